"""A plot, carried out: the pen is the tool, raised to safe_mm above the work, lowered to its depth (cam/32)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping

from isel_twin.cam.hpgl.scan import Instruction, instructions
from isel_twin.cam.pen import Pen
from isel_twin.cam.reader import Once
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Element, End, Place

UNIT_MM = 0.025
DEPTH_MM = 0.5  # of the lowered pen, if the settings have none
MOST_POLYGON = 100_000  # instructions in the buffer of a polygon
MOST_ANGLE = 36_000.0

Flat = tuple[float, float]  # plotter units


class Plot:
    """A plot while it is read. pen: where it is, plotter units."""

    def __init__(self, settings: CamSettings) -> None:
        self._settings = settings
        self._once = Once()
        self._tool = Pen(settings)
        self.pen: Flat = (self._tool.x / UNIT_MM, self._tool.y / UNIT_MM)
        self._depth = settings.depth_of(0, DEPTH_MM)
        self._relative = False
        self._corners: tuple[float, ...] = ()  # P1, P2 by IP
        self._scale = self._no_scale = (1.0, 0.0, 1.0, 0.0)  # plotter units = factor * number + shift, in X and in Y
        self._polygon: list[Instruction] = []
        self._corner: Flat | None = None  # where the polygon being told began
        self._began: Flat = self.pen  # the last polygon

    def run(self, lines: Iterable[str]) -> Iterator[Element]:
        """Elements of the toolpath. Raises CamError."""
        place = Place(1)
        for told in instructions(lines):
            place = told.place
            if self._corner is None and told.code in _POINTS and not told.odd:
                yield from self.points(told)
                continue
            if self._corner is not None and told.code != "PM":
                if told.code in _IN_POLYGONS:
                    if len(self._polygon) >= MOST_POLYGON:
                        raise CamError(f"a polygon of more than {MOST_POLYGON} points; draw it with PD", place)
                    self._polygon.append(told)
                continue
            yield from self._carried_out(told)
        yield from self._raised(place)
        yield End(place)

    def _carried_out(self, told: Instruction) -> Iterator[Element]:
        if told.odd:
            yield from self._once("odd", told.place, "a number too many: points are pairs, the last number is left out")
        if told.code in REFUSED:
            raise CamError(f"{told.code} is refused: {REFUSED[told.code]}", told.place)
        act = INSTRUCTIONS.get(told.code)
        if act is not None:
            yield from act(self, told) or ()
        elif told.code not in IGNORED:
            yield from self._once(told.code, told.place, f"{told.code} is not known and left out")

    # The pen ---------------------------------------------------------------------------------------------------------

    def _raised(self, place: Place) -> Iterator[Element]:
        return self._tool.raised(place)

    def _lowered(self, place: Place) -> Iterator[Element]:
        if not self._tool.down and self._settings.feed_mm_s <= 0.0:
            raise CamError("a plot has no feed; set feed_mm_s", place)
        return self._tool.lowered(place, self._depth)

    def _set_pen(self, down: bool, place: Place) -> Iterator[Element]:
        return self._lowered(place) if down else self._raised(place)

    def _to(self, to: Flat, place: Place) -> Iterator[Element]:
        """A straight move with the pen as it is."""
        self.pen = to
        return self._tool.to(to[0] * UNIT_MM, to[1] * UNIT_MM, place)

    def _turn(self, centre: Flat, degrees: float, place: Place) -> Iterator[Element]:
        """An arc about the centre, positive counter-clockwise."""
        if not abs(degrees) <= MOST_ANGLE:
            raise CamError(f"an arc of {degrees:g} degrees; allowed: up to {MOST_ANGLE:g}", place)
        x, y = self.pen[0] - centre[0], self.pen[1] - centre[1]
        if not degrees or not (x or y):
            return
        angle = math.radians(degrees)
        end = (
            centre[0] + x * math.cos(angle) - y * math.sin(angle),
            centre[1] + x * math.sin(angle) + y * math.cos(angle),
        )
        if degrees % 360.0 == 0.0:
            end = self.pen
        if not self._tool.down:
            yield from self._to(end, place)
            return
        turns = math.copysign(math.ceil(abs(degrees) / 360.0), degrees)
        self.pen = end
        x, y = end[0] * UNIT_MM, end[1] * UNIT_MM
        yield from self._tool.turned(x, y, (centre[0] * UNIT_MM, centre[1] * UNIT_MM), int(turns), place)

    def _by_itself(self, place: Place, start: Flat, drawn: Callable[[], Iterator[Element]]) -> Iterator[Element]:
        """A figure that begins at `start` with the pen lowered; after it the pen is as and where it was."""
        before, down = self.pen, self._tool.down
        if start != before:
            yield from self._raised(place)
            yield from self._to(start, place)
        yield from self._lowered(place)
        yield from drawn()
        if self.pen != before:
            yield from self._raised(place)
            yield from self._to(before, place)
        yield from self._set_pen(down, place)

    # Points ----------------------------------------------------------------------------------------------------------

    def _absolute(self, x: float, y: float) -> Flat:
        ax, bx, ay, by = self._scale
        return ax * x + bx, ay * y + by

    def _offset(self, x: float, y: float) -> Flat:
        return self.pen[0] + self._scale[0] * x, self.pen[1] + self._scale[2] * y

    def _radius(self, value: float, place: Place) -> float:
        ax, _, ay, _ = self._scale
        if abs(abs(ax) - abs(ay)) > 1e-9 * abs(ax):
            raise CamError("a circle under SC with different scales is an ellipse, which is not drawn", place)
        return abs(ax) * value

    def _numbers(self, told: Instruction, least: int) -> tuple[float, ...]:
        if len(told.numbers) < least:
            raise CamError(f"{told.code} wants {least} numbers", told.place)
        return told.numbers

    # Instructions ----------------------------------------------------------------------------------------------------

    def initialise(self, told: Instruction) -> Iterator[Element]:
        """IN, DF: where the pen is stays (cam/33)."""
        self._relative, self._scale = False, self._no_scale
        if told.code == "IN":
            self._corners = ()
            yield from self._raised(told.place)

    def points(self, told: Instruction) -> Iterator[Element]:
        if told.code in ("PA", "PR"):
            self._relative = told.code == "PR"
        elif told.first and not (self._tool.down and told.code == "PD"):
            yield from self._set_pen(told.code == "PD", told.place)
        if told.numbers:
            x, y = told.numbers
            yield from self._to(self._offset(x, y) if self._relative else self._absolute(x, y), told.place)

    def select(self, told: Instruction) -> Iterator[Element]:
        number = int(told.numbers[0]) if told.numbers else 0
        if number < 0:
            raise CamError("SP must not be negative", told.place)
        if not number:  # cam/33
            yield from self._raised(told.place)
        else:
            yield from self._tool.changed(number, told.place)
            self._depth = self._settings.depth_of(number, DEPTH_MM)

    def arc(self, told: Instruction) -> Iterator[Element]:
        x, y, degrees = self._numbers(told, 3)[:3]
        self._radius(1.0, told.place)
        yield from self._turn(self._offset(x, y) if told.code == "AR" else self._absolute(x, y), degrees, told.place)

    def arc_by_points(self, told: Instruction) -> Iterator[Element]:
        """AT, RT: through a point between to an end."""
        x1, y1, x2, y2 = self._numbers(told, 4)[:4]
        point = self._offset if told.code == "RT" else self._absolute
        (ax, ay), (bx, by), (cx, cy) = self.pen, point(x1, y1), point(x2, y2)
        self._radius(1.0, told.place)
        ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
        area = 2.0 * (ux * vy - uy * vx)
        if abs(area) < 1e-9:
            yield from self._to((cx, cy), told.place)
            return
        u, v = ux * ux + uy * uy, vx * vx + vy * vy
        px, py = (vy * u - uy * v) / area, (ux * v - vx * u) / area
        angle = math.degrees(math.atan2(-px * (vy - py) + py * (vx - px), -px * (vx - px) - py * (vy - py))) % 360.0
        yield from self._turn((ax + px, ay + py), angle if area > 0 else angle - 360.0, told.place)

    def circle(self, told: Instruction) -> Iterator[Element]:
        radius = self._radius(self._numbers(told, 1)[0], told.place)
        centre = self.pen
        if radius:
            rim = (centre[0] + radius, centre[1])
            yield from self._by_itself(told.place, rim, lambda: self._turn(centre, 360.0, told.place))

    def rectangle(self, told: Instruction) -> Iterator[Element]:
        if told.code[0] == "R":
            yield from self._outlined(told)
        (x0, y0), numbers = self.pen, self._numbers(told, 2)
        x1, y1 = (self._offset if told.code[1] == "R" else self._absolute)(numbers[0], numbers[1])

        def drawn() -> Iterator[Element]:
            for corner in ((x1, y0), (x1, y1), (x0, y1), (x0, y0)):
                yield from self._to(corner, told.place)

        yield from self._by_itself(told.place, self.pen, drawn)

    def wedge(self, told: Instruction) -> Iterator[Element]:
        if told.code == "WG":
            yield from self._outlined(told)
        radius, start, degrees = self._numbers(told, 3)[:3]
        radius, centre, angle = self._radius(radius, told.place), self.pen, math.radians(start % 360.0)

        def drawn() -> Iterator[Element]:
            yield from self._to(
                (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)), told.place
            )
            yield from self._turn(centre, degrees, told.place)
            yield from self._to(centre, told.place)

        yield from self._by_itself(told.place, centre, drawn)

    def _outlined(self, told: Instruction) -> Iterator[Element]:
        yield from self._once("fill", told.place, f"{told.code} fills an area: only its edge is drawn")

    def scaling_points(self, told: Instruction) -> None:
        self._corners = told.numbers[:4] if len(told.numbers) >= 4 else ()

    def scaling(self, told: Instruction) -> None:
        if not told.numbers:
            self._scale = self._no_scale
            return
        left, right, low, high = self._numbers(told, 4)[:4]
        if len(told.numbers) > 4 and told.numbers[4]:
            raise CamError(
                "SC of type 1 or 2 is not read; let the program that made it write plotter units", told.place
            )
        if not self._corners:
            raise CamError("SC without IP: the size of the plotter is not known; write IP before it", told.place)
        if left == right or low == high:
            raise CamError("SC with a range of 0", told.place)
        x1, y1, x2, y2 = self._corners
        ax, ay = (x2 - x1) / (right - left), (y2 - y1) / (high - low)
        self._scale = (ax, x1 - ax * left, ay, y1 - ay * low)

    def polygon(self, told: Instruction) -> Iterator[Element]:
        """PM0 begins a polygon, PM1 closes a part of it, PM2 ends it; EP draws it."""
        kind = told.numbers[0] if told.numbers else 0.0
        if kind == 0.0:
            self._polygon, self._corner = [], self.pen
        elif self._corner is not None:
            self._polygon.append(told)
            if kind == 2.0:
                self._began, self._corner = self._corner, None
        yield from ()

    def edges(self, told: Instruction) -> Iterator[Element]:
        if told.code == "FP":
            yield from self._outlined(told)
        before, down, relative = self.pen, self._tool.down, self._relative
        if self.pen != self._began:
            yield from self._raised(told.place)
            yield from self._to(self._began, told.place)
        part, begins = self._began, False
        for each in self._polygon:
            if each.code == "PM":
                yield from self._to(part, each.place)
                begins = True
                continue
            yield from self._carried_out(each)
            if begins and each.numbers:
                part, begins = self.pen, False
        if self.pen != before:
            yield from self._raised(told.place)
            yield from self._to(before, told.place)
        self._relative = relative
        yield from self._set_pen(down, told.place)

    def turned(self, told: Instruction) -> None:
        if told.numbers and told.numbers[0] % 360.0:
            raise CamError("RO is refused: turn the drawing in the program that made it", told.place)

    def left_out(self, told: Instruction) -> Iterator[Element]:
        yield from self._once(told.code, told.place, f"{told.code}: {_LEFT_OUT[told.code]}")


_LEFT_OUT = {
    "LB": "text is not drawn",
    "IW": "the window is not kept: everything is drawn",
    "VS": "the speed of the pen is not used: it is feed_mm_s",
    "AS": "the acceleration of the pen is not used: it is the controller's",
    "FS": "the force of the pen is not used: it goes down to depth_mm",
}
_POINTS = frozenset(("PU", "PD", "PA", "PR"))
_IN_POLYGONS = _POINTS | frozenset(("AA", "AR", "AT", "RT", "CI"))
INSTRUCTIONS: Mapping[str, Callable[[Plot, Instruction], Iterator[Element] | None]] = {
    **dict.fromkeys(("IN", "DF"), Plot.initialise),
    **dict.fromkeys(_POINTS, Plot.points),
    "SP": Plot.select,
    **dict.fromkeys(("AA", "AR"), Plot.arc),
    **dict.fromkeys(("AT", "RT"), Plot.arc_by_points),
    "CI": Plot.circle,
    **dict.fromkeys(("EA", "ER", "RA", "RR"), Plot.rectangle),
    **dict.fromkeys(("EW", "WG"), Plot.wedge),
    "IP": Plot.scaling_points,
    "SC": Plot.scaling,
    "PM": Plot.polygon,
    **dict.fromkeys(("EP", "FP"), Plot.edges),
    "RO": Plot.turned,
    **dict.fromkeys(_LEFT_OUT, Plot.left_out),
}
REFUSED = {
    "PE": "let the program that made it write PD",
    "ZP": "heights are in safe_mm and depth_mm",
    "ZO": "heights are in safe_mm and depth_mm",
    "IR": "write IP with plotter units",
}
IGNORED = frozenset(
    f"{letters[0]}{second}"
    for letters in (
        *("ACF", "BP", "CAOPRS", "DIRT", "ECS", "FT", "LAT", "MCGT", "NPR", "OACDEFHIOPSW"),
        *("PCGSTW", "QL", "RF", "SAILMRSV", "TR", "VA", "WRU"),
    )
    for second in letters[1:]
)  # by their first letter: pens, styles, pages, replies
