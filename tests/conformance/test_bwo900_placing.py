"""BWO 900: moves of single axes that the PLC asks for (manual 8.7, P12110 to P12112, P12131 to P12133), 1 um an
increment: the axes stand at 0, and nothing runs but what is asked for."""

from __future__ import annotations

import pytest
from conformance.bwo900_desk import file, fresh, mm, parameters, put_out, said, start, value
from conformance.rows import shows

from isel_twin.testing import Desk

BYTE_2, BYTE_3, BYTE_4 = 1 << 8, 1 << 16, 1 << 24


def delete(desk: Desk, number: int) -> None:
    desk.send(file("D", f"K1:P {number}: --"))


# P12110


@shows("bwo900-8.7-21")
def test_a_position_is_set_and_shown_as_it_was_when_that_is_deleted() -> None:
    """P12151, P12154: set and shown position; P12150, the mechanical one, stays."""
    desk = fresh("P1|N10 G0 X10|N20 M30")
    start(desk)
    desk.finish()
    desk.send(parameters(p8683=1, p12110=250))
    assert [value(desk, n) for n in (12_150, 12_151, 12_154)] == [10.0, 250.0, 250.0]
    delete(desk, 12_110)
    assert [value(desk, n) for n in (12_150, 12_151, 12_154)] == [10.0, 10.0, 10.0]


@shows("bwo900-8.7-21")
def test_a_set_position_moves_nothing_and_programs_count_from_it() -> None:
    desk = fresh("P1|N10 G0 X260|N20 M30")
    desk.send(parameters(p12110=250))
    before = desk.ticks
    desk.run(1.0)
    assert desk.ticks == before
    start(desk)
    desk.finish()
    assert (mm(desk)[0], value(desk, 12_150)) == (260.0, 10.0)


@shows("bwo900-8.7-21")
def test_software_limits_stay_where_the_machine_has_them() -> None:
    """P12030 = 20: 10 mm are left when 10 is set to be 250."""
    desk = fresh(p12030=20)
    desk.send(parameters(p12112=10))
    desk.finish()
    desk.send(parameters(p12110=250, p12112=260.001))
    assert said(desk) == [2103]
    desk.send(parameters(p12112=260))
    desk.finish()
    assert (mm(desk)[0], value(desk, 12_150)) == (260.0, 20.0)


@shows("bwo900-8.7-21")
def test_a_reference_run_ends_it() -> None:
    desk = fresh()
    desk.send(parameters(p12110=250))
    desk.send(parameters(p12130=1))
    desk.finish()
    assert (value(desk, 12_150), value(desk, 12_151)) == (0.0, 0.0)


@shows("bwo900-8.7-21")
def test_no_position_is_set_while_axes_move() -> None:
    desk = fresh()
    desk.send(parameters(p12111=50))
    desk.run(0.5)
    desk.send(parameters(p12110=250))
    assert said(desk) == [1321]
    desk.finish()
    assert mm(desk)[0] == 50.0


# P12111, P12112


@shows("bwo900-8.7-21")
@pytest.mark.parametrize(
    ("number", "speed", "reached", "ends"), [(12_111, 12_121, 12_191, 35.0), (12_112, 12_122, 12_192, 25.0)]
)
def test_relative_and_absolute(number: int, speed: int, reached: int, ends: float) -> None:
    """From 10 by 25, or to 25: begins when written, at 600 mm/min, and tells when it is there."""
    desk = fresh(**{f"p{speed}": 600})
    desk.send(parameters(p12111=10))
    desk.finish()
    desk.send(parameters(**{f"p{number}": 25}))
    desk.run(1.0)
    assert value(desk, 12_170) == pytest.approx(600.0, abs=1.0)
    assert value(desk, reached) == 0.0
    desk.finish()
    assert (mm(desk), value(desk, reached)) == ((ends, 0.0, 0.0), 1.0)
    delete(desk, number)
    assert value(desk, reached) == 0.0


@shows("bwo900-8.7-21")
@pytest.mark.parametrize(("number", "speed"), [(12_111, 12_121), (12_112, 12_122)])
@pytest.mark.parametrize("given", [0.0, None])
def test_without_a_speed_that_of_the_axis(number: int, speed: int, given: float | None) -> None:
    desk = fresh(p12004=1_200, **({} if given is None else {f"p{speed}": given}))
    desk.send(parameters(**{f"p{number}": 50}))
    desk.run(1.0)
    assert value(desk, 12_170) == pytest.approx(1_200.0, abs=1.0)


@shows("bwo900-8.7-21")
@pytest.mark.parametrize("number", [12_111, 12_112])
def test_deleting_breaks_it_off(number: int) -> None:
    desk = fresh(p12004=1_200)
    desk.send(parameters(**{f"p{number}": 50}))
    desk.run(1.0)
    delete(desk, number)
    desk.finish()
    here = mm(desk)[0]
    assert 10.0 < here < 30.0
    assert (value(desk, number + 80), said(desk)) == (0.0, [])
    desk.run(1.0)
    assert mm(desk)[0] == here


@shows("bwo900-8.7-21")
@pytest.mark.parametrize(("number", "axis", "channel"), [(12_111, 12_126, 8_866), (12_112, 12_127, 8_867)])
def test_overrides(number: int, axis: int, channel: int) -> None:
    """Override 7 is 50 %, 6 is 10 % (8.6); the axis' own stands above the channel's; without either it is the first."""

    def speed(**before: float) -> float:
        desk = fresh(p12004=1_200, **before)
        desk.send(parameters(**{f"p{number}": 100}))
        desk.run(1.5)
        return value(desk, 12_170)

    found = [
        speed(**each) for each in (
            {}, {"p11310": 20}, {f"p{channel}": 7}, {f"p{axis}": 6}, {f"p{channel}": 7, f"p{axis}": 6}
        )
    ]  # fmt: skip
    assert found == pytest.approx([1_200.0, 240.0, 600.0, 120.0, 120.0], abs=1.0)


@shows("bwo900-8.7-21")
def test_an_override_of_0_holds_and_the_rest_of_the_way_is_made() -> None:
    desk = fresh(p12004=1_200)
    desk.send(parameters(p12112=30))
    desk.run(0.8)
    desk.send(parameters(p11310=0))
    desk.run(1.0)
    held = mm(desk)[0]
    desk.run(1.0)
    assert (mm(desk)[0], value(desk, 12_192)) == (held, 0.0)
    desk.send(parameters(p11310=100))
    desk.finish()
    assert (mm(desk)[0], value(desk, 12_192)) == (30.0, 1.0)


@shows("bwo900-8.7-21")
def test_axes_move_beside_each_other() -> None:
    """Y (200 further) is asked for while X moves; each has its own speed."""
    desk = fresh(p12121=600, p12321=300)
    desk.send(parameters(p12111=20))
    desk.run(1.0)
    desk.send(parameters(p12311=10))
    desk.run(0.5)
    assert [value(desk, n) for n in (12_170, 12_370)] == pytest.approx([600.0, 300.0], abs=1.0)
    desk.finish()
    assert (mm(desk), value(desk, 12_191), value(desk, 12_391)) == ((20.0, 10.0, 0.0), 1.0, 1.0)


@shows("bwo900-8.7-21")
def test_a_new_target_takes_the_place_of_the_old_one() -> None:
    desk = fresh(p12004=1_200)
    desk.send(parameters(p12112=50))
    desk.run(1.0)
    desk.send(parameters(p12112=3))
    desk.finish()
    assert (mm(desk)[0], value(desk, 12_192), said(desk)) == (3.0, 1.0, [])


# P12131


@shows("bwo900-8.7-22")
@pytest.mark.parametrize(("byte", "sense"), [(1, 1), (BYTE_2, -1)])
def test_a_measuring_move_goes_to_the_probe(byte: int, sense: int) -> None:
    """At P8755; P12181 tells that the place is taken, P12153 where."""
    desk = fresh(p8755=300)
    desk.send(parameters(p12111=40))
    desk.finish()
    desk.send(parameters(p12131=byte))
    desk.run(2.0)
    assert value(desk, 12_170) == pytest.approx(sense * 300.0, abs=1.0)
    touched = mm(desk)[0]
    desk.set("probe", "touched")
    assert int(value(desk, 12_181)) & 0xFF == 1
    desk.finish()
    assert value(desk, 12_153) == pytest.approx(touched, abs=0.02)
    assert 0.0 <= sense * (mm(desk)[0] - touched) < 0.5
    assert said(desk) == []


@shows("bwo900-8.7-22")
def test_a_measuring_move_is_stopped_by_its_byte() -> None:
    desk = fresh(p8755=300)
    desk.send(parameters(p12131=1))
    desk.run(1.0)
    desk.send(parameters(p12131=0))
    desk.finish()
    here = mm(desk)[0]
    assert 3.0 < here < 7.0
    assert int(value(desk, 12_181)) & 0xFF == 0
    desk.set("probe", "touched")
    desk.run(0.5)
    assert (mm(desk)[0], int(value(desk, 12_181)) & 0xFF) == (here, 0)


@shows("bwo900-8.7-22")
def test_the_place_is_taken_at_the_next_edge_or_at_once() -> None:
    """Byte 3 releases the probe, byte 4 takes the place now; the axis stands meanwhile."""
    desk = fresh("P1|N10 G0 X10|N20 M30")
    start(desk)
    desk.finish()
    desk.set("probe", "touched")
    desk.set("probe", "free")
    desk.send(parameters(p8683=1, p12131=BYTE_3))
    assert 2_153 not in put_out(desk)
    desk.set("probe", "touched")
    assert (value(desk, 12_153), int(value(desk, 12_181)) & 0xFF) == (10.0, 1)
    desk.send(parameters(p12111=2))
    desk.finish()
    desk.send(parameters(p12131=BYTE_4))
    assert (value(desk, 12_153), mm(desk)[0]) == (12.0, 12.0)


# P8717, P8891


@shows("bwo900-6.1-49")
@pytest.mark.parametrize(("released", "seen"), [(1, [0.0, 10.0, 10.0]), (2, [0.0, 10.0, 15.0]), (0, [0.0, 0.0, 0.0])])
def test_positions_at_an_edge_of_the_probe(released: int, seen: list[float]) -> None:
    """The probe is touched at 10 and at 15 mm, while a key or the PLC moves the axis."""
    desk = fresh("P1|N10 G0 X10|N20 M30", p12153=0)
    start(desk)
    desk.finish()
    desk.send(parameters(p8683=1, p8717=released))
    found = [value(desk, 12_153)]
    if released:
        assert value(desk, 8_696) == -1.0
    for _ in range(2):
        desk.set("probe", "touched")
        found.append(value(desk, 12_153))
        desk.set("probe", "free")
        desk.send(parameters(p12111=5))
        desk.finish()
    assert found == seen
    if released:
        assert value(desk, 8_696) == 20.0  # the last block


@shows("bwo900-8.5-94")
@pytest.mark.parametrize(("mask", "places"), [
    (0, (10.0, 0.0, 5.0)), (1, (0.0, 0.0, 5.0)), (2, (10.0, 0.0, 5.0)), (3, (0.0, 0.0, 5.0)), (4, (0.0, 0.0, 0.0)),
])  # fmt: skip
def test_a_block_that_would_move_a_locked_axis_waits(mask: int, places: tuple[float, ...]) -> None:
    desk = fresh("P1|N10 G1 F1200 Z5|N20 X10|N30 M30", p8891=mask)
    start(desk)
    desk.run(4.0)
    assert mm(desk) == places
    desk.send(parameters(p8891=0))
    desk.finish()
    assert (mm(desk), said(desk)) == ((10.0, 0.0, 5.0), [])


# P12132, P12133


@shows("bwo900-8.7-22")
@pytest.mark.parametrize(
    ("number", "byte", "place", "ends", "reached"),
    [
        (12_132, 1, 12_032, 4.0, (12_182, 1)),
        (12_132, BYTE_2, 12_033, 14.0, (12_182, 1)),
        (12_132, BYTE_3, 12_034, 4.0, (12_182, BYTE_3)),
        (12_132, BYTE_4, 12_035, 14.0, (12_182, BYTE_3)),
        (12_133, 1, 12_036, 4.0, (12_183, 1)),
    ],
)
def test_positions_in_parameters(number: int, byte: int, place: int, ends: float, reached: tuple[int, int]) -> None:
    """From 10 to 4, or 4 further; byte 0 clears what tells that it was reached."""
    desk = fresh(**{f"p{place}": 4})
    desk.send(parameters(p12111=10))
    desk.finish()
    desk.send(parameters(**{f"p{number}": byte}))
    desk.finish()
    assert (mm(desk), value(desk, reached[0])) == ((ends, 0.0, 0.0), reached[1])
    desk.send(parameters(**{f"p{number}": 0}))
    assert (value(desk, reached[0]), mm(desk)[0]) == (0.0, ends)


@shows("bwo900-8.7-22")
@pytest.mark.parametrize(("number", "byte", "place"), [
    (12_132, 1, 12_032), (12_132, BYTE_2, 12_033), (12_132, BYTE_3, 12_034), (12_132, BYTE_4, 12_035),
    (12_133, 1, 12_036), (12_133, BYTE_2, 12_037),
])  # fmt: skip
def test_their_speeds_and_overrides(number: int, byte: int, place: int) -> None:
    """Emergency positions at the axis' highest speed and 100 %, base positions with P12128, others at P12123, too."""
    desk = fresh(p12004=1_200, p12123=600, p12128=7, p11310=20, **{f"p{place}": 50})
    desk.send(parameters(**{f"p{number}": byte}))
    desk.run(1.5)
    wanted = 300.0 if number == 12_133 else 1_200.0 if byte in (1, BYTE_2) else 600.0
    assert value(desk, 12_170) == pytest.approx(wanted, abs=1.0)


@shows("bwo900-8.7-22")
def test_an_emergency_position_stops_the_program_and_says_m2000() -> None:
    """Y makes a path; X is sent to 5: Y stops, then X goes."""
    desk = fresh("P1|N10 G1 F600 Y50|N20 M30", p12032=5)
    start(desk)
    desk.run(2.0)
    desk.send(parameters(p12132=1))
    desk.finish()
    x, y, _ = mm(desk)
    assert (x, value(desk, 12_182), value(desk, 8_687), said(desk)) == (5.0, 1.0, 0.0, [2000])
    assert 10.0 < y < 30.0


@shows("bwo900-8.7-22")
def test_other_positions_are_refused_while_a_program_runs() -> None:
    """The program has all axes of the channel (bwo900/74)."""
    desk = fresh("P1|N10 G1 F600 Y20|N20 M30", p12034=5, p12036=5)
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p12111=5, p12112=5, p12131=1, p12132=BYTE_3, p12133=1))
    desk.finish()
    assert (mm(desk), said(desk)) == ((0.0, 20.0, 0.0), [1321] * 5)


@shows("bwo900-8.7-22")
def test_to_and_fro() -> None:
    """From 0 by 6 mm at 100 mm/s, 2 s at the start and 1 s at the turn; byte 2 = 0 ends it."""
    desk = fresh(p12037=6, p12038=2, p12039=1)
    desk.send(parameters(p12133=BYTE_2))
    seen = []
    for _ in range(80):
        desk.run(0.1)
        seen.append((mm(desk)[0], int(value(desk, 12_183))))
    assert {each for each in seen if each[0] in (0.0, 6.0)} == {(0.0, 0), (6.0, BYTE_2)}
    rests = [sum(place == at for place, _ in seen) * 0.1 for at in (6.0, 0.0)]
    first = next(k for k, (place, _) in enumerate(seen) if place == 6.0)
    one_turn = [place for place, _ in seen[first : first + 36]]  # 1 s, back, 2 s, forth
    assert one_turn.count(6.0) == pytest.approx(10, abs=1)
    assert one_turn.count(0.0) == pytest.approx(20, abs=1)
    assert min(rests) > 0.0
    desk.send(parameters(p12133=0))
    desk.finish()
    here = mm(desk)[0]
    desk.run(4.0)
    assert (mm(desk)[0], value(desk, 12_183)) == (here, 0.0)


# what else may happen to them


@shows("bwo900-8.7-21", "bwo900-8.7-22")
@pytest.mark.parametrize("asked", [{"p12112": 30}, {"p12133": 1}])
def test_places_of_the_machine_want_a_reference_point(asked: dict[str, float]) -> None:
    desk = fresh(referenced=False, p12036=30)
    desk.send(parameters(**asked))
    desk.run(2.0)
    assert (mm(desk)[0], said(desk)) == (0.0, [1008])


@shows("bwo900-8.7-21")
@pytest.mark.parametrize(("way", "number"), [(41.0, 2103), (-11.0, 2104)])
def test_software_limits_refuse_a_move(way: float, number: int) -> None:
    desk = fresh(p12030=40, p12031=-10)
    desk.send(parameters(p12111=way))
    desk.run(1.0)
    assert (mm(desk)[0], said(desk)) == (0.0, [number])


@pytest.mark.parametrize("stop", [{"p8684": 0}, {"p8705": 1}, {"p8683": 2}, {"p8702": 1}])
def test_stop_abort_mode_and_lock_brake_them(stop: dict[str, float]) -> None:
    desk = fresh(p12004=1_200, p12204=1_200)
    desk.send(parameters(p12111=50, p12311=50))
    desk.run(1.0)
    desk.send(parameters(**stop))
    desk.finish()
    here = mm(desk)
    assert (value(desk, 12_191), value(desk, 12_391)) == (0.0, 0.0)
    assert 10.0 < here[0] == here[1] < 30.0
    desk.run(1.0)
    assert mm(desk) == here


def test_an_emergency_stop_ends_them() -> None:
    desk = fresh(p12037=20)
    desk.send(parameters(p12133=BYTE_2, p12311=50))
    desk.run(0.5)
    desk.set("estop", "pressed")
    desk.run(1.0)
    here = mm(desk)
    desk.set("estop", "released")
    desk.run(3.0)
    assert (mm(desk), said(desk)) == (here, [3001])


def test_a_locked_direction_holds_one() -> None:
    desk = fresh(p12004=1_200)
    desk.send(parameters(p12111=30))
    desk.run(0.5)
    desk.send(parameters(p12137=1))
    desk.run(2.0)
    assert mm(desk)[0] < 20.0
    desk.send(parameters(p12137=0))
    desk.finish()
    assert (mm(desk)[0], value(desk, 12_191)) == (30.0, 1.0)


def test_keys_wait_for_them_and_start_does() -> None:
    """In AUTO the program begins once the axis stands; in HAND a key and a reference run are refused."""
    desk = fresh("P1|N10 G0 X5|N20 M30", p12004=1_200)
    desk.send(parameters(p12111=30))
    desk.run(0.2)
    desk.send(parameters(p8752=1, p12130=1))
    assert said(desk) == [1321, 1321]
    desk.finish()
    desk.send(parameters(p8683=2, p12111=10))
    desk.run(0.2)
    desk.send(parameters(p8800=1, p8684=1))
    desk.finish()
    assert (mm(desk)[0], value(desk, 12_191)) == (5.0, 1.0)


def test_what_was_asked_for_is_forgotten_at_power_off() -> None:
    desk = fresh()
    desk.send(parameters(p12133=1, p12036=3, p12111=5))
    desk.finish()
    again = Desk.of("bwo900", flash=desk.flash)
    again.run(2.0)
    told = put_out(again)
    assert (mm(again)[0], told.get(2_133), told.get(2_183), told.get(2_191), said(again)) == (0.0, None, None, None, [])


def test_a_struck_switch_ends_a_move_and_refuses_the_next_one_onto_it() -> None:
    """The switch is just below the reference point; the axis brakes behind it."""
    desk = fresh(p12004=600)
    desk.send(parameters(p12111=-10))
    desk.finish()
    there = mm(desk)[0]
    assert (-4.0 < there < 0.0, value(desk, 12_191), said(desk)) == (True, 0.0, [2102])
    desk.send(parameters(p12111=-0.1))
    desk.run(0.5)
    assert (mm(desk)[0], said(desk)) == (there, [2102, 2102])
    desk.send(parameters(p12112=5))
    desk.finish()
    assert (mm(desk)[0], value(desk, 12_192)) == (5.0, 1.0)


def test_abort_drops_a_move_that_waits_for_the_one_before() -> None:
    desk = fresh(p12004=1_200)
    desk.send(parameters(p12111=50))
    desk.run(1.0)
    desk.send(parameters(p12112=-1, p8705=1))
    desk.finish()
    desk.run(1.0)
    assert mm(desk)[0] > 10.0


@pytest.mark.parametrize("place", [12_036, 12_032])
def test_a_place_is_asked_for_again_when_its_byte_was_0(place: int) -> None:
    number = 12_133 if place == 12_036 else 12_132
    desk = fresh(**{f"p{place}": 10})
    for wanted in (1, 0, 1):
        desk.send(parameters(**{f"p{number}": wanted}))
        desk.finish()
        assert value(desk, number + 50) == wanted
        desk.send(parameters(p12111=3))
        desk.finish()
    assert mm(desk)[0] == 13.0
