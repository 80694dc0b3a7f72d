"""The search that knows the time of a job and looks for its edge."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.many.tuning import Judgement, Problem
from isel_twin.many.tuning.judge import LEAST, Made
from isel_twin.many.tuning.result import Tried
from isel_twin.many.tuning.structure import Structure, move_time_s, steps_of

pytestmark = pytest.mark.long(seconds=4)

STEPS = (32_000, 9_600, 320)
JOB = "@07\n@0R7\n" + "".join(f"@0A{n},10000,0,30,0,30,0,30\n" for n in STEPS)
PROBLEM = Problem(JOB, TwinSpec("4030", "imc-s8"), speed_share=0.8)
LEFT = 0.2
"""Of torque and speed, that is asked for."""


@pytest.mark.parametrize(("steps", "seconds"), [(9600, 3.026), (3200, 1.026), (320, 0.126), (32, 0.030)])
def test_times_of_moves_at_3200_hz(steps: int, seconds: float) -> None:
    """By hand: 300 Hz, 100 Hz/ms, d = (3200^2 - 300^2) / 200 000 = 50.75 steps."""
    assert move_time_s(steps, 3200, 100, 300) == pytest.approx(seconds, abs=6e-4)


@pytest.mark.parametrize("steps", [5.0, 640.0, 123_456.0])
def test_steps_follow_from_the_time(steps: float) -> None:
    assert steps_of(float(move_time_s(steps, 12_000, 200, 400)), 12_000, 200, 400) == pytest.approx(steps, rel=1e-9)


@dataclass(frozen=True)
class Invented:
    """A machine of which this much is known: margins of speed and of torque, and the times. overshoot: of the rotor at
    the end of a ramp, at most."""

    limit_hz: float
    strongest: float
    overshoot: float = 0.0

    def margins(self, speed: Any, acceleration: Any, start: Any) -> tuple[Any, Any]:
        """What is left of torque and of speed (broadcast); nothing: steps are lost."""
        limit_hz = self.limit_hz / (1.0 + self.overshoot * np.sin(acceleration / 60.0) ** 2)
        pulled = 0.15 + acceleration / self.strongest * (1.0 + (start / 3000.0) ** 2)
        reserve = np.where(speed > 1.15 * limit_hz, 0.0, np.maximum(1.0 - 0.8 * speed / limit_hz, 0.001))
        return 1.0 - pulled / (1.0 - speed / 60_000.0), reserve

    def made(self, values: dict[str, int]) -> Judgement:
        speed, acceleration, start = (values[key] for key in ("speed_hz", "acceleration_hz_per_ms", "start_stop_hz"))
        torque, reserve = map(float, self.margins(speed, acceleration, start))
        if torque <= 0.0 or reserve <= 0.0:
            return Judgement(0.0, 0.0, "lost", slipped=True)
        moves = [float(move_time_s(n, speed, acceleration, start)) for n in STEPS]
        kept = max(torque, 0.001), reserve
        return Judgement(sum(moves) + 0.5, min(kept), "", moves=tuple(Made(t, *kept) for t in moves))

    def stored(self, values: dict[str, int]) -> Judgement:
        """The same machine of a controller that stores moves and carries them out with the last, in half steps: there
        is a time of all, and no margin."""
        told = self.made(values)
        if not told.good or told.margin < LEFT:
            return Judgement(0.0, 0.0, "lost", slipped=True)
        moves = (*[Made(0.0, 1.0)] * (len(STEPS) - 1), Made(told.time_s - 0.5, LEAST, LEAST))
        return Judgement(told.time_s, LEAST, "", moves=moves, torque=LEAST, speed=LEAST)

    def best_s(self) -> float:
        """The time of the fastest of 9000 settings that leave as much as is asked for."""
        speeds, ramps, starts = np.arange(5000, 20_500, 200), np.geomspace(50, 4000, 40).astype(int), (150, 600, 2400)
        places = np.meshgrid(speeds, ramps, starts)
        times_s = sum(move_time_s(n, *places) for n in STEPS) + 0.5
        return float(times_s[np.minimum(*self.margins(*places)) >= LEFT].min())


def searched(machine: Callable[[dict[str, int]], Judgement], least: float) -> float:
    """The time of the fastest of 25 trials."""
    structure, tried = Structure(PROBLEM), [Tried(0, PROBLEM.nearest(), machine(PROBLEM.nearest()))]
    while len(tried) < 25 and (batch := structure.chosen(tried, least, 8)):
        assert len(batch) <= 8
        for values in batch[: 25 - len(tried)]:
            assert values not in [one.values for one in tried], "nothing is learnt from a trial made twice"
            tried.append(Tried(len(tried), values, machine(values)))
    judged = [one.judgement for one in tried]
    return min(one.time_s for one in judged if one.good and one.margin >= least)


@pytest.mark.parametrize(
    ("limit_hz", "strongest", "overshoot", "behind"),
    [(19_000.0, 900.0, 0.0, 0.003), (20_500.0, 300.0, 0.0, 0.008), (19_000.0, 1800.0, 0.015, 0.005)],
)
def test_twenty_five_trials_come_near_the_best(
    limit_hz: float, strongest: float, overshoot: float, behind: float
) -> None:
    machine = Invented(limit_hz, strongest, overshoot)
    assert searched(machine.made, LEFT) <= (1.0 + behind) * machine.best_s()


@pytest.mark.parametrize(
    ("limit_hz", "strongest", "behind"),
    [(19_000.0, 900.0, 0.02), (15_000.0, 300.0, 0.055), (20_500.0, 300.0, 0.055), (19_000.0, 1800.0, 0.02)],
)
def test_so_they_do_where_only_losses_and_the_time_of_all_moves_are_told(
    limit_hz: float, strongest: float, behind: float
) -> None:
    machine = Invented(limit_hz, strongest)
    assert searched(machine.stored, 0.0) <= (1.0 + behind) * machine.best_s()


def test_nothing_is_tried_that_something_lesser_has_lost() -> None:
    start = Tried(0, PROBLEM.nearest(), Invented(19_000.0, 900.0).made(PROBLEM.nearest()))
    lost = dataclasses.replace(start, number=1, values={**PROBLEM.nearest(), "speed_hz": 12_000, "start_stop_hz": 150})
    lost = dataclasses.replace(lost, judgement=Judgement(0.0, 0.0, "lost", slipped=True))
    for values in Structure(PROBLEM).chosen([start, lost], 0.2, 8):
        assert values["speed_hz"] < 12_000 or values["acceleration_hz_per_ms"] < 100


def test_a_single_trial_can_be_asked_for_where_only_losses_are_told() -> None:
    start = Tried(0, PROBLEM.nearest(), Invented(19_000.0, 900.0).stored(PROBLEM.nearest()))
    assert len(Structure(PROBLEM).chosen([start], 0.0, 1)) == 1


def test_where_nothing_holds_it_has_nothing_to_say() -> None:
    lost = Tried(0, PROBLEM.nearest(), Judgement(0.0, 0.0, "lost", slipped=True))
    assert Structure(PROBLEM).chosen([lost], 0.2, 8) == []
