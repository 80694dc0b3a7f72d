"""`mj_step` for the compiled core: called by its address, so that the core needs nothing of MuJoCo to be built.

mj_step_address() -> int                     of the library that the mujoco package has loaded
time_step_address(model) -> int              of the number in an mjModel
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

import mujoco

_LIBRARIES = ("libmujoco.so*", "libmujoco*.dylib", "mujoco*.dll")  # on Linux, macOS and Windows


def library(folder: Path) -> Path:
    """The library in the folder of the mujoco package. Raises FileNotFoundError if there is none."""
    for pattern in _LIBRARIES:
        for path in sorted(folder.glob(pattern)):
            return path
    raise FileNotFoundError(f"{folder}: no library of MuJoCo here ({', '.join(_LIBRARIES)})")


_WORDS = 256  # of an mjModel, among which its options stand


def time_step_address(model: mujoco.MjModel) -> int:
    """Address of `model.opt.timestep`: the word that follows it. Raises RuntimeError if none or several do."""
    words, kept = (ctypes.c_double * _WORDS).from_address(model._address), model.opt.timestep
    found = set(range(_WORDS))
    for step_s in (0.75 * kept, 1.25 * kept, kept):
        model.opt.timestep = step_s
        found = {word for word in found if words[word] == step_s}
    if len(found) != 1:
        raise RuntimeError("the time step is not where MuJoCo 4 has it; take a version that is allowed")
    return int(model._address + 8 * found.pop())


@cache
def mj_step_address() -> int:
    found = library(Path(mujoco.__file__).parent)
    return ctypes.cast(ctypes.CDLL(str(found)).mj_step, ctypes.c_void_p).value or 0
