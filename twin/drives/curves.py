"""Pull-out torque and pull-in rate of a motor on a stage, from a virtual bench and in closed form.

The virtual bench uses the sub-step that moves the machine and measures what makers publish:

    pull-out torque   the largest load at which a motor that runs already stays in step
    pull-in rate      the highest step rate at which it starts from rest in step

The bench is the motor, an inertia on its shaft and a generator as brake, whose torque is proportional to speed
(drives/4). The motor accelerates against it to the speed in question and must hold it. It is out of step once it lags
by four full steps, one turn of the electrical angle.

Two closed forms are given for comparison; both assume steady rotation, so they do not show instability. The first is an
upper bound
(P. Acarnley, Stepping Motors: phasor diagram), with one limit at a time:

    T(w) = min(g Km I, Nr psi V1/|Z| - Nr we psi^2 R/|Z|^2) - T_fe(w)
    we = Nr w,  psi = Km/Nr,  |Z|^2 = R^2 + we^2 L^2,  V1 = 4/pi V,  g: fundamental of the current wave over I

V is the mean of the voltages that drive a current and against which it flows back: a limited stage does both in turn.

The second predicts it, to about 6 % where the motor does not swing itself out of step. Both limits hold at once: in
axes that turn with the rotor (d along its magnets, T = Km i_q) the current vector lies in the circle that the stage
asks for and in the one that the voltage allows:

    |i| <= g I            |(R + j we L) i + j we psi| <= V1            T(w) = Km max i_q - T_fe(w)

The second circle has its centre at -j we psi / (R + j we L) and the radius V1 / |R + j we L|; with speed it moves to
negative d. With rising speed the highest point of the common area is i = j g I, then the crossing of the circles, then
the top of the second. A stage that follows its sine gives V1 = V at most. Where the second circle alone limits, the
stage asks for X = g I/|i| times the current that flows, and its voltage is a clipped sine of amplitude V 2/pi (X
asin(1/X) + sqrt(1 - 1/X^2)).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.dynamics import axis_parameters
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stage import Stage
from isel_twin.native import core

SUB_STEP_S = 25e-6  # of the bench, the same as the machine's
START_RPM = 60.0  # speed from which the bench accelerates


def mean_command(phase: NDArray[np.float64]) -> NDArray[np.float64]:
    """Time mean of the step counter floor(phase) in each sub-step: phase [n + 1] at its borders, never falling -> [n].

    Within a sub-step the phase runs evenly. Started at whole number m, it has stepped j times when it ends at m + v
    with j = floor(v), and the counter was m + i for equal times: the sum is j (j - 1)/2 + j (v - j).
    """
    begin, end = phase[:-1], phase[1:]
    whole = np.floor(begin)
    passed = end - whole
    steps = np.floor(passed)
    area = 0.5 * steps * (steps - 1.0) + steps * (passed - steps)
    mean: NDArray[np.float64] = whole + area / np.where(end > begin, end - begin, 1.0)
    return mean


def follow(
    parameters: NDArray[np.void],
    states: NDArray[np.void],
    command: NDArray[np.float64],
    load_torque_nm: NDArray[np.float64],
    limit: float,
) -> int:
    """Let the drive parameters [1], states [1] follow a command on a bench without a nut.

    command [n]: mean of the microstep counter in each sub-step; load_torque_nm [n]: against positive rotation; limit:
    ends when rotor and command are more microsteps apart. Returns the number of sub-steps made.
    """
    made: int = core.follow_command(parameters, states, command, load_torque_nm, limit)
    return made


def pull_out_torque(
    motor: Motor,
    stage: Stage,
    speed_rpm: float,
    load_inertia_kgm2: float | None = None,
    *,
    constant_load: bool = False,
    dt_s: float = SUB_STEP_S,
) -> float:
    """Pull-out torque in Nm at a speed in rev/min, 0 if the motor cannot hold the speed at all.

    load_inertia_kgm2: inertia on the shaft (None: that of the rotor). constant_load: instead of the brake a load that
    does not depend on speed and rises once the speed is reached. It does not damp, so that mid-band instability shows:
    torque is lost early, and irregularly with speed.

    Raises ValueError for a negative or infinite speed.
    """
    if not 0.0 <= speed_rpm < math.inf:
        raise ValueError(f"speed_rpm must be 0 or more, not {speed_rpm!r}")
    inertia = motor.rotor_inertia_kgm2 if load_inertia_kgm2 is None else load_inertia_kgm2
    # Below a revolution a minute every motor holds, and the bench would take too long.
    omega = max(speed_rpm, 1.0) * 2.0 * math.pi / 60.0
    rate_hz = omega / (2.0 * math.pi) * motor.full_steps_per_rev * stage.microsteps
    start_omega = min(omega, START_RPM * 2.0 * math.pi / 60.0)
    peak_nm = math.sqrt(2.0) * motor.torque_constant_nm_per_a * stage.current_a

    # Accelerate with at most 1.5 % of the peak torque; hold for at least twenty turns of the electrical angle.
    total_inertia = motor.rotor_inertia_kgm2 + inertia
    accelerate_s = max(0.3, 100.0 * total_inertia * (omega - start_omega) / peak_nm)
    hold_s = max(0.4, 20.0 * 2.0 * math.pi / (omega * motor.pole_pairs))
    t = dt_s * np.arange(round((accelerate_s + hold_s) / dt_s) + 1)
    ramp = np.minimum(t / accelerate_s, 1.0)  # smooth start: the speed follows 3 q^2 - 2 q^3
    ramp_s = accelerate_s * ramp**3 * (1.0 - 0.5 * ramp) + np.maximum(t - accelerate_s, 0.0)
    share = start_omega / omega
    phase = rate_hz * (share * t + (1.0 - share) * ramp_s)
    command = mean_command(phase)
    rise = np.clip((t[1:] - accelerate_s) / (0.5 * hold_s), 0.0, 1.0)
    rise *= rise * (3.0 - 2.0 * rise)

    def holds(torque_nm: float) -> bool:
        brake = 0.0 if constant_load else torque_nm / omega
        load = torque_nm * rise if constant_load else np.zeros_like(rise)
        return _in_step(motor, stage, Screw(inertia_kgm2=inertia), command, load, start_omega, dt_s, brake)

    return _largest(holds, peak_nm)


def pull_in_rate(
    motor: Motor,
    stage: Stage,
    load_inertia_kgm2: float = 0.0,
    load_torque_nm: float = 0.0,
    *,
    dt_s: float = SUB_STEP_S,
) -> float:
    """Highest rate at which the motor starts from rest in step, in the stage's own steps (full, half, micro) per
    second; 0 if it never starts. Lower rates near its resonance can still fail (`starts_in_step`)."""

    def starts(rate_hz: float) -> bool:
        return starts_in_step(motor, stage, rate_hz, Screw(inertia_kgm2=load_inertia_kgm2), load_torque_nm, dt_s=dt_s)

    # No motor starts at fifty times its resonance: a step would have to move it within a tenth of its period.
    return _largest(starts, 50.0 * resonance_hz(motor, stage, load_inertia_kgm2) * stage.microsteps)


def starts_in_step(
    motor: Motor,
    stage: Stage,
    rate_hz: float,
    screw: Screw | None = None,
    load_torque_nm: float = 0.0,
    *,
    full_steps: int = 100,
    dt_s: float = SUB_STEP_S,
) -> bool:
    """True if the motor, at rest with the stage on, starts at rate_hz and makes that many full steps, losing none.

    rate_hz: as in `pull_in_rate`. screw: on the shaft, without its nut. Raises ValueError for a rate that is not above
    0.
    """
    if not 0.0 < rate_hz < math.inf:
        raise ValueError(f"rate_hz must be above 0, not {rate_hz!r}")
    steps = full_steps * stage.microsteps
    settle_s, after_s = 0.2, 0.1
    t = dt_s * np.arange(round((settle_s + steps / rate_hz + after_s) / dt_s) + 1)
    command = mean_command(np.clip((t - settle_s) * rate_hz, 0.0, float(steps)))
    return _in_step(motor, stage, screw or Screw(), command, np.full(len(command), load_torque_nm), 0.0, dt_s)


def resonance_hz(motor: Motor, stage: Stage, load_inertia_kgm2: float = 0.0) -> float:
    """Natural frequency of the rotor in the field of the stage at standstill: sqrt(Nr T / J) / 2 pi. Full steps near
    this rate, or a whole fraction of it, excite it."""
    motor = motor.at_current(stage.vector_a)
    length = math.sqrt(2.0) if stage.microsteps == 1 else 1.0
    stiffness = motor.pole_pairs * length * motor.torque_constant_nm_per_a * stage.current_a
    return math.sqrt(stiffness / (motor.rotor_inertia_kgm2 + load_inertia_kgm2)) / (2.0 * math.pi)


def pull_out_envelope(motor: Motor, stage: Stage, speed_rpm: float) -> float:
    """Upper bound of the pull-out torque in Nm (first closed form), 0 or more."""
    motor = motor.at_current(stage.vector_a)
    omega = speed_rpm * 2.0 * math.pi / 60.0
    electrical = motor.pole_pairs * omega
    resistance = motor.resistance_ohm + stage.extra_resistance_ohm
    impedance = math.hypot(resistance, electrical * motor.inductance_h)
    km = motor.torque_constant_nm_per_a
    by_supply = km * 4.0 / math.pi * 0.5 * (stage.drive_v + stage.supply_v) / impedance
    by_supply -= electrical * km**2 / motor.pole_pairs * resistance / impedance**2
    by_current = _fundamental(stage) * km * stage.current_a
    return max(0.0, min(by_current, by_supply) - motor.iron_torque_nm(omega))


def pull_out_prediction(motor: Motor, stage: Stage, speed_rpm: float) -> float:
    """Predicted pull-out torque in Nm (second closed form), 0 or more."""
    found: float = pull_out_predictions(motor, stage, np.array([speed_rpm], np.float64)).item()
    return found


def pull_out_predictions(motor: Motor, stage: Stage, speed_rpm: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same for each of these speeds [n]."""
    motor = motor.at_current(stage.vector_a)
    torque_nm = np.empty(len(speed_rpm))
    core.predict_torques(
        speed_rpm, motor.pole_pairs, motor.resistance_ohm + stage.extra_resistance_ohm, motor.inductance_h,
        motor.torque_constant_nm_per_a, motor.iron_drag_nm_s_per_rad, motor.iron_knee_rad_s,
        _fundamental(stage) * stage.current_a, 0.5 * (stage.drive_v + stage.supply_v), torque_nm,
    )  # fmt: skip
    return torque_nm


def iron_torques(motor: Motor, omega_rad_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """`Motor.iron_torque_nm` at each of these speeds [n]."""
    return np.array([motor.iron_torque_nm(speed) for speed in omega_rad_s.tolist()])


def _fundamental(stage: Stage) -> float:
    """Amplitude of the first harmonic of the stepped current wave over the peak current: the vector, of mean length 1
    in microstep, (1 + sqrt 2)/2 in half step and sqrt 2 in full step, stands between steps: sin(x)/x, x half a step."""
    half_step = math.pi / (4.0 * stage.microsteps)
    return stage.vector * math.sin(half_step) / half_step


def _in_step(
    motor: Motor,
    stage: Stage,
    screw: Screw,
    command: NDArray[np.float64],
    load_torque_nm: NDArray[np.float64],
    omega_rad_s: float,
    dt_s: float,
    brake_nm_s_per_rad: float = 0.0,
) -> bool:
    """True if the motor is never four full steps off the command. The bench adds a brake to the drag."""
    states = axis_states(1)
    states["omega_rad_s"] = omega_rad_s
    parameters = axis_parameters(motor, stage, screw, dt_s)
    parameters["drag_nm_s_per_rad"] += brake_nm_s_per_rad
    return follow(parameters, states, command, load_torque_nm, 4.0 * stage.microsteps) == len(command)


def _largest(holds: Callable[[float], bool], upper: float) -> float:
    """Largest value that holds, to 0.02 %: down from above by 5 % a step, then halving. 0 if nothing above 1 % does."""
    low = upper
    while not holds(low):
        low *= 0.95
        if low < 0.01 * upper:
            return 0.0
    high = low / 0.95
    while high - low > 2e-4 * low:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
