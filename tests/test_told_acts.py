"""Every act of a scenario that changes what was made or answered is in the verdict, by a rule that its row names.

What it changes is found by the same job without it; an act that changes nothing leaves the job well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from isel_twin.bridge.virtual.virtual_host import HostProgram, run_host
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks.job import Inspection
from isel_twin.jobs.checks.rules import RULES
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import Played, played
from isel_twin.jobs.verdict import judge
from isel_twin.language import create_language
from isel_twin.wiring import ACTS

JOBS: Mapping[str, tuple[str, str]] = {
    "imc-s8": ("4030", "@07\n@0N7\n@0A8000,8000,0,30,0,30,0,30\n@0P\n"),
    "bwo900": ("4030-servo", "N10 G1 F300 G91 X10\nN20 M30\n"),
}
MOVE = {"imc-s8": 2, "bwo900": 2}  # index of the line in whose midst things happen
STEEL = {"flutes": 1, "spindle": 100, "material": "steel", "diameter": 6.0, "width": 6.0}


class Tried(NamedTuple):
    """An act that changes something, and one of the same key that changes nothing."""

    changing: Mapping[str, Any]
    idle: Mapping[str, Any]
    controller: str = "imc-s8"


OF_ACT: Mapping[str, Tried] = {
    "set": Tried({"set": {"estop": "pressed"}}, {"set": {"user_0": "low"}}),
    "force_n": Tried({"force_n": {"x": -5000.0}}, {"force_n": {"x": 5.0}}),
    "phase_lost": Tried({"phase_lost": {"x": "ab"}}, {"phase_lost": {"x": ""}}),
    "noise": Tried({"noise": 1.0}, {"noise": 1e-9}),
    "cut": Tried({"cut": {**STEEL, "depth": 20.0}}, {"cut": {**STEEL, "depth": 1e-3}}),
    "swapped": Tried({"swapped": {"limit_x2": "stop"}, "set": {"stop": "down"}}, {"swapped": {"user_0": "user_1"}}),
    "friction_n": Tried({"friction_n": {"x": 5000.0}}, {"friction_n": {"x": 1.0}}),
    "obstacle_mm": Tried({"obstacle_mm": {"x": "ahead"}}, {"obstacle_mm": {"x": 9000.0}}),
    "payload_kg": Tried({"payload_kg": {"tool": 500.0}}, {"payload_kg": {"tool": 0.1}}),
    "undervoltage": Tried({"undervoltage": 0.95}, {"undervoltage": 0.01}),
    "hot_stage_k": Tried({"hot_stage_k": {"x": 100.0}}, {"hot_stage_k": {"x": 1.0}}),
    "dropped": Tried({"dropped": 1.0}, {"dropped": 1e-9}),
    "doubled": Tried({"doubled": 1.0}, {"doubled": 1e-9}),
    "line_cut": Tried({"line_cut": True}, {"line_cut": True, "for": 1e-3}),
    "reset": Tried({"reset": True}, {"reset": True, "at": 1000.0}),
    "key": Tried({"key": {"abort": True}}, {"key": {"override": 100}}, "bwo900"),
    "brownout": Tried({"brownout": True, "for": 0.2}, {"brownout": True, "at": 1000.0}),
}


class Outcome(NamedTuple):
    played: Played
    made: tuple[object, ...]  # replies, counters, and steps lost
    rules: frozenset[str]  # of findings that are no warnings
    place_mm: float  # of X, in machine coordinates


def outcome(controller: str, event: Mapping[str, Any] | None) -> Outcome:
    machine, job = JOBS[controller]
    spec = TwinSpec(machine, controller, "mujoco")
    twin = (spec.with_events([dict(event)]) if event else spec).build()
    inspection = Inspection(twin, golden=False)
    made = played(twin, parse_job(job, create_language(controller), controller), [inspection.take], 60.0)
    findings = inspection.report("job", made.verdict).findings
    replies = tuple(result.reply for result in made.results)
    return Outcome(
        made,
        (replies, made.verdict.counts, made.verdict.ticks, made.verdict.whole_steps_lost),
        frozenset(one.rule for one in findings if not one.warning),
        float(twin.machine_position_mm[0]),
    )


@cache
def clean(controller: str) -> Outcome:
    return outcome(controller, None)


def amid(tried: Tried, act: Mapping[str, Any]) -> dict[str, Any]:
    """The event in the midst of the move."""
    line = clean(tried.controller).played.results[MOVE[tried.controller]]
    event = {"at": (line.time_ns + line.end_ns) / 2e9, **act}
    if act.get("obstacle_mm") == {"x": "ahead"}:
        event["obstacle_mm"] = {"x": clean(tried.controller).place_mm - 1.0}
    return event


def test_rows_name_rules() -> None:
    failing = {name for name, rule in RULES.items() if not rule.warning}
    assert {rule for act in ACTS.values() for rule in act.told} <= failing
    assert all(act.told for act in ACTS.values())


@pytest.mark.parametrize("key", ACTS)
def test_an_act_that_changes_something_is_told(key: str) -> None:
    tried = OF_ACT[key]
    was, now = clean(tried.controller), outcome(tried.controller, amid(tried, tried.changing))
    assert was.played.ok, was.played.verdict.problems()
    assert now.made != was.made, "or it shows nothing"
    assert not now.played.ok
    assert now.rules & set(ACTS[key].told), now.rules


@pytest.mark.parametrize("key", ACTS)
def test_an_act_that_changes_nothing_leaves_it_well(key: str) -> None:
    tried = OF_ACT[key]
    was, now = clean(tried.controller), outcome(tried.controller, amid(tried, tried.idle))
    assert now.made == was.made, "or it is no such act"
    assert now.played.ok, now.played.verdict.problems()
    assert not now.rules


# ---- the line --------------------------------------------------------------------------------------------------------

WALK = "@07\n@0N7\n@0A6400,5000,0,30,0,30,0,30{}\n@0P{}\n"


def walked(key: str, seed: int, job: str) -> tuple[tuple[object, ...], Played]:
    spec = TwinSpec("4030", "imc-s8", "kinematic", seed)
    twin = (spec.with_events([{"at": 0.0, key: 0.02}]) if key else spec).build()
    made = played(twin, parse_job(job, create_language("imc-s8"), "imc-s8"), timeout_s=60.0)
    return (made.verdict.counts, tuple(one.reply for one in made.results if not one.condition)), made


@pytest.mark.parametrize("key", ["noise", "dropped", "doubled"])
@pytest.mark.parametrize("expected", [("", ""), (" => 0", " => *")], ids=["bare", "expecting"])
def test_no_seed_of_a_bad_line_is_well_if_it_made_or_answered_something_else(
    key: str, expected: tuple[str, str]
) -> None:
    job = WALK.format(*expected)
    right, _ = walked("", 0, job)
    differ = []
    for seed in range(60):
        made, job_played = walked(key, seed, job)
        if made != right:
            differ.append(seed)
            assert not job_played.ok, (seed, made)
    assert len(differ) > 10, "or it shows nothing"


def altered(job: str) -> Played:
    """With one bit flipped in each byte: the controller hears no end of a line, and says nothing."""
    twin = TwinSpec("4030", "imc-s8", "kinematic").with_events([{"at": 0.0, "noise": 1.0}]).build()
    return played(twin, parse_job(job, create_language("imc-s8"), "imc-s8"), timeout_s=60.0)


def test_the_words_of_a_verdict_and_of_a_line() -> None:
    made = altered("@07\n")
    assert made.verdict.problems() == ("1 refused", "bytes altered on the line: 4")
    assert made.results[0].blame == "bytes altered on the line: 4; meanwhile, at 0.000 s: noise 1.0"
    assert made.verdict.summary()["line_faults"] == {"altered": 4, "lost": 0, "doubled": 0}


@pytest.mark.parametrize("condition", ["bytes == 4", "bytes.altered == 4", "bytes >= 1"])
def test_a_job_may_expect_what_the_line_alters(condition: str) -> None:
    made = altered(f"@07 => none\n! {condition}\n")
    assert made.ok, made.verdict.problems()


@pytest.mark.parametrize("condition", ["bytes.lost == 0", "bytes.doubled == 0"])
def test_a_condition_on_another_kind_does_not_expect_it(condition: str) -> None:
    made = altered(f"@07 => none\n! {condition}\n")
    assert made.verdict.problems() == ("bytes altered on the line: 4",)


def test_a_condition_expects_what_was_before_it_only() -> None:
    made = altered("@07 => none\n! bytes == 4\n@07 => none\n")
    assert made.verdict.problems() == ("bytes altered on the line: 4",)


def test_a_host_of_its_own_is_told_as_well() -> None:
    twin = TwinSpec("4030", "imc-s8", "kinematic").with_events([{"at": 0.0, "noise": 1.0}]).build()
    assert twin.query("@07") == ""
    assert judge(twin, ()).problems() == ("bytes altered on the line: 4",)


def test_bytes_for_a_controller_without_supply_are_lost() -> None:
    """A BWO 900 answers nothing to a program that it has taken, nor to one that it has not."""
    job = JOBS["bwo900"][1]
    twin = TwinSpec("4030-servo", "bwo900", "kinematic").with_events([{"at": 0.0, "brownout": True}]).build()
    made = played(twin, parse_job(job, create_language("bwo900"), "bwo900"), timeout_s=60.0)
    assert not made.ok
    assert any("bytes lost on the line" in one for one in made.verdict.problems())


def test_a_file_of_noise_fails_a_check(tmp_path: Path) -> None:
    from tests.in_process import isel_twin

    (tmp_path / "job.txt").write_text(WALK.format(" => *", " => *"))
    (tmp_path / "bad.toml").write_text("[[event]]\nat = 0\nnoise = 0.3\n")
    called = (tmp_path / "job.txt", "--plant", "kinematic", "--scenario", tmp_path / "bad.toml")
    for command in ("run", "check"):
        done = isel_twin(command, *called)
        assert done.returncode == 1
        assert "bytes altered on the line" in done.stdout


# ---- reference runs that end without their switch --------------------------------------------------------------------

REFERENCE = "@07\n@0d5000,5000,5000\n@0R7{}\n@0A1600,5000,0,30,0,30,0,30\n"
"""By 2.2.22 of the iMC's manual the stop key stands for the switch while an axis is on its way to it."""


@pytest.mark.parametrize("state", ["down", "broken", "stuck_open"])
@pytest.mark.parametrize("expected", ["", " => 0"])
@pytest.mark.parametrize("at_s", [2.0, 8.0])
def test_a_reference_run_that_the_stop_key_has_ended_is_told(state: str, expected: str, at_s: float) -> None:
    spec = TwinSpec("4030", "imc-s8", "kinematic", start_mm=(100.0, 100.0, 35.0))
    twin = spec.with_events([{"at": at_s, "set": {"stop": state}}]).build()
    lines = parse_job(REFERENCE.format(expected), create_language("imc-s8"), "imc-s8")
    inspection = Inspection(twin, golden=False)
    made = played(twin, lines, [inspection.take], 60.0)
    axis = {2.0: "Z", 8.0: "Y"}[at_s]
    said = f"referenced though no end switch was struck: {axis}"
    assert said in made.verdict.problems()
    findings = inspection.report("job", made.verdict).findings
    assert [(one.rule, one.line) for one in findings if said in one.message] == [("switch", 3)]


@pytest.mark.parametrize("start_mm", [(100.0, 100.0, 35.0), (-0.5, -0.5, -0.5)])
def test_a_reference_run_with_its_switches_is_well(start_mm: tuple[float, float, float]) -> None:
    twin = TwinSpec("4030", "imc-s8", "kinematic", start_mm=start_mm).build()
    lines = parse_job(REFERENCE.format(""), create_language("imc-s8"), "imc-s8")
    assert played(twin, lines, timeout_s=60.0).ok


HOST = """
import time, serial
port = serial.Serial("COM1", {}, timeout=0)
for frame in {!r}:
    port.write(frame)
    time.sleep(60)
    port.reset_input_buffer()
"""
LINE = {"imc-s8": "19200", "ismif": "19200", "gmi99": '38400, parity="E"', "bwo900": "19200"}
FAR = {"start_mm": (100.0, 100.0, 35.0), "plant": "kinematic"}


def told_of_a_host(controller: str, frames: Sequence[bytes], events: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """What the verdict says of a host that heeds no reply."""
    spec = TwinSpec("4030-servo" if controller in ("gmi99", "bwo900") else "4030", controller, **FAR)
    twin = spec.with_events(events).build()
    host = HOST.format(LINE[controller], [*frames])
    return run_host(twin, HostProgram((), code=host)).verdict.problems()


@pytest.mark.parametrize("at_s", [2.0, 8.0])
def test_a_host_that_heeds_no_reply_is_told_of_the_stop_key_in_its_reference_run(at_s: float) -> None:
    frames = [b"@07\r", b"@0d5000,5000,5000\r", b"@0R7\r"]
    told = told_of_a_host("imc-s8", frames, [{"at": 120.0 + at_s, "set": {"stop": "down"}, "for": 0.2}])
    assert told == (f"referenced though no end switch was struck: {'Z' if at_s < 5.0 else 'Y'}",)


@pytest.mark.parametrize("controller", LINE)
def test_a_loose_wire_of_the_switch_in_a_reference_run_is_told(controller: str) -> None:
    """It reads as struck for a moment, halfway on the way: the zero lies there, and the reply is well."""
    loose = {"when": "x < 50 mm", "set": {"limit_x1": "broken"}, "for": 0.3}
    frames = create_language(controller).reference()
    assert told_of_a_host(controller, frames, []) == ()
    assert "referenced though no end switch was struck: X" in told_of_a_host(controller, frames, [loose])


def test_the_stop_key_in_a_reference_run_of_a_stored_program_is_told() -> None:
    twin = TwinSpec("4030", "imc-s8", **FAR).with_events([{"at": 2.0, "set": {"stop": "down"}, "for": 0.2}]).build()
    lines = parse_job("@07\n@0i\n77\n9\n@0S\n", create_language("imc-s8"), "imc-s8")
    made = played(twin, lines, timeout_s=100.0)
    assert "referenced though no end switch was struck: Z" in made.verdict.problems()
    assert [result.number for result in made.results if result.astray] == [5]


def test_a_dead_switch_that_the_stop_key_stands_for_is_told() -> None:
    """The carriage strikes it, but its contact stays closed: the key ends the run, somewhere behind it."""
    events = [{"at": 0.0, "set": {"limit_z1": "stuck_closed", "limit_z2": "stuck_closed"}}]
    stop = {"at": 75.0, "set": {"stop": "down"}, "for": 0.2}
    told = told_of_a_host("imc-s8", [b"@07\r", b"@0R4\r"], [*events, stop])
    assert "referenced though no end switch was struck: Z" in told
