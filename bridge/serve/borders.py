"""What a served line is made of, and what its parts need of each other: twin, line, endpoints, and who listens."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.pacing import Clocked
from isel_twin.controller import SerialFormat


class SerialTwin(Clocked, Protocol):
    """What the server needs of a twin."""

    @property
    def replies_due(self) -> int:
        """Bytes of replies still on the line; from a host that asks faster than it can answer, no more is taken."""

    @property
    def commands_due(self) -> int:
        """Bytes that were written and have not arrived: if it lets its host wait, no more is taken."""

    @property
    def serial_format(self) -> SerialFormat: ...
    def write(self, data: bytes) -> None: ...
    def read(self) -> bytes: ...


class WireTap:
    """Somebody who follows the traffic (wire_log.py); does nothing unless overridden."""

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        """Bytes have been sent by the host (`sent`) or have arrived there."""

    def look(self, time_ns: int) -> None:
        """Time has passed."""

    def act(self, time_ns: int, text: str) -> None:
        """Somebody beside the host has done something to the machine or to its time."""

    def close(self) -> None:
        """That was all."""


class SerialLine(Protocol):
    """What endpoints are attached to: the controller's line, a twin's (`Server`) or a real one's (tap.py)."""

    @property
    def serial_format(self) -> SerialFormat:
        """How the controller's bytes go over the line."""

    def receive(self, endpoint: Endpoint, data: bytes) -> None:
        """A host of this endpoint has sent `data` just now."""

    def claim(self, endpoint: Endpoint) -> bool:
        """A network client of this endpoint asks for the line; True if it may have it."""


class Endpoint(Protocol):
    """A place where hosts connect. It is given its `SerialLine` by `attach`, and from then on watched."""

    kind: str  # `pty`, `tcp`, `rfc2217`: the key of its address in the line that `serve` prints
    address: str  # what a host connects to
    gathers: bool  # bytes without a pause on a paced line go on in one piece, as from a terminal server

    @property
    def busy(self) -> bool:
        """True while a network client holds the line here."""

    @property
    def waiting(self) -> int:
        """Bytes for the host that it has not taken yet."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """How the host has set the port, as far as that can be seen: attributes of a pySerial port, baudrate first."""

    def attach(self, line: SerialLine) -> None:
        """The line that will watch this endpoint, to be told what hosts send."""
        return

    def watches(self, listening: bool) -> Iterable[FileWatch]:
        """Files to wait for now; no host is to be read while not `listening`: the line is full."""

    def send(self, data: bytes) -> None:
        """Bytes for the host. Never blocks; without a host they are lost."""
        return

    def give_way(self) -> None:
        """A new network client takes the line: let go of one that only waits for its last replies."""
        return

    def close(self) -> None:
        """Stop listening, let go of everything."""
        return
