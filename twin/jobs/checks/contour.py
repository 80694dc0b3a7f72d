"""The way of the carriages against the path of the user's file: what a command, chords, a corner taken in passing, a
lag across the path or lost steps make of it.

    file  --- drawing --->  points, cut?, line      once more as the reader reads it: not as it was written
    carriages, every 5 ms  --- Contour.look --->    distance to the nearest piece of the next few millimetres

What is cut counts; rapids only lead from one cut to the next (jobs/9). The counters' sense, mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.cam import arcs
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Line, Point, Rapid, Reference, Toolpath

BACK_MM, AHEAD_MM = 2.0, 5.0  # along the path, from the nearest point before, in which the next one is looked for
# mm of distance that a mm counts as ...
ONWARDS = 2e-2  # ... along the path from where the way so far leads: it is not left where it crosses itself
BACKWARDS = 6e-2  # ... behind the farthest place so far: a servo turns in a hole before it is at its bottom
CHORD = 0.02  # of the bound: by how much the chords of an arc may leave it
LEAST_CHORD_MM = 1e-5


@dataclass(frozen=True)
class Drawing:
    """A path in straight pieces."""

    points_mm: NDArray[np.float64]  # [n + 1, 3], in the counters' sense
    cuts: NDArray[np.bool_]  # [n], of each piece: False for rapids
    line: NDArray[np.int64]  # [n], in the file

    @property
    def ends_mm(self) -> NDArray[np.float64]:
        """float64 [n + 1], way along the path up to each point."""
        ways = np.linalg.norm(np.diff(self.points_mm, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(ways)])


def drawing(path: Toolpath, settings: CamSettings, bound_mm: float) -> Drawing:
    """The path of a file, arcs by chords that leave them by a fiftieth of the bound. Raises CamError."""
    points, cuts, lines = [settings.machine_point(settings.start)], [], []
    tolerance_mm = max(CHORD * bound_mm, LEAST_CHORD_MM)
    for place, to, cut in _pieces(path, points[0], tolerance_mm):
        points.append(to)
        cuts.append(cut)
        lines.append(place)
    sense = np.array([1.0, 1.0, settings.z_sign])
    return Drawing(np.array(points) * sense, np.array(cuts, dtype=np.bool_), np.array(lines, dtype=np.int64))


def _pieces(path: Toolpath, at: Point, tolerance_mm: float) -> Iterator[tuple[int, Point, bool]]:
    for element in path:
        if isinstance(element, Rapid | Line):
            yield element.place.line, element.to, isinstance(element, Line)
            at = element.to
        elif isinstance(element, Arc):
            for to in arcs.chords(element, at, arcs.shape(element, at), tolerance_mm):
                yield element.place.line, to, True
            at = element.to
        elif isinstance(element, Reference):
            at = element.ends(at)
            yield element.place.line, at, False


@dataclass(frozen=True)
class Way:
    """How far the carriages have come along a path."""

    now_mm: float = 0.0
    farthest_mm: float = 0.0
    at_mm: tuple[float, ...] = ()  # the carriages when they were last looked at; empty: not yet


class Contour:
    """How far the carriages leave a path, by lines of the file."""

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
        """position_mm: float64 [3], true position of the carriages in the counters' sense."""
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
