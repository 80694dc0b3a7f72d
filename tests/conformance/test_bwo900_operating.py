"""BWO 900, chapters 1 and 2 and the files of 3.10, from the manual by another hand: what a host and an operator see."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conformance.bwo900_desk import (
    CARRIAGE,
    REFERENCE,
    Pulsing,
    analysed,
    file,
    fresh,
    mm,
    parameters,
    put_out,
    run,
    said,
    start,
    value,
)
from conformance.rows import case, shows

from isel_twin.firmware.bwo900.geometry.elements import Arc
from isel_twin.testing import Desk

pytestmark = pytest.mark.long(seconds=4)

LONG = "P1|N10 G1 F3000 X50|N20 Y50|N30 M30"
DRILLING = "P30:1 P32:800 P33:0 P34:5 P35:9"


def path(desk: Desk, first: int, begin: tuple[float, ...] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Places in mm since a mark, [n, 3]."""
    return np.array(begin) + np.cumsum(desk.steps_since(first).delta[:, :3] / 1000.0, axis=0)


def content(desk: Desk, number: int) -> float:
    """A parameter from P7000 to P9999, 0 where it has never been set."""
    return put_out(desk).get(8_000 + number, 0.0)


# 1.5


@shows("bwo900-1.5-1")
def test_sixty_thousand_parameters() -> None:
    desk = fresh(referenced=False)
    desk.send(file("D", "q 59999: 7"))
    assert (said(desk), put_out(desk)[59_999]) == ([], 7.0)
    desk.send(file("D", "q 60000: 7"))
    assert said(desk) == [1302]


@shows("bwo900-1.5-2")
def test_long_programs_are_kept() -> None:
    """2 MB, more than the smaller memory has."""
    desk = fresh(referenced=False)
    block = "X1 {" + "-" * 180 + "}"
    desk.send(file("P1", *(f"N{n} {block}" for n in range(1, 10_801))))
    assert said(desk) == []


@shows("bwo900-1.5-2")
@pytest.mark.parametrize("size", [1_500_000, 3_000_000])
def test_what_does_not_fit_into_the_memory_is_refused_and_the_rest_stays(size: int) -> None:
    """Programs of 1 MB, 198 bytes a block: the last one is smaller, and is replaced by one of its own size."""
    desk = Desk.of("bwo900", carriage=CARRIAGE, settings={"nc_memory_bytes": size})
    block = "X1 {" + "-" * 184 + "}"

    def program(number: int, blocks: int) -> bytes:
        return file(f"P{number}", *(f"N{100_000 + n} {block}" for n in range(blocks)))

    fitting = size // 1_000_000
    for number in range(1, fitting + 2):
        desk.send(program(number, 5_000))
    assert said(desk) == [1256]
    assert sorted(desk.controller._execution._store) == [f"P{n}" for n in range(1, fitting + 1)]  # type: ignore[attr-defined]
    desk.send(program(1, 5_000))
    assert said(desk) == [1256, 1106]


@shows("bwo900-1.5-3")
def test_one_channel_and_three_axes() -> None:
    assert said(run("P1|N10 G0 X5 A5|N20 M30")) == [1216]
    assert said(run("P1|N10 G0 X5 A5|N20 M30", q113=float(ord("A") | 4 << 16 | 4 << 24))) == [1216]
    desk = fresh(referenced=False)
    desk.send(file("D", "K2:P1: 5"))
    assert said(desk) == [1112]


@shows("bwo900-1.5-4")
def test_a_line_in_all_axes() -> None:
    desk = fresh("P1|N10 G1 F3000 X30 Y20 Z10|N30 M30")
    first = desk.ticks
    start(desk)
    desk.finish()
    places = path(desk, first)
    assert np.abs(places - places[:, :1] * (1.0, 2 / 3, 1 / 3)).max() < 2e-3


@shows("bwo900-1.5-5")
def test_a_helix() -> None:
    """A half circle of radius 10 with 5 mm across: Z goes with the angle, the path is hypot(10 pi, 5) long."""
    done = analysed("N10 G3 F1000 X20 I10 J0 Z5|N20 M30")
    arc = done.path[0].elements[0]
    assert isinstance(arc, Arc)
    assert arc.length_mm == pytest.approx(math.hypot(10 * math.pi, 5))
    assert arc.point(0.5) == pytest.approx((10.0, -10.0, 2.5))


@shows("bwo900-1.5-6")
def test_cycle_times() -> None:
    desk = fresh("P1|N10 P500:P500+1 M23.10", p500=0)
    start(desk)
    desk.run(0.6)
    assert 0.6 / value(desk, 500) < 6e-3
    desk = fresh(LONG)
    first = desk.ticks
    start(desk)
    desk.run(0.5)
    assert 0 < np.diff(desk.steps_since(first).t_ns).min() < 3_000_000


# 2.3


@shows("bwo900-2.3-5", "bwo900-2.3-1")
def test_each_axis_has_its_reference_run() -> None:
    desk = fresh(LONG, referenced=False)
    for axis, rest in ((1, "XZ"), (0, "Z")):
        desk.send(parameters(p8683=1, **{f"p{12_130 + 200 * axis}": 1}))
        desk.finish()
        assert [value(desk, n) for n in (8579, 12_180 + 200 * axis)] == [0.0, 1.0]
        start(desk)
        desk.run(0.1)
        assert desk.remarks[-1][1].endswith(f"({rest})")
    assert said(desk) == [1008, 1008]


def by_hand(**before: float) -> Desk:
    """2.3.2: the key - until the limit switch stops X, then +, which is held for a while."""
    desk = fresh(referenced=False, p8750=1, p8751=1, p8755=6000, **before)
    desk.controller.use_drives(Pulsing(desk))
    for key, seconds in ((2, 4.0), (1, 1.5)):
        desk.send(parameters(p8752=key))
        desk.run(seconds)
        desk.send(parameters(p8752=0))
        desk.finish()
    assert said(desk)[:1] == [2102]
    return desk


@shows("bwo900-2.3-6")
@pytest.mark.parametrize("reference_mm", [0.0, -12.5])
def test_a_reference_point_by_hand_is_that_of_a_reference_run(reference_mm: float) -> None:
    desk = by_hand(p12040=reference_mm)
    assert value(desk, 12_180) == 1.0
    assert value(desk, 12_150) > reference_mm  # braked behind it
    desk.send(parameters(p8683=1, p12112=reference_mm))
    desk.finish()
    first = desk.ticks
    desk.send(parameters(p12130=1))
    desk.finish()
    assert desk.steps_since(first).delta[:, 0].sum() == 0, "X is where it was"
    assert value(desk, 12_150) == reference_mm


@shows("bwo900-2.3-6")
@pytest.mark.parametrize(("logic", "taken"), [(0x00010001, 1.0), (0x00000001, 1.0), (0x00010000, 0.0), (0, 0.0)])
def test_p12044_says_whether_keys_take_the_reference_point(logic: int, taken: float) -> None:
    """Byte 1: in +. Byte 3: at the zero pulse, or at the switch, which opens up to a revolution (5 mm) before."""
    desk = by_hand(p12044=logic)
    assert value(desk, 12_180) == taken
    desk.send(parameters(p8683=1, p12330=1, p12530=1))
    desk.finish()
    assert value(desk, 8_579) == taken


@shows("bwo900-2.3-6")
def test_a_key_that_is_let_go_before_the_point_takes_none() -> None:
    desk = fresh(referenced=False, p8750=1, p8751=1, p8755=60)
    desk.send(parameters(p8755=6000, p8752=2))
    desk.run(4.0)
    desk.send(parameters(p8752=0, p8755=60))
    desk.finish()
    desk.send(parameters(p8752=1))
    desk.run(0.2)
    desk.send(parameters(p8752=0))
    desk.finish()
    assert value(desk, 12_180) % 256 == 0.0


@shows("bwo900-2.3-7")
def test_hand_needs_no_reference() -> None:
    desk = fresh(referenced=False, p8750=2, p8751=3)
    desk.send(parameters(p8683=1, p8752=1))
    desk.finish()
    assert (mm(desk), said(desk)) == ((0.0, 0.0, 10.0), [])


@shows("bwo900-2.6.2-8", "bwo900-2.3-5")
def test_no_program_starts_during_a_reference_run() -> None:
    desk = fresh(LONG)
    start(desk)
    desk.finish()
    desk.send(parameters(p8683=1, p12130=1))
    desk.run(0.3)
    start(desk)
    desk.finish()
    assert (said(desk), mm(desk)) == ([1008], (0.0, 50.0, 0.0))
    start(desk)
    desk.finish()
    assert mm(desk) == (50.0, 50.0, 0.0)


# 2.5.1


@pytest.mark.parametrize("block", ["0", "--"])
@shows("bwo900-2.5.1-2")
def test_a_start_block_that_is_none(block: str) -> None:
    desk = fresh(LONG, p8801=20)
    desk.send(file("D", f"K1:P8801: {block}"))
    start(desk)
    desk.finish()
    assert mm(desk) == (50.0, 50.0, 0.0)


@shows("bwo900-2.5.1-3")
def test_rapid_without_a_speed_is_not_the_feed_of_hand() -> None:
    desk = fresh("P1|N10 G0 X100|N20 M30", p8755=600, p8816=0, p12004=6000)
    start(desk)
    desk.run(1.0)
    assert mm(desk)[0] > 80.0


@pytest.mark.parametrize("text", ["0", "--"])
@pytest.mark.parametrize("number", [8815, 8818])
@shows("bwo900-2.5.1-4")
def test_test_feed_and_percentage_that_are_none(number: int, text: str) -> None:
    desk = fresh("P1|N10 G1 F1200 X60|N20 M30", **{f"p{number}": 50})
    desk.send(file("D", f"K1:P{number}: {text}"))
    start(desk)
    desk.run(1.0)
    before = mm(desk)[0]
    desk.run(1.0)
    assert mm(desk)[0] - before == pytest.approx(20.0, abs=2e-3)


@pytest.mark.parametrize(
    ("program", "values", "message", "block"),
    [
        case("bwo900-2.5.1-5", "P1|N10 G1 F3000 X20 M01|N20 Q5|N30 M30", {}, 1216, 10),
        case("bwo900-2.5.1-5", "P1|N10 G1 F3000 X20|N20 X90|N30 M30", {"p12030": 50}, 2103, 20),
        case("bwo900-2.5.1-5", "P1|N10 G1 F6000 X20|N20 X950|N30 M30", {}, 2101, 20),
    ],
)
def test_a_message_keeps_the_place(program: str, values: dict[str, float], message: int, block: int) -> None:
    desk = run(program, **values)
    assert (said(desk), value(desk, 8802), value(desk, 8803)) == ([message], 1.0, float(block))


def broken_off(*programs: str, seconds: float, **before: float) -> Desk:
    desk = fresh(*programs, **before)
    start(desk)
    desk.run(seconds)
    desk.send(parameters(p8705=1))
    desk.finish()
    return desk


@shows("bwo900-2.5.1-6", "bwo900-2.5.1-7")
def test_the_way_of_a_restart() -> None:
    desk = broken_off("P1|N5 G1 F3000 Y20|N10 X50 Z5|N20 Y50|N30 M30", seconds=1.0)
    here = mm(desk)
    assert (value(desk, 8802), value(desk, 8803), here[1]) == (1.0, 10.0, 20.0)
    desk.send(parameters(p8683=1, p8750=2, p8751=2, p8752=1))
    desk.finish()
    away = mm(desk)
    assert away == (here[0], 30.0, here[2])
    desk.send(parameters(p8804=1))
    first = desk.ticks
    start(desk)
    desk.run(0.1)
    assert value(desk, 8804) == 1.0
    desk.finish()
    places = path(desk, first, away)
    turn = int(np.argmin(places[:, 0]))
    assert places[turn] == pytest.approx((0.0, 20.0, 0.0), abs=2e-3)
    way = places[: turn + 1]
    straight = np.array(away) - np.linspace(0, 1, 50)[:, None] * (np.array(away) - (0.0, 20.0, 0.0))
    nearest = np.min(np.linalg.norm(way[:, None] - straight[None], axis=2), axis=1)
    assert nearest.max() < 0.5
    assert (mm(desk), value(desk, 8804)) == ((50.0, 50.0, 5.0), 0.0)


@shows("bwo900-2.5.1-7")
def test_a_restart_that_does_not_get_there_may_be_tried_again() -> None:
    desk = broken_off("P1|N5 G1 F3000 Y20|N10 X50|N20 Y50|N30 M30", seconds=1.0)
    for _ in range(2):
        desk.send(parameters(p8683=1, p8804=1))
        start(desk)
        desk.run(0.1)
        desk.send(parameters(p8705=1))
        desk.finish()
        assert [value(desk, n) for n in (8802, 8803, 8804)] == [1.0, 10.0, 1.0]
    start(desk)
    desk.finish()
    assert mm(desk) == (50.0, 50.0, 0.0)


@shows("bwo900-2.5.1-8")
def test_a_restart_in_a_cycle_begins_the_cycle() -> None:
    program = f"P1|N5 S1000 M3 F3000 G1 Z9 Y5|N10 G86 G81 P103:0 P105:10 P106:4 X10 {DRILLING}|N30 G0 X50|N40 M30"
    desk = broken_off(program, seconds=5.0, p8816=6000)
    assert value(desk, 8803) == 10.0
    assert mm(desk)[0] > 15.0
    desk.send(parameters(p8683=1, p8804=1))
    first, here = desk.ticks, mm(desk)
    start(desk)
    desk.finish()
    places = path(desk, first, here)
    assert places[places[:, 2] < 0.01][:, 0].min() == pytest.approx(10.0, abs=2e-3)
    deep = {round(x) for x in places[places[:, 2] < 0.01][:, 0]}
    assert deep == {10, 20, 30, 40}
    assert mm(desk) == (50.0, 5.0, 9.0)


@shows("bwo900-2.5.1-9")
def test_no_functions_on_the_way_of_a_restart() -> None:
    desk = broken_off("P1|N5 M7 G1 F3000 Y20|N10 X50|N30 M30", seconds=1.0)
    desk.send(parameters(p8683=1, p8804=1))
    before = len([1 for _, name, level in desk.output_log if name == "a0.3" and level])
    start(desk)
    desk.finish()
    assert len([1 for _, name, level in desk.output_log if name == "a0.3" and level]) == before


@pytest.mark.parametrize(
    ("program", "seconds", "block", "end"),
    [
        ("P1|N5 G1 F3000 G91 M24.3|N10 X10|N20 Y10 M25|N30 G90 Z5|N40 M30", 0.8, 10, (30.0, 30.0, 5.0)),
        ("P1|N5 G1 F3000 X5|N10 M28.2|N30 Z5|N40 M30#P2|N10 X20|N20 Y20|N30 X0|N40 M2", 0.8, 20, (0.0, 20.0, 5.0)),
    ],
)
@shows("bwo900-2.5.1-6")
def test_restart_in_loops_and_subprograms(program: str, seconds: float, block: int, end: tuple[float, ...]) -> None:
    desk = broken_off(*program.split("#"), seconds=seconds)
    assert value(desk, 8803) == block
    desk.send(parameters(p8683=1, p8804=1))
    start(desk)
    desk.finish()
    assert (said(desk), mm(desk)) == ([], end)


@shows("bwo900-2.5.1-10")
def test_no_graphic() -> None:
    assert mm(run(LONG, p8809=1)) == (50.0, 50.0, 0.0)


@shows("bwo900-2.5.1-11")
def test_without_moving_the_display_moves() -> None:
    """P12154 shows where the block ends, the machine position stands; so does the display behind the end."""
    desk = fresh("P1|N10 G0 X7 Y3|N20 G1 F600 X12 M00|N30 M30", p8812=1)
    start(desk)
    desk.run(0.5)
    assert [value(desk, n) for n in (12_154, 12_354, 12_150)] == [12.0, 3.0, 0.0]
    assert mm(desk) == (0.0, 0.0, 0.0)
    desk.send(parameters(p8684=1))
    desk.finish()
    assert value(desk, 12_154) == 0.0


@pytest.mark.parametrize("text", ["0", "--"])
@shows("bwo900-2.5.1-12")
def test_simulation_is_switched_off(text: str) -> None:
    desk = fresh("P1|N10 G0 X5 M7|N20 M30", p8812=1, p8813=1)
    start(desk)
    desk.finish()
    assert (mm(desk)[0], desk.outputs.get("a0.3", 0)) == (0.0, 0)
    desk.send(file("D", f"K1:P8812: {text}", f"K1:P8813: {text}"))
    start(desk)
    desk.finish()
    assert (mm(desk)[0], desk.outputs["a0.3"]) == (5.0, 1)


@shows("bwo900-2.5.3-1")
def test_areas_of_parameters() -> None:
    desk = fresh(referenced=False)
    for number, q in ((0, 10_000), (7000, 15_000), (11_000, 1000), (12_000, 2000), (20_000, 20_000), (30_000, 22_000)):
        desk.send(parameters(**{f"p{number}": 3.25}))
        assert put_out(desk)[q] == 3.25, number
    for number in (10_000, 10_999, 19_000, 40_000):
        desk.send(parameters(**{f"p{number}": 1}))
    assert said(desk) == [1302] * 4


# 2.6


@shows("bwo900-2.6.1-2")
def test_keys_are_without_effect_during_a_step() -> None:
    desk = fresh(p8750=2, p8751=1, p8755=600)
    desk.send(parameters(p8752=1))
    desk.run(0.3)
    for values in ({"p8752": 0}, {"p8751": 2, "p8752": 2}, {"p8750": 1, "p8752": 1}):
        desk.send(parameters(**values))
        desk.run(0.05)
    desk.finish()
    assert (mm(desk), said(desk)) == ((10.0, 0.0, 0.0), [])


@pytest.mark.parametrize("how", ["line", "key"])
@shows("bwo900-2.6.1-3")
def test_stop_breaks_a_step_off(how: str) -> None:
    desk = fresh(p8750=2, p8751=1, p8755=600)
    desk.send(parameters(p8752=1))
    desk.run(0.3)
    if how == "line":
        desk.send(parameters(p8684=0))
    else:
        desk.press("stop")
    desk.finish()
    there = mm(desk)[0]
    assert 2.0 < there < 4.0
    desk.send(parameters(p8752=0))
    desk.send(parameters(p8752=1))
    desk.finish()
    assert mm(desk)[0] == pytest.approx(there + 10.0, abs=1e-9)


@pytest.mark.parametrize("how", [{"p8684": 0}, {"p8705": 1}])
@shows("bwo900-2.6.1-3")
def test_stop_and_abort_end_what_moves_in_hand(how: dict[str, float]) -> None:
    desk = fresh(p8750=1, p8751=1, p8755=600)
    desk.send(parameters(p8752=1))
    desk.run(0.3)
    desk.send(parameters(**how))
    desk.finish()
    assert 2.0 < mm(desk)[0] < 4.0
    desk = fresh(referenced=False)
    desk.send(REFERENCE)
    desk.run(1.0)
    desk.send(parameters(**how))
    desk.finish(1.0)
    assert value(desk, 8579) == 0.0


@shows("bwo900-2.6.1-4")
def test_the_tool_s_length_counts_in_hand() -> None:
    """A tool of length 5 in the spindle: where it stands is 5 below the axis."""
    desk = fresh("P1|N10 T1 M16 M06|N20 G0 Z10|N30 Z10|N40 M30", p21000=1, p21010=0, p21011=5)
    start(desk)
    desk.finish()
    assert mm(desk)[2] == 15.0
    desk.send(parameters(p8683=1, p8750=2, p8751=3, p8752=1))
    desk.finish()
    assert (value(desk, 12_550), value(desk, 12_554)) == (25.0, 20.0)


@shows("bwo900-2.6.1-6")
def test_the_override_acts_in_hand() -> None:
    """The printed screen: 10000 set, override 45, 4500 actual."""
    desk = fresh(p8750=1, p8751=1, p8754=0, p8755=10_000, p12004=12_000, p12008=50, p11310=45)
    desk.send(parameters(p8752=1))
    way = 0.0
    for percent, mm_min in ((45, 4500), (100, 10_000), (20, 2000), (0, 0), (120, 12_000)):
        desk.send(parameters(p11310=percent))
        desk.run(0.1)
        before = mm(desk)[0]
        desk.run(0.1)
        assert value(desk, 8756) == pytest.approx(mm_min)
        assert mm(desk)[0] - before == pytest.approx(mm_min / 600.0, abs=0.02)
        way = mm(desk)[0]
    desk.send(parameters(p8752=0))
    desk.finish()
    assert way < mm(desk)[0] < way + 15.0
    assert (said(desk), mm(desk)[1:]) == ([], (0.0, 0.0))


@pytest.mark.parametrize("percents", [(45,), (0, 100), (100, 10), (10, 100), (50, 0, 120), (120, 0, 0, 5)])
@shows("bwo900-2.6.1-6", "bwo900-2.6.1-2")
def test_a_step_is_whole_whatever_the_override(percents: tuple[float, ...]) -> None:
    desk = fresh(p8750=2, p8751=2, p8755=1000, p11310=percents[0])
    desk.send(parameters(p8752=1))
    first = desk.ticks
    for percent in percents[1:]:
        desk.run(0.2)
        desk.send(parameters(p11310=percent))
    desk.finish()
    assert mm(desk) == (0.0, 10.0, 0.0)
    assert desk.steps_since(first).delta[:, 1].min() >= 0


@pytest.mark.parametrize("how", [{"p8752": 0}, {"p8684": 0}, {"p8705": 1}, {"p8683": 2}])
@shows("bwo900-2.6.1-6")
def test_what_waits_for_the_override_can_be_given_up(how: dict[str, float]) -> None:
    desk = fresh(p8750=1, p8751=1, p11310=0)
    desk.send(parameters(p8752=1))
    desk.run(0.5)
    desk.send(parameters(**how))
    desk.finish()
    desk.send(parameters(p11310=100))
    desk.run(1.0)
    assert mm(desk)[0] == 0.0


@shows("bwo900-2.6.1-7")
def test_zero_point_and_plane_in_hand() -> None:
    """The program's own zero point, shift and plane are none of HAND's; G54 has 100, 200, 300, the tool is 5 long."""
    table = {"p20003": 100, "p20004": 200, "p20005": 300, "p20006": 50, "p21000": 1, "p21010": 0, "p21011": 5}
    desk = fresh("P1|N10 T1 M06|N20 G18 G55 G0 X-40|N30 G92 X7|N40 M30", **table)
    start(desk)
    desk.finish()

    def shown() -> list[float]:
        return [value(desk, n) for n in (12_154, 12_354, 12_554)]

    desk.send(parameters(p8683=1))
    assert mm(desk) == (10.0, 0.0, 0.0)
    assert shown() == [10.0, 0.0, -5.0]
    desk.send(parameters(p8758=54))
    assert shown() == [-90.0, -200.0, -305.0]
    desk.send(parameters(p8757=19))
    assert shown() == [-95.0, -200.0, -300.0]
    desk.send(parameters(p20003=90))
    assert shown() == [-85.0, -200.0, -300.0]
    desk.send(parameters(p8758=99, p8757=0))
    assert shown() == [10.0, 0.0, -5.0]
    desk.send(parameters(p8758=54))
    desk.power_cycle()
    desk.send(REFERENCE)
    desk.finish()
    assert shown() == [0.0, 0.0, -5.0]


@shows("bwo900-2.6.1-5")
def test_no_positions_are_taken_over() -> None:
    desk = fresh(p8758=54)
    assert value(desk, 8758) == 54.0


HOLDING = {
    "path": "N10 X30",
    "dwell": "N10 G04.3",
    "halt": "N10 M6",
    "jump": "N10 M41.20|N15 Y3",
    "cycle": f"N10 G86 G81 P103:0 P105:10 P106:5 X10 {DRILLING}",
    "condition": "N10 waituntil P500>1",
    "M00": "N10 X10 M00",
    "loop": "N10 M24.5|N12 X10|N14 X0 M25",
}


@pytest.mark.parametrize("phase", HOLDING)
@shows("bwo900-2.6.2-2")
def test_stop_at_any_time(phase: str) -> None:
    values = {"p11060": float(0x10 << 8)}
    desk = fresh(f"P1|N5 F3000 G1 Z9 S100 M3|{HOLDING[phase]}|N20 X50|N40 M30", p500=0, p8816=6000, **values)
    start(desk)
    for _ in range(2):
        desk.run(0.3)
        desk.send(parameters(p8684=0))
        desk.run(4.0)
        held = mm(desk)
        desk.run(1.0)
        assert (mm(desk), value(desk, 8687)) == (held, 1.0)
        desk.send(parameters(p8684=1))
    desk.send(parameters(p500=2))
    desk.finish()
    assert (mm(desk)[0], mm(desk)[2], value(desk, 8685), said(desk)) == (50.0, 9.0, 0.0, [])


@pytest.mark.parametrize("phase", HOLDING)
@pytest.mark.parametrize("how", ["abort", "hand", "estop"])
@shows("bwo900-2.6.2-6", "bwo900-2.5.1-1", "bwo900-2.7.1-1")
def test_breaking_off_at_any_time(phase: str, how: str) -> None:
    program = f"P1|N5 F3000 G1 Z9 S100 M3|{HOLDING[phase]}|N20 X50|N40 M30"
    desk = fresh(program, p500=0, p8816=6000, p11060=float(0x10 << 8))
    start(desk)
    desk.run(0.6)
    if how == "estop":
        desk.set("estop", "pressed")
    else:
        desk.send(parameters(**({"p8705": 1} if how == "abort" else {"p8683": 1})))
    desk.finish()
    assert [content(desk, n) for n in (8685, 8687, 8802, 8705)] == [0.0, 0.0, 1.0, 0.0]
    assert said(desk) == ([3001] if how == "estop" else [])
    held = mm(desk)
    desk.run(3.0)
    assert mm(desk) == held
    desk.set("estop", "released")
    desk.send(parameters(p8683=1, p500=2))
    start(desk)
    desk.finish()
    if phase == "M00":
        desk.send(parameters(p8684=1))
        desk.finish()
    assert (mm(desk)[0], mm(desk)[2], value(desk, 8685)) == (50.0, 9.0, 0.0)


@shows("bwo900-2.6.2-9")
def test_after_an_abort_no_function_follows() -> None:
    """M6 takes two seconds in the PLC; M3 behind it was not sent yet."""
    for how in ("p8705", "estop"):
        desk = fresh("P1|N10 M6 M3 S1000 G0 X5|N30 M30")
        start(desk)
        desk.run(0.5)
        if how == "estop":
            desk.set("estop", "pressed")
        else:
            desk.send(parameters(p8705=1))
        desk.run(5.0)
        assert desk.outputs.get("spindle", 0) == 0


@pytest.mark.parametrize("block", ["G0 X12 Y3", "N10 G0 X12 Y3", "X12 G0 Y3 (part of a block)"])
@shows("bwo900-2.6.2-4")
def test_positioning_blocks(block: str) -> None:
    desk = fresh(f"P0|{block}")
    desk.send(parameters(p8683=8, p8684=1))
    desk.finish()
    assert (mm(desk), said(desk)) == ((12.0, 3.0, 0.0), [])


@shows("bwo900-2.6.2-7")
def test_the_skip_key_counts_before_start() -> None:
    desk = fresh("P1|N5 G1 F3000 Y20 M01|/N10 X50|N20 Y50|N30 M30")
    for before, after, place in ((0, 1, 50.0), (1, 0, 0.0)):
        desk.send(parameters(p8810=before))
        start(desk)
        desk.run(0.1)
        desk.send(parameters(p8810=after))
        desk.finish()
        assert mm(desk)[0] == place
        desk.send(file("P2", "N10 G0 X0 Y0", "N20 M30"))
        start(desk, 2)
        desk.finish()


@pytest.mark.parametrize("kind", [1, 2])
@shows("bwo900-2.6.2-8")
def test_a_program_waits_for_the_axes_of_hand(kind: int) -> None:
    desk = fresh(LONG, p8750=kind, p8751=3, p8755=3000)
    desk.send(parameters(p8752=1))
    desk.run(0.1)
    start(desk)
    desk.finish()
    assert mm(desk)[:2] == (50.0, 50.0)
    assert 1.0 < mm(desk)[2] <= 10.0
    assert said(desk) == []


@pytest.mark.parametrize("how", [{"p8705": 1}, {"p8683": 1}])
@shows("bwo900-2.6.2-8")
def test_a_program_waits_for_what_was_broken_off(how: dict[str, float]) -> None:
    """At 50 mm/s the axis brakes for 125 ms; Start comes after 10."""
    desk = fresh(LONG, "P2|N10 G0 Z5|N20 M30")
    start(desk)
    desk.run(0.5)
    desk.send(parameters(**how))
    desk.run(0.01)
    before = mm(desk)[0]
    start(desk, 2)
    desk.finish()
    assert before < mm(desk)[0] < before + 8.0
    assert (mm(desk)[1:], said(desk)) == ((0.0, 5.0), [])


# 2.7, 2.8


@shows("bwo900-2.7.1-1")
def test_supply_lost() -> None:
    desk = fresh(LONG)
    start(desk)
    desk.run(0.5)
    desk.set("power_ok", "open")
    desk.run(1.0)
    assert (said(desk), value(desk, 8685)) == ([3002], 0.0)


@shows("bwo900-2.7.1-2")
def test_messages_stand_and_their_history() -> None:
    desk = fresh("P7|N10 X5|N20 M30")
    control = desk.controller
    for way in ({"p8683": 1}, {"p8508": 1}):
        start(desk, 77)
        desk.run(0.5)
        assert [m.number for m in control.messages] == [1252]  # type: ignore[attr-defined]
        desk.send(parameters(**way))
        assert control.messages == []  # type: ignore[attr-defined]
        desk.run(0.5)
    history = [(when, m.number) for when, m in control.history]  # type: ignore[attr-defined]
    assert [number for _, number in history] == [1252, 1252]
    assert history[1][0] - history[0][0] == pytest.approx(1e9, abs=1e6)


@shows("bwo900-2.7.1-3")
def test_printed_messages() -> None:
    desk = fresh(LONG)
    desk.send(parameters(p8683=2))
    desk.send(parameters(p8683=8))
    start(desk, 77)
    desk.run(0.1)
    assert said(desk) == [1009, 1252]


@shows("bwo900-2.8.4-1")
def test_all_programs_in_one_file() -> None:
    desk = fresh(referenced=False)
    text = "".join(f"{n}\r\nN10 G91 G0 X1 P5{n[1]}:1\r\nN20 M30\r\n#\r\n" for n in ("P1", "Z2", "P3"))
    desk.send(f"\r\n{text}".encode() + b"\x04\r\n")
    desk.send(REFERENCE)
    desk.finish()
    desk.send(file("P9", "N10 M28.1", "N20 G2", "N30 M28.3", "N40 M30"))
    desk.send(file("P8", "N10 M28.1", "N30 M28.3", "N40 M30"))
    start(desk, 8)
    desk.finish()
    assert (mm(desk)[0], said(desk)) == (2.0, [])


@shows("bwo900-2.8.4-3")
def test_all_parameters_are_put_out_at_once() -> None:
    desk = fresh(referenced=False)
    desk.send(parameters(p11181=0))
    assert len(put_out(desk)) > 50


@shows("bwo900-2.9-1")
def test_the_panel_s_editors_are_not_there() -> None:
    assert not {"renumber", "teach", "edit"} & set(fresh(referenced=False).controller.keys)  # type: ignore[attr-defined]


# 3.10


@shows("bwo900-3.10-9")
def test_the_sign_of_the_end() -> None:
    desk = fresh(referenced=False)
    desk.send(b"\r\nD\r\nK1:P11177: 26\r\n#\r\n\x04")
    desk.send(b"P1\r\nN10 G0 X5\r\nN20 M30\x1a")
    desk.send(REFERENCE.replace(b"\x04", b"\x1a"))
    desk.finish()
    desk.send(parameters(p8800=1, p8683=2, p8684=1).replace(b"\x04", b"\x1a"))
    desk.finish()
    assert (said(desk), mm(desk)[0]) == ([], 5.0)
    before = len(desk.replies)
    desk.send(parameters(p11181=0).replace(b"\x04", b"\x1a"))
    assert b"".join(data for _, data in desk.replies[before:]).rstrip().endswith(b"\x1a")


@pytest.mark.parametrize("dash", ["-", "--", "\x96", "\x97"])
@shows("bwo900-3.10-10", "bwo900-3.10-5")
def test_printed_files_with_dashes(dash: str) -> None:
    desk = fresh(referenced=False, q4=3)
    desk.send(file("D", f"q 0: {dash} S:$00000000", "q 1: 8 S:$00000001", "q 3: 30000", f"q 4: {dash}"))
    known = put_out(desk)
    assert ([known.get(n) for n in (0, 1, 3, 4)], said(desk)) == ([None, 8.0, 30000.0, None], [])


REFUSED = [
    (file("P1", "N10 G0 X7", "N20 M30 X", "N15 M30"), 1290),
    (file("P1", "N10 G0 X7", "M30"), 1111),
    (file("P1", "N10 G0 X7", "N20 X" + "1" * 500), 1113),
    (file("P1", "N10 G0 X7", "N20 M30 \\"), 1111),
    (file("D", "K1:P500: 1e999"), 1111),
    (file("D", "K1:P500: abc"), 1111),
    (file("D", "K1:P500: 9 S:$123456789"), 1111),
    (file("D", "K1:P500 = 9"), 1111),
    (file("D", "K2:P500: 9"), 1112),
    (file("D", "K1:P5500: 9"), 1302),
    (parameters(p8683=3), 1322),
    (parameters(p8683=8), 1009),
    (parameters(p8752=1), 1321),
    (parameters(p12130=1), 1321),
]


@pytest.mark.parametrize(("what", "number"), REFUSED)
@shows("bwo900-3.10-11")
def test_what_is_refused_changes_nothing(what: bytes, number: int) -> None:
    """While a program runs, and for the next one."""
    desk = fresh(LONG, p500=5)
    start(desk)
    desk.run(0.5)
    desk.send(what)
    desk.finish()
    assert (said(desk), mm(desk), value(desk, 500)) == ([number], (50.0, 50.0, 0.0), 5.0)
    start(desk)
    desk.finish()
    assert (len(said(desk)), mm(desk)) == (1, (50.0, 50.0, 0.0))


@shows("bwo900-3.10-12")
def test_programs_in_execution_are_not_replaced() -> None:
    desk = fresh("P1|N10 G1 F3000 X20|N20 M28.2|N30 M30", "P2|N10 X30|N20 M02", "P3|N10 M30")
    start(desk)
    desk.run(0.2)
    for name in ("P1", "P2"):
        desk.send(file(name, "N10 G0 Y9", "N20 M30"))
    desk.send(file("P3", "N10 G0 Z9", "N20 M30"))
    desk.finish()
    assert (said(desk), mm(desk)) == ([1105, 1105, 1106], (30.0, 0.0, 0.0))
    desk.send(file("P1", "N10 G0 Y9", "N20 M30"))
    start(desk)
    desk.finish()
    assert (said(desk)[-1], mm(desk)) == (1106, (30.0, 9.0, 0.0))


@shows("bwo900-3.10-7", "bwo900-2.8.4-2")
def test_programs_are_put_out_and_read_in_again() -> None:
    desk = fresh("P123456|N10 G0 X0 Y0 Z0|N20 F100 G1 X100|N30 M30", "Z7|N10 M02", referenced=False)
    for number, expected in (
        (123_456, [b"P123456", b"N10 G0 X0 Y0 Z0", b"N20 F100 G1 X100", b"N30 M30", b"#", b"\x04"]),
        (0, [b"P123456", b"N10 G0 X0 Y0 Z0", b"N20 F100 G1 X100", b"N30 M30", b"#", b"Z7", b"N10 M02", b"#", b"\x04"]),
    ):
        before = len(desk.replies)
        desk.controller.press(desk.time_ns, "output", number)  # type: ignore[attr-defined]
        desk.run(0.01)
        text = b"".join(data for _, data in desk.replies[before:])
        assert [line for line in text.split(b"\r\n") if line] == expected
        other = Desk.of("bwo900", carriage=CARRIAGE)
        other.send(text)
        assert said(other) == []
