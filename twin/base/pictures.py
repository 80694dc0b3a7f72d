"""Pictures by matplotlib, an optional package."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from isel_twin.base.files import atomic_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Curve:
    """Points joined by a line; style: matplotlib's, such as "--" or "o-"."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    style: str = "-"


def picture_bytes(figure: Figure, kind: str = "png") -> bytes:
    """A figure as a file; kind: "png", "svg" or another that matplotlib knows. The same figure gives the same bytes."""
    from matplotlib import rc_context

    buffer = io.BytesIO()
    when = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with rc_context({"svg.hashsalt": "isel-twin"}):
        figure.savefig(buffer, format=kind, metadata=when)
    return buffer.getvalue()


def plain_text(words: str) -> str:
    """Text for a figure with dollars escaped, which would begin a formula."""
    return words.replace("$", r"\$")


def draw_curves(
    file: Path, title: str, x_label: str, y_label: str, curves: Sequence[Curve], below: tuple[str, Curve] | None = None
) -> None:
    """Draw curves into a file (type by suffix); axes begin at 0. below: label and curve of another quantity, in a plot
    of its own with a line at 0. Raises ValueError without matplotlib, OSError."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ValueError("drawing needs matplotlib: pip install 'isel-twin[report]'") from None
    figure = Figure(figsize=(7.0, 4.0 if below is None else 6.0), layout="constrained")
    axes, *more = figure.subplots(1 if below is None else 2, sharex=True, squeeze=False)[:, 0]
    for curve in curves:
        axes.plot(curve.x, curve.y, curve.style, markersize=3, label=curve.label)
    axes.set_title(plain_text(title), wrap=True, fontsize="medium")
    axes.set(xlim=(0, None), ylim=(0, None), ylabel=y_label)
    axes.legend()
    if below is not None:
        label, curve = below
        more[0].axhline(0.0, color="0.3", linewidth=0.8)
        more[0].plot(curve.x, curve.y, curve.style, markersize=3)
        more[0].set(ylabel=label)
    for each in (axes, *more):
        each.grid(alpha=0.3)
    (more or [axes])[-1].set(xlabel=x_label)
    atomic_write(file, picture_bytes(figure, file.suffix.removeprefix(".").lower()))
