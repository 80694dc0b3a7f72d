"""`isel-twin compare`: two recordings compared, or one with a twin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cli import options, sessions
from isel_twin.cli.outputs import many, say, say_json
from isel_twin.core.spec import TwinSpec

if TYPE_CHECKING:
    from isel_twin.many.learning.explain import Explained
    from isel_twin.recordings.compare import Exchange, Pair
    from isel_twin.recordings.judging import Comparison, Limits
    from isel_twin.recordings.reading import Recorded

ROWS = 40  # most rows of a table without --all


def compare(
    a: Annotated[Path, Parameter(help="A recording: of `serve`, `run`, `replay`, or of a real controller (`tap`).")],
    b: Annotated[Path | None, Parameter(help="Another one; without it the twin of this call, driven as A was.")] = None,
    /,
    *,
    time_tolerance: sessions.TimeTolerance = None,
    step_tolerance: sessions.StepTolerance = 1,
    explain: Annotated[
        bool, Parameter(negative="no-explain", help="Look for what makes the twin answer as the other side does.")
    ] = True,
    twin: options.SessionTwin = options.DEFAULT_SESSION_TWIN,
    start: sessions.StartMm = "",
    report: sessions.ReportPath = None,
    all: Annotated[bool, Parameter(help="Every command, not only those that differ.")] = False,
    json: Annotated[bool, Parameter(help="One JSON object a command, then one with the summary.")] = False,
) -> int:
    """Compare two recordings command by command: replies, positions, durations.

    A duration is the time from the last byte of a command to the last byte of its reply. If one of them is of a twin,
    or there is one only, the twin is changed until it answers as the other side does: the verdict says what it took.
    Exit code 0 if nothing differs beyond what two equal machines would, 1 otherwise.
    """
    from tempfile import TemporaryDirectory

    from isel_twin.recordings.judging import compare as compare_recordings
    from isel_twin.recordings.reading import read

    limits = sessions.limits_of(time_tolerance, step_tolerance)
    options.check_writable(report, kept=(a, b, *twin.files))
    with call_errors(a):
        first = read(a)
    second = None
    if b is not None:
        if (replace(twin, controller=""), start) != (options.DEFAULT_SESSION_TWIN, ""):
            raise CallError(f"{b}: says itself what it was made with; options of a twin go with one recording")
        with call_errors(b):
            second = read(b)
    with TemporaryDirectory(prefix="isel-twin-") as folder:
        explained = None
        if second is None:
            spec = sessions.spec_for(first, twin, start)
            found, explained = _with_twin(first, twin.controller, limits, spec, explain=explain)
        else:
            languages = [sessions.language_of(each, twin.controller) for each in (first, second)]
            with call_errors():
                found = compare_recordings(first, second, languages[0], languages[1], limits)
            if not (found.pairs or found.only_a or found.only_b):
                raise CallError(f"{a}, {b}: no host sends a command in them: there is nothing to compare")
            if explain and not found.same:
                explained = _explained(first, second, twin.controller, limits, Path(folder))
    recordings = [first] if second is None else [first, second]
    verdict, lines = sessions.verdict(found, explained), sessions.words(found, explained)
    names = str(a), "the twin of this call" if b is None else str(b)
    sessions.write_page(report, f"isel-twin compare: {a.name}", verdict, lines, names, found)
    if json:
        _print_json(found, explained, recordings, verdict, all)
    else:
        _print_table(found, recordings, [*lines, verdict], all)
    return 0 if found.same else 1


def _with_twin(
    recorded: Recorded, controller: str, limits: Limits, spec: TwinSpec, *, explain: bool
) -> tuple[Comparison, Explained | None]:
    """A recording compared with the twin of the call, which is switched on where the real one was unless the call says
    where."""
    from isel_twin.many.learning.explain import explained

    session = sessions.session_of(recorded, controller, limits)
    with call_errors():
        result = explained(session, spec, unknown_start=spec.start_mm is None, most=None if explain else 0)
    return result.before, result if result.causes else None


def _explained(a: Recorded, b: Recorded, controller: str, limits: Limits, folder: Path) -> Explained | None:
    """What makes the side that is of a twin answer as the other one does; None if neither is, or nothing does."""
    from isel_twin.many.learning.explain import explained
    from isel_twin.recordings.reading import RecordingError
    from isel_twin.recordings.replay import spec_of

    real, twin = (a, b) if b.of_twin else (b, a)
    if not twin.of_twin:
        return None
    try:
        spec = spec_of(twin, folder)
    except RecordingError:  # it begins late, or nobody said what it was
        return None
    session = sessions.session_of(real, controller, limits)
    with call_errors():
        result = explained(session, spec, unknown_start=False)
    return result if result.causes else None


def _print_json(
    found: Comparison, explained: Explained | None, recordings: list[Recorded], verdict: str, every: bool
) -> None:
    for pair in found.pairs if every else found.different:
        say_json(_pair(pair, found))
    jitter = found.jitter
    say_json(
        {
            "summary": True,
            "same": found.same,
            "verdict": verdict,
            "causes": sessions.causes_as_json(explained),
            "differences": sessions.differences_as_json(found.weighed),
            "unexplained": sessions.differences_as_json(found.weighed if explained is None else explained.unexplained),
            "commands": len(found.pairs),
            "different": len(found.different),
            "first": None if not found.different else found.different[0].number,
            "most": None if found.most is None else _pair(found.most, found),
            "only_a": [_command(exchange) for exchange in found.only_a],
            "only_b": [_command(exchange) for exchange in found.only_b],
            "tolerance_s": found.tolerance_ns / SECOND_NS,
            "jitter": {
                "median_s": jitter.median_ns / SECOND_NS,
                "spread_s": jitter.spread_ns / SECOND_NS,
                "largest_s": jitter.largest_ns / SECOND_NS,
                "replies": jitter.replies,
            },
            "whole": [recorded.whole for recorded in recordings],
        }
    )


def _pair(pair: Pair, found: Comparison) -> dict[str, Any]:
    sides = {
        name: {
            "sent_s": side.sent_ns / SECOND_NS,
            "duration_s": None if side.duration_ns is None else side.duration_ns / SECOND_NS,
            "reply_hex": side.reply.hex(),
            "counts": side.counts,
        }
        for name, side in (("a", pair.a), ("b", pair.b))
    }
    later = None if pair.later_ns is None else pair.later_ns / SECOND_NS
    return {"number": pair.number, "command": pair.a.text, "differs": found.differs(pair), "later_s": later} | sides


def _command(exchange: Exchange) -> dict[str, Any]:
    return {"sent_s": exchange.sent_ns / SECOND_NS, "command": exchange.text}


def _print_table(found: Comparison, recordings: list[Recorded], lines: list[str], every: bool) -> None:
    for recorded in recordings:
        if not recorded.whole:
            say(f"{recorded.path}: the recording has no end, it was cut off; it is compared as far as it goes")
    rows = found.pairs if every else found.different[:ROWS]
    if rows:
        print(f"{'no':>6}  {'command':<32} {'A / s':>12} {'B / s':>12} {'B - A / ms':>12}  differs")
    for pair in rows:
        print(_row(pair, found))
    if len(rows) < len(found.different):
        print(f"  ... and {len(found.different) - len(rows)} more; --all lists every command")
    for name, only in (("A", found.only_a), ("B", found.only_b)):
        if only:
            first, number = only[0], many(len(only), "command")
            print(f"only in {name}: {number}, the first at {first.sent_ns / SECOND_NS:.3f} s: {first.text}")
    if found.different:
        first_pair = found.different[0]
        print(f"first difference: command {first_pair.number}, {first_pair.a.text}: {_what(first_pair, found)}")
    if (most := found.most) is not None and most.later_ns:
        print(f"largest time difference: command {most.number}, {most.a.text}: {most.later_ns / 1e6:+.3f} ms")
    print(*lines, sep="\n")


def _what(pair: Pair, found: Comparison) -> str:
    return " and ".join(found.differs(pair))


def _row(pair: Pair, found: Comparison) -> str:
    from isel_twin.language import readable

    took_ns = pair.a.duration_ns, pair.b.duration_ns
    durations = [f"{'-':>12}" if ns is None else f"{ns / SECOND_NS:>12.6f}" for ns in took_ns]
    later = "-" if pair.later_ns is None else f"{pair.later_ns / 1e6:+.3f}"
    told = []
    for one in found.by_pair.get(pair.number, ()):
        if one.kind == "reply":
            told.append(f"reply {readable(pair.a.reply) or 'none'} / {readable(pair.b.reply) or 'none'}")
        else:
            told.append(one.text if one.kind in ("position", "counters") else one.kind.value)
    return f"{pair.number:>6}  {pair.a.text:<32} {' '.join(durations)} {later:>12}  {'; '.join(told)}".rstrip()
