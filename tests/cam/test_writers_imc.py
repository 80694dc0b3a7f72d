"""Toolpaths as iMC commands, played on the 4030: lines, path, end and time against the manual and closed forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from cam.played import (
    END,
    FAST,
    TRAVEL,
    P,
    arc,
    axes_of,
    check_made,
    line,
    lines_of,
    played,
    rapid,
    texts,
)
from cam.random_paths import paths
from hypothesis import given
from hypothesis import settings as hypothesis_settings

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Coolant, Dwell, Element, Output, Place, Rapid, Spindle, Stop, Tool
from isel_twin.cam.writing import written
from isel_twin.cam.written import MachineAxes
from isel_twin.firmware.imc.profile import load_profile
from isel_twin.firmware.imc.writing import ImcCommands
from tests.thorough import drawn

BEGIN = ["@07", "@0d5000,5000,5000", "@0R7", "@0z1"]
ABOVE = rapid(50, 50, -5)


def job(path: Sequence[Element], settings: CamSettings = FAST, controller: str = "imc-s8") -> list[str]:
    lines = texts(lines_of(controller, path, settings))
    assert lines[:4] == BEGIN
    return lines[4:]


def seconds(steps: int, hz: float, f0: float = 300.0, a: float = 100_000.0) -> float:
    """A move with ramps of the iMC as delivered: start-stop frequency and Hz/s."""
    ramps = (hz**2 - f0**2) / a
    return 2 * (hz - f0) / a + (steps - ramps) / hz if steps >= ramps else 2 * (math.sqrt(f0**2 + a * steps) - f0) / a


def test_lines_for_speeds_along_the_path() -> None:
    """(30, 40) at 10 mm/s of 320 steps/mm is 3200 along the path; 31.25 mm/s, the top 40000 Hz, is 125 mm/s there."""
    axes = replace(axes_of("imc-s8"), speed_along_path=True)
    lines = lines_of("imc-s8", [rapid(10, 10, 0), line(40, 50, 0), line(70, 90, 0, 125.0), END], axes=axes)
    assert [text.split(",")[1] for text in texts(lines) if "@0M" in text] == ["9600", "3200", "40000"]


def test_lines_as_the_manual_writes_them() -> None:
    """2.2.29: with 3D the speed of X is that of the longest axis: (30, 40) at 10 mm/s is 40 * 320 / 50 * 10."""
    assert job([rapid(10, 10, 0), line(40, 50, 0), END]) == [
        "@0M3200,6788,3200,6788,0,6788,0,30",
        "@0M12800,2560,16000,2560,0,2560,0,30",
    ]


@pytest.mark.parametrize(
    ("to", "hz"), [((60, 50, -5), 3200), ((80, 90, -5), 2560), ((60, 60, -15), 1848), ((50, 50, -6), 3200)]
)
def test_a_feed_is_along_the_path(to: tuple[float, float, float], hz: int) -> None:
    """f = v max|n| / L at 10 mm/s; the same f for every axis, also when only Z moves."""
    (_, cut) = job([ABOVE, line(*to), END])
    assert cut.split(",")[1::2] == [str(hz)] * 3 + ["30"]


def test_a_line_in_space_is_made_to_the_step() -> None:
    run = check_made("imc-s8", [rapid(10, 20, -5), line(40, 60, -15), line(40.001, 60, -15), END])
    assert run.counts[-1].tolist() == [12800, 19200, 4800]


@pytest.mark.parametrize("length", [30.0, 10.0, 1.0, 0.1])
def test_a_line_takes_its_length_by_feed_and_its_ramps(length: float) -> None:
    """At 10 mm/s: 3.026 s, 1.026 s, 0.126 s, 0.030 s."""
    run = played("imc-s8", [rapid(10, 10, 0), line(10 + length, 10, 0), END])
    began = int((run.counts[:, 0] <= 3200).sum()) - 1  # index of the first step of the cut
    before = run.t_ns[began - 1]
    assert (run.t_ns[-1] - before) / 1e9 == pytest.approx(seconds(round(320 * length), 3200), abs=2e-6)


def test_points_are_rounded_and_not_ways() -> None:
    """A thousand thirds of a step make 1 mm and no drift."""
    path = [line(10 + k / 960, 10, 0) for k in range(961)]
    lines = job([rapid(10, 10, 0), *path, END])
    assert lines[-1].startswith("@0M3520,")
    assert len(lines) == 1 + 320


def test_a_circle_is_one_command_and_a_way_to_its_end() -> None:
    """r = 10 mm is R = 3200: B = 8 R, f = B v / (2 pi r), D = (R^2 - Xs(Xs - 1) - 0) / 2 with Rx = -1, Ry = 1."""
    lines = job([ABOVE, arc((50, 50, -5), (40, 50, 0)), END])
    d = -(3200**2 - 3200 * 3199 - 0 * 1) // 2
    assert lines[1:] == ["@0e0", "@0f-1", f"@0y25600,4074,{d},3200,0,-1,1", "@0M16000,4074,16000,4074,1600,4074,0,30"]


@pytest.mark.parametrize("turns", [1, -1, 2])
@pytest.mark.parametrize("to", [(50, 50), (40, 60), (40, 40), (30, 50), (46, 58), (48, 44)])
def test_arcs_of_x_and_y_are_made(to: tuple[float, float], turns: int) -> None:
    run = check_made("imc-s8", [ABOVE, arc((*to, -5), (40, 50, 0), turns), END])
    assert [line.text[:3] for line in run.lines[5:]] == ["@0e", "@0f", "@0y", "@0M"]


def test_the_centre_moves_where_no_radius_fits_the_nearest_one() -> None:
    """With the centre at the nearest step the only radius that is read is 1.2 steps too large, and the arc 2.5 off."""
    start, to, centre = (41.7053, 41.40364, -59.65942), (41.69894, 41.6262, -59.56717), (41.34813, 41.5048, 0.0)
    run = check_made("imc-s8", [rapid(*start), arc(to, centre, -2), END], replace(FAST, tolerance_mm=0.002))
    assert any(text.startswith("@0w") for text in texts(run.lines))


@pytest.mark.parametrize("turns", [1, -2])
def test_a_helix_is_one_command_and_a_way_to_its_end(turns: int) -> None:
    """r = 10 mm, 0.75 mm up: f = B v / L with the length of the helix, and Z by 240 steps."""
    run = check_made("imc-s8", [rapid(50, 50, -20), arc((50, 50, -19.25), (40, 50, 0), turns), END])
    b = 25600 * abs(turns)
    hz = round(b * 10 / math.hypot(20 * math.pi * turns, 0.75))
    helix = run.lines[-2].text
    assert helix.startswith(f"@0w{b},{hz},")
    assert helix.endswith(",-240")


def test_a_steep_helix_is_chords() -> None:
    """Z goes evenly with the steps of X and Y, (1 - cos + sin) / 2 of a quarter turn, and not with its angle: 2 % of
    5 mm are more than the tolerance."""
    run = check_made("imc-s8", [rapid(50, 50, -30), arc((50, 50, -10), (40, 50, 0)), END])
    assert not any("@0w" in line.text for line in run.lines)


@pytest.mark.parametrize(
    "element",
    [
        arc((50, 30, -20), (50, 40, -20), 1, plane=0),
        arc((50, 50, -20), (50, 55, -24), -1, plane=0),
        arc((58, 50, -20), (54, 50, -20), 1, plane=1),
        arc((50, 50, -20), (53, 50, -24), -2, plane=1),
        arc((30, 50, -20), (41, 50, 0)),
    ],
    ids=["YZ", "YZ circle", "ZX", "ZX twice", "spiral"],
)
def test_other_arcs_are_chords(element: Element) -> None:
    run = check_made("imc-s8", [rapid(50, 50, -20), element, END])
    assert not any("@0y" in line.text for line in run.lines)


def test_the_number_of_chords_follows_from_the_tolerance() -> None:
    """Equal angles of at most 2 acos(1 - e / r): 71 for a circle with r = 5 mm and e = 5 um; the last ends exactly."""
    settings = CamSettings(rapid_mm_s=30.0, tolerance_mm=0.005)
    lines = job([ABOVE, arc((50, 50, -5), (50, 45, -5), -1, plane=0), END], settings)[1:]
    assert len(lines) == math.ceil(2 * math.pi / (2 * math.acos(1 - 0.005 / 5)))
    assert lines[-1].split(",")[:5:2] == ["@0M16000", "16000", "1600"]


@given(path=paths(turns=3))
@hypothesis_settings(max_examples=drawn(12), deadline=None)
def test_any_path_is_made(path: list[Element]) -> None:
    check_made("imc-s8", path)


@pytest.mark.parametrize("controller", ["imc-m", "imc-mp", "c142"])
def test_every_member_takes_it(controller: str) -> None:
    path = [ABOVE, arc((40, 60, -5), (40, 50, 0)), line(20, 20, -1), Spindle(P, 1), Spindle(P, 0), END]
    check_made(controller, path)


# ---- speeds ----------------------------------------------------------------------------------------------------------


def test_a_speed_beyond_the_controller_is_clipped_and_said_once() -> None:
    """10000 Hz of the C142 are 31.25 mm/s along an axis."""
    path = [rapid(100, 0, 0), rapid(0, 0, 0), line(100, 0, 0, 50.0), line(0, 0, 0, 60.0), END]
    lines = lines_of("c142", path, CamSettings(rapid_mm_s=166.0))
    assert [line.text.split(",")[1] for line in lines if "@0M" in line.text] == ["10000"] * 4
    assert [line.text for line in lines if line.caution] == [
        "# caution: a rapid of 166 mm/s is more than the machine makes: 31.25 mm/s here",
        "# caution: a feed of 50 mm/s is more than the machine makes: 31.25 mm/s here",
    ]


def test_a_speed_beyond_an_axis_is_clipped() -> None:
    """Z makes 4 mm/s: a line of 30 mm in X and 10 mm in Z takes 2.5 s at least."""
    axes = MachineAxes((320.0, 320.0, 320.0), TRAVEL, (40.0, 40.0, 4.0))
    (*_, cut) = texts(line for line in lines_of("imc-s8", [line(30, 0, -10, 20.0), END], axes=axes) if not line.caution)
    assert cut == f"@0M9600,{9600 / 2.5:.0f},0,3840,3200,3840,0,30"


def test_a_creeping_feed_is_made_as_slowly_as_the_controller_can() -> None:
    lines = lines_of("imc-s8", [line(1, 0, 0, 0.05), line(2, 0, 0, 0.05), END])
    assert [line.text.split(",")[1] for line in lines if "@0M" in line.text] == ["30"] * 2
    assert sum(line.caution is not None for line in lines) == 1


# ---- travel ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ([line(395.01, 0, 0)], "X 395.009 mm"),
        ([line(0, -0.1, 0)], "Y -0.100 mm"),
        ([line(0, 0, 1)], "Z -1.000 mm"),
        ([rapid(50, 4, -5), arc((60, 4, -5), (55, 4, 0))], "Y"),
        ([rapid(50, 50, -4), arc((60, 50, -4), (55, 50, -4), 1, plane=1)], "Z"),
    ],
    ids=["X", "Y", "Z", "arc", "chord"],
)
def test_what_leaves_the_travel_is_refused_at_its_place(path: list[Element], words: str) -> None:
    """An arc that begins and ends within it, too: the lower half about (55, 4), the upper half in ZX."""
    last = path[-1]._replace(place=Place(7, 3))
    with pytest.raises(CamError, match=rf"line 7, column 3: leads to {words}") as caught:
        lines_of("imc-s8", [*path[:-1], last, END])
    assert caught.value.place == Place(7, 3)


def test_the_border_of_the_travel_belongs_to_it() -> None:
    near = [rapid(50, 5, 0), arc((60, 5, 0), (55, 5, 0)), END]
    check_made("imc-s8", near)
    assert job([rapid(395, 300, -140), *near])[0].startswith("@0M126400,")


def test_an_axis_that_there_is_not_cannot_move() -> None:
    axes = MachineAxes((320.0, 320.0, 320.0), (TRAVEL[0], TRAVEL[1], (0.0, 0.0)))
    assert texts(lines_of("imc-s8", [rapid(10, 20, 0), END], axes=axes)) == [
        "@03",
        "@0d5000,5000",
        "@0R3",
        "@0M3200,8587,6400,8587",
    ]
    with pytest.raises(CamError, match="goes along Z, an axis that this machine has not"):
        lines_of("imc-s8", [rapid(10, 20, -1), END], axes=axes)


def test_a_counter_of_z_that_grows_upwards() -> None:
    """Zero at the top, the table at -140 mm: Z is sent as it is programmed."""
    axes = MachineAxes((320.0, 320.0, 320.0), (TRAVEL[0], TRAVEL[1], (-140.0, 0.0)))
    settings = CamSettings(rapid_mm_s=30.0, z_sign=1)
    assert texts(lines_of("imc-s8", [line(0, 0, -2), END], settings, axes))[4:] == ["@0M0,3200,0,3200,-640,3200,0,30"]


# ---- events ----------------------------------------------------------------------------------------------------------


def test_spindle_and_pauses() -> None:
    path = [Spindle(P, 1, 12000.0, 2.0), Dwell(P, 0.25), Spindle(P, -1), END]
    assert job(path) == [
        "@0B2,1",
        "<2.000s>",
        "# caution: a spindle speed of 12000 rev/min is not told to the spindle, nor is any other: "
        "set it by hand, or set [cam] spindle_max_rpm to its speed at 10 V",
        "<0.250s>",
        "@0B2,1",
        "# caution: spindle counter-clockwise: the controller only switches it on, in the sense that it has",
        "@0B2,0",
    ]
    assert texts(lines_of("c142", [Spindle(P, 1), END]))[4:] == ["@0B65529,1", "@0B65529,0"]


def test_outputs_are_bits_of_the_user_port() -> None:
    settings = CamSettings(outputs={"coolant": 0, "A4.1": 3, "PUMP": 7})
    path = [Coolant(P, 1, True), Output(P, "A4", 0b1, 1), Output(P, "PUMP", 1, 1), Output(P, "A4", 0b1, 0), END]
    assert job(path, settings) == ["@0B0,1", "@0B0,9", "@0B0,137", "@0B0,129", "@0B0,128"]


def test_what_cannot_be_switched_on_need_not_be_switched_off() -> None:
    assert job([Coolant(P, 1, False), Coolant(P, 2, False), Output(P, "P3", 1, 0), END]) == []


def test_outputs_that_nobody_has_named_are_said_once() -> None:
    path = [Coolant(P, 2, True), Coolant(P, 2, False), Output(P, "A4", 0b111, 0b010), Output(P, "A4", 0b111, 0), END]
    lines = lines_of("imc-s8", path)[4:]
    assert [line.text.split(" ")[2] for line in lines if line.caution] == ["coolant2", "A4.2"]
    assert len(lines) == 2
    with pytest.raises(CamError, match="coolant = 8; the user port has bits 0 to 7"):
        job([Coolant(P, 1, True), END], CamSettings(outputs={"coolant": 8}))


def test_a_tool_is_changed_at_its_point_and_the_way_there_is_safe() -> None:
    """Z up first; back X and Y first: to where a rapid leads, or to where a cut was left."""
    settings = CamSettings(rapid_mm_s=30.0, tool_change=(300.0, 0.0, 1.0))
    change = Tool(P, 2, "3 mm")
    lines = job([Spindle(P, 1), line(10, 10, -5), change, rapid(20, 20, -2), change, line(30, 20, -2), END], settings)
    spots = [tuple(int(n) / 320 for n in text[3:].split(",")[:5:2]) for text in lines if text.startswith("@0M")]
    assert spots == [
        (10, 10, 5),
        (10, 10, 1), (300, 0, 1), (20, 20, 1), (20, 20, 2),
        (20, 20, 1), (300, 0, 1), (20, 20, 1), (20, 20, 2), (30, 20, 2),
    ]  # fmt: skip
    assert lines[2] == "@0B2,0"
    assert lines[5] == "# change to tool 2 (3 mm); the spindle is off"
    check_made("imc-s8", [line(10, 10, -5), change, line(20, 20, -2), END])


def test_start_and_park() -> None:
    settings = CamSettings(rapid_mm_s=30.0, start=(10.0, 0.0, 5.0), park=(0.0, 300.0, 0.0))
    lines = job([Spindle(P, 1), line(10, 0, -6), END], settings)
    assert [text.split(",")[:5:2] for text in lines] == [
        ["@0M3200", "0", "0"],
        ["@0M3200", "0", "1600"],
        ["@0B2"],
        ["@0M3200", "0", "1920"],
        ["@0M3200", "0", "0"],
        ["@0M0", "96000", "0"],
        ["@0B2"],
    ]


def test_stops_are_remarks() -> None:
    stop = "# stop: the operator goes on from here"
    assert job([Stop(P), Stop(P, optional=True), END]) == [stop, stop]
    assert job([Stop(P, optional=True), END], CamSettings(optional_stop=False)) == []


def test_places_are_those_of_the_file() -> None:
    path = [Rapid(Place(3), (10.0, 0.0, 0.0)), arc((10, 20, 0), (10, 10, 0))._replace(place=Place(4)), END]
    assert [line.place and line.place.line for line in lines_of("imc-s8", path)] == [None] * 4 + [3, 4, 4, 4, 4]


# ---- members that lack a command -------------------------------------------------------------------------------------


def lacking(letters: str, path: list[Element]) -> list[str]:
    profile = load_profile("imc-s8", {})
    object.__setattr__(profile, "unknown_commands", tuple(letters))
    axes = axes_of("imc-s8")
    return texts(written(iter(path), axes, FAST, ImcCommands(profile, axes, FAST, BEGIN)))


def test_without_3d_z_goes_up_first_and_down_last() -> None:
    lines = lacking("z", [rapid(10, 10, -5), rapid(20, 10, 0), line(30, 10, 0), END])
    assert [text.split(",")[:5:2] for text in lines[3:]] == [
        ["@0M3200", "3200", "0"],
        ["@0M3200", "3200", "1600"],
        ["@0M3200", "3200", "0"],
        ["@0M6400", "3200", "0"],
        ["@0M9600", "3200", "0"],
    ]
    with pytest.raises(CamError, match="moves Z by itself"):
        lacking("z", [line(10, 0, -10), END])


def test_without_circles_arcs_are_chords() -> None:
    assert not any("@0y" in text for text in lacking("y", [ABOVE, arc((50, 50, -5), (40, 50, 0)), END]))
