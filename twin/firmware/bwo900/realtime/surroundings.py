"""Interfaces of the channel: PLC, axes, parameters, messages, and beginning and end of programs.

Channel --- Surroundings ---> Execution (bwo900/execution.py)
"""

from __future__ import annotations

from typing import Protocol

from isel_twin.firmware.bwo900.geometry.blocks import MFunction, PathBlock
from isel_twin.firmware.bwo900.machine_plc import MachinePlc
from isel_twin.firmware.bwo900.messages import Message
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.words import Text
from isel_twin.firmware.bwo900.realtime.axes import Axes
from isel_twin.firmware.bwo900.realtime.deletion import DeletionWatch
from isel_twin.firmware.bwo900.realtime.executed import Executed
from isel_twin.firmware.bwo900.realtime.spindle import Spindle


class Surroundings(Protocol):
    """The control, seen from its channel."""

    parameters: Parameters
    plc: MachinePlc
    axes: Axes
    executed: Executed
    deletion: DeletionWatch
    spindle: Spindle

    @property
    def single(self) -> bool:
        """Single block: the channel stops after every block."""

    def write(self, number: int, value: float | None) -> None: ...
    def say(self, said: Message) -> None: ...
    def show(self, text: Text) -> None: ...
    def begun(self, t_ns: int, block: PathBlock) -> None: ...
    def ended(self, broken: tuple[str, int] | None) -> None:
        """The program has ended normally (None), or was interrupted in a block of a program."""


def mute(around: Surroundings) -> bool:
    """P8813: True if programs run without M functions."""
    return bool(int(around.parameters.get(P.WITHOUT_M)))


def unmoved(around: Surroundings) -> bool:
    """P8812: True if programs run without moving."""
    return bool(int(around.parameters.get(P.WITHOUT_MOVING)))


def send(around: Surroundings, functions: tuple[MFunction, ...]) -> None:
    """Send M functions to the PLC, unless `mute`."""
    if functions and not mute(around):
        for function in functions:
            around.plc.function(around.axes.now_ns, function.code)


def enter(around: Surroundings, block: PathBlock, t_ns: int) -> None:
    """Take the beginning of a block at t_ns."""
    around.spindle.take(block)
    if around.executed.enter(block):
        around.begun(t_ns, block)


def speak(around: Surroundings, block: PathBlock) -> None:
    """Carry out the effects of a block at its beginning: parameters, S, T, text, M functions, in this order (manual
    3.6)."""
    if block.watched:
        around.deletion.begins()
    for number, value in block.parameters:
        around.write(number, value)
    for spindle, speed in block.speeds.items():
        around.plc.speed(spindle, speed)
    if block.tool is not None:
        around.plc.tool(block.tool)
    if block.text is not None:
        around.show(block.text)
    send(around, block.pre)
