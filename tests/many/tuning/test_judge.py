"""A setting judged: a safe one, a brave one and what lies between rank as they should, on the same machines."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from isel_twin.base.crew import here
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.result import Result
from isel_twin.machine import MachineError
from isel_twin.many.tuning import Judgement, confirm
from isel_twin.many.tuning import judge as judge_module
from isel_twin.many.tuning.judge import Made, Weather, judged, make
from isel_twin.many.tuning.result import Held, Tried, front, tuned
from isel_twin.many.tuning.settling import Settling
from isel_twin.plant import PlantError

from .small import BRAVE, SAFE, problem

QUICK = {"speed_hz": 21_000, "acceleration_hz_per_ms": 500, "start_stop_hz": 400}


def test_safe_quick_and_brave() -> None:
    asked = problem(repetitions=2)
    weather = Weather.of(asked)
    stands, safe, quick, brave = (
        judged(candidate, weather, range(3))
        for candidate in (asked.as_it_stands(), *map(asked.candidate, (SAFE, QUICK, BRAVE)))
    )
    assert stands is not None
    assert safe is not None
    assert quick is not None
    assert brave is not None
    assert safe.time_s > stands.time_s > quick.time_s
    assert (safe.good, stands.good, quick.good, brave.good) == (True, True, True, False)
    assert safe.margin > quick.margin > brave.margin == 0.0
    assert (quick.repetitions, brave.repetitions) == (3, 1), "what is lost stays lost"
    assert brave.slipped
    assert [len(each.moves) for each in (stands, quick, brave)] == [3, 3, 1], "the move to blame is the last"
    assert sum(each.time_s for each in stands.moves) == pytest.approx(stands.time_s)
    assert brave.why.startswith("line 7: X has lost ")


def test_the_time_is_that_of_the_trapezoids() -> None:
    """From the first move on, without the reference run: v = 9 kHz, a = 100 Hz/ms, f0 = 300 Hz; the feed has a ramp,
    too. A ramp takes (v - f0) / a and (v^2 - f0^2) / 2 a steps; the pulses of a tick more or less."""
    asked = problem()
    made = make(asked.as_it_stands(), Weather.of(asked), 0)
    assert made is not None

    def way_s(steps: int, v: float) -> float:
        a, f0 = 100e3, 300.0
        return 2 * (v - f0) / a + (steps - (v * v - f0 * f0) / a) / v

    assert made.time_s == pytest.approx(way_s(9600, 9000.0) + way_s(320, 1000.0) + way_s(9920, 9000.0), rel=0.005)


def test_repetitions_are_the_same_for_all_settings_and_differ_from_each_other() -> None:
    asked = problem()
    weather = Weather.of(asked)
    candidate = asked.as_it_stands()
    first, again, second = (make(candidate, weather, number) for number in (1, 1, 2))
    assert first == again
    assert first is not None
    assert second is not None
    assert first.margin != second.margin


def test_what_is_stopped_is_nothing() -> None:
    asked = problem()
    assert judged(asked.as_it_stands(), Weather.of(asked), range(2), stop=lambda: True) is None
    assert confirm(asked, asked.as_it_stands(), 2, stop=lambda: True) is None


def test_of_repetitions_of_which_the_last_is_cut_off_the_moves_that_all_have_made_are_judged() -> None:
    whole = Judgement(9.0, 0.5, repetitions=1, moves=(Made(4.0, 0.6, 0.9), Made(5.0, 0.8, 0.5)))
    cut_off = Judgement(3.0, 0.0, "line 2: X has lost 1 step", 1, True, (Made(3.0, 0.7, 0.4),), 1)
    made = (Made(4.0, 0.6, 0.4),)
    assert Judgement.of([whole, cut_off]) == Judgement(9.0, 0.0, cut_off.why, 2, True, made, 1)


def test_a_job_that_is_refused_is_told_with_its_line() -> None:
    from isel_twin.many.tuning import Problem

    asked = Problem("@07\n@0M100,9000,0,30,0,30,0,30\n", repetitions=0)
    found = judged(asked.as_it_stands(), Weather.of(asked), range(1))
    assert found is not None
    assert (found.why, found.slipped) == ("line 2: @0M100,9000,0,30,0,30,0,30 (line 2): R: not referenced", False)


def test_a_trial_on_which_the_simulation_runs_away_is_one_that_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    def runs_away(*_: object) -> None:
        raise PlantError("axis y: runs away at 33.770500 s")

    monkeypatch.setattr(judge_module, "played", runs_away)
    asked = problem()
    found = judged(asked.as_it_stands(), Weather.of(asked), range(2))
    assert found == Judgement(0.0, 0.0, "axis y: runs away at 33.770500 s", 1, True)


def test_confirmed_is_what_holds_on_machines_that_no_trial_has_seen() -> None:
    asked = problem()
    seen: list[int] = []
    held = confirm(asked, asked.candidate(QUICK), 3, told=lambda each: seen.append(each.number))
    assert held is not None
    assert seen == [2, 3, 4], "0 and 1 belong to the trials"
    assert (held.good, held.made, held.lost) == (True, 3, 0)
    with ThreadPoolExecutor(2) as executor:
        assert confirm(asked, asked.candidate(QUICK), 3, crew=here(executor)) == held
    assert (
        confirm(asked, asked.candidate(QUICK), 3, told=lambda each: seen.append(each.number), hard=[9, 4]) is not None
    )
    assert seen[3:] == [4, 2, 3], "where others have failed first"
    strict = confirm(asked, asked.candidate(QUICK), 3, least=0.99)
    assert strict is not None
    assert (strict.good, strict.made) == (False, 1)
    brave = confirm(asked, asked.candidate(BRAVE), 3)
    assert brave is not None
    assert (brave.good, brave.lost) == (False, 1)


def one(number: int, time_s: float, margin: float, why: str = "") -> Tried:
    return Tried(number, {}, Judgement(time_s, margin, why))


def test_the_front_has_what_none_else_beats() -> None:
    tried = [one(0, 9.0, 0.6), one(1, 5.0, 0.5), one(2, 5.0, 0.5), one(3, 4.0, 0.0, "lost"), one(4, 6.0, 0.4)]
    assert [each.number for each in front(tried)] == [1, 0]


def test_permanent_are_the_ramps_of_the_most_careful_move() -> None:
    asked = problem(each_move=True)
    values = dict(asked.nearest())
    values |= {"acceleration_hz_per_ms.5": 700, "start_stop_hz.6": 250}
    found = tuned(asked, Tried(0, values, Judgement(1.0, 0.5)), Held(1, 0.5, 0.5, Judgement(1.0, 0.5)))
    assert found.permanent == ("@0IL", "@0Ij250", "@0IJ100", "@0IW")
    assert "@0J700\n@0M9600" in found.candidate.text


class Ringing:
    """Stands in for a twin whose second axis rings: 0.1 mm, 50 Hz, down to a tenth in 0.02 s ln 10."""

    def __init__(self) -> None:
        self.time_ns = 7_000_000_000

    def run_until(self, time_ns: int) -> None:
        self.time_ns = time_ns

    @property
    def position_error_mm(self) -> np.ndarray:
        t_s = (self.time_ns - 7_000_000_000) / 1e9
        return np.array([0.5, 0.3 + 0.1 * np.exp(-t_s / 0.02) * np.cos(2 * np.pi * 50.0 * t_s), 0.0])


def result(number: int, ok: bool = True) -> Result:
    return Result(number, "@0P", "0", ok, 0, 0, (), ())


def test_it_rings_until_its_last_peak_beyond_the_bound() -> None:
    """Peaks every 10 ms: 0.1 exp(-0.5 n). The one at 40 ms is 0.0135 mm, the next 0.0082."""
    twin = Ringing()
    settling = Settling(twin, 0.01, (4, 5))  # type: ignore[arg-type]
    settling.take(result(3))
    settling.take(result(5, ok=False))
    assert twin.time_ns == 7_000_000_000, "another line, and one that was refused"
    settling.take(result(4))
    assert settling.of_line_ns == {4: pytest.approx(42_000_000, abs=3_000_000)}
    assert settling.dwelt_ns == 200_000_000
    assert settling.spared_ns == settling.dwelt_ns - settling.of_line_ns[4]


def test_a_time_with_settling_is_longer_by_what_each_move_rings() -> None:
    asked, patient = problem(), problem(settle_mm=0.0005)
    plain = make(asked.as_it_stands(), Weather.of(asked), 0)
    rings = make(patient.as_it_stands(), Weather.of(patient), 0)
    longer_s = [long.time_s - short.time_s for long, short in zip(rings.moves, plain.moves, strict=True)]
    assert all(0.0 <= each <= 0.2 for each in longer_s)
    assert max(longer_s) > 0.005
    assert rings.time_s == pytest.approx(plain.time_s + sum(longer_s), abs=1e-3)
    still = problem(settle_mm=5.0)
    assert make(still.as_it_stands(), Weather.of(still), 0).time_s == pytest.approx(plain.time_s, abs=1e-3)
    assert patient.about()["settling"] == 0.0005
    assert "settling" not in asked.about()


def test_a_time_on_the_line_is_longer_by_the_bits_of_what_is_sent_and_answered() -> None:
    """Ten bits a byte, from the first move on; each command is answered by one byte, a pause by none."""
    asked, slow = problem(), problem(call=TwinSpec(line_speed=1200))
    plain, timed = (make(each.as_it_stands(), Weather.of(each), 0) for each in (asked, slow))
    job = asked.as_it_stands()
    sent = [line.sent for line in job.lines if line.number >= job.first and line.sent]
    assert timed.time_s - plain.time_s == pytest.approx(sum(10 * (len(each) + 1) for each in sent) / 1200, abs=2e-3)
    assert timed.line.endswith(" of it on the line, 1200 8N1")
    assert slow.about()["line"] == [1200, 0.0]
    assert "line" not in asked.about()


def test_a_repetition_whose_machine_cannot_be_built_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    made = judge_module.perturbed_twin

    def some(call: TwinSpec, number: int, *more: Any) -> Any:
        if number == 1:
            raise MachineError("machine.toml: axes.x.travel: 9000 mm; allowed: up to 400 mm")
        return made(call, number, *more)

    monkeypatch.setattr(judge_module, "perturbed_twin", some)
    asked = problem(repetitions=2)
    judgement = judged(asked.candidate(SAFE), Weather.of(asked), range(3))
    assert judgement is not None
    assert judgement.good
    assert (judgement.repetitions, judgement.number) == (2, 2)
