"""Cycles as they are used: stopped, broken off and begun again, block by block, in subprograms and loops, slowed to
nothing, with radius correction, without a tool, with parameters that make no sense. Whatever happens, the path is the
same in the end or there is a message, and time passes."""

from __future__ import annotations

import random
from typing import Final

import numpy as np
import pytest
from conformance.bwo900_desk import fresh, mm, parameters, put_out, said, start, value
from firmware.bwo900.run import Analysed, programs
from firmware.bwo900.test_cycles import CYCLE_NUMBERS, SOUND
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.messages import MESSAGES, ProgramError
from isel_twin.testing import Desk, StillBusyError
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=8)

TOOLS: Final = {"p21000": 1.0, "p21010": 4.0, "p21020": 2.0, "p21030": 3.0}
"""T1 with radius 4 mm, T2 with radius 3 mm."""
FIRST: Final = "P1|N10 G00 G54 G90 X30 Y30 Z11 F3000 S900 T2 M06 M03"
BLOCKS: Final = {
    "G71": "P11:20 P12:14 P13:4 P16:4 P17:3 P19:1",
    "G72": "P11:20 P12:14 P13:4 P16:4 P17:3 P19:1",
    "G73": "P11:20 P12:14 P13:4 P15:0,5 P16:4 P17:3 P19:1 P20:1",
    "G74": "P13:4 P14:8 P16:3 P17:3 P19:1",
    "G75": "P13:4 P14:8 P15:0,5 P16:3 P17:3 P19:1 P20:1",
    "G81": "X30 P30:0,5 P32:1200 P33:2 P34:8",
    "G83": "X30 P32:1200 P33:2 P34:8 P36:3",
    "G84": "X30 P30:0,2 P32:2 P33:2 P34:8",
    "G85": "X30 P32:1200 P33:2 P34:8",
    "G88 G81": "P100:10 P101:0 P106:3 P110:0 P111:10 P116:2 P32:1200 P33:2 P34:8",
}


def text(cycle: str, behind: str = "N30 X5 M05|N40 M30") -> str:
    return f"{FIRST}|N20 {cycle} {BLOCKS[cycle]}|{behind}"


def path(desk: Desk, since: int) -> tuple[tuple[int, ...], ...]:
    """Corners of the box around what was made since then, and where it ended; increments."""
    ticks = desk.steps_since(since)
    began = np.array(desk.counts) - ticks.total
    made = began + ticks.path()
    return tuple(made.min(axis=0).tolist()), tuple(made.max(axis=0).tolist()), tuple(desk.counts)


@pytest.fixture(scope="module")
def undisturbed() -> dict[str, tuple[tuple[tuple[int, ...], ...], float]]:
    """Of each cycle: its path, and how long it takes, s."""
    found = {}
    for cycle in BLOCKS:
        desk = fresh(text(cycle), **TOOLS)
        begin, mark = desk.time_ns, desk.ticks
        start(desk)
        desk.finish()
        assert said(desk) == []
        found[cycle] = path(desk, mark), (desk.time_ns - begin) / 1e9
    return found


@pytest.mark.parametrize("cycle", BLOCKS)
def test_stop_and_override_0_change_nothing_but_time(cycle: str, undisturbed: dict) -> None:
    wanted, takes_s = undisturbed[cycle]
    desk = fresh(text(cycle), **TOOLS)
    mark = desk.ticks
    start(desk)
    for number in range(4):
        desk.run(0.2 * takes_s)
        if number % 2:
            desk.send(parameters(p11310=0))
            desk.run(1.0)
            here = mm(desk)
            desk.run(20.0)
            assert mm(desk) == here or cycle == "G84", "tapping fixes the override at 100 %"
            desk.send(parameters(p11310=100))
        else:
            desk.send(parameters(p8684=0))
            desk.run(1.0)
            here = mm(desk)
            desk.run(5.0)
            assert mm(desk) == here
            desk.send(parameters(p8684=1))
    desk.finish()
    assert path(desk, mark) == wanted
    assert said(desk) == []


@pytest.mark.parametrize("cycle", BLOCKS)
@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_cycle_that_was_broken_off_can_be_begun_again(cycle: str, share: float, undisturbed: dict) -> None:
    """P8804: from the beginning of its block."""
    wanted, takes_s = undisturbed[cycle]
    desk = fresh(text(cycle), **TOOLS)
    start(desk)
    desk.run(share * takes_s)
    while value(desk, 8901) != 20.0:
        desk.run(0.05)
    desk.send(parameters(p8705=1))
    desk.finish()
    assert (value(desk, 8802), value(desk, 8803)) == (1.0, 20.0)
    mark = desk.ticks
    desk.send(parameters(p8804=1, p8684=1))
    desk.finish()
    assert said(desk) == []
    assert tuple(desk.counts) == wanted[2]
    assert path(desk, mark)[0][2] == (6_000 if cycle < "G76" else 2_000), "down to the bottom again"


@pytest.mark.parametrize("cycle", BLOCKS)
def test_single_block_stops_behind_a_cycle_or_in_it(cycle: str, undisturbed: dict) -> None:
    wanted, _ = undisturbed[cycle]
    for inside in (0, 1):
        desk = fresh(text(cycle), **TOOLS, p8814=inside)
        mark = desk.ticks
        start(desk, mode=4)
        desk.finish()
        starts = 1
        while value(desk, 8685):
            assert starts < 500
            desk.send(parameters(p8684=1))
            desk.finish()
            starts += 1
        assert path(desk, mark) == wanted
        assert starts == 4 if not inside else starts > 7


def test_cycles_in_subprograms_and_loops() -> None:
    """Three passes of two calls of a grid of 3 x 2: 36 holes, each place six times."""
    program = Analysed(
        """
        P1
        N10 G00 X0 Y0 Z20 S500 M03 F900
        N20 P100:10 P101:0 P106:3 P110:0 P111:10 P116:2 P32:800 P33:0 P34:5
        N30 M24.3
        N40 M28.10
        N50 M28.10 M25
        N60 M30
        P10
        N10 M28.20
        N20 M02
        P20
        N10 G88 G81
        N20 M02
        """
    )
    holes = [b.finish for b in program.path if b.feed_mm_min == 800]
    assert len(holes) == 36
    assert {holes.count(place) for place in holes} == {6}


def test_a_cycle_of_the_user_may_call_cycles() -> None:
    program = Analysed(
        """
        P1
        N10 G00 X5 Y5 Z20 S500 M03 F900 T2 M06
        N20 P500:3 G1001
        N30 X9 M30
        Z1001
        N10 P32:800 P33:0 P34:5
        N20 M24:P500
        N30 G91 G81 X10
        N40 G90 M25
        N50 G1002
        N60 M30
        Z1002
        N10 G74 P13:2 P14:8 P16:3 P17:2 P19:1
        N20 M30
        """.replace("M24:P500", "M24.3"),
        **TOOLS,
    )
    holes = [b.finish[:2] for b in program.path if b.feed_mm_min == 800]
    assert holes == [(15.0, 5.0), (25.0, 5.0), (35.0, 5.0)]
    assert [b.number for b in program.path][-1] == 30
    assert any(b.program == "Z1002" for b in program.path)


def test_a_cycle_that_calls_itself_is_too_deep() -> None:
    with pytest.raises(ProgramError) as error:
        Analysed("P1\nN10 G1001\nN20 M30\nZ1001\nN10 G1001\nN20 M30")
    assert error.value.number == 1220


@pytest.mark.parametrize("cycle", BLOCKS)
def test_radius_correction_is_off_in_a_cycle_and_on_behind_it(cycle: str) -> None:
    """What is milled is what is milled without it; a line behind is corrected, from where the cycle has ended."""
    found = []
    for g in ("G40", "G41"):
        desk = fresh(
            f"{FIRST}|N15 {g} G01 X30 Y29|N18 X30 Y30|N20 {cycle} {BLOCKS[cycle]}|N30 G40 G00 X5 Y5 M05|N40 M30",
            **TOOLS,
        )
        start(desk)
        desk.run(2.0)
        mark = desk.ticks
        desk.finish(120.0)
        found.append((said(desk), path(desk, mark)[0][2], mm(desk)))
    assert found[0] == found[1]


@pytest.mark.parametrize("cycle", BLOCKS)
def test_cycles_without_a_tool(cycle: str) -> None:
    """Pockets need a radius: M8001. Holes need none."""
    desk = fresh(text(cycle).replace("T2 M06", ""))
    start(desk)
    desk.finish()
    assert said(desk) == ([8001] if cycle < "G76" else [])
    assert value(desk, 8685) == 0.0


@pytest.mark.parametrize(
    ("block", "number"),
    [
        ("G83 X30 P32:1200 P33:2 P34:8 P36:0", 8036),
        ("G83 X30 P32:1200 P33:2 P34:8 P36:0 P37:1 P39:1", 8036),
        ("G81 X30 P32:0 P33:2 P34:8", 8032),
        ("G81 X30 P32:1200 P33:P900 P34:8", 1202),
        ("G86 G81 P103:0 P104:P900 P106:4 P32:1200 P33:2 P34:8", 1202),
        ("G74 P13:4 P14:8 P16:0 P17:3 P19:1", 8016),
        ("G74 P13:4 P14:8 P16:3 P17:P901 P19:1", 8017),
        ("G71 P11:P900 P12:14 P13:4 P16:4 P17:3 P19:1", 1202),
        ("G71 P11:20 P12:14 P13:4 P16:P901 P17:3 P19:1", 8016),
        ("G73 P11:20 P12:14 P13:4 P15:1 P16:4 P17:3 P19:1 P20:P901", 8020),
    ],
)
def test_parameters_without_sense_end_with_a_message(block: str, number: int) -> None:
    desk = fresh(f"{FIRST}|N20 {block}|N30 M30", **TOOLS)
    desk.send(parameters(p900=1e12, p901=1e-12))
    start(desk)
    desk.finish(60.0)
    assert said(desk) == [number]
    assert value(desk, 8685) == 0.0
    assert put_out(desk)


EXTREMES: Final = st.sampled_from([5e-324, 1e-300, -1e-300, 1e-9, 1e9, 1e18, -1e18, 1e300, -1e300, 1.7e308, -1.7e308])


@settings(max_examples=drawn(150), deadline=None, derandomize=True, phases=(Phase.generate,))
@given(
    cycle=CYCLE_NUMBERS,
    pattern=st.sampled_from(["", "G86", "G87", "G88", "G89"]),
    changed=st.dictionaries(
        st.sampled_from([*SOUND, 103, 104, 105, 113, 114, 115, 125]), st.none() | EXTREMES, max_size=4
    ),
)
def test_extreme_parameters_are_moves_or_a_message(cycle: str, pattern: str, changed: dict[int, float | None]) -> None:
    parameters = Analysed("N10 M30", **TOOLS).parameters
    for number, given_value in {**SOUND, **changed}.items():
        parameters.write(number, given_value)
    text = f"N10 G00 T02 M06 F900 S100 M03\nN20 {pattern} {cycle} X1 Y2 Z3\nN30 X1 M30"
    one = Interpreter(parameters, programs(text))
    one.begin("P1", (0.0, 0.0, 0.0))
    try:
        for _ in range(60):
            block = one.next()
            if block is Waiting.EXECUTION:
                one.executed()
            assert not isinstance(block, PathBlock) or not np.isnan([e.end for e in block.elements]).any()
    except ProgramError as error:
        assert error.number in MESSAGES  # noqa: PT017


def test_stop_while_a_function_before_the_path_waits() -> None:
    """M06 takes two seconds: its path begins with Start, and M06 is not sent again."""
    desk = fresh("P1|N10 G00 X30 T2 M06|N20 M30", **TOOLS)
    start(desk)
    desk.run(0.5)
    desk.send(parameters(p8684=0))
    desk.run(5.0)
    assert mm(desk)[0] == 0.0
    assert value(desk, 8685) == 1.0
    begin = desk.time_ns
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk)[0] == 30.0
    assert (desk.time_ns - begin) / 1e9 < 1.5


WORDS: Final = [
    "X10", "X0", "Y5", "Y0", "X20", "Z5", "Z0", "G0", "G1", "G2", "G3", "R8", "G91", "G90", "F2000", "M26", "M26",
    "M26", "M26", "G04.0.2", "G04.5.0", "sc:2", "sc:1", "sc:0", "sc:100", "M41.90", "P500:P500+1", "P500>5.90",
    "P500>20.120", "M23.20", "M50", "M00", "M01", "M24.3", "M25", "M28.2", "G41", "G40", "tr:1", "P8715:1", "P8715:0",
    "P8716:1", "G81", "G74", "G86", "G45", "P163:30", "G61", "G12", "P71:2", "M30", "M02", "T2", "M06",
]  # fmt: skip
SIGNALS: Final = ({"p8715": 0}, {"p8715": 1}, {"p8684": 0}, {"p8684": 1}, {"p8705": 1}, {"p11310": 0}, {"p11310": 100})
FASTEST: Final = 220
"""Increments in a cycle of 2 ms: 6000 mm/min at 1000 a mm are 200, and half of a set point's rounding."""


@pytest.mark.parametrize("seed", range(20))
def test_programs_with_m26_and_cycles_live_through_any_signal(seed: int) -> None:
    """Time passes, no set point jumps, and what is left can be broken off."""
    chance = random.Random(seed)
    blocks = [
        f"N{10 * n} " + " ".join(chance.choices(WORDS, k=chance.randint(1, 4))) for n in range(1, chance.randint(4, 14))
    ]
    desk = fresh(
        f"P1|N5 G1 F1500 X8 Y8 S500 M03 P500:0|{'|'.join(blocks)}|N900 M30",
        "P2|N10 X3 M26|N20 Y9 M02",
        **TOOLS,
        **{"p11060": 0x1000, "p11062": 0x050000, "p32": 1000, "p33": 1, "p34": 4, "p100": 10, "p101": 0, "p106": 3},
        **{"p13": 2, "p14": 6, "p16": 2, "p17": 2, "p19": 1},
    )
    mark = desk.ticks
    start(desk, mode=chance.choice([2, 2, 4]))
    for _ in range(chance.randint(1, 6)):
        desk.run(chance.choice([0.003, 0.05, 0.3, 1.0]))
        if chance.random() < 0.3:
            desk.set("probe", chance.choice(["touched", "free"]))
        else:
            desk.send(parameters(**chance.choice(SIGNALS)))
    try:
        desk.finish(5.0)
    except StillBusyError:
        desk.send(parameters(p8683=1, p8705=1))
        desk.run(8.0)
    assert desk.controller.idle
    made = desk.steps_since(mark).delta
    assert not len(made) or np.abs(made.astype(int)).max() <= FASTEST
