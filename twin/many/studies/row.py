"""One point of a sweep, one row of its table: a function of two values that runs in any process.

    Work    common to all rows: text of the job, machine by name, tables of the scenario, bounds
    Point   of one row: the values of the parameters and the seed
    compute(work, point) -> {"ok": True, "margin": 0.41, "cycle_s": 12.3, ...}, the columns OUTCOMES

Refused commands, lost steps and violated bounds make `ok` false, with the reason in `failure`, by the rules of
`isel-twin check`. A point that cannot begin (a machine out of its limits, an invalid job) is a row with `error` only.
Problems of the computer (a missing file, no memory) are raised.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.crew import MismatchError
from isel_twin.base.errors import one_line
from isel_twin.base.quiet import quietly
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks.rules import Bounds

if TYPE_CHECKING:
    from isel_twin.jobs.job import Line
    from isel_twin.machine import Machine

# columns of every row: type, unit ("": text or bool) and meaning
OUTCOMES: Mapping[str, tuple[str, str, str]] = {
    "ok": ("bool", "", "the job did what it has to, no step lost, every bound kept; null: it could not begin"),
    "error": ("string", "", "why it could not begin; null: it did"),
    "failure": ("string", "", "rules that were broken, as `isel-twin check` has them, with blanks between; null: none"),
    "finding": ("string", "", "the first of them in words, with its line"),
    "commands": ("int64", "1", "commands sent"),
    "refused": ("int64", "1", "commands refused"),
    "lost_x": ("int64", "steps", "whole slips of axis x since power-on"),
    "lost_y": ("int64", "steps", "whole slips of axis y since power-on"),
    "lost_z": ("int64", "steps", "whole slips of axis z since power-on"),
    "margin": ("float64", "1", "least pull-out margin of any motor in any line; null without physics or the whole job"),
    "margin_low": ("float64", "1", "and where it lies as far as torque is known: the least"),
    "margin_high": ("float64", "1", "the most"),
    "margin_moves": ("float64", "1", "the margin of the lines that set no counter: without reference runs"),  # many/2
    "edge": (
        "float64",
        "1",
        "least factor on the speed of any motor in any line until it swings; null without physics or the whole job",
    ),
    "limiting": ("string", "", "the axis that has the least margin in those"),
    "limiting_line": ("int64", "1", "and the line of the job in which it has it"),
    "error_mm": ("float64", "mm", "largest difference of true position and counter of any axis at the end, at rest"),
    "cycle_s": ("float64", "s", "from the first command to the end of the last one; null if a line was not made"),
    "events_late": ("int64", "1", "events of the scenario that were still to come at the end"),
    "reply": ("string", "", "the last reply"),
}


UNCERTAIN = "uncertain"


@dataclass(frozen=True)
class Work:
    """What all rows of a sweep have in common; sent to the workers."""

    version: str
    job_name: str
    job: str = ""  # text of the job with its placeholders; "" if there are moves
    moves: tuple[tuple[float, float, float], ...] = ()  # targets in mm, after a reference run
    spec: TwinSpec = field(default_factory=TwinSpec)  # the twin of all rows, without seed, events and overrides
    machine_digest: str = ""
    events: tuple[Mapping[str, Any], ...] = ()
    # each seed has another machine, as with `isel-twin run --robust`; UNCERTAIN: what this one may be, as with that
    perturbed: bool | str = False
    bounds: Bounds = field(default_factory=Bounds)
    parameters: tuple[tuple[str, str, str], ...] = ()  # section, key and unit of each value of a point

    @property
    def job_lines(self) -> list[str]:
        """The lines of the job, as job files count them."""
        return self.job.replace("\r\n", "\n").replace("\r", "\n").split("\n")

    @property
    def event_names(self) -> list[str]:
        return [str(event["name"]) for event in self.events if "name" in event]


@dataclass(frozen=True)
class Point:
    number: int  # of its row, from 1
    id: str  # the same for the same content, in any plan
    values: tuple[Any, ...]  # in the order of `Work.parameters`
    seed: int


def compute(work: Work, point: Point) -> dict[str, Any]:
    """The outcome of one point, OUTCOMES by name. Raises MismatchError and OSError for problems that are not the
    point's, GivenUp if nobody waits for it any more."""
    _check(work)
    found: dict[str, Any]
    try:
        with quietly():
            found = _made(work, point)
    except (OSError, MemoryError, MismatchError):
        raise
    except ValueError as error:
        found = {"error": one_line(str(error))}
    except Exception as error:
        found = {"error": one_line(f"{type(error).__name__}: {error}")}
    return {**dict.fromkeys(OUTCOMES), **found}


def _check(work: Work) -> None:
    if work.machine_digest:
        name = work.spec.machine_name
        try:
            there = work.spec.as_built.digest
        except ValueError as error:
            raise MismatchError(f"the machine {name} cannot be read there: {one_line(str(error))}") from None
        if there != work.machine_digest:
            raise MismatchError(f"the machine {name} is another one there")


def _made(work: Work, point: Point) -> dict[str, Any]:
    from isel_twin.jobs.checks.job import Inspection
    from isel_twin.jobs.job import check_conditions
    from isel_twin.jobs.playing import played
    from isel_twin.jobs.result import least_band
    from isel_twin.jobs.robust import perturbation, perturbed_twin
    from isel_twin.jobs.verdict import whole_slips

    given = dict(zip(work.parameters, point.values, strict=True))
    call = work.spec.with_(seed=point.seed)
    call = call.with_(overrides=_overrides(call, _of(given, "machine")))
    known = work.perturbed == UNCERTAIN
    if work.perturbed and not known:
        seed, _, overrides = perturbation(call.fitted(), 0, point.seed)
        call = call.with_(seed=seed, overrides={**call.overrides, **overrides})
    if work.events:
        call = call.with_events(_events(work, _of(given, "scenario")))
    lines = _lines(work, given, call)
    twin = perturbed_twin(call.with_(seed=0), point.seed, source="known")[0] if known else call.build()
    check_conditions(lines, twin)
    inspection = Inspection(twin, work.bounds, golden=False)
    verdict = played(twin, lines, [inspection.take], work.bounds.timeout_s).verdict
    results = inspection.results
    report = inspection.report(work.job_name, verdict)
    wrong = [finding for finding in report.findings if not finding.warning]
    slips = whole_slips(verdict.lost_steps, verdict.slip_steps) + verdict.forgotten_steps
    margins = [
        (each, result.number, name)
        for result in results
        for name, each in zip(CARRIAGES, result.margin, strict=False)
        if each is not None and not result.condition
    ]
    nothing = (None, None, None)
    least, line, axis = min((m for m in margins if m[1] not in inspection.setting), default=nothing)
    low, high = least_band(verdict.margin_band) or (None, None)
    first = wrong[0] if wrong else None
    whole = not verdict.part  # a margin or a time of half a job is none of the job (jobs/18)
    replies = [result.shown_reply for result in results if not result.condition]
    return {
        "ok": report.ok,
        "failure": " ".join(dict.fromkeys(finding.rule for finding in wrong)) or None,
        "finding": None if first is None else f"line {first.line}: {first.message}" if first.line else first.message,
        "commands": verdict.commands,
        "refused": verdict.refused,
        **{f"lost_{name}": int(steps) for name, steps in zip(CARRIAGES, slips, strict=False)},
        "margin": min(margins, default=nothing)[0] if whole else None,
        "margin_low": low if whole else None,
        "margin_high": high if whole else None,
        "margin_moves": least if whole else None,
        "edge": verdict.least_edge[0] if whole and verdict.least_edge else None,
        "limiting": axis if whole else None,
        "limiting_line": line if whole else None,
        "error_mm": max(abs(error) for error in verdict.position_error_mm),
        "cycle_s": verdict.cycle_s if whole else None,
        "events_late": verdict.events_after_end,
        "reply": replies[-1] if replies else None,
    }


def _of(given: Mapping[tuple[str, str, str], Any], section: str) -> list[tuple[str, str, Any]]:
    return [(key, unit, value) for (where, key, unit), value in given.items() if where == section]


def _overrides(call: TwinSpec, given: Sequence[tuple[str, str, Any]]) -> dict[str, Any]:
    """Overrides of the machine: plain values first, then multiples of the resulting values."""
    overrides = {key: value for key, unit, value in given if unit != "times"}
    if factors := [(key, value) for key, unit, value in given if unit == "times"]:
        tree = call.with_(overrides=overrides).fitted().tree
        for key, factor in factors:
            every = key.startswith("axes.all.")
            for name in [key.replace("all", axis, 1) for axis in CARRIAGES] if every else [key]:
                overrides[name] = overrides.get(name, _value(tree, name)) * factor
    return overrides


def _value(tree: Any, key: str) -> float:
    for name in key.split("."):
        tree = tree[name]
    return float(tree["value"] if isinstance(tree, Mapping) else tree)


def _lines(work: Work, given: Mapping[tuple[str, str, str], Any], call: TwinSpec) -> list[Line]:
    from isel_twin.jobs.job import parse_job
    from isel_twin.language import create_language

    if work.moves:
        settings = {key: value for key, _, value in _of(given, "settings")}
        return _moves(work, settings, call.fitted())
    lines = work.job_lines
    words = {key: _word(value) for key, _, value in _of(given, "job")}
    for key in [key for key in words if key.startswith("line ")]:
        lines[int(key.removeprefix("line ")) - 1] = words.pop(key)
    text = "\n".join(lines)
    for key, word in words.items():
        text = text.replace(f"{{{key}}}", word)
    parsed = parse_job(text, create_language(work.spec.controller), work.spec.controller)
    if not parsed:
        raise ValueError(f"{work.job_name}: there is no command in it")
    return parsed


def _word(value: Any) -> str:
    """A value as text in a job: whole numbers without a decimal point, as controllers need them."""
    if isinstance(value, float) and value == math.floor(value) and abs(value) < 1e15:
        return str(int(value))
    return str(value)


def _moves(work: Work, settings: Mapping[str, int], machine: Machine) -> list[Line]:
    """The lines that a host would send for the moves: a reference run, and each target with the settings."""
    from isel_twin.jobs.job import Line
    from isel_twin.language import MoveSettings, create_language, needed, readable

    language = needed(create_language(work.spec.controller), work.spec.controller)
    how = MoveSettings(**settings)
    frames = list(language.reference())
    for target_mm in work.moves:
        for axis, mm in zip(machine.axes, target_mm, strict=True):
            if not 0.0 <= mm < axis.travel_mm:
                raise ValueError(f"moves: {axis.name} is {mm:g} mm; allowed: 0 to {axis.travel_mm:g} mm")
        counts = [round(mm * axis.steps_per_mm) for mm, axis in zip(target_mm, machine.axes, strict=True)]
        frames += language.move(counts, how)
    return [Line(number, readable(frame), (frame,)) for number, frame in enumerate(frames, 1)]


def _events(work: Work, given: Sequence[tuple[str, str, Any]]) -> list[dict[str, Any]]:
    """The tables of the scenario of this point."""
    events = [copy.deepcopy(dict(event)) for event in work.events]
    by_name = {str(number): event for number, event in enumerate(events, 1)}
    by_name |= {str(event["name"]): event for event in events if "name" in event}
    happening: list[str] | None = None
    for key, unit, value in given:
        if key == "events":
            happening = str(value).split()
            continue
        name, _, path = key.partition(".")
        *above, last = path.split(".")
        inner: Any = by_name[name]
        for step in above:
            inner = inner.setdefault(step, {})
            if not isinstance(inner, dict):
                raise ValueError(f"scenario.{key}: {step} is no table in the event")
        if unit == "times":
            if not isinstance(inner.get(last), int | float):
                raise ValueError(f"scenario.{key}: the event has no number there to be multiplied")
            value = inner[last] * value
        inner[last] = value
    if happening is not None:
        events = [event for event in events if "name" not in event or event["name"] in happening]
    return events
