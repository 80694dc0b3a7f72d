"""Programs and parameters over the serial line: E/A traffic of the peripheral port (manual 3.10, P11170 on).

    CR LF  P1 CR LF  N10 ... CR LF  ...  # CR LF  04 CR LF          programs, Z: cycles
    CR LF  D  CR LF  K1:P 10: 1 S:$00000009 CR LF  q 3: 30000 ...   parameters; D+ with their status; a dash deletes
    CR LF  W  CR LF  K1:P 21000: 1 ...                              the same of the tool table; N, B: of zero points

Lines end in CR LF, CR or LF. A wrong line gives a message with its number, and the rest of the file is skipped.
The control sends nothing by itself; files that it is asked for have the same form.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Final

from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import P, Q
from isel_twin.firmware.bwo900.parameters import LOADED, Parameters
from isel_twin.firmware.bwo900.programs.feed import Feed
from isel_twin.firmware.bwo900.programs.lines import (
    BLANK,
    END,
    HANDSHAKE,
    MOST_LINE,
    PARAMETERS,
    TABLES,
    program_name,
)
from isel_twin.firmware.bwo900.programs.stored import Builder, Store

EOT: Final = 0x04  # end of a file, unless P11177 says otherwise
PROTECTED: Final = 0x01  # bit of P11178: programs are not overwritten (M1107)
LINE_MODE: Final = 0x01  # of q41, byte 1: blocks need no number (nc_line_mode, 3.9.2.2)
POSITIONED: Final = "P0"  # program of the positioning block, which is typed at the panel and needs no number (2.6.2)
MOST_OF_TABLE: Final = 10_000
_LINE = re.compile(
    r"\s*(?:K(?P<channel>\d+)\s*:?\s*)?(?P<area>[Pq])\s*(?P<number>\d+)\s*:\s*"
    r"(?P<value>--|[-–—\x96\x97]|\$[0-9A-Fa-f]+;?|[-+]?\d+(?:[.,]\d*)?(?:[Ee][-+]?\d+)?)"
    r"(?:\s*S(?P<how>[:|])\s*\$(?P<status>[0-9A-Fa-f]{1,8}))?\s*"
)


class Receiver:
    """Reads files from the line.

    written: called with (number, value, area, channel) after a file has set a parameter. locked: True for a program
    that must not be replaced now (M1105). memory_bytes: of all programs (M1256), 0: as many as there are.
    """

    def __init__(
        self,
        parameters: Parameters,
        store: Store,
        written: Callable[[int, float | None, str, int], None],
        locked: Callable[[str], bool],
        memory_bytes: int = 0,
    ) -> None:
        self._parameters, self._store, self._written, self._locked = parameters, store, written, locked
        self._memory_bytes = memory_bytes
        self._line = bytearray()
        self._number = 0
        self._sign = end_of_file(parameters)
        """The end of a file as it was when this one began, which may set another one."""
        self._kind = ""  # the present file: name of a program, D, D+, "?" for a skipped one; empty: none
        self._builder: Builder | Feed | None = None
        self.changed = False  # programs or parameters have changed; its reader resets it

    @property
    def busy(self) -> bool:
        """True within a file, even a skipped one, but not a fed program."""
        return bool(self._kind) and not isinstance(self._builder, Feed)

    def take(self, data: bytes) -> Iterator[ProgramError]:
        """Take bytes of the line; yields errors."""
        data = data.translate(None, HANDSHAKE)
        at = 0
        while (found := _ends(self._sign, end_of_file(self._parameters)).search(data, at)) is not None:
            self._more(data[at : found.start()])
            at = found.end()
            yield from self._end_of_line()
            if found[0] not in b"\r\n":
                yield from self._end_of_file()
                self._number, self._sign = 0, end_of_file(self._parameters)
        self._more(data[at:])

    def _more(self, data: bytes) -> None:
        """Keep a part of a line; of one that is too long just enough to detect that."""
        self._line += data[: max(MOST_LINE + 1 - len(self._line), 0)]

    def _end_of_line(self) -> Iterator[ProgramError]:
        if not self._line:
            return
        text, self._line = self._line.decode("latin-1"), bytearray()
        self._number += 1
        if len(text) > MOST_LINE:
            yield self._skip(Code.LINE_TOO_LONG, f"line {self._number}: more than {MOST_LINE} characters")
            return
        word = text.strip(BLANK)
        if not word:
            return
        if not self._kind:
            yield from self._begin(word)
        elif word == END:
            yield from self._end_of_file()
        elif self._kind in PARAMETERS:
            yield from self._parameter(word)
        elif self._builder is not None:
            try:
                self._builder.add(self._number, text)
            except ProgramError as error:
                yield self._skip(error.number, error.detail, error.infos)

    def _begin(self, word: str) -> Iterator[ProgramError]:
        if word in PARAMETERS:
            self._kind = word
        elif name := program_name(word):
            feed = self._store.feed
            if feed is not None and not feed.begun and name[0] == "P":
                feed.begun = True
                self._kind, self._builder = feed.name, feed
            else:
                lines = int(self._parameters.get(Q.LINE_MODE, 0.0, "q")) & LINE_MODE
                self._kind, self._builder = name, Builder(name, numbered=not lines and name != POSITIONED)
        else:
            yield self._skip(
                Code.WRONG_FILE,
                f"line {self._number}: {word[:20]!r}; a file begins with P or Z and a number, D, W or N",
            )

    def _skip(self, number: int, detail: str, infos: tuple[float, ...] = ()) -> ProgramError:
        if isinstance(self._builder, Feed):
            self._builder.give_up()
        self._kind, self._builder = "?", None
        return ProgramError(number, detail, infos=infos or (self._number,))

    def _end_of_file(self) -> Iterator[ProgramError]:
        kind, self._kind = self._kind, ""
        builder, self._builder = self._builder, None
        if builder is None:
            return
        if isinstance(builder, Feed):
            try:
                builder.end()
            except ProgramError as error:
                yield error
            return
        try:
            program = builder.program()
        except ProgramError as error:
            yield error
            return
        if self._locked(kind):
            yield ProgramError(Code.PROGRAM_BUSY, f"{kind} is being carried out")
            return
        others = sum(len(self._store[name].text) for name in self._store if name != kind)
        if self._memory_bytes and others + len(program.text) > self._memory_bytes:
            yield ProgramError(Code.MEMORY_FULL, f"{kind}; there are {self._memory_bytes} bytes")
            return
        if kind in self._store:
            if int(self._parameters.get(P.TRANSFER_OPTIONS)) & PROTECTED:
                yield ProgramError(Code.PROGRAM_KEPT, kind)
                return
            yield ProgramError(Code.PROGRAM_OVERWRITTEN, kind)
        self._store[kind] = program
        self.changed = True

    def _wrong(self, what: str) -> ProgramError:
        return ProgramError(Code.WRONG_LINE, f"line {self._number}: {what}", infos=(self._number,))

    def _parameter(self, word: str) -> Iterator[ProgramError]:
        match = _LINE.fullmatch(word)
        if match is None:
            yield self._wrong(f"{word[:40]!r}")
            return
        text, area = match["value"], match["area"]
        channel, number = int(match["channel"] or 1), int(match["number"])
        value: float | None = None
        try:
            if text[0] == "$":
                value = float(int(text.strip("$;"), 16))
            elif text[0] in "+-.0123456789" and text.strip("-"):
                value = float(text.replace(",", "."))
        except OverflowError:
            value = math.inf
        if value is not None and not math.isfinite(value):
            yield self._wrong(f"{word[:40]!r} is too large a number")
            return
        if self._kind in TABLES and (area, number) not in _table(self._parameters, self._kind):
            yield self._wrong(f"{area}{number} is not of the {TABLES[self._kind]}")
            return
        try:
            self._parameters.write(number, value, area, channel)
            if match["status"] is not None and self._kind == "D+":
                status = int(match["status"], 16) | (LOADED if value is not None else 0)
                self._parameters.set_status(number, status, area, channel, add=match["how"] == "|")
        except ProgramError as error:
            no_channel = error.number == Code.NO_CHANNEL
            yield ProgramError(Code.NO_FILE_CHANNEL, error.detail, infos=(self._number,)) if no_channel else error
            return
        self.changed = True
        self._written(number, value, area, channel)


@lru_cache
def _ends(sign: int, other: int) -> re.Pattern[bytes]:
    """Ends of lines: CR, LF, and both ends of a file."""
    return re.compile(b"[\\x0a\\x0d\\x%02x\\x%02x]" % (sign, other))


def end_of_file(parameters: Parameters) -> int:
    """The character that a file ends with (P11177)."""
    return int(parameters.given(P.END_OF_FILE, float(EOT))) & 0xFF


def table_file(parameters: Parameters, kind: str) -> str:
    """The tool table (W) or the zero points (N) as a file: those of its parameters that have a value."""
    p = parameters
    numbers = [n for _, n in sorted(_table(p, kind)) if p.loaded(n)]
    return "".join(f"{line}\r\n" for line in (kind, *(f"K1:P {n}: {p.get(n):.15g}" for n in numbers), END))


def _table(parameters: Parameters, kind: str) -> frozenset[tuple[str, int]]:
    """Area and numbers of the parameters of the tool table (W) or the zero points (N, B)."""
    p = parameters
    if kind == "W":
        first = int(p.get(Q.TOOL_TABLE, 21_000, "q"))
        count = int(p.get(Q.TOOLS, 0.0, "q")) * int(p.given(Q.TOOL_SIZE, 20.0, "q"))
    else:
        first = int(p.get(Q.ZERO_TABLE, 20_000, "q"))
        points = (7 + 6 * int(p.get(Q.ZERO_MORE, 0.0, "q"))) * (int(p.get(Q.ZERO_GROUPS, 0.0, "q")) + 1)
        count = points * int(p.given(Q.ZERO_SETS, 1.0, "q")) * int(p.given(Q.ZERO_AXES, 3.0, "q"))
    return frozenset(("P", n) for n in range(first, first + min(count, MOST_OF_TABLE)))


def parameter_file(parameters: Parameters, status: bool = True) -> str:
    """All parameters as a file, D+ with their status."""
    lines = ["D+" if status else "D"]
    known = dict(parameters.statuses())
    for q, value in parameters.items():
        tail = f" S:${known.get(q, 0) | LOADED:08X}" if status else ""
        lines.append(f"q {q}: {value:.15g}{tail}")
    return "".join(f"{line}\r\n" for line in (*lines, END))
