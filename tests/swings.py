"""python -m tests.swings [--motor NAME] [--kind KIND] [--step STEP]: is the limit of the swing (drives/stability.py)
continuous, and true in the time domain?

Each of twenty motors is walked in fine steps through supply, current, inductance and inertia. From step to step a limit
may move by no more than twice the step, and at every eighth a kick must die at 0.95 of it and grow at 1.05; at a jump
it must do so on both sides. Prints a row for each walk: the first and the last limit in rev/min, how many settings have
one, and which are contradicted. Exit code 1 if any is. A quarter of an hour of processor time.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.curves import follow
from isel_twin.drives.dynamics import axis_parameters
from isel_twin.drives.library import MOTORS
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stability import Bench
from isel_twin.drives.stage import KINDS, Stage

NAMES = tuple(name for name in MOTORS if name not in ("103-546-5342", "AS1050"))  # no supply here swings these two
RANGES = {"supply": (0.6, 1.6), "current": (0.6, 1.2), "inductance": (0.6, 1.5), "inertia": (0.5, 3.0)}
STEP = 1.02
SUPPLY_V, FRICTION, LOAD = 36.0, 0.04, 0.02  # torques over that at rest
KICK_RAD, SUB_STEP_S = 0.07, 2e-6
UP_S, SETTLE_S, KICKED_S, WINDOWS, PART = 0.5, 0.15, 0.4, 16, 250
EACH = 8


def growth_per_s(motor: Motor, stage: Stage, load_nm: float, screw: Screw, speed_rpm: float) -> float:
    """Of the swing that a kick makes in the time domain, after a gentle run from rest; inf out of step. A swing that
    grows is followed to three times its beginning, one that dies to a tenth."""
    motor, screw = replace(motor, detent_torque_nm=0.0), replace(screw, breakaway_ratio=1.0)
    parameters, states = axis_parameters(motor, stage, screw, SUB_STEP_S, 0.0), axis_states(1)
    hz = speed_rpm / 60.0 * motor.full_steps_per_rev * stage.microsteps
    t = SUB_STEP_S * (np.arange(round((UP_S + SETTLE_S + KICKED_S) / SUB_STEP_S)) + 0.5)
    command = hz * np.where(t < UP_S, t * t / (2.0 * UP_S), t - 0.5 * UP_S)

    def turned(part: NDArray[np.float64]) -> float:
        """The load angle in rad after a part of the command; nan out of step."""
        done = follow(parameters, states, part, np.full(len(part), load_nm), 4.0 * stage.microsteps)
        lag = part[-1] * parameters["microstep_rad"][0] - motor.pole_pairs * states["theta_rad"][0]
        return float(lag) if done == len(part) else math.nan

    before, kicked = np.split(command, [len(t) - round(KICKED_S / SUB_STEP_S)])
    if math.isnan(turned(before)):
        return math.inf
    states["theta_rad"] -= KICK_RAD / motor.pole_pairs
    lags = np.array([turned(part) for part in kicked.reshape(-1, PART)]).reshape(WINDOWS, -1)
    if np.isnan(lags).any():
        return math.inf
    size = lags.std(axis=1) / lags[0].std()
    within = np.flatnonzero((size < 0.1) | (size > 3.0))
    last = max(1, int(within[0]) if len(within) else WINDOWS - 1)
    return math.log(size[last]) / (last * KICKED_S / WINDOWS)


def walk(name: str, kind: str, quantity: str, step: float) -> Iterator[tuple[Bench, float]]:
    """The benches of a walk, each with the factor on the quantity."""
    motor = MOTORS[name]
    current_a = motor.rated_current_a if math.isfinite(motor.rated_current_a) else 4.0
    low, high = RANGES[quantity]
    for factor in low * step ** np.arange(math.log(high / low) / math.log(step)):
        by = {quantity: float(factor)}
        stage = Stage(SUPPLY_V * by.get("supply", 1.0), current_a * by.get("current", 1.0), kind=kind)
        changed = replace(motor, inductance_h=motor.inductance_h * by.get("inductance", 1.0))
        rest_nm = motor.torque_constant_nm_per_a * current_a
        screw = Screw(motor.rotor_inertia_kgm2 * by.get("inertia", 1.0), FRICTION * rest_nm)
        yield Bench(changed, stage, LOAD * rest_nm, screw), float(factor)


def true(bench: Bench, limit_rpm: float) -> bool:
    """True if a kick dies at 0.95 of a limit and grows at 1.05."""
    below, above = (
        growth_per_s(bench.motor, bench.stage, bench.load_nm, bench.shaft, share * limit_rpm) for share in (0.95, 1.05)
    )
    return below < 0.0 < above


def row(name: str, kind: str, quantity: str, step: float = STEP) -> tuple[str, list[str]]:
    """A row of the table, and what is wrong in it: factors on the quantity, and limits."""
    told, wrong, before, number = [], [], None, 0
    for number, (bench, factor) in enumerate(walk(name, kind, quantity, step)):
        found = bench.limit()
        now = (bench, found.speed_rpm) if found.swings else None
        jumps = now is not None and before is not None and abs(math.log(now[1] / before[1])) > 2.0 * math.log(step)
        asked = [now, before] if jumps else [now] if number % EACH == 0 else []
        wrong += [f"{factor:.2f}: {one[1]:.0f}" for one in asked if one is not None and not true(*one)]
        told += [] if now is None else [found.speed_rpm]
        before = now
    ends = f"{told[0]:.0f} to {told[-1]:.0f}" if told else "none"
    return f"| {name} | {kind} | {quantity} | {ends} | {len(told)} of {number + 1} | {', '.join(wrong)} |", wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motor", choices=NAMES)
    parser.add_argument("--kind", choices=KINDS, default="fast")
    parser.add_argument("--step", type=float, default=STEP, help="factor from setting to setting")
    asked = parser.parse_args()
    good = True
    print("| motor | stage | walk | limits | told | contradicted by a kick |\n|---|---|---|---|---|---|")
    for name, quantity in itertools.product([asked.motor] if asked.motor else NAMES, RANGES):
        told, wrong = row(name, asked.kind, quantity, asked.step)
        good = good and not wrong
        print(told, flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
