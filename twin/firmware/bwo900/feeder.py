"""Programs that are carried out while they come (dripfeed), and how the host is told to wait (2.5.1, P8811; P8807;
P11176).

    mode AUTO with P8811 = 1 (or Start, if P8807 says so)   the next program that comes is fed
    Start                                                    it is carried out, as soon as its first block is there
    end, abort, message, HAND                                what comes of it still is thrown away

RTS/CTS: no byte comes while the line is not clear to send. Xon/Xoff: the host is told by a character, and trusted.
"""

from __future__ import annotations

from typing import Final

from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.feed import Feed
from isel_twin.firmware.bwo900.programs.stored import Store

AT_START: Final = 0x10  # bit of P8807: a program is fed from Start on, not from the change of mode
XON, XOFF = b"\x11", b"\x13"


class Feeder:
    """Puts a `Feed` into the store when there is to be one, and takes it away."""

    def __init__(self, parameters: Parameters, store: Store) -> None:
        self._parameters, self._store = parameters, store
        self._told_to_wait = False  # the host has got Xoff, and no Xon since

    @property
    def _wanted(self) -> bool:
        return self._parameters.get(P.FED) == 1.0

    @property
    def clear_to_send(self) -> bool:
        feed = self._store.feed
        return feed is None or not feed.waits or self._by_characters

    @property
    def level(self) -> int:
        """Bytes that wait (P8561)."""
        return 0 if self._store.feed is None else self._store.feed.level

    @property
    def failed(self) -> str:
        """The fed program, if blocks of it are lost so that it cannot go on; empty: none."""
        feed = self._store.feed
        return feed.name if feed is not None and feed.given_up else ""

    def automatic(self, name: str) -> None:
        """The mode has become AUTO or SINGLE; name: of the program that Start begins."""
        if self._wanted and not int(self._parameters.get(P.START_FLAGS_2)) & AT_START:
            self._arm(name)

    def start(self, name: str, *, from_the_middle: bool) -> None:
        """A program is started. Raises ProgramError M1269 if it is fed and is to begin in its middle."""
        if not self._wanted:
            self.end()
        elif from_the_middle:
            raise ProgramError(Code.NOT_WHILE_FED, f"{name} is fed: it begins at its first block")
        else:
            self._arm(name)

    def end(self) -> None:
        if self._store.feed is not None:
            self._store.feed.give_up()
            self._store.feed = None

    def say(self) -> bytes:
        """Xoff or Xon for the host, if what it was told last is no longer true."""
        waits = self._by_characters and self._store.feed is not None and self._store.feed.waits
        if waits == self._told_to_wait:
            return b""
        self._told_to_wait = waits
        return XOFF if waits else XON

    @property
    def _by_characters(self) -> bool:
        return self._parameters.get(P.HANDSHAKE) == 1.0

    def _arm(self, name: str) -> None:
        feed = self._store.feed
        if feed is None or feed.given_up:
            feed = self._store.feed = Feed(name)
        feed.name = name
