"""iSMIF, sections 4, 5 and 7: overview, line, jobs and memory, factory settings, technical data."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.closed_forms import line
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
    top_speed_hz,
)
from conformance.rows import case, shows

# --- 4: every command of the overview exists ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "command",
    [
        case("ismif-4-2", "@V"),
        case("ismif-4-3", "@X"),
        case("ismif-4-4", "@LZ"),
        case("ismif-4-7", "Z1"),
        case("ismif-4-8", "#S200"),
        case("ismif-4-9", "#E0,600"),
        case("ismif-4-10", "#R500"),
        case("ismif-4-11", "#DZ,0,2,2,2"),
        case("ismif-4-12", "#OZ,25"),
        case("ismif-4-15", "@B"),
        case("ismif-4-17", "@A"),
        case("ismif-4-18", "@C"),
        case("ismif-4-19", "A0"),
        case("ismif-4-20", "W1"),
    ],
)
def test_the_command_exists(command: str) -> None:
    desk = fresh()
    assert desk.query(command).endswith("\r")
    assert status(desk)[2] == "0"


# --- 5.1: the line ------------------------------------------------------------------------------------------------


@shows("ismif-5.1-1")
def test_everything_sent_is_ascii() -> None:
    desk = referenced("#E1,800", "L1,X200,Y500")
    for command in ("@V", "@X", "@LX", "@LY", "@B", "@R"):
        now(desk, command)
    assert all(data.isascii() for _, data in desk.replies)


@shows("ismif-5.1-2")
def test_nothing_is_sent_unasked() -> None:
    desk = fresh()
    desk.run(2.0)
    assert desk.read() == ""
    now(desk, "@V")
    desk.run(2.0)
    assert desk.read() == ""


@shows("ismif-5.1-3")
def test_line_speed() -> None:
    assert fresh().controller.serial_format.baud == 19_200


# --- 5.2: commands, jobs, memory ----------------------------------------------------------------------------------


@shows("ismif-5.2-1")
def test_a_command_begins_with_its_cr() -> None:
    desk = fresh()
    desk.send(b"@V")
    desk.run(1.0)
    assert desk.read() == ""
    desk.send(b"\r")
    assert desk.read() == "@V SMC-ISMIF 1.00\r"


@shows("ismif-5.2-2")
@pytest.mark.parametrize("command", ["T0", "#S150", "#DX,0,4,4,4", "L1,x5", "$HX", "A1", "W250", "@R", "@B", "@C"])
def test_every_command_is_acknowledged(command: str) -> None:
    assert now(fresh(), command) == ACK


@shows("ismif-5.2-3")
@pytest.mark.parametrize(("query", "answer"), [("@V", "@V SMC-ISMIF 1.00\r"), ("@X", "@X000100\r"), ("@LX", "@LX0\r")])
def test_queries_are_answered_with_a_value(query: str, answer: str) -> None:
    assert now(fresh(), query) == answer


STATES = {
    "at rest": ("W1", 1.0),
    "in a ramp": ("L1,X5000", 0.1),
    "in a move": ("L1,X5000", 3.0),
    "searching": ("$HX", 0.3),
    "resting": ("$HX", 0.01),
    "waiting": ("W60000", 3.0),
}
"""A job, and how many seconds after its start it is in the state."""


@shows("ismif-5.2-4", "ismif-5.2-14")
@pytest.mark.parametrize("paused", [False, True])
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("command", ["@V", "@X", "@LY", "@A", "@B", "@S", "@R", "@C", "L1,x5", "W9", "nonsense"])
def test_everything_is_answered_at_once_whatever_goes_on(command: str, state: str, paused: bool) -> None:
    """Without any time passing, which is within 500 ms. `@B` may end the job by it, and is told that as well."""
    doing, seconds = STATES[state]
    desk = referenced()
    send_job(desk, doing)
    desk.run(seconds)
    if paused:
        assert now(desk, "@A") == ACK
    answer = now(desk, command)
    assert answer.endswith("\r")
    assert answer in (ACK, ACK + DONE) or answer.startswith(command)
    assert desk.replies[-1][0] == desk.time_ns


@shows("ismif-5.2-5")
def test_master_commands_do_not_get_into_the_memory() -> None:
    desk = referenced()
    assert now(desk, "L1,x100") == ACK
    assert now(desk, "@A") == ACK
    assert now(desk, "@C") == ACK
    assert moved(desk, "L1,x10").total == (110, 0, 0, 0)


@shows("ismif-5.2-6", "ismif-5.2-16")
def test_stored_commands_wait_for_the_start() -> None:
    desk = referenced()
    mark = desk.ticks
    for command in ("T1", "A1", "L1,X200,Y500"):
        assert now(desk, command) == ACK
    desk.run(5.0)
    assert (desk.ticks, desk.outputs["pin12"], desk.outputs["clock_signals"]) == (mark, 0, 0)
    assert status(desk) == "000000"


@shows("ismif-5.2-7", "ismif-5.2-15")
def test_01h_starts_everything_stored_in_its_order() -> None:
    desk = referenced()
    stream = moved(desk, "L1,x300", "L1,y200", "L1,x-100")
    assert stream.delta.tolist() == [*line(300).tolist(), *line(0, 200).tolist(), *line(-100).tolist()]


@shows("ismif-5.2-9", "ismif-5.2-10")
def test_02h_comes_by_itself_when_the_job_is_over() -> None:
    desk = referenced()
    send_job(desk, "L1,x300")
    assert desk.read() == ACK
    end_ns = desk.time_ns + pulse_times_ns(300, 600)[-1]
    assert desk.finish() == DONE
    assert desk.replies[-1] == (end_ns, b"\x02\r")
    assert job(desk, "L1,x-300") == ACK + DONE


COMMAND = "L1,x1,y1,z1"
STORED = 65_536 // (len(COMMAND) + 1)
"""Commands of this length, their CR included, that 64 KB hold."""


@shows("ismif-5.2-8", "ismif-5.2-11", "ismif-5.2-12", "ismif-5.2-13", "ismif-5.2-14")
def test_a_full_memory_says_so_starts_and_reports_room() -> None:
    """The longest command is 128 bytes: from 128 free bytes down the memory counts as full (decision ismif/2)."""
    desk = referenced("#R0", "#E1,5000")
    mark = desk.ticks
    replies = [now(desk, COMMAND)]
    while replies[-1] == ACK:
        assert desk.ticks == mark
        replies.append(now(desk, COMMAND))
    assert replies[-1] == FULL
    assert STORED - 128 // (len(COMMAND) + 1) - 1 <= len(replies) <= STORED
    assert status(desk) == "100001"
    assert now(desk, COMMAND) == FULL
    desk.run(0.1)
    assert desk.read() == DONE
    assert now(desk, COMMAND) == ACK
    desk.finish()
    assert job(desk, COMMAND) == ACK + DONE
    assert desk.steps_since(mark).total == (len(replies) + 3,) * 3 + (0,)


@shows("ismif-5.2-17")
def test_half_steps_to_begin_with() -> None:
    assert moved(referenced(), "L1,x10").total == (10, 0, 0, 0)


@shows("ismif-5.2-18")
def test_three_axes_to_begin_with() -> None:
    assert moved(referenced(), "L1,z10").total == (0, 0, 10, 0)


@shows("ismif-5.2-19", "ismif-5.2-20", "ismif-5.2-21", "ismif-6.9-4")
@pytest.mark.parametrize("index", [0, 1, 50, 99])
def test_speeds_and_ramp_to_begin_with(index: int) -> None:
    stream = moved(referenced(), f"L{index},x700")
    assert stream.t_ns.tolist() == pulse_times_ns(700, v=600, f0=200, ramp_ms=500)


@shows("ismif-5.2-22", "ismif-5.2-23", "ismif-6.13-3")
def test_reference_run_to_begin_with() -> None:
    """From 400, 300, 200 half steps to the motor end (0), off the switch, 25 steps further."""
    desk = fresh()
    off = HYSTERESIS + 1
    assert moved(desk, "$HX").delta[:, 0].tolist() == [-1] * 400 + [1] * off + [1] * 25
    assert moved(desk, "$HY").delta[:, 1].tolist() == [-1] * 300 + [1] * off + [1] * 25
    assert moved(desk, "$HZ").delta[:, 2].tolist() == [-1] * 200 + [1] * off + [1] * 25


# --- 7: technical data and pins -----------------------------------------------------------------------------------


@shows("ismif-7-1")
@pytest.mark.parametrize("speed_hz", [65, 5000])
def test_slowest_and_fastest_output(speed_hz: int) -> None:
    stream = moved(referenced(f"#S{speed_hz}", f"#E1,{speed_hz}"), "L1,x20")
    assert stream.t_ns.tolist() == [round(k * 10**9 / speed_hz) for k in range(1, 21)]


@shows("ismif-7-1")
@pytest.mark.parametrize("command", ["#S64", "#S5001", "#E1,64", "#E1,5001"])
def test_speeds_outside_are_refused(command: str) -> None:
    desk = referenced()
    job(desk, command)
    assert status(desk) == "001000"
    assert moved(desk, "L1,x300").t_ns.tolist() == pulse_times_ns(300, v=600, f0=200, ramp_ms=500)


@shows("ismif-7-2")
@pytest.mark.parametrize("error_ppm", [-50_000, 12_345, 50_000])
def test_output_frequency_may_be_off_by_five_percent(error_ppm: int) -> None:
    stream = moved(fresh(frequency_error_ppm=error_ppm), "L1,x700")
    assert stream.t_ns.tolist() == pulse_times_ns(700, v=600, f0=200, ramp_ms=500, error_ppm=error_ppm)
    assert top_speed_hz(stream) == pytest.approx(600 * (1 + error_ppm / 1e6), rel=1e-6)


@shows("ismif-7-3")
def test_pin_11_is_the_reference_input() -> None:
    desk = fresh()
    assert set(desk.levels) == {"pin11"}
    send_job(desk, "$HY")
    desk.run(0.2)
    desk.set("pin11", False)
    desk.run(0.02)
    desk.set("pin11", True)
    stands = desk.ticks
    desk.run(0.02)
    assert desk.ticks == stands  # stopped by the input, not yet on the way back
    desk.finish()
    assert desk.counts == (0, 0, 0, 0)
    assert status(desk)[2] == "0"


@shows("ismif-7-4", "ismif-6.19-1", "ismif-6.19-2")
def test_pin_12_is_the_signal() -> None:
    desk = fresh()
    assert desk.outputs["pin12"] == 0
    assert job(desk, "A1") == ACK + DONE
    assert desk.outputs["pin12"] == 1
    assert job(desk, "A0") == ACK + DONE
    assert desk.outputs["pin12"] == 0


@shows("ismif-7-5", "ismif-6.5-2")
def test_clock_and_direction_are_in_the_stream() -> None:
    """A clock pulse is a tick of an axis, its direction the sign; the pins are in test_ismif_connector.py."""
    desk = referenced()
    assert job(desk, "T1") == ACK + DONE
    assert desk.outputs["clock_signals"] == 1
    delta = moved(desk, "L1,x4,y-2").delta
    assert delta[:, 0].tolist() == [1] * 4
    assert sorted(delta[:, 1].tolist()) == [-1, -1, 0, 0]
    assert not delta[:, 2].any()


@shows("ismif-6.5-3")
def test_both_kinds_of_signal_make_the_same_steps() -> None:
    streams = [moved(referenced(signals), "L1,x700,y-300,z11") for signals in ("T0", "T1")]
    assert np.array_equal(streams[0].t_ns, streams[1].t_ns)
    assert np.array_equal(streams[0].delta, streams[1].delta)
