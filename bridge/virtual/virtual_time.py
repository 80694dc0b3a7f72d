"""Virtual time for a host program in this process: turns for its threads, stand-ins for what is real, and a port."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from isel_twin.bridge.serve.borders import WireTap
from isel_twin.bridge.virtual.stand_ins import replace_all
from isel_twin.bridge.virtual.turns import Turns
from isel_twin.bridge.virtual.virtual_serial import Ports, stand_ins

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin


class VirtualTime(Turns):
    """While this context is open, the thread in it and those it starts live in the virtual time of a twin.

    twin: the machine; bytes go to and come from it at its times. port: name of the serial port that it is at; None: of
    every one that the host opens. wire: hears the line. limit_s: virtual seconds after which the host is ended; None:
    it may go on for ever.

    Names are replaced by stand_ins.py for as long. One at a time in a process: RuntimeError otherwise.
    When it is left, threads that are still there are ended: `HostEnded` is raised in them where they wait.
    """

    def __init__(
        self, twin: Twin, port: str | None = None, *, wire: WireTap | None = None, limit_s: float | None = None
    ) -> None:
        super().__init__(twin, wire, limit_s)
        self.ports = Ports(self, port)

    def _replace(self) -> Callable[[], None]:
        return replace_all(self, stand_ins(self.ports))
