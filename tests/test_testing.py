"""The test desk itself: exact switch edges, exact deadlines, and controllers that break the protocol are found out."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from isel_twin.controller import CounterSet, DriveInput, Drives, Event, Output, Reply, SerialFormat
from isel_twin.motion import StepRun, constant, line
from isel_twin.testing import Desk, PositionSwitch, ProtocolError, StillBusyError

MS = 1_000_000


class Toy:
    """Answers "k" at once, moves X by -100 at 1 kHz on "m", stops at terminal "end" going low, fails on request."""

    serial_format = SerialFormat(19_200)
    direction = (1, 1, 1, 1)

    def __init__(self, flash: bytes | None) -> None:
        self.run: StepRun | None = None
        self.begin = (0, 0, 0, 0)
        self.counts = (0, 0, 0, 0)
        self.events: list[Event] = []
        self.heard: list[tuple[int, str, bool]] = []
        self.advanced: list[int] = []

    @property
    def next_ns(self) -> int | None:
        return self.run.end_ns if self.run else None

    @property
    def idle(self) -> bool:
        return self.run is None

    def _pass(self, t_ns: int) -> None:
        if self.run is not None:
            self.counts = tuple(b + d for b, d in zip(self.begin, self.run.displacement(t_ns), strict=True))
            if t_ns >= self.run.end_ns:
                self.run = None
                self.events.append(Reply(b"0"))

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self.levels = dict(levels)

    def receive(self, t_ns: int, data: bytes) -> None:
        self._pass(t_ns)
        for value in data.decode():
            if value == "k":
                self.events.append(Reply(b"k"))
            elif value == "m":
                self.begin = self.counts
                self.run = StepRun(line((-100, 0, 0, 0)), constant(100, 1000), t_ns)
            elif value == "p":
                self.events.append(Output("power_request", 1))
            elif value == "!":
                self.counts = (7, 0, 0, 0)
            elif value == "=":
                self.counts = (7, 0, 0, 0)
                self.events.append(CounterSet(0, 7))

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._pass(t_ns)
        self.heard.append((t_ns, terminal, level))
        if terminal == "end" and not level and self.run is not None:
            self.run = None
            self.events.append(Reply(b"2"))

    def advance(self, t_ns: int) -> None:
        self.advanced.append(t_ns)
        self._pass(t_ns)

    def take(self) -> list[Event]:
        events, self.events = self.events, []
        return events

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return {"end": ("limit_x1",), "power": ("power_ok",), "chain": ("estop_1", "hood_setup")}


def toy(x: int = 0, trip: int = -1000, hysteresis: int = 3) -> tuple[Desk, Toy]:
    switch = PositionSwitch("limit_x1", 0, trip, -1, hysteresis)
    desk = Desk(Toy, carriage=(x, 0, 0, 0), position_switches=[switch])
    assert isinstance(desk.controller, Toy)
    return desk, desk.controller


def test_reply_comes_at_the_end_of_the_run_and_every_tick_is_recorded() -> None:
    desk, controller = toy()
    desk.run(1.0)
    desk.send(b"m")
    assert desk.finish() == "0"
    assert desk.time_ns == 1_100 * MS
    assert desk.replies == [(1_100 * MS, b"0")]
    assert desk.steps.t_ns.tolist() == [1_000 * MS + k * MS for k in range(1, 101)]
    assert desk.steps.total == (-100, 0, 0, 0)
    assert controller.advanced == sorted(controller.advanced)


def test_switch_edge_comes_at_the_very_tick() -> None:
    desk, controller = toy(x=10, trip=-30)
    desk.send(b"m")
    assert desk.finish() == "2"
    assert controller.heard == [(40 * MS, "end", False)]
    assert desk.time_ns == 40 * MS
    assert len(desk.steps) == 40
    assert desk.counts == (-40, 0, 0, 0)


def test_switch_closes_behind_its_hysteresis() -> None:
    switch = PositionSwitch("limit_x1", 0, -20, +1, 3)
    desk = Desk(Toy, carriage=(0, 0, 0, 0), position_switches=[switch])
    assert desk.levels["end"] is False
    desk.send(b"m")
    assert desk.finish() == "0"
    assert desk.inputs_log == [(24 * MS, "end", True)]


def test_cabinet_and_series_wiring() -> None:
    desk, controller = toy()
    desk.set("estop", "pressed")
    assert sorted(controller.heard) == [(0, "chain", False), (0, "power", False)]
    desk.send(b"p")
    assert desk.levels == {"end": True, "power": False, "chain": False}
    desk.set("estop", "released")
    assert desk.levels["chain"] is True


def test_agenda_and_forced_wires() -> None:
    desk, controller = toy()
    desk.at(0.03, lambda: desk.set("limit_x1", "open"))
    desk.send(b"m")
    assert desk.finish() == "2"
    assert desk.time_ns == 30 * MS
    desk.set("end", True)
    desk.set("end", "free")
    assert [level for _, _, level in controller.heard] == [False, True, False]
    with pytest.raises(KeyError, match="nonesuch"):
        desk.set("nonesuch", True)


def test_counters_that_do_not_follow_the_stream_are_found_out() -> None:
    desk, _ = toy()
    desk.send(b"=")
    assert desk.counts == (7, 0, 0, 0)
    desk, _ = toy()
    with pytest.raises(ProtocolError, match="counters"):
        desk.send(b"!")


def test_a_controller_that_never_comes_to_rest_is_found_out() -> None:
    desk, _ = toy()
    desk.send(b"m")
    with pytest.raises(StillBusyError, match=r"0\.05 s"):
        desk.finish(0.05)


def test_bytes_one_by_one_take_their_time() -> None:
    desk, _ = toy()
    desk.send(b"kk", byte_time_ns=520_833)
    assert desk.replies == [(520_833, b"k"), (1_041_666, b"k")]


def test_power_cycle_starts_a_new_life_with_the_old_record() -> None:
    desk, _ = toy()
    desk.send(b"m")
    desk.run(0.05)
    desk.power_cycle(2.0)
    assert desk.counts == (0, 0, 0, 0)
    assert desk.time_ns == 2_050 * MS
    assert desk.steps.total == (-50, 0, 0, 0)
    assert desk.carriage.tolist() == [-50, 0, 0, 0]


class Asking(Toy):
    """Asks its drives, and listens to one of them."""

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return {}

    def drive_inputs(self) -> list[DriveInput]:
        return [DriveInput("lost", 0, "fault")]

    def use_drives(self, drives: Drives) -> None:
        self.drives = drives


def test_a_controller_that_asks_has_ideal_drives() -> None:
    desk = Desk(Asking)
    controller = desk.controller
    assert isinstance(controller, Asking)
    desk.send(b"m")
    desk.run(1.0)
    drives = controller.drives
    assert drives.encoder == desk.counts == (-100, 0, 0, 0)
    assert drives.lag == drives.speed == (0.0,) * 4
    assert drives.in_position == (True,) * 4
    assert drives.fault == drives.overloaded == drives.on == (False,) * 4
    desk.set("lost", True)
    assert controller.heard[-1] == (desk.time_ns, "lost", True)
