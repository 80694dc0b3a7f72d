"""What no job may call well: a controller that starts anew, steps without current, a store that is not kept; and what a
job has to say itself if it is about just that."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.cli import main
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks import check_job
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import Played, played

pytestmark = pytest.mark.long(seconds=4)

PLANTS = ("kinematic", "mujoco")
PROGRAM = "N10 G90 G0 X10\nN20 G1 F600 X30\nN30 M30\n"


def command(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(ended.value.code or 0)


def run(job: str, scenario: str = "", controller: str = "imc-s8", plant: str = "kinematic", machine: str = "4030",
        folder: Path | None = None) -> tuple[Twin, Played]:  # fmt: skip
    file = None
    if scenario:
        assert folder is not None
        file = folder / "events.toml"
        file.write_text(scenario)
    twin = Twin(machine, controller, plant, scenario=file, start_mm=(50.0, 50.0, 50.0))
    return twin, played(twin, parse_job(job, twin.language, controller))


def event(at_s: float, acts: str) -> str:
    return f"[[event]]\nat = {at_s}\n{acts}\n"


BROWNOUT = "brownout = true\nfor = 0.2"

# ---- a controller that starts anew -----------------------------------------------------------------------------------


@pytest.mark.parametrize("acts", [BROWNOUT, "reset = true"])
@pytest.mark.parametrize("plant", PLANTS)
def test_a_program_that_a_restart_has_ended_is_not_well(plant: str, acts: str, tmp_path: Path) -> None:
    clean = run(PROGRAM, "", "bwo900", plant, "4030-servo")[1]
    assert clean.ok
    middle_s = (clean.verdict.ended_ns - 5e8) / 1e9
    made = run(PROGRAM, event(middle_s, acts), "bwo900", plant, "4030-servo", tmp_path)[1]
    assert not made.ok
    assert made.verdict.restarts == 1
    assert "the controller restarted" in made.results[-1].shown_reply
    assert acts.split(" ")[0] in made.results[-1].event


@pytest.mark.parametrize(
    ("controller", "job"),
    [
        ("imc-s8", "@07\n@0R7\n@0A3200,800,0,30,0,30,0,30"),
        ("ismif", "$HZXY<1>\n<1s>\nL1,X9000<1>"),
        ("ismif", "$HZXY<1>\n<1s>\n@R"),
    ],
)
def test_so_is_every_restart_before_the_last_reply(controller: str, job: str, tmp_path: Path) -> None:
    """During a line, or between two lines of which each is answered as it has to be."""
    clean = run(job, "", controller)[1]
    assert clean.ok
    for at_ns in (clean.results[-1].end_ns - 1_000, clean.results[1].time_ns + 1_000_000):
        made = run(job, event(at_ns / 1e9, "reset = true"), controller, folder=tmp_path)[1]
        assert (made.ok, made.verdict.restarts) == (False, 1)


def test_after_the_last_reply_it_may_start_anew(tmp_path: Path) -> None:
    made = run("@07", event(0.2, "reset = true"), folder=tmp_path)[1]
    assert (made.ok, made.verdict.restarts, made.verdict.events_after_end) == (True, 0, 1)


def test_a_job_about_a_restart_says_so(tmp_path: Path) -> None:
    job = "@07 => 0\n<1s> => none\n@07 => 0\n"
    once, twice = event(0.5, BROWNOUT), event(0.5, BROWNOUT) + event(2.0, "reset = true")
    more = "! restarts == 1\n<2s> => none\n@07\n"
    assert not run(job, once, folder=tmp_path)[1].ok
    assert run(f"{job}! restarts == 1", once, folder=tmp_path)[1].ok
    assert not run(job + more, twice, folder=tmp_path)[1].ok
    assert run(f"{job}{more}! restarts == 2", twice, folder=tmp_path)[1].ok


# ---- steps without current -------------------------------------------------------------------------------------------

LONG = "$HZXY<1>\n<1s>\nL1,X9000<1>\n"


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("acts", ['set.estop = "pressed"', 'set.hood = "forced"'])
def test_an_interface_that_steps_on_without_current_has_not_done_its_job(plant: str, acts: str, tmp_path: Path) -> None:
    """The iSMIF has no input that would tell it (ismif/9): it makes all its steps."""
    clean = run(LONG, "", "ismif", plant)
    assert clean[1].ok
    assert clean[0].unpowered_steps.sum() == 0
    twin, made = run(LONG, event(clean[1].results[-1].end_ns / 1e9 - 0.5, acts), "ismif", plant, folder=tmp_path)
    assert twin.steps.delta.shape == clean[0].steps.delta.shape
    assert made.results[-1].ok
    assert not made.ok
    assert 0 < made.verdict.unpowered_steps == twin.unpowered_steps[0] < 9000
    assert f"{made.verdict.unpowered_steps} steps made while the power stages were off" in made.verdict.problems()


def test_the_finding_names_the_line(tmp_path: Path) -> None:
    (tmp_path / "events.toml").write_text(event(40.0, 'set.estop = "pressed"'))
    spec = TwinSpec(controller="ismif", plant="kinematic", scenario=tmp_path / "events.toml")
    report = check_job(tmp_path / "job.txt", spec, parse_job(LONG * 9, spec.build().language, "ismif"))
    first = report.findings[0]
    assert first.rule == "unpowered"
    assert first.line is not None
    assert "made while the stages have no power" in first.message


@pytest.mark.parametrize(("plant", "said"), [("kinematic", "unpowered > 0"), ("mujoco", "unpowered > 0\n! lost > 0")])
def test_a_job_about_an_emergency_stop_says_so(plant: str, said: str, tmp_path: Path) -> None:
    end_s = run(LONG, "", "ismif", plant)[1].results[-1].end_ns / 1e9
    scenario = event(end_s - 0.5, 'set.estop = "pressed"')
    assert run(f"{LONG}<1s> => none\n! {said}\n", scenario, "ismif", plant, folder=tmp_path)[1].ok
    other = "margin >= 0" if plant == "mujoco" else "lost == 0"
    assert not run(f"{LONG}! {other}\n", scenario, "ismif", plant, folder=tmp_path)[1].ok


# ---- the flash -------------------------------------------------------------------------------------------------------


def test_a_store_that_is_not_kept_is_lost_is_told_and_fails_the_job() -> None:
    """As after a power-cycle: the values of before are there. No manual knows a reply for it (core/6)."""
    twin = Twin(plant="kinematic")
    before = twin.flash

    def full(image: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    twin.on_flash = full
    made = played(twin, parse_job("@07\n@0J500\n@0IW", twin.language, "imc-s8"))
    assert made.results[-1].reply == "0"
    assert (made.ok, made.verdict.stores_lost) == (False, 1)
    assert twin.flash == before
    assert "not kept" in twin.remarks[-1][1]
    assert "the flash memory did not keep what was stored" in made.verdict.problems()


def test_the_file_of_a_full_disk_is_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    job, flash = tmp_path / "job.txt", tmp_path / "flash"
    job.write_text("@07\n@0J500\n@0IW\n")
    flash.write_bytes(b"")
    from isel_twin.core import flash as module

    def full(path: Path, data: bytes) -> None:
        if data:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(module, "atomic_write", full)
    assert command("run", job, "--plant", "kinematic", "--flash", flash) == 1
    assert "the flash memory did not keep what was stored" in capsys.readouterr().out
    assert flash.read_bytes() == b""


# ---- words -----------------------------------------------------------------------------------------------------------


def test_a_refusal_says_what_it_means_and_what_came_before(tmp_path: Path) -> None:
    made = run("@07\n@0R7\n@0A16000,800,0,30,0,30,0,30", event(40.0, 'set.estop = "pressed"'), folder=tmp_path)[1]
    *_, last = made.results
    assert last.reply == "9"
    assert last.shown_reply.startswith("9: ")
    assert last.shown_reply.endswith("; meanwhile, at 40.000 s: set estop pressed")
    after = run("@07\n<1s>\n@0R7", event(0.5, 'set.estop = "pressed"'), folder=tmp_path)[1].results[-1]
    assert after.event == "before, at 0.500 s: set estop pressed"


def test_a_load_angle_is_no_lost_step(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    job = tmp_path / "job.txt"
    job.write_text("@07\n@0R7\n@0A1600,800,0,30,0,30,0,30\n")
    assert command("run", job) == 0
    assert "all well: 3 commands, no steps lost, least torque margin" in capsys.readouterr().out
    assert command("run", job, "--json") == 0
    assert '"lost_steps": [0, 0, 0, 0]' in capsys.readouterr().out


def test_what_the_kinematic_plant_cannot_know_is_said_once(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    job = tmp_path / "job.txt"
    job.write_text("@07\n@0R7\n")
    assert command("run", job, "--plant", "kinematic") == 0
    out = capsys.readouterr().out
    assert out.count("lost steps, margins and loads were not simulated; use --plant mujoco") == 1
    assert "lost steps:" not in out


# ---- legal and absurd ------------------------------------------------------------------------------------------------


def test_a_move_that_another_axis_times_is_remarked(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """In 3D the speed written for X is that of the longest way (2.2.18): 16 000 steps at 30 a second are 533 s."""
    job = tmp_path / "job.txt"
    job.write_text("@07\n@0R7\n@0z1\n@0M12,30,16000,900,0,30,0,30\n@0M1600,900,16000,900,0,30,0,30\n")
    assert command("run", job, "--plant", "kinematic") == 0
    said = "Y: 16000 steps in 533 s, 30 steps/s instead of 900: another axis sets the time of this move"
    assert [line for line in capsys.readouterr().out.splitlines() if "remark" in line] == [f"remark: line 4: {said}"]
    assert command("check", job, "--plant", "kinematic") == 0
    assert f"warning odd        line 4: {said}" in capsys.readouterr().out


@pytest.mark.parametrize(
    "lines",
    [
        ["@0M3000,5000,0,30,2000,100,0,30"],  # X is over after 0.6 s, then Z takes its 20 s (2.2.2)
        ["@0A160,800,0,30,4000,400,-4000,400"],  # Z goes down and comes back
        ["@0J1", "@0A30000,40000,0,30,0,30,0,30"],  # a slow ramp
        ["@0M9600,4000,9600,4000,0,30,0,30", "@0f-1", "@0w25600,2000,-1600,3200,0,-1,1,200"],  # a helix of one turn
    ],
    ids=["2.5D", "down and up", "ramp", "helix"],
)
def test_a_move_that_is_made_as_it_is_written_is_not_remarked(lines: list[str]) -> None:
    assert run("\n".join(["@07", "@0N7", *lines]), "", plant="kinematic")[1].verdict.odd == ()


def test_moves_that_are_joined_in_one_line_are_not_remarked() -> None:
    """5.5 mm of Z are over after 0.6 s; the rest of the line is the way of X, there and back."""
    lines = ["M50000", "f10000 | 84h 5500 | H2 | 81h 90000 | H2 | 81h 0 | H2"]
    assert run("\n".join(["Q4;1", "Q3;1", *lines]), "", "gmi99", "kinematic", "4030-servo")[1].verdict.odd == ()


def test_a_block_that_crawls_is_remarked() -> None:
    slow = PROGRAM.replace("N30", "N25 G1 X31 F0.5\nN27 G0 X5\nN30")
    odd = run(slow, "", "bwo900", "kinematic", "4030-servo")[1].verdict.odd
    assert [line for line, _ in odd] == [3]
    assert odd[0][1].startswith("P1 N25 G1 X31 F0.5 takes 120 s at 0.5 mm/min")
    assert run(PROGRAM, "", "bwo900", "kinematic", "4030-servo")[1].verdict.odd == ()


# ---- nothing to compare ----------------------------------------------------------------------------------------------


def test_recordings_in_which_nothing_is_done_are_not_the_same(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    from isel_twin.recordings.recording import FileRecording

    for name in ("a", "b"):
        twin = Twin(plant="kinematic")
        recording = FileRecording(tmp_path / f"{name}.mcap", twin, 10_000_000)
        twin.run(0.1)
        assert recording.close()
    assert command("replay", tmp_path / "a.mcap") == 2
    assert "no host and no operator acts in it: there is nothing to compare" in capsys.readouterr().err
    assert command("compare", tmp_path / "a.mcap", tmp_path / "b.mcap") == 2
    assert "no host sends a command in them: there is nothing to compare" in capsys.readouterr().err


def test_a_panel_that_looks_leaves_the_recorded_margins_as_they_are(tmp_path: Path) -> None:
    """Two readers that look again and again: every sample is as it was without them."""
    from isel_twin.recordings.reading import read
    from isel_twin.recordings.recording import FileRecording

    seen = []
    for readers in (0, 2):
        twin = Twin(start_mm=(50.0, 50.0, 50.0))
        file = tmp_path / f"{readers}.mcap"
        recording = FileRecording(file, twin, 10_000_000)
        panels = [twin.margin_reader() for _ in range(readers)]
        twin.write(b"@07\r@0R7\r")
        for _ in range(300):
            twin.run(0.01)
            for panel in panels:
                panel.take()
        assert recording.close()
        seen.append(read(file).samples.tobytes())
    assert seen[0] == seen[1]
    assert len(seen[0]) > 0


def test_a_controller_that_waits_is_told_from_one_that_moves() -> None:
    """A move ends 2 s after power-on; a minute and more later nothing has come."""
    from isel_twin.jobs.why import waits

    twin = Twin(plant="kinematic")
    assert [twin.query(line) for line in ("@07", "@0N7", "@0A1600,800,0,30,0,30,0,30")] == ["0", "0", "0"]
    twin.run(59.0)
    assert waits(twin, 3600.0) == ""
    twin.run(2.0)
    said = "no complete reply within 3600 s, and nothing has moved since 2.0"
    assert waits(twin, 3600.0).startswith(said)
    assert "the controller waits for an input" in waits(twin, 3600.0)
    assert waits(twin, 10.0) == ""
