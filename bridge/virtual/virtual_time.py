"""Virtual time for a host program in this process: turns for its threads, stand-ins for real functions, and a port."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from isel_twin.bridge.serve.borders import WireTap
from isel_twin.bridge.virtual.sockets import Network
from isel_twin.bridge.virtual.stand_ins import replace_all
from isel_twin.bridge.virtual.turns import Turns
from isel_twin.bridge.virtual.virtual_serial import Ports, stand_ins
from isel_twin.native import core

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin


class VirtualTime(Turns):
    """While this context is open, its thread and those it starts run in the virtual time of a twin.

    port: name of the twin's serial port; None: every port that the host opens. wire: gets the traffic. limit_s: virtual
    seconds after which the host is ended; None: no limit.

    stand_ins.py replaces names meanwhile. One at a time in a process: RuntimeError otherwise. At its end the remaining
    threads are ended: `HostEnded` is raised where they wait.
    """

    def __init__(
        self, twin: Twin, port: str | None = None, *, wire: WireTap | None = None, limit_s: float | None = None
    ) -> None:
        super().__init__(twin, wire, limit_s)
        self.ports = Ports(self, port)
        self.network = Network()

    def _replace(self) -> Callable[[], None]:
        core.load()  # in a checkout it may be compiled: that takes real time, not the host's
        return replace_all(self, stand_ins(self.ports))
