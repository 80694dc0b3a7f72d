"""The working spindle: a motor on a frequency converter, its rotor, and what a cut takes from it (drives/16).

    contactor, command --> converter: ramp --> J dw/dt = T - friction - load --> speed, angle
    contactor open: the motor has no current; friction, load and a brake stop the rotor

    runs up and down   |dn/dt| <= max_speed / run_up, and what torque -+ friction -+ load can do with the inertia
    reached            n = command - slip x load / torque: an asynchronous motor gives way under load
    overloaded         friction + load > torque: it slows down, to standstill if the load stays

Everything is constant between two changes of command, contactor or load, so speed is a line in time and angle a
parabola, both in closed form: a speed does not depend on when it is looked at. Speeds are signed: positive turns
clockwise, seen from above (M03).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from isel_twin.base.parameters import check, number, word
from isel_twin.base.units import SECOND_NS

_RAD_S = 2.0 * math.pi / 60.0  # of 1 rev/min
FULL_SCALE = 255  # of the output `analog`: 10 V


@dataclass(frozen=True)
class Spindle:
    """A spindle, as `[spindle]` of a machine file has it. Raises ValueError for a number out of range and a motor that
    cannot turn itself."""

    max_rev_min: float = number("1/min", 100.0, 100_000.0, key="max_speed")  # at 10 V, and with speed_from = "fixed"
    run_up_s: float = number("s", 0.01, 60.0, key="run_up")  # ramp of the converter, from standstill to max_speed
    torque_nm: float = number("N m", 0.001, 200.0, key="torque")
    inertia_kgm2: float = number("kg m2", 1e-7, 1.0, key="inertia")  # rotor, collet and tool
    friction_nm: float = number("N m", 0.0, 20.0, key="friction")  # bearings, seals and fan
    slip_rev_min: float = number("1/min", 0.0, 5_000.0, key="slip")  # what the whole torque takes from the speed
    # of a brake that grips when the contactor opens; 0: the spindle coasts
    brake_nm: float = number("N m", 0.0, 200.0, key="brake", optional=True, default=0.0)
    # analog: the output of 0 to 10 V; fixed: a knob at the spindle, which stands at max_speed
    speed_from: str = word("analog", "fixed", default="analog")

    def __post_init__(self) -> None:
        check(self)
        if self.friction_nm >= self.torque_nm:
            raise ValueError(f"spindle: friction must be less than torque, {self.torque_nm:g} N m")
        if not self.friction_nm + self.brake_nm:
            raise ValueError("spindle: without friction and brake it would never stop")

    def wanted_rev_min(self, analog: int, told_rev_min: int | None) -> float:
        """Command for the output `analog` and, where the controller gives one, `spindle_speed`."""
        if told_rev_min is not None:
            return min(max(float(told_rev_min), -self.max_rev_min), self.max_rev_min)
        return self.max_rev_min * (1.0 if self.speed_from == "fixed" else analog / FULL_SCALE)


@dataclass(frozen=True)
class Turning:
    """A stretch of a spindle's motion in which nothing changes: from t_ns on the speed runs in `ramp` rev/min a second
    from `speed` to `goal`, and stays there."""

    t_ns: int = 0
    speed: float = 0.0  # rev/min
    goal: float = 0.0
    ramp: float = 0.0  # signed
    angle: float = 0.0  # turns at t_ns, since power-on

    @property
    def end_ns(self) -> int:
        """When the goal is reached."""
        if self.speed == self.goal:
            return self.t_ns
        return self.t_ns + math.ceil((self.goal - self.speed) / self.ramp * SECOND_NS)

    def speed_rev_min(self, t_ns: int) -> float:
        if t_ns >= self.end_ns:
            return self.goal
        return self.speed + self.ramp * (t_ns - self.t_ns) / SECOND_NS

    def turns(self, t_ns: int) -> float:
        ramp_ns = min(t_ns, self.end_ns) - self.t_ns
        now = self.speed_rev_min(t_ns if t_ns < self.end_ns else self.end_ns)
        minutes = ((self.speed + now) / 2.0 * ramp_ns + self.goal * (t_ns - self.t_ns - ramp_ns)) / SECOND_NS / 60.0
        return self.angle + minutes


def turning(spindle: Spindle, at: Turning, t_ns: int, wanted: float, load_nm: float, *, live: bool) -> Turning:
    """How it goes on from t_ns. wanted: command, rev/min; load_nm: against its turning; live: the contactor is on."""
    speed = at.speed_rev_min(t_ns)
    against = spindle.friction_nm + load_nm  # at a turning rotor
    able = spindle.max_rev_min / spindle.run_up_s
    per_nm = 1.0 / spindle.inertia_kgm2 / _RAD_S  # rev/min a second
    if not live:
        goal, ramp = 0.0, (against + spindle.brake_nm) * per_nm
    elif against >= spindle.torque_nm:
        goal, ramp = 0.0, (against - spindle.torque_nm) * per_nm
    else:
        given_way = min(spindle.slip_rev_min * load_nm / spindle.torque_nm, abs(wanted))
        goal = wanted - math.copysign(given_way, wanted)
        if speed * goal < 0.0:  # it turns round by way of standstill
            goal = 0.0
        up = abs(goal) > abs(speed)
        ramp = min(able, (spindle.torque_nm + (-against if up else against)) * per_nm)
    if ramp <= 0.0:
        goal = speed
    return Turning(t_ns, speed, goal, math.copysign(ramp, goal - speed), at.turns(t_ns))
