"""The executor that controllers share, by its contract: toy activities on a bench that keeps the protocol of time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.firmware.activity import Activity, Ended, Listen, Pause, Travel, Unfinished
from isel_twin.firmware.executor import Executor
from isel_twin.motion import Displacement, Stream, TimeLaw, constant, line, trapezoid
from tests.thorough import drawn

MS = MILLISECOND_NS


def law(ticks: int) -> TimeLaw:
    """2000 Hz, from and to 200 Hz at 10 Hz/ms: a ramp takes 180 ms and 198 ticks."""
    return trapezoid(ticks, 2000, 200, 10_000)


def one_khz(ticks: int) -> TimeLaw:
    """A tick every ms, no ramps."""
    return constant(ticks, 1000)


class Toy:
    """What activities leave behind: results of their requests, with their times, and whether they were closed."""

    def __init__(self, axes: int = 2) -> None:
        self.executor = Executor(axes)
        self.stream = Stream(axes)
        self.results: list[tuple[int, object]] = []
        self.ends: list[Unfinished | None] = []
        self.parkings: list[int] = []
        self.closed: list[str] = []
        self.kept: list[Activity] = []
        """Activities somebody still holds, so that they are closed by the executor or not at all."""

    # ---- activities ----

    def ask(self, *requests: Travel | Pause | Listen, name: str = "asking") -> Activity:
        """Each request once."""
        try:
            for request in requests:
                result = yield request
                self.results.append((self.executor.now_ns, result))
        finally:
            self.closed.append(name)

    def go(self, *ways: Displacement, law: Callable[[int], TimeLaw] = law) -> Activity:
        """Along these lines, all the way, whatever stops come."""
        for way in ways:
            path, made = line(way), 0
            while made < path.ticks:
                ended = yield Travel(path, law(path.ticks - made), made)
                self.results.append((self.executor.now_ns, ended))
                made = ended.ticks

    def wait(self, ns: int) -> Activity:
        """Exactly so long."""
        left: int | None = ns
        while left is not None:
            left = yield Pause(left)
            self.results.append((self.executor.now_ns, left))

    # ---- the bench ----

    def start(self, activity: Activity) -> Executor:
        self.kept.append(activity)
        self.executor.start(activity, self.ends.append)
        self.follow()
        return self.executor

    def park(self) -> None:
        self.executor.park(lambda: self.parkings.append(self.executor.now_ns))
        self.follow()

    def follow(self) -> None:
        """Show the motion to a stream, as whoever drives a controller does."""
        self.stream.follow(self.executor.motion, self.executor.now_ns)

    def pass_to(self, t_ns: int) -> None:
        """Let time pass to t_ns, never beyond what is due; what is due at t_ns is done."""
        executor = self.executor
        while executor.next_ns is not None and executor.next_ns <= t_ns:
            self.look_at(executor.next_ns)
            assert executor.due
            executor.tick()
            self.follow()
        self.look_at(t_ns)

    def look_at(self, t_ns: int) -> None:
        """Let time pass to t_ns, with nothing done that is due then."""
        assert t_ns >= self.executor.now_ns
        self.executor.now_ns = t_ns
        self.stream.make(len(self.stream.until(t_ns)[0]))

    def finish(self) -> None:
        """Let time pass until nothing more comes by itself."""
        while self.executor.next_ns is not None:
            self.pass_to(self.executor.next_ns)

    @property
    def ticks(self) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
        """All ticks made by now."""
        steps = self.stream.steps(self.executor.now_ns)
        return steps.t_ns, steps.delta

    @property
    def made(self) -> Displacement:
        """Their sum."""
        return tuple(int(n) for n in self.ticks[1].sum(axis=0, dtype=np.int64))


@pytest.fixture
def toy() -> Toy:
    return Toy()


# --- requests and what they give ------------------------------------------------------------------------------------


def test_requests_are_carried_out_one_after_the_other(toy: Toy) -> None:
    executor = toy.start(
        toy.ask(Travel(line((3, -1)), one_khz(3)), Pause(7 * MS), Listen(), Travel(line((0, 2)), one_khz(2)))
    )
    assert executor.busy
    assert (executor.next_ns, executor.due) == (3 * MS, False)
    toy.pass_to(3 * MS)
    assert (executor.motion, executor.next_ns) == (None, 10 * MS)
    toy.pass_to(15 * MS)
    assert isinstance(executor.request, Listen)
    assert (executor.next_ns, executor.due) == (None, False)
    executor.hear(65)
    toy.follow()
    toy.finish()
    assert toy.results == [(3 * MS, Ended(3)), (10 * MS, None), (15 * MS, 65), (17 * MS, Ended(2))]
    assert toy.ends == [None]
    assert (executor.busy, executor.request, executor.motion) == (False, None, None)
    assert toy.ticks[0].tolist() == [1 * MS, 2 * MS, 3 * MS, 16 * MS, 17 * MS]


def test_what_takes_no_time_is_over_in_the_same_call(toy: Toy) -> None:
    toy.start(toy.ask())
    assert toy.ends == [None]
    assert not toy.executor.busy


def test_a_motion_of_no_ticks_is_not_shown_and_takes_no_time(toy: Toy) -> None:
    nothing, resumed = Travel(line((0, 0)), law(0)), Travel(line((5, 0)), law(0), first=5)
    executor = toy.start(toy.ask(nothing, resumed, Pause(MS)))
    assert toy.results == [(0, Ended(0)), (0, Ended(5))]
    assert executor.motion is None
    assert isinstance(executor.request, Pause)


def test_a_pause_of_no_time_is_due_at_once_and_lets_others_look(toy: Toy) -> None:
    executor = toy.start(toy.ask(Pause(0)))
    assert executor.busy
    assert (executor.next_ns, executor.due) == (0, True)
    executor.tick()
    assert toy.ends == [None]


def test_a_tick_before_its_time_does_nothing(toy: Toy) -> None:
    executor = toy.start(toy.ask(Pause(5)))
    toy.look_at(4)
    executor.tick()
    assert (executor.busy, toy.results) == (True, [])


def test_purposes_are_the_firmwares_own(toy: Toy) -> None:
    executor = toy.start(toy.ask(Pause(5, "rest"), Listen("an answer"), Travel(line((1, 0)), law(1), purpose=["any"])))
    assert executor.purpose == "rest"
    toy.pass_to(5)
    assert executor.purpose == "an answer"
    executor.hear(0)
    assert executor.purpose == ["any"]
    toy.finish()
    assert executor.purpose is None


def test_an_activity_begins_where_the_one_before_has_ended(toy: Toy) -> None:
    """Whoever is told of the end may start the next one from there."""

    def next_one(reason: Unfinished | None) -> None:
        assert not toy.executor.busy
        toy.executor.start(toy.go((0, 3), law=one_khz), toy.ends.append)

    toy.executor.start(toy.go((2, 0), law=one_khz), next_one)
    toy.follow()
    toy.finish()
    assert toy.ticks[0].tolist() == [1 * MS, 2 * MS, 3 * MS, 4 * MS, 5 * MS]
    assert toy.executor.counts == (2, 3)


def test_unfinished_work_is_told_and_a_fault_in_the_firmware_is_not_hidden(toy: Toy) -> None:
    reason = Unfinished("why")

    def fails(error: Exception) -> Activity:
        yield Pause(1)
        raise error

    toy.start(fails(reason))
    toy.finish()
    assert toy.ends == [reason]
    toy.start(fails(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        toy.finish()


# --- counters -------------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=drawn(50))
@given(t_ns=st.integers(0, SECOND_NS), way=st.tuples(st.integers(-900, 900), st.integers(-900, 900)))
def test_counters_are_what_they_were_and_what_has_been_made_since(t_ns: int, way: Displacement) -> None:
    toy = Toy()
    toy.executor.set_counter(0, 17)
    toy.executor.set_counter(1, -5)
    toy.start(toy.go(way))
    toy.pass_to(t_ns)
    assert toy.executor.counts == (17 + toy.made[0], -5 + toy.made[1])
    toy.finish()
    assert toy.executor.counts == (17 + way[0], -5 + way[1])


def test_as_many_counters_as_axes() -> None:
    toy = Toy(axes=6)
    toy.start(toy.go((1, 2, 3, -4, 5, -6)))
    toy.finish()
    assert toy.executor.counts == (1, 2, 3, -4, 5, -6)


# --- stop and go on -------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=drawn(60))
@given(
    ways=st.lists(st.tuples(st.integers(-700, 700), st.integers(-700, 700)), min_size=1, max_size=3),
    stops=st.lists(st.tuples(st.integers(0, 400 * MS), st.integers(0, 50 * MS)), max_size=6),
)
def test_any_stops_leave_the_ticks_as_they_are(ways: list[Displacement], stops: list[tuple[int, int]]) -> None:
    """Stopped anywhere, also at rest, and gone on with: exactly the ticks of the undisturbed way, in their order."""
    undisturbed, toy = Toy(), Toy()
    undisturbed.start(undisturbed.go(*ways))
    undisturbed.finish()
    executor = toy.start(toy.go(*ways))
    for after, rest in stops:
        toy.pass_to(executor.now_ns + after)
        toy.park()
        toy.finish()
        toy.look_at(executor.now_ns + rest)
        if executor.parked is not None:
            assert not executor.busy
            executor.resume()
            toy.follow()
    toy.finish()
    assert toy.ticks[1].tolist() == undisturbed.ticks[1].tolist()
    assert toy.executor.counts == undisturbed.executor.counts
    assert toy.ends == [None]


def test_a_stop_is_a_ramp_and_then_rest(toy: Toy) -> None:
    """In the cruise; the ramp down is as long as the one up."""
    executor = toy.start(toy.go((5000, 0)))
    toy.pass_to(500 * MS)
    speed_before = 1e9 / np.diff(toy.ticks[0])[-1]
    toy.park()
    assert (executor.stopping, executor.parked, toy.parkings) == (True, None, [])
    toy.finish()
    (stands_ns,) = toy.parkings
    t_ns = toy.ticks[0]
    assert speed_before == pytest.approx(2000, rel=1e-3)
    assert 200 < 1e9 / np.diff(t_ns)[-1] < 250
    assert 170 * MS < stands_ns - 500 * MS < 190 * MS
    assert t_ns[-1] == stands_ns
    assert (executor.busy, executor.next_ns, executor.motion) == (False, None, None)
    assert executor.parked is not None
    assert executor.parked.result == Ended(len(t_ns))
    assert isinstance(executor.parked.request, Travel)


def test_a_motion_without_a_ramp_stands_where_it_is_and_that_is_due_now(toy: Toy) -> None:
    executor = toy.start(toy.go((50, 0), law=one_khz))
    toy.pass_to(20 * MS + 1)
    toy.park()
    assert executor.motion is not None
    assert (executor.due, executor.next_ns, toy.parkings) == (True, 20 * MS + 1, [])
    executor.tick()
    assert (toy.parkings, executor.counts) == ([20 * MS + 1], (20, 0))


def test_a_stop_at_rest_does_nothing(toy: Toy) -> None:
    toy.park()
    assert toy.executor.parked is None
    assert toy.parkings == []


def test_a_second_stop_in_the_ramp_changes_nothing(toy: Toy) -> None:
    once = Toy()
    for desk, stops in ((once, 1), (toy, 3)):
        desk.start(desk.go((5000, 0)))
        for i in range(stops):
            desk.pass_to((500 + 20 * i) * MS)
            desk.park()
        desk.finish()
    assert toy.parkings == once.parkings
    assert toy.ticks[0].tolist() == once.ticks[0].tolist()


@settings(max_examples=drawn(50))
@given(ns=st.integers(0, 1000), stops=st.lists(st.tuples(st.integers(0, 400), st.integers(0, 400)), max_size=5))
def test_a_pause_stands_still_while_parked(ns: int, stops: list[tuple[int, int]]) -> None:
    """Whoever asks for what was left waits exactly so long, not counting the stops."""
    toy = Toy()
    executor = toy.start(toy.wait(ns))
    stood = 0
    for after, rest in stops:
        toy.pass_to(executor.now_ns + after)
        if not executor.busy:
            break
        toy.park()
        assert executor.parked is not None
        assert executor.next_ns is None
        toy.pass_to(executor.now_ns + rest)
        stood += rest
        executor.resume()
    toy.finish()
    assert toy.ends == [None]
    assert toy.results[-1] == (ns + stood, None)


def test_a_pause_cut_short_tells_what_is_left(toy: Toy) -> None:
    executor = toy.start(toy.ask(Pause(100)))
    toy.pass_to(30)
    toy.park()
    toy.look_at(500)
    executor.resume()
    assert toy.results == [(500, 70)]
    assert toy.ends == [None]


def test_a_listener_that_was_parked_has_heard_nothing(toy: Toy) -> None:
    executor = toy.start(toy.ask(Listen()))
    toy.park()
    executor.resume()
    assert toy.results == [(0, None)]


def test_another_activity_while_one_is_parked(toy: Toy) -> None:
    executor = toy.start(toy.go((50, 0), law=one_khz))
    toy.pass_to(20 * MS)
    toy.park()
    toy.finish()
    toy.start(toy.go((0, 3), law=one_khz))
    toy.finish()
    assert executor.counts == (20, 3)
    executor.resume()
    toy.follow()
    toy.finish()
    assert executor.counts == (50, 3)
    assert toy.ends == [None, None]


# --- events ---------------------------------------------------------------------------------------------------------


def test_an_event_ends_the_motion_with_the_ramp(toy: Toy) -> None:
    executor = toy.start(toy.ask(Travel(line((5000, 0)), law(5000)), Travel(line((0, 9)), one_khz(9))))
    toy.pass_to(500 * MS)
    executor.event()
    toy.follow()
    assert executor.stopping
    toy.pass_to(executor.next_ns or 0)
    ((stands_ns, ended),) = toy.results
    assert ended == Ended(toy.made[0], by_event=True)
    assert 170 * MS < stands_ns - 500 * MS < 190 * MS
    assert not executor.stopping
    toy.finish()
    assert toy.results[1] == (stands_ns + 9 * MS, Ended(9))


@pytest.mark.parametrize("in_ramp", [False, True])
def test_a_cut_ends_it_at_the_last_tick_made(toy: Toy, in_ramp: bool) -> None:
    executor = toy.start(toy.ask(Travel(line((5000, 0)), law(5000))))
    toy.pass_to(500 * MS)
    if in_ramp:
        executor.event()
        toy.follow()
        toy.pass_to(550 * MS)
    made = toy.made[0]
    executor.cut()
    toy.follow()
    assert executor.due
    executor.tick()
    assert toy.results == [((550 if in_ramp else 500) * MS, Ended(made, by_event=True))]
    assert executor.counts == (made, 0)


def test_an_edge_at_the_time_of_the_last_tick_still_meets_the_motion(toy: Toy) -> None:
    executor = toy.start(toy.ask(Travel(line((5, 0)), one_khz(5))))
    toy.look_at(5 * MS)
    assert executor.motion is not None
    assert executor.counts == (5, 0)
    executor.cut()
    executor.tick()
    assert toy.results == [(5 * MS, Ended(5, by_event=True))]


def test_an_event_in_the_ramp_of_a_stop_is_remembered(toy: Toy) -> None:
    executor = toy.start(toy.ask(Travel(line((5000, 0)), law(5000))))
    toy.pass_to(500 * MS)
    toy.park()
    executor.event()
    toy.finish()
    assert executor.parked is not None
    executor.resume()
    assert toy.results[0][1] == Ended(toy.made[0], by_event=True)


def test_a_cut_in_the_ramp_of_a_stop_parks_at_once(toy: Toy) -> None:
    executor = toy.start(toy.ask(Travel(line((5000, 0)), law(5000))))
    toy.pass_to(500 * MS)
    toy.park()
    toy.pass_to(520 * MS)
    executor.cut()
    executor.tick()
    assert toy.parkings == [520 * MS]
    assert executor.parked is not None
    assert executor.parked.result == Ended(toy.made[0], by_event=True)


def test_a_cut_reaches_a_motion_that_is_parked_but_not_a_pause(toy: Toy) -> None:
    executor = toy.start(toy.ask(Travel(line((50, 0)), one_khz(50)), Pause(10)))
    toy.pass_to(20 * MS)
    toy.park()
    toy.finish()
    executor.cut()
    executor.resume()
    assert toy.results == [(20 * MS, Ended(20, by_event=True))]
    toy.park()
    executor.cut()
    executor.resume()
    assert toy.results[1:] == [(20 * MS, 10)]


def test_events_at_rest_and_in_a_pause_mean_nothing(toy: Toy) -> None:
    toy.executor.event()
    toy.executor.cut()
    executor = toy.start(toy.ask(Pause(10)))
    executor.event()
    executor.cut()
    assert (executor.stopping, executor.next_ns) == (False, 10)


# --- ends -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stopped_before", [False, True])
def test_breaking_off_waits_for_the_ramp_and_overrules_a_stop(toy: Toy, stopped_before: bool) -> None:
    executor = toy.start(toy.ask(Travel(line((5000, 0)), law(5000)), Pause(1)))
    toy.pass_to(500 * MS)
    if stopped_before:
        toy.park()
        toy.pass_to(550 * MS)
    reason, latest = Unfinished("first"), Unfinished("latest")
    executor.break_off(reason)
    executor.break_off(latest)
    toy.follow()
    assert toy.ends == []
    toy.park()
    toy.finish()
    assert (toy.ends, toy.results, toy.parkings) == ([latest], [], [])
    assert toy.closed == ["asking"]
    assert executor.parked is None
    assert executor.counts == toy.made
    assert 170 * MS < executor.now_ns - 500 * MS < 190 * MS


@pytest.mark.parametrize("request_", [Pause(100), Listen()])
def test_breaking_off_what_stands_is_at_once(toy: Toy, request_: Pause | Listen) -> None:
    executor, reason = toy.start(toy.ask(request_)), Unfinished()
    executor.break_off(reason)
    assert (toy.ends, toy.closed, executor.busy, executor.next_ns) == ([reason], ["asking"], False, None)


def test_aborting_is_at_once_and_counters_keep_what_was_made(toy: Toy) -> None:
    executor, reason = toy.start(toy.ask(Travel(line((5000, -50)), law(5000)))), Unfinished()
    toy.pass_to(500 * MS)
    made = toy.made
    executor.abort(reason)
    toy.follow()
    assert (toy.ends, toy.closed, executor.motion) == ([reason], ["asking"], None)
    toy.look_at(SECOND_NS)
    assert made == toy.made == executor.counts


def test_at_rest_there_is_nothing_to_end(toy: Toy) -> None:
    toy.executor.break_off(Unfinished())
    toy.executor.abort(Unfinished())
    toy.executor.forget()
    toy.executor.discard()
    assert toy.ends == []


def test_what_is_forgotten_is_closed_and_nobody_is_told(toy: Toy) -> None:
    executor = toy.start(toy.ask(Listen()))
    toy.park()
    executor.forget()
    assert (toy.closed, toy.ends, executor.parked) == (["asking"], [], None)


def test_discarding_closes_everything_and_nobody_is_told(toy: Toy) -> None:
    """What is in progress first, then what was parked; counters stay, and the next activity begins from there."""
    executor = toy.start(toy.ask(Listen(), name="parked"))
    toy.park()
    toy.start(toy.ask(Travel(line((5000, 0)), law(5000)), name="busy"))
    toy.pass_to(500 * MS)
    toy.park()
    toy.pass_to(520 * MS)
    made = toy.made
    executor.discard()
    toy.follow()
    assert (toy.closed, toy.ends) == (["busy", "parked"], [])
    assert (executor.busy, executor.parked, executor.motion, executor.next_ns, executor.stopping) == (
        False,
        None,
        None,
        None,
        False,
    )
    assert executor.counts == made
    toy.start(toy.go((0, 4), law=one_khz))
    toy.finish()
    assert executor.counts == (made[0], 4)


def test_what_an_activity_holds_it_gives_back_before_its_end_is_told(toy: Toy) -> None:
    activity = toy.ask(Pause(10))
    toy.executor.start(activity, lambda reason: toy.closed.append("told"))
    toy.executor.abort(Unfinished())
    assert toy.closed == ["asking", "told"]
