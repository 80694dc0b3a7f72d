"""Programs that are executed while they arrive (dripfeed), and flow control of the host (2.5.1, P8811; P8807; P11176).

    mode AUTO with P8811 = 1 (or Start, if P8807 says so)   the next program that comes is fed
    Start                                                    it is executed as soon as its first block is there
    end, abort, message, HAND                                the rest of it is discarded

RTS/CTS: no byte comes while the line is not clear to send. Xon/Xoff: the host must obey the characters.
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
    """Puts a `Feed` into the store when needed, and removes it."""

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
        """Name of the fed program if blocks of it are lost; empty: none."""
        feed = self._store.feed
        return feed.name if feed is not None and feed.given_up else ""

    def automatic(self, name: str) -> None:
        """Take the change to AUTO or SINGLE; name: of the program that Start begins."""
        if self._wanted and not int(self._parameters.get(P.START_FLAGS_2)) & AT_START:
            self._arm(name)

    def start(self, name: str, *, from_the_middle: bool) -> None:
        """Take the start of a program. Raises ProgramError M1269 for a fed one from the middle."""
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
        """Xoff or Xon for the host, if its state has changed."""
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
