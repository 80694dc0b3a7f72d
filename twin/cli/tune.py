"""`isel-twin tune`: the fastest settings of a job that lose no step, and their transfer to the real controller. Trials
are in a database, so that the same command continues after Ctrl-C, or with more trials.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options
from isel_twin.cli.interruption import interruption
from isel_twin.cli.jobs import check_file, clamped, job_name, read_source, say_cautions, say_zero
from isel_twin.cli.options import Whole
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    from isel_twin.base.crew import Crew
    from isel_twin.cli.tune_output import Output
    from isel_twin.jobs.toolpaths import Source
    from isel_twin.many.tuning import Problem, Tuned
    from isel_twin.many.tuning.study import Study


@Parameter(name="*")
@dataclass(frozen=True)
class Demands:
    """What a setting has to hold."""

    margin: Annotated[
        float,
        Parameter(help="Least margin, of torque and of speed, that the tuned job has to keep, a share from 0 to 1."),
    ] = 0.2
    edge: Annotated[
        float,
        Parameter(help="Least edge, a factor: speed from which on a motor swings over the speed at which it turns."),
    ] = 1.1
    settle_mm: Annotated[
        float | None, Parameter(help="A move takes until its carriages ring by no more than this, mm.")
    ] = None
    robust: Annotated[
        Whole, Parameter(help="Number of other machines, as one can buy them, on which each setting is judged.")
    ] = 5
    uncertain: Annotated[
        Whole,
        Parameter(help="And the number of machines that this one may be, as far as its numbers are known: bands."),
    ] = 0
    confirm: Annotated[
        Whole, Parameter(help="Number of further machines on which it must lose no step (149: at most 2 % do).")
    ] = 149

    def check(self) -> None:
        """Raise CallError for what cannot be demanded."""
        _check_numbers(robust=(self.robust, 0), uncertain=(self.uncertain, 0), confirm=(self.confirm, 1))
        if not 0.0 <= self.margin <= 1.0:
            raise CallError(f"margin {self.margin:g}: must be from 0 to 1", option=True)
        if not 0.5 <= self.edge <= 3.0:
            raise CallError(f"edge {self.edge:g}: must be from 0.5 to 3", option=True)
        if self.settle_mm is not None and not 0.0 < self.settle_mm <= 10.0:
            raise CallError(f"settle-mm {self.settle_mm:g}: must be a distance up to 10, such as 0.01", option=True)


@Parameter(name="*")
@dataclass(frozen=True)
class Space:
    """Which settings may be tried."""

    each_move: Annotated[bool, Parameter(help="Settings of its own for each move; equal lines share them.")] = False
    speed: Annotated[str | None, Parameter(help="LOW:HIGH in Hz, of rapid ways; one number: fixed.")] = None
    acceleration: Annotated[str | None, Parameter(help="LOW:HIGH in Hz/ms.")] = None
    start_stop: Annotated[str | None, Parameter(help="LOW:HIGH in Hz.")] = None
    rapid: Annotated[
        Whole | None, Parameter(help="Speeds in the job from here (Hz) are rapid; slower ones are feeds and stay.")
    ] = None

    def ranges(self) -> dict[str, tuple[int, int]]:
        """Least and greatest value of each setting whose option is given. Raises CallError."""
        settings = {"speed": "speed_hz", "acceleration": "acceleration_hz_per_ms", "start_stop": "start_stop_hz"}
        ranges = {}
        for option, setting in settings.items():
            if (text := getattr(self, option)) is not None:
                low, colon, high = text.partition(":")
                try:
                    ranges[setting] = int(low), int(high if colon else low)
                except ValueError:
                    said = f"{option.replace('_', '-')} {text}"
                    raise CallError(f"{said}: must be LOW:HIGH, for example 5000:20000", option=True) from None
        return ranges


HOLDS = Demands()
ANY = Space()


def tune(
    job: Annotated[Path, Parameter(help="File of controller commands, one a line.")],
    /,
    *,
    trials: Annotated[
        Whole, Parameter(help="Number of settings that are tried, those of earlier calls among them.")
    ] = 25,
    demands: Demands = HOLDS,
    space: Space = ANY,
    machine: options.MachineName = MACHINE,
    controller: options.ControllerName = TwinSpec.controller,
    seed: Annotated[
        Whole, Parameter(help="A number: seed of the machines and of the choice of settings.")
    ] = TwinSpec.seed,
    set: options.Overrides = (),
    scenario: options.ScenarioFile = None,
    flash: Annotated[Path | None, Parameter(help="The controller's flash memory; is only read.")] = None,
    line: options.LineOptions = options.NO_LINE,
    cam: options.CamOptions = options.AS_IT_LOOKS,
    timeout: options.Timeout = 3600.0,
    storage: Annotated[
        str | None, options.written("Database of what has been tried: file, or URL as Optuna has it. JOB.tune.db")
    ] = None,
    study: Annotated[str, Parameter(help="Name of the study in it.")] = "tune",
    workers: options.Workers | None = None,
    cluster: options.Cluster = None,
    batch: Annotated[
        Whole, Parameter(help="Number of settings that are chosen together, so of workers that help.")
    ] = 8,
    out: Annotated[Path | None, options.written("The tuned job. JOB.tuned.txt", name=("--out", "-o"))] = None,
    permanent: Annotated[
        Path | None, options.written("Commands that make its ramps the controller's own. JOB.permanent.txt")
    ] = None,
    picture: Annotated[
        Path | None, options.written("Draw time against margin (.png, .svg, .pdf).", *options.PICTURE)
    ] = None,
    json: Annotated[bool, Parameter(help="One line of JSON a trial, then one with the summary.")] = False,
) -> int:
    """Find the fastest settings of a job that lose no step and keep a margin, also on slightly different machines.

    It varies the rapid speed, the acceleration and the start-stop frequency, for the whole job or, with --each-move,
    for each of its moves. Each setting is judged on the machine as it is, on --robust others as one can buy them and on
    --uncertain that this one may be, as far as its numbers are known, the same for all; the first lost step ends it.
    The fastest that keeps --margin and --edge there must lose nothing on --confirm others to buy, too.

    It writes the job with its new lines, and the commands that store its ramps in the controller. Trials stay in
    --storage: after Ctrl-C the same command continues. The time counts from the first move; the reference run before it
    is not tuned.

    Exit code 0 if a setting holds; 1 if none does, and nothing is written; 130 after Ctrl-C.
    """
    if options.is_standard_input(job):
        raise CallError("-: the tuned job stands beside the job; name a file")
    check_file(job)
    options.check_one_crew(workers, cluster)
    workers = 1 if workers is None else workers
    demands.check()
    rapid = 1 if space.rapid is None else space.rapid
    _check_numbers(trials=(trials, 1), workers=(workers, 1), batch=(batch, 1), seed=(seed, 0), rapid=(rapid, 1))
    crew = options.crew_of(workers, cluster)
    options.check_seconds("timeout", timeout, 0.0)
    ranges = space.ranges()
    database = storage if storage is not None else str(job.with_name(f"{job.stem}.tune.db"))
    file = None if "://" in database else Path(database)
    out = out or job.with_name(f"{job.stem}.tuned{job.suffix}")
    permanent = permanent or job.with_name(f"{job.stem}.permanent{job.suffix}")
    options.check_writable(out, permanent, picture, file, kept=(job, scenario, flash))
    overrides = options.parse_overrides(set)
    call = TwinSpec(machine, controller, "mujoco", seed, scenario, None, overrides=overrides)
    call = clamped(line.on(call), job)

    asked = cam.reading()
    _, source = read_source(job, call, asked)  # reports errors with their line
    say_zero(job, asked, None if source is None else source.zero)
    say_cautions(job, () if source is None else source.cautions)
    from isel_twin.cli.tune_output import Json, Table

    with call_errors(job):
        how: dict[str, Any] = {"each_move": space.each_move, "rapid_hz": space.rapid, "ranges": ranges}
        how |= {"repetitions": demands.robust, "uncertain": demands.uncertain, "settle_mm": demands.settle_mm}
        # at that edge the margin of speed is the one asked for
        share = (1.0 - demands.margin) * demands.edge
        how |= {"speed_share": share, "edge": demands.edge, "timeout_s": timeout}
        how["flash"] = flash.read_bytes() if flash is not None else None
        problem = _problem(job, source, call, demands.confirm, how)
    with ExitStack() as stack:
        begun = _study(problem, file or database, stack, name=study, seed=seed, batch=batch, least=demands.margin)
        stopped = stack.enter_context(interruption())
        show = Json() if json else stack.enter_context(Table(trials, demands.confirm))
        stack.enter_context(crew)
        stack.enter_context(_failures())
        found = _tuned(job, begun, trials, demands.confirm, crew, stopped, show)
        if picture is not None:
            _draw(picture, job, begun, found)
        written = [] if found is None else _write(job, found, out, permanent)
    show.over(job, begun, found, bool(stopped), written)
    return 128 + stopped[0] if stopped else int(found is None)


def _check_numbers(**numbers: tuple[int, int]) -> None:
    """Raise CallError for a value below its least one."""
    for name, (value, low) in numbers.items():
        if value < low:
            raise CallError(f"{name} {value}: must be a whole number from {low}", option=True)


def _problem(job: Path, source: Source | None, call: TwinSpec, confirm: int, how: dict[str, Any]) -> Problem:
    """What is to be tuned. how: further arguments of it. Raises as it does, and ValueError for what is missing."""
    from isel_twin.jobs.job import decode_job
    from isel_twin.jobs.robust import check
    from isel_twin.many.tuning import Problem
    from isel_twin.many.tuning.study import need_optuna

    need_optuna()
    check(call, how["repetitions"] + confirm)
    check(call, how["uncertain"], "known")
    return Problem(decode_job(job.read_bytes()) if source is None else source.text, call, **how)


def _study(problem: Problem, database: Path | str, stack: ExitStack, **how: Any) -> Study:
    """The study in a file, which then is claimed, or behind a URL."""
    from isel_twin.base.files import Claim
    from isel_twin.many.tuning.study import Study

    with call_errors(database):
        if isinstance(database, Path):
            stack.callback(Claim(database).release)
        return Study(problem, f"sqlite:///{database}" if isinstance(database, Path) else database, **how)


@contextmanager
def _failures() -> Iterator[None]:
    """Turn errors from outside, such as a lost database or cluster, into CallError."""
    from isel_twin.base.crew import LostError
    from isel_twin.many.tuning.study import StudyError

    try:
        yield
    except LostError as error:
        raise CallError(f"{error}; the same call goes on from there") from None
    except StudyError as error:
        raise CallError(str(error)) from None


def _tuned(
    job: Path, study: Study, trials: int, confirm: int, crew: Crew, stopped: Sequence[int], show: Output
) -> Tuned | None:
    """Try settings, then confirm the fastest, and see what becomes of it on machines that this one may be; None if none
    holds, or if stopped."""
    study.judge_references(lambda: bool(stopped))
    before = study.reference("as it stands")
    if before is not None and not before.good and not before.slipped:
        raise CallError(f"{job}: {before.why}; a job has to run before it can be tuned: isel-twin run {job}")
    show.begun(study)
    study.run(trials, crew, lambda: bool(stopped), show.tried)
    found = None if stopped else _chosen(study, confirm, crew, stopped, show)
    if found is None or not study.problem.uncertain:
        return found
    from isel_twin.many.tuning.result import may_be

    known = may_be(study.problem, found.candidate, found.tried.judgement, crew, lambda: bool(stopped))
    return replace(found, may_be=known)


def _chosen(study: Study, confirm: int, crew: Crew, stopped: Sequence[int], show: Output) -> Tuned | None:
    """The fastest setting that holds; None if none does, or if stopped."""
    from isel_twin.many.tuning.result import confirm as confirmed
    from isel_twin.many.tuning.result import to_confirm, tuned

    problem = study.problem
    hard: list[int] = []
    if problem.each_move and any(tried.judgement.good for tried in study.tried):
        show.puts_together()
        mended = study.repaired(confirm, hard, crew, lambda: bool(stopped), show.mended)
        if mended is not None:
            return tuned(problem, *mended)
        if stopped:
            return None
    for tried in to_confirm(study.tried, study.least):
        show.confirms(tried)
        candidate = problem.candidate(tried.values)
        # many/12
        held = confirmed(problem, candidate, confirm, 0.0, crew, lambda: bool(stopped), show.confirmed, hard)
        if held is None:
            return None
        if held.good:
            return tuned(problem, tried, held)
        show.fell(tried, held.why)
        if held.last.number not in hard:
            hard.append(held.last.number)
    return None


def _draw(picture: Path, job: Path, study: Study, found: Tuned | None) -> None:
    """Draw time against margin: all trials, the references and the result."""
    from isel_twin.base.files import atomic_write
    from isel_twin.many.tuning import front

    marks = {"tuned": None if found is None else found.tried.judgement}
    marks |= {"job as it stands": study.reference("as it stands"), "controller's defaults": study.reference("defaults")}
    drawn = {name: one for name, one in marks.items() if one is not None}
    with call_errors(picture):
        kind = picture.suffix.removeprefix(".").lower()
        atomic_write(picture, front.draw(kind, job_name(job), study.tried, drawn, study.least))


def _write(job: Path, found: Tuned, out: Path, permanent: Path) -> list[Path]:
    """Write the tuned job, and the job that stores its ramps in a controller that can. Returns what was written."""
    from isel_twin.base.files import atomic_write

    with call_errors(out):
        atomic_write(out, found.candidate.text.encode())
    if not found.permanent:
        return [out]
    about = f"# Makes the ramps found for {job.name} the controller's own, also after power-off."
    with call_errors(permanent):
        atomic_write(permanent, "\n".join((about, *found.permanent, "")).encode())
    return [out, permanent]
