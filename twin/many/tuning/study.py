"""Chooses the settings to try: an Optuna study with two objectives, in a database.

    batch 0: trials 0 .. 7      batch 1: trials 8 .. 15     ...
    ask all 8 -> judge them, by any executor -> tell all 8, in their order

A trial depends on the batches before it and on the values of its own batch, never on the speed of workers. Every trial
has a new sampler, with a seed from the study's seed and the trial's number, so that an interrupted study continues as
if without interruption: trials asked but not told are judged first, with their values from the database.

    trial 0                    the job as it is, or the nearest values in the ranges
    then a few at random       the same for all moves, even with settings of each move: most need similar ones
    then                       compose.py: the best known settings of each move, and new ones for a few of them,
                               from Optuna's tree-structured Parzen estimator or near the best

A setting that loses a step is pruned at once. Objectives: least time and greatest margin.
"""

from __future__ import annotations

import dataclasses
import functools
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from isel_twin.base.crew import Crew, Stop, in_order
from isel_twin.base.errors import one_line
from isel_twin.many.tuning.compose import best_of_each, composed, distributions, sampler
from isel_twin.many.tuning.judge import Judgement, Made, Weather, judged
from isel_twin.many.tuning.result import PUT_TOGETHER, Held, Tried, confirm
from isel_twin.many.tuning.space import SETTINGS, Parameter, Problem
from isel_twin.many.tuning.structure import Structure

if TYPE_CHECKING:
    import optuna

BATCH = 8  # trials that are chosen together
RANDOM = 12  # random trials at the beginning, at most a third of all
MENDED = 60  # most corrections of the composed best settings


class StudyError(ValueError):
    """A study cannot begin or continue; the message is one line with the reason and the remedy."""


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
        """storage: Optuna URL of a database; None: in memory. seed: of the choice of trials. least: the wanted
        margin."""
        self.problem = problem
        self.seed = seed
        self.least = least
        self._where = _place(storage)
        self.batch = batch
        self._weather = Weather.of(problem)
        self._numbers = (*range(problem.repetitions + 1), *problem.may_be)
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
            what = "job" if "job" in other else ", another ".join(other)  # much else depends on the job
            raise StudyError(
                f"{self._where}: study {self._study.study_name!r} is of another {what}; choose another name or another "
                "storage"
            )

    @property
    def tried(self) -> list[Tried]:
        """All finished trials, in their order."""
        over = self._trials("COMPLETE", "PRUNED")
        return [Tried(one.number, one.params, _judgement(one.user_attrs["judgement"])) for one in over]

    def reference(self, what: str) -> Judgement | None:
        """The judgement of the job `as it stands`, or with the `defaults` of the controller, if there is one."""
        told = self._study.user_attrs.get(what)
        return None if told is None else _judgement(told)

    def judge_references(self, stop: Stop | None = None) -> None:
        """Judge the job as it is and with the defaults of the controller, unless already done."""
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
        """Continue until there are this many trials in all, or `stop` returns True. told: called with each finished
        trial."""
        while not (stop is not None and stop()):
            with _storing(self._where):
                asked = self._trials("RUNNING") or self._ask(trials)  # first those asked but never told
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
        """Compose the best known settings of each move and confirm them on `wanted` new machines. After a failure the
        failing move gets its next best settings, at most MENDED times. None if nothing was found, or if stopped. hard:
        machines to try first, extended by those with failures. told: called with each failure.
        """
        seen, been = self.tried, set[tuple[int, ...]]()
        for _ in range(MENDED):
            values = best_of_each(self.problem, seen, self.least)
            if (key := tuple(values.values())) in been:
                return None
            been.add(key)
            candidate = self.problem.candidate(values)
            held = confirm(self.problem, candidate, wanted, 0.0, crew, stop, hard=hard)
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
        """Ask for the rest of the next batch; all trials before are over."""
        over = len(self._study.get_trials(deepcopy=False)) - len(self._trials("WAITING"))
        many = min(trials, (over // self.batch + 1) * self.batch) - over
        given: Sequence[dict[str, int] | None]
        if len(self.problem.groups) == 1 and (planned := self._planned()) is not None:
            first = [self.problem.nearest()] if over == 0 else []
            given = [*first, *planned][: max(0, min(self.batch, trials - over))]
        else:
            given = [self._given(number, trials) for number in range(over, over + many)]
        for number, values in enumerate(given, over):
            if not self._trials("WAITING") and values is not None:
                self._study.enqueue_trial(values)
            with _quiet():
                self._study.sampler = sampler(self.seed, number)
                self._study.ask(distributions(self.problem.parameters))
        return self._trials("RUNNING")

    def _given(self, number: int, trials: int) -> dict[str, int] | None:
        """Values of the first trials, which are fixed or random, and of those with settings of each move."""
        if number == 0:
            return self.problem.nearest()
        if number > min(RANDOM, max(1, trials // 3)):
            with _quiet():
                return composed(self.problem, self.tried, self.least, self.seed, number)
        draw = np.random.default_rng([self.seed, number])
        share = {setting: draw.uniform() for setting in SETTINGS}
        return {parameter.name: _between(parameter, share[parameter.setting]) for parameter in self.problem.parameters}

    def _planned(self) -> list[dict[str, int]] | None:
        """The next trials by the structure of the problem, none if nothing is worth one; None if nothing is known to
        hold."""
        before = self.reference("as it stands")
        known = [] if before is None else [Tried(-1, self.problem.nearest(), before)]
        known += self.tried
        if not any(each.judgement.good for each in known):
            return None
        return Structure(self.problem).chosen(known, self.least, self.batch)

    def _tell(self, trial: optuna.trial.FrozenTrial, judgement: Judgement) -> None:
        from optuna.trial import TrialState

        # attributes must be set before the trial is over: afterwards nothing can be added
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
    """The judgement from its attributes in a database."""
    return Judgement(**{**kept, "moves": tuple(Made(*each) for each in kept["moves"])})


def _opened(storage: str | None, name: str) -> optuna.Study:
    """A new or continued study. Raises StudyError."""
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
    """Turn errors of a database in use into StudyError."""
    from optuna.exceptions import StorageInternalError
    from sqlalchemy.exc import SQLAlchemyError

    try:
        yield
    except (SQLAlchemyError, StorageInternalError) as error:
        reason = one_line(str(getattr(error.__cause__ or error, "orig", None) or error))
        raise StudyError(f"{where}: cannot be used any more: {reason}") from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence Optuna's logging and its warnings about experimental features."""
    import optuna

    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            yield
    finally:
        optuna.logging.set_verbosity(before)
