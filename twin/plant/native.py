"""`mj_step` for compiled code: called by its address, an integer, so that the code can be cached.

mj_step_address() -> int                     of the library that the mujoco package has loaded
call_mj_step(address, model, data)           in compiled code; model, data: addresses of mjModel and mjData
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

import mujoco
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_LIBRARIES = ("libmujoco.so*", "libmujoco*.dylib", "mujoco*.dll")  # on Linux, macOS and Windows


@intrinsic
def call_mj_step(typingctx, address, model, data):
    def build(context, builder, signature, arguments):
        word = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [word, word])
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), build


def library(folder: Path) -> Path:
    """The library in the folder of the mujoco package. Raises FileNotFoundError if there is none."""
    for pattern in _LIBRARIES:
        for path in sorted(folder.glob(pattern)):
            return path
    raise FileNotFoundError(f"{folder}: no library of MuJoCo here ({', '.join(_LIBRARIES)})")


@cache
def mj_step_address() -> int:
    found = library(Path(mujoco.__file__).parent)
    return ctypes.cast(ctypes.CDLL(str(found)).mj_step, ctypes.c_void_p).value or 0
