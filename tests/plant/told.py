"""What a drive is told, in exact arithmetic: the definition of a led command and nothing of the plants' code.

A tick (t, change, lead) of lead 0 changes the command at once; any other is led evenly over its lead, together with
what is left of the one before. So the command is made of straight pieces with jumps between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import ceil, floor

import numpy as np

from isel_twin.plant import Plant

Tick = tuple[int, int, int]
"""Time in ns, change, lead in ns."""
Edge = tuple[int, tuple[bool, ...]]
"""Time in ns, thresholds passed from then on."""
NEVER = 1 << 62


def pieces(ticks: Sequence[Tick]) -> list[tuple[int, Fraction, Fraction, int, int]]:
    """From t up to `last`, command(t') = value + slope (t' - t), but not beyond `end`: (t, value, slope, end, last)."""
    goal, slope, end = 0, Fraction(0), 0
    corners = [(0, Fraction(0), Fraction(0), 0)]
    for t, change, lead in ticks:
        value = goal - slope * max(end - t, 0)
        goal += change
        if lead and change:
            slope, end = (goal - value) / lead, t + lead
        elif not lead:
            value += change
        corners.append((t, value, slope, end))
    return [(*a, b[0] - 1) for a, b in pairwise([*corners, (NEVER, Fraction(0), Fraction(0), 0)])]


def command(ticks: Sequence[Tick], t_ns: Fraction | int) -> Fraction:
    """The command at t_ns, ticks at that very time made."""
    t, value, slope, end, _ = [piece for piece in pieces(ticks) if piece[0] <= t_ns][-1]
    return value + slope * max(min(t_ns, end) - t, 0)


def mean(ticks: Sequence[Tick], a: int, b: int) -> Fraction:
    """Mean of the command from a to b: the areas under the straight pieces."""
    corners = sorted({a, b, *(c for t, _, _, end, _ in pieces(ticks) for c in (t, end) if a < c < b)})
    middles = ((command(ticks, Fraction(left + right, 2)), right - left) for left, right in pairwise(corners))
    return sum((value * length for value, length in middles), Fraction(0)) / (b - a)


def edges(ticks: Sequence[Tick], limit: Fraction, sense: int, hysteresis: Fraction) -> list[tuple[int, bool]]:
    """(first whole ns, struck from then on) of each edge of a switch, if the carriage is exactly where it is told."""
    out = []
    struck = sense * (0 - limit) > 0
    for t, value, slope, end, last in pieces(ticks):
        while True:
            bound = limit - sense * hysteresis if struck else limit
            beyond = sense * (value - bound)
            if (beyond > 0) != struck:
                at = t
            elif slope * sense * (-1 if struck else 1) > 0:
                crossing = t + (bound - value) / slope
                at = ceil(crossing) if struck else floor(crossing) + 1
            else:
                break
            if at > min(end, last) and at != t:
                break
            struck = not struck
            out.append((at, struck))
            t, value = at, value + slope * max(min(at, end) - t, 0)
    return out


def drive(
    plant: Plant,
    ticks: Sequence[tuple[int, tuple[int, ...], int]],
    until_ns: int,
    cuts: Sequence[int] = (),
    start_ns: int = 0,
) -> list[Edge]:
    """Make the ticks (t, changes, lead) after start_ns up to until_ns, in calls that end where the lead changes and at
    the cuts. What an early return leaves over is handed in again. Returns the edges.
    """
    ticks = [tick for tick in ticks if tick[0] > start_ns]
    out, now, done = [], start_ns, 0
    passed = tuple(plant.trips().tolist())
    while now < until_ns:
        lead = ticks[done][2] if done < len(ticks) else 0
        alike = [t for t in ticks[done:] if t[2] == lead]
        stop = min([until_ns, *(t[0] - 1 for t in ticks[done:] if t[2] != lead), *(c for c in cuts if c > now)])
        alike = [t for t in alike if t[0] <= stop]
        t_ns = np.array([t[0] for t in alike], dtype=np.int64)
        delta = np.array([t[1] for t in alike], dtype=np.int32).reshape(len(alike), len(plant.commanded))
        now = plant.advance(stop, t_ns, delta, lead)
        done += int(np.searchsorted(t_ns, now, side="right"))
        if (after := tuple(plant.trips().tolist())) != passed:
            passed = after
            out.append((now, passed))
    return out
