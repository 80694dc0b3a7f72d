"""Elements of drawings as inline SVG: escaped text, numbers, axes, lines and marks. Style comes from classes only, so
that a page can forbid inline styles.
"""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from isel_twin.base.printable import shown

WIDTH = 1020  # of the time plots, px


def escape(text: object) -> str:
    """Text for a page, with escapes for markup and for what steers (printable.py)."""
    return html.escape(shown(str(text)))


def tenths(value: float) -> str:
    """A length in px, to a tenth."""
    return f"{value:.1f}".removesuffix(".0")


def number(value: float) -> str:
    return f"{value + 0.0:g}" if abs(value) >= 1e-9 else "0"


def nice(low: float, high: float) -> tuple[float, float, float]:
    """Ends of an axis that includes both, and the distance of its grid lines: 1, 2 or 5 times a power of ten."""
    span = max(high - low, 1e-9)
    power = 10.0 ** math.floor(math.log10(span / 3.0))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= span / 3.0)
    return math.floor(low / step) * step, math.ceil(high / step) * step, step


def line(x: Iterable[float], y: Iterable[float]) -> str:
    """The path of one line, in tenths of a pixel, without repeated points."""
    points = list(dict.fromkeys(f"{tenths(a)} {tenths(b)}" for a, b in zip(x, y, strict=True)))
    return "M" + "L".join(points if len(points) > 1 else points * 2)


@dataclass(frozen=True)
class Mark:
    """A finding in a drawing."""

    number: int
    text: str
    time_ns: int


def badge(mark: Mark) -> str:
    """The number of a finding in a circle, with a link to it."""
    wide = 8.0 + 3.0 * len(str(mark.number))
    return (
        f"<a href='#finding-{mark.number}'><title>{escape(mark.text)}</title><circle class='fault' r='{wide:g}' "
        f"fill-opacity='.9'/><text class='badge' text-anchor='middle' y='4'>{mark.number}</text></a>"
    )


def apart(marks: Sequence[Mark]) -> Iterable[Mark]:
    """The first of the marks at each time."""
    return {mark.time_ns: mark for mark in reversed(marks)}.values()
