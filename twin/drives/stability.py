"""Is steady rotation stable? The growth of a swing of the rotor about it, and the speed from which on it grows.

A motor that turns synchronously can have torque to spare and still swing itself out of step (mid-band instability):
where the supply no longer drives the wanted current, the phase of the current follows the swing of the rotor in a way
that feeds it. No closed form holds for a stage that limits a part of each half wave, so the growth is found from the
sub-step of the machine itself, by Floquet's theorem. At constant speed everything repeats after a quarter of an
electrical period, apart from a rotation of the currents by 90 degrees (drives/13):

    x = (i_A, i_B, w, lambda)      currents, speed, load angle: state when the command is at 0
    F(x)                           the same a quarter period T4 later, currents turned back: (i_A, i_B) <- (i_B, -i_A)
    x* = F(x*)                     steady rotation (Newton, from the speed before upwards)
    mu                             eigenvalue of the slope of F about x* of the largest magnitude
    growth = ln |mu| / T4          swing frequency = arg mu / (2 pi T4)

With electronic damping its two states belong to x as well. The slope is that of the straight line through points up to
6 degrees on both sides, as large as a swing that one sees:

    F |              .-'     A stage that limits changes its voltage between two sub-steps, where a current passes
      |         .-'|.-'      0 or the wanted one. So F goes in stairs, as wide as a sub-step. A derivative sees one
      |    .-'|.-'           tread and never the risers, however short the sub-steps are; the line sees both.
      |.-'|.-'
      +-------------- x

**The limit** is the speed above which a swing grows, and is told only if it is one (`Bench.limit`):

- the supply feeds it: the swing grows by more than what the falling part of the law of the iron could feed, which was
  fitted to torques and not to swings (motor.py). Without that, a motor of little inductance had its limit at the knee
  of the law, where a swing takes a second to grow by a half;
- at 0.95 of it a swing dies and at 1.05 it grows, by more than what the line may see in error, with half and with
  twice as many sub-steps, too; where there is no rotation any more, or what grows does not swing, torque has ended;
- so does a kick of 6 degrees in the time domain;
- it is below LAST_RPM, up to where the law was fitted to makers' curves.

Range of validity. Just above growth 0 the swing is bounded by a few degrees, and a motor that is accelerated through
a narrow band may never show it, so the limit bounds the loss of steps from below, to 5 %. Friction counts as what it
is about a steady speed: viscous friction damps; Coulomb's is a load, as its describing function is 0 until the swing
turns the shaft back. Left out is what only helps: the damper of the nut. Left out, too, are the errors of a stage and
the detent torque, which shake the rotor in narrow bands at low speed, and friction that falls with speed (stick-slip
below 60 rev/min).

A rule of thumb (`rule_rpm`): the stage cannot drive the wanted current against its inductance any more,

    we = (4/pi) (V1 + V2)/2 / (L I)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.curves import pull_out_prediction
from isel_twin.drives.dynamics import axis_parameters
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stage import Stage
from isel_twin.native import core

SUB_STEPS = 80  # least number in a quarter period
LONGEST_S = 25e-6  # of a sub-step
SPAN = 1.04  # from speed to speed upwards: steady rotation is found from the one before
FIRST_RPM = 60.0
LAST_RPM = 1500.0  # of the curves to which the law was fitted (docs/fidelity.md)
NEARER, FARTHER = 0.95, 1.05  # of a limit: where a swing dies, and where it grows
FED = 0.85  # least part of the speed from which on the supply feeds a swing that the limit may be
SLIGHT_PER_S = 0.5  # growth, or decay, that the line through so large a swing may see where there is none
SLOW_HZ = 1.0  # of what grows without swinging: out of step, the torque is used up
SWING = 0.1  # of currents and speed, and rad: as far as the slope reaches, and the kick
POINTS = 4  # on each side
KICK_S = 0.25
SURE = 0.9  # by which a kick must have faded in KICK_S, or grown by its inverse
NEAR = 1e-3  # of currents, speed and rad: the last step of Newton's method; ten times that where stairs hinder it
PATIENCE = 600  # quarter periods
STATES = 6  # currents, speed, load angle; smoothed command and low pass of the electronic damping
IN_C = ("STATES",)  # records.h has them, too
AT_REST = axis_states(1)


@dataclass(frozen=True)
class Rotation:
    """Steady rotation at a speed."""

    speed_rpm: float
    growth_per_s: float  # of a swing; below 0: it dies away
    swing_hz: float  # one beyond half the frequency of quarter periods is told as its mirror image below it
    load_angle_deg: float  # electrical, by which the rotor is behind the command

    @property
    def stable(self) -> bool:
        return self.growth_per_s <= 0.0


@dataclass(frozen=True)
class Limit:
    """The speed up to which rotation is stable, and what ends it."""

    speed_rpm: float
    ends: Literal["swing", "torque", "unsure", ""]
    """unsure: a swing grows about there, but not so that a limit could be told; "": nothing does, up to there."""

    @property
    def swings(self) -> bool:
        return self.ends == "swing"


@dataclass(frozen=True)
class _Steady:
    rotation: Rotation
    state: NDArray[np.float64]  # x*
    map_: _Map


class Bench:
    """A motor on a stage with a shaft and a constant torque on it."""

    def __init__(self, motor: Motor, stage: Stage, load_nm: float = 0.0, shaft: Screw | None = None) -> None:
        """load_nm: against the rotation; shaft: turns with the rotor, without its nut; None: as much inertia as the
        rotor has."""
        if not 0.0 <= load_nm < math.inf:
            raise ValueError(f"load_nm must be 0 or more, not {load_nm!r}")
        self.motor = replace(motor, detent_torque_nm=0.0)
        self.stage = replace(stage, step_error=0.0, current_offset=0.0)
        self.load_nm = load_nm
        self.shaft = replace(shaft or Screw(inertia_kgm2=motor.rotor_inertia_kgm2), breakaway_ratio=1.0)
        self._friction_nm = load_nm + self.shaft.coulomb_nm

    def rotations(self, speeds_rpm: Sequence[float]) -> Iterator[Rotation | None]:
        """Steady rotation at rising speeds; None where there is none any more."""
        near, below = None, FIRST_RPM
        for speed_rpm in speeds_rpm:
            between = (below * SPAN**k for k in range(math.ceil(math.log(speed_rpm / below) / math.log(SPAN))))
            for each in (*between, speed_rpm):  # each is found from the one before
                near = self._steady(each, near)
                if near is None:
                    yield from (None for later in speeds_rpm if later >= speed_rpm)
                    return
            below = speed_rpm
            assert near is not None
            yield near.rotation

    def limit(self) -> Limit:
        """The speed above which a swing grows that the supply feeds, to 1 rev/min, if it is one on both sides."""
        found: list[_Steady] = []
        for k in range(math.ceil(math.log(LAST_RPM / FIRST_RPM) / math.log(SPAN))):
            speed_rpm = FIRST_RPM * SPAN**k
            there = self._steady(speed_rpm, found[-1] if found else None)
            if there is None and pull_out_prediction(self.motor, self.stage, speed_rpm) < self._friction_nm:
                return Limit(found[-1].rotation.speed_rpm if found else 0.0, "torque")
            if there is None or there.rotation.growth_per_s > self._iron_feeds_per_s(speed_rpm) + SLIGHT_PER_S:
                return self._onset(found, speed_rpm)
            found.append(there)
        return Limit(LAST_RPM, "")

    def _iron_feeds_per_s(self, speed_rpm: float) -> float:
        """Growth of a swing by the slope of the iron loss, where that falls with speed."""
        ratio = speed_rpm * math.pi / 30.0 / self.motor.iron_knee_rad_s
        slope = self.motor.iron_drag_nm_s_per_rad * (1.0 - ratio**2) / (1.0 + ratio**2) ** 2
        return max(0.0, -slope / (2.0 * (self.motor.rotor_inertia_kgm2 + self.shaft.inertia_kgm2)))

    def _onset(self, found: Sequence[_Steady], fed_rpm: float) -> Limit:
        """The limit below the speed at which the supply feeds a swing, from what was found below that."""
        speeds = [*(each.rotation.speed_rpm for each in found), fed_rpm]
        last = next((k for k in reversed(range(len(found))) if found[k].rotation.stable), None)
        if last is None or speeds[last] < FED * fed_rpm:
            return Limit(fed_rpm, "unsure")
        low, high_rpm = found[last], speeds[last + 1]
        while high_rpm - low.rotation.speed_rpm > 1.0:
            middle_rpm = 0.5 * (low.rotation.speed_rpm + high_rpm)
            there = self._steady(middle_rpm, low)
            if there is not None and there.rotation.stable:
                low = there
            else:
                high_rpm = middle_rpm
        confirmed = self._moves(low, NEARER) == {False} and self._moves(low, FARTHER) == {True}
        return Limit(low.rotation.speed_rpm, "swing" if confirmed else "unsure")

    def _moves(self, near: _Steady, factor: float) -> set[bool | None]:
        """Every answer to whether a swing grows at a speed near that of a limit; None: not to be told. More than one
        means that it depends on the sub-steps, or that a kick contradicts."""
        answers: set[bool | None] = set()
        for finer in (0.5, 1.0, 2.0):
            there = self._steady(factor * near.rotation.speed_rpm, near, finer)
            swing = None if there is None or there.rotation.swing_hz < SLOW_HZ else there.rotation
            growth_per_s = 0.0 if swing is None else swing.growth_per_s
            answers.add(None if abs(growth_per_s) < SLIGHT_PER_S else growth_per_s > 0.0)
        if there is not None:
            answers.add(there.map_.kicked(there.state))
        return answers

    def _steady(self, speed_rpm: float, near: _Steady | None, finer: float = 1.0) -> _Steady | None:
        """Steady rotation at a speed, from one nearby; None where there is none. finer: sub-steps."""
        omega = speed_rpm * math.pi / 30.0
        quarter_s = 0.5 * math.pi / (self.motor.pole_pairs * omega)
        count = round(finer * max(SUB_STEPS, math.ceil(quarter_s / LONGEST_S)))
        map_ = _Map(self, omega, quarter_s, count)
        state = self._guess(omega) if near is None else near.state.copy()
        state[2] = omega
        slope = map_.settle(state)
        if slope is None:
            return None
        values = np.linalg.eigvals(slope)
        largest = values[np.abs(values).argmax()]
        growth = math.log(max(abs(largest), 1e-300)) / quarter_s
        swing_hz = float(abs(np.angle(largest))) / (2.0 * math.pi * quarter_s)
        return _Steady(Rotation(speed_rpm, growth, swing_hz, math.degrees(state[3])), state, map_)

    def _guess(self, omega: float) -> NDArray[np.float64]:
        """Currents that follow their wave, and the load angle that goes with the load."""
        torque = self._friction_nm + self.motor.iron_torque_nm(omega)
        peak = self.motor.torque_constant_nm_per_a * self.stage.current_a
        state = np.zeros(STATES)
        state[0], state[2] = self.stage.current_a, omega
        state[3] = math.asin(min(0.95, torque / peak))
        return state


class _Map:
    """F: from the state at a quarter period's beginning to that at its end."""

    def __init__(self, bench: Bench, omega: float, quarter_s: float, count: int) -> None:
        stage = bench.stage
        self.parameters = axis_parameters(bench.motor, stage, bench.shaft, quarter_s / count, 0.0)
        self.used = STATES if stage.damping_gain and not stage.stepped else STATES - 2
        self.quarter_s, self.load_nm, self._states = quarter_s, bench.load_nm, AT_REST.copy()
        counter = np.arange(count + 1) * (stage.microsteps / count)
        self.command = 0.5 * (counter[1:] + counter[:-1])
        self.scale = np.array([stage.current_a, stage.current_a, omega, 1.0, 1.0, 1.0])[: self.used]

    def __call__(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty(STATES)
        core.quarter(self.parameters, AT_REST, self._states, self.command, self.load_nm, state, out)
        return out[: self.used]

    def settle(self, state: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Bring a state to x*, and return the slope of F about it; None if that fails. Where the stage begins to limit,
        Newton's method may go astray: then the motor turns by itself for a while first, which leads there if it is
        stable."""
        began = state.copy()
        slope = self._newton(state)
        if slope is not None:
            return slope
        state[:] = began
        return None if self._turned(state, PATIENCE) is None else self._newton(state)

    def _newton(self, state: NDArray[np.float64]) -> NDArray[np.float64] | None:
        for step in range(20):
            off = self(state) - state[: self.used]
            change = np.linalg.solve(np.eye(self.used) - self.slope(state, 1), off)
            far = float(np.abs(change / self.scale).max())
            if not far < math.inf or abs(state[3]) > math.pi:
                return None
            state[: self.used] += change / max(1.0, far / 0.5)
            if far < NEAR * (1.0 if step < 10 else 10.0):
                return self.slope(state, POINTS)
        return None

    def slope(self, state: NDArray[np.float64], points: int) -> NDArray[np.float64]:
        """That of the straight line through so many points on both sides of each number of the state."""
        columns = np.zeros((self.used, self.used))
        away = SWING / points * self.scale
        away[:2] *= min(1.0, 3.0 * math.hypot(state[0], state[1]) / self.scale[0])  # if no more can flow
        core.slopes(self.parameters, AT_REST, self._states, self.command, self.load_nm, state, away, points, columns)
        return columns.T

    def kicked(self, state: NDArray[np.float64]) -> bool | None:
        """True if the swing grows that a kick out of x* makes, False if it dies, None if it does neither clearly."""
        state = state.copy()
        state[3] += SWING
        lags = self._turned(state, 4 * math.ceil(0.25 * KICK_S / self.quarter_s))
        if lags is None:
            return True
        first, *_, last = lags.reshape(4, -1).std(axis=1)
        return None if SURE < last / first < 1.0 / SURE else bool(last > first)

    def _turned(self, state: NDArray[np.float64], quarters: int) -> NDArray[np.float64] | None:
        """Load angles after each of so many quarter periods, and the state then; None if the motor drops out."""
        lags = np.empty(quarters)
        kept = core.quarters(self.parameters, AT_REST, self._states, self.command, self.load_nm, state, lags)
        return lags if kept else None


LOAD_SHARE = 0.1  # load over the torque at standstill, of a motor without an axis; the limit changes little with it


def limit_rad_s(motor: Motor, stage: Stage, screw: Screw, guide_friction_n: float) -> float:
    """The limit of an axis; inf if there is none, or none that could be told."""
    shaft = Screw(screw.inertia_kgm2, screw.coulomb_nm, viscous_nm_s_per_rad=screw.viscous_nm_s_per_rad)
    return _limit_rad_s(motor, stage, guide_friction_n * screw.travel_m_per_rad / screw.efficiency, shaft)


@lru_cache(1024)  # three axes of some hundred machines, as searches have them
def _limit_rad_s(motor: Motor, stage: Stage, load_nm: float, shaft: Screw) -> float:
    limit = Bench(motor, stage, load_nm, shaft).limit()
    return limit.speed_rpm * math.pi / 30.0 if limit.swings else math.inf


def rule_rpm(motor: Motor, stage: Stage) -> float:
    """The rule of thumb."""
    mean_v = 0.5 * (stage.drive_v + stage.supply_v)
    electrical = 4.0 / math.pi * mean_v / (motor.inductance_h * stage.current_a)
    return electrical / motor.pole_pairs * 30.0 / math.pi
