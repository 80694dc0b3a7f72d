"""GMI99, sections 2, 3.1.1 Q, 3.2: drives becoming ready and losing readiness. What the drives do is decided (G16 to
G20): their own manual is not to be had."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.gmi99_desk import (
    BUSY_MOVING,
    NOT_READY,
    OK,
    READY,
    STATUS,
    TICK_NS,
    TO_0,
    TO_20000,
    TRAVEL,
    CardDesk,
    PositionSwitch,
    command,
    fresh,
    long,
    prepared,
)
from conformance.rows import shows

REFERENCE = "68 08 08 68 E0 51 07 00 00 01 00 00 39 16"


@shows("gmi99-2-3", "gmi99-3.1.1-29", "gmi99-3.1.1-31", "gmi99-3.2-6")
def test_a_reference_run() -> None:
    """100 mm to the switch at 10 mm/s, then at 2 mm/s to the first zero pulse after the point where it is free: a turn
    on at the desk, which has no encoders."""
    desk = fresh()
    assert desk.ask(REFERENCE) == OK
    assert desk.ask(STATUS) == "10 E0 D0 B0 16"
    desk.run(9.0)
    assert desk.ask(STATUS) == "10 E0 D0 B0 16"
    desk.finish()
    assert 12.5 < desk.time_ns / 1e9 < 13.5
    assert [desk.set_position(axis) for axis in range(3)] == [0, 0, 0]
    assert desk.ask(STATUS) == READY
    free = 8 + 1
    assert np.all(np.abs(desk.carriage[:3] - 5000 - free) <= 9)
    assert np.abs(desk.steps.delta).max() <= 40


@shows("gmi99-2-3")
def test_a_reference_run_repeats_to_an_increment() -> None:
    places = set()
    for start in (20_000, 20_003, 20_017, 20_031):
        desk = CardDesk.of("gmi99", carriage=(start,) * 3, position_switches=[PositionSwitch("limit_x1", 0, 0, -1)])
        desk.ask(command("Q", 1, 1))
        desk.finish()
        places.add(int(desk.carriage[0]))
    assert max(places) - min(places) <= 8, "an edge is seen at a set point: 8 increments at 2000 Hz on this desk"


@shows("gmi99-2-3")
def test_a_reference_run_may_begin_on_the_switch() -> None:
    desk = CardDesk.of("gmi99", carriage=(-100, -100, -100))
    desk.ask(command("N", 1, 10))
    desk.ask(command("Q", 1, 1))
    desk.finish()
    assert desk.ask(STATUS) == READY
    assert desk.steps.delta[:, 0].min() >= 0


@shows("gmi99-3.1.1-31")
def test_axes_are_referenced_in_the_order_of_their_commands() -> None:
    desk = fresh()
    assert desk.tell(command("Q", 4, 1), command("Q", 3, 1)) == [OK, OK]
    desk.run(3.0)
    assert desk.counts[2] < 0
    assert desk.counts[:2] == (0, 0)
    desk.finish()
    assert desk.ask(STATUS) == READY


@shows("gmi99-3.2-8")
def test_not_all_axes_are_ready() -> None:
    desk = fresh()
    assert desk.tell(command("Q", 3), STATUS, command("Q", 4), STATUS) == [OK, NOT_READY, OK, READY]


@shows("gmi99-3.1.1-29")
def test_a_reference_run_that_finds_no_switch_fails() -> None:
    desk = CardDesk.of("gmi99", position_switches=[], carriage=(0, 0, 0))
    desk.ask(command("Q", 1, 1))
    desk.finish()
    assert desk.ask(STATUS) == NOT_READY
    assert desk.controller.fault
    assert desk.counts[0] == -480_000


@shows("gmi99-3.2-1")
def test_a_reference_run_is_broken_off() -> None:
    desk = fresh()
    desk.ask(REFERENCE)
    desk.run(2.0)
    desk.ask("10 E0 00 E0 16")
    desk.finish()
    assert desk.ask(STATUS) == NOT_READY
    assert desk.time_ns == 2_100_000_000, "10000 Hz at 100 Hz/ms"


@shows("gmi99-3.2-5", "gmi99-6.1.1-4", "gmi99-3.2-7")
def test_an_emergency_stop_in_motion() -> None:
    desk = prepared()
    t0 = desk.time_ns
    desk.ask(TO_20000)
    desk.at_ms(t0, 1000)
    desk.set("estop", "pressed")
    assert desk.outputs["stages"] == 0
    assert desk.ask("10 E0 01 E1 16") == "10 E0 48 28 16"
    assert desk.ask(command("T", 1, 3, 0)) == long(b"I\x80\x04"), "M0.4 = 0, M0.7 = 1; M1.2: no command"
    assert desk.controller.run is None
    desk.set("estop", "released")
    assert desk.ask("10 E0 01 E1 16") == "10 E0 40 20 16"
    assert desk.ask("68 08 08 68 E0 51 07 00 00 01 00 00 39 16") == OK
    desk.finish()
    assert desk.ask(STATUS) == "10 E0 00 E0 16"
    assert desk.cabinet.relay


@shows("gmi99-3.2-5")
def test_nothing_becomes_ready_while_the_emergency_stop_is_pressed() -> None:
    desk = fresh()
    desk.set("estop", "pressed")
    assert desk.tell(command("Q", 7), STATUS) == [OK, "10 E0 48 28 16"]
    assert desk.controller.fault


@shows("gmi99-3.2-7")
def test_an_open_hood_takes_the_supply_away() -> None:
    desk = prepared()
    desk.ask(TO_20000)
    desk.run(0.5)
    desk.set("hood", "forced")
    assert desk.ask(STATUS) == NOT_READY
    assert desk.outputs["stages"] == 0
    assert desk.tell(command("Q", 7), STATUS) == [OK, "10 E0 C0 A0 16"]
    desk.finish()
    assert desk.controller.fault
    desk.set("hood", "closed")
    assert desk.tell(command("Q", 7), STATUS) == [OK, READY]


@shows("gmi99-6.1.1-5")
def test_a_limit_switch_ends_the_motion() -> None:
    """Decision gmi99/18: at 10000 Hz and four times 50 Hz/ms 250 increments and 50 ms more."""
    desk = CardDesk.of("gmi99", carriage=(390_000, 100_000, 50_000), position_switches=_far_switch())
    desk.tell(command("Q", 7), command("M", 50_000), command("f", 10_000), TO_20000, TO_0)
    desk.finish()
    assert desk.status() == 0x40
    assert 5200 <= desk.counts[0] <= 5300
    assert desk.controller.fault
    assert desk.outputs["stages"] == 1
    assert desk.ask(command("T", 1, 3, 0)) == long(b"I\x90\x04")
    assert desk.tell(command("Q", 7), TO_20000) == [OK, OK]
    desk.finish()
    assert desk.counts[0] == 0, "not further onto the switch"
    assert desk.tell(command("Q", 7), command(0x81, -1000)) == [OK, OK]
    desk.finish()
    assert desk.counts[0] == -1000


def _far_switch() -> list[PositionSwitch]:
    return [PositionSwitch("limit_x2", 0, TRAVEL[0], 1)]


@shows("gmi99-6.1.1-5")
def test_a_drive_fault_ends_the_motion() -> None:
    desk = prepared()
    desk.ask(TO_20000)
    desk.run(1.0)
    desk.set("slot0.fault", True)
    assert desk.ask(STATUS) == "10 E0 D0 B0 16", "the other axes brake"
    desk.finish()
    assert desk.ask(STATUS) == NOT_READY
    desk.set("slot0.fault", False)
    assert desk.tell(command("Q", 7), STATUS)[0] == OK
    desk.finish()
    assert desk.ask(STATUS) == READY


@shows("gmi99-3.1.1-16")
def test_waiting_for_in_position() -> None:
    desk = prepared()
    assert desk.tell(TO_20000, command("H", 2), command(0x81, 0)) == [OK] * 3
    desk.finish()
    assert desk.counts[0] == 0


@pytest.mark.parametrize("until_ms", [0, 1, 3, 4, 5, 7])
@shows("gmi99-1.2-1")
def test_motion_begins_on_the_grid(until_ms: float) -> None:
    desk = prepared()
    desk.run(until_ms / 1000)
    sent_ns = desk.time_ns
    desk.ask(TO_20000)
    assert desk.ask(STATUS) == BUSY_MOVING
    desk.finish()
    started_ns = int(desk.steps.t_ns[0]) - TICK_NS
    assert started_ns % TICK_NS == 0
    assert 0 <= started_ns - sent_ns < TICK_NS
