"""A chain of pieces, joined without a stop where speeds allow, sampled on a grid into set points.

    speed                                            a piece: its length in units of path, how far each axis goes
      |      ______            ____                  on it, the highest speed on it, its acceleration, and the
      |     /      \\__________/    \\                 highest speed at which it may be entered from the one before
      |    /    :      :      :     \\
      +---+-----:------:------:------+----- path
            1       2      3      4                  set points: one a period, rounded to whole increments

Look-ahead. v_j is the speed at the joint before piece j, A_j the mean acceleration on it, L_j its length. First from
the end, where the speed is 0, backwards, then from the beginning forwards:

    F_j = min(scale speed_j, limit_j, ceiling)
    v_j <= min(entry_j, F_j-1, F_j),    v_j^2 <= v_j+1^2 + 2 A_j L_j,    v_j+1^2 <= v_j^2 + 2 A_j L_j

Each piece rises to its peak min(F, sqrt((2 A L + v_j^2 + v_j+1^2) / 2)), cruises, falls. A ramp from v0 to v1 in time
t_r = |v1 - v0| / A takes the path (v0 + v1) t_r / 2 and is one of

    linear   s(t) = v0 t + (v1 - v0) t^2 / (2 t_r)                         A = the acceleration of the piece
    sin^2    s(t) = v0 t + (v1 - v0) (t/2 - t_r/(2 pi) sin(pi t / t_r))    A = 2/pi of it: it is the peak of the ramp

Set point k of axis i is the beginning of its piece + round(n_i s(k period) / L), ties to even; the last one is the end.

Plans are immutable. `replanned` gives one that has the same set points up to tick k and goes on from the place and
speed there: with more pieces, another scale or ceiling, a hold. A plan takes some 200 bytes a piece, however long the
piece. Appending a piece replans only the pieces within the braking distance. More in docs/set_points.md.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import SECOND_NS
from isel_twin.motion.blocks import PlanBlock, State, block_at, block_positions, long_enough, opened
from isel_twin.motion.look_ahead import DT, LENGTH, PLAN_PHASE, S0, S1, V0, T, in_c
from isel_twin.motion.path import Displacement, check_range
from isel_twin.motion.pieces import Pieces
from isel_twin.motion.planning import Ramps, now
from isel_twin.native import core

# periods by which an end may miss a tick and still count as on it: nanoseconds at standstill (motion/12)
GRID_NOISE = 1e-6


def joined(
    pieces: Pieces,
    period_ns: int,
    *,
    sine: bool = False,
    scale: float = 1.0,
    ceiling: float = math.inf,
    identity: object = 0,
) -> Joined:
    """The plan of these pieces, from standstill at tick 0 to standstill at the end.

    period_ns: time from tick to tick. sine: ramps are sin^2, else linear. scale: factor of the wanted speeds, an
    override; 0 holds. ceiling: speed that no piece exceeds. identity: of `isel_twin.motion.SetPoints`; a controller
    numbers its motions. Raises ValueError for a period, scale or ceiling that is not allowed.
    """
    if period_ns <= 0:
        raise ValueError(f"the period of set points must be positive, got {period_ns} ns")
    numbers = np.empty(0, dtype=np.int32), np.empty(0, dtype=np.int8)
    block = PlanBlock(0, np.empty((0, 6)), *numbers, np.zeros((1, pieces.axes)), np.empty((0, 5)), (), 0)
    empty = Joined(pieces.axes, period_ns, sine, 1.0, math.inf, identity, False, False, 0, (block,))
    return empty.replanned(0, append=pieces, scale=scale, ceiling=ceiling)


@dataclass(frozen=True, eq=False)
class Joined:
    """Made by `joined`; implements `isel_twin.motion.SetPoints`."""

    axes: int
    period_ns: int
    sine: bool
    scale: float
    ceiling: float
    identity: object
    hold: bool
    dropped: bool  # it was stopped: the remaining pieces are dropped, and none can be appended
    ticks: int  # number of set points; the last one is at the end of the chain or where it is held
    blocks: tuple[PlanBlock, ...]
    forgotten: int = 0  # ticks at the beginning whose set points are no longer known (`forgetting`)

    @property
    def held(self) -> bool:
        """It brakes or stands, perhaps with pieces left, by a hold or a scale of 0."""
        return self.hold or self.scale <= 0

    @property
    def pieces(self) -> int:
        """Number of pieces, made, being made or waiting."""
        return self.blocks[-1].first + len(self.blocks[-1].table)

    @property
    def duration_s(self) -> float:
        """Time from tick 0 to standstill; at most a millionth of a period after the last tick."""
        return self.blocks[-1].end_s

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        check_range(first, last, self.ticks)
        self._check_known(first)
        return np.diff(block_positions(self.blocks, self.period_s, self.sine, first, last), axis=0).astype(np.int32)

    def displacement(self, k: int) -> Displacement:
        """Takes logarithmic time. Beyond the last tick: the end."""
        self._check_known(k)
        return tuple(block_positions(self.blocks, self.period_s, self.sine, k, k)[0].tolist())

    def speed(self, k: int) -> float:
        """Path speed at tick k, units per second; 0 at and after the last one."""
        return self._state(k)[1].v

    def finished(self, k: int) -> int:
        """Number of pieces that are complete at tick k."""
        t_s = self._end_s(k)
        block = self.blocks[block_at(self.blocks, t_s)]
        row = block.row(t_s)
        if row < 0:
            return block.first
        at = int(block.piece[row])
        ended = t_s - block.phases[row, T] >= block.phases[row, DT] and block.phases[row, S1] == block.table[at, LENGTH]
        return block.first + at + int(ended)

    def passed(self, j: int) -> int:
        """The first tick at which `finished` is j or more, as planned now; j = 0 .. pieces.

        Raises IndexError for another number, a piece beyond the place where it is held, and for what is forgotten.
        """
        if j == 0 and not self.forgotten:
            return 0
        if j <= self.blocks[0].first or j > self.pieces:
            raise IndexError(f"piece {j} of {self.blocks[0].first + 1} .. {self.pieces}")
        block = self.blocks[bisect_right(self.blocks, j - 1, key=lambda block: block.first) - 1]
        at = j - 1 - block.first
        row = int(block.piece.searchsorted(at, side="right")) - 1
        if row < 0 or block.piece[row] != at or block.phases[row, S1] != block.table[at, LENGTH]:
            raise IndexError(f"piece {j} of {self.pieces} is not reached as planned now")
        k = math.ceil(float(block.phases[row, T] + block.phases[row, DT]) / self.period_s - GRID_NOISE)
        while self.finished(k) < j:
            k += 1
        while k > self.forgotten and self.finished(k - 1) >= j:
            k -= 1
        return k

    @property
    def known_pieces(self) -> int:
        """Number of pieces that are not forgotten."""
        return self.pieces - self.blocks[0].first

    def forgetting(self, k: int) -> Joined:
        """The plan without what was before tick k, so that the memory of an endless motion stays bounded; numbers and
        displacements stay. Raises IndexError for a tick that is already forgotten."""
        self._check_known(k)
        k = min(k, self.ticks)
        kept = self.blocks[block_at(self.blocks, k * self.period_s) :]
        return replace(self, blocks=kept, forgotten=k)

    def stopped(self, k: int) -> Joined:
        """The same up to tick k, then braking along the path to standstill; the rest is dropped."""
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
        wanted: tuple[int, float] | None = None,
    ) -> Joined:
        """The same up to tick k, which may lie beyond the last one, then with what is changed here.

        drop: remove the pieces that have not begun, except those it needs to stop; with hold, all that is left. append:
        pieces at the end, after what was dropped. scale, ceiling: see `joined`; speeds above them fall as the ramps
        allow, joints keep their entry speeds. hold: True brakes along the path and stands, False goes on. sharpness:
        factor of the accelerations while it brakes for a hold. wanted: number of pieces, and their new wanted speed.

        A ramp under way goes on unchanged if the new plan has the same; otherwise a new one begins at the momentary
        speed. A falling sin^2 ramp without which a joint would be passed too fast is finished first.

        Raises ValueError for a negative k, numbers that are not allowed, pieces with another number of axes, or pieces
        for a plan that was dropped while held.
        """
        new = self._changed(k, scale, ceiling, hold, sharpness, wanted)
        if append is not None and self.dropped:
            raise ValueError("what was dropped takes no more")
        if append is not None and append.axes != self.axes:
            raise ValueError(f"{append.axes} axes, not {self.axes}")
        if self.dropped:
            return self
        same = (new.scale, new.ceiling, new.hold) == (self.scale, self.ceiling, self.hold)
        same = same and wanted is None and not drop and (sharpness == 1 or not new.held)
        if same and (append is None or not len(append)):
            return self
        number, state = self._state(k)
        if same and append is not None and (longer := self._lengthened(number, state, append, k)) is not None:
            return longer
        before, tail, state = opened(self.blocks, number, state)
        if wanted is not None:
            tail = tail.with_speed(state.piece, wanted[0] - tail.first, wanted[1])
        if drop:
            tail, state = new.ramps.without_rest(tail, state)
        if append is not None:
            tail = tail.with_pieces(append)
        if drop and new.held:
            new = replace(new, dropped=True)
        if not (self.held and new.held) or (sharpness != 1 and state.v > 0):
            laid = new.ramps.braked(tail, state, sharpness) if new.held else new.ramps.laid(tail, state)
            tail = tail.with_phases(*laid)
        if not len(tail.phases) and len(tail.table):  # stands where it is, which may be in the middle of a piece
            tail = tail.standing(state.piece, state.s, state.t_s if before or self.forgotten else 0.0)
        return new._with(before, tail, k)

    def _changed(
        self,
        k: int,
        scale: float | None,
        ceiling: float | None,
        hold: bool | None,
        sharpness: float,
        wanted: tuple[int, float] | None,
    ) -> Joined:
        """The plan with other settings but its old phases. Raises ValueError like `replanned`."""
        given = {"scale": scale, "ceiling": ceiling, "hold": hold}
        changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        new = replace(self, **changes) if changes else self
        sound = 0 <= new.scale < math.inf and new.ceiling > 0 and 0 < sharpness < math.inf
        if k < 0 or not sound or (wanted is not None and not 0 < wanted[1] < math.inf):
            raise ValueError(f"no plan at tick {k} for scale {new.scale}, ceiling {new.ceiling}, sharpness {sharpness}")
        return new

    def _lengthened(self, number: int, state: State, append: Pieces, k: int) -> Joined | None:
        """With more pieces, planned from the last joint that keeps its speed; None if that joint is passed or the plan
        held."""
        tail = self.blocks[-1]
        row = int(tail.piece.searchsorted(tail.settled))
        if self.held or row >= len(tail.phases) or (number == len(self.blocks) - 1 and state.row >= row):
            return None
        grown, at = tail.with_pieces(append), tail.phases[row]
        law = self.ramps.lay(grown, tail.settled, float(at[T]), float(at[S0]), float(at[V0]))
        return self._with(self.blocks[:-1], grown.with_phases(row, tail.settled, law), k)

    def remainder(self, identity: object = 0, *, scale: float | None = None) -> Joined:
        """The rest of a held plan, from its last tick on, as a motion of its own: for a controller that begins another
        motion when it goes on. Its set points are the same whole numbers: rounding counts from where the pieces
        began."""
        here = np.array(self.displacement(self.ticks), dtype=np.float64)
        tail = self.blocks[-1]
        _, first, s = now(tail, self._state(self.ticks)[1])
        rows = int(first < len(tail.table))
        rest = replace(
            tail,
            first=0,
            phases=np.array([[0.0, 0.0, s, s, 0.0, 0.0]])[:rows],
            piece=np.zeros(rows, dtype=np.int32),
            back=np.zeros(rows, dtype=np.int8),
            corner=tail.corner[first:] - here,
            table=tail.table[first:],
            curves=tuple((j - first, curve) for j, curve in tail.curves if j >= first),
            settled=0,
        )
        standing = replace(self, identity=identity, hold=True, dropped=False, ticks=0, blocks=(rest,), forgotten=0)
        return standing.replanned(0, hold=False, scale=scale)

    def _check_known(self, k: int) -> None:
        if k < self.forgotten:
            raise IndexError(f"set point {k}" + f": those before {self.forgotten} are forgotten" * (k >= 0))

    @property
    def period_s(self) -> float:
        return self.period_ns / SECOND_NS

    @property
    def ramps(self) -> Ramps:
        return Ramps(self.sine, self.scale, self.ceiling)

    def _end_s(self, k: int) -> float:
        """Time until which an end counts as reached at tick k."""
        return (k + GRID_NOISE) * self.period_s

    def _state(self, k: int) -> tuple[int, State]:
        """Number of the block at tick k, and the place in it."""
        t_s = k * self.period_s
        if k >= self.ticks:
            number, block = len(self.blocks) - 1, self.blocks[-1]
            row = len(block.phases) - 1
            piece, s = (int(block.piece[row]), float(block.phases[row, S1])) if row >= 0 else (0, 0.0)
            return number, State(row, piece, s, 0.0, t_s, True)
        number = block_at(self.blocks, t_s)
        block = self.blocks[number]
        at = np.empty(2)
        row = core.plan_state(t_s, in_c(block.phases, PLAN_PHASE), self.sine, at)
        s, v = at.tolist()
        return number, State(row, int(block.piece[row]) if row >= 0 else 0, s, v, t_s, row < 0)

    def _with(self, before: tuple[PlanBlock, ...], tail: PlanBlock, k: int) -> Joined:
        """The plan with these blocks, the last one split where nothing will change any more."""
        row = int(tail.piece.searchsorted(tail.settled))
        if not self.held and long_enough(row) and row < len(tail.piece) and tail.piece[row] == tail.settled:
            past, tail = tail.split(row)
            before = (*before, past)
        ticks = math.ceil(tail.end_s / self.period_s - GRID_NOISE)
        return replace(self, blocks=(*before, tail), ticks=max(ticks, min(k, self.ticks), 0))
