"""Arcs, in every plane and frame: ends that miss the programmed circle by as much as P8843 allows, and radii."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest
from conformance.bwo900_desk import analysed
from hypothesis import example, given, settings
from hypothesis import strategies as st

from isel_twin.firmware.bwo900.geometry.elements import Arc
from tests.thorough import drawn

TOLERANCE_MM = 0.003  # P8843 as delivered
PLANES = {"G17": ("X", "Y", "I", "J"), "G18": ("Z", "X", "K", "I"), "G19": ("Y", "Z", "J", "K")}
INDEX = "XYZ"
START = (40.0, 55.0)


Frame = tuple[float, float, float]
"""Where a turned frame has its origin in the plane, mm, and by how much it is turned, degrees."""
AS_IT_IS = (0.0, 0.0, 0.0)


def arc_of(text: str) -> tuple[Arc, bool]:
    """The only arc, and whether its radius was too small (M1234)."""
    done = analysed(text)
    made = [element for block in done.blocks for element in block.elements if isinstance(element, Arc)]
    assert len(made) == 1
    return made[0], [note.number for note in done.interpreter.notes] == [1234]


@dataclass(frozen=True)
class Circle:
    """A part of a circle as it is programmed, and the frame it is programmed in."""

    plane: str
    clockwise: bool
    absolute: bool
    mirror: str
    frame: Frame
    radius: float
    begin: float
    """Angle of the start, seen from the centre, rad."""
    share: float
    """Of the full turn."""
    miss: float
    """How far outside of the circle its end is, as a share of the tolerance."""

    @property
    def turn(self) -> float:
        return (-1.0 if self.clockwise else 1.0) * 2.0 * math.pi * self.share

    @property
    def signs(self) -> tuple[int, int]:
        """Of the plane's first and second axis."""
        return -1 if "G61" in self.mirror else 1, -1 if "G62" in self.mirror else 1

    @property
    def centre(self) -> tuple[float, float]:
        return START[0] - self.radius * math.cos(self.begin), START[1] - self.radius * math.sin(self.begin)

    @property
    def end(self) -> tuple[float, float]:
        out, angle = self.radius + self.miss * TOLERANCE_MM, self.begin + self.turn
        return self.centre[0] + out * math.cos(angle), self.centre[1] + out * math.sin(angle)

    def arc(self, centre_or_radius: str) -> tuple[Arc, bool]:
        """Programmed with these words."""
        a, b, *_ = PLANES[self.plane]
        base = (0.0, 0.0) if self.absolute else START
        words = f"{a}{self.end[0] - base[0]:.9f} {b}{self.end[1] - base[1]:.9f} {centre_or_radius}"
        u, v, angle = self.frame
        turned = "" if self.frame == AS_IT_IS else f"G45 P160:{u} P161:{v} P163:{angle}"
        way_in = f"N5 {self.plane} F500 {turned}|N7 {self.mirror}|N10 G90 G0 {a}{START[0]} {b}{START[1]}"
        g = f"{'G90' if self.absolute else 'G91'} {'G2' if self.clockwise else 'G3'}"
        return arc_of(f"{way_in}|N20 {g} {words}|N30 M30")

    def on_the_machine(self, point: tuple[float, float]) -> tuple[float, float]:
        """A point of the program in the plane: turned, then mirrored, then moved (bwo900/6)."""
        e, (u, v) = math.radians(self.frame[2]), self.signs
        turned = point[0] * math.cos(e) - point[1] * math.sin(e), point[0] * math.sin(e) + point[1] * math.cos(e)
        return self.frame[0] + u * turned[0], self.frame[1] + v * turned[1]

    def in_plane(self, arc: Arc, count: int = 33) -> list[tuple[float, float]]:
        """Points along the arc."""
        first, second = (INDEX.index(letter) for letter in PLANES[self.plane][:2])
        return [(point[first], point[second]) for point in (arc.point(n / (count - 1)) for n in range(count))]


def circles(shares: st.SearchStrategy[float]) -> st.SearchStrategy[Circle]:
    tenths = st.integers(-3600, 3600).map(lambda n: n / 10.0)
    return st.builds(
        Circle,
        plane=st.sampled_from(sorted(PLANES)),
        clockwise=st.booleans(),
        absolute=st.booleans(),
        mirror=st.sampled_from(["", "G61", "G62", "G61 G62"]),
        frame=st.one_of(st.just(AS_IT_IS), st.tuples(tenths, tenths, tenths)),
        radius=st.floats(0.5, 80.0),
        begin=st.floats(0.0, 2.0 * math.pi),
        share=shares,
        miss=st.floats(-0.99, 0.99),
    )


@settings(max_examples=drawn(300), deadline=None)
@given(circles(st.one_of(st.just(1.0), st.floats(0.02, 0.98))))
@example(Circle("G17", True, True, "", AS_IT_IS, 10.0, 0.0, 1.0, 1e-6 / TOLERANCE_MM))
@example(Circle("G17", False, True, "", AS_IT_IS, 10.0, 0.0, 1.0, -1e-6 / TOLERANCE_MM))
@example(Circle("G17", True, False, "G61", AS_IT_IS, 10.0, 0.0, 1.0, 0.99))
def test_the_programmed_circle_is_cut(circle: Circle) -> None:
    """Every point of the path is as far from the programmed centre as the radius, but for the tolerance, and goes the
    programmed way round."""
    _, _, i, j = PLANES[circle.plane]
    base = (0.0, 0.0) if circle.absolute else START
    arc, _ = circle.arc(f"{i}{circle.centre[0] - base[0]:.9f} {j}{circle.centre[1] - base[1]:.9f}")
    u, v = circle.signs
    assert arc.sweep_rad == pytest.approx(circle.turn * u * v, abs=2.5 * TOLERANCE_MM / circle.radius + 1e-6)
    centre = circle.on_the_machine(circle.centre)
    for point in circle.in_plane(arc):
        assert abs(math.dist(point, centre) - circle.radius) <= 2.0 * TOLERANCE_MM + 1e-6


@settings(max_examples=drawn(200), deadline=None)
@given(circles(st.one_of(st.just(0.5), st.floats(0.02, 0.98))))
@example(Circle("G17", True, True, "", (5.0, 7.0, 30.0), 10.0, 0.0, 0.5, 0.0))
def test_the_circle_of_a_programmed_radius_is_cut(circle: Circle) -> None:
    """From the start to the end about one centre, on its own side of half a turn (R > 0 less, R < 0 more) and the
    programmed way round: there is only one such arc. P8843 is about centres; R below half of the chord is M1234, and
    half of the chord from then on (4.3)."""
    arc, too_small = circle.arc(f"R{circle.radius if circle.share <= 0.5 else -circle.radius:.9f}")
    half = math.dist(START, circle.end) / 2.0
    if abs(half - circle.radius) > 1e-7:
        assert too_small == (half > circle.radius)
    points, u_v = circle.in_plane(arc), circle.signs[0] * circle.signs[1]
    assert points[0] == pytest.approx(circle.on_the_machine(START), abs=1e-6)
    assert points[-1] == pytest.approx(circle.on_the_machine(circle.end), abs=1e-6)
    assert math.copysign(1.0, arc.sweep_rad) == math.copysign(1.0, circle.turn * u_v)
    more = abs(arc.sweep_rad) - math.pi
    assert more <= 1e-6 if circle.share <= 0.5 else more >= -1e-6
    for point in points:
        assert math.dist(point, arc.centre) == pytest.approx(max(circle.radius, half), abs=1e-6)


def test_a_full_circle_whose_end_misses_by_a_rounded_digit() -> None:
    for x, y in ((60.000001, 50.0), (59.999999, 50.0), (60.0, 50.000001), (60.0, 49.999999)):
        for g, turn in (("G2", -1.0), ("G3", 1.0)):
            arc, _ = arc_of(f"N10 G0 X50 Y50|N20 G1 F3000 X60|N30 {g} X{x:.6f} Y{y:.6f} I50 J50|N40 M30")
            assert arc.centre == pytest.approx((50.0, 50.0), abs=1e-4)
            assert arc.sweep_rad == pytest.approx(turn * 2.0 * math.pi, abs=1e-6)
