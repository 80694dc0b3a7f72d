"""GMI99: axes that leave the interpolation (3.1.1 p4, FB 254.6). Top speed 50000 Hz, B 50 Hz/ms, f 10000 Hz."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.gmi99_desk import READY, STATUS, CardDesk, command, prepared, running, short
from conformance.rows import shows

X, Y, Z = 0x81, 0x82, 0x84
PROGRAM, TURN, WAIT = 1, 2, 0


def record(number: int, *frames: str) -> tuple[str, ...]:
    return command("p", 3, 100, number), *frames, command("p", 3, 101)


def p4(axis: int, what: int, value: int = 0) -> str:
    return command("p", 4, value & 0xFFFFFF, axis << 8 | what)


def together(desk: CardDesk, first: int, a: int, b: int) -> bool:
    """True if two axes have moved in the same ticks for a while."""
    delta = desk.steps_since(first).delta
    return int(np.sum((delta[:, a] != 0) & (delta[:, b] != 0))) > 50


UP_AND_DOWN = record(3, command("f", 5_000), command(Z, 4_000), command(Z, 0), command(Z, 2_000))


@shows("gmi99-3.1.1-68")
def test_an_axis_runs_a_program_of_its_own_beside_the_path() -> None:
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN)
    first = desk.ticks
    desk.tell(p4(2, PROGRAM, 3), command(0x83, 20_000, 10_000))
    desk.finish()
    assert desk.counts[:3] == (20_000, 10_000, 2_000)
    assert together(desk, first, 0, 2)
    assert not desk.controller.fault


@shows("gmi99-3.1.1-68")
def test_the_path_is_as_it_is_without_it_and_so_is_the_program() -> None:
    """The sum of both: each axis makes the same set points as alone, at the same times from its beginning on."""
    alone = prepared(*record(0, command(X, 1)), *UP_AND_DOWN)
    first = alone.ticks
    alone.tell(p4(2, PROGRAM, 3))
    alone.finish()
    program = alone.steps_since(first).delta[:, 2]
    mark = alone.ticks
    alone.tell(command(0x83, 20_000, 10_000))
    alone.finish()
    path = alone.steps_since(mark).delta[:, :2]
    both = prepared(*record(0, command(X, 1)), *UP_AND_DOWN)
    first = both.ticks
    both.tell(p4(2, PROGRAM, 3), command(0x83, 20_000, 10_000))
    both.finish()
    delta = both.steps_since(first).delta
    assert np.trim_zeros(delta[:, 2]).tolist() == np.trim_zeros(program).tolist()
    moved = delta[:, :2][np.any(delta[:, :2] != 0, axis=1)]
    assert moved.tolist() == path[np.any(path != 0, axis=1)].tolist()


@shows("gmi99-3.1.1-68")
def test_a_command_waits_until_the_program_of_an_axis_is_done() -> None:
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN)
    first = desk.ticks
    desk.tell(p4(2, PROGRAM, 3), p4(2, WAIT), command(X, 20_000))
    desk.finish()
    assert (desk.counts[0], desk.counts[2]) == (20_000, 2_000)
    assert not together(desk, first, 0, 2)


@shows("gmi99-3.1.1-68")
def test_an_axis_is_back_in_the_interpolation_behind_its_program() -> None:
    """An absolute move then counts from where it is; while it is away a move of it is refused."""
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN)
    desk.tell(p4(2, PROGRAM, 3), command(Z, 500))
    assert desk.controller.fault
    desk.finish()
    assert desk.counts[2] == 2_000
    desk.tell(command(0x85, 1_000, 3_000))
    desk.finish()
    assert (desk.counts[0], desk.counts[2]) == (1_000, 3_000)


@shows("gmi99-3.1.1-68")
def test_a_plan_that_lasts_longer_than_the_program_ends_where_it_should() -> None:
    """X is still on its way when Z is back: a further move of both is joined to it, and counts from where Z is."""
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN)
    desk.tell(p4(2, PROGRAM, 3), command(X, 90_000))
    desk.run(5.0)
    desk.tell(command(0x85, 95_000, 6_000))
    desk.finish()
    assert (desk.counts[0], desk.counts[2]) == (95_000, 6_000)


@shows("gmi99-3.1.1-68")
@pytest.mark.parametrize("rev_min", [120, -120])
def test_an_axis_turns_like_a_spindle(rev_min: int) -> None:
    """With 1000 increments a revolution (N40) 120 1/min are 2000 Hz: 8 every 4 ms, beside a path and behind it."""
    desk = prepared(command("N", 1_000, 40, 2), p4(2, TURN, rev_min))
    desk.run(0.5)
    first = desk.ticks
    desk.tell(command(X, 3_000))
    desk.run(1.0)
    assert set(desk.steps_since(first).delta[:, 2].tolist()) == {8 if rev_min > 0 else -8}
    assert desk.counts[0] == 3_000
    desk.tell(p4(2, TURN, 0))
    desk.run(0.2)
    rest = desk.counts[2]
    desk.run(0.5)
    assert desk.counts[2] == rest
    desk.tell(command(Z, 0))
    desk.finish()
    assert desk.counts[2] == 0


@shows("gmi99-3.1.1-68")
def test_a_spindle_turns_round_by_way_of_standstill() -> None:
    desk = prepared(command("N", 1_000, 40, 2), p4(2, TURN, 600))
    desk.run(0.5)
    first = desk.ticks
    desk.tell(p4(2, TURN, -600))
    desk.run(1.2)
    changes = np.diff(desk.steps_since(first).delta[:, 2])
    assert np.abs(changes).max() <= 2, "50 Hz/ms are 0.8 increments a tick and tick"
    assert desk.steps_since(first).delta[-1, 2] == -40


@shows("gmi99-6.1.3-16")
def test_function_6_tells_which_axes_have_left_the_interpolation() -> None:
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN)
    desk.tell(p4(2, PROGRAM, 3))
    assert desk.controller._card.uncoupled == 4  # type: ignore[attr-defined]
    desk.finish()
    assert desk.controller._card.uncoupled == 0  # type: ignore[attr-defined]


FOLLOWS = "OB 1\nU M 40.0\nSPB =OFF\nL KF 1\nSPA =GO\nOFF: L KF 0\nGO: L KF 30\nSPA FB 254\nBE\n"
"""FB 254.30 with 1, and with 0 while M40.0 is set."""
ONCE = r"OB 21|L KF 1|L KF 30|SPA FB 254|BE|OB 1|BE|".replace("|", "\n")
"""With 1, when the PLC is started."""


def followed(feed: int, plc: str) -> tuple[float, float]:
    """Turns of Z, 1000 increments each, told 600 1/min at f 10000, along a path of 20000 increments at that feed; and
    its highest speed in Hz."""
    desk = running(plc)
    desk.run(0.05)
    desk.tell(command("N", 1_000, 40, 2), command("f", 10_000), p4(2, TURN, 600), command("f", feed))
    desk.run(0.5)
    assert desk.counts[2] == 0, "the path stands"
    first = desk.ticks
    desk.tell(command(X, 20_000))
    desk.finish()
    desk.run(0.2)
    delta = desk.steps_since(first).delta[:, 2]
    return delta.sum() / 1_000.0, float(delta.max()) / 0.004


@shows("gmi99-1.4-1")
@pytest.mark.parametrize(
    ("feed", "plc"), [(10_000, FOLLOWS), (5_000, ONCE), (20_000, ONCE)], ids=["f", "half", "twice"]
)
def test_the_speed_of_a_spindle_follows_the_feed(feed: int, plc: str) -> None:
    """600 1/min at 10000 Hz are 1 increment for each of the path: 20 turns, whatever feed comes later."""
    turns, hz = followed(feed, plc)
    assert turns == pytest.approx(20.0, abs=0.2)
    assert hz == pytest.approx(feed, rel=0.03)


@shows("gmi99-1.4-1")
def test_function_30_with_0_ends_it() -> None:
    """The spindle turns with what it was told, 600 1/min, while the path stands."""
    desk = running(FOLLOWS)
    desk.run(0.05)
    desk.tell(command("N", 1_000, 40, 2), command("f", 10_000), p4(2, TURN, 600))
    desk.run(0.3)
    assert desk.counts[2] == 0
    desk.tell(command("p", 11, 40, 1))
    desk.run(0.5)
    first = desk.ticks
    desk.run(0.4)
    assert desk.steps_since(first).delta[:, 2].sum() == pytest.approx(4_000, abs=50)


# what else may happen to them


@pytest.mark.parametrize("frame", [
    p4(2, PROGRAM, 4), p4(2, PROGRAM, 40), p4(3, PROGRAM, 3), p4(2, 3), p4(2, TURN, 100),
])  # fmt: skip
def test_what_is_refused(frame: str) -> None:
    """No such program, an axis that N10 leaves out, no such action, and no N40: nothing moves."""
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN, frame)
    desk.finish()
    assert desk.controller.fault
    assert (desk.counts[2], desk.ask(STATUS)) == (0, READY)


def test_a_program_with_moves_of_others_ends_there() -> None:
    desk = prepared(*record(0, command(X, 1)), *record(3, command(Z, 500), command(X, 700), command(Z, 900)))
    desk.tell(p4(2, PROGRAM, 3))
    desk.finish()
    assert (desk.controller.fault, desk.counts[0], desk.counts[2]) == (True, 0, 500)


def test_a_break_off_brakes_them_and_nothing_goes_on() -> None:
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN, command("N", 1_000, 40, 1))
    desk.tell(p4(2, PROGRAM, 3), p4(1, TURN, 120), command(X, 20_000))
    desk.run(0.4)
    desk.tell(short(0))
    desk.run(0.6)
    here = desk.counts
    desk.run(1.0)
    assert desk.counts == here
    assert 0 < here[2] < 4_000
    desk.tell(command(0x87, 100, 200, 300))
    desk.finish()
    assert desk.counts[:3] == (100, 200, 300)


def test_the_stop_flag_holds_them() -> None:
    """M0.0: MB0 = 1, set by p11."""
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN, command("N", 1_000, 40, 1))
    desk.tell(p4(2, PROGRAM, 3), p4(1, TURN, 120))
    desk.run(0.4)
    desk.tell(command("p", 11, 0, 1))
    desk.run(0.5)
    held = desk.counts
    desk.run(0.5)
    assert desk.counts == held
    desk.tell(command("p", 11, 0, 0))
    desk.run(3.0)
    assert desk.counts[2] == 2_000
    assert desk.counts[1] > held[1] + 4_000


def test_an_emergency_stop_ends_them() -> None:
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN, command("N", 1_000, 40, 1))
    desk.tell(p4(2, PROGRAM, 3), p4(1, TURN, 120))
    desk.run(0.4)
    desk.set("estop", "pressed")
    here = desk.counts
    desk.run(0.5)
    desk.set("estop", "released")
    desk.run(0.5)
    assert desk.counts == here
    desk.tell(command("Q", 7), command(Y, 100))
    desk.finish()
    assert desk.counts[:3] == (0, 100, 0)


def test_a_limit_switch_stops_an_axis_that_turns() -> None:
    """X at 100 mm of 395; -6000 1/min of 1000 increments are cut to M: 50 mm/s, and braked with 4 B."""
    desk = prepared(command("N", 1_000, 40, 0), p4(0, TURN, -6_000))
    desk.run(4.0)
    here = desk.counts[0]
    assert -107_000 < here < -100_000
    desk.run(1.0)
    assert desk.counts[0] == here
    assert desk.status() & 0x40, "the indexer is not ready"


def test_none_leaves_while_nothing_moves() -> None:
    """N17 = 1: everything takes its time, and no set points are sent."""
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN, command("N", 1, 17), p4(2, PROGRAM, 3), command(X, 500))
    desk.finish()
    assert (desk.controller.fault, desk.ticks) == (True, 0)


def test_no_counter_is_set_meanwhile() -> None:
    desk = prepared(command("N", 1_000, 40, 2), p4(2, TURN, 120))
    desk.run(0.5)
    desk.tell(command("O", 0, 2), command("Q", 4))
    desk.run(0.5)
    assert desk.controller.fault
    assert desk.counts[2] > 1_000
    desk.tell(command("O", 77, 0))
    assert desk.counts[0] == 77


@shows("gmi99-3.1.1-68")
def test_what_a_program_of_an_axis_may_have() -> None:
    """Relative moves, rapid at the axis' own M, outputs and waits, and an end before the end."""
    steps = (
        command("G", 91), command(Z, 1_000), command("G", 90), command("f", 1_000), command(Z, 1_500), command("G", 0),
        command("p", 10, 16, 3), command("p", 10, 14, 2), command(Z, 12_000), command("p", 3, 2), command(Z, 0),
    )  # fmt: skip
    desk = prepared(*record(0, command(X, 1)), *record(3, *steps), command("M", 20_000, 3))
    desk.tell(p4(2, PROGRAM, 3))
    desk.run(0.3)
    first = desk.ticks
    desk.run(0.2)
    assert desk.steps_since(first).delta[:, 2].max() == 4, "f 1000"
    assert not desk.outputs.get("a0.3", 0)
    desk.run(0.4)
    assert desk.outputs["a0.3"] == 1
    first = desk.ticks
    desk.finish()
    assert desk.counts[2] == 12_000
    assert desk.steps_since(first).delta[:, 2].max() == pytest.approx(80, abs=1), "M of Z is 20000 Hz"
    assert not desk.controller.fault


def test_an_axis_that_runs_a_program_does_not_turn_and_one_that_brakes_may_turn_again() -> None:
    desk = prepared(*record(0, command(X, 1)), *UP_AND_DOWN, command("N", 1_000, 40, 1), command("N", 1_000, 40, 2))
    desk.tell(p4(2, PROGRAM, 3), p4(2, TURN, 120), p4(1, TURN, 1_200))
    assert desk.controller.fault
    desk.run(0.6)
    desk.tell(p4(1, TURN, 0), p4(1, TURN, 120))
    desk.run(1.0)
    first = desk.ticks
    desk.run(0.3)
    assert set(desk.steps_since(first).delta[:, 1].tolist()) == {8}
    desk.run(1.0)
    assert desk.counts[2] == 2_000


def test_m_of_the_axis_bounds_how_fast_it_turns() -> None:
    """1200 1/min of 1000 increments would be 20000 Hz: M of Y is 4000."""
    desk = prepared(command("M", 4_000, 2), command("N", 1_000, 40, 1), p4(1, TURN, 1_200))
    desk.run(0.3)
    first = desk.ticks
    desk.run(0.3)
    assert set(desk.steps_since(first).delta[:, 1].tolist()) == {16}


@pytest.mark.parametrize("frame", [command("m", 53), command("p", 3, 1, 0), command("G", 54)])
def test_what_is_nothing_for_a_single_axis_ends_its_program(frame: str) -> None:
    desk = prepared(*record(0, command(X, 1)), *record(3, command(Z, 500), frame, command(Z, 900)))
    desk.tell(p4(2, PROGRAM, 3))
    desk.run(2.0)
    assert (desk.controller.fault, desk.counts[2]) == (True, 500)
