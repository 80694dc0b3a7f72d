r"""The reference: a hybrid motor on two switched H bridges, as equations of its own. Nothing here comes from the twin.

Motor (MathWorks Simscape "Stepper Motor"), with Rm taken for a path of iron with an inductance of its own:

    L di_A/dt = v_A - R i_A + Km w sin(Nr th)          L di_B/dt = v_B - R i_B - Km w cos(Nr th)
    J dw/dt   = -Km i_A sin(Nr th) + Km i_B cos(Nr th) - Td sin(4 Nr th) - T_iron(w) - B w - T_load

    T_iron = (Km^2/Rm) w / (1 + (w/w_k)^2)

Bridge: at each tick of a 20 kHz clock a phase is switched on in the direction of its reference; it is switched off when
the current has reached the reference, until the next tick. Off means

    slow decay    the phase is short-circuited through the lower switches, v = 0
    mixed decay   first a share of the period against the supply, v = -V sign(i), then short-circuited
    auto          slow while the reference rises, mixed while it falls, as driver chips are usually set

    i  |   /\      /\        on: v = V - i Rs        off, fast: v = -V - i Rs        off, slow: v = -i Rs
       |  /  \_   /  \_      Rs: two switches and the sense resistor
       | /     \_/     \_
       +---|-------|------ ticks of 50 us

Two solvers of the same right-hand side: `run` steps through it by the classical Runge-Kutta rule, in C (solver.c), ten
steps in a tick or more, and looks at the currents once a step; `run_adaptive` gives it to SciPy's DOP853 piece by
piece, from switching to switching, with an event where a current reaches its reference. It is slow, and shows that
`run` is right.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isel_twin.native import Core

_bridge = Core(Path(__file__).with_name("solver.c"))
SLOW, MIXED, AUTO = 0, 1, 2


@dataclass(frozen=True)
class Rig:
    """Motor, bridge and bench, in SI units."""

    resistance: float
    inductance: float
    km: float
    inertia: float
    """Rotor and what turns with it."""
    detent: float
    iron_resistance: float
    knee: float
    """w_k, of the shaft."""
    supply: float
    current: float
    microsteps: int = 10
    teeth: int = 50
    switches: float = 0.2
    brake: float = 0.0
    """Load torque over speed."""
    decay: int = AUTO
    fast_share: float = 0.3
    """Part of the clock period that mixed decay spends against the supply."""
    clock: float = 20e3
    gain: float = 0.0
    """Electronic damping."""
    corner: float = 300.0

    def array(self) -> NDArray[np.float64]:
        return np.array(
            [
                self.resistance + self.switches, self.inductance, self.km, self.inertia, self.detent,
                self.km**2 / self.iron_resistance,
                self.knee, self.supply, self.current, self.microsteps, self.teeth, self.brake, self.decay,
                self.fast_share, 1.0 / self.clock, self.gain, 2.0 * math.pi * self.corner,
            ]
        )  # fmt: skip


def run(
    rig: NDArray[np.float64],
    start_rate: float,
    rate: float,
    ramp: float,
    hold: float,
    load: float,
    rise: float,
    steps_per_tick: int,
) -> tuple[float, float, float]:
    """Where it ends: seconds until the rotor lags four full steps (or the end), the rotor angle, the mean motor torque
    over the last half of `hold`.

    The load rises to `load` within `rise` seconds after the ramp, as 3 q^2 - 2 q^3, and is there at once if rise is 0.
    """
    found = np.zeros(3)
    _bridge.run(rig, start_rate, rate, ramp, hold, load, rise, steps_per_tick, found)
    seconds, angle, torque = found.tolist()
    return seconds, angle, torque


def run_adaptive(rig: Rig, rate: float, hold: float, load: float) -> tuple[float, float]:
    """The same at an even rate and load, without damping: rotor angle at the end, mean torque of the last half."""
    from scipy.integrate import solve_ivp  # half a second, for this file alone

    a = rig.array()
    tick, per_step = a[14], 0.5 * math.pi / a[9]
    y = np.array([0.0, 0.0, 0.0, rate / a[9] / (4.0 * a[10]) * 2.0 * math.pi])
    state, fast_until = [0, 0], [0.0, 0.0]
    sign, last, falls = [1.0, 1.0], [0.0, 0.0], [False, False]
    t, end, impulse = 0.0, round(hold / tick) * tick, 0.0
    period = 0

    def motor_torque(y: NDArray[np.float64]) -> NDArray[np.float64]:
        angle = a[10] * y[2]
        return np.asarray(a[2] * (y[1] * np.cos(angle) - y[0] * np.sin(angle)))

    while t < end - 1e-12:
        step = math.floor(t * rate + 1e-9)
        ref = [a[8] * math.cos(step * per_step), a[8] * math.sin(step * per_step)]
        if t >= period * tick - 1e-12:
            period += 1
            for p in range(2):
                falls[p], last[p] = abs(ref[p]) < abs(last[p]), ref[p]
                sign[p], state[p] = (1.0 if ref[p] >= 0.0 else -1.0), 1
        for p in range(2):
            if state[p] == 1 and y[p] * sign[p] >= abs(ref[p]) - 1e-9:
                state[p] = 2 if a[12] == MIXED or (a[12] == AUTO and falls[p]) else 0
                fast_until[p] = t + a[13] * tick
            if state[p] == 2 and (t >= fast_until[p] - 1e-12 or abs(y[p]) < 1e-3):
                state[p] = 0
        v = [a[7] * sign[p] if state[p] == 1 else -a[7] * math.copysign(1.0, y[p]) * (state[p] == 2) for p in range(2)]
        stop = min([period * tick, (step + 1) / rate, *(fast_until[p] for p in range(2) if state[p] == 2)])
        if stop - t < 1e-12:  # two switchings at once, but for rounding
            t = stop
            continue
        events = []
        for p in range(2):
            if state[p] == 1:
                events.append(lambda _, y, p=p, ref=ref: y[p] * sign[p] - abs(ref[p]))
            elif state[p] == 2:
                events.append(lambda _, y, p=p: abs(y[p]) - 0.99e-3)
        for event in events:
            event.terminal = True  # type: ignore[attr-defined]

        def right(_: float, y: NDArray[np.float64], v: list[float] = v) -> NDArray[np.float64]:
            out = np.zeros(4)
            _bridge.slope(y, a, v[0], v[1], load, out)
            return out

        piece = solve_ivp(right, (t, stop), y, "DOP853", events=events, rtol=1e-8, atol=1e-9, dense_output=True)
        until = float(piece.t[-1])
        if t >= 0.5 * end:  # two Gauss points: the torque is smooth between two switchings
            middle, half = 0.5 * (t + until), 0.5 * (until - t)
            x = half / math.sqrt(3.0)
            impulse += half * float(motor_torque(piece.sol(middle - x)) + motor_torque(piece.sol(middle + x)))
        y, t = piece.y[:, -1], until
    return float(y[2]), impulse / (0.5 * end)


def pull_out(rig: Rig, rpm: float) -> float:
    """Largest torque of a brake at which it reaches a speed and holds it, to 0.3 %; 0 if there is none."""
    w = rpm * math.pi / 30.0
    full = 4 * rig.teeth * rig.microsteps / (2.0 * math.pi)
    peak = math.sqrt(2.0) * rig.km * rig.current
    start = min(w, 2.0 * math.pi)
    ramp = max(0.3, 30.0 * rig.inertia * (w - start) / peak)
    hold = max(0.4, 20.0 * 2.0 * math.pi / (w * rig.teeth))

    def holds(torque: float) -> bool:
        braked = dataclasses.replace(rig, brake=torque / w).array()
        return bool(run(braked, start * full, w * full, ramp, hold, 0.0, 0.0, 10)[0] >= ramp + hold)

    low = peak
    while not holds(low):
        low *= 0.9
        if low < 0.05 * peak:
            return 0.0
    high = low / 0.9
    while high - low > 3e-3 * low:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
