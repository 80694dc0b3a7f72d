"""The constants of a servo drive and its faults. The law of its sub-step is in servo.h."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.screw import Screw
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.shaft import AXIS_PARAMETERS, SERVO, lay_shaft

LAG_FAULT = 1  # `fault`: the following error has passed its limit
VOLTAGE_FAULT = 2  # `fault`: the common supply had too little voltage while the drive was on
IN_C = ("LAG_FAULT", "VOLTAGE_FAULT")  # records.h has them, too
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


def forget(states: NDArray[np.void]) -> None:
    """Clear the faults; a drive whose stage is on works again from the next sub-step (plant/16)."""
    states["fault"] = 0
