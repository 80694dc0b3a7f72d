"""`isel-twin compare`: two recordings compared."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cli.options import check_seconds
from isel_twin.cli.outputs import many, say, say_json

if TYPE_CHECKING:
    from isel_twin.language import Language
    from isel_twin.recordings.compare import Comparison, Exchange, Pair
    from isel_twin.recordings.reading import Recorded

ROWS = 40  # most rows of a table without --all


def compare(
    a: Annotated[Path, Parameter(help="A recording: of `serve`, `run`, `replay`, or of a real controller (`tap`).")],
    b: Annotated[Path, Parameter(help="Another one.")],
    /,
    *,
    time_tolerance: Annotated[float, Parameter(help="Seconds by which durations may differ.")] = 0.01,
    controller: Annotated[str, Parameter(help="Whose language frames the commands, if a recording does not say.")] = "",
    all: Annotated[bool, Parameter(help="Every command, not only those that differ.")] = False,
    json: Annotated[bool, Parameter(help="One JSON object a command, then one with the summary.")] = False,
) -> int:
    """Compare two recordings command by command: replies, durations, counters.

    A duration is the time from the last byte of a command to the last byte of its reply. Shows the first and the
    largest difference. Exit code 0 if nothing differs beyond the tolerance, 1 otherwise.
    """
    from isel_twin.recordings.compare import compare as compare_recordings
    from isel_twin.recordings.reading import read

    check_seconds("time-tolerance", time_tolerance, 0.0)
    with call_errors(a):
        first = read(a)
    with call_errors(b):
        second = read(b)
    languages = _language(first, controller), _language(second, controller)
    with call_errors():
        result = compare_recordings(first, second, *languages, round(time_tolerance * SECOND_NS))
    if not (result.pairs or result.only_a or result.only_b):
        raise CallError(f"{a}, {b}: no host sends a command in them: there is nothing to compare")
    if json:
        _print_json(result, (first, second), all)
    else:
        _print_table(result, (first, second), all)
    return 0 if result.same else 1


def _language(recorded: Recorded, controller: str) -> Language:
    """A fresh language for a recording. Raises CallError."""
    from isel_twin.language import create_language

    name = controller or recorded.controller
    if not name:
        raise CallError(f"{recorded.path}: does not say which controller it is of; --controller NAME does")
    with call_errors(recorded.path):
        language = create_language(name)
    if language is None:
        raise CallError(f"controller {name!r} has no language: nobody knows where its commands end")
    return language


def _print_json(result: Comparison, recordings: tuple[Recorded, Recorded], every: bool) -> None:
    for pair in result.pairs if every else result.different:
        say_json(_pair(pair, result.tolerance_ns))
    say_json(
        {
            "summary": True,
            "same": result.same,
            "commands": len(result.pairs),
            "different": len(result.different),
            "first": None if not result.different else result.different[0].number,
            "most": None if result.most is None else _pair(result.most, result.tolerance_ns),
            "only_a": [_command(exchange) for exchange in result.only_a],
            "only_b": [_command(exchange) for exchange in result.only_b],
            "whole": [recorded.whole for recorded in recordings],
        }
    )


def _pair(pair: Pair, tolerance_ns: int) -> dict[str, Any]:
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
    told = {"number": pair.number, "command": pair.a.text, "differs": pair.differs(tolerance_ns), "later_s": later}
    return told | sides


def _command(exchange: Exchange) -> dict[str, Any]:
    return {"sent_s": exchange.sent_ns / SECOND_NS, "command": exchange.text}


def _print_table(result: Comparison, recordings: tuple[Recorded, Recorded], every: bool) -> None:
    for recorded in recordings:
        if not recorded.whole:
            say(f"{recorded.path}: the recording has no end, it was cut off; it is compared as far as it goes")
    rows = result.pairs if every else result.different[:ROWS]
    if rows:
        print(f"{'no':>6}  {'command':<32} {'A / s':>12} {'B / s':>12} {'B - A / ms':>12}  differs")
    for pair in rows:
        print(_row(pair, result.tolerance_ns))
    if len(rows) < len(result.different):
        print(f"  ... and {len(result.different) - len(rows)} more; --all lists every command")
    for name, only in (("A", result.only_a), ("B", result.only_b)):
        if only:
            first, number = only[0], many(len(only), "command")
            print(f"only in {name}: {number}, the first at {first.sent_ns / SECOND_NS:.3f} s: {first.text}")
    if result.different:
        first_pair = result.different[0]
        what = " and ".join(first_pair.differs(result.tolerance_ns))
        print(f"differs first: command {first_pair.number}, {first_pair.a.text}: {what}")
    if (most := result.most) is not None and most.later_ns:
        print(f"differs most in time: command {most.number}, {most.a.text}: {most.later_ns / 1e6:+.3f} ms")
    verdict = "the same" if result.same else "not the same"
    tolerance = f"durations within {result.tolerance_ns / 1e6:g} ms"
    print(f"{verdict}: {many(len(result.pairs), 'command')} compared, {len(result.different)} differ ({tolerance})")


def _row(pair: Pair, tolerance_ns: int) -> str:
    from isel_twin.language import readable

    took_ns = pair.a.duration_ns, pair.b.duration_ns
    durations = [f"{'-':>12}" if ns is None else f"{ns / SECOND_NS:>12.6f}" for ns in took_ns]
    later = "-" if pair.later_ns is None else f"{pair.later_ns / 1e6:+.3f}"
    found = []
    for name in pair.differs(tolerance_ns):
        if name == "reply":
            found.append(f"reply {readable(pair.a.reply) or 'none'} / {readable(pair.b.reply) or 'none'}")
        elif name == "counters":
            found.append(f"counters {list(pair.a.counts or ())} / {list(pair.b.counts or ())}")
        else:
            found.append(name)
    return f"{pair.number:>6}  {pair.a.text:<32} {' '.join(durations)} {later:>12}  {'; '.join(found)}".rstrip()
