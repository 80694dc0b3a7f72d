"""A controller without supply: it hears nothing, moves nothing and says nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from isel_twin.controller import Controller, Event, SerialFormat


class Unpowered:
    """Stands in for a controller while there is no mains. Implements `isel_twin.controller.Controller`."""

    run = None
    next_ns = None
    idle = True
    fault = False

    def __init__(self, controller: Controller) -> None:
        """controller: the one that has lost its supply, and all that it knew."""
        self.counts = (0,) * len(controller.counts)
        self.direction = controller.direction
        self.serial_format: SerialFormat = controller.serial_format

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        """There is nothing to switch on."""

    def receive(self, t_ns: int, data: bytes) -> None:
        """Nobody listens."""

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        """Nobody looks."""

    def advance(self, t_ns: int) -> None:
        """Nothing happens."""

    def take(self) -> list[Event]:
        """Nothing has happened."""
        return []

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        """None."""
        return {}

    def machine_overrides(self) -> Mapping[str, Any]:
        """None."""
        return {}
