"""The control's connections: inputs, axes, power, PLC, outputs and messages."""

from __future__ import annotations

from isel_twin.firmware.bwo900.machine_plc import MachinePlc
from isel_twin.firmware.bwo900.messages import Message
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.realtime.axes import Axes
from isel_twin.firmware.bwo900.realtime.hand import Hand
from isel_twin.firmware.bwo900.realtime.outgoing import Outgoing
from isel_twin.firmware.bwo900.realtime.power import Power
from isel_twin.firmware.bwo900.realtime.spindle import Spindle


class Hardware:
    """One of each; `axes.now_ns` is the time of all of them."""

    def __init__(self, parameters: Parameters, plc: str | None) -> None:
        self.parameters = parameters
        self.plc = MachinePlc(plc)
        self.levels: dict[str, bool] = {}  # of the inputs, by terminal
        self.outgoing = Outgoing(parameters)
        self.axes = Axes(parameters, self.levels)
        self.spindle = Spindle(parameters, self.axes, self.plc)
        self.power = Power(self.levels, self.outgoing)
        self.hand = Hand(parameters, self.axes, self.outgoing)

    def say(self, said: Message) -> None:
        self.outgoing.say(self.axes.now_ns, said)
