"""What a watched twin has done: which command did it, and what is forgotten with a restored state."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.jobs.checks.watched import Watched

MOVE = b"@0A8000,2000,0,30,0,30,0,30\r"


def ready(plant: str = "kinematic") -> Watched:
    """After a reference run, with nothing behind it."""
    watched = Watched(Twin(plant=plant, start_mm=(2.0, 2.0, 2.0)))
    for command in ("@07", "@0R7"):
        watched.twin.query(command)
    watched.begin()
    return watched


def test_commands_of_a_job_say_what_was_refused_and_what_set_a_counter(tmp_path: Path) -> None:
    job = tmp_path / "job.txt"
    job.write_text("@07\n@0R7\n@0M800000,2000,0,30,0,30,0,30\n")
    watched = Watched(Twin(plant="kinematic"))
    watched.play(job)
    assert [str(command) for command in watched.commands] == [
        "line 1: @07", "line 2: @0R7", "line 3: @0M800000,2000,0,30,0,30,0,30",
    ]  # fmt: skip
    assert [command.refused for command in watched.commands] == [False, False, True]
    assert [command.counter_set for command in watched.commands] == [False, True, False]


def test_steps_that_the_last_command_has_lost_are_found_at_rest() -> None:
    watched = ready("mujoco")
    watched.twin.query("@0J2000")
    watched.twin.query("@0A16000,40000,0,30,0,30,0,30")
    assert watched.lost_in("x") is None
    watched.rest()
    assert str(watched.lost_in("x")) == "@0A16000,40000,0,30,0,30,0,30"


def test_a_command_after_a_restored_state_is_no_part_of_one_that_is_forgotten() -> None:
    watched = ready()
    watched.twin.write(MOVE)
    watched.twin.run(1.0)
    moving = watched.twin.save()
    watched.twin.run_until_idle()
    watched.twin.write(MOVE)
    watched.twin.restore(moving)
    watched.twin.write(b"@0P\r")
    assert [str(command) for command in watched.commands] == [MOVE.decode().strip(), "@0P"]
    assert watched.samples()[0].max() <= watched.twin.time_ns


def test_the_machine_comes_to_rest_once() -> None:
    """Half a second, and none if it just did."""
    watched = ready()
    begin_ns = watched.twin.time_ns
    watched.rest()
    watched.rest()
    assert watched.twin.time_ns - begin_ns == 500_000_000


def test_a_command_is_the_one_of_its_first_instant() -> None:
    watched = ready()
    for command in ("@0A10,1000,0,30,0,30,0,30", "@0P"):
        watched.twin.query(command)
    first, second = watched.commands
    assert watched.command_at(second.begin_ns) is second
    assert watched.command_at(second.begin_ns - 1) is first


def test_what_is_wrong_with_a_job_is_seen_at_the_line_of_the_test(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as caught:
        ready().play(tmp_path / "none.txt")
    assert [entry.path for entry in caught.traceback.filter(caught)] == [Path(__file__)]
