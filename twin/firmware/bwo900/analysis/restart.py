"""Restart at the contour: an interrupted program goes on at the block of the interruption (manual 8.5, P8804).

    P8802, P8803   program and block of the interruption, written by the control
    P8804 = 1      Start analyses the program up to there without moving, drives to the beginning of that block in
                   rapid, and goes on; P8804 is then 0
    P8686          2 on the way there, else 0

A block of a cycle restarts at the beginning of the cycle. M functions before are not sent: the table bits that select
them are in a lost picture of the manual.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import BlockEnd, PathBlock, Stop
from isel_twin.firmware.bwo900.geometry.elements import Point, Straight
from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import P

APPROACHES: Final = 2.0
MOST_BLOCKS: Final = 1_000_000  # a program that does not reach the block within this many is an endless loop


def find(
    interpreter: Interpreter, name: str, number: int, position: Point, write: Callable[[int, float | None], None]
) -> None:
    """Analyse a begun program up to a block, so that the way to it and the block come next. position: of the axes, mm.
    Raises ProgramError: M1255 if the program ends before it, and those of the program."""
    for _ in range(MOST_BLOCKS):
        block = interpreter.next()
        if block is Waiting.EXECUTION:
            interpreter.pass_over()
            interpreter.executed()
        elif block is Waiting.ACKNOWLEDGEMENT:
            interpreter.acknowledged(jumps=False)
        elif block is Waiting.BEGINNING:
            interpreter.begun()
        elif block is None or block is Waiting.CONDITION:
            break
        elif isinstance(block, PathBlock):
            if (block.program, block.number) == (name, number):
                there = (*block.parameters, (P.RESTART, 0.0), (P.RESTART_STATE, 0.0))
                interpreter.put_back(_way(block, position), replace(block, parameters=there))
                return
            if block.stop is Stop.END:
                break
            for parameter, value in block.parameters:
                write(parameter, value)
    raise ProgramError(Code.NO_BLOCK, f"{name} N{number} to restart at")


def _way(block: PathBlock, position: Point) -> PathBlock:
    elements = () if position == block.start else (Straight(position, block.start),)
    return PathBlock(
        block.program,
        block.number,
        start=position,
        elements=elements,
        plane=block.plane,
        rapid=True,
        end=BlockEnd.EXACT_STOP,
        parameters=((P.RESTART_STATE, APPROACHES),),
        main=False,
    )
