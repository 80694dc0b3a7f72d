"""What pySerial ports in this process have in common: modem lines that nobody looks at, and how long they wait."""

from __future__ import annotations

from serial.serialutil import PortNotOpenError, SerialBase

from isel_twin.base.units import SECOND_NS

STRETCH_NS = SECOND_NS  # virtual time between two looks whether bytes can still come, if nobody waits for a time
PATIENCE_NS = 3600 * SECOND_NS  # virtual time of idleness after which no byte is expected of a controller


class NoModemLines(SerialBase):
    """A port whose other end is always there and ready; it never rings, and does not look at a break, RTS and DTR."""

    def _check_open(self) -> None:
        if not self.is_open:
            raise PortNotOpenError()

    def _unseen(self) -> None:
        """The controller does not look at it."""

    _update_break_state = _update_rts_state = _update_dtr_state = _unseen

    @property
    def cts(self) -> bool:
        self._check_open()
        return True

    dsr = cd = cts

    @property
    def ri(self) -> bool:
        self._check_open()
        return False
