"""Which waiting blocks join without a stop and so make one stretch of path."""

from __future__ import annotations

from collections import deque
from typing import Final

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.realtime.spindle import commands
from isel_twin.firmware.bwo900.realtime.surroundings import Surroundings

ONLY_REAL_TIME: Final = 0x1010  # of P8806 (byte 1, 2, bit 4): single block stops only after blocks with real-time work


def released(around: Surroundings) -> bool:
    """P8706: False while the PLC holds the change of blocks. Once it is set blocks do not join (bwo900/90)."""
    return around.parameters.get(P.BLOCK_RELEASE, 1.0) != 0.0


def halts(block: PathBlock, around: Surroundings) -> bool:
    """True if single block stops after it."""
    p = around.parameters
    if not around.single or not (block.main or int(p.get(P.SINGLE_EVERY))):
        return False
    return not int(p.get(P.START_FLAGS_1)) & ONLY_REAL_TIME or block.in_real_time


def waits_for_start(block: PathBlock, around: Surroundings) -> bool:
    """True if Start has to go on after it: M00, unless the PLC decides that by a stop (P8828), or single block."""
    by_plc = int(around.parameters.get(P.M_MODIFIED)) & 1
    return (block.stop is Stop.MEASURING_STOP and not by_plc) or halts(block, around)


def breaks_after(block: PathBlock, around: Surroundings) -> bool:
    """True if the axes stop at its end to wait for something."""
    return block.stands or any(function.halt for function in block.post) or halts(block, around)


def joins(block: PathBlock, following: PathBlock, around: Surroundings) -> bool:
    """True if a block goes on in the stretch of the one before it."""
    return (
        not around.parameters.loaded(P.BLOCK_RELEASE)
        and not breaks_after(block, around)
        and not any(function.halt for function in following.pre)
        and following.override == block.override
        and not (around.spindle.present and _waits_for_spindle(block, following))
        and not (not following.elements and breaks_after(following, around))
    )


def _waits_for_spindle(block: PathBlock, following: PathBlock) -> bool:
    """True if the spindle changes between two blocks, or the feed begins to count by its turns."""
    before, after = block.in_force.modal.speed, following.in_force.modal.speed
    other = before != after or following.per_turn != block.per_turn or (block.rapid and not following.rapid)
    return other or commands((*block.post, *following.pre), following)


def joining(waiting: deque[PathBlock], last: PathBlock | None, around: Surroundings) -> list[PathBlock]:
    """Take the waiting blocks that continue the stretch after `last`, its last block; None: a new stretch."""
    chosen: list[PathBlock] = []
    while waiting:
        block = waiting[0]
        if last and (
            not joins(last, block, around)
            or around.axes.obstacle(block)
            or around.axes.bars(block)
            or not around.plc.room
        ):
            break
        chosen.append(waiting.popleft())
        last = block
    return chosen
