"""The report as a picture (PNG): path in two views coloured by deviation, speed, position, error and margin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.pictures import picture_bytes, plain_text
from isel_twin.base.units import SECOND_NS
from isel_twin.report.columns import Columns
from isel_twin.report.path import COLOURS, LEAST_UM
from isel_twin.report.svg import Mark

if TYPE_CHECKING:
    from isel_twin.jobs.result import Result


def draw(
    title: str, seen: Columns, results: Sequence[Result], marks: Sequence[Mark], limits: Mapping[str, float]
) -> bytes:
    """The picture. limits: `deviation_mm` and `margin`."""
    with_margin = any(margin is not None for result in results for margin in result.margin)
    figure = Figure(figsize=(13, 13 if with_margin else 11.5), layout="constrained", dpi=100)
    figure.suptitle(plain_text(title))
    rows = 5 if with_margin else 4
    grid = figure.add_gridspec(rows, 2, height_ratios=[2.6, 1, 1, 1, 1][:rows])
    deviation_um = seen.way.deviation_mm * 1e3
    for column, (u, v) in enumerate(((0, 1), (0, 2))):
        view = figure.add_subplot(grid[0, column])
        points = seen.way.position_mm[:, [u, v]]
        lines = LineCollection(
            np.stack([points[:-1], points[1:]], axis=1).tolist(),
            cmap=ListedColormap(COLOURS),
            array=deviation_um[:-1],
            linewidths=1.2,
        )
        lines.set_clim(0.0, max(float(deviation_um.max(initial=0.0)), LEAST_UM))
        view.add_collection(lines)
        view.autoscale()
        view.set(xlabel=f"{CARRIAGES[u].upper()} / mm", ylabel=f"{CARRIAGES[v].upper()} / mm")
        view.set_aspect("equal", adjustable="datalim")
        for mark in marks:
            at = seen.way.at(mark.time_ns)
            view.annotate(str(mark.number), (at[u], at[v]), color="#b3261e", weight="bold")
    figure.colorbar(lines, ax=view, label="deviation / um")
    time_s = seen.time_ns / SECOND_NS
    plots = [figure.add_subplot(grid[1, :])]
    plots += [figure.add_subplot(grid[row, :], sharex=plots[0]) for row in range(2, rows)]
    plots[0].fill_between(time_s, *seen.speed_mm_s, linewidth=1, color="#1d2733")
    for i, axis in enumerate(CARRIAGES):
        for plot, (low, high), by in ((plots[1], seen.position_mm, 1.0), (plots[2], seen.error_mm, 1e3)):
            both = np.stack([low[:, i], high[:, i]], axis=1) * by  # a line through the least and the largest
            cuts = np.flatnonzero(np.diff(seen.piece)) + 1
            at, values = np.insert(time_s, cuts, time_s[cuts]), np.insert(both, cuts, np.nan, axis=0)
            plot.plot(at.repeat(2), values.ravel(), label=axis.upper(), linewidth=1)
    for plot, label in zip(plots, ("speed / mm/s", "position / mm", "error / um"), strict=False):
        plot.set_ylabel(label)
    low_um, high_um = plots[2].get_ylim()
    plots[2].set_ylim(min(low_um, -LEAST_UM), max(high_um, LEAST_UM))
    plots[1].legend(loc="upper right")
    if "deviation_mm" in limits:
        for sign in (-1e3, 1e3):
            plots[2].axhline(sign * limits["deviation_mm"], color="#b3261e", linestyle="--", linewidth=1)
    if with_margin:
        for i, axis in enumerate(AXIS_NAMES):
            spans = [
                (100.0 * margin, result.time_ns / SECOND_NS, result.end_ns / SECOND_NS)
                for result in results
                if i < len(result.margin) and (margin := result.margin[i]) is not None
            ]
            if spans:
                heights, firsts, lasts = zip(*spans, strict=True)
                plots[3].hlines(heights, firsts, lasts, color=f"C{i}", label=axis.upper())
        plots[3].set(ylabel="margin / %", ylim=(-2, 102))
        if "margin" in limits:
            plots[3].axhline(100.0 * limits["margin"], color="#b3261e", linestyle="--", linewidth=1)
    for plot in plots:
        for mark in marks:
            plot.axvline(mark.time_ns / SECOND_NS, color="#b3261e", linestyle=":", linewidth=1)
    plots[-1].set_xlabel("virtual time / s")
    return picture_bytes(figure)
