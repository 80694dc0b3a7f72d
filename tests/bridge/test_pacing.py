"""Virtual time against a wall clock that the test turns by hand."""

from __future__ import annotations

import numpy as np
import pytest

from isel_twin.bridge.serve.pacing import LONGEST_S, PATIENCE_NS, SLIP_NS, STEADY_NS, TICK_NS, Pacer, parse_speed

MS = 1_000_000


class Clock:
    """Wall time in ns."""

    def __init__(self) -> None:
        self.now = 1_000 * MS

    def __call__(self) -> int:
        return self.now


class Machine:
    """A twin that needs `cost` wall ns for a virtual ns and knows when it will be idle and when something happens."""

    def __init__(self, clock: Clock, cost: float = 0.0, event_ns: int | None = None, idle: bool = True) -> None:
        self.time_ns = 0
        self.next_event_ns = event_ns
        self.idle = idle
        self.reply_waiting = False
        self.cost = cost
        self._clock = clock

    def run_until(self, time_ns: int, stop=None) -> None:
        """At the event the reply comes, and the twin is idle."""
        assert time_ns >= self.time_ns
        event = self.next_event_ns
        if event is not None and event <= time_ns:
            self._spend(event)
            self.next_event_ns, self.idle, self.reply_waiting = None, True, True
            assert stop is not None
            if stop():
                return
        self._spend(time_ns)

    def _spend(self, time_ns: int) -> None:
        self._clock.now += int((time_ns - self.time_ns) * self.cost)
        self.time_ns = time_ns


@pytest.mark.parametrize(("text", "speed"), [("1", 1.0), ("0.5", 0.5), ("20", 20.0), ("max", None)])
def test_speeds(text, speed):
    assert parse_speed(text) == speed


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "", "fast", "MAX"])
def test_bad_speeds_are_named(text):
    with pytest.raises(ValueError, match="speed"):
        parse_speed(text)


@pytest.mark.parametrize("speed", [1.0, 0.5, 20.0])
def test_an_idle_twin_follows_the_wall_clock_at_once(speed):
    clock = Clock()
    pacer, machine = Pacer(speed, clock=clock), Machine(clock)
    clock.now += 3600 * 1000 * MS
    pacer.advance(machine)
    assert machine.time_ns == 3600 * 1000 * MS * speed


def test_an_idle_twin_without_events_is_left_alone():
    clock = Clock()
    assert Pacer(1.0, clock=clock).wait_s(Machine(clock)) == LONGEST_S
    assert Pacer(None, clock=clock).wait_s(Machine(clock)) is None


def test_sleep_ends_at_the_next_event():
    clock = Clock()
    pacer, machine = Pacer(2.0, clock=clock), Machine(clock, event_ns=100 * MS)
    assert pacer.wait_s(machine) == pytest.approx(0.050)
    clock.now += 40 * MS
    assert pacer.wait_s(machine) == pytest.approx(0.010)


def test_an_advance_stops_at_a_reply_so_that_it_leaves_in_time():
    clock = Clock()
    pacer, machine = Pacer(1.0, clock=clock), Machine(clock, cost=0.1, event_ns=30 * MS, idle=False)
    clock.now += 100 * MS
    while machine.next_event_ns is not None:
        pacer.advance(machine)
    assert machine.time_ns == 30 * MS
    assert pacer.wait_s(machine) == 0.0  # the present is 70 ms ahead


def test_an_advance_that_takes_no_time_does_not_stop_at_each_reply():
    """At high speeds bytes of a paced line come faster than they can be handed on one by one."""
    clock = Clock()
    pacer, machine = Pacer(20.0, clock=clock), Machine(clock, event_ns=30 * MS, idle=False)
    clock.now += 100 * MS
    pacer.advance(machine)
    assert machine.time_ns == 2000 * MS


def test_a_busy_twin_is_looked_at_every_tick():
    clock = Clock()
    pacer = Pacer(1.0, clock=clock)
    assert pacer.wait_s(Machine(clock, event_ns=10_000 * MS, idle=False)) == pytest.approx(TICK_NS / 1e9)


def test_a_twin_that_cannot_keep_up_slips_and_makes_up_nothing():
    clock = Clock()
    pacer, machine = Pacer(1.0, clock=clock), Machine(clock, cost=2.0, idle=False)
    began = clock.now
    for _ in range(10_000):
        pacer.advance(machine)
        clock.now += 1 * MS
    elapsed = clock.now - began
    assert pacer.behind
    assert 0.3 < pacer.reached <= 0.5
    assert machine.time_ns <= elapsed / 2
    present = pacer.present_ns()
    assert present is not None
    assert present - machine.time_ns <= SLIP_NS + 3 * TICK_NS


def test_at_speed_max_time_stands_still_while_idle():
    clock = Clock()
    pacer, machine = Pacer(None, clock=clock), Machine(clock, event_ns=50 * MS)
    clock.now += 1000 * MS
    pacer.advance(machine)
    assert machine.time_ns == 0


def test_at_speed_max_a_busy_twin_runs_in_slices_of_about_a_tick():
    clock = Clock()
    pacer, machine = Pacer(None, clock=clock), Machine(clock, cost=0.01, event_ns=10_000 * MS, idle=False)
    longest = 0
    while not machine.idle:
        assert pacer.wait_s(machine) == 0.0
        began = clock.now
        pacer.advance(machine)
        longest = max(longest, clock.now - began)
    assert machine.time_ns == 10_000 * MS  # not a nanosecond beyond what there was to do
    assert TICK_NS // 4 <= longest <= 2 * TICK_NS


def test_at_speed_max_a_twin_that_waits_for_the_outside_is_left_alone():
    clock = Clock()
    pacer, machine = Pacer(None, clock=clock), Machine(clock, event_ns=None, idle=False)
    pacer.advance(machine)
    assert machine.time_ns == 0
    assert pacer.wait_s(machine) is None


@pytest.mark.parametrize("idle", [True, False])
def test_no_stretch_of_time_is_computed_at_once_however_dear_it_is(idle):
    """An idle twin that is recorded: a look of 0.1 ms every 10 ms, at speed 1000 ten times what can be done."""
    clock = Clock()
    pacer, machine = Pacer(1000.0, clock=clock), Machine(clock, cost=0.01, idle=idle)
    longest = 0
    for _ in range(2_000):
        clock.now += 1 * MS
        began = clock.now
        pacer.advance(machine)
        longest = max(longest, clock.now - began)
    assert longest <= 3 * TICK_NS


def test_falling_behind_is_noticed_within_a_second_and_so_is_catching_up():
    clock = Clock()
    pacer, machine = Pacer(20.0, clock=clock), Machine(clock, idle=False)

    def serve(seconds: float) -> None:
        end = clock.now + int(seconds * 1000) * MS
        while clock.now < end:
            pacer.advance(machine)
            clock.now += 1 * MS

    serve(5.0)
    assert not pacer.behind
    machine.cost = 0.45  # at most 2.2 times real time, and less for the time between two advances
    serve(1.0)
    assert pacer.behind
    assert 1.5 < pacer.reached < 2.5
    serve(10.0)
    assert pacer.behind
    machine.cost = 0.0
    serve((STEADY_NS - 1.2 * SLIP_NS) / 1e9)
    assert pacer.behind, "it may have been a pause only"
    serve(1.0)
    assert not pacer.behind
    assert 1.5 < pacer.reached < 2.5
    serve(10.0)
    assert not pacer.behind


def test_an_idle_second_is_made_up_for_without_a_slip():
    """A recorder needs half of the time; the longest sleep must not look like falling behind."""
    clock = Clock()
    pacer, machine = Pacer(1.0, clock=clock), Machine(clock, cost=0.5)
    for _ in range(200):
        wait = pacer.wait_s(machine)
        assert wait is not None
        clock.now += int(wait * 1e9)
        pacer.advance(machine)
    assert not pacer.behind


def test_what_a_host_says_does_not_wait_for_a_twin_that_is_far_behind():
    clock = Clock()
    pacer, machine = Pacer(1e6, clock=clock), Machine(clock, cost=0.01, idle=False)
    clock.now += 100 * MS
    began = clock.now
    pacer.catch_up(machine, lambda: None)
    assert clock.now - began <= PATIENCE_NS + 2 * TICK_NS
    assert pacer.behind
    assert pacer.present_ns() == machine.time_ns, "it is said now, wherever the machine is"


def test_what_a_host_says_waits_for_a_twin_that_is_nearly_there():
    clock = Clock()
    pacer, machine = Pacer(1.0, clock=clock), Machine(clock, cost=0.1, idle=False)
    clock.now += 100 * MS
    spoken = pacer.present_ns()
    pacer.catch_up(machine, lambda: None)
    present = pacer.present_ns()
    assert spoken is not None
    assert present is not None
    assert spoken <= machine.time_ns <= present
    assert not pacer.behind


@pytest.mark.parametrize("seed", [71, 84, 251, 286, 345])
def test_a_speed_that_is_not_reached_is_never_said_to_be_exceeded(seed: int) -> None:
    """A computer that makes 22 to 50 times real time, but for long looks now and then; hosts speak meanwhile."""
    chance = np.random.default_rng(seed)
    clock = Clock()
    pacer, machine = Pacer(20.0, clock=clock), Machine(clock, idle=False)
    while not pacer.behind:
        machine.cost = float(chance.choice([0.02, 0.045, 0.045, 4.0]))
        pacer.advance(machine)
        clock.now += int(chance.choice([1, 1, 1, 1, 40])) * MS
        if chance.random() < 0.05:
            pacer.catch_up(machine, lambda: None)
    assert 0.0 < pacer.reached < 20.0
