"""The result of an identification as a self-contained page: plain HTML with inline SVG, no script.

    verdict | identifiability | estimates with intervals | correlations | held back: before and after, datum by datum

Residuals are in standard deviations of the data, on a logarithmic scale (decades above 1); within 1 is noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from isel_twin.many.identification.fit import Estimate, Fit
from isel_twin.many.identification.sealed import Day
from isel_twin.report.page import whole_page
from isel_twin.report.svg import escape

ROWS = 400  # most data listed; the worst ones first
WIDTH, ROW = 460, 22
LABEL = 46  # most characters of a label beside its bar


def page(title: str, result: Fit, fitted: Sequence[str], held: Sequence[str], day: Day | None = None) -> str:
    """The page; day: a measuring day that is scored at its end."""
    if result.worse:
        verdict = "NOT PROMOTED: what was held back is predicted worse than before"
    elif held:
        verdict = f"held back: predicted {result.times:.1f} times better than before"
    else:
        verdict = "nothing was held back: not judged"
    if not result.explains:
        verdict += "; the model does not explain what was fitted, so no number is measured"
    body = [
        f"<header><h1>{escape(title)}</h1>",
        f"<p class='verdict {'good' if result.explains and not result.worse else 'bad'}'>{escape(verdict)}</p>",
        f"<p>Fitted: {escape(', '.join(fitted))}. Held back: {escape(', '.join(held) or 'none')}. "
        f"Chi squared per degree of freedom: {result.chi2:.2f}, by chance at most {result.chi2_limit:.2f}; "
        f"by kind: {escape(', '.join(one.short for one in result.kinds))}. "
        f"{result.replays} replays.</p></header><main>",
        *(f"<p class='wrong'>{escape(line)}</p>" for line in result.doubts),
        "<section><h2>Before the fit: what these data can tell</h2><ul>",
        *(f"<li>{escape(line)}</li>" for line in result.prospect.lines),
        *(f"<li>{escape(one.line)}</li>" for one in result.noise),
        "</ul></section>",
        "<section><h2>Estimates</h2>",
        _estimates(result.estimates),
        "<figure>",
        _intervals(result.estimates),
        "<figcaption>Light: prior range. Dark: 95 % interval. In standard deviations.</figcaption></figure>",
        "<h3>Correlations</h3>",
        _correlations(result),
        "</section>",
        _laws(result) if result.laws else "",
        "<section><h2>Residuals: root mean square, in standard deviations of the data</h2>",
        _errors(result),
        "</section>",
        _held(result) if held else "",
        _day(day) if day is not None else "",
        "</main>",
    ]
    return whole_page(title, body)


def _estimates(estimates: Sequence[Estimate]) -> str:
    rows = []
    for one in estimates:
        item = one.unknown
        ranges = [f"{each.low:.4g} .. {each.high:.4g}" for each in (one, item)]
        cells = (f"{one.value:.4g}", ranges[0], escape(item.unit), ranges[1], f"{one.remaining:.0%}")
        mark = "" if one.identified else " class='wrong'"
        rows.append(
            f"<tr{mark}><th scope='row' class='text'>{escape(item.name)}</th>"
            + "".join(f"<td>{cell}</td>" for cell in cells)
            + f"<td class='text'>{escape(one.note)}</td><td class='code'>{escape(', '.join(item.keys))}</td></tr>"
        )
    head = ("value", "95 % interval", "unit", "prior range", "of the prior's", "remark", "stands for")
    titles = "".join(f"<th scope='col'>{name}</th>" for name in head)
    return (
        f"<div class='wide'><table><thead><tr><th scope='col' class='text'>parameter</th>{titles}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _intervals(estimates: Sequence[Estimate]) -> str:
    """Each parameter's prior range and interval on one scale, in standard deviations of its prior."""
    left, span = 130, 4.0
    height = ROW * len(estimates) + 20

    def px(u: float) -> float:
        return left + (max(-span, min(span, u)) + span) / (2.0 * span) * WIDTH

    parts = [f"<svg viewBox='0 0 {left + WIDTH + 20} {height}' width='{left + WIDTH + 20}' role='img'>"]
    parts += [f"<title>Prior range and interval of {len(estimates)} parameters</title>"]
    for tick in (-4, -2, 0, 2, 4):
        parts.append(f"<line class='grid' x1='{px(tick):.1f}' x2='{px(tick):.1f}' y1='0' y2='{height - 18}'/>")
        parts.append(f"<text class='soft' x='{px(tick):.1f}' y='{height - 4}' text-anchor='middle'>{tick}</text>")
    for row, one in enumerate(estimates):
        y = ROW * row + 4
        low, high = (_bounded(one, value) for value in (one.low, one.high))
        at = px(one.unknown.at(one.value))
        parts.append(f"<text x='0' y='{y + 11}'>{escape(one.unknown.name)}</text>")
        parts.append(f"<rect class='even' x='{px(-2):.1f}' y='{y}' width='{px(2) - px(-2):.1f}' height='14'/>")
        parts.append(
            f"<rect class='v1' x='{px(low):.1f}' y='{y + 3}' width='{max(2.0, px(high) - px(low)):.1f}' height='8'/>"
        )
        parts.append(f"<line class='line path' x1='{at:.1f}' x2='{at:.1f}' y1='{y}' y2='{y + 14}'/>")
    return "".join(parts) + "</svg>"


def _bounded(one: Estimate, value: float) -> float:
    return one.unknown.at(value) if value > 0.0 or not one.unknown.logarithmic else -math.inf


def _correlations(result: Fit) -> str:
    names = [escape(one.unknown.name) for one in result.estimates]
    head = "".join(f"<th scope='col'>{name}</th>" for name in names)
    rows = "".join(
        f"<tr><th scope='row' class='text'>{name}</th>" + "".join(f"<td>{value:+.2f}</td>" for value in line) + "</tr>"
        for name, line in zip(names, result.correlation.tolist(), strict=True)
    )
    return f"<div class='wide'><table><thead><tr><th></th>{head}</tr></thead><tbody>{rows}</tbody></table></div>"


def _laws(result: Fit) -> str:
    """Numbers that were not asked for: what was fitted beside, and what each would gain."""
    beside = f"<h3>Fitted beside, within what is known of them</h3>{_estimates(result.beside)}" if result.beside else ""
    rows = "".join(
        f"<tr><th scope='row' class='text'>{escape(one.law)}</th><td>{one.gained:+.1f}</td>"
        f"<td class='code'>{escape(one.key)}</td></tr>"
        for one in result.laws
    )
    head = "".join(f"<th scope='col'>{name}</th>" for name in ("gained", "number"))
    return (
        f"<section><h2>Numbers that were not asked for</h2>{beside}<h3>Laws</h3><div class='wide'><table><thead><tr>"
        f"<th scope='col' class='text'>law</th>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        "<p>Gained: logarithm of how much likelier what is held back from the fit is with this law than without "
        "it.</p></section>"
    )


def _errors(result: Fit) -> str:
    def cells(before: Mapping[str, float], after: Mapping[str, float], kind: str) -> str:
        if kind not in before:
            return "<td></td><td></td>"
        return f"<td>{before[kind]:.2f}</td><td>{after[kind]:.2f}</td>"

    kinds = list(dict.fromkeys([*result.fitted_before, *result.before]))
    rows = "".join(
        f"<tr><th scope='row' class='text'>{kind}</th>{cells(result.fitted_before, result.fitted_after, kind)}"
        f"{cells(result.before, result.after, kind)}</tr>"
        for kind in kinds
    )
    head = "".join(f"<th scope='col'>{name}</th>" for name in ("fitted, before", "after", "held back, before", "after"))
    return f"<table><thead><tr><th></th>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _held(result: Fit) -> str:
    """All held-back data with their residuals, the largest first."""
    left = 330

    def px(sigmas: float) -> float:
        return left + min(4.0, math.log10(max(1.0, abs(sigmas)))) / 4.0 * WIDTH

    each = [
        (one, (one.value - before) / one.sigma, (one.value - after) / one.sigma) for one, before, after in result.held
    ]
    each.sort(key=lambda row: -max(abs(row[1]), abs(row[2])))
    shown = each[:ROWS]
    height = 16 * len(shown) + 24
    parts = [f"<svg viewBox='0 0 {left + WIDTH + 20} {height}' width='{left + WIDTH + 20}' role='img'>"]
    parts.append("<title>Residuals of what was held back, before and after</title>")
    for decade in range(5):
        x = left + decade / 4.0 * WIDTH
        parts.append(f"<line class='grid' x1='{x:.1f}' x2='{x:.1f}' y1='0' y2='{height - 20}'/>")
        parts.append(f"<text class='soft' x='{x:.1f}' y='{height - 6}' text-anchor='middle'>{10**decade}</text>")
    for row, (item, before, after) in enumerate(shown):
        y = 16 * row
        label = f"{item.kind} {item.recording} {item.label}"[:LABEL]
        parts.append(f"<text x='0' y='{y + 11}'>{escape(label)}</text>")
        parts.append(f"<rect class='refused' x='{left}' y='{y + 2}' width='{px(before) - left:.1f}' height='6'/>")
        parts.append(f"<rect class='v1' x='{left}' y='{y + 8}' width='{px(after) - left:.1f}' height='5'/>")
    more = f" The worst {ROWS} of {len(each)}." if len(each) > ROWS else ""
    return (
        "<section><h2>Held back, before and after</h2><figure>"
        + "".join(parts)
        + "</svg><figcaption>Residuals in standard deviations, logarithmic from 1. Red: before. Blue: after."
        + f"{more}</figcaption></figure></section>"
    )


def _day(day: Day) -> str:
    """One table: predicted, measured, E_n, verdict."""
    rows = []
    for one in day.scores:
        said, there = one.predicted, one.verdict != "not measured"
        told = f"{one.measured:.4g}" if there else "", f"{one.e_n:+.2f}" if there else ""
        cells = (f"{said.value:.4g}", f"{said.low:.4g} .. {said.high:.4g}", told[0], escape(said.unit), told[1])
        mark = " class='wrong'" if one.verdict == "differs" else ""
        rows.append(
            f"<tr{mark}><th scope='row' class='text'>{escape(said.what)}</th>"
            + "".join(f"<td>{cell}</td>" for cell in cells)
            + f"<td class='text'>{one.verdict}</td></tr>"
        )
    titles = ("predicted", "band", "measured", "unit", "E<sub>n</sub>", "verdict")
    head = "".join(f"<th scope='col'>{name}</th>" for name in titles)
    return (
        "<section><h2>The measuring day, predicted beforehand</h2>"
        f"<p class='{'good' if day.holds else 'bad'}'>{escape(day.in_words())}</p>"
        f"<div class='wide'><table><thead><tr><th scope='col' class='text'>characteristic</th>{head}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div><p class='soft'>Sealed: <code>{day.seal}</code></p></section>"
    )
