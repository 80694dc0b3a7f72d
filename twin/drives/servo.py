"""One servo drive, one sub-step: from the command in increments to the force on the nut.

The mechanics are the stepper's (shaft.py); the drive closes its own loops:

    e     = command - shift - floor(th increments_per_rev / 2 pi)            following error, in every sub-step
    w_ref = (Kv e + Kff d command/dt) 2 pi / increments_per_rev             every loop period, as e
    i_ref = clip(Kp (w_ref - w + z), -I, I)       z' = z + (T_s / Ti) (w_ref - w), held while clipped
    v     = clip((i_ref - E i) / A + K w, -U, U)   i' = E i + A (v - K w)   E = exp(-R dt/L), A = (1 - E)/R
    T     = K (i + i')/2
    q'    = q + (1 - exp(-dt/tau)) ((i'/I_rated)^2 - q)                      I2t; I: peak, rated while overloaded

        command --(-)--> e --Kv--> w_ref --(-)--> PI --i_ref--> [current in one sub-step, |v| <= U] --K--> shaft
                   '--------- encoder -----'----- w -----'

The command is its time mean over the sub-step; the plant interpolates it between set points, as a drive does that gets
one every few milliseconds. Kp = J w_v / K and Ti = ratio / w_v, J: all that turns. The speed is the shaft's, as from an
observer: differences of encoder counts would be coarse at this rate.

When switched on, a drive stays where it is and stores the difference to its command (`shift`, plant/15). |e| beyond the
limit is a fault: no current from that sub-step on, until it is cleared (`forget`) and the drive is on again. A motor
with a broken cable has no current, but the drive does not notice. At rest with e = 0 nothing changes and time may be
skipped; `cool` then advances the I2t.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.compiling import contains, njit
from isel_twin.drives import dynamics, servo_drive, shaft
from isel_twin.drives.dynamics import OPEN
from isel_twin.drives.screw import Screw
from isel_twin.drives.servo_drive import I2T_BACK, ServoDrive, ServoMotor
from isel_twin.drives.shaft import AXIS_PARAMETERS, SERVO, lay_shaft, turn

LAG_FAULT = 1  # `fault`: the following error has passed its limit
VOLTAGE_FAULT = 2  # `fault`: the common supply had too little voltage while the drive was on
CAUSES: Mapping[int, str] = {0: "", LAG_FAULT: "following error exceeded", VOLTAGE_FAULT: "too little supply voltage"}


def servo_parameters(
    motor: ServoMotor, drive: ServoDrive, screw: Screw, dt_s: float, stiffness_n_per_m: float | None = None
) -> NDArray[np.void]:
    """Constants of a servo drive: one record of AXIS_PARAMETERS, shape [1]; arguments: `axis_parameters`. Raises
    ValueError if the sub-step dt_s is too long for the nut spring, or the loop period is not whole sub-steps."""
    p = np.zeros(1, AXIS_PARAMETERS)
    lay_shaft(p, screw, motor.rotor_inertia_kgm2, dt_s, stiffness_n_per_m)
    loop = round(drive.loop_period_s / dt_s)
    if loop < 1 or abs(loop * dt_s - drive.loop_period_s) > 1e-9 * drive.loop_period_s:
        raise ValueError(
            f"servo: loop_period {drive.loop_period_s * 1e6:g} us; "
            f"allowed: whole multiples of motor_substep, {dt_s * 1e6:g} us"
        )
    resistance = motor.resistance_ohm + drive.extra_resistance_ohm
    gain = -math.expm1(-resistance * dt_s / motor.inductance_h) / resistance
    rad = 2.0 * math.pi / drive.increments_per_rev
    p["kind"] = SERVO
    p["pole_pairs"] = 1.0
    p["drive_v"] = p["return_v"] = drive.drive_v
    p["decay"] = math.exp(-resistance * dt_s / motor.inductance_h)
    p["gain_a_per_v"] = gain
    p["gain_v_per_a"] = 1.0 / gain
    p["torque_constant_nm_per_a"] = motor.torque_constant_nm_per_a
    p["increments_per_rad"] = 1.0 / rad
    p["loop_substeps"] = loop
    p["position_gain_rad_s"] = drive.position_gain_per_s * rad
    p["forward_rad_s"] = drive.feed_forward * rad / drive.loop_period_s
    p["speed_gain_a_s"] = p["inertia_kgm2"] * drive.speed_bandwidth_rad_s / motor.torque_constant_nm_per_a
    p["integral_share"] = drive.loop_period_s / drive.reset_s
    p["peak_a"] = drive.peak_current_a
    p["rated_a"] = motor.rated_current_a
    p["lag_limit"] = drive.lag_limit
    p["window"] = drive.window
    p["window_substeps"] = max(1, round(drive.window_time_s / dt_s))
    p["heat_share"] = -math.expm1(-dt_s / drive.i2t_time_constant_s)
    p["connected"] = 1
    return p


@njit(inner=True, error_model="numpy")
def _off(s):
    """Open the loops; latched faults stay."""
    s.on = 0
    s.wanted_a = 0.0
    s.integral_rad_s = 0.0
    s.voltage_v = 0.0
    s.arrived = 0


@njit(inner=True, error_model="numpy")
def fail(s, cause):
    s.fault = cause
    s.cause = cause
    s.faults += 1
    _off(s)


@njit(error_model="numpy")
def step_servo(p, s, command, phases, current_fraction, nut_position_m, nut_velocity_m_s, load_torque_nm):
    """As `step_axis`, for a servo drive: command in increments, phases OPEN or not; current_fraction is not used.

    Finite arguments give finite results. With phases OPEN, or a fault, it never adds energy.
    """
    torque, drag, steady = servo_torque(p, s, command, phases)
    return turn(p, s, torque - load_torque_nm, drag, nut_position_m, nut_velocity_m_s, steady)


@njit(inner=True, error_model="numpy", forceinline=True)
def servo_torque(p, s, command, phases):
    """The motor's part of `step_servo`, as `turn` takes it: torque, drag, steady."""
    omega = s.omega_rad_s
    encoder = math.floor(s.theta_rad * p.increments_per_rad)
    steady = True
    before_a = s.current_a_a
    current_a = 0.0
    s.due -= 1
    sample = s.due <= 0
    if sample:
        s.due = p.loop_substeps
    if phases == OPEN or s.fault != 0:
        steady = before_a == 0.0
        _off(s)
    else:
        if s.on == 0:
            s.on = 1
            s.shift = command - encoder
            s.sampled = command
        error = command - s.shift - encoder
        s.error = error
        if abs(error) > p.lag_limit:
            fail(s, LAG_FAULT)
        else:
            s.arrived = min(s.arrived + 1, p.window_substeps) if abs(error) <= p.window else 0
            if sample:
                went = command - s.sampled
                s.sampled = command
                wanted_rad_s = p.position_gain_rad_s * error + p.forward_rad_s * went
                slow = wanted_rad_s - omega
                wanted_a = p.speed_gain_a_s * (slow + s.integral_rad_s)
                most_a = p.rated_a if s.overloaded != 0 else p.peak_a
                if wanted_a > most_a:
                    wanted_a = most_a
                elif wanted_a < -most_a:
                    wanted_a = -most_a
                else:
                    s.integral_rad_s += p.integral_share * slow
                steady = wanted_a == s.wanted_a
                s.wanted_a = wanted_a
            if p.connected != 0:
                emf_v = p.torque_constant_nm_per_a * omega
                kept_a = p.decay * before_a
                voltage_v = (s.wanted_a - kept_a) * p.gain_v_per_a + emf_v
                current_a = s.wanted_a
                if abs(voltage_v) > p.drive_v:
                    voltage_v = math.copysign(p.drive_v, voltage_v)
                    current_a = kept_a + p.gain_a_per_v * (voltage_v - emf_v)
                s.voltage_v = voltage_v
            here = error == 0.0 and command == s.sampled and s.arrived == p.window_substeps
            steady = steady and here and current_a == before_a and abs(current_a) <= p.rated_a
    mean_a = 0.5 * (before_a + current_a) if s.on != 0 else 0.0
    s.current_a_a = current_a
    ratio = current_a / p.rated_a
    s.heat += p.heat_share * (ratio * ratio - s.heat)
    if s.heat > 1.0:
        s.overloaded = 1
    elif s.heat < I2T_BACK:
        s.overloaded = 0
    steady = steady and s.overloaded == 0
    s.torque_nm = p.torque_constant_nm_per_a * mean_a
    return s.torque_nm, p.drag_nm_s_per_rad, steady


@njit(error_model="numpy")
def cool(p, s, substeps):
    """I2t after sub-steps in which nothing else has changed (exact solution); s is unchanged."""
    ratio = s.current_a_a / p.rated_a
    left = math.exp(substeps * math.log1p(-p.heat_share))
    return ratio * ratio + left * (s.heat - ratio * ratio)


@njit(error_model="numpy")
def forget(s):
    """Clear the fault; if its stage is on, the drive works again from the next sub-step (plant/16)."""
    s.fault = 0


contains(__name__, dynamics.__file__, servo_drive.__file__, shaft.__file__)
