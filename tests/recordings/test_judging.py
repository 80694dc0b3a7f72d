"""What counts as a difference of two sessions, by sessions that differ in one known thing."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace

import pytest

from isel_twin.firmware.gmi99.link import long_record
from isel_twin.language import create_language, needed
from isel_twin.recordings.compare import Exchange, matched, paired
from isel_twin.recordings.judging import Comparison, Kind, Limits, _chance, judge

MS = 1_000_000
LANGUAGE = needed(create_language("imc-s8"), "imc-s8")


def position(*counts: int) -> bytes:
    """Manual 2.2.21: the code, then 24 bits an axis."""
    return b"0" + b"".join(b"%06X" % (count & 0xFFFFFF) for count in counts)


def session(*told: tuple[str, float, bytes], delays: random.Random | None = None) -> list[Exchange]:
    """Commands with their durations in ms and replies; a control byte as its number. delays: of a busy computer."""
    pieces, now_ns = [], 0
    language = needed(create_language("imc-s8"), "imc-s8")
    for text, ms, reply in told:
        sent = bytes([int(text)]) if text.isdigit() else text.encode() + b"\r"
        pieces.append((now_ns, sent, True, 0))
        took_ns = round(ms * MS) + (round(delays.expovariate(1 / (2 * MS))) if delays else 0)
        if reply:
            pieces.append((now_ns + took_ns, reply, False, 0))
        now_ns += (took_ns if reply or text.isdigit() else round(ms * MS)) + 50 * MS * bool(reply)
    return paired(pieces, language)


QUICK = tuple((f"@0B{n % 4},1", 5.0, b"0") for n in range(8))
MOVES = tuple((f"@0A{n + 1}00,900,0,30,0,30,0,30", 400.0 + 10 * n, b"0") for n in range(8))


def longer(moves: tuple[tuple[str, float, bytes], ...], ms: float) -> tuple[tuple[str, float, bytes], ...]:
    return tuple((text, took + ms, reply) for text, took, reply in moves)


def judged(a: list[Exchange], b: list[Exchange], **limits: object) -> Comparison:
    return judge(matched(a, b), LANGUAGE, Limits(**limits))  # type: ignore[arg-type]


def kinds(found: Comparison) -> list[tuple[int, str]]:
    return [(one.pair.number, one.kind.value) for one in found.differences]


@pytest.mark.parametrize("seed", range(20))
def test_two_equal_sessions_on_a_busy_computer_are_the_same(seed: int) -> None:
    a, b = (session(*QUICK, *MOVES, delays=random.Random(2 * seed + side)) for side in (0, 1))
    assert judged(a, b).same
    assert judged(a, session(*QUICK, *MOVES), exact_b=True).same


def test_one_late_reply_of_a_move_is_no_difference_and_two_are() -> None:
    quick = (*QUICK, ("@0B1,1", 25.0, b"0"))  # one quick reply was 20 ms late, too
    late = list(MOVES)
    late[2] = (*late[2][:1], late[2][1] + 250.0, b"0")
    assert judged(session(*quick, *MOVES), session(*QUICK, ("@0B1,1", 5.0, b"0"), *late)).same
    late[5] = (*late[5][:1], late[5][1] + 250.0, b"0")
    found = judged(session(*quick, *MOVES), session(*QUICK, ("@0B1,1", 5.0, b"0"), *late))
    assert kinds(found) == [(12, "duration"), (15, "duration")]


def test_sessions_of_moves_alone_say_that_no_quick_reply_tells_their_scatter() -> None:
    found = judged(session(*MOVES), session(*MOVES))
    assert found.same
    assert str(found.jitter).startswith("0 quick replies:")


AGAIN = tuple((f"@0A{300 * (-1) ** n},1000,0,30,0,30,0,30", 320.0, b"0") for n in range(6))
"""Forth and back, three times."""


def test_moves_that_are_late_and_were_in_time_once_are_no_difference() -> None:
    """As measured under a load that comes and goes: 96, 63 and 73 ms, and no quick reply by more than 9."""
    quick = (*QUICK, ("@0B1,1", 14.0, b"0"))
    late = [(text, ms + more, reply) for (text, ms, reply), more in zip(AGAIN, (96, 63, 73, 0, 0, 0), strict=True)]
    twin = session(*QUICK, ("@0B1,1", 5.0, b"0"), *AGAIN)
    assert judged(session(*quick, *late), twin, exact_b=True).same


def test_moves_that_are_late_each_time_are_a_difference() -> None:
    quick = (*QUICK, ("@0B1,1", 14.0, b"0"))
    late = [(text, ms + more, reply) for (text, ms, reply), more in zip(AGAIN, (96, 90, 92, 88, 91, 94), strict=True)]
    found = judged(session(*quick, *late), session(*QUICK, ("@0B1,1", 5.0, b"0"), *AGAIN), exact_b=True)
    assert [number for number, kind in kinds(found) if kind == "duration"] == list(range(10, 16))


def test_moves_that_an_overloaded_computer_delays_more_than_quick_replies_are_no_difference() -> None:
    """As measured with fifteen busy processes on two cores: most are late, and those that are not show it."""
    quick = [(text, ms + late, reply) for (text, ms, reply), late in zip(QUICK, (1, 1, 4, 5, 6, 7, 9, 10), strict=True)]
    late = [(text, ms + more, b"0") for (text, ms, _), more in zip(MOVES, (2, 2, 12, 13, 17, 20, 26, 27), strict=True)]
    again = [(text, ms + more, b"0") for (text, ms, _), more in zip(AGAIN, (16, 26, 2, 19, 12, 2), strict=True)]
    assert judged(session(*quick, *late, *again), session(*QUICK, *MOVES, *AGAIN), exact_b=True).same


def test_all_moves_a_little_later_are_a_difference_beyond_chance() -> None:
    """4.6 ms, by which a move with 50 in place of 100 Hz/ms is longer, among delays of 2 ms."""
    a = session(*QUICK, *MOVES, delays=random.Random(1))
    b = session(*QUICK, *longer(MOVES, 12.0), delays=random.Random(2))
    found = judged(a, b)
    assert {kind for _, kind in kinds(found)} == {"duration"}
    assert len(found.differences) >= 6


def test_a_move_shorter_than_a_twin_makes_it_is_a_difference_whatever_the_load() -> None:
    quick = (*QUICK, ("@0B1,1", 205.0, b"0"))
    real = session(*quick, *longer(MOVES, -8.0))
    twin = session(*QUICK, ("@0B1,1", 5.0, b"0"), *MOVES)
    assert judged(real, twin, exact_b=True).differences
    assert {one.kind for one in judged(real, twin, exact_b=True).differences} == {Kind.DURATION}


def test_a_busy_server_that_catches_up_during_moves_is_no_difference() -> None:
    """Quick replies were late by 8 to 36 ms, moves by 1.8 ms, as measured beside three other servers on two cores."""
    late = [(text, ms + 4.0 * (2 + number), reply) for number, (text, ms, reply) in enumerate(QUICK)]
    assert judged(session(*late, *longer(MOVES, 1.8)), session(*QUICK, *MOVES), exact_b=True).same


def test_a_line_that_is_always_late_hides_no_shorter_move() -> None:
    """An adapter that hands over every 16 ms, and moves that are 10 ms shorter."""
    late = [(text, ms + 16.0 + 0.1 * (number % 3), reply) for number, (text, ms, reply) in enumerate(QUICK)]
    found = judged(session(*late, *longer(MOVES, 6.0)), session(*QUICK, *MOVES), exact_b=True)
    assert len(found.differences) == len(MOVES)


def test_a_stop_that_fell_seven_steps_later_is_no_difference_and_what_follows_is_compared() -> None:
    """At 900 Hz 7 steps are 7.8 ms; the move goes on from where it stopped."""

    def stopped(after_ms: float, at: int) -> list[Exchange]:
        return session(
            *QUICK,
            ("@0A9000,900,0,30,0,30,0,30", after_ms, b""),
            ("255", 20.0, b"F"),
            ("@0P", 12.0, position(at, 0, 0)),
            ("@0P", 12.0, position(at, 0, 0)),
            ("@0Q", 5.0, b"5"),
        )

    found = judged(stopped(500.0, 450), stopped(507.8, 457))
    assert found.same
    assert len(found.pairs) == len(QUICK) + 5
    assert kinds(judged(stopped(500.0, 450), stopped(507.8, 557))) == [(11, "position")]  # and not told twice
    other = stopped(507.8, 457)
    other[-1] = replace(other[-1], reply=b"4", meaning="another")
    assert kinds(judged(stopped(500.0, 450), other)) == [(13, "reply")]


@pytest.mark.parametrize(("steps", "same"), [(0, True), (1, True), (2, False)])
def test_positions_are_compared_with_a_tolerance_in_steps(steps: int, same: bool) -> None:
    a, b = (session(*QUICK, ("@0P", 12.0, position(1000, at, -5))) for at in (0, steps))
    assert judged(a, b).same == same
    assert judged(a, b, steps=2).same


CARD = {  # question for the position of X, of Y, and how each is answered
    "ismif": (b"@LX\r", b"@LY\r", lambda axis, n: b"@L" + b"XY"[axis : axis + 1] + b"%d\r" % n),
    "gmi99": (
        create_language("gmi99").frame("T0;0"),  # type: ignore[union-attr]
        create_language("gmi99").frame("T0;1"),  # type: ignore[union-attr]
        lambda axis, n: long_record("E", 224, b"@" + n.to_bytes(3, "little", signed=True), from_card=True),
    ),
}
"""iSMIF 6.4; GMI99 3.1.1 (`T0`: three bytes, two's complement)."""


@pytest.mark.parametrize(("steps", "same"), [(0, True), (1, True), (-2, False), (2, False)])
@pytest.mark.parametrize("controller", CARD)
def test_positions_told_one_by_one_have_the_same_tolerance(controller: str, steps: int, same: bool) -> None:
    """Each axis by itself: Y is off, X is not, and what is told again is not off again."""
    ask_x, ask_y, answer = CARD[controller]

    def told(y: int) -> Comparison:
        def side(y: int) -> list[Exchange]:
            pieces, now_ns = [], 0
            for sent, reply in (
                (ask_x, answer(0, 800)),
                (ask_y, answer(1, y)),
                (ask_x, answer(0, 0)),
                (ask_y, answer(1, y)),
            ):
                pieces += [(now_ns, sent, True, 0), (now_ns + 5 * MS, reply, False, 0)]
                now_ns += 50 * MS
            return paired(pieces, needed(create_language(controller), controller))

        return judge(matched(side(-40), side(y)), needed(create_language(controller), controller))

    found = told(-40 + steps)
    assert found.same is same
    assert kinds(found) == ([] if same else [(2, "position")])


def test_places_in_a_file_of_parameters_have_a_tolerance_and_the_rest_has_none() -> None:
    """BWO 900, P11181: P12151 of X, Y, Z are q2151, q2351, q2551, in mm; P12160, the following error, is measured."""
    language = needed(create_language("bwo900"), "bwo900")

    def side(y: str, lag: str = "0.001", other: str = "5") -> list[Exchange]:
        lines = ("q2151: 10.000", f"q2160: {lag}", f"q2351: {y}", "q2551: -3.000", f"q10500: {other}", "\x04")
        sent = b"\r\nD\r\nK1:P 11181: 0\r\n#\r\n\x04\r\n"
        return paired([(0, sent, True, 0), (9 * MS, "\r\n".join(lines).encode() + b"\r\n", False, 0)], language)

    def told(b: list[Exchange]) -> list[str]:
        return [one.kind.value for one in judge(matched(side("7.000"), b), language).differences]

    assert told(side("7.000", lag="-0.007")) == told(side("7.001")) == []
    assert told(side("7.002")) == ["position"]
    assert told(side("7.000", other="6")) == ["reply"]
    (one,) = judge(matched(side("7.000"), side("7.001", other="6")), language).differences
    assert one.text == "q10500: 5 / q10500: 6"


def test_replies_are_compared_by_meaning() -> None:
    a, b = (session(*QUICK, ("@0P", 12.0, reply)) for reply in (position(-1, 0, 0), b"0ffffff000000000000"))
    assert judged(a, b).same


def test_the_first_reference_run_tells_the_place_at_power_on_and_a_later_one_does_not() -> None:
    a = session(*QUICK, ("@0R7", 9000.0, b"0"), *MOVES, ("@0R7", 2000.0, b"0"), ("@0R7", 2000.0, b"0"))
    b = session(*QUICK, ("@0R7", 15_000.0, b"0"), *MOVES, ("@0R7", 2000.0, b"0"), ("@0R7", 2000.0, b"0"))
    assert kinds(judged(a, b)) == [(9, "start")]
    b = session(*QUICK, ("@0R7", 9000.0, b"0"), *MOVES, ("@0R7", 2300.0, b"0"), ("@0R7", 2300.0, b"0"))
    assert kinds(judged(a, b)) == [(18, "duration"), (19, "duration")]


def test_differences_are_sorted_by_how_much_they_matter() -> None:
    a = session(*QUICK, *MOVES, ("@0P", 12.0, position(0, 0, 0)), ("@0R7", 2000.0, b"0"))
    b = session(*QUICK, *longer(MOVES, 50.0), ("@0P", 12.0, position(9, 0, 0)), ("@0R7", 2000.0, b"2"))
    order = [one.kind for one in judged(a, b).weighed]
    assert order == [Kind.REPLY, Kind.POSITION, *[Kind.DURATION] * 8]


def test_ranks_have_the_probability_of_all_orders_counted() -> None:
    for n, m in ((2, 3), (4, 4), (1, 5)):
        values = range(n + m)
        sums = [
            sum(a > b for a in these for b in set(values) - set(these)) for these in itertools.combinations(values, n)
        ]
        for these in itertools.combinations(values, n):
            those = sorted(set(values) - set(these))
            above = sum(a > b for a in these for b in those)
            expected = sum(each >= above for each in sums) / math.comb(n + m, n)
            assert _chance(these, those) == pytest.approx(expected)
    many = _chance(range(60), range(60))
    assert many == pytest.approx(0.5, abs=0.01)
