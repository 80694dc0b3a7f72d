"""A drill file, carried out line by line: holes, slots and routs in its order, neither mirrored nor sorted."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from itertools import pairwise

from isel_twin.cam.excellon.numbers import INCH_MM, NumberFormat
from isel_twin.cam.excellon.words import Word, at_most_once, words
from isel_twin.cam.gcode.arcs import by_radius
from isel_twin.cam.pen import Pen
from isel_twin.cam.reader import Once
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Caution, Element, End, Place, Remark, Stop

DEPTH_MM = 1.8  # a board of 1.5 mm and the point of a drill (cam/44)
MOST_REPEATS = 100_000  # holes and lines that R and M02 make, in a file (cam/47)
_LOOSE_MM, _LOOSE = 0.01, 0.001  # radii of start and end of an arc may differ by one of these, as in NCP (cam/4)
_NAMED = re.compile(r"[A-Z]{2,}|[A-Z],|M(4[57]|9[78])\b\W", re.I | re.A)
_SILENT = {"FMAT,1", "FMAT,2", "VER,1", "ICI,OFF"}
_FMAT_1 = {1: 6, 2: 0, 24: 1, 26: 2, 27: 8, 0: 9}  # M codes of FMAT,1 in FMAT,2


class Program:
    """A drill file while it is read: mm from the zero of the work."""

    def __init__(self, settings: CamSettings) -> None:
        self._settings = settings
        self._once = Once()
        self._pen = Pen(settings)
        self._format = NumberFormat(self._once, settings.drill_format)
        self._header = False
        self._fmat_1 = False
        self._incremental = False
        self._mode = 5  # G00, G01, G02, G03: a rout; G05: holes
        self._at = (0.0, 0.0)  # as programmed, with the zero and the pattern in it
        self._zero = (0.0, 0.0)  # G93
        self._step = (0.0, 0.0)  # M02
        self._tools: dict[int, str] = {}  # diameters by number, for people
        self._tool: Word | None = None  # selected, before its first hole
        self._pattern: list[tuple[int, str]] | None = None  # lines from M25 on
        self._recording = False
        self._began = self._at  # of the pattern
        self._repeats = 0
        self._holes = False
        self._low, self._high = [math.inf, math.inf], [-math.inf, -math.inf]
        self._ended = False
        self._ahead: deque[tuple[int, str]] = deque()
        self._rest: Iterator[tuple[int, str]] = iter(())
        self._line = ""  # being read

    def run(self, lines: Iterable[str]) -> Iterator[Element]:
        """Elements of the toolpath. Raises CamError."""
        self._rest = enumerate(lines, 1)
        number = 1
        while (item := self._ahead.popleft() if self._ahead else next(self._rest, None)) is not None:
            number, line = item
            yield from self._read(number, line)
            if self._ended:
                break
        else:
            yield from self._once("end", Place(number), "the file ends without M30; it may be cut off")
        place = Place(number)
        yield from self._pen.raised(place)
        if assumed := self._format.assumed():
            xs, ys = (f"{low:.4g} to {high:.4g}" for low, high in zip(self._low, self._high, strict=True))
            where = f"; so X goes from {xs} mm, Y from {ys} mm" if self._holes else ""
            why = f"numbers are read as {assumed}, which the file does not say{where}; if not, set drill_format"
            yield Caution(self._format.first or place, why)
        yield End(place)

    def _lines_ahead(self) -> Iterator[str]:
        """From the line being read on; they are kept for being read."""
        yield self._line
        yield from (line for _, line in tuple(self._ahead))
        for item in self._rest:
            self._ahead.append(item)
            yield item[1]

    def _read(self, number: int, line: str) -> Iterator[Element]:
        self._line = line
        text, _, comment = line.partition(";")
        if comment and "FORMAT" in comment.upper():
            yield from self._format.commented(comment, Place(number, len(text) + 1, ";"))
        if not (begin := text.strip()):
            return
        if self._recording and self._pattern is not None:
            self._pattern.append((number, line))
        if begin[0] == "/":
            if self._settings.block_delete:
                return
            text = text.replace("/", " ", 1)
            begin = text.strip()
        place = Place(number, len(text) - len(text.lstrip()) + 1, begin)
        if begin == "%":
            self._header = False
        elif _NAMED.match(begin):
            yield from self._named(begin, place)
        elif begin:
            yield from self._statement(words(text, number))

    # What a file says of itself --------------------------------------------------------------------------------------

    def _named(self, text: str, place: Place) -> Iterator[Element]:
        """INCH, METRIC, ICI, FMAT, texts; settings of drilling machines, most of them in the header (cam/46)."""
        word, *rest = (part.strip().upper() for part in text.split(","))
        if word in ("INCH", "METRIC"):
            for part in (yield from self._format.header(word, rest, place)):
                yield from self._left_out(part, place)
        elif word == "ICI" and rest in ([], ["ON"], ["OFF"]):
            self._incremental = rest != ["OFF"]
        elif word == "FMAT" and rest in (["1"], ["2"]):
            self._fmat_1 = rest == ["1"]
        elif word[:3] in ("M45", "M47"):
            yield Remark(place, text[3:].lstrip(" ,"))
        elif word[:3] in ("M97", "M98"):
            yield from self._once("text", place, f"{word[:3]}: text is not drilled")
        elif text.upper() not in _SILENT:
            yield from self._left_out(text, place)

    def _left_out(self, text: str, place: Place) -> Iterator[Element]:
        yield from self._once(text, place, f"{text[:40]}: a setting of drilling machines, without effect")

    # Statements ------------------------------------------------------------------------------------------------------

    def _statement(self, found: list[Word]) -> Iterator[Element]:
        if found and found[0].letter == "N":
            found = found[1:]
        if found and found[0].letter == "T":
            found = yield from self._selected(found)
        if not found:
            return
        ends = [*(at for at, word in enumerate(found) if at and _begins(word) and found[0].letter != "R"), len(found)]
        for begin, end in pairwise([0, *ends]):
            yield from self._carried_out(found[begin:end])

    def _carried_out(self, found: list[Word]) -> Iterator[Element]:
        """A code with its numbers, a point, or both points of a slot."""
        code = next((word for word in found if word.letter in "GM"), found[0])
        if code.letter == "G" and code.whole == 85:
            split = found.index(code)
            yield from self._slot(found[:split], code, found[split + 1 :])
        elif code.letter == "G":
            yield from self._prepared(code, at_most_once(found, "XYAIJ"), found)
        elif code.letter == "M":
            yield from self._auxiliary(code, at_most_once(found, "XYR"), found)
        else:
            yield from self._plain(found)

    def _plain(self, found: list[Word]) -> Iterator[Element]:
        """Points, repeated holes, feeds and speeds."""
        given = at_most_once(found, "XYAIJR")
        self._nothing_else(found, "XYAIJRFSBHZ")
        yield from self._machine_words(found)
        if "R" in given:
            yield from self._repeated(given)
        elif "X" in given or "Y" in given:
            yield from self._point(found[0].place, given)
        elif given:
            raise CamError(f"{found[0].place.word[:20]} without X and Y", found[0].place)

    def _nothing_else(self, found: list[Word], letters: str) -> None:
        for word in found:
            if word.letter not in letters:
                raise CamError(f"{word.place.word[:20]} is no word of Excellon here", word.place)

    def _machine_words(self, found: list[Word]) -> Iterator[Element]:
        for word in found:
            if word.letter in "FSBHZ" and float(word.text):
                why = f"{word.place.word[:20]}: feeds, speeds and strokes of drilling machines have no effect; "
                yield from self._once("F", word.place, f"{why}plunge_mm_s and feed_mm_s do")

    def _selected(self, found: list[Word]) -> Generator[Element, None, list[Word]]:
        """T, with a diameter a definition; the words behind it are given back."""
        tool, number = found[0], found[0].whole
        end = next((index for index, word in enumerate(found) if word.letter not in "TCFSBHZ"), len(found))
        given = at_most_once(found[:end], "TCFSBHZ")
        yield from self._machine_words(found[:end])
        if "C" in given:
            self._tools[number] = self._diameter(given["C"])
        if not self._header or "C" not in given:
            self._tool = tool if number or number in self._tools else None  # T0 is no tool, but for some programs
        return found[end:]

    def _diameter(self, word: Word) -> str:
        """As people call it; digits without a point have leading zeros."""
        text = word.text if "." in word.text else ""
        unit = self._format.unit
        if not text or not unit:
            return word.text
        return f"{float(text) * (INCH_MM if unit == 'inch' else 1.0):.4g} mm"

    def _prepared(self, code: Word, given: Mapping[str, Word], found: list[Word]) -> Iterator[Element]:
        number = code.whole
        self._nothing_else(found, "GXYAIJFS")
        yield from self._machine_words(found)
        if number in (0, 1, 2, 3, 5, 81):
            self._mode = 5 if number == 81 else number
            if number in (0, 5, 81):
                yield from self._pen.raised(code.place)
        elif number in (90, 91):
            self._incremental = number == 91
        elif number == 93:
            zero = yield from self._numbers(given)
            self._zero = (zero.get("X", 0.0), zero.get("Y", 0.0))
            if any(self._zero):
                yield from self._once("G93", code.place, "G93: points count from there on from this one")
            return
        elif number in (41, 42):
            why = f"G{number} is not made: the centre of the tool goes where the file says"
            yield from self._once("G41", code.place, f"{why}; let the program that made it offset the way")
        elif number in (4, 7):
            yield from self._left_out(code.place.word, code.place)
            return
        elif number != 40:
            raise CamError(f"{code.place.word[:20]} is not read; {_ONE_BY_ONE}", code.place)
        if "X" in given or "Y" in given:
            yield from self._point(code.place, given)

    def _auxiliary(self, code: Word, given: Mapping[str, Word], found: list[Word]) -> Iterator[Element]:
        number = code.whole
        if self._fmat_1:
            number = _FMAT_1.get(number, number)
        place = code.place
        self._nothing_else(found, "MXYR" if number == 2 else "MXY")
        if given and number != 2:
            yield from self._once("M XY", place, f"X and Y behind {code.letter}{code.text} are left out")
        if number in (0, 30):
            self._ended = True
        elif number in (71, 72):
            self._format.switch("mm" if number == 71 else "inch")
        elif number in (48, 95):
            self._header = number == 48
        elif number in (14, 15):
            yield from self._changed(place)
            yield from self._lowered(place)
        elif number in (16, 17):
            yield from self._pen.raised(place)
        elif number in (6, 9):
            yield Stop(place, optional=number == 6)
        elif (act := _PATTERNS.get(number)) is not None:
            yield from act(self, code, given)
        elif number != 18:
            raise CamError(f"{place.word[:20]} is not read; {_ONE_BY_ONE}", place)

    # Points ----------------------------------------------------------------------------------------------------------

    def _numbers(self, given: Mapping[str, Word]) -> Generator[Element, None, dict[str, float]]:
        """Gives mm by letter."""
        made: dict[str, float] = {}
        for letter, word in given.items():
            if letter != "R":
                made[letter], said = self._format.mm(word.text, word.place, self._lines_ahead())
                yield from said
        return made

    def _target(self, mm: Mapping[str, float]) -> tuple[float, float]:
        base = self._at if self._incremental else [z + s for z, s in zip(self._zero, self._step, strict=True)]
        x, y = (base[axis] + mm[name] if name in mm else self._at[axis] for axis, name in enumerate("XY"))
        return x, y

    def _point(self, place: Place, given: Mapping[str, Word]) -> Iterator[Element]:
        self._header = False
        mm = yield from self._numbers(given)
        start, self._at = self._at, self._target(mm)
        if self._mode == 5:
            yield from self._hole(place)
        elif self._mode == 0:
            yield from self._changed(place)
            yield from self._pen.raised(place)
            yield from self._pen.to(*self._at, place)
        else:
            yield from self._routed(place, start, mm)

    def _reached(self, point: tuple[float, float]) -> None:
        self._holes = True
        for axis, value in enumerate(point):
            self._low[axis] = min(self._low[axis], value)
            self._high[axis] = max(self._high[axis], value)

    def _hole(self, place: Place) -> Iterator[Element]:
        yield from self._changed(place)
        yield from self._pen.raised(place)
        yield from self._pen.to(*self._at, place)
        yield from self._lowered(place)
        yield from self._pen.raised(place)

    def _changed(self, place: Place) -> Iterator[Element]:
        """The tool that was selected, before its first work."""
        if self._tool is not None:
            number = self._tool.whole
            if number not in self._tools:
                why = f"T{number} has no diameter in this file"
                yield from self._once("undefined", self._tool.place, why)
            yield from self._pen.changed(number, self._tool.place, self._tools.get(number, ""))
            self._tool = None
        elif self._pen.tool is None:
            yield from self._once("tool", place, "no tool is selected yet: the one in the spindle is taken")

    def _lowered(self, place: Place) -> Iterator[Element]:
        settings, tool = self._settings, self._pen.tool or 0
        if settings.depth_mm is None and tool not in settings.pen_depth_mm:
            why = f"the file has no depth: {DEPTH_MM:g} mm is taken, for a board of 1.5 mm; set depth_mm"
            yield from self._once("depth", place, why)
        self._reached((self._pen.x, self._pen.y))
        yield from self._pen.lowered(place, settings.depth_of(tool, DEPTH_MM))

    def _cut(self, place: Place) -> None:
        if self._settings.feed_mm_s <= 0.0:
            raise CamError("slots and routs have no feed; set feed_mm_s", place)

    def _slot(self, before: list[Word], code: Word, behind: list[Word]) -> Iterator[Element]:
        """G85: a cut from a hole to another (cam/45)."""
        self._cut(code.place)
        self._nothing_else([*before, *behind], "XY")
        if before:
            mm = yield from self._numbers(at_most_once(before, "XY"))
            self._at = self._target(mm)
        self._header = False
        yield from self._changed(code.place)
        yield from self._pen.raised(code.place)
        yield from self._pen.to(*self._at, code.place)
        yield from self._lowered(code.place)
        mm = yield from self._numbers(at_most_once(behind, "XY"))
        self._at = self._target(mm)
        self._reached(self._at)
        yield from self._pen.to(*self._at, code.place)
        yield from self._pen.raised(code.place)

    def _routed(self, place: Place, start: tuple[float, float], mm: Mapping[str, float]) -> Iterator[Element]:
        yield from self._changed(place)
        if not self._pen.down:
            why = f"G0{self._mode} before M15 moves above the work"
            yield from self._once("up", place, why)
            yield from self._pen.to(*self._at, place)
            return
        self._cut(place)
        self._reached(self._at)
        if self._mode == 1:
            yield from self._pen.to(*self._at, place)
            return
        clockwise = self._mode == 2
        if "A" in mm:
            try:
                centre = by_radius(start, self._at, mm["A"], clockwise)
            except ValueError as error:
                raise CamError(f"{error}".replace("R", "A", 1), place) from None
        elif "I" in mm or "J" in mm:
            centre = (start[0] + mm.get("I", 0.0), start[1] + mm.get("J", 0.0))
        else:
            raise CamError(f"G0{self._mode} has no centre; write A, its radius, or I and J", place)
        r0, r1 = math.dist(start, centre), math.dist(self._at, centre)
        if min(r0, r1) <= 1e-9 or abs(r0 - r1) > max(_LOOSE_MM, _LOOSE * max(r0, r1)):
            raise CamError(f"radii to start and end are {r0:.4f} and {r1:.4f} mm", place)
        yield from self._pen.turned(*self._at, centre, -1 if clockwise else 1, place)

    # Repeats ---------------------------------------------------------------------------------------------------------

    def _count(self, place: Place, number: int) -> None:
        self._repeats += number
        if self._repeats > MOST_REPEATS:
            raise CamError(f"more than {MOST_REPEATS} repeats in a file", place)

    def _repeated(self, given: Mapping[str, Word]) -> Iterator[Element]:
        """R: the last hole again so many times, each a step further."""
        place, times = given["R"].place, given["R"].whole
        self._count(place, times)
        mm = yield from self._numbers(given)
        for _ in range(times):
            self._at = (self._at[0] + mm.get("X", 0.0), self._at[1] + mm.get("Y", 0.0))
            yield from self._hole(place)

    def _pattern_begins(self, code: Word, given: Mapping[str, Word]) -> Iterator[Element]:
        self._pattern, self._recording, self._began = [], True, self._at
        yield from ()

    def _pattern_ends(self, code: Word, given: Mapping[str, Word]) -> Iterator[Element]:
        if self._pattern is None:
            raise CamError(f"{code.place.word} ends a pattern that has no beginning; write M25 before it", code.place)
        if self._recording:
            self._pattern.pop()  # its own line
        self._recording = False
        yield from ()

    def _stepped(self, code: Word, given: Mapping[str, Word]) -> Iterator[Element]:
        """M02: the pattern again, a step from where it was made last (cam/47)."""
        if self._pattern is None or self._recording:
            raise CamError(
                f"{code.place.word} repeats a pattern, which M25 begins and M01 ends; the end of a file is M30",
                code.place,
            )
        mm = yield from self._numbers(given)
        if not mm:
            return
        x, y = mm.get("X", 0.0), mm.get("Y", 0.0)
        for _ in range(given["R"].whole if "R" in given else 1):
            self._count(code.place, len(self._pattern) + 1)
            self._step = (self._step[0] + x, self._step[1] + y)
            self._at = self._began = (self._began[0] + x, self._began[1] + y)
            for number, line in self._pattern:
                for element in self._read(number, line):  # the lines of a path only grow
                    yield element if isinstance(element, Caution) else element._replace(place=code.place)

    def _steps_end(self, code: Word, given: Mapping[str, Word]) -> Iterator[Element]:
        self._at = (self._at[0] - self._step[0], self._at[1] - self._step[1])
        self._step, self._pattern, self._recording = (0.0, 0.0), None, False
        yield from ()


def _begins(word: Word) -> bool:
    """Does a code begin something of its own? G85 belongs to the point before it."""
    return word.letter in "GM" and not (word.letter == "G" and word.whole == 85)


_ONE_BY_ONE = "let the program that made the file write each hole and each way by itself"
_PATTERNS: Mapping[int, Callable[[Program, Word, Mapping[str, Word]], Iterator[Element]]] = {
    25: Program._pattern_begins,
    1: Program._pattern_ends,
    2: Program._stepped,
    8: Program._steps_end,
}
