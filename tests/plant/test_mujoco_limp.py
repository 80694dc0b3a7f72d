"""Stages off, brakes, stops, collisions, and numbers that run away."""

from __future__ import annotations

import numpy as np
import pytest
from plant.energy import mechanical_energy_j

from isel_twin.machine import MachineError
from isel_twin.plant import PlantError

from .conftest import PERIOD, ramp_ns, ticks

FOUR = [ticks(4, *np.eye(3, dtype=int)[axis]) for axis in range(3)]
"""Four pulses of one axis, away from the motor."""
HEAVY = {"masses.z_slide": 40.0}
"""A Z slide whose weight (392 N) is more than friction and detent hold (about 250 N)."""


def test_limp_axis_gives_way_to_a_hand_but_not_to_a_finger(bench):
    """Breakaway 1.3 x 0.09 N m and detent 0.06 N m at 5 mm, guide 30 N: about 230 N at 90 % efficiency."""
    b = bench(power=False)
    b.plant.apply_force(0, 150.0)
    b.wait(1000)
    assert b.plant.position_mm[0] == pytest.approx(100.0, abs=0.05)
    b.plant.apply_force(0, 400.0)
    b.wait(200)
    assert b.plant.position_mm[0] > 102.0
    assert b.plant.commanded[0] == 0


def test_moved_by_hand_it_snaps_to_the_nearest_period_at_power_on(bench):
    b = bench(power=False)
    b.plant.apply_force(0, 400.0)
    b.wait(240)
    b.plant.apply_force(0, 0.0)
    b.wait(1000)
    by_hand = b.plant.rotor[0]
    assert by_hand > PERIOD
    b.plant.set_power(stages=True, brake_released=True, lowering=False)
    b.wait(1000)
    assert b.plant.rotor[0] == pytest.approx(PERIOD * round(by_hand / PERIOD), abs=0.8)


@pytest.mark.parametrize(
    ("overrides", "released", "falls"),
    [
        ({}, True, False),
        (HEAVY, True, True),
        ({**HEAVY, "axes.z.brake": 1000.0}, False, False),
        ({**HEAVY, "axes.z.brake": 1000.0}, True, True),
    ],
)
def test_z_falls_when_the_power_is_cut_unless_something_holds_it(bench, overrides, released, falls):
    b = bench(overrides)
    b.wait(500)
    height = b.plant.position_mm[2]
    b.plant.set_power(stages=False, brake_released=released, lowering=False)
    b.wait(1000)
    assert (b.plant.position_mm[2] - height > 10.0) == falls
    assert falls or b.plant.position_mm[2] == pytest.approx(height, abs=0.01)


@pytest.mark.parametrize("overrides", [HEAVY, {"imperfections": "ideal"}, {"axes.all.guide_friction": 0.0}])
def test_limp_machine_never_gains_energy(bench, overrides):
    """Pushed away, let go, running into its stops, 3 mm beyond the travel.

    What the spring of a stop holds for a moment is not in the sum: looked at while no carriage is in one.
    """
    b = bench(overrides, power=False, start_mm=(360.0, 280.0, 100.0))
    stops = np.array([398.0, 303.0, 143.0])
    for axis in range(3):
        b.plant.apply_force(axis, 800.0)
    b.wait(60)
    for axis in range(3):
        b.plant.apply_force(axis, 0.0)
    energy = [mechanical_energy_j(b.plant.built)]
    for _ in range(3000):
        b.wait(0.5)
        if np.all(b.plant.position_mm < stops):
            energy.append(mechanical_energy_j(b.plant.built))
    spent = energy[0] - energy[-1]
    assert spent > 0.1
    assert np.max(energy - np.minimum.accumulate(energy)) < 1e-4 * spent


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sense", [1, -1])
def test_stops_stand_two_kilonewtons(bench, axis, sense):
    b = bench(power=False)
    b.plant.apply_force(axis, 2000.0 * sense)
    b.wait(8000)
    travel = b.plant.machine.axes[axis].travel_mm
    stop = travel + 3.0 if sense > 0 else -3.0
    give_mm = {0: 2000.0 / 5e3, 1: 2000.0 / 8e3, 2: 0.0}[axis]
    assert b.plant.position_mm[axis] == pytest.approx(stop + sense * give_mm, abs=0.02), "the frame gives, the stop not"
    assert b.plant.at_rest


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_motor_stalls_at_the_stop(bench, axis):
    """2 pi 0.9 1.78 N m / 5 mm = 2.0 kN and a little for the momentum of the rotor, and not through the stop."""
    start = [100.0, 100.0, 30.0]
    start[axis] = bench().plant.machine.axes[axis].travel_mm
    b = bench(start_mm=start)
    t_ns = ramp_ns(3200, 2000)
    force_n, beyond_mm = [], []
    for k in range(0, 3200, 4):
        b.feed(int(t_ns[k + 3] - (t_ns[k - 1] if k else 0)), t_ns[k : k + 4] - (t_ns[k - 1] if k else 0), FOUR[axis])
        force_n.append(b.plant.parts.states["force_n"][axis])
        beyond_mm.append(b.plant.position_mm[axis] - start[axis] - 3.0)
    assert 1900.0 < max(force_n) < 2400.0
    assert max(beyond_mm) < 0.2, "most of it is the frame, which swings as the carriage bounces"
    b.wait(1000)
    assert b.lost[axis] == pytest.approx(3200 - 3.0 * 320, abs=2 * PERIOD), "the nut's spring is wound up"


FIXTURE = """
<mujoco model="block">
  <worldbody>
    <body name="block"><geom type="box" size="0.28 0.17 0.02" pos="0 0 0.02" mass="2"/></body>
  </worldbody>
</mujoco>
"""


def test_spindle_runs_onto_a_fixture_and_stays_there(bench, tmp_path):
    """The cutter is 147 mm above the table at Z = 0; a 40 mm block stops it at 107 mm."""
    (tmp_path / "block.xml").write_text(FIXTURE)
    b = bench({"fixture": str(tmp_path / "block.xml")}, start_mm=(200.0, 150.0, 100.0))
    b.move((0, 0, 9600), 2000)
    assert b.plant.position_mm[2] == pytest.approx(107.0, abs=0.2), "it bounces when the motor slips"
    b.wait(500)
    assert b.lost[2] >= 20 * 320
    with pytest.raises(MachineError, match="fixture"):
        bench({"fixture": str(tmp_path / "none.xml")})


def test_numbers_that_run_away_name_the_axis(bench):
    b = bench()
    b.plant.apply_force(0, 1e12)
    with pytest.raises(PlantError, match=r"axis x: runs away at 0\.0505"):
        b.wait(10)
    with pytest.raises(ValueError, match=r"axis y.*not a finite number"):
        bench().plant.apply_force(1, float("inf"))


def test_time_step_too_long_for_the_stiffness_is_refused_with_what_would_do(bench):
    stiff = {"axes.y.stiffness": 60.0}
    with pytest.raises(
        MachineError, match=r"mujoco_step: 0\.5 ms is too long for axes\.y\.stiffness and 3 kg; .*0\.39 ms"
    ):
        bench(stiff)
    b = bench({**stiff, "timing.mujoco_step": 0.25})
    b.move((0, 3200, 0), 5000)
    b.wait(1000)
    assert b.plant.position_mm[1] == pytest.approx(110.0, abs=0.03)


@pytest.mark.parametrize("number", range(12))
def test_machines_at_random_within_the_limit_of_the_time_step_stay_calm(bench, number):
    """Masses, stiffness, damping, friction, lead and play drawn at random; the worst the time step allows."""
    random = np.random.default_rng(number)
    overrides = {
        "axes.all.stiffness": random.uniform(5.0, 60.0),
        "axes.all.damping": random.uniform(300.0, 3000.0),
        "axes.all.backlash": random.choice([0.0, 0.01, 0.1]),
        "axes.all.guide_friction": random.uniform(5.0, 150.0),
        "axes.all.efficiency": random.uniform(0.5, 1.0),
        "axes.all.lead": random.choice([2.5, 5.0, 10.0]),
        "masses.table_carriage": random.uniform(0.5, 10.0),
        "masses.z_slide": random.uniform(1.0, 15.0),
        "imperfections.structure": bool(number % 2),
    }
    overrides = {key: value if isinstance(value, bool) else float(value) for key, value in overrides.items()}
    for step_ms in (0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05):
        try:
            b = bench({**overrides, "timing.mujoco_step": step_ms})
            break
        except MachineError:
            continue
    lead_mm = overrides["axes.all.lead"]
    b.move((3200, 3200, 3200), 4000, hz_per_ms=50)
    b.wait(3000)
    assert b.plant.position_mm == pytest.approx(np.array([100.0, 100.0, 30.0]) + 2.0 * lead_mm, abs=0.13)
    assert np.abs(b.plant.velocity_mm_s).max() < 0.1
