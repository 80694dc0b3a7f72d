"""The twin's loop, seen by a controller that does what a test says and watches how it is driven.

The protocol of time is that of isel_twin/controller: times never decrease and never pass `next_ns`, every call is
followed by `take`. Plants are those of the package; all times come from closed forms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from motion.plans import Table, table

import isel_twin.core.assembly
import isel_twin.core.twin
from isel_twin import Twin
from isel_twin.base.units import MICROSECOND_NS, MILLISECOND_NS, SECOND_NS
from isel_twin.controller import CounterSet, DriveInput, Drives, Event, FlashWrite, Output, Reply, SerialFormat
from isel_twin.motion import Motion, SetPointRun, StepRun, constant, line, trapezoid

SUBSTEP_NS = 25 * MICROSECOND_NS
STEP_MM = 1 / 320
SWITCHES = {name: (name,) for name in ("limit_x1", "limit_x2", "limit_y1", "limit_y2", "limit_z1", "limit_z2")}
START_MM = (100.0, 50.0, 30.0)


@dataclass
class Call:
    """A call of the border and what was true during it."""

    what: str
    t_ns: int
    detail: Any = None


class Scripted:
    """A controller; `agenda` is what it does by itself, `on_bytes` and `on_level` how it answers.

    It asserts the protocol of time in each call.
    """

    def __init__(self, axes: int = 4, line_format: SerialFormat | None = None, direction: int = 1) -> None:
        self.serial_format = line_format or SerialFormat(9600)
        self.direction = (direction,) * axes
        self.fault = False
        self.idle = True
        self.made = (0,) * axes
        self.motion: Motion | None = None
        self.agenda: list[tuple[int, Callable[[], None]]] = []
        self.on_bytes: Callable[[bytes], None] = lambda data: None
        self.on_level: Callable[[str, bool], None] = lambda terminal, level: None
        self.calls: list[Call] = []
        self.contacts: Mapping[str, tuple[str, ...]] = SWITCHES
        self.events: list[Event] = []
        self.t_ns = 0
        self._taken = True

    # what it does

    def say(self, *events: Event) -> None:
        self.events += events

    def start(self, motion: Motion) -> None:
        """Begin a motion, ending the one before, if there is one."""
        self.end()
        self.motion = motion

    def end(self) -> None:
        """Stand still from now on."""
        self.made, self.motion = self.counts, None

    def at(self, t_ns: int, deed: Callable[[], None]) -> None:
        self.agenda.append((t_ns, deed))
        self.agenda.sort(key=lambda entry: entry[0])

    # what it shows

    @property
    def counts(self) -> tuple[int, ...]:
        if self.motion is None:
            return self.made
        return tuple(m + n for m, n in zip(self.made, self.motion.displacement(self.t_ns), strict=True))

    @property
    def run(self) -> Motion | None:
        return self.motion

    @property
    def next_ns(self) -> int | None:
        times = [t for t, _ in self.agenda[:1]] + ([] if self.motion is None else [self.motion.end_ns])
        return min(times, default=None)

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return self.contacts

    def machine_overrides(self) -> Mapping[str, Any]:
        return {"imperfections": "ideal"}

    # how it is driven

    def _called(self, what: str, t_ns: int, detail: Any = None) -> None:
        assert self._taken, f"{what}: what the call before said has not been fetched"
        assert t_ns >= self.t_ns, f"{what}: time runs backwards"
        assert self.next_ns is None or t_ns <= self.next_ns, f"{what}: time has passed {self.next_ns}"
        self.t_ns = t_ns
        self._taken = False
        self.calls.append(Call(what, t_ns, detail))

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._called("power_on", t_ns, dict(levels))
        self.say(Output("stages", 1), Output("brake", 1))

    def receive(self, t_ns: int, data: bytes) -> None:
        self._called("receive", t_ns, data)
        self.on_bytes(data)

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._called("set_input", t_ns, (terminal, level))
        self.on_level(terminal, level)

    def advance(self, t_ns: int) -> None:
        self._called("advance", t_ns)
        if self.agenda and self.agenda[0][0] <= t_ns:
            self.agenda.pop(0)[1]()
        elif self.motion is not None and self.motion.end_ns <= t_ns:
            self.end()

    def take(self) -> list[Event]:
        self._taken = True
        events, self.events = self.events, []
        return events

    def times(self, what: str) -> list[int]:
        return [call.t_ns for call in self.calls if call.what == what]

    @property
    def edges(self) -> list[tuple[int, str, bool]]:
        return [(call.t_ns, *call.detail) for call in self.calls if call.what == "set_input"]


class Asking(Scripted):
    """One that wants to know what its drives know; `drives` are seen at each call."""

    inputs: Sequence[DriveInput] = ()

    def drive_inputs(self) -> Sequence[DriveInput]:
        self.calls.append(Call("drive_inputs", 0))
        return self.inputs

    def use_drives(self, drives: Drives) -> None:
        self.calls.append(Call("use_drives", 0))
        self.drives = drives
        self.seen: list[tuple[int, tuple[int, ...], tuple[float, ...], tuple[bool, ...]]] = []

    def _called(self, what: str, t_ns: int, detail: Any = None) -> None:
        super()._called(what, t_ns, detail)
        self.seen.append((t_ns, self.drives.encoder, self.drives.lag, self.drives.on))


Build = Callable[..., Twin]


@pytest.fixture
def build(monkeypatch: pytest.MonkeyPatch) -> Build:
    """build(controller, **arguments of Twin): a twin of that controller, which has no language."""

    def twin(controller: Scripted, plant: str = "kinematic", **options: Any) -> Twin:
        monkeypatch.setattr(
            isel_twin.core.assembly, "controller_factory", lambda name: lambda flash, settings: controller
        )
        monkeypatch.setattr(isel_twin.core.assembly, "language_factory", lambda name: lambda: None)
        return Twin(controller="scripted", plant=plant, start_mm=options.pop("start_mm", START_MM), **options)

    return twin


def steps(*n: int, hz: int = 1000, start_ns: int = 0) -> StepRun:
    return StepRun(line(n), constant(max(map(abs, n)), hz), start_ns)


# ---- power-on ------------------------------------------------------------------------------------------------------


def test_a_controller_is_switched_on_once_with_all_its_levels(build: Build) -> None:
    controller = Scripted()
    controller.contacts = {"x": ("limit_x1", "limit_x2"), "none": ("limit_a2",), "key": ("key",)}
    twin = build(controller)
    assert controller.calls[0] == Call("power_on", 0, {"x": True, "key": False})
    assert controller.times("power_on") == [0]
    assert (twin.time_ns, twin.idle, twin.next_event_ns) == (0, True, None)
    assert dict(twin.outputs) == {"stages": 1, "brake": 1, "power": 1, "spindle_runs": 0}
    assert dict(twin.levels) == {"x": True, "key": False}


def test_a_switch_struck_at_power_on_is_among_the_levels_and_no_edge(build: Build) -> None:
    controller = Scripted()
    twin = build(controller, start_mm=(-0.5, 50.0, 30.0))
    assert controller.calls[0].detail == {name: name != "limit_x1" for name in SWITCHES}
    twin.run(1.0)
    assert controller.edges == []


def test_drives_are_handed_over_before_power_on(build: Build) -> None:
    controller = Asking()
    controller.inputs = (DriveInput("lag_x", 0, "lag", 20.0), DriveInput("alarm", 3, "fault"))
    build(controller)
    asked = [call.what for call in controller.calls]
    assert asked[:3] == ["drive_inputs", "use_drives", "power_on"]
    assert asked.count("drive_inputs") == asked.count("use_drives") == asked.count("power_on") == 1
    assert controller.calls[2].detail == dict.fromkeys(SWITCHES, True) | {"lag_x": False, "alarm": False}


def test_a_controller_that_does_not_ask_is_not_burdened(build: Build) -> None:
    twin = build(Scripted())
    assert set(twin.levels) == set(SWITCHES)


# ---- the protocol of time ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
@pytest.mark.parametrize("seed", range(3))
def test_time_never_passes_what_the_controller_waits_for(build: Build, plant: str, seed: int) -> None:
    """Timers, moves and bytes at random times, cut into random pieces; the controller itself asserts the protocol."""
    random = np.random.default_rng(seed)
    controller = Scripted()
    due = sorted(random.integers(1, 400 * MILLISECOND_NS, 60).tolist())
    done: list[int] = []

    def act(t_ns: int) -> None:
        done.append(controller.t_ns)
        assert controller.t_ns == t_ns, "at the very time"
        if random.random() < 0.4:
            controller.start(steps(int(random.integers(-60, 60)), -7, 3, 9, hz=3000, start_ns=t_ns))
        elif random.random() < 0.3:
            controller.end()

    for t in due:
        controller.at(t, lambda t=t: act(t))  # type: ignore[misc]
    twin = build(controller, plant, line_speed=True)
    while twin.time_ns < 400 * MILLISECOND_NS:
        twin.write(b"x" * int(random.integers(0, 4)))
        twin.run_until(twin.time_ns + int(random.integers(1, 20 * MILLISECOND_NS)))
    assert done == due
    assert controller.times("receive") == sorted(set(controller.times("receive"))), "byte after byte"
    assert twin.counts.tolist() == list(controller.counts)
    assert twin.steps.delta.sum(axis=0, dtype=int).tolist() == list(controller.counts)


def test_what_is_due_again_at_the_same_instant_is_done_in_it(build: Build) -> None:
    """A controller may name the present as its next time: it is advanced again before any time passes."""
    controller = Scripted()
    done: list[int] = []
    for t in (5, 7, 7, 7, 9):
        controller.at(t, lambda: done.append(controller.t_ns))
    twin = build(controller)
    twin.run_until(8)
    assert done == [5, 7, 7, 7]
    twin.run_until(9)
    assert done == [5, 7, 7, 7, 9]


def test_what_is_due_at_power_on_is_done_at_once(build: Build) -> None:
    controller = Scripted()
    done: list[int] = []
    for _ in range(3):
        controller.at(0, lambda: done.append(controller.t_ns))
    twin = build(controller)
    assert (done, twin.time_ns) == ([0, 0, 0], 0)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A twin that goes round a thousand times at an instant, not a hundred thousand."""
    monkeypatch.setattr(isel_twin.core.twin, "_ENDLESS", 1000)


@pytest.mark.usefixtures("impatient")
def test_a_controller_that_waits_for_the_present_for_ever_is_broken(build: Build) -> None:
    controller = Scripted()

    def again() -> None:
        controller.at(50, again)

    controller.at(50, again)
    twin = build(controller)
    with pytest.raises(RuntimeError, match="does not come to an end at 50 ns"):
        twin.run(1.0)


@pytest.mark.usefixtures("impatient")
def test_a_controller_that_answers_its_own_edges_for_ever_is_broken(build: Build) -> None:
    """It switches the spindle off when the contactor is on, and on when it is off."""
    controller = Scripted()
    controller.contacts = {"runs": ("spindle",)}
    controller.on_level = lambda terminal, level: controller.say(Output("spindle", int(not level)))
    controller.at(70, lambda: controller.say(Output("spindle", 1)))
    twin = build(controller)
    with pytest.raises(RuntimeError, match="does not come to an end at 70 ns"):
        twin.run(1.0)


def test_an_output_that_works_a_contact_is_an_edge_of_the_same_instant(build: Build) -> None:
    controller = Scripted()
    controller.contacts = {"runs": ("spindle",), "power": ("power_ok",)}
    controller.at(70, lambda: controller.say(Output("spindle", 1)))
    twin = build(controller)
    twin.run_until(1000)
    assert controller.edges == [(70, "runs", True)]
    twin.set_input("estop", "pressed")
    assert sorted(controller.edges[1:]) == [(1000, "power", False), (1000, "runs", False)]
    assert twin.time_ns == 1000


# ---- the serial line -----------------------------------------------------------------------------------------------

FORMATS = [
    (SerialFormat(9600, 7, "E", 1), Fraction(10, 9600)),
    (SerialFormat(19_200, 8, "O", 2), Fraction(12, 19_200)),
    (SerialFormat(38_400, 8, "N", 1), Fraction(10, 38_400)),
    (SerialFormat(300, 7, "N", 2), Fraction(10, 300)),
    (SerialFormat(115_200, 8, "E", 1), Fraction(11, 115_200)),
]


@pytest.mark.parametrize(("line_format", "byte_s"), FORMATS, ids=[str(f) for f, _ in FORMATS])
def test_bytes_take_the_time_of_their_format(build: Build, line_format: SerialFormat, byte_s: Fraction) -> None:
    """Start bit, data, parity, stop bits: byte k of those sent at t arrives at t + k bits / baud, in whole ns."""
    byte_ns = round(byte_s * SECOND_NS)
    controller = Scripted(line_format=line_format)
    controller.on_bytes = lambda data: controller.say(Reply(data.upper() + b"!"))
    twin = build(controller, line_speed=True)
    twin.run_until(1234)
    twin.write(b"abc")
    assert controller.times("receive") == []
    twin.run_until(1234 + byte_ns)
    twin.write(b"d")
    twin.run_until(1234 + 4 * byte_ns - 1)
    assert controller.times("receive") == [1234 + k * byte_ns for k in (1, 2, 3)]
    assert not twin.idle
    assert twin.run_until_idle()
    received = [(c.t_ns, c.detail) for c in controller.calls if c.what == "receive"]
    assert received == [(1234 + k * byte_ns, bytes([96 + k])) for k in (1, 2, 3, 4)]
    assert twin.time_ns == 1234 + 9 * byte_ns, "each is answered by two, which wait for one another: 1 + 2 x 4"
    assert twin.read() == b"A!B!C!D!"


def test_replies_arrive_byte_by_byte(build: Build) -> None:
    controller = Scripted(line_format=SerialFormat(9600, 7, "E", 1))
    byte_ns = round(Fraction(10, 9600) * SECOND_NS)
    controller.at(500, lambda: controller.say(Reply(b"xyz")))
    twin = build(controller, line_speed=True)
    twin.run_until(500)
    for k in range(1, 4):
        assert twin.next_event_ns == 500 + k * byte_ns
        twin.run_until(500 + k * byte_ns - 1)
        assert (twin.read(), twin.reply_waiting) == (b"", False)
        twin.run_until(500 + k * byte_ns)
        assert twin.reply_waiting
        assert twin.read() == b"xyz"[k - 1 : k]


def test_the_format_may_change(build: Build) -> None:
    """What is sent is sent in the format of its time."""
    controller = Scripted(line_format=SerialFormat(1000, 8, "N", 1))

    def faster(data: bytes) -> None:
        controller.serial_format = SerialFormat(10_000, 8, "N", 1)
        controller.say(Reply(b"ok"))

    controller.on_bytes = faster
    twin = build(controller, line_speed=True)
    twin.write(b"!")
    assert twin.run_until_idle()
    assert twin.time_ns == 10 * MILLISECOND_NS + 2 * MILLISECOND_NS
    assert twin.serial_format.baud == 10_000


def test_without_line_speed_bytes_arrive_at_once(build: Build) -> None:
    controller = Scripted(line_format=SerialFormat(300))
    controller.on_bytes = lambda data: controller.say(Reply(data[::-1]))
    twin = build(controller)
    twin.run_until(99)
    twin.write(b"abc")
    assert [(c.t_ns, c.detail) for c in controller.calls if c.what == "receive"] == [(99, b"abc")]
    assert (twin.read(), twin.time_ns, twin.idle) == (b"cba", 99, True)


# ---- motions -------------------------------------------------------------------------------------------------------


def ticks(twin: Twin) -> tuple[list[int], list[list[int]]]:
    return twin.steps.t_ns.tolist(), twin.steps.delta.tolist()


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("axes", [1, 2, 3, 4, 6, 8])
def test_any_number_of_axes(build: Build, axes: int, direction: int) -> None:
    """The leading axis makes 640 steps at 1 kHz; a carriage moves 1/320 mm a step, in the sense of its motor."""
    n = tuple((-1) ** i * (640 - 64 * i) for i in range(axes))
    controller = Asking(axes, direction=direction)
    controller.at(100, lambda: controller.start(steps(*n, start_ns=100)))
    twin = build(controller)
    twin.run_until(100 + 320 * MILLISECOND_NS)
    half = [-(-abs(m) // 2) * (1 if m > 0 else -1) for m in n]
    assert all(abs(a - b) <= 1 for a, b in zip(twin.counts.tolist(), half, strict=True))
    twin.run(1.0)
    assert twin.counts.tolist() == list(n)
    assert twin.steps.delta.shape == (640, axes)
    assert twin.steps.delta.dtype == np.int8
    assert twin.steps.t_ns.tolist() == [100 + k * MILLISECOND_NS for k in range(1, 641)]
    assert twin.steps.delta.sum(axis=0, dtype=int).tolist() == list(n)
    expected = [m * STEP_MM for m in (*n, 0, 0)][:3]
    np.testing.assert_allclose(twin.position_mm, expected, atol=1e-9)
    np.testing.assert_allclose(twin.machine_position_mm, np.array(START_MM) + direction * np.array(expected), atol=1e-9)
    assert twin.lost_steps.tolist() == [0.0] * axes
    assert twin.forgotten_steps.shape == twin.slip_steps.shape == (axes,)
    assert controller.drives.encoder == n
    assert controller.drives.lag == (0.0,) * axes
    assert controller.drives.on == (True,) * axes
    assert controller.drives.fault == (False,) * axes


def test_a_motion_that_is_continued_goes_on(build: Build) -> None:
    """A stop ramp in mid-motion: what was made stays made, and the rest is that of the ramp."""
    run = StepRun(line((2000, -500, 0, 7)), trapezoid(2000, 8000, 400, 100_000), 0)
    stop_ns = 71 * MILLISECOND_NS + 333
    stopped = run.stopped(stop_ns)
    assert 0 < stopped.last < 2000
    controller = Scripted()
    controller.at(0, lambda: controller.start(run))

    def stop() -> None:
        controller.motion = stopped

    controller.at(stop_ns, stop)
    twin = build(controller)
    twin.run(1.0)
    t_ns, delta = stopped.window(0, stopped.last)
    assert ticks(twin) == (t_ns.tolist(), delta.tolist())
    assert len(twin.steps.motions) == 1
    assert twin.counts.tolist() == list(stopped.displacement(stopped.end_ns))
    np.testing.assert_allclose(twin.position_error_mm, 0.0, atol=1e-9)


def test_a_motion_may_be_shown_by_another_object_each_time(build: Build) -> None:
    """Identity is nobody's business: what is equal continues."""

    class Fresh(Scripted):
        @property
        def run(self) -> Motion | None:
            return None if self.motion is None else replace(self.motion)  # type: ignore[type-var]

    controller = Fresh()
    controller.at(0, lambda: controller.start(steps(300, -300, 0, 0)))
    twin = build(controller)
    for k in range(100):
        twin.run_until(k * 2_700_001)
        twin.write(b"?")
    twin.run(0.2)
    assert ticks(twin)[0] == [k * MILLISECOND_NS for k in range(1, 301)]
    assert len(twin.steps.motions) == 1
    np.testing.assert_allclose(twin.position_mm, [300 * STEP_MM, -300 * STEP_MM, 0.0], atol=1e-9)


@pytest.mark.parametrize("same_path", [True, False])
def test_a_motion_that_does_not_continue_ends_the_one_before(build: Build, same_path: bool) -> None:
    """Twelve steps of the first, then all of the second, whether it is the same path again or another one."""
    first = steps(100, 0, 0, 0)
    change_ns = 12 * MILLISECOND_NS + 400_000
    second = replace(first, start_ns=change_ns) if same_path else steps(0, 50, -50, 0, start_ns=change_ns)
    controller = Scripted()
    controller.at(0, lambda: controller.start(first))
    controller.at(change_ns, lambda: controller.start(second))
    twin = build(controller)
    twin.run(1.0)
    after = [change_ns + k * MILLISECOND_NS for k in range(1, second.last + 1)]
    assert ticks(twin)[0] == [k * MILLISECOND_NS for k in range(1, 13)] + after
    assert twin.counts.tolist() == ([112, 0, 0, 0] if same_path else [12, 50, -50, 0])
    assert [m.start_ns for m in twin.steps.motions] == [0, change_ns]
    np.testing.assert_allclose(twin.position_error_mm, 0.0, atol=1e-9)


def test_a_motion_resumed_makes_the_rest_of_its_path(build: Build) -> None:
    path = line((100, 33, 0, 0))
    controller = Scripted()
    first = StepRun(path, constant(100, 1000), 0)
    cut = first.cut(40 * MILLISECOND_NS)
    rest = StepRun(path, constant(60, 2000), 90 * MILLISECOND_NS, first=40)
    controller.at(0, lambda: controller.start(cut))
    controller.at(90 * MILLISECOND_NS, lambda: controller.start(rest))
    twin = build(controller)
    twin.run(1.0)
    times = [k * MILLISECOND_NS for k in range(1, 41)] + [90 * MILLISECOND_NS + k * 500_000 for k in range(1, 61)]
    assert ticks(twin) == (times, path.deltas(0, 100).tolist())


def test_a_long_motion_is_made_whole(build: Build) -> None:
    """More ticks than are expanded at once; where time is cut does not matter."""
    count = 100_000
    times = []
    for cuts in ((), (SECOND_NS // 3, SECOND_NS // 3 + 1, 3 * SECOND_NS)):
        controller = Scripted()
        controller.at(0, lambda c=controller: c.start(steps(count, -count // 2, 0, 0, hz=20_000)))  # type: ignore[misc]
        twin = build(controller)
        for cut in cuts:
            twin.run_until(cut)
            assert twin.counts[0] == cut * 20_000 // SECOND_NS
            assert len(twin.steps) == twin.counts[0]
        twin.run_until(10 * SECOND_NS)
        times.append(twin.steps.t_ns)
        assert twin.counts.tolist() == [count, -count // 2, 0, 0]
        np.testing.assert_allclose(twin.position_error_mm, 0.0, atol=1e-7)
    assert (times[0] == times[1]).all()
    assert (times[0] == np.arange(1, count + 1) * 50_000).all()


def test_a_switch_far_into_a_long_motion_is_heard_at_its_tick(build: Build) -> None:
    """64032.5 steps before the switch: tick 64033 strikes it, after more ticks than are expanded at once."""
    controller = Scripted()
    controller.at(0, lambda: controller.start(steps(-80_000, 0, 0, 0, hz=20_000)))
    controller.on_level = lambda terminal, level: controller.end()
    twin = build(controller, start_mm=(64_032.5 * STEP_MM, 50.0, 30.0))
    twin.run_until(10 * SECOND_NS)
    assert controller.edges == [(64_033 * 50 * MICROSECOND_NS, "limit_x1", False)]
    assert (twin.counts[0], len(twin.steps)) == (-64_033, 64_033)
    assert twin.machine_position_mm[0] == pytest.approx(-0.5 * STEP_MM)


def test_where_nothing_is_due_nobody_is_called_and_counters_are_right_when_asked_for(build: Build) -> None:
    """Looks at a motion of 1 kHz in between: 10.5 ms after its start ten steps have been made."""
    controller = Scripted()
    controller.at(0, lambda: controller.start(steps(1000, 0, 0, 0)))
    twin = build(controller)
    twin.run(0.0)
    calls = len(controller.calls)
    for _ in range(21):
        twin.run(0.0005)
        assert twin.position_mm.shape == (3,)
    assert len(controller.calls) == calls
    assert twin.position_mm[0] == pytest.approx(10 * STEP_MM)
    assert twin.counts.tolist() == [10, 0, 0, 0]
    assert controller.calls[-1] == Call("advance", 10_500_000)
    twin.run(0.0005)
    twin.write(b"x")
    assert [(call.what, call.t_ns) for call in controller.calls[-2:]] == [
        ("advance", 11_000_000),
        ("receive", 11_000_000),
    ]


# ---- edges ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1, -1])
def test_a_switch_is_heard_at_the_tick_that_strikes_it(build: Build, direction: int) -> None:
    """0.1 mm from the switch: step 33 is beyond it, and the controller that hears of it has made 33 steps."""
    controller = Scripted(direction=direction)
    made = []

    def struck(terminal: str, level: bool) -> None:
        made.append(controller.counts[0])
        controller.end()

    controller.on_level = struck
    controller.at(100, lambda: controller.start(steps(direction * -1000, 0, 0, 0, start_ns=100)))
    twin = build(controller, start_mm=(0.1, 50.0, 30.0))
    twin.run(1.0)
    assert controller.edges == [(100 + 33 * MILLISECOND_NS, "limit_x1", False)]
    assert made == [-33 * direction]
    assert len(twin.steps) == 33
    assert twin.machine_position_mm[0] == pytest.approx(0.1 - 33 * STEP_MM)
    assert dict(twin.levels) == {name: name != "limit_x1" for name in SWITCHES}


def test_an_edge_of_a_led_command_comes_at_its_nanosecond(build: Build) -> None:
    """Set points of -16 increments every 4 ms, each led evenly over the period after it: 42.5 increments before the
    switch, the command is there after two periods of leading and 10.5 / 16 of the third, at 8 + 4 + 2.625 ms."""
    controller = Scripted()
    run = SetPointRun(table(*[(-16, 0, 0, 0)] * 10), 4 * MILLISECOND_NS, 500)
    controller.at(500, lambda: controller.start(run))
    controller.on_level = lambda terminal, level: controller.end() if not level else None
    twin = build(controller, start_mm=(42.5 * STEP_MM, 50.0, 30.0))
    twin.run(0.1)
    (edge,) = controller.edges
    assert edge[1:] == ("limit_x1", False)
    assert edge[0] == pytest.approx(500 + 14_625_000, abs=1)
    assert len(twin.steps) == 3, "the third set point came at 12 ms"
    assert twin.counts.tolist() == [-48, 0, 0, 0]
    assert twin.machine_position_mm[0] == pytest.approx(-5.5 * STEP_MM), "what was led is led to its end"


def test_a_replanned_motion_of_set_points(build: Build) -> None:
    """New set points after the fifth; those made stay made."""
    controller = Scripted(2)
    run = SetPointRun(table(*[(10, -3)] * 20), 4 * MILLISECOND_NS, 0)
    other = replace(run, plan=Table((*[(10, -3)] * 5, (7, 7), (1, 1))))
    controller.at(0, lambda: controller.start(run))

    def replan() -> None:
        controller.motion = other

    controller.at(20 * MILLISECOND_NS, replan)
    twin = build(controller)
    twin.run(0.2)
    assert ticks(twin)[1] == [list(row) for row in other.plan.deltas(0, 7)]
    assert twin.steps.delta.dtype == np.int32
    assert twin.counts.tolist() == [58, -7]
    np.testing.assert_allclose(twin.position_mm, [58 * STEP_MM, -7 * STEP_MM, 0.0], atol=1e-9)


def test_a_motion_prolonged_at_its_last_tick(build: Build) -> None:
    """The next move of a plan is joined at the very instant at which the first one would have ended."""
    controller = Scripted(1)
    run = SetPointRun(table(*[(10,)] * 5), 4 * MILLISECOND_NS, 0)
    longer = replace(run, plan=table(*[(10,)] * 5, *[(-4,)] * 3))
    controller.at(0, lambda: controller.start(run))

    def prolong() -> None:
        controller.motion = longer

    controller.at(run.end_ns, prolong)
    twin = build(controller)
    twin.run(0.2)
    assert ticks(twin) == ([k * 4 * MILLISECOND_NS for k in range(1, 9)], [[10]] * 5 + [[-4]] * 3)
    assert (twin.counts.tolist(), len(twin.steps.motions)) == ([38], 1)
    assert twin.position_mm[0] == pytest.approx(38 * STEP_MM)


def test_a_stop_ramp_begun_by_an_edge(build: Build) -> None:
    """The stream is that of the run stopped at the edge, which is the tick that passes the switch: number 3201."""
    run = StepRun(line((-6000, 0, 0, 0)), trapezoid(6000, 9000, 400, 100_000), 0)
    controller = Scripted()
    controller.at(0, lambda: controller.start(run))

    def struck(terminal: str, level: bool) -> None:
        controller.motion = run.stopped(controller.t_ns)

    controller.on_level = struck
    twin = build(controller, start_mm=(10.0, 50.0, 30.0))
    twin.run(3.0)
    edge_ns = int(run.window(3200, 3201)[0][0])
    stopped = run.stopped(edge_ns)
    assert controller.edges == [(edge_ns, "limit_x1", False)]
    assert 3201 < stopped.last < 6000
    assert ticks(twin)[0] == stopped.window(0, stopped.last)[0].tolist()
    assert twin.machine_position_mm[0] == pytest.approx(10.0 - stopped.last * STEP_MM)


def test_every_edge_between_is_heard_in_a_move_over_a_switch(build: Build) -> None:
    """On over the switch and back: struck at step 33, free at the hysteresis of 0.2 mm (64 steps) beyond it."""
    controller = Scripted()
    controller.at(0, lambda: controller.start(steps(-100, 0, 0, 0)))
    controller.at(200 * MILLISECOND_NS, lambda: controller.start(steps(300, 0, 0, 0, start_ns=200 * MILLISECOND_NS)))
    twin = build(controller, start_mm=(0.1, 50.0, 30.0))
    twin.run(1.0)
    back = 100 - 32 + 64
    assert controller.edges == [
        (33 * MILLISECOND_NS, "limit_x1", False),
        ((200 + back) * MILLISECOND_NS, "limit_x1", True),
    ]


def test_a_following_error_is_an_edge_at_the_sub_step_that_passes_the_limit(build: Build) -> None:
    """A push on a carriage with motors: at each call before the edge the error is within the limit, at the edge it is
    beyond, and the edge is at the end of a sub-step; it ends when the error is back by the hysteresis."""
    controller = Asking()
    controller.inputs = (DriveInput("lag_x", 0, "lag", 2.0, 1.0),)

    def look() -> None:
        controller.at(controller.t_ns + SUBSTEP_NS, look)

    controller.at(50 * MILLISECOND_NS, look)
    twin = build(controller, "mujoco")
    twin.run_until(50 * MILLISECOND_NS)
    controller.seen.clear()
    twin.apply_force(0, 900.0)
    twin.run_until(100 * MILLISECOND_NS)
    twin.apply_force(0, 0.0)
    twin.run_until(400 * MILLISECOND_NS)
    edges = controller.edges
    assert [(terminal, level) for _, terminal, level in edges[:1]] == [("lag_x", True)]
    assert [level for _, _, level in edges] == [i % 2 == 0 for i in range(len(edges))]
    assert not edges[-1][2], "at rest without a load there is no error to speak of"
    assert all(t % SUBSTEP_NS == 0 for t, _, _ in edges)
    level, at = False, {t: level for t, _, level in edges}
    for t_ns, _, lag, on in controller.seen:
        level = at.get(t_ns, level)
        assert on == (True,) * 4
        if t_ns not in at:
            assert abs(lag[0]) <= 2.0 if not level else abs(lag[0]) > 1.0
        elif level:
            assert abs(lag[0]) > 2.0
        else:
            assert abs(lag[0]) <= 1.0
    assert 50 * MILLISECOND_NS < edges[0][0] < 60 * MILLISECOND_NS


# ---- what the controller says --------------------------------------------------------------------------------------


def test_events_are_taken_over_in_their_order(build: Build) -> None:
    images: list[bytes] = []
    controller = Scripted()
    controller.at(10, lambda: controller.say(Reply(b"a"), FlashWrite(b"1"), Reply(b"b"), FlashWrite(b"2")))
    twin = build(controller, flash=b"0")
    twin.on_flash = images.append
    assert twin.flash == b"0"
    twin.run_until(10)
    assert (twin.read(), images, twin.flash) == (b"ab", [b"1", b"2"], b"2")


def test_a_counter_that_is_set_is_the_new_zero(build: Build) -> None:
    controller = Asking()

    def set_counter() -> None:
        controller.made = (5, 0, 0, 0)
        controller.say(CounterSet(0, 5))

    controller.at(0, lambda: controller.start(steps(320, 0, 0, 0)))
    controller.at(SECOND_NS, set_counter)
    twin = build(controller)
    twin.run(0.5)
    assert twin.position_mm.tolist() == pytest.approx([1.0, 0.0, 0.0])
    twin.run(1.0)
    assert twin.position_mm.tolist() == pytest.approx([5 * STEP_MM, 0.0, 0.0])
    assert twin.position_error_mm.tolist() == pytest.approx([0.0] * 3)
    assert controller.drives.encoder == (5, 0, 0, 0)


def test_a_motion_with_the_hood_open_takes_the_power_whatever_the_controller_says(build: Build) -> None:
    controller = Asking()
    controller.contacts = {"power": ("power_ok",)}
    controller.at(SECOND_NS, lambda: controller.start(steps(100, 0, 0, 0, start_ns=SECOND_NS)))
    twin = build(controller)
    twin.set_input("hood", "open")
    twin.run_until(SECOND_NS - 1)
    assert controller.drives.on == (True,) * 4
    twin.run_until(SECOND_NS)
    assert controller.edges == [(SECOND_NS, "power", False)]
    assert controller.drives.on == (False,) * 4


def test_a_query_drops_what_was_waiting_and_says_when_there_is_no_answer() -> None:
    """`@0P` with three axes: 0 and 18 digits; the 0 of `@07` has not been read."""
    twin = Twin(plant="kinematic")
    twin.write(b"@07\r")
    assert twin.reply_waiting
    assert twin.query("@0P") == "0" + 18 * "0"
    assert twin.query("@0R7") == "0"
    with pytest.raises(TimeoutError, match=r"no complete reply to '@0A8000,100,.*' within 0.5 s"):
        twin.query("@0A8000,100,0,30,0,30,0,30", 0.5)
    assert not twin.idle


# ---- whoever looks -------------------------------------------------------------------------------------------------


def test_observers_look_on_their_grid_and_at_every_change(build: Build) -> None:
    controller = Scripted()
    controller.at(2700, lambda: controller.say(Output("lamp", 1)))
    twin = build(controller)
    looks: list[int] = []
    twin.run_until(500)
    twin.observe(lambda seen: looks.append(seen.time_ns), 1000)
    assert looks == [500]
    twin.run_until(4000)
    assert looks == [500, 1500, 2500, 2700, 3500]
    twin.set_input("limit_x1", "broken")
    assert looks[5:] == [4000]
    twin.set_input("limit_x1", "broken")
    assert looks[5:] == [4000], "nothing has changed"
    twin.run_until(10_000)
    assert looks[6:] == [4500, 5500, 6500, 7500, 8500, 9500]
    with pytest.raises(ValueError, match="must be positive"):
        twin.observe(lambda seen: None, 0)


def test_stop_is_asked_whenever_something_has_happened(build: Build) -> None:
    controller = Scripted()
    for t in (10, 20, 30):
        controller.at(t, lambda: None)
    twin = build(controller)
    twin.run_until(100, lambda: twin.time_ns >= 20)
    assert twin.time_ns == 20
    twin.run_until(15)
    assert twin.time_ns == 20, "a time in the past does nothing"
    twin.run_until(100)
    assert twin.time_ns == 100


def test_next_event_is_the_earliest_of_all(build: Build) -> None:
    controller = Scripted()
    controller.at(900 * MILLISECOND_NS, lambda: controller.start(steps(900, 0, 0, 0, start_ns=900 * MILLISECOND_NS)))
    twin = build(controller)
    assert twin.next_event_ns == 900 * MILLISECOND_NS
    twin.run_until(900 * MILLISECOND_NS)
    assert twin.next_event_ns is not None
    assert 900 * MILLISECOND_NS < twin.next_event_ns <= 910 * MILLISECOND_NS, "something moves"
    twin.run(1.0)
    assert twin.next_event_ns is None


def test_a_machine_that_still_moves_may_bring_something_about(build: Build) -> None:
    """Without a motion or a timer, but pushed: whoever paces the twin has to look again."""
    twin = build(Scripted(), "mujoco")
    twin.run(1.0)
    assert twin.next_event_ns is None
    twin.apply_force(1, 300.0)
    twin.run(0.001)
    assert twin.next_event_ns is not None
    assert twin.time_ns < twin.next_event_ns <= twin.time_ns + 10 * MILLISECOND_NS
    twin.run(5.0)
    assert twin.next_event_ns is None


def test_whoever_builds_the_twin_has_the_last_word_on_its_machine(build: Build) -> None:
    """The controller wants an ideal machine; its switches bounce all the same, and nothing else is as it was."""
    twin = build(Scripted(), overrides={"imperfections.bounce": True})
    assert twin.machine.imperfections.bounce
    assert not twin.machine.imperfections.backlash


def test_a_scenario_happens_at_its_times(build: Build, tmp_path: Any) -> None:
    file = tmp_path / "scenario.toml"
    file.write_text(
        '[[event]]\nat = 0.001\nset = { limit_y1 = "broken" }\n[[event]]\nat = 0.0025\nset = { limit_y1 = "ok" }\n'
    )
    controller = Scripted()
    twin = build(controller, scenario=file)
    assert twin.next_event_ns == MILLISECOND_NS
    twin.run(0.01)
    assert controller.edges == [(1_000_000, "limit_y1", False), (2_500_000, "limit_y1", True)]
