"""A job that is recorded and driven again: the same stream to the nanosecond, the same counts, the same places."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.capture.load import load
from isel_twin.capture.play import Strikes
from isel_twin.capture.play import play as play_capture
from isel_twin.capture.player import Player
from isel_twin.capture.ticks import Ticks
from isel_twin.cli import main
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.sending import play
from isel_twin.jobs.verdict import SETTLE_S, judge
from isel_twin.machine import load_machine
from isel_twin.recordings.npz import write_npz
from isel_twin.recordings.recorder import Recorder
from isel_twin.recordings.vcd import write_vcd

REFERENCED = "@07\n@0R7\n@0M16000,8000,8000,4000,0,30,2000,800\n<0.4s>\n@0M8000,5000,9000,1000,0,30,0,30\n"
STOPPED = "@07\n@0ID2\n@0R7\n@0A8000,5000,400,900,0,30,0,30<13> <0.6s> <253>\n@0S\n"
JOBS = {"referenced": (REFERENCED, ""), "stopped": (STOPPED, "y")}
"""And the axes whose motors are turned round: a stream is in the sense of the counters."""


def driven(ticks: Ticks, plant: str, seed: int) -> Twin:
    """A twin that plays a stream, as long after its end as a verdict waits."""
    contacts = tuple(contact.name for contact in load_machine("4030").contacts)
    twin = Twin(controller=Player(ticks, contacts), plant=plant, seed=seed)
    twin.run_until(ticks.end_ns)
    return twin


class Recorded(NamedTuple):
    twin: Twin
    folder: Path
    """With job.npz and job.vcd."""
    plant: str
    reverse: str


@pytest.fixture(
    params=[("referenced", "kinematic"), ("stopped", "kinematic"), ("referenced", "mujoco")], scope="module"
)
def recorded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """A twin that has done a job."""
    (job, reverse), plant = JOBS[request.param[0]], request.param[1]
    folder = tmp_path_factory.mktemp("recorded")
    twin = Twin(plant=plant, seed=5)
    with Recorder(twin, 10_000_000) as recorder:
        list(play(twin, parse_job(job, twin.language, "imc-s8"), 600.0))
        twin.run(SETTLE_S)
        write_npz(folder / "job.npz", twin.steps)
        write_vcd(folder / "job.vcd", twin.steps, recorder)
    return Recorded(twin, folder, plant, reverse)


@pytest.mark.parametrize("name", ["job.npz", "job.vcd"])
def test_the_stream_is_the_same_to_the_nanosecond(recorded: Recorded, name: str) -> None:
    twin, folder, *_ = recorded
    ticks = load(folder / name)
    assert len(ticks.t_ns) > 1000
    np.testing.assert_array_equal(ticks.t_ns, twin.steps.t_ns)
    np.testing.assert_array_equal(ticks.delta, twin.steps.delta)


def test_the_machine_ends_where_it_did(recorded: Recorded) -> None:
    """The dump tells what the controller did with its stages, so the motors are where they were to the bit."""
    twin, folder, plant, reverse = recorded
    again = driven(load(folder / "job.vcd", reverse=reverse), plant, seed=5)
    again.run_until(twin.time_ns)
    sense = np.array([-1 if axis in reverse else 1 for axis in "xyza"])
    np.testing.assert_array_equal(again.counts, twin.steps.delta.sum(axis=0) * sense)
    np.testing.assert_array_equal(again.steps.t_ns, twin.steps.t_ns)
    np.testing.assert_array_equal(again.steps.delta, twin.steps.delta * sense)
    np.testing.assert_array_equal(again.machine_position_mm, twin.machine_position_mm)


def test_a_stream_without_the_stages_ends_there_within_a_load_angle(recorded: Recorded) -> None:
    """An .npz does not tell when the stages were on: from the beginning. What differs is how friction holds the rotors
    at rest, less than a step (3.1 um)."""
    twin, folder, plant, reverse = recorded
    again = driven(load(folder / "job.npz", reverse=reverse), plant, seed=5)
    again.run_until(twin.time_ns)
    sense = np.array([-1 if axis in reverse else 1 for axis in "xyza"])
    np.testing.assert_array_equal(again.counts, twin.steps.delta.sum(axis=0) * sense)
    away_mm = np.abs(again.machine_position_mm - twin.machine_position_mm)
    assert away_mm.max() <= (0.0 if plant == "kinematic" else 0.003)


# ---- the command -----------------------------------------------------------------------------------------------------


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """call(words...) -> exit code, standard output, standard error, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as caught:
            main([*words])
        assert isinstance(caught.value.code, int)
        return caught.value.code, *capsys.readouterr()

    return run


OPTIONS = ("--plant", "kinematic", "--seed", "5", "--json")


@pytest.mark.parametrize("name", ["one.npz", "one.vcd"])
def test_run_then_drive(call: Any, tmp_path: Path, name: str) -> None:
    (tmp_path / "job.txt").write_text(REFERENCED)
    code, out, _ = call("run", "job.txt", *OPTIONS, "--vcd", "one.vcd", "--steps", "one.npz")
    assert code == 0
    before = json.loads(out.splitlines()[-1])
    code, out, err = call("drive", name, *OPTIONS, "--may-strike", "all", "--steps", "two.npz")
    assert (code, err) == (0, "")
    *motions, after = map(json.loads, out.splitlines())
    assert (tmp_path / "two.npz").read_bytes() == (tmp_path / "one.npz").read_bytes()
    assert after["steps"] == before["steps"] == after["capture"]["ticks"]
    assert after["lost_steps"] == [0.0] * 4
    assert {strike["switch"] for strike in after["capture"]["struck"]} == {"limit_x1", "limit_y1", "limit_z1"}
    assert len(motions) == 2  # the pause of 0.4 s parts them
    assert motions[0]["reply"].split() == ["limit_z1", "limit_y1", "limit_x1"]


def test_a_switch_that_is_struck_is_not_well_unless_it_may_be(call: Any, tmp_path: Path) -> None:
    (tmp_path / "job.txt").write_text(REFERENCED)
    call("run", "job.txt", *OPTIONS, "--steps", "job.npz")
    assert call("drive", "job.npz", *OPTIONS)[0] == 1
    assert call("drive", "job.npz", *OPTIONS, "--may-strike", "limit_x1,limit_y1,limit_z1")[0] == 0


LATE = "$timescale {unit} $end\n$var wire 1 s x_step $end\n$var wire 1 d x_dir $end\n$enddefinitions $end\n#0\n0s\n0d\n"
"""Steps of 5 us, one each 100 us; the direction turns 20 times, 200 ns before a step."""


def late(unit: str, length_ns: int) -> str:
    turns = [(10_000 + 100_000 * k - 200, f"{1 - k % 2}d") for k in range(20)]
    steps = [(10_000 + 100_000 * k + after, level) for k in range(20) for after, level in ((0, "1s"), (5000, "0s"))]
    changes = "".join(f"#{time // length_ns}\n{what}\n" for time, what in sorted(turns + steps))
    return LATE.format(unit=unit) + changes


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_a_direction_that_turns_too_late_is_not_well(call: Any, tmp_path: Path, plant: str) -> None:
    """650 ns is what a DRV8825 needs (TI, SLVSA73); 200 ns are enough for a drive of 150 ns, or for nobody who asks."""
    (tmp_path / "late.vcd").write_text(late("1 ns", 1))
    words = ("drive", "late.vcd", "--plant", plant, "--start", "50,50,20")
    told = "X: 20 changes of direction less than 0.65 us before a step, the first at 0.000010 s, the shortest 0.2 us"
    code, out, _ = call(*words, "--report", "page.html")
    assert code == 1
    assert f"failed: 1 motion, {told}, " in out
    page = (tmp_path / "page.html").read_text()
    assert "<p class='verdict bad'>" in page
    assert f"<p>{told}</p>" in page
    code, out, _ = call(*words, "--json")
    summary = json.loads(out.splitlines()[-1])
    assert (code, summary["ok"]) == (1, False)
    assert [(one["rule"], one["level"], one["time_s"]) for one in summary["findings"]] == [("signal", "error", 1e-5)]
    for enough in ("0.2", "0.15", "0"):
        code, out, _ = call(*words, "--setup-us", enough, "--json")
        summary = json.loads(out.splitlines()[-1])
        assert (code, summary["ok"], summary["findings"]) == (0, True, [])
        assert "not_looked_at" not in summary
    assert call(*words, "--setup-us", "0", "--pulse-us", "5.1")[0] == 1, "pulses of 5 us"


def test_what_a_capture_cannot_tell_is_not_judged_and_said(call: Any, tmp_path: Path) -> None:
    """At one sample a microsecond 200 ns are 0 or 1 us; pulses of 5 us can be told from 1.9 us."""
    (tmp_path / "late.vcd").write_text(late("1 us", 1000))
    code, out, _ = call("drive", "late.vcd", *OPTIONS[:2], "--start", "50,50,20", "--json")
    assert (code, json.loads(out.splitlines()[-1])["not_looked_at"]) == (0, ["setup_us", "hold_us"])
    code, out, _ = call("drive", "late.vcd", *OPTIONS[:2], "--start", "50,50,20")
    assert "not looked at: setup_us, hold_us; the capture resolves 1000 ns" in out


def test_a_gap_is_not_well(call: Any, tmp_path: Path) -> None:
    """140 steps at 1 kHz with $dumpoff for 7 ms: 133 are captured."""
    lines = ["$timescale 1 us $end", "$var wire 1 s x_step $end", "$var wire 1 d x_dir $end", "$enddefinitions $end"]
    lines += ["#0", "$dumpvars 0s 1d $end"]
    for k in range(1, 141):
        if k == 61:
            lines += ["#60500", "$dumpoff xs xd $end"]
        if k == 68:
            lines += ["#67500", "$dumpon 0s 1d $end"]
        if not 61 <= k < 68:
            lines += [f"#{1000 * k}", "1s", f"#{1000 * k + 5}", "0s"]
    (tmp_path / "gap.vcd").write_text("\n".join(lines) + "\n")
    code, out, _ = call("drive", "gap.vcd", *OPTIONS[:2], "--start", "50,50,20")
    assert code == 1
    assert "a mapped signal has no level from 0.060500 to 0.067500 s: what it did then is missing" in out
    code, out, _ = call("drive", "gap.vcd", *OPTIONS, "--start", "50,50,20")
    summary = json.loads(out.splitlines()[-1])
    assert (code, summary["ok"], summary["steps"]) == (1, False, 133)
    assert summary["capture"]["gaps_ns"] == [[60_500_000, 67_500_000]]
    assert [(one["rule"], one["time_s"]) for one in summary["findings"]] == [("signal", 0.0605)]


def test_a_switch_that_is_struck_from_the_beginning_is_not_well(call: Any, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t_ns=np.arange(1, 81) * 200_000, delta=np.ones((80, 1), dtype=np.int8))
    words = ("drive", "a.npz", "--plant", "kinematic", "--start=-1,50,20")
    code, out, _ = call(*words)
    assert code == 1
    assert "all well" not in out
    assert "limit_x1 is struck" in out
    assert call(*words, "--may-strike", "limit_x1")[0] == 0


def test_the_table_tells_what_happened(call: Any, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t_ns=np.arange(1, 8001) * 200_000, delta=np.ones((8000, 1), dtype=np.int8))
    call("drive", "a.npz", *OPTIONS, "--vcd", "job.vcd")
    code, out, err = call("drive", "job.vcd", "--plant", "kinematic", "--start", "50,50,20", "--interval", "1")
    assert (code, err) == (0, "")
    assert "X +8000" in out
    assert "all well as far as simulated: 1 motion, " in out
    assert "X: 8000 steps, at most 5000 steps/s" in out
    assert "cycle time" in out


def test_every_output_is_written(call: Any, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t_ns=np.arange(1, 8001) * 200_000, delta=np.ones((8000, 1), dtype=np.int8))
    call("drive", "a.npz", *OPTIONS, "--vcd", "job.vcd")
    written = ("--steps", "s.npz", "--vcd", "v.vcd", "--trace", "t.parquet", "--report", "r.html")
    code, _, err = call("drive", "job.vcd", *OPTIONS, *written)
    assert (code, err) == (0, "")
    assert all((tmp_path / name).stat().st_size for name in written[1::2])
    np.testing.assert_array_equal(load(tmp_path / "v.vcd").t_ns, load(tmp_path / "job.vcd").t_ns)


def test_one_file_that_cannot_be_written_costs_neither_the_verdict_nor_another_file(call: Any, tmp_path: Path) -> None:
    """As `run` does: the stream meets a full disk; verdict, VCD, recording and page are there."""
    np.savez(tmp_path / "a.npz", t_ns=np.arange(1, 8001) * 200_000, delta=np.ones((8000, 1), dtype=np.int8))
    outputs = ("--steps", "/dev/full", "--vcd", "v.vcd", "--record", "r.mcap", "--report", "r.html")
    code, out, err = call("drive", "a.npz", "--plant", "kinematic", "--start", "50,50,20", *outputs)
    assert (code, err) == (2, "isel-twin: /dev/full: No space left on device\n")
    assert "failed: 1 motion, not written: /dev/full, " in out
    assert "cycle time" in out
    assert all((tmp_path / name).stat().st_size > 1000 for name in ("v.vcd", "r.mcap"))
    assert "</html>" in (tmp_path / "r.html").read_text()


def test_a_wall_in_the_way_loses_steps(call: Any, tmp_path: Path) -> None:
    """200 mm at 25 mm/s from 300 mm on: the far-end switch at 395 mm is struck, the stop 3 mm behind it holds."""
    n = 64_000
    t_ns = np.arange(1, n + 1, dtype=np.int64) * 125_000
    np.savez(tmp_path / "long.npz", t_ns=t_ns, delta=np.outer(np.ones(n), [1, 0, 0]).astype(np.int8))
    code, out, _ = call("drive", "long.npz", "--start", "300,50,20", "--json")
    summary = json.loads(out.splitlines()[-1])
    assert code == 1
    assert summary["lost_steps"][0] > 30_000
    (strike,) = summary["capture"]["struck"]
    assert (strike["switch"], strike["allowed"]) == ("limit_x2", False)
    assert strike["time_ns"] == pytest.approx(95.0 / 25.0 * 1e9, abs=5e7)


def test_overrides_change_the_machine(call: Any, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t_ns=np.arange(1, 1601) * 1_000_000, delta=np.ones((1600, 1), dtype=np.int8))
    for words, way_mm in ((), 5.0), (("--set", "axes.x.steps_per_rev=3200"), 2.5), (("--reverse", "x"), -5.0):
        code, out, _ = call("drive", "a.npz", *OPTIONS, *words)
        assert code == 0
        assert json.loads(out.splitlines()[-1])["position_mm"][0] == pytest.approx(way_mm, abs=1e-9)


def test_a_scenario_acts_on_a_driven_machine(call: Any, tmp_path: Path) -> None:
    """The E-stop cuts the power of the stages: what is captured afterwards is not made."""
    np.savez(tmp_path / "a.npz", t_ns=np.arange(1, 16001) * 250_000, delta=np.ones((16000, 1), dtype=np.int8))
    (tmp_path / "stop.toml").write_text('[[event]]\nat = 2.0\nset = { estop = "pressed" }\n')
    code, out, err = call("drive", "a.npz", "--seed", "5", "--json", "--scenario", "stop.toml")
    assert code == 1, err
    summary = json.loads(out.splitlines()[-1])
    assert summary["lost_steps"][0] == pytest.approx(8000, abs=40)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.vcd"], "none.vcd: there is no such file"),
        (["a.bin"], "the name must end in .vcd"),
        (["a.npz", "--map", "x.step=D0,x.dir=D1"], "leave the map out"),
        (["a.npz", "--start", "1,2"], "--start '1,2': must be three numbers"),
        (["a.npz", "--start", "1,2,2000"], "start_mm: z"),
        (["a.npz", "--set", "axes.x.lead"], "--set 'axes.x.lead': must be KEY=VALUE"),
        (["a.npz", "--set", "axes.x.led=5"], "axes.x.led"),
        (["a.npz", "--may-strike", "limit_q1"], "--may-strike limit_q1: there are limit_x1"),
        (["a.npz", "--reverse", "w"], "reverse w: there are x"),
        (["late.npz", "--vcd", "b.vcd"], "--interval 0.01: makes 1.0e+10 samples"),
        (["a.npz", "--gap", "0"], "--gap 0: must be a time"),
        (["a.npz", "--pulse-us", "nan"], "--pulse-us nan: must be from 0"),
        (["a.npz", "--steps", "a.npz"], "named twice"),
        (["a.npz", "--machine", "9"], "9"),
        (["empty.npz"], "has no step in it"),
    ],
)
def test_a_call_that_cannot_be_carried_out_is_one_line(call: Any, tmp_path: Path, words: list[str], said: str) -> None:
    np.savez(tmp_path / "a.npz", t_ns=np.arange(1, 10), delta=np.ones((9, 3), dtype=np.int8))
    np.savez(tmp_path / "empty.npz", t_ns=np.arange(0), delta=np.ones((0, 3), dtype=np.int8))
    np.savez(tmp_path / "late.npz", t_ns=np.array([10**17]), delta=np.ones((1, 3), dtype=np.int8))
    (tmp_path / "a.bin").write_bytes(b"x")
    code, out, err = call("drive", *words, "--plant", "kinematic")
    assert (code, out, err.count("\n")) == (2, "", 1), err
    assert said in err


def test_full_steps_of_a_half_step_stage_are_pulses_of_two(tmp_path: Path) -> None:
    """The iSMIF counts half steps; in full-step mode a pulse is two of them, which the dump says beside it."""
    twin = Twin(controller="ismif", plant="kinematic", seed=5)
    job = "$HZXY<1>\nF1\nL1,x400,y101<1>\nF0\nL1,x101,y30<1>\n"
    with Recorder(twin, 10_000_000) as recorder:
        list(play(twin, parse_job(job, twin.language, "ismif"), 600.0))
        write_vcd(tmp_path / "job.vcd", twin.steps, recorder)
    assert set(np.unique(np.abs(twin.steps.delta))) == {0, 1, 2}
    ticks = load(tmp_path / "job.vcd")
    np.testing.assert_array_equal(ticks.t_ns, twin.steps.t_ns)
    np.testing.assert_array_equal(ticks.delta, twin.steps.delta)


def test_a_recording_of_a_driven_machine_is_replayed_to_the_bit(call: Any, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t_ns=np.arange(1, 16001) * 250_000, delta=np.ones((16000, 1), dtype=np.int8))
    (tmp_path / "stop.toml").write_text('[[event]]\nat = 2.0\nset = { estop = "pressed" }\n')
    words = ("--scenario", "stop.toml", "--start", "50,50,20", "--record", "a.mcap", "--json")
    code, out, err = call("drive", "a.npz", *words)
    assert (code, err) == (1, "")
    assert json.loads(out.splitlines()[-1])["ok"] is False
    code, out, err = call("replay", "a.mcap")
    assert (code, err) == (0, "")
    assert "no difference" in out
    assert call("export", "a.mcap", "b.npz")[0] == 0
    np.testing.assert_array_equal(load(tmp_path / "b.npz").t_ns, load(tmp_path / "a.npz").t_ns)


def test_a_player_comes_back_from_its_image() -> None:
    outputs = ((0, "stages", 0), (5, "stages", 1))
    ticks = Ticks(np.array([3, 9]), np.array([[1, 0], [-1, 2]], dtype=np.int8), 9, outputs)
    player = Player.restored(Player(ticks, ("limit_x1",), 5).image())
    assert (player.terminals(), len(player.motions)) == ({"limit_x1": ("limit_x1",)}, 2)
    twin = Twin(controller=player, plant="kinematic")
    twin.run_until(9)
    assert (twin.steps.t_ns.tolist(), twin.steps.delta.tolist()) == ([3, 9], [[1, 0], [-1, 2]])
    assert twin.outputs["stages"] == 1
    for image in (b"", b"PK", b"isel-twin"):
        with pytest.raises(ValueError, match="is no image of a player"):
            Player.restored(image)


def test_an_interrupted_play_has_made_the_ticks_before() -> None:
    ticks = Ticks(np.arange(1, 1001) * 1_000_000, np.ones((1000, 3), dtype=np.int8), 1_000_000_000)
    player = Player(ticks)
    twin = Twin(controller=player, plant="kinematic", start_mm=(50, 50, 20))
    twin.observe(lambda _: None, 10_000_000)  # somebody looks, so that something happens on the way
    (result,) = play_capture(twin, player, ticks.over_ns, Strikes(twin), bool, lambda: twin.time_ns >= 300_000_000)
    assert (result.complete, result.ok) == (False, True)
    assert result.counts == (result.end_ns // 1_000_000,) * 3
    verdict = judge(twin, [result], 0, interrupted=True)
    assert (verdict.ok, verdict.refused) == (False, 0)
