"""A tool whose file has no heights: raised above the work, lowered to its depth, carried across."""

from __future__ import annotations

from collections.abc import Iterator

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Element, Line, Place, Point, Rapid, Tool


class Pen:
    """The tool of a plot or of a drill file: up it is at least `safe_mm` above the work (cam/32).

    down: is it lowered? x, y: where it is, mm from the zero of the work; tool: its number, None before the first one.
    """

    def __init__(self, settings: CamSettings) -> None:
        self._settings = settings
        self._zero = settings.machine_point(settings.zero)
        self._length = 0.0
        x, y, z = settings.machine_point(settings.start)
        self.x, self.y = x - self._zero[0], y - self._zero[1]
        self._height = z - self._zero[2]
        self.tool: int | None = None
        self.down = False

    def machine(self, x: float, y: float) -> Point:
        """A point of the work, at the height of the tool."""
        return self._zero[0] + x, self._zero[1] + y, self._zero[2] + self._length + self._height

    def raised(self, place: Place) -> Iterator[Element]:
        self.down = False
        if self._height < self._settings.safe_mm:
            yield from self._lifted(place)

    def lowered(self, place: Place, depth_mm: float) -> Iterator[Element]:
        """Straight into the work, if it is not there."""
        if not self.down:
            yield from self._lifted(place)
            self.down, self._height = True, -depth_mm
            yield Line(place, self.machine(self.x, self.y), self._settings.plunge_mm_s)

    def to(self, x: float, y: float, place: Place) -> Iterator[Element]:
        """A straight move, a cut if the tool is lowered."""
        if not self.down:
            yield from self.raised(place)
        if (x, y) != (self.x, self.y):
            self.x, self.y = x, y
            target = self.machine(x, y)
            yield Line(place, target, self._settings.feed_mm_s) if self.down else Rapid(place, target)

    def turned(self, x: float, y: float, centre: tuple[float, float], turns: int, place: Place) -> Iterator[Element]:
        """An arc of a lowered tool, positive counter-clockwise."""
        self.x, self.y = x, y
        yield Arc(place, self.machine(x, y), self.machine(*centre), 2, turns, self._settings.feed_mm_s)

    def changed(self, number: int, place: Place, name: str = "") -> Iterator[Element]:
        """Raised, and another tool from here on."""
        yield from self.raised(place)
        if number != self.tool:
            self.tool = number
            yield Tool(place, number, name)
            before, self._length = self._length, self._settings.tool_length_mm.get(number, 0.0)
            self._height += before - self._length

    def _lifted(self, place: Place) -> Iterator[Element]:
        if self._height != self._settings.safe_mm:
            self._height = self._settings.safe_mm
            yield Rapid(place, self.machine(self.x, self.y))
