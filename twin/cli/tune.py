"""`isel-twin tune`: the fastest settings of a job that lose no step, and how the real controller gets them.

What has been tried is in a database, so that the same command goes on after Ctrl-C, or with more trials.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors, one_line
from isel_twin.cli.crews import crew_of
from isel_twin.cli.interruption import interruption
from isel_twin.cli.jobs import job_name, read_job
from isel_twin.cli.options import (
    ControllerName,
    MachineName,
    Overrides,
    ScenarioFile,
    Timeout,
    Whole,
    Workers,
    check_seconds,
    check_writable,
    is_standard_input,
    parse_overrides,
)
from isel_twin.cli.outputs import many
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    from isel_twin.base.crew import Crew
    from isel_twin.many.tuning import Problem, Tuned
    from isel_twin.many.tuning.judge import Judgement
    from isel_twin.many.tuning.result import Tried
    from isel_twin.many.tuning.study import Study

TRIALS = 60
ROBUST = 5
CONFIRM = 50
LEAST = 0.2
BATCH = 8


def tune(
    job: Annotated[Path, Parameter(help="File of controller commands, one a line.")],
    /,
    *,
    each_move: Annotated[bool, Parameter(help="Settings of its own for each move; equal lines share them.")] = False,
    trials: Annotated[Whole, Parameter(help="Settings that are tried, those of earlier calls among them.")] = TRIALS,
    margin: Annotated[float, Parameter(help="Least pull-out margin that the tuned job has to keep, 0 .. 1.")] = LEAST,
    robust: Annotated[Whole, Parameter(help="Slightly different machines on which each setting is judged.")] = ROBUST,
    confirm: Annotated[Whole, Parameter(help="Further machines on which the tuned job has to hold.")] = CONFIRM,
    speed: Annotated[str | None, Parameter(help="LOW:HIGH in Hz, of rapid ways; one number: fixed.")] = None,
    acceleration: Annotated[str | None, Parameter(help="LOW:HIGH in Hz/ms.")] = None,
    start_stop: Annotated[str | None, Parameter(help="LOW:HIGH in Hz.")] = None,
    rapid: Annotated[
        Whole | None, Parameter(help="Speeds in the job from here (Hz) are rapid; slower ones are feeds and stay.")
    ] = None,
    machine: MachineName = MACHINE,
    controller: ControllerName = TwinSpec.controller,
    seed: Annotated[Whole, Parameter(help="Seed of the machines and of the choice of settings.")] = TwinSpec.seed,
    set: Overrides = (),
    scenario: ScenarioFile = None,
    flash: Annotated[Path | None, Parameter(help="The controller's flash memory; is only read.")] = None,
    timeout: Timeout = 3600.0,
    storage: Annotated[
        str | None, Parameter(help="Database of what has been tried: file, or URL as Optuna has it. JOB.tune.db")
    ] = None,
    study: Annotated[str, Parameter(help="Name of the study in it.")] = "tune",
    workers: Workers = 1,
    batch: Annotated[Whole, Parameter(help="Settings that are chosen together, so workers that help.")] = BATCH,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), help="The tuned job. JOB.tuned.txt")] = None,
    permanent: Annotated[
        Path | None, Parameter(help="Commands that make its ramps the controller's own. JOB.permanent.txt")
    ] = None,
    picture: Annotated[Path | None, Parameter(help="Draw time against margin (.png, .svg).")] = None,
    json: Annotated[bool, Parameter(help="One line of JSON a trial, then one with the summary.")] = False,
) -> int:
    """Find the fastest settings of a job that lose no step and keep a margin, also on slightly different machines.

    Tried are the speed of its rapid ways, the acceleration and the start-stop frequency, for the whole job or, with
    --each-move, for each of its moves. Each setting is judged on the machine as it is and on --robust others
    (power-on position, supply 5 %, friction 20 %, masses and payload 10 %), the same ones for all; the first lost step
    ends it. The fastest that keeps --margin there has to keep it on --confirm others, too.

    Written are the job with its new lines, and the commands that make its ramps the controller's own. What has been
    tried stays in --storage: after Ctrl-C the same command goes on. The time counts from the first move; the reference
    run before it is not tuned.

    Exit code 0 if a setting holds; 1 if none does, and nothing is written; 130 after Ctrl-C.
    """
    if is_standard_input(job):
        raise CallError("-: the tuned job stands beside the job; name a file")
    _check_numbers(trials, robust, confirm, workers, batch, margin, seed, rapid)
    check_seconds("timeout", timeout, 0.0)
    bounds = {"speed_hz": speed, "acceleration_hz_per_ms": acceleration, "start_stop_hz": start_stop}
    ranges = {name: _range(name, text) for name, text in bounds.items() if text is not None}
    read_job(job, controller)  # says what is wrong with it, with its line
    database = storage if storage is not None else str(job.with_name(f"{job.stem}.tune.db"))
    file = None if "://" in database else Path(database)
    out = out or job.with_name(f"{job.stem}.tuned{job.suffix}")
    permanent = permanent or job.with_name(f"{job.stem}.permanent{job.suffix}")
    check_writable(out, permanent, picture, file, kept=(job, scenario, flash))
    call = TwinSpec(machine, controller, "mujoco", seed, scenario, None, overrides=parse_overrides(set))

    from isel_twin.base.files import Claim, atomic_write
    from isel_twin.base.pictures import check_picture
    from isel_twin.core.warm import told_of_compiling
    from isel_twin.jobs.job import decode_job
    from isel_twin.jobs.robust import check
    from isel_twin.many.tuning import Problem, front
    from isel_twin.many.tuning.study import Study, StudyError, need_optuna

    try:
        need_optuna()
        if picture is not None:
            check_picture(picture, "tune")
    except StudyError as error:
        raise CallError(str(error)) from None
    with call_errors(job):
        image = flash.read_bytes() if flash is not None else None
        check(call, robust + confirm)
        problem = Problem(
            decode_job(job.read_bytes()),
            call,
            each_move=each_move,
            rapid_hz=rapid,
            ranges=ranges,
            repetitions=robust,
            timeout_s=timeout,
            flash=image,
        )
    with ExitStack() as stack:
        if file is not None:
            with call_errors(file):
                stack.callback(Claim(file).release)
        with call_errors(database):
            begun = Study(problem, f"sqlite:///{file}" if file is not None else database, study, seed, batch, margin)
        stack.enter_context(told_of_compiling())
        stopped = stack.enter_context(interruption())
        show = _Json() if json else stack.enter_context(_Table(trials, confirm))
        crew = stack.enter_context(crew_of(workers))
        stack.enter_context(_failures())
        begun.judge_references(lambda: bool(stopped))
        before = begun.reference("as it stands")
        if before is not None and not before.good and not before.slipped:
            raise CallError(f"{job}: {before.why}; a job has to run before it can be tuned: isel-twin run {job}")
        show.begun(begun, problem)
        begun.run(trials, crew, lambda: bool(stopped), show.tried)
        found = None if stopped else _chosen(problem, begun, confirm, margin, crew, stopped, show)
        if picture is not None:
            marks = {"job as it stands": before, "controller's defaults": begun.reference("defaults")}
            if found is not None:
                marks = {"tuned": found.tried.judgement, **marks}
            drawn = {name: one for name, one in marks.items() if one is not None}
            with call_errors(picture):
                kind = picture.suffix.removeprefix(".").lower()
                atomic_write(picture, front.draw(kind, job_name(job), begun.tried, drawn, margin))
        if found is not None:
            with call_errors(out):
                atomic_write(out, found.candidate.text.encode())
            with call_errors(permanent):
                atomic_write(permanent, _permanent_text(job, found).encode())
    show.over(job, begun, found, bool(stopped), (out, permanent), trials)
    if stopped:
        return 128 + stopped[0]
    return 0 if found is not None else 1


def _check_numbers(
    trials: int, robust: int, confirm: int, workers: int, batch: int, margin: float, seed: int, rapid: int | None
) -> None:
    """Refuse numbers that are none. Raises CallError."""
    for name, value, low in (
        ("trials", trials, 1), ("robust", robust, 0), ("confirm", confirm, 1), ("workers", workers, 1),
        ("batch", batch, 1), ("seed", seed, 0), ("rapid", 1 if rapid is None else rapid, 1),
    ):  # fmt: skip
        if value < low:
            raise CallError(f"{name} {value}: must be a whole number from {low}", option=True)
    if not 0.0 <= margin <= 1.0:
        raise CallError(f"margin {margin:g}: must be from 0 to 1", option=True)


def _range(name: str, text: str) -> tuple[int, int]:
    option = {"speed_hz": "speed", "acceleration_hz_per_ms": "acceleration", "start_stop_hz": "start-stop"}[name]
    low, colon, high = text.partition(":")
    try:
        return int(low), int(high if colon else low)
    except ValueError:
        raise CallError(f"{option} {text}: must be LOW:HIGH, for example 5000:20000", option=True) from None


@contextmanager
def _failures() -> Iterator[None]:
    """What ends a study from outside is told in a line."""
    from isel_twin.many.tuning.study import StudyError

    try:
        yield
    except StudyError as error:
        raise CallError(str(error)) from None


def _chosen(
    problem: Problem,
    study: Study,
    confirm: int,
    least: float,
    crew: Crew,
    stopped: Sequence[int],
    show: _Json | _Table,
) -> Tuned | None:
    """The fastest setting of the front that holds; None if none does, or if it was stopped."""
    from isel_twin.many.tuning.result import confirm as confirmed
    from isel_twin.many.tuning.result import front, tuned

    hard: list[int] = []
    if problem.each_move and any(tried.judgement.good for tried in study.tried):
        show.puts_together()
        mended = study.repaired(confirm, hard, crew, lambda: bool(stopped), show.mended)
        if mended is not None:
            return tuned(problem, *mended)
        if stopped:
            return None
    for tried in front(study.tried):
        if tried.judgement.margin < least:
            continue
        candidate = problem.candidate(tried.values)
        show.confirms(tried)
        held = confirmed(problem, candidate, confirm, least, crew, lambda: bool(stopped), show.confirmed, hard)
        if held is None:
            return None
        if held.good:
            return tuned(problem, tried, held)
        show.fell(tried, held.why)
        if held.last.number not in hard:
            hard.append(held.last.number)
    return None


def _permanent_text(job: Path, found: Tuned) -> str:
    """A job file that makes the ramps the controller's own."""
    about = f"# Makes the ramps found for {job.name} the controller's own, also after power-off."
    return "\n".join((about, *found.permanent, ""))


def _summary(study: Study, found: Tuned | None) -> dict[str, Any]:
    from isel_twin.many.tuning.result import PUT_TOGETHER, as_json, front, gain

    def reference(what: str) -> Judgement | None:
        return study.reference(what)

    told: dict[str, Any] = {"summary": True, "found": found is not None, "trials": len(study.tried)}
    told["pruned"] = sum(not tried.judgement.good for tried in study.tried)
    for key, what in (("as_it_stands", "as it stands"), ("defaults", "defaults")):
        judgement = reference(what)
        told[key] = None if judgement is None else as_json(judgement)
    told["front"] = [
        {"trial": one.number, "values": dict(one.values), **as_json(one.judgement)} for one in front(study.tried)
    ]
    if found is not None:
        own, held = found.tried.judgement, found.held
        number = None if found.tried.number == PUT_TOGETHER else found.tried.number
        told["tuned"] = {"trial": number, "values": dict(found.tried.values), **as_json(own)}
        told["permanent"] = list(found.permanent)
        told["confirmed"] = {
            "repetitions": held.made, "lost": held.lost, "margin": round(held.margin, 4),
            "margin_of_95_percent": round(held.nearly_all, 4),
        }  # fmt: skip
        for key, what in (("saved", "as it stands"), ("saved_against_defaults", "defaults")):
            judgement = reference(what)
            good = judgement is not None and judgement.good
            told[key] = round(gain(own.time_s, judgement.time_s), 6) if good and judgement is not None else None
    return told


class _Json:
    """A line a trial and one for the summary."""

    def begun(self, study: Study, problem: Problem) -> None:
        """The job as it stands and the defaults have been judged; what was tried before is told again."""
        for tried in study.tried:
            self.tried(tried)

    def tried(self, tried: Tried) -> None:
        """A trial is over."""
        from isel_twin.many.tuning.result import as_json

        self._say({"trial": tried.number, "values": dict(tried.values), **as_json(tried.judgement)})

    def puts_together(self) -> None:
        """The best of each move is going to be put together."""

    def mended(self, why: str) -> None:
        """It did not hold, and is going to be mended."""
        self._say({"trial": None, "not_confirmed": why})

    def confirms(self, tried: Tried) -> None:
        """A setting is going to be confirmed."""

    def confirmed(self, repetition: Judgement) -> None:
        """It has been made once more."""

    def fell(self, tried: Tried, why: str) -> None:
        """It did not hold."""
        self._say({"trial": tried.number, "not_confirmed": why})

    def over(
        self, job: Path, study: Study, found: Tuned | None, stopped: bool, files: Sequence[Path], trials: int
    ) -> None:
        """All is over."""
        written = [str(file) for file in files] if found is not None else []
        self._say({**_summary(study, found), "interrupted": stopped, "written": written})

    def _say(self, told: Mapping[str, Any]) -> None:
        import json

        print(json.dumps(told), flush=True)


class _Table:
    """What is better than all before, as it is found; a line of progress on a terminal. A context manager."""

    def __init__(self, trials: int, confirm: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        self._trials, self._confirm = trials, confirm
        out, messages = Console(), Console(stderr=True)
        shown = out if out.is_terminal else messages
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        self._progress = Progress(
            *columns,
            console=shown,
            transient=True,
            redirect_stdout=out.is_terminal,  # a file must get what goes there
            redirect_stderr=messages.is_terminal,
            disable=not shown.is_terminal,
        )
        self._task = self._progress.add_task("job as it stands", total=trials)
        self._seen: list[Tried] = []

    def __enter__(self) -> _Table:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def begun(self, study: Study, problem: Problem) -> None:
        """See _Json."""
        had = study.tried
        ways = f"ways from {problem.rapid_from_hz} Hz are rapid"
        what = f"{many(len(problem.parameters), 'parameter')} for {many(len(problem.moves), 'move')}"
        print(f"{what}; {ways}", flush=True)
        for what, name in (("as it stands", "job as it stands"), ("defaults", "controller's defaults")):
            judgement = study.reference(what)
            if judgement is not None:
                print(f"{name:<22} {_words(judgement)}", flush=True)
        if had:
            print(f"goes on after {many(len(had), 'trial')}", flush=True)
        self._seen = list(had)
        self._progress.update(self._task, completed=len(had), description="trials")

    def tried(self, tried: Tried) -> None:
        """See _Json."""
        from isel_twin.many.tuning.front import in_words
        from isel_twin.many.tuning.result import front

        self._seen.append(tried)
        best = front(self._seen)
        if tried in best:
            print(f"trial {tried.number:<16} {_words(tried.judgement)}  {in_words(tried.values)}", flush=True)
        fastest = f": best {best[0].judgement.time_s:.2f} s" if best else ""
        self._progress.update(self._task, completed=len(self._seen), description=f"trials{fastest}")

    def puts_together(self) -> None:
        """See _Json."""
        self._progress.update(self._task, description="puts the best of each move together", total=None)

    def mended(self, why: str) -> None:
        """See _Json."""
        print(f"the best of each move does not hold, is mended: {why}", flush=True)

    def confirms(self, tried: Tried) -> None:
        """See _Json."""
        self._progress.update(
            self._task, description=f"confirms trial {tried.number}", total=self._confirm, completed=0
        )

    def confirmed(self, repetition: Judgement) -> None:
        """See _Json."""
        self._progress.advance(self._task)

    def fell(self, tried: Tried, why: str) -> None:
        """See _Json."""
        print(f"trial {tried.number} does not hold: {why}", flush=True)

    def over(
        self, job: Path, study: Study, found: Tuned | None, stopped: bool, files: Sequence[Path], trials: int
    ) -> None:
        """See _Json."""
        from isel_twin.cli.outputs import say
        from isel_twin.many.tuning.front import rows

        self._progress.stop()
        before = study.reference("as it stands")
        if before is not None:
            print()
            table = [("trial", "time / s", "saved", "margin", "settings")]
            table += rows(study.tried, before, None if found is None else found.tried.number)
            for trial, time_s, saved, margin, settings in table:
                print(f"{trial:>6}{time_s:>11}{saved:>9}{margin:>9}  {settings}")
            print()
        if stopped:
            say(f"{job}: interrupted after {len(study.tried)} of {trials} trials; the same command goes on")
        elif found is None:
            say(f"{job}: no setting keeps the margin on all machines; a smaller --margin, or more --trials, may")
        else:
            self._found(found, study, files)

    def _found(self, found: Tuned, study: Study, files: Sequence[Path]) -> None:
        from isel_twin.many.tuning.result import ALONE

        told = _summary(study, found)
        saved = [
            f"{100.0 * told[key]:.1f} % less than {what}"
            for key, what in (("saved", "the job as it stands"), ("saved_against_defaults", "the defaults"))
            if told[key] is not None
        ]
        held = found.held
        print(f"tuned: {found.tried.judgement.time_s:.3f} s{''.join(f', {each}' for each in saved)}")
        print(
            f"margin: {100.0 * held.margin:.1f} % or more on {many(held.made, 'machine')} that no trial has seen, "
            f"{100.0 * held.nearly_all:.1f} % or more on {100 - ALONE} % of them; nothing lost"
        )
        print(f"written: {', '.join(map(str, files))}")
        print(f"permanent in the controller by: {'  '.join(found.permanent)}")


def _words(judgement: Judgement) -> str:
    if not judgement.good:
        return one_line(judgement.why)
    return f"{judgement.time_s:>9.3f} s {100.0 * judgement.margin:5.1f} %"
