"""Who may speak on a network port of the line: who begins as a host of this controller does.

A web page can make a browser send bytes to any port of this computer: what stands in the body of its request would be
commands of the controller. So the first line or frame of a connection is held until it is whole. If the controller's
language knows it as a beginning, it goes on, and so does all that follows; anybody else is turned away before a byte of
it reaches the line (bridge/22):

    @07 CR      -> to the line            GET / HTTP/1.1, a TLS greeting, STUN, any TOKEN and a blank    -> closed
    @0  <10 s>  -> closed                 CR LF  -> to the line, and the next line is looked at

A controller without a language, or whose language does not know beginnings, has to do with less: what looks like
one of STRANGERS is turned away, and what is silent for a moment before it does goes on.
"""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Sequence
from contextlib import suppress

from isel_twin.controller import offers
from isel_twin.language import KnowsBeginnings, Language, readable

PATIENCE_S = 10.0  # longest wait for the rest of a first line
HOLD_S = 0.25  # the same without a language that knows beginnings
LONGEST = 1024  # most bytes of a first line
SHOWN = 40  # bytes of a stranger in the log
_TOKEN = rb"[!#$%&'*+.^_`|~0-9A-Za-z-]+ *"
_SURE = 10  # bytes within which strangers show, except for an HTTP method, which may be longer
STRANGERS: Sequence[tuple[str, re.Pattern[bytes]]] = tuple(
    (name, re.compile(pattern, re.DOTALL))
    for name, pattern in (
        ("an SSH greeting", rb"SSH-"),
        ("an HTTP request, or another line of a word and a blank", _TOKEN + rb"(?<= )\S"),
        ("a TLS greeting", re.escape(bytes.fromhex("1603"))),
        ("WebRTC's imitation of one", re.escape(bytes.fromhex("80460103"))),
        ("a STUN message", rb"(..)?...." + re.escape(bytes.fromhex("2112a442"))),
        ("an SMB greeting", b"....[" + bytes.fromhex("feff") + b"]SMB"),
    )
)


class GreetingError(Exception):
    """The connection is not of a host; the message says of whom."""


class Gate:
    """Looks at the first bytes of a connection. language: of the controller."""

    def __init__(self, language: Language | None = None) -> None:
        self._knowing = language if offers(language, KnowsBeginnings) else None
        self._idle = b"" if self._knowing is None else self._knowing.idle
        self.patience_s = HOLD_S if self._knowing is None else PATIENCE_S
        self.held = b""
        self.open = False
        """No more is looked at."""

    def take(self, data: bytes) -> bytes:
        """The bytes that may go on, of those held and these. Raises GreetingError."""
        if self.open:
            return data
        data = self.held + data
        self.held = data.lstrip(self._idle)
        idle = data[: len(data) - len(self.held)]
        if not self.held:
            return idle
        begins = _unlike_strangers(self.held) if self._knowing is None else self._knowing.begins(self.held)
        if begins is False or (begins is None and len(self.held) > LONGEST):
            raise GreetingError(_stranger(self.held) or _shown(self.held))
        return idle + self._release() if begins else idle

    def lapse(self) -> bytes:
        """The bytes that go on when no more come for `patience_s`, or at all. Raises GreetingError."""
        if self.held and self._knowing is not None:
            raise GreetingError(f"{_shown(self.held)} and no more")
        return self._release()

    def _release(self) -> bytes:
        self.open, held, self.held = True, self.held, b""
        return held


def _stranger(data: bytes) -> str:
    """The name of whoever begins so, empty if unknown."""
    return next((name for name, pattern in STRANGERS if pattern.match(data)), "")


def _unlike_strangers(data: bytes) -> bool | None:
    """`KnowsBeginnings.begins` without knowing the language."""
    if _stranger(data):
        return False
    return None if len(data) < _SURE or re.fullmatch(_TOKEN, data) else True


def _shown(data: bytes) -> str:
    return readable(data[:SHOWN]) + (" ..." if len(data) > SHOWN else "")


class Alarm:
    """A file that becomes readable some time later."""

    def __init__(self, seconds: float) -> None:
        self._in, self.file = socket.socketpair()
        self._timer = threading.Timer(seconds, self._ring)
        self._timer.daemon = True
        self._timer.start()

    def _ring(self) -> None:
        with suppress(OSError):  # closed meanwhile
            self._in.send(b"\0")

    def close(self) -> None:
        self._timer.cancel()
        self._in.close()
        self.file.close()
