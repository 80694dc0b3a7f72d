"""Outputs of the control: events, changes of outputs, messages.

A message is an event, is active until it is cleared, and stays in the history. While active its number is in P8500 to
P8503, by its effect, its axis in P8504 and P12197, its place in P8910 and P8911, and details in P8505 to P8507: a line
of a file, a parameter and its channel. One with an effect beyond display is a fault.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from isel_twin.controller import Event, Output, Remark
from isel_twin.firmware.bwo900.messages import Effect, Message
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import MACHINE_AXES, Parameters, of_axis

CELLS: Final[Mapping[Effect, int]] = {
    Effect.SYSTEM_ABORT: P.MESSAGE_SYSTEM,
    Effect.CHANNEL_ABORT: P.MESSAGE_HIGH,
    Effect.STOP: P.MESSAGE_LOW,
    Effect.SHOWN: P.MESSAGE_SHOWN,
}
INTERPOLATOR: Final = (20, 21)  # messages 20xx and 21xx are about an axis
INFOS: Final = (P.MESSAGE_INFO_1, P.MESSAGE_INFO_2, P.MESSAGE_INFO_3)
MOST_MESSAGES: Final = 1_000


class Outgoing:
    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._events: list[Event] = []
        self._outputs: dict[str, int] = {}
        self.standing: list[Message] = []  # active messages, the newest last
        self.history: list[tuple[int, Message]] = []
        self.fault_cause = ""  # the last message with an effect beyond display, or the like

    def add(self, *events: Event) -> None:
        self._events += events

    def take(self) -> list[Event]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    def output(self, name: str, value: int) -> None:
        if self._outputs.get(name) != value:
            self._outputs[name] = value
            self.add(Output(name, value))

    def pulse(self, name: str) -> None:
        self.add(Output(name, 1), Output(name, 0))

    def say(self, t_ns: int, said: Message) -> None:
        """Raise a message: it becomes active, goes into history and parameters, and may be a fault."""
        self.standing.append(said)
        del self.standing[:-MOST_MESSAGES]
        self.history.append((t_ns, said))
        del self.history[:-MOST_MESSAGES]
        self._parameters.write(CELLS[said.effect], float(said.number))
        if said.number // 100 in INTERPOLATOR and said.detail[:1] and said.detail[:1] in "XYZ":
            axis = "XYZ".index(said.detail[0])
            self._parameters.write(P.MESSAGE_AXIS, axis + 1.0)
            self._parameters.write(of_axis(axis, Axis.MESSAGE), float(said.number))
        for number, info in zip(INFOS, (*said.infos, 0.0, 0.0, 0.0), strict=False):
            if info or self._parameters.get(number):
                self._parameters.write(number, float(info))
        if said.program:
            self._parameters.write(P.FAULTY_PROGRAM, float(said.program[1:]))
            self._parameters.write(P.FAULTY_BLOCK, float(said.block))
        if said.effect is not Effect.SHOWN:
            self.fault_cause = str(said)
        self.output("message", said.number)
        self.add(Remark(str(said)))

    def acknowledge(self) -> None:
        self.standing.clear()
        cells = (*CELLS.values(), P.MESSAGE_AXIS, *(of_axis(axis, Axis.MESSAGE) for axis in range(MACHINE_AXES)))
        for number in cells:
            self._parameters.write(number, 0.0)

    def clear(self) -> None:
        """Clear the active messages and the fault."""
        self.acknowledge()
        self.fault_cause = ""
        self.output("message", 0)
