"""What the real time asks of the control around it: functions, speeds, parameters, messages, limits.

    Channel --- Services ---> Control (PLC, drives, parameters, messages)

The channel knows nothing of a PLC or of drives, so that it can be tried without them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from isel_twin.firmware.bwo900.geometry.blocks import Machine, PathBlock
from isel_twin.firmware.bwo900.messages import Message
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.realtime.path import Limits
from isel_twin.firmware.bwo900.realtime.watch import Watch


@dataclass(frozen=True)
class Services:
    """What the control does for its channel."""

    function: Callable[[Machine], None]
    """Send an M function to the PLC."""
    acknowledged: Callable[[], bool]
    """Whether all of them have been."""
    room: Callable[[], bool]
    """Whether the PLC takes more of them."""
    withdraw: Callable[[], None]
    """Take back those that have not been."""
    speed: Callable[[int, float], None]
    """S of a spindle, 1/min."""
    tool: Callable[[int], None]
    parameter: Callable[[int, float | None], None]
    say: Callable[[Message], None]
    text: Callable[[object], None]
    unsettled: Callable[[], list[int]]
    """Axes that are not within their exact-stop windows."""
    settling_ns: Callable[[int], int]
    """How long an axis may take to get there."""
    limits: Callable[[], Limits]
    counts: Callable[[], tuple[int, ...]]
    begun: Callable[[int, PathBlock], None]
    """A block of a program has begun: when, and which."""
    ended: Callable[[tuple[str, int] | None], None]
    """A program has ended by itself (None), or was broken off in a block of a program."""
    option: Callable[[int], int]
    """A parameter P of the start data, 0 if it is deleted."""
    watch: Watch
    """Of blocks with M26."""
    allowed: Callable[[PathBlock], str]
    """Why a block's path must not be made, such as a software limit; empty: it may."""

    @property
    def mute(self) -> bool:
        """P8813: programs are carried out without M functions."""
        return bool(self.option(P.WITHOUT_M))

    def send(self, function: Machine) -> None:
        """An M function, unless there are none."""
        if not self.mute:
            self.function(function)

    def speak(self, block: PathBlock) -> None:
        """What happens as a block begins."""
        if block.watched:
            self.watch.begins()
        for number, value in block.parameters:
            self.parameter(number, value)
        for spindle, speed in block.speeds.items():
            self.speed(spindle, speed)
        if block.tool is not None:
            self.tool(block.tool)
        if block.text is not None:
            self.text(block.text)
        for function in block.pre:
            self.send(function)
