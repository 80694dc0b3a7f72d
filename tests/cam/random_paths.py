"""Random toolpaths that stay within the travel of the 4030."""

from __future__ import annotations

import math

from cam.played import END, arc, line, rapid
from hypothesis import strategies as st

from isel_twin.cam.toolpath import Element, Point

LOW, HIGH = (40.0, 40.0, -60.0), (80.0, 80.0, -40.0)


@st.composite
def paths(draw: st.DrawFn, turns: int = 2, most: int = 4) -> list[Element]:
    """Rapids, lines and arcs of all planes from corner to corner of a box; radii of 0.05 to 15 mm,
    which lead out of it for a while."""
    points = st.tuples(*(st.floats(low, high) for low, high in zip(LOW, HIGH, strict=True)))
    at: Point = draw(points)
    path: list[Element] = [rapid(*at)]
    for _ in range(draw(st.integers(1, most))):
        within = all(low <= v <= high for low, v, high in zip(LOW, at, HIGH, strict=True))
        kind = draw(st.sampled_from(["rapid", "line", "arc", "arc"] if within else ["rapid", "line"]))
        to = draw(points)
        if kind == "rapid":
            path.append(rapid(*to))
        elif kind == "line":
            path.append(line(*to, draw(st.floats(5.0, 25.0))))
        else:
            plane = draw(st.integers(0, 2))
            u, v = (plane + 1) % 3, (plane + 2) % 3
            radius, first, last = draw(st.floats(0.05, 15.0)), draw(st.floats(0, 6.28)), draw(st.floats(0, 6.28))
            centre, end = [0.0, 0.0, 0.0], list(to)
            centre[u], centre[v] = at[u] - radius * math.cos(first), at[v] - radius * math.sin(first)
            end[u], end[v] = centre[u] + radius * math.cos(last), centre[v] + radius * math.sin(last)
            end[plane] = draw(st.sampled_from([at[plane], at[plane] + draw(st.floats(-1.5, 1.5)), to[plane]]))
            to = (end[0], end[1], end[2])
            sense = draw(st.sampled_from([n for n in range(-turns, turns + 1) if n]))
            path.append(arc(to, (centre[0], centre[1], centre[2]), sense, plane, draw(st.floats(5.0, 20.0))))
        at = to
    return [*path, END]
