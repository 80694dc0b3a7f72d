"""What pySerial ports in this process have in common: modem lines that nobody looks at, and how long they wait."""

from __future__ import annotations

from serial.serialutil import PortNotOpenError, SerialBase

from isel_twin.base.units import SECOND_NS

STRETCH_NS = SECOND_NS
"""Virtual time between two looks whether bytes can still come, if nobody waits for a time."""

PATIENCE_NS = 3600 * SECOND_NS
"""Virtual time for which a controller may be idle before nothing is expected of it any more."""


class NoModemLines(SerialBase):
    """A port whose other end is always there and ready."""

    def _check_open(self) -> None:
        if not self.is_open:
            raise PortNotOpenError()

    def _update_break_state(self) -> None:
        """The controller does not look at a break."""

    def _update_rts_state(self) -> None:
        """The controller does not look at RTS."""

    def _update_dtr_state(self) -> None:
        """The controller does not look at DTR."""

    @property
    def cts(self) -> bool:
        """Always ready."""
        self._check_open()
        return True

    @property
    def dsr(self) -> bool:
        """Always there."""
        self._check_open()
        return True

    @property
    def ri(self) -> bool:
        """Never rings."""
        self._check_open()
        return False

    @property
    def cd(self) -> bool:
        """Always there."""
        self._check_open()
        return True
