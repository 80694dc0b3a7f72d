"""When programs are fed, and how the host is told to wait (manual 2.5.1, P8811; P8807; P11176).

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

AT_START: Final = 0x10
"""Of P8807, byte 1: it is loaded from Start on, not from the change of mode."""
XON, XOFF = b"\x11", b"\x13"


class Feeder:
    """Puts a `Feed` into the store when there is to be one, and takes it away."""

    def __init__(self, parameters: Parameters, store: Store) -> None:
        self._parameters, self._store = parameters, store
        self._told_to_wait = False
        """The host, by Xoff."""

    @property
    def wanted(self) -> bool:
        """Programs are fed."""
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
        """The program that is fed if blocks of it are lost, so that it cannot go on; empty: none."""
        feed = self._store.feed
        return feed.name if feed is not None and feed.given_up else ""

    def automatic(self, name: str) -> None:
        """The mode is one of those in which programs run; name: of the program to be started."""
        if self.wanted and not int(self._parameters.get(P.START_FLAGS_2)) & AT_START:
            self._arm(name)

    def start(self, name: str, *, from_the_middle: bool) -> None:
        """A program is started. Raises ProgramError M1269 if it is fed, and not from its first block on."""
        if not self.wanted:
            self.end()
            return
        if from_the_middle:
            raise ProgramError(Code.NOT_WHILE_FED, f"{name} is fed: it begins at its first block")
        self._arm(name)

    def end(self) -> None:
        """Nothing is fed any more."""
        if self._store.feed is not None:
            self._store.feed.give_up()
            self._store.feed = None

    def say(self) -> bytes:
        """What the host is to be told now: to wait, to go on, or nothing."""
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
