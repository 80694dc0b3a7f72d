"""What an editor shows of a job: findings, figures at the ends of lines, and what a line means.

Lines of an editor count from 0, columns in the units of its encoding; lines of a job from 1.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence

from lsprotocol import types

from isel_twin.jobs.checks import Finding, Report
from isel_twin.jobs.checks.live import Figures

SOURCE = "isel-twin"

_LINE_END = re.compile(r"\r\n|\r|\n")  # those of the protocol are those of a job file
_PLACE = re.compile(r"(?:line (\d+))(?:, column (\d+))?: ")

Units = Callable[[str], int]  # length of a text in the units of the editor


def lines_of(text: str) -> list[str]:
    return _LINE_END.split(text)


def of_report(
    report: Report, figures: Mapping[int, Figures], lines: Sequence[str], units: Units
) -> list[types.Diagnostic]:
    """A diagnostic for each finding, at its line; those of the whole job at the first line."""
    return [
        types.Diagnostic(
            range=_range(*_place(finding), lines, units),
            message=_words(finding, figures),
            severity=types.DiagnosticSeverity.Warning if finding.warning else types.DiagnosticSeverity.Error,
            source=SOURCE,
            code=finding.rule,
        )
        for finding in report.findings
    ]


def of_error(message: str, lines: Sequence[str], units: Units) -> list[types.Diagnostic]:
    """What is wrong with a text that cannot be played, or with the project. message: may begin with its place."""
    place = _PLACE.match(message)
    line, column = (int(place[1]), int(place[2] or 0)) if place else (1, 0)
    told = message[place.end() :] if place else message
    where, error = _range(line, column, lines, units), types.DiagnosticSeverity.Error
    return [types.Diagnostic(range=where, message=told, severity=error, source=SOURCE)]


def hints(
    figures: Mapping[int, Figures], lines: Sequence[str], first: int, last: int, units: Units
) -> list[types.InlayHint]:
    """The figures of the lines that take time from `first` to `last`, which count from 0, each behind its line."""
    return [
        types.InlayHint(position=types.Position(number - 1, units(lines[number - 1])), label=str(of), padding_left=True)
        for number, of in sorted(figures.items())
        if of.seconds > 0.0 and first <= number - 1 <= last and number <= len(lines)
    ]


def explained(rows: Iterable[str], of: Figures | None) -> types.Hover | None:
    """What the commands of a line mean, and what came of them; None for nothing."""
    parts = [f"- {_plain(row)}" for row in rows]
    if of is not None:
        parts += ["", str(of), *(f"- reply: {_plain(reply)}" for reply in of.replies)]
    if not parts:
        return None
    return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, "\n".join(parts).strip()))


def _words(finding: Finding, figures: Mapping[int, Figures]) -> str:
    of = figures.get(_place(finding)[0]) if finding.line is not None else None
    return f"{finding.message} ({of})" if of is not None else finding.message


def _place(finding: Finding) -> tuple[int, int]:
    """Line and column, from 1; column 0: the whole line."""
    return finding.at or (finding.line or 1, 0)


def _range(line: int, column: int, lines: Sequence[str], units: Units) -> types.Range:
    """From the column, or the first character, to the end of the line."""
    row = min(max(line, 1), max(len(lines), 1)) - 1
    text = lines[row] if lines else ""
    indent = len(text) - len(text.lstrip())
    start = min(column - 1 if column else indent, len(text))
    return types.Range(types.Position(row, units(text[:start])), types.Position(row, units(text.rstrip())))


def _plain(text: str) -> str:
    """Text that Markdown leaves as it is."""
    return re.sub(r"([\\`*_{}\[\]<>#|])", r"\\\1", text)
