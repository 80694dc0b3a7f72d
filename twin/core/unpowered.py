"""A controller without supply: no inputs, no motion, no outputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from isel_twin.controller import Controller, Event, SerialFormat


class Unpowered:
    """Implements `isel_twin.controller.Controller` while there is no mains."""

    run = None
    next_ns = None
    idle = True
    fault = True
    fault_cause = "the mains is off"

    def __init__(self, controller: Controller) -> None:
        self.counts = (0,) * len(controller.counts)
        self.direction = controller.direction
        self.serial_format: SerialFormat = controller.serial_format

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None: ...

    def receive(self, t_ns: int, data: bytes) -> None: ...

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None: ...

    def advance(self, t_ns: int) -> None: ...

    def take(self) -> list[Event]:
        return []

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return {}

    def machine_overrides(self) -> Mapping[str, Any]:
        return {}
