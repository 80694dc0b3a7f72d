"""Modes and motions of G-code: where the tool is, how numbers are read, and the elements that a block's motion makes.

Inside, everything is mm in the active coordinates, Z upwards, whatever unit and sense the file has.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator

from isel_twin.cam.arcs import seen_from_above
from isel_twin.cam.gcode import arcs, codes
from isel_twin.cam.gcode.cycles import Cycle
from isel_twin.cam.gcode.offsets import Offsets
from isel_twin.cam.gcode.words import Block
from isel_twin.cam.reader import Once
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, CamError, Dwell, Element, Line, Place, Point, Rapid, Reference

_AXES = "XYZ"
_CENTRES = "IJK"
_TAPPING_OR_REFERENCE = (
    'G74 is tapping, which needs a spindle that the axis follows; if it is a reference run, set dialect = "din"'
)
_USES = {  # which codes of a block give these letters a meaning; arcs and cycles come on top
    "H": {430},
    "L": {100},
    "P": {40, 100, 640},
    "Q": {640},
    "R": {100},
}


class Motion:
    """Modes that concern motion. code: of the motion, None before the first; feed: mm/s; in G93
    1/s, of the whole block."""

    def __init__(self, settings: CamSettings, once: Once) -> None:
        self._settings = settings
        self._once = once
        self.offsets = Offsets(settings)
        self.at = self._program(settings.machine_point(settings.start))
        self._up = 1 if settings.file_z_up else -1
        self._set_unit(1.0)
        self._unit_given = self._told_din = False
        self.code: int | None = None
        self.feed = 0.0
        self.inverse = False
        self._absolute = True
        self._centre_absolute: bool | None = None  # by G90.1 and G91.1; None: by neither
        self._found_offsets = False  # in DIN 66025: by an arc that fits only so
        self._plane = 170
        self._to_start = not settings.strict  # G98 (cam/17)
        self._cycle = Cycle()
        self._homes: dict[int, Point] = {}  # of G28, G30: machine points
        self.plain = self.flat = False  # may moves, may arcs be read without a block
        self.relative = False  # of plain moves: G91

    def _program(self, machine: Point) -> Point:
        x, y, z = self.offsets.base
        return machine[0] - x, machine[1] - y, machine[2] - z

    def _machine(self, point: Point) -> Point:
        x, y, z = self.offsets.base
        return point[0] + x, point[1] + y, point[2] + z

    def _set_unit(self, unit: float) -> None:
        self.unit, self.unit_z, self.per_mm_s = unit, unit * self._up, self._per_mm_s(unit)

    def _per_mm_s(self, unit: float) -> float:
        """A feed of 1 mm/s where lengths are in this unit."""
        return self._settings.per_mm_s(1.0 if self._settings.dialect == "winpc" else 60.0 / unit)

    def _mm(self, axis: int, value: float) -> float:
        return value * (self.unit_z if axis == 2 else self.unit)

    # What a block says before it moves -------------------------------------------------------------------------------

    def check(self, block: Block) -> None:
        """Raise CamError if axes or letters have no code that takes them, or two."""
        g, words = block.g, block.words
        axes = [letter for letter in _AXES if letter in words]
        once, code = g.get(codes.ONCE), g.get(codes.MOTION)
        takes = once in codes.TAKES_AXES
        if self._settings.dialect == "winpc" and codes.SYSTEM in g and axes:
            raise block.wrong("X Y Z behind G54 .. G59 move the zero on WinPC-NC, by what is not known here", axes[0])
        if once == 740 and not self._is_din():
            raise block.wrong(_TAPPING_OR_REFERENCE)
        if 500 in g.values() and ("S" in words or (axes and code is None)):
            raise block.wrong("G50 with S, or alone with X Y Z, is of lathes")
        if code is not None and code != 800 and takes:
            first, other = codes.name("G", code), codes.name("G", int(once or 0))
            remedy = "" if code in (20, 30) else f"; write {first} in a line of its own before it"
            raise block.wrong(f"{first} and {other} both take X Y Z{remedy}")
        if axes and not takes and (code == 800 or (code is None and self.code in (None, 800))):
            raise block.wrong(f"no motion takes {axes[0]}: none has come yet, or G80 has ended it", axes[0])
        if once in (520, 920) and not axes:
            raise block.wrong(f"{codes.name('G', once)} wants X, Y or Z")
        motion = self._to_be(block)
        arc, cycle = motion in (20, 30), motion in codes.CYCLES
        every, numbered = {*g.values()}, not codes.TAKES_P.isdisjoint(block.m.values())
        for letter in words:
            free = letter in "XYZFSTD" or (letter == "R" and (arc or cycle)) or (letter in _CENTRES and arc)
            free = free or (letter == "P" and (arc or cycle or numbered)) or (letter in "LQ" and cycle)
            if letter == "D" or not (free or every & _USES.get(letter, set())):
                holds = f": {codes.name('G', motion)} holds here" if motion is not None else ""
                raise block.wrong(f"no code of this line takes {letter}{holds}", letter)

    def _to_be(self, block: Block) -> int | None:
        """The motion of the block; None for none."""
        code = block.g.get(codes.MOTION)
        if code is not None:
            return code
        if block.g.get(codes.ONCE) in codes.TAKES_AXES or not any(letter in block.words for letter in _AXES):
            return None
        return self.code

    def feed_mode(self, block: Block) -> None:
        mode = block.g.get(codes.FEED)
        if mode is None:
            return
        if self._settings.strict or (mode == 930) != self.inverse:
            self.feed = 0.0
        self.inverse = mode == 930

    def set_feed(self, block: Block) -> None:
        """F, in the unit of its own line; it stays as fast when the unit changes (cam/18)."""
        unit = {None: self.unit, 200: arcs.INCH_MM, 700: arcs.INCH_MM}.get(block.g.get(codes.UNIT), 1.0)
        self.feed = block.words["F"] / (60.0 if self.inverse else self._per_mm_s(unit))

    def modes(self, block: Block, loaded: int | None) -> Iterator[Element]:
        """Plane, unit, length of the tool, system, distance, retract; then offsets and G28 G30."""
        g = block.g
        self._plane = g.get(codes.PLANE, self._plane)
        if codes.UNIT in g:
            yield from self._units(block)
        if codes.LENGTH in g:
            yield from self._length(block, loaded)
        here = self._machine(self.at)
        if codes.SYSTEM in g:
            self.offsets.select(codes.SYSTEMS[g[codes.SYSTEM]], block.at("G", g[codes.SYSTEM]))
            self.at = self._program(here)
        if codes.DISTANCE in g:
            self._absolute = g[codes.DISTANCE] == 900
        if codes.CENTRE in g:
            self._centre_absolute = g[codes.CENTRE] == 901
        if codes.RETRACT in g:
            self._to_start = g[codes.RETRACT] == 980
        once = g.get(codes.ONCE)
        if once == 530 and self._switches_zeros_off(block):
            if not self._settings.din:
                text = "G53 alone is read as DIN 66025 has it: zeros are off until G54 .. G59 come"
                yield from self._once("G53", block.at("G", once), text)
            here = self._machine(self.at)
            self.offsets.switch_off()
            self.at = self._program(here)
        elif once == 740:
            yield from self._reference(block)
        elif once in codes.TAKES_AXES or codes.CLEAR in g or once in (281, 301):
            if not self._unit_given and any(letter in block.words for letter in _AXES):
                yield from self._say_mm(block)
            yield from self._one_shot(block, once)

    def _is_din(self) -> bool:
        return self._settings.din or (self._told_din and not self._settings.strict)

    def _switches_zeros_off(self, block: Block) -> bool:
        """G53 in DIN 66025; elsewhere G53 alone means nothing (cam/35)."""
        if self._settings.strict or self._settings.dialect == "rs274":
            return False
        return self._settings.din or not any(letter in block.words for letter in _AXES)

    def _reference(self, block: Block) -> Iterator[Element]:
        """G74 of DIN 66025: of the axes named, all if none is (cam/35)."""
        place, given = block.at("G", 740), [axis for axis, letter in enumerate(_AXES) if letter in block.words]
        if any(block.words[_AXES[axis]] for axis in given):
            yield from self._once("G74", place, "the numbers behind X Y Z of G74 mean nothing here: Z goes first")
        run = Reference(place, tuple(given or range(3)))
        self.at = self._program(run.ends(self._machine(self.at)))
        yield run

    def _units(self, block: Block) -> Iterator[Element]:
        code = block.g[codes.UNIT]
        if code in (700, 710):
            dialect = "rs274" if self._settings.strict else self._settings.dialect
            if dialect == "rs274":
                instead = "G20" if code == 700 else "G21"
                wrong = f"{codes.name('G', code)} is not of this dialect; write {instead}"
                raise CamError(wrong, block.at("G", code))
            if not self._settings.din:
                self._told_din = True
                unit = "inch" if code == 700 else "mm"
                yield from self._once("G71", block.at("G", code), f"{codes.name('G', code)} is read as {unit}")
        else:
            self._told_din = False
        self._unit_given = True
        self._set_unit(arcs.INCH_MM if code in (200, 700) else 1.0)

    def _length(self, block: Block, loaded: int | None) -> Iterator[Element]:
        length = 0.0
        if block.g[codes.LENGTH] == 430:
            tool = block.words.get("H", loaded or 0)
            if tool < 0 or tool != int(tool):
                raise block.wrong("H must be a whole number, 0 or more", "H")
            lengths = self._settings.tool_length_mm
            if int(tool) not in lengths and tool:
                yield from self._once(
                    "G43",
                    block.at("G", 430),
                    f"the length of tool {int(tool)} is taken as 0: it is not in tool_length_mm",
                )
            length = lengths.get(int(tool), 0.0)
        here = self._machine(self.at)
        self.offsets.set_length(length)
        self.at = self._program(here)

    def _one_shot(self, block: Block, once: int | None) -> Iterator[Element]:
        values = {
            axis: self._mm(axis, block.words[letter]) for axis, letter in enumerate(_AXES) if letter in block.words
        }
        here = self._machine(self.at)
        zero = once in (520, 920) or (once == 100 and not block.words.get("P"))
        if zero and not self.offsets.active:
            raise block.wrong(
                f"{codes.name('G', once or 0)} stands behind G53, which switches zeros off; write G54 before it"
            )
        if once in (280, 300):
            yield from self._home(block, once, values)
            return
        if once in (281, 301):
            self._homes[once - 1] = here
        elif once == 100:
            self._set_system(block, values, here)
        elif once == 520:
            self.offsets.shift(values)
        elif once == 920:
            self.offsets.shift_here(values, self.at)
        if (clear := block.g.get(codes.CLEAR)) is not None:
            self.offsets.use_shift(clear == 923, forget=clear == 921)
        self.at = self._program(here)

    def _set_system(self, block: Block, values: dict[int, float], here: Point) -> None:
        kind, number = block.words.get("L"), block.words.get("P")
        if kind not in (2.0, 20.0):
            raise block.wrong("G10 wants L2 or L20; tables of tools are in tool_length_mm", "L")
        if number is None or number not in range(10):
            raise block.wrong("G10 wants P 0 .. 9, the number of the system", "P")
        if "R" in block.words and (block.words["R"] or kind == 20.0):
            raise block.wrong("R of G10 turns the coordinates: a rotation is not made", "R")
        system = int(number) or self.offsets.active
        if kind == 2.0:
            self.offsets.set_system(system, values)
        else:
            self.offsets.set_system_here(system, values, here)

    def _home(self, block: Block, once: int, values: dict[int, float]) -> Iterator[Element]:
        """G28, G30: by way of the point of the block to the stored one, Z first if that goes up (cam/28)."""
        place = block.at("G", once)
        if values:
            yield from self._careful(place, self._target(values))
        home = self._program(self._homes.get(once, (0.0, 0.0, 0.0)))
        yield from self._careful(place, self._with({axis: home[axis] for axis in values or range(3)}))

    def _careful(self, place: Place, to: Point) -> Iterator[Element]:
        if to[2] > self.at[2] and not self._settings.strict:
            yield from self._rapid(place, (self.at[0], self.at[1], to[2]))
        yield from self._rapid(place, to)

    def _rapid(self, place: Place, to: Point) -> Iterator[Element]:
        """None if the tool is there."""
        if to != self.at:
            self.at = to
            yield Rapid(place, self._machine(to))

    def _with(self, values: dict[int, float]) -> Point:
        x, y, z = (values.get(axis, old) for axis, old in enumerate(self.at))
        return x, y, z

    def _target(self, values: dict[int, float]) -> Point:
        """The end of a move, by G90 or G91."""
        if self._absolute:
            return self._with(values)
        return self._with({axis: self.at[axis] + value for axis, value in values.items()})

    def _say_mm(self, block: Block) -> Iterator[Element]:
        self._unit_given = True
        yield from self._once("unit", block.place, "there is no G20 or G21: numbers are read as mm")

    # Motion ----------------------------------------------------------------------------------------------------------

    def move(self, block: Block) -> Iterator[Element]:
        """Make the moves of the block."""
        code, words = self._to_be(block), block.words
        values = {axis: self._mm(axis, words[letter]) for axis, letter in enumerate(_AXES) if letter in words}
        if code is not None:
            self.code = code
            if not self._unit_given and values:
                yield from self._say_mm(block)
            if code not in codes.CYCLES:
                self._cycle.end()
            yield from self._made(block, code, values)
        elif block.g.get(codes.ONCE) == 530 and self.offsets.active:
            raise CamError("G53 wants X, Y or Z, with G0 or G1", block.at("G", 530))
        self.relative = not self._absolute
        self.plain = self._unit_given and not self.inverse and self.code in (0, 10, 20, 30)
        self.flat = self.plain and self._plane == 170 and self._reads_absolute() is False

    def _made(self, block: Block, code: int, values: dict[int, float]) -> Iterator[Element]:
        place = block.at("G", code) if codes.name("G", code) in block.places else block.place
        if block.g.get(codes.ONCE) == 530 and self.offsets.active:
            if code not in (0, 10):
                raise block.wrong("G53 goes with G0 or G1 only")
            if not self._absolute:
                raise block.wrong("G53 cannot be used with G91; write G90 in its line, and G91 again in the next one")
            base = self.offsets.base
            to = self._with({axis: value - base[axis] for axis, value in values.items()})
        else:
            to = self._target(values)
        if code == 0 and values:
            self.at = to
            yield Rapid(place, self._machine(to))
        elif code == 10 and (values or self._settings.strict):
            length = math.dist(self.at, to)
            feed = yield from self._feed(block, length)
            self.at = to
            if length or not self.inverse:
                yield Line(place, self._machine(to), feed)
        elif code in (20, 30):
            yield from self._arc(block, place, to)
        elif code in codes.CYCLES:
            yield from self._hole(block, place, code, values)

    def default_feed(self, place: Place) -> Iterator[Element]:
        """Take feed_mm_s, as no F has come yet. Raises CamError if none is set."""
        usual = self._settings.feed_mm_s
        if usual <= 0.0 or self._settings.strict:
            setting = "" if self._settings.strict else ", or set feed_mm_s"
            raise CamError(f"there is no feed yet; write F before the first cut{setting}", place)
        self.feed = usual
        yield from self._once("feed", place, f"there is no F yet: the feed is feed_mm_s, {usual:g} mm/s")

    def _feed(self, block: Block, length: float) -> Generator[Element, None, float]:
        """Yields a caution, returns mm/s."""
        if self.inverse:
            if "F" not in block.words or self.feed <= 0.0:
                raise block.wrong("in G93 each line of G1, G2 and G3 wants F")
            return length * self.feed
        if self.feed <= 0.0:
            yield from self.default_feed(block.place)
        return self.feed

    def _arc(self, block: Block, place: Place, to: Point) -> Iterator[Element]:
        third = arcs.PLANES[self._plane]
        first, second = seen_from_above(third)
        clockwise = (self.code == 20) ^ (self._up < 0 and third != 2)
        turns = block.words.get("P", 1.0)
        if turns != int(turns) or not 1 <= turns <= 1e6:
            raise block.wrong("P of an arc must be a whole number, 1 or more", "P")
        start, end = (self.at[first], self.at[second]), (to[first], to[second])
        try:
            centre = yield from self._centre(block, start, end, clockwise)
        except ValueError as error:
            raise block.wrong(str(error)) from None
        signed = -int(turns) if clockwise else int(turns)
        middle = self._with({first: centre[0], second: centre[1]})
        angle = arcs.sweep(start, end, centre, signed)
        r0, r1 = arcs.radii(start, end, centre)
        length = math.hypot((r0 + r1) / 2.0 * angle, to[third] - self.at[third])
        feed = yield from self._feed(block, length)
        self.at = to
        yield Arc(place, self._machine(to), self._machine(middle), third, signed, feed)

    def _centre(
        self, block: Block, start: arcs.Flat, end: arcs.Flat, clockwise: bool
    ) -> Generator[Element, None, arcs.Flat]:
        """Yields a caution, returns the centre. Raises ValueError."""
        third, words = arcs.PLANES[self._plane], block.words
        axes, other = seen_from_above(third), _CENTRES[third]
        letters = [_CENTRES[axis] for axis in axes]
        if words.get(other) is not None and (words[other] or self._settings.strict):
            leave = "" if words[other] else "; leave it out"  # of more than 0 it may be another plane, or a pitch
            raise ValueError(f"{other} is not of this plane{leave}")
        given = {
            axis: self._mm(axis, words[letter]) for axis, letter in zip(axes, letters, strict=True) if letter in words
        }
        if "R" in words:
            if given:
                raise ValueError("an arc has R or I J K, not both")
            return arcs.by_radius(start, end, words["R"] * self.unit, clockwise)
        if not given:
            raise ValueError("an arc wants its centre I J K, or its radius R")
        if self._centre_absolute and len(given) < 2:
            raise ValueError(f"with G90.1 an arc wants both {' and '.join(letters)}")
        offset = (start[0] + given.get(axes[0], 0.0), start[1] + given.get(axes[1], 0.0))
        absolute = (given.get(axes[0], start[0]), given.get(axes[1], start[1]))
        reads = self._reads_absolute()
        fitting = [centre for centre in (offset, absolute) if arcs.fits(start, end, centre, self.unit)]
        if reads is None and fitting:
            if len(fitting) == 2 and offset != absolute:
                raise ValueError(f"{' '.join(letters)} may be offsets or absolute; write G91.1 or G90.1 before it")
            reads = fitting[0] is absolute
            kind = "absolute" if reads else "offsets from the start"
            yield from self._once("din arcs", block.place, f"I J K are read as {kind}: only so the radii are equal")
        if reads and self._centre_absolute is None and fitting == [offset]:
            reads, self._found_offsets = False, True
            yield from self._once(
                "din arcs", block.place, "I J K are read as offsets from the start: only so the radii are equal"
            )
        centre = absolute if reads else offset
        if centre not in fitting:
            readings = offset, absolute
            raise ValueError(arcs.misfit(" ".join(letters), self.unit, (start, end), readings, bool(reads)))
        return centre

    def _reads_absolute(self) -> bool | None:
        """Is a centre absolute? G90.1 and G91.1 say so; else DIN 66025 by G90, all others never, and None where nobody
        knows (cam/26)."""
        if self._centre_absolute is not None:
            return self._centre_absolute
        if self._settings.dialect == "din":
            return self._absolute and not self._found_offsets
        return None if self._told_din else False

    def _hole(self, block: Block, place: Place, code: int, values: dict[int, float]) -> Iterator[Element]:
        if not values:
            return
        if self.inverse:
            raise block.wrong("cycles want G94 and F a minute")
        feed = yield from self._feed(block, 0.0)
        along, series = arcs.PLANES[self._plane], self._cycle.series
        repeats = self._cycle.take(block, code, along, self._mm(along, 1.0), self.unit, self.at[along])
        yield from self._cycle.unused(block, self._settings.strict, self._once)
        clear, bottom = self._cycle.heights(block, self._absolute)
        across = {axis: value for axis, value in values.items() if axis != along}
        if series is not None and (told := self._cycle.unlike(series, self.at[along], clear, self._to_start)):
            yield from self._once(told, place, told)
        if self.at[along] < clear:
            yield from self._rapid(place, self._with({along: clear}))
        for _ in range(repeats):
            yield from self._rapid(place, self._target(across))
            yield from self._rapid(place, self._with({along: clear}))
            for kind, value in self._cycle.steps(clear, bottom, self._to_start):
                if kind == "dwell":
                    yield Dwell(place, value)
                elif kind == "rapid":
                    yield from self._rapid(place, self._with({along: value}))
                elif value != self.at[along]:
                    self.at = self._with({along: value})
                    yield Line(place, self._machine(self.at), feed)
