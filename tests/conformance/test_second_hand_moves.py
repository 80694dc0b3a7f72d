"""Moves beside the path, once more from the manuals' text and closed forms, and together with what else can happen
meanwhile: axes that the PLC moves and reference points by hand (BWO 900, 2.3.2, 8.7), axes that leave the interpolation
and a spindle that follows the feed (GMI99, 3.1.1 p4, 6.1.4)."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.bwo900_desk import (
    REFERENCE,
    Pulsing,
    file,
    fresh,
    mm,
    parameters,
    put_out,
    said,
    start,
    value,
)
from conformance.gmi99_desk import ABORT, OK, TO_0, TO_10000, TO_20000, CardDesk, Q, command, prepared, running, word
from conformance.rows import shows

from isel_twin import Twin
from isel_twin.testing import Desk

pytestmark = pytest.mark.long(seconds=5)

RAMP_MM_S2 = 400.0
"""P12004 = 6000 mm/min in P12008 = 250 ms."""
EMERGENCY, EMERGENCY_BY, BASE, BASE_BY = (1 << 8 * byte for byte in range(4))
FIXED, TO_AND_FRO = 1, 1 << 8
ONWARD, BACK, AT_EDGE, NOW = (1 << 8 * byte for byte in range(4))


def seconds(way_mm: float, mm_min: float) -> float:
    """From rest to rest."""
    speed = mm_min / 60.0
    return way_mm / speed + speed / RAMP_MM_S2


def deleted(desk: Desk, number: int) -> None:
    desk.send(file("D", f"K1:P {number}: --"))


def told(desk: Desk, *numbers: int) -> list[int]:
    """What these parameters of axes say, deleted ones 0."""
    put = put_out(desk)
    return [int(put.get(number - 10_000, 0.0)) for number in numbers]


# BWO 900, 8.7: P12110 to P12112


@shows("bwo900-8.7-21")
def test_a_relative_position_begins_with_each_write_and_tells_when_it_is_there() -> None:
    desk = fresh()
    for way, place in ((7.0, 7.0), (7.0, 14.0), (-4.5, 9.5)):
        desk.send(parameters(p12111=way))
        desk.run(0.05)
        assert told(desk, 12_191) == [0], "under way"
        desk.finish()
        assert (mm(desk), told(desk, 12_191)) == ((place, 0.0, 0.0), [1])
    assert told(desk, 12_192, 12_391) == [0, 0]
    deleted(desk, 12_111)
    desk.finish()
    assert (mm(desk)[0], told(desk, 12_191), said(desk)) == (9.5, [0], [])


@shows("bwo900-8.7-21")
def test_an_absolute_position_is_one_of_the_machine() -> None:
    """Its zero is where P12040 of the reference point says; the zero point of a program (G54: 2) has no part in it."""
    desk = fresh("P1|N10 G54 G0 X15|N20 M30", p12040=12.5, p20003=2)
    start(desk)
    desk.finish()
    assert value(desk, 12_150) == 17.0
    mark = desk.ticks
    desk.send(parameters(p12112=20))
    desk.finish()
    assert desk.steps_since(mark).total == (3_000, 0, 0)
    assert told(desk, 12_150, 12_151, 12_192, 12_191) == [20, 20, 1, 0]


@shows("bwo900-8.7-21", "bwo900-8.7-22")
@pytest.mark.parametrize(
    ("asked", "said_before", "mm_min"),
    [
        ({"p12111": 30}, {"p12121": 0, "p12122": 600}, 6000),
        ({"p12111": 30}, {"p12121": 1200}, 1200),
        ({"p12112": 30}, {"p12122": 1800, "p12121": 600}, 1800),
        ({"p12111": 30}, {"p12121": 3000, "p11310": 50}, 1500),  # override 1
        ({"p12111": 30}, {"p12121": 3000, "p8866": 7, "p8867": 6}, 1500),  # override 7: always 50 %
        ({"p12112": 30}, {"p12122": 3000, "p8867": 7, "p11310": 20}, 1500),
        ({"p12111": 30}, {"p12121": 3000, "p8866": 6, "p12126": 7, "p12127": 6}, 1500),
        ({"p12112": 30}, {"p12122": 3000, "p8867": 6, "p12127": 7}, 1500),
        ({"p12132": EMERGENCY}, {"p12032": 30, "p11310": 50, "p12128": 6}, 6000),  # 100 %
        ({"p12132": EMERGENCY_BY}, {"p12033": 30, "p11310": 50}, 6000),
        ({"p12132": BASE}, {"p12034": 30, "p12123": 600, "p12128": 7}, 3000),
        ({"p12132": BASE_BY}, {"p12035": 30, "p12128": 7}, 3000),
        ({"p12133": FIXED}, {"p12036": 30, "p12123": 1200, "p12128": 7}, 600),
        ({"p12133": FIXED}, {"p12036": 30}, 6000),
    ],
)
def test_speeds_and_overrides(asked: dict[str, int], said_before: dict[str, float], mm_min: float) -> None:
    desk = fresh(**said_before)
    mark, begin_ns = desk.ticks, desk.time_ns
    desk.send(parameters(**asked))
    desk.finish()
    ticks = desk.steps_since(mark)
    assert ticks.total == (30_000, 0, 0)
    assert (ticks.t_ns[-1] - begin_ns) / 1e9 == pytest.approx(seconds(30.0, mm_min), abs=0.02)


@shows("bwo900-8.7-21")
@pytest.mark.parametrize("number", [12_111, 12_112])
def test_deleted_on_its_way_it_is_broken_off(number: int) -> None:
    """An active positioning is broken off: 20 mm/s, v^2 / 2 a = 0.5 mm."""
    desk = fresh(p12121=1200, p12122=1200)
    desk.send(parameters(**{f"p{number}": 40}))
    desk.run(1.0)
    there = mm(desk)[0]
    deleted(desk, number)
    desk.finish()
    assert mm(desk)[0] == pytest.approx(there + 0.5, abs=0.1)
    assert told(desk, 12_191, 12_192) == [0, 0]
    desk.send(parameters(p12112=25))
    desk.finish()
    assert (mm(desk)[0], said(desk)) == (25.0, [])


@shows("bwo900-8.7-21")
def test_written_on_its_way_the_new_position_counts() -> None:
    """Absolute: the axis turns back and never gets to the first place. Relative: from where it stands, 0.5 mm on."""
    desk = fresh(p12121=1200, p12122=1200)
    desk.send(parameters(p12112=40))
    desk.run(1.0)
    desk.send(parameters(p12112=10))
    desk.finish()
    assert desk.steps.path()[:, 0].max() < desk.steps.path()[-1, 0] + 12_000
    assert (mm(desk)[0], told(desk, 12_192)) == (10.0, [1])
    desk.send(parameters(p12111=40))
    desk.run(1.0)
    there = mm(desk)[0]
    desk.send(parameters(p12111=-3))
    desk.finish()
    assert mm(desk)[0] == pytest.approx(there + 0.5 - 3.0, abs=0.1)


@shows("bwo900-8.7-21", "bwo900-8.7-22")
def test_two_axes_at_once_each_with_its_speed() -> None:
    """X 20 mm at 10 mm/s, Y 30 at 100: Y is there first; what ends X leaves Y alone, and the other way about."""
    desk = fresh(p12122=600, p12236=30)
    desk.send(parameters(p12112=20, p12333=FIXED))
    desk.run(seconds(30.0, 6000) + 0.05)
    assert (mm(desk)[1], told(desk, 12_383, 12_192)) == (30.0, [FIXED, 0])
    assert mm(desk)[0] == pytest.approx(10.0 * (0.6 - 0.0125), abs=0.1)
    desk.send(parameters(p12333=0))
    desk.finish()
    assert (mm(desk), told(desk, 12_383, 12_192)) == ((20.0, 30.0, 0.0), [0, 1])
    desk.send(parameters(p12112=0, p12312=0))
    desk.run(0.4)
    deleted(desk, 12_112)
    desk.finish()
    assert mm(desk)[0] > 15.0
    assert (mm(desk)[1], told(desk, 12_192, 12_392)) == (0.0, [0, 1])


@shows("bwo900-8.7-21", "bwo900-8.7-6")
def test_a_position_that_is_set_moves_nothing_and_no_limit_of_the_machine() -> None:
    """Display and set position become 100, the mechanical position stays; deleted, the old one is shown."""
    desk = fresh(p12030=50)
    desk.send(parameters(p12111=10))
    desk.finish()
    desk.send(parameters(p12110=100))
    desk.run(0.01)
    assert [value(desk, n) for n in (12_150, 12_151, 12_154)] == [10.0, 100.0, 100.0]
    desk.send(parameters(p12112=130))
    desk.finish()
    assert (value(desk, 12_150), said(desk)) == (40.0, [])
    desk.send(parameters(p12112=141))
    desk.finish()
    assert (value(desk, 12_150), said(desk)) == (40.0, [2103])
    desk.send(parameters(p8683=1, p8508=1))
    deleted(desk, 12_110)
    desk.run(0.01)
    assert [value(desk, n) for n in (12_150, 12_151, 12_154)] == [40.0, 40.0, 40.0]


# 8.7: P12131 to P12133


@shows("bwo900-8.7-22")
@pytest.mark.parametrize(
    ("axis", "number", "byte", "place", "tells", "says"),
    [
        (0, 12_132, EMERGENCY, 12_032, (12_182, 1), [2000, 2000]),
        (1, 12_132, EMERGENCY_BY, 12_033, (12_182, 1), [2000, 2000]),
        (0, 12_132, BASE, 12_034, (12_182, 1 << 16), []),
        (1, 12_132, BASE_BY, 12_035, (12_182, 1 << 16), []),
        (1, 12_133, FIXED, 12_036, (12_183, 1), []),
    ],
)
def test_a_byte_starts_0_stops_and_the_place_is_told(
    axis: int, number: int, byte: int, place: int, tells: tuple[int, int], says: list[int]
) -> None:
    """1, 0 in the middle, and 1 again: an absolute place is reached, a relative one counts from the standstill."""
    own = 200 * axis
    desk = fresh(**{f"p{place + own}": 30.0})
    desk.send(parameters(**{f"p{number + own}": byte}))
    desk.run(0.2)
    assert told(desk, tells[0] + own) == [0]
    desk.send(parameters(**{f"p{number + own}": 0}))
    desk.finish()
    held = mm(desk)[axis]
    assert 10.0 < held < 30.0
    desk.run(1.0)
    assert (mm(desk)[axis], told(desk, tells[0] + own)) == (held, [0])
    desk.send(parameters(**{f"p{number + own}": byte}))
    desk.finish()
    relative = place in (12_033, 12_035)
    goal = [0.0, 0.0, 0.0]
    goal[axis] = held + 30.0 if relative else 30.0
    assert mm(desk) == pytest.approx(goal, abs=1e-9)
    assert (told(desk, tells[0] + own), said(desk)) == ([tells[1]], says)
    desk.send(parameters(**{f"p{number + own}": 0}))
    assert told(desk, tells[0] + own) == [0]


@shows("bwo900-8.7-22")
def test_an_emergency_position_beside_a_program() -> None:
    """M2000; all other axes of the channel are stopped, the axis goes to its place at 6000 mm/min whatever the
    override; the program is over."""
    desk = fresh("P1|N10 G1 F1200 X50 Y50|N20 M30", p12432=20, p11310=50)
    start(desk)
    desk.run(1.5)
    before = mm(desk)
    desk.send(parameters(p12532=EMERGENCY))
    desk.finish()
    assert 2000 in said(desk)
    assert (mm(desk)[2], told(desk, 12_582), value(desk, 8_687)) == (20.0, [1], 0.0)
    assert all(0.0 < now - then < 1.0 for now, then in zip(mm(desk)[:2], before[:2], strict=True))


@shows("bwo900-8.7-22")
@pytest.mark.parametrize("other", [{"p12312": 40}, {"p12333": TO_AND_FRO}, {"p12331": ONWARD}])
def test_an_emergency_position_holds_what_else_the_plc_moves(other: dict[str, float]) -> None:
    """Y, at 20 mm/s, brakes in 0.5 mm at most, and stays; its place is not told."""
    desk = fresh(p12032=30, p12237=15, p12322=1200, p12323=1200, p8755=1200)
    desk.send(parameters(**other))
    desk.run(0.5)
    there = mm(desk)[1]
    desk.send(parameters(p12132=EMERGENCY))
    desk.run(3.0)
    assert (mm(desk)[0], said(desk)) == (30.0, [2000])
    assert there < mm(desk)[1] <= there + 0.55
    assert told(desk, 12_182, 12_381, 12_383, 12_392) == [1, 0, 0, 0]


@shows("bwo900-8.7-21", "bwo900-8.7-22")
def test_an_override_counts_on_the_way_and_not_for_an_emergency() -> None:
    desk = fresh(p12122=1200, p12032=40)
    desk.send(parameters(p12112=20))
    desk.run(0.5)
    desk.send(parameters(p11310=0))
    desk.run(1.0)
    held = mm(desk)[0]
    desk.run(1.0)
    assert (mm(desk)[0], told(desk, 12_192)) == (held, [0])
    assert held == pytest.approx(10.0, abs=0.1)
    desk.send(parameters(p11310=100))
    desk.finish()
    assert (mm(desk)[0], told(desk, 12_192)) == (20.0, [1])
    desk.send(parameters(p12132=EMERGENCY))
    desk.run(0.1)
    desk.send(parameters(p11310=0))
    desk.run(0.5)
    assert (mm(desk)[0], told(desk, 12_182)) == (40.0, [1])


@shows("bwo900-8.7-22")
@pytest.mark.parametrize("way", [8.0, -8.0])
def test_to_and_fro_with_its_rests_until_it_is_held(way: float) -> None:
    """There and back at 20 mm/s: 0.45 s each, and 0.5 s at the start, 0.25 s at the other end."""
    desk = fresh(p12037=way, p12123=1200, p12038=0.5, p12039=0.25)
    desk.send(parameters(p12112=20))
    desk.finish()
    mark = desk.ticks
    desk.send(parameters(p12133=TO_AND_FRO))
    desk.run(4.0)
    ticks = desk.steps_since(mark)
    rests = np.flatnonzero(np.diff(ticks.t_ns) > 100_000_000)
    stands = (ticks.t_ns[rests + 1] - ticks.t_ns[rests]) / 1e9
    assert list(ticks.path()[rests, 0]) == [1000 * way, 0, 1000 * way, 0][: len(rests)]
    assert list(stands) == pytest.approx([0.25, 0.5, 0.25, 0.5][: len(rests)], abs=0.02)
    leaves = ticks.t_ns[rests + 1]
    assert (leaves[2] - leaves[0]) / 1e9 == pytest.approx(2 * seconds(8.0, 1200) + 0.75, abs=0.02)
    desk.send(parameters(p12133=0))
    desk.finish()
    held = mm(desk)[0]
    desk.run(2.0)
    assert (mm(desk)[0], told(desk, 12_183)) == (held, [0])
    assert 0.0 <= (held - 20.0) / way <= 1.0


@shows("bwo900-8.7-22")
def test_to_and_fro_without_a_rest_beside_another_axis() -> None:
    """With an exact stop at both ends; Y is placed meanwhile, and a program waits for the axis that goes on."""
    desk = fresh("P1|N10 G0 X30|N20 M30", p12037=5, p12123=3000)
    mark = desk.ticks
    desk.send(parameters(p12133=TO_AND_FRO))
    desk.run(0.5)
    desk.send(parameters(p12312=12))
    desk.run(1.5)
    path = desk.steps_since(mark).path()[:, 0]
    assert (path.max(), mm(desk)[1], told(desk, 12_392)) == (pytest.approx(5000, abs=30), 12.0, [1])
    start(desk)
    desk.run(2.0)
    desk.send(parameters(p12133=0))
    desk.finish()
    assert (mm(desk)[:2], said(desk)) == ((30.0, 12.0), [])


@shows("bwo900-8.7-22")
@pytest.mark.parametrize(("byte", "sense"), [(ONWARD, 1), (BACK, -1)])
def test_a_measuring_move_ends_at_the_probe(byte: int, sense: int) -> None:
    """At the feed of HAND (P8755: 10 mm/s) until the edge: P12181 and P12153 say that and where. 0 stops before it."""
    desk = fresh(p8755=600)
    desk.send(parameters(p12112=40))
    desk.finish()
    desk.send(parameters(p12131=byte))
    desk.run(1.0)
    assert mm(desk)[0] == pytest.approx(40.0 + sense * (10.0 - 0.125), abs=0.1)
    desk.send(parameters(p12131=0))
    desk.finish()
    stood = mm(desk)[0]
    assert (stood, told(desk, 12_181)) == (pytest.approx(40.0 + sense * 10.0, abs=0.1), [0])
    desk.send(parameters(p12131=byte))
    desk.run(0.5)
    at = mm(desk)[0]
    desk.set("probe", "touched")
    desk.finish()
    assert told(desk, 12_181) == [0x0101], "taken, and the input is on"
    assert value(desk, 12_153) == pytest.approx(at, abs=0.05)
    assert mm(desk)[0] == pytest.approx(at + sense * 0.125, abs=0.05)
    assert (mm(desk)[1:], said(desk)) == ((0.0, 0.0), [])


@shows("bwo900-8.7-22")
def test_a_measuring_position_is_taken_in_passing() -> None:
    """Byte 4: now. Byte 3: at the next edge, once, and the axis goes on. Y, which is not asked, keeps none."""
    desk = fresh(p12121=1200)
    desk.send(parameters(p12111=40))
    desk.run(0.5)
    at = mm(desk)[0]
    desk.send(parameters(p12131=NOW))
    desk.run(0.01)
    assert (value(desk, 12_153), told(desk, 12_181)) == (pytest.approx(at, abs=0.3), [1])
    desk.send(parameters(p12131=0))
    desk.send(parameters(p12131=AT_EDGE))
    desk.run(0.5)
    at = mm(desk)[0]
    for state in ("touched", "free", "touched"):
        desk.set("probe", state)
        desk.run(0.2)
    desk.finish()
    assert value(desk, 12_153) == pytest.approx(at, abs=0.3)
    assert (mm(desk)[0], told(desk, 12_191, 12_181), said(desk)) == (40.0, [1, 0x0101], [])
    assert told(desk, 12_381)[0] & 1 == 0


# together with limits, reference points, locks, faults


KINDS = [
    {"p12111": 40.0},
    {"p12112": 40.0},
    {"p12132": EMERGENCY},
    {"p12132": BASE_BY},
    {"p12133": FIXED},
    {"p12133": TO_AND_FRO},
]
PLACES = {f"p{number}": 40.0 for number in range(12_032, 12_038)}


@shows("bwo900-8.7-6", "bwo900-8.7-22")
@pytest.mark.parametrize("kind", KINDS)
def test_a_software_limit_in_the_way(kind: dict[str, float]) -> None:
    """It is not begun: M2103; another axis goes all the same, and so does this one as far as it may."""
    desk = fresh(p12030=35, **PLACES)
    desk.send(parameters(**kind))
    desk.run(1.0)
    assert (mm(desk)[0], [n for n in said(desk) if n != 2000]) == (0.0, [2103])
    assert told(desk, 12_182, 12_183, 12_191, 12_192) == [0] * 4
    desk.send(parameters(p8683=1, p8508=1, p12132=0, p12133=0))
    desk.send(parameters(p12112=35, p12312=40))
    desk.finish()
    assert mm(desk)[:2] == (35.0, 40.0)


@shows("bwo900-2.3-7", "bwo900-8.7-21")
def test_without_a_reference_point_there_are_no_places() -> None:
    """Of that axis alone; by how much it moves, it may."""
    desk = fresh(referenced=False, **PLACES)
    for kind in ({"p12112": 40.0}, {"p12132": EMERGENCY}, {"p12132": BASE}, {"p12133": FIXED}):
        desk.send(parameters(**kind))
        desk.finish()
        assert mm(desk)[0] == 0.0
        assert {*said(desk)} - {2000} in ({1008}, {2110})
        desk.send(parameters(p8683=1, p8508=1, p12132=0, p12133=0))
    told_before = len(said(desk))
    desk.send(parameters(p12330=1))
    desk.finish()
    desk.send(parameters(p12312=15, p12111=5))
    desk.finish()
    assert (mm(desk)[:2], len(said(desk))) == ((5.0, 15.0), told_before)


@shows("bwo900-8.7-21")
def test_beside_a_program_they_are_refused_and_behind_one_they_go() -> None:
    """M1321, and the program's path is the same; Start waits for a move that is under way."""
    desk = fresh("P1|N10 G1 F3000 X30|N20 Y20|N30 M30", p12122=1200, p12036=40)
    start(desk)
    desk.run(0.3)
    for kind in ({"p12312": 5.0}, {"p12133": FIXED}):
        desk.send(parameters(**kind))
        desk.run(0.01)
    desk.finish()
    assert (mm(desk), said(desk), told(desk, 12_392, 12_183)) == ((30.0, 20.0, 0.0), [1321, 1321], [0, 0])
    desk.send(parameters(p8683=1, p8508=1, p12133=0))
    desk.send(parameters(p8800=1, p8683=2))
    desk.send(parameters(p12112=60))
    desk.run(0.2)
    desk.send(parameters(p8684=1))
    desk.finish()
    assert desk.steps.path()[:, 0].max() == desk.steps.path()[-1, 0] + 30_000, "X was at 60 before it came to 30"
    assert (mm(desk), len(said(desk))) == ((30.0, 20.0, 0.0), 2)


@shows("bwo900-8.7-22")
@pytest.mark.parametrize(
    ("kind", "contact", "off", "on"),
    [
        *((kind, "estop", "pressed", "released") for kind in KINDS),
        *((kind, "limit_x2", False, "free") for kind in KINDS[-2:]),
    ],
)
def test_an_emergency_stop_in_the_middle(kind: dict[str, float], contact: str, off: str | bool, on: str) -> None:
    """Drives off, or the switch of the axis: it ends there; nothing goes on by itself, the next write is whole."""
    desk = fresh(**PLACES)
    desk.send(parameters(**kind))
    desk.run(0.3)
    desk.set(contact, off)
    desk.run(0.5)
    held = mm(desk)[0]
    assert 10.0 < held < 40.0
    assert told(desk, 12_182, 12_183, 12_191, 12_192) == [0] * 4
    desk.set(contact, on)
    desk.run(0.5)
    desk.send(parameters(p8683=1, p8508=1))
    desk.run(1.0)
    assert mm(desk)[0] == held
    desk.send(parameters(p12132=0, p12133=0))
    desk.send(parameters(p12112=40))
    desk.finish()
    assert (mm(desk)[0], told(desk, 12_192)) == (40.0, [1])


@shows("bwo900-8.7-23")
@pytest.mark.parametrize("lock", [{"p12137": 1}, {"p8702": 1}, {"p8701": 0}])
def test_a_lock_in_the_middle(lock: dict[str, float]) -> None:
    """The axis stands as long as it is on, without its place; the other direction is free where one is locked."""
    desk = fresh(p12122=1200)
    desk.send(parameters(p12112=40))
    desk.run(1.0)
    desk.send(parameters(**lock))
    desk.run(1.0)
    held = mm(desk)[0]
    desk.run(1.0)
    assert (mm(desk)[0], told(desk, 12_192)) == (held, [0])
    assert 19.0 < held < 21.0
    if "p12137" in lock:
        desk.send(parameters(p12112=10))
        desk.finish()
        assert mm(desk)[0] == 10.0


def test_a_place_is_reached_from_a_saved_middle_and_forgotten_with_the_mains() -> None:
    twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=(6, 6, 6), seed=2)
    twin.write(parameters(p12122=1200, p12037=20, p12323=1200, p12237=15) + REFERENCE)
    twin.run_until_idle(60.0)
    twin.write(parameters(p12112=40, p12333=TO_AND_FRO))
    twin.run(1.0)
    saved = twin.save()
    twin.run(2.1)
    end = tuple(twin.machine_position_mm)
    assert end[0] == pytest.approx(45.0, abs=0.01)
    twin.restore(saved)
    assert twin.machine_position_mm[0] < 30.0
    twin.run(2.1)
    assert tuple(twin.machine_position_mm) == end
    twin.restore(saved)
    for state in ("off", "on"):
        twin.set_input("power", state)
        twin.run(3.0)
    held = tuple(twin.machine_position_mm)
    twin.run(3.0)
    assert tuple(twin.machine_position_mm) == held
    assert held[0] < 30.0


# 2.3.2


def keys(desk: Desk, *held: tuple[int, float]) -> None:
    """HAND - (2) and HAND + (1), each for so many seconds."""
    for key, time_s in held:
        desk.send(parameters(p8752=key))
        desk.run(time_s)
        desk.send(parameters(p8752=0))
        desk.finish()


def by_hand(axis: int, **before: float) -> Desk:
    """A control in HAND, continuous, of that axis, at 50 mm/s, that knows no place."""
    desk = fresh(referenced=False, p8683=1, p8750=1, p8751=axis + 1, p8755=3000, **before)
    desk.controller.use_drives(Pulsing(desk))
    return desk


@shows("bwo900-2.3-6")
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(("logic", "at"), [(0x00010001, 1_766), (0x00000001, 9)])
def test_a_reference_point_by_hand_is_where_its_marks_say(axis: int, logic: int, at: int) -> None:
    """- to the limit switch, + until the axis is known. The switch opens 9 increments from its edge, the zero pulse
    comes at 1766: 3 mm of P12040 there."""
    desk = by_hand(axis, **{f"p{12_044 + 200 * axis}": logic, f"p{12_040 + 200 * axis}": 3.0})
    keys(desk, (2, 3.0), (1, 1.5))
    assert [one & 1 for one in told(desk, 12_180, 12_380, 12_580)] == [int(axis == n) for n in range(3)]
    seen = 0.0011 if logic >> 16 else 0.1  # a pulse is latched, a switch is seen at a set point: 2 ms of 50 mm/s
    beyond = int(desk.carriage[axis]) - at
    assert beyond > 0
    assert value(desk, 12_150 + 200 * axis) == pytest.approx(3.0 + beyond / 1000.0, abs=seen)
    desk.send(parameters(p8683=1, **{f"p{12_112 + 200 * axis}": 3.0}))
    desk.finish()
    assert int(desk.carriage[axis]) == pytest.approx(at, abs=1000 * seen)


@shows("bwo900-2.3-6")
@pytest.mark.parametrize("logic", [0x00010000, 0x00010100])
def test_a_sense_that_is_not_released_takes_none(logic: int) -> None:
    """P12044, byte 2 releases -, in which an axis never leaves this switch."""
    desk = by_hand(0, p12044=logic)
    keys(desk, (2, 3.0), (1, 1.5))
    assert told(desk, 12_180)[0] & 1 == 0
    assert desk.carriage[0] > 10_000


@shows("bwo900-2.3-6")
def test_an_emergency_stop_between_switch_and_mark() -> None:
    """There is no point, until the two keys are pressed again; with all three axes known a program begins."""
    desk = by_hand(0, p12044=0x00010001)
    keys(desk, (2, 3.0))
    desk.send(parameters(p8683=1, p8508=1, p8755=300, p8752=1))
    desk.run(0.8)
    desk.set("estop", "pressed")
    desk.run(0.5)
    desk.set("estop", "released")
    desk.send(parameters(p8683=1, p8508=1, p8752=0, p8755=3000))
    assert 0 < desk.carriage[0] < 1_766
    assert told(desk, 12_180)[0] & 1 == 0
    keys(desk, (2, 1.0), (1, 1.5))
    assert told(desk, 12_180) == [1]
    for axis in (1, 2):
        desk.send(parameters(p8683=1, p8508=1, p8751=axis + 1))
        keys(desk, (2, 3.0), (1, 1.5))
    assert (told(desk, 12_380, 12_580), value(desk, 8_579)) == ([1, 1], 1.0)


# GMI99: p4


MASK = "OB 1\nL KF 5\nL KF 6\nSPA FB 254\nT MW 50\nBE\n"
"""MW50: the axes that have left the interpolation (FB 254.6.5)."""
TO_5000 = command(0x81, 5_000)
FOLLOWING = "OB 1\nU M 40.0\nSPB =ON\nL KF 0\nL KF 30\nSPA FB 254\nBEA\nON: L KF 1\nL KF 30\nSPA FB 254\nBE\n"
"""FB 254.30, by flag M40.0."""


def start_of(axis: int, program: int) -> str:
    return command("p", 4, program, 256 * axis + 1)


def turn(axis: int, rev_min: int) -> str:
    return command("p", 4, rev_min, 256 * axis + 2)


def wait_for(axis: int) -> str:
    return command("p", 4, 0, 256 * axis)


def recorded(desk: CardDesk, *programs: tuple[str, ...]) -> CardDesk:
    """Programs 0 on."""
    for number, frames in enumerate(programs):
        sent = (command("p", 3, 100, number), *frames, command("p", 3, 101, number))
        assert desk.tell(*sent) == [OK] * len(sent)
    desk.finish()
    return desk


Z_TO_20000 = (command("f", 8_000), command(0x84, 20_000))
"""2.66 s: 20000 / 8000 + 8000 / 50000."""
Y_TO_9000 = (command("f", 9_000), command(0x82, 9_000))
"""1.18 s."""


@shows("gmi99-3.1.1-68", "gmi99-6.1.3-5")
def test_axes_run_programs_of_their_own_beside_the_path() -> None:
    """X takes 2.2 s along the path, Y 1.18 s, Z 2.66 s: all begin at once, and each is told as long as it is out."""
    desk = recorded(running(MASK), Z_TO_20000, Y_TO_9000)
    assert desk.tell(start_of(2, 0), start_of(1, 1), TO_20000) == [OK] * 3
    begin_ns = desk.time_ns
    for ms, mask in ((100, 6), (1_300, 4), (2_600, 4), (2_720, 0)):
        desk.at_ms(begin_ns, ms)
        assert word(desk, 50) & 0xFF == mask, ms
    ends = [int(desk.steps.t_ns[np.flatnonzero(desk.steps.delta[:, axis])[-1]]) - begin_ns for axis in range(3)]
    assert [end / 1e9 for end in ends] == pytest.approx([2.2, 1.18, 2.66], abs=0.017)
    assert desk.counts[:3] == (20_000, 9_000, 20_000)


@shows("gmi99-3.1.1-68")
@pytest.mark.parametrize("waits", [True, False])
def test_a_command_behind_the_wait_comes_when_the_axis_has_ended(waits: bool) -> None:
    """Waiting for Y, which is not out, is no waiting; Z is coupled again and moved by the path."""
    desk = recorded(prepared(), Z_TO_20000)
    desk.tell(start_of(2, 0), wait_for(2 if waits else 1), TO_20000)
    desk.run(2.5)
    assert desk.counts[0] == (0 if waits else 20_000)
    desk.finish()
    assert desk.counts[:3] == (20_000, 0, 20_000)
    desk.tell(command(0x87, 0, 500, 0))
    desk.finish()
    assert desk.counts[:3] == (0, 500, 0)


@shows("gmi99-3.1.1-68")
def test_stop_flag_abort_and_emergency_stop_in_the_middle() -> None:
    """The stop flag holds axis and path, and both go on; what ends a motion ends both for good."""
    for ends in (None, "abort", "estop"):
        desk = recorded(running(MASK), Z_TO_20000)
        desk.tell(start_of(2, 0), TO_20000)
        desk.run(0.5)
        if ends is None:
            desk.tell(command("p", 11, 0, 1))
        elif ends == "abort":
            desk.tell(ABORT)
        else:
            desk.set("estop", "pressed")
        desk.run(0.3)
        held = desk.carriage.tolist()
        assert 3_300 < desk.counts[2] < 4_100
        desk.run(0.5)
        assert desk.carriage.tolist() == held
        assert word(desk, 50) & 0xFF == (4 if ends is None else 0)
        if ends is None:
            desk.tell(command("p", 11, 0, 0))
        elif ends == "estop":
            desk.set("estop", "released")
            desk.tell(Q)
        desk.run(0.2)
        if ends is None:
            desk.run(2.3)
            assert desk.counts[:3] == (20_000, 0, 20_000)
        else:
            assert desk.carriage.tolist() == held
        desk.tell(command(0x85, 1_000, 1_000))
        desk.finish()
        assert desk.counts[:3] == (1_000, 0, 1_000)


@shows("gmi99-3.1.1-68", "gmi99-6.1.3-5")
@pytest.mark.parametrize("sense", [1, -1])
def test_an_axis_turns_until_its_speed_is_0(sense: int) -> None:
    """120 1/min of 1000 increments: 2000 a second, whatever the path does meanwhile; M4 is M3 backwards."""
    desk = running(MASK)
    desk.tell(command("N", 1000, 40, 2), turn(2, sense * 120))
    desk.run(0.1)
    before = desk.counts[2]
    desk.tell(TO_10000)
    desk.run(0.5)
    assert desk.counts[2] - before == pytest.approx(sense * 1_000, abs=9)
    assert word(desk, 50) & 0xFF == 4
    desk.tell(turn(2, 0), wait_for(2))
    desk.finish()
    desk.run(0.02)
    assert (desk.counts[0], word(desk, 50) & 0xFF) == (10_000, 0)
    desk.tell(command(0x84, 100))
    desk.finish()
    assert desk.counts[2] == 100


# GMI99, 6.1.4


def following(rev_min: int, feed: int) -> CardDesk:
    """Z, of 1000 increments a revolution, follows the path: FB 254.30.1, f, and the speed."""
    desk = running(FOLLOWING)
    desk.tell(command("N", 1000, 40, 2), command("p", 11, 40, 1))
    desk.run(0.02)
    desk.tell(command("f", feed), turn(2, rev_min))
    desk.run(0.1)
    return desk


def made(desk: CardDesk, *frames: str) -> tuple[int, int]:
    """Increments of X and Z until the path is made (5000 increments at 5000 Hz: 1.1 s)."""
    before = desk.counts
    assert desk.tell(*frames) == [OK] * len(frames)
    desk.run(1.2)
    return desk.counts[0] - before[0], desk.counts[2] - before[2]


@shows("gmi99-1.4-1")
def test_a_spindle_makes_the_same_turns_on_the_same_path() -> None:
    """120 1/min at f 10000: 2000 increments to 10000 of the path, with its ramps, at any later feed; a new speed gives
    another proportion, to the feed that is set then."""
    desk = following(120, 10_000)
    assert made(desk, TO_5000) == (5_000, pytest.approx(1_000, abs=6))
    assert made(desk, command("f", 5_000), TO_0) == (-5_000, pytest.approx(1_000, abs=6))
    assert made(desk) == (0, 0), "it stands while the path does"
    assert made(desk, turn(2, 240), TO_5000) == (5_000, pytest.approx(4_000, abs=20)), "4000 to 5000"
    assert made(desk, command("f", 10_000), "10 E0 09 32 1B 16", TO_0) == (-5_000, pytest.approx(4_000, abs=20))


@shows("gmi99-1.4-1")
def test_a_spindle_is_held_with_its_path_and_let_go_by_fb_254_30_0() -> None:
    desk = following(120, 10_000)
    desk.tell(TO_10000)
    desk.run(0.5)
    desk.tell(command("p", 11, 0, 1))
    desk.run(0.25)
    held = desk.counts
    desk.run(0.25)
    assert desk.counts == held
    assert held[2] == pytest.approx(held[0] / 5, abs=6)
    desk.tell(command("p", 11, 0, 0))
    desk.run(1.0)
    assert (desk.counts[0], desk.counts[2]) == (10_000, pytest.approx(2_000, abs=8))
    desk.tell(command("p", 11, 40, 0))
    desk.run(0.1)
    desk.tell(turn(2, 60))
    desk.run(0.2)
    before = desk.counts
    desk.run(0.3)
    assert (desk.counts[0], desk.counts[2] - before[2]) == (before[0], pytest.approx(300, abs=5))
    desk.tell(command("p", 11, 40, 1))
    desk.run(0.2)
    assert desk.counts[2] - before[2] == pytest.approx(500, abs=9), "until the next speed"
