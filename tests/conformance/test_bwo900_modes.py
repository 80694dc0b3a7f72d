"""BWO 900, chapters 1 and 2, and what chapters 3.10, 8 and 9 say of operating: modes, start, stop, abort, reference,
restart, start data, HAND, files, messages."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.bwo900_desk import CARRIAGE, REFERENCE, file, fresh, mm, parameters, put_out, run, said, start, value
from conformance.rows import case, shows

from isel_twin.testing import Desk

LONG = "P1|N10 G1 F3000 X50|N20 Y50|N30 M30"


@shows("bwo900-2.3-1", "bwo900-2.3-2", "bwo900-2.3-3", "bwo900-8.7-4")
def test_reference_runs() -> None:
    desk = fresh(LONG, referenced=False, p12040=7)
    start(desk)
    desk.finish()
    assert said(desk) == [1008]
    assert [value(desk, n) for n in (8579, 12180, 12380, 12580)] == [0.0] * 4
    assert desk.ticks == 0
    desk.send(REFERENCE)
    desk.finish()
    assert mm(desk) == (7.0, 0.0, 0.0)
    assert [value(desk, n) for n in (8579, 12180, 12380, 12580)] == [1.0] * 4
    start(desk)
    desk.finish()
    assert mm(desk) == (50.0, 50.0, 0.0)


@shows("bwo900-2.3-4")
def test_reference_runs_are_made_in_hand() -> None:
    desk = fresh(LONG)
    desk.send(parameters(p8683=2, p12130=1))
    desk.run(0.1)
    assert said(desk) == [1321]


@shows("bwo900-2.6.2-1", "bwo900-2.6.2-2", "bwo900-8.5-20")
def test_modes_and_what_the_program_is_at() -> None:
    desk = fresh(LONG)
    assert (value(desk, 8685), value(desk, 8687)) == (0.0, 0.0)
    desk.send(parameters(p8684=1))
    desk.run(0.1)
    assert said(desk) == [1322]
    start(desk)
    desk.run(0.5)
    assert (value(desk, 8685), value(desk, 8687)) == (2.0, 1.0)
    desk.send(parameters(p8682=1))
    desk.run(1.0)
    assert (value(desk, 8685), value(desk, 8687)) == (1.0, 1.0)
    held = mm(desk)
    assert held[0] < 50.0
    desk.send(parameters(p8682=2))
    desk.finish()
    assert mm(desk) == (50.0, 50.0, 0.0)
    assert (value(desk, 8685), value(desk, 8687)) == (0.0, 0.0)


@shows("bwo900-2.6.2-3")
def test_auto_and_positioning_change_by_way_of_hand() -> None:
    desk = fresh(LONG)
    desk.send(parameters(p8683=2))
    desk.send(parameters(p8683=8))
    desk.run(0.1)
    assert said(desk) == [1009]


@shows("bwo900-2.6.2-4")
def test_a_positioning_block() -> None:
    desk = fresh(LONG, "P0|G0 X12 Y3")
    desk.send(parameters(p8683=8, p8684=1))
    desk.finish()
    assert mm(desk) == (12.0, 3.0, 0.0)


@shows("bwo900-2.6.2-5", "bwo900-8.5-21")
def test_single_block() -> None:
    program = (
        "P1|N10 G0 X10|N20 P1:5|N25 G0 X20|N30 S500 M3|N40 G86 G81 P103:0 P105:5 P106:2 P32:500 P33:1 P34:2|N50 M30"
    )
    desk = fresh(program, p1=0)
    start(desk, mode=4)
    stops = []
    for _ in range(4):
        desk.run(3.0)
        assert value(desk, 8685) == 1.0
        stops.append((mm(desk)[0], value(desk, 1)))
        desk.send(parameters(p8684=1))
    assert [x for x, _ in stops] == [10.0, 10.0, 20.0, 20.0]


@shows("bwo900-8.5-21")
def test_blocks_of_subprograms_are_blocks() -> None:
    desk = fresh("P1|N10 M28.2|N20 M30", "P2|N10 G0 X10|N20 X20|N30 M02")
    start(desk, mode=4)
    places = []
    for _ in range(4):
        desk.run(2.0)
        places.append(mm(desk)[0])
        desk.send(parameters(p8684=1))
    assert {0.0, 10.0, 20.0} <= set(places)


@pytest.mark.parametrize("flag", [0x10, 0x1000])
@shows("bwo900-8.5-22")
def test_single_block_may_pass_over_parameters(flag: int) -> None:
    desk = fresh("P1|N10 G0 X10|N20 P1:5|N25 G0 X20|N50 M30", p8806=flag)
    start(desk, mode=4)
    for place in (10.0, 20.0):
        desk.run(3.0)
        assert mm(desk)[0] == place
        desk.send(parameters(p8684=1))


@shows("bwo900-8.5-23")
def test_single_block_may_stop_in_cycles() -> None:
    program = "P1|N10 G0 Z9 S500 M3|N40 G81 X5 P32:500 P33:1 P34:2|N50 M30"
    stops = {}
    for every in (0, 1):
        desk = fresh(program, p8814=every)
        start(desk, mode=4)
        stops[every] = []
        for _ in range(4):
            desk.run(5.0)
            stops[every].append(mm(desk)[2])
            desk.send(parameters(p8684=1))
    assert stops[0][:2] == [9.0, 2.0]
    assert stops[1][:2] == [9.0, 9.0]
    assert 2.0 in stops[1][2:]


@shows("bwo900-2.6.2-6", "bwo900-8.5-24", "bwo900-8.5-25")
def test_abort_and_restart() -> None:
    desk = fresh("P1|N5 P1:P1+1 G1 F3000 Y20|N10 X50 M7|N20 Y50|N30 M30", p1=0)
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p8705=1))
    desk.finish()
    broken = mm(desk)
    assert 0.0 < broken[0] < 50.0
    assert broken[1] == 20.0
    assert [value(desk, n) for n in (8802, 8803, 8705)] == [1.0, 10.0, 0.0]
    desk.send(parameters(p8683=1, p8804=1))
    first = desk.ticks
    start(desk)
    desk.finish()
    places = np.array(broken) + np.cumsum(desk.steps_since(first).delta[:, :3] / 1000.0, axis=0)
    assert places[:, 0].min() == pytest.approx(0.0, abs=2e-3)
    assert places[places[:, 0] < 30.0][:, 1] == pytest.approx(20.0, abs=2e-3)
    assert mm(desk) == (50.0, 50.0, 0.0)
    assert [value(desk, n) for n in (8802, 8803, 8804)] == [0.0, 0.0, 0.0]


@shows("bwo900-2.5.1-1")
def test_changing_to_hand_breaks_off_and_clears_messages() -> None:
    desk = fresh(LONG)
    start(desk)
    desk.run(0.5)
    desk.send(parameters(p8683=1))
    desk.finish()
    assert mm(desk)[0] < 50.0
    assert value(desk, 8802) == 1.0


@shows("bwo900-2.7.1-1")
def test_emergency_stop() -> None:
    desk = fresh(LONG)
    start(desk)
    desk.run(0.5)
    desk.set("estop", "pressed")
    desk.run(0.1)
    there = mm(desk)
    desk.run(1.0)
    assert (mm(desk), said(desk)) == (there, [3001])


def test_a_workspace_that_vanishes_is_a_message() -> None:
    desk = fresh("P1|N10 G54 G0 X5 M00|N20 X6|N30 M30", p8555=1)
    start(desk)
    desk.run(3.0)
    desk.send(parameters(p8555=9, p8684=1))
    desk.finish()
    assert said(desk) == [1240]


@pytest.mark.parametrize(
    "name", ["p12004", "p12008", "p12012", "p12013", "p12016", "p12020", "p8815", "p8816", "p8818"]
)
@shows("bwo900-8.7-2")
def test_parameters_that_make_no_sense_mean_their_defaults(name: str) -> None:
    desk = fresh("P1|N10 G0 X5|N20 G1 F1000 Y5|N30 M30", **{name: -5})
    start(desk)
    desk.finish()
    assert mm(desk) == (5.0, 5.0, 0.0)


@shows("bwo900-9.7-2")
def test_limit_switches() -> None:
    desk = fresh("P1|N10 G1 F3000 X900|N30 M30")
    start(desk)
    desk.finish()
    assert said(desk) == [2101]
    assert value(desk, 8685) == 0.0


@shows("bwo900-8.5-26")
def test_a_program_may_start_at_a_block() -> None:
    desk = fresh(LONG, p8801=20)
    desk.send(parameters(p501=1))
    start(desk)
    desk.finish()
    assert said(desk) == [1230]
    desk = fresh("P1|N10 G0 X50|N20 G0 Y50|N30 M30", p8801=20)
    start(desk)
    desk.finish()
    assert mm(desk) == (0.0, 50.0, 0.0)


@pytest.mark.parametrize(
    ("values", "modal"),
    [
        case("bwo900-8.5-27", {"p8830": 54}, (9369, 54)),
        case("bwo900-8.5-28", {"p8853": 47}, (9367, 47)),
        case("bwo900-8.5-29", {"p8650": 28, "p8651": 54, "p8652": 18}, (9350, 18)),
        case("bwo900-8.5-29", {"p8650": 28, "p8652": 18}, (9350, 17)),
    ],
)
def test_what_a_program_starts_with(values: dict[str, float], modal: tuple[int, int]) -> None:
    desk = run(f"P1|N10 P500:P{modal[0]}|N20 M30", **values)
    assert value(desk, 500) == modal[1]


@shows("bwo900-9.5-15")
def test_a_wrong_start_state() -> None:
    assert said(run(LONG, p8830=90)) == [1249]


@shows("bwo900-8.5-30")
def test_without_moving() -> None:
    desk = run("P1|N10 G0 X50|N20 P1:7 G1 F100 Y900|N30 M30", p8812=1)
    assert (mm(desk), value(desk, 1)) == ((0.0, 0.0, 0.0), 7.0)


@shows("bwo900-8.5-31")
def test_without_functions() -> None:
    desk = fresh("P1|N10 S500 M3 M28.2|N20 M30", "P2|N10 G0 X5|N20 M2", p8813=1)
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 5.0
    assert desk.outputs.get("spindle", 0) == 0


@shows("bwo900-8.6-2")
def test_the_override_ends_at_120_percent() -> None:
    def speed(percent: float) -> float:
        desk = fresh("P1|N10 G1 F1200 X30|N30 M30", p11310=percent)
        first = desk.ticks
        start(desk)
        desk.finish()
        return float(desk.steps_since(first).delta[:, 0].max() / 1000.0 / 0.002 * 60.0)

    assert speed(120) == pytest.approx(1440.0, rel=0.02)
    assert speed(200) == pytest.approx(1440.0, rel=0.02)


# HAND


@shows("bwo900-8.5-40", "bwo900-8.5-41")
def test_an_axis_moves_while_its_key_is_held() -> None:
    desk = fresh(p8750=1, p8751=2, p8755=600)
    desk.send(parameters(p8683=1, p8752=1))
    desk.run(2.0)
    moving = mm(desk)
    assert moving[1] == pytest.approx(20.0, rel=0.1)
    assert value(desk, 8756) == 600.0
    desk.send(parameters(p8752=0))
    desk.finish()
    assert moving[1] < mm(desk)[1] < moving[1] + 2.0
    assert (mm(desk)[0], mm(desk)[2]) == (0.0, 0.0)
    desk.send(parameters(p8752=2))
    desk.run(1.0)
    desk.send(parameters(p8752=0))
    desk.finish()
    assert mm(desk)[1] == pytest.approx(moving[1] - 10.0, abs=2.0)


@pytest.mark.parametrize(
    ("values", "way"),
    [
        case("bwo900-8.5-42", {}, 10.0),
        case("bwo900-8.5-42", {"p8762": 3}, 0.1),
        case("bwo900-8.5-42", {"p8762": 2, "p8764": 3.5}, 3.5),
        case("bwo900-8.5-43", {"p8760": 2.5}, 2.5),
    ],
)
def test_steps(values: dict[str, float], way: float) -> None:
    desk = fresh(p8750=2, p8751=3, **values)
    for count in (1, 2):
        desk.send(parameters(p8752=1))
        desk.run(0.01)
        desk.send(parameters(p8752=0))
        desk.finish()
        assert mm(desk)[2] == pytest.approx(count * way)


@shows("bwo900-8.5-44")
def test_the_speed_in_hand_has_a_limit() -> None:
    desk = fresh(p8750=1, p8751=1, p8754=300, p8755=600)
    desk.send(parameters(p8752=1))
    desk.run(2.0)
    assert value(desk, 8756) == 300.0
    assert mm(desk)[0] == pytest.approx(10.0, rel=0.05)


@shows("bwo900-9.7-1")
def test_software_limits_hold_in_hand() -> None:
    desk = fresh(p8750=1, p8751=1, p8755=3000, p12030=12)
    desk.send(parameters(p8752=1))
    desk.finish()
    assert mm(desk)[0] == 12.0
    desk.send(parameters(p8752=0, p8750=2))
    desk.send(parameters(p8752=1))
    desk.finish()
    assert (mm(desk)[0], said(desk)) == (12.0, [2103])
    desk = fresh("P1|N10 G0 Y20 M01|N20 P12231:5 P12031:18 M30", p8750=1, p8751=2, p8755=3000)
    start(desk)
    desk.finish()
    desk.send(parameters(p8683=1, p8752=2))
    desk.finish()
    assert mm(desk)[1] == 5.0


@pytest.mark.parametrize("kind", [3, 4, 5])
@shows("bwo900-8.5-45")
def test_kinds_of_moves_in_hand_that_are_not_there(kind: int) -> None:
    desk = fresh(p8750=kind, p8751=1)
    desk.send(parameters(p8752=1))
    desk.finish()
    assert (mm(desk)[0], said(desk)) == (0.0, [1321])


@shows("bwo900-2.6.1-1")
def test_axes_have_no_keys_in_auto() -> None:
    desk = fresh()
    desk.send(parameters(p8683=2, p8751=1, p8752=1))
    desk.finish()
    assert (mm(desk)[0], said(desk)) == (0.0, [1321])


# Files


@shows("bwo900-3.10-1", "bwo900-3.10-2")
def test_the_printed_program_file() -> None:
    desk = Desk.of("bwo900", carriage=CARRIAGE)
    desk.send(file("P123456", "N10 G0 X0 Y0 Z0", "N20 F100 G1 X100", "N30 M30"))
    desk.send(REFERENCE)
    desk.finish()
    start(desk, 123456)
    desk.run(3.0)
    assert mm(desk)[0] > 3.0
    assert value(desk, 8900) == 123456.0


@shows("bwo900-3.10-3", "bwo900-3.10-5")
def test_the_printed_parameter_files() -> None:
    desk = fresh(referenced=False, p14=3)
    lines = (
        "K1:P 10: 1 S:$00000009|K1:P 11: 100 S:$0000000D|K1:P 12: 200 S:$00000001|K1:P 13: 5|K1:P 14: \x97|K1:P 15: 2"
    )
    desk.send(file("D", *lines.replace("\x97", "--").split("|")))
    content = put_out(desk)
    assert [content.get(10_000 + n) for n in range(10, 16)] == [1, 100, 200, 5, None, 2]
    desk.send(file("D", "q 0: -- S:$00000000", "q 3: 30000", "q 4: -"))
    assert put_out(desk)[3] == 30000.0


@shows("bwo900-3.10-4", "bwo900-3.10-6", "bwo900-8.4-3")
def test_status_of_parameters() -> None:
    desk = fresh(referenced=False)
    desk.send(file("D+", "K1 P1: 123 S:$32000100"))
    desk.send(file("D+", "K1 P2: 5 S:$00000100", "K1 P2: 5 S|$00000400"))
    desk.send(file("D", "K1 P3: 5 S:$00000400"))
    before = len(desk.replies)
    desk.send(parameters(p11181=5))
    text = b"".join(data for _, data in desk.replies[before:]).decode()
    assert "D+" in text
    assert "q 10001: 123 S:$32000101" in text
    assert "q 10002: 5 S:$00000501" in text
    assert "q 10003: 5 S:$00000001" in text
    assert text.rstrip("\r\n").endswith("\x04")


@shows("bwo900-3.10-7")
def test_what_is_put_out_can_be_read_in() -> None:
    desk = fresh(referenced=False, p500=1.25, p20003=-7.5)
    before = len(desk.replies)
    desk.send(parameters(p11181=0))
    text = b"".join(data for _, data in desk.replies[before:])
    other = Desk.of("bwo900", carriage=CARRIAGE)
    other.send(text)
    assert (said(other), put_out(other)) == ([], put_out(desk))


@pytest.mark.parametrize(
    ("lines", "number"),
    [
        case("bwo900-9.3-1", ("X5", "N10"), 1110),
        case("bwo900-9.3-2", ("D", "P1 = 5"), 1111),
        case("bwo900-9.3-3", ("P1", "N10 X" + "1" * 500), 1113),
        case("bwo900-9.3-4", ("D", "K3:P1: 5"), 1112),
    ],
)
def test_messages_about_files(lines: tuple[str, ...], number: int) -> None:
    desk = Desk.of("bwo900", carriage=CARRIAGE)
    desk.send(file(*lines))
    desk.run(0.1)
    assert said(desk) == [number]
    assert value(desk, 8503) == number


@shows("bwo900-9.3-5")
def test_a_program_is_overwritten() -> None:
    desk = fresh("P1|N10 G0 X5|N20 M30", "P1|N10 G0 X6|N20 M30")
    start(desk)
    desk.finish()
    assert (said(desk), mm(desk)[0]) == ([1106], 6.0)


@shows("bwo900-9.1-1", "bwo900-9.1-2")
def test_messages_name_their_place() -> None:
    desk = run("P7|N10 G0 X10|N20 G1 F100 Q20|N30 M30", "P1|N10 M28.7|N20 M30")
    assert [text for _, text in desk.remarks] == ["M1216 P7 N20 column 13: unknown axis (Q)"]
    assert [value(desk, n) for n in (8501, 8910, 8911)] == [1216.0, 7.0, 20.0]
    assert mm(desk)[0] == 10.0


@shows("bwo900-8.6-3")
def test_the_line_s_settings() -> None:
    desk = fresh(referenced=False)
    form = desk.controller.serial_format
    assert (form.baud, form.data_bits, form.parity, form.stop_bits) == (9600, 8, "N", 2)
    desk.send(parameters(p11172=19200, p11174=1, p11175=2))
    form = desk.controller.serial_format
    assert (form.baud, form.data_bits, form.parity, form.stop_bits) == (19200, 8, "E", 1)


@shows("bwo900-1-1")
def test_programs_and_parameters_outlive_the_mains() -> None:
    desk = fresh("P1|N10 G0 X:P500|N20 M30", p500=12.5)
    desk.power_cycle()
    desk.send(REFERENCE)
    desk.finish()
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 12.5
