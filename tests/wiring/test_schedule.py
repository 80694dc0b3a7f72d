"""The schedule by itself: who is next, how often, and what an edge is."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from isel_twin.wiring import ScenarioEvent, Schedule, Trigger
from isel_twin.wiring.schedule import REARM_NS

MS = 1_000_000
SPINDLE = Trigger("output", "spindle", 1.0)


def event(number: int, at_ns: int = 0, **fields: Any) -> ScenarioEvent:
    return ScenarioEvent(at_ns, {"set": {"hood": str(number)}}, number=number, **fields)


def taken(schedule: Schedule, t_ns: int) -> list[int]:
    """Numbers of the events that happen at t_ns."""
    numbers = []
    while (happens := schedule.take(t_ns)) is not None:
        numbers.append(happens.number)
    return numbers


def all_until(schedule: Schedule, t_ns: int) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = [(0, number) for number in taken(schedule, 0)]
    while (now := schedule.next_ns) is not None and now <= t_ns:
        found += [(now, number) for number in taken(schedule, now)]
    return found


def test_events_at_one_instant_happen_in_the_order_of_the_file() -> None:
    schedule = Schedule([event(2, 5), event(4, 5), event(1, when=SPINDLE), event(3, when=SPINDLE)])
    schedule.look(lambda condition: False)
    schedule.look(lambda condition: True)
    assert taken(schedule, 0) == [1, 3]
    assert taken(schedule, 5) == [2, 4]
    again = Schedule([event(2, 5), event(3, when=SPINDLE), event(1, when=SPINDLE)])
    again.look(lambda condition: False)
    again.look(lambda condition: True)
    assert taken(again, 5) == [1, 2, 3], "whatever brought them about"


def test_repeats_come_every_so_often_and_then_no_more() -> None:
    schedule = Schedule([event(1, 10, times=3, every_ns=100)])
    assert schedule.left == 3
    assert all_until(schedule, 10_000) == [(10, 1), (110, 1), (210, 1)]
    assert (schedule.left, schedule.next_ns) == (0, None)


def test_a_repeat_counts_from_its_time_not_from_when_it_was_asked() -> None:
    schedule = Schedule([event(1, 10, times=3, every_ns=100)])
    assert taken(schedule, 1000) == [1, 1, 1]


@pytest.mark.parametrize(("times", "count"), [(1, 1), (2, 2), (0, 4)])
def test_a_condition_counts_when_it_becomes_so(times: int, count: int) -> None:
    """It stays true for long, and is looked at often: one edge is one event."""
    schedule = Schedule([event(1, when=SPINDLE, times=times)])
    happened = 0
    for step in range(80):
        so = step % 20 >= 10
        schedule.look(lambda condition, so=so: so)
        happened += len(taken(schedule, step * MS))
    assert happened == count
    assert schedule.left == 0


def test_what_is_so_at_power_on_has_to_be_otherwise_first() -> None:
    schedule = Schedule([event(1, when=SPINDLE)])
    for t_ns, so in ((0, True), (1, True), (2, False), (3, True)):
        schedule.look(lambda condition, so=so: so)
        assert taken(schedule, t_ns) == ([1] if t_ns == 3 else [])


@pytest.mark.parametrize(("gap_ns", "count"), [(REARM_NS - 1, 1), (REARM_NS, 2)])
def test_edges_that_come_too_soon_are_one(gap_ns: int, count: int) -> None:
    schedule = Schedule([event(1, when=SPINDLE, times=0)])
    happened = 0
    for t_ns, so in ((4, False), (5, True), (6, False), (5 + gap_ns, True)):
        schedule.look(lambda condition, so=so: so)
        happened += len(taken(schedule, t_ns))
    assert happened == count


def test_a_delay_passes_whatever_becomes_of_the_condition() -> None:
    schedule = Schedule([event(1, when=SPINDLE, delay_ns=300)])
    schedule.look(lambda condition: False)
    for t_ns, so in ((100, True), (200, False)):
        schedule.look(lambda condition, so=so: so)
        assert taken(schedule, t_ns) == []
    assert schedule.next_ns == 400
    assert taken(schedule, 400) == [1]


def test_one_event_after_another() -> None:
    later = Trigger("after", "trip", 2e-6)
    schedule = Schedule([event(1, 100, name="trip", times=3, every_ns=5 * MS), event(2, when=later, times=2)])
    assert all_until(schedule, 100 * MS) == [
        (100, 1), (2100, 2), (100 + 5 * MS, 1), (2100 + 5 * MS, 2), (100 + 10 * MS, 1),
    ]  # fmt: skip


def test_chains() -> None:
    schedule = Schedule(
        [
            event(1, 7, name="a"),
            event(2, when=Trigger("after", "a", 0.0), name="b"),
            event(3, when=Trigger("after", "b", 1e-9), delay_ns=2),
        ]
    )
    assert all_until(schedule, 100) == [(7, 1), (7, 2), (10, 3)]


def test_positions_are_numbered_as_they_are_asked_for() -> None:
    waits = [Trigger("position", "x", 1.0, 1), Trigger("position", "y", 2.0, -1)]
    schedule = Schedule([event(1, when=waits[0]), event(2, when=SPINDLE), event(3, when=waits[1])])
    assert schedule.positions == tuple(waits)
    schedule.passed(0, True)
    schedule.passed(1, False)
    schedule.passed(1, True)
    assert taken(schedule, 5) == [3]


class Lines:
    """A language of lines."""

    def __init__(self) -> None:
        self.rest = {True: b"", False: b""}

    def messages(self, data: bytes, sent: bool) -> Iterator[Any]:
        *lines, self.rest[sent] = (self.rest[sent] + data).split(b"\n")
        return iter([SimpleNamespace(text=line.decode()) for line in lines])


def test_messages_are_those_of_the_language() -> None:
    schedule = Schedule(
        [event(1, when=Trigger("sent", "GO"), times=0), event(2, when=Trigger("replied", "OK"))], Lines()
    )
    schedule.heard(b"NO GO\nG", sent=True)
    assert taken(schedule, 0) == []
    schedule.heard(b"O 1\n", sent=True)
    assert taken(schedule, 1) == [1]
    schedule.heard(b"OK\n", sent=True)
    assert taken(schedule, 5 * MS) == []
    schedule.heard(b"OK\n", sent=False)
    assert taken(schedule, 5 * MS) == [2]


@pytest.mark.parametrize("pieces", [[b"xab<\rab<\ra"], [b"xa", b"b", b"<\rab<", b"\ra"]])
def test_without_a_language_bytes_are_found_wherever_they_stand(pieces: list[bytes]) -> None:
    schedule = Schedule([event(1, when=Trigger("sent", "ab<60><13>"), times=2), event(2, when=Trigger("sent", "q"))])
    happened: list[int] = []
    for number, piece in enumerate(pieces):
        schedule.heard(piece, sent=True)
        happened += taken(schedule, number * 2 * MS)
    assert set(happened) == {1}


def test_what_ends_comes_before_what_begins() -> None:
    schedule = Schedule([event(1, 10)])
    schedule.end_later(10, event(9))
    assert schedule.left == 1, "an end is no event of the file"
    assert taken(schedule, 10) == [9, 1]


def test_two_events_that_bring_each_other_about_come_to_an_end() -> None:
    """Opened, closed, opened ... at one instant would never end."""
    opened, closed = Trigger("input", "hood", "open"), Trigger("input", "hood", "closed")
    schedule = Schedule([event(1, when=opened, times=0), event(2, when=closed, times=0)])
    hood, happened = "closed", 0
    schedule.look(lambda condition: condition.value == hood)
    hood = "open"
    schedule.look(lambda condition: condition.value == hood)
    while (happens := schedule.take(0)) is not None and happened < 100:
        hood = "closed" if happens.number == 1 else "open"
        schedule.look(lambda condition, hood=hood: condition.value == hood)
        happened += 1
    assert happened == 2
