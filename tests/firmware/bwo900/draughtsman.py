"""A second opinion on programs: writes random ones, and knows where they lead, from the manual alone.

A `Draughtsman` keeps what the manual says of path conditions, as a chain of matrices, and draws each block's path as
points of the program carried through that chain one by one: lines by their ends, arcs by points so close that their
chords are off by SAGITTA at most. Nothing of it comes from the control's own code.

    machine = length + zero point + G92 mirrored + U0V0, then mirror, rotation, dUV, G44       P8859 0
    machine = length + zero point + U0V0, then mirror, rotation, dUV + G92, G44                P8859 2
    and the sense of each axis (P8892)

Words that are not programmed keep their axis of the program where it is; when a frame changes nothing moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

__all__ = ["CORNER_EXPONENTS", "SAGITTA", "ZERO_POINTS", "Curve", "Draughtsman", "programs"]

SAGITTA = 1e-4
"""mm"""
ZERO_POINTS = {54: (12.5, -7.0, 3.0), 55: (-20.0, 4.25, -1.5), 56: (0.0, 0.0, 0.0)}
DWELL, DWELL_S = "G04.0.15", 0.15
PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
CORNER_EXPONENTS = (1.0, 2.0, 5.0)
NAMES, CENTRES = "XYZ", "IJK"


@dataclass(frozen=True)
class Curve:
    """One piece of a path, in machine coordinates."""

    points: NDArray[np.float64]
    """mm [n, 3]"""
    begin: NDArray[np.float64]
    """Unit vector along its beginning."""
    end: NDArray[np.float64]
    """Unit vector along its end."""
    feed: float | None
    """mm/min; None: rapid."""
    stops: bool
    """It ends at speed 0."""
    end_feed: float | None = None
    """mm/min: `f`, the feed that its block ends with."""
    circle: tuple[int, int, float] | None = None
    """Both axes of its plane and the radius in mm, if it is an arc."""
    dwell_s: float = 0.0
    """G04, behind it."""

    @property
    def length_mm(self) -> float:
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


@dataclass
class Draughtsman:
    """Draws; see the module. Times and speeds are not its business."""

    shift_first: bool
    rapid_stops: bool
    lines: list[str] = field(default_factory=list)
    called: dict[str, list[str]] = field(default_factory=dict)
    """Lines of other programs, which these call."""
    curves: list[Curve] = field(default_factory=list)
    place: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    plane: int = 17
    zero: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    shift: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    correction: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    turned: tuple[float, float, float, float, float, float] | None = None
    """U0, V0, E, dU, dV, dE of a rotation that is on."""
    mirror: tuple[int, int] = (1, 1)
    absolute: bool = True
    pole: tuple[float, float] | None = None
    feed: float = 3000.0
    exact: bool = False
    senses: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))

    # the frame

    @property
    def axes(self) -> tuple[int, int, int]:
        return PLANES[self.plane]

    def _matrix(self) -> NDArray[np.float64]:
        """Program to machine, homogeneous."""
        u, v, w = self.axes
        u0, v0, angle, du, dv, dangle = self.turned or (0.0,) * 6
        turn = np.eye(4)
        e = math.radians(angle + dangle)
        turn[u, u] = turn[v, v] = math.cos(e)
        turn[v, u], turn[u, v] = math.sin(e), -math.sin(e)
        mirror = np.eye(4)
        mirror[u, u], mirror[v, v] = self.mirror
        added, origin, tool = np.zeros(3), np.zeros(3), np.zeros(3)
        added[u], added[v], origin[u], origin[v], tool[w] = du, dv, u0, v0, self.length
        inner = added + (self.shift if self.shift_first else 0.0)
        flipped = self.shift * np.diag(mirror)[:3]
        outer = tool + self.zero + origin + (0.0 if self.shift_first else flipped)
        return np.diag([*self.senses, 1.0]) @ moved(outer) @ mirror @ turn @ moved(inner + self.correction)

    def program_place(self) -> NDArray[np.float64]:
        return (np.linalg.inv(self._matrix()) @ [*self.place, 1.0])[:3]

    def machine(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        matrix = self._matrix()
        return points @ matrix[:3, :3].T + matrix[:3, 3]

    # blocks

    def says(self, text: str) -> None:
        self.lines.append(f"N{10 * (len(self.lines) + 1)} {text}")

    def goes(
        self,
        text: str,
        points: NDArray[np.float64],
        *,
        rapid: bool = False,
        exact: bool = False,
        within: bool = False,
        end_feed: float | None = None,
        radius: float | None = None,
        **way: NDArray[np.float64],
    ) -> None:
        """A path through these places of the program. way: direction of its ends in the program, where it is bent.

        exact: it ends with an exact stop; within: the block goes on behind it; end_feed: `f`; radius: of an arc.
        """
        if text:
            self.says(text)
        places = self.machine(points)
        places[0] = self.place
        stops = not within and (exact or self.exact or (rapid and self.rapid_stops))
        self._drawn(places, way, rapid, stops, end_feed, radius)

    def _drawn(
        self,
        places: NDArray[np.float64],
        way: dict[str, NDArray[np.float64]],
        rapid: bool,
        stops: bool,
        end_feed: float | None = None,
        radius: float | None = None,
    ) -> None:
        turn = self._matrix()[:3, :3]
        chords = np.diff(places, axis=0)
        if np.abs(chords).max() < 1e-9:
            return
        begin = turn @ way["begin"] if "begin" in way else chords[0]
        end = turn @ way["end"] if "end" in way else chords[-1]
        self.curves.append(
            Curve(
                places,
                begin / np.linalg.norm(begin),
                end / np.linalg.norm(end),
                None if rapid else self.feed,
                stops,
                end_feed,
                None if radius is None else (*self.axes[:2], radius),
            )
        )
        self.place = places[-1]

    def words(self, start: NDArray[np.float64], goal: NDArray[np.float64], axes: tuple[int, ...]) -> str:
        base = np.zeros(3) if self.absolute else start
        return " ".join(f"{NAMES[axis]}{goal[axis] - base[axis]:.6f}" for axis in axes)

    def line(
        self, goal: NDArray[np.float64], axes: tuple[int, ...], g: str = "G1", end_feed: float | None = None
    ) -> None:
        """A line or rapid move to a place of the program; only these axes are programmed."""
        start = self.program_place()
        goal = np.array([goal[axis] if axis in axes else start[axis] for axis in range(3)])
        words = self.words(start, goal, axes) + ("" if end_feed is None else f" f{end_feed:.0f}")
        said = g.split()
        self.goes(f"{g} {words}", np.array([start, goal]), rapid="G0" in said, exact="G8" in said, end_feed=end_feed)
        if DWELL in said:
            self.stands(DWELL_S)

    def stands(self, dwell_s: float = 0.0) -> None:
        """What comes last stops exactly, and stands for so long."""
        self.curves[-1] = replace(self.curves[-1], stops=True, dwell_s=self.curves[-1].dwell_s + dwell_s)

    def loop(self, ways: list[NDArray[np.float64]], passes: int) -> None:
        """M24 to M25: blocks with a way of all axes each."""
        self.absolute = False
        self.says("G91")
        self.says(f"M24.{passes}")
        for number in range(passes):
            inside = len(self.lines)
            for way in ways:
                self.line(self.program_place() + way, (0, 1, 2))
            if number:
                del self.lines[inside:]
        self.says("M25")

    def arc(
        self, centre: tuple[float, float], sweep: float, rise: float | None, radius: bool, polar: bool = False
    ) -> None:
        """An arc about a centre, which lies where it is said from the start; rise: of the third axis of the plane."""
        start = self.program_place()
        u, v, w = self.axes
        size = math.hypot(*centre)
        first = math.atan2(-centre[1], -centre[0])
        count = max(4, math.ceil(abs(sweep) / math.sqrt(8.0 * SAGITTA / size)))
        share = np.linspace(0.0, 1.0, count + 1)
        points = start + share[:, None] * np.eye(3)[w] * (rise or 0.0)
        points[:, u] = start[u] + centre[0] + size * np.cos(first + share * sweep)
        points[:, v] = start[v] + centre[1] + size * np.sin(first + share * sweep)
        ways = []
        for angle in (first, first + sweep):
            way = np.zeros(3)
            way[u], way[v], way[w] = -size * sweep * math.sin(angle), size * sweep * math.cos(angle), rise or 0.0
            ways.append(way)
        goal, base = points[-1], np.zeros(3) if self.absolute else start
        words = self.words(start, goal, (u, v) if rise is None else (u, v, w))
        if polar and self.pole is not None:
            away = (goal[u] - self.pole[0], goal[v] - self.pole[1])
            words = f"x:{math.hypot(*away):.7f} c:{math.degrees(math.atan2(away[1], away[0])):.7f}"
        if radius:
            words += f" R{size if abs(sweep) < math.pi else -size:.6f}"
        else:
            letters = (CENTRES[u], CENTRES[v])
            base = (start[u], start[v]) if self.absolute else (0.0, 0.0)
            words += f" {letters[0]}{base[0] + centre[0]:.6f} {letters[1]}{base[1] + centre[1]:.6f}"
        self.goes(f"G{3 if sweep > 0.0 else 2} {words}", points, radius=size, begin=ways[0], end=ways[1])

    def corner(self, first: tuple[float, float], second: tuple[float, float], share: float, chamfer: bool) -> None:
        """G12 between two lines in the plane, by two ways from the start; share: what it takes of the shorter one."""
        start = self.program_place()
        u, v, _ = self.axes
        middle, goal = start.copy(), start.copy()
        middle[[u, v]] += first
        goal[[u, v]] = middle[[u, v]] + second
        d, e = np.array(first) / math.hypot(*first), np.array(second) / math.hypot(*second)
        turn = math.atan2(d[0] * e[1] - d[1] * e[0], float(d @ e))
        leg = round(share * min(math.hypot(*first), math.hypot(*second)), 6)
        radius = round(leg / math.tan(abs(turn) / 2.0), 6)
        put = f"P70:{leg:.6f} P71: --" if chamfer else f"P71:{radius:.6f}"
        before, after = middle.copy(), middle.copy()
        before[[u, v]] -= leg * d
        after[[u, v]] += leg * e
        self.goes(f"G12 {put} G1 {self.words(start, middle, (u, v))}", np.array([start, before]))
        self.says(f"{self.words(middle, goal, (u, v))}")
        if chamfer:
            self.goes("", np.array([before, after]), within=True)
        else:
            left = np.array([-d[1], d[0]]) * math.copysign(1.0, turn)
            centre = before[[u, v]] + radius * left
            count = max(4, math.ceil(abs(turn) / math.sqrt(8.0 * SAGITTA / radius)))
            angles = math.atan2(*(-left[::-1])) + np.linspace(0.0, turn, count + 1)
            points = np.repeat(before[None], count + 1, axis=0)
            points[:, u], points[:, v] = centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)
            ways = [np.zeros(3), np.zeros(3)]
            ways[0][[u, v]], ways[1][[u, v]] = d, e
            self.goes("", points, within=True, radius=radius, begin=ways[0], end=ways[1])
        self.goes("", np.array([after, goal]))

    def three(self, first: tuple[float, float], second: tuple[float, float]) -> None:
        """G123: two ways in the plane, on the circle through their three points, or on two lines."""
        start = self.program_place()
        u, v, _ = self.axes
        q, r = np.array(first), np.array(first) + second
        middle, goal = start.copy(), start.copy()
        middle[[u, v]] += q
        goal[[u, v]] += r
        self.says(f"G123 G1 {self.words(start, middle, (u, v))}")
        self.says(self.words(middle, goal, (u, v)))
        if abs(height(first, second)) < 0.02:
            self.goes("", np.array([start, middle]))
            self.goes("", np.array([middle, goal]))
            return
        centre = np.linalg.solve(2.0 * np.array([q, r]), np.array([q @ q, r @ r]))
        size = float(np.hypot(*centre))
        sense = -math.copysign(1.0, height(first, second))
        angles = [math.atan2(*(point - centre)[::-1]) for point in (np.zeros(2), q, r)]
        for a, b in ((0, 1), (1, 2)):
            sweep = sense * ((sense * (angles[b] - angles[a])) % (2.0 * math.pi))
            turned = angles[a] + sweep * np.linspace(
                0.0, 1.0, 2 + math.ceil(abs(sweep) / math.sqrt(8 * SAGITTA / size))
            )
            points = np.repeat(start[None], len(turned), axis=0)
            points[:, u] += centre[0] + size * np.cos(turned)
            points[:, v] += centre[1] + size * np.sin(turned)
            ways = [np.zeros(3), np.zeros(3)]
            for way, angle in zip(ways, (turned[0], turned[-1]), strict=True):
                way[u], way[v] = -sense * math.sin(angle), sense * math.cos(angle)
            self.goes("", points, radius=size, begin=ways[0], end=ways[1])

    def uncorrected(self, goal: NDArray[np.float64], axes: tuple[int, ...]) -> None:
        """A block with G66: places of the machine, in the sense of its axes."""
        there = goal * self.senses
        places = np.array([self.place, [there[axis] if axis in axes else self.place[axis] for axis in range(3)]])
        ways = self.senses * (places[1] - (0.0 if self.absolute else places[0]))
        words = " ".join(f"{NAMES[a]}{ways[a]:.6f}" for a in axes)
        self.says(f"G66 G1 {words}")
        self._drawn(places, {}, rapid=False, stops=self.exact)


def height(first: tuple[float, float], second: tuple[float, float]) -> float:
    """How far the end of the first way lies beside the chord of both, on its left, as a share of the chord."""
    chord = (first[0] + second[0], first[1] + second[1])
    return (chord[0] * first[1] - chord[1] * first[0]) / (chord[0] ** 2 + chord[1] ** 2)


def moved(by: NDArray[np.float64]) -> NDArray[np.float64]:
    """A shift as a matrix."""
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


places = st.tuples(*[st.integers(-400, 400).map(lambda n: n / 10.0)] * 3).map(np.array)
some_axes = st.sampled_from([(0,), (1,), (2,), (0, 1), (1, 2), (0, 2), (0, 1, 2), (0, 1, 2), (0, 1, 2)])
ways = st.tuples(st.integers(-300, 300), st.integers(-300, 300)).map(lambda w: (w[0] / 10.0, w[1] / 10.0))
feeds = st.sampled_from([600, 1800, 4200, 9000])
millimetres = st.integers(-300, 300).map(lambda n: n / 10.0)
KINDS = (
    *("line",) * 4, *("arc",) * 4, *("rapid",) * 2, *("corner",) * 3, "three", *("dimension",) * 2,
    *("uncorrected",) * 2, "zero", "shift", "correction", "rotation", "added", "mirror", "polar", "plane", "feed",
    "exact", "length", "sense", "loop",
)  # fmt: skip


@st.composite
def programs(draw: st.DrawFn, most: int = 10, *, least: int = 2, frames: bool = True) -> Draughtsman:
    """A program of up to `most` things, from rapid to a first place on, and what it draws."""
    drawn = Draughtsman(draw(st.booleans()), draw(st.booleans()))
    drawn.says("G0 G90 F3000")
    drawn.line(np.array([1.0, 2.0, 3.0]), (0, 1, 2), "G0")
    for _ in range(draw(st.integers(least, most))):
        kind = draw(st.sampled_from(KINDS if frames else KINDS[:16]))
        u, v, _ = drawn.axes
        match kind:
            case "line":
                kinds = [*[("G1", None)] * 4, ("G1 G8", None), ("G1", 240.0), (f"G1 {DWELL}", None)]
                g, end_feed = draw(st.sampled_from(kinds))
                drawn.line(draw(places), draw(some_axes), g, end_feed)
            case "rapid":
                drawn.line(draw(places), draw(some_axes), "G0")
            case "arc":
                centre = draw(ways)
                if math.hypot(*centre) < 0.5:
                    continue
                degrees = draw(st.integers(3, 357)) * draw(st.sampled_from([1, -1]))
                by_radius = draw(st.booleans()) and not 160 < abs(degrees) < 200 and 10 < abs(degrees) < 350
                rise = draw(st.one_of(st.none(), st.integers(-100, 100).map(lambda n: n / 10.0)))
                drawn.arc(centre, math.radians(degrees), rise, by_radius)
            case "corner":
                first, second = draw(ways), draw(ways)
                across = abs(first[0] * second[1] - first[1] * second[0])
                along = first[0] * second[0] + first[1] * second[1]
                turn = math.degrees(math.atan2(across, along))
                if min(math.hypot(*first), math.hypot(*second)) < 1.0 or not 10.0 < turn < 160.0:
                    continue
                drawn.corner(first, second, draw(st.sampled_from([0.05, 0.3, 0.8])), draw(st.booleans()))
            case "three":
                first, second = draw(ways), draw(ways)
                if math.hypot(first[0] + second[0], first[1] + second[1]) < 1.0:
                    continue
                beside = abs(height(first, second))
                if min(math.hypot(*first), math.hypot(*second)) > 1.0 and (beside < 0.015 or beside > 0.025):
                    drawn.three(first, second)
            case "zero":
                g = draw(st.sampled_from([53, 54, 55, 56, 153]))
                drawn.zero = np.array(ZERO_POINTS.get(g, (0.0, 0.0, 0.0)))
                drawn.shift = np.zeros(3)
                drawn.says(f"G{g}")
            case "shift" | "correction":
                values, axes = draw(places), draw(some_axes)
                g = 92 if kind == "shift" else 44
                drawn.says(f"G{g} " + " ".join(f"{NAMES[axis]}{values[axis]}" for axis in axes))
                if kind == "shift":
                    drawn.shift = np.array([values[axis] if axis in axes else 0.0 for axis in range(3)])
                else:
                    kept = drawn.correction
                    drawn.correction = np.array([values[axis] if axis in axes else kept[axis] for axis in range(3)])
            case "rotation":
                if drawn.turned is not None:
                    drawn.turned = None
                    drawn.says("G46")
                    continue
                u0, v0, angle = draw(millimetres), draw(millimetres), draw(st.integers(-3600, 3600)) / 10.0
                drawn.turned = (u0, v0, angle, 0.0, 0.0, 0.0)
                drawn.says(f"G45 P160:{u0} P161:{v0} P163:{angle}")
            case "added":
                if drawn.turned is None:
                    continue
                du, dv, dangle = draw(millimetres), draw(millimetres), draw(st.integers(-900, 900)) / 10.0
                before = drawn.turned
                drawn.turned = (*before[:3], before[3] + du, before[4] + dv, before[5] + dangle)
                drawn.says(f"P165:{du} P166:{dv} P168:{dangle}")
            case "mirror":
                signs = (draw(st.sampled_from([1, -1])), draw(st.sampled_from([1, -1])))
                drawn.mirror = signs
                drawn.says("G60")
                text = " ".join(g for g, sign in (("G61", signs[0]), ("G62", signs[1])) if sign < 0)
                if text:
                    drawn.says(text)
                drawn.absolute = True
                drawn.says("G90")
                drawn.line(draw(places), (0, 1, 2))
            case "dimension":
                drawn.absolute = not drawn.absolute
                drawn.says("G90" if drawn.absolute else "G91")
            case "polar":
                drawn.absolute = True
                pole = (draw(millimetres), draw(millimetres))
                drawn.says(f"G90 G10 {NAMES[u]}{pole[0]} {NAMES[v]}{pole[1]}")
                drawn.pole = pole
                for _ in range(draw(st.integers(1, 3))):
                    centre, degrees = draw(ways), draw(st.sampled_from([40, 120, 230, -70, -300]))
                    if math.hypot(*centre) > 0.5 and draw(st.booleans()):
                        drawn.arc(centre, math.radians(degrees), None, True, polar=True)
                        continue
                    start = drawn.program_place()
                    radius, angle = draw(st.integers(0, 400)) / 10.0, draw(st.integers(-3600, 3600)) / 10.0
                    goal = start.copy()
                    goal[u] = pole[0] + radius * math.cos(math.radians(angle))
                    goal[v] = pole[1] + radius * math.sin(math.radians(angle))
                    sign = draw(st.sampled_from(["", "-"]))
                    drawn.goes(f"G1 x:{sign}{radius} c:{angle}", np.array([start, goal]))
                drawn.pole = None
                drawn.says("G11")
            case "plane":
                # the rotation, mirrors and length lie in the plane: what is on goes with it
                drawn.plane = draw(st.sampled_from([17, 18, 19]))
                drawn.says(f"G{drawn.plane}")
            case "feed":
                drawn.feed = float(draw(feeds))
                drawn.says(f"F{drawn.feed:.0f}")
            case "uncorrected":
                drawn.uncorrected(draw(places), draw(some_axes))
            case "exact":
                drawn.exact = not drawn.exact
                drawn.says("G28" if drawn.exact else "G29")
                if drawn.exact:  # its own block, without a path, ends with an exact stop, too
                    drawn.stands()
            case "sense":
                bits = draw(st.integers(0, 7))
                drawn.senses = np.array([-1.0 if bits >> axis & 1 else 1.0 for axis in range(3)])
                drawn.says(f"P8892:{bits}")
            case "loop":
                drawn.loop(draw(st.lists(places, min_size=1, max_size=2)), draw(st.integers(1, 3)))
            case "length":
                drawn.length = draw(st.integers(0, 300)) / 10.0
                drawn.says(f"tl:{drawn.length}")
    drawn.says("M30")
    return drawn
