"""A pseudo terminal: a serial device that any program on this computer opens, /dev/pts/N, with a link to it if wanted.

    host program --open--> LINK -> /dev/pts/N  <=kernel=>  master --> Server

The slave side is kept open here too: a host may close and reopen the device without the kernel hanging up, and raw mode
is in force before it comes. A pseudo terminal has no bit times, but keeps the speed and the stop bits that a host sets;
data bits and parity stay 8N (Linux, `pty_set_termios`). At first it has the speed of the controller's line.

A link of a killed server is replaced, even if its /dev/pts/N exists, which may now belong to another program. A server
claims its link (isel_twin.base.files), which shows whether it still runs.
"""

from __future__ import annotations

import errno
import fcntl
import os
import selectors
import struct
import sys
import termios
import tty
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from isel_twin.base.files import Claim
from isel_twin.bridge.serve.borders import Endpoint, SerialLine
from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.outbox import Outbox


class PtyEndpoint(Endpoint):
    """A pseudo terminal; `link`: path of a symbolic link to it, made by `attach` and removed by `close`.

    Raises OSError if there is no pseudo terminal or the link's name is taken.
    """

    kind = "pty"
    gathers = False  # a device passes each byte on as it comes
    busy = False  # unknown for a device, and not needed

    def __init__(self, link: str | None = None) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.address = os.ttyname(self._slave)
        self.link = link
        self._outbox = Outbox(lambda data: os.write(self._master, data))
        self._listening = True
        self._claim: Claim | None = None
        if link is not None:
            try:
                if not Path(link).parent.is_dir():
                    raise NotADirectoryError(errno.ENOTDIR, "there is no such folder; make it first", link)
                self._claim = Claim(link)
                _make_room(Path(link), self._claim.abandoned)
            except OSError:
                self.link = None
                self.close()
                raise

    @property
    def waiting(self) -> int:
        return len(self._outbox)

    @property
    def settings(self) -> Mapping[str, Any]:
        return _settings(self._master)

    def attach(self, line: SerialLine) -> None:
        self._line = line
        _set_speed(self._slave, line.serial_format.baud)
        if self.link is not None:
            os.symlink(self.address, self.link)  # from now on there is somebody who answers

    def watches(self, listening: bool) -> Iterable[FileWatch]:
        self._listening = listening
        events = (selectors.EVENT_READ if listening else 0) | (selectors.EVENT_WRITE if self._outbox else 0)
        return [FileWatch(self._master, events, self._ready)] if events else []

    def _ready(self) -> None:
        if self._outbox:
            self._outbox.flush()
        if not self._listening:
            return
        try:
            data = os.read(self._master, 4096)
        except BlockingIOError:
            return
        if data:
            self._line.receive(self, data)

    def send(self, data: bytes) -> None:
        self._outbox.put(data)

    def close(self) -> None:
        if self._master < 0:
            return
        if self.link is not None and os.path.islink(self.link) and os.readlink(self.link) == self.address:
            os.unlink(self.link)
        if self._claim is not None:
            self._claim.release()
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1


def _make_room(link: Path, abandoned: bool) -> None:
    """Remove a link of a killed server, or a dangling one. Raises OSError if there is anything else."""
    if link.is_symlink() and (abandoned or not link.exists()):
        link.unlink()
    elif os.path.lexists(link):
        raise OSError(errno.EEXIST, "exists already; remove it or choose another name for the link", str(link))


_TCGETS2 = 0x802C542A  # Linux: settings with speeds in bit/s (asm-generic/ioctls.h, struct termios2)
_TCSETS2 = 0x402C542B
_CBAUD, _BOTHER = 0o010017, 0o010000  # Linux: the control flags' bits of the speed; the speed is a number of its own
_TERMIOS2 = struct.Struct("4I20B2I")
_NAMED = [name for name in dir(termios) if name.startswith("B") and name[1:].isdigit()]
_SPEEDS = {int(getattr(termios, name)): int(name[1:]) for name in _NAMED}  # in bit/s, by code of the system


def _settings(file: int) -> dict[str, Any]:
    """Speed and stop bits of a terminal set by a host, if known."""
    flags, speed = _flags_and_speed(file)
    known = {"baudrate": speed} if speed else {}
    return {**known, "stopbits": 2 if flags & termios.CSTOPB else 1}


def _flags_and_speed(file: int) -> tuple[int, int]:
    """Control flags, and the speed towards the host in bit/s; 0 if it has none or an unknown one."""
    if sys.platform == "linux":  # any number can be a speed there
        with suppress(OSError):
            values = _TERMIOS2.unpack(fcntl.ioctl(file, _TCGETS2, bytes(_TERMIOS2.size)))
            return values[2], values[-1]
    now = termios.tcgetattr(file)
    return now[2], _SPEEDS.get(now[5], 0)


def _set_speed(file: int, baud: int) -> None:
    """Set the first speed of a terminal: any number on Linux, elsewhere one of the named speeds."""
    if sys.platform == "linux":
        with suppress(OSError):
            values = list(_TERMIOS2.unpack(fcntl.ioctl(file, _TCGETS2, bytes(_TERMIOS2.size))))
            values[2] = values[2] & ~_CBAUD | _BOTHER
            values[-2:] = baud, baud
            fcntl.ioctl(file, _TCSETS2, _TERMIOS2.pack(*values))
            return
    codes = {speed: code for code, speed in _SPEEDS.items()}
    if baud in codes:
        now = termios.tcgetattr(file)
        now[4] = now[5] = codes[baud]
        termios.tcsetattr(file, termios.TCSANOW, now)
