"""An NCP program, carried out statement by statement: a line is matched as a plain move first, which most lines are."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping

from isel_twin.base.parameters import hint
from isel_twin.cam.arcs import PLANES, SENSE
from isel_twin.cam.ncp.drill import Drill
from isel_twin.cam.ncp.statement import Statement, parsed
from isel_twin.cam.reader import MOST, Once
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
    Place,
    Point,
    Rapid,
    Reference,
    Remark,
    Spindle,
    Stop,
    Tool,
)

_MOVE = re.compile(
    r"[ \t]*(?:N[0-9]{1,9}[ \t]+)?(MOVEABS|FASTABS)"
    r"(?:[ \t]+X(-?[0-9]{1,9}))?(?:[ \t]+Y(-?[0-9]{1,9}))?(?:[ \t]+Z(-?[0-9]{1,9}))?[ \t]*[\r\n]*\Z"
)
_PORT = re.compile(r"[ \t]*(A[0-9]{1,3})[ \t]*=[ \t]*([01]{8})[ \t]*\Z", re.I)
_BIT = re.compile(r"[ \t]*(A[0-9]{1,3})\.([1-8])[ \t]*=[ \t]*([01])[ \t]*\Z", re.I)

_PLANES = {"XY": 2, "YX": 2, "XZ": 1, "ZX": 1, "YZ": 0, "ZY": 0}  # the axis turned about
_LOOSE_MM, _LOOSE = 0.01, 0.001  # radii of start and end of an arc may differ by one of these (cam/4)


class Program:
    """Modal state while a program is read: lengths mm, in the zero that is active; speeds mm/s."""

    def __init__(self, settings: CamSettings) -> None:
        self.settings = settings
        self.once = Once()
        self.job_zero = settings.machine_point(settings.zero)
        self.base = self.job_zero  # machine point of the active zero
        self.tool_length = 0.0
        self.cleared = False  # by WPCLEAR: coordinates are the machine's, without the tool's length
        self.at: Point = self.program(settings.machine_point(settings.start))
        self.up = 1 if settings.file_z_up else -1  # of the numbers in the file
        self.per_mm = 1000.0
        self.rapid = 0.0
        self.feed = settings.feed_mm_s
        self.fed = False  # by VEL
        self.plane = _PLANES["XY"]
        self.drill = Drill()
        self.turns = 0  # of the spindle
        self.headed = self.named = self.ended = False  # named: by IMF_PBL

    def run(self, lines: Iterable[str]) -> Iterator[Element]:
        number = 0
        for number, line in enumerate(lines, 1):
            match = _MOVE.match(line)
            if match is not None and match.lastindex != 1 and self.headed and (self.fed or match[1] == "FASTABS"):
                yield self._move(match, number)
                continue
            statement = parsed(line, number)
            if isinstance(statement, Statement):
                yield from self._carried_out(statement)
                if self.ended:
                    return
            elif statement is not None:
                yield from self.once("(", statement, "a line that begins with ( is taken as a remark")
        place = Place(max(number, 1))
        yield from self.once("end", place, "the file ends without PROGEND; it may be cut off")
        yield End(place)

    def _move(self, match: re.Match[str], number: int) -> Element:
        """A plain move: the fast way for most lines."""
        word, x, y, z = match.groups()
        ax, ay, az = self.at
        per_mm = self.per_mm
        if x is not None:
            ax = int(x) / per_mm
        if y is not None:
            ay = int(y) / per_mm
        if z is not None:
            az = self.up * int(z) / per_mm
        self.at = (ax, ay, az)
        bx, by, bz = self.base
        place = Place(number, match.start(1) + 1, word)
        if word == "FASTABS":
            return Rapid(place, (ax + bx, ay + by, az + bz), self.rapid)
        return Line(place, (ax + bx, ay + by, az + bz), self.feed)

    def _carried_out(self, statement: Statement) -> Iterator[Element]:
        row = STATEMENTS.get(statement.word)
        self.named = self.named or statement.word == "IMF_PBL"
        statement.check_compiled(self.named)
        if row is None:
            raise CamError(
                f"unknown word {statement.place.word[:40]!r}; {hint(statement.word, STATEMENTS, 'NCP has')}",
                statement.place,
            )
        if not self.headed:
            self.headed = True
            if statement.word != "IMF_PBL":
                yield from self.once("head", statement.place, "there is no line IMF_PBL at the beginning")
        if statement.place.word != statement.place.word.upper() and statement.word != "IMF_PBL":
            yield from self.once("case", statement.place, "words in small letters are read like capitals")
        yield from row(self, statement) or ()

    # Points ----------------------------------------------------------------------------------------------------------

    def machine(self, point: Point) -> Point:
        return point[0] + self.base[0], point[1] + self.base[1], point[2] + self.base[2]

    def program(self, machine: Point) -> Point:
        return machine[0] - self.base[0], machine[1] - self.base[1], machine[2] - self.base[2]

    def rebase(self) -> None:
        """The active zero or the tool has changed; the tool stays where it is."""
        machine = self.machine(self.at)
        bx, by, bz = (0.0, 0.0, 0.0) if self.cleared else self.job_zero
        self.base = (bx, by, bz if self.cleared else bz + self.tool_length)
        self.at = self.program(machine)

    def mm(self, letter: str, value: float) -> float:
        """A coordinate or increment of the file."""
        return (self.up if letter in "ZK" else 1) * value / self.per_mm

    def end(self, words: Mapping[str, float], relative: bool) -> Point:
        """The end of a move: axes that are not named stay."""
        now = self.at if relative else (0.0, 0.0, 0.0)
        x, y, z = (
            now[axis] + self.mm(letter, words[letter]) if letter in words else self.at[axis]
            for axis, letter in enumerate("XYZ")
        )
        return x, y, z

    def _feed(self, place: Place) -> tuple[float, Iterable[Element]]:
        if self.feed <= 0.0:
            raise CamError(f"{place.word} comes before the first VEL; write VEL, or set feed_mm_s", place)
        if self.fed:
            return self.feed, ()
        said = self.once("feed", place, f"there is no VEL yet: the feed is feed_mm_s, {self.feed:g} mm/s")
        return self.feed, said

    # Motion ----------------------------------------------------------------------------------------------------------

    def move(self, statement: Statement) -> Iterator[Element]:
        words = statement.letters("XYZABC")
        _no_rotary(statement, words)
        if not words:
            raise statement.wrong("names no axis")
        self.at = self.end(words, statement.word.endswith("REL"))
        if statement.word.startswith("FAST"):
            yield Rapid(statement.place, self.machine(self.at), self.rapid)
        else:
            feed, said = self._feed(statement.place)
            yield from said
            yield Line(statement.place, self.machine(self.at), feed)

    def arc(self, statement: Statement) -> Iterator[Element]:
        """Arc or helix. Its centre is absolute; if only that fits, an offset from the start (cam/1)."""
        relative = statement.word.endswith("REL")
        words = statement.letters("XYZABCIJKW" if "HLX" in statement.word else "XYZABCIJK")
        _no_rotary(statement, words)
        end = self.end(words, relative)
        centre = self._centre(statement, words)
        if len(centre) < 2:
            yield from self.once(
                "centre", statement.place, "an arc without I or J: its centre has this axis of its start"
            )
        absolute = {axis: centre.get(axis, self.at[axis]) for axis in PLANES[self.plane]}
        if relative or not self._fits(absolute, end):
            by_offset = {axis: self.at[axis] + centre.get(axis, 0.0) for axis in PLANES[self.plane]}
            if not self._fits(by_offset, end):
                r0, r1 = self._radii(by_offset, end)
                told = f"the radii to start and end are {r0:.4f} and {r1:.4f} mm with its centre as an offset"
                if not relative:
                    r0, r1 = self._radii(absolute, end)
                    told += f", {r0:.4f} and {r1:.4f} mm as absolute"
                raise statement.wrong(told)
            if not relative:
                yield from self.once(
                    "offset",
                    statement.place,
                    "I and J are read as offsets from the start: only so the radii to start and end are equal",
                )
            absolute = by_offset
        feed, said = self._feed(statement.place)
        yield from said
        third = self.plane
        mirrored = (third == 1) ^ (self.up < 0 and third != 2)  # XZ is seen from -Y
        clockwise = statement.word.startswith("CW") ^ mirrored
        turns = self._turns(statement, words.get("W"), absolute, end, clockwise)
        x, y, z = (absolute.get(axis, self.at[axis]) for axis in range(3))
        self.at = end
        yield Arc(statement.place, self.machine(end), self.machine((x, y, z)), third, turns, feed)

    def _centre(self, statement: Statement, words: Mapping[str, float]) -> dict[int, float]:
        """Coordinates of the centre by axis, as far as they are written: I and J, in other planes also with K for Z
        (cam/3)."""
        third = self.plane
        letters = (
            ("J", "K") if third == 0 and "K" in words else ("I", "K") if third == 1 and "K" in words else ("I", "J")
        )
        for letter in "IJK":
            if letter in words and letter not in letters:
                raise statement.wrong(f"{letter} is not of this plane")
        axes = zip(PLANES[third], letters, strict=True)
        centre = {axis: self.mm("Z" if axis == 2 else "X", words[letter]) for axis, letter in axes if letter in words}
        if not centre:
            raise statement.wrong("has no centre I J")
        return centre

    def _radii(self, centre: Mapping[int, float], end: Point) -> tuple[float, float]:
        (first, a), (second, b) = centre.items()
        at = self.at
        return math.hypot(at[first] - a, at[second] - b), math.hypot(end[first] - a, end[second] - b)

    def _fits(self, centre: Mapping[int, float], end: Point) -> bool:
        r0, r1 = self._radii(centre, end)
        return min(r0, r1) > 1e-9 and abs(r0 - r1) <= max(_LOOSE_MM, _LOOSE * max(r0, r1)) + 1e-9

    def _turns(
        self, statement: Statement, sweep: float | None, centre: Mapping[int, float], end: Point, clockwise: bool
    ) -> int:
        """Signed turns; W, the whole sweep in degrees, must agree with start and end within one degree."""
        (first, a), (second, b) = centre.items()
        sense = -1 if clockwise else 1
        if sweep is None:
            return sense
        x0, y0, x1, y1 = self.at[first] - a, self.at[second] - b, end[first] - a, end[second] - b
        angle = math.degrees(math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1))
        angle = angle * sense * SENSE[self.plane] % 360.0
        angle = angle if angle > 1e-4 else 360.0
        turns = round((abs(sweep) - angle) / 360.0) + 1
        if turns < 1 or abs(angle + 360.0 * (turns - 1) - abs(sweep)) > 1.0:
            raise statement.wrong(f"W{sweep:g} does not lead to its end: that is at {angle:.1f} degrees, or turns more")
        return sense * turns

    def hole(self, statement: Statement) -> Iterator[Element]:
        """One hole; the tool stays above it."""
        words = statement.letters("XYZABC")
        _no_rotary(statement, words)
        if not words or "Z" in words:
            raise statement.wrong("wants X and Y of the hole; its depth stands in DRILLDEF")
        place, drill = statement.place, self.drill
        if 0.0 < (drill["D"] or 0.0) < 100.0:
            yield from self.once(
                "depth", place, "DRILLDEF D is in um: less than 100 is next to nothing; mm were meant?"
            )
        down = drill["V"]
        if down is None:
            down, said = self._feed(place)
            yield from said
        safe = drill.safe(self.per_mm, self.up)
        x, y, _ = self.end(words, False)
        if self.at[2] < safe:
            yield from self._rapid(place, (self.at[0], self.at[1], safe))
        yield from self._rapid(place, (x, y, self.at[2]))
        yield from self._rapid(place, (x, y, safe))
        for kind, value in drill.steps(statement, self.per_mm, self.up, self.settings.peck_clearance_mm):
            if kind == "feed":
                self.at = (x, y, value)
                yield Line(place, self.machine(self.at), down)
            elif kind == "rapid":
                yield from self._rapid(place, (x, y, value))
            else:
                yield Dwell(place, value)

    def _rapid(self, place: Place, to: Point) -> Iterator[Element]:
        """None if the tool is there."""
        if to != self.at:
            self.at = to
            yield Rapid(place, self.machine(to), self.rapid)

    def drill_def(self, statement: Statement) -> None:
        self.drill.define(statement, self.per_mm_s())

    # Modes -----------------------------------------------------------------------------------------------------------

    def per_mm_s(self) -> float:
        """1 mm/s in the feeds of the file."""
        return self.settings.per_mm_s(self.per_mm)

    def speed(self, statement: Statement) -> None:
        value = statement.number(1e9) / self.per_mm_s()
        if not 0.0 < value <= MOST:
            raise statement.wrong("must be more than 0")
        if statement.word == "VEL":
            self.feed, self.fed = value, True
        else:
            self.rapid = value

    def set_plane(self, statement: Statement) -> None:
        name = "".join(token for token, _ in statement.tokens)
        if name not in _PLANES:
            raise statement.wrong(f"{name[:20]!r} is no plane; allowed: XY, XZ, YZ")
        self.plane = _PLANES[name]

    def unit(self, statement: Statement) -> Iterator[Element]:
        statement.nothing()
        before, self.per_mm = self.per_mm, 1000.0
        if statement.word == "INCH":
            self.per_mm = 1000.0 / 25.4
            yield from self.once("inch", statement.place, "INCH: numbers are read as 1/1000 inch")
        self.drill.convert(self.per_mm / before)

    def zero(self, statement: Statement) -> None:
        words = [token for token, _ in statement.tokens]
        if statement.word == "WPCLEAR":
            statement.nothing()
            self.cleared = True
        elif statement.word == "WPZERO":
            if words != ["STANDARD"]:
                raise statement.wrong("wants STANDARD behind it")
            self.cleared, self.job_zero = False, self.settings.machine_point(self.settings.zero)
        else:
            if len(words) != 2 or words[1] != "ACT" or words[0] not in tuple("12345678"):
                raise statement.wrong("wants a number 1 .. 8 and ACT, as WPREG1ACT")
            number = int(words[0])
            if number not in self.settings.zeros:
                raise statement.wrong(f"zero {number} is not known; set zeros.{number} = [x, y, z]")
            self.cleared, self.job_zero = False, self.settings.machine_point(self.settings.zeros[number])
        self.rebase()

    # The machine -----------------------------------------------------------------------------------------------------

    def tool(self, statement: Statement) -> Iterator[Element]:
        number = int(statement.number(1e6))
        yield Tool(statement.place, number)
        self.tool_length = self.settings.tool_length_mm.get(number, 0.0)
        self.rebase()

    def spindle(self, statement: Statement) -> Iterator[Element]:
        turns, rpm, wait_ms = self.turns, None, 0.0
        tokens = iter(statement.tokens)
        if not statement.tokens:
            raise statement.wrong("wants ON, OFF, CW, CCW, RPM or TIME behind it")
        for token, at in tokens:
            if token in ("RPM", "TIME"):
                number, there = next(tokens, ("", at))
                value = statement.value(number, there, 0.0, 1e6 if token == "RPM" else 1e8)
                rpm, wait_ms = (value, wait_ms) if token == "RPM" else (rpm, value)
            elif token in _TURNS:
                turns = _TURNS[token]
            elif token == "ON":
                turns = turns or 1
            else:
                raise statement.wrong(f"{token!r} is unknown; allowed: ON, OFF, CW, CCW, RPM, TIME", at)
        self.turns = turns
        yield Spindle(statement.place, turns, rpm, wait_ms / 1000.0)

    def switch(self, statement: Statement) -> Iterator[Element]:
        words = [token for token, _ in statement.tokens]
        if len(words) != 1 or words[0] not in ("ON", "OFF"):
            raise statement.wrong("wants ON or OFF behind it")
        on = words[0] == "ON"
        if statement.word.startswith("COOLANT"):
            yield Coolant(statement.place, 2 if statement.word == "COOLANT2" else 1, on)
        else:
            yield Output(statement.place, statement.word, 1, int(on))

    def coolant_off(self, statement: Statement) -> Iterator[Element]:
        yield from self.once("coolant_off", statement.place, "COOLANT_OFF is read as COOLANT OFF")
        yield Coolant(statement.place, 1, False)

    def wait(self, statement: Statement) -> Iterator[Element]:
        yield Dwell(statement.place, statement.number(1e8) / 1000.0)

    def port(self, statement: Statement) -> Iterator[Element]:
        match = _PORT.match(statement.text)
        if match is None:
            raise statement.wrong("wants a port and its eight bits, as A4=00000001")
        yield Output(statement.place, match[1].upper(), 0xFF, int(match[2], 2))

    def bit(self, statement: Statement) -> Iterator[Element]:
        match = _BIT.match(statement.text)
        if match is None:
            raise statement.wrong("wants a bit 1 .. 8 of a port and its value, as A4.1=1")
        place = int(match[2]) - 1
        yield Output(statement.place, match[1].upper(), 1 << place, int(match[3]) << place)

    def halt(self, statement: Statement) -> Iterator[Element]:
        yield Stop(statement.place)

    def shown(self, statement: Statement) -> Iterator[Element]:
        """TYPE, and the name of the program behind IMF_PBL."""
        text = " ".join(statement.text.split())
        if text and (statement.word == "TYPE" or statement.text[0] in " \t"):
            yield Remark(statement.place, text)

    def no_effect(self, statement: Statement) -> None:
        statement.nothing()

    def stop(self, statement: Statement) -> Iterator[Element]:
        self.ended = True
        yield End(statement.place)

    def reference(self, statement: Statement) -> Iterator[Element]:
        """REF: of the axes named, all if none is (cam/35)."""
        named = "".join(token for token, _ in statement.tokens)
        if set(named) - {*"XYZ"}:
            raise statement.wrong(f"{named[:20]!r} names no axes of this machine; allowed: X, Y, Z")
        axes = tuple(axis for axis, letter in enumerate("XYZ") if not named or letter in named)
        run = Reference(statement.place, axes)
        self.at = self.program(run.ends(self.machine(self.at)))
        yield run


def _no_rotary(statement: Statement, words: Mapping[str, float]) -> None:
    for letter in "ABC":
        if letter in words:
            leave = "" if words[letter] else f"; leave {letter}0 out"
            raise statement.wrong(f"this machine has no axis {letter}{leave}")


_TURNS = {"CW": 1, "CCW": -1, "OFF": 0}
STATEMENTS: Mapping[str, Callable[[Program, Statement], Iterable[Element] | None]] = {
    "IMF_PBL": Program.shown,
    **dict.fromkeys(("FASTABS", "FASTREL", "MOVEABS", "MOVEREL"), Program.move),
    **dict.fromkeys(("CWABS", "CCWABS", "CWREL", "CCWREL", "CWHLXABS", "CCWHLXABS"), Program.arc),
    **dict.fromkeys(("VEL", "FASTVEL"), Program.speed),
    "PLANE": Program.set_plane,
    "DRILLDEF": Program.drill_def,
    "DRILL": Program.hole,
    "GETTOOL": Program.tool,
    "SPINDLE": Program.spindle,
    **dict.fromkeys(("COOLANT", "COOLANT2", "WPCLAMP", "PUMP", "LAMP", "POPTION1", "POPTION2"), Program.switch),
    "COOLANT_OFF": Program.coolant_off,
    "WAIT": Program.wait,
    "SETPORT": Program.port,
    "SETBIT": Program.bit,
    **dict.fromkeys(("WPCLEAR", "WPZERO", "WPREG"), Program.zero),
    **dict.fromkeys(("INCH", "METRIC"), Program.unit),
    "HALT": Program.halt,
    "TYPE": Program.shown,
    **dict.fromkeys(("INITTOOL", "PROGBEGIN"), Program.no_effect),
    "PROGEND": Program.stop,
    "REF": Program.reference,
}
