"""The records of an axis drive, whatever motor turns its shaft; the sub-step of rotor, screw and nut is in shaft.h."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.screw import Screw
from isel_twin.native import record

STEPPER = 0  # `kind`: open loop, two phases (stepper.h)
SERVO = 1  # `kind`: closed loop (servo.h)
IN_C = ("STEPPER", "SERVO")  # records.h has them, too

# constants of one axis drive; built by `axis_parameters` and `servo_parameters`
AXIS_PARAMETERS = record(
    "AXIS_PARAMETERS",
    [
        ("kind", "i8"),  # STEPPER, SERVO
        ("microstep_rad", "f8"),  # electrical angle of one microstep
        ("phase_offset_rad", "f8"),  # electrical angle at counter 0: pi/4 in full step (both phases on), else 0
        ("stepped", "f8"),  # 1: corners of full and half step, 0: sine
        ("current_a", "f8"),  # peak phase current at current fraction 1
        ("drive_v", "f8"),  # largest voltage that drives a current
        ("return_v", "f8"),  # largest voltage against which a current flows back into the supply
        ("fast_share", "f8"),  # part of it against which a current falls that is too large, not of the wrong sign
        ("decay", "f8"),  # E = exp(-R dt / L)
        ("gain_a_per_v", "f8"),  # A = (1 - E) / R
        ("gain_v_per_a", "f8"),  # 1 / A
        ("torque_constant_nm_per_a", "f8"),  # Km
        ("pole_pairs", "f8"),  # Nr
        ("detent_torque_nm", "f8"),  # Td
        ("iron_nm_s_per_rad", "f8"),  # Km^2 / Rm, the iron drag over speed well below the knee
        ("iron_knee_s_per_rad", "f8"),  # 1 / w_k
        ("damping_gain", "f8"),  # g of the electronic damping, 0: none
        ("smooth_share", "f8"),  # part of the way to the command that its smooth version goes in a sub-step
        ("damping_share", "f8"),  # the same of the low pass of the load angle
        # of the shaft
        ("dt_s", "f8"),  # the sub-step all derived constants below belong to
        ("kick_rad_s_per_nm", "f8"),  # dt / J, J: rotor and everything that turns with it
        ("inertia_kgm2", "f8"),  # J
        ("drag_nm_s_per_rad", "f8"),  # B
        ("coulomb_nm", "f8"),  # friction torque in motion
        ("stribeck_nm", "f8"),  # surplus of the friction torque at rest
        ("stribeck_rad_s", "f8"),  # shaft speed at which half of the surplus is gone (drives/7)
        ("travel_m_per_rad", "f8"),  # r, lead error included
        ("half_backlash_m", "f8"),
        ("stiffness_n_per_m", "f8"),  # k, 0: no nut
        ("damping_n_s_per_m", "f8"),  # c
        ("forward_loss", "f8"),  # friction torque over |F| r when the screw drives: 1 / efficiency - 1
        ("backward_loss", "f8"),  # the same when the nut drives: 1 - backdrive_efficiency
        # of the stage
        ("plain", "f8"),  # 1: sine without errors of the stage
        ("step_error_rad", "f8"),  # largest electrical angle by which the current vector is turned
        ("current_offset", "f8"),  # of phase B, over the current
        # of servo drives
        ("increments_per_rad", "f8"),
        ("loop_substeps", "i8"),  # sub-steps from sample to sample of the position and speed loop
        ("position_gain_rad_s", "f8"),  # wanted speed by an increment of error: Kv / increments_per_rad
        ("forward_rad_s", "f8"),  # wanted speed by an increment of command since the sample before: feed-forward
        ("speed_gain_a_s", "f8"),  # wanted current by an error of speed: Kp
        ("integral_share", "f8"),  # loop period over Ti
        ("peak_a", "f8"),
        ("rated_a", "f8"),
        ("lag_limit", "f8"),  # increments
        ("window", "f8"),  # increments
        ("window_substeps", "i8"),
        ("heat_share", "f8"),  # part of the way to (i / rated)^2 that I2t goes in a sub-step
        ("connected", "i8"),  # 0: the cable of the motor is broken
    ],
)

_fields = AXIS_PARAMETERS.names or ()
_SHAFT = slice(_fields.index("dt_s"), _fields.index("backward_loss") + 1)  # all fields have eight bytes

# state of one axis drive; built by `axis_states`
AXIS_STATE = record(
    "AXIS_STATE",
    [
        ("theta_rad", "f8"),  # rotor angle, 0 where counter 0 holds it, positive away from the motor
        ("omega_rad_s", "f8"),  # rotor speed
        ("current_a_a", "f8"),  # phase A current
        ("current_b_a", "f8"),  # phase B current
        ("command", "f8"),  # mean command that belongs to the shape below, microsteps
        ("shape_a", "f8"),  # wanted current of phase A over current_a
        ("shape_b", "f8"),
        ("smooth_rad", "f8"),  # commanded angle as the electronic damping sees it, without its steps
        ("lag_rad", "f8"),  # low pass of the load angle to that
        ("torque_nm", "f8"),  # torque of the currents in the last sub-step (for traces)
        ("force_n", "f8"),  # force on the nut in the last sub-step
        ("at_rest", "i8"),  # 1: the last sub-step changed nothing
        # of servo drives; the current of the motor is current_a_a
        ("on", "i8"),  # 1: the loops are closed
        ("fault", "i8"),  # 0, LAG_FAULT, VOLTAGE_FAULT: latched, the motor is without current
        ("cause", "i8"),  # the last fault, cleared or not
        ("faults", "i8"),  # number of faults so far
        ("due", "i8"),  # sub-steps to the next sample of the loops
        ("shift", "f8"),  # command less encoder when the drive was switched on
        ("error", "f8"),  # following error at the start of the last sub-step, increments
        ("wanted_a", "f8"),
        ("integral_rad_s", "f8"),
        ("sampled", "f8"),  # command at the last sample
        ("voltage_v", "f8"),  # at the motor in the last sub-step
        ("heat", "f8"),  # I2t: low pass of (i / rated)^2
        ("overloaded", "i8"),  # 1: I2t has passed 1 and is not back below I2T_BACK: at most the rated current flows
        ("arrived", "i8"),  # sub-steps within the window
    ],
)


def lay_shaft(
    p: NDArray[np.void], screw: Screw, rotor_inertia_kgm2: float, dt_s: float, stiffness_n_per_m: float | None = None
) -> None:
    """Fill in the constants of all but the motor: p [1] AXIS_PARAMETERS. stiffness_n_per_m: where the nut is; None: the
    stated one. Raises ValueError if the sub-step dt_s is too long for the nut spring on this shaft."""
    if not 0.0 < dt_s <= 1e-3:
        raise ValueError(f"drive: the sub-step must lie in 0 .. 1 ms, not {dt_s!r} s")
    inertia = rotor_inertia_kgm2 + screw.inertia_kgm2
    travel = screw.travel_m_per_rad
    stiffness = screw.stiffness_n_per_m if stiffness_n_per_m is None else stiffness_n_per_m
    if stiffness * travel**2 * dt_s**2 > inertia:
        raise ValueError(
            f"drive: sub-step {dt_s:g} s is too long for this stiffness and inertia; shorten it or soften it"
        )
    p.view(np.float64)[_SHAFT] = (  # in the order of AXIS_PARAMETERS
        dt_s,
        dt_s / inertia,
        inertia,
        screw.viscous_nm_s_per_rad,
        screw.coulomb_nm,
        screw.coulomb_nm * (screw.breakaway_ratio - 1.0),
        screw.stribeck_rad_s,
        travel,
        0.5e-3 * screw.backlash_mm,
        stiffness,
        screw.damping_n_s_per_m,
        1.0 / screw.efficiency - 1.0,
        1.0 - screw.backdrive_efficiency,
    )


def axis_states(n: int) -> NDArray[np.void]:
    """n drives at rest at counter 0, without current: shape [n], dtype AXIS_STATE."""
    states = np.zeros(n, AXIS_STATE)
    states["command"] = math.nan  # makes the first sub-step compute the shape
    return states
