"""Pockets of any size: nothing outside them is cut, everything inside is, and each layer at its height.

    the tool's disc at every place of a path with feed   lies in the pocket less its allowance
    every place that the tool can reach in the pocket    is within the tool's radius of a path with feed

Reckoned from the pocket's definition (rounded rectangle, circle), not from the cycle's rows.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from firmware.bwo900.draw_pockets import distances, draw
from firmware.bwo900.run import Analysed
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.firmware.bwo900.geometry.elements import Arc
from tests.thorough import drawn

Places = NDArray[np.float64]


def rounded(places: Places, half: tuple[float, float], corner: float) -> Places:
    """Signed distance of places to a rounded rectangle about 0, negative inside (n,)."""
    q = np.abs(places) - (np.array(half) - corner)
    return np.hypot(*np.maximum(q, 0.0).T) + np.minimum(q.max(axis=1), 0.0) - corner


def run(cycle: str, radius: float, words: str) -> Analysed:
    return Analysed(
        f"N10 G00 T1 M06 F1000\nN20 {cycle} X0 Y0 Z1 P19:1 {words}\nN30 M30",
        p21000=1,
        p21010=radius,
    )


@st.composite
def rectangles(draw: st.DrawFn) -> tuple[dict[int, float], float]:
    """Parameters and tool radius."""
    radius = draw(st.floats(0.5, 6.0))
    allowance = draw(st.sampled_from([0.0, 0.3, 1.0]))
    least = 2.0 * (radius + allowance)
    sizes = [least + draw(st.floats(0.0, 8.0)) * radius for _ in range(2)]
    corner = radius + draw(st.floats(0.0, 1.0)) * (min(sizes) / 2.0 - radius)
    depth = draw(st.floats(0.5, 20.0))
    values = {
        11: sizes[0], 12: sizes[1], 13: depth, 14: corner, 15: allowance, 18: 0.1,
        16: draw(st.floats(0.15, 2.0)) * radius * draw(st.sampled_from([1, -1])),
        17: (depth - 0.1) * draw(st.floats(0.4, 1.0)), 20: draw(st.floats(0.2, 1.5)),
    }  # fmt: skip
    return {number: round(value, 3) for number, value in values.items()}, round(radius, 3)


def fits(values: dict[int, float], radius: float) -> bool:
    """Rounding of the drawn values may have made it just impossible."""
    return (
        radius <= values[14] <= min(values[11], values[12]) / 2.0
        and min(values[11], values[12]) >= 2.0 * (radius + values[15])
        and abs(values[16]) <= 2.0 * radius
        and values[17] <= values[13] - values[18]
    )


def text(values: dict[int, float]) -> str:
    return " ".join(f"P{n}:{v:.3f}" for n, v in values.items())


def floors(values: dict[int, float]) -> list[float]:
    """Heights of the layers below the workpiece's top, 0."""
    depth = values[13] - values[18]
    return [-values[17] * k for k in range(1, math.ceil(depth / values[17] - 1e-9))] + [-depth]


@pytest.mark.parametrize("cycle", ["G71", "G72", "G73"])
@settings(max_examples=drawn(25), deadline=None, derandomize=True)
@given(pocket=rectangles(), seed=st.integers(0, 1000))
def test_rectangular_pocket(cycle: str, pocket: tuple[dict[int, float], float], seed: int) -> None:
    values, radius = pocket
    assume(fits(values, radius))
    program = run(cycle, radius, text(values))
    half = values[11] / 2.0, values[12] / 2.0
    fine = [b for b in program.path if b.feed_mm_min == 500.0]
    rough = [b for b in program.path[:-2] if b.feed_mm_min != 500.0]  # the last two: up, to the middle
    assert bool(fine) == (cycle == "G73" and values[15] > 0.0)

    def signed(places: Places, allowance: float, inset: float) -> Places:
        """Distance to the pocket less its allowance, drawn in by `inset`: what a tool's centre may reach."""
        corner = max(values[14] - allowance - inset, 0.0)
        return rounded(places, (half[0] - allowance - inset, half[1] - allowance - inset), corner)

    for blocks, allowance in ((rough, values[15]), (fine, 0.0)):
        elements = [e for b in blocks for e in b.elements if min(e.start[2], e.end[2]) < 0.0]
        if elements:
            low = np.array([e.point(k / 6)[:2] for e in elements for k in range(7)])
            assert signed(low, allowance, radius).max() <= 1e-6, "the disc is inside"

    places = np.random.default_rng(seed).uniform(-1.0, 1.0, (300, 2)) * np.array(half)
    for height in floors(values):
        last = height == floors(values)[-1]
        allowance = 0.0 if fine and last else values[15]
        cut = [e for b in program.path if not b.rapid for e in b.elements if abs(e.end[2] - height) < 1e-9]
        wanted = places[signed(places, allowance, radius) <= radius - 1e-3]
        assert distances(wanted, cut).max(initial=0.0) <= radius + 2e-3, "everything that it reaches is cut"
    assert program.points[-1] == (0.0, 0.0, 1.0)


@pytest.mark.parametrize("cycle", ["G74", "G75"])
@settings(max_examples=drawn(30), deadline=None, derandomize=True)
@given(
    radius=st.floats(0.5, 6.0),
    ratio=st.floats(1.0, 9.0),
    infeed=st.floats(0.15, 1.98),
    allowance=st.sampled_from([0.0, 0.4, 1.0]),
    sign=st.sampled_from([1, -1]),
    seed=st.integers(0, 1000),
)
def test_circular_pocket(
    cycle: str, radius: float, ratio: float, infeed: float, allowance: float, sign: int, seed: int
) -> None:
    radius = round(radius, 3)
    size = round(radius * ratio + allowance, 3) + 0.001
    across = round(min(infeed * radius, size), 3)
    values = {13: 4.0, 14: size, 15: allowance, 16: sign * across, 17: 2.5, 18: 0.5, 20: 0.3}
    program = run(cycle, radius, text(values))
    left = 0.0 if cycle == "G75" else allowance
    elements = [e for b in program.path for e in b.elements if min(e.start[2], e.end[2]) < 0.0]
    ends = np.array([e.point(k / 6)[:2] for e in elements for k in range(7)])
    assert np.hypot(*ends.T).max() <= size - left - radius + 1e-6
    places = np.random.default_rng(seed).uniform(-size, size, (300, 2))
    wanted = places[np.hypot(*places.T) <= size - left - 1e-3]
    floor = [e for b in program.path for e in b.elements if abs(e.end[2] + 3.5) < 1e-9]
    # Turns of half circles are a little more than the infeed apart off their axis: below 1 % of it.
    assert distances(wanted, floor).max(initial=0.0) <= max(radius, across / 2.0 * 1.01) + 2e-3
    assert program.points[-1] == (0.0, 0.0, 1.0)


@pytest.mark.parametrize("cycle", ["G71", "G72", "G73"])
def test_turned_plane(cycle: str) -> None:
    """In G18 the first axis is Z, the second X, and the tool comes along Y."""
    words = "P11:40 P12:20 P13:3 P16:4 P17:3 P15:0 P19:1"
    xy = Analysed(f"N10 G00 T1 M06 F1000\nN20 {cycle} X0 Y0 Z1 {words}\nN30 M30", p21000=1, p21010=3.0)
    zx = Analysed(f"N10 G18 G00 T1 M06 F1000\nN20 {cycle} Z0 X0 Y1 {words}\nN30 M30", p21000=1, p21010=3.0)
    assert [(p[1], p[2], p[0]) for p in xy.points] == zx.points


@pytest.mark.parametrize("cycle", ["G71", "G72", "G73", "G74", "G75"])
def test_mirrored(cycle: str) -> None:
    """G61 mirrors the path, and with it conventional milling into climb milling."""
    words = "X5 Y7 Z1 P11:40 P12:20 P13:3 P14:8 P16:4 P17:3 P15:0,5 P20:0,5 P19:1" if cycle < "G74" else (
        "X5 Y7 Z1 P13:3 P14:18 P15:0,5 P16:4 P17:3 P19:1 P20:0,5"
    )  # fmt: skip
    plain, mirrored = (
        Analysed(f"N10 G00 T1 M06 F1000 {g}\nN20 {cycle} {words}\nN30 M30", p21000=1, p21010=3.0) for g in ("", "G61")
    )
    np.testing.assert_allclose(np.array(plain.points) * (-1, 1, 1), np.array(mirrored.points), atol=1e-9)
    ways = zip(plain.path, mirrored.path, strict=True)
    assert all(
        a.elements[0].sweep_rad == pytest.approx(-b.elements[0].sweep_rad)
        for a, b in ways
        if isinstance(a.elements[0], Arc) and isinstance(b.elements[0], Arc)
    )


def test_the_picture_of_the_docs(tmp_path: Path) -> None:
    draw(tmp_path / "pockets.png", grid=30)
    assert (tmp_path / "pockets.png").stat().st_size > 50_000
