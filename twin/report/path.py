"""The path of a job in two views, XY and XZ, as inline SVG; the colour shows the deviation from the counters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.report.columns import Columns
from isel_twin.report.svg import WIDTH, Mark, apart, badge, line, nice, number

if TYPE_CHECKING:
    from isel_twin.jobs.result import Result

COLOURS = ("#1f4e9e", "#2a86b8", "#35a07c", "#c9a227", "#dd7a1c", "#c02a1d")  # of deviations, from small to large
LEAST_UM = 1.0  # smaller deviations have one colour: they are rounding errors
BOX = 62.0, 28.0, 490.0, 350.0  # of a view: left, top, width and height of the frame, px


def deviation_classes(columns: Columns) -> tuple[float, NDArray[np.int64]]:
    """Largest deviation in um, at least LEAST_UM, and for each vertex of the path the index in COLOURS."""
    deviation_um = columns.way.deviation_mm * 1e3
    most_um = max(float(np.nanmax(deviation_um, initial=0.0)), LEAST_UM)
    classes = np.minimum(np.nan_to_num(deviation_um / most_um) * len(COLOURS), len(COLOURS) - 1)
    return most_um, classes.astype(np.int64)


@dataclass(frozen=True)
class Swath:
    """A stretch of time with one tool cutting in one plane."""

    begin_ns: int
    end_ns: int
    plane: tuple[int, int]
    radius_mm: float


def swaths(results: Sequence[Result]) -> list[Swath]:
    """The swaths that programs cut."""
    found: list[Swath] = []
    for result in results:
        steps = [part for part in result.parts if part.position_mm]
        ends = [step.time_ns for step in steps[1:]] + [result.end_ns]
        for step, end_ns in zip(steps, ends, strict=False):
            if step.tool_mm <= 0.0:
                continue
            new = Swath(step.time_ns, end_ns, (min(step.plane), max(step.plane)), step.tool_mm)
            last = found[-1] if found else None
            if last is not None and last == replace(new, begin_ns=last.begin_ns, end_ns=new.begin_ns):
                found[-1] = replace(last, end_ns=end_ns)
            else:
                found.append(new)
    return found


@dataclass(frozen=True, eq=False)
class _View:
    """Two axes of the path in the frame, in equal scales."""

    axes: tuple[int, int]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @staticmethod
    def of(columns: Columns, axes: tuple[int, int]) -> _View:
        points = columns.way.position_mm[:, axes]
        return _View(axes, points.min(axis=0), points.max(axis=0))

    @property
    def middle(self) -> NDArray[np.float64]:
        return (self.low + self.high) / 2.0

    @property
    def scale(self) -> float:
        """mm per px."""
        extent = self.high - self.low
        return max(float(max(extent[0] / BOX[2], extent[1] / BOX[3])) * 1.08, 1e-3)

    def px(self, position_mm: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """x and y in px of positions [..., 3]."""
        from_middle = (position_mm[..., self.axes] - self.middle) / self.scale
        return BOX[0] + BOX[2] / 2.0 + from_middle[..., 0], BOX[1] + BOX[3] / 2.0 - from_middle[..., 1]

    def grid(self) -> Iterable[str]:
        """Grid lines with their numbers, and the names of the axes."""
        left, top, width, height = BOX
        for axis in (0, 1):
            half, middle = BOX[2 + axis] / 2.0 * self.scale, float(self.middle[axis])
            first, last, step = nice(middle - half, middle + half)
            for n in range(round(first / step), round(last / step) + 1):
                place = (n * step - middle) / self.scale
                if abs(place) > BOX[2 + axis] / 2.0 + 1e-6:
                    continue
                if axis == 0:
                    x = left + width / 2.0 + place
                    yield f"<path class='grid' d='M{x:.1f} {top}v{height}'/>"
                    yield f"<text x='{x:.1f}' y='{top + height + 17:g}' text-anchor='middle'>{number(n * step)}</text>"
                else:
                    y = top + height / 2.0 - place
                    yield f"<path class='grid' d='M{left} {y:.1f}h{width}'/>"
                    yield f"<text x='{left - 7:g}' y='{y + 4:.1f}' text-anchor='end'>{number(n * step)}</text>"
        u, v = (CARRIAGES[axis].upper() for axis in self.axes)
        yield f"<text x='{left + width:g}' y='{top + height + 35:g}' text-anchor='end'>{u} / mm</text>"
        yield f"<text x='{left:g}' y='{top - 9:g}'>{v} / mm</text>"


def path_view(
    columns: Columns, axes: tuple[int, int], name: str, marks: Sequence[Mark], cuts: Sequence[Swath] = ()
) -> str:
    """The path seen along the third axis. Cuts in its plane are drawn with the width of the tool."""
    view = _View.of(columns, axes)
    most_um, classes = deviation_classes(columns)
    x, y = view.px(columns.way.position_mm)
    u, v = (CARRIAGES[axis].upper() for axis in axes)
    spans = (f"{axis} from {view.low[k]:.3f} to {view.high[k]:.3f} mm" for k, axis in enumerate((u, v)))
    about = f"{', '.join(spans)}; the largest deviation is {most_um:.4g} um."
    key = f"path-{name}"
    parts = [
        "<svg viewBox='0 0 570 430' width='570' height='430' role='img' "
        f"aria-labelledby='{key}-title {key}-about'><title id='{key}-title'>Path in {u} and {v}, coloured by "
        f"deviation</title><desc id='{key}-about'>{about}</desc>",
        *view.grid(),
        f"<rect class='frame' x='{BOX[0]:g}' y='{BOX[1]:g}' width='{BOX[2]:g}' height='{BOX[3]:g}'/>",
    ]
    for cut in cuts:
        here = (columns.way.time_ns >= cut.begin_ns) & (columns.way.time_ns <= cut.end_ns)
        if cut.plane == axes and here.any():
            parts.append(
                f"<path class='swath' stroke-width='{2.0 * cut.radius_mm / view.scale:.2f}' "
                f"d='{line(x[here], y[here])}'><title>tool of radius {cut.radius_mm:g} mm</title></path>"
            )
    parts.append(f"<g id='{key}'>")
    for colour in range(len(COLOURS)):
        if data := _runs(x, y, classes == colour):
            parts.append(f"<path class='line' stroke='{COLOURS[colour]}' d='{data}'/>")
    parts.append("</g>")
    for mark in apart(marks):
        px, py = view.px(columns.way.at(mark.time_ns))
        parts.append(f"<g transform='translate({px:.1f} {py:.1f})'>{badge(mark)}</g>")
    return "".join([*parts, "</svg>"])


def finding_picture(columns: Columns, mark: Mark, error_at: tuple[float, float]) -> str:
    """The place of a finding in the path, and the error within a second of it, at error_at (top and height, px)."""
    top, height = error_at
    span_ns = columns.last_ns - columns.first_ns
    middle = (mark.time_ns - columns.first_ns) / span_ns * WIDTH
    half = min(SECOND_NS / span_ns, 0.5) * WIDTH
    position = columns.way.at(mark.time_ns)
    where = ", ".join(f"{axis.upper()} {mm:.3f} mm" for axis, mm in zip(CARRIAGES, position, strict=True))
    px, py = _View.of(columns, (0, 1)).px(position)
    return (
        f"<svg viewBox='0 0 320 120' width='320' height='120' role='img' aria-label='Place of finding {mark.number} in "
        f"the path, {where}; error of position within a second of it'>"
        f"<svg x='0' width='160' height='120' viewBox='55 20 505 366'><use href='#path-xy'/>"
        f"<circle cx='{px:.1f}' cy='{py:.1f}' r='16' fill='none' stroke='#b3261e' stroke-width='7'/></svg>"
        f"<svg x='170' width='150' height='120' viewBox='{middle - half:.3f} {top - 4:g} {2 * half:.3f} "
        f"{height + 8:g}' preserveAspectRatio='none'><use href='#curves-error'/>"
        f"<path class='mark' d='M{middle:.3f} {top:g}v{height:g}'/></svg></svg>"
    )


def _runs(x: NDArray[np.float64], y: NDArray[np.float64], wanted: NDArray[np.bool_]) -> str:
    """Lines from each wanted vertex to the next vertex."""
    if len(x) < 2:
        return ""
    edges = np.diff(np.concatenate([[0], wanted[:-1].astype(np.int8), [0]]))
    firsts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return "".join(line(x[a : b + 1], y[a : b + 1]) for a, b in zip(firsts, ends, strict=True))
