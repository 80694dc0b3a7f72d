"""All plots of a job over one time axis, as inline SVG.

    commands | speed | position | error | lost steps | margin | lanes of outputs and inputs | events
                                     ^ a numbered line: a finding

In the group `zoom` x is in pixels of the whole job; report.js stretches the group.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.report.columns import Columns, Pair
from isel_twin.report.path import LEAST_UM
from isel_twin.report.svg import WIDTH, Mark, apart, badge, escape, nice, number, tenths
from isel_twin.wiring.contacts import FAULTS

if TYPE_CHECKING:
    from isel_twin.jobs.result import Result
    from isel_twin.recordings.recorder import Change, Recorder

MM_FROM_UM = 1000.0  # deviations and errors from here on are shown in mm
LEFT, RIGHT = 120, 20  # of the time plots, px
MOST_SPANS = 1500  # of a lane; spans shorter than this part of the job are joined
NEAR_PX = WIDTH / MOST_SPANS  # what is nearer is drawn as one
MOST_TOLD = 5  # events that one mark tells
_Pixels = Callable[[int], float]


@dataclass(frozen=True)
class TimePlots:
    """The drawing, and top and height of the error plot in px."""

    svg: str
    error_at: tuple[float, float]


@dataclass(frozen=True)
class _Curve:
    style: str
    name: str
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True)
class _Row:
    """Curves of one quantity; least: smallest range of the axis; bound: lines at plus and minus this."""

    name: str
    unit: str
    curves: Sequence[_Curve]
    height: float = 110.0
    least: float = 1.0
    bound: float | None = None


@dataclass
class _Drawing:
    """The drawing so far: fixed parts, parts that the zoom stretches, and the top of the next row."""

    y: float = 26.0
    fixed: list[str] = field(default_factory=list)
    moving: list[str] = field(default_factory=list)

    def lane(
        self, name: str, content: Iterable[str], group: str = "", *, base: float = 12.0, height: float = 20.0
    ) -> None:
        """A row of rectangles with its name on the left."""
        title = f"<title>{group}</title>" if group else ""
        self.fixed.append(f"<text x='{LEFT - 10}' y='{self.y + base:g}' text-anchor='end'>{title}{escape(name)}</text>")
        self.moving += content
        self.y += height


def time_plots(
    columns: Columns, results: Sequence[Result], recorder: Recorder, marks: Sequence[Mark], limits: Mapping[str, float]
) -> TimePlots:
    """The plots. limits: lines at `deviation_mm` and `margin`."""
    span_ns = columns.last_ns - columns.first_ns

    def px(time_ns: int) -> float:
        return (time_ns - columns.first_ns) / span_ns * WIDTH

    drawing, error_at = _Drawing(), (0.0, 1.0)
    drawing.lane("commands", [_command_band(results, px, drawing.y)], base=13.0, height=30.0)
    for row in _rows(columns, recorder.axes, limits):
        if row.name == "error":
            error_at = drawing.y, row.height
        _draw_row(drawing, row, (columns.time_ns - columns.first_ns) / span_ns * WIDTH, columns.piece)
    _draw_margins(drawing, results, px, limits.get("margin"))
    for group, name, spans in lanes(recorder, columns.last_ns):
        drawing.lane(name, _lane(name, spans, px, drawing.y), group)
    if recorder.events:
        drawing.lane("events", _events(recorder, px, drawing.y))
    bottom = drawing.y + 4.0
    drawing.moving += [f"<path class='mark' d='M{px(mark.time_ns):.2f} 22V{bottom:g}'/>" for mark in marks]
    badges = "".join(
        f"<g data-x='{px(mark.time_ns):.2f}' transform='translate({LEFT + px(mark.time_ns):.2f} 0)'>"
        f"<g transform='translate(0 12)'>{badge(mark)}</g></g>"
        for mark in apart(marks)
    )
    first_s, last_s = columns.first_ns / SECOND_NS, columns.last_ns / SECOND_NS
    height = bottom + 44.0
    span = f"From {first_s:.3f} to {last_s:.3f} s of virtual time: {len(results)} lines of the job"
    about = f"{span}, and {len(marks)} findings with a time. The tables on this page have the numbers."
    svg = (
        f"<svg id='times' viewBox='0 0 {LEFT + WIDTH + RIGHT} {height:g}' width='{LEFT + WIDTH + RIGHT}' "
        f"height='{height:g}' role='img' tabindex='0' aria-labelledby='times-title times-about' data-left='{LEFT}' "
        f"data-width='{WIDTH}' data-bottom='{bottom:g}' data-first='{first_s!r}' data-last='{last_s!r}'>"
        f"<title id='times-title'>Speed, position, error, margin, inputs and outputs over time</title>"
        f"<desc id='times-about'>{about}</desc>{''.join(drawing.fixed)}"
        f"<svg x='{LEFT}' y='0' width='{WIDTH}' height='{bottom:g}' overflow='hidden'><g id='zoom'>"
        f"{''.join(drawing.moving)}</g></svg>{badges}<path class='frame' d='M{LEFT} {bottom:g}h{WIDTH}'/>"
        f"<g id='ticks'>{_ticks(first_s, last_s, bottom)}</g>"
        f"<text x='{LEFT + WIDTH}' y='{bottom + 36:g}' text-anchor='end'>virtual time / s</text>"
        f"<rect id='choice' y='22' width='0' height='{bottom - 22:g}' fill='#1f4e9e' fill-opacity='.15'/>"
        f"<g id='cursor' visibility='hidden'><path class='cursor' d='M0 22V{bottom:g}'/>"
        f"<text y='{bottom + 36:g}' text-anchor='middle'></text></g></svg>"
    )
    return TimePlots(svg, error_at)


def _rows(columns: Columns, axes: int, limits: Mapping[str, float]) -> Iterable[_Row]:
    carriages = [(axis, axis) for axis in CARRIAGES]
    yield _Row("speed", "mm/s", [_Curve("path", "path", *columns.speed_mm_s)], height=100.0)
    yield _Row("position", "mm", _curves(columns.position_mm, carriages))
    most_um = 1e3 * max(float(np.nanmax(np.abs(part), initial=0.0)) for part in columns.error_mm)
    unit, by = ("um", 1e3) if most_um < MM_FROM_UM else ("mm", 1.0)
    bound = limits["deviation_mm"] * by if "deviation_mm" in limits else None
    yield _Row("error", unit, _curves(columns.error_mm, carriages, by), least=LEAST_UM * by / 1e3, bound=bound)
    low, high = columns.lost_steps
    if np.nanmax(np.abs(high), initial=0.0) >= 0.5 or np.nanmin(low, initial=0.0) <= -0.5:
        names = [(axis if axis in "xyza" else "path", axis) for axis in AXIS_NAMES[:axes]]
        yield _Row("lost", "steps", _curves(columns.lost_steps, names), height=90.0)


def _curves(pair: Pair, names: Sequence[tuple[str, str]], by: float = 1.0) -> list[_Curve]:
    """Curves with names; names: pairs of style and name."""
    return [_Curve(style, name, pair[0][:, i] * by, pair[1][:, i] * by) for i, (style, name) in enumerate(names)]


def _draw_row(drawing: _Drawing, row: _Row, x: NDArray[np.float64], piece: NDArray[np.int64]) -> None:
    low, high, step = _range(row)
    y, height = drawing.y, row.height

    def py(value: NDArray[np.float64]) -> NDArray[np.float64]:
        return y + height - (value - low) / (high - low) * height

    drawing.fixed += _scale(row, y, low, high, step)
    moving = drawing.moving
    moving.append(f"<g id='curves-{row.name}'>")
    for k in range(round(low / step), round(high / step) + 1):
        moving.append(f"<path class='grid' d='M0 {tenths(float(py(np.array(k * step))))}h{WIDTH}'/>")
    for value in (row.bound, -row.bound) if row.bound is not None else ():
        if low <= value <= high:
            moving.append(f"<path class='mark' d='M0 {tenths(float(py(np.array(value))))}h{WIDTH}'/>")
    for curve in row.curves:
        if data := _zigzag(x, py(curve.low), py(curve.high), piece):
            moving.append(f"<path class='line {curve.style}' d='{data}'/>")
    moving.append("</g>")
    drawing.y += height + 18.0


def _draw_margins(drawing: _Drawing, results: Sequence[Result], px: _Pixels, bound: float | None) -> None:
    """The least margins of the lines of the job; nothing without physics."""
    y, height = drawing.y, 80.0
    margins = _margin_lines(results, px, y, height)
    if not margins:
        return
    none = np.zeros(0)
    row = _Row("margin", "%", [_Curve(axis, axis, none, none) for axis in margins], height)
    drawing.fixed += _scale(row, y, 0.0, 100.0, 50.0)
    moving = drawing.moving
    moving.append("<g id='curves-margin'>")
    moving += [f"<path class='grid' d='M0 {tenths(y + height * part)}h{WIDTH}'/>" for part in (0.0, 0.5, 1.0)]
    if bound is not None:
        moving.append(f"<path class='mark' d='M0 {tenths(y + height * (1.0 - bound))}h{WIDTH}'/>")
    moving += [f"<path class='line {axis}' d='{data}'/>" for axis, data in margins.items()]
    moving.append("</g>")
    drawing.y += height + 18.0


def _events(recorder: Recorder, px: _Pixels, y: float) -> Iterable[str]:
    """A mark for each event, or for those that are too near each other to be told apart."""
    for _, near in itertools.groupby(recorder.events, lambda event: int(px(event[0]) / NEAR_PX)):
        events = list(near)
        told = [f"{kind} at {time_ns / SECOND_NS:.3f} s: {text}" for time_ns, kind, text in events]
        told[MOST_TOLD:] = [f"and {len(told) - MOST_TOLD} more"] if len(told) > MOST_TOLD else []
        yield (
            f"<path class='event' stroke='#c77700' stroke-width='3' vector-effect='non-scaling-stroke' "
            f"d='M{px(events[0][0]):.2f} {y:g}v16'><title>{escape('; '.join(told))}</title></path>"
        )


def _ticks(first_s: float, last_s: float, bottom: float) -> str:
    """Numbers of the time axis, for print and without the script."""
    _, _, step = nice(0.0, (last_s - first_s) * 3.0 / 8.0)
    ticks = [n * step for n in range(math.ceil(first_s / step - 1e-9), math.floor(last_s / step + 1e-9) + 1)]
    places = ((at, LEFT + (at - first_s) / (last_s - first_s) * WIDTH) for at in ticks)
    texts = (f"<text x='{x:.1f}' y='{bottom + 19:g}' text-anchor='middle'>{number(at)}</text>" for at, x in places)
    return "".join(texts)


def _range(row: _Row) -> tuple[float, float, float]:
    """Ends of the axis for the curves of a row, and the distance of its grid lines."""
    low = min(float(np.nanmin(curve.low, initial=0.0)) for curve in row.curves)
    high = max(float(np.nanmax(curve.high, initial=0.0)) for curve in row.curves)
    if row.bound is not None and row.bound < 4.0 * max(high, -low):  # a distant bound would flatten the curve
        low, high = min(low, -row.bound), max(high, row.bound)
    if high - low < row.least:
        low, high = min(low, -row.least if low < 0.0 else 0.0), max(high, row.least)
    return nice(low, high)


def _scale(row: _Row, y: float, low: float, high: float, step: float) -> Iterable[str]:
    """The left side of a row: its name and unit, the names of several curves, and numbers."""
    yield f"<text x='4' y='{y + 12:g}'>{row.name}</text><text class='soft' x='4' y='{y + 28:g}'>{row.unit}</text>"
    if len(row.curves) > 1 or row.name == "margin":
        for k, curve in enumerate(row.curves):
            name = curve.name.upper()
            yield f"<text class='f{curve.style}' x='{4 + 15 * k}' y='{y + 46:g}' font-weight='700'>{name}</text>"
    for k in range(round(low / step), round(high / step) + 1):
        at = y + row.height - (k * step - low) / (high - low) * row.height
        yield f"<text x='{LEFT - 8}' y='{at + 4:.1f}' text-anchor='end'>{number(k * step)}</text>"


def _zigzag(
    x: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], piece: NDArray[np.int64]
) -> str:
    """A line through minimum and maximum of each column, interrupted between pieces; y grows downwards."""
    good = np.isfinite(low)
    x, low, high, piece = x[good], low[good], high[good], piece[good]
    data = []
    for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(piece)) + 1):
        if not len(part):
            continue
        points: list[str] = []
        values: list[tuple[str, str]] = []
        for at, a, b in zip(x[part].tolist(), low[part].tolist(), high[part].tolist(), strict=True):
            values += [(f"{at:.2f}", tenths(a))] + ([(f"{at:.2f}", tenths(b))] if abs(a - b) >= 0.05 else [])
        for k, (at_text, value) in enumerate(values):  # a level stretch needs only its ends
            if not (0 < k < len(values) - 1 and values[k - 1][1] == value == values[k + 1][1]):
                points.append(f"{at_text} {value}")
        data.append("M" + "L".join(points if len(points) > 1 else points * 2))
    return "".join(data)


def _command_band(results: Sequence[Result], px: _Pixels, y: float) -> str:
    """The commands; those too short to be told apart as one, but for the refused."""
    parts = []
    sent = [result for result in results if not result.condition]
    joined: Result | None = None  # the first of those that are not drawn yet
    for k, result in enumerate(sent):
        begin = joined or result
        first, last = px(begin.time_ns), px(result.end_ns)
        if last - first < NEAR_PX and result.ok and k + 1 < len(sent):
            joined = begin
            continue
        joined = None
        style = ("even", "odd")[k % 2] if result.ok else "refused"
        lines = f"line {result.number}" if begin is result else f"lines {begin.number} to {result.number}"
        told = f"{lines}: {result.command[:80]} ({result.time_ns / SECOND_NS:.3f} s)"
        parts.append(
            f"<rect class='{style}' x='{first:.2f}' y='{y:g}' width='{max(last - first, 0.5):.2f}' height='18'>"
            f"<title>{escape(told)}</title></rect>"
        )
    return "".join(parts)


def _margin_lines(results: Sequence[Result], px: _Pixels, y: float, height: float) -> dict[str, str]:
    """The least margin of each axis in each line of the job, as a stepped curve; none without physics. Of lines too
    short to be told apart, the least and the largest."""
    found = {}
    for i, axis in enumerate(AXIS_NAMES):
        spans: list[tuple[float, float, float, float]] = []  # begin, end, least, largest
        for result in results:
            margin = result.margin[i] if i < len(result.margin) else None
            if margin is None:
                continue
            first, last, low, high = px(result.time_ns), px(result.end_ns), margin, margin
            if spans and last - spans[-1][0] < NEAR_PX:
                first, _, least, largest = spans.pop()
                low, high = min(low, least), max(high, largest)
            spans.append((first, last, low, high))
        if spans:
            found[axis] = "".join(_margin_line(span, y, height) for span in spans)
    return found


def _margin_line(span: tuple[float, float, float, float], y: float, height: float) -> str:
    first, last, low, high = span
    from_high = f"{tenths(y + height * (1.0 - high))}V" if high > low else ""
    return f"M{first:.2f} {from_high}{tenths(y + height * (1.0 - low))}H{last:.2f}"


def lanes(recorder: Recorder, last_ns: int) -> list[tuple[str, str, list[tuple[int, int, int | str]]]]:
    """(group, name, spans) of each output and input that changes or is faulty; a span is (from, to, value)."""
    names = [(group, name) for kind in ("output", "input") for group, name in recorder.names() if group == kind]
    histories: dict[tuple[str, str], list[Change]] = {}
    for change in recorder.changes:
        histories.setdefault((change.group, change.name), []).append(change)
    found = []
    for group, name in names:
        history = histories.get((group, name), [])
        if len(history) < 2 and not any(change.value in FAULTS and change.value != "ok" for change in history):
            continue
        ends = [change.time_ns for change in history[1:]] + [last_ns]
        spans = [(change.time_ns, end, change.value) for change, end in zip(history, ends, strict=True)]
        found.append((group, name, spans))
    return found


def _lane(name: str, spans: Sequence[tuple[int, int, int | str]], px: _Pixels, y: float) -> Iterable[str]:
    values: dict[int | str, int] = {0: 0, "free": 0, "released": 0, "closed": 0, "ok": 0}
    if isinstance(spans[0][2], str):  # the first state of an input is its rest; numbers have no rest
        values[spans[0][2]] = 0
    least_ns = (spans[-1][1] - spans[0][0]) / MOST_SPANS if len(spans) > MOST_SPANS else 0.0
    styles, joined = set(), 0  # of spans too short to be told apart; how many
    for k, (first_ns, last_ns, value) in enumerate(spans):
        kind = values.setdefault(value, max(values.values()) + 1)
        styles.add("fault" if value in FAULTS and value != "ok" else f"v{min(kind, 3)}")
        first_ns = spans[k - joined][0]
        if last_ns - first_ns < least_ns and k + 1 < len(spans):
            joined += 1
            continue
        said = f"{joined + 1} states, the last {value}," if joined else str(value)
        told = f"{name} {said} from {first_ns / SECOND_NS:.3f} to {last_ns / SECOND_NS:.3f} s"
        first, last, style = px(first_ns), px(last_ns), "fault" if "fault" in styles else max(styles)
        styles, joined = set(), 0
        yield (
            f"<rect class='{style}' x='{first:.2f}' y='{y:g}' width='{max(last - first, 0.6):.2f}' height='16'>"
            f"<title>{escape(told)}</title></rect>"
        )
