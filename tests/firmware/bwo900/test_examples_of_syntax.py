"""Worked examples of chapters 3, 6, 7.1, 8.1 and 8.3 as printed (the numbers of the manual's lines beside each)."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.bwo900_desk import fresh, mm, parameters, put_out, said, start, value
from firmware.bwo900.run import Analysed

from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.realtime.path import MotionLimits, PieceMaker
from isel_twin.firmware.bwo900.realtime.stretch import PERIOD_NS
from isel_twin.motion.joined import joined

TOOLS = {"p21000": 1.0, "p21020": 2.0, "p21030": 3.0, "p21040": 3.0}


def file(*lines: str) -> bytes:
    return ("\r\n" + "".join(f"{line}\r\n" for line in (*lines, "#"))).encode("latin-1") + b"\x04\r\n"


def test_the_printed_block() -> None:
    """L4112: a block with everything; P30 = (P20 + 35) 3."""
    run = Analysed("N10 G01 F100 T03 M100 P30:(P20+35)*3 X200.0000 Y400.550 { Kommentar }\nN20 M30", p20=5, **TOOLS)
    block = run.path[0]
    assert run.parameters.get(30) == 120.0
    assert (block.finish, block.feed_mm_min, block.tool) == ((200.0, 400.55, 0.0), 100.0, 3)
    assert [function.code for function in block.pre] == [100]


@pytest.mark.parametrize(
    ("block", "point"), [("N10 G0 X100 Z33", (100.0, 0.0, 33.0)), ("N10 G0 X(P20+5) Y-(P20)", (15.0, -10.0, 0.0))]
)
def test_axes(block: str, point: tuple[float, ...]) -> None:
    """L4137."""
    assert Analysed(f"{block}\nN20 M30", p20=10).points == [point]


def test_the_loop_of_supervision() -> None:
    """L4370, F100 as printed: 1.67 mm/s. The loop runs beside N10, and N200 comes when N10 is over."""
    text = (
        "P1|N10 G01 F100 X1000|N20 sc :1|N30 P500>P501.140|N40 P502:P502+1|N50 M23.30|"
        "N140 P503:1|N150 sc :0|N200 G00 X200|N210 M30"
    )
    desk = fresh(text, p500=0, p501=5, p502=0, p503=0)
    start(desk)
    desk.run(6.0)
    first, place = value(desk, 502), mm(desk)[0]
    assert place == pytest.approx(10.0, abs=0.1)
    desk.run(1.0)
    assert value(desk, 502) - first == pytest.approx(1.0 / (3 * 1.5e-3), rel=0.02)  # three blocks a pass
    desk.send(parameters(p500=6))
    desk.run(0.1)
    passes = value(desk, 502)
    desk.run(2.0)
    assert (value(desk, 503), value(desk, 502)) == (1.0, passes)
    assert mm(desk)[0] == pytest.approx(place + 3.1 * 100 / 60, abs=0.05)


def test_a_feed_at_the_end_of_a_block() -> None:
    """L4406: N60 runs at 6000 mm/min, and at X5600 at 1000."""
    run = Analysed("N50 X400 G0\nN60 G1 F6000 f1000 X5600\nN70 X5700\nN80 M30")
    path = PieceMaker(MotionLimits.of(run.parameters, [1000.0] * 3), (400.0, 0.0, 0.0))
    pieces, _ = path.pieces(run.path[1:])
    plan = joined(pieces, PERIOD_NS, sine=False, scale=1.0, identity=1)
    steps = plan.deltas(0, plan.ticks)[:, 0] / 1000.0
    places, speeds = 400.0 + np.cumsum(steps), steps / (PERIOD_NS / 1e9) * 60.0
    assert np.median(speeds) == pytest.approx(6000.0, rel=1e-3)
    assert speeds[np.abs(places - 5600.0).argmin()] == pytest.approx(1000.0, abs=60.0)
    assert speeds[(places > 1000.0) & (places < 5590.0)].min() > 1500.0


def test_line_mode() -> None:
    """L4525, q41 bit 0: blocks without numbers, N100 is a mark to jump to. X50 is the reference point."""
    desk = fresh(q41=1, p12040=50)
    desk.send(file("P1", "G01 F6000 X100", "M23.100", "G01 Y50", "N100 X150", "G04.1", "X100"))
    first = desk.ticks
    start(desk)
    desk.finish()
    steps = desk.steps_since(first)
    assert (said(desk), mm(desk)) == ([], (100.0, 0.0, 0.0))
    places = 50.0 + np.cumsum(steps.delta[:, 0]) / 1000.0
    assert places.max() == 150.0
    there = int(places.argmax())
    assert (steps.t_ns[there + 1] - steps.t_ns[there]) / 1e9 == pytest.approx(1.0, abs=0.02)


def test_the_printed_parameter_file() -> None:
    """L5860: with D the status is not taken over, but for `loaded`."""
    desk = fresh(referenced=False, p14=3)
    lines = "K1:P 10: 1 S:$00000009|K1:P 11: 100 S:$0000000D|K1:P 12: 200 S:$00000001|K1:P 13: 5|K1:P 14: —|K1:P 15: 2"
    desk.send(file("D", *lines.replace("—", "\x97").split("|")))
    content = put_out(desk)
    assert [content.get(10_000 + n) for n in range(10, 16)] == [1.0, 100.0, 200.0, 5.0, None, 2.0]
    before = len(desk.replies)
    desk.send(parameters(p11181=5))
    text = b"".join(data for _, data in desk.replies[before:]).decode()
    assert "q 10010: 1 S:$00000001" in text
    assert "q 10011: 100 S:$00000001" in text
    assert said(desk) == []


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("K1 P1: 123 S:$32000100", 0x32000101),
        ("K1 P1: 123 S:$32000101", 0x32000101),
        ("K1 P1: 123 S|$32000101", 0x32000501),
        ("K1 P1: 123 S:$30020401", 0x30020401),
    ],
)
def test_the_printed_status_files(line: str, status: int) -> None:
    """L5841, L5880, L10409, on a parameter that has status $00000400."""
    desk = fresh(referenced=False)
    desk.send(file("D+", "K1 P1: 1 S:$00000400", line))
    before = len(desk.replies)
    desk.send(parameters(p11181=5))
    text = b"".join(data for _, data in desk.replies[before:]).decode()
    assert f"q 10001: 123 S:${status:08X}" in text


CHANNELS = {
    2: 2,
    101: 1,
    102: 10_000,
    103: 5_000,
    104: 18_000,
    105: 2_000,
    201: 2,
    202: 20_000,
    203: 2_000,
    204: 25_000,
}


@pytest.mark.parametrize(
    ("number", "channel", "q"),
    [
        (0, 1, 10_000),
        (4999, 1, 14_999),
        (7000, 1, 15_000),
        (9999, 1, 17_999),
        (11_000, 1, 1000),
        (11_999, 1, 1999),
        (12_000, 1, 2000),
        (12_200, 1, 2200),
        (20_000, 1, 18_000),
        (21_999, 1, 19_999),
        (0, 2, 20_000),
        (7000, 2, 22_000),
        (20_000, 2, 25_000),
        (11_000, 2, 1000),
    ],
)
def test_addresses_of_two_channels(number: int, channel: int, q: int) -> None:
    """L10232, L10286, L11443."""
    axes = {110: float(0x01010058), 111: float(0x12020059), 112: float(0x0303005A)}
    p = Parameters({**CHANNELS, 205: 2_000, **axes})
    assert p.address("P", number, channel) == q
    assert [name for name, _ in p.axes] == ["X", "Y", "Z"]
    assert p.address("P", 12_400) == 2400


@pytest.mark.parametrize(
    ("workspace", "zero", "axis", "group", "number"),
    [
        (1, 0, 1, 0, 20_000),
        (1, 0, 3, 2, 20_044),
        (1, 1, 1, 0, 20_003),
        (1, 1, 1, 1, 20_024),
        (1, 3, 1, 0, 20_009),
        (1, 6, 3, 2, 20_062),
        (2, 0, 1, 0, 20_063),
        (2, 1, 1, 1, 20_087),
        (2, 6, 3, 2, 20_125),
    ],
)
def test_zero_points_of_two_workspaces(workspace: int, zero: int, axis: int, group: int, number: int) -> None:
    """L11110."""
    p = Parameters({**CHANNELS, 170: 20_000, 171: 2, 172: 2, 173: 3})
    assert p.zero_address(zero, axis - 1, workspace, group) == number


@pytest.mark.parametrize(
    ("zero", "axis", "group", "number"),
    [
        (0, 1, 0, 20_000),
        (1, 4, 3, 20_163),
        (7, 1, 0, 20_028),
        (7, 1, 2, 20_132),
        (12, 4, 3, 20_207),
        (12, 1, 1, 20_100),
    ],
)
def test_extended_zero_points(zero: int, axis: int, group: int, number: int) -> None:
    """L11165: G154 is the one behind G59."""
    p = Parameters({**CHANNELS, 170: 20_000, 171: 1, 172: 3, 173: 4, 174: 1})
    assert p.zero_address(zero, axis - 1, 1, group) == number


@pytest.mark.parametrize(
    ("records", "size", "groups", "tool", "radius"),
    [
        (0, 20, {21_000: 1.0, 21_020: 2.0}, 1, 21_010),
        (0, 20, {21_000: 1.0, 21_020: 2.0}, 2, 21_030),
        (3, 38, {21_000: 1.0, 21_038: 2.0, 21_076: 3.0}, 1, 21_010),
        (3, 38, {21_000: 1.0, 21_038: 2.0, 21_076: 3.0}, 2, 21_048),
        (3, 38, {21_000: 1.0, 21_038: 2.0, 21_076: 3.0}, 3, 21_086),
    ],
)
def test_tools_with_and_without_sub_records(
    records: int, size: int, groups: dict[int, float], tool: int, radius: int
) -> None:
    """L11246: T2 is called, its radius lies where it is printed."""
    known = {f"p{number}": content for number, content in groups.items()}
    run = Analysed(
        f"N10 T{tool} M16 G1 F1\nN20 G41 X5\nN30 M30", q177=records, q178=size, q176=9, **known, **{f"p{radius}": 1.5}
    )
    assert run.path[0].correction.radius_mm == 1.5


def test_g_functions_at_the_start() -> None:
    """L12602: G28, G54, G18; what stands behind a deleted one does not count."""
    desk = fresh("P1|N10 P1:P9358 P2:P9369 P3:P9350 P4:P9378|N20 M30", p8650=28, p8651=54, p8652=18, p8654=91)
    start(desk)
    desk.finish()
    assert [value(desk, n) for n in (1, 2, 3, 4)] == [28.0, 54.0, 18.0, 90.0]


@pytest.mark.parametrize(("place", "step"), [(1, 10.0), (2, 1.0), (3, 0.1), (4, 0.01), (5, 0.001)])
def test_steps_in_hand(place: int, step: float) -> None:
    """L12843."""
    desk = fresh(p8750=2, p8751=1, p8762=place)
    desk.send(parameters(p8752=1))
    desk.finish()
    assert mm(desk)[0] == step


LONG_Z6 = (
    "Z6|N10 _wzwxl_x_pos := 100; _wzwxl_y_pos:= 30;|N30 P8100=P8050.200|N40 P8100=0.100|"
    "N50 G00 X:_wzwxl_x_pos Y:_wzwxl_y_pos M01|N60 P8047:1|N100 P8050=0.200|"
    "N120 G00 X:_wzwxl_x_pos Y:_wzwxl_y_pos M01|N140 P8045:1|N200 M30"
)
"""L9782 with places on this machine; the comment `P8120 :` behind N50 is none of the block's."""


@pytest.mark.parametrize(
    ("before", "wanted", "place", "spindle"),
    [(0, 3, (100.0, 30.0), 3.0), (2, 3, (100.0, 30.0), 3.0), (3, 3, (0.0, 0.0), 3.0), (2, 0, (100.0, 30.0), 0.0)],
)
def test_the_printed_tool_change(before: int, wanted: int, place: tuple[float, float], spindle: float) -> None:
    """L9782: nothing is fetched that is there, nothing put away where nothing is."""
    change = f"N90 T{before} M06|" if before else ""
    desk = fresh(f"P1|{change}N95 G0 X0 Y0|N100 T{wanted} M6|N110 M30", LONG_Z6, **TOOLS)
    first = desk.ticks
    start(desk)
    desk.finish()
    steps = desk.steps_since(first).delta[:, :2] / 1000.0
    assert said(desk) == []
    assert mm(desk)[:2] == place
    assert len(steps) > 0 or place == (0.0, 0.0)
    assert value(desk, 8100) == spindle


def test_tool_data_and_then_the_correction() -> None:
    """L9843."""
    run = Analysed("N100 T2 M16 F100\nN120 X100 Y100 G42\nN130 G40 M30", **TOOLS)
    assert (run.path[0].correction.side, run.path[0].correction.radius_mm) == (-1, 3.0)
