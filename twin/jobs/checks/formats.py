"""Findings in words, as JUnit XML, SARIF, JSON and annotations of a pull request.

words    a line for the verdict and one for each finding
JUnit    one suite, one case a job; its findings as one failure, warnings in system-out
SARIF    2.1.0, one result a finding, with the line of the job, for code scanning and editors; one note a job of what
         was not looked at
JSON     one object a job
::error  commands in the log of a GitHub-style runner, which shows them at the line
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import quote
from xml.etree import ElementTree

from isel_twin.base.printable import shown, shown_line
from isel_twin.base.units import SECOND_NS
from isel_twin.jobs.checks.rules import RULES, Finding, Rule
from isel_twin.version import VERSION

_PLACE = re.compile(r"line (\d+)(?:, column (\d+))?: ")  # at the beginning of an error of a file

NOT_JUDGED = "not judged: the check was interrupted"


class Outcome(Protocol):
    """A verdict as the formats tell it."""

    @property
    def commands(self) -> int: ...

    @property
    def cycle_s(self) -> float: ...

    @property
    def line_told(self) -> str: ...

    @property
    def margin_told(self) -> str: ...

    def summary(self) -> dict[str, Any]: ...


class Told(Protocol):
    """A report on a job: of a twin (job.py), or of a real controller (bridge/tap/real_job.py)."""

    @property
    def job(self) -> str: ...

    @property
    def ok(self) -> bool: ...

    @property
    def findings(self) -> Sequence[Finding]: ...

    @property
    def verdict(self) -> Outcome: ...

    @property
    def unseen(self) -> Sequence[str]:
        """Rules and conditions that were not looked at."""


@dataclass(frozen=True)
class NothingDone:
    """The outcome of a job that was not played."""

    commands: int = 0
    cycle_s: float = 0.0
    line_told: str = ""
    margin_told: str = ""

    def summary(self) -> dict[str, Any]:
        return {}


@dataclass(frozen=True)
class Unread:
    """The report on a file that cannot be judged; why: one line."""

    job: str
    why: str
    excerpt: str = ""  # lines below it
    ok: bool = False
    verdict: NothingDone = NothingDone()
    unseen: tuple[str, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        why = self.why.removeprefix(f"{self.job}: ")
        if (place := _PLACE.match(why)) is None:
            return (Finding("unread", why),)
        return (Finding("unread", why[place.end() :], int(place[1]), at=(int(place[1]), int(place[2] or 0))),)


def where(finding: Finding) -> str:
    time = "" if finding.time_ns is None else f"at {finding.time_ns / SECOND_NS:.3f} s"
    return ", ".join(part for part in (finding.place, time) if part)


def as_words(report: Told) -> str:
    """For the terminal: the verdict in a line, and a line for each finding."""
    if isinstance(report, Unread):
        why = shown_line(f"{report.job}: not read: {report.why.removeprefix(f'{report.job}: ')}")
        return "\n".join([why, *report.excerpt.splitlines()])
    verdict = report.verdict
    margin = verdict.margin_told and f", margin {verdict.margin_told}"
    commands = f"{verdict.commands} command{'' if verdict.commands == 1 else 's'}"
    time = ", ".join(filter(None, (f"{verdict.cycle_s:.3f} s", verdict.line_told)))
    rows = [f"{shown_line(report.job)}: {'ok' if report.ok else 'failed'} ({commands}, {time}{margin})"]
    for finding in report.findings:
        warning, place = "warning " if finding.warning else "", where(finding)
        rows.append(f"  {warning}{finding.rule:<10} {f'{place}: ' if place else ''}{shown_line(finding.message)}")
    if report.unseen:
        rows.append(f"  {_unseen(report)}")
    return "\n".join(rows)


def _unseen(report: Told) -> str:
    return f"not looked at: {', '.join(report.unseen)}"


def _in_words(finding: Finding) -> str:
    place = where(finding)
    return f"{finding.rule}: {finding.message}{f' ({place})' if place else ''}"


def junit(reports: Sequence[Told], unjudged: Sequence[str] = ()) -> str:
    """JUnit XML. Times are those of the machine, from the first command to the end of the last one. unjudged: jobs that
    an interruption has left out, which are errors."""
    unread = sum(isinstance(report, Unread) for report in reports)
    failures = sum(not report.ok for report in reports) - unread
    time_s = f"{sum(report.verdict.cycle_s for report in reports):.3f}"
    tests, errors = str(len(reports) + len(unjudged)), str(len(unjudged) + unread)
    counts = {"tests": tests, "failures": str(failures), "errors": errors, "time": time_s}
    root = ElementTree.Element("testsuites", counts)
    suite = ElementTree.SubElement(root, "testsuite", {"name": "isel-twin", **counts, "skipped": "0"})
    for report in reports:
        about = {**_case(report.job), "time": f"{report.verdict.cycle_s:.3f}"}
        case = ElementTree.SubElement(suite, "testcase", about)
        if wrong := [finding for finding in report.findings if not finding.warning]:
            failure = {"type": wrong[0].rule, "message": shown(_in_words(wrong[0]))}
            kind = "error" if isinstance(report, Unread) else "failure"
            ElementTree.SubElement(case, kind, failure).text = shown("\n".join(map(_in_words, wrong)))
        notes = [_in_words(finding) for finding in report.findings if finding.warning]
        if notes := [*notes, *([_unseen(report)] if report.unseen else [])]:
            ElementTree.SubElement(case, "system-out").text = shown("\n".join(notes))
    for job in unjudged:
        case = ElementTree.SubElement(suite, "testcase", {**_case(job), "time": "0.000"})
        ElementTree.SubElement(case, "error", {"type": "interrupted", "message": NOT_JUDGED}).text = NOT_JUDGED
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _case(job: str) -> dict[str, str]:
    path = Path(job)
    return {"name": shown_line(path.name), "classname": shown_line(path.parent.as_posix())}


def sarif(reports: Sequence[Told], unjudged: Sequence[str] = ()) -> str:
    """SARIF 2.1.0. Paths are those of the call; relative ones start at the root of the sources. unjudged: as for
    `junit`."""
    rules = [_described(name, rule) for name, rule in RULES.items()]
    names = list(RULES)
    results = [
        {
            "ruleId": finding.rule,
            "ruleIndex": names.index(finding.rule),
            "level": finding.level,
            "message": {"text": shown(finding.message)},
            "locations": [{"physicalLocation": _location(report, finding)}],
        }
        for report in reports
        for finding in report.findings
    ]
    driver = {"name": "isel-twin", "semanticVersion": _semantic(VERSION), "rules": rules}
    said = [("note", _unseen(report), report.job) for report in reports if report.unseen]
    said += [("error", NOT_JUDGED, job) for job in unjudged]
    notes = [
        {"level": level, "message": {"text": text}, "locations": [{"physicalLocation": _place(job)}]}
        for level, text, job in said
    ]
    told = {"executionSuccessful": not unjudged, "toolExecutionNotifications": notes}
    run = {"tool": {"driver": driver}, "results": results, **({"invocations": [told]} if notes else {})}
    log = {"$schema": "https://json.schemastore.org/sarif-2.1.0.json", "version": "2.1.0", "runs": [run]}
    return json.dumps(log, indent=2) + "\n"


def _described(name: str, rule: Rule) -> dict[str, Any]:
    broken = f"Broken when {rule.broken}."
    return {
        "id": name,
        "shortDescription": {"text": rule.demand},
        "fullDescription": {"text": _plain(f"{rule.demand} {broken}")},
        "help": {"text": _plain(f"{broken} {rule.remedy}"), "markdown": f"{broken}\n\n{rule.remedy}"},
        "defaultConfiguration": {"level": "warning" if rule.warning else "error"},
    }


def _plain(markdown: str) -> str:
    return markdown.replace("`", "")


def _semantic(version: str) -> str:
    match = re.match(r"\d+\.\d+\.\d+", version)
    return match[0] if match else "0.0.0"


def _location(report: Told, finding: Finding) -> dict[str, Any]:
    line, column = finding.at or (finding.line or 1, 0)
    region = {"startLine": line, **({"startColumn": column} if column else {})}
    return {**_place(report.job), "region": region}


def _place(job: str) -> dict[str, Any]:
    path = Path(job)
    name = os.fsencode(path.as_posix())  # need not be UTF-8
    uri = path.absolute().as_uri() if path.is_absolute() else quote(name)
    return {"artifactLocation": {"uri": uri}}


def content(finding: Finding) -> dict[str, Any]:
    """A finding in JSON's types."""
    return {
        "rule": finding.rule,
        "level": finding.level,
        "line": finding.line if finding.at is None else finding.at[0],
        "time_s": None if finding.time_ns is None else finding.time_ns / SECOND_NS,
        "message": finding.message,
    }


def as_json(report: Told) -> str:
    """One line: job, ok, findings, and the verdict as `isel-twin run --json` has it."""
    findings = list(map(content, report.findings))
    told = {"job": report.job, "ok": report.ok, "cycle_s": report.verdict.cycle_s, "findings": findings}
    told |= {"not_looked_at": list(report.unseen)} if report.unseen else {}
    told |= {"error": report.why} if isinstance(report, Unread) else {}
    return json.dumps({**told, "verdict": report.verdict.summary()})


def as_annotations(reports: Iterable[Told]) -> Iterator[str]:
    """Commands for the log of a GitHub-style runner."""
    for report in reports:
        for finding in report.findings:
            values = {
                "file": shown_line(report.job),
                "line": str((finding.at or (finding.line or 1,))[0]),
                "title": f"isel-twin {finding.rule}",
            }
            place = ",".join(f"{key}={_escaped(value, ':,')}" for key, value in values.items())
            yield f"::{finding.level} {place}::{_escaped(shown(finding.message))}"


def _escaped(text: str, others: str = "") -> str:
    """Escape the characters that would end a command."""
    for character in "%\r\n" + others:
        text = text.replace(character, f"%{ord(character):02X}")
    return text
