"""Protocols between the parts of a served line: twin, line, endpoints, and taps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.pacing import Clocked
from isel_twin.controller import SerialFormat
from isel_twin.language import Language


class SerialTwin(Clocked, Protocol):
    """The twin, as needed by the server."""

    @property
    def replies_due(self) -> int:
        """Bytes of replies still on the line; if there are too many, no more is read from the host."""

    @property
    def commands_due(self) -> int:
        """Bytes written but not arrived; during a handshake wait no more is read from the host."""

    @property
    def serial_format(self) -> SerialFormat: ...
    @property
    def language(self) -> Language | None: ...
    def write(self, data: bytes) -> None: ...
    def read(self) -> bytes: ...


class WireTap:
    """An observer of the traffic (wire_log.py); methods do nothing unless overridden."""

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        """Bytes have been sent by the host (`sent`) or have arrived there."""

    def look(self, time_ns: int) -> None:
        """Time has passed."""

    def act(self, time_ns: int, text: str) -> None:
        """An operator has acted on the machine or its time."""

    def close(self) -> None:
        """End of the traffic."""


class SerialLine(Protocol):
    """The controller's line for endpoints: of a twin (`Server`) or a real one (tap.py)."""

    @property
    def serial_format(self) -> SerialFormat:
        """Form of the controller's bytes on the line."""

    @property
    def language(self) -> Language | None:
        """Of the controller, if it has one."""

    def receive(self, endpoint: Endpoint, data: bytes) -> None:
        """Take data that a host of this endpoint has just sent."""

    def claim(self, endpoint: Endpoint) -> bool:
        """A network client of this endpoint asks for the line; True if it may have it."""


class Endpoint(Protocol):
    """A place where hosts connect. It gets its `SerialLine` by `attach`, which then watches it."""

    kind: str  # `pty`, `tcp`, `rfc2217`: the key of its address in the line that `serve` prints
    address: str  # what a host connects to
    gathers: bool  # gather bytes without a pause on a paced line into one piece, as a terminal server does

    @property
    def busy(self) -> bool:
        """True while a network client holds the line here."""

    @property
    def waiting(self) -> int:
        """Bytes for the host that it has not taken yet."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """Known port settings of the host: attributes of a pySerial port, baudrate first."""

    def attach(self, line: SerialLine) -> None:
        """Take the line that will watch this endpoint and get the hosts' bytes."""
        return

    def watches(self, listening: bool) -> Iterable[FileWatch]:
        """Files to wait for now; no host may be read while not `listening`, as the line is full."""

    def send(self, data: bytes) -> None:
        """Bytes for the host. Never blocks; without a host they are lost."""
        return

    def give_way(self) -> None:
        """A new network client takes the line: disconnect one that only waits for its last replies."""
        return

    def close(self) -> None:
        """Stop listening and close everything."""
        return
