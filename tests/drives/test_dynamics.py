"""The sub-step: friction that sticks, a nut with play, motors without current, and no energy from nowhere."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from drives.axis import DT, Rig, rigs, trapezoid
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.drives.curves import mean_command
from isel_twin.drives.dynamics import (
    BOTH,
    OPEN,
    PHASE_A,
    PHASE_B,
    axis_parameters,
)
from isel_twin.drives.library import MOTORS
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import AXIS_STATE, axis_states
from isel_twin.drives.stage import Stage
from isel_twin.native import core
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=7)

NEMA23 = MOTORS["23HS32-4004S"]
NO_DETENT = dataclasses.replace(NEMA23, detent_torque_nm=0.0)
LOSSLESS = dataclasses.replace(NEMA23, iron_loss_ohm=math.inf)
RADIUS_M = 5e-3 / (2 * math.pi)
FULL_STEP_RAD = 2 * math.pi / 200
PLAY_FREE = Screw(inertia_kgm2=3.1e-5, coulomb_nm=0.1, stiffness_n_per_m=3e7, damping_n_s_per_m=500.0)


# Friction ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("share", "moves"), [(-1.02, True), (-0.98, False), (0.5, False), (0.98, False), (1.02, True)])
def test_breakaway(share: float, moves: bool) -> None:
    """A limp shaft without detent turns when the load exceeds 1.3 times the friction in motion, and not before."""
    parameters = axis_parameters(NO_DETENT, Stage(48, 4.2), Screw(coulomb_nm=0.1, breakaway_ratio=1.3), DT)
    states = axis_states(1)
    for _ in range(1000):
        core.step_axis(parameters, states, 0.0, OPEN, 1.0, 0.0, 0.0, -share * 0.13)
    assert (states["omega_rad_s"][0] * math.copysign(1, share) > 0) == moves
    assert (states["theta_rad"][0] != 0.0) == moves


def test_nothing_creeps_at_rest() -> None:
    """Under half the breakaway torque for 10 s no bit of the state changes, and the drive knows it."""
    parameters = axis_parameters(NEMA23, Stage(48, 4.2), Screw(coulomb_nm=0.1), DT)
    states = axis_states(1)
    states["omega_rad_s"] = 5.0
    for _ in range(8000):
        core.step_axis(parameters, states, 3.0, BOTH, 1.0, 0.0, 0.0, 0.065)
    assert states["at_rest"][0]
    before = states.tobytes()
    for _ in range(8000):
        core.step_axis(parameters, states, 3.0, BOTH, 1.0, 0.0, 0.0, 0.065)
    assert states.tobytes() == before


def test_friction_stops_a_shaft_after_the_time_of_the_closed_form() -> None:
    """J dw/dt = -(T + B w): t = J/B ln(1 + B w/T), with iron loss (its knee far away) and viscous friction in B."""
    inertia, coulomb = 5.3e-5 + 4e-5, 0.08
    drag = 2e-4 + NO_DETENT.torque_constant_nm_per_a**2 / NO_DETENT.iron_loss_ohm
    motor = dataclasses.replace(NO_DETENT, iron_knee_rad_s=math.inf)
    screw = Screw(inertia_kgm2=4e-5, coulomb_nm=coulomb, breakaway_ratio=1.0, viscous_nm_s_per_rad=2e-4)
    parameters, states = axis_parameters(motor, Stage(48, 4.2), screw, DT), axis_states(1)
    states["omega_rad_s"] = 60.0
    steps = 0
    while states["omega_rad_s"][0] > 0.0:
        core.step_axis(parameters, states, 0.0, OPEN, 1.0, 0.0, 0.0, 0.0)
        steps += 1
    assert steps * DT == pytest.approx(inertia / drag * math.log(1 + drag * 60.0 / coulomb), rel=1e-3, abs=2 * DT)
    assert states["omega_rad_s"][0] == 0.0


@pytest.mark.parametrize("speed", [6.0, 60.0, 300.0])
def test_a_limp_rotor_feels_the_iron_drag_with_its_knee(speed: float) -> None:
    """Without current, detent and friction: J dw/dt = -(Km^2/Rm) w / (1 + (w/w_k)^2), stage on or off."""
    bare = dataclasses.replace(NO_DETENT, iron_loss_ohm=40.0, iron_knee_rad_s=60.0)
    parameters, states = axis_parameters(bare, Stage(48, 4.2), Screw(), DT), axis_states(1)
    states["omega_rad_s"] = speed
    core.step_axis(parameters, states, 0.0, OPEN, 1.0, 0.0, 0.0, 0.0)
    torque = (speed - states["omega_rad_s"][0]) / DT * bare.rotor_inertia_kgm2
    km = 2.40 / (math.sqrt(2) * 4.0)
    assert torque == pytest.approx(km**2 / 40.0 * speed / (1 + (speed / 60.0) ** 2), rel=2e-3)


def damped(gain: float, microsteps: int = 8) -> Stage:
    return Stage(supply_v=48, current_a=4.2, microsteps=microsteps, damping_gain=gain)


def swing_after_a_kick(gain: float, microsteps: int) -> float:
    """Peak to peak angle of a standing rotor from 30 to 60 ms after a kick of 3 rad/s."""
    motor = dataclasses.replace(NO_DETENT, iron_loss_ohm=math.inf)
    parameters, states = axis_parameters(motor, damped(gain, microsteps), Screw(), DT), axis_states(1)
    for _ in range(2000):
        core.step_axis(parameters, states, 0.0, BOTH, 1.0, 0.0, 0.0, 0.0)
    states["omega_rad_s"] += 3.0
    angles = []
    for k in range(2400):
        core.step_axis(parameters, states, 0.0, BOTH, 1.0, 0.0, 0.0, 0.0)
        if k >= 1200:
            angles.append(states["theta_rad"][0])
    return float(np.ptp(angles))


def test_electronic_damping_quiets_a_rotor_and_leaves_it_where_it_stood() -> None:
    assert swing_after_a_kick(2.0, 8) < 0.02 * swing_after_a_kick(0.0, 8)


def test_electronic_damping_smooths_its_pulses_at_five_times_its_corner() -> None:
    """A low pass of f goes 1 - exp(-2 pi f dt) of the way in dt; drives/9."""
    stage = dataclasses.replace(damped(2.0), damping_corner_hz=300.0)
    share = axis_parameters(NO_DETENT, stage, Screw(), 25e-6)["smooth_share"][0]
    assert share == pytest.approx(1.0 - math.exp(-2.0 * math.pi * 1500.0 * 25e-6))


@pytest.mark.parametrize("microsteps", [1, 2])
def test_there_is_no_electronic_damping_in_half_and_full_step(microsteps: int) -> None:
    assert swing_after_a_kick(2.0, microsteps) == swing_after_a_kick(0.0, microsteps)


def test_a_damped_drive_comes_to_rest_bit_for_bit() -> None:
    """The low pass meets the load angle for good; a stage switched off meanwhile does not remember where it was."""
    parameters, states = axis_parameters(NEMA23, damped(2.0), Screw(coulomb_nm=0.1), DT), axis_states(1)
    states["omega_rad_s"] = 5.0
    for phases in (BOTH, OPEN, BOTH):
        for _ in range(8000):
            core.step_axis(parameters, states, 3.0, phases, 1.0, 0.0, 0.0, 0.065)
        assert states["at_rest"][0]
        before = states.tobytes()
        core.step_axis(parameters, states, 3.0, phases, 1.0, 0.0, 0.0, 0.065)
        assert states.tobytes() == before


def test_friction_at_rest_is_higher_than_in_motion() -> None:
    """A load between the two lets a standing shaft stand and a turning one turn on."""
    motor = dataclasses.replace(NO_DETENT, iron_loss_ohm=48.0, iron_knee_rad_s=math.inf)
    parameters = axis_parameters(motor, Stage(48, 4.2), Screw(coulomb_nm=0.1, breakaway_ratio=1.5), DT)
    standing, turning = axis_states(1), axis_states(1)
    turning["omega_rad_s"] = 20.0
    for _ in range(4000):
        for states in (standing, turning):
            core.step_axis(parameters, states, 0.0, OPEN, 1.0, 0.0, 0.0, -0.14)
    assert standing["theta_rad"][0] == 0.0
    # In motion the load of 0.14 Nm leaves 0.04 Nm for the iron drag: w = 0.04 / 3.75e-3.
    drag = NO_DETENT.torque_constant_nm_per_a**2 / 48.0
    assert turning["omega_rad_s"][0] == pytest.approx(0.04 / drag, rel=0.1)


# Nut -----------------------------------------------------------------------------------------------------------------


def test_a_held_screw_gives_by_its_stiffness() -> None:
    """1000 N on 30 N/um: 33.3 um, beyond what the held rotor gives way."""
    rig = Rig(PLAY_FREE)
    end = rig.run(1.0, phases=BOTH, push_n=1000.0)
    give_m = end.x_m[-1] - end.theta_rad[-1] * RADIUS_M
    assert give_m == pytest.approx(1000.0 / 3e7, rel=1e-3)
    assert end.force_n[-1] == pytest.approx(-1000.0, rel=1e-3)


@pytest.mark.parametrize("backlash_mm", [0.02, 0.05])
def test_backlash_is_the_free_travel_of_a_carriage_on_a_held_screw(backlash_mm: float) -> None:
    rig = Rig(dataclasses.replace(PLAY_FREE, backlash_mm=backlash_mm, damping_n_s_per_m=1e4))
    right = rig.run(1.0, phases=BOTH, push_n=20.0)
    left = rig.run(1.0, phases=BOTH, push_n=-20.0)
    travel_mm = 1e3 * (right.x_m[-1] - left.x_m[-1])
    assert travel_mm == pytest.approx(backlash_mm + 1e3 * 2 * 20.0 / 3e7, abs=1e-3)


def test_within_the_backlash_there_is_no_force() -> None:
    rig = Rig(dataclasses.replace(PLAY_FREE, backlash_mm=0.1))
    rig.v_m_s = 1e-3
    free = rig.run(0.045, phases=BOTH)
    assert np.all(free.force_n == 0.0)
    assert free.v_m_s[-1] == 1e-3


def test_a_nut_with_play_never_pulls() -> None:
    """The damper acts on contact only: the force has the sign of the overlap."""
    rig = Rig(dataclasses.replace(PLAY_FREE, backlash_mm=0.02, damping_n_s_per_m=2e4))
    rig.v_m_s = 0.02
    ride = rig.run(0.5, phases=BOTH)
    overlap = ride.x_m - ride.theta_rad * RADIUS_M
    assert np.any(ride.force_n != 0.0)
    assert np.all(ride.force_n * overlap <= 0.0)


def test_lead_error_stretches_the_travel() -> None:
    """0.046 % on ten revolutions of 5 mm: 23 um."""
    command = mean_command(trapezoid(16_000, 300, 8000, 100e3))
    ends = [
        Rig(dataclasses.replace(PLAY_FREE, lead_error=error)).follow(command, phases=BOTH).x_m[-1]
        for error in (0.0, 0.00046)
    ]
    assert ends[0] == pytest.approx(0.050, abs=5e-6)
    assert ends[1] - ends[0] == pytest.approx(0.00046 * 0.050, rel=1e-2)


@pytest.mark.parametrize(("direction", "share"), [(1, 1 / 0.8), (-1, 2 - 1 / 0.8)], ids=["raising", "letting down"])
def test_a_load_on_the_nut_meets_the_efficiency_of_the_screw(direction: int, share: float) -> None:
    """500 N against or with the motion take F r / efficiency or F r * backdrive_efficiency: read off the load angle."""
    screw = Screw(inertia_kgm2=3.1e-5, stiffness_n_per_m=3e7, damping_n_s_per_m=5000.0, efficiency=0.8)
    rig = Rig(screw, motor=dataclasses.replace(NO_DETENT, iron_loss_ohm=math.inf))
    rig.run(0.5, phases=BOTH, push_n=-500.0)
    command = direction * mean_command(2000.0 * np.arange(0, 1.0, DT))
    turning = rig.follow(command, phases=BOTH, push_n=-500.0)
    half = len(command) // 2
    lag = command[half:] / 8 * FULL_STEP_RAD - turning.theta_rad[half:]
    torque_nm = NEMA23.torque_constant_nm_per_a * 4.2 * np.sin(50 * lag).mean()
    assert turning.force_n[half:].mean() == pytest.approx(500.0, rel=0.01)
    assert torque_nm == pytest.approx(share * 500.0 * RADIUS_M, abs=0.015)


# Without current -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("push_n", "moves"), [(60.0, False), (400.0, True)])
def test_a_limp_axis_can_be_pushed_by_hand(push_n: float, moves: bool) -> None:
    """Detent 0.06 Nm and breakaway 0.13 Nm hold 5 mm lead against 0.19 Nm / r, about 240 N, but not 400 N."""
    travelled = Rig(PLAY_FREE).run(0.5, push_n=push_n).x_m[-1]
    assert (travelled > 1e-3) == moves


def test_a_self_locking_screw_cannot_be_pushed() -> None:
    rig = Rig(dataclasses.replace(PLAY_FREE, efficiency=0.4, backdrive_efficiency=-0.5))
    pushed = rig.run(0.5, push_n=3000.0)
    assert abs(pushed.theta_rad[-1]) < FULL_STEP_RAD


def test_a_limp_rotor_falls_into_a_detent_position() -> None:
    """Detent positions are one full step apart; a microstep in between lets go to one side."""
    parameters = axis_parameters(NEMA23, Stage(48, 4.2, microsteps=8), Screw(coulomb_nm=0.001), DT)
    for command in (3.0, 5.0, 11.0, 13.0):
        states = axis_states(1)
        for phases in (BOTH, OPEN):
            for _ in range(20_000):
                core.step_axis(parameters, states, command, phases, 1.0, 0.0, 0.0, 0.0)
        full_steps = states["theta_rad"][0] / FULL_STEP_RAD
        assert full_steps == pytest.approx(round(command / 8), abs=0.02)
        assert states["at_rest"][0]


@pytest.mark.parametrize(("turned", "settles"), [(0.3, 0), (1.7, 0), (2.3, 4), (5.4, 4), (-3.0, -4), (6.2, 8)])
def test_power_on_pulls_a_moved_rotor_to_the_nearest_phase(turned: float, settles: int) -> None:
    """Up to two full steps it comes back; beyond, it falls into the next position four full steps on."""
    parameters = axis_parameters(NEMA23, Stage(48, 4.2), Screw(coulomb_nm=0.05), DT)
    states = axis_states(1)
    states["theta_rad"] = turned * FULL_STEP_RAD
    for _ in range(20_000):
        core.step_axis(parameters, states, 0.0, BOTH, 1.0, 0.0, 0.0, 0.0)
    assert states["theta_rad"][0] / FULL_STEP_RAD == pytest.approx(settles, abs=0.05)


@pytest.mark.parametrize(("phases", "lives", "dead"), [(PHASE_A, "a", "b"), (PHASE_B, "b", "a")])
def test_a_broken_phase_carries_no_current(phases: int, lives: str, dead: str) -> None:
    parameters, states = axis_parameters(NEMA23, Stage(48, 4.2), Screw(coulomb_nm=0.05), DT), axis_states(1)
    for _ in range(2000):
        core.step_axis(parameters, states, 4.0, phases, 1.0, 0.0, 0.0, 0.0)
    assert states[f"current_{dead}_a"][0] == 0.0
    assert states[f"current_{lives}_a"][0] == pytest.approx(4.2 * math.sqrt(0.5))


# Currents ------------------------------------------------------------------------------------------------------------


def test_current_rises_as_the_supply_and_the_inductance_allow() -> None:
    """(V/R)(1 - exp(-R t/L)) on a locked shaft, up to the set current and no further."""
    stage = Stage(supply_v=36, current_a=4.2, microsteps=8)
    parameters = axis_parameters(NEMA23, stage, Screw(coulomb_nm=5.0), DT)
    states = axis_states(1)
    resistance, voltage = 0.65 + stage.extra_resistance_ohm, 36 * stage.supply_factor
    for k in range(1, 60):
        core.step_axis(parameters, states, 0.0, BOTH, 1.0, 0.0, 0.0, 0.0)
        free = voltage / resistance * (1 - math.exp(-resistance * k * DT / 3.2e-3))
        assert states["current_a_a"][0] == pytest.approx(min(4.2, free), rel=1e-9)
        assert states["current_b_a"][0] == 0.0


@pytest.mark.parametrize(
    ("microsteps", "wave"),
    [
        (1, [(1, 1), (-1, 1), (-1, -1), (1, -1)]),
        (2, [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]),
        (4, [(math.cos(k * math.pi / 8), math.sin(k * math.pi / 8)) for k in range(16)]),
    ],
)
def test_current_wave_of_the_stage(microsteps: int, wave: list[tuple[float, float]]) -> None:
    parameters = axis_parameters(NEMA23, Stage(48, 4.2, microsteps), Screw(coulomb_nm=5.0), DT)
    states = axis_states(1)
    for turn in (0, 3, -2):
        for k, (a, b) in enumerate(wave):
            for _ in range(200):
                core.step_axis(parameters, states, float(turn * len(wave) + k), BOTH, 0.5, 0.0, 0.0, 0.0)
            assert states["current_a_a"][0] == pytest.approx(0.5 * 4.2 * a, abs=1e-9)
            assert states["current_b_a"][0] == pytest.approx(0.5 * 4.2 * b, abs=1e-9)


@pytest.mark.parametrize("microsteps", [1, 2, 8])
def test_the_rotor_stands_where_the_counter_says_in_every_mode(microsteps: int) -> None:
    parameters = axis_parameters(NO_DETENT, Stage(48, 4.2, microsteps), Screw(coulomb_nm=0.001), DT)
    states = axis_states(1)
    for full_step in range(-2, 3):
        states["theta_rad"] = (full_step + 0.4) * FULL_STEP_RAD
        for _ in range(20_000):
            core.step_axis(parameters, states, float(full_step * microsteps), BOTH, 1.0, 0.0, 0.0, 0.0)
        assert states["theta_rad"][0] / FULL_STEP_RAD == pytest.approx(full_step, abs=0.002)


# Energy and numbers --------------------------------------------------------------------------------------------------

SCREWS = st.builds(
    Screw,
    inertia_kgm2=st.floats(0, 1e-4),
    coulomb_nm=st.floats(0, 0.3),
    breakaway_ratio=st.floats(1, 2),
    viscous_nm_s_per_rad=st.floats(0, 1e-3),
    lead_mm=st.floats(2, 10),
    efficiency=st.floats(0.3, 1.0),
    backlash_mm=st.sampled_from([0.0, 0.01, 0.05]),
    stiffness_n_per_m=st.sampled_from([0.0, 1e6, 3e7]),
    damping_n_s_per_m=st.floats(0, 3000),
)


@given(SCREWS, st.floats(2, 50), st.floats(-60, 60), st.floats(-0.1, 0.1), st.floats(-400, 400))
@settings(max_examples=drawn(60), deadline=None)
def test_a_drive_without_current_never_gains_energy(
    screw: Screw, mass_kg: float, omega: float, v_m_s: float, push_n: float
) -> None:
    """Rotor, detent, nut spring, carriage and the potential of the pull together, at every sub-step.

    The integrator lets the sum breathe by its own order, (w dt)^2 of what goes to and fro; and contact begins and ends
    somewhere within a sub-step, which is worth the spring energy of the way made in it.
    """
    rig = Rig(screw, mass_kg)
    rig.state["omega_rad_s"] = omega
    rig.v_m_s = v_m_s
    inertia = NEMA23.rotor_inertia_kgm2 + screw.inertia_kgm2
    spring = screw.stiffness_n_per_m * (1 / mass_kg + screw.travel_m_per_rad**2 / inertia)
    breath = 0.5 * DT**2 * (spring + 4 * 50 * 0.06 / inertia)
    start_j = rigs.stored_energy_j(rig.parameters, rig.state, 0.0) + 0.5 * mass_kg * v_m_s**2
    ride = rig.run(0.25, push_n=push_n)
    way_m = DT * np.max(np.abs(ride.v_m_s) + screw.travel_m_per_rad * np.abs(ride.omega_rad_s))
    touch_j = 2 * screw.stiffness_n_per_m * way_m**2 if screw.backlash_mm else 0.0
    turnover_j = start_j + np.max(np.abs(push_n * ride.x_m)) + 1e-9
    energy = np.concatenate([[start_j], ride.energy_j])
    assert np.max(energy - np.minimum.accumulate(energy)) <= breath * turnover_j + touch_j


def test_without_any_loss_the_energy_stays_for_ever() -> None:
    """80 000 sub-steps of detent, spring and play against each other: no drift either way."""
    screw = Screw(inertia_kgm2=3.1e-5, stiffness_n_per_m=3e7, backlash_mm=0.02, efficiency=1.0)
    rig = Rig(screw, 20.0, motor=LOSSLESS)
    rig.state["omega_rad_s"] = 10.0
    energy = rig.run(2.0).energy_j
    assert energy == pytest.approx(0.5 * (5.3e-5 + 3.1e-5) * 10.0**2, rel=1e-3)


@given(
    st.integers(0, 3),
    st.floats(-1e7, 1e7),
    st.floats(-1e6, 1e6),
    st.floats(-1e5, 1e5),
    st.floats(-1, 1),
    st.floats(-100, 100),
    st.floats(-1e3, 1e3),
)
@settings(max_examples=drawn(100), deadline=None)
def test_finite_arguments_give_finite_results(
    phases: int, command: float, theta: float, omega: float, x_m: float, v_m_s: float, load_nm: float
) -> None:
    parameters, states = axis_parameters(NEMA23, Stage(48, 4.2), PLAY_FREE, DT), axis_states(1)
    states["theta_rad"], states["omega_rad_s"] = theta, omega
    for _ in range(5):
        core.step_axis(parameters, states, command, phases, 1.0, x_m, v_m_s, load_nm)
    assert all(np.isfinite(states[name][0]) for name in AXIS_STATE.names)


def test_same_arguments_same_bits() -> None:
    runs = []
    for _ in range(2):
        rig = Rig(PLAY_FREE)
        rig.run(0.1, command=37.5, phases=BOTH, push_n=100.0)
        runs.append(rig.state.tobytes())
    assert runs[0] == runs[1]


def test_a_sub_step_too_long_for_the_spring_is_refused() -> None:
    with pytest.raises(ValueError, match="too long"):
        axis_parameters(NEMA23, Stage(48, 4.2), Screw(lead_mm=40, stiffness_n_per_m=2e8), 4 * DT)
    with pytest.raises(ValueError, match="sub-step"):
        axis_parameters(NEMA23, Stage(48, 4.2), Screw(), 0.0)
