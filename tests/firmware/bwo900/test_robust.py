"""Random programs and parameters: a message or a run, and time passes."""

from __future__ import annotations

import gc
import random
import tracemalloc
from collections import Counter

import pytest
from conformance.bwo900_desk import REFERENCE, file, fresh, mm, parameters, said, start
from firmware.bwo900.random_programs import outcome, program

from isel_twin.testing import StillBusyError

NUMBERS = (
    *(8_682, 8_683, 8_684, 8_705, 8_508, 8_650, 8_651, 8_750, 8_751, 8_752, 8_801, 8_804, 8_806, 8_810, 8_812, 8_813),
    *(8_814, 8_815, 8_816, 8_818, 8_830, 8_845, 8_851, 8_852, 8_853, 8_858, 8_859, 8_555, 8_160, 8_161, 160, 163),
    *(11_060, 11_181, 11_310, 12_004, 12_008, 12_009, 12_012, 12_013, 12_016, 12_018, 12_030, 12_031),
)
VALUES = (0, 1, 2, 4, 8, -1, -5, 0.5, 18, 50, 54, 90, 100, 1000, 1e9)


def test_programs_end_with_a_message_or_by_themselves() -> None:
    seen = Counter(outcome(program(seed)) for seed in range(1_500))
    assert seen["end"] > 50
    assert len(seen) > 25


def test_places_that_no_counter_holds_are_refused() -> None:
    """A counter has 32 bits: 2147 m at 1000 increments a mm."""
    assert outcome({"P1": ["N10 G0 X2147", "N20 M30"]}) == "end"
    for block in ("N10 G0 X2147484", "N10 G0 Y-99999999999", "N10 G0 Z" + "9" * 190):
        assert outcome({"P1": [block, "N20 M30"]}) in ("M1202", "M1211")
    assert outcome({"P1": ["N10 G0 X2147484", "N20 M30"]}) == "M1202"


@pytest.mark.parametrize(
    ("definition", "value", "told"),
    [("q170", -5, 1302), ("q170", 1e300, 1302), ("q171", -3, 1240), ("q172", 1e9, 1302)],
)
def test_zero_points_at_a_wrong_address_are_told_by_the_first_program_and_mended_by_a_parameter(
    definition: str, value: float, told: int
) -> None:
    """Kept over the mains they do not keep the control from coming up (manual, 8.3)."""
    desk = fresh("P1|N10 G01 X5 F1000|N20 M30", referenced=False, **{definition: value})
    desk.power_cycle()
    desk.send(REFERENCE)
    desk.finish()
    start(desk)
    desk.finish()
    assert said(desk)[-1] == told
    desk.send(parameters(q170=20_000, q171=1, q172=0))
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 5.0


def test_analysis_leaves_nothing_behind() -> None:
    for seed in range(40):
        outcome(program(seed))
    gc.collect()
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for seed in range(40):
        outcome(program(seed))
    gc.collect()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 100_000


def test_the_whole_control_lives_through_anything() -> None:
    """Programs, parameters in the middle of them, emergency stops; whatever is left can be broken off."""
    for seed in range(60):
        chance = random.Random(seed)
        desk = fresh()
        for name, blocks in program(seed).items():
            desk.send(file(name, *blocks))

        def disturb(most: int, desk: object = desk, chance: random.Random = chance) -> None:
            for _ in range(chance.randint(0, most)):
                desk.send(parameters(**{f"p{chance.choice(NUMBERS)}": chance.choice(VALUES)}))  # type: ignore[attr-defined]

        disturb(4)
        start(desk, mode=chance.choice([2, 2, 2, 4, 8]))
        for _ in range(chance.randint(1, 3)):
            desk.run(chance.choice([0.01, 0.3, 2.0]))
            disturb(2)
            if chance.random() < 0.1:
                desk.set("estop", "pressed")
                desk.set("estop", "released")
        try:
            desk.finish(5.0)
        except StillBusyError:
            desk.send(parameters(p8683=1, p8705=1))
            desk.run(8.0)
        assert desk.controller.idle, seed


def test_descriptors_that_make_no_sense() -> None:
    """Addresses beyond the memory, endless tables, planes of axes that there are not: a run or a message, and soon."""
    for number, value in ((102, 1e9), (103, -1), (172, 1e9), (173, -5), (152, 0x050401), (113, 0x04040041), (111, 0)):
        desk = fresh("P1|N10 G54 G0 X5|N20 G2 F100 X6 I5.5 J0|N30 M30", **{f"q{number}": value})
        start(desk)
        desk.finish()
        assert desk.counts[0] == 6_000 or desk.remarks, number
