"""The phases of a joined plan from a moment on, over the pieces of a block; formulas: `joined`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.blocks import Law, PlanBlock, State
from isel_twin.motion.look_ahead import DT, LENGTH, LIMIT, PLAN_PHASE, PLAN_PIECE, S0, S1, SPEED, V0, V1, T, in_c
from isel_twin.native import core


class Ramps(NamedTuple):
    """The form of the ramps, and what scales and limits the wanted speeds."""

    sine: bool
    scale: float
    ceiling: float

    @property
    def mean(self) -> float:
        """Mean over peak acceleration of a ramp."""
        return 2.0 / math.pi if self.sine else 1.0

    def lay(self, block: PlanBlock, piece: int, t_s: float, s: float, v: float) -> Law:
        """A law from place s of a piece to the end of the chain."""
        table = block.table[piece:]
        wanted = np.minimum(np.minimum(table[:, SPEED] * self.scale, table[:, LIMIT]), self.ceiling)
        phases, at, back, told = _room(3 * len(table))
        pieces, joint = in_c(table, PLAN_PIECE), np.empty(len(table) + 1)
        count = core.lay(t_s, s, v, pieces, wanted, self.mean, joint, in_c(phases, PLAN_PHASE), at, back, told)
        return Law(phases[:count], at[:count], back[:count], int(told[0]), bool(told[1]) or not count)

    def laid(self, block: PlanBlock, state: State) -> tuple[int, int, Law]:
        """The plan from here on: number of phases that stay, number of the piece on which the new law begins, the
        law."""
        if not state.ended:
            row = state.row - int(block.back[state.row])
            at, piece = block.phases[row], int(block.piece[row])
            law = self.lay(block, piece, float(at[T]), float(at[S0]), float(at[V0]))
            if law.kept and _agree(block.phases[row : state.row + 1], law, state.t_s):  # motion/9
                return row, piece, law
        row, piece, s = now(block, state)
        law = self.lay(block, piece, state.t_s, s, state.v)
        if law.kept or not self._falling(block, state):  # motion/10
            return row, piece, law
        piece, t_s, s, v = _fallen(block, state)
        return state.row + 1, piece, self.lay(block, piece, t_s, s, v)

    def without_rest(self, block: PlanBlock, state: State) -> tuple[PlanBlock, State]:
        """The block without the pieces that have not begun, except those it needs to stop."""
        needed = state.piece + (state.s > 0)
        if state.v > 0:
            row, piece, law = self.braked(block, state, 1.0)
            needed = (piece + int(law.piece[-1]) if len(law.piece) else int(block.piece[row - 1])) + 1
        block = block.shortened(needed)
        return block, replace(state, row=min(state.row, len(block.phases) - 1))

    def braked(self, block: PlanBlock, state: State, sharpness: float) -> tuple[int, int, Law]:
        """The plan to a stop; returns what `laid` does."""
        row, piece, s = now(block, state)
        law = self._brake(block, piece, state.t_s, s, state.v, sharpness)
        if law.kept or not self._falling(block, state):  # motion/10
            return row, piece, law
        piece, t_s, s, v = _fallen(block, state)
        return state.row + 1, piece, self._brake(block, piece, t_s, s, v, sharpness)

    def _brake(self, block: PlanBlock, piece: int, t_s: float, s: float, v: float, sharpness: float) -> Law:
        """A law from place s of a piece to standstill."""
        table = block.table[piece:]
        phases, at, back, told = _room(len(table) if v > 0 else 0)
        if not len(phases):
            return Law(phases, at, back, 0, not v > 0)
        rows, mean = in_c(phases, PLAN_PHASE), self.mean * sharpness
        count = core.brake(t_s, s, v, in_c(table, PLAN_PIECE), mean, rows, at, back, told)
        return Law(phases[:count], at[:count], back[:count], 0, bool(told[1]))

    def _falling(self, block: PlanBlock, state: State) -> bool:
        return self.sine and not state.ended and bool(block.phases[state.row, V1] < block.phases[state.row, V0])


def _room(n: int) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int8], NDArray[np.int64]]:
    """Arrays for n phases, and for what is told of them."""
    return np.empty((n, 6)), np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int8), np.empty(2, dtype=np.int64)


def now(block: PlanBlock, state: State) -> tuple[int, int, float]:
    """Where a phase that begins now starts: number of phases before it, piece, place on the piece."""
    row = int(block.phases[:, T].searchsorted(state.t_s))
    if state.row >= 0 and state.piece < len(block.table) and state.s >= block.table[state.piece, LENGTH]:
        return row, state.piece + 1, 0.0
    return row, state.piece, state.s


def _fallen(block: PlanBlock, state: State) -> tuple[int, float, float, float]:
    """Piece, time, place and speed at the end of the ramp under way."""
    at = block.phases[state.row]
    t_s, s, v = float(at[T] + at[DT]), float(at[S1]), float(at[V1])
    return (state.piece + 1, t_s, 0.0, v) if s >= block.table[state.piece, LENGTH] else (state.piece, t_s, s, v)


def _agree(phases: NDArray[np.float64], law: Law, t_s: float) -> bool:
    """True if the law begins with these phases; the last, under way at t_s, may differ in length if it is no ramp."""
    n = len(phases)
    if len(law.phases) < n or law.piece[n - 1] != 0 or not np.array_equal(phases[:-1], law.phases[: n - 1]):
        return False
    now, then = phases[-1], law.phases[n - 1]
    if now[V0] != now[V1]:
        return bool(np.array_equal(now, then))
    same = now[T] == then[T] and now[S0] == then[S0] and now[V0] == then[V0] == then[V1]
    return bool(same and t_s < then[T] + then[DT])
