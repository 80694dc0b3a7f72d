"""What the control tells the outside: events in their order, outputs when they change, messages.

A message is an event, stands until it is cleared, is kept in the history, and is in a parameter that tells its effect:

    P8500 system abort    P8501 channel abort    P8502 channel stop    P8503 shown    P8910, P8911 program and block
    P8504 axis            P8505 to P8507 what else there is to know: a line of a file, a parameter and its channel

One that is more than shown is a fault.
"""

from __future__ import annotations

from typing import Final

from isel_twin.controller import Event, Output, Remark
from isel_twin.firmware.bwo900.messages import Effect, Message
from isel_twin.firmware.bwo900.parameters import Parameters

__all__ = ["Outgoing"]

CELLS: Final = {
    Effect.SYSTEM_ABORT: 8_500,
    Effect.CHANNEL_ABORT: 8_501,
    Effect.STOP: 8_502,
    Effect.SHOWN: 8_503,
}
OF_AXES: Final = range(2_000, 2_200)
"""Messages whose detail is an axis."""
NAMES: Final = "XYZ"
MOST_MESSAGES: Final = 1_000
"""Of the history."""


class Outgoing:
    """Events until they are taken, and what has been said."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._events: list[Event] = []
        self._outputs: dict[str, int] = {}
        self.standing: list[Message] = []
        """Messages that have not been cleared, the newest last."""
        self.history: list[tuple[int, Message]] = []
        self.fault = False

    def add(self, *events: Event) -> None:
        """Something happens."""
        self._events += events

    def take(self) -> list[Event]:
        """What has happened since."""
        events, self._events = self._events, []
        return events

    def output(self, name: str, value: int) -> None:
        """An output is to have this value."""
        if self._outputs.get(name) != value:
            self._outputs[name] = value
            self.add(Output(name, value))

    def pulse(self, name: str) -> None:
        """An output rises and falls."""
        self.add(Output(name, 1), Output(name, 0))

    def say(self, t_ns: int, said: Message) -> None:
        """A message: shown, kept, and what it does."""
        self.standing.append(said)
        del self.standing[:-MOST_MESSAGES]
        self.history.append((t_ns, said))
        del self.history[:-MOST_MESSAGES]
        self._parameters.write(CELLS[said.effect], float(said.number))
        axis = NAMES.find(said.detail) + 1 if said.detail and said.number in OF_AXES else 0
        for number, info in zip(range(8_504, 8_508), (axis, *said.infos, 0.0, 0.0, 0.0), strict=False):
            if info or self._parameters.get(number):
                self._parameters.write(number, float(info))
        if said.program:
            self._parameters.write(8_910, float(said.program[1:]))
            self._parameters.write(8_911, float(said.block))
        if said.effect is not Effect.SHOWN:
            self.fault = True
        self.output("message", said.number)
        self.add(Remark(str(said)))

    def clear(self) -> None:
        """The operator has read them; the fault is over."""
        self.standing.clear()
        self.fault = False
        self.output("message", 0)
