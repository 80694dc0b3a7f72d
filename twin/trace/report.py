"""One self-contained HTML page about a job: path, position error, lost steps, commands and replies.

What the position error is, is in `isel_twin.snapshot`. Curves are of the carriages, counters of all axes that the
controller has.
"""

from __future__ import annotations

import html
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from isel_twin.axes import AXIS_NAMES, CARRIAGES
from isel_twin.files import atomic_write
from isel_twin.position import position_error_mm
from isel_twin.trace.recorder import Recorder
from isel_twin.units import SECOND_NS

if TYPE_CHECKING:
    from isel_twin.job import Result
    from isel_twin.twin import Twin

__all__ = ["write_report"]

POINTS = 4000
"""Most samples drawn in a curve."""
ROWS = 500
"""Most commands listed."""

_CARRIAGES = tuple(axis.upper() for axis in CARRIAGES)

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem; padding: 0 1rem; color: #222; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: 1rem 0; }
td, th { padding: .15rem .7rem; text-align: right; border-bottom: 1px solid #ddd; }
td.text, th.text { text-align: left; font-family: ui-monospace, monospace; }
tr.refused { background: #fde8e6; }
svg { max-width: 100%; height: auto; }
"""


def write_report(
    path: str | os.PathLike[str],
    title: str,
    twin: Twin,
    recorder: Recorder,
    results: Sequence[Result],
    summary: Mapping[str, Any],
) -> None:
    """Write the page. Raises OSError."""
    samples = _thinned(recorder)
    parts = [
        "<!DOCTYPE html>",
        f"<html lang='en'><head><meta charset='utf-8'><title>{html.escape(title)}</title>",
        f"<style>{_STYLE}</style></head><body><h1>{html.escape(title)}</h1>",
        _table(("", ""), [(key, _shown(value)) for key, value in summary.items()], []),
        _svg(_path_figure(samples)),
        _svg(_time_figure(samples, twin.step_mm)),
        "<h2>Commands</h2>",
        _commands(results, len(twin.counts)),
        "</body></html>",
    ]
    atomic_write(path, "\n".join(parts).encode())


def _thinned(recorder: Recorder) -> NDArray[np.void]:
    """At most POINTS samples, evenly chosen, the last one included."""
    stride = max(1, -(-len(recorder) // POINTS))
    pieces, offset = [], 0
    for piece in recorder.samples():
        pieces.append(piece[-offset % stride :: stride])
        offset += len(piece)
    return np.concatenate([*pieces, piece[-1:]])  # a recorder has a sample at least, of the time it was made


def _path_figure(samples: NDArray[np.void]) -> Figure:
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    x, y, z = samples["position_mm"].T
    plan, side = figure.subplots(1, 2)
    plan.plot(x, y, linewidth=1)
    plan.set(xlabel="X / mm", ylabel="Y / mm", title="path from above", aspect="equal", adjustable="datalim")
    side.plot(x, z, linewidth=1)
    side.set(xlabel="X / mm", ylabel="Z / mm", title="path from the front", aspect="equal", adjustable="datalim")
    return figure


def _time_figure(samples: NDArray[np.void], step_mm: NDArray[np.float64]) -> Figure:
    figure = Figure(figsize=(11, 7.5), layout="constrained")
    time_s = samples["time_ns"] / SECOND_NS
    error_um = position_error_mm(samples["position_mm"], samples["counts"], step_mm) * 1e3
    position, error, lost = figure.subplots(3, 1, sharex=True)
    for number, axis in enumerate(_CARRIAGES):
        position.plot(time_s, samples["position_mm"][:, number], label=axis, linewidth=1)
        error.plot(time_s, error_um[:, number], label=axis, linewidth=1)
    for number, axis in enumerate(_CARRIAGES[: samples["lost_steps"].shape[1]]):  # motors are where carriages are
        lost.plot(time_s, samples["lost_steps"][:, number], label=axis, linewidth=1)
    position.set(ylabel="true position / mm")
    position.legend(loc="upper right")
    for curve in (error, lost):  # rounding errors are not worth a magnified look
        low, high = curve.get_ylim()
        curve.set_ylim(min(low, -1.0), max(high, 1.0))
    error.set(ylabel="position error / um")
    lost.set(ylabel="lost steps", xlabel="virtual time / s")
    return figure


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "isel-twin"}):  # same job, same bytes
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _commands(results: Sequence[Result], axes: int) -> str:
    rows = [
        (
            str(result.number),
            f"{result.time_ns / SECOND_NS:.6f}",
            result.command,
            result.shown_reply,
            *(str(count) for count in result.counts),
            *(f"{position:.4f}" for position in result.position_mm),
        )
        for result in results[:ROWS]
    ]
    head = (
        "line",
        "time / s",
        "command",
        "reply",
        *(f"count {axis.upper()}" for axis in AXIS_NAMES[:axes]),
        *(f"{axis} / mm" for axis in _CARRIAGES),
    )
    refused = [index for index, result in enumerate(results[:ROWS]) if not result.ok]
    rest = f"<p>and {len(results) - ROWS} more</p>" if len(results) > ROWS else ""
    return _table(head, rows, refused, text=(2, 3)) + rest


def _table(
    head: Sequence[str], rows: Iterable[Sequence[str]], marked: Sequence[int], text: Sequence[int] = (0, 1)
) -> str:
    def cells(tag: str, values: Sequence[str]) -> str:
        kinds = [" class='text'" if index in text else "" for index in range(len(values))]
        return "".join(f"<{tag}{k}>{html.escape(v)}</{tag}>" for k, v in zip(kinds, values, strict=True))

    body = "".join(
        f"<tr{' class=refused' if index in marked else ''}>{cells('td', row)}</tr>\n" for index, row in enumerate(rows)
    )
    return f"<table><tr>{cells('th', head)}</tr>\n{body}</table>"


def _shown(value: Any) -> str:
    return ", ".join(_shown(item) for item in value) if isinstance(value, list | tuple) else str(value)
