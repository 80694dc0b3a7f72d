"""Rotor, screw and nut of an axis in one sub-step, whatever motor turns them; and the records of an axis drive.

Stepper and servo drives differ only in how a command becomes a torque. The effect of the torque on rotor, friction,
screw, backlash and nut is here, compiled into both (dynamics.py, servo.py):

    F = k dead_zone(r th - x, backlash) + c (r w - v_nut)          force on the nut
    J dw/dt = T - B w - F r - T_load - friction

Time step: the angle drifts half a sub-step, the speed is kicked by the torque found there, the angle drifts the other
half (Stoermer-Verlet: second order, no secular gain of energy). What is linear in w is taken as the mean of old and new
speed. Dry friction is an impulse in the kick that can stop the shaft but not reverse it: below breakaway the speed is
exactly 0 and the angle does not change by a bit.

    th --drift--> torque of the motor --turn: kick, drift--> th'

AXIS_STATE and AXIS_PARAMETERS are numpy structured dtypes; in compiled code `states[i]` is a reference with named
fields.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.compiling import njit
from isel_twin.drives.screw import Screw
from isel_twin.native import record

STEPPER = 0  # `kind`: open loop, two phases (dynamics.py)
SERVO = 1  # `kind`: closed loop (servo.py)
REST_RAD_S = 1e-9  # shaft speed below which a drive counts as at rest (friction brings it to exactly 0)

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
        ("at_rest", "i8"),  # 1: the last sub-step changed nothing (`at_rest`)
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


@njit(inner=True, error_model="numpy", forceinline=True)
def turn(p, s, torque, drag, nut_position_m, nut_velocity_m_s, steady):
    """Turn the shaft by a torque for one sub-step; return the mean force on the nut in N.

    torque, drag: of motor and load without the nut, in N m, and its part linear in the speed, in N m s/rad. steady:
    nothing else in the drive has changed in this sub-step. Other arguments: `step_axis`.
    """
    half_dt = 0.5 * p.dt_s
    omega = s.omega_rad_s
    theta = s.theta_rad + half_dt * omega

    # Nut: spring and damper outside the backlash; a nut with play can be pushed but not pulled back.
    damping = 0.0
    spring = 0.0
    if p.stiffness_n_per_m > 0.0:
        stretch = p.travel_m_per_rad * theta - nut_position_m
        rate = p.damping_n_s_per_m * (p.travel_m_per_rad * omega - nut_velocity_m_s)
        if stretch > p.half_backlash_m:
            spring = p.stiffness_n_per_m * (stretch - p.half_backlash_m)
        elif stretch < -p.half_backlash_m:
            spring = p.stiffness_n_per_m * (stretch + p.half_backlash_m)
        if p.half_backlash_m == 0.0 or (spring + rate) * spring > 0.0:
            damping = p.damping_n_s_per_m
        else:
            spring = 0.0
    push = spring - damping * nut_velocity_m_s
    drag += damping * p.travel_m_per_rad * p.travel_m_per_rad
    torque -= push * p.travel_m_per_rad

    # Kick: linear drag at the mean speed, then the friction impulse.
    half_drag = 0.5 * p.kick_rad_s_per_nm * drag
    share = 1.0 / (1.0 + half_drag)
    free = (omega * (1.0 - half_drag) + p.kick_rad_s_per_nm * torque) * share
    force = push + damping * p.travel_m_per_rad * omega
    ratio = omega / p.stribeck_rad_s
    friction = p.coulomb_nm + p.stribeck_nm / (1.0 + ratio * ratio)
    loss = p.forward_loss if free * force > 0.0 else p.backward_loss
    friction += loss * abs(force) * p.travel_m_per_rad
    stop = p.kick_rad_s_per_nm * friction * share
    if free > stop:
        omega_new = free - stop
    elif free < -stop:
        omega_new = free + stop
    else:
        omega_new = 0.0
    s.theta_rad = theta + half_dt * omega_new
    s.omega_rad_s = omega_new
    s.force_n = push + 0.5 * damping * p.travel_m_per_rad * (omega + omega_new)
    s.at_rest = 1 if steady and abs(omega) <= REST_RAD_S and abs(omega_new) <= REST_RAD_S else 0
    return s.force_n


@njit(inner=True, error_model="numpy")
def at_rest(s):
    """True if the last sub-step changed neither angle nor currents. With the same arguments further ones change nothing
    either (with friction, not a bit): time may be skipped until an argument changes."""
    return s.at_rest != 0
