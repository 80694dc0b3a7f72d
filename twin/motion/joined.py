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
from bisect import bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.units import SECOND_NS
from isel_twin.motion.blocks import Block, Law, State
from isel_twin.motion.look_ahead import (
    DT,
    LENGTH,
    LIMIT,
    S0,
    S1,
    SPEED,
    V0,
    V1,
    T,
    brake,
    lay,
    places,
    positions,
    speed_at,
)
from isel_twin.motion.path import Displacement, check_range
from isel_twin.motion.pieces import Pieces

BLOCK = 512
"""Phases in a block of a plan, at least: more are copied less often, fewer are copied sooner."""

GRID_NOISE = 1e-6
"""Periods by which an end may miss a tick and fall on it: some nanoseconds, in which nothing moves at an end."""


class Stretch(NamedTuple):
    """Phases of a plan one after the other, and the straight pieces they lead along; see `Joined.since`, `written`."""

    first: int
    """Number of the first piece."""
    ticks: int
    """Of the whole plan."""
    phases: NDArray[np.float64]
    """float64 [n, 6]: time of the beginning and duration in s, place from and to, speed from and to."""
    piece: NDArray[np.int32]
    """int32 [n]: number of the piece of each phase, from the first one on."""
    corner: NDArray[np.float64]
    """float64 [pieces + 1, axes]: where pieces begin and the last one ends, in increments."""
    length: NDArray[np.float64]
    """float64 [pieces]."""


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
    if period_ns <= 0:
        raise ValueError(f"the period of set points must be positive, got {period_ns} ns")
    block = Block(
        0,
        np.empty((0, 6)),
        np.empty(0, dtype=np.int32),
        np.empty(0, dtype=np.int8),
        np.zeros((1, pieces.axes)),
        np.empty((0, 5)),
        (),
        0,
    )
    empty = Joined(pieces.axes, period_ns, sine, 1.0, math.inf, identity, False, False, 0, (block,))
    return empty.replanned(0, append=pieces, scale=scale, ceiling=ceiling)


@dataclass(frozen=True, eq=False)
class Joined:
    """Made by `joined`; follows `isel_twin.motion.SetPoints`. Immutable; see the module."""

    axes: int
    period_ns: int
    sine: bool
    scale: float
    ceiling: float
    identity: object
    hold: bool
    """It was told to hold."""
    dropped: bool
    """It was stopped: what was left is forgotten, and nothing can be appended."""
    ticks: int
    """Number of set points: after the last one it stands, at the end of the chain or where it is held."""
    _blocks: tuple[Block, ...]
    forgotten: int = 0
    """Ticks at the beginning of which nothing is known any more; see `forgetting`."""

    @property
    def held(self) -> bool:
        """It brakes, or stands, though pieces may be left: it was told to, or the scale is 0."""
        return self.hold or self.scale <= 0

    @property
    def pieces(self) -> int:
        """Number of pieces: those that were made, that are being made and that are waiting."""
        return self._blocks[-1].first + len(self._blocks[-1].table)

    @property
    def duration_s(self) -> float:
        """Time at which it stands, from tick 0; at or before the last tick but for a millionth of a period."""
        phases = self._blocks[-1].phases
        return float(phases[-1, T] + phases[-1, DT]) if len(phases) else 0.0

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        """See `SetPoints.deltas`."""
        check_range(first, last, self.ticks)
        self._check_known(first)
        return np.diff(self._positions(first, last), axis=0).astype(np.int32)

    def displacement(self, k: int) -> Displacement:
        """See `SetPoints.displacement`; costs the logarithm of the number of pieces. Beyond the last tick: the end."""
        self._check_known(k)
        return tuple(self._positions(k, k)[0].tolist())

    def speed(self, k: int) -> float:
        """Path speed at tick k, units per second; 0 at and after the last one."""
        return self._state(k)[1].v

    def finished(self, k: int) -> int:
        """Number of pieces whose end has been reached or passed at tick k."""
        t_s = self._end_s(k)
        block = self._blocks[self._block_at(t_s)]
        row = block.row(t_s)
        if row < 0:
            return block.first
        at = int(block.piece[row])
        ended = t_s - block.phases[row, T] >= block.phases[row, DT] and block.phases[row, S1] == block.table[at, LENGTH]
        return block.first + at + int(ended)

    def passed(self, j: int) -> int:
        """The first tick at which `finished` is j or more, as planned now; j = 1 .. pieces. 0 for j = 0.

        Raises IndexError if it will not get there: for another number, or beyond the place where it is held; and for
        what is forgotten.
        """
        if j == 0 and not self.forgotten:
            return 0
        if j <= self._blocks[0].first or j > self.pieces:
            raise IndexError(f"piece {j} of {self._blocks[0].first + 1} .. {self.pieces}")
        block = self._blocks[bisect_right(self._blocks, j - 1, key=lambda block: block.first) - 1]
        at = j - 1 - block.first
        row = int(block.piece.searchsorted(at, side="right")) - 1
        if row < 0 or block.piece[row] != at or block.phases[row, S1] != block.table[at, LENGTH]:
            raise IndexError(f"piece {j} of {self.pieces} is not reached as planned now")
        k = math.ceil(float(block.phases[row, T] + block.phases[row, DT]) / self._period_s - GRID_NOISE)
        while self.finished(k) < j:
            k += 1
        while k > self.forgotten and self.finished(k - 1) >= j:
            k -= 1
        return k

    @property
    def known_pieces(self) -> int:
        """Number of pieces that take memory: all but those that are forgotten."""
        return self.pieces - self._blocks[0].first

    def forgetting(self, k: int) -> Joined:
        """The same from tick k on, and nothing of what was before: so that a motion without an end needs no more room
        than its last pieces do. Numbers of ticks and pieces, and displacements, stay what they were.

        Raises IndexError for a tick that is forgotten already.
        """
        self._check_known(k)
        k = min(k, self.ticks)
        kept = self._blocks[self._block_at(k * self._period_s) :]
        return replace(self, _blocks=kept, forgotten=k)

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
        wanted: tuple[int, float] | None = None,
    ) -> Joined:
        """The same up to tick k, then otherwise; what is not said stays. k may lie beyond the last tick: it stood.

        drop: forget the pieces that have not begun, but for those it needs to stop; with hold, the rest of all. append:
        pieces at the end, after what was dropped. scale, ceiling: see `joined`; speeds above them fall as the ramps
        allow, joints keep their entry speeds. hold: True brakes along the path and stands, with what is left waiting;
        False goes on. sharpness: factor of the accelerations of the pieces while it brakes for a hold. wanted: number
        of pieces, and another wanted speed on what is left of them.

        A ramp under way goes on unchanged if the new plan has the same; otherwise a new one begins at the momentary
        speed. A falling sin^2 ramp without which a joint would be passed too fast is finished first.

        Raises ValueError for a negative k, numbers that are not allowed, pieces with another number of axes, or pieces
        for a plan that was dropped while held.
        """
        new = replace(
            self,
            scale=self.scale if scale is None else scale,
            ceiling=self.ceiling if ceiling is None else ceiling,
            hold=self.hold if hold is None else hold,
        )
        sound = 0 <= new.scale < math.inf and new.ceiling > 0 and 0 < sharpness < math.inf
        if k < 0 or not sound or (wanted is not None and not 0 < wanted[1] < math.inf):
            raise ValueError(f"no plan at tick {k} for scale {new.scale}, ceiling {new.ceiling}, sharpness {sharpness}")
        if append is not None and (append.axes != self.axes or self.dropped):
            raise ValueError(
                "what was dropped takes no more" if self.dropped else f"{append.axes} axes, not {self.axes}"
            )
        if self.dropped:
            return self
        same = (new.scale, new.ceiling, new.hold) == (self.scale, self.ceiling, self.hold)
        same = same and wanted is None
        if same and not drop and (append is None or not len(append)):
            return self
        number, state = self._state(k)
        if same and not drop and not self.held and append is not None:
            tail = self._blocks[-1]
            row = int(tail.piece.searchsorted(tail.settled))
            if row < len(tail.phases) and (number < len(self._blocks) - 1 or state.row < row):
                grown, at = tail.with_pieces(append), tail.phases[row]
                law = new._lay(grown, tail.settled, float(at[T]), float(at[S0]), float(at[V0]))
                return new._with(self._blocks[:-1], grown.with_phases(row, tail.settled, law), k)
        before, tail, state = self._open(number, state)
        if wanted is not None:
            tail = tail.with_speed(state.piece, wanted[0] - tail.first, wanted[1])
        if drop:
            needed = state.piece + (state.s > 0)
            if state.v > 0:
                row, piece, law = new._braked(tail, state, 1.0)
                needed = (piece + int(law.piece[-1]) if len(law.piece) else int(tail.piece[row - 1])) + 1
            tail = tail.shortened(needed)
            state = replace(state, row=min(state.row, len(tail.phases) - 1))
        if append is not None:
            tail = tail.with_pieces(append)
        new = replace(new, dropped=drop and new.held)
        if not (self.held and new.held) or sharpness != 1:
            row, piece, law = new._braked(tail, state, sharpness) if new.held else new._laid(tail, state)
            tail = tail.with_phases(row, piece, law)
        if not len(tail.phases) and len(tail.table):  # stands where it is, which may be in the middle of a piece
            tail = tail.standing(state.piece, state.s, state.t_s if before or self.forgotten else 0.0)
        return new._with(before, tail, k)

    def remainder(self, identity: object = 0, *, scale: float | None = None) -> Joined:
        """What is left of a plan that is held, from where it stands (its last tick), as a motion of its own that is not
        told to hold; with another scale if one is given.

        For a controller that ends the motion when it stands and begins another one when it goes on. Set points fall on
        the same whole numbers: they are rounded from where the pieces began.
        """
        here = np.array(self.displacement(self.ticks), dtype=np.float64)
        tail = self._blocks[-1]
        _, first, s = self._now(tail, self._state(self.ticks)[1])
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
        standing = replace(self, identity=identity, hold=True, dropped=False, ticks=0, _blocks=(rest,), forgotten=0)
        return standing.replanned(0, hold=False, scale=scale)

    # ---- written down ------------------------------------------------------------------------------------------------

    def since(self, k: int) -> Stretch | None:
        """What it says of the ticks from k on, from the phase under way at tick k; all of it for k = 0.

        None if curves lead along: they are functions and cannot be written down.
        """
        later = self._blocks[self._block_at(k * self._period_s) :]
        if any(block.curves for block in later):
            return None
        row = max(later[0].row(k * self._period_s), 0)
        first = later[0].first + (int(later[0].piece[row]) if len(later[0].piece) else 0)
        rows = [slice(row, None), *(slice(None),) * (len(later) - 1)]
        number = np.concatenate([block.piece[part] + block.first for block, part in zip(later, rows, strict=True)])
        stretches = [(block, after.first - block.first) for block, after in pairwise(later)]
        stretches.append((later[-1], len(later[-1].table)))
        corner = np.concatenate([block.corner[:n] for block, n in stretches] + [later[-1].corner[-1:]])
        length = np.concatenate([block.table[:n, LENGTH] for block, n in stretches])
        low = first - later[0].first
        count = int(number[-1]) + 1 - first if len(number) else 0
        return Stretch(
            first,
            self.ticks,
            np.concatenate([block.phases[part] for block, part in zip(later, rows, strict=True)]),
            (number - first).astype(np.int32),
            corner[low : low + count + 1],
            length[low : low + count],
        )

    def _check_known(self, k: int) -> None:
        if k < self.forgotten:
            raise IndexError(f"set point {k}" + f": those before {self.forgotten} are forgotten" * (k >= 0))

    # ---- places ----------------------------------------------------------------------------------------------------

    @property
    def _period_s(self) -> float:
        return self.period_ns / SECOND_NS

    def _end_s(self, k: int) -> float:
        """Time until which an end counts as reached at tick k."""
        return (k + GRID_NOISE) * self._period_s

    def _block_at(self, t_s: float) -> int:
        return max(bisect_right(self._blocks, t_s, key=lambda block: block.start_s) - 1, 0)

    def _state(self, k: int) -> tuple[int, State]:
        """Number of the block at tick k, and where it is there."""
        t_s = k * self._period_s
        number = len(self._blocks) - 1 if k >= self.ticks else self._block_at(t_s)
        block = self._blocks[number]
        if k >= self.ticks:
            row = len(block.phases) - 1
            if row < 0:
                return number, State(-1, 0, 0.0, 0.0, t_s, True)
            return number, State(row, int(block.piece[row]), float(block.phases[row, S1]), 0.0, t_s, True)
        row = block.row(t_s)
        place, at = np.empty(1), np.empty(1, dtype=np.int64)
        places(k, self._period_s, block.phases, block.piece, self.sine, place, at)
        speed = speed_at(t_s - block.phases[row, T], block.phases, row, self.sine) if row >= 0 else 0.0
        return number, State(row, max(int(at[0]), 0), float(place[0]), float(speed), t_s, row < 0)

    def _positions(self, first: int, last: int) -> NDArray[np.int64]:
        """int64 [last - first + 1, axes]: displacements at ticks first .. last."""
        out = np.empty((last - first + 1, self.axes), dtype=np.int64)
        period_s = self._period_s
        number, k = self._block_at(first * period_s), first
        while k <= last:
            block, end = self._blocks[number], last + 1
            number += 1
            if number < len(self._blocks):
                start_s = self._blocks[number].start_s
                end = math.ceil(start_s / period_s)
                while end * period_s < start_s:
                    end += 1
                while (end - 1) * period_s >= start_s:
                    end -= 1
                end = min(max(end, k), last + 1)
            part = out[k - first : end - first]
            positions(k, period_s, block.phases, block.piece, self.sine, block.table[:, LENGTH], block.corner, part)
            if block.curves:
                self._bend(block, k, part)
            k = end
        return out

    def _bend(self, block: Block, k: int, out: NDArray[np.int64]) -> None:
        """Put what lies on curves where it is."""
        place, at = np.empty(len(out)), np.empty(len(out), dtype=np.int64)
        places(k, self._period_s, block.phases, block.piece, self.sine, place, at)
        for j, curve in block.curves:
            low, high = int(at.searchsorted(j)), int(at.searchsorted(j, side="right"))
            if low < high:
                begin = block.corner[j]
                whole = np.rint(begin)
                way = curve.displacement(place[low:high])
                arrived = (place[low:high] == block.table[j, LENGTH])[:, None]
                way = np.where(arrived, block.corner[j + 1] - begin, way)
                out[low:high] = whole.astype(np.int64) + np.rint(begin - whole + way).astype(np.int64)

    # ---- planning --------------------------------------------------------------------------------------------------

    @property
    def _mean(self) -> float:
        """Mean acceleration of a ramp over its greatest."""
        return 2.0 / math.pi if self.sine else 1.0

    def _open(self, number: int, state: State) -> tuple[tuple[Block, ...], Block, State]:
        """What is over and done with, and the rest as one block, with the present in it."""
        before, tail = self._blocks[:number], self._blocks[number]
        later = self._blocks[number:]
        if len(later) > 1:
            stretches = [(block, after.first - block.first) for block, after in pairwise(later)]
            stretches.append((later[-1], len(later[-1].table)))
            tail = replace(
                tail,
                corner=np.concatenate(
                    [block.corner[:count] for block, count in stretches] + [later[-1].corner[-1:]], axis=0
                ),
                table=np.concatenate([block.table[:count] for block, count in stretches]),
                curves=tuple(
                    (block.first - tail.first + j, curve)
                    for block, count in stretches
                    for j, curve in block.curves
                    if j < count
                ),
            )
        if state.row >= BLOCK:
            row = state.row - int(tail.back[state.row])
            past, tail = tail.split(row)
            before = (*before, past)
            state = replace(state, row=state.row - row, piece=state.piece + before[-1].first - tail.first)
        return before, tail, state

    def _with(self, before: tuple[Block, ...], tail: Block, k: int) -> Joined:
        """This plan with these blocks, the last one cut where nothing will change any more."""
        row = int(tail.piece.searchsorted(tail.settled))
        if not self.held and BLOCK <= row < len(tail.piece) and tail.piece[row] == tail.settled:
            past, tail = tail.split(row)
            before = (*before, past)
        plan = replace(self, _blocks=(*before, tail))
        ticks = math.ceil(plan.duration_s / self._period_s - GRID_NOISE)
        return replace(plan, ticks=max(ticks, min(k, self.ticks), 0))

    def _lay(self, block: Block, piece: int, t_s: float, s: float, v: float) -> Law:
        """From place s of a piece on to the end of the chain."""
        table = block.table[piece:]
        wanted = np.minimum(np.minimum(table[:, SPEED] * self.scale, table[:, LIMIT]), self.ceiling)
        phases, at = np.empty((3 * len(table), 6)), np.empty(3 * len(table), dtype=np.int32)
        back = np.empty(len(at), dtype=np.int8)
        count, settled, kept = lay(t_s, s, v, table, wanted, self._mean, phases, at, back)
        return Law(phases[:count], at[:count], back[:count], settled, kept or not count)

    def _laid(self, block: Block, state: State) -> tuple[int, int, Law]:
        """How it goes on: number of phases that stay, piece on which the law of the others begins, that law."""
        if not state.ended:
            row = state.row - int(block.back[state.row])
            at, piece = block.phases[row], int(block.piece[row])
            law = self._lay(block, piece, float(at[T]), float(at[S0]), float(at[V0]))
            if law.kept and _agree(block.phases[row : state.row + 1], law, state.t_s):
                return row, piece, law
        row, piece, s = self._now(block, state)
        law = self._lay(block, piece, state.t_s, s, state.v)
        if law.kept or not self._falling(block, state):
            return row, piece, law
        piece, t_s, s, v = self._fallen(block, state)
        return state.row + 1, piece, self._lay(block, piece, t_s, s, v)

    def _brake(self, block: Block, piece: int, t_s: float, s: float, v: float, sharpness: float) -> Law:
        """From place s of a piece on to standstill."""
        table = block.table[piece:]
        phases, at = np.empty((len(table), 6)), np.empty(len(table), dtype=np.int32)
        back = np.empty(len(table), dtype=np.int8)
        count, kept = brake(t_s, s, v, table, self._mean * sharpness, phases, at, back) if v > 0 else (0, True)
        return Law(phases[:count], at[:count], back[:count], 0, kept)

    def _braked(self, block: Block, state: State, sharpness: float) -> tuple[int, int, Law]:
        """How it comes to a stop: like `_laid`."""
        row, piece, s = self._now(block, state)
        law = self._brake(block, piece, state.t_s, s, state.v, sharpness)
        if law.kept or not self._falling(block, state):
            return row, piece, law
        piece, t_s, s, v = self._fallen(block, state)
        return state.row + 1, piece, self._brake(block, piece, t_s, s, v, sharpness)

    def _now(self, block: Block, state: State) -> tuple[int, int, float]:
        """Number of phases that have begun before the present, and where a new one begins."""
        row = int(block.phases[:, T].searchsorted(state.t_s))
        if state.row >= 0 and state.piece < len(block.table) and state.s >= block.table[state.piece, LENGTH]:
            return row, state.piece + 1, 0.0
        return row, state.piece, state.s

    def _falling(self, block: Block, state: State) -> bool:
        return self.sine and not state.ended and bool(block.phases[state.row, V1] < block.phases[state.row, V0])

    def _fallen(self, block: Block, state: State) -> tuple[int, float, float, float]:
        """Piece, time, place and speed at the end of the ramp under way."""
        at = block.phases[state.row]
        t_s, s, v = float(at[T] + at[DT]), float(at[S1]), float(at[V1])
        return (state.piece + 1, t_s, 0.0, v) if s >= block.table[state.piece, LENGTH] else (state.piece, t_s, s, v)


def written(stretch: Stretch, period_ns: int, *, sine: bool, before: Joined | None = None) -> Joined:
    """The plan that a stretch says, to be looked at only; before: the one whose ticks come first, if there is one.

    Raises ValueError for a stretch that is none, or does not belong behind that plan.
    """
    first, ticks, phases, piece, corner, length = stretch
    sound = (
        period_ns > 0
        and 0 <= ticks < 1 << 40
        and first >= 0
        and corner.ndim == 2
        and 1 <= corner.shape[1] <= len(AXIS_NAMES)
        and len(corner) == len(length) + 1
        and phases.ndim == 2
        and phases.shape[1:] == (6,)
        and piece.shape == (len(phases),)
        and bool(np.isfinite(phases).all() and np.isfinite(corner).all() and (length > 0).all())
        and bool((np.diff(phases[:, T]) >= 0).all() and (np.diff(piece) >= 0).all())
        and (not len(piece) or (int(piece[0]) >= 0 and int(piece[-1]) < len(length)))
        and (bool(len(piece)) or not ticks)
    )
    if not sound:
        raise ValueError("no stretch of a joined plan")
    table = np.zeros((len(length), 5))
    table[:, LENGTH] = length
    block = Block(first, phases, piece, np.zeros(len(piece), dtype=np.int8), corner, table, (), 0)
    if before is None:
        return Joined(corner.shape[1], period_ns, sine, 1.0, math.inf, 0, False, True, ticks, (block,))
    if (
        (before.axes, before.period_ns, before.sine) != (corner.shape[1], period_ns, sine)
        or first > before.pieces
        or not len(piece)
    ):
        raise ValueError("a stretch of another plan")
    number = before._block_at(block.start_s)
    last = before._blocks[number]
    row = int(last.phases[:, T].searchsorted(block.start_s))
    kept = before._blocks[:number]
    if row and first < last.first:
        raise ValueError("a stretch of another plan")
    if row >= BLOCK:
        kept = (*kept, replace(last, phases=last.phases[:row], piece=last.piece[:row], back=last.back[:row]))
    elif row:
        pieces = first - last.first
        block = Block(
            last.first,
            np.vstack((last.phases[:row], phases)),
            np.concatenate((last.piece[:row], piece + np.int32(pieces))),
            np.zeros(row + len(piece), dtype=np.int8),
            np.concatenate((last.corner[:pieces], corner)),
            np.concatenate((last.table[:pieces], table)),
            (),
            0,
        )
    return replace(before, ticks=ticks, _blocks=(*kept, block))


def _agree(phases: NDArray[np.float64], law: Law, t_s: float) -> bool:
    """Whether the law begins with these phases; the last of them, under way at t_s, may be longer if it is no ramp."""
    n = len(phases)
    if len(law.phases) < n or law.piece[n - 1] != 0 or not np.array_equal(phases[:-1], law.phases[: n - 1]):
        return False
    now, then = phases[-1], law.phases[n - 1]
    if now[V0] != now[V1]:
        return bool(np.array_equal(now, then))
    same = now[T] == then[T] and now[S0] == then[S0] and now[V0] == then[V0] == then[V1]
    return bool(same and t_s < then[T] + then[DT])
