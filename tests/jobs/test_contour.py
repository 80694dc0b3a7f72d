"""The way of the carriages against the path of a file: distances in closed form, and findings in the file's lines."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Dwell, Element, Line, Place, Point, Rapid
from isel_twin.jobs.checks.contour import Contour, Drawing, drawing
from tests.in_process import isel_twin
from tests.near import NEAR

pytestmark = pytest.mark.long(seconds=6)

DOWN = CamSettings(start=(0.0, 0.0, 0.0), z_sign=-1)


def of(*elements: Element, bound_mm: float = 0.1) -> Drawing:
    return drawing(iter(elements), DOWN, bound_mm)


def line(number: int, *to: float) -> Line:
    x, y, z = to
    return Line(Place(number), (x, y, z), 10.0)


def walked(contour: Contour, *points: Point, start: Point = (0.0, 0.0, 0.0)) -> dict[int, float]:
    """Distances by lines, where a carriage goes straight from point to point, in steps of 0.05 mm."""
    at = np.array(start)
    for to in points:
        steps = max(math.ceil(np.linalg.norm(np.array(to) - at) / 0.05), 1)
        for share in np.arange(steps + 1) / steps:
            contour.look(at + share * (np.array(to) - at), 7)
        at = np.array(to)
    return {number: distance_mm for number, (distance_mm, _) in contour.worst.items()}


def test_z_is_in_the_sense_of_the_counters_and_what_does_not_move_is_no_piece() -> None:
    drawn = of(Rapid(Place(1), (0.0, 0.0, 5.0)), Dwell(Place(2), 1.0), line(3, 10.0, 0.0, 5.0))
    assert drawn.points_mm.tolist() == [[0.0, 0.0, 0.0], [0.0, 0.0, -5.0], [10.0, 0.0, -5.0]]
    assert drawn.cuts.tolist() == [False, True]
    assert drawn.line.tolist() == [1, 3]


@pytest.mark.parametrize("bound_mm", [0.5, 0.05, 0.005])
def test_chords_leave_an_arc_by_a_fiftieth_of_the_bound(bound_mm: float) -> None:
    """From its sagitta: r (1 - cos(half the angle))."""
    arc = Arc(Place(1), (10.0, 10.0, 0.0), (0.0, 10.0, 0.0), 2, 1, 5.0)
    points = of(arc, bound_mm=bound_mm).points_mm[:, :2]
    middles = 0.5 * (points[1:] + points[:-1])
    sagitta_mm = 10.0 - np.linalg.norm(middles - (0.0, 10.0), axis=1)
    assert 0.0 < sagitta_mm.max() <= bound_mm / 50.0
    np.testing.assert_allclose(np.linalg.norm(points - (0.0, 10.0), axis=1), 10.0, rtol=1e-12)


def test_the_distance_is_that_across_the_path() -> None:
    """Along it a carriage may be anywhere; 0.3 mm beside it is 0.3 mm."""
    contour = Contour(of(line(1, 20.0, 0.0, 0.0)), 0.1)
    assert walked(contour, (3.0, 0.0, 0.0), (10.0, 0.3, 0.0), (20.0, 0.3, 0.0)) == {1: pytest.approx(0.3)}
    assert list(contour.found()) == [(1, pytest.approx(0.3), 7)]


def test_a_corner_cut_off_is_as_far_as_its_height() -> None:
    """From 1 mm before a right angle to 1 mm behind it: half of root 2 from the corner, half a millimetre from the
    path."""
    contour = Contour(of(line(1, 20.0, 0.0, 0.0), line(2, 20.0, 20.0, 0.0)), 0.1)
    found = walked(contour, (19.0, 0.0, 0.0), (20.0, 1.0, 0.0), (20.0, 20.0, 0.0))
    assert max(found.values()) == pytest.approx(0.5, abs=0.03)


def test_rapids_lead_on_and_are_not_judged() -> None:
    contour = Contour(of(line(1, 5.0, 0.0, 0.0), Rapid(Place(2), (40.0, 0.0, 0.0)), line(3, 45.0, 0.0, 0.0)), 0.1)
    found = walked(contour, (5.0, 0.0, 0.0), (20.0, 2.0, 0.0), (40.0, 0.0, 0.0), (45.0, 0.0, 0.0))
    assert 3 not in found
    assert max(found.values(), default=0.0) < 0.2  # what of the dogleg is nearer to the cut than to the rapid


def test_what_has_been_passed_is_no_longer_near() -> None:
    """Back on the other side of a slit of 1 mm, 30 mm later: the row before is nearer, and is not what is cut now."""
    rows = of(line(1, 30.0, 0.0, 0.0), line(2, 30.0, 1.0, 0.0), line(3, 0.0, 1.0, 0.0))
    found = walked(Contour(rows, 0.1), (30.0, 0.0, 0.0), (30.0, 1.0, 0.0), (10.0, 0.4, 0.0))
    assert found[3] == pytest.approx(0.6, abs=0.02)


def test_a_way_that_crosses_itself_is_not_left_there() -> None:
    """Once around on a circle of 1 mm, 0.03 mm too small, and through its far side: 3 mm of the path lie between."""
    centre = (21.0, 20.0, 0.0)
    circle = Arc(Place(2), (20.0, 20.0, 0.0), centre, 2, -1, 8.0)
    contour = Contour(of(line(1, 20.0, 20.0, 0.0), circle, line(3, 30.0, 20.0, 0.0), bound_mm=0.01), 0.01)
    around = [(21.0 - 0.97 * math.cos(k / 50), 20.0 + 0.97 * math.sin(k / 50), 0.0) for k in range(315)]
    found = walked(contour, (20.0, 20.0, 0.0), *around, (30.0, 20.0, 0.0))
    assert found[2] == pytest.approx(0.03, abs=0.001)
    assert found[3] < 0.04


def test_a_hole_is_drilled_down_and_up() -> None:
    hole = of(line(1, 0.0, 0.0, -8.0), line(2, 0.0, 0.0, 0.0), line(3, 9.0, 0.0, 0.0))
    contour = Contour(hole, 0.1)
    assert walked(contour, (0.0, 0.0, 8.0), (0.0, 0.0, 0.0), (9.0, 0.2, 0.0)) == {3: pytest.approx(0.2)}
    assert contour.way.now_mm == pytest.approx(25.0, abs=0.01)


@pytest.mark.parametrize("short_mm", [0.001, 0.02, 0.3])
def test_a_servo_that_turns_before_the_bottom_of_a_hole_is_on_its_way_up(short_mm: float) -> None:
    """Slowly at first, and from a little below where it has been, as a drive settles."""
    hole = of(line(1, 0.0, 0.0, -8.0), Rapid(Place(2), (0.0, 0.0, 0.0)), Rapid(Place(3), (9.0, 0.0, 0.0)))
    contour, bottom_mm = Contour(hole, 0.5), 8.0 - short_mm
    assert set(walked(contour, (0.0, 0.0, bottom_mm))) <= {1}
    contour.begin()
    for back_mm in (0.002, 0.001, 0.004, 0.01, 0.03, 0.08, 0.2):
        contour.look(np.array([0.0, 0.0, bottom_mm - back_mm]), 7)
    worst = walked(contour, (0.0, 0.0, 0.0), (9.0, 0.5, 0.0), start=(0.0, 0.0, bottom_mm - 0.2))
    assert set(worst) <= {1}
    assert all(distance_mm < 1e-9 for distance_mm in worst.values())
    assert contour.way.now_mm == pytest.approx(25.0, abs=0.6)


PART = "G21 G90 G17\nG0 Z5\nG0 X20 Y20\nG1 Z-1 F600\nG1 X40 F1200\nG3 X20 Y40 I-20 J0\nG1 Y20\nG0 Z5\nM30\n"
MACHINES = {"imc-s8": "4030", "ismif": "4030", "gmi99": "4030-servo", "bwo900": "4030-servo"}


def findings(folder: Path, controller: str, *options: str, part: str = PART, cam: str = "") -> list[dict[str, str]]:
    (folder / "part.nc").write_text(part)
    (folder / "isel-twin.toml").write_text(f"[cam]\nzero = [0, 0, 40]\n{cam}\n")
    call = ("--controller", controller, "--machine", MACHINES[controller], *NEAR, "--json", *options)
    told = json.loads(isel_twin("check", folder / "part.nc", *call).stdout)
    return [one for one in told["findings"] if one["rule"] in ("contour", "effect")]


def checked(folder: Path, controller: str, *options: str, part: str = PART, tolerance: float = 0.01) -> list[str]:
    found = findings(folder, controller, *options, part=part, cam=f"tolerance_mm = {tolerance}")
    return [f"{one['rule']} {one['line']}" for one in found]


@pytest.mark.parametrize("controller", MACHINES)
def test_what_is_made_without_physics_is_what_was_drawn(controller: str, tmp_path: Path) -> None:
    """Within the tolerance of the chords and a count."""
    assert checked(tmp_path, controller, "--plant", "kinematic", "--contour-mm", "0.03") == []


def test_chords_are_found_in_the_line_of_their_arc(tmp_path: Path) -> None:
    """The iSMIF has no arcs: chords of 0.2 mm, of which at most 0.05 mm are asked."""
    found = checked(tmp_path, "ismif", "--plant", "kinematic", "--contour-mm", "0.05", tolerance=0.2)
    assert set(found) == {"contour 6"}
    assert checked(tmp_path, "ismif", "--plant", "kinematic", "--contour-mm", "0.25", tolerance=0.2) == []


def test_lost_steps_leave_the_path_of_all_cuts_that_follow(tmp_path: Path) -> None:
    """They are lost in the rapid of line 3, along X: the cut of line 5, along X, is on its path all the same."""
    weak = ("--contour-mm", "0.05", "--set", "axes.x.guide_friction=1500")
    found = checked(tmp_path, "imc-s8", *weak)
    assert {"contour 6", "contour 7"} <= set(found) <= {f"contour {number}" for number in (4, 5, 6, 7)}


@pytest.mark.parametrize("controller", MACHINES)
def test_four_controllers_make_lines_and_corners_within_20_um_with_physics(controller: str, tmp_path: Path) -> None:
    """At 20 mm/s. Where an axis begins to creep, at the begin of the arc in line 6, friction holds it for a while, and
    the steps of the iSMIF are 12.5 um (docs/fidelity.md)."""
    found = findings(tmp_path, controller, "--contour-mm", "0.02", cam="tolerance_mm = 0.002")
    off_mm = {int(one["line"]): float(one["message"].split()[0]) for one in found}
    assert set(off_mm) <= {6}
    assert max(off_mm.values(), default=0.02) < 0.05


BITE = """
[[event]]
at = 0.0
[event.cut]
diameter = 3.0
flutes = 2
depth = 0.5
width = 3.0
spindle = 18000
kc = {{ value = 2400, unit = "N/mm2", grade = "estimate", source = "a blunt tool" }}
stickout = {stickout}
"""


def test_a_thin_tool_bends_off_the_path(tmp_path: Path) -> None:
    """A slot in line 5, 20 mm/s: N a kc f / 4 = 20 N across give 20 x (1.203 + 1/20) = 25 um at the tool, with the
    holder of 20 N/um, and 20 x (1/5 + 1/8) = 6.5 um of frame, which also swings."""
    part = "G21 G90 G17\nG0 Z5\nG0 X20 Y20\nG1 Z-1 F600\nG1 X60 F1200\nG0 Z5\nM30\n"
    off_mm = {}
    for stickout in (0, 20):
        (tmp_path / "cut.toml").write_text(BITE.format(stickout=stickout))
        options = ("--contour-mm", "0.001", "--set", "axes.all.backlash=0", "--scenario", str(tmp_path / "cut.toml"))
        found = findings(tmp_path, "imc-s8", *options, part=part)
        off_mm[stickout] = next(float(one["message"].split()[0]) for one in found if one["line"] == 5)
    assert 0.005 < off_mm[0] < 0.02
    assert off_mm[20] - off_mm[0] == pytest.approx(0.025, abs=0.004)


def test_a_servo_that_follows_rounds_the_corner_of_a_program(tmp_path: Path) -> None:
    """It follows by 25 ms: from the plunge of line 4 into line 5, into the arc and out of it there are right angles,
    which are exact stops unless the settings say that they need not be."""
    found = findings(tmp_path, "bwo900", "--contour-mm", "0.02", cam="following_mm = 0")
    assert {5, 7} < {int(one["line"]) for one in found} <= {4, 5, 6, 7}


def test_without_a_drawing_the_bound_says_so(tmp_path: Path) -> None:
    assert checked(tmp_path, "imc-s8", "--contour-mm", "0.1", part="@07\n@0R7\n@0P\n") == ["effect None"]
    assert checked(tmp_path, "imc-s8", "--contour-mm", "0.1", part="G21 G90\nG4 P0.1\nM2\n") == ["effect None"]


def test_the_bound_stands_beside_the_job_and_is_refused_in_one_line(tmp_path: Path) -> None:
    job = tmp_path / "part.nc"
    job.write_text(PART)
    (tmp_path / "isel-twin.toml").write_text("[check]\ncontour_mm = -1\n[cam]\nzero = [0, 0, 40]\n")
    refused = isel_twin("check", job)
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "contour_mm" in refused.stderr
    assert isel_twin("check", job, "--contour-mm", "-1").returncode == 2
