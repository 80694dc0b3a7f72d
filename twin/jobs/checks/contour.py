"""The way of the carriages against the path of the user's file: what a command, chords, a corner taken in passing, a
lag across the path or lost steps make of it.

    file  --- drawing --->  points, cut?, line      once more as the reader reads it: not as it was written
    carriages, every 5 ms  --- Contour.look --->    distance to the nearest piece of the next few millimetres

What is cut counts; rapids only lead from one cut to the next (jobs/9). The counters' sense, mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.cam import arcs
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Element, End, Line, Place, Point, Rapid, Reference, Spindle, Tool, Toolpath

BACK_MM, AHEAD_MM = 2.0, 5.0  # along the path, from the nearest point before, in which the next one is looked for
# mm of distance that a mm counts as ...
ONWARDS = 2e-2  # ... along the path from where the way so far leads: it is not left where it crosses itself
BACKWARDS = 6e-2  # ... behind the farthest place so far: a servo turns in a hole before it is at its bottom
CHORD = 0.02  # of the bound: by how much the chords of an arc may leave it
LEAST_CHORD_MM = 1e-5


@dataclass(frozen=True)
class Drawing:
    """A path in straight pieces, and what the file says of tool and spindle on it."""

    points_mm: NDArray[np.float64]  # [n + 1, 3], in the counters' sense
    cuts: NDArray[np.bool_]  # [n], of each piece: False for rapids
    line: NDArray[np.int64]  # [n], in the file
    speed_rpm: NDArray[np.float64]  # [n], of the spindle, as the file says it; 0: off, nan: on, at no speed of its own
    off: Mapping[int, int]  # lines that switch the spindle off, by the first piece without it; 0: it is not on yet
    changes: tuple[tuple[int, int], ...]  # of tools: number of the point, and line
    switches: bool  # the file switches the spindle on
    relay: bool  # by the controller's own output for it
    tolerance_mm: float  # chords leave arcs by at most this
    z_sign: int  # 1: points grow upwards

    @property
    def ends_mm(self) -> NDArray[np.float64]:
        """float64 [n + 1], way along the path up to each point."""
        ways = np.linalg.norm(np.diff(self.points_mm, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(ways)])

    @property
    def lifts(self) -> NDArray[np.bool_]:
        """bool [n], pieces that lead straight up, or nowhere: they cut nothing."""
        ways = np.diff(self.points_mm, axis=0)
        lifts: NDArray[np.bool_] = (np.abs(ways[:, :2]) < LEAST_CHORD_MM).all(axis=1) & (ways[:, 2] * self.z_sign >= 0)
        return lifts


def drawing(path: Toolpath, settings: CamSettings, bound_mm: float | None = None, *, spindle_off: int = 0) -> Drawing:
    """The path of a file, arcs by chords that leave them by a fiftieth of the bound, or as those of the controller may.
    spindle_off: the line before them that has switched the spindle off. Raises CamError."""
    tolerance_mm = settings.tolerance_mm if bound_mm is None else max(CHORD * bound_mm, LEAST_CHORD_MM)
    return _Pen(settings, tolerance_mm, spindle_off).drawn(path)


class _Pen:
    """Draws a path while its elements pass."""

    def __init__(self, settings: CamSettings, tolerance_mm: float, spindle_off: int) -> None:
        self._settings, self._tolerance_mm = settings, tolerance_mm
        self._points = [settings.machine_point(settings.start)]
        self._pieces: list[tuple[bool, int, float]] = []  # a cut?, line, speed
        self._speed_rpm, self._last_rpm = 0.0, math.nan  # now, and the last one that was said
        self._off = {0: spindle_off}
        self._changes: list[tuple[int, int]] = []
        self._switches = spindle_off > 0
        self._away_from: Point | None = None  # where the tool stood before it was changed

    def drawn(self, path: Toolpath) -> Drawing:
        for element in path:
            self._take(element)
        sense = np.array([1.0, 1.0, self._settings.z_sign])
        cuts, line, speed_rpm = zip(*self._pieces, strict=True) if self._pieces else ((), (), ())
        return Drawing(
            np.array(self._points) * sense,
            np.array(cuts, dtype=np.bool_),
            np.array(line, dtype=np.int64),
            np.array(speed_rpm, dtype=np.float64),
            self._off,
            tuple(self._changes),
            self._switches,
            "spindle" not in self._settings.outputs,
            self._tolerance_mm,
            self._settings.z_sign,
        )

    def _take(self, element: Element) -> None:
        match element:
            case Rapid() | Line() | Arc():
                if self._away_from is not None:
                    self._back(element)
                if not isinstance(element, Arc):
                    self._go(element.place, element.to, cut=isinstance(element, Line))
                    return
                at = self._points[-1]
                for to in arcs.chords(element, at, arcs.shape(element, at), self._tolerance_mm):
                    self._go(element.place, to, cut=True)
            case Spindle():
                self._last_rpm = self._last_rpm if element.speed_rpm is None else element.speed_rpm
                self._switch(element.turns, element.place.line)
            case Tool():
                self._change(element)
            case Reference():
                self._by_z(element.place, element.ends(self._points[-1]))
            case End() if self._settings.park is not None:
                self._by_z(element.place, self._settings.machine_point(self._settings.park))

    def _switch(self, turns: int, line: int) -> None:
        was_on = self._speed_rpm != 0.0
        self._speed_rpm = 0.0 if not turns else self._last_rpm or math.nan
        self._switches |= bool(turns)
        if was_on and not turns:
            self._off[len(self._pieces)] = line

    def _go(self, place: Place, to: Point, *, cut: bool = False) -> None:
        self._pieces.append((cut, place.line, self._speed_rpm))
        self._points.append(to)

    def _change(self, tool: Tool) -> None:
        """As cam/writing.py makes it."""
        if (where := self._settings.tool_change) is not None:
            self._away_from = self._away_from or self._points[-1]
            self._by_z(tool.place, self._settings.machine_point(where))
        self._switch(0, tool.place.line)
        self._changes.append((len(self._points) - 1, tool.place.line))

    def _by_z(self, place: Place, to: Point) -> None:
        """By rapids, Z first."""
        x, y, _ = self._points[-1]
        self._go(place, (x, y, to[2]))
        self._go(place, to)

    def _back(self, element: Rapid | Line | Arc) -> None:
        to = element.to if isinstance(element, Rapid) or self._away_from is None else self._away_from
        self._away_from = None
        self._go(element.place, (to[0], to[1], self._points[-1][2]))
        self._go(element.place, to)


@dataclass(frozen=True)
class Way:
    """Progress of the carriages along a path."""

    now_mm: float = 0.0
    farthest_mm: float = 0.0
    at_mm: tuple[float, ...] = ()  # the carriages when they were last looked at; empty: not yet


class Contour:
    """Distance of the carriages from a path, by lines of the file."""

    def __init__(self, drawn: Drawing, most_mm: float) -> None:
        self._drawn, self.most_mm = drawn, most_mm
        self._ends_mm = drawn.ends_mm
        self._along = np.diff(drawn.points_mm, axis=0)
        self._square = np.maximum(np.einsum("ij,ij->i", self._along, self._along), 1e-30)
        self._length = np.sqrt(self._square)
        self.restart()

    def restart(self, way: Way = Way()) -> None:
        """Begin anew, or go on from this place of the path."""
        self.way = way
        self.worst: dict[int, tuple[float, int]] = {}  # distance in mm and when, by lines of the file

    def begin(self) -> None:
        """Forget what has been found, as before a line of the job."""
        self.worst = {}

    def look(self, position_mm: NDArray[np.float64], time_ns: int) -> None:
        """position_mm: float64 [3], true position of the tool over the table, in the counters' sense."""
        now_mm, farthest_mm = self.way.now_mm, self.way.farthest_mm
        place = tuple(position_mm.tolist())
        moved_mm = math.dist(place, self.way.at_mm) if self.way.at_mm else 0.0
        pieces = len(self._drawn.cuts)
        low = int(self._ends_mm.searchsorted(now_mm - BACK_MM - moved_mm, side="right")) - 1
        high = int(self._ends_mm.searchsorted(now_mm + AHEAD_MM + moved_mm, side="left"))
        low, high = min(max(low, 0), pieces - 1), min(max(high, 1), pieces)
        along, apart = self._along[low:high], position_mm - self._drawn.points_mm[low:high]
        share = np.minimum(np.maximum(np.einsum("ij,ij->i", apart, along) / self._square[low:high], 0.0), 1.0)
        apart = apart - share[:, None] * along
        distance_mm = np.sqrt(np.einsum("ij,ij->i", apart, apart))
        way_mm = self._ends_mm[low:high] + share * self._length[low:high]
        # a hole leads down and up the same way: which of them it is, the way so far decides
        onwards_mm = np.abs(way_mm - now_mm - moved_mm)
        behind_mm = np.maximum(farthest_mm - way_mm, 0.0)
        nearest = int((distance_mm + ONWARDS * onwards_mm + BACKWARDS * behind_mm).argmin())
        now_mm = float(way_mm[nearest])
        self.way = Way(now_mm, max(farthest_mm, now_mm), place)
        if (cuts := self._drawn.cuts[low:high])[nearest]:
            line, worst_mm = int(self._drawn.line[low + nearest]), float(distance_mm[cuts].min())
            if worst_mm > self.worst.get(line, (0.0, 0))[0]:
                self.worst[line] = worst_mm, time_ns

    def found(self) -> Iterator[tuple[int, float, int]]:
        """Line of the file, distance in mm and when, where it is more than the bound."""
        for line, (worst_mm, time_ns) in sorted(self.worst.items()):
            if worst_mm > self.most_mm:
                yield line, worst_mm, time_ns
