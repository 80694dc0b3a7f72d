"""Power of the drives: its conditions, and its request.

    Start, a key of an axis, a reference run --> request --> relay of the cabinet, reset of the drives
                                                 |  until `ready`, at most half a second
                                                 +--> switch(on): stages, brake

E-stop, the loss of the supply and a fault of a drive switch off.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.firmware.bwo900.messages import Code
from isel_twin.firmware.bwo900.realtime.axes import AXES
from isel_twin.firmware.bwo900.realtime.outgoing import Outgoing

POWER_NS: Final = 500 * MILLISECOND_NS


class Power:
    def __init__(self, levels: Mapping[str, bool], outgoing: Outgoing) -> None:
        """levels: of the inputs, kept up to date by the caller."""
        self._levels, self._outgoing = levels, outgoing
        self.faulty = [False] * AXES
        self.on = False
        self.until_ns: int | None = None  # limit of the wait for power; None: no wait

    @property
    def ready(self) -> bool:
        """True if E-stop, supply and drives allow motion."""
        return self._levels.get("estop", True) and self._levels.get("power", True) and not any(self.faulty)

    @property
    def there(self) -> bool:
        return self.on and self.ready

    @property
    def missing(self) -> int:
        return Code.EMERGENCY_STOP if not self._levels.get("estop", True) else Code.DRIVES_OFF

    def request(self, now_ns: int) -> None:
        """Ask the cabinet to close its relay, and reset drives with a fault."""
        self._outgoing.pulse("power_request")
        if any(self.faulty):
            self._outgoing.pulse("drive_reset")
        self.until_ns = now_ns + POWER_NS

    def switch(self, *, on: bool) -> None:
        self.on = on
        self._outgoing.output("stages", int(on))
        self._outgoing.output("brake", int(on))
