"""Jobs, memory and faults: what ismif/1 to ismif/12 say where the manual is silent."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from conformance.ismif_desk import (
    ACK,
    DONE,
    FULL,
    HYSTERESIS,
    fresh,
    job,
    moved,
    now,
    pulse_times_ns,
    referenced,
    send_job,
    status,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.controller import create_controller
from isel_twin.firmware.ismif.memory import QUEUE_SIZE, ReceiveQueue
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=4)

# --- S1: wrong commands -------------------------------------------------------------------------------------------


def test_a_wrong_command_voids_its_job() -> None:
    desk = referenced()
    mark = desk.ticks
    assert now(desk, "L1,x100") == ACK
    assert now(desk, "L1,q100") == ACK
    assert status(desk) == "001000"
    assert now(desk, "L1,y100") == ACK
    assert job(desk, "A1") == ACK + DONE
    assert (desk.ticks, desk.outputs["pin12"]) == (mark, 0)
    assert moved(desk, "L1,z10").total == (0, 0, 10, 0)  # the next job is another one


@pytest.mark.parametrize("command", ["@R", "@S"])
def test_a_wrong_command_is_forgotten_with_the_memory(command: str) -> None:
    desk = referenced()
    now(desk, "L1,q100")
    now(desk, command)
    assert moved(desk, "L1,x10").total == (10, 0, 0, 0)


def test_a_wrong_command_does_not_disturb_the_running_job() -> None:
    desk = referenced()
    send_job(desk, "L1,X900")
    desk.run(0.2)
    assert now(desk, "nonsense") == ACK
    assert status(desk) == "101001"
    assert desk.finish() == DONE
    assert desk.counts == (900, 0, 0, 0)


def test_a_target_out_of_range_ends_its_job() -> None:
    desk = referenced("#R0", "#E1,5000")
    mark = desk.ticks
    assert job(desk, "L1,x10", "L1,x8388600", "L1,y10") == ACK * 3 + DONE
    assert desk.steps_since(mark).total == (10, 0, 0, 0)
    assert status(desk) == "001000"


def test_a_failing_job_leaves_the_next_one_alone() -> None:
    desk = referenced()
    now(desk, "@A")
    send_job(desk, "L1,x8388600", "L1,x8388600", "L1,y10")
    send_job(desk, "L1,z10")
    mark = desk.ticks
    desk.read()
    assert now(desk, "@B") == ACK  # in the pause: the first job has not begun
    desk.start("@C")
    desk.run(1.0)
    desk.start("@B")
    assert desk.finish() == ACK + ACK + DONE + DONE
    assert desk.steps_since(mark).total[1:] == (0, 10, 0)
    assert status(desk)[2] == "1"


@pytest.mark.parametrize("waits_for_room", [True, False])
def test_the_rest_of_a_failing_job_that_a_full_memory_has_started_is_discarded(waits_for_room: bool) -> None:
    """84 KB: the second vector fails while the rest waits for room in the memory, or before it is sent."""
    desk = referenced("#R0")
    mark, replies = desk.ticks, []
    for command in ["L1,x5", "L1,x8388607"] + ["L1,x1,y1".ljust(27)] * 3000:
        desk.start(command)
        replies.append(desk.read())
        if waits_for_room and replies[-1] == FULL:
            replies.append(desk.finish())
            assert replies[-1] == DONE
    desk.send(b"L1,x7\x01")
    replies.append(desk.finish())
    text = "".join(replies)
    assert desk.steps_since(mark).total == (5, 0, 0, 0)
    assert (text.count("\x02"), text.endswith(DONE), len(text.replace(DONE, "").replace(FULL, ACK))) == (2, True, 3003)
    assert status(desk) == "001000"
    assert moved(desk, "L1,z10").total == (0, 0, 10, 0)


def test_lines_too_long_are_wrong_commands() -> None:
    desk = referenced()
    good = "L1,x" + "0" * 6 + "7"
    assert moved(desk, good + " " * (127 - len(good))).total == (7, 0, 0, 0)
    assert now(desk, good + " " * (128 - len(good))) == ACK
    assert status(desk) == "001000"
    assert now(desk, "x" * 100_000) == ACK
    assert now(desk, "@V") == "@V SMC-ISMIF 1.00\r"


def test_line_feeds_and_empty_lines_are_not_there() -> None:
    desk = referenced()
    desk.send(b"\n@V\r\n\r\r \r\n@LX\n\r")
    assert desk.read() == "@V SMC-ISMIF 1.00\r@LX0\r"
    assert status(desk) == "000000"


# --- S2: jobs and memory ------------------------------------------------------------------------------------------


def test_01h_by_itself_starts_what_is_stored() -> None:
    desk = referenced()
    assert now(desk, "L1,x10") == ACK
    desk.send(b"\x01")
    assert desk.finish() == DONE
    assert desk.counts == (10, 0, 0, 0)
    desk.send(b"\x01")
    assert desk.finish() == DONE  # an empty job is over at once


def test_a_command_in_a_running_job_waits_for_its_own_start() -> None:
    desk = referenced()
    send_job(desk, "L1,X900")
    desk.run(0.3)
    desk.read()
    assert now(desk, "L1,Y50") == ACK
    assert desk.finish() == DONE
    assert (desk.counts, status(desk)) == ((900, 0, 0, 0), "000000")
    desk.send(b"\x01")
    assert desk.finish() == DONE
    assert desk.counts == (900, 50, 0, 0)


def test_a_job_queued_behind_a_running_one() -> None:
    desk = referenced()
    send_job(desk, "L1,X900")
    send_job(desk, "L1,Y50")
    assert desk.finish() == ACK + ACK + DONE + DONE
    assert desk.counts == (900, 50, 0, 0)


@pytest.mark.parametrize("waits_for_answers", [True, False])
def test_nothing_is_lost_when_the_host_sends_more_than_the_memory_holds(waits_for_answers: bool) -> None:
    """3000 commands of 28 bytes, 84 KB. A rude host does not wait for answers; each is given once, in order."""
    desk = referenced("#R0", "#E1,5000")
    mark, replies, commands = desk.ticks, [], [f"L1,x{k % 2}".ljust(27) for k in range(3000)]
    for command in commands:
        desk.start(command)
        if waits_for_answers:
            while not (answer := desk.read()):
                desk.run(0.01)
            replies.append(answer)
    desk.send(b"\x01")
    replies.append(desk.finish())
    text = "".join(replies)
    assert desk.steps_since(mark).total == (1500, 0, 0, 0)
    assert FULL in text
    assert text.endswith(DONE)
    assert text.replace(DONE, "").replace(FULL, ACK) == ACK * len(commands)
    if not waits_for_answers:  # room is announced when nothing waits for it any more, then the end of the job
        assert text.endswith(ACK + DONE + DONE)
        assert text.count(DONE) == 2
    assert status(desk) == "000000"


def test_master_commands_overtake_a_full_memory() -> None:
    desk = referenced()
    send_job(desk, "W60000")
    desk.send(b"L1,x1\r" * 15_000)
    desk.read()
    assert status(desk) == "010001"
    assert now(desk, "@R") == ACK
    assert status(desk) == "000100"
    assert moved(desk, "L1,x3").total == (3, 0, 0, 0)


def test_a_pause_counts_as_idle_whatever_waits() -> None:
    desk = referenced()
    desk.start("@A")
    desk.send(b"L1,x1\r" * 15_000)
    assert desk.controller.idle
    desk.start("@C")
    assert not desk.controller.idle


def test_lines_beyond_the_receive_queue_are_lost_with_their_job() -> None:
    """64 KB of memory and 64 KB of queue hold at most 4096 commands of 32 bytes; those after them leave no trace."""
    desk = referenced("#R0", "#E1,5000")
    mark, line = desk.ticks, b"L1,x1" + b" " * 26 + b"\r"
    desk.start("@A")
    desk.read()
    desk.send(line * 4070)
    assert not desk.controller.fault
    desk.send(line * 3750)
    assert desk.controller.fault
    desk.send(b"L1,y1\r" * 1000 + b"L1,y1\x01")
    desk.start("@C")
    answers = desk.finish().replace(DONE, "").replace(FULL, ACK)
    assert 4070 < len(answers) - len(ACK) <= 4096  # one is that of @C
    assert desk.steps_since(mark).total[1:] == (0, 0, 0)
    assert 65_536 // 32 - 128 // 32 - 1 <= desk.ticks - mark <= 4096  # what full memories have started is made
    desk.send(b"L1,y9\x01")
    assert desk.finish() == ACK + DONE
    assert desk.steps_since(mark).total[1:] == (0, 0, 0)  # the loss took the 01h too: this was still the same job
    assert moved(desk, "L1,z10").total == (0, 0, 10, 0)


def test_the_end_of_each_line_takes_a_byte_of_the_queue() -> None:
    queue = ReceiveQueue()
    assert queue.append(b"x" * (QUEUE_SIZE - 2), False)
    assert queue.append(b"", False)
    assert not queue.append(b"", False)


def test_a_host_that_ignores_everything_fills_no_memory() -> None:
    """240 KB more into a paused interface that has been sent as many: it holds no more than before, within 16 KB, which
    is half a byte a command."""
    desk = referenced()
    desk.start("@A")
    desk.send(b"L1,x1\r" * 40_000)
    tracemalloc.start()
    try:
        desk.send(b"L1,x1\r" * 40_000)
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert grown < 16_384


# --- S8: reference run --------------------------------------------------------------------------------------------


def test_a_second_reference_run_begins_with_an_unknown_position() -> None:
    desk = referenced()
    send_job(desk, "$HX")
    desk.run(0.1)
    assert status(desk) == "100110"
    desk.finish()
    assert status(desk) == "000000"


def test_starting_on_the_switch_only_runs_off() -> None:
    desk = fresh()
    desk.carriage[0] = -20
    desk.run(0.0)
    desk.power_cycle()
    assert moved(desk, "$HX").delta[:, 0].tolist() == [1] * (20 + HYSTERESIS + 1 + 25)


def test_bounce_of_the_switch_does_not_end_the_free_run() -> None:
    desk = fresh()
    send_job(desk, "$HX")
    while desk.levels["pin11"]:
        desk.run(0.001)
    for k in range(3):
        desk.at(0.0002 + 0.0003 * k, lambda: desk.set("pin11", True))
        desk.at(0.0003 + 0.0003 * k, lambda: desk.set("pin11", False))
    desk.at(0.0012, lambda: desk.set("pin11", "free"))
    desk.finish()
    assert desk.carriage[0] == HYSTERESIS + 1 + 25
    assert status(desk)[2] == "0"


def test_a_switch_that_is_never_found_is_an_error() -> None:
    desk = fresh()
    desk.set("pin11", True)
    assert job(desk, "#R0", "#E2,5000", "$HX", "L1,x50") == ACK * 4 + DONE
    assert desk.steps.total == (-200_000, 0, 0, 0)
    assert status(desk) == "001100"
    assert [text for _, text in desk.remarks] == [
        "reference run of X: the reference input has not gone low in 200000 half steps of the search"
    ]


def test_a_switch_that_never_lets_go_is_an_error() -> None:
    """A broken wire, or another axis on its switch: the input is shared."""
    desk = fresh()
    desk.set("limit_z1", "open")
    assert job(desk, "$HX", "L1,x50") == ACK * 2 + DONE
    assert desk.steps.total == (4000, 0, 0, 0)
    assert status(desk) == "001100"
    assert [text for _, text in desk.remarks] == [
        "reference run of X: the reference input has not gone high in 4000 half steps of the free run"
    ]


def test_switches_do_not_matter_outside_a_reference_run() -> None:
    desk = referenced()
    send_job(desk, "L1,X900")
    desk.run(0.4)
    desk.set("pin11", False)
    desk.finish()
    assert desk.counts == (900, 0, 0, 0)
    assert status(desk) == "000000"


@pytest.mark.parametrize("after_s", [0.02, 0.3, 0.7, 0.9, 0.95, 1.0, 1.1])
def test_pause_in_a_reference_run(after_s: float) -> None:
    """Search from 50 to 883 ms, free run from 933 to 978, offset from 1028 to 1145: it goes on to the same end."""
    desk = fresh()
    send_job(desk, "$HX")
    desk.run(after_s)
    assert now(desk, "@A") == ACK
    desk.finish()
    assert status(desk) == "000110"
    stands = desk.ticks
    desk.run(10.0)
    assert desk.ticks == stands
    assert now(desk, "@C") + desk.finish() == ACK + DONE
    assert desk.carriage[0] == HYSTERESIS + 1 + 25
    assert desk.counts == (0, 0, 0, 0)


@pytest.mark.parametrize("after_s", [0.02, 0.3])
def test_stop_with_ramp_in_a_reference_run_breaks_it_off(after_s: float) -> None:
    desk = fresh()
    send_job(desk, "$HXYZ", "L1,x5")
    desk.run(after_s)
    desk.send(b"@B\r")
    desk.finish()
    assert status(desk) == "000100"
    assert desk.steps.delta[-5:].tolist() == [[1, 0, 0, 0]] * 5
    assert desk.struck("limit_x1") is False


# --- S9 to S12: pause, wait, reset, plotter -----------------------------------------------------------------------


def test_pause_suspends_a_waiting_time() -> None:
    desk = referenced()
    send_job(desk, "W1000", "L1,x10")
    desk.run(0.4)
    now(desk, "@A")
    assert status(desk) == "000001"
    desk.run(30.0)
    start_ns, mark = desk.time_ns, desk.ticks
    now(desk, "@C")
    assert status(desk) == "010001"
    desk.finish()
    assert (desk.steps_since(mark).t_ns - start_ns - 600_000_000).tolist() == pulse_times_ns(10, 600)


def test_stop_with_ramp_does_not_end_a_waiting_time() -> None:
    desk = referenced()
    send_job(desk, "W1000", "L1,x10")
    start_ns, mark = desk.time_ns, desk.ticks
    desk.run(0.4)
    assert now(desk, "@B") == ACK
    assert status(desk) == "010001"
    desk.finish()
    assert (desk.steps_since(mark).t_ns - start_ns - 10**9).tolist() == pulse_times_ns(10, 600)


def test_pause_at_rest_holds_the_next_job() -> None:
    desk = referenced()
    assert now(desk, "@A") == ACK
    send_job(desk, "L1,x10")
    desk.run(5.0)
    assert (desk.counts, status(desk)) == ((0, 0, 0, 0), "000001")
    assert now(desk, "@C").startswith(ACK)
    desk.finish()
    assert desk.counts == (10, 0, 0, 0)


def test_continue_on_the_ramp_goes_on_as_soon_as_it_stands() -> None:
    desk = referenced()
    send_job(desk, "L1,X3000")
    desk.run(1.5)
    now(desk, "@A")
    desk.run(0.2)
    now(desk, "@C")
    assert status(desk) == "100001"
    desk.finish()
    assert desk.counts == (3000, 0, 0, 0)


@settings(deadline=None, max_examples=drawn(60))
@given(st.lists(st.tuples(st.floats(0.0, 1.5), st.floats(0.0, 0.6)), max_size=5), st.booleans())
def test_any_pauses_leave_the_way_as_it_is(pauses: list[tuple[float, float]], full_steps: bool) -> None:
    """However often a job is paused and continued, on a ramp or not, it makes its path, tick for tick."""
    undisturbed, disturbed = (referenced(f"F{int(full_steps)}") for _ in range(2))
    commands = ("L1,X700,Y-20", "W200", "L1,x-300,z5")
    mark = undisturbed.ticks
    job(undisturbed, *commands)
    send_job(disturbed, *commands)
    for runs_s, stands_s in pauses:
        disturbed.run(runs_s)
        disturbed.start("@A")
        disturbed.run(stands_s)
        disturbed.start("@C")
    disturbed.finish()
    assert np.array_equal(disturbed.steps_since(mark).delta, undisturbed.steps_since(mark).delta)
    assert disturbed.counts == undisturbed.counts
    assert status(disturbed) == "000000"


def test_stop_with_ramp_in_a_pause_forgets_the_vector() -> None:
    desk = referenced()
    send_job(desk, "L1,X3000", "L1,Y5")
    desk.run(1.5)
    now(desk, "@A")
    desk.finish()
    x = desk.counts[0]
    now(desk, "@B")
    now(desk, "@C")
    desk.finish()
    assert desk.counts == (x, 5, 0, 0)


def test_reset_and_stop_switch_the_signals_off() -> None:
    desk = referenced("A1", "Z2", "L1,Z5")
    assert (desk.outputs["pin12"], desk.outputs["z_relay"]) == (1, 1)
    now(desk, "@S")
    assert (desk.outputs["pin12"], desk.outputs["z_relay"]) == (0, 0)


def test_stop_keeps_the_error_and_reset_clears_it() -> None:
    desk = referenced()
    now(desk, "nonsense")
    now(desk, "@S")
    assert status(desk) == "001100"
    now(desk, "@R")
    assert status(desk) == "000100"


def test_plotter_needs_no_reference_of_z() -> None:
    desk = fresh()
    job(desk, "Z2", "$HXYZ")
    assert status(desk) == "000000"
    assert not desk.steps.delta[:, 2].any()
    job(desk, "L1,Z-3")
    assert now(desk, "@LZ") == "@LZ-3\r"
    assert desk.outputs["z_relay"] == 1


def test_positions_survive_a_change_between_half_and_full_steps() -> None:
    desk = referenced("L1,X201")
    assert job(desk, "F1") == ACK + DONE
    assert now(desk, "@LX") == "@LX100\r"
    assert moved(desk, "L1,X0").total == (-200, 0, 0, 0)
    assert job(desk, "F0") == ACK + DONE
    assert now(desk, "@LX") == "@LX1\r"


def test_full_steps_below_zero_count_without_a_gap() -> None:
    """From half step -3 on: full steps -2, -1, 0, 1, none of them twice."""
    desk = referenced("L1,X-3", "F1")
    seen = [now(desk, "@LX")]
    for _ in range(3):
        moved(desk, "L1,x1")
        seen.append(now(desk, "@LX"))
    assert seen == ["@LX-2\r", "@LX-1\r", "@LX0\r", "@LX1\r"]


def test_settings_do_not_survive_the_mains() -> None:
    desk = referenced("#E1,5000", "F1", "T1", "A1")
    desk.power_cycle()
    assert status(desk) == "000100"
    assert (desk.outputs["pin12"], desk.outputs["full_steps"], desk.outputs["clock_signals"]) == (0, 0, 0)
    assert moved(desk, "L1,x300").t_ns.tolist() == pulse_times_ns(300, 600)


# --- S15: the fault a caller sees -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"L1,x10\x01", False),
        (b"L1,x10\r", False),  # stored, never started: more may come
        (b"L1,x", False),
        (b"nonsense\r", True),
        (b"nonsense\x01", True),
        (b"@Q\r", True),
        (b"L1,x5\rL1,x8388607\x01", True),
        (b"nonsense\x01@S\rL1,x10\x01", True),
        (b"nonsense\x01@R\r", False),
    ],
)
def test_fault_is_the_error_character(data: bytes, fault: bool) -> None:
    desk = referenced()
    assert desk.controller.fault is False
    desk.send(data)
    desk.finish()
    assert desk.controller.fault is fault


def test_a_failed_reference_run_is_a_fault() -> None:
    desk = fresh()
    desk.set("pin11", True)
    job(desk, "#R0", "#E2,5000", "$HX")
    assert desk.controller.fault is True


# --- settings -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [50_001, -50_001, 0.05, True, "5 %"])
def test_a_wrong_frequency_error_is_named(value: object) -> None:
    with pytest.raises(ValueError, match=r"frequency_error_ppm is .*; allowed: a whole number from -50000 to 50000"):
        create_controller("ismif", settings={"frequency_error_ppm": value})


# --- what single mutations once went through with -------------------------------------------------------------------


@pytest.mark.parametrize("command", ["Z1", "Z2"])
def test_choosing_what_z_is_lifts_the_pen(command: str) -> None:
    """6.7: its relay drops, and the pen stands at 0 again, which a relative way shows."""
    desk = referenced("Z2")
    moved(desk, "L1,Z5")
    assert desk.outputs["z_relay"] == 1
    assert job(desk, command) == ACK + DONE
    assert desk.outputs["z_relay"] == 0
    assert job(desk, "Z2") == ACK + DONE
    assert now(desk, "@LZ") == "@LZ0\r"
    moved(desk, "L1,z-0")
    assert desk.outputs["z_relay"] == 0


def test_the_memory_is_full_when_less_than_the_longest_command_is_free() -> None:
    """65536 bytes; with 128 of them free it is not full, with fewer it is (ismif/2)."""
    twelve, eight = "L1,x1,y1,z1", "L1,x100"
    assert (len(twelve) + 1, len(eight) + 1) == (12, 8)
    desk = fresh()
    for _ in range((65_536 - 128) // 12):
        assert now(desk, twelve) == ACK
    assert now(desk, eight) == ACK
    assert now(desk, eight) == FULL
