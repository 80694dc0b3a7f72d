"""A chain of pieces, joined without a stop where speeds allow, sampled on a grid into set points.

    speed                                            a piece: its length in units of path, how far each axis goes
      |      ______            ____                  on it, the greatest speed on it, its acceleration, and the
      |     /      \\__________/    \\                 greatest speed at which it may be entered from the one before
      |    /    :      :      :     \\
      +---+-----:------:------:------+----- path
            1       2      3      4                  set points: one a period, rounded to whole increments

Look-ahead. v_j is the speed at the joint in front of piece j, A_j the mean acceleration on it, L_j its length. From the
end, at which the chain stands, backwards, then from the beginning forwards:

    F_j = min(scale speed_j, limit_j, ceiling)
    v_j <= min(entry_j, F_j-1, F_j),    v_j^2 <= v_j+1^2 + 2 A_j L_j,    v_j+1^2 <= v_j^2 + 2 A_j L_j

Each piece rises to its peak min(F, sqrt((2 A L + v_j^2 + v_j+1^2) / 2)), cruises, falls. A ramp from v0 to v1 in time
t_r = |v1 - v0| / A takes the path (v0 + v1) t_r / 2 and is one of

    linear   s(t) = v0 t + (v1 - v0) t^2 / (2 t_r)                         A = the acceleration of the piece
    sin^2    s(t) = v0 t + (v1 - v0) (t/2 - t_r/(2 pi) sin(pi t / t_r))    A = 2/pi of it: its steepest slope is that

Set point k of axis i is the beginning of its piece + round(n_i s(k period) / L), ties to even; the last one is the end.

A plan is a value. `replanned` gives another one that has the same set points up to tick k and goes on from the
momentary place and speed: with more pieces, another scale or ceiling, a hold. It is described, not stored: some 200
bytes a piece, whatever the piece takes. A piece more at the end costs the pieces within the braking distance.

Definitions and closed forms are in docs/set_points.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.path import Displacement

__all__ = ["Curve", "Joined", "Pieces", "chain", "joined", "piece"]


class Curve(Protocol):
    """A piece that is not straight."""

    def displacement(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [n, axes], increments from the beginning of the piece at these places of it, float64 [n] in units of
        path; zeros at 0, the displacement of the piece at its length."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """n pieces as columns; made by `piece`, `chain`, or at once from arrays.

    displacement: float64 [n, axes], increments, whole multiples of 2^-16 below 2^31: whole numbers as a rule, so that
    sums are exact. The others float64 [n]: length in units of path, positive; speed in units per second, wanted, times
    the scale of the plan; limit, never exceeded whatever the scale; acceleration in units per second^2; entry, greatest
    speed at the joint with the piece before. curves: numbers of the pieces that are not straight, with their curves.

    Raises ValueError for shapes that do not agree, numbers that are not as said, or a speed, limit or acceleration that
    is not positive. An empty chain is allowed.
    """

    displacement: NDArray[np.float64]
    length: NDArray[np.float64]
    speed: NDArray[np.float64]
    limit: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    entry: NDArray[np.float64]
    curves: tuple[tuple[int, Curve], ...] = ()

    @property
    def axes(self) -> int:
        """Number of axes."""
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
    """One piece; see `Pieces`."""
    raise NotImplementedError


def chain(parts: Sequence[Pieces]) -> Pieces:
    """Several, one after the other. Raises ValueError for none, or different numbers of axes."""
    raise NotImplementedError


def joined(
    pieces: Pieces,
    period_ns: int,
    *,
    sine: bool = False,
    scale: float = 1.0,
    ceiling: float = math.inf,
    identity: object = 0,
) -> Joined:
    """The plan that makes these pieces from standstill at tick 0 to standstill at the end.

    period_ns: time from tick to tick. sine: ramps are sin^2, else linear. scale: factor of the wanted speeds, an
    override; 0 holds. ceiling: speed that no piece exceeds. identity: see `isel_twin.motion.SetPoints`; a controller
    counts its motions. Raises ValueError for a period, scale or ceiling that is not allowed.
    """
    raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Joined:
    """Made by `joined`; follows `isel_twin.motion.SetPoints`. Immutable; see the module."""

    axes: int
    period_ns: int
    sine: bool
    scale: float
    ceiling: float
    identity: object
    held: bool
    """It brakes, or stands, though pieces may be left."""
    dropped: bool
    """What it had not begun when it was stopped is forgotten; nothing can be appended."""
    ticks: int
    """Number of set points: after the last one it stands, at the end of the chain or where it is held."""
    pieces: int
    """Number of pieces: those that were made, that are being made and that are waiting."""

    @property
    def duration_s(self) -> float:
        """Time at which it stands, from tick 0; at or before the last tick."""
        raise NotImplementedError

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        """See `SetPoints.deltas`."""
        raise NotImplementedError

    def displacement(self, k: int) -> Displacement:
        """See `SetPoints.displacement`; costs the logarithm of the number of pieces. Beyond the last tick: the end."""
        raise NotImplementedError

    def speed(self, k: int) -> float:
        """Path speed at tick k, units per second; 0 at and after the last one."""
        raise NotImplementedError

    def finished(self, k: int) -> int:
        """Number of pieces whose end has been reached or passed at tick k."""
        raise NotImplementedError

    def passed(self, j: int) -> int:
        """The first tick at which `finished` is j or more, as planned now; j = 1 .. pieces. 0 for j = 0.

        Raises IndexError if it will not get there: for another number, or beyond the place where it is held.
        """
        raise NotImplementedError

    def stopped(self, k: int) -> Joined:
        """The same up to tick k, then down to standstill along the path; what is left is forgotten."""
        return self.replanned(k, hold=True, drop=True)

    def replanned(
        self,
        k: int,
        *,
        append: Pieces | None = None,
        drop: bool = False,
        scale: float | None = None,
        ceiling: float | None = None,
        hold: bool | None = None,
        sharpness: float = 1.0,
    ) -> Joined:
        """The same up to tick k, then otherwise; what is not said stays. k may lie beyond the last tick: it stood.

        drop: forget the pieces that have not begun (and, with hold, the rest of the one that has). append: pieces at
        the end, after what was dropped. scale, ceiling: see `joined`; speeds above them fall as the ramps allow, joints
        keep their entry speeds. hold: True brakes along the path and stands, with what is left waiting; False goes on.
        sharpness: factor of the accelerations of the pieces while it brakes for a hold.

        A ramp under way goes on unchanged if the new plan has the same; otherwise a new one begins at the momentary
        speed. A falling sin^2 ramp without which a joint would be passed too fast is finished first.

        Raises ValueError for a negative k, pieces with another number of axes, or what is appended to a plan that was
        dropped and held.
        """
        raise NotImplementedError

    def remainder(self, identity: object = 0) -> Joined:
        """What is left of a plan that is held, from where it stands (its last tick), as a motion of its own, not held.

        For a controller that ends the motion when it stands and begins another one when it goes on. Set points fall on
        the same whole numbers: they are rounded from where the pieces began.
        """
        raise NotImplementedError
