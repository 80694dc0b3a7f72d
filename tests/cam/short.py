"""Toolpaths in short words, as tests expect them.

    rapid 10 20 5 | line 10 20 -0.5 F10 | arc 20 20 0 about 20 10 ccw | dwell 0.25 | tool 1 | spindle cw 12000 wait 2
    reference XY | coolant 1 on | output A4 255=1 | stop | remark words | caution | end

Numbers have four decimals at most; a plane other than XY is named, and turns other than one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from isel_twin.cam.reader import Reader
from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import (
    Arc,
    Caution,
    Coolant,
    Dwell,
    Element,
    Line,
    Output,
    PathMode,
    Point,
    Rapid,
    Reference,
    Remark,
    Spindle,
    Stop,
    Tool,
)

UP = CamSettings(z_sign=1)  # machine zero is the workpiece's
_PLANES = {2: "", 1: " XZ", 0: " YZ"}
_AXES = {2: (0, 1), 1: (0, 2), 0: (1, 2)}


def number(value: float) -> str:
    return f"{round(value, 4) + 0.0:g}"


def _point(point: Point) -> str:
    return " ".join(map(number, point))


def short(element: Element) -> str:
    """One element."""
    if isinstance(element, Rapid):
        return f"rapid {_point(element.to)}" + (f" F{number(element.speed_mm_s)}" if element.speed_mm_s else "")
    if isinstance(element, Line):
        return f"line {_point(element.to)} F{number(element.feed_mm_s)}"
    if isinstance(element, Arc):
        centre = " ".join(number(element.centre[axis]) for axis in _AXES[element.plane])
        turns = "" if abs(element.turns) == 1 else f" x{abs(element.turns)}"
        sense = "ccw" if element.turns > 0 else "cw"
        how = f"{centre}{_PLANES[element.plane]} {sense}{turns} F{number(element.feed_mm_s)}"
        return f"arc {_point(element.to)} about {how}"
    return _event(element)


def _event(element: Element) -> str:
    if isinstance(element, Reference):
        return f"reference {''.join('XYZ'[axis] for axis in element.axes)}"
    if isinstance(element, PathMode):
        tolerance = "" if element.tolerance_mm is None else f" {number(element.tolerance_mm)}"
        return "exact" if element.exact else f"joined{tolerance}"
    if isinstance(element, Dwell):
        return f"dwell {number(element.seconds)}"
    if isinstance(element, Tool):
        return f"tool {element.number}"
    if isinstance(element, Spindle):
        speed = "" if element.speed_rpm is None else f" {number(element.speed_rpm)}"
        wait = f" wait {number(element.wait_s)}" if element.wait_s else ""
        return f"spindle {({1: 'cw', -1: 'ccw', 0: 'off'})[element.turns]}{speed}{wait}"
    if isinstance(element, Coolant):
        return f"coolant {element.number} {'on' if element.on else 'off'}"
    if isinstance(element, Output):
        return f"output {element.name} {element.mask}={element.value}"
    if isinstance(element, Remark):
        return f"remark {element.text}"
    if isinstance(element, Stop):
        return "stop optional" if element.optional else "stop"
    return "caution" if isinstance(element, Caution) else "end"


def told(reader: str | Reader, text: str | Iterable[str], settings: CamSettings = UP) -> list[str]:
    """The toolpath of a file in short words."""
    lines = text.splitlines(keepends=True) if isinstance(text, str) else text
    chosen = reader_named(reader) if isinstance(reader, str) else reader
    return [short(element) for element in chosen.read(lines, settings)]


def cautions(reader: str, text: str, settings: CamSettings = UP) -> list[str]:
    """What the reader cautions about."""
    path = reader_named(reader).read(text.splitlines(), settings)
    return [element.text for element in path if isinstance(element, Caution)]


def length(element: Element, start: Point) -> float:
    """Of a motion, mm."""
    if isinstance(element, Arc):
        a, b = _AXES[element.plane]
        sense = (1 if element.turns > 0 else -1) * (-1 if element.plane == 1 else 1)
        centre, to = element.centre, element.to
        r0, r1 = (
            math.dist((start[a], start[b]), (centre[a], centre[b])),
            math.dist((to[a], to[b]), (centre[a], centre[b])),
        )
        first = math.atan2(start[b] - centre[b], start[a] - centre[a])
        last = math.atan2(to[b] - centre[b], to[a] - centre[a])
        sweep = (last - first) * sense % (2 * math.pi)
        sweep = (sweep if sweep > 1e-6 else 2 * math.pi) + 2 * math.pi * (abs(element.turns) - 1)
        return math.hypot((r0 + r1) / 2 * sweep, to[element.plane] - start[element.plane])
    assert isinstance(element, Rapid | Line)
    return math.dist(element.to, start)


def seconds(path: Iterable[Element], rapid_mm_s: float = 0.0) -> list[tuple[float, float]]:
    """Length and time of each motion and dwell; spindles wait. Without ramps."""
    at: Point = (0.0, 0.0, 0.0)
    found = []
    for element in path:
        if isinstance(element, Rapid | Line | Arc):
            way = length(element, at)
            speed = element.speed_mm_s or rapid_mm_s if isinstance(element, Rapid) else element.feed_mm_s
            found.append((way, way / speed if way else 0.0))
            at = element.to
        elif isinstance(element, Dwell):
            found.append((0.0, element.seconds))
        elif isinstance(element, Spindle) and element.wait_s:
            found.append((0.0, element.wait_s))
    return found
