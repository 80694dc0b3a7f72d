"""Pieces of a path as columns: the chain that `joined` plans."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.motion.look_ahead import FAULTS
from isel_twin.native import core


class Curve(Protocol):
    """A piece that is not straight."""

    def displacement(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [n, axes], increments from the beginning of the piece at places s, float64 [n] in units of path;
        zeros at 0, the displacement of the piece at its length."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """n pieces as columns; made by `piece`, `chain`, or at once from arrays.

    displacement: float64 [n, axes], increments, whole multiples of 2^-16 below 2^31: whole numbers as a rule, so that
    sums are exact. The others float64 [n]: length in units of path, positive; speed in units per second, which the
    scale of the plan multiplies; limit, never exceeded whatever the scale; acceleration in units per second^2; entry,
    highest speed at the joint with the piece before. curves: numbers of the pieces that are not straight, with their
    curves.

    Raises ValueError for shapes that do not agree, other displacements, or a length, speed, limit or acceleration that
    is not positive. An empty chain is allowed.
    """

    displacement: NDArray[np.float64]
    length: NDArray[np.float64]
    speed: NDArray[np.float64]
    limit: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    entry: NDArray[np.float64]
    curves: tuple[tuple[int, Curve], ...] = ()

    def __post_init__(self) -> None:
        if self.displacement.ndim != 2 or not 1 <= self.displacement.shape[1] <= len(AXIS_NAMES):
            raise ValueError(f"displacements are a table of 1 to {len(AXIS_NAMES)} axes, not {self.displacement.shape}")
        if any(column.shape != (len(self.displacement),) for column in self.columns[1:]):
            raise ValueError(f"columns of pieces must all have {len(self.displacement)} rows")
        fault = core.faults(*(np.ascontiguousarray(column, dtype=np.float64) for column in self.columns))
        if fault:
            raise ValueError(FAULTS[fault])

    @property
    def columns(self) -> tuple[NDArray[np.float64], ...]:
        """displacement, length, speed, limit, acceleration, entry."""
        return self.displacement, self.length, self.speed, self.limit, self.acceleration, self.entry

    @property
    def axes(self) -> int:
        return int(self.displacement.shape[1])

    def __len__(self) -> int:
        return len(self.length)


def piece(
    displacement: Sequence[float],
    length: float,
    speed: float,
    acceleration: float,
    limit: float = math.inf,
    entry: float = math.inf,
    curve: Curve | None = None,
) -> Pieces:
    columns = ([values] for values in (displacement, length, speed, limit, acceleration, entry))
    curves = () if curve is None else ((0, curve),)
    return _pieces((np.array(column, dtype=np.float64) for column in columns), curves)


def chain(parts: Sequence[Pieces]) -> Pieces:
    """Several chains as one. Raises ValueError for none, or different numbers of axes."""
    if len({part.axes for part in parts}) != 1:
        raise ValueError(f"a chain needs parts of the same axes, got {[part.axes for part in parts]}")
    if len(parts) == 1:
        return parts[0]
    curves, done = [], 0
    for part in parts:
        curves += [(done + j, curve) for j, curve in part.curves]
        done += len(part)
    columns = zip(*(part.columns for part in parts), strict=True)
    return _pieces(map(np.concatenate, columns), tuple(curves))


def _pieces(columns: Iterable[NDArray[np.float64]], curves: tuple[tuple[int, Curve], ...]) -> Pieces:
    displacement, length, speed, limit, acceleration, entry = columns
    return Pieces(displacement, length, speed, limit, acceleration, entry, curves)


def table(pieces: Pieces) -> NDArray[np.float64]:
    """float64 [n, 5], the columns that `look_ahead` names."""
    return np.column_stack(pieces.columns[1:])
