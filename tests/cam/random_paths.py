"""Random toolpaths that stay within the travel of the 4030."""

from __future__ import annotations

import math
from random import Random

from cam.played import END, arc, line, rapid
from hypothesis import strategies as st

from isel_twin.cam.toolpath import Element, Point

LOW, HIGH = (40.0, 40.0, -60.0), (80.0, 80.0, -40.0)
EDGE = 0.15  # part of the numbers that are an end of their range, its middle or a whole number


def random_path(random: Random, turns: int = 2, most: int = 4, part: float = 1.0) -> list[Element]:
    """Rapids, lines and arcs of all planes from corner to corner of a box, of which only this part is used; radii of
    0.05 to 15 mm, or that part of it, which lead out of it for a while."""
    box = [(low, low + part * (high - low)) for low, high in zip(LOW, HIGH, strict=True)]

    def number(low: float, high: float) -> float:
        if random.random() < EDGE:
            return random.choice([low, high, (low + high) / 2.0, min(max(round(low), low), high)])
        return random.uniform(low, high)

    def point() -> Point:
        x, y, z = (number(low, high) for low, high in box)
        return x, y, z

    at = point()
    path: list[Element] = [rapid(*at)]
    for _ in range(random.randint(1, most)):
        within = all(low <= v <= high for (low, high), v in zip(box, at, strict=True))
        kind, to = random.choice(["rapid", "line", "arc", "arc"] if within else ["rapid", "line"]), point()
        if kind == "rapid":
            path.append(rapid(*to))
        elif kind == "line":
            path.append(line(*to, number(5.0, 25.0)))
        else:
            plane = random.randint(0, 2)
            u, v = (plane + 1) % 3, (plane + 2) % 3
            radius, first, last = number(0.05, 15.0 * part), number(0, math.tau), number(0, math.tau)
            centre, end = [0.0, 0.0, 0.0], list(to)
            centre[u], centre[v] = at[u] - radius * math.cos(first), at[v] - radius * math.sin(first)
            end[u], end[v] = centre[u] + radius * math.cos(last), centre[v] + radius * math.sin(last)
            end[plane] = random.choice([at[plane], at[plane] + number(-1.5, 1.5), to[plane]])
            to = (end[0], end[1], end[2])
            sense = random.choice([n for n in range(-turns, turns + 1) if n])
            path.append(arc(to, (centre[0], centre[1], centre[2]), sense, plane, number(5.0, 20.0)))
        at = to
    return [*path, END]


def paths(turns: int = 2, most: int = 4) -> st.SearchStrategy[list[Element]]:
    return st.integers(0, 2**32).map(lambda seed: random_path(Random(seed), turns, most))
