"""A toolpath as lines of a job: what is alike for all controllers.

    toolpath  --- written --->  Course: Move, Turn   --- Commands.move, .turn --->  lines, each with its place
                                Spindle, Dwell, ...  --- Commands.spindle, .dwell, ... -->

A controller gives its `Commands`. Before a change of a tool and at the end the tool goes away safely, Z first, and
comes back X and Y first (language/3). A stop is a remark (language/6).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple, Protocol

from isel_twin.cam import arcs
from isel_twin.cam.course import CLOSE, Course, Limits, Move, TravelError, Turn
from isel_twin.cam.following import Following, directions
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import (
    Arc,
    CamError,
    Caution,
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
    Reference,
    Remark,
    Spindle,
    Stop,
    Tool,
    Toolpath,
)
from isel_twin.cam.written import MachineAxes, Written

COOLANT = {1: "coolant", 2: "coolant2"}  # names in `CamSettings.outputs`
FIXED = 0.01  # by which a speed may differ from one that is set by hand


class Speed(NamedTuple):
    """A speed of the spindle that the controller is told."""

    rev_min: float
    share: float  # of the highest one, 0 .. 1


class Commands(Limits, Protocol):
    """The commands of one controller. What gives several lines may give none."""

    @property
    def both_senses(self) -> bool:
        """The spindle can turn counter-clockwise, too."""

    @property
    def speed_by(self) -> Literal["", "scale", "number"]:
        """The spindle is told its speed by a share of the highest one, by a number, or not at all."""

    def begin(self) -> Iterable[str]:
        """First lines: the controller is made ready and referenced."""

    def move(self, move: Move) -> Iterable[Written]:
        """Lines for this move, or for moves before it that were held back."""

    def turn(self, turn: Turn) -> Iterable[Written]: ...

    def held(self) -> Iterable[Written]:
        """Lines for the moves that are held back until now."""

    def settled(self, place: Place) -> Iterable[Written]:
        """Lines with which drives that follow come to rest before the next move; asked of machines with such drives."""

    def reference(self, axes: tuple[int, ...]) -> Iterable[str] | None:
        """A reference run of these axes in the midst of a job; None: it makes one before a program only."""

    def dwell(self, seconds: float) -> str: ...

    def spindle(self, turns: int, speed: Speed | None) -> Iterable[str] | None:
        """speed: None where none is told. None: it cannot be switched."""

    def coolant(self, number: int, on: bool) -> Iterable[str] | None:
        """number: as `Coolant` has it, a key of COOLANT."""

    def output(self, name: str, on: bool) -> Iterable[str] | None:
        """By its number in the settings (language/7)."""

    def remark(self, text: str) -> str: ...

    def end(self) -> Iterable[str]: ...


def pause(seconds: float) -> str:
    """A pause as a job file has it."""
    return f"<{seconds:.3f}s>"


def remark(text: str) -> str:
    """A remark of a job file."""
    return f"# {' '.join(text.split())}"


def written(path: Toolpath, axes: MachineAxes, settings: CamSettings, commands: Commands) -> Iterator[Written]:
    """The lines of a job that makes this path. Raises CamError at the place that cannot be made."""
    return _Writer(axes, settings, commands).lines(path)


class _Writer:
    def __init__(self, axes: MachineAxes, settings: CamSettings, commands: Commands) -> None:
        self._axes = axes
        self._course = Course(axes, settings, commands)
        self._following = Following(axes, settings)
        self._commands = commands
        self._settings = settings
        self._turns = 0  # of the spindle
        self._speed_rpm: float | None = None  # as the file has it, whether it turns or not
        self._top_rpm = settings.spindle_max_rpm or axes.spindle_max_rpm  # 0: not known
        self._tells_speed = commands.speed_by == "number" or bool(commands.speed_by and self._top_rpm)
        self._cooled: set[int] = set()
        self._exact = False  # drives that follow come to rest behind each motion
        self._away_from: Point | None = None  # where the tool stood before it was changed

    def lines(self, path: Toolpath) -> Iterator[Written]:
        commands, course, rapid_mm_s = self._commands, self._course, self._settings.rapid_mm_s
        yield from map(Written, commands.begin())
        yield from self._to_own("start", self._settings.start, Place(1), z_first=False)
        place = None
        for element in path:
            place = element.place
            if isinstance(element, (Line, Rapid, Arc)):
                if self._away_from is not None:
                    yield from self._back(element)
                if self._exact:
                    yield from commands.settled(place)
                if isinstance(element, Line):
                    yield from self._straight(place, element.to, element.feed_mm_s, rapid=False)
                elif isinstance(element, Rapid):
                    yield from self._straight(place, element.to, element.speed_mm_s or rapid_mm_s, rapid=True)
                else:
                    yield from self._arc(element)
            elif isinstance(element, End):
                break
            elif isinstance(element, PathMode):
                self._exact = element.exact and bool(self._axes.lag_s)
                self._following.bound(element.tolerance_mm)
            elif isinstance(element, Spindle):
                yield from self._spindle(element)
            else:
                yield from commands.held()
                yield from self._event(element)
            if course.cautions:
                yield from self._cautions()
        yield from self._end(place or Place(1))

    def _straight(self, place: Place, to: Point, speed: float, rapid: bool) -> Iterator[Written]:
        if self._following.matters:
            way = [end - at for end, at in zip(to, self._course.point, strict=True)]
            if self._following.corner(way, way, speed):
                yield from self._commands.settled(place)
        if (move := self._course.line(place, to, speed, rapid)) is not None:
            yield from self._commands.move(move)

    def _arc(self, arc: Arc) -> Iterator[Written]:
        if self._following.matters:
            of = arcs.shape(arc, self._course.point)
            arc = self._followed(arc, of)
            if self._following.corner(*directions(of), arc.feed_mm_s):
                yield from self._commands.settled(arc.place)
        for part in self._course.arc(arc):
            yield from self._commands.turn(part) if isinstance(part, Turn) else self._commands.move(part)

    def _followed(self, arc: Arc, of: arcs.Shape) -> Arc:
        """As slowly as the drives have to make it."""
        radius = min(of.start_radius, of.end_radius)
        fastest, why = self._following.fastest_mm_s(radius)
        if arc.feed_mm_s <= fastest * (1.0 + CLOSE):
            return arc
        self._course.caution("arc", arc.place, f"an arc of r {radius:.3g} mm is made at {fastest:.3g} mm/s: {why}")
        return arc._replace(feed_mm_s=fastest)

    def _event(self, element: Element) -> Iterator[Written]:
        commands, place = self._commands, element.place
        match element:
            case Reference():
                yield from self._reference(element)
            case Dwell():
                yield Written(commands.dwell(element.seconds), place)
            case Coolant():
                lines = commands.coolant(element.number, element.on)
                if element.on or lines is not None:  # what cannot be switched on need not be switched off
                    yield from self._switched(lines, place, COOLANT[element.number])
                (self._cooled.add if element.on else self._cooled.discard)(element.number)
            case Output():
                yield from self._output(element)
            case Tool():
                yield from self._change(element)
            case Stop():
                if not element.optional or self._settings.optional_stop:
                    yield Written(commands.remark("stop: the operator goes on from here"), place)
            case Remark():
                yield Written(commands.remark(element.text), place)
            case Caution():
                yield self._cautioned(element)

    def _reference(self, run: Reference) -> Iterator[Written]:
        """Make a reference run of the axes that there are (language/10)."""
        lines = self._commands.reference(tuple(axis for axis in run.axes if axis < self._axes.count))
        if lines is not None:
            yield from (Written(line, run.place) for line in lines)
            self._course.referenced(run)
            self._following.rest()
        elif (to := run.ends(self._course.point)) != self._course.point:
            text = "a reference run is made before a program only: here the axes go to its end by rapids, Z first"
            self._course.caution("reference", run.place, text)
            yield from self._to(to, run.place, z_first=True)

    def _spindle(self, spindle: Spindle) -> Iterator[Written]:
        """S counts until another one comes, also over a standstill; alone it switches nothing (language/11), and parts
        no motions that the controller joins."""
        place, turns, before = spindle.place, spindle.turns, self._speed_rpm
        only_speed = spindle.speed_rpm is not None and turns == self._turns
        if spindle.speed_rpm is not None:
            self._speed_rpm = spindle.speed_rpm
            self._check_speed(place, spindle.speed_rpm, bool(turns))
        elif turns and before is None and self._tells_speed:
            self._course.caution("no speed", place, "the spindle is switched on without a speed: it may stand")
        if turns < 0 and not self._commands.both_senses:
            text = "spindle counter-clockwise: the controller only switches it on, in the sense that it has"
            self._course.caution("sense", place, text)
        if not only_speed or (turns and self._tells_speed and self._speed_rpm != before):
            yield from self._commands.held()
            yield from self._switched(self._commands.spindle(turns, self._speed()), place, "spindle")
        self._turns = turns
        if spindle.wait_s > 0:
            yield from self._commands.held()
            yield Written(self._commands.dwell(spindle.wait_s), place)

    def _speed(self) -> Speed | None:
        if self._speed_rpm is None or not self._tells_speed:
            return None
        top = self._top_rpm
        rev_min = min(self._speed_rpm, top) if top else self._speed_rpm
        return Speed(rev_min, rev_min / top if top else 0.0)

    def _check_speed(self, place: Place, rev_min: float, on: bool) -> None:
        """Say what the spindle does not take."""
        fixed = self._axes.spindle_fixed_rpm
        told = f"a spindle speed of {rev_min:g} rev/min is"
        if self._tells_speed:
            if 0.0 < self._top_rpm < rev_min:
                self._course.caution("fast spindle", place, f"{told} more than it makes: {self._top_rpm:g} rev/min")
        elif (on or rev_min) and not (fixed and abs(rev_min - fixed) <= FIXED * fixed):
            why = f"by hand it stands at {fixed:g} rev/min" if fixed else "set it by hand"
            if self._commands.speed_by:
                why += ", or set [cam] spindle_max_rpm to its speed at 10 V"
            elif self._axes.spindle_max_rpm:
                why = "it follows an output that this controller has not, and stands"
            self._course.caution("speed", place, f"{told} not told to the spindle, nor is any other: {why}")

    def _output(self, output: Output) -> Iterator[Written]:
        for bit in range(output.mask.bit_length()):
            if output.mask >> bit & 1:
                numbered = f"{output.name}.{bit + 1}"
                name = output.name if output.mask == 1 and numbered not in self._settings.outputs else numbered
                on = bool(output.value >> bit & 1)
                lines = self._commands.output(name, on)
                if on or lines is not None:  # as coolant
                    yield from self._switched(lines, output.place, name)

    def _switched(self, lines: Iterable[str] | None, place: Place, name: str) -> Iterator[Written]:
        if lines is None:
            text = f"{name} is not switched: [cam] outputs does not say which output it is"
            self._course.caution(f"output {name}", place, text)
            return
        for line in lines:
            yield Written(line, place)

    def _change(self, tool: Tool) -> Iterator[Written]:
        place, course = tool.place, self._course
        if self._turns:
            yield from self._spindle(Spindle(place, 0))
        if self._settings.tool_change is not None:
            before = course.point
            yield from self._to_own("tool_change", self._settings.tool_change, place)
            self._away_from = self._away_from or before
        named = f"{tool.number} ({tool.name})" if tool.name else f"{tool.number}"
        yield Written(self._commands.remark(f"change to tool {named}; the spindle is off"), place)

    def _back(self, element: Rapid | Line | Arc) -> Iterator[Written]:
        """From where tools are changed to where this rapid leads or this cut begins, down at the end."""
        to = element.to if isinstance(element, Rapid) or self._away_from is None else self._away_from
        self._away_from = None
        yield from self._to(to, element.place, z_first=False)

    def _to_own(self, key: str, counters_mm: Point, place: Place, z_first: bool = True) -> Iterator[Written]:
        """To a point of the settings, which no zero of the work moves."""
        try:
            yield from self._to(self._settings.machine_point(counters_mm), place, z_first)
        except TravelError as error:
            raise CamError(f"{error}: change [cam] {key}") from None

    def _to(self, to: Point, place: Place, z_first: bool) -> Iterator[Written]:
        """By rapids, Z alone at the beginning or at the end."""
        x, y, z = self._course.point
        for point in ((x, y, to[2]) if z_first else (to[0], to[1], z), to):
            yield from self._straight(place, point, self._settings.rapid_mm_s, rapid=True)
        yield from self._commands.held()

    def _end(self, place: Place) -> Iterator[Written]:
        yield from self._commands.held()
        if self._settings.park is not None:
            yield from self._to_own("park", self._settings.park, place)
        if self._turns:
            yield from self._spindle(Spindle(place, 0))
        for number in sorted(self._cooled):
            yield from (Written(line, place) for line in self._commands.coolant(number, on=False) or ())
        yield from self._cautions()
        yield from (Written(line, place) for line in self._commands.end())

    def _cautions(self) -> Iterator[Written]:
        said, self._course.cautions = self._course.cautions, []
        yield from map(self._cautioned, said)

    def _cautioned(self, caution: Caution) -> Written:
        return Written(self._commands.remark(f"caution: {caution.text}"), caution.place, caution)
