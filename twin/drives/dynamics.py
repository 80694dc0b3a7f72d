"""The constants of a stepper drive, from motor, stage and screw. The law of its sub-step is in stepper.h."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import AXIS_PARAMETERS, STEPPER, lay_shaft
from isel_twin.drives.stage import Stage

OPEN = 0  # `phases`: both phases open, the motor is limp
PHASE_A = 1  # `phases`: phase A alone is connected (a broken wire in B)
PHASE_B = 2  # `phases`: phase B alone is connected (a broken wire in A)
BOTH = 3  # `phases`: the stage drives both phases
IN_C = ("OPEN", "PHASE_A", "PHASE_B", "BOTH")  # records.h has them, too
SMOOTHING = 5.0  # corner of the smoothed command over that of the damping, so that it does not amplify single pulses
_fields = AXIS_PARAMETERS.names or ()  # all have eight bytes
_MOTOR = slice(_fields.index("microstep_rad"), _fields.index("damping_share") + 1)
_ERRORS = slice(_fields.index("plain"), _fields.index("current_offset") + 1)


def axis_parameters(
    motor: Motor, stage: Stage, screw: Screw, dt_s: float, stiffness_n_per_m: float | None = None
) -> NDArray[np.void]:
    """Constants of a drive for sub-steps of dt_s: one record, shape [1]; concatenate for several axes.
    stiffness_n_per_m: of the screw where the nut is; None: the stated one.

    Raises ValueError if the sub-step is too long for the nut spring on this shaft.
    """
    motor = motor.at_current(stage.vector_a)
    p = np.zeros(1, AXIS_PARAMETERS)
    lay_shaft(p, screw, motor.rotor_inertia_kgm2, dt_s, stiffness_n_per_m)
    resistance = motor.resistance_ohm + stage.extra_resistance_ohm
    gain = -math.expm1(-resistance * dt_s / motor.inductance_h) / resistance
    p["kind"] = STEPPER
    numbers = p.view(np.float64)
    numbers[_MOTOR] = (  # in the order of AXIS_PARAMETERS
        2.0 * math.pi * motor.pole_pairs / (motor.full_steps_per_rev * stage.microsteps),
        math.pi / 4.0 if stage.microsteps == 1 else 0.0,
        stage.stepped,
        stage.current_a,
        stage.drive_v,
        stage.supply_v,
        stage.fast_share,
        math.exp(-resistance * dt_s / motor.inductance_h),
        gain,
        1.0 / gain,
        motor.torque_constant_nm_per_a,
        motor.pole_pairs,
        motor.detent_torque_nm,
        motor.iron_drag_nm_s_per_rad,
        1.0 / motor.iron_knee_rad_s,
        0.0 if stage.stepped else stage.damping_gain,
        -math.expm1(-2.0 * math.pi * SMOOTHING * stage.damping_corner_hz * dt_s),
        -math.expm1(-2.0 * math.pi * stage.damping_corner_hz * dt_s),
    )
    plain = not (stage.stepped or stage.step_error or stage.current_offset)
    numbers[_ERRORS] = plain, stage.step_error * 0.5 * math.pi, stage.current_offset
    return p
