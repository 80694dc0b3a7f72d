"""Common parts of pySerial ports in this process: unused modem lines, and times of waiting."""

from __future__ import annotations

from serial.serialutil import PortNotOpenError, SerialBase

from isel_twin.base.units import SECOND_NS

STRETCH_NS = SECOND_NS  # virtual time between checks whether bytes can still come, in waits without a timeout
PATIENCE_NS = 3600 * SECOND_NS  # virtual time of idleness after which no byte is expected of a controller


class NoModemLines(SerialBase):
    """A port whose other end is always ready; it never rings, and ignores break, RTS and DTR."""

    def _check_open(self) -> None:
        if not self.is_open:
            raise PortNotOpenError()

    def _unseen(self) -> None:
        """No effect on the controller."""

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
