"""Circles of the card: chords so short that set points stay within one increment of the arc (GMI99 manual 1.2).

                C2 ___ C3        corners on radius R + 1/4, n equal angles, beginning and end on the exact points
              C1 /     \\
                /       \\        chord of sagitta 1/2:  d = 2 asin(1 / sqrt R),  length sqrt(4 R)
         start |    + R  | end   n = max(ceil(theta / d), ceil(theta / 90 deg)),  V <= sqrt(4 R) / 12 ms

Seen with the lower of the two slots to the right and the higher one upwards. Where beginning and end differ in radius
it runs evenly with the angle; further axes go evenly along with the chords (a helix). An end at the beginning is a full
circle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from isel_twin.firmware.gmi99.planner import Move, Rules

__all__ = ["chords", "circle", "fastest_hz"]


def fastest_hz(radius: float) -> float:
    """sqrt(4 R) / 12 ms: greatest path speed on a circle of so many increments."""
    raise NotImplementedError


def chords(radius: float, angle: float) -> int:
    """Number of chords of an arc of so many radians."""
    raise NotImplementedError


def circle(
    centre: Mapping[int, int],
    displacement: Sequence[int],
    clockwise: bool,
    feed: int | None,
    rules: Rules,
    *,
    per_revolution: bool = False,
) -> Move:
    """An arc from the present position by `displacement` (increments of each slot) around `centre` (increments from the
    present position, by slot).

    feed, per_revolution: as for `isel_twin.firmware.gmi99.planner.line`. Raises ValueError unless the centre has two
    slots and neither end lies on it.
    """
    raise NotImplementedError
