"""A pseudo terminal: a serial device that any program on this computer opens, /dev/pts/N, with a link to it if wanted.

    host program --open--> LINK -> /dev/pts/N  <=kernel=>  master --> Server

The slave side is kept open here too. So a host may close and reopen the device as often as it likes without the kernel
hanging up, and what it sets (raw mode, no echo) is in force before it comes. The baud rate a host sets is not looked
at: a pseudo terminal has no bit times; the twin's line has (server.py).

A link left behind by a server that was killed is replaced, also if its /dev/pts/N exists: the number may belong to
somebody else by now. A server claims its link (isel_twin.files), so it is known who lives and who was killed.
"""

from __future__ import annotations

import errno
import os
import selectors
import tty
from collections.abc import Iterable
from pathlib import Path

from isel_twin.bridge.server import Outbox, Server, Watch
from isel_twin.files import Claim

__all__ = ["PtyEndpoint"]


class PtyEndpoint:
    """A pseudo terminal; `link`: path of a symbolic link to it, made here and removed by `close`.

    Raises OSError if there is no pseudo terminal or the link's name is taken.
    """

    kind = "pty"
    gathers = False  # a device hands on each byte as it comes
    busy = False  # whether a program has the device open cannot be told, and does not matter

    def __init__(self, link: str | None = None) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.address = os.ttyname(self._slave)
        self.link = link
        self._outbox = Outbox(lambda data: os.write(self._master, data))
        self._claim: Claim | None = None
        if link is not None:
            try:
                self._claim = Claim(link)
                self._make_link(Path(link), self._claim.abandoned)
            except OSError:
                self.link = None
                self.close()
                raise

    def _make_link(self, link: Path, abandoned: bool) -> None:
        """Link to the device. A link that a killed server has left, or that leads nowhere, is replaced."""
        if link.is_symlink() and (abandoned or not link.exists()):
            link.unlink()
        elif os.path.lexists(link):
            raise OSError(errno.EEXIST, "exists already; remove it or choose another name for the link", str(link))
        link.symlink_to(self.address)

    def attach(self, server: Server) -> None:
        self._server = server

    def watches(self, listening: bool) -> Iterable[Watch]:
        events = (selectors.EVENT_READ if listening else 0) | (selectors.EVENT_WRITE if self._outbox else 0)
        return [Watch(self._master, events, self._ready)] if events else []

    def _ready(self) -> None:
        if self._outbox:
            self._outbox.flush()
        try:
            data = os.read(self._master, 4096)
        except BlockingIOError:
            return
        if data:
            self._server.receive(self, data)

    def send(self, data: bytes) -> None:
        self._outbox.put(data)

    def give_way(self) -> None:
        """Nothing to do: no network client here."""

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
