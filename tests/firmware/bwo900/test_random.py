"""Random programs: paths keep to their geometry, set points to the limits, corrected contours to their distance.

Limits are those of the parameters, set here: 100, 80, 60 mm/s and 250, 200, 150 mm/s^2. A set point is rounded to an
increment of 1 um, and so are the ends of pieces: sqrt(3) um at most in space.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from firmware.bwo900.run import Analysed
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.firmware.bwo900.geometry.contour import Contour
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element
from isel_twin.firmware.bwo900.geometry.offset import Offset
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.realtime.path import MotionLimits, PieceMaker
from isel_twin.motion.joined import Joined, joined
from tests.thorough import drawn

PERIOD_NS = 2_000_000
DT_S = PERIOD_NS * 1e-9
SPEED = np.array([100.0, 80.0, 60.0])
ACCELERATION = np.array([250.0, 200.0, 150.0])
LIMITS = {
    **{f"p{12004 + 200 * axis}": float(60.0 * SPEED[axis]) for axis in range(3)},
    **{f"p{12008 + 200 * axis}": float(1000.0 * SPEED[axis] / ACCELERATION[axis]) for axis in range(3)},
}
ROUNDED_MM = 1.8e-3

coordinates = st.integers(-400, 400).map(lambda n: n / 10.0)
points = st.tuples(coordinates, coordinates, coordinates)
feeds = st.sampled_from([300, 1500, 6000, 20000])


@st.composite
def blocks(draw: st.DrawFn) -> list[str]:
    """Lines and arcs, with feeds, as words."""
    made = [f"G1 F{draw(feeds)} X1 Y1 Z1"]
    here = (1.0, 1.0)
    for _ in range(draw(st.integers(1, 12))):
        x, y, z = draw(points)
        far = math.dist(here, (x, y))
        kind = draw(st.sampled_from(["line", "line", "rapid", "arc", "helix"])) if far > 0.5 else "line"
        feed = f" F{draw(feeds)}" if draw(st.booleans()) else ""
        match kind:
            case "rapid":
                made.append(f"G0 X{x} Y{y} Z{z}")
            case "arc" | "helix":
                radius = far * draw(st.sampled_from([0.6, 1.0, 3.0])) * draw(st.sampled_from([1, -1]))
                made.append(
                    f"G{draw(st.sampled_from([2, 3]))} X{x} Y{y} R{radius:.4f}" + (f" Z{z}" if kind == "helix" else "")
                )
            case _:
                made.append(f"G1 X{x} Y{y} Z{z}")
        made[-1] += feed
        here = (x, y)
    return made


def analysed(words: list[str], head: str = "G90") -> Analysed:
    lines = [f"N{10 * (number + 1)} {text}" for number, text in enumerate([head, *words, "M30"])]
    return Analysed("\n".join(lines), **LIMITS)


def elements(done: Analysed) -> list[Element]:
    """All elements, corners and radius correction done."""
    made = done.blocks
    for item in (Contour(), Offset(None)):
        made = [out for block in made for out in item.push(block)] + item.flush()
    return [element for block in made for element in block.elements]


def planned(done: Analysed) -> tuple[Joined, NDArray[np.float64]]:
    """The plan of a whole program, and the place after every tick, mm [ticks, 3]."""
    path = PieceMaker(MotionLimits.of(done.parameters, [1000.0] * 3), (0.0, 0.0, 0.0))
    plan = joined(path.pieces(done.path)[0], PERIOD_NS)
    places = np.cumsum(np.vstack([np.zeros((1, 3)), plan.deltas(0, plan.ticks)]), axis=0)
    return plan, places / 1000.0


def sampled(path: list[Element], count: int) -> NDArray[np.float64]:
    return np.array([element.point(i / count) for element in path for i in range(count + 1)])


def distance(places: NDArray[np.float64], path: list[Element]) -> NDArray[np.float64]:
    """Distance of each place to the nearest element, mm; arcs by chords of sagitta below 0.1 um."""
    least = np.full(len(places), np.inf)
    for element in path:
        count = 1
        if isinstance(element, Arc):
            count = max(1, math.ceil(abs(element.sweep_rad) / math.sqrt(8e-4 / element.radius_mm)))
        corners = sampled([element], count)
        for a, b in pairwise(corners):
            way = b - a
            length = float(way @ way)
            share = np.clip((places - a) @ way / length, 0.0, 1.0) if length else np.zeros(len(places))
            least = np.minimum(least, np.linalg.norm(places - a - share[:, None] * way, axis=1))
    return least


@given(blocks())
@settings(max_examples=drawn(25), deadline=None)
def test_set_points_keep_to_the_path_and_end_exactly(words: list[str]) -> None:
    done = analysed(words)
    _, places = planned(done)
    assert np.array_equal(np.rint(places[-1] * 1000), np.rint(np.array(done.points[-1]) * 1000))
    assert (
        distance(places[:: max(len(places) // 400, 1)], [e for b in done.path for e in b.elements]).max() < ROUNDED_MM
    )


@given(blocks())
@settings(max_examples=drawn(25), deadline=None)
def test_set_points_keep_to_speeds_and_feeds(words: list[str]) -> None:
    """Over ten ticks, in which two roundings are 0.1 mm/s."""
    done = analysed(words)
    _, places = planned(done)
    if len(places) > 10:
        axes = np.abs(places[10:] - places[:-10]) / (10 * DT_S)
        assert (axes <= SPEED + 0.06).all()
    fastest = max((block.feed_mm_min or 0.0) / 60.0 for block in done.path)
    if not any(block.rapid for block in done.path) and len(places) > 10:
        assert np.linalg.norm(places[10:] - places[:-10], axis=1).max() / (10 * DT_S) <= fastest + 0.1


@given(blocks())
@settings(max_examples=drawn(25), deadline=None)
def test_with_exact_stops_no_axis_exceeds_its_acceleration(words: list[str]) -> None:
    """Second differences over 20 ticks, 40 ms: three roundings are 1.25 mm/s^2."""
    done = analysed(words, "G28")
    _, places = planned(done)
    if len(places) > 40:
        second = np.abs(places[40:] - 2.0 * places[20:-20] + places[:-40]) / (20 * DT_S) ** 2
        assert (second <= ACCELERATION + 1.3).all()


@given(blocks(), st.sampled_from([1.0, 2.0, 5.0]))
@settings(max_examples=drawn(25), deadline=None)
def test_corners_are_passed_at_their_speed(words: list[str], exponent: float) -> None:
    """At a joint: the lower feed times the cosine of the change of direction to the exponent; 0 at 90 degrees."""
    done = analysed(words)
    done.parameters.write(8_851, exponent)
    plan, _ = planned(done)
    path = [(element, block) for block in done.path for element in block.elements]
    most = float(max(ACCELERATION)) * math.sqrt(3.0) * DT_S
    if plan.pieces != len(path):  # a piece of less than an increment was left out
        return
    for joint, ((a, block), (b, following)) in enumerate(pairwise(path), 1):
        cosine = sum(p * q for p, q in zip(a.tangent(1.0), b.tangent(0.0), strict=True))
        rapid = 200.0
        feed = min(rapid if c.rapid else (c.feed_mm_min or 0.0) / 60.0 for c in (block, following))
        stops = block.rapid
        allowed = 0.0 if stops else feed * max(cosine, 0.0) ** exponent
        assert plan.speed(plan.passed(joint)) <= allowed + most + 1e-6


@given(blocks(), st.sampled_from(["G61", "G62", "G61 G62"]), st.sampled_from(["", "G41 tr:0.5", "G42 tr:0.5"]))
@settings(max_examples=drawn(25), deadline=None)
def test_mirrored_programs_give_mirrored_paths(words: list[str], mirror: str, correction: str) -> None:
    signs = np.array([-1.0 if "61" in mirror else 1.0, -1.0 if "62" in mirror else 1.0, 1.0])
    both = []
    for g in ("G60", mirror):
        try:
            both.append(sampled(elements(analysed(words, f"{g} {correction}")), 5))
        except ProgramError as error:
            both.append(np.full((1, 3), float(error.number)) * (signs if g != "G60" else 1.0))
    assert both[0] * signs == pytest.approx(both[1], abs=1e-6)


@given(blocks(), st.integers(-3600, 3600), points, st.sampled_from(["", "G41 tr:0.5"]))
@settings(max_examples=drawn(25), deadline=None)
def test_rotated_programs_give_rotated_paths(
    words: list[str], tenths: int, centre: tuple[float, float, float], correction: str
) -> None:
    angle = math.radians(tenths / 10.0)
    turn = np.array([[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0, 0, 1]])
    away = np.array([centre[0], centre[1], 0.0])
    plain = [f"G0 X0.5 Y0.5 Z0 {correction}", *words]
    turned = [f"G45 P160:{centre[0]} P161:{centre[1]} P163:{tenths / 10.0}", *plain]
    both = []
    for text in (plain, turned):
        try:
            both.append(sampled(elements(analysed(text))[1:], 5))
        except ProgramError as error:
            both.append(np.full((1, 3), float(error.number)))
    if both[0].shape == (1, 3) or both[1].shape == (1, 3):
        assert both[0].shape == both[1].shape
    else:
        assert both[0] @ turn.T + away == pytest.approx(both[1], abs=1e-6)


@st.composite
def stars(draw: st.DrawFn) -> list[tuple[float, float, float]]:
    """A contour that is seen whole from its middle, counter-clockwise: X and Y of its corners, and the angle by which
    the edge from there on is bent, 0 for a line. It begins in the middle of its first edge."""
    count = draw(st.integers(3, 12))
    radii = draw(st.lists(st.integers(200, 600), min_size=count, max_size=count))
    bends = draw(st.lists(st.sampled_from([0.0, 0.0, 0.0, 25.0, -25.0, 50.0]), min_size=count, max_size=count))
    corners = [
        (r / 10.0 * math.cos(2 * math.pi * k / count), r / 10.0 * math.sin(2 * math.pi * k / count), bend)
        for k, (r, bend) in enumerate(zip(radii, bends, strict=True))
    ]
    (ax, ay, _), (bx, by, _) = corners[:2]
    return [((ax + bx) / 2.0, (ay + by) / 2.0, 0.0), *corners[1:], (ax, ay, 0.0)]


def along(corners: list[tuple[float, float, float]]) -> list[str]:
    """The way around, from the first corner back to it."""
    made = [f"G1 F100 X{corners[0][0]:.7f} Y{corners[0][1]:.7f}"]
    for (ax, ay, bend), (bx, by, _) in pairwise([*corners, corners[0]]):
        end = f"X{bx:.7f} Y{by:.7f}"
        radius = math.dist((ax, ay), (bx, by)) / (2.0 * math.sin(math.radians(abs(bend) / 2.0))) if bend else 0.0
        made.append(f"{'G3' if bend > 0.0 else 'G2'} {end} R{radius:.7f}" if bend else f"G1 {end}")
    return made


def flat(element: Element) -> NDArray[np.float64]:
    """Its points in XY, by chords of sagitta below 0.1 um."""
    bent = isinstance(element, Arc)
    count = math.ceil(abs(element.sweep_rad) / math.sqrt(8e-4 / element.radius_mm)) + 1 if bent else 1
    return sampled([element], count)[:, :2]


def ring(path: list[Element]) -> shapely.Polygon:
    """Rounded, so that what ends where it began does not cross itself by the last bit."""
    return shapely.Polygon(np.concatenate([flat(element) for element in path]).round(6))


def rolled(element: Element, aside: float) -> NDArray[np.float64]:
    """Where the middle of a disc is while it rolls along an element: every 0.2 mm, its radius aside, left > 0."""
    points = np.array(shapely.segmentize(shapely.LineString(flat(element)), 0.2).coords)
    along = np.diff(points, axis=0)
    left = along[:, ::-1] * [-1.0, 1.0] / np.linalg.norm(along, axis=1)[:, None]
    return (points[:-1] + points[1:]) / 2.0 + aside * left


def off(places: NDArray[np.float64], other: shapely.Geometry) -> NDArray[np.float64]:
    """Distances of places in XY."""
    return shapely.distance(shapely.points(places), other)


@given(stars(), st.sampled_from(["G41", "G42"]), st.sampled_from([0.5, 3.0, 8.0, 16.0]))
@settings(max_examples=drawn(60), deadline=None)
def test_corrected_contours_are_the_edge_of_the_grown_or_shrunk_area(
    corners: list[tuple[float, float, float]], side: str, radius: float
) -> None:
    """Shapely is the judge: the path is closed, does not cross itself, is the radius away from the contour everywhere
    within 1 um, and comes as near to each element. So it is the edge; `shapely.buffer` itself is not: for radii that
    are large against the chords of arcs it simplifies, by millimetres. Where the tool cannot touch an element at all
    the manual's message comes (7.7); where it would cut one that is no neighbour the path crosses itself: only
    neighbours are looked at."""
    words, aside = along(corners), radius if side == "G41" else -radius
    contour = elements(analysed(words))[1:]
    lines = [shapely.LineString(flat(element)) for element in contour]
    number, path = 0, list[Element]()
    try:
        path = elements(analysed([f"{side} tr:{radius} {words[0]}", *words[1:], "G40 X0 Y0"]))[1:-1]
    except ProgramError as error:
        number = error.number
    if number:
        assert number in (1152, 1156, 1223)
        edge, larger = ring(contour).exterior, 1.02 * aside
        assert min(off(rolled(e, larger), edge).max() for e in contour) < abs(larger) - 1e-3
    elif not ring(path).is_valid:
        others = [shapely.MultiLineString([b for b in lines if not a.dwithin(b, 1e-5)]) for a in lines]
        assert min(off(rolled(e, aside), o).min() for e, o in zip(contour, others, strict=True)) < radius - 1e-3
    else:
        area, way = ring(contour), ring(path)
        assert area.contains(way) if side == "G41" else way.contains(area)
        places = np.array(shapely.segmentize(way.exterior, 0.2).coords)
        assert off(places, area.exterior) == pytest.approx(radius, abs=1e-3)
        assert shapely.distance(lines, way.exterior) == pytest.approx(radius, abs=1e-3)
