"""Drawings of a report as inline SVG: the path in two views, and everything that has a time above one axis.

    path        XY and XZ; colour: how far the machine is from its counters
    times       commands | speed | position | error | margin | lost steps | lanes of outputs, inputs, faults, events
                                     ^ a numbered line: a finding
    picture     of a finding: where in the path it was, and the error around its time

Everything in the group `zoom` has x in pixels of the whole job; report.js stretches the group. No other style than that
of classes is used, so that a page can forbid all others.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.report.columns import Columns
from isel_twin.wiring.contacts import FAULTS

if TYPE_CHECKING:
    from isel_twin.jobs.job import Result
    from isel_twin.recordings.recorder import Change, Recorder

COLOURS = ("#1f4e9e", "#2a86b8", "#35a07c", "#c9a227", "#dd7a1c", "#c02a1d")
"""Of deviations, from none to the largest."""
LEAST_UM = 1.0
"""Deviation up to which all is one colour: rounding is not worth one."""
MM_FROM_UM = 1000.0
"""Deviations and errors from here on are told in mm."""
LEFT, WIDTH, RIGHT = 120, 1020, 20
"""Of the time plots, px."""
MOST_SPANS = 1500
"""Of a lane; shorter ones than that part of the job are joined."""

_Pixels = Callable[[int], NDArray[np.float64]]

_CONTROLS = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def escape(text: object) -> str:
    """Text for a page: nothing in it is markup, and characters that a page may not hold are shown as such."""
    return html.escape(_CONTROLS.sub("\ufffd", str(text)))


@dataclass(frozen=True)
class Mark:
    """A finding in a drawing."""

    number: int
    text: str
    time_ns: int


def _number(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def _nice(low: float, high: float) -> tuple[float, float, float]:
    """Ends of an axis that holds both, and the distance of its grid lines."""
    span = max(high - low, 1e-9)
    power = 10.0 ** math.floor(math.log10(span / 3.0))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= span / 3.0)
    return math.floor(low / step) * step, math.ceil(high / step) * step, step


def _told(value: float) -> str:
    return f"{value + 0.0:g}" if abs(value) >= 1e-9 else "0"


# The path


def deviation_classes(columns: Columns) -> tuple[float, NDArray[np.int64]]:
    """Largest deviation in um, at least LEAST_UM, and for each vertex of the path which of COLOURS it has."""
    deviation_um = columns.way.deviation_mm * 1e3
    most_um = max(float(np.nanmax(deviation_um, initial=0.0)), LEAST_UM)
    classes = np.minimum(np.nan_to_num(deviation_um / most_um) * len(COLOURS), len(COLOURS) - 1)
    return most_um, classes.astype(np.int64)


@dataclass(frozen=True)
class Swath:
    """A tool of a radius cuts in a plane, from one time to another."""

    begin_ns: int
    end_ns: int
    plane: tuple[int, int]
    radius_mm: float


def swaths(results: Sequence[Result]) -> list[Swath]:
    """Where the tools of programs cut, one for each stretch in one plane with one tool."""
    found: list[Swath] = []
    for result in results:
        steps = [part for part in result.parts if part.position_mm]
        ends = [step.time_ns for step in steps[1:]] + [result.end_ns]
        for step, end_ns in zip(steps, ends, strict=False):
            if step.tool_mm <= 0.0:
                continue
            plane = (min(step.plane), max(step.plane))
            last = found[-1] if found else None
            if last is not None and (last.end_ns, last.plane, last.radius_mm) == (step.time_ns, plane, step.tool_mm):
                found[-1] = Swath(last.begin_ns, end_ns, plane, step.tool_mm)
            else:
                found.append(Swath(step.time_ns, end_ns, plane, step.tool_mm))
    return found


def path_view(
    columns: Columns, axes: tuple[int, int], name: str, marks: Sequence[Mark], cuts: Sequence[Swath] = ()
) -> str:
    """The path seen along the third axis, in equal scales; cuts: of them, those in its plane are drawn as wide as the
    tool is."""
    u, v = axes
    points = columns.way.position_mm[:, [u, v]]
    names = CARRIAGES[u].upper(), CARRIAGES[v].upper()
    most_um, classes = deviation_classes(columns)
    width, height = 570.0, 430.0
    box = 62.0, 28.0, 490.0, 350.0  # left, top, width and height of the frame
    low, high = points.min(axis=0), points.max(axis=0)
    scale = max(float(max((high[0] - low[0]) / box[2], (high[1] - low[1]) / box[3])) * 1.08, 1e-3)
    middle = (low + high) / 2.0
    x = box[0] + box[2] / 2.0 + (points[:, 0] - middle[0]) / scale
    y = box[1] + box[3] / 2.0 - (points[:, 1] - middle[1]) / scale
    key = f"path-{name}"
    title = f"Path in {names[0]} and {names[1]}, coloured by deviation"
    about = (
        f"{names[0]} from {low[0]:.3f} to {high[0]:.3f} mm, {names[1]} from {low[1]:.3f} to {high[1]:.3f} mm; "
        f"the largest deviation is {most_um:.4g} um."
    )
    parts = [
        f"<svg viewBox='0 0 {width:g} {height:g}' width='{width:g}' height='{height:g}' role='img' "
        f"aria-labelledby='{key}-title {key}-about'>",
        f"<title id='{key}-title'>{title}</title><desc id='{key}-about'>{about}</desc>",
    ]
    parts += _path_axes(box, middle, scale, names)
    parts.append(f"<rect class='frame' x='{box[0]:g}' y='{box[1]:g}' width='{box[2]:g}' height='{box[3]:g}'/>")
    for cut in cuts:
        if cut.plane == axes:
            here = (columns.way.time_ns >= cut.begin_ns) & (columns.way.time_ns <= cut.end_ns)
            data, wide = _line(x[here].tolist(), y[here].tolist()) if here.any() else "", 2.0 * cut.radius_mm / scale
            told = f"<title>tool of radius {cut.radius_mm:g} mm</title>"
            if data:
                parts.append(f"<path class='swath' stroke-width='{wide:.2f}' d='{data}'>{told}</path>")
    parts.append(f"<g id='{key}'>")
    for colour in range(len(COLOURS)):
        if data := _runs(x, y, classes == colour):
            parts.append(f"<path class='line' stroke='{COLOURS[colour]}' d='{data}'/>")
    parts.append("</g>")
    for mark in _apart(marks):
        at = columns.way.at(mark.time_ns)
        px = box[0] + box[2] / 2.0 + (at[u] - middle[0]) / scale
        py = box[1] + box[3] / 2.0 - (at[v] - middle[1]) / scale
        parts.append(f"<g transform='translate({px:.1f} {py:.1f})'>{_badge(mark)}</g>")
    parts.append("</svg>")
    return "".join(parts)


def _path_axes(
    box: tuple[float, float, float, float], middle: NDArray[np.float64], scale: float, names: tuple[str, str]
) -> Iterable[str]:
    for axis in (0, 1):
        half = box[2 + axis] / 2.0 * scale
        first, last, step = _nice(float(middle[axis]) - half, float(middle[axis]) + half)
        for n in range(round(first / step), round(last / step) + 1):
            place = (n * step - middle[axis]) / scale
            if abs(place) > box[2 + axis] / 2.0 + 1e-6:
                continue
            if axis == 0:
                x = box[0] + box[2] / 2.0 + place
                yield f"<path class='grid' d='M{x:.1f} {box[1]}v{box[3]}'/>"
                yield f"<text x='{x:.1f}' y='{box[1] + box[3] + 17:g}' text-anchor='middle'>{_told(n * step)}</text>"
            else:
                y = box[1] + box[3] / 2.0 - place
                yield f"<path class='grid' d='M{box[0]} {y:.1f}h{box[2]}'/>"
                yield f"<text x='{box[0] - 7:g}' y='{y + 4:.1f}' text-anchor='end'>{_told(n * step)}</text>"
    yield f"<text x='{box[0] + box[2]:g}' y='{box[1] + box[3] + 35:g}' text-anchor='end'>{names[0]} / mm</text>"
    yield f"<text x='{box[0]:g}' y='{box[1] - 9:g}'>{names[1]} / mm</text>"


def _runs(x: NDArray[np.float64], y: NDArray[np.float64], wanted: NDArray[np.bool_]) -> str:
    """Lines from each wanted vertex to the next one, whatever that is."""
    if len(x) < 2:
        return ""
    edges = np.diff(np.concatenate([[0], wanted[:-1].astype(np.int8), [0]]))
    firsts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return "".join(_line(x[a : b + 1], y[a : b + 1]) for a, b in zip(firsts, ends, strict=True))


def _line(x: Iterable[float], y: Iterable[float]) -> str:
    """One line, in tenths of a pixel, points that are the same left out."""
    points = list(dict.fromkeys(f"{_number(a)} {_number(b)}" for a, b in zip(x, y, strict=True)))
    return "M" + "L".join(points if len(points) > 1 else points * 2)


def _badge(mark: Mark) -> str:
    wide = 8.0 + 3.0 * len(str(mark.number))
    return (
        f"<a href='#finding-{mark.number}'><title>{escape(mark.text)}</title><circle class='fault' r='{wide:g}' "
        f"fill-opacity='.9'/><text class='badge' text-anchor='middle' y='4'>{mark.number}</text></a>"
    )


def _apart(marks: Sequence[Mark]) -> Iterable[Mark]:
    """Marks at one time are one, the first."""
    return {mark.time_ns: mark for mark in reversed(marks)}.values()


# Everything above one axis of time


@dataclass(frozen=True)
class _Curve:
    style: str
    name: str
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def time_plots(
    columns: Columns, results: Sequence[Result], recorder: Recorder, marks: Sequence[Mark], limits: Mapping[str, float]
) -> str:
    """The plots. limits: lines at `deviation_mm` and `margin`."""
    span_ns = columns.last_ns - columns.first_ns

    def px(time_ns: NDArray[np.int64] | int) -> NDArray[np.float64]:
        return (np.asarray(time_ns) - columns.first_ns) / span_ns * WIDTH

    fixed: list[str] = []  # names and scales, which stay where they are
    moving: list[str] = []
    y = 26.0
    fixed.append(f"<text x='{LEFT - 10}' y='{y + 13:g}' text-anchor='end'>commands</text>")
    moving.append(_command_band(results, px, y))
    y += 30.0
    x = px(columns.time_ns)
    axes = recorder.axes
    carriages = [(axis, axis) for axis in CARRIAGES]

    speed = _Curve("path", "path", *columns.speed_mm_s)
    rows = [
        ("speed", "mm/s", [speed], 100.0, 1.0, None),
        ("position", "mm", _curves(columns.position_mm, carriages, 1.0), 110.0, 1.0, None),
        ("error", *_in_unit(columns.error_mm, carriages, limits.get("deviation_mm"))),
    ]
    if np.nanmax(np.abs(columns.lost_steps[1]), initial=0.0) >= 0.5 or (
        np.nanmin(columns.lost_steps[0], initial=0.0) <= -0.5
    ):
        names = [(axis if axis in "xyza" else "path", axis) for axis in AXIS_NAMES[:axes]]
        rows.insert(3, ("lost", "steps", _curves(columns.lost_steps, names, 1.0), 90.0, 1.0, None))
    error_at = (0.0, 1.0)
    for name, unit, drawn, height, least, limit in rows:
        if name == "error":
            error_at = (y, height)
        bound = limit
        low, high, step = _range(drawn, least, bound)
        fixed += _scale(name, unit, drawn, y, height, low, high, step)

        def py(
            value: NDArray[np.float64], y: float = y, height: float = height, low: float = low, high: float = high
        ) -> NDArray[np.float64]:
            return y + height - (value - low) / (high - low) * height

        moving.append(f"<g id='curves-{name}'>")
        for k in range(round(low / step), round(high / step) + 1):
            moving.append(f"<path class='grid' d='M0 {_number(float(py(np.array(k * step))))}h{WIDTH}'/>")
        if bound is not None:
            for value in (bound, -bound):
                if low <= value <= high:
                    moving.append(f"<path class='mark' d='M0 {_number(float(py(np.array(value))))}h{WIDTH}'/>")
        for curve in drawn:
            data = _zigzag(x, py(curve.low), py(curve.high), columns.piece)
            if data:
                moving.append(f"<path class='line {curve.style}' d='{data}'/>")
        moving.append("</g>")
        y += height + 18.0
    margins = _margin_lines(results, px, y, 80.0)
    if margins:
        fixed += _scale("margin", "%", [_Curve(a, a, x, x) for a in margins], y, 80.0, 0.0, 100.0, 50.0)
        moving.append("<g id='curves-margin'>")
        moving += [f"<path class='grid' d='M0 {_number(y + 80.0 * part)}h{WIDTH}'/>" for part in (0.0, 0.5, 1.0)]
        if "margin" in limits:
            moving.append(f"<path class='mark' d='M0 {_number(y + 80.0 * (1.0 - limits['margin']))}h{WIDTH}'/>")
        moving += [f"<path class='line {axis}' d='{data}'/>" for axis, data in margins.items()]
        moving.append("</g>")
        y += 98.0
    for group, name, spans in lanes(recorder, columns.last_ns):
        fixed.append(
            f"<text x='{LEFT - 10}' y='{y + 12:g}' text-anchor='end'><title>{group}</title>{escape(name)}</text>"
        )
        moving += _lane(name, spans, px, y)
        y += 20.0
    if recorder.events:
        fixed.append(f"<text x='{LEFT - 10}' y='{y + 12:g}' text-anchor='end'>events</text>")
        for time_ns, kind, text in recorder.events[:MOST_SPANS]:
            at, told = float(px(time_ns)), f"{kind} at {time_ns / SECOND_NS:.3f} s: {text}"
            moving.append(
                f"<path class='event' stroke='#c77700' stroke-width='3' vector-effect='non-scaling-stroke' "
                f"d='M{at:.2f} {y:g}v16'><title>{escape(told)}</title></path>"
            )
        y += 20.0
    bottom = y + 4.0
    for mark in marks:
        moving.append(f"<path class='mark' d='M{float(px(mark.time_ns)):.2f} 22V{bottom:g}'/>")
    badges = "".join(
        f"<g data-x='{float(px(mark.time_ns)):.2f}' transform='translate({LEFT + float(px(mark.time_ns)):.2f} 0)'>"
        f"<g transform='translate(0 12)'>{_badge(mark)}</g></g>"
        for mark in _apart(marks)
    )
    first_s, last_s = columns.first_ns / SECOND_NS, columns.last_ns / SECOND_NS
    height = bottom + 44.0
    about = (
        f"From {first_s:.3f} to {last_s:.3f} s of virtual time: {len(results)} lines of the job, and "
        f"{len(marks)} findings with a time. The tables on this page have the numbers."
    )
    return (
        f"<svg id='times' viewBox='0 0 {LEFT + WIDTH + RIGHT} {height:g}' width='{LEFT + WIDTH + RIGHT}' "
        f"height='{height:g}' role='img' tabindex='0' aria-labelledby='times-title times-about' data-left='{LEFT}' "
        f"data-width='{WIDTH}' data-bottom='{bottom:g}' data-first='{first_s!r}' data-last='{last_s!r}' "
        f"data-error='{error_at[0]:g} {error_at[1]:g}'>"
        f"<title id='times-title'>Speed, position, error, margin, inputs and outputs over time</title>"
        f"<desc id='times-about'>{about}</desc>{''.join(fixed)}"
        f"<svg x='{LEFT}' y='0' width='{WIDTH}' height='{bottom:g}' overflow='hidden'><g id='zoom'>{''.join(moving)}"
        f"</g></svg>{badges}<path class='frame' d='M{LEFT} {bottom:g}h{WIDTH}'/>"
        f"<g id='ticks'>{_ticks(first_s, last_s, bottom)}</g>"
        f"<text x='{LEFT + WIDTH}' y='{bottom + 36:g}' text-anchor='end'>virtual time / s</text>"
        f"<rect id='choice' y='22' width='0' height='{bottom - 22:g}' fill='#1f4e9e' fill-opacity='.15'/>"
        f"<g id='cursor' visibility='hidden'><path class='cursor' d='M0 22V{bottom:g}'/>"
        f"<text y='{bottom + 36:g}' text-anchor='middle'></text></g></svg>"
    )


def _curves(
    pair: tuple[NDArray[np.float64], NDArray[np.float64]], names: Sequence[tuple[str, str]], by: float
) -> list[_Curve]:
    """Of pairs of style and name."""
    return [_Curve(style, name, pair[0][:, i] * by, pair[1][:, i] * by) for i, (style, name) in enumerate(names)]


def _in_unit(
    error_mm: tuple[NDArray[np.float64], NDArray[np.float64]], names: Sequence[tuple[str, str]], limit_mm: float | None
) -> tuple[str, list[_Curve], float, float, float | None]:
    """The row of errors, in um, or in mm if they are large."""
    most_um = 1e3 * max(float(np.nanmax(np.abs(part), initial=0.0)) for part in error_mm)
    unit, by = ("um", 1e3) if most_um < MM_FROM_UM else ("mm", 1.0)
    return unit, _curves(error_mm, names, by), 110.0, LEAST_UM * by / 1e3, None if limit_mm is None else limit_mm * by


def _ticks(first_s: float, last_s: float, bottom: float) -> str:
    """Without a script, and in print, the axis has its numbers as well."""
    _, _, step = _nice(0.0, (last_s - first_s) * 3.0 / 8.0)
    parts = []
    for n in range(math.ceil(first_s / step - 1e-9), math.floor(last_s / step + 1e-9) + 1):
        x = LEFT + (n * step - first_s) / (last_s - first_s) * WIDTH
        parts.append(f"<text x='{x:.1f}' y='{bottom + 19:g}' text-anchor='middle'>{_told(n * step)}</text>")
    return "".join(parts)


def _range(drawn: Sequence[_Curve], least: float, bound: float | None) -> tuple[float, float, float]:
    """Axis for curves: what is less than `least` is not magnified."""
    low = min(float(np.nanmin(curve.low, initial=0.0)) for curve in drawn)
    high = max(float(np.nanmax(curve.high, initial=0.0)) for curve in drawn)
    if bound is not None and bound < 4.0 * max(high, -low):  # a bound far away would flatten the curve
        low, high = min(low, -bound), max(high, bound)
    if high - low < least:
        low, high = min(low, -least if low < 0.0 else 0.0), max(high, least)
    return _nice(low, high)


def _scale(
    name: str, unit: str, drawn: Sequence[_Curve], y: float, height: float, low: float, high: float, step: float
) -> Iterable[str]:
    yield f"<text x='4' y='{y + 12:g}'>{name}</text><text class='soft' x='4' y='{y + 28:g}'>{unit}</text>"
    if len(drawn) > 1 or name == "margin":
        for k, curve in enumerate(drawn):
            style = curve.style
            name = curve.name.upper()
            yield f"<text class='f{style}' x='{4 + 15 * k}' y='{y + 46:g}' font-weight='700'>{name}</text>"
    for k in range(round(low / step), round(high / step) + 1):
        at = y + height - (k * step - low) / (high - low) * height
        yield f"<text x='{LEFT - 8}' y='{at + 4:.1f}' text-anchor='end'>{_told(k * step)}</text>"


def _zigzag(
    x: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], piece: NDArray[np.int64]
) -> str:
    """A line through the least and greatest value of each column, interrupted between pieces; y grows downwards."""
    good = np.isfinite(low)
    x, low, high, piece = x[good], low[good], high[good], piece[good]
    data = []
    for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(piece)) + 1):
        if not len(part):
            continue
        points: list[str] = []
        values: list[tuple[str, str]] = []
        for at, a, b in zip(x[part].tolist(), low[part].tolist(), high[part].tolist(), strict=True):
            values += [(f"{at:.2f}", _number(a))] + ([(f"{at:.2f}", _number(b))] if abs(a - b) >= 0.05 else [])
        for k, (at_text, value) in enumerate(values):  # of a level stretch the ends are enough
            if not (0 < k < len(values) - 1 and values[k - 1][1] == value == values[k + 1][1]):
                points.append(f"{at_text} {value}")
        data.append("M" + "L".join(points if len(points) > 1 else points * 2))
    return "".join(data)


def _command_band(results: Sequence[Result], px: _Pixels, y: float) -> str:
    parts = []
    sent = [result for result in results if not result.condition]
    shown = 0.0
    for k, result in enumerate(sent):
        first, last = float(px(result.time_ns)), float(px(result.end_ns))
        if last - shown < WIDTH / MOST_SPANS and result.ok:
            continue
        shown = last
        style = ("even", "odd")[k % 2] if result.ok else "refused"
        told = f"line {result.number}: {result.command[:80]} ({result.time_ns / SECOND_NS:.3f} s)"
        parts.append(
            f"<rect class='{style}' x='{first:.2f}' y='{y:g}' width='{max(last - first, 0.5):.2f}' height='18'>"
            f"<title>{escape(told)}</title></rect>"
        )
    return "".join(parts)


def _margin_lines(results: Sequence[Result], px: _Pixels, y: float, height: float) -> dict[str, str]:
    """The least margin of each axis in each line of the job, as steps; none without physics."""
    found = {}
    for i, axis in enumerate(AXIS_NAMES):
        data, shown = [], -1.0
        for result in results:
            margin = result.margin[i] if i < len(result.margin) else None
            first, last = float(px(result.time_ns)), float(px(result.end_ns))
            if margin is None or (last - shown < WIDTH / MOST_SPANS and margin >= 0.2):
                continue
            shown = last
            data.append(f"M{first:.2f} {_number(y + height * (1.0 - margin))}H{last:.2f}")
        if data:
            found[axis] = "".join(data)
    return found


# Lanes


def lanes(recorder: Recorder, last_ns: int) -> list[tuple[str, str, list[tuple[int, int, int | str]]]]:
    """(group, name, spans) of each output and input that changes or is faulty: (from, to, value), as time goes."""
    order = {"output": 0, "input": 1}
    names = [each for each in recorder.names() if each[0] in order]
    histories: dict[tuple[str, str], list[Change]] = {}
    for change in recorder.changes:
        histories.setdefault((change.group, change.name), []).append(change)
    found = []
    for group, name in sorted(names, key=lambda each: order[each[0]]):
        history = histories.get((group, name), [])
        if len(history) < 2 and not any(change.value in FAULTS and change.value != "ok" for change in history):
            continue
        ends = [change.time_ns for change in history[1:]] + [last_ns]
        spans = [(change.time_ns, end, change.value) for change, end in zip(history, ends, strict=True)]
        found.append((group, name, spans))
    return found


def _lane(name: str, spans: Sequence[tuple[int, int, int | str]], px: _Pixels, y: float) -> Iterable[str]:
    values: dict[int | str, int] = {0: 0, "free": 0, "released": 0, "closed": 0, "ok": 0}
    if isinstance(spans[0][2], str):  # of an input, what it is at first is its rest; a number speaks for itself
        values[spans[0][2]] = 0
    least = (spans[-1][1] - spans[0][0]) / MOST_SPANS
    drawn_ns = spans[0][0]
    for first_ns, last_ns, value in spans:
        if len(spans) > MOST_SPANS and last_ns - drawn_ns < least:
            continue
        first, last = float(px(min(first_ns, drawn_ns) if len(spans) > MOST_SPANS else first_ns)), float(px(last_ns))
        drawn_ns = last_ns
        kind = values.setdefault(value, max(values.values()) + 1)
        style = "fault" if value in FAULTS and value != "ok" else f"v{min(kind, 3)}"
        told = f"{name} {value} from {first_ns / SECOND_NS:.3f} to {last_ns / SECOND_NS:.3f} s"
        yield (
            f"<rect class='{style}' x='{first:.2f}' y='{y:g}' width='{max(last - first, 0.6):.2f}' height='16'>"
            f"<title>{escape(told)}</title></rect>"
        )


def picture(columns: Columns, mark: Mark, plots: str) -> str:
    """Where in the path a finding is, and speed and error for a second around it; drawn from what the page has."""
    at = re.search(r"data-error='(\S+) (\S+)'", plots)
    y, height = (float(at[1]), float(at[2])) if at else (0.0, 100.0)
    span_ns = columns.last_ns - columns.first_ns
    middle = (mark.time_ns - columns.first_ns) / span_ns * WIDTH
    half = min(SECOND_NS / span_ns, 0.5) * WIDTH
    position = columns.way.at(mark.time_ns)
    where = ", ".join(f"{axis.upper()} {mm:.3f} mm" for axis, mm in zip(CARRIAGES, position, strict=True))
    points = columns.way.position_mm[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    scale = max(float(max((high[0] - low[0]) / 490.0, (high[1] - low[1]) / 350.0)) * 1.08, 1e-3)
    px = 307.0 + (position[0] - (low[0] + high[0]) / 2.0) / scale
    py = 203.0 - (position[1] - (low[1] + high[1]) / 2.0) / scale
    return (
        f"<svg viewBox='0 0 320 120' width='320' height='120' role='img' aria-label='Place of finding {mark.number} in "
        f"the path, {where}; error of position within a second of it'>"
        f"<svg x='0' width='160' height='120' viewBox='55 20 505 366'><use href='#path-xy'/>"
        f"<circle cx='{px:.1f}' cy='{py:.1f}' r='16' fill='none' stroke='#b3261e' stroke-width='7'/></svg>"
        f"<svg x='170' width='150' height='120' viewBox='{middle - half:.3f} {y - 4:g} {2 * half:.3f} {height + 8:g}' "
        f"preserveAspectRatio='none'><use href='#curves-error'/>"
        f"<path class='mark' d='M{middle:.3f} {y:g}v{height:g}'/></svg></svg>"
    )
