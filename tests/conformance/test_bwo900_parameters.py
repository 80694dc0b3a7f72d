"""BWO 900, chapter 8: parameters of motion, overrides, status cells, limits, parameters that make no sense."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from conformance.bwo900_desk import T1, Lagging, file, fresh, mm, parameters, put_out, said, start, value
from conformance.rows import shows

from isel_twin.firmware.bwo900.realtime.path import circumradius
from isel_twin.testing import Desk

pytestmark = pytest.mark.long(seconds=11)


def feeds(desk: Desk, limit_s: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """Places in mm [n, 3] and path speeds in mm/min [n], one every 2 ms, from Start of P1 to its end."""
    first = desk.ticks
    start(desk)
    desk.finish(limit_s)
    return moved(desk, first)


def moved(desk: Desk, first: int) -> tuple[np.ndarray, np.ndarray]:
    steps = desk.steps_since(first).delta[:, :3] / 1000.0
    return np.cumsum(steps, axis=0), np.hypot.reduce(steps, axis=1) / 0.002 * 60.0


# P8848 to P8850, P8857: formulas of the manual, worked out by hand


@shows("bwo900-8.5-10", "bwo900-8.5-11")
@pytest.mark.parametrize(
    ("g", "turn", "radius", "factor"),
    [
        ("G41", "G3", 10.0, 1.0 - 0.5 * (20.0 - 10.0) / (20.0 - 2.0)),  # inside: concave, P8849
        ("G41", "G2", 10.0, 1.0 + 0.3 * (20.0 - 10.0) / (20.0 - 2.0)),  # outside: convex, P8848
        ("G42", "G2", 10.0, 1.0 - 0.5 * (20.0 - 10.0) / (20.0 - 2.0)),
        ("G42", "G3", 10.0, 1.0 + 0.3 * (20.0 - 10.0) / (20.0 - 2.0)),
        ("G41", "G3", 25.0, 1.0),  # R above P8850
        ("G40", "G3", 10.0, 1.0),  # no contour
    ],
)
def test_feed_dynamics(g: str, turn: str, radius: float, factor: float) -> None:
    """F (1 + p / 100 (P8850 - R) / (P8850 - WR)), P8850 = 20 mm, WR = 2 mm."""
    side = 1.0 if turn == "G3" else -1.0
    way, end = f"X{10 + radius} Y{70 + side * radius} I10 J{70 + side * radius}", 70 + side * 60
    text = f"P1|N5 G0 Y70|N10 F1200 tr:2|N20 {g} G1 X10|N30 {turn} {way}|N40 G1 Y{end}|N50 M30"
    places, speeds = feeds(fresh(text, p8848=30, p8849=-50, p8850=20))
    on = (places[:, 0] > 12.5) & (places[:, 0] < 10 + radius - 2.5)
    assert np.median(speeds[on]) == pytest.approx(1200.0 * factor, rel=0.01)


@shows("bwo900-8.5-12")
@pytest.mark.parametrize(("turn", "centre"), [("G3", 8.0), ("G2", 12.0)])
def test_the_feed_of_the_point_of_contact(turn: str, centre: float) -> None:
    """P8850 = 1: the contour's radius 10 mm is passed with F, the tool's centre with F r / 10."""
    side = 1.0 if turn == "G3" else -1.0
    way, end = f"X20 Y{70 + side * 10} I10 J{70 + side * 10}", 70 + side * 60
    text = f"P1|N5 G0 Y70|N10 F1200 tr:2|N20 G41 G1 X10|N30 {turn} {way}|N40 G1 Y{end}|N50 M30"
    places, speeds = feeds(fresh(text, p8850=1))
    on = (places[:, 0] > 12.5) & (places[:, 0] < 17.0)
    assert np.median(speeds[on]) == pytest.approx(1200.0 * centre / 10.0, rel=0.01)


@pytest.mark.parametrize(
    "values",
    [
        {"p8850": 2, "p8849": -50},  # the tool is as large as the reference
        {"p8850": -5, "p8849": -50},
        {"p8850": 0.5, "p8849": -50},
        {"p8850": 20, "p8849": 1e30, "p8848": 1e30},
        {"p8850": 1e30, "p8849": -1e30, "p8848": -1e30},
    ],
)
def test_feed_dynamics_that_make_no_sense(values: dict[str, float]) -> None:
    """It is off, or at the ends of -100 to 100 %, and the program comes to its end (bwo900/67)."""
    text = "P1|N10 F6000 tr:2|N20 G41 G1 X10|N30 G3 X20 Y10 I10 J10|N35 G2 X30 Y20 I30 J10|N40 G1 X40|N50 M30"
    desk = fresh(text, **values)
    start(desk)
    desk.finish(300.0)
    assert (said(desk), mm(desk)[:2]) == ([], (40.0, 22.0))


@shows("bwo900-8.5-14")
def test_contour_dynamics() -> None:
    """Points on a circle of 20 mm, 5 degrees apart: v = KV sqrt(2 R d), 16 / s, d 0.05 mm; arcs alike; not rapid."""
    most = 16.0 * math.sqrt(2 * 20 * 0.05) * 60.0
    points = [(20 * math.sin(math.radians(a)), 20 - 20 * math.cos(math.radians(a))) for a in range(5, 91, 5)]
    lines = "|".join(f"N{20 + n} X{x:.6f} Y{y:.6f}" for n, (x, y) in enumerate(points))
    places, speeds = feeds(fresh(f"P1|N10 G1 F3000|{lines}|N90 M30", p8857=0.05))
    on = (places[:, 1] > 1.0) & (places[:, 1] < 18.0)
    assert np.median(speeds[on]) == pytest.approx(most, rel=0.01)
    assert speeds[on].max() <= most * 1.1  # rounding of both axes to 1 um in 2 ms
    places, speeds = feeds(fresh("P1|N10 G3 F3000 X20 Y20 I0 J20|N90 M30", p8857=0.05))
    assert np.median(speeds) == pytest.approx(most, rel=0.01)
    _, speeds = feeds(fresh("P1|N10 G1 F3000 X40|N20 X80|N90 M30", p8857=0.05))
    assert speeds.max() == pytest.approx(3000.0, rel=0.02)  # straight on
    _, speeds = feeds(fresh(f"P1|N10 G0|{lines}|N90 M30", p8857=0.05, p8858=2))
    assert speeds.max() > 1.5 * most


def test_the_circle_through_three_points() -> None:
    assert circumradius((0.0, 0.0), (3.0, 0.0), (3.0, 4.0)) == pytest.approx(2.5)
    assert circumradius((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 0.0, 4.0)) == pytest.approx(2.5)
    assert circumradius((0.0, 0.0), (3.0, 0.0), (5.0, 0.0)) == math.inf
    assert circumradius((0.0, 0.0), (3.0, 0.0), (0.0, 0.0)) == math.inf
    assert circumradius((0.0, 0.0), (0.0, 0.0), (5.0, 0.0)) == math.inf


# P11310 on: overrides


def speed_of(percent_cells: dict[str, float]) -> float:
    """Speed of a line of 1000 mm/min, as a share."""
    _, speeds = feeds(fresh("P1|N10 G1 F1000 X20|N30 M30", **percent_cells))
    return float(speeds.max()) / 1000.0


@shows("bwo900-8.6-4")
@pytest.mark.parametrize(("raw", "share"), [(255, 1.2), (127.5, 0.6), (51, 0.24)])
def test_the_potentiometer_acts_continuously_without_a_table(raw: float, share: float) -> None:
    assert speed_of({"p11311": raw}) == pytest.approx(share, abs=0.031)  # one increment in 2 ms: 0.03


@shows("bwo900-8.6-5", "bwo900-8.6-6")
@pytest.mark.parametrize(
    ("raw", "percent"), [(0, 0), (9, 0), (10, 1), (19, 2), (29, 5), (38, 10), (208, 95), (218, 100), (255, 120)]
)
def test_the_potentiometer_and_its_table(raw: float, percent: float) -> None:
    """P11314 = q1370: 256 values for 27 entries, 0, 1, 2, 5, 10 and on in fives to 120."""
    desk = fresh(referenced=False, p11314=1370)
    desk.send(parameters(p11311=raw))
    assert value(desk, 11310) == percent


@shows("bwo900-8.6-6")
def test_the_table_as_delivered() -> None:
    desk = fresh(referenced=False)
    content = [value(desk, 11370 + n) for n in (0, 1, 2, 3, 4, 5, 6, 7, 27)]
    assert content == [27, 0, 1, 2, 5, 10, 15, 20, 120]
    assert [value(desk, 11330 + 5 * n) for n in range(4)] == [0, 10, 50, 100]


@shows("bwo900-8.6-7")
@pytest.mark.parametrize(
    ("values", "percent"),
    [
        ({"p11312": 40, "p11310": 10}, 40),
        ({"p11313": 80, "p11310": 110}, 80),
        ({"p11313": 80, "p11311": 255}, 80),
        ({"p11312": 90, "p11313": 80, "p11310": 85}, 80),
        ({"p11312": -7, "p11310": -3}, 0),
        ({"p11313": 1e9, "p11310": 1e9}, 120),
        ({"p11314": 1e9, "p11311": 255}, 120),
        ({"p11314": -4, "p11311": 1e9}, 120),
        ({"p11314": 1370, "p11370": 0, "p11311": 255}, 120),
        ({"p11314": 1370, "p11370": 1e9, "p11311": 128}, 120),
    ],
)
def test_limits_of_the_override(values: dict[str, float], percent: float) -> None:
    """P11312, P11313; what makes no sense is 0, 120 %, or no table (bwo900/69)."""
    assert value(fresh(referenced=False, **values), 11310) == percent


@shows("bwo900-8.6-8")
def test_which_override_an_axis_follows() -> None:
    """P12125 (bwo900/69): 7 is the fixed one of 50 %; the lowest of several axes counts; others are the first."""
    assert speed_of({"p12125": 7}) == pytest.approx(0.5, abs=0.03)
    assert speed_of({"p12125": 7, "p12325": 6, "p11310": 80}) == pytest.approx(0.1, abs=0.03)
    assert speed_of({"p12125": 9, "p11310": 80}) == pytest.approx(0.8, abs=0.03)


@shows("bwo900-8.6-9")
@pytest.mark.parametrize("status", ["00000000", "00000004"])
def test_a_program_sets_the_override(status: str) -> None:
    """Analysed, it counts at once; as a parameter of real time with its block (N20 on, halfway)."""
    desk = fresh("P1|N10 G1 F1000 X10|N20 P11310:50 X20|N30 M30", referenced=True)
    desk.send(file("D+", f"K1:P 11310: 100 S:${status}"))
    places, speeds = feeds(desk)
    first, second = speeds[(places[:, 0] > 2) & (places[:, 0] < 8)], speeds[(places[:, 0] > 12) & (places[:, 0] < 18)]
    assert np.median(second) == pytest.approx(500.0, abs=31.0)
    assert np.median(first) == pytest.approx(1000.0 if status[-1] == "4" else 500.0, abs=31.0)


def test_the_override_outlives_the_mains() -> None:
    desk = fresh("P1|N10 G1 F1000 X20|N30 M30", p11310=50)
    desk.power_cycle()
    assert desk.controller.key_values["override"] == 50.0


# P8817


@shows("bwo900-8.5-2")
def test_asynchronous_feed() -> None:
    """The block under way goes on at 2400 mm/min to its end, the next one at its own; the value alone does nothing."""
    desk = fresh("P1|N10 G1 F1200 X40|N20 X60|N30 M30", p8817=300)
    first = desk.ticks
    start(desk)
    desk.run(0.8)
    desk.send(parameters(p8817=2400))
    desk.finish()
    places, speeds = moved(desk, first)
    assert speeds[(places[:, 0] > 2) & (places[:, 0] < 12)].max() == pytest.approx(1200.0, abs=31.0)
    assert np.median(speeds[(places[:, 0] > 25) & (places[:, 0] < 37)]) == pytest.approx(2400.0, rel=0.01)
    assert np.median(speeds[(places[:, 0] > 45) & (places[:, 0] < 57)]) == pytest.approx(1200.0, rel=0.03)


@shows("bwo900-8.5-2")
def test_asynchronous_feed_of_a_program_and_while_it_is_held() -> None:
    desk = fresh("P1|N10 G1 F1200 X40|N20 P8817:600 X60|N30 G0 X80|N40 M30")
    desk.send(file("D+", "K1:P 8817: 1 S:$00000005"))
    first = desk.ticks
    start(desk)
    desk.run(0.8)
    desk.send(parameters(p8684=0))
    desk.run(1.0)
    desk.send(parameters(p8817=900))
    desk.send(parameters(p8684=1))
    desk.finish()
    places, speeds = moved(desk, first)
    assert np.median(speeds[(places[:, 0] > 25) & (places[:, 0] < 37)]) == pytest.approx(900.0, rel=0.05)
    assert np.median(speeds[(places[:, 0] > 42) & (places[:, 0] < 57)]) == pytest.approx(600.0, rel=0.05)


@pytest.mark.parametrize("wrong", [0, -5, 1e30])
def test_an_asynchronous_feed_that_makes_no_sense(wrong: float) -> None:
    """0 and less change nothing; too much is what the axis can."""
    desk = fresh("P1|N10 G1 F1200 X40|N30 G0 X50|N40 M30", p12004=3000)
    first = desk.ticks
    start(desk)
    desk.run(0.8)
    desk.send(parameters(p8817=wrong))
    desk.run(0.5)
    fastest = moved(desk, first)[1].max()
    assert fastest == pytest.approx(3000.0 if wrong > 0 else 1200.0, abs=31.0)
    desk.finish()
    desk.send(parameters(p8817=wrong))
    assert (mm(desk)[0], said(desk)) == (50.0, [])


# Exact stops and the following error


@shows("bwo900-8.7-9", "bwo900-8.7-10")
@pytest.mark.parametrize(
    ("values", "lag", "waits"),
    [
        ({}, 31.0, False),  # sqrt(1 / 1000) mm
        ({}, 32.0, True),
        ({"p12216": 0.1}, 99.0, False),
        ({"p12216": 0.1}, -101.0, True),
        ({"p12216": -1}, 32.0, True),
        ({"p12212": 4000}, 63.0, False),  # sqrt(1 / 4000) mm
        ({"p12212": 4000}, 64.0, True),
        ({"p12217": 5}, 32.0, True),  # the coarse window is another one
    ],
)
def test_the_exact_stop_waits_for_every_axis(values: dict[str, float], lag: float, waits: bool) -> None:
    desk = fresh("P1|N10 G0 X5|N20 G1 F600 X8|N30 M30", **values)
    Lagging(desk).lag = (0.0, lag, 0.0)
    start(desk)
    desk.run(2.0)
    assert (mm(desk)[0] == 5.0) is waits
    desk.finish()
    assert said(desk) == ([2022, 2022] if waits else [])  # of N10 and of M30


@shows("bwo900-8.7-11", "bwo900-9.7-3")
@pytest.mark.parametrize(
    ("values", "seconds"),
    [({}, 3.0), ({"p12218": 500}, 0.5), ({"p12018": 500}, 3.0), ({"p12218": -5}, 3.0), ({"p12218": 0.5}, 0.002)],
)
def test_an_axis_that_does_not_get_into_position(values: dict[str, float], seconds: float) -> None:
    """P12018 of that axis: M2022 with its name, and the program goes on."""
    desk = fresh("P1|N10 G0 X5|N20 G1 F600 X8|N30 M30", **values)
    Lagging(desk).lag = (0.0, 200.0, 0.0)
    start(desk)
    for _ in range(1000):
        desk.run(0.002)
        if mm(desk)[0] == 5.0:
            break
    stands_ns = desk.time_ns
    desk.finish()
    when_ns, text = next((t, text) for t, text in desk.remarks if "M2022" in text)
    assert (when_ns - stands_ns) / 1e9 == pytest.approx(seconds, abs=0.003)
    assert text.endswith("(Y)")
    assert (mm(desk)[0], value(desk, 8503), value(desk, 8504), value(desk, 12397)) == (8.0, 2022, 2, 2022)


def lagging(desk: Desk, gain: float, seconds: float) -> None:
    """Let time pass with an X axis that follows by its gain: dy/dt = gain (x - y)."""
    drives = Lagging(desk)
    y = float(desk.counts[0])
    for _ in range(round(seconds / 0.01)):
        desk.run(0.01)
        y += (desk.counts[0] - y) * (1.0 - math.exp(-gain * 0.01))
        drives.lag = (desk.counts[0] - y, 0.0, 0.0)
        if desk.controller.idle:
            return


@shows("bwo900-8.7-8", "bwo900-8.7-12", "bwo900-9.7-4")
@pytest.mark.parametrize(
    ("values", "gain", "lost"),
    [
        ({}, 16.0, False),  # as it ought to be
        ({}, 14.0, False),  # 14 % more
        ({}, 8.0, True),  # 100 % more
        ({"p12024": 150}, 8.0, False),
        ({"p12024": 10}, 12.0, True),  # 33 % more
        ({"p12020": 8}, 8.0, False),
        ({"p12025": -1}, 2.0, False),
        ({"p12025": 900}, 8.0, True),
        ({"p12025": 5000}, 8.0, False),
        ({"p12024": -20, "p12025": -20}, 8.0, True),  # defaults
        ({"p12224": 500}, 8.0, True),  # of another axis
    ],
)
def test_the_following_error_is_watched(values: dict[str, float], gain: float, lost: bool) -> None:
    """v / KV at 3000 mm/min and 16 / s is 3.1 mm; 50 % more for 50 ms are allowed: M2001, drives off."""
    desk = fresh("P1|N10 G1 F3000 X100 G8|N20 M30", **values)
    start(desk)
    lagging(desk, gain, 3.0)
    assert said(desk) == ([2001] if lost else [])
    assert (desk.outputs["stages"], mm(desk)[0] == 100.0) == (0 if lost else 1, not lost)
    assert value(desk, 8500) == (2001 if lost else 0)
    if lost:
        assert (value(desk, 8504), value(desk, 12197)) == (1, 2001)


@shows("bwo900-8.7-12")
def test_a_short_lag_is_forgiven() -> None:
    """40 ms beyond the limit are less than P12025."""
    desk = fresh("P1|N10 G1 F3000 X100|N20 M30")
    drives = Lagging(desk)
    start(desk)
    desk.run(1.0)
    for _ in range(3):
        drives.lag = (9000.0, 0.0, 0.0)
        desk.run(0.04)
        drives.lag = (3000.0, 0.0, 0.0)
        desk.run(0.04)
    assert said(desk) == []
    drives.lag = (-9000.0, 0.0, 0.0)
    desk.run(0.08)
    assert said(desk) == [2001]


def test_the_watch_does_not_depend_on_how_time_is_cut() -> None:
    ends = []
    for cut in (0.0007, 0.013, 1.5):
        desk = fresh("P1|N10 G1 F3000 X100|N20 M30")
        drives = Lagging(desk)
        start(desk)
        desk.run(0.5)
        drives.lag = (9000.0, 0.0, 0.0)
        for _ in range(round(1.5 / cut)):
            desk.run(cut)
        ends.append([(t, text) for t, text in desk.remarks] + [desk.counts])
    assert ends[0] == ends[1] == ends[2]


# Status cells: in motion, at rest, held, after abort, after reset


def cells(desk: Desk, *numbers: int) -> list[float | None]:
    """Parameters as they are put out, all of one moment; None: deleted."""
    content = put_out(desk)
    return [content.get(q_of(number)) for number in numbers]


def q_of(number: int) -> int:
    bases = ((0, 5_000, 10_000), (7_000, 10_000, 15_000), (11_000, 12_000, 1_000), (12_000, 18_400, 2_000))
    return next(base + number - first for first, end, base in bases if first <= number < end)


PLACE = (8_685, 8_687, 8_900, 8_901, 8_906, 8_907, 8_802, 8_803)


@shows("bwo900-8.5-50", "bwo900-8.5-51", "bwo900-8.5-52")
def test_what_the_program_is_at() -> None:
    desk = fresh("P7|N10 G1 F1200 X20|N20 X40|N30 M30")
    assert cells(desk, *PLACE[:4]) == [0, 0, 0, 0]
    start(desk, 7)
    desk.run(0.5)
    assert cells(desk, *PLACE[:4]) == [2, 1, 7, 10]
    desk.finish()
    start(desk, 7)
    desk.run(0.5)
    assert cells(desk, *PLACE) == [2, 1, 7, 10, 0, 0, 0, 0]
    desk.run(1.0)
    desk.send(parameters(p8684=0))
    desk.run(1.0)
    assert cells(desk, *PLACE) == [1, 1, 7, 20, 0, 0, 0, 0]
    desk.send(parameters(p8705=1))
    desk.run(1.0)
    assert cells(desk, *PLACE) == [0, 0, 0, 0, 7, 20, 7, 20]
    start(desk, 7)
    desk.finish()
    assert cells(desk, *PLACE) == [0, 0, 0, 0, 0, 0, 0, 0]
    start(desk, 7)
    desk.run(0.5)
    desk.set("estop", "pressed")
    assert cells(desk, *PLACE) == [0, 0, 0, 0, 7, 10, 7, 10]
    desk.power_cycle()
    assert cells(desk, *PLACE) == [0, 0, 0, 0, 7, 10, 7, 10]


@shows("bwo900-8.5-53", "bwo900-8.5-54", "bwo900-8.5-55")
def test_feed_motion_and_dwell() -> None:
    """P8936 programmed, P8937 at the end, P8938 now, P8940 motion, P8941 and P8942 dwell."""
    numbers = (8_936, 8_937, 8_938, 8_940, 8_941, 8_942)
    desk = fresh("P1|N10 G1 F1200 f600 X20|N20 G0 X30|N30 G3 X40 Y10 R10|N40 G1 X45 G4.2.5|N50 M30")
    assert cells(desk, *numbers) == [0, 0, 0, 1, 0, 0]
    start(desk)
    desk.run(0.5)
    assert cells(desk, *numbers) == [1200, 600, pytest.approx(1200, rel=1e-3), 1, 0, 0]
    desk.send(parameters(p8684=0))
    desk.run(1.0)
    assert cells(desk, *numbers) == [1200, 600, 0, 1, 0, 0]
    desk.send(parameters(p8684=1))
    seen = []
    for _ in range(1000):
        desk.run(0.05)
        now = cells(desk, 8_901, *numbers)
        seen += [now] if not seen or now[0] != seen[-1][0] else []
        if now[5]:
            break
    assert [now[4] for now in seen if now[0] in (20, 30, 40)] == [0, 3, 1]
    assert next(now[1] for now in seen if now[0] == 20) == 1200  # F outlives rapid
    desk.run(1.0)
    first, (programmed, rest) = now[6], cells(desk, 8_941, 8_942)
    desk.run(0.5)
    while cells(desk, 8_942)[0] == 0:  # the way to N40's end
        desk.run(0.05)
    programmed, rest = cells(desk, 8_941, 8_942)
    desk.run(0.5)
    assert programmed == 2.5
    assert rest is not None
    assert cells(desk, 8_942)[0] == pytest.approx(rest - 0.5, abs=0.01)
    desk.finish()
    assert (cells(desk, *numbers), first) == ([0, 0, 0, 1, 0, 0], first)


@shows("bwo900-8.5-56", "bwo900-8.5-57")
def test_g_functions_of_the_block_that_is_carried_out() -> None:
    """Analysis is in N40 already: P9364 and so on are its, P8964 and so on those of N10, then of N20 and N30."""
    real = (8_950, 8_951, 8_952, 8_953, 8_958, 8_964, 8_969, 8_978, 8_979, 8_972, 8_970)
    first = "N10 G1 F1200 X20|N20 G55 G92 X-20|N30 G91 G42 G63 tr:1 X20"
    desk = fresh(f"P1|{first}|N40 G18 G90 G40 G28 X60 G61|N50 M01|N60 M30")
    rest = [17, 1, 2, 3, 29, 40, 53, 90, 0, 64, 60]
    assert cells(desk, *real) == rest
    start(desk)
    desk.run(0.5)
    assert cells(desk, *real) == rest
    ahead = [number + 400 for number in real]
    assert cells(desk, *ahead) == [18, 3, 1, 2, 28, 40, 55, 90, 92, 63, 61]
    assert cells(desk, 9_301)[0] >= 40
    desk.run(1.0)
    assert cells(desk, 8_901, *real) == [30, 17, 1, 2, 3, 29, 42, 55, 91, 92, 63, 60]
    assert cells(desk, 9_100, 9_101) == [-20, 0]
    desk.send(parameters(p8705=1))
    desk.finish()
    assert cells(desk, *real) == rest
    assert cells(desk, *ahead) == rest
    assert cells(desk, 9_100, 9_500) == [0, 0]


@shows("bwo900-8.5-58", "bwo900-8.5-59")
def test_subprograms_and_cycles() -> None:
    """P8912 to P8914: level and place of the call; P8904, P8905: cycle and its block, deleted without one."""
    numbers = (8_900, 8_901, 8_904, 8_905, 8_912, 8_913, 8_914)
    desk = fresh(
        "P1|N10 M28.5|N20 G1001|N30 M3 S500 G81 Z5 P32:300 P33:0 P34:2|N40 M30",
        "P5|N10 G1 F600 X5|N20 M02",
        "Z1001|N70 G1 F600 X10|N80 M02",
    )
    none = [0, 0, None, None, 0, 0, 0]
    assert cells(desk, *numbers) == none
    start(desk)
    seen = []
    for _ in range(200):
        desk.run(0.05)
        now = cells(desk, *numbers)
        seen += [now] if now not in seen else []
        if desk.controller.idle:
            break
    assert [5, 10, None, None, 1, 1, 10] in seen
    assert [1, 20, 1001, 70, 1, 1, 20] in seen
    assert [1, 30, 81, 0, 0, 0, 0] in seen
    assert seen[-1] == none


@shows("bwo900-8.5-60")
def test_an_m_function_that_is_waited_for() -> None:
    """P8559: M06 takes the PLC two seconds."""
    desk = fresh("P1|N10 G0 X5|N20 M6|N30 M30")
    start(desk)
    desk.run(2.0)
    assert cells(desk, 8_559) == [1]
    desk.finish()
    assert cells(desk, 8_559) == [0]


@shows("bwo900-8.7-13", "bwo900-8.7-14", "bwo900-8.7-15")
def test_axes_in_motion_held_and_at_rest() -> None:
    """P12150 to P12160, P12168, P12170, P12188; the lag is 1.5 mm behind a line at 1200 mm/min."""
    numbers = (12_151, 12_152, 12_160, 12_168, 12_170, 12_188)
    desk = fresh("P1|N10 G54 G1 F1200 X40|N30 M30", p20003=2)
    drives = Lagging(desk)
    assert cells(desk, *numbers) == [0, 0, 0, 0, 0, 0]
    start(desk)
    desk.run(1.0)
    drives.lag, drives.speed = (1500.0, 0.0, 0.0), (20_000.0, 0.0, 0.0)
    place = desk.counts[0] / 1000.0
    now = cells(desk, *numbers)
    assert now == [place, pytest.approx(place - 1.5), pytest.approx(1.5), 1200, pytest.approx(1200, rel=0.03), 1]
    assert cells(desk, 12_154, 12_155, 12_156, 12_157) == [
        pytest.approx(place - 2),
        40,
        pytest.approx(40 - place + 2),
        2,
    ]
    assert cells(desk, 12_370, 12_388) == [0, 0]  # Y stands
    desk.send(parameters(p8684=0))
    drives.lag, drives.speed = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    desk.run(1.0)
    place = desk.counts[0] / 1000.0
    assert cells(desk, *numbers) == [place, place, 0, 0, 0, 0]
    drives.lag = (100.0, 0.0, 0.0)
    assert cells(desk, 12_188) == [1]  # not within its window
    drives.lag = (0.0, 0.0, 0.0)
    desk.send(parameters(p8684=1))
    desk.finish()
    assert cells(desk, *numbers, 12_156) == [42, 42, 0, 0, 0, 0, 0]


@shows("bwo900-8.7-16", "bwo900-8.7-17")
def test_references_limits_and_switches() -> None:
    """P12180: byte 1 referenced, byte 2 switch; P12135: byte 1 limit +, byte 2 -; P12185: the same of software."""
    desk = fresh("P1|N10 G0 X30|N20 M30", referenced=False, p12030=30, p12031=0)
    assert cells(desk, 12_180, 12_135, 8_579, 8_709) == [0, 0, 0, 0]
    desk.send(parameters(p8683=1, p12130=1))
    desk.finish()
    assert cells(desk, 12_180, 12_380, 8_579, 8_709) == [1, 0, 0, 0]
    assert cells(desk, 12_185, 12_385) == [256, 0]
    desk.send(parameters(p12330=1, p12530=1))
    desk.finish()
    assert cells(desk, 12_380, 12_580, 8_579, 8_709) == [1, 1, 1, 1]
    start(desk)
    desk.finish()
    assert cells(desk, 12_185) == [1]
    desk.set("limit_y1", False)
    desk.run(0.01)
    assert cells(desk, 12_335, 12_380) == [256, 257]
    desk.set("limit_y1", "free")
    desk.set("limit_x2", False)
    desk.run(0.01)
    assert cells(desk, 12_135, 12_180) == [1, 1]
    desk.power_cycle()
    assert cells(desk, 12_180, 8_579, 8_709) == [0, 0, 0]


@shows("bwo900-8.5-61", "bwo900-8.5-62")
@pytest.mark.parametrize(
    ("text", "cell", "number"),
    [
        ("N10 Q5|N20 M30", 8_501, 1216),
        ("N10 F600 G2 X10 Y0 R2|N20 M30", 8_502, 1234),
        ("N10 G0 X5|N20 M30", 8_503, 2022),
    ],
)
def test_messages_by_their_effect(text: str, cell: int, number: int) -> None:
    desk = fresh(f"P1|{text}")
    Lagging(desk).lag = (100.0, 0.0, 0.0) if number == 2022 else (0.0, 0.0, 0.0)
    start(desk)
    desk.run(5.0)
    wanted = [number if c == cell else 0 for c in range(8_500, 8_504)]
    assert cells(desk, *range(8_500, 8_504)) == wanted
    desk.send(parameters(p8508=1))
    assert cells(desk, *range(8_500, 8_505), 12_197, 8_508) == [0] * 7
    desk.power_cycle()
    assert cells(desk, *range(8_500, 8_505)) == [0] * 5


@shows("bwo900-8.5-61")
def test_emergency_stop_breaks_the_system_off() -> None:
    desk = fresh("P1|N10 G1 F600 X50|N20 M30")
    start(desk)
    desk.run(0.5)
    desk.set("estop", "pressed")
    assert cells(desk, 8_500, 8_501) == [3001, 0]
    desk.set("estop", "released")
    desk.send(parameters(p8683=1))
    assert cells(desk, 8_500) == [0]


@shows("bwo900-8.5-63")
def test_what_the_channel_is_made_of() -> None:
    desk = fresh(referenced=False)
    assert cells(desk, 8_550, 8_551, 8_552, 12_198, 12_199, 12_398, 12_399) == [1, 3, 3, 1, 1, 1, 2]
    for number, q in ((500, 10_500), (8_800, 15_000 + 1_800), (11_310, 1_310), (12_204, 2_204)):
        desk.send(parameters(p8553=number))
        assert cells(desk, 8_554) == [q]
    desk.send(parameters(p8553=10_500))
    assert cells(desk, 8_554) == [None]


# What the PLC may ask of the channel and of axes


@shows("bwo900-8.5-70", "bwo900-8.5-71")
@pytest.mark.parametrize(("stop", "free"), [({"p8702": 1}, {"p8702": 0}), ({"p8701": 0}, {"p8701": 1})])
def test_safety_stop_and_release_of_the_channel(stop: dict[str, float], free: dict[str, float]) -> None:
    """The axes stop on the path and go on by themselves; Start is no help; in HAND nothing begins (bwo900/71)."""
    desk = fresh("P1|N10 G63 G1 F1200 X20|N20 Y20|N30 M30")
    start(desk)
    desk.run(0.5)
    before = mm(desk)[0]
    desk.send(parameters(**stop))
    desk.run(1.0)
    place = mm(desk)[0]
    assert before <= place < before + 1.0
    assert value(desk, 8685) == 1
    desk.send(parameters(p8684=1))
    desk.run(1.0)
    assert mm(desk)[0] == place
    desk.send(parameters(**free))
    desk.finish()
    assert mm(desk)[:2] == (20.0, 20.0)
    desk.send(parameters(p8683=1, **stop))
    desk.send(parameters(p8750=2, p8751=1, p8760=1, p8752=1))
    desk.run(1.0)
    assert (mm(desk)[0], said(desk)) == (20.0, [1321])


def on_its_way(**options: object) -> Desk:
    """X at 100 mm/s, with a ramp of 100 / 2 / 400 s: 12.5 mm."""
    desk = fresh("P1|N10 G1 F6000 X100|N20 Y10|N30 M30", p12004=6000, p12008=250, **options)  # type: ignore[arg-type]
    start(desk)
    desk.run(0.6)
    return desk


@shows("bwo900-8.5-70", "bwo900-8.7-23")
@pytest.mark.parametrize(("stop", "free"), [
    ({"p8701": 0}, {"p8701": 1}), ({"p12137": 0x010001}, {"p12137": 0}), ({"p12137": 0x010101}, {"p12137": 0}),
])  # fmt: skip
@pytest.mark.parametrize("before", [{}, {"p8702": 1}, {"p8704": 0}, {"p11313": 0, "p11310": 0}])
def test_a_halt_without_ramps_ends_at_the_next_set_point(
    before: dict[str, float], stop: dict[str, float], free: dict[str, float]
) -> None:
    """At full speed, and while the axes brake already for a safety stop, a Stop or an override of 0."""
    desk = on_its_way()
    if before:
        desk.send(parameters(**before))
        desk.run(0.05)
    at = mm(desk)[0]
    desk.send(parameters(**stop))
    desk.run(0.5)
    assert mm(desk)[0] == pytest.approx(at, abs=0.2)  # one set point, 2 ms, at 100 mm/s
    desk.send(parameters(**free))
    desk.send(parameters(p8702=0, p11313=100, p11310=100))
    desk.send(parameters(p8684=1))
    desk.finish()
    assert (mm(desk), said(desk)) == ((100.0, 10.0, 0.0), [])


@shows("bwo900-8.5-70", "bwo900-8.7-23")
@pytest.mark.parametrize("stop", [{"p8701": 0}, {"p12137": 0x010001}])
def test_a_halt_with_ramps_is_a_setting_and_says_so(stop: dict[str, float]) -> None:
    desk = on_its_way(settings={"ramped_halts": True})
    at = mm(desk)[0]
    desk.send(parameters(**stop))
    desk.run(0.5)
    assert mm(desk)[0] - at == pytest.approx(12.5, abs=0.25)
    assert any("ramped_halts" in text for _, text in desk.remarks)


@shows("bwo900-8.7-23")
@pytest.mark.parametrize("stop", [{"p12137": 1}, {"p12137": 0x010100}, {"p8702": 1}])
def test_other_locks_brake_with_ramps_or_not_at_all(stop: dict[str, float]) -> None:
    """Without byte 3, or with byte 3 for the other direction; a safety stop has ramps by its text."""
    desk = on_its_way()
    at = mm(desk)[0]
    desk.send(parameters(**stop))
    desk.run(0.15)
    assert mm(desk)[0] - at > 9.0


@shows("bwo900-8.5-70", "bwo900-8.7-23")
@pytest.mark.parametrize("stop", [{"p8701": 0}, {"p12137": 0x010001}])
@pytest.mark.parametrize("move", [{"p8750": 1, "p8751": 1, "p8755": 6000, "p8754": 6000}, {"p12121": 6000}])
def test_moves_without_a_program_halt_so_too(move: dict[str, float], stop: dict[str, float]) -> None:
    desk = fresh(p12004=6000, p12008=250)
    desk.send(parameters(p8683=1, **move))
    desk.send(parameters(p8752=1) if "p8750" in move else parameters(p12111=80))
    desk.run(0.6)
    at = mm(desk)[0]
    assert at > 20.0
    desk.send(parameters(**stop))
    desk.run(0.5)
    assert mm(desk)[0] == pytest.approx(at, abs=0.2)


@shows("bwo900-8.5-70")
@pytest.mark.parametrize(("stop", "least_mm"), [({"p8701": 0}, 0.0), ({"p8702": 1}, 0.1)])
def test_a_reference_run_ends_with_the_release_of_the_channel(stop: dict[str, float], least_mm: float) -> None:
    """It has no reference point then; the next one finds it."""
    desk = fresh(referenced=False)
    desk.send(parameters(p8683=1, p12130=1))
    desk.run(0.6)
    at = desk.carriage[0]
    assert 0 < at < 20_000
    desk.send(parameters(**stop))
    desk.run(1.0)
    place = desk.carriage[0]
    assert 1000.0 * least_mm <= at - place <= 1000.0
    desk.run(1.0)
    assert (desk.carriage[0], value(desk, 8709)) == (place, 0.0)


@shows("bwo900-8.5-71")
def test_a_safety_stop_brakes_all_axes_along_the_path() -> None:
    """v^2 / 2 a = 2.5 mm at 50 mm/s: X, with 4/5 of a, can do P12004 / P12008, so a = 5/4 of 100 mm/s in 250 ms."""
    desk = fresh("P1|N10 G1 F3000 X40 Y30|N30 M30", p12004=6000, p12008=250, p12204=6000, p12208=250)
    start(desk)
    desk.run(0.5)
    before = np.array(mm(desk))
    desk.send(parameters(p8702=1))
    desk.run(1.0)
    place = np.array(mm(desk))
    assert place[0] / 4 == pytest.approx(place[1] / 3, abs=0.002)
    assert np.hypot(*(place - before)[:2]) == pytest.approx(2.5, abs=0.15)
    desk.run(1.0)
    assert mm(desk) == tuple(place)
    desk.send(parameters(p8702=0))
    desk.finish()
    assert mm(desk)[:2] == (40.0, 30.0)


@shows("bwo900-8.5-71")
def test_a_stop_beside_a_safety_stop_waits_for_start() -> None:
    desk = fresh("P1|N10 G1 F1200 X20|N30 M30")
    desk.send(parameters(p8702=1))
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p8684=0))
    desk.send(parameters(p8702=0))
    desk.run(1.0)
    assert mm(desk)[0] == 0.0
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk)[0] == 20.0


@shows("bwo900-8.7-18", "bwo900-8.7-19", "bwo900-8.7-20")
@pytest.mark.parametrize(
    ("values", "speed"),
    [
        ({"p12136": 1}, 600),  # 10 % of P12004
        ({"p12136": 256}, 1200),  # 20 %
        ({"p12136": 257}, 600),
        ({"p12136": 1, "p12005": 450}, 450),
        ({"p12136": 256, "p12006": 900}, 900),
        ({"p12136": 0, "p12005": 450}, 3000),
        ({"p12136": 1, "p12005": -4}, 600),
        ({"p12336": 1}, 3000),
        ({"p12120": 1500}, 1500),
        ({"p12120": 0}, 3000),
        ({"p12120": -5}, 3000),
    ],
)
@pytest.mark.parametrize("g", ["G1", "G0"])
def test_slope_and_interpolation_speed(values: dict[str, float], speed: float, g: str) -> None:
    """P12004 is 6000; F3000, and P8816 is 3000: nothing but the speed is another one."""
    _, speeds = feeds(fresh(f"P1|N10 {g} F3000 X30|N30 M30", p8816=3000, **values))
    assert speeds.max() == pytest.approx(speed, abs=31.0)


@shows("bwo900-8.7-18")
def test_slope_in_hand() -> None:
    desk = fresh(p8750=1, p8751=1, p8755=3000, p12136=1, p12120=100)
    desk.send(parameters(p8752=1))
    desk.run(1.0)
    assert value(desk, 8756) == 600.0


# Parameters in the middle of a motion, over a power cut, and without sense

LINES = "P1|N10 G1 F3000 X40|N20 G8 X60|N30 X100|N40 M30"


@pytest.mark.parametrize(
    ("values", "later"),
    [
        ({"p12004": 600}, 600),
        ({"p12136": 1}, 600),
        ({"p12120": 900}, 900),
        ({"p8815": 1500}, 1500),
        ({"p8818": 50}, 1500),
        ({"p12008": 1000, "p12009": 0}, 3000),
        ({"p12013": 1}, 3000),
    ],
)
def test_limits_count_from_the_next_standstill_on(values: dict[str, float], later: float) -> None:
    """bwo900/72: N20 joins N10 and ends with an exact stop; N30 is planned anew."""
    desk = fresh(LINES)
    first = desk.ticks
    start(desk)
    desk.run(0.4)
    desk.send(parameters(**values))
    desk.finish(60.0)
    places, speeds = moved(desk, first)
    assert speeds[places[:, 0] < 58].max() == pytest.approx(3000.0, abs=31.0)
    assert speeds[places[:, 0] > 62].max() == pytest.approx(later, abs=31.0)
    assert (mm(desk)[0], said(desk)) == (100.0, [])


CHANGES = (
    (0.30, {"p11310": 70}),
    (0.55, {"p8817": 1800}),
    (0.70, {"p12004": 2400, "p12008": 100}),
    (0.90, {"p8702": 1}),
    (1.30, {"p8702": 0}),
    (1.50, {"p12136": 1, "p8851": 3, "p8857": 0.01}),
    (1.70, {"p11311": 200}),
    (2.10, {"p8818": 40, "p12018": 700, "p12016": 0.001}),
    (2.50, {"p8684": 0}),
    (2.90, {"p8815": 700, "p12030": 500}),
    (3.00, {"p8684": 1}),
)


def test_changes_take_effect_at_the_same_moment_however_time_is_cut() -> None:
    ways = []
    for cut in (None, 0.0013, 0.05):
        desk = fresh(
            "P1|N10 G1 F3000 X40|N20 X60 Y20|N30 G0 X80|N35 G3 F2000 X90 Y30 R10|N40 G1 G8 Y60|N50 X0 Y0|N60 M30"
        )
        for when, values in CHANGES:
            desk.at(when, lambda desk=desk, values=values: desk.send(parameters(**values)))  # type: ignore[misc]
        first = desk.ticks
        start(desk)
        for _ in range(round(4.0 / cut) if cut else 0):
            desk.run(cut or 0.0)
        desk.run(4.0 if cut is None else 0.0)
        desk.finish(200.0)
        ways.append((desk.steps_since(first).delta.tobytes(), [text for _, text in desk.remarks], mm(desk)))
    assert ways[0] == ways[1] == ways[2]
    assert ways[0][2] == (0.0, 0.0, 0.0)


def test_the_control_is_the_same_after_a_power_cut() -> None:
    """All that files, keys and programs have set; but for what ends with the mains."""
    desk = fresh("P1|N10 P500:7 P8851:2 P20003:1.5 P12020:40|N20 G54 G1 F600 X5|N30 M30", p8848=30, p12010=1, q171=2)
    desk.send(file("D+", "K1:P 700: 5 S:$30000009", "q 40: 3"))
    for name, given in (("override", 45.0), ("skip", True), ("program", 1), ("axis", "y"), ("step", 0.5)):
        desk.controller.press(desk.time_ns, name, given)
    start(desk)
    desk.finish()
    desk.send(parameters(p8702=1, p12136=1))
    before = put_out(desk)
    keys = dict(desk.controller.key_values)
    desk.power_cycle()
    after = put_out(desk)
    ends = {q_of(n) for n in (8_702, 12_136, 8_683, 8_688, 8_703, 8_579, 8_709, *(12_180 + 200 * a for a in range(3)))}
    places = {q_of(12_000 + 200 * a + n) for a in range(3) for n in (150, 151, 152, 154, 155, 156, 157, 185)}
    changed = {q for q in before | after if before.get(q) != after.get(q)}
    assert changed <= ends | places | {q_of(9_369), q_of(8_969)}
    assert desk.controller.key_values == keys | {"mode": "hand"}
    assert after[q_of(500)] == 7


WRONG = ("0", "-1", "--", "1" + "0" * 30, "0.5", "-0.5", "65535.5", "1000000000")
MOVED_BY = (
    *(8_806, 8_810, 8_815, 8_816, 8_818, 8_830, 8_843, 8_845, 8_848, 8_849, 8_850, 8_851, 8_852, 8_853, 8_857, 8_858),
    *(8_859, 8_555, 8_556, 8_650, 8_748, 8_754, 8_755, 11_310, 11_311, 11_312, 11_313, 11_314, 11_370, 12_004, 12_005),
    *(12_006, 12_008, 12_009, 12_010, 12_012, 12_013, 12_016, 12_017, 12_018, 12_020, 12_024, 12_025, 12_030, 12_031),
    *(12_040, 12_120, 12_125, 12_136, 8_701, 8_702, 8_817),
)


@pytest.mark.parametrize("wrong", WRONG)
def test_parameters_without_sense_in_a_file_a_program_and_real_time(wrong: str) -> None:
    """A message or the default, never an exception; whatever is left can be broken off."""
    text = "P1|N10 G54 G0 X5 T2 M16|N20 G1 F1200 G41 Y5|N25 X12 Y9|N30 G3 X20 Y17 I12 J17|N40 G40 G1 X22 G4.0.1|N50 M30"
    first = WRONG.index(wrong)
    for place, number in list(enumerate(MOVED_BY))[first % 2 :: 2]:
        desk = fresh(text, **T1)
        line = f"K1:P {number}: {wrong}"
        kind = (place // 2 + first) % 3
        if kind == 0:
            desk.send(file("D", line))
            start(desk)
        elif kind == 1:
            start(desk)
            desk.run(0.4)
            desk.send(file("D", line))
        else:
            desk.send(file("D+", f"K1:P {number}: 1 S:$00000005"))
            desk.send(
                file("P2", "N10 G1 F1200 X5", f"N20 P{number}:{wrong} X8", "N30 G54 G0 X12 G1", "N40 Y5", "N50 M30")
            )
            start(desk, 2)
        desk.run(3.0)
        desk.send(parameters(p8683=1, p8701=1, p8702=0, p11313=120, p11310=100))
        desk.send(parameters(p8750=2, p8751=3, p8760=1, p8752=1))
        desk.run(0.5)
        assert desk.controller.serial_format.data_bits == 8


def test_a_resolution_that_is_none() -> None:
    """1e30 increments a mm, in the middle of a program and then in HAND: 1000 (bwo900/73)."""
    desk = fresh("P1|N10 G1 F1200 X5|N20 X8|N30 M30")
    start(desk)
    desk.run(0.2)
    desk.send(file("D", "K1:P 12012: 1" + "0" * 30))
    desk.finish()
    desk.send(parameters(p8683=1, p8750=2, p8751=1, p8760=1, p8752=1))
    desk.finish()
    assert mm(desk)[0] == 9.0


@pytest.mark.parametrize(
    ("line", "number"),
    [
        ("q 60000: 1", 1302),
        ("K1:P 10500: 1", 1302),
        ("K1:P 5: " + "9" * 330, 1111),
        ("K1:P 5: nan", 1111),
        ("K1:P 5: 1.2.3", 1111),
        ("K2:P 5: 1", 1112),
    ],
)
def test_lines_that_are_no_parameters(line: str, number: int) -> None:
    desk = fresh(referenced=False, p5=3)
    desk.send(file("D", line))
    assert (said(desk), value(desk, 5)) == ([number], 3)


@pytest.mark.parametrize(
    ("values", "name"),
    [({"q110": 0}, "X"), ({"q111": 88}, "Y"), ({"q102": -5}, "X"), ({"q103": 1e9}, "X"), ({"q112": 5}, "Z")]
    + [({"q152": q152}, "Y") for q152 in (-1, 0, 1e9, 0x030301, 0x050201)],
)
def test_descriptors_without_sense_are_those_of_a_new_control(values: dict[str, float], name: str) -> None:
    """No letter, the same letter twice, a block of parameters that does not fit (bwo900/73)."""
    desk = fresh(f"P1|N10 G0 {name}5|N20 M30", **values)
    start(desk)
    desk.finish()
    assert (mm(desk)["XYZ".index(name)], said(desk)) == (5.0, [])


# Locks, files, keys of HAND


@shows("bwo900-8.4-4", "bwo900-8.4-5")
@pytest.mark.parametrize(
    ("values", "refused"),
    [
        ({}, False),
        ({"p8510": 2}, True),
        ({"p8510": 1}, False),  # another lock
        ({"p8510": 2, "p8511": 2}, False),
        ({"p11008": 1, "p11018": 2}, True),
        ({"p11009": 1, "p11019": 2}, True),
        ({"p11008": 0, "p11018": 2}, False),
        ({"p8510": 2, "p11008": -1, "p11018": 2}, False),
    ],
)
def test_locks_of_parameters(values: dict[str, float], refused: bool) -> None:
    """P500 belongs to lock 2."""
    desk = fresh("P1|N10 P499:1 P501:1|N20 P500:7|N30 M30", **values)
    desk.send(file("D+", "K1:P 500: 5 S:$00020001"))
    start(desk)
    desk.finish()
    assert said(desk) == ([1304] if refused else [])
    assert value(desk, 500) == (5 if refused else 7)
    desk.send(parameters(p500=9))
    assert value(desk, 500) == 9


@shows("bwo900-8.1-2")
@pytest.mark.parametrize("content", ["0", "--"])
@pytest.mark.parametrize(("number", "speed"), [(8_815, 1200), (8_816, 6000), (8_818, 1200), (12_120, 1200)])
def test_nothing_and_deleted_mean_the_default(number: int, speed: float, content: str) -> None:
    desk = fresh(f"P1|N10 {'G0' if number == 8_816 else 'G1 F1200'} X80|N20 M30")
    desk.send(file("D", f"K1:P {number}: 50"))
    desk.send(file("D", f"K1:P {number}: {content}"))
    assert feeds(desk)[1].max() == pytest.approx(speed, abs=31.0)


@shows("bwo900-8.6-10")
def test_programs_may_be_protected() -> None:
    desk = fresh("P1|N10 G0 X5|N20 M30", p11178=1)
    desk.send(file("P1", "N10 G0 X7", "N20 M30"))
    desk.send(file("P2", "N10 G0 X9", "N20 M30"))
    assert said(desk) == [1107]
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 5.0
    start(desk, 2)
    desk.finish()
    assert mm(desk)[0] == 9.0


@shows("bwo900-8.5-46")
def test_the_next_step() -> None:
    """10, 1, 0.1, 0.01, 0.001, and 10 again: steps of 0 are passed over."""
    desk = fresh(referenced=False)
    seen = []
    for _ in range(6):
        desk.send(parameters(p8761=1))
        seen.append((value(desk, 8762), value(desk, 8760), value(desk, 8761)))
    assert seen == [(2, 1, 0), (3, 0.1, 0), (4, 0.01, 0), (5, 0.001, 0), (1, 10, 0), (2, 1, 0)]


@shows("bwo900-8.5-47")
def test_m_functions_in_hand() -> None:
    desk = fresh("P1|N10 G1 F600 X20|N20 M30")
    desk.send(parameters(p8690=3))
    desk.run(0.1)
    assert desk.outputs["spindle"] == 1
    desk.send(parameters(p8690=5))
    desk.run(0.1)
    assert desk.outputs["spindle"] == 0
    desk.send(parameters(p8690=1234))
    assert said(desk) == [1227]
    start(desk)
    desk.run(0.5)
    desk.send(parameters(p8690=3))
    desk.finish()
    assert (said(desk), desk.outputs["spindle"]) == ([1227, 1321], 0)


# Corners, ends of rapid, what the control is at


@shows("bwo900-8.5-15")
@pytest.mark.parametrize(
    ("exponent", "factor"), [("0", 0.5), ("--", 0.5), ("2", 0.25), ("-1", 1.0), ("-2", 0.5), ("0.5", 0.7071)]
)
def test_corner_dynamics(exponent: str, factor: float) -> None:
    """At 120 degrees between the lines cos(60) = 0.5; -1 is off, other negative numbers are none (bwo900/73)."""
    desk = fresh("P1|N10 G1 F1200 X20|N20 X30 Y17.3205|N30 M30")
    desk.send(file("D", f"K1:P 8851: {exponent}"))
    places, speeds = feeds(desk)
    corner = np.sort(speeds[np.hypot(places[:, 0] - 20, places[:, 1]) < 0.3])[1]
    assert corner == pytest.approx(1200.0 * factor, abs=60.0)


@shows("bwo900-8.5-16")
@pytest.mark.parametrize(("kind", "slowest"), [(0, 0), (1, 0), (2, 1200), (3, 0), (-1, 0)])
def test_the_end_of_rapid(kind: float, slowest: float) -> None:
    """P8858 = 2 does not stop; a number that is none means an exact stop (bwo900/73)."""
    places, speeds = feeds(fresh("P1|N10 G0 X20|N20 X40|N30 M30", p8858=kind, p8816=1200))
    passing = speeds[(places[:, 0] > 19.5) & (places[:, 0] < 20.5)]
    assert passing.min() == pytest.approx(slowest, abs=60.0)


@shows("bwo900-8.5-17")
@pytest.mark.parametrize("mode", [1, 2, 4])
def test_the_mode_is_told(mode: int) -> None:
    """P8683 is the wish, P8703 what the PLC makes of it, P8688 what is."""
    desk = fresh(referenced=False)
    assert cells(desk, 8_688, 8_703) == [1, 1]
    desk.send(parameters(p8683=mode))
    assert cells(desk, 8_688, 8_703) == [mode, mode]
    desk.send(parameters(p8703=1))
    assert cells(desk, 8_688) == [1]
    desk.send(parameters(p8683=mode))
    desk.power_cycle()
    assert cells(desk, 8_688, 8_703, 8_683) == [1, 1, 1]


@shows("bwo900-8.5-18")
def test_the_plc_s_start_and_stop() -> None:
    desk = fresh("P1|N10 G1 F600 X10|N20 M30")
    desk.send(parameters(p8800=1, p8703=2, p8704=1))
    desk.run(0.4)
    assert value(desk, 8685) == 2
    desk.send(parameters(p8704=0))
    desk.run(0.5)
    assert value(desk, 8685) == 1
    desk.send(parameters(p8704=1))
    desk.finish()
    assert mm(desk)[0] == 10.0


@shows("bwo900-8.2-1")
def test_the_number_of_axes() -> None:
    assert put_out(fresh(referenced=False, q1=7))[1] == 7
    desk = fresh(referenced=False, q1=7)
    desk.power_cycle()
    assert put_out(desk)[1] == 3


@shows("bwo900-8.5-19")
def test_messages_of_the_correction_are_not_suppressed() -> None:
    """P8844 (bwo900/24): a circle smaller than the tool is a message all the same."""
    text = "P1|N10 G1 F600 tr:15 X5|N20 G41 X10|N30 X30|N40 G3 X40 Y10 R10|N50 G1 Y30|N60 M30"
    desk = fresh(text, p8844=3)
    start(desk)
    desk.finish()
    assert len(said(desk)) == 1


# The table of parameters without effect


def without_effect() -> dict[str, list[int]]:
    """Numbers of the last list of docs/bwo900.md, by their area."""
    page = (Path(__file__).parents[2] / "docs" / "bwo900.md").read_text(encoding="utf-8")
    table = " ".join(page[page.index("Parameters that are kept and have no effect") :].split())
    found: dict[str, list[int]] = {"P": [], "q": []}
    for area, first, last in re.findall(r"\b([Pq])(\d+)(?: to [Pq](\d+))?", table):
        found[area] += range(int(first), int(last or first) + 1)
    return found


@shows("bwo900-8.6-11", "bwo900-8.7-24")
@pytest.mark.parametrize("content", [1, 2, 257])
def test_parameters_without_effect_have_none(content: int) -> None:
    """All of the table at once: the same set points, messages and places as without them (bwo900/13, 18, 38, 80)."""
    text = (
        "P1|N10 G54 G0 X5 T2 M16|N20 G1 F1200 G41 Y5|N25 X12 Y9 M3 S500|N30 G3 X20 Y17 I12 J17|N40 G40 G1 X22|N50 M30"
    )
    ways = []
    for values in ({}, without_effect()):
        desk = fresh(text, **T1)
        numbers = values.get("P", []) + [
            number + 200 * a for number in values.get("P", []) if number >= 12_000 for a in (1, 2)
        ]
        desk.send(
            file("D", *(f"K1:P {n}: {content}" for n in numbers), *(f"q {n}: {content}" for n in values.get("q", [])))
        )
        first = desk.ticks
        start(desk)
        desk.finish()
        ways.append((desk.steps_since(first).delta.tobytes(), said(desk), mm(desk)))
    assert len(without_effect()["P"]) > 500
    assert ways[0] == ways[1]
