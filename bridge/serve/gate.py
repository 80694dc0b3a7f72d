"""Who may speak on a network port of the line: anybody but programs that greet it as something else.

A web page can make a browser send bytes to any port of this computer: what stands in the body of its request would be
commands of the controller. So a connection that begins as no host does is closed before a byte of it reaches the line:

    GET, POST, OPTIONS ... and a blank    HTTP, WebSocket          0x16 0x03    TLS
    0x00 or 0x01 . . . 0x21 0x12 0xA4 0x42    STUN (WebRTC)        SSH-         SSH
    0x00 . . . 0xFF or 0xFE and SMB           SMB

A browser sends the first of these in one piece. A host may send its bytes one at a time, and may begin with the same
letter: they are held as long as they may still become a greeting, at most HOLD_S of silence (bridge/22).

    G  E  T  _   -> closed            G  0  -> to the line at once            G  <0.25 s>  -> to the line
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Sequence
from contextlib import suppress

HOLD_S = 0.25
ANY = None  # any byte

_METHODS = ("GET", "POST", "PUT", "HEAD", "OPTIONS", "DELETE", "PATCH", "CONNECT", "TRACE", "PRI")
GREETINGS: Sequence[tuple[str, Sequence[int | None]]] = (
    *(("an HTTP request", f"{method} ".encode()) for method in _METHODS),
    ("a TLS greeting", bytes.fromhex("1603")),
    ("an SSH greeting", b"SSH-"),
    *(("a STUN message", (kind, ANY, ANY, ANY, *bytes.fromhex("2112a442"))) for kind in (0, 1)),
    *(("an SMB greeting", (0, ANY, ANY, ANY, kind, *b"SMB")) for kind in (0xFE, 0xFF)),
)


class GreetingError(Exception):
    """The connection is not of a host; the message says of whom."""


class Gate:
    """Looks at the first bytes of a connection."""

    def __init__(self) -> None:
        self.held = b""
        self.open = False
        """No more is looked at."""

    def take(self, data: bytes) -> bytes:
        """The bytes that may go on, of those held and these. Raises GreetingError."""
        if self.open:
            return data
        self.held += data
        alike = [(name, pattern) for name, pattern in GREETINGS if _alike(self.held, pattern)]
        for name, pattern in alike:
            if len(self.held) >= len(pattern):
                raise GreetingError(name)
        return b"" if alike else self.release()

    def release(self) -> bytes:
        """The bytes held: they are of a host."""
        self.open, held, self.held = True, self.held, b""
        return held


def _alike(data: bytes, pattern: Sequence[int | None]) -> bool:
    """Is one the beginning of the other?"""
    return all(wanted in (ANY, byte) for byte, wanted in zip(data, pattern, strict=False))


class Alarm:
    """A file that becomes readable once, some time after `set`."""

    def __init__(self) -> None:
        self._in, self.file = socket.socketpair()
        self._timer: threading.Timer | None = None

    def set(self, seconds: float) -> None:
        """Anew: an alarm that was set before does not come."""
        self._cancel()
        self._timer = threading.Timer(seconds, self._ring)
        self._timer.daemon = True
        self._timer.start()

    def _ring(self) -> None:
        with suppress(OSError):  # closed meanwhile
            self._in.send(b"\0")

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def close(self) -> None:
        self._cancel()
        self._in.close()
        self.file.close()
