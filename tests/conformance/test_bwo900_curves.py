"""Curves in space of the BWO 900: splines and polynomials (manual 4.18), circles in space (4.3).

Judge: the definitions. A polynomial is V3 t^3 + V2 t^2 + V1 t + V0; a circle has all its points in the plane of start,
end and centre, at one distance; a spline goes through its points with one tangent at each.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from conformance.bwo900_desk import analysed, fresh, mm, run, said, start
from conformance.rows import case, shows

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.spline import Spline
from isel_twin.testing import Desk

SPLINE = (
    "P1|N5 G54 G49 G0 F2000 X0 Y40 Z15|N10 G1 X8 Y40 Z10|N20 G50 X14.8 Y39.5|N30 X23.5 Y33.3|N40 X30 Y19.4"
    "|N50 X44.3 Y12.9|N60 X62.3 Y19.3|N70 X71.8 Y38.5|N80 X75.124 Y48.749|N90 X80.7 Y58|N100 X96.1 Y62"
    "|N110 X110.5 Y51.1|N120 X112.9 Y37.2|N130 X114.7 Y31.9|N140 X119 Y29.3|N150 G1 X123.2 Y29.1|N160 M30 Z15"
)
"""The printed example of 4.18, moved by 8, 40 and 10 mm so that no axis leaves the machine."""
POINTS = [
    (8, 40), (14.8, 39.5), (23.5, 33.3), (30, 19.4), (44.3, 12.9), (62.3, 19.3), (71.8, 38.5), (75.124, 48.749),
    (80.7, 58), (96.1, 62), (110.5, 51.1), (112.9, 37.2), (114.7, 31.9), (119, 29.3), (123.2, 29.1),
]  # fmt: skip


def drawn(desk: Desk, mark: int) -> np.ndarray:
    """float64 [n, 3], mm, of the set points after the first `mark`; the last is where the axes are."""
    way = np.cumsum(desk.steps_since(mark).delta, axis=0)
    return (np.array(desk.counts) - way[-1] + way) / 1e3


def program(text: str, **before: float) -> np.ndarray:
    """The set points of P1."""
    desk = fresh(text, **before)
    mark = desk.ticks
    start(desk)
    desk.finish()
    assert said(desk) == []
    return drawn(desk, mark)


def splined(bulge: float, text: str) -> list[PathBlock]:
    """The blocks of a program as the filter of splines gives them."""
    spline = Spline(bulge)
    return [out for block in analysed(text).path for out in spline.push(block)] + spline.flush()


@shows("bwo900-4.3-11")
@pytest.mark.parametrize(("g", "part"), [("G3", 1.0 / 3.0), ("G2", 2.0 / 3.0)])
@pytest.mark.parametrize("plane", ["G17", "G18"])
def test_circle_in_space(g, part, plane):
    """120 degrees in the plane x + y + z = 125 about (50, 50, 25): G03 the short arc, G02 the long one; whatever
    the plane."""
    end = "X45.9175 Y45.9175 Z33.165"
    begin = (58.165, 45.9175, 20.9175)
    centre = np.array([50.0, 50.0, 25.0])
    places = program(f"P1|N1 {plane} G0 X58.165 Y45.9175 Z20.9175|N2 {g} F3000 {end} I50 J50 K25|N3 M30")
    first = int(np.argmin(np.linalg.norm(places - begin, axis=1)))
    places = places[first:]
    radius = np.linalg.norm(begin - centre)
    assert np.abs(np.linalg.norm(places - centre, axis=1) - radius).max() < 0.003
    assert np.abs((places - centre) @ np.ones(3) / math.sqrt(3.0)).max() < 0.002
    length = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
    assert length == pytest.approx(2.0 * math.pi * radius * part, rel=2e-3)
    assert places[-1] == pytest.approx((45.9175, 45.9175, 33.165), abs=6e-4)


@shows("bwo900-4.3-11")
@pytest.mark.parametrize("words", ["G91 X-12.2475 Y0 Z12.2475 I-8.165 J4.0825 K4.0825"])
def test_its_centre_counts_from_the_start_with_g91(words):
    places = program(f"P1|N1 G0 X58.165 Y45.9175 Z20.9175|N2 G3 F3000 {words}|N3 M30")
    assert places[-1] == pytest.approx((45.9175, 45.9175, 33.165), abs=6e-4)


@shows("bwo900-4.3-18")
@pytest.mark.parametrize(("words", "number"), [("X30 Y50 Z25 I50 J50 K25", 1238), ("X50 Y65 Z25 I50 J50 K25", 1238)])
def test_what_is_no_circle_in_space(words, number):
    """Start, end and centre on a line are no plane; radii of 20 and 15 mm."""
    assert said(run(f"P1|N1 G0 X70 Y50 Z25|N2 G3 F1000 {words}|N3 M30")) == [number]


@shows("bwo900-4.18-3")
@pytest.mark.parametrize("dimension", ["G90", "G91"])
def test_polynomial(dimension):
    """4.18: P = V3 t^3 + V2 t^2 + V1 t + V0; the end is V3 + V2 + V1 + V0."""
    words = "X:[-30,20,60] Y:[15,0,-20] Z:[0,8,-4]"
    places = program(f"P1|N1 G0 X20 Y40 Z30|N2 {dimension} G52 F2400 {words}|N3 M30")
    t = np.linspace(0.0, 1.0, 4001)[:, None]
    wanted = np.array([20.0, 40.0, 30.0]) + t * ([60, -20, -4] + t * ([20, 0, 8] + t * [-30, 15, 0]))
    assert places[-1] == pytest.approx((70.0, 35.0, 34.0))
    on_it = places[np.argmin(np.linalg.norm(places - wanted[0], axis=1)) :]
    nearest = np.min(np.linalg.norm(on_it[:, None, :] - wanted[None, ::4], axis=2), axis=1)
    assert nearest.max() < 0.04  # wanted is drawn every 0.07 mm or so
    steps = np.linalg.norm(np.diff(on_it, axis=0), axis=1)
    assert steps.max() == pytest.approx(40.0 * 0.002, abs=0.003), "the feed is that along the path, not of t"


@shows("bwo900-4.18-3")
@pytest.mark.parametrize("words", ["G1 X:[1,2,3]", "G52 X:[1,2]", "G52 X:[1,,2]"])
def test_words_that_are_no_polynomial(words):
    assert said(run(f"P1|N1 G1 F1000 {words}|N2 M30")) == [1211]


@shows("bwo900-4.18-1")
def test_printed_example_goes_through_its_points():
    places = program(SPLINE)[:, :2]
    for point in POINTS:
        assert np.min(np.linalg.norm(places - point, axis=1)) < 0.04, point  # 33 mm/s: 0.067 mm a set point


@shows("bwo900-4.18-1")
@pytest.mark.parametrize("bulge", [0.0, 0.5, 0.85, 2.0])
def test_tangents_of_a_spline(bulge):
    """One tangent at every point: along the lead-in, c (P_i+1 - P_i-1) inside, along the lead-out (bwo900/85)."""
    c = bulge or 0.5
    cubics = [block.elements[0] for block in splined(bulge, SPLINE.partition("|")[2]) if block.spline]
    assert len(cubics) == 13
    points = np.array(POINTS)
    for i, cubic in enumerate(cubics):
        v1, v2, v3 = (np.array(v)[:2] for v in (cubic.v1, cubic.v2, cubic.v3))
        leaving, arriving = v1, v1 + 2.0 * v2 + 3.0 * v3
        assert np.array(cubic.start)[:2] + v1 + v2 + v3 == pytest.approx(points[i + 1], abs=1e-9)
        if i:
            assert leaving == pytest.approx(c * (points[i + 1] - points[i - 1]), abs=1e-9)
        if i < 12:
            assert arriving == pytest.approx(c * (points[i + 2] - points[i]), abs=1e-9)
    way = points[14] - points[13]
    assert arriving[0] * way[1] - arriving[1] * way[0] == pytest.approx(0.0, abs=1e-9)
    assert cubics[0].tangent(0.0)[:2] == pytest.approx((0.848, 0.0), abs=1e-3), "along the lead-in, Z15 to Z10 in 8 mm"


@shows("bwo900-4.18-2")
def test_g51_is_the_same_curve_with_a_feed_of_its_own():
    """The feed of a tight place holds the whole block with G50, a part of it with G51: the same places, sooner."""
    bend = "P1|N1 G1 F6000 X10 Y10|N2 {} X60 Y10.5|N3 X61 Y12|N4 G1 X61 Y40|N5 M30"
    plain, fitted = (program(bend.format(g), p12008=400.0, p12208=400.0) for g in ("G50", "G51"))
    assert len(fitted) < len(plain)
    apart = [np.min(np.linalg.norm(plain - place, axis=1)) for place in fitted[::20]]
    assert max(apart) < 0.11


@shows("bwo900-4.18-4")
@pytest.mark.parametrize(
    "text", ["N1 G50 F1000 X5|N2 X10 Y5|N3 G1 X20|N4 M30", "N1 G1 F1000 X5|N2 G50 X10 Y5|N3 X12 Y8|N4 M30"]
)
def test_a_spline_without_a_path_before_or_after_it(text):
    assert said(run(f"P1|{text}")) == [1235]


@shows("bwo900-4.18-5")
@pytest.mark.parametrize("g", ["G0", "G1", "G2"])
def test_paths_overwrite_each_other(g):
    """A circle may lead out: R 5 about (15, 10), tangential to Y."""
    lead_out = "X20 Y15 I15 J15" if g == "G2" else "X20 Y15"
    desk = run(f"P1|N1 G1 F1000 X5|N2 G50 X10 Y5|N3 X10 Y15|N4 {g} {lead_out}|N5 M30")
    assert said(desk) == []
    assert mm(desk)[:2] == (20.0, 15.0)


@shows("bwo900-4.18-6")
@pytest.mark.parametrize(
    ("text", "number"),
    [case("bwo900-4.18-6", "G50 X20 Y10|N4 G1 X30", 1232), case("bwo900-4.18-6", "G52 X:[1,2,3]", 1232)],
)
def test_no_radius_correction_on_curves_in_space(text, number):
    assert said(run(f"P1|N1 tr:2|N2 G41 G1 F1000 X10|N3 {text}|N9 M30")) == [number]


@shows("bwo900-4.18-1")
@pytest.mark.parametrize("override", [50.0, 100.0])
def test_stop_and_start_on_a_spline(override):
    """It brakes along the curve and goes on: the same set points but for their times."""
    whole = program(SPLINE)
    desk = fresh(SPLINE, p11310=override)
    mark = desk.ticks
    start(desk)
    desk.run(4.0)
    for name in ("stop", "start"):
        desk.set(name, "down")
        desk.set(name, "up")
        desk.run(1.0)
    desk.finish()
    places = drawn(desk, mark)
    assert mm(desk)[:2] == (123.2, 29.1)
    assert max(np.min(np.linalg.norm(whole - place, axis=1)) for place in places[::40]) < 0.11
