"""`isel-twin serve --log wire`: each message on the line, with its time, direction and meaning.

    isel-twin:    12.345678 s  host  @07                       set the axes, initialise: X Y Z
    isel-twin:    12.346720 s  twin  0                         reply: done
    isel-twin:    12.400000 s  ctl   {"set": {"estop": "pressed"}}

Times are the virtual ones at which messages were complete. The controller's language explains them. Without one, bytes
are shown in hexadecimal, up to a silence of SILENCE_NS or a byte from the other side.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import NamedTuple

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.bridge.serve.borders import WireTap
from isel_twin.language import Language

log = logging.getLogger("isel_twin.wire")

SILENCE_NS = 20 * MILLISECOND_NS  # virtual time that ends a message without a language
LINE_BYTES = 32  # bytes of a line in hexadecimal, at most


class WireLine(NamedTuple):
    """A message, or an operation."""

    time_s: float  # virtual time
    who: str  # `host`, or the name of the controller or of others
    text: str
    meaning: str


def print_line(line: WireLine) -> None:
    text = f"{line.time_s:12.6f} s  {line.who:<4}  {line.text:<24}  {line.meaning}".rstrip()
    log.info("%s", text, extra={"each": True})


class Taps(WireTap):
    """Several taps as one."""

    def __init__(self, taps: Sequence[WireTap]) -> None:
        self._taps = tuple(taps)

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        for tap in self._taps:
            tap.carry(time_ns, data, sent)

    def look(self, time_ns: int) -> None:
        for tap in self._taps:
            tap.look(time_ns)

    def act(self, time_ns: int, text: str) -> None:
        for tap in self._taps:
            tap.act(time_ns, text)

    def close(self) -> None:
        for tap in self._taps:
            tap.close()


class WireLog(WireTap):
    """Explains the traffic, and calls `say` with each line. language: a fresh instance; None for hexadecimal.

    controller, others: names of the controller and of operators, in up to four letters.
    """

    def __init__(
        self,
        language: Language | None,
        controller: str = "twin",
        others: str = "ctl",
        say: Callable[[WireLine], None] = print_line,
    ) -> None:
        self._controller, self._others = controller, others
        self._language, self._say = language, say
        self._begun = bytearray()
        self._sent = True
        self._time_ns = 0

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        if self._language is not None:
            for message in self._language.messages(data, sent):
                self._print(time_ns, sent, message.text or _hex(message.data), message.explanation)
            self._time_ns = time_ns
            return
        if sent is not self._sent or time_ns - self._time_ns > SILENCE_NS:
            self._print_begun()
        self._sent, self._time_ns = sent, time_ns
        self._begun += data
        while len(self._begun) >= LINE_BYTES:
            self._print(time_ns, sent, _hex(self._begun[:LINE_BYTES]))
            del self._begun[:LINE_BYTES]

    def look(self, time_ns: int) -> None:
        if self._begun and time_ns - self._time_ns > SILENCE_NS:
            self._print_begun()

    def act(self, time_ns: int, text: str) -> None:
        self._print_begun()
        self._say(WireLine(time_ns / SECOND_NS, self._others, text, ""))

    def close(self) -> None:
        """Print incomplete messages."""
        self._print_begun()
        if self._language is not None:
            for sent in (True, False):
                if begun := self._language.rest(sent):
                    self._print(self._time_ns, sent, _hex(begun), "not complete")

    def _print_begun(self) -> None:
        if self._begun:
            self._print(self._time_ns, self._sent, _hex(self._begun))
            self._begun.clear()

    def _print(self, time_ns: int, sent: bool, text: str, explanation: str = "") -> None:
        self._say(WireLine(time_ns / SECOND_NS, "host" if sent else self._controller, text, explanation))


def _hex(data: bytes | bytearray) -> str:
    return data.hex(" ")
