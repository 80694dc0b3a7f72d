"""A toolpath written for a controller and made by the twin of its machine: where every axis was, and when."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from isel_twin import Twin
from isel_twin.cam.arcs import NO_WAY_MM
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Element, End, Line, Place, Point, Rapid
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.controller import offers
from isel_twin.jobs.job import Line as JobLine
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.sending import play
from isel_twin.language import WritesToolpaths, create_language

Points = NDArray[np.float64]  # [points, 3], mm
TRAVEL = ((0.0, 395.0), (0.0, 300.0), (0.0, 140.0))  # of the 4030
MACHINES = {"imc-s8": "4030", "imc-m": "4030", "imc-mp": "4030", "c142": "4030", "ismif": "4030"}
STEPS_MM = {"ismif": 80.0, "gmi99": 1000.0, "bwo900": 1000.0}  # others: 320
REFERENCE = ("@0R", "$H", "Q3", "Q4", "reference")  # how commands of a reference run begin
FAST = CamSettings(rapid_mm_s=30.0)
FINE = 200  # pieces of a path at least, in which the next one to a point is looked for
P = Place(1)


def axes_of(controller: str) -> MachineAxes:
    steps = STEPS_MM.get(controller, 320.0)
    return MachineAxes((steps, steps, steps), TRAVEL)


def lines_of(
    controller: str, path: Iterable[Element], settings: CamSettings = FAST, axes: MachineAxes | None = None
) -> list[Written]:
    language = create_language(controller)
    assert offers(language, WritesToolpaths)
    return list(language.written(iter(path), axes or axes_of(controller), settings))


def texts(lines: Iterable[Written]) -> list[str]:
    return [line.text for line in lines]


@dataclass
class Made:
    counts: NDArray[np.int64]  # [steps + 1, 3]: after each, the first before all
    steps_mm: float

    @property
    def end_mm(self) -> Sequence[float]:
        return [count / self.steps_mm for count in self.counts[-1]]

    @property
    def mm(self) -> NDArray[np.float64]:
        return self.counts / self.steps_mm


@dataclass
class Played(Made):
    twin: Twin
    lines: list[Written]
    begin_ns: int  # the end of the reference run
    t_ns: NDArray[np.int64]  # of the steps since then
    spindle: list[int]  # after each line

    @property
    def seconds(self) -> float:
        """From the first step to the last."""
        return float(self.t_ns[-1] - self.t_ns[0]) / 1e9


class Player:
    """A twin that plays toolpaths one after the other, each a job of its own; only the first has the reference run.
    Those behind it must begin with a rapid of all axes, as a job takes it that the tool stands at the zero."""

    def __init__(self, controller: str, axes: MachineAxes | None = None) -> None:
        machine = MACHINES.get(controller, "4030-servo")
        self.controller, self.axes = controller, axes
        self.steps_mm = STEPS_MM.get(controller, 320.0)
        self.twin = Twin(machine=machine, controller=controller, plant="kinematic", seed=1)
        self.start: Point = (0.0, 0.0, 0.0)  # as the counters show it
        self._homed_ns = 0

    def play(self, path: Iterable[Element], settings: CamSettings = FAST) -> Played:
        twin = self.twin
        lines = lines_of(self.controller, path, settings, self.axes)
        job = parse_job("\n".join(texts(lines)), twin.language, self.controller)
        begin = twin.time_ns
        results, spindle = [], []
        for result in play(twin, [each for each in job if not (self._homed_ns and homes(each))], timeout_s=3000.0):
            results.append(result)
            spindle.append(twin.outputs.get("spindle", 0))
        assert [(r.command, r.reply, r.why) for r in results if not r.ok] == []
        assert not twin.fault
        if not self._homed_ns:
            begin = self._homed_ns = max(r.end_ns for r in results if r.command.startswith(REFERENCE))
        chunks = [motion.window(motion.first, motion.last) for motion in twin.steps.motions if motion.end_ns > begin]
        t_ns = np.concatenate([times for times, _ in chunks] or [np.empty(0, np.int64)])
        first = int(np.searchsorted(t_ns, begin, side="right"))
        delta = np.vstack([deltas[:, :3] for _, deltas in chunks] or [np.empty((0, 3))])[first:].astype(np.int64)
        counts = counts_of(delta, twin.counts.tolist())
        x, y, z = (counts[-1] / self.steps_mm).tolist()
        self.start = x, y, z
        return Played(counts, self.steps_mm, twin, lines, begin, t_ns[first:], spindle)


def counts_of(delta: NDArray[np.int64], end: Sequence[int]) -> NDArray[np.int64]:
    """int64 [steps + 1, 3], counters that end here, from their changes [steps, 3]."""
    last = np.array(end[:3], dtype=np.int64)
    return np.vstack([last - np.cumsum(delta[::-1], axis=0)[::-1], last])


def homes(line: JobLine) -> bool:
    return line.command.startswith(REFERENCE)


def played(controller: str, path: Iterable[Element], settings: CamSettings = FAST) -> Played:
    return Player(controller).play(path, settings)


def distance_mm(points: Points, corners: Points) -> float:
    """Largest distance of these points from the polyline."""
    centre = corners.mean(axis=0)  # near it products lose no digits
    points, corners = points - centre, corners - centre
    begins, ways = corners[:-1], np.diff(corners, axis=0)
    squares = np.maximum((ways**2).sum(axis=1), 1e-30)
    lengths = (points**2).sum(axis=1)
    least = np.full(len(points), np.inf)
    for first in range(0, len(ways), 256):  # so much at once that it stays in the cache
        begin, way, square = begins[first : first + 256], ways[first : first + 256], squares[first : first + 256]
        along = points @ way.T - (begin * way).sum(axis=1)
        apart = lengths[:, None] - 2.0 * (points @ begin.T) + (begin**2).sum(axis=1)  # squared, from its begin
        part = np.clip(along / square, 0.0, 1.0)
        least = np.minimum(least, (apart - part * (2.0 * along - part * square)).min(axis=1))
    return math.sqrt(max(least.max(), 0.0))


def is_near(points: Points, corners: Points, near_mm: float) -> bool:
    """Whether no point is farther than this from the polyline. Most are near one of the pieces that meet at the corner
    next to them; only others are held against all pieces."""
    from scipy.spatial import KDTree

    corners = finely(corners, float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()) / FINE)
    if len(corners) < 2:
        return distance_mm(points, np.vstack([corners, corners])) <= near_mm
    _, next_to = KDTree(corners).query(points)
    least = np.full(len(points), np.inf)
    for piece in (np.maximum(next_to - 1, 0), np.minimum(next_to, len(corners) - 2)):
        begin, way = corners[piece], corners[piece + 1] - corners[piece]
        along = ((points - begin) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-30)
        apart = points - begin - np.clip(along, 0.0, 1.0)[:, None] * way
        least = np.minimum(least, np.linalg.norm(apart, axis=1))
    far = points[least > near_mm]
    return not len(far) or distance_mm(far, corners) <= near_mm


def finely(corners: Points, longest_mm: float) -> Points:
    """The polyline with corners in between, so that no piece is longer."""
    ways = np.diff(corners, axis=0)
    parts = np.maximum(np.ceil(np.linalg.norm(ways, axis=1) / max(longest_mm, 1e-9)).astype(int), 1)
    piece = np.repeat(np.arange(len(ways)), parts)
    share = (np.arange(len(piece)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[piece]
    return np.vstack([corners[piece] + share[:, None] * ways[piece], corners[-1:]])


def ideal_mm(path: Iterable[Element], settings: CamSettings = FAST, start: Point = (0.0, 0.0, 0.0)) -> Points:
    """The path in the sense of the counters; arcs by 2 degrees, in closed form: u is the first axis of the plane that a
    counter-clockwise arc leaves towards the second one (X Y, Z X, Y Z)."""
    points = [start]
    for element in path:
        if isinstance(element, (Rapid, Line)):
            points.append(element.to)
        elif isinstance(element, Arc):
            k = element.plane
            u, v = (k + 1) % 3, (k + 2) % 3
            centre = complex(element.centre[u], element.centre[v])
            first, last = (complex(p[u], p[v]) - centre for p in (points[-1], element.to))
            sense = 1 if element.turns > 0 else -1
            angle = cmath.phase((last / first) ** sense) % (2 * math.pi)
            angle = (
                2 * math.pi * abs(element.turns)
                if min(angle, 2 * math.pi - angle) * abs(first) < NO_WAY_MM
                else (angle + 2 * math.pi * (abs(element.turns) - 1))
            )
            begin, n = points[-1], math.ceil(math.degrees(angle) / 2)
            for i in range(1, n):
                at = first / abs(first) * cmath.exp(1j * sense * angle * i / n)
                at = centre + at * (abs(first) + (abs(last) - abs(first)) * i / n)
                point = [0.0, 0.0, 0.0]
                point[k] = begin[k] + (element.to[k] - begin[k]) * i / n
                point[u], point[v] = at.real, at.imag
                points.append((point[0], point[1], point[2]))
            points.append(element.to)
    return np.array(points) * (1.0, 1.0, settings.z_sign)


def check_made(controller: str, path: Sequence[Element], settings: CamSettings = FAST) -> Played:
    return check_played(Player(controller), path, settings)


M_co = TypeVar("M_co", bound=Made, covariant=True)


class Plays(Protocol[M_co]):
    """Who plays toolpaths one after the other."""

    @property
    def start(self) -> Point: ...

    def play(self, path: Iterable[Element], settings: CamSettings) -> M_co: ...


def check_played(
    player: Plays[M_co], path: Sequence[Element], settings: CamSettings = FAST, points: int = 4000
) -> M_co:
    """Play it and hold it against the path: the end within a step, every place within the tolerance and a step of each
    axis (half of it is rounding, half the steps of a line), and every place of the path within that and what passes
    between two set points of it."""
    start = settings.machine_point(player.start)
    run = player.play(path, settings)
    step, mm = 1.0 / run.steps_mm, run.mm
    wanted = ideal_mm(path, settings, start)
    assert np.abs(mm[-1] - wanted[-1]).max() <= step
    chord = largest_radius_mm(path) * (1.0 - math.cos(math.radians(1.0)))  # of the wanted path itself
    near = settings.tolerance_mm + math.sqrt(3.0) * step + chord
    corners = mm[np.unique(np.linspace(0, len(mm) - 1, points).astype(int))]
    assert is_near(corners, wanted, near)
    apart = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).max()) / 2.0
    assert is_near(wanted, corners, near + apart)
    length = float(np.linalg.norm(np.diff(wanted, axis=0), axis=1).sum())
    assert np.abs(swept_mm2(corners) - swept_mm2(wanted)).max() <= 2.0 * near * (length + 1.0) + apart * length
    return run


def largest_radius_mm(path: Iterable[Element]) -> float:
    arcs = (element for element in path if isinstance(element, Arc))
    return max((math.dist(_flat(each.to, each.plane), _flat(each.centre, each.plane)) for each in arcs), default=0.0)


def _flat(point: Point, plane: int) -> Sequence[float]:
    return [*point[:plane], *point[plane + 1 :]]


def swept_mm2(points: Points) -> Points:
    """Areas in YZ, ZX and XY that the way from the first point encircles: signed, so that sense and turns count."""
    way = points - points[0]
    return np.cross(way[:-1], way[1:]).sum(axis=0) / 2.0


def rapid(x: float, y: float, z: float) -> Rapid:
    return Rapid(P, (x, y, z))


def line(x: float, y: float, z: float, feed: float = 10.0) -> Line:
    return Line(P, (x, y, z), feed)


def arc(to: Point, centre: Point, turns: int = 1, plane: int = 2, feed: float = 10.0) -> Arc:
    return Arc(P, to, centre, plane, turns, feed)


END = End(P)
