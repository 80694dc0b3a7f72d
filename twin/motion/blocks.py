"""How a joined plan is kept: blocks of phases and of the pieces that they lead along, one after the other in time.

    blocks    | settled, shared by all later plans | settled ... | the tail: may be planned anew |
    pieces    0 ........ 480 . 480 ........ 950 ............................................ last

A block is a value: what changes makes another one. A piece whose phases lie in two blocks is in both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.look_ahead import SPEED, T
from isel_twin.motion.pieces import Curve, Pieces, table


@dataclass(frozen=True, eq=False, slots=True)
class Block:
    """A stretch of the plan: phases in the order of time, and the pieces that they, or later ones, lead along."""

    first: int
    """Number of its first piece; it may be the last one of the block before."""
    phases: NDArray[np.float64]
    piece: NDArray[np.int32]
    back: NDArray[np.int8]
    corner: NDArray[np.float64]
    """float64 [pieces + 1, axes], where pieces begin and the last one ends, increments from tick 0 on."""
    table: NDArray[np.float64]
    curves: tuple[tuple[int, Curve], ...]
    settled: int
    """The last piece (of the block) whose beginning keeps its speed whatever is appended."""

    @property
    def start_s(self) -> float:
        return float(self.phases[0, T]) if len(self.phases) else 0.0

    def row(self, t_s: float) -> int:
        """The phase at this time; -1 before the first."""
        return int(self.phases[:, T].searchsorted(t_s, side="right")) - 1

    def split(self, row: int) -> tuple[Block, Block]:
        """The phases before this one, the others."""
        last, first = int(self.piece[row - 1]) + 1, int(self.piece[row])
        before = Block(
            self.first,
            self.phases[:row].copy(),
            self.piece[:row].copy(),
            self.back[:row].copy(),
            self.corner[: last + 1].copy(),
            self.table[:last].copy(),
            tuple((j, curve) for j, curve in self.curves if j < last),
            0,
        )
        after = Block(
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

    def with_pieces(self, pieces: Pieces) -> Block:
        """With these behind it, without phases."""
        if not len(pieces):
            return self
        n = len(self.table)
        return replace(
            self,
            corner=np.vstack((self.corner, self.corner[-1] + np.cumsum(pieces.displacement, axis=0))),
            table=np.vstack((self.table, table(pieces))),
            curves=self.curves + tuple((n + j, curve) for j, curve in pieces.curves),
        )

    def with_speed(self, first: int, last: int, speed: float) -> Block:
        """With another wanted speed on the pieces from `first` to before `last`."""
        changed = self.table.copy()
        changed[first : max(last, first), SPEED] = speed
        return replace(self, table=changed)

    def shortened(self, count: int) -> Block:
        """With its first so many pieces; what led along others was standing."""
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

    def standing(self, piece: int, s: float, t_s: float) -> Block:
        """With nothing but a phase that stands, from a time on, at place s of a piece."""
        phases = np.array([[t_s, 0.0, s, s, 0.0, 0.0]])
        return replace(self, phases=phases, piece=np.array([piece], np.int32), back=np.zeros(1, np.int8))

    def with_phases(self, row: int, piece: int, law: Law) -> Block:
        """With the first `row` phases, then those of a law that begins on this piece."""
        return replace(
            self,
            phases=np.vstack((self.phases[:row], law.phases)),
            piece=np.concatenate((self.piece[:row], law.piece + np.int32(piece))),
            back=np.concatenate((self.back[:row], law.back)),
            settled=piece + law.settled,
        )


@dataclass(frozen=True, eq=False, slots=True)
class Law:
    """What `lay` or `brake` made, piece numbers from the first piece on."""

    phases: NDArray[np.float64]
    piece: NDArray[np.int32]
    back: NDArray[np.int8]
    settled: int
    kept: bool


@dataclass(frozen=True, slots=True)
class State:
    """Where a plan is: phase `row` of its last block (-1: before all), place s of the piece `piece` of that block."""

    row: int
    piece: int
    s: float
    v: float
    t_s: float
    ended: bool
