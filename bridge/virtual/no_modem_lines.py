"""What pySerial ports in this process have in common: modem lines that nobody looks at."""

from __future__ import annotations

from serial.serialutil import PortNotOpenError, SerialBase


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
