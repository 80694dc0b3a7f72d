"""Is steady rotation stable? The growth of a small swing of the rotor about it, and the speed from which on it grows.

A motor that turns synchronously can have torque to spare and still swing itself out of step (mid-band instability):
where the supply no longer drives the wanted current, the phase of the current follows the swing of the rotor in a way
that feeds it. No closed form holds for a stage that limits a part of each half wave, so the growth is found from the
sub-step of the machine itself, by Floquet's theorem. At constant speed everything repeats after a quarter of an
electrical period, apart from a rotation of the currents by 90 degrees (drives/13):

    x = (i_A, i_B, w, lambda)      currents, speed, load angle: state when the command is at 0
    F(x)                           the same a quarter period T4 later, currents turned back: (i_A, i_B) <- (i_B, -i_A)
    x* = F(x*)                     steady rotation (Newton, from the speed before upwards)
    mu                             eigenvalue of dF/dx at x* of the largest magnitude
    growth = ln |mu| / T4          swing frequency = arg mu / (2 pi T4)

With electronic damping its two states belong to x as well.

Range of validity. Small swings: just above growth 0 the swing is bounded by a few degrees, and a motor that is
accelerated through a narrow band may never show it. The first loss of steps in the time domain lies at 1.03 to 1.26 of
the speed of zero growth (twelve cases of motor, supply and load), so that speed is a bound from below and not far off.
Left out are the errors of a stage (step accuracy, offset) and the detent torque, which shake the rotor in narrow bands
at low speed without end to its reach. Iron loss above its knee feeds the swing a little, which is a property of the
fitted law (motor.py): without a knee the limit of a NEMA 23 at 48 V lies at 894 instead of 793 rev/min. The growth rate
needs short sub-steps; that of the machine, 25 us, gives too small a growth (4.5 instead of 14 a second at 850 rev/min),
and the same onset.

A rule of thumb (`rule_rpm`): the stage cannot drive the wanted current against its inductance any more,

    we = (4/pi) (V1 + V2)/2 / (L I)        within -8 to +15 % where R I is below 0.15 of the supply
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.compiling import contains, njit
from isel_twin.drives.dynamics import BOTH, FILES, axis_parameters, step_axis
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stage import Stage

SUB_STEPS = 80  # least number in a quarter period
LONGEST_S = 5e-6  # of a sub-step
SPAN_RPM = 20.0  # from speed to speed upwards: steady rotation is found from the one before
FIRST_RPM = 60.0
LAST_RPM = 6000.0
PATIENCE = 600  # quarter periods
STATES = 6  # currents, speed, load angle; smoothed command and low pass of the electronic damping
AT_REST = axis_states(1)


@dataclass(frozen=True)
class Rotation:
    """Steady rotation at a speed."""

    speed_rpm: float
    growth_per_s: float  # of a small swing; below 0: it dies away
    swing_hz: float  # one beyond half the frequency of quarter periods is told as its mirror image below it
    load_angle_deg: float  # electrical, by which the rotor is behind the command

    @property
    def stable(self) -> bool:
        return self.growth_per_s <= 0.0


@dataclass(frozen=True)
class Limit:
    """The speed up to which rotation is stable, and what ends it."""

    speed_rpm: float
    swings: bool  # True: a swing grows; False: the torque does not suffice, or there is no limit up to LAST_RPM


_Found = tuple[NDArray[np.float64] | None, Rotation | None]


class Bench:
    """A motor on a stage with an inertia and a constant torque on its shaft."""

    def __init__(self, motor: Motor, stage: Stage, load_nm: float = 0.0, load_kgm2: float | None = None) -> None:
        """load_nm: against the rotation; load_kgm2: on the shaft beside the rotor, None: as much as the rotor has."""
        if not 0.0 <= load_nm < math.inf:
            raise ValueError(f"load_nm must be 0 or more, not {load_nm!r}")
        self.motor = replace(motor, detent_torque_nm=0.0)
        self.stage = replace(stage, step_error=0.0, current_offset=0.0)
        self.load_nm = load_nm
        self._screw = Screw(inertia_kgm2=motor.rotor_inertia_kgm2 if load_kgm2 is None else load_kgm2)
        self._used = STATES if self.stage.damping_gain and not self.stage.stepped else STATES - 2

    def rotations(self, speeds_rpm: Sequence[float]) -> Iterator[Rotation | None]:
        """Steady rotation at rising speeds; None where there is none any more."""
        state, below = None, FIRST_RPM
        for speed_rpm in speeds_rpm:
            between = np.arange(below, speed_rpm, SPAN_RPM)  # each is found from the one before
            for each in (*between, speed_rpm):
                state, found = self._rotation(float(each), state)
                if found is None:
                    break
            below = speed_rpm
            yield found
            if found is None:
                yield from (None for later in speeds_rpm if later > speed_rpm)
                return

    def limit(self, last_rpm: float = LAST_RPM) -> Limit:
        """The speed at which the growth passes 0 for the first time upwards, to 1 rev/min."""
        state: NDArray[np.float64] | None = None
        below = 0.0
        for speed_rpm in np.arange(FIRST_RPM, last_rpm + SPAN_RPM, SPAN_RPM):
            there, found = self._rotation(float(speed_rpm), state)
            if found is None and not below:
                return Limit(0.0, swings=False)
            if found is None or not found.stable:
                return self._between(below, float(speed_rpm), state, swings=found is not None)
            state, below = there, float(speed_rpm)
        return Limit(last_rpm, swings=False)

    def _between(self, low_rpm: float, high_rpm: float, state: NDArray[np.float64] | None, swings: bool) -> Limit:
        while high_rpm - low_rpm > 1.0:
            middle = 0.5 * (low_rpm + high_rpm)
            there, found = self._rotation(middle, state)
            if found is not None and found.stable:
                low_rpm, state = middle, there
            else:
                high_rpm, swings = middle, found is not None
        return Limit(low_rpm, swings)

    def _rotation(self, speed_rpm: float, near: NDArray[np.float64] | None) -> _Found:
        """The state x* at a speed and what it does, from a state nearby; None where there is none.

        F jumps where a current passes 0 just as a sub-step begins, and one number of sub-steps in six leads to x* just
        there, which looks like growth. So only what grows with each of five numbers grows. (Seldom it looks like less
        growth: a quarter of it on a source of voltage at 600 rev/min without load.)"""
        quarter_s = 0.5 * math.pi / (self.motor.pole_pairs * speed_rpm * math.pi / 30.0)
        count = max(SUB_STEPS, math.ceil(quarter_s / LONGEST_S))
        best: _Found = (None, None)
        for more in (0, 7, 13, 22, 31):
            state, found = self._one(speed_rpm, near, quarter_s, count + more)
            if found is not None and (best[1] is None or found.growth_per_s < best[1].growth_per_s):
                best = state, found
            if best[1] is not None and best[1].stable:
                break
        return best

    def _one(self, speed_rpm: float, near: NDArray[np.float64] | None, quarter_s: float, count: int) -> _Found:
        omega = speed_rpm * math.pi / 30.0
        parameters = axis_parameters(self.motor, self.stage, self._screw, quarter_s / count)
        map_ = _Map(parameters, self.stage, self.load_nm, omega, count, self._used)
        state = self._guess(omega) if near is None else near.copy()
        state[2] = omega
        if not map_.settle(state) or abs(state[3]) > math.pi:
            return None, None
        values = np.linalg.eigvals(map_.slope(state))
        largest = values[np.abs(values).argmax()]
        growth = math.log(max(abs(largest), 1e-300)) / quarter_s
        swing_hz = float(abs(np.angle(largest))) / (2.0 * math.pi * quarter_s)
        return state, Rotation(speed_rpm, growth, swing_hz, math.degrees(state[3]))

    def _guess(self, omega: float) -> NDArray[np.float64]:
        """Currents that follow their wave, and the load angle that goes with the load."""
        torque = self.load_nm + self.motor.iron_torque_nm(omega)
        peak = self.motor.torque_constant_nm_per_a * self.stage.current_a
        state = np.zeros(STATES)
        state[0], state[2] = self.stage.current_a, omega
        state[3] = math.asin(min(0.95, torque / peak))
        return state


class _Map:
    """F: from the state at a quarter period's beginning to that at its end."""

    def __init__(
        self, parameters: NDArray[np.void], stage: Stage, load_nm: float, omega: float, count: int, used: int
    ) -> None:
        self.parameters, self.used, self._states = parameters, used, AT_REST.copy()
        counter = np.arange(count + 1) * (stage.microsteps / count)
        self.command = 0.5 * (counter[1:] + counter[:-1])
        self.load_nm = load_nm
        self.scale = np.array([stage.current_a, stage.current_a, omega, 1.0, 1.0, 1.0])[:used]

    def __call__(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty(STATES)
        quarter(self.parameters, AT_REST, self._states, self.command, self.load_nm, state, out)
        return out[: self.used]

    def settle(self, state: NDArray[np.float64]) -> bool:
        """Bring a state to x*; True if that succeeds. Where the stage begins to limit, Newton's method may go astray:
        then the motor turns by itself for a while first, which leads there if it is stable."""
        began = state.copy()
        if self._newton(state):
            return True
        state[:] = began
        for _ in range(PATIENCE):
            state[: self.used] = self(state)
            if not abs(state[3]) < math.pi:  # out of step
                return False
        return self._newton(state)

    def _newton(self, state: NDArray[np.float64]) -> bool:
        off = self._off(state)
        for _ in range(40):
            if np.abs(off).max() < 1e-8:
                return True
            change = np.linalg.solve(np.eye(self.used) - self.slope(state), self(state) - state[: self.used])
            if not np.isfinite(change).all() or abs(state[3]) > math.pi:
                return False
            share = 1.0 / max(1.0, float(np.abs(change / self.scale).max()) / 0.5)
            for _ in range(8):
                tried = state.copy()
                tried[: self.used] += share * change
                there = self._off(tried)
                if np.linalg.norm(there) < np.linalg.norm(off):
                    break
                share *= 0.5
            state[:], off = tried, there
        return bool(np.abs(off).max() < 1e-5)

    def _off(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        off: NDArray[np.float64] = (self(state) - state[: self.used]) / self.scale
        return off

    def slope(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """dF/dx by central differences."""
        columns = np.empty((self.used, self.used))
        away = 1e-5 * self.scale
        scratch = np.empty((3, STATES))
        differences(self.parameters, AT_REST, self._states, self.command, self.load_nm, state, away, columns, scratch)
        return columns.T


@njit(nogil=True)
def quarter(parameters, at_rest, states, command, load_nm, x, out):
    """Advance the drive parameters[0] by a quarter electrical period from state x [6]; the state then to out [6].
    states: of the drive on the way, from at_rest on."""
    states[0] = at_rest[0]
    p, s = parameters[0], states[0]
    half_pi = 0.5 * np.pi
    s.current_a_a, s.current_b_a, s.omega_rad_s = x[0], x[1], x[2]
    s.theta_rad = -x[3] / p.pole_pairs
    s.smooth_rad = p.phase_offset_rad + x[4]
    s.lag_rad = x[5]
    s.command = -1.0
    for k in range(len(command)):
        step_axis(p, s, command[k], BOTH, 1.0, 0.0, 0.0, load_nm)
    out[0], out[1], out[2] = s.current_b_a, -s.current_a_a, s.omega_rad_s
    out[3] = half_pi - p.pole_pairs * s.theta_rad
    out[4] = s.smooth_rad - p.phase_offset_rad - half_pi
    out[5] = s.lag_rad


@njit(nogil=True, error_model="numpy")
def differences(parameters, at_rest, states, command, load_nm, x, away, columns, scratch):
    """What `quarter` makes of x [6] with each of its numbers away [n] further up, less what it makes of it as far
    down, over the way between: to columns [n, n], one for each number that is moved. scratch [3, 6]."""
    tried, up, down = scratch[0], scratch[1], scratch[2]
    for k in range(x.shape[0]):
        tried[k] = x[k]
    for k in range(columns.shape[0]):
        tried[k] = x[k] + away[k]
        quarter(parameters, at_rest, states, command, load_nm, tried, up)
        tried[k] = x[k] - away[k]
        quarter(parameters, at_rest, states, command, load_nm, tried, down)
        tried[k] = x[k]
        for i in range(columns.shape[1]):
            columns[k, i] = (up[i] - down[i]) / (2.0 * away[k])


contains(__name__, *FILES)


LOAD_SHARE = 0.1  # load over the torque at standstill; the limit changes little with it


@lru_cache(64)
def limit_rad_s(motor: Motor, stage: Stage) -> float:
    """The limit under LOAD_SHARE of the torque; inf if no swing grows below LAST_RPM."""
    limit = Bench(motor, stage, LOAD_SHARE * motor.torque_constant_nm_per_a * stage.current_a).limit()
    return limit.speed_rpm * math.pi / 30.0 if limit.swings else math.inf


def rule_rpm(motor: Motor, stage: Stage) -> float:
    """The rule of thumb."""
    mean_v = 0.5 * (stage.drive_v + stage.supply_v)
    electrical = 4.0 / math.pi * mean_v / (motor.inductance_h * stage.current_a)
    return electrical / motor.pole_pairs * 30.0 / math.pi
