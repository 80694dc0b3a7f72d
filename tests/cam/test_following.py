"""Drives that follow: what they make of corners and arcs, and how it is kept within the bound of the settings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from cam.played import END, FAST, P, Player, arc, axes_of, ideal_mm, line, lines_of, rapid, texts

from isel_twin import Twin
from isel_twin.cam.following import Following
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Element, PathMode, Tool
from isel_twin.cam.written import MachineAxes
from isel_twin.jobs.toolpaths import machine_axes

LAG_S = 0.025  # of the 4030-servo: a gain of 40 1/s


def behind(lag_s: float, way_mm: np.ndarray, step_s: float) -> np.ndarray:
    """A first-order lag behind points at equal times, from standing on the first of them."""
    at, follows = way_mm[0].copy(), []
    for to in way_mm:
        at += (to - at) * -math.expm1(-step_s / lag_s)
        follows.append(at.copy())
    return np.array(follows)


def rounding_mm(degrees: float, speed_mm_s: float) -> float:
    """How far what follows is from both lines of a corner, at the farthest."""
    step_s = 5e-5
    ways = speed_mm_s * step_s * np.arange(6000)
    turn = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    path = np.vstack([np.outer(ways - ways[-1], (1.0, 0.0)), np.outer(ways, turn)])
    at = behind(LAG_S, path, step_s)[6000:]
    return float(np.minimum(np.abs(at[:, 1]), np.abs(at @ (-turn[1], turn[0]))).max())


def bounded(held_mm: float = 0.0, reset_s: float = 0.0127, **bounds: float) -> Following:
    axes = replace(axes_of("bwo900"), lag_s=LAG_S, held_mm=held_mm, reset_s=reset_s)
    return Following(axes, CamSettings(**bounds))


def is_sharp(degrees: float, speed_mm_s: float, bound_mm: float = 0.02) -> bool:
    following = bounded(following_mm=bound_mm)
    following.corner((1, 0, 0), (1, 0, 0), speed_mm_s)
    to = math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0
    return following.corner(to, to, speed_mm_s)


@pytest.mark.parametrize("degrees", [5, 30, 60, 90])
def test_a_corner_is_sharp_from_the_speed_at_which_a_lag_rounds_it_by_the_bound(degrees: float) -> None:
    speed = 0.02 * math.e / (LAG_S * math.sin(math.radians(degrees)))
    assert rounding_mm(degrees, speed) == pytest.approx(0.02, rel=0.02)
    assert not is_sharp(degrees, 0.99 * speed)
    assert is_sharp(degrees, 1.01 * speed)


def test_a_way_back_is_as_sharp_as_a_right_angle_and_what_goes_straight_on_is_not() -> None:
    assert is_sharp(180, 8.0)
    assert not is_sharp(180, 2.0)
    assert not is_sharp(0, 1000.0)


def test_what_has_no_length_is_no_corner() -> None:
    following = bounded()
    assert not following.corner((1, 0, 0), (1, 0, 0), 20.0)
    assert not following.corner((0, 0, 0), (0, 0, 0), 20.0)
    assert not following.corner((1, 0, 0), (1, 0, 0), 20.0)
    assert following.corner((0, 0, 1), (0, 0, 1), 20.0)


@pytest.mark.parametrize("radius", [0.5, 5.0])
def test_an_arc_at_the_fastest_speed_shrinks_by_the_bound(radius: float) -> None:
    (speed, _), step_s = bounded().fastest_mm_s(radius), 1e-4
    angles = speed / radius * step_s * np.arange(20_000)
    follows = behind(LAG_S, radius * np.column_stack([np.cos(angles), np.sin(angles)]), step_s)
    assert radius - np.linalg.norm(follows[-1]) == pytest.approx(0.02, rel=0.07)


def held_mm(mm_s2: float, held: float, reset_s: float) -> float:
    """By how much an arc has left a drive that stands, when error and integral have the torque to turn it: by steps."""
    t, dt, integral = 0.0, 1e-5, 0.0
    while True:
        t += dt
        error = mm_s2 * t * (LAG_S + 0.5 * t)
        integral += error * dt
        if error + integral / reset_s >= held:
            return 0.5 * mm_s2 * t * t


@pytest.mark.parametrize(("held", "reset_s", "bound"), [(0.2, 0.0127, 0.02), (0.1, 0.01, 0.005), (0.3, 0.05, 0.05)])
@pytest.mark.parametrize("radius", [0.5, 20.0])
def test_friction_holds_a_drive_that_turns_round_by_the_bound(
    held: float, reset_s: float, bound: float, radius: float
) -> None:
    speed, why = bounded(held, reset_s, reversal_mm=bound).fastest_mm_s(radius)
    assert held_mm(speed**2 / radius, held, reset_s) == pytest.approx(bound, rel=0.01)
    assert why == f"friction holds a drive that turns round by {bound:g} mm at most ([cam] reversal_mm)"


def test_an_arc_is_as_slow_as_the_tighter_bound_asks() -> None:
    lag, why = bounded(0.2, following_mm=1e-4, reversal_mm=0.02).fastest_mm_s(5.0)
    assert lag == pytest.approx(math.sqrt(2.0 * 5.0 * 1e-4) / LAG_S)
    assert "following_mm" in why
    assert bounded(0.2, reversal_mm=0.0).fastest_mm_s(5.0) == bounded().fastest_mm_s(5.0)


@pytest.mark.parametrize("held", [0.01, 0.062])
def test_what_is_never_held_by_as_much_is_not_slowed(held: float) -> None:
    """Its error alone, or error and integral, turn it before the arc has left it by 0.02 mm, at any speed."""
    assert bounded(held, following_mm=0.0, reversal_mm=0.02).fastest_mm_s(5.0)[0] == math.inf


def test_without_a_bound_for_corners_none_is_sharp() -> None:
    following = bounded(0.2, following_mm=0.0, reversal_mm=0.02)
    assert following.matters
    following.corner((1, 0, 0), (1, 0, 0), 50.0)
    assert not following.corner((0, 1, 0), (0, 1, 0), 50.0)
    assert not bounded(0.0, following_mm=0.0, reversal_mm=0.02).matters


def servo(controller: str) -> MachineAxes:
    return replace(axes_of(controller), lag_s=LAG_S)


PART: list[Element] = [
    rapid(10, 0, 0),
    line(10, 0, -2, 1.0),
    line(20, 0, -2),
    arc((20, 20, -2), (20, 10, 0)),  # goes on straight
    line(20.0004, 20, -2),  # straight back, but by no count
    line(20.001, 20, -2),
    line(30, 30, -2),
    END,
]


def test_a_machine_says_by_what_its_drives_follow() -> None:
    """Z has the least inertia of screws: what turns its shaft round, over J w_v Kv, is its error (machine.toml)."""
    steps, servos = [
        machine_axes(Twin(machine=machine, controller=controller, plant="kinematic").machine)
        for machine, controller in (("4030", "imc-s8"), ("4030-servo", "gmi99"))
    ]
    assert (steps.lag_s, steps.held_mm) == (0.0, 0.0)
    turns_nm = 0.09 * (1.0 + 1.3) + 30.0 * 5e-3 / (2.0 * math.pi) / 0.9
    inertia = 4e-5 + 5e-6 + 0.85 * math.pi / 32.0 * 7850.0 * 0.016**4 * 0.28
    error = turns_nm / (inertia * 2.0 * math.pi * 50.0 * 40.0) * 5.0 / (2.0 * math.pi)
    assert (servos.lag_s, servos.held_mm) == (LAG_S, pytest.approx(error))
    assert servos.reset_s == pytest.approx(4.0 / (2.0 * math.pi * 50.0))
    for wrong, why in (("lag_s", "lag_s is -1"), ("held_mm", "held_mm -1"), ("reset_s", "reset_s is -1")):
        with pytest.raises(ValueError, match=why):
            replace(axes_of("imc-s8"), **{wrong: -1.0})


def test_sharp_corners_are_exact_stops_of_the_bwo_900() -> None:
    """The rapid stops exactly by itself; slowly down and across at 10 mm/s is a corner of 0.03 mm."""
    made = [text.split(" ", 1)[1] for text in texts(lines_of("bwo900", PART, axes=servo("bwo900")))[3:-2]]
    assert made == [
        *("G0 X10", "G1 Z2 F60", "G04.0.000", "G1 X20 F600", "G3 X20 Y20 I20 J10"),
        *("G04.0.000", "G1 X20.001", "G04.0.000", "G1 X30 Y30"),
    ]


def test_sharp_corners_wait_for_the_drives_of_the_gmi99() -> None:
    """In the same line. The cut waits for the rapid before it, too."""
    lines = texts(lines_of("gmi99", PART, axes=servo("gmi99")))[5:]
    assert lines[0] == "f30000 | 81h 10000 | H2"
    assert lines[1].split(" | ")[:5] == ["f1000", "84h 2000", "H2", "f10000", "81h 20000"]
    assert lines[1].count("H2") == 3
    assert "H2 | H2" not in lines[1]


@pytest.mark.parametrize("controller", ["gmi99", "bwo900"])
def test_the_way_is_the_same_and_a_bound_of_0_asks_for_nothing(controller: str) -> None:
    free = lines_of(controller, PART, replace(FAST, following_mm=0.0), servo(controller))
    assert texts(free) == texts(lines_of(controller, PART))
    player = Player(controller, servo(controller))
    run = player.play(PART)
    assert abs(run.mm[-1] - ideal_mm(PART)[-1]).max() <= 1e-3


@pytest.mark.parametrize("controller", ["gmi99", "bwo900"])
def test_an_arc_is_made_as_slowly_as_its_drives_follow_and_that_is_said_once(controller: str) -> None:
    """r = 0.5 mm: the square root of 2 x 0.5 x 0.02, over 25 ms, is 5.657 mm/s."""
    small = arc((51, 60, 0), (50.5, 60, 0), 1, feed=8.0)
    lines = lines_of(controller, [rapid(50, 60, 0), small, line(50, 60, 0, 5.0), small, END], axes=servo(controller))
    (said,) = [each.text for each in lines if each.caution]
    assert "an arc of r 0.5 mm is made at 5.66 mm/s: its drives follow within 0.02 mm ([cam] following_mm)" in said
    assert sum(("F339.411" if controller == "bwo900" else "f5657") in each.text for each in lines) >= 1


def test_a_line_of_the_gmi99_has_no_more_commands_than_the_card_buffers() -> None:
    """Each cut with a feed of its own and a corner behind it: two commands beside the move."""
    path = [rapid(50, 50, -5), *(line(50 + 0.3 * k, 50 + k % 2, -5, 8 + 0.01 * k) for k in range(1, 100)), END]
    run = Player("gmi99", servo("gmi99")).play(path)
    assert run.end_mm == pytest.approx((79.7, 51, 5))
    *_, first, last = texts(run.lines)
    assert [first.count("h "), last.count("h ")] == [45, 9]


def test_the_bound_is_a_setting() -> None:
    coarse = lines_of("bwo900", PART, CamSettings(following_mm=0.2), servo("bwo900"))
    assert not any("G04" in each.text for each in coarse)


def test_a_cut_waits_for_the_way_back_from_a_change_of_the_tool() -> None:
    """It goes on in the direction of before, and the tool comes down from above."""
    settings = replace(FAST, tool_change=(300.0, 0.0, 1.0))
    path = [line(10, 10, -5), line(20, 10, -5), Tool(P, 2), line(30, 10, -5), END]
    *_, before, last = texts(lines_of("gmi99", path, settings, servo("gmi99")))
    assert (before.endswith("H2"), last) == (True, "f10000 | 81h 30000")


STRAIGHT = [line(float(k), 0, 0) for k in (10, 20, 30)]


@pytest.mark.parametrize(("controller", "rest", "stops"), [("bwo900", "G04.0.000", 2), ("gmi99", "H2", 3)])
def test_exact_stop_of_a_file_brings_drives_to_rest(controller: str, rest: str, stops: int) -> None:
    """G61: in a straight line, too; the BWO 900 needs none before the first motion. G64 ends it."""
    for modes, count in (([PathMode(P, True)], stops), ([PathMode(P, True), PathMode(P, False)], 0)):
        made = " | ".join(texts(lines_of(controller, [*modes, *STRAIGHT, END], axes=servo(controller))))
        assert made.count(rest) == count
    assert rest not in " ".join(texts(lines_of(controller, [PathMode(P, True), *STRAIGHT, END])))


@pytest.mark.parametrize(
    ("setting", "tolerance", "bound"),
    [
        (0.02, None, 0.02),
        (0.02, 0.001, 0.001),
        (0.02, 0.5, 0.02),
        (0.0, 0.001, 0.001),
        (0.0, None, 0.0),
        (0.02, 0.0, 0.02),
    ],
)
def test_the_tighter_of_settings_and_file_bounds_a_corner(
    setting: float, tolerance: float | None, bound: float
) -> None:
    """G64 P: as fast as r = 5 mm may be made with that bound."""
    following = bounded(following_mm=setting)
    following.bound(tolerance)
    fastest, why = following.fastest_mm_s(5.0)
    assert fastest == pytest.approx(math.sqrt(10.0 * bound) / LAG_S if bound else math.inf)
    assert ("G64 P" in why) is (tolerance == bound)
