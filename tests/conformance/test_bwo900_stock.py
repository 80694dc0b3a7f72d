"""BWO 900, chapter 5: pockets and holes cut into a workpiece of columns: what goes is what was asked for.

Sizes are drawn, in three planes, turned, mirrored and shifted; the pocket is reckoned from its definition alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from conformance.rows import shows
from firmware.bwo900.run import Analysed
from firmware.bwo900.stock import Places, Setting, Stock
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from tests.thorough import drawn

FEED, PLUNGE, RADIUS_P = 1_000.0, 240.0, "p21010"
TOP = 1.25
"""Safety distance: the cycle begins so high above the workpiece, which is at 0."""
QUICK = (Phase.explicit, Phase.generate)
"""Examples are drawn, and not made smaller: that takes longer than all of them."""
SETTINGS = st.builds(
    Setting,
    plane=st.sampled_from(["G17", "G18", "G19"]),
    zero=st.sampled_from([(0.0, 0.0, 0.0), (12.5, -40.0, 7.0)]),
    origin=st.sampled_from([(0.0, 0.0), (9.0, -3.0)]),
    angle_deg=st.sampled_from([0.0, 90.0, 33.0, -200.0]),
    mirrors=st.tuples(st.booleans(), st.booleans()),
)


def shares(least: float, most: float) -> st.SearchStrategy[float]:
    return st.floats(least, most).map(lambda value: round(value, 3))


@st.composite
def pockets(draw: st.DrawFn, cycle: str) -> tuple[dict[int, float], float]:
    """Parameters that make a pocket, and the tool's radius."""
    radius = round(draw(shares(0.8, 5.0)), 2)
    allowance = draw(st.sampled_from([0.0, 0.4, 1.5]))
    depth = round(draw(shares(1.0, 9.0)), 2)
    left = draw(st.sampled_from([0.0, 0.3]))
    values = {
        13: depth,
        15: allowance,
        16: round(radius * draw(shares(0.3, 2.0)) - 5e-4, 3) * draw(st.sampled_from([1, -1])),
        17: round((depth - left) * draw(shares(0.26, 1.0)) - 5e-4, 3),
        18: left,
        20: draw(st.sampled_from([0.3, 1.0, 5.0])),
    }
    values = {number: round(value, 3) for number, value in values.items()}
    if cycle < "G74":
        sizes = [2.0 * (radius + allowance) + radius * draw(shares(0.0, 9.0)) for _ in range(2)]
        values |= {11: round(sizes[0] + 0.001, 3), 12: round(sizes[1] + 0.001, 3)}
        half = min(values[11], values[12]) / 2.0
        values[14] = math.floor((radius + (half - radius) * draw(shares(0.0, 1.0))) * 1e3) / 1e3
        values[14] = max(values[14], radius)
    else:
        values[14] = round(radius * draw(shares(1.0, 8.0)) + allowance + abs(values[16]), 3)
        if draw(st.booleans()):  # drilled: nothing stays between it and the first circle
            values[16] = math.copysign(min(abs(values[16]), radius), values[16])
            values[11] = round((values[14] - allowance - abs(values[16])) * draw(shares(0.0, 0.9)), 3)
    return values, radius


def signed(cycle: str, values: dict[int, float], centres: Places) -> Callable[[Places, float], Places]:
    """Distance to the nearest of pockets of the tool's centre or the tool itself: (places, inset), negative inside."""

    def one(places: Places, inset: float) -> Places:
        if cycle >= "G74":
            return np.hypot(*places.T) - (values[14] - inset)
        corner = max(values[14] - inset, 0.0)
        q = np.abs(places) - (np.array([values[11], values[12]]) / 2.0 - inset - corner)
        return np.hypot(*np.maximum(q, 0.0).T) + np.minimum(q.max(axis=1), 0.0) - corner

    def nearest(places: Places, inset: float) -> Places:
        return np.min([one(places - centre, inset) for centre in centres], axis=0)

    return nearest


def check(program: Analysed, cycle: str, values: dict[int, float], radius: float, setting: Setting, at: Places) -> None:
    """Cut it, and look at what is left. at: centres of the pockets (n, 2)."""
    distance = signed(cycle, values, at)
    reach = values[14] + radius + 1.0 if cycle >= "G74" else max(values[11], values[12]) / 2.0 + radius + 1.0
    line = np.linspace(-reach, reach, 36) + 0.0123  # off the axes, where ways touch
    grid = np.stack([c.ravel() for c in np.meshgrid(line, line)], axis=1)
    places = np.concatenate([grid + centre for centre in at])
    finishes = cycle in ("G73", "G75") and values[15] > 0.0

    def fine(block: PathBlock) -> bool:
        return finishes and block.feed_mm_min == FEED / 2.0

    def outside(columns: Places, block: PathBlock) -> Places:
        """A disc whose centre keeps the radius' distance to the wall: the corner of what it cuts is the tool's."""
        allowance = 0.0 if fine(block) else values[15]
        return distance(columns, allowance + radius) - radius

    stock = Stock(setting, places, radius, outside, lambda block: values[13] if fine(block) else values[17])
    for centre in at:
        stock.height[np.hypot(*(places - centre).T) <= values.get(11, 0.0) if cycle >= "G74" else False] = -1e9
    cycle_blocks = [b for b in program.path if b.number == 20]
    stock.cut(cycle_blocks[1:])
    assert not stock.wrong, stock.wrong[:3]
    floor = -(values[13] - values[18])
    allowance = 0.0 if finishes else values[15]
    whole = distance(places, allowance + radius) <= radius - 2e-3
    assert whole.any()
    assert (stock.height[whole] <= floor + 1e-6).all(), "everything that the tool can reach is gone"
    bottom = stock.height[stock.height > -1e8]
    assert bottom.min() == pytest.approx(floor), "and no deeper"
    downs = [b for b in cycle_blocks if b.feed_mm_min == PLUNGE]
    steps = math.ceil((values[13] - values[18]) / values[17] - 1e-9)
    assert len(downs) >= steps * len(at), "P21 at each layer"
    assert all(b.rapid or b.feed_mm_min in (FEED, PLUNGE, FEED / 2.0) for b in cycle_blocks)


def words(values: dict[int, float]) -> str:
    return " ".join(f"P{n}:{v:.3f}" for n, v in values.items()) + f" P19:{TOP} P21:{PLUNGE:g}"


def analysed(setting: Setting, radius: float, block: str, before: str = "") -> Analysed:
    """A program with that block, behind one that sets parameters."""
    text = f"N10 {setting.words} G00 T1 M06 F{FEED:g} S900 M03\nN15 {before}\nN20 {block}\nN30 M30"
    return Analysed(text, p21000=1, **{RADIUS_P: radius}, **setting.parameters)


@shows("bwo900-5.2-12")
@pytest.mark.parametrize("cycle", ["G71", "G72", "G73", "G74", "G75"])
@settings(max_examples=drawn(20), deadline=None, derandomize=True, phases=QUICK)
@given(data=st.data(), setting=SETTINGS)
def test_a_pocket_is_cut_out(cycle: str, data: st.DataObject, setting: Setting) -> None:
    values, radius = data.draw(pockets(cycle))
    program = analysed(setting, radius, f"{cycle} {setting.at(5.0, 7.0, TOP)}", words(values))
    check(program, cycle, values, radius, setting, np.array([[5.0, 7.0]]))


def along(angle_deg: float, length: float) -> Places:
    """The manual's X(AB) = P104 cos P103, Y(AB) = P104 sin P103."""
    return length * np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])


@st.composite
def patterns(draw: st.DrawFn, apart: float) -> tuple[str, Places]:
    """A pattern from A = (5, 7), its places at least `apart` from each other: words, places in any order."""
    start = np.array([5.0, 7.0])
    number = draw(st.integers(2, 3))
    angle = draw(st.sampled_from([0.0, 25.0, 110.0, -70.0, 400.0]))
    kind = draw(st.sampled_from(["G86", "G87", "G88", "G89"]))
    if kind == "G89":
        turn = draw(st.sampled_from([60.0, -75.0]))
        size = apart / math.sin(math.radians(abs(turn) / 2.0))
        at = [start + along(angle + turn * k, size / 2.0) for k in range(number)]
        said = f"P120:5 P121:7 P122:{size:.4f} P123:{angle} P125:{turn} P126:{number}"
        return f"{kind} {said}", np.array(at)
    first = f"P103:{angle} P105:{apart:.4f} P106:{number}"
    row = [along(angle, apart * k) for k in range(number)]
    if kind == "G86":
        return f"{kind} {first}", np.array([start + place for place in row])
    second = f"P110:{along(angle + 90.0, apart)[0]:.4f} P111:{along(angle + 90.0, apart)[1]:.4f} P116:2"
    return f"{kind} {first} {second}", np.array(
        [start + place + along(angle + 90.0, apart * j) for j in range(2) for place in row]
    )


@shows("bwo900-5.4-9")
@pytest.mark.parametrize("cycle", ["G71", "G72", "G73", "G74", "G75"])
@settings(max_examples=drawn(4), deadline=None, derandomize=True, phases=QUICK)
@given(data=st.data(), setting=SETTINGS)
def test_pockets_at_the_places_of_a_pattern(cycle: str, data: st.DataObject, setting: Setting) -> None:
    values, radius = data.draw(pockets(cycle))
    size = 2.0 * values[14] if cycle >= "G74" else math.hypot(values[11], values[12])
    said, places = data.draw(patterns(size + 1.0))
    program = analysed(setting, radius, f"{said} {cycle} {setting.at(5.0, 7.0, TOP)}", words(values))
    check(program, cycle, values, radius, setting, places)


@shows("bwo900-5.4-9")
@pytest.mark.parametrize("cycle", ["G81", "G83", "G84", "G85"])
@settings(max_examples=drawn(10), deadline=None, derandomize=True, phases=QUICK)
@given(data=st.data(), setting=SETTINGS, depth=shares(1.0, 30.0), radius=shares(0.5, 4.0))
def test_holes_at_the_places_of_a_pattern(
    cycle: str, data: st.DataObject, setting: Setting, depth: float, radius: float
) -> None:
    said, places = data.draw(patterns(2.0 * radius + 2.0))
    strokes, step = data.draw(st.integers(1, 5)), data.draw(shares(0.5, 4.0))
    shrinks = cycle == "G83" and data.draw(st.booleans())
    first = data.draw(shares(1.0, 12.0))
    numbers = f"P36:{step} P37:{first} P39:1" if shrinks else f"P36:{strokes}"
    drill = f"P32:{5 if cycle == 'G84' else FEED} P33:{-depth} P34:{TOP} P35:{TOP + 20.0} {numbers}"
    program = analysed(
        setting, radius, f"{said} {cycle} {setting.at(5.0, 7.0, 50.0)}", f"{drill} {setting.at(5.0, 7.0, 50.0)}"
    )
    reach = np.linspace(-radius - 0.9, radius + 0.9, 12)
    disc = np.stack([c.ravel() for c in np.meshgrid(reach, reach)], axis=1)
    columns = np.concatenate([disc + place for place in places])
    away = np.min([np.hypot(*(columns - place).T) for place in places], axis=0)

    def outside(here: Places, _: PathBlock) -> Places:
        return np.min([np.hypot(*(here - place).T) for place in places], axis=0) - radius

    deepest = depth + TOP
    if cycle == "G83":
        deepest = max(first, step) if shrinks else deepest / strokes
    stock = Stock(setting, columns, radius, outside, lambda _: deepest)
    stock.cut([b for b in program.path if b.number == 20])
    assert not stock.wrong, stock.wrong[:3]
    assert stock.height[away < radius - 2e-6] == pytest.approx(-depth)
    assert (stock.height[away > radius + 2e-6] == 0.0).all()
