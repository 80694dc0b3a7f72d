"""A part of a toolpath: the lines of a file from one to another, with all that holds there (cam/41).

    lines 1 .. 41         followed, not made: point, tool, spindle, coolant, outputs
    line 42, first move   tool, spindle at its speed, ...; then over its start at the height of travel, down by rapid to
                          where the file's own plunges begin, and on at their feed
    .. line 60            made; then straight up, and the end of the program

Units, plane, zero and feed are in the elements already, as the reader has read the file from its beginning.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass

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
    Tool,
    Toolpath,
)


@dataclass(frozen=True)
class LineRange:
    """Lines of a file, from 1, both included. last: None for the end of the file. Raises ValueError."""

    first: int = 1
    last: int | None = None

    def __post_init__(self) -> None:
        if self.first < 1:
            raise ValueError(f"from-line {self.first}: lines of a file count from 1")
        if self.last is not None and self.last < self.first:
            raise ValueError(f"to-line {self.last}: is before line {self.first}, where the part begins")

    def __str__(self) -> str:
        return f"from line {self.first} on" if self.last is None else f"in lines {self.first} to {self.last}"


WHOLE = LineRange()


class Section:
    """The part of a toolpath that some lines of its file ask for."""

    def __init__(self, lines: LineRange, settings: CamSettings) -> None:
        self.not_made = ""  # lines that were left out, when it is through; "" for a whole file
        self.spindle_off = 0  # line before the first motion that has switched it off; 0: it turns, or never has
        self._lines = lines
        self._plunge_mm_s = settings.plunge_mm_s
        self._start = self._point = settings.machine_point(settings.start)
        self._travel = self._start[2]  # highest Z of a rapid
        self._entry: float | None = None  # highest Z at which a cut has followed a rapid
        self._plunge: float | None = None  # feed of the last cut straight down
        self._rapid = True  # nothing has been cut since the last rapid
        self._rpm: float | None = None
        self._running_up = False  # nothing has been cut since the spindle was switched on
        self._held: dict[Hashable, Element] = {}  # what holds, and events before the first motion, in their order
        self._left_out = self._moved = False
        self._motion: Place | None = None  # the last one

    def made(self, path: Toolpath) -> Toolpath:
        """The elements of these lines and what leads to them. Raises CamError if none of them moves the tool."""
        return path if self._lines == WHOLE else self._partly(path)

    def _partly(self, path: Toolpath) -> Iterator[Element]:
        first, last = self._lines.first, self._lines.last
        inside = begun = False
        element: Element | None = None  # None: what follows cannot be read
        for element in _read_to(path, last):
            line = element.place.line
            if isinstance(element, Caution):
                yield element
                continue
            if isinstance(element, End):
                break
            if last is not None and line > last:
                if isinstance(element, Remark):
                    continue
                break
            inside = inside or line >= first
            motion = isinstance(element, (Rapid, Line, Arc))
            if not inside:
                self._pass(element)
            elif not (begun or motion):
                self._hold(element)
            else:
                if not begun:
                    yield from self._begin(element)
                    begun = True
                self._follow(element)
                yield element
        else:
            element = None
        if not begun or self._motion is None:
            raise self._empty(element)
        cut = not isinstance(element, End)
        if cut:
            yield from self._lift(self._motion)
        self.not_made = self._told(cut)
        yield element if isinstance(element, End) else End(self._motion)

    def _pass(self, element: Element) -> None:
        """Keep what an element changes that is not made."""
        self._left_out = self._left_out or not isinstance(element, Remark)
        if isinstance(element, (PathMode, Tool, Spindle, Coolant, Output)):
            self._hold(element)
        elif isinstance(element, Dwell):
            spindle = self._held.get(Spindle)
            if self._running_up and isinstance(spindle, Spindle):
                self._held[Spindle] = spindle._replace(wait_s=spindle.wait_s + element.seconds)
        elif isinstance(element, (Rapid, Line, Arc, Reference)):
            self._moved = True
            self._follow(element)

    def _hold(self, element: Element) -> None:
        """Keep an event until the first motion; a later one of its kind takes its place."""
        key: Hashable = len(self._held), element.place
        if isinstance(element, Tool):
            key = Tool
            self._switch(turns=False, line=element.place.line)
            self._held.pop(Spindle, None)
            if self._rpm is not None:
                self._held[Spindle] = Spindle(element.place, 0, self._rpm)
        elif isinstance(element, Spindle):
            key = Spindle
            self._switch(turns=bool(element.turns), line=element.place.line)
            before = self._held.get(Spindle)
            wait_s = before.wait_s if isinstance(before, Spindle) and element.turns else 0.0
            self._rpm = self._rpm if element.speed_rpm is None else element.speed_rpm
            element = element._replace(speed_rpm=self._rpm, wait_s=max(element.wait_s, wait_s))
            self._running_up = bool(element.turns)
        elif isinstance(element, PathMode):
            key = PathMode
        elif isinstance(element, Coolant):
            key = Coolant, element.number
        elif isinstance(element, Output):
            key = Output, element.name, element.mask
        elif isinstance(element, Reference):
            self._start, self._moved = element.ends(self._start), True
            self._follow(element)
        self._held.pop(key, None)
        self._held[key] = element

    def _switch(self, *, turns: bool, line: int) -> None:
        before = self._held.get(Spindle)
        if turns:
            self.spindle_off = 0
        elif isinstance(before, Spindle) and before.turns:
            self.spindle_off = line

    def _follow(self, element: Element) -> None:
        if isinstance(element, Reference):
            self._point, self._rapid = element.ends(self._point), True
            return
        if isinstance(element, Rapid):
            self._travel = max(self._travel, element.to[2])
            self._rapid = True
        elif isinstance(element, (Line, Arc)):
            x, y, z = self._point
            if self._rapid:
                self._entry = z if self._entry is None else max(self._entry, z)
            if isinstance(element, Line) and element.to[:2] == (x, y) and element.to[2] < z:
                self._plunge = element.feed_mm_s
            self._rapid = self._running_up = False
        else:
            return
        self._point, self._motion = element.to, element.place

    def _begin(self, element: Element) -> Iterator[Element]:
        """Everything that holds is made so; then the tool goes to where this motion begins. A rapid is not begun where
        it begins, which may be in the work, but led to its end."""
        for held in self._held.values():
            if not (isinstance(held, Spindle) and not held.turns) and not (isinstance(held, Coolant) and not held.on):
                yield held
        if self._moved and isinstance(element, Rapid):
            yield from self._approach(element.place, element.to, self._plunge_mm_s)
        elif self._moved and isinstance(element, (Line, Arc)):
            yield from self._approach(element.place, self._point, element.feed_mm_s)

    def _approach(self, place: Place, to: Point, feed_mm_s: float) -> Iterator[Element]:
        """Up, across, down in the air by rapid, and down to the depth at the feed of the file's plunges. feed_mm_s: of
        the cut that follows."""
        x, y, z = to
        high = max(self._travel, z)
        level = high if self._entry is None else min(high, max(self._entry, z))
        if self._start[2] < high:
            yield Rapid(place, (self._start[0], self._start[1], high))
        yield Rapid(place, (x, y, high))
        if level < high:
            yield Rapid(place, (x, y, level))
        if z < level:
            yield Line(place, to, self._plunge or min(self._plunge_mm_s, feed_mm_s))

    def _lift(self, place: Place) -> Iterator[Element]:
        x, y, z = self._point
        if z < self._travel:
            yield Rapid(place, (x, y, self._travel))

    def _told(self, cut: bool) -> str:
        first, last = self._lines.first, self._lines.last
        before = "line 1" if first == 2 else f"lines 1 to {first - 1}"
        return " and ".join([before] * self._left_out + [f"all after line {last}"] * cut)

    def _empty(self, follows: Element | None) -> CamError:
        told = f"nothing moves the tool {self._lines}"
        near = [] if self._motion is None else [f"its last motion before is in line {self._motion.line}"]
        if follows is not None and not isinstance(follows, End):
            near.append(f"it goes on in line {follows.place.line}")
        return CamError(": ".join([told, *([", ".join(near)] if near else [])]))


def _read_to(path: Toolpath, last: int | None) -> Iterator[Element]:
    """The elements, without the error of a line behind the last one."""
    try:
        yield from path
    except CamError as error:
        if last is None or error.place is None or error.place.line <= last:
            raise
