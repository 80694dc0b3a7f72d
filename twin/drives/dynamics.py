"""One stepper drive, one sub-step: from the commanded electrical angle to the force on the nut.

This code advances power stage, two phase currents, rotor, screw and nut spring by one sub-step dt, at 10^7 axis
sub-steps a second, with true sticking friction and no numerical gain of energy.

    e_A = -Km w sin(Nr th)        e_B = Km w cos(Nr th)                              back-EMF
    v   = clip((i_ref - E i)/A + e, -V, V),   i' = E i + A (v - e)                   E = exp(-R dt/L), A = (1 - E)/R
    T   = -Km i_A sin(Nr th) + Km i_B cos(Nr th) - Td sin(4 Nr th) - T_fe(w)         i_A, i_B: mean of i and i'
    T_fe = (Km^2/Rm) w / (1 + (w/w_k)^2)                                             iron loss (motor.py)

(MathWorks Simscape "Stepper Motor"; the stage is a current source that the supply limits, without chopper ripple.) The
other half of the sub-step, rotor, screw and nut, is in shaft.py for every kind of motor.

i_ref is the wave of the stage at the commanded angle, turned and shifted by its errors (stage.py). Electronic damping
turns the current vector further by the swing of the load angle about its low pass, as a digital microstep drive with
damping does (drives/9):

    lambda = phi_cmd - Nr th     d lambda_f/dt = 2 pi f_c (lambda - lambda_f)     phi = phi_cmd + g (lambda - lambda_f)

For lambda the command is smoothed between its pulses.

          dt
    |-----------|          pulses within the sub-step act in it by the time mean of the command:
    __|``````````          a pulse after 0.2 dt moves the mean by 0.8 microsteps

`follow` in curves.py shows how compiled code uses it, with the records of shaft.py.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.compiling import njit
from isel_twin.drives import shaft, trigonometry
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import AXIS_PARAMETERS, STEPPER, lay_shaft, turn
from isel_twin.drives.stage import Stage
from isel_twin.drives.trigonometry import sine_and_cosine

OPEN = 0  # `phases`: both phases open, the motor is limp
PHASE_A = 1  # `phases`: phase A alone is connected (a broken wire in B)
PHASE_B = 2  # `phases`: phase B alone is connected (a broken wire in A)
BOTH = 3  # `phases`: the stage drives both phases
SMOOTHING = 5.0  # corner of the smoothed command over that of the damping, so that it does not amplify single pulses
_fields = AXIS_PARAMETERS.names or ()  # all have eight bytes
_MOTOR = slice(_fields.index("microstep_rad"), _fields.index("damping_share") + 1)
_ERRORS = slice(_fields.index("plain"), _fields.index("current_offset") + 1)
SETTLED_RAD = 1e-12  # electrical load-angle swing below which damping does nothing, so that a drive comes to rest


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


@njit(inner=True, error_model="numpy")
def _corner(angle_rad):
    """The switched counterpart of the cosine: 1 up to pi/4, 0 at pi/2, -1 from 3 pi/4; linear between.

    The counter stands on multiples of pi/4 (half step), or odd ones (full step, drives/6); between them is the time
    mean of the wanted current in a sub-step with a pulse in it."""
    wrapped = angle_rad - 2.0 * math.pi * math.floor(angle_rad / (2.0 * math.pi) + 0.5)
    return min(1.0, max(-1.0, 2.0 - abs(wrapped) * (4.0 / math.pi)))


@njit(inner=True, error_model="numpy")
def _shape(p, s, phi):
    """Wanted currents at an electrical angle, turned and shifted by the stage's errors."""
    if p.stepped != 0.0:
        shape_a, shape_b = _corner(phi), _corner(phi - 0.5 * math.pi)
        turn, _ = sine_and_cosine(phi - p.phase_offset_rad)
    else:
        shape_b, shape_a = sine_and_cosine(phi)
        turn = shape_b
    if p.step_error_rad != 0.0:
        sine, cosine = sine_and_cosine(p.step_error_rad * turn)
        shape_a, shape_b = shape_a * cosine - shape_b * sine, shape_b * cosine + shape_a * sine
    s.shape_a = shape_a
    s.shape_b = shape_b + p.current_offset


@njit(inner=True, error_model="numpy")
def _phase(p, current_a, wanted_a, emf_v):
    """Phase current after a sub-step: the wanted one, as far as the supply can drive it. Drops in the switches reduce
    the voltage that drives a current, not the one against which it flows back (drives/1), which is a part of the supply
    where the current is only too large, and not of the wrong sign (drives/14)."""
    voltage_v = (wanted_a - p.decay * current_a) * p.gain_v_per_a + emf_v
    return_v = p.return_v if current_a * wanted_a <= 0.0 else p.fast_share * p.return_v
    highest_v = p.drive_v if current_a >= 0.0 else return_v
    if voltage_v > highest_v:
        return p.decay * current_a + p.gain_a_per_v * (highest_v - emf_v)
    lowest_v = -p.drive_v if current_a <= 0.0 else -return_v
    if voltage_v < lowest_v:
        return p.decay * current_a + p.gain_a_per_v * (lowest_v - emf_v)
    return wanted_a


@njit(inner=True, error_model="numpy")
def step_axis(p, s, command, phases, current_fraction, nut_position_m, nut_velocity_m_s, load_torque_nm):
    """Advance one drive by one sub-step; return the force on the nut in N (mean over the sub-step).

    p, s              records of AXIS_PARAMETERS and AXIS_STATE; s is changed in place
    command           time mean over the sub-step of the microstep counter
    phases            BOTH with the stage on, OPEN with it off, PHASE_A or PHASE_B with a wire broken. An open phase
                      carries no current from this sub-step on (in truth it fades within 0.3 ms, decision drives/5)
    current_fraction  phase current over nominal, for the lowered current at rest
    nut_position_m    where the carriage stands in the middle of the sub-step; 0: middle of the backlash at theta 0
    nut_velocity_m_s  its velocity
    load_torque_nm    torque from outside against positive rotation

    Finite arguments give finite results. With phases OPEN it never adds energy.
    """
    torque, drag, steady = stepper_torque(p, s, command, phases, current_fraction, load_torque_nm)
    return turn(p, s, torque, drag, nut_position_m, nut_velocity_m_s, steady)


@njit(inner=True, error_model="numpy", forceinline=True)
def stepper_torque(p, s, command, phases, current_fraction, load_torque_nm):
    """The motor's part of `step_axis`, as `turn` takes it: torque, drag, steady."""
    omega = s.omega_rad_s
    theta = s.theta_rad + 0.5 * p.dt_s * omega
    angle = p.pole_pairs * theta + p.phase_offset_rad
    sine, cosine = sine_and_cosine(angle)

    # Stage and currents.
    settled = True
    if p.damping_gain > 0.0:
        phi = command * p.microstep_rad + p.phase_offset_rad
        if phases != BOTH or s.command != s.command:  # nothing to damp, or the first sub-step
            s.smooth_rad = phi
            s.lag_rad = phi - angle
        s.smooth_rad += p.smooth_share * (phi - s.smooth_rad)
        lag = s.smooth_rad - angle
        s.lag_rad += p.damping_share * (lag - s.lag_rad)
        swing = lag - s.lag_rad
        settled = abs(swing) + abs(phi - s.smooth_rad) < SETTLED_RAD
        if settled:
            s.smooth_rad = phi
            s.lag_rad = phi - angle
            swing = 0.0
        s.command = command
        phi += p.damping_gain * swing
        if p.plain != 0.0:
            s.shape_b, s.shape_a = sine_and_cosine(phi)
        else:
            _shape(p, s, phi)
    elif command != s.command:
        phi = command * p.microstep_rad + p.phase_offset_rad
        s.command = command
        if p.plain != 0.0:
            s.shape_b, s.shape_a = sine_and_cosine(phi)
        else:
            _shape(p, s, phi)
    emf_v = p.torque_constant_nm_per_a * omega
    wanted_a = p.current_a * current_fraction
    current_a = _phase(p, s.current_a_a, wanted_a * s.shape_a, -emf_v * sine) if phases & PHASE_A else 0.0
    current_b = _phase(p, s.current_b_a, wanted_a * s.shape_b, emf_v * cosine) if phases & PHASE_B else 0.0
    mean_a = 0.5 * (s.current_a_a + current_a) if phases & PHASE_A else 0.0
    mean_b = 0.5 * (s.current_b_a + current_b) if phases & PHASE_B else 0.0
    steady = settled and current_a == s.current_a_a and current_b == s.current_b_a
    s.current_a_a = current_a
    s.current_b_a = current_b
    torque = p.torque_constant_nm_per_a * (mean_b * cosine - mean_a * sine)
    s.torque_nm = torque
    sine_2 = 2.0 * sine * cosine
    torque -= p.detent_torque_nm * 2.0 * sine_2 * (1.0 - 2.0 * sine * sine) + load_torque_nm

    knee = p.iron_knee_s_per_rad * omega
    drag = p.drag_nm_s_per_rad + p.iron_nm_s_per_rad / (1.0 + knee * knee)
    return torque, drag, steady


FILES = (__file__, shaft.__file__, trigonometry.__file__)  # whose code `step_axis` contains
