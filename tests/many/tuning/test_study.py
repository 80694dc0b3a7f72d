"""A study: the same whoever does the work and however often it was interrupted; another job is another study."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import optuna
import pytest

from isel_twin.base.crew import here
from isel_twin.many.tuning import Judgement
from isel_twin.many.tuning import study as study_module
from isel_twin.many.tuning.compose import best_of_each
from isel_twin.many.tuning.judge import Made
from isel_twin.many.tuning.result import PUT_TOGETHER, Held, Tried, front
from isel_twin.many.tuning.study import Study, StudyError

from .small import call, problem

pytestmark = pytest.mark.long(seconds=6)


def invented(candidate: Any, weather: Any, numbers: Any, least: float = 0.0, stop: Any = None) -> Judgement | None:
    """In place of the twin: faster is quicker; beyond 2000 Hz/ms, 25 kHz on the way there, or 15 kHz on the way back
    everything is lost."""
    if stop is not None and stop():
        return None
    moves: list[Made] = []
    acceleration = 100
    for line in candidate.lines:
        code, _, rest = line.command.partition("0J")
        acceleration = int(rest) if code == "@" else acceleration
        if line.number not in candidate.moves:
            continue
        steps, speed_hz = 320 if "A" in line.command else 9600, int(line.command.split(",")[1])
        most_hz = 15_000 if line.command.startswith("@0M0,") else 25_000
        if speed_hz > most_hz or acceleration > 2000:
            return Judgement(0.1, 0.0, f"line {line.number}: X has lost 4 steps", 1, True, (*moves, Made(0.1, 0.0)))
        margin = 1.0 - speed_hz / most_hz / 1.2 - acceleration / 1e5
        moves.append(Made(steps / speed_hz + speed_hz / acceleration / 1e3, margin))
    return Judgement(sum(each.time_s for each in moves), min(each.margin for each in moves), "", 2, False, tuple(moves))


@pytest.fixture(scope="module")
def quick() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(study_module, "judged", invented)
        yield


@pytest.fixture(scope="module")
def for_all(quick: None) -> list[Tried]:
    """25 trials with the same settings for all moves."""
    study = Study(problem())
    study.run(25)
    return study.tried


@pytest.fixture(scope="module")
def whole(quick: None) -> list[Tried]:
    """Eight trials without a pause."""
    study = Study(problem(), seed=3, batch=4)
    study.run(8)
    return study.tried


def told(tried: list[Tried]) -> list[tuple[int, dict[str, int], Judgement]]:
    return [(each.number, dict(each.values), each.judgement) for each in tried]


class Late(ThreadPoolExecutor):
    """Is through with the first of what it was given last."""

    def __init__(self) -> None:
        super().__init__(8)
        self._first = threading.Event()

    def submit(self, task: Callable[..., Any], /, *arguments: Any, **_: Any) -> Future[Any]:
        before, self._first = self._first, threading.Event()
        mine = self._first

        def late() -> Any:
            made = task(*arguments)
            mine.wait(0.05)
            before.set()
            return made

        return super().submit(late)


@pytest.mark.usefixtures("quick")
def test_the_same_whoever_does_the_work() -> None:
    made = []
    for executor in (None, Late()):
        study = Study(problem(), seed=3, batch=4)
        study.run(16, here(executor))
        made.append(told(study.tried))
    assert made[0] == made[1]
    assert 4 < len(made[0]) <= 16
    others = []
    for seed in (3, 4):
        study = Study(problem(each_move=True), seed=seed, batch=4)
        study.run(4)
        others.append(told(study.tried))
    assert others[0] != others[1], "with settings of each move the seed chooses"


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("after", [1, 6])
def test_the_same_however_often_it_was_interrupted(after: int, whole: list[Tried], tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'tune.db'}"
    seen: list[Tried] = []
    first = Study(problem(), url, seed=3, batch=4)
    first.run(8, stop=lambda: len(seen) >= after, told=seen.append)
    assert len(first.tried) == after
    second = Study(problem(), url, seed=3, batch=4)
    second.run(8)
    assert told(second.tried) == told(whole)
    second.run(8)
    assert len(second.tried) == len(whole), "all have been made"


def test_optuna_logs_nothing_meanwhile_and_as_before_afterwards(quick: None, caplog: pytest.LogCaptureFixture) -> None:
    optuna.logging.enable_propagation()
    before = optuna.logging.get_verbosity()
    try:
        Study(problem()).run(2)
    finally:
        optuna.logging.disable_propagation()
    assert caplog.records == []
    assert optuna.logging.get_verbosity() == before == optuna.logging.INFO


def test_it_goes_where_it_is_fast(for_all: list[Tried]) -> None:
    """The best of 25 trials is near the cliff at 15 kHz."""
    assert front(for_all)[0].values["speed_hz"] > 13_400


@pytest.mark.usefixtures("quick")
def test_each_move_begins_with_all_alike() -> None:
    study = Study(problem(each_move=True))
    study.run(9)
    for each in study.tried[1:4]:
        accelerations = {value for name, value in each.values.items() if name.startswith("acceleration")}
        assert len(accelerations) == 1
    assert len({value for name, value in study.tried[8].values.items() if name.startswith("acceleration")}) > 1


@pytest.mark.usefixtures("quick")
def test_each_move_finds_its_own_and_beats_the_same_for_all(for_all: list[Tried]) -> None:
    """The way there can be nearly twice as fast as the way back."""
    each = Study(problem(each_move=True), least=0.1)
    each.run(48)
    assert front(each.tried)[0].judgement.time_s < 0.9 * front(for_all)[0].judgement.time_s
    again = Study(problem(each_move=True), least=0.1)
    again.run(48, here(ThreadPoolExecutor(3)))
    assert told(again.tried) == told(each.tried)


@pytest.mark.usefixtures("quick")
def test_the_best_of_each_move_is_mended_until_it_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    """On machine 7 the way there loses steps beyond 15 kHz, which no trial has seen; it alone gets slower."""
    asked = problem(each_move=True)
    study = Study(asked, least=0.1)
    study.run(40)
    best = best_of_each(asked, study.tried, 0.1)
    assert best["speed_hz.5"] > 15_000

    def confirmed(_: Any, candidate: Any, wanted: int, least: float, *__: Any, hard: Any) -> Held:
        moves = invented(candidate, None, ()).moves  # type: ignore[union-attr]
        speed_hz = int(candidate.lines[[line.number for line in candidate.lines].index(7)].command.split(",")[1])
        why = "X has lost 4 steps" if speed_hz > 15_000 else ""
        last = Judgement(1.0, 0.0 if why else 0.2, why, 1, bool(why), moves[:1] if why else moves, 7)
        return Held(1 if why else wanted, last.margin, last.margin, last, why)

    monkeypatch.setattr(study_module, "confirm", confirmed)
    hard: list[int] = []
    found = study.repaired(3, hard)
    assert found is not None
    tried, held = found
    assert held.good
    assert hard == [7]
    assert tried.number == PUT_TOGETHER
    assert tried.values["speed_hz.5"] <= 15_000
    assert {name: value for name, value in tried.values.items() if not name.endswith(".5")} == {
        name: value for name, value in best.items() if not name.endswith(".5")
    }


def test_what_is_known_of_a_move_and_who_is_to_blame() -> None:
    from isel_twin.many.tuning.compose import known

    asked = problem(each_move=True)
    values = asked.nearest()
    good = Tried(0, values, Judgement(6.0, 0.3, moves=(Made(2.0, 0.6), Made(1.0, 0.3), Made(3.0, 0.5))))
    moves = (Made(2.0, 0.6), Made(1.0, 0.0))
    lost = Tried(1, values, Judgement(3.0, 0.0, "line 6: X has lost 4 steps", 1, True, moves))
    before = Tried(2, values, Judgement(0.0, 0.0, "line 4: X has lost 4 steps", 1, True))
    found = [[(each.time_s, each.margin) for each in seen] for seen in known(asked, [good, lost, before])]
    assert found == [[(2.0, 0.6)], [(0.0, 0.0)], [(3.0, 0.5)]]
    other = {name: value + 1 for name, value in values.items()}
    lost = Tried(1, other, lost.judgement)
    found = [[(each.time_s, each.margin) for each in seen] for seen in known(asked, [good, lost, before])]
    assert found == [[(2.0, 0.6), (2.0, 0.6)], [(1.0, 0.3), (0.0, 0.0)], [(3.0, 0.5)]]


@pytest.mark.usefixtures("quick")
def test_another_job_machine_or_seed_is_refused(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'tune.db'}"
    Study(problem(), url)
    for words, what in (
        ({"call": call(machine="4030-portal")}, "machine"),
        ({"call": call(controller="imc-m", seed=2)}, "controller, another seed"),
    ):
        with pytest.raises(StudyError, match=rf"tune\.db: study 'tune' is of another {what}; choose another name or"):
            Study(problem(**words), url)
    with pytest.raises(StudyError, match=r"of another seed of the study"):
        Study(problem(), url, seed=1)
    Study(problem(call=call(machine="4030-portal")), url, "other")


def test_a_storage_that_is_none_is_told_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "no.db").write_text("this is no database at all " * 50)
    for url in (f"sqlite:///{tmp_path / 'no.db'}", "nonsense://x", "nonsense", f"sqlite:///{tmp_path / 'no' / 'x.db'}"):
        with pytest.raises(StudyError, match=r"^[^\n]*: cannot be used as a storage: [^\n]+$"):
            Study(problem(), url)


@pytest.mark.usefixtures("quick")
def test_a_storage_that_is_lost_on_the_way_is_told_in_a_line(tmp_path: Path) -> None:
    file = tmp_path / "tune.db"
    study = Study(problem(), f"sqlite:///{file}")

    def spoil(_: Tried) -> None:
        file.write_bytes(b"no database any more" * 1000)

    with pytest.raises(StudyError, match=r"^[^\n]*tune\.db: cannot be used any more: [^\n]+$"):
        study.run(8, told=spoil)


def test_a_study_of_something_else_is_left_alone(tmp_path: Path) -> None:
    import optuna

    url = f"sqlite:///{tmp_path / 'theirs.db'}"
    theirs = optuna.create_study(storage=url, study_name="tune", directions=["minimize", "maximize"])
    theirs.tell(theirs.ask(), (1.0, 2.0))
    with pytest.raises(StudyError, match=r"study 'tune' is not one of jobs; choose another name"):
        Study(problem(), url)
    one = f"sqlite:///{tmp_path / 'one.db'}"
    optuna.create_study(storage=one, study_name="tune")
    with pytest.raises(StudyError, match=r"study 'tune' is not one of jobs; choose another name"):
        Study(problem(), one)
