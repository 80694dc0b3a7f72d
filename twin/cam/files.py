"""A toolpath as a file again: G-code or NCP, in mm from the zero of the machine, Z upwards.

    Line to X 10 at 30 mm/s    ---    G1 X10 F1800     |    VEL 30000  MOVEABS X10000
    Arc about (5, 5)           ---    G2 X10 Y10 I5    |    CWABS I5000 J5000 X10000 Y10000

Taken are rapids, lines, arcs about Z, spindle, coolant and remarks: what a host has sent becomes no more than that
(isel_twin.jobs.recovered). Whoever reads it with `zero = [0, 0, 0]` in [cam] gets the same toolpath, NCP within half a
micrometre.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from isel_twin.cam.toolpath import Arc, Coolant, Element, Line, Point, Rapid, Remark, Spindle, Toolpath

Words = Iterator[str]


class _File:
    """State that holds until it changes: the point, and the feed as it was written."""

    def __init__(self) -> None:
        self.point: Point = (0.0, 0.0, 0.0)
        self.feed = ""

    def axes(self, to: Point, shown: Callable[[float], str], always: str = "") -> str:
        """Words of the axes that move, and of those that are always written."""
        made = [
            f"{name}{shown(value)}"
            for name, value, before in zip("XYZ", to, self.point, strict=True)
            if name in always or shown(value) != shown(before)
        ]
        self.point = to
        return " ".join(made)


def gcode(path: Toolpath) -> Words:
    """Lines of RS274, mm and mm/min."""
    file = _File()
    yield from ("%", "G21 G90 G91.1 G94 G17 G40 G49 G80")
    for element in path:
        yield from _gcode(element, file)
    yield from ("M30", "%")


def _gcode(element: Element, file: _File) -> Words:
    match element:
        case Rapid(_, to):
            if words := file.axes(to, _mm):
                yield f"G0 {words}"
        case Line(_, to, feed_mm_s):
            if words := file.axes(to, _mm):
                yield f"G1 {words}{_f(file, feed_mm_s)}"
        case Arc(_, to, centre, 2, turns, feed_mm_s):
            from_x, from_y, _ = file.point
            way = f"I{_mm(centre[0] - from_x)} J{_mm(centre[1] - from_y)}"
            words = file.axes(to, _mm, always="XY")
            yield f"{'G3' if turns > 0 else 'G2'} {words} {way}{_f(file, feed_mm_s)}"
        case Spindle(_, turns, rpm):
            yield {1: "M3", -1: "M4"}.get(turns, "M5") + (f" S{rpm:.0f}" if turns and rpm is not None else "")
        case Coolant(_, number, on):
            yield ("M8" if number == 1 else "M7") if on else "M9"
        case Remark(_, text):
            yield f"({text.translate(str.maketrans('()', '[]'))})"


def ncp(path: Toolpath) -> Words:
    """Statements of isel's NCP, um and um/s."""
    file = _File()
    yield "IMF_PBL_V1.0"
    for element in path:
        yield from _ncp(element, file)
    yield "PROGEND"


def _ncp(element: Element, file: _File) -> Words:
    match element:
        case Rapid(_, to):
            if words := file.axes(to, _um):
                yield f"FASTABS {words}"
        case Line(_, to, feed_mm_s):
            if words := file.axes(to, _um):
                yield from _velocity(file, feed_mm_s)
                yield f"MOVEABS {words}"
        case Arc(_, to, centre, 2, turns, feed_mm_s):
            whole = [_um(value) for value in to] == [_um(value) for value in file.point]
            words = file.axes(to, _um, always="" if whole else "XY")
            yield from _velocity(file, feed_mm_s)
            yield f"{'CCWABS' if turns > 0 else 'CWABS'} I{_um(centre[0])} J{_um(centre[1])} {words}".rstrip()
        case Spindle(_, turns, rpm):
            speed = f" RPM{rpm:.0f}" if turns and rpm is not None else ""
            yield {1: "SPINDLE CW ON", -1: "SPINDLE CCW ON"}.get(turns, "SPINDLE OFF") + speed
        case Coolant(_, number, on):
            yield f"{'COOLANT' if number == 1 else 'COOLANT2'} {'ON' if on else 'OFF'}"
        case Remark(_, text):
            yield f"; {text}"


WRITERS: Mapping[str, Callable[[Toolpath], Words]] = {"gcode": gcode, "ncp": ncp}


def _f(file: _File, feed_mm_s: float) -> str:
    return _changed(file, f" F{_plain(60.0 * feed_mm_s, 3)}")


def _velocity(file: _File, feed_mm_s: float) -> Words:
    if words := _changed(file, f"VEL {max(1, round(1e3 * feed_mm_s))}"):
        yield words


def _changed(file: _File, feed: str) -> str:
    """The words of a feed, "" if it is the one that holds."""
    before, file.feed = file.feed, feed
    return "" if feed == before else feed


def _mm(value: float) -> str:
    return _plain(value, 5)


def _um(value: float) -> str:
    return str(round(1e3 * value))


def _plain(value: float, digits: int) -> str:
    """A number without needless digits; -0 is 0."""
    return f"{round(value, digits) + 0.0:.{digits}f}".rstrip("0").rstrip(".")
