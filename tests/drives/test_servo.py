"""The servo drive alone: against closed forms of its cascade, against MuJoCo's own motor, and at its limits.

Closed form, with all of it continuous and nothing at a limit (th, w of the shaft, J its inertia):

    J th'' = K i - T        K i = J w_v (1 + 1/(T_i s)) (Kv (r - th) - s th)

    th / r = w_v Kv (T_i s + 1) / D        th / T = -(T_i s / J) / D
    D = T_i s^3 + w_v T_i s^2 + w_v (1 + Kv T_i) s + w_v Kv
"""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from drives.axis import rigs
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.cli.motor import motor as motor_command
from isel_twin.drives.screw import Screw
from isel_twin.drives.servo import LAG_FAULT, forget, servo_parameters
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.servo_report import servo_table
from isel_twin.drives.shaft import axis_states
from isel_twin.machine import load_machine
from isel_twin.native import core
from tests.thorough import drawn

DT = 25e-6
ON, OFF = 3, 0
MOTOR = ServoMotor(0.8, 1.5e-3, 0.1, 4e-5, 4.0)
DRIVE = ServoDrive(
    60.0, 12.0, 5000, 40.0, 0.0, 2 * math.pi * 50, 4.0, 250e-6, 4000, 10, 20e-3, 4.0, rated_current_a=4.0
)
FINE = replace(DRIVE, increments_per_rev=5_000_000, lag_limit=4e6)
"""With an encoder whose increments do not show."""
RAD = 2 * math.pi / FINE.increments_per_rev


class Rotor:
    """A drive with its motor and nothing on the shaft, or what a screw puts there."""

    def __init__(self, drive: ServoDrive = DRIVE, screw: Screw = Screw(), dt_s: float = DT) -> None:  # noqa: B008
        self.p, self.s, self.dt_s = servo_parameters(MOTOR, drive, screw, dt_s), axis_states(1), dt_s

    def follow(self, commands, load_nm=0.0, phases: int = ON) -> NDArray[np.float64]:
        """float64 [n, 6]: angle, speed, current, voltage, error, heat after each sub-step."""
        commands = np.asarray(commands, dtype=np.float64)
        seen = np.zeros((len(commands), 6))
        loads = np.broadcast_to(np.asarray(load_nm, float), len(commands)).copy()
        rigs.ride(self.p, self.s, commands, phases, loads, seen)
        return seen

    def stay(self, seconds: float, command: float = 0.0, **others) -> NDArray[np.float64]:
        return self.follow(np.full(round(seconds / self.dt_s), command), **others)


def step_of_cascade(numerator: list[float], samples: int) -> NDArray[np.float64]:
    """float64 [samples], from a step on."""
    from scipy import signal  # half a second, for this file alone

    w_v, kv = DRIVE.speed_bandwidth_rad_s, DRIVE.position_gain_per_s
    reset_s = DRIVE.integral_ratio / w_v
    made = signal.TransferFunction(numerator, [reset_s, w_v * reset_s, w_v * (1 + kv * reset_s), w_v * kv])
    return signal.step(made, T=DT * np.arange(samples))[1]


DAMPING = 0.5 * 0.8 * math.sqrt(4e-5 / 1.5e-3) / 0.1
"""Of the motor alone, winding and rotor, on a constant voltage: R/2 sqrt(J/L) / K."""
RESET_S = DRIVE.integral_ratio / DRIVE.speed_bandwidth_rad_s


# Linear ---------------------------------------------------------------------------------------------------------------


def test_a_step_of_the_command_is_answered_as_the_linear_cascade_does():
    """The closed form knows neither of the time between samples nor of the one in which the current comes."""
    rotor = Rotor(FINE)
    rotor.stay(0.01)
    step = 0.1
    seen = rotor.stay(0.3, step / RAD)
    w_v, kv = DRIVE.speed_bandwidth_rad_s, DRIVE.position_gain_per_s
    exact = step_of_cascade([w_v * kv * RESET_S, w_v * kv], len(seen) + 1)
    assert np.abs(seen[:, 2]).max() < 12.0
    assert np.abs(seen[:, 3]).max() < 60.0
    assert np.abs(seen[:, 0] - step * exact[1:]).max() < 0.05 * step


def test_a_step_of_the_load_is_answered_as_the_linear_cascade_does():
    rotor = Rotor(FINE)
    rotor.stay(0.01)
    load_nm = 0.4
    seen = rotor.stay(0.4, load_nm=load_nm)
    exact = step_of_cascade([-RESET_S / MOTOR.rotor_inertia_kgm2, 0.0], len(seen) + 1)
    assert np.abs(seen[:, 2]).max() < 12.0
    assert np.abs(seen[:, 3]).max() < 60.0
    assert np.abs(seen[:, 0] - load_nm * exact[1:]).max() < 0.05 * load_nm * np.abs(exact).max()


def test_at_constant_speed_it_lags_by_speed_over_gain_and_with_feed_forward_by_nothing():
    speed = 200_000_000.0 / 1000  # increments/s of FINE: 0.25 rad/s
    commands = speed * DT * np.arange(round(0.8 / DT))
    assert Rotor(FINE).follow(commands)[-1, 4] == pytest.approx(speed / DRIVE.position_gain_per_s, rel=0.002)
    ahead = Rotor(replace(FINE, feed_forward=1.0)).follow(commands)[-1, 4]
    assert abs(ahead) < 0.02 * speed / DRIVE.position_gain_per_s


# An independent motor -------------------------------------------------------------------------------------------------

DC_MOTOR = """
<mujoco>
  <option timestep="2.5e-6" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="shaft" type="hinge" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="4e-5 4e-5 4e-5"/>
    </body>
  </worldbody>
  <actuator><dcmotor joint="shaft" motorconst="0.1" resistance="0.8" inductance="1.5e-3"/></actuator>
</mujoco>
"""


def test_motor_current_and_speed_are_those_of_mujocos_own_motor():
    """The voltage that the drive puts to its free motor in a move, put to MuJoCo's: ten steps of it to a sub-step."""
    t = DT * np.arange(round(0.12 / DT))
    seen = Rotor(replace(DRIVE, lag_limit=1e9)).follow(np.round(8000 * np.sin(2 * math.pi * 25 * t)))
    model = mujoco.MjModel.from_xml_string(DC_MOTOR)
    data = mujoco.MjData(model)
    theirs = np.zeros((len(t), 2))
    for k, voltage_v in enumerate(seen[:, 3]):
        data.ctrl[0] = voltage_v
        for _ in range(10):
            mujoco.mj_step(model, data)
        theirs[k] = data.qvel[0], data.act[0]
    assert np.abs(seen[:, 3]).max() == 60.0, "it has been at its voltage limit"
    assert np.abs(seen[:, 2]).max() == 12.0, "and at its current limit"
    assert np.abs(seen[:, 1] - theirs[:, 0]).max() < 0.01 * np.abs(theirs[:, 0]).max()
    assert np.abs(seen[:, 2] - theirs[:, 1]).max() < 0.02 * np.abs(theirs[:, 1]).max()


# Limits ---------------------------------------------------------------------------------------------------------------


def test_current_and_voltage_stay_within_their_limits():
    rotor = Rotor(replace(DRIVE, lag_limit=1e9))
    rotor.stay(0.01)
    seen = rotor.stay(0.4, 100_000.0)
    assert np.abs(seen[:, 2]).max() == 12.0
    assert np.abs(seen[:, 3]).max() == 60.0
    overshoot = math.exp(-math.pi * DAMPING / math.sqrt(1 - DAMPING**2))
    assert 600.0 < np.abs(seen[:, 1]).max() <= 600.0 * (1 + overshoot), "back-EMF uses up the voltage: 60 V / 0.1 V s"


def test_without_voltage_to_drive_it_the_current_rises_by_the_time_constant_of_the_winding():
    """L di/dt = U - R i: at 60 V and standstill 12 A after -L/R ln(1 - 12 R/U) = 0.33 ms."""
    blocked = Screw(coulomb_nm=5.0)
    seen = (rotor := Rotor(replace(DRIVE, lag_limit=1e9), blocked)).stay(0.01)
    seen = rotor.stay(0.002, 100_000.0)
    full = -1.5e-3 / 0.8 * math.log(1 - 12 * 0.8 / 60)
    began = int(np.argmax(seen[:, 3] > 0))
    assert (int(np.argmax(seen[:, 2] == 12.0)) + 1 - began) * DT == pytest.approx(full, abs=1.01 * DT)


def test_i2t_holds_the_current_down_to_the_rated_one():
    """Blocked at 12 A, three times the rated current: (1 - e^(-t/4 s)) 9 = 1 at t = 4 ln(9/8) = 0.471 s."""
    rotor = Rotor(replace(DRIVE, lag_limit=1e9), Screw(coulomb_nm=5.0))
    rotor.stay(0.01)
    seen = rotor.stay(1.0, 100_000.0)
    began = int(np.argmax(seen[:, 2] == 12.0))
    held = np.flatnonzero((seen[:, 2] < 12.0) & (np.arange(len(seen)) > began))[0]
    assert (held - began) * DT == pytest.approx(4.0 * math.log(9 / 8), abs=0.002)
    assert seen[-1, 2] == 4.0
    assert rotor.s["overloaded"][0] == 1
    rotor.stay(2.0, phases=OFF)  # 4 ln(1/0.9) = 0.42 s and it is below nine tenths
    assert rotor.s["overloaded"][0] == 0


def test_what_i2t_becomes_in_a_rest_is_what_it_becomes_sub_step_by_sub_step():
    rotor = Rotor()
    rotor.s["heat"] = 0.7
    told = core.cooled(rotor.p, rotor.s, 80_000)
    rotor.stay(80_000 * DT)
    assert told == pytest.approx(0.7 * math.exp(-80_000 * DT / 4.0), rel=1e-9)
    assert rotor.s["heat"][0] == pytest.approx(told, rel=1e-9)


def steadiness(rotor: Rotor, command: float, substeps: int) -> list[bool]:
    """Whether each sub-step says that the ones behind it will be the same."""
    said = []
    for _ in range(substeps):
        said.append(bool(rigs.steady(rotor.p, rotor.s, command, ON)))
        rotor.stay(rotor.dt_s, command)
    return said


def test_it_says_that_nothing_will_change_at_rest_only():
    """At rest where it was told, in position: always, and nothing changes; with a step, or as long as I2t holds the
    current down: never."""
    rotor = Rotor()
    rotor.stay(0.1)
    before = rotor.s.copy()
    assert steadiness(rotor, 0.0, 40) == [True] * 40
    for name in before.dtype.names:
        assert name == "due" or np.array_equal(before[name], rotor.s[name], equal_nan=True), name
    rotor.s["overloaded"], rotor.s["heat"] = 1, 0.99
    assert steadiness(rotor, 0.0, 40) == [False] * 40
    rotor = Rotor()
    rotor.stay(0.1)
    rotor.stay(20 * rotor.dt_s, 1000.0)
    assert not any(steadiness(rotor, 1000.0, 200))


def test_beyond_its_following_error_it_is_off_in_that_very_sub_step():
    """4001 increments away at once: no current flows, not for one sub-step, and none until the fault is forgotten."""
    rotor = Rotor()
    rotor.stay(0.01)
    assert rotor.stay(0.01, 4000.0)[:, 2].any()
    assert rotor.s["fault"][0] == 0
    rotor = Rotor()
    rotor.stay(0.01)
    seen = rotor.stay(0.01, 4001.0)
    assert rotor.s["fault"][0] == LAG_FAULT
    assert not seen[:, 2].any()
    rotor.stay(0.01, phases=OFF)
    assert rotor.s["fault"][0] == LAG_FAULT
    forget(rotor.s)
    seen = rotor.stay(0.1, 4001.0)
    assert not seen.any(), "it stays where it stands and takes that for the place it is told"
    assert rotor.s["fault"][0] == 0


def test_the_current_that_flowed_makes_no_torque_in_the_sub_step_of_a_fault():
    rotor = Rotor()
    rotor.stay(0.01)
    assert rotor.stay(20 * DT, 4000.0)[-1, 2] > 1.0
    rotor.stay(DT, 9000.0)
    assert rotor.s["fault"][0] == LAG_FAULT
    assert rotor.s["torque_nm"][0] == 0.0


def test_switched_on_in_motion_it_brakes_and_stays_there():
    rotor = Rotor()
    rotor.s["omega_rad_s"] = 10.0
    rotor.stay(0.02, phases=OFF)
    at = rotor.s["theta_rad"][0]
    seen = rotor.stay(0.5, 123.0)
    assert abs(seen[-1, 0] - at) < 0.01
    assert abs(seen[-1, 1]) < 0.05


def test_a_broken_cable_carries_no_current_and_the_drive_learns_it_by_its_following_error():
    rotor = Rotor()
    rotor.p["connected"] = 0
    rotor.stay(0.01)
    seen = rotor.follow(np.arange(4400.0))
    assert not seen[:, 2].any()
    assert rotor.s["fault"][0] == LAG_FAULT


@given(
    st.floats(0, 1e-4), st.floats(0, 0.3), st.floats(0, 1e-3), st.sampled_from([0.0, 0.01, 0.05]),
    st.sampled_from([0.0, 1e6, 3e7]), st.floats(0, 3000), st.floats(2, 50), st.floats(-60, 60), st.floats(-400, 400),
    st.booleans(),
)  # fmt: skip
@settings(max_examples=drawn(40), deadline=None)
def test_a_drive_without_current_never_gains_energy(
    inertia, coulomb, viscous, backlash, stiffness, damping, mass_kg, omega, push_n, faulty
):
    """As for the stepper (test_dynamics.py), switched off or faulty; there is no detent in a servo motor."""
    screw = Screw(
        inertia_kgm2=inertia, coulomb_nm=coulomb, viscous_nm_s_per_rad=viscous, backlash_mm=backlash,
        stiffness_n_per_m=stiffness, damping_n_s_per_m=damping,
    )  # fmt: skip
    rotor = Rotor(screw=screw)
    rotor.s["omega_rad_s"] = omega
    rotor.s["fault"] = LAG_FAULT if faulty else 0
    total = MOTOR.rotor_inertia_kgm2 + inertia
    start_j = rigs.stored_energy_j(rotor.p, rotor.s, 0.0)
    record = np.zeros((round(0.25 / DT), 7))
    rigs.couple(rotor.p, rotor.s, np.zeros(len(record)), ON if faulty else OFF, mass_kg, push_n, 0.0, 0.0, record)
    fastest = max(abs(omega) * screw.travel_m_per_rad, abs(push_n) / mass_kg * 0.25) * 2.0
    breath = 0.5 * DT**2 * stiffness * (1 / mass_kg + screw.travel_m_per_rad**2 / total)
    touch_j = 2 * stiffness * (DT * fastest) ** 2 if backlash else 0.0
    turnover_j = start_j + abs(push_n) * fastest * 0.25 + 1e-9
    energy = np.concatenate([[start_j], record[:, 5]])
    rounding_j = 1e-12 * turnover_j
    assert np.max(energy - np.minimum.accumulate(energy)) <= breath * turnover_j + touch_j + rounding_j


def test_the_loops_are_sampled_on_their_own_grid():
    with pytest.raises(ValueError, match="loop_period 250 us; allowed: whole multiples of motor_substep, 40 us"):
        servo_parameters(MOTOR, DRIVE, Screw(), 40e-6)


def test_the_numbers_here_are_those_of_the_machine():
    axis = load_machine("4030-servo").axes[0]
    assert axis.motor == MOTOR
    assert axis.stage == DRIVE


def test_its_torque_curve_by_hand():
    """At 500 rad/s the back-EMF leaves 10 V: 12.5 A and so 12 A; at 550 rad/s 5 V: 6.25 A; at 590 rad/s 1 V: 1.25 A."""
    rpm = [w * 30 / math.pi for w in (0.0, 500.0, 550.0, 590.0, 600.0, 700.0)]
    table = servo_table(MOTOR, DRIVE, rpm)
    assert [point.peak_nm for point in table] == pytest.approx([1.2, 1.2, 0.625, 0.125, 0.0, 0.0], abs=1e-9)
    assert [point.rated_nm for point in table] == pytest.approx([0.4, 0.4, 0.4, 0.125, 0.0, 0.0], abs=1e-9)
    assert table[0].peak_band_nm == pytest.approx((0.92 * 1.2, 1.08 * 1.2)), "K as makers spread it"
    assert all(p.peak_band_nm[0] <= p.peak_nm <= p.peak_band_nm[1] for p in table)
    assert all(p.rated_band_nm[0] <= p.rated_nm <= p.rated_band_nm[1] < 0.44 for p in table)


def test_the_command_line_shows_an_axis(capsys):
    """Corners by hand: (60 - 0.8 x 12) / 0.1 = 504 rad/s, (60 - 0.8 x 4) / 0.1 = 568 rad/s; 4 s x ln(9/8) = 0.47 s."""
    assert motor_command("y", machine="4030-servo") == 0
    shown = capsys.readouterr().out
    assert "servo motor of 4030-servo, axis y at 60 V, 4 A, 12 A peak" in shown
    assert "1.200 (1.104 to 1.296)      0.400 (0.368 to 0.432)" in shown
    assert "peak torque up to 4813 rpm, for 0.47 s from cold; rated torque up to 5424 rpm" in shown
    assert "lags by 2500 increments at 100 mm/s; at its limit of 4000 at 160 mm/s" in shown
