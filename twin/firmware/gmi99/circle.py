"""Circles of the card: chords short enough that set points stay within one increment of the arc (GMI99 manual 1.2).

                C2 ___ C3        corners on radius R + 1/4, n equal angles, beginning and end on the exact points
              C1 /     \\
                /       \\        chord of sagitta 1/2:  d = 2 asin(1 / sqrt R),  length sqrt(4 R)
         start |    + R  | end   n = max(ceil(theta / d), ceil(theta / 90 deg)),  V <= sqrt(4 R) / 12 ms

The lower of the two slots points to the right and the higher one upwards. If beginning and end differ in radius it
changes evenly with the angle; further axes move evenly along the chords (a helix). An end at the beginning is a full
circle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from isel_twin.firmware.gmi99.planner import AXES, SHORTEST_S, PreparedMove, Rules, straight
from isel_twin.motion.look_ahead import FRACTIONS

ROUNDING = 1e-9  # tolerance in chords for a quotient that should be a whole number
# increments by which inner corners lie outside the arc: half the sagitta, for equal errors on both sides
OUTSIDE = 0.25


def fastest_hz(radius: float) -> float:
    """sqrt(4 R) / 12 ms: highest path speed on a circle with this radius in increments."""
    return math.sqrt(4.0 * radius) / SHORTEST_S


def chords(radius: float, angle: float) -> int:
    most = 2.0 * math.asin(min(1.0, 1.0 / math.sqrt(radius)))
    return max(math.ceil(angle / most - ROUNDING), math.ceil(angle / (math.pi / 2.0) - ROUNDING), 1)


def circle(
    centre: Mapping[int, int],
    displacement: Sequence[int],
    clockwise: bool,
    feed: int | None,
    rules: Rules,
    *,
    per_revolution: bool = False,
) -> PreparedMove:
    """An arc by `displacement` (increments of each slot) around `centre` (increments by slot), both from the present
    position.

    feed, per_revolution: as for `planner.line`. Raises ValueError: not two slots, an end on the centre.
    """
    if len(centre) != 2 or not set(centre) <= set(range(AXES)) or len(displacement) != AXES:
        raise ValueError(f"the centre of a circle needs two of {AXES} slots, got {sorted(centre)}")
    right, up = sorted(centre)
    x0, y0 = -centre[right], -centre[up]
    x1, y1 = x0 + displacement[right], y0 + displacement[up]
    if not (x0 or y0) or not (x1 or y1):
        raise ValueError("a circle cannot begin or end at its centre")
    turned = math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1) * (-1 if clockwise else 1)
    angle = turned if turned > 0 else turned + 2.0 * math.pi
    first, last = math.hypot(x0, y0), math.hypot(x1, y1)
    radius = max(first, last)
    n = chords(radius, angle)
    part = np.arange(n + 1) / n
    at = math.atan2(y0, x0) + (-angle if clockwise else angle) * part
    r = first + (last - first) * part
    corner = np.outer(part, np.array(displacement, dtype=np.float64))
    corner[1:-1, right] = ((r + OUTSIDE) * np.cos(at))[1:-1] - x0
    corner[1:-1, up] = ((r + OUTSIDE) * np.sin(at))[1:-1] - y0
    way = np.diff(np.rint(corner * FRACTIONS) / FRACTIONS, axis=0)
    plane = np.hypot(way[:, right], way[:, up])
    shortest_s = plane / (fastest_hz(radius) * (r[:-1] + r[1:]) / (2.0 * radius))
    corners = not rules.free_circles
    return straight(way, feed, rules, per_revolution=per_revolution, shortest_s=shortest_s, corners=corners)
