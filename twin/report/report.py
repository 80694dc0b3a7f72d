"""A report about a job: one self-contained HTML page, or a picture.

    verdict and limits | findings with pictures | path | time plots | what differs from the golden run | commands

The page is plain HTML with inline SVG and a small script for the zoom; print and screen readers show everything without
it. A Content-Security-Policy forbids loading anything. All text from outside (names, commands, replies) is escaped. The
size does not grow with the length of the job: curves have the resolution of a screen (columns.py), and beyond ROWS only
commands with a finding are listed (report/1).

`isel_twin.core.position` defines the position error. Curves show the carriages, counters all axes of the controller. A
name ending in .png makes a picture instead (picture.py, needs matplotlib).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.files import atomic_write, kind_of
from isel_twin.base.units import SECOND_NS
from isel_twin.jobs.checks.rules import RULES
from isel_twin.report.columns import Columns, columns
from isel_twin.report.page import whole_page
from isel_twin.report.path import COLOURS, deviation_classes, finding_picture, path_view, swaths
from isel_twin.report.svg import Mark, escape
from isel_twin.report.times import MM_FROM_UM, TimePlots, time_plots

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.checks.job import Report
    from isel_twin.jobs.checks.rules import Bounds, Finding
    from isel_twin.jobs.result import Part, Result
    from isel_twin.recordings.recorder import Recorder

KINDS = ".html", ".htm", ".png"
ROWS = 1000  # most commands listed, beside those with a finding
PICTURES = 60  # most findings with a picture
LONG = 400  # most characters of a command or reply that are shown


def write_report(
    path: str | os.PathLike[str],
    title: str,
    twin: Twin,
    recorder: Recorder,
    results: Sequence[Result],
    summary: Mapping[str, Any],
    checked: Report | None = None,
    bounds: Bounds | None = None,
) -> None:
    """Write the page, or a picture if the name ends in .png. Raises OSError, and ValueError for another ending.

    summary: of the verdict, with "ok". checked: report with the findings; bounds: those of the check.
    """
    kind = kind_of(path, KINDS, bare=True)
    seen = columns(recorder, twin.step_mm, twin.time_ns)
    findings = () if checked is None else checked.findings
    marks = [
        Mark(number, f"finding {number}: {finding.rule}: {finding.message}", time_ns)
        for number, finding in enumerate(findings, 1)
        if (time_ns := _time(finding, results)) is not None
    ]
    asked = {} if bounds is None else {"deviation_mm": bounds.deviation_mm, "margin": bounds.margin}
    limits = {key: value for key, value in asked.items() if value is not None}
    if kind == ".png":
        from isel_twin.report.picture import draw

        atomic_write(path, draw(title, seen, results, marks, limits))
        return
    plots = time_plots(seen, results, recorder, marks, limits)
    ok = bool(summary.get("ok")) if checked is None else checked.ok and bool(summary.get("ok"))
    missing = f", but {summary['not_made']} not made" if summary.get("not_made") else ""
    body = [
        f"<header><h1>{escape(title)}</h1>",
        f"<p class='verdict {'good' if ok else 'bad'}'>{'OK' if ok else 'FAILED'}{missing}</p>",
        f"<p>{escape(_in_short(summary, findings))}</p>",
        "<nav aria-label='Parts of the report'><ul><li><a href='#summary'>Summary</a></li>",
        "<li><a href='#findings'>Findings</a></li>" if findings else "",
        "<li><a href='#path'>Path</a></li><li><a href='#plots'>Time plots</a></li>",
        "<li><a href='#commands'>Commands</a></li></ul></nav></header><main>",
        "<section aria-labelledby='summary'><h2 id='summary'>Summary</h2><div class='columns tables'>",
        "" if checked is None or bounds is None else _limits(checked, bounds),
        _facts(summary),
        "</div></section>",
        _findings(findings, marks, seen, plots) if findings else "",
        _golden(findings, checked),
        _path(seen, marks, results),
        "<section aria-labelledby='plots'><h2 id='plots'>Time plots</h2>",
        _controls(),
        f"<figure>{plots.svg}<figcaption>Drag to look closer, double-click for all; Ctrl and wheel, or the keys + - 0 "
        "and the arrows work too. Numbered lines are findings.</figcaption></figure></section>",
        _commands(results, len(twin.counts), findings),
        "</main>",
    ]
    atomic_write(path, whole_page(title, body, ("report.js",)).encode())


def _time(finding: Finding, results: Sequence[Result]) -> int | None:
    """The time at which a finding is shown: its own, or the end of its line."""
    if finding.time_ns is not None:
        return finding.time_ns
    return next((result.end_ns for result in results if result.number == finding.line), None)


def _in_short(summary: Mapping[str, Any], findings: Sequence[Finding]) -> str:
    text = f"{_many(summary.get('commands', 0), 'command')}, {summary.get('refused', 0)} refused"
    text += f", {_many(len(findings), 'finding')}" if findings else ""
    time_s = summary.get("time_ns", 0) / SECOND_NS
    return f"{text}; {time_s:.3f} s of virtual time on the machine {summary.get('machine')}"


def _many(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _facts(summary: Mapping[str, Any]) -> str:
    def shown(value: Any) -> str:
        if isinstance(value, Mapping):
            return ", ".join(f"{key} {shown(each)}" for key, each in value.items()) or "none"
        if isinstance(value, list | tuple):
            return ", ".join(shown(each) for each in value) or "none"
        if isinstance(value, bool):
            return "yes" if value else "no"
        return "none" if value in (None, "") else str(value)

    told = {key: value for key, value in summary.items() if key != "time_ns"}
    told["virtual_time_s"] = f"{summary.get('time_ns', 0) / SECOND_NS:.6f}"
    body = "".join(
        f"<tr><th scope='row' class='text'>{escape(key.replace('_', ' '))}</th>"
        f"<td class='text'>{escape(shown(value))}</td></tr>\n"
        for key, value in told.items()
    )
    return f"<table><caption>The run</caption><tbody>{body}</tbody></table>"


def _limits(checked: Report, bounds: Bounds) -> str:
    nearest = checked.verdict.least_edge
    edge = "none" if nearest is None else f"{nearest[0]:.2f} ({nearest[1].upper()}, line {nearest[2]})"
    margin = checked.verdict.margin_told or "none"
    measured = {"margin": margin, "edge": edge, "cycle": f"{checked.verdict.cycle_s:.3f} s"}
    rows = []
    for name, rule in RULES.items():
        wrong = " class='wrong'" if any(finding.rule == name for finding in checked.findings) else ""
        texts = rule.demand, bounds.limit(name) or "", measured.get(name, ""), checked.outcome(name, bounds)
        cells = "".join(f"<td class='text'>{escape(text)}</td>" for text in texts)
        rows.append(f"<tr{wrong}><th scope='row' class='text'>{name}</th>{cells}</tr>\n")
    head = _head([(name, True) for name in ("rule", "demand", "limit", "measured", "result")])
    return f"<div class='wide'><table><caption>Limits</caption>{head}<tbody>{''.join(rows)}</tbody></table></div>"


def _head(names: Iterable[tuple[str, bool]]) -> str:
    cells = "".join(f"<th scope='col'{' class=text' if text else ''}>{escape(name)}</th>" for name, text in names)
    return f"<thead><tr>{cells}</tr></thead>"


def _findings(findings: Sequence[Finding], marks: Sequence[Mark], seen: Columns, plots: TimePlots) -> str:
    by_number = {mark.number: mark for mark in marks}
    items = []
    for number, finding in enumerate(findings, 1):
        mark = by_number.get(number)
        place = "" if finding.line is None else f"<a href='#line-{finding.line}'>{finding.place}</a>"
        at = "" if mark is None else f"at {mark.time_ns / SECOND_NS:.3f} s"
        look = picture = ""
        if mark is not None:
            middle = mark.time_ns / SECOND_NS
            look = (
                f" <button type='button' data-from='{middle - 0.5:.6f}' data-to='{middle + 0.5:.6f}' "
                f"aria-label='Show finding {number} in the time plots'>show</button>"
            )
            if number <= PICTURES:
                picture = f"<figure>{finding_picture(seen, mark, plots.error_at)}</figure>"
        kind = "warning" if finding.warning else "error"
        items.append(
            f"<li class='finding {kind}' id='finding-{number}'><h3><span class='number'>{number}</span> "
            f"{finding.rule} ({kind})</h3><p>{escape(finding.message[:LONG])}</p>"
            f"<p>{', '.join(part for part in (place, at) if part) or 'the job as a whole'}{look}</p>{picture}</li>\n"
        )
    return (
        "<section aria-labelledby='findings'><h2 id='findings'>Findings</h2>"
        "<p>Each with its place in the path and the error of position from a second before to a second after it.</p>"
        f"<ol class='findings'>{''.join(items)}</ol></section>"
    )


def _golden(findings: Sequence[Finding], checked: Report | None) -> str:
    """Differences from the golden run; "" without one."""
    if checked is None or not checked.golden.call:  # only a compared run has its call
        return ""
    rows = "".join(
        f"<tr><td>{'' if finding.line is None else finding.line}</td>"
        f"<td class='text'>{escape(finding.message[:LONG])}</td></tr>\n"
        for finding in findings
        if finding.rule == "golden"
    )
    head = _head([("line", False), ("difference", True)])
    told = (
        f"<div class='wide'><table><caption>Before -> now, in the order of the job: the first one is where it begins"
        f"</caption>{head}<tbody>{rows}</tbody></table></div>".replace("->", "&rarr;", 1)
        if rows
        else "<p>The job does what it did: replies, times, step stream, end.</p>"
    )
    return f"<section aria-labelledby='golden'><h2 id='golden'>Compared with the golden run</h2>{told}</section>"


def _path(seen: Columns, marks: Sequence[Mark], results: Sequence[Result]) -> str:
    most_um, _ = deviation_classes(seen)
    unit, most = ("um", most_um) if most_um < MM_FROM_UM else ("mm", most_um / 1e3)
    swatches = [
        f"<rect x='{110 + 85 * k}' y='4' width='85' height='10' fill='{colour}'/><text x='{195 + 85 * k}' y='30' "
        f"text-anchor='middle'>{most * (k + 1) / len(COLOURS):.3g}</text>"
        for k, colour in enumerate(COLOURS)
    ]
    legend = (
        f"<svg viewBox='0 0 720 36' width='720' height='36' role='img' aria-label='Colours from deviation 0 to "
        f"{most:.3g} {unit}'><text x='0' y='14'>deviation / {unit}</text>"
        f"<text x='110' y='30' text-anchor='middle'>0</text>{''.join(swatches)}</svg>"
    )
    cuts = swaths(results)
    planes = {"xy": (0, 1), "xz": (0, 2)}
    planes |= {"yz": (1, 2)} if any(cut.plane == (1, 2) for cut in cuts) else {}
    views = "".join(path_view(seen, plane, name, marks, cuts) for name, plane in planes.items())
    wide = " Grey, in the plane in which it cuts: as wide as the tool is." if cuts else ""
    return (
        "<section aria-labelledby='path'><h2 id='path'>Path</h2><p>From above and from the front, in the zero that "
        f"counts at the end. Where a counter is set anew, the path goes on.{wide}</p>"
        f"<figure><div class='columns'>{views}</div>{legend}</figure></section>"
    )


def _controls() -> str:
    zoom = ("+", "Zoom in", "+"), ("-", "Zoom out", "&minus;")
    move = ("ArrowLeft", "Earlier", "&larr;"), ("ArrowRight", "Later", "&rarr;")
    buttons = (*zoom, *move, ("0", "Whole job", "All"))
    made = "".join(
        f"<button type='button' data-act='{act}' aria-label='{name}'>{shown}</button>" for act, name, shown in buttons
    )
    return f"<div class='zoom'>{made}<span id='told' role='status'></span></div>"


def _commands(results: Sequence[Result], axes: int, findings: Sequence[Finding]) -> str:
    wrong: dict[int, list[int]] = {}
    for number, finding in enumerate(findings, 1):
        if finding.line is not None:
            wrong.setdefault(finding.line, []).append(number)
    chosen = [result for k, result in enumerate(results) if k < ROWS or result.number in wrong or not result.ok]
    shown = chosen[: 2 * ROWS]
    with_margin = any(margin is not None for result in results for margin in result.margin)
    head = [("line", False), ("time / s", False), ("took / s", False), ("command", True), ("reply", True)]
    head += [(f"count {axis.upper()}", False) for axis in AXIS_NAMES[:axes]]
    head += [(f"{axis.upper()} / mm", False) for axis in CARRIAGES]
    head += [("margin", False), ("edge", False)] if with_margin else []
    head += [("findings", True)] if wrong else []
    named: set[int] = set()
    rows = []
    for result in shown:
        key = "" if result.number in named else f" id='line-{result.number}'"
        named.add(result.number)
        times_s = result.time_ns / SECOND_NS, (result.end_ns - result.time_ns) / SECOND_NS
        cells = "".join(f"<td>{time_s:.6f}</td>" for time_s in times_s)
        cells += f"<td class='code command'>{escape(result.command[:LONG])}</td>"
        cells += f"<td class='code'>{escape(_reply(result)[:LONG])}</td>"
        cells += "".join(f"<td>{count}</td>" for count in result.counts)
        cells += "".join(f"<td>{position:.4f}</td>" for position in result.position_mm)
        if with_margin:
            cells += f"<td>{result.margin_told}</td>"
            edge = min((edge for edge in result.edge if edge is not None), default=None)
            cells += f"<td>{'' if edge is None else f'{edge:.2f}'}</td>"
        if wrong:
            links = " ".join(f"<a href='#finding-{n}'>{n}</a>" for n in wrong.get(result.number, ()))
            cells += f"<td class='text'>{links}</td>"
        style = " class='wrong'" if not result.ok or result.number in wrong else ""
        rows.append(f"<tr{key}{style}><th scope='row'>{result.number}</th>{cells}</tr>\n")
        rows += [_part(part, axes, len(head)) for part in result.parts[:ROWS]]
    rest = f"<p>and {len(results) - len(shown)} more</p>" if len(results) > len(shown) else ""
    return (
        "<section aria-labelledby='commands'><h2 id='commands'>Commands</h2><div class='wide'><table><caption>Lines of "
        f"the job, when each was sent and how long it took; counters and true positions at its end</caption>"
        f"{_head(head)}<tbody>{''.join(rows)}</tbody></table></div>{rest}</section>"
    )


def _part(part: Part, axes: int, columns: int) -> str:
    """A row for a step of a program, or a remark of the controller."""
    places = "".join(f"<td>{position:.4f}</td>" for position in part.position_mm)
    style = "" if places else " class='wrong'"
    begin = f"<td>{part.time_ns / SECOND_NS:.6f}</td><td></td><td class='code command'>{escape(part.text[:LONG])}</td>"
    rest = columns - 4 - (1 + axes + len(part.position_mm) if places else 0)
    cells = f"<td></td>{'<td></td>' * axes}{places}" if places else ""
    return f"<tr{style}><th scope='row'></th>{begin}{cells}{'<td></td>' * rest}</tr>\n"


def _reply(result: Result) -> str:
    return result.shown_reply if result.ok or not result.condition else f"{result.shown_reply} ({result.why})"
