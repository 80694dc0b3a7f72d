"""Shared by `compare`, `replay` and `learn`: recordings as sessions, and the verdict on two of them in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cli import options
from isel_twin.cli.outputs import many

if TYPE_CHECKING:
    from isel_twin.core.spec import TwinSpec
    from isel_twin.language import Language
    from isel_twin.many.learning.explain import Explained
    from isel_twin.many.learning.session import Session
    from isel_twin.recordings.judging import Comparison, Difference, Limits
    from isel_twin.recordings.reading import Recorded

SHOWN = 5  # differences of a verdict

StartMm = Annotated[
    str, Parameter(help="Where the carriages are at power-on: X,Y,Z in mm from the motor-end switches.")
]
TimeTolerance = Annotated[
    float | None, Parameter(help="Seconds by which durations may differ. Default: from the session's quick replies.")
]
StepTolerance = Annotated[options.Whole, Parameter(help="Steps by which positions may differ.")]
ReportPath = Annotated[Path | None, options.written("A page with both time lines (HTML).", *options.PAGE, bare=True)]


def limits_of(time_tolerance: float | None, step_tolerance: int) -> Limits:
    """Raises CallError."""
    from isel_twin.recordings.judging import Limits

    if time_tolerance is not None:
        options.check_seconds("time-tolerance", time_tolerance, 0.0)
    if step_tolerance < 0:
        raise CallError(f"step-tolerance {step_tolerance}: must be a number of steps from 0", option=True)
    return Limits(None if time_tolerance is None else time_tolerance * SECOND_NS, step_tolerance)


def parse_start(text: str) -> tuple[float, ...] | None:
    """Places in mm; None for no text. Raises CallError."""
    return None if not text else options.parse_places("start", text, "20,20,10")


def spec_for(recorded: Recorded, twin: options.SessionTwin, start: str) -> TwinSpec:
    """The twin of a call, with the controller of the recording unless another is asked for. Its flash is read only.
    Raises CallError."""
    name = name_of(recorded, twin.controller)
    image = None
    if twin.flash is not None:
        with call_errors(twin.flash):
            image = twin.flash.read_bytes()
    call = replace(twin, controller=name, flash=None)
    return call.spec(line_speed=True).with_(flash=image, start_mm=parse_start(start))


def name_of(recorded: Recorded, controller: str = "") -> str:
    """Which controller a recording is of. Raises CallError."""
    if not (name := controller or recorded.controller):
        raise CallError(f"{recorded.path}: does not say which controller it is of; --controller NAME does")
    return name


def language_of(recorded: Recorded, controller: str) -> Language:
    """A fresh language for a recording. Raises CallError."""
    from isel_twin.language import create_language

    name = name_of(recorded, controller)
    with call_errors(recorded.path):
        language = create_language(name)
    if language is None:
        raise CallError(f"controller {name!r} has no language, which would say where its commands end")
    return language


def session_of(recorded: Recorded, controller: str, limits: Limits) -> Session:
    """Raises CallError, also for a recording in which no host speaks."""
    from isel_twin.many.learning.session import Session
    from isel_twin.recordings.compare import traffic

    language_of(recorded, controller)
    with call_errors(recorded.path):
        limits = replace(limits, exact_a=recorded.of_twin)
        session = Session(tuple(traffic(recorded)), name_of(recorded, controller), limits)
    if not session.exchanges:
        raise CallError(f"{recorded.path}: the host sends nothing in it: there is nothing to compare")
    return session


def verdict(found: Comparison, explained: Explained | None) -> str:
    """In one line."""
    number = many(len(found.pairs), "command")
    if found.same and explained is None:
        return f"the same: {number} compared, 0 differ"
    if explained is not None and explained.causes:
        both = zip(explained.causes, explained.alternatives, strict=True)
        but = "; ".join(", or ".join((cause.told, *others)) for cause, others in both)
        if explained.same:
            return f"the same but for {but}"
        return f"not the same: {but}; and {many(_left(explained), 'difference')} unexplained"
    only = len(found.only_a) + len(found.only_b)
    more = f", {many(only, 'command')} on one side only" if only else ""
    return f"not the same: {number} compared, {len(found.different)} differ{more}"


def _left(explained: Explained) -> int:
    return len(explained.unexplained) + len(explained.rest.only_a) + len(explained.rest.only_b)


def words(found: Comparison, explained: Explained | None) -> list[str]:
    """What stands below a verdict: causes with what makes the twin so, the weightiest differences with their places."""
    lines = []
    if explained is not None:
        for cause in explained.causes:
            seen = f" (seen in {cause.evidence})" if cause.evidence else ""
            lines.append(f"{cause.told}{seen}: {cause.setting}")
    shown = found.weighed if explained is None or not explained.causes else list(explained.unexplained)
    lines += [place(one) for one in shown[:SHOWN]]
    if len(shown) > SHOWN:
        lines.append(f"and {len(shown) - SHOWN} more")
    return [*lines, str(found.jitter)]


def place(one: Difference) -> str:
    at_s = one.pair.a.sent_ns / SECOND_NS
    return f"command {one.pair.number} at {at_s:.3f} s, {one.pair.a.text}: {one.kind}, {one.text}"


def causes_as_json(explained: Explained | None) -> Sequence[dict[str, Any]]:
    if explained is None:
        return []
    return [
        {
            "name": cause.name,
            "told": cause.told,
            "setting": cause.setting,
            "value": cause.value,
            "sigma": cause.sigma,
            "evidence": cause.evidence,
            "alternatives": list(others),
        }
        for cause, others in zip(explained.causes, explained.alternatives, strict=True)
    ]


def differences_as_json(differences: Sequence[Difference]) -> Sequence[dict[str, Any]]:
    return [
        {
            "kind": one.kind.value,
            "command": one.pair.a.text,
            "number": one.pair.number,
            "at_s": one.pair.a.sent_ns / SECOND_NS,
            "text": one.text,
        }
        for one in differences
    ]


def write_page(path: Path | None, title: str, told: str, lines: Sequence[str], names: Any, found: Comparison) -> None:
    """Raises CallError."""
    if path is None:
        return
    from isel_twin.base.files import atomic_write
    from isel_twin.report.sessions import sessions_page

    with call_errors(path):
        atomic_write(path, sessions_page(title, told, lines, names, found).encode())
