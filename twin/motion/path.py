"""Which axes step at which tick: straight lines, circles and helices.

A path is a rule, not a list: any stretch of it can be asked for, in any order, and costs only its own length (on a
circle plus at most one checkpoint interval). Ticks are packed into one byte, two bits an axis, X in the lowest.

    line     axis i with n_i steps has made floor((2 k n_i + N) / (2 N)) of them after tick k, N = max |n_i|
    circle   every tick is one step of one of the two axes (module `circle`)
    helix    a circle of B ticks; the third axis follows by the rule of the line with N = B
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["Displacement", "Line", "Path", "decode", "encode", "even", "fill_even", "line"]

AXES = 4

Displacement = tuple[int, int, int, int]
"""Steps of X, Y, Z, A."""


class Path(Protocol):
    """What a `Run` asks of a path. Immutable; a controller may bring its own."""

    @property
    def ticks(self) -> int:
        """Number of ticks of the whole path."""

    def codes(self, first: int, last: int) -> NDArray[np.uint8]:
        """uint8 [last - first], packed steps of ticks first + 1 .. last. IndexError if the path has fewer."""

    def displacement(self, k: int) -> Displacement:
        """Steps made by each axis after k ticks, 0 <= k <= ticks."""


# ---- packing -------------------------------------------------------------------------------------------------------


def encode(delta: NDArray[np.int8]) -> NDArray[np.uint8]:
    """Pack steps int8 [n, 4] of -1, 0, +1 into uint8 [n]: 0 none, 1 plus, 3 minus (two's complement), X in bits 0-1."""
    code = np.zeros(len(delta), dtype=np.uint8)
    for axis in range(AXES):
        code |= (delta[:, axis].astype(np.uint8) & 3) << (2 * axis)
    return code


def decode(code: NDArray[np.uint8]) -> NDArray[np.int8]:
    """Unpack uint8 [n] into steps int8 [n, 4]; the inverse of `encode`."""
    return _DECODED[code]


_DECODED = np.array([[(0, 1, 0, -1)[code >> 2 * axis & 3] for axis in range(AXES)] for code in range(256)], np.int8)


def step_code(axis: int, direction: int) -> int:
    """Code of one step of one axis (0 X .. 3 A), direction +1 or -1."""
    return (direction & 3) << 2 * axis


# ---- lines ---------------------------------------------------------------------------------------------------------


def line(steps: Sequence[int]) -> Line:
    """A straight line of the given signed steps of X, Y, Z, A; as many ticks as the leading axis has steps.

    Raises ValueError unless there are exactly four numbers below 2^40.
    """
    if len(steps) != AXES or any(abs(n) >= 1 << 40 for n in steps):
        raise ValueError(f"a line needs four step numbers below 2^40, got {tuple(steps)}")
    x, y, z, a = (int(n) for n in steps)
    return Line((x, y, z, a))


@dataclass(frozen=True, slots=True)
class Line:
    """Made by `line`."""

    steps: Displacement

    @property
    def ticks(self) -> int:
        return max(abs(n) for n in self.steps)

    def codes(self, first: int, last: int) -> NDArray[np.uint8]:
        check_range(first, last, self.ticks)
        code = np.zeros(last - first, dtype=np.uint8)
        for axis, n in enumerate(self.steps):
            fill_even(code, first, n, self.ticks, axis)
        return code

    def displacement(self, k: int) -> Displacement:
        check_range(0, k, self.ticks)
        x, y, z, a = (even(k, n, self.ticks) for n in self.steps)
        return x, y, z, a


def check_range(first: int, last: int, ticks: int) -> None:
    """Raise IndexError unless ticks first + 1 .. last exist."""
    if not 0 <= first <= last <= ticks:
        raise IndexError(f"ticks {first}..{last} of a path of {ticks}")


def even(k: int, n: int, ticks: int) -> int:
    """Steps that an axis with n steps in all, evenly spread over `ticks` ticks, has made after tick k."""
    if n < 0:
        return -even(k, -n, ticks)
    return (2 * k * n + ticks) // (2 * ticks) if n else 0


def fill_even(code: NDArray[np.uint8], first: int, n: int, ticks: int, axis: int) -> None:
    """Add to code[i] the step of this axis at tick first + 1 + i, by the rule of `even`; |n| <= ticks."""
    if n == 0:
        return
    step = np.uint8(step_code(axis, 1 if n > 0 else -1))
    if abs(n) == ticks:  # the leading axis
        code |= step
    else:
        _fill_even(code, (2 * first * abs(n) + ticks) % (2 * ticks), 2 * abs(n), 2 * ticks, step)


@njit(cache=True, nogil=True)
def _fill_even(code, rest, add, modulus, step):  # type: ignore[no-untyped-def]
    """A step falls where the running sum rest + add + add + ... passes a multiple of the modulus."""
    for i in range(code.size):
        rest += add
        if rest >= modulus:
            rest -= modulus
            code[i] |= step
