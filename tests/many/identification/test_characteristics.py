"""Numbers of a measuring day by their standards, each from readings of which it is known in closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from isel_twin.language import MoveSettings, create_language, needed
from isel_twin.machine import load_machine
from isel_twin.many.identification import protocol as protocol_module
from isel_twin.many.identification.experiment import Block
from isel_twin.many.identification.measured import Measured, Reading, Ring, Stall
from isel_twin.many.identification.protocol import characteristics, day

MACHINE = load_machine("4030")
TURN = 2.0 * math.pi / 16


def told(*readings: Reading) -> dict[str, float]:
    return {one.what: pytest.approx(one.value) for one in characteristics(Measured(readings))}


def positions(runs: Sequence[tuple[Sequence[float], Sequence[float]]]) -> list[Reading]:
    """Runs up and down places 100 mm apart; each a deviation in um by place."""
    found = []
    for up, down in runs:
        for at, um in [*enumerate(up), *reversed(list(enumerate(down)))]:
            found.append(Reading("", 1, "x", 100.0 * at + 1e-3 * um, gauge="1 positioning x", counter_mm=100.0 * at))
    return found


def test_repeatability_is_four_deviations_of_the_worse_way_where_the_ways_agree() -> None:
    """ISO 230-2, R = max(4 s_up, 4 s_down, 2 s_up + 2 s_down + B): 0 and 2 um up, s = sqrt 2; 1 and 1 down, B = 0."""
    found = told(*positions([((0.0, 0.0), (1.0, 0.0)), ((2.0, 0.0), (1.0, 0.0))]))
    assert found["positioning x: repeatability R"] == 4e-3 * math.sqrt(2.0)
    assert found["positioning x: reversal B"] == 0.0


def test_positioning_needs_two_runs() -> None:
    """A standard deviation has n - 1 below the line."""
    assert told(*positions([((0.0, 1.0), (2.0, 3.0))])) == {}


def bar(*ways: Sequence[float]) -> list[Reading]:
    """A bar of 50 mm that reads 10 mm at the middle of its gauge, and so many mm more at each place of each way."""
    return [Reading("", 1, "x", 10.0 + mm, gauge="3 circle", about_mm=(60.0, 60.0, 0.0)) for way in ways for mm in way]


def test_circular_deviation_is_that_of_the_worse_way() -> None:
    """One place of sixteen is 10 um out on one way, another one 10 um in on the other.

    Its own part of the least squares circle is (1 + 2 cos^2 + 2 sin^2) / 16, that of a place next to it
    (1 + 2 cos 22.5 deg) / 16: what is left spans 13/16 and the latter. Both ways together
    would span nearly twice as much.
    """
    out, in_ = np.zeros(16), np.zeros(16)
    out[4], in_[4] = 0.01, -0.01
    found = told(*bar(out, in_))
    assert found["circle: circular deviation G"] == 0.01 * (13.0 + 1.0 + 2.0 * math.cos(TURN)) / 16.0
    assert found["circle: reversal H"] == 0.01  # at 90 deg of one way, at 270 deg of the other


@pytest.mark.parametrize(("ways", "wanted"), [((5, 5), 0), ((6, 6), 3), ((16, 15), 0)])
def test_a_circle_needs_six_places_each_way(ways: tuple[int, int], wanted: int) -> None:
    assert len(told(*bar(*(np.zeros(number) for number in ways)))) == wanted


@pytest.mark.parametrize(("count", "wanted"), [(9, {"straightness x_y: bow": 0.04}), (8, {})])
def test_the_bow_is_that_of_a_parabola_over_the_line_of_its_ends(count: int, wanted: dict[str, float]) -> None:
    """The straightedge is laid 3 mm away and askew by 0.5 mm."""
    part = np.linspace(0.0, 1.0, count)
    readings = [
        Reading("", 1, "y", 3.0 + 0.5 * p + 0.04 * 4.0 * p * (1.0 - p), gauge="2 straightness x_y")
        for p in part.tolist()
    ]
    assert told(*readings) == wanted


def test_a_turn_of_the_guide_is_what_a_length_grows_by_the_height() -> None:
    """380 mm with Z up and 380.06 with Z 120 mm down: 0.5 mm/m."""
    each = [10.0, 390.0, 10.01, 390.01, 7.0, 387.06, 7.01, 387.07]
    readings = [Reading("", 1, "x", mm, gauge="4 heights x 120") for mm in each]
    assert told(*readings) == {"heights x 120: turn of the guide": 0.5}
    assert told(*readings[:6]) == {}


def test_a_reversal_is_what_is_read_from_above_less_what_is_read_from_below() -> None:
    readings = [Reading("", 1, "x", mm, gauge="5 reversal x 40") for mm in (1.00, 1.02, 2.00, 2.04)]
    assert told(*readings) == {"reversal x 40: reversal": 0.03}


def test_a_push_counts_by_its_greatest_force_both_ways() -> None:
    pulled = ((120.0, 0.05), (-120.0, -0.03), (60.0, 0.02), (-60.0, -0.01), (120.0, 0.07), (-120.0, -0.05))
    readings = [Reading("", 1, "x", mm, gauge="6 push x 120 at the tool", push_n=n) for n, mm in pulled]
    assert told(*readings) == {"push x 120 at the tool: both ways": 0.06 + 0.04}
    assert told(readings[0], readings[2]) == {}


def test_a_coast_is_what_the_scale_runs_on_beyond_the_counter() -> None:
    readings = [Reading("", 1, "x", mm, gauge="7 coast x 5300", counter_mm=at) for mm, at in ((7.1, 7.0), (50.3, 50.0))]
    assert told(*readings) == {"coast x 5300: overrun": 0.2}
    assert told(readings[0]) == {}


def test_a_ring_has_its_damping_in_per_cent_if_it_was_heard() -> None:
    rings = (Ring("", 1, "x", 100.0, frequency_hz=38.4, damping=0.031), Ring("", 2, "y", 100.0, frequency_hz=20.0))
    found = [(one.what, one.unit, one.value) for one in characteristics(Measured(rings=rings))]
    assert found == [
        ("ring x: frequency", "Hz", 38.4),
        ("ring x: damping", "%", pytest.approx(3.1)),
        ("ring y: frequency", "Hz", 20.0),
    ]


def test_a_stall_is_the_geometric_mean_of_held_and_lost_and_a_bound_is_none() -> None:
    ends = ((20_000.0, 24_200.0, None), (20_000.0, math.inf, None), (0.0, 9_000.0, None), (10_000.0, 14_400.0, 36.0))
    stalls = tuple(Stall("", "x", 15.0, 55.0, 400, 300, held, lost, supply_v=v) for held, lost, v in ends)
    found = {one.what: one.value for one in characteristics(Measured(stalls=stalls))}
    assert found == {
        "stall x 400: speed": pytest.approx(22_000.0),
        "stall x 400 at 36 V: speed": pytest.approx(12_000.0),
    }


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Where X was sent to, mm, while a day was planned."""
    language, found = needed(create_language("imc-s8"), "imc-s8"), list[float]()

    class Watched:
        ranges = language.ranges

        @staticmethod
        def move(target: list[int], how: MoveSettings) -> list[bytes]:
            found.append(target[0] / MACHINE.axes[0].steps_per_mm)
            return list(language.move(target, how))

    monkeypatch.setattr(protocol_module, "create_language", lambda name: Watched)
    monkeypatch.setattr(
        protocol_module, "blocks", lambda *_: [Block(f"coast x {hz}", "") for hz in (9000, 12_000, 12_001)]
    )
    return found


def test_each_place_is_come_to_from_its_side_and_no_two_are_as_far_apart(asked: list[float]) -> None:
    """ISO 230-2: from below on the way up, from above on the way down; uneven, so that errors of a turn show."""
    blocks = {block.name: block for block in day(MACHINE, "imc-s8", ["x"], seed=4, runs=2)}
    once = asked[:12]
    first, *up = once[:6]
    over, *down = once[6:]
    assert down == up[::-1]
    assert asked[12:24] == once
    assert (first, over) == pytest.approx((up[0] - 2.0, up[-1] + 2.0), abs=0.01)
    even = np.linspace(10.0, MACHINE.axes[0].travel_mm - 10.0, 5)
    assert (up[0], up[-1]) == pytest.approx((even[0], even[-1]), abs=0.01)
    away = np.abs(np.array(up) - even)[1:-1]
    assert (away > 0.1).all()
    assert (away < 0.2 * (even[1] - even[0]) + 0.01).all()
    assert sum(len(step.readings) for step in blocks["positioning x"].steps) == 20


def test_coasts_that_a_stall_would_end_are_left_out(asked: list[float]) -> None:
    names = [block.name for block in day(MACHINE, "imc-s8", ["x"], seed=0)]
    assert [name for name in names if name.startswith("coast")] == ["coast x 9000", "coast x 12000"]
    assert asked
