"""How a joined plan is kept: blocks of phases and of the pieces that they lead along, one after the other in time.

    blocks    | settled, shared by all later plans | settled ... | the tail: may be planned anew |
    pieces    0 ........ 480 . 480 ........ 950 ............................................ last

Blocks are immutable. A piece whose phases lie in two blocks is in both.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.look_ahead import DT, LENGTH, PLAN_PHASE, PLAN_PIECE, SPEED, T, in_c
from isel_twin.motion.pieces import Curve, Pieces, table
from isel_twin.native import core

BLOCK = 512  # least phases in a block: a trade-off between the number and the size of copies


@dataclass(frozen=True, eq=False, slots=True)
class PlanBlock:
    """A stretch of the plan: phases in the order of time, and the pieces that they, or later ones, lead along."""

    first: int  # number of its first piece; it may be the last one of the block before
    phases: NDArray[np.float64]
    piece: NDArray[np.int32]
    back: NDArray[np.int8]
    corner: NDArray[np.float64]  # [pieces + 1, axes], increments at which pieces begin and the last one ends
    table: NDArray[np.float64]
    curves: tuple[tuple[int, Curve], ...]
    settled: int  # last piece of the block whose entry speed stays, whatever is appended

    @property
    def start_s(self) -> float:
        return float(self.phases[0, T]) if len(self.phases) else 0.0

    @property
    def end_s(self) -> float:
        return float(self.phases[-1, T] + self.phases[-1, DT]) if len(self.phases) else 0.0

    def row(self, t_s: float) -> int:
        """Number of the phase at this time; -1 before the first."""
        return int(self.phases[:, T].searchsorted(t_s, side="right")) - 1

    def split(self, row: int) -> tuple[PlanBlock, PlanBlock]:
        """Two blocks: the phases before `row`, and the others."""
        last, first = int(self.piece[row - 1]) + 1, int(self.piece[row])
        before = PlanBlock(
            self.first,
            self.phases[:row].copy(),
            self.piece[:row].copy(),
            self.back[:row].copy(),
            self.corner[: last + 1].copy(),
            self.table[:last].copy(),
            tuple((j, curve) for j, curve in self.curves if j < last),
            0,
        )
        after = PlanBlock(
            self.first + first,
            self.phases[row:],
            self.piece[row:] - np.int32(first),
            self.back[row:],
            self.corner[first:],
            self.table[first:],
            tuple((j - first, curve) for j, curve in self.curves if j >= first),
            max(self.settled - first, 0),
        )
        return before, after

    def with_pieces(self, pieces: Pieces) -> PlanBlock:
        """With more pieces at the end, without phases."""
        if not len(pieces):
            return self
        n = len(self.table)
        return replace(
            self,
            corner=np.vstack((self.corner, self.corner[-1] + np.cumsum(pieces.displacement, axis=0))),
            table=np.vstack((self.table, table(pieces))),
            curves=self.curves + tuple((n + j, curve) for j, curve in pieces.curves),
        )

    def with_speed(self, first: int, last: int, speed: float) -> PlanBlock:
        """With another wanted speed on the pieces from `first` to before `last`."""
        changed = self.table.copy()
        changed[first : max(last, first), SPEED] = speed
        return replace(self, table=changed)

    def shortened(self, count: int) -> PlanBlock:
        """The first `count` pieces; phases on dropped pieces must be at standstill."""
        if count >= len(self.table):
            return self
        row = int(self.piece.searchsorted(count))
        return replace(
            self,
            phases=self.phases[:row],
            piece=self.piece[:row],
            back=self.back[:row],
            corner=self.corner[: count + 1],
            table=self.table[:count],
            curves=tuple((j, curve) for j, curve in self.curves if j < count),
        )

    def standing(self, piece: int, s: float, t_s: float) -> PlanBlock:
        """With a single phase: at rest from t_s on, at place s of a piece."""
        phases = np.array([[t_s, 0.0, s, s, 0.0, 0.0]])
        return replace(self, phases=phases, piece=np.array([piece], np.int32), back=np.zeros(1, np.int8))

    def with_phases(self, row: int, piece: int, law: Law) -> PlanBlock:
        """The first `row` phases, then those of a law that begins on this piece."""
        return replace(
            self,
            phases=np.vstack((self.phases[:row], law.phases)),
            piece=np.concatenate((self.piece[:row], law.piece + np.int32(piece))),
            back=np.concatenate((self.back[:row], law.back)),
            settled=piece + law.settled,
        )


@dataclass(frozen=True, eq=False, slots=True)
class Law:
    """Phases that `lay` or `brake` made; numbers of pieces count from the first piece they were given."""

    phases: NDArray[np.float64]
    piece: NDArray[np.int32]
    back: NDArray[np.int8]
    settled: int
    kept: bool


@dataclass(frozen=True, slots=True)
class State:
    """The present in a plan: phase `row` of its last block (-1: before all), place s on `piece` of that block."""

    row: int
    piece: int
    s: float
    v: float
    t_s: float
    ended: bool


def long_enough(rows: int) -> bool:
    return rows >= BLOCK


def block_at(blocks: Sequence[PlanBlock], t_s: float) -> int:
    return max(bisect_right(blocks, t_s, key=lambda block: block.start_s) - 1, 0)


def _own_pieces(blocks: Sequence[PlanBlock]) -> list[tuple[PlanBlock, int]]:
    """Blocks, each with the number of its pieces that are not also in the next one."""
    own = [(block, after.first - block.first) for block, after in pairwise(blocks)]
    return [*own, (blocks[-1], len(blocks[-1].table))]


def merged_corner(blocks: Sequence[PlanBlock]) -> NDArray[np.float64]:
    """`PlanBlock.corner` of all of them as one."""
    return np.concatenate([block.corner[:count] for block, count in _own_pieces(blocks)] + [blocks[-1].corner[-1:]])


def merged_table(blocks: Sequence[PlanBlock]) -> NDArray[np.float64]:
    """`PlanBlock.table` of all of them as one."""
    return np.concatenate([block.table[:count] for block, count in _own_pieces(blocks)])


def opened(blocks: tuple[PlanBlock, ...], number: int, state: State) -> tuple[tuple[PlanBlock, ...], PlanBlock, State]:
    """The finished blocks, the others merged into one, and the present in that one."""
    before, tail = blocks[:number], blocks[number]
    later = blocks[number:]
    if len(later) > 1:
        tail = replace(
            tail,
            corner=merged_corner(later),
            table=merged_table(later),
            curves=tuple(
                (block.first - tail.first + j, curve)
                for block, count in _own_pieces(later)
                for j, curve in block.curves
                if j < count
            ),
        )
    if long_enough(state.row):
        row = state.row - int(tail.back[state.row])
        past, tail = tail.split(row)
        before = (*before, past)
        state = replace(state, row=state.row - row, piece=state.piece + before[-1].first - tail.first)
    return before, tail, state


def block_positions(
    blocks: tuple[PlanBlock, ...], period_s: float, sine: bool, first: int, last: int
) -> NDArray[np.int64]:
    """int64 [last - first + 1, axes]: displacements at ticks first .. last."""
    out = np.empty((last - first + 1, blocks[0].corner.shape[1]), dtype=np.int64)
    number, k = block_at(blocks, first * period_s), first
    while k <= last:
        block, end = blocks[number], last + 1
        number += 1
        if number < len(blocks):
            start_s = blocks[number].start_s
            end = math.ceil(start_s / period_s)
            while end * period_s < start_s:
                end += 1
            while (end - 1) * period_s >= start_s:
                end -= 1
            end = min(max(end, k), last + 1)
        part = out[k - first : end - first]
        phases, pieces = in_c(block.phases, PLAN_PHASE), in_c(block.table, PLAN_PIECE)
        core.positions(k, period_s, phases, block.piece, sine, pieces, block.corner, part)
        if block.curves:
            _bend(block, period_s, sine, k, part)
        k = end
    return out


def _bend(block: PlanBlock, period_s: float, sine: bool, k: int, out: NDArray[np.int64]) -> None:
    """Correct the positions on curved pieces, which `core.positions` treats as straight."""
    place, at = np.empty(len(out)), np.empty(len(out), dtype=np.int64)
    core.places(k, period_s, in_c(block.phases, PLAN_PHASE), block.piece, sine, place, at)
    for j, curve in block.curves:
        low, high = int(at.searchsorted(j)), int(at.searchsorted(j, side="right"))
        if low < high:
            begin = block.corner[j]
            whole = np.rint(begin)
            way = curve.displacement(place[low:high])
            arrived = (place[low:high] == block.table[j, LENGTH])[:, None]
            way = np.where(arrived, block.corner[j + 1] - begin, way)
            out[low:high] = whole.astype(np.int64) + np.rint(begin - whole + way).astype(np.int64)
