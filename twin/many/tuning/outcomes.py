"""Where the edge is, as far as held and lost trials tell: three ways to lose steps, each with a threshold of its own.

    start     the start-stop frequency f is beyond F: the motor does not follow the first steps
    ramp      a / T(V) is beyond A: less torque is left at V than the ramp needs (T: over that at rest)
    speed     V is beyond S: the rotor swings itself out of step, or falls behind

A trial that held says V <= S and a/T(V) <= A and f <= F, one that lost that at least one of these is wrong; either may
be mistaken, as there are bands within the edge. Before any trial the thresholds are about what closed forms say, within
factors (log-normal, independent). The chance that a place holds is the weight of all thresholds beyond it:

    weight[S, A, F] = before * product over trials        chance[V, a, f] = sum of weight[S >= V, A >= a/T, F >= f]
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.curves import pull_out_prediction, resonance_hz
from isel_twin.drives.motor import Motor
from isel_twin.drives.stability import rule_rpm
from isel_twin.drives.stage import Stage
from isel_twin.machine import Axis

Grid = NDArray[np.float64]  # [..., 3]: speed_hz, acceleration over torque in Hz/ms, start_stop_hz

POINTS = 48  # of each threshold
MISTAKEN = 0.03  # chance that a trial says the opposite
WIDE = 4.0  # standard deviations of what is thought before, within which thresholds are looked for
SPREAD = (0.1, 1.0, 0.5)  # those of S, A and F, in the logarithm
UNTOLD = 0.5  # that of S, if no limit of the swing is told
STARTS = 6.0  # full steps a natural period at which a motor without load still starts
PULLS = 0.3  # of the torque at rest over the inertia, which friction, swing and the worst of machines leave for a ramp
DISTANCE = np.linspace(-WIDE, WIDE, POINTS)
_normal = np.exp(-0.5 * np.square(DISTANCE))
_BEFORE = _normal[:, None, None] * _normal[:, None] * _normal  # [S, A, F]


@dataclass(frozen=True)
class Thresholds:
    """What is thought of the thresholds S, A, F before any trial: the middle of each."""

    middles: tuple[float, float, float]
    spreads: tuple[float, float, float] = SPREAD

    @classmethod
    def of(cls, axis: Axis, limit_hz: float) -> Thresholds:
        """By closed forms. limit_hz: the speed from which on the axis swings itself out of step; inf: none is
        told."""
        motor, stage = axis.motor, axis.stage
        assert isinstance(motor, Motor)
        assert isinstance(stage, Stage)
        inertia = motor.rotor_inertia_kgm2 + axis.screw.inertia_kgm2
        turn_s2 = pull_out_prediction(motor, stage, 0.0) / inertia / (2.0 * math.pi)
        starts_hz = STARTS * resonance_hz(motor, stage, axis.screw.inertia_kgm2) * stage.microsteps
        ramp = PULLS * 1e-3 * turn_s2 * axis.steps_per_rev
        if math.isfinite(limit_hz):
            return cls((limit_hz, ramp, starts_hz))
        return cls((rule_rpm(motor, stage) * axis.steps_per_rev / 60.0, ramp, starts_hz), (UNTOLD, *SPREAD[1:]))

    def chance(self, places: Grid, held: Grid, lost: Grid) -> NDArray[np.float64]:
        """The chance that each place holds. held, lost: the places of trials, [n, 3]."""
        axes = [middle * np.exp(spread * DISTANCE) for middle, spread in zip(self.middles, self.spreads, strict=True)]
        weight = _BEFORE.copy()
        for point, holds in [*((point, True) for point in held), *((point, False) for point in lost)]:
            first = [int(np.searchsorted(thresholds, value)) for thresholds, value in zip(axes, point, strict=True)]
            within = weight[first[0] :, first[1] :, first[2] :]
            if holds:
                right = within.copy()
                weight *= MISTAKEN
                within[...] = right
            else:
                within *= MISTAKEN
        beyond = np.zeros([POINTS + 1] * 3)
        beyond[:-1, :-1, :-1] = weight[::-1, ::-1, ::-1].cumsum(0).cumsum(1).cumsum(2)[::-1, ::-1, ::-1]
        at = (np.searchsorted(thresholds, places[..., number]) for number, thresholds in enumerate(axes))
        found: NDArray[np.float64] = beyond[tuple(at)] / weight.sum()
        return found
