"""RFC 2217: a serial port over Telnet, for hosts that set baud rate and lines over the network.

    serial.serial_for_url("rfc2217://127.0.0.1:PORT")

The negotiation is pySerial's `serial.rfc2217.PortManager`. Line settings are accepted and reported back; their effect
on bytes is in server.py and tap.py.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import serial
from serial.rfc2217 import PortManager

from isel_twin.bridge.serve.tcp import CodecError
from isel_twin.controller import SerialFormat

SUBOPTION_BYTES = 256  # longest Telnet suboption taken from a client; those of RFC 2217 have at most a few bytes
SETTINGS = ("baudrate", "bytesize", "parity", "stopbits", "break_condition", "dtr", "rts")  # a client may set

DATA_BITS = (serial.FIVEBITS, serial.SIXBITS, serial.SEVENBITS, serial.EIGHTBITS)


@dataclass
class LineSettings:
    """The serial port for `PortManager`: settings that a client may read and set."""

    baudrate: int = 19_200
    bytesize: int = serial.EIGHTBITS
    parity: str = serial.PARITY_NONE
    stopbits: float = serial.STOPBITS_ONE
    xonxoff: bool = False
    rtscts: bool = False
    break_condition: bool = False
    dtr: bool = True
    rts: bool = True
    cts: bool = True
    dsr: bool = True
    ri: bool = False
    cd: bool = True

    def __setattr__(self, name: str, value: Any) -> None:
        """Raises ValueError for an impossible setting; `PortManager` then answers with the old value."""
        if (name == "bytesize" and value not in DATA_BITS) or (name == "baudrate" and value <= 0):
            raise ValueError(f"{name} {value}")
        super().__setattr__(name, value)

    def reset_input_buffer(self) -> None:
        """No effect: no unread bytes are kept here."""

    def reset_output_buffer(self) -> None:
        """No effect: written bytes are already on the line."""


class _Connection:
    def __init__(self, send: Callable[[bytes], None]) -> None:
        self.write = send


class Rfc2217Codec:
    """Telnet with the com port option on one connection. form: of the port until the client sets another."""

    def __init__(self, send: Callable[[bytes], None], form: SerialFormat = SerialFormat(19_200)) -> None:  # noqa: B008
        self._port = LineSettings(form.baud, form.data_bits, form.parity, form.stop_bits)
        self._manager = PortManager(self._port, _Connection(send))

    @property
    def settings(self) -> Mapping[str, Any]:
        """The client's settings: attributes of a pySerial port."""
        return {name: value for name, value in asdict(self._port).items() if name in SETTINGS}

    def decode(self, data: bytes) -> bytes:
        """Bytes for the line; negotiation is answered on the way. Raises CodecError for malformed Telnet."""
        try:
            line = b"".join(self._manager.filter(data))
        except (ValueError, KeyError, IndexError, TypeError, struct.error) as error:
            raise CodecError(f"malformed RFC 2217 option: {error}") from error
        if len(self._manager.suboption or b"") > SUBOPTION_BYTES:
            raise CodecError("endless RFC 2217 option")
        return line

    def encode(self, data: bytes) -> bytes:
        """Bytes for the connection, with Telnet's escape byte doubled."""
        return b"".join(self._manager.escape(data))
