"""A job that works by luck is told from one that works: repetitions with small perturbations, drawn from the seed."""

from __future__ import annotations

import dataclasses
import json
import math
import multiprocessing
import os
import re
import signal
import statistics
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin.base import crew
from isel_twin.base.errors import CallError
from isel_twin.cli import main
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs import robust
from isel_twin.jobs.checks.job import check_job
from isel_twin.jobs.checks.rules import Bounds
from isel_twin.jobs.job import parse_job
from isel_twin.language import create_language
from isel_twin.machine import Machine, describe, load_machine, with_overrides
from tests import forked
from tests.near import NEAR, near_switches

pytestmark = pytest.mark.long(seconds=16)

SOUND = "@07\n@0R7\n@0A1600,5000,800,5000,0,900,0,900\n"
AT_36_V = """based_on = "../near"
[axes.all.stage]
supply = { value = 36.0, unit = "V", grade = "setting", source = "the supply in question" }
"""
NEAR_STALL = "@07\n@0R7\n@0J100\n@0z1\n@0M32000,20500,0,900,0,900,0,30\n"
"""At 36 V it loses nearly everything or nothing, as chance has it."""


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Any:
    """run(job, words...) -> exit code, lines of standard output, standard error; in a folder with the machines `near`,
    which is the one if none is named, and `m36`."""
    for name in ("near", "m36"):
        (tmp_path / name).mkdir()
    near_switches(tmp_path / "near", 2.0)
    (tmp_path / "m36" / "machine.toml").write_text(AT_36_V)
    monkeypatch.chdir(tmp_path)

    def call(job: str, *words: str) -> tuple[int, list[str], str]:
        (tmp_path / "job.txt").write_text(job)
        with pytest.raises(SystemExit) as caught:
            main(["run", "job.txt", *(() if "--machine" in words else ("--machine", "near")), *words])
        assert isinstance(caught.value.code, int)
        said = capsys.readouterr()
        return caught.value.code, said.out.splitlines(), said.err

    return call


# What is perturbed ---


@cache
def drawn() -> dict[str, np.ndarray]:
    """Factors [400] by key."""
    machine = with_overrides(load_machine("4030"), {"payload.mass": 2.0})
    rows = [robust.perturbation(machine, 5, n)[1] for n in range(1, 401)]
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


@pytest.mark.parametrize(
    ("key", "low", "high"),
    [
        ("axes.x.stage.supply", 0.88, 1.04),  # transformer and rectifier
        ("axes.y.specimen.resistance", 0.9, 1.3 * 1.1),  # +-10 %, up to 76 K warmer
        ("axes.z.specimen.inductance", 0.8, 1.2),
        ("axes.x.specimen.torque_constant", 0.92 * (1.0 - 0.0012 * 76.4), 1.08),
        ("axes.x.stage.current", 0.925, 1.075),
        ("axes.y.guide_friction", math.exp(-0.7), math.exp(0.7)),
        ("axes.z.efficiency", 0.80 / 0.9, 0.95 / 0.9),
        ("masses.portal", 0.875, 1.125),
        ("payload.mass", 0.9, 1.1),
    ],
)
def test_factors_lie_in_their_ranges_and_fill_them(key: str, low: float, high: float) -> None:
    factors = drawn()[key]
    assert low <= factors.min() < low + 0.15 * (high - low)
    assert high - 0.15 * (high - low) < factors.max() <= high


def test_what_goes_together_does() -> None:
    """The windings are as warm on all axes and weaken the magnets; a delivery is alike; grease is as cold all over."""
    factors = drawn()

    def together(one: str, other: str) -> float:
        return float(np.corrcoef(factors[one], factors[other])[0, 1])

    assert together("axes.x.specimen.resistance", "axes.y.specimen.resistance") > 0.6
    assert together("axes.x.specimen.resistance", "axes.x.specimen.torque_constant") < -0.2
    assert together("axes.x.specimen.inductance", "axes.z.specimen.inductance") > 0.8
    assert 0.15 < together("axes.x.guide_friction", "axes.x.shaft_coulomb") < 0.45
    assert np.array_equal(factors["axes.x.stage.supply"], factors["axes.z.stage.supply"])


def test_the_machine_is_changed_by_its_factors_and_in_nothing_else() -> None:
    machine = with_overrides(load_machine("4030"), {"payload.mass": 2.0, "axes.y.stage.supply": 24.0})
    _, factors, overrides = robust.perturbation(machine, 5, 1)
    other = with_overrides(machine, overrides)
    for axis, changed, name in zip(machine.axes, other.axes, "xyz", strict=True):
        mine = {key.removeprefix(f"axes.{name}."): factor for key, factor in factors.items() if f"axes.{name}." in key}
        assert changed.stage.supply_v == pytest.approx(axis.stage.supply_v * mine["stage.supply"])
        assert changed.guide_friction_n == pytest.approx(axis.guide_friction_n * mine["guide_friction"])
        assert changed.screw.coulomb_nm == pytest.approx(axis.screw.coulomb_nm * mine["shaft_coulomb"])
        assert changed.screw.viscous_nm_s_per_rad == pytest.approx(
            axis.screw.viscous_nm_s_per_rad * mine["shaft_viscous"]
        )
        assert changed.motor.inductance_h == pytest.approx(axis.motor.inductance_h * mine["specimen.inductance"])
        assert changed.motor.resistance_ohm == pytest.approx(axis.motor.resistance_ohm * mine["specimen.resistance"])
        assert changed.motor.iron_drag_nm_s_per_rad == pytest.approx(
            axis.motor.iron_drag_nm_s_per_rad * mine["specimen.iron_loss"]
        )
        assert (changed.travel_mm, changed.screw.lead_mm) == (axis.travel_mm, axis.screw.lead_mm)
    for name, mass_kg in machine.masses_kg.items():
        assert other.masses_kg[name] == pytest.approx(mass_kg * factors[f"masses.{name}"])
    assert other.payload_kg == pytest.approx(2.0 * factors["payload.mass"])


@pytest.mark.parametrize(
    "says",
    [
        'damping_gain = { value = 2.0, unit = "1", grade = "setting", source = "digital drive" }',
        'kind = "digital"',
    ],
)
def test_electronic_damping_is_drawn_where_a_stage_has_it(says: str, tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(f'based_on = "4030"\n[axes.x.stage]\n{says}\n')
    machine, plain = load_machine(tmp_path), load_machine("4030")
    rows = [robust.perturbation(machine, 5, n)[1] for n in range(1, 60)]
    plain_rows = [robust.perturbation(plain, 5, n)[1] for n in range(1, 60)]
    for row in [*rows, *plain_rows]:
        row.pop("axes.x.stage.kind", None)  # not drawn of a stage whose file says it
    factors = [row.pop("axes.x.specimen.damping_gain") for row in rows]
    overrides = robust.perturbation(machine, 5, 1)[2]
    drawn = [axis.stage.damping_gain for axis in with_overrides(machine, overrides).axes]
    assert drawn == pytest.approx([2.0 * factors[0], 0.0, 0.0])
    assert math.exp(-0.7) <= min(factors) < 0.8
    assert 1.2 < max(factors) <= math.exp(0.7)
    assert rows == plain_rows, "all else is drawn as without it"


def test_a_decay_that_nobody_has_said_is_drawn_the_same_on_all_axes() -> None:
    """Of 400: fast 40 %, mixed 60 % with 0.3 to 0.9, within four standard deviations."""
    machine = load_machine("4030")
    shares = []
    for number in range(1, 401):
        source = ("kind", "known")[number % 2]
        _, factors, overrides = robust.perturbation(machine, 1, number, source)  # type: ignore[arg-type]
        if number <= 20:
            drawn = {axis.stage.fast_share for axis in with_overrides(machine, overrides).axes}
            assert drawn == {factors["axes.x.stage.kind"]}
        shares.append(factors["axes.x.stage.kind"])
    assert sum(share == 1.0 for share in shares) == pytest.approx(160, abs=40)
    mixed = [share for share in shares if share != 1.0]
    assert 0.3 <= min(mixed) < max(mixed) <= 0.9
    unsaid = with_overrides(machine, {"axes.all.stage.kind": "mixed"}).axes[0].stage.fast_share
    assert unsaid == pytest.approx(statistics.median(mixed), abs=0.05), "amid what is drawn"


@pytest.mark.parametrize("grade", ["", "datasheet", "measured", "setting", "estimate"])
def test_a_decay_that_a_sheet_names_is_not_drawn(grade: str, tmp_path: Path) -> None:
    says = f'{{ value = "mixed", grade = "{grade}", source = "of the IC" }}' if grade else '"mixed"'
    fixed = '{ value = 0.4, unit = "1", grade = "datasheet", source = "of the IC" }'
    (tmp_path / "machine.toml").write_text(
        f'based_on = "4030"\n[axes.all.stage]\nkind = {says}\nmixed_decay = {fixed}\n'
    )
    machine = load_machine(tmp_path)
    kinds = {robust.perturbation(machine, 0, n)[2].get("axes.x.stage.kind") for n in range(1, 30)}
    assert kinds == ({"fast", "mixed"} if grade == "estimate" else {None})
    (row,) = (one for one in describe(machine) if one.parameter == "axes.all.stage.kind")
    assert (row.value, row.grade) == ("mixed", grade or "setting")


def test_what_is_lowered_at_rest_is_drawn_and_what_was_drawn_before_stays() -> None:
    """Current at rest 0.6 to 1.4 times 0.5. Factors of seed 3, number 1, as they were before stages were drawn."""
    machine = load_machine("4030")
    drawn = [robust.perturbation(machine, 2, n)[1]["axes.y.stage.idle_current"] for n in range(1, 60)]
    assert 0.6 <= min(drawn) < 0.75
    assert 1.25 < max(drawn) <= 1.4
    assert robust.perturbation(machine, 3, 1)[1]["payload.mass"] == pytest.approx(0.9986826760727237, rel=1e-12)


@pytest.mark.parametrize(("lost", "of", "bound"), [(0, 20, 0.139), (0, 60, 0.0487), (1, 20, 0.216), (20, 20, 1.0)])
def test_a_frequency_and_its_bound(lost: int, of: int, bound: float) -> None:
    """Of Clopper and Pearson, one side, 95 %; without a loss 1 - 0.05^(1/n)."""
    assert robust.at_most(lost, of) == pytest.approx(bound, abs=5e-4)


def test_each_number_and_each_seed_draws_anew_and_always_the_same() -> None:
    machine = load_machine("4030")
    drawn = [robust.perturbation(machine, seed, number) for seed in (0, 1) for number in (1, 2)]
    assert drawn == [robust.perturbation(machine, seed, number) for seed in (0, 1) for number in (1, 2)]
    assert len({seed for seed, _, _ in drawn}) == 4
    assert len({factors["axes.x.stage.supply"] for _, factors, _ in drawn}) == 4


def test_the_supply_of_an_ismif_is_that_of_its_own_stages() -> None:
    """32 V (its controller's wish), not the machine's 48."""
    call = TwinSpec(controller="ismif")
    robust.check(call, 3)
    supplies = [robust.perturbation(call.fitted(), 0, number)[2]["axes.x.stage.supply"] for number in (1, 2)]
    assert all(0.88 * 32.0 <= volts <= 1.04 * 32.0 for volts in supplies)


def test_what_the_caller_says_of_the_supply_goes_before_what_the_controller_wishes() -> None:
    """24 V, neither the 32 V of an iSMIF's own stages nor the machine's 48."""
    machine = TwinSpec(controller="ismif", overrides={"axes.all.stage.supply": 24.0}).fitted()
    assert {axis.stage.supply_v for axis in machine.axes} == {24.0}


def test_repetitions_have_scenario_line_and_machine_of_the_call(tmp_path: Path) -> None:
    """A reference run of 100 full steps away is stopped by the emergency stop after a tenth of a second; 16 bytes take
    their time at 19200 bit/s; a turn of 400 microsteps makes 1600 of them 20 mm."""

    def first(**called: Any) -> Any:
        lines = parse_job(SOUND, create_language("imc-s8"), "imc-s8")
        return next(robust.repetitions(TwinSpec(**called), lines, 1, timeout_s=60.0)).verdict

    plain = first()
    scenario = tmp_path / "stop.toml"
    scenario.write_text('[[event]]\nat = 0.1\nset = { estop = "pressed" }\n')
    assert plain.ok
    assert not first(scenario=scenario).ok
    byte_s = 10 / 19200
    least_ns = byte_s * 1e9 * len(SOUND.encode())
    timed = first(line_speed=True)
    assert (plain.line_counts, timed.line_counts) == (False, True)
    assert least_ns <= timed.bytes_ns < 3.0 * least_ns
    slower = {"axes.all.steps_per_rev": 400, "axes.all.stage.kind": "fast"}
    turned = first(overrides=slower).position_mm[0]
    assert turned == pytest.approx(4.0 * plain.position_mm[0], rel=0.02)


# What comes of it ---


def test_a_sound_job_is_robust(run: Any) -> None:
    code, out, err = run(SOUND, "--robust", "5")
    assert (code, err) == (0, "")
    assert out[-1] == "robust: 0 of 5 machines lost steps: at most 45 % of such machines do (95 %)"


@pytest.mark.slow
def test_a_job_that_fails_always_is_not_called_robust(run: Any) -> None:
    code, out, _ = run(NEAR_STALL.replace("20500", "40000"), "--machine", "m36", "--robust", "2")
    assert (code, out[-1]) == (1, "failed on every machine: all 2 ended alike")


@pytest.mark.slow
def test_a_job_near_stall_is_fragile_though_it_may_work_once(run: Any) -> None:
    code, out, _ = run(NEAR_STALL, "--machine", "m36", "--robust", "10", "--json", "--workers", "2")
    *lines, last = (json.loads(line) for line in out)
    assert code == 1
    assert last["sound"] is False
    assert last["robust"]["of"] == 10
    trials = [line for line in lines if "trial" in line]
    assert [trial["trial"] for trial in trials] == list(range(1, 11))
    assert sum(not trial["agrees"] for trial in trials) == last["other"]
    assert 0 < sum(trial["ok"] for trial in trials) < 10
    assert 0 < last["robust"]["lost"] < 10
    named = last["separates"]
    assert named is None or (named[0].replace(".all.", ".x.") in trials[0]["factors"] and named[3] <= 0.05)


def test_runs_agree_if_they_refuse_alike_and_lose_on_the_same_axes() -> None:
    call, lines = TwinSpec(), parse_job(SOUND, create_language("imc-s8"), "imc-s8")
    first, second = (trial.verdict for trial in robust.repetitions(call, lines, 2, timeout_s=60.0))
    assert robust.agree(first, second)
    assert not robust.agree(first, dataclasses.replace(second, refused=1))
    lost = dataclasses.replace(second, lost_steps=(32.1, 0.0, 0.0, 0.0))
    assert not robust.agree(first, lost)
    assert robust.agree(lost, dataclasses.replace(lost, lost_steps=(64.0, 0.0, 0.0, 0.0)))


def test_other_processes_find_the_same(run: Any, tmp_path: Path) -> None:
    call, lines = TwinSpec(tmp_path / "near", seed=3), parse_job(SOUND, create_language("imc-s8"), "imc-s8")
    here = list(robust.repetitions(call, lines, 2, timeout_s=60.0))
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert list(robust.repetitions(call, lines, 2, timeout_s=60.0, crew=crew.here(pool))) == here
    assert here[0].verdict.position_mm != here[1].verdict.position_mm


def test_repetitions_begin_with_the_flash_file_as_it_was_and_leave_it_alone(run: Any, tmp_path: Path) -> None:
    """A stored reference speed of 500 Hz makes the reference run four times as long as the built-in 2000 Hz; the job
    stores 4000 Hz at its end, which no repetition may meet at its beginning."""
    file = tmp_path / "kept.flash"
    (tmp_path / "far").mkdir()
    machine = near_switches(tmp_path / "far", 20.0)
    far = ("--machine", "far", "--flash", file.name)
    assert run("@07\n@0Id500,500,500,500\n@0IW\n", *far)[0] == 0
    slow = file.read_bytes()
    code, out, _ = run(SOUND + "@0Id4000,4000,4000,4000\n@0IW\n", *far, "--robust", "1", "--json")
    *_, trial, _ = (json.loads(line) for line in out)
    stored = file.read_bytes()
    assert (code, trial["agrees"]) == (0, True)
    assert stored != slow
    call, lines = TwinSpec(machine, flash=file), parse_job(SOUND, create_language("imc-s8"), "imc-s8")
    times_s = [
        next(robust.repetitions(call, lines, 1, timeout_s=600.0, flash=flash)).verdict.ended_ns / 1e9
        for flash in (slow, None)
    ]
    assert trial["time_ns"] / 1e9 == pytest.approx(times_s[0], abs=4.0)  # and some seconds for storing
    assert times_s[0] > 2.0 * times_s[1]
    assert file.read_bytes() == stored


# Other ways to say the job, and to read of it ---


def test_a_job_from_standard_input_is_repeated_as_a_file_is(tmp_path: Path) -> None:
    """In other processes too, which have no standard input of it."""
    (tmp_path / "job.txt").write_text(SOUND)
    words = (*NEAR, "--robust", "2", "--workers", "2", "--json")
    from_file, from_input = (forked.run("run", job, *words, input=SOUND, cwd=tmp_path) for job in ("job.txt", "-"))
    assert (from_file.returncode, from_file.stderr) == (from_input.returncode, from_input.stderr) == (0, "")
    assert from_file.stdout == from_input.stdout
    summary, *_, last = (told for line in from_input.stdout.splitlines() if "number" not in (told := json.loads(line)))
    assert (summary["summary"], last["summary"], last["robust"]["of"]) == (True, True, 2)


def test_a_scenario_happens_in_each_repetition(run: Any, tmp_path: Path) -> None:
    """The emergency stop is hit in the reference run, or never."""
    (tmp_path / "stop.toml").write_text('[[event]]\nat = 0.1\nset = { estop = "pressed" }\n')
    code, out, _ = run(SOUND, "--robust", "2", "--scenario", "stop.toml", "--json")
    *_, job, first, second, last = (json.loads(line) for line in out)
    assert (code, last["sound"], last["other"]) == (1, False, 0)
    assert [seen["ok"] for seen in (job, first, second)] == [False] * 3


@pytest.mark.skipif(sys.platform == "win32", reason="pipes there do not break like that")
def test_nobody_reads_on(tmp_path: Path) -> None:
    """As `| head -1` does: no traceback, no hundred repetitions, and no success."""
    (tmp_path / "job.txt").write_text(SOUND)
    with forked.start("run", "job.txt", *NEAR, "--robust", "100", "--workers", "2", "--json", cwd=tmp_path) as child:
        assert child.stdout is not None
        assert child.stderr is not None
        assert json.loads(child.stdout.readline())["number"] == 1
        child.stdout.close()
        assert child.wait(timeout=forked.PATIENCE_S) != 0
        assert "Traceback" not in child.stderr.read()


# Ctrl-C ---


@pytest.mark.skipif(sys.platform == "win32", reason="no signals to a group of processes")
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_of_a_terminal_ends_the_repetitions_and_shows_what_has_been_done(tmp_path: Path, jobs: str) -> None:
    """A terminal sends it to all processes of the command; so many repetitions would take a quarter of a minute."""
    (tmp_path / "job.txt").write_text("@07\n@0R7\n")
    words = ("run", "job.txt", "--robust", "100", "--workers", jobs)
    with forked.start(*words, cwd=tmp_path, start_new_session=True) as command:
        assert command.stdout is not None
        assert any(line.startswith("all well") for line in command.stdout)
        time.sleep(0.5)  # amid a repetition, or in the start of the processes
        os.killpg(command.pid, signal.SIGINT)
        out, err = command.communicate(timeout=forked.PATIENCE_S)
    assert command.returncode == 130
    assert "Traceback" not in err
    assert re.search(r"job.txt: interrupted after \d+ of 100 repetitions", err)
    assert out.splitlines()[-1].startswith("unfinished: ")


def test_a_repetition_in_progress_is_given_up() -> None:
    """Two thousand moves; asked whether to stop at every event, the answer is yes from the 40th time on."""
    call = TwinSpec()
    lines = parse_job("@07\n@0R7\n" + "@0A800,5000,0,30,0,30,0,30\n" * 2000, create_language("imc-s8"), "imc-s8")
    asked = 0

    def stop() -> bool:
        nonlocal asked
        asked += 1
        return asked > 40

    assert list(robust.repetitions(call, lines, 3, timeout_s=60.0, stop=stop)) == []
    assert asked < 100


def test_other_processes_give_up_what_they_are_at() -> None:
    """Eight days of moves each, which take hours to compute."""
    there, back = "@0A72000,100,0,30,0,30,0,30\n", "@0A-72000,100,0,30,0,30,0,30\n"
    lines = parse_job("@07\n@0R7\n" + (there + back) * 500, create_language("imc-s8"), "imc-s8")
    begin_s = time.monotonic()
    made = robust.repetitions(
        TwinSpec(), lines, 2, timeout_s=1e6, crew=crew.local(2), stop=lambda: time.monotonic() > begin_s + 2.0
    )
    assert list(made) == []


# Refusals ---


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--robust", "3", "--plant", "kinematic"),
            "--robust: the kinematic plant loses no steps; use --plant mujoco",
        ),
        (("--robust", "-1"), "--robust -1: must be a number of repetitions"),
        (("--robust", "3", "--workers", "0"), "--workers 0: must be a number of processes from 1"),
    ],
)
def test_a_call_that_makes_no_sense_is_refused_before_anything_runs(run: Any, words: Any, said: str) -> None:
    code, out, err = run(SOUND, *words)
    assert (code, out) == (2, [])
    assert said in err
    assert err.count("\n") == 1


# numbers of the 4030 at an end of what a machine file allows (isel_twin.machine.schema)
AT_THE_END = {
    "axes.all.stage.supply": 200.0,
    "axes.all.backlash": 1.0,
    "axes.all.stiffness": 200.0,
    "axes.all.efficiency": 1.0,
    "axes.all.guide_friction": 2000.0,
    "axes.all.shaft_coulomb": 5.0,
    "axes.all.specimen.inductance": 5.0,
    "axes.all.specimen.resistance": 2.0,
    "payload.mass": 100.0,
}


@pytest.mark.parametrize("source", ["kind", "known"])
def test_machines_are_drawn_within_what_a_machine_file_allows(source: robust.Source) -> None:
    """Half of the draws of a number at its end would lie beyond it; those are at the end, and the factor says so."""
    machine = with_overrides(load_machine("4030"), AT_THE_END)
    drawn = [robust.perturbation(machine, 0, number, source)[1:] for number in range(1, 101)]
    for _, overrides in drawn:
        with_overrides(machine, overrides)
    supplies = [(factors["axes.x.stage.supply"], overrides["axes.x.stage.supply"]) for factors, overrides in drawn]
    assert max(supplies) == (1.0, 200.0)
    assert min(supplies)[0] < 0.95
    assert all(volts == pytest.approx(200.0 * factor) for factor, volts in supplies)


def test_a_machine_that_cannot_be_built_loses_its_repetition(monkeypatch: pytest.MonkeyPatch) -> None:
    """A model whose rail ends before the travel that is drawn: no range of a number says so."""
    draw = robust.perturbation

    def too_long(machine: Machine, seed: int, number: int, source: robust.Source = "kind") -> Any:
        twin_seed, factors, overrides = draw(machine, seed, number, source)
        return twin_seed, factors, {**overrides, **({"axes.x.travel": 9000.0} if number != 2 else {})}

    monkeypatch.setattr(robust, "perturbation", too_long)
    lines = parse_job("@07\n", create_language("imc-s8"), "imc-s8")
    robust.check(TwinSpec(), 3)
    assert [made.number for made in robust.repetitions(TwinSpec(), lines, 3, timeout_s=60.0)] == [2]
    report = check_job(Path("job.txt"), TwinSpec(), lines, Bounds(robust=3))
    assert report.ok
    assert "robust: 2 of its machines cannot be built" in report.findings[0].message
    with pytest.raises(CallError, match=r"axes\.x\.travel: 9000 mm; allowed: up to "):
        robust.check(TwinSpec(), 1)


def test_a_repetition_that_is_not_over_in_time_has_lines_not_sent() -> None:
    lines = parse_job(SOUND, create_language("imc-s8"), "imc-s8")
    verdict = next(robust.repetitions(TwinSpec(), lines, 1, timeout_s=1.0)).verdict
    assert (verdict.ok, verdict.unsent) == (False, 1)  # a reference run takes longer
