"""Two builds of the physics in lockstep: a log of every array of the loop after every call of it, and where two differ.

    python -m tests.lockstep FILE [SESSION ...]      play golden sessions, all with physics by default; write the log
    python -m tests.lockstep --compare FILE FILE     the first call after which a part differs; exit code 0 if none does
    LOCKSTEP=FILE python -m pytest -n 0 -p tests.lockstep --hypothesis-seed 1 tests/plant     the log of tests

A line a call: number of the call, which one, sub-steps since power-on, and a checksum of each part that the first line
names. `#` begins the session or test. So one build writes a log, the other another, and the first line that differs is
where to look. Values of a call go to a file: LOCKSTEP_AT=NUMBER LOCKSTEP_VALUES=FILE.npz

It sees what the plant has in Python (`MujocoPlant.parts`), whatever the loop is written in; loops of others that
advance a plant by its memory (envs) are not seen, nor is what other threads do, which has no order.
"""

from __future__ import annotations

import itertools
import os
import sys
import threading
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin.plant.mujoco import MujocoPlant

WATCHED = ("_start", "advance", "watch_margin", "set_cut")
"""Methods of the plant after which the parts are logged; what others change is seen after the next advance."""
ADDRESSES = ("step_at", "mj_step", "model", "data")
"""Fields of the part `plant` that differ from process to process."""


def values(plant: MujocoPlant) -> dict[str, NDArray[Any]]:
    """All parts of a plant by name, without addresses; of the samples those that wait to be read."""
    parts = plant.parts._asdict()
    parts["plant"] = parts["plant"].copy()
    for name in ADDRESSES:
        parts["plant"][name] = 0
    parts["samples"] = parts["samples"][: int(parts["plant"]["sampled"][0])]
    return parts


class Log:
    """Writes a line for each call."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._number = 0
        self._names: tuple[str, ...] = ()
        self._at = int(os.environ.get("LOCKSTEP_AT", "0"))

    def mark(self, text: str) -> None:
        """What the calls that follow belong to."""
        print("#", text, file=self._file)

    def called(self, plant: MujocoPlant, name: str) -> None:
        """A call of this name has ended."""
        parts = values(plant)
        if self._names != tuple(parts):
            self._names = tuple(parts)
            print("parts", *self._names, file=self._file)
        self._number += 1
        sums = (f"{zlib.crc32(array.tobytes()):08x}" for array in parts.values())
        print(self._number, name, int(parts["plant"]["now"][0]), *sums, file=self._file)
        if self._number == self._at:
            np.savez(os.environ["LOCKSTEP_VALUES"], **parts)


def _logged(method: Callable[..., Any], log: Log) -> Callable[..., Any]:
    def call(plant: MujocoPlant, *arguments: Any, **keywords: Any) -> Any:
        try:
            return method(plant, *arguments, **keywords)
        finally:
            if hasattr(plant, "parts") and threading.current_thread() is threading.main_thread():
                log.called(plant, method.__name__)

    return call


@contextmanager
def logging(path: Path) -> Iterator[Log]:
    """Log all calls of all plants to a file meanwhile."""
    with path.open("w", encoding="utf-8") as file, pytest.MonkeyPatch.context() as patch:
        log = Log(file)
        for name in WATCHED:
            patch.setattr(MujocoPlant, name, _logged(getattr(MujocoPlant, name), log))
        yield log


def play_golden(path: Path, wanted: Sequence[str] = ()) -> None:
    """Write the log of these golden sessions, of all with physics by default."""
    sys.path.insert(0, str(Path(__file__).resolve().parent))
    from golden.session import digest_of
    from golden.sessions import names, session

    with logging(path) as log:
        for name in wanted or names("mujoco"):
            log.mark(name)
            log.mark(f"digest {digest_of(session(name))}")


def compare(first: Path, second: Path) -> str | None:
    """The first difference of two logs, in words; None if they are equal and there are calls in them. Parts that one
    build alone has are left out."""
    logs = [path.read_text(encoding="utf-8").splitlines() for path in (first, second)]
    for path, lines in zip((first, second), logs, strict=True):
        if not any(line[:1].isdigit() for line in lines):
            return f"{path}: no call is logged"
    names: list[list[str]] = [[], []]
    within = ""
    for number, lines in enumerate(itertools.zip_longest(*logs), 1):
        if None in lines:
            return f"line {number}: {(first, second)[lines.index(None)]} ends here, within {within}"
        one, other = lines
        if one.startswith("parts ") and other.startswith("parts "):
            names = [["number", "call", "sub-step", *line.split()[1:]] for line in lines]
            if not set(names[0][3:]) & set(names[1][3:]):
                return f"line {number}: no part in common"
        elif one[:1].isdigit() and other[:1].isdigit():
            left, right = (dict(zip(*each, strict=True)) for each in zip(names, map(str.split, lines), strict=True))
            if differ := [name for name in left if name in right and left[name] != right[name]]:
                return f"line {number}, within {within}: {', '.join(differ)}\n< {one}\n> {other}"
        elif one != other:
            return f"line {number}, within {within}:\n< {one}\n> {other}"
        elif one.startswith("# "):
            within = one[2:]
    return None


# Hooks of pytest, for `-p tests.lockstep`

_LOGS = pytest.StashKey[Log]()


def pytest_configure(config: pytest.Config) -> None:
    if "LOCKSTEP" not in os.environ:
        raise pytest.UsageError("tests.lockstep writes a log: set LOCKSTEP=FILE")
    stack = ExitStack()
    config.stash[_LOGS] = stack.enter_context(logging(Path(os.environ["LOCKSTEP"])))
    config.add_cleanup(stack.close)


def pytest_runtest_setup(item: pytest.Item) -> None:
    item.config.stash[_LOGS].mark(item.nodeid)


def main(arguments: Sequence[str]) -> int:
    if len(arguments) == 3 and arguments[0] == "--compare":
        difference = compare(Path(arguments[1]), Path(arguments[2]))
        print(difference or "no difference")
        return 1 if difference else 0
    if not arguments or arguments[0].startswith("-"):
        print(__doc__, file=sys.stderr)
        return 2
    play_golden(Path(arguments[0]), arguments[1:])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
