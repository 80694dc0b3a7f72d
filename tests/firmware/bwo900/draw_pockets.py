"""Draws the manual's examples of G71 to G75: the pocket, the path of the tool's centre, and what the tool sweeps.

PYTHONPATH=tests python -m firmware.bwo900.draw_pockets docs/images/bwo900_pockets.png
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from firmware.bwo900.run import Analysed
from numpy.typing import NDArray

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element

Places = NDArray[np.float64]

EXAMPLES = {
    "G71, example 1: rows one way, edges": "G71 X55,5 Y40,5 Z2 P11:71 P12:41 P13:5 P16:4 P17:3 P19:2 P21:100",
    "G71, example 2: from S2, along Y": "G71 X43 Y60,5 Z1 P11:46 P12:81 P13:30 P14:13 P16:-4 P17:7 P19:1 P21:400",
    "G72, example 1: rows forth and back": "G72 X53 Y35,5 Z1 P11:66 P12:31 P13:5 P16:5,1 P17:3 P19:1",
    "G73, example 2: contour, rows, finishing": (
        "G73 X52,5 Y37,5 Z1 P11:65 P12:35 P13:5 P14:11 P15:1,5 P16:4,2 P17:2 P19:1 P20:1"
    ),
    "G74, example 1: spiral": "G74 X53 Y53 Z1 P13:27 P14:33 P16:5,1 P17:5 P19:1",
    "G75, example 1: spiral, finishing": "G75 X48 Y48 Z1 P13:35 P14:28 P15:2 P16:4,1 P17:8 P19:1 P20:2",
}
RADIUS_MM = 3.0
FEED = 1000.0
COLOURS = {"feed": "#1f4e9c", "finishing": "#2a8f3a", "rapid": "#d97a00"}


def chords(elements: Sequence[Element]) -> tuple[Places, Places]:
    """Beginnings and ends of the chords of elements in X and Y, each (n, 2); an arc is 1 um away at most."""
    points: list[tuple[float, float]] = []
    ends: list[tuple[float, float]] = []
    for element in elements:
        steps = 1
        if isinstance(element, Arc):
            steps = max(math.ceil(abs(element.sweep_rad) / math.sqrt(8.0 * 1e-3 / max(element.radius_mm, 1e-3))), 2)
        places = [element.point(k / steps)[:2] for k in range(steps + 1)]
        points += [(x, y) for x, y in places[:-1]]
        ends += [(x, y) for x, y in places[1:]]
    return np.array(points).reshape(-1, 2), np.array(ends).reshape(-1, 2)


def distances(places: Places, elements: Sequence[Element]) -> Places:
    """Of each place (n, 2) to the nearest of the elements, (n,)."""
    begin, end = chords(elements)
    way = end - begin
    size = np.maximum((way**2).sum(axis=1), 1e-18)
    nearest = np.full(len(places), np.inf)
    for k in range(len(begin)):
        share = np.clip((places - begin[k]) @ way[k] / size[k], 0.0, 1.0)
        nearest = np.minimum(nearest, np.hypot(*(places - begin[k] - share[:, None] * way[k]).T))
    return nearest


def last_layer(program: Analysed) -> list[PathBlock]:
    """What is done at the floor, and above it before the next."""
    floor = min(b.finish[2] for b in program.path)
    first = next(k for k, b in enumerate(program.path) if b.finish[2] == floor)
    return program.path[first:]


def outline(words: str) -> list[tuple[float, float]]:
    """The pocket's wall, closed."""
    p = {w[1:].split(":")[0]: float(w.split(":")[1].replace(",", ".")) for w in words.split() if ":" in w}
    x, y = (float(w[1:].replace(",", ".")) for w in words.split()[1:3])
    if "12" not in p:
        return [(x + p["14"] * math.cos(a), y + p["14"] * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 181)]
    corner = p.get("14", RADIUS_MM)
    a, b = p["11"] / 2 - corner, p["12"] / 2 - corner
    wall = [
        (x + u * a + corner * math.cos(w), y + v * b + corner * math.sin(w))
        for k, (u, v) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)))
        for w in np.linspace(k * math.pi / 2, (k + 1) * math.pi / 2, 20)
    ]
    return [*wall, wall[0]]


def draw(target: Path, grid: int = 220) -> None:
    """The picture; grid: places along each side at which it is asked what was swept. Needs matplotlib."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 9), layout="constrained")
    for axes, (title, words) in zip(figure.subplots(2, 3).flat, EXAMPLES.items(), strict=True):
        program = Analysed(f"N10 G00 T1 M06 F{FEED:g}\nN20 {words}\nN30 M30", **{"p21000": 1, "p21010": RADIUS_MM})
        blocks = last_layer(program)
        wall = np.array(outline(words))
        low, high = wall.min(axis=0) - 3.0, wall.max(axis=0) + 3.0
        xs, ys = np.linspace(low[0], high[0], grid), np.linspace(low[1], high[1], grid)
        places = np.stack([c.ravel() for c in np.meshgrid(xs, ys)], axis=1)
        floor = min(b.finish[2] for b in blocks)
        cut = [e for b in blocks for e in b.elements if b.feed_mm_min is not None and e.end[2] == floor]
        swept = distances(places, cut).reshape(grid, grid)
        axes.contourf(xs, ys, swept, levels=[-1.0, RADIUS_MM], colors=["#dfe7f3"])
        axes.plot(*wall.T, color="black", linewidth=1.5)
        for block in blocks:
            kind = "rapid" if block.rapid else "finishing" if block.feed_mm_min == FEED / 2 else "feed"
            for element in block.elements:
                line = np.array([element.point(k / 40)[:2] for k in range(41)])
                axes.plot(*line.T, color=COLOURS[kind], linewidth=1.0, linestyle=":" if kind == "rapid" else "-")
                if element.length_mm > 8.0 and kind != "rapid":
                    (x, y), (dx, dy) = element.point(0.5)[:2], element.tangent(0.5)[:2]
                    axes.annotate(
                        "", (x + dx, y + dy), (x, y), arrowprops={"arrowstyle": "->", "color": COLOURS[kind], "lw": 1.0}
                    )
        start = blocks[0].elements[0].end
        axes.plot(*start[:2], "o", color="black", markersize=5)
        axes.plot(*program.points[-1][:2], "x", color="black", markersize=7)
        axes.set_title(f"{title}\nlast layer, Z {floor:g}", fontsize=10)
        axes.set_aspect("equal")
    figure.suptitle(
        "blue: feed, green: half the feed, dotted: rapid; grey: swept by the tool of radius 3 mm; black: the pocket\n"
        "dot: where it plunges, cross: where it ends"
    )
    figure.savefig(target, dpi=80)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
