"""One axis drive, one sub-step: from the commanded electrical angle to the force on the nut.

The goal of this code is to advance power stage, two phase currents, rotor, screw and nut spring by one sub-step dt,
fast enough for 10^7 axis sub-steps a second, with true sticking and without ever gaining energy by itself.

    e_A = -Km w sin(Nr th)        e_B = Km w cos(Nr th)                              back-EMF
    v   = clip((i_ref - E i)/A + e, -V, V),   i' = E i + A (v - e)                   E = exp(-R dt/L), A = (1 - E)/R
    T   = -Km i_A sin(Nr th) + Km i_B cos(Nr th) - Td sin(4 Nr th) - T_fe(w)         i_A, i_B: mean of i and i'
    T_fe = (Km^2/Rm) w / (1 + (w/w_k)^2)                                             iron loss, see motor.py
    F   = k dead_zone(r th - x, backlash) + c (r w - v_nut)                          force on the nut
    J dw/dt = T - B w - F r - T_load - friction

(MathWorks Simscape "Stepper Motor"; the stage is a current source that the supply limits, without chopper ripple.)

i_ref is the wave of the stage at the commanded angle, turned and shifted by its errors (stage.py). A stage with
electronic damping turns the current vector further by what the load angle swings about its low pass, as a digital
microstep drive does that watches its motor (D9):

    lambda = phi_cmd - Nr th     d lambda_f/dt = 2 pi f_c (lambda - lambda_f)     phi = phi_cmd + g (lambda - lambda_f)

For lambda the command is smoothed between its pulses.

Time step: the angle drifts half a sub-step, the speed is kicked by the torque found there, the angle drifts the other
half (Stoermer-Verlet: second order, no secular gain of energy). What is linear in w is taken as the mean of old and new
speed. Dry friction is an impulse in the kick that can stop the shaft but not reverse it: below breakaway the speed is
exactly 0 and the angle does not change by a bit.

          dt
    |-----------|          pulses within the sub-step act in it by the time mean of the command:
    __|``````````          a pulse after 0.2 dt moves the mean by 0.8 microsteps

    th --drift--> kick --drift--> th'

Records, not objects: AXIS_STATE and AXIS_PARAMETERS are numpy structured dtypes; in compiled code `states[i]` is a
reference with named fields. How a kernel uses them:

    parameters = np.concatenate([axis_parameters(motor, stage, screw, dt_s) for ...])    # [n] AXIS_PARAMETERS
    states = axis_states(n)                                                               # [n] AXIS_STATE

    @njit
    def kernel(parameters, states, ...):
        for i in range(len(states)):
            mean = ...                  # time mean of the microstep counter over this sub-step, a fraction is right
            force_n = step_axis(parameters[i], states[i], mean, phases, fraction, x_mid_m, v_m_s, 0.0)
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.compiling import njit
from isel_twin.drives import trigonometry
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.stage import Stage
from isel_twin.drives.trigonometry import sine_and_cosine

OPEN = 0
"""`phases`: both phases open, the motor is limp."""
PHASE_A = 1
"""`phases`: phase A alone is connected (a broken wire in B)."""
PHASE_B = 2
"""`phases`: phase B alone is connected (a broken wire in A)."""
BOTH = 3
"""`phases`: the stage drives both phases."""

REST_RAD_S = 1e-9
"""Below this shaft speed before and after a sub-step a drive counts as standing (friction brings it to exactly 0)."""

SMOOTHING = 5.0
"""Corner of the smooth command of the electronic damping over its own corner: else it would amplify single pulses."""

SETTLED_RAD = 1e-12
"""Electronic damping takes a smaller swing of the load angle (electrical) for none, so that a drive comes to rest."""

AXIS_PARAMETERS = np.dtype(
    [
        ("dt_s", "f8"),  # the sub-step all derived constants below belong to
        ("microstep_rad", "f8"),  # electrical angle of one microstep
        ("phase_offset_rad", "f8"),  # electrical angle at counter 0: pi/4 in full step (both phases on), else 0
        ("stepped", "f8"),  # 1: corners of full and half step, 0: sine
        ("current_a", "f8"),  # peak phase current at current fraction 1
        ("drive_v", "f8"),  # largest voltage that drives a current
        ("return_v", "f8"),  # largest voltage against which a current flows back into the supply
        ("decay", "f8"),  # E = exp(-R dt / L)
        ("gain_a_per_v", "f8"),  # A = (1 - E) / R
        ("gain_v_per_a", "f8"),  # 1 / A
        ("torque_constant_nm_per_a", "f8"),  # Km
        ("pole_pairs", "f8"),  # Nr
        ("detent_torque_nm", "f8"),  # Td
        ("kick_rad_s_per_nm", "f8"),  # dt / J, J: rotor and everything that turns with it
        ("inertia_kgm2", "f8"),  # J
        ("drag_nm_s_per_rad", "f8"),  # B
        ("iron_nm_s_per_rad", "f8"),  # Km^2 / Rm, the iron drag over speed well below the knee
        ("iron_knee_s_per_rad", "f8"),  # 1 / w_k
        ("damping_gain", "f8"),  # g of the electronic damping, 0: none
        ("smooth_share", "f8"),  # part of the way to the command that its smooth version goes in a sub-step
        ("damping_share", "f8"),  # the same of the low pass of the load angle
        ("coulomb_nm", "f8"),  # friction torque in motion
        ("stribeck_nm", "f8"),  # surplus of the friction torque at rest
        ("stribeck_rad_s", "f8"),  # shaft speed at which half of the surplus is gone
        ("travel_m_per_rad", "f8"),  # r, lead error included
        ("half_backlash_m", "f8"),
        ("stiffness_n_per_m", "f8"),  # k, 0: no nut
        ("damping_n_s_per_m", "f8"),  # c
        ("forward_loss", "f8"),  # friction torque over |F| r when the screw drives: 1 / efficiency - 1
        ("backward_loss", "f8"),  # the same when the nut drives: 1 - backdrive_efficiency
        ("plain", "f8"),  # 1: sine without errors of the stage
        ("step_error_rad", "f8"),  # largest electrical angle by which the current vector is turned
        ("current_offset", "f8"),  # of phase B, over the current
    ],
    align=True,
)
"""Constants of one axis drive; built by `axis_parameters`."""

AXIS_STATE = np.dtype(
    [
        ("theta_rad", "f8"),  # rotor angle, 0 where counter 0 holds it, positive away from the motor
        ("omega_rad_s", "f8"),  # rotor speed
        ("current_a_a", "f8"),  # phase A current
        ("current_b_a", "f8"),  # phase B current
        ("command", "f8"),  # mean command the shape below belongs to, microsteps
        ("shape_a", "f8"),  # wanted current of phase A over current_a
        ("shape_b", "f8"),
        ("smooth_rad", "f8"),  # commanded angle as the electronic damping sees it, without its steps
        ("lag_rad", "f8"),  # low pass of the load angle to that
        ("torque_nm", "f8"),  # torque of the currents in the last sub-step (for traces)
        ("force_n", "f8"),  # force on the nut in the last sub-step
        ("at_rest", "i8"),  # 1: the last sub-step changed nothing; see at_rest()
    ],
    align=True,
)
"""State of one axis drive; built by `axis_states`."""


def axis_parameters(motor: Motor, stage: Stage, screw: Screw, dt_s: float) -> NDArray[np.void]:
    """Constants of a drive for sub-steps of dt_s: one record, shape [1]; axes are put together by concatenation.

    Raises ValueError if the sub-step is too long for the nut spring on this shaft.
    """
    if not 0.0 < dt_s <= 1e-3:
        raise ValueError(f"drive: the sub-step must lie in 0 .. 1 ms, not {dt_s!r} s")
    inertia = motor.rotor_inertia_kgm2 + screw.inertia_kgm2
    travel = screw.travel_m_per_rad
    if screw.stiffness_n_per_m * travel**2 * dt_s**2 > inertia:
        raise ValueError(
            f"drive: sub-step {dt_s:g} s is too long for this stiffness and inertia; shorten it or soften it"
        )
    resistance = motor.resistance_ohm + stage.extra_resistance_ohm
    decay = math.exp(-resistance * dt_s / motor.inductance_h)
    gain = -math.expm1(-resistance * dt_s / motor.inductance_h) / resistance
    p = np.zeros(1, AXIS_PARAMETERS)
    p["dt_s"] = dt_s
    p["microstep_rad"] = 2.0 * math.pi * motor.pole_pairs / (motor.full_steps_per_rev * stage.microsteps)
    p["phase_offset_rad"] = math.pi / 4.0 if stage.microsteps == 1 else 0.0
    p["stepped"] = float(stage.stepped)
    p["plain"] = float(not (stage.stepped or stage.step_error or stage.current_offset))
    p["step_error_rad"] = stage.step_error * 0.5 * math.pi
    p["current_offset"] = stage.current_offset
    p["current_a"] = stage.current_a
    p["drive_v"] = stage.drive_v
    p["return_v"] = stage.supply_v
    p["decay"] = decay
    p["gain_a_per_v"] = gain
    p["gain_v_per_a"] = 1.0 / gain
    p["torque_constant_nm_per_a"] = motor.torque_constant_nm_per_a
    p["pole_pairs"] = motor.pole_pairs
    p["detent_torque_nm"] = motor.detent_torque_nm
    p["kick_rad_s_per_nm"] = dt_s / inertia
    p["inertia_kgm2"] = inertia
    p["drag_nm_s_per_rad"] = screw.viscous_nm_s_per_rad
    p["iron_nm_s_per_rad"] = motor.iron_drag_nm_s_per_rad
    p["iron_knee_s_per_rad"] = 1.0 / motor.iron_knee_rad_s
    p["damping_gain"] = 0.0 if stage.stepped else stage.damping_gain
    p["smooth_share"] = -math.expm1(-2.0 * math.pi * SMOOTHING * stage.damping_corner_hz * dt_s)
    p["damping_share"] = -math.expm1(-2.0 * math.pi * stage.damping_corner_hz * dt_s)
    p["coulomb_nm"] = screw.coulomb_nm
    p["stribeck_nm"] = screw.coulomb_nm * (screw.breakaway_ratio - 1.0)
    p["stribeck_rad_s"] = screw.stribeck_rad_s
    p["travel_m_per_rad"] = travel
    p["half_backlash_m"] = 0.5e-3 * screw.backlash_mm
    p["stiffness_n_per_m"] = screw.stiffness_n_per_m
    p["damping_n_s_per_m"] = screw.damping_n_s_per_m
    p["forward_loss"] = 1.0 / screw.efficiency - 1.0
    p["backward_loss"] = 1.0 - screw.backdrive_efficiency
    return p


def axis_states(n: int) -> NDArray[np.void]:
    """n drives at rest at counter 0, without current: shape [n], dtype AXIS_STATE."""
    states = np.zeros(n, AXIS_STATE)
    states["command"] = math.nan  # no shape yet: the first sub-step finds it
    return states


@njit(error_model="numpy")
def _corner(angle_rad):
    """The switched counterpart of the cosine: 1 up to pi/4, 0 at pi/2, -1 from 3 pi/4; linear between.

    The counter stands on multiples of pi/4 (half step) or odd multiples (full step) only. Between them the line gives
    the time mean of the current wanted in a sub-step with a pulse in it.
    """
    wrapped = angle_rad - 2.0 * math.pi * math.floor(angle_rad / (2.0 * math.pi) + 0.5)
    return min(1.0, max(-1.0, 2.0 - abs(wrapped) * (4.0 / math.pi)))


@njit(error_model="numpy")
def _shape(p, s, phi):
    """Wanted currents of any stage at an electrical angle, turned and shifted by its errors."""
    if p.stepped != 0.0:
        shape_a, shape_b = _corner(phi), _corner(phi - 0.5 * math.pi)
        turn = math.sin(phi - p.phase_offset_rad)
    else:
        shape_b, shape_a = sine_and_cosine(phi)
        turn = shape_b
    if p.step_error_rad != 0.0:
        sine, cosine = sine_and_cosine(p.step_error_rad * turn)
        shape_a, shape_b = shape_a * cosine - shape_b * sine, shape_b * cosine + shape_a * sine
    s.shape_a = shape_a
    s.shape_b = shape_b + p.current_offset


@njit(error_model="numpy")
def _phase(p, current_a, wanted_a, emf_v):
    """Phase current after a sub-step: what is wanted, or as far as the supply gets it.

    Drops in the switches take from the voltage that drives a current, not from the one it flows back against (D1).
    """
    voltage_v = (wanted_a - p.decay * current_a) * p.gain_v_per_a + emf_v
    highest_v = p.drive_v if current_a >= 0.0 else p.return_v
    if voltage_v > highest_v:
        return p.decay * current_a + p.gain_a_per_v * (highest_v - emf_v)
    lowest_v = -p.drive_v if current_a <= 0.0 else -p.return_v
    if voltage_v < lowest_v:
        return p.decay * current_a + p.gain_a_per_v * (lowest_v - emf_v)
    return wanted_a


@njit(error_model="numpy")
def step_axis(p, s, command, phases, current_fraction, nut_position_m, nut_velocity_m_s, load_torque_nm):
    """Advance one drive by one sub-step; return the force on the nut in N (mean over the sub-step).

    p                 record of AXIS_PARAMETERS
    s                 record of AXIS_STATE, changed in place
    command           time mean over the sub-step of the microstep counter (a pulse in it: a fraction)
    phases            BOTH with the stage on, OPEN with it off, PHASE_A or PHASE_B with a wire broken. An open phase
                      carries no current from this sub-step on (in truth it fades within 0.3 ms, decision D5)
    current_fraction  phase current over nominal, for the lowered current at rest
    nut_position_m    where the carriage stands in the middle of the sub-step; 0: amid its backlash at theta 0
    nut_velocity_m_s  its velocity
    load_torque_nm    torque from outside against positive rotation

    Finite arguments give finite results. With phases OPEN it never adds energy: detent and nut spring store it,
    friction and iron take it.
    """
    half_dt = 0.5 * p.dt_s
    omega = s.omega_rad_s
    theta = s.theta_rad + half_dt * omega
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
            s.shape_a = math.cos(phi)
            s.shape_b = math.sin(phi)
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

    # Nut: spring and damper outside the backlash; a nut with play can be pushed but not pulled back.
    knee = p.iron_knee_s_per_rad * omega
    drag = p.drag_nm_s_per_rad + p.iron_nm_s_per_rad / (1.0 + knee * knee)
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


@njit(error_model="numpy")
def at_rest(s):
    """True if the last sub-step changed neither angle nor currents.

    Then a sub-step with the same arguments changes nothing either, bit for bit if there is friction, and time may be
    skipped until an argument changes.
    """
    return s.at_rest != 0


@njit(error_model="numpy")
def stored_energy_j(p, s, nut_position_m):
    """Energy in the rotor, the detent and the nut spring, J (phase currents not counted)."""
    angle = p.pole_pairs * s.theta_rad + p.phase_offset_rad
    stretch = max(0.0, abs(p.travel_m_per_rad * s.theta_rad - nut_position_m) - p.half_backlash_m)
    return (
        0.5 * p.inertia_kgm2 * s.omega_rad_s**2
        + p.detent_torque_nm / (4.0 * p.pole_pairs) * (1.0 - math.cos(4.0 * angle))
        + 0.5 * p.stiffness_n_per_m * stretch**2
    )


_FILES = (__file__, trigonometry.__file__)


def drop_stale_code(function: Any, *files: str) -> None:
    """Throw away what numba has kept of a function that contains code of other files, if those have changed since.

    numba asks only whether the function's own file has changed. So the digest of the others is kept beside the code.
    files: the others, those of `step_axis` if none is named. Call it once, right after the function is defined.
    """
    cache = function._cache
    if cache.cache_path is None:  # nothing is kept
        return
    folder = Path(cache.cache_path)
    stamp = folder / f"{function.__module__}.drives"
    digest = hashlib.sha256(b"".join(Path(file).read_bytes() for file in files or _FILES)).hexdigest()
    with contextlib.suppress(OSError):
        if stamp.is_file() and stamp.read_text() == digest:
            return
        module = function.__module__.rpartition(".")[2]
        for file in folder.glob(f"{module}.*.nb[ci]"):
            file.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        stamp.write_text(digest)


drop_stale_code(step_axis, trigonometry.__file__)
