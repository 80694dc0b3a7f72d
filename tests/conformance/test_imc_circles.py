"""iMC, sections 2.2.7, 2.2.8, 2.2.27, 2.2.28 and 2.3: planes, arcs, helices and their parameters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from conformance.closed_forms import (
    READINGS,
    directions,
    hex24,
    interpolation_parameter,
    made_after,
    off_circle,
    pulse_times_ns,
    turned_deg,
)
from conformance.imc_desk import CONTROLLERS, fresh, initialised, made, ready
from conformance.rows import case, shows
from numpy.typing import NDArray

from isel_twin.testing import Desk, Ticks

pytestmark = pytest.mark.long(seconds=5)

EXAMPLE = "@0y400,1500,119,-141,141,-1,-1"


def free(axes: int = 7, **options: Any) -> Desk:
    """Ready, with no switch in the way of large circles."""
    return ready(axes, position_switches=(), **options)


def points(stream: Ticks, xs: int, ys: int, axes: tuple[int, int] = (0, 1)) -> NDArray[np.int64]:
    """int64 [n + 1, 2]: the path relative to the centre, start point included."""
    path = stream.path()[:, list(axes)] + (xs, ys)
    return np.concatenate([[(xs, ys)], path])


def arc(desk: Desk, length: int, d: float, xs: int, ys: int, clockwise: bool, speed: int = 20_000) -> NDArray[np.int64]:
    """Make an arc and return its points; every tick must be one step of X or Y."""
    rx, ry = directions(xs, ys, clockwise)
    assert desk.query("@0f0" if clockwise else "@0f-1") == "0"
    stream = made(desk, f"@0y{length},{speed},{d:.0f},{xs},{ys},{rx},{ry}")
    assert len(stream) == length
    assert (np.abs(stream.delta).sum(axis=1) == 1).all()
    return points(stream, xs, ys)


def on_circle(radius: float, degrees: float) -> tuple[int, int]:
    """Xs, Ys of section 2.3.4, rounded."""
    angle = math.radians(degrees)
    return round(radius * math.cos(angle)), round(radius * math.sin(angle))


# --- 2.2.7: plane --------------------------------------------------------------------------------------------------

QUARTER = "@0y200,1500,{d},100,0,-1,1"


def quarter(desk: Desk) -> tuple[int, ...]:
    """Sum of the steps of a quarter circle of radius 100 from 0 to 90 degrees of the plane."""
    assert desk.query("@0f-1") == "0"
    return made(desk, QUARTER.format(d=interpolation_parameter(100, 100, 0, -1, 1))).total


@shows("imc-2.2.7-1")
def test_default_plane() -> None:
    assert quarter(free()) == (-100, 100, 0, 0)


@pytest.mark.parametrize(
    ("plane", "total"),
    [
        case("imc-2.2.7-2", 0, (-100, 100, 0, 0)),
        case("imc-2.2.7-3", 1, (-100, 0, 100, 0)),
        case("imc-2.2.7-4", 2, (0, -100, 100, 0)),
    ],
)
def test_planes(plane: int, total: tuple[int, ...]) -> None:
    desk = free()
    assert desk.query(f"@0e{(plane + 1) % 3}") == "0"
    assert desk.query(f"@0e{plane}") == "0"
    assert quarter(desk) == total


@shows("imc-2.2.7-5")
def test_plane_is_modal() -> None:
    desk = free()
    assert desk.query("@0e2") == "0"
    assert quarter(desk) == (0, -100, 100, 0)
    assert desk.query("@0A5,900,0,900,0,900,0,900") == "0"
    assert quarter(desk) == (0, -100, 100, 0)
    assert desk.query("@0e0") == "0"
    assert quarter(desk) == (-100, 100, 0, 0)


@shows("imc-2.2.7-6")
@pytest.mark.parametrize("value", ["3", "-1"])
def test_there_are_three_planes(value: str) -> None:
    assert free().query(f"@0e{value}") == "1"


# --- 2.2.8: sense --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("sense", "degrees"), [case("imc-2.2.8-1", True, -90.0), case("imc-2.2.8-2", False, 90.0)])
def test_sense_of_arcs(sense: bool, degrees: float) -> None:
    d = interpolation_parameter(500, 500, 0, *directions(500, 0, sense), clockwise=sense)
    path = arc(free(), 1000, d, 500, 0, sense)
    assert turned_deg(path) == pytest.approx(degrees)


@shows("imc-2.2.8-3")
@pytest.mark.parametrize("value", ["1", "2", "-2"])
def test_there_are_two_senses(value: str) -> None:
    assert free().query(f"@0f{value}") == "1"


@shows("imc-2.2.8-4", "imc-2.3.1-1")
def test_sense_acts_on_the_arc_that_follows() -> None:
    desk = free()
    for clockwise in (False, True, False):
        d = interpolation_parameter(500, 0, -500, *directions(0, -500, clockwise), clockwise=clockwise)
        assert turned_deg(arc(desk, 1000, d, 0, -500, clockwise)) == pytest.approx(-90 if clockwise else 90)


# --- 2.2.28: arc ---------------------------------------------------------------------------------------------------


@shows("imc-2.2.28-1", "imc-2.2.28-2", "imc-2.2.28-5", "imc-2.3.1-2", "imc-2.3.6-2")
def test_printed_arc() -> None:
    desk = free()
    assert desk.query("@0f-1") == "0"
    stream = made(desk, EXAMPLE)
    path = points(stream, -141, 141)
    assert len(stream) == 400
    assert (np.abs(stream.delta).sum(axis=1) == 1).all()
    assert tuple(path[-1]) == (-141, -141)
    assert off_circle(path, 200) <= 1
    assert desk.query("@0P") == hex24(0, -282, 0)


@shows("imc-2.2.28-3", "imc-2.2.28-7")
def test_arcs_follow_the_ramp_law() -> None:
    desk = free()
    assert desk.query("@0f-1") == "0"
    begin = desk.time_ns
    stream = made(desk, EXAMPLE)
    expected = [begin + t for t in pulse_times_ns(400, 1500)]
    assert stream.t_ns.tolist() == expected
    assert desk.replies[-1] == (expected[-1], b"0")


@pytest.mark.parametrize(("command"), [case("imc-2.2.28-4", "@0y400,{},119,-141,141,-1,-1")])
@pytest.mark.parametrize(("speed", "reply"), [(29, "D"), (30, "0"), (40_000, "0"), (40_001, "D")])
def test_range_of_arc_speeds(command: str, speed: int, reply: str) -> None:
    assert free().query(command.format(speed)) == reply


@shows("imc-2.2.28-6", "imc-2.3.5-1", "imc-2.3.5-2")
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("quadrant", range(4))
def test_directions_in_the_quadrants(quadrant: int, clockwise: bool) -> None:
    """Rx as the manual's tables give it, Ry as the tangent demands; the first steps go that way, and on the circle."""
    rx = (-1, -1, 1, 1)[quadrant] * (-1 if clockwise else 1)
    ry = (1, -1, -1, 1)[quadrant] * (-1 if clockwise else 1)
    xs, ys = on_circle(300, 45 + 90 * quadrant)
    assert directions(xs, ys, clockwise) == (rx, ry)
    d = interpolation_parameter(300, xs, ys, rx, ry, clockwise)
    path = arc(free(), 600, d, xs, ys, clockwise)
    assert np.sign(path[10] - path[0]).tolist() == [rx, ry]
    assert off_circle(path, 300) <= 1


@shows("imc-2.2.28-8")
def test_a_command_during_an_arc_waits() -> None:
    desk = free()
    desk.start("@0f-1")
    desk.start(EXAMPLE)
    desk.run(0.1)
    desk.start("@0P")
    desk.run(0.05)
    assert desk.read() == "0"
    assert desk.finish() == "0" + "0" + hex24(0, -282, 0)[1:]


@shows("imc-2.2.28-9", "imc-2.2.27-8")
@pytest.mark.parametrize("command", [EXAMPLE, "@0w400,1500,119,-141,141,-1,-1,50"])
def test_arcs_before_the_axes_are_set(command: str) -> None:
    desk = fresh()
    assert desk.query(command) == "4"
    assert desk.ticks == 0


@shows("imc-5-33")
@pytest.mark.parametrize("command", [EXAMPLE, "@0w400,1500,119,-141,141,-1,-1,50"])
def test_arcs_before_the_reference_run(command: str) -> None:
    desk = initialised()
    assert desk.query(command) == "R"
    assert desk.ticks == 0


@pytest.mark.parametrize(("letter", "count"), [case("imc-2.2.28-10", "y", 7), case("imc-2.2.27-9", "w", 8)])
def test_number_of_values(letter: str, count: int) -> None:
    values = ["400", "1500", "119", "-141", "141", "-1", "-1", "50", "0"]
    desk = free()
    for given in range(1, 10):
        assert desk.query(f"@0{letter}" + ",".join(values[:given])) == ("0" if given == count else "7"), given


# --- 2.3: every start, both senses, small and large ----------------------------------------------------------------

OCTANTS = [0, 22.5, 45, 67.5, 90, 112.5, 135, 157.5, 180, 202.5, 225, 247.5, 270, 292.5, 315, 337.5]


@shows("imc-2.3.3-1", "imc-2.3.4-1")
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("radius", [7, 8, 20, 141, 1000, 20_000])
def test_arcs_from_every_octant_stay_within_one_step(radius: int, reading: str, clockwise: bool) -> None:
    desk = free()
    length = 3 * radius if radius > 5000 else 7 * radius
    for degrees in OCTANTS:
        xs, ys = on_circle(radius, degrees)
        d = interpolation_parameter(radius, xs, ys, *directions(xs, ys, clockwise), clockwise, reading)
        path = arc(desk, length, d, xs, ys, clockwise, speed=40_000)
        assert off_circle(path, radius) <= 1, degrees
        expected = (-1 if clockwise else 1) * 360 * length / (8 * radius)
        # The simple formula counts steps as if they were even round the circle; within an octant they are not.
        assert turned_deg(path) == pytest.approx(expected, abs=8 + 120 / radius), degrees


@shows("imc-2.3.2-1")
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("radius", [7, 8, 33, 500, 5000])
@pytest.mark.parametrize("degrees", [0, 90, 180, 270])
@pytest.mark.parametrize("reading", READINGS)
def test_circles_from_an_axis_close(radius: int, reading: str, degrees: int, clockwise: bool) -> None:
    xs, ys = on_circle(radius, degrees)
    d = interpolation_parameter(radius, xs, ys, *directions(xs, ys, clockwise), clockwise, reading)
    path = arc(free(), 8 * radius, d, xs, ys, clockwise, speed=40_000)
    sign = -1 if clockwise else 1
    assert tuple(path[2 * radius]) == (-sign * ys, sign * xs)
    assert tuple(path[4 * radius]) == (-xs, -ys)
    assert tuple(path[8 * radius]) == (xs, ys)
    assert off_circle(path, radius) <= 1


@shows("imc-2.3.6-1")
def test_numbers_of_the_worked_example() -> None:
    assert round(4 * 200 * (3.9267 - 2.3562) / math.pi) == 400
    assert on_circle(200, 135) == (-141, 141)
    assert directions(-141, 141, clockwise=False) == (-1, -1)
    assert interpolation_parameter(200, -141, 141, -1, -1, reading="meant") == 119
    assert interpolation_parameter(200, -141, 141, -1, -1, reading="slipped") == 119
    path = arc(free(), 400, 119, -141, 141, clockwise=False, speed=1500)
    assert tuple(path[-1]) == (-141, -141)


def by_products(radius: float, xs: int, ys: int, rx: int, ry: int) -> float:
    """D as some host programs compute it."""
    return (radius**2 - xs * (xs - rx) - ys * (ys - ry)) / 2


@shows("imc-2.3.3-1")
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("radius", [7.5, 50.0, 400.0, 1234.56, 9000.25])
def test_other_start_values_cost_a_few_steps_and_no_more(radius: float, signed: bool, clockwise: bool) -> None:
    desk = free()
    length = round(3 * radius)
    for degrees in OCTANTS:
        xs, ys = on_circle(radius, degrees)
        rx, ry = directions(xs, ys, clockwise)
        d = by_products(radius, xs, ys, rx, ry) * (-rx * ry if signed else 1)
        path = arc(desk, length, d, xs, ys, clockwise, speed=40_000)
        assert off_circle(path, radius) <= 4, degrees
        assert math.copysign(1, turned_deg(path)) == (-1 if clockwise else 1), degrees


@shows("imc-2.3.3-1")
def test_an_arc_as_hosts_send_it() -> None:
    desk = free()
    assert desk.query("@0f0") == "0"
    path = points(made(desk, "@0y 2400,400,-200,0,-400,-1,1"), 0, -400)
    assert off_circle(path, 400) <= 4
    assert turned_deg(path) == pytest.approx(-270, abs=1)


# --- 2.2.27: helix -------------------------------------------------------------------------------------------------


@shows("imc-2.2.27-1", "imc-2.2.27-2", "imc-2.2.27-4", "imc-2.2.27-7")
def test_printed_helix() -> None:
    desk = free()
    assert desk.query("@0f-1") == "0"
    begin = desk.time_ns
    stream = made(desk, "@0w32000,600,-1000,-2000,0,1,-1,6000")
    path = points(stream, -2000, 0)
    assert len(stream) == 32_000
    assert (np.abs(stream.delta[:, :2]).sum(axis=1) == 1).all()
    assert off_circle(path, 2000) <= 1
    assert turned_deg(path) == pytest.approx(720, abs=1)
    assert stream.total[2] == 6000
    assert desk.replies[-1] == (begin + pulse_times_ns(32_000, 600)[-1], b"0")


@shows("imc-1-36", "imc-2.2.27-1")
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize(("clockwise", "climb"), [(False, 700), (False, -700), (True, 250)])
def test_a_turn_of_a_helix_is_its_closed_form(controller: str, clockwise: bool, climb: int) -> None:
    """x = R cos a, y = R sin a, each within a step; z = climb k / n at step k of n = 8 R, within half a step."""
    radius, n = 100, 800
    rx, ry = directions(radius, 0, clockwise)
    d = interpolation_parameter(radius, radius, 0, rx, ry, clockwise)
    desk = free(controller=controller)
    assert desk.query("@0f0" if clockwise else "@0f-1") == "0"
    begin = desk.time_ns
    stream = made(desk, f"@0w{n},1500,{d},{radius},0,{rx},{ry},{climb}")
    path = points(stream, radius, 0)
    assert (np.abs(stream.delta[:, :2]).sum(axis=1) == 1).all()
    assert off_circle(path, radius) <= 1
    sign = -1 if clockwise else 1
    assert path[[n // 4, n // 2, 3 * n // 4, n]].tolist() == [[0, sign * 100], [-100, 0], [0, -sign * 100], [100, 0]]
    assert turned_deg(path) == pytest.approx(sign * 360)
    assert np.abs(stream.path()[:, 2] - climb * np.arange(1, n + 1) / n).max() <= 0.5
    assert desk.counts == (0, 0, climb, 0)
    assert stream.t_ns.tolist() == [begin + t for t in pulse_times_ns(n, 1500)]
    assert desk.replies[-1] == (int(stream.t_ns[-1]), b"0")


@shows("imc-2.2.27-3")
@pytest.mark.parametrize(("speed", "reply"), [(29, "D"), (30, "0"), (40_000, "0"), (40_001, "D")])
def test_range_of_helix_speeds(speed: int, reply: str) -> None:
    assert free().query(f"@0w40,{speed},119,-141,141,-1,-1,5") == reply


@shows("imc-2.2.27-5")
@pytest.mark.parametrize("steps", [6000, -6000, 1, -7, 0, 399, 400])
def test_third_axis_is_spread_evenly(steps: int) -> None:
    desk = free()
    assert desk.query("@0f-1") == "0"
    stream = made(desk, f"@0w{max(400, abs(steps))},1500,119,-141,141,-1,-1,{steps}")
    n = len(stream)
    assert stream.path()[:, 2].tolist() == made_after(np.arange(1, n + 1), steps, n).tolist()


@shows("imc-2.2.27-10")
@pytest.mark.parametrize("steps", [401, -6000])
def test_a_steep_helix_is_led_by_its_third_axis(steps: int) -> None:
    """A quarter of R = 200 has 2 R steps, made while the third axis makes its own at the given speed."""
    desk = free()
    assert desk.query("@0f-1") == "0"
    begin = desk.time_ns
    stream = made(desk, f"@0w400,1500,119,-141,141,-1,-1,{steps}")
    n = abs(steps)
    assert stream.t_ns.tolist() == [begin + t for t in pulse_times_ns(n, 1500)]
    assert stream.delta[:, 2].tolist() == [np.sign(steps)] * n
    arc = np.abs(stream.delta[:, :2]).sum(axis=1)
    assert np.cumsum(arc).tolist() == made_after(np.arange(1, n + 1), 400, n).tolist()
    path = points(stream, -141, 141)
    assert tuple(path[-1]) == (-141, -141)
    assert off_circle(path, 200) <= 1


@shows("imc-2.2.27-10")
def test_a_helix_without_an_arc_is_a_line() -> None:
    stream = made(free(), "@0w0,1500,119,-141,141,-1,-1,300")
    assert stream.delta.tolist() == [[0, 0, 1, 0]] * 300


@shows("imc-2.2.27-6")
@pytest.mark.parametrize(("plane", "third"), [(0, 2), (1, 1), (2, 0)])
def test_third_axis_is_the_one_outside_the_plane(plane: int, third: int) -> None:
    desk = free()
    assert desk.query(f"@0e{plane}") == "0"
    assert desk.query("@0f-1") == "0"
    stream = made(desk, "@0w400,1500,119,-141,141,-1,-1,77")
    assert stream.total[third] == 77
    first, second = (axis for axis in range(3) if axis != third)
    path = points(stream, -141, 141, (first, second))
    assert tuple(path[-1]) == (-141, -141)
    assert off_circle(path, 200) <= 1
