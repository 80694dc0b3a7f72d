"""A G-code program, carried out block by block, in the order of LinuxCNC's interpreter.

Most lines are plain moves, G0 to G3 with X Y Z, I J or R, F and S in any order: they are matched as a whole. All others
become a block, and `Program._block` carries out what it says in the order of its lines, whatever the order of the
words.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import chain, islice, repeat

from isel_twin.cam.gcode import arcs, codes
from isel_twin.cam.gcode.motion import Motion
from isel_twin.cam.gcode.offsets import ORIGIN
from isel_twin.cam.gcode.words import Block, Lines
from isel_twin.cam.reader import HEAD_LINES, Once
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import (
    Arc,
    CamError,
    Coolant,
    Dwell,
    Element,
    End,
    Line,
    Output,
    PathMode,
    Place,
    Point,
    Rapid,
    Remark,
    Spindle,
    Stop,
    Tool,
)

_NUMBER = r"(?:[0-9]{1,6}\.?[0-9]{0,12}|\.[0-9]{1,12})"
_WORDS = "|".join(
    f"{letter}({sign}{_NUMBER})(?![^{letter}]*{letter})" for sign, of in (("-?", "XYZIJR"), ("", "FS")) for letter in of
)
_PLAIN = re.compile(
    rf"[ \t]*(?:N[0-9]{{1,9}}[ \t]*)?(?=([A-Z][-+.0-9]*))(?:G0?([0-3])(?![0-9.])[ \t]*)?"
    rf"(?:(?:{_WORDS})[ \t]*)*[\r\n]*\Z",
    re.I | re.A,
)
_END = re.compile(r"\s*(N\s*\d+\s*)?M(0?2|30)(?!\d)", re.I | re.A)
_LONG_DWELL_S = 60.0


def _to_percent(lines: Iterator[str]) -> tuple[list[str], int]:
    """The next lines, to where it is known if text stands above the program, and how many are that text: those above a
    % that has anything behind it."""
    head: list[str] = []
    text = 0
    for line in islice(lines, HEAD_LINES):
        head.append(line)
        if text and line.strip():
            return head, text
        percent = line.lstrip()[:1] == "%"
        if percent:
            text = len(head) - 1
        if _END.match(line) or (percent and not text):
            break
    return head, 0


class Program:
    """A program while it is read."""

    def __init__(self, settings: CamSettings) -> None:
        self._settings = settings
        self._once = Once()
        self._motion = Motion(settings, self._once)
        self._lines = Lines(settings.strict, settings.dialect, self._once)
        self._tool: int | None = None  # selected by T
        self._selected_at = Place(1)
        self._loaded: int | None = None
        self._turns = 0
        self._percent = self._ended = False

    def per_mm_s(self) -> float:
        """1 mm/s in the feeds of the line; 0 where they are none (G93)."""
        return self._motion.per_mm_s if not self._motion.inverse else 0.0

    def run(self, lines: Iterable[str]) -> Iterator[Element]:
        """Elements of the toolpath. Raises CamError."""
        motion = self._motion
        number, begun = 0, False
        lines = iter(lines)
        if self._settings.din:
            head, text_lines = _to_percent(lines)
            lines = chain(repeat("", text_lines), head[text_lines:], lines)
        for number, line in enumerate(lines, 1):
            match = _PLAIN.match(line) if motion.plain else None
            if match is not None and (made := self._plain(match, number)) is not None:
                yield from made
                continue
            text = line.rstrip("\r\n")
            first = text.lstrip()[:1]
            if not first:
                continue
            if first == "%":
                if self._percent or begun:
                    yield from self._at_percent(text, number, begun)
                    return
                if self._settings.strict and text.strip() != "%":
                    raise CamError("nothing may stand behind %", Place(number))
                self._percent = True
                continue
            if first == "/" and self._settings.block_delete:
                continue
            try:
                block, said = self._lines.block(text, number)
                yield from said
                begun = begun or bool(block.places) or (self._settings.strict)
                yield from self._block(block)
            except CamError as error:
                text_lines = 0 if self._percent or self._settings.strict else _to_percent(chain((line,), lines))[1]
                if not text_lines:
                    raise
                wrong = f"the line is no G-code, and % follows in line {number + text_lines}; if text stands above %"
                raise CamError(f"{wrong}, {codes.DIALECTS}", error.place) from None
            if self._ended:
                return
        place = Place(max(number, 1))
        if self._settings.strict:
            raise CamError("the file ends without % or M2; write M2 at its end", place)
        if not self._percent:
            yield from self._once("end", place, "the file ends without M2, M30 or %; it may be cut off")
        yield from self._end(place)

    def _plain(self, match: re.Match[str], number: int) -> tuple[Element, ...] | None:
        """Elements of a plain move; None, and nothing is changed, if it must become a block, which also finds what is
        wrong with it."""
        motion = self._motion
        word, code, x, y, z, i, j, r, f, s = match.groups()
        kind = motion.code or 0 if code is None else 10 * int(code)
        unit, at = motion.unit, motion.at
        feed = motion.feed if f is None else float(f) / motion.per_mm_s
        if feed <= 0.0 and kind:
            return None
        fx, fy, fz = at if motion.relative else ORIGIN
        to = tx, ty, tz = (
            at[0] if x is None else fx + float(x) * unit,
            at[1] if y is None else fy + float(y) * unit,
            at[2] if z is None else fz + float(z) * motion.unit_z,
        )
        bx, by, bz = motion.offsets.base
        place, end = Place(number, match.start(1) + 1, word), (tx + bx, ty + by, tz + bz)
        moved: Element
        if i is None and j is None and r is None:
            if kind > 10:
                return None
            moved = Line(place, end, feed) if kind else Rapid(place, end)
        else:
            if kind <= 10 or (centre := self._plain_centre(kind, to, i, j, r)) is None:
                return None
            middle = (centre[0] + bx, centre[1] + by, at[2] + bz)
            moved = Arc(place, end, middle, 2, -1 if kind == 20 else 1, feed)
        motion.code, motion.feed, motion.at = kind, feed, to
        made = (moved,) if x or y or z or kind > 10 else ()
        return made if s is None else (Spindle(Place(number, match.start(10), f"S{s}"), self._turns, float(s)), *made)

    def _plain_centre(self, kind: int, to: Point, i: str | None, j: str | None, r: str | None) -> arcs.Flat | None:
        """Centre of an arc in G17 by offsets or a radius; None: it must become a block."""
        motion = self._motion
        if not motion.flat or (r is not None and (i is not None or j is not None)):
            return None
        start, end, unit = motion.at[:2], to[:2], motion.unit
        if r is None:
            centre = start[0] + float(i or 0.0) * unit, start[1] + float(j or 0.0) * unit
            return centre if arcs.fits(start, end, centre, unit) else None
        try:
            return arcs.by_radius(start, end, float(r) * unit, kind == 20)
        except ValueError:
            return None

    def _at_percent(self, text: str, number: int, begun: bool) -> Iterator[Element]:
        place = Place(number, text.index("%") + 1, "%")
        if not self._percent:
            if self._settings.strict:
                raise CamError("% stands in the first line and in the last one", place)
            yield from self._once("%", place, "a % ends the file that had none at its beginning")
        yield from self._end(place)

    def _block(self, block: Block) -> Iterator[Element]:
        """In the order of LinuxCNC."""
        motion, g, m, words = self._motion, block.g, block.m, block.words
        for message in block.messages:
            yield Remark(block.place, message)
        if not block.places:
            return
        motion.check(block)
        motion.feed_mode(block)
        if "F" in words and not self._dwells_by_f(block):
            if words["F"] < 0.0:
                raise block.wrong("F must not be negative", "F")
            motion.set_feed(block)
        yield from self._switches(block)
        if g.get(codes.ONCE) == 40:
            yield from self._dwell(block)
        yield from motion.modes(block, self._loaded)
        if codes.PATH in g:
            yield self._path_mode(block)
        yield from motion.move(block)
        stop = m.get(codes.STOP)
        if stop in (0, 1):
            if stop == 0 or self._settings.optional_stop:
                yield Stop(block.at("M", stop), stop == 1)
        elif stop is not None:
            self._ended = True
            yield from self._end(block.at("M", stop))

    def _path_mode(self, block: Block) -> PathMode:
        """G61, G61.1, G64 P (cam/30)."""
        code, tolerance = block.g[codes.PATH], block.words.get("P")
        if code == 640 and tolerance is not None and tolerance < 0.0:
            raise block.wrong("P of G64 must not be negative", "P")
        return PathMode(block.at("G", code), code != 640, None if tolerance is None else tolerance * self._motion.unit)

    def _end(self, place: Place) -> Iterator[Element]:
        if self._tool is not None and self._loaded is None:
            text = f"T{self._tool} is selected, and no M6 of the file changes to it"
            yield from self._once("T", self._selected_at, text)
        yield End(place)

    def _switches(self, block: Block) -> Iterator[Element]:
        """Speed, tool, spindle, coolant."""
        m, words = block.m, block.words
        speed = words.get("S") if block.g.get(codes.ONCE) != 40 or "P" in words else None
        if speed is not None and speed < 0.0:
            raise block.wrong("S must not be negative", "S")
        if "T" in words:
            if words["T"] < 0.0 or words["T"] != int(words["T"]):
                raise block.wrong("T must be a whole number, 0 or more", "T")
            self._tool, self._selected_at = int(words["T"]), block.places["T"]
        if codes.DIGITAL in m:
            yield self._digital(block, m[codes.DIGITAL])
        if m.get(codes.OVERRIDE) == 52 and words.get("P", 1.0):
            yield from self._once("M52", block.at("M", 52), "M52: nothing adapts the feed here")
        turns = {3: 1, 4: -1, 5: 0, None: None}[m.get(codes.SPINDLE)]
        if codes.TOOL in m:
            yield from self._change(block.at("M", 6))
        if speed is not None or turns is not None:
            self._turns = self._turns if turns is None else turns
            place = block.places["S"] if turns is None else block.at("M", m[codes.SPINDLE])
            yield Spindle(place, self._turns, speed)
        coolant = m.get(codes.COOLANT)
        if coolant is not None:
            place = block.at("M", coolant)
            for number in (1, 2) if coolant == 9 else (9 - coolant,):
                yield Coolant(place, number, coolant != 9)
        for group, code in m.items():
            if group.startswith(codes.SWITCH):
                yield Output(block.at("M", code), f"M{abs(code)}", 1, int(code > 0))

    def _digital(self, block: Block, code: int) -> Output:
        """M62 and M64 switch the output P on, M63 and M65 off; all of them between motions (cam/49)."""
        number = block.words.get("P", -1.0)
        if number < 0.0 or number != int(number):
            raise block.wrong(f"M{code} wants P, the number of an output: a whole number, 0 or more")
        return Output(block.at("M", code), f"P{int(number)}", 1, int(code in (62, 64)))

    def _change(self, place: Place) -> Iterator[Element]:
        if self._turns:
            self._turns = 0
            yield Spindle(place, 0)
        if self._tool is None and not self._settings.strict:
            yield Stop(place)
            return
        self._loaded = self._tool or 0
        yield Tool(place, self._loaded)

    def _dwells_by_f(self, block: Block) -> bool:
        return block.g.get(codes.ONCE) == 40 and self._settings.din and "P" not in block.words

    def _dwell(self, block: Block) -> Iterator[Element]:
        """G4: P; S where CAM programs write so; F in DIN programs (cam/22)."""
        words, place = block.words, block.at("G", 40)
        seconds = words.get("P")
        if seconds is None and self._dwells_by_f(block):
            seconds = words.get("F")
        if seconds is None and not self._settings.strict:
            seconds = words.get("S")
        if seconds is None or seconds < 0.0:
            din = f"; if F are its seconds, {codes.DIALECTS}" if "F" in words and not self._settings.strict else ""
            raise CamError(f"G4 wants P, seconds of 0 or more{din}", place)
        if seconds > _LONG_DWELL_S:
            yield from self._once("G4", place, f"G4 waits {seconds:g} s: P is in seconds; ms were meant?")
        yield Dwell(place, seconds)
