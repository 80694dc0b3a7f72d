"""A joined plan as arrays for a recording: its phases from a tick on, and the plan made from them again."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.motion.blocks import PlanBlock, block_at, long_enough, merged_corner, merged_table
from isel_twin.motion.joined import Joined
from isel_twin.motion.look_ahead import LENGTH, T


class Stretch(NamedTuple):
    """Phases of a plan one after the other, and the straight pieces they lead along."""

    first: int  # number of the first piece
    ticks: int  # number of ticks of the whole plan
    phases: NDArray[np.float64]  # [n, 6]: begin and duration in s, place from and to, speed from and to
    piece: NDArray[np.int32]  # [n]: number of the piece of each phase, from the first one on
    corner: NDArray[np.float64]  # [pieces + 1, axes]: where pieces begin and the last one ends, in increments
    length: NDArray[np.float64]  # [pieces]


def since(plan: Joined, k: int) -> Stretch | None:
    """The plan from the phase under way at tick k on; all of it for k = 0.

    None if a piece is curved: curves are functions and cannot be stored as arrays.
    """
    later = plan.blocks[block_at(plan.blocks, k * plan.period_s) :]
    if any(block.curves for block in later):
        return None
    row = max(later[0].row(k * plan.period_s), 0)
    first = later[0].first + (int(later[0].piece[row]) if len(later[0].piece) else 0)
    rows = [slice(row, None), *(slice(None),) * (len(later) - 1)]
    number = np.concatenate([block.piece[part] + block.first for block, part in zip(later, rows, strict=True)])
    corner, length = merged_corner(later), merged_table(later)[:, LENGTH]
    low = first - later[0].first
    count = int(number[-1]) + 1 - first if len(number) else 0
    return Stretch(
        first,
        plan.ticks,
        np.concatenate([block.phases[part] for block, part in zip(later, rows, strict=True)]),
        (number - first).astype(np.int32),
        corner[low : low + count + 1],
        length[low : low + count],
    )


def written(stretch: Stretch, period_ns: int, *, sine: bool, before: Joined | None = None) -> Joined:
    """The plan of a stretch, read-only: it cannot be replanned. before: the plan whose ticks come first.

    Raises ValueError for arrays that are no stretch, and for one that does not follow that plan.
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
    block = PlanBlock(first, phases, piece, np.zeros(len(piece), dtype=np.int8), corner, table, (), 0)
    if before is None:
        return Joined(corner.shape[1], period_ns, sine, 1.0, math.inf, 0, False, True, ticks, (block,))
    if (
        (before.axes, before.period_ns, before.sine) != (corner.shape[1], period_ns, sine)
        or first > before.pieces
        or not len(piece)
    ):
        raise ValueError("a stretch of another plan")
    number = block_at(before.blocks, block.start_s)
    last = before.blocks[number]
    row = int(last.phases[:, T].searchsorted(block.start_s))
    kept = before.blocks[:number]
    if row and not last.first <= first <= last.first + len(last.table):
        raise ValueError("a stretch of another plan")
    if long_enough(row):
        kept = (*kept, replace(last, phases=last.phases[:row], piece=last.piece[:row], back=last.back[:row]))
    elif row:
        pieces = first - last.first
        if int(last.piece[row - 1]) >= pieces + len(table):
            raise ValueError("a stretch of another plan")
        block = PlanBlock(
            last.first,
            np.vstack((last.phases[:row], phases)),
            np.concatenate((last.piece[:row], piece + np.int32(pieces))),
            np.zeros(row + len(piece), dtype=np.int8),
            np.concatenate((last.corner[:pieces], corner)),
            np.concatenate((last.table[:pieces], table)),
            (),
            0,
        )
    return replace(before, ticks=ticks, blocks=(*kept, block))
