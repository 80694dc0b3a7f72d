"""What is tested one by one elsewhere, met together: forces, brakes, cuts, resets, other frames, half steps."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.plant import Cut

START_MM = (100.0, 100.0, 30.0)
LEAD_M = 5e-3
SLIP = 32
"""Steps in a slip at 1600 a turn: four full steps."""
FREE = {
    f"axes.all.{key}": value
    for key, value in {"shaft_coulomb": 0.0, "shaft_viscous": 0.0, "guide_friction": 0.0, "efficiency": 1.0}.items()
}
"""Nothing rubs, so that a push arrives at the motor whole."""


def imc(**options: Any) -> Twin:
    twin = Twin(start_mm=START_MM, **options)
    assert twin.query("@07") == "0"
    return twin


# A controller that is reset while somebody pushes ---


def test_a_push_outlasts_a_reset_in_a_motion() -> None:
    """300 N on the tool bend the portal of the 4030 by 60 um at 5 N/um, whatever the controller does; let go, the tool
    is back within the friction and play that it has."""
    twin = Twin(start_mm=START_MM)
    assert [twin.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    twin.run(1.0)
    rest_mm = twin.machine_position_mm.copy()
    twin.apply_force(0, 300.0, "tool")
    twin.run(1.0)
    bent_mm = twin.machine_position_mm[0] - rest_mm[0]
    assert 0.055 < bent_mm < 0.12
    twin.write(b"@0A8000,2000,0,30,0,30,0,30\r")
    twin.run(0.5)
    twin.write(bytes([254]))
    twin.run(2.0)
    assert twin.idle
    assert np.abs(twin.lost_steps).max() < SLIP / 2, "nobody was near the torque of the motor, and a reset is a ramp"
    there_mm = twin.machine_position_mm.copy()
    twin.apply_force(0, 0.0, "tool")
    twin.run(1.0)
    assert there_mm[0] - twin.machine_position_mm[0] == pytest.approx(300.0 / 5e3, abs=0.05)
    assert twin.machine_position_mm[1:] == pytest.approx(there_mm[1:], abs=0.002)


# A brake that closes under load ---


@pytest.mark.parametrize(
    ("brake_n", "push_n", "holds"), [(500.0, 500.0, True), (0.0, 500.0, False), (500.0, 1100.0, False)]
)
def test_a_brake_that_closes_under_a_push(brake_n: float, push_n: float, holds: bool) -> None:
    """Limp the axis stands some 230 N, and 500 N more with its brake: what is less stays, what is more goes."""
    twin = imc(overrides={"axes.z.brake": brake_n, "axes.z.stage.idle_current": 1.0})
    twin.run(1.0)
    twin.apply_force(2, push_n)
    twin.run(1.0)
    before_mm = float(twin.machine_position_mm[2])
    assert abs(before_mm - START_MM[2]) < 0.1, "the motor holds it"
    twin.set_input("estop", "pressed")
    twin.run(1.0)
    fell_mm = twin.machine_position_mm[2] - before_mm
    assert (abs(fell_mm) < 0.025) == holds, "a full step"
    assert holds or fell_mm > 10.0
    if holds:
        twin.apply_force(2, 0.0)
        twin.set_input("estop", "released")
        twin.run(1.0)
        assert abs(twin.lost_steps[2]) < SLIP / 2


# Margins: half steps, cuts ---


@pytest.mark.parametrize("part", [0.15, 0.3])
def test_margin_of_a_motor_in_half_steps(part: float) -> None:
    """A push takes a part between that of one phase, Km I, and that of two, sqrt 2 Km I; detent aside (0.06 N m)."""
    overrides = {**FREE, "axes.all.stage.idle_current": 1.0}
    twin = Twin(controller="ismif", start_mm=START_MM, overrides=overrides)
    axis = twin.machine.axes[0]
    assert axis.stage.stepped
    one_nm = axis.motor.torque_constant_nm_per_a * axis.stage.current_a
    twin.run(2.0)
    twin.watch_margin()
    assert twin.margin[0] == pytest.approx(1.0, abs=0.02)
    twin.apply_force(0, -part * one_nm * 2.0 * math.pi / LEAD_M)
    twin.run(2.0)
    twin.watch_margin()
    twin.run(0.1)
    slack = 0.06 / one_nm + 0.01
    assert 1.0 - part - slack < twin.margin[0] < 1.0 - part / math.sqrt(2.0) + slack


def test_a_deeper_cut_leaves_less_margin() -> None:
    """Along X at 50 mm/s: the force against the feed, r N a kc f / 4, takes F r of the torque, ten times as much at ten
    times the depth. 0.3 x 2 x 5 mm x 800 N/mm2 x 0.25 mm / 4 = 150 N, 0.12 N m of 1.7 N m, and half as much again at
    the teeth's peak; without friction, which a greater load would add to."""
    margins = []
    for depth_mm in (None, 0.5, 5.0, 10.0):
        twin = imc(overrides=FREE)
        cut = None if depth_mm is None else Cut(6.0, 2, depth_mm, 6.0, 6000.0, 800.0)
        assert twin.query("@0R7") == "0"
        twin.set_cut(cut)
        twin.write(b"@0A32000,16000,0,30,0,30,0,30\r")
        twin.run(1.0)
        twin.watch_margin()
        twin.run(0.5)
        margins.append(float(twin.margin[0]))
        assert np.abs(twin.lost_steps).max() < SLIP / 2
    none, shallow, deep, deepest = margins
    assert none > shallow > deep > deepest
    force_n = 0.3 * 2.0 * 5.0 * 800.0 * 0.25 / 4.0
    assert none - deep > force_n * LEAD_M / (2.0 * math.pi) / 1.78
    assert none - deepest > 2.0 * force_n * LEAD_M / (2.0 * math.pi) / 1.78


# Frames of one's own ---

SOFT = """based_on = "4030"
name = "soft"
[structure.flex_x]
stiffness = { value = 2.0, unit = "N/um", grade = "measured", source = "a gauge and a weight" }
damping_ratio = { value = 0.1, unit = "1", grade = "measured", source = "its ring" }
"""


def test_a_frame_of_ones_own_gives_and_rings_as_its_file_says(tmp_path: Path) -> None:
    """20 N at the tool, which friction keeps from the nut: F / k, 6 um more than on the 4030; and after a step of force
    it overshoots by exp(-pi zeta / sqrt(1 - zeta^2)): 73 % with 0.1, 91 with 0.03."""
    (tmp_path / "machine.toml").write_text(SOFT)
    gives, overshoots = [], []
    for machine in ("4030", tmp_path):
        twin = Twin(str(machine), start_mm=START_MM)
        twin.query("@07")
        twin.run(1.0)
        rest_mm = float(twin.machine_position_mm[0])
        seen: list[float] = []
        twin.apply_force(0, 20.0, "tool")
        for _ in range(1500):
            twin.run(0.001)
            seen.append(twin.machine_position_mm[0] - rest_mm)
        gives.append(seen[-1])
        overshoots.append(max(seen) / seen[-1] - 1.0)
    assert gives[1] - gives[0] == pytest.approx(20.0 / 2e3 - 20.0 / 5e3, rel=0.02)
    assert overshoots[1] == pytest.approx(math.exp(-math.pi * 0.1 / math.sqrt(0.99)), abs=0.05)
    assert overshoots[0] > overshoots[1] + 0.1
