"""Which settings are tried: a study of Optuna with two objectives, kept in a database.

    batch 0: trials 0 .. 7      batch 1: trials 8 .. 15     ...
    ask all 8 -> judge them, by whatever executor -> tell all 8, in their order

A trial is chosen knowing the batches before it, and what the others of its own batch are about to try, never how fast a
worker was. The sampler is made anew for every trial, its seed drawn from the study's seed and the trial's number, so
that a study which was interrupted goes on as if it had not been: trials that had been asked and not told are judged
first, with the values the database has for them.

    trial 0                    the job as it stands, or what of the ranges comes nearest
    then a few at random       all moves alike, also if each can have its own settings: most of them want much the same
    then                       compose.py: the best that is known of each move, and something new for a few of them,
                               from Optuna's tree-structured Parzen estimator or near what is best

A setting that loses a step is pruned there and then. Objectives: time (to be small) and margin (to be large).
"""

from __future__ import annotations

import dataclasses
import functools
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from isel_twin.base.crew import Crew, Stop, in_order
from isel_twin.base.errors import one_line
from isel_twin.many.tuning.compose import best_of_each, composed, distributions, sampler
from isel_twin.many.tuning.judge import Judgement, Weather, judged
from isel_twin.many.tuning.result import PUT_TOGETHER, Held, Tried, confirm
from isel_twin.many.tuning.space import SETTINGS, Parameter, Problem

if TYPE_CHECKING:
    import optuna

BATCH = 8  # trials that are chosen together
RANDOM = 12  # trials at the beginning that are drawn at random, and at most a third of all
MENDED = 60  # times that the best of each move is mended before it is given up


class StudyError(ValueError):
    """A study cannot be begun or gone on with; the message is one line that says why and what to do."""


class Study:
    """A study of a problem in a database. Raises StudyError for a database that holds another one under its name."""

    def __init__(
        self,
        problem: Problem,
        storage: str | None = None,
        name: str = "tune",
        seed: int = 0,
        batch: int = BATCH,
        least: float = 0.0,
    ) -> None:
        """storage: URL of a database, as Optuna has it; None: in memory. seed: of the choice of trials. least: margin
        that is wanted; nothing with less is looked for."""
        self.problem = problem
        self.seed = seed
        self.least = least
        self._where = _place(storage)
        self.batch = batch
        self._weather = Weather.of(problem)
        self._numbers = range(problem.repetitions + 1)
        self._study = _opened(storage, name)
        self._check({**problem.about(), "seed of the study": seed, "size of a batch": batch})

    def _check(self, about: Mapping[str, Any]) -> None:
        had = self._study.user_attrs.get("about")
        if had is None:
            ways = [direction.name for direction in self._study.directions]
            if ways != ["MINIMIZE", "MAXIMIZE"] or self._study.get_trials(deepcopy=False):
                raise StudyError(
                    f"{self._where}: study {self._study.study_name!r} is not one of jobs; choose another name"
                )
            self._study.set_user_attr("about", dict(about))
            return
        other = [key for key, value in about.items() if had.get(key) != value]
        if other:
            what = "job" if "job" in other else ", another ".join(other)  # much follows from the job
            raise StudyError(
                f"{self._where}: study {self._study.study_name!r} is of another {what}; choose another name or another "
                "storage"
            )

    @property
    def tried(self) -> list[Tried]:
        """All trials that are over, in their order."""
        over = self._trials("COMPLETE", "PRUNED")
        return [Tried(one.number, one.params, _judgement(one.user_attrs["judgement"])) for one in over]

    def reference(self, what: str) -> Judgement | None:
        """How the job does `as it stands`, or with the `defaults` of the controller, if that has been judged."""
        told = self._study.user_attrs.get(what)
        return None if told is None else _judgement(told)

    def judge_references(self, stop: Stop | None = None) -> None:
        """Judge the job as it stands and with the defaults of the controller, unless that has been done."""
        for what, candidate in (("as it stands", self.problem.as_it_stands()), ("defaults", self.problem.defaults())):
            if self.reference(what) is None:
                judgement = judged(candidate, self._weather, self._numbers, stop=stop)
                if judgement is None:
                    return
                with _storing(self._where):
                    self._study.set_user_attr(what, dataclasses.asdict(judgement))

    def run(
        self,
        trials: int,
        crew: Crew | None = None,
        stop: Stop | None = None,
        told: Callable[[Tried], None] | None = None,
    ) -> None:
        """Go on until so many trials have been made in all, or `stop` returns True. told: given each as it is over."""
        while not (stop is not None and stop()):
            with _storing(self._where):
                asked = self._trials("RUNNING") or self._ask(trials)  # those that were asked and never told first
            if not asked:
                return
            judge = functools.partial(judged, weather=self._weather, numbers=self._numbers)
            candidates = [self.problem.candidate(trial.params) for trial in asked]
            for trial, judgement in zip(asked, in_order(judge, candidates, crew, stop), strict=False):
                if judgement is None:
                    return
                with _storing(self._where):
                    self._tell(trial, judgement)
                if told is not None:
                    told(Tried(trial.number, trial.params, judgement))

    def repaired(
        self,
        wanted: int,
        hard: list[int],
        crew: Crew | None = None,
        stop: Stop | None = None,
        told: Callable[[str], None] | None = None,
    ) -> tuple[Tried, Held] | None:
        """The best that is known of each move, made on `wanted` machines that no trial has seen, until it holds.

        Where it does not, the settings of the move to blame are worse than was known, and the next best of that move
        take their place: at most MENDED times. None if nothing has been found so, or if it was stopped. hard: machines
        that go first; those on which it failed are added. told: given what was wrong each time.
        """
        seen, been = self.tried, set[tuple[int, ...]]()
        for _ in range(MENDED):
            values = best_of_each(self.problem, seen, self.least)
            if (key := tuple(values.values())) in been:
                return None
            been.add(key)
            candidate = self.problem.candidate(values)
            held = confirm(self.problem, candidate, wanted, self.least, crew, stop, hard=hard)
            if held is None:
                return None
            if held.good:
                judgement = judged(candidate, self._weather, self._numbers, self.least, stop)
                if judgement is None:
                    return None
                seen.append(Tried(PUT_TOGETHER, values, judgement))
                if judgement.good and judgement.margin >= self.least:
                    return seen[-1], held
                continue
            if told is not None:
                told(held.why)
            if held.last.number not in hard:
                hard.append(held.last.number)
            seen.append(Tried(PUT_TOGETHER, values, held.last))
        return None

    def _trials(self, *states: str) -> list[optuna.trial.FrozenTrial]:
        from optuna.trial import TrialState

        return self._study.get_trials(deepcopy=False, states=[TrialState[state] for state in states])

    def _ask(self, trials: int) -> list[optuna.trial.FrozenTrial]:
        """The rest of the next batch."""
        over = len(self._study.get_trials(deepcopy=False)) - len(self._trials("WAITING"))
        many = min(trials, (over // self.batch + 1) * self.batch) - over
        for number in range(over, over + many):
            if not self._trials("WAITING") and (values := self._given(number, trials)) is not None:
                self._study.enqueue_trial(values)
            with _quiet():
                self._study.sampler = sampler(self.seed, number)
                self._study.ask(distributions(self.problem.parameters))
        return self._trials("RUNNING")

    def _given(self, number: int, trials: int) -> dict[str, int] | None:
        """Values of a trial that nobody has to think about."""
        if number == 0:
            return self.problem.nearest()
        if number > min(RANDOM, max(1, trials // 3)):
            with _quiet():
                return composed(self.problem, self.tried, self.least, self.seed, number)
        draw = np.random.default_rng([self.seed, number])
        share = {setting: draw.uniform() for setting in SETTINGS}
        return {parameter.name: _between(parameter, share[parameter.setting]) for parameter in self.problem.parameters}

    def _tell(self, trial: optuna.trial.FrozenTrial, judgement: Judgement) -> None:
        from optuna.trial import TrialState

        # what is told of a trial is told before it is over: afterwards nothing can be added
        self._study._storage.set_trial_user_attr(trial._trial_id, "judgement", dataclasses.asdict(judgement))
        if judgement.good:
            self._study.tell(trial.number, (judgement.time_s, judgement.margin))
        else:
            self._study.tell(trial.number, state=TrialState.PRUNED)


def _between(parameter: Parameter, share: float) -> int:
    low, high = parameter.low, parameter.high
    value = low * (high / low) ** share if parameter.log else low + share * (high - low)
    return parameter.nearest(round(value))


def _judgement(kept: Mapping[str, Any]) -> Judgement:
    """As it comes out of a database."""
    return Judgement(**{**kept, "moves": tuple((time_s, margin) for time_s, margin in kept["moves"])})


def _opened(storage: str | None, name: str) -> optuna.Study:
    """A study, new or gone on with. Raises StudyError."""
    need_optuna()
    import optuna
    from sqlalchemy.exc import SQLAlchemyError

    with _quiet():
        try:
            return optuna.create_study(
                storage=storage, study_name=name, directions=["minimize", "maximize"], load_if_exists=True
            )
        except (SQLAlchemyError, ImportError, RuntimeError, ValueError, KeyError) as error:
            reason = one_line(str(getattr(error, "orig", None) or error))
            raise StudyError(f"{_place(storage)}: cannot be used as a storage: {reason}") from error


def _place(storage: str | None) -> str:
    return "in memory" if storage is None else storage.removeprefix("sqlite:///")


def need_optuna() -> None:
    """Raise StudyError unless Optuna is installed."""
    try:
        import optuna  # noqa: F401
    except ImportError:
        raise StudyError("a study needs optuna: pip install 'isel-twin[tune]'") from None


@contextmanager
def _storing(where: str) -> Iterator[None]:
    """What goes wrong with a database in use is a StudyError."""
    from optuna.exceptions import StorageInternalError
    from sqlalchemy.exc import SQLAlchemyError

    try:
        yield
    except (SQLAlchemyError, StorageInternalError) as error:
        reason = one_line(str(getattr(error.__cause__ or error, "orig", None) or error))
        raise StudyError(f"{where}: cannot be used any more: {reason}") from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what Optuna says of every study and of what it calls experimental."""
    import optuna

    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            yield
    finally:
        optuna.logging.set_verbosity(before)
