"""The line between host and controller in the time of a job: counted where asked, told where it is much.

Ten bits a byte at 8N1, eleven at 8N2 and 8E1; an iMC's command ends with CR, and its reply is one byte.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.in_process import isel_twin

SENT = ["@07", "@0R7", "@0z1", "@0M1600,5000,1600,5000,0,30,0,30"]
SENT += [f"@0M{1600 + 160 * (k % 2)},5000,1600,5000,0,30,0,30" for k in range(1, 201)]  # chords of 0.5 mm
CHORDS = "\n".join(SENT) + "\n"
BITS = 10 * sum(len(command) + 2 for command in SENT)
FAR = "@07\n@0R7\n@0M32000,1000,16000,1000,0,30,0,30\n"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def written(text: str, name: str = "job.txt") -> str:
    Path(name).write_text(text)
    return name


def checked(job: str, *options: str) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(isel_twin("check", job, "--plant", "kinematic", "--json", *options).stdout)
    return answer


@pytest.mark.parametrize("baud", [9600, 19_200, 115_200])
def test_a_line_adds_the_bits_of_all_bytes_where_each_reply_is_awaited(baud: int) -> None:
    job = written(CHORDS)
    alone, timed = checked(job), checked(job, "--line-speed", str(baud))
    assert timed["cycle_s"] - alone["cycle_s"] == pytest.approx(BITS / baud, rel=1e-3)
    assert timed["verdict"]["bytes_ns"] == pytest.approx(BITS / baud * 1e9, rel=1e-5)
    assert alone["verdict"]["bytes_ns"] == pytest.approx(BITS / 19_200 * 1e9, rel=1e-5)
    assert [one["verdict"]["line_counts"] for one in (alone, timed)] == [False, True]


def test_the_line_is_told_above_a_fiftieth_of_the_job() -> None:
    took = f"up to {BITS / 19_200:.3f} s"
    for options, told in ((), f"{took} more on a line of 19200 8N1"), (("--line-speed", "19200"), f"{took} of it on"):
        ran, judged = (isel_twin(how, written(CHORDS), "--plant", "kinematic", *options) for how in ("run", "check"))
        assert told in ran.stdout.splitlines()[-2]
        assert told in judged.stdout.splitlines()[0]
    for command in ("run", "check"):
        assert "line of" not in isel_twin(command, written(FAR), "--plant", "kinematic").stdout


def test_a_bound_of_time_judges_the_line_that_was_asked_for() -> None:
    job = written(CHORDS)
    bound = checked(job)["cycle_s"] + 0.9 * BITS / 19_200
    assert checked(job, "--cycle-s", f"{bound}")["ok"]
    assert [one["rule"] for one in checked(job, "--cycle-s", f"{bound}", "--line-speed", "19200")["findings"]] == [
        "cycle"
    ]
    Path("isel-twin.toml").write_text(f"[check]\ncycle_s = {bound}\nline_speed = 19200\n")
    assert [one["rule"] for one in checked(job)["findings"]] == ["cycle"]
    assert checked(job, "--line-speed", "115200")["ok"]


def test_a_line_of_a_job_ends_with_the_timer_of_the_adapter() -> None:
    job = written(CHORDS)
    ran = isel_twin("run", job, "--plant", "kinematic", "--json", "--adapter-ms", "16")
    *results, summary = map(json.loads, ran.stdout.splitlines())
    assert all(result["end_ns"] % 16_000_000 == 0 for result in results)
    without = checked(job, "--line-speed", "19200")
    assert 0 < summary["time_ns"] - without["verdict"]["time_ns"] <= len(SENT) * 16_000_000


@pytest.mark.parametrize(
    ("controller", "form", "hidden"),
    [("gmi99", "38400 8E1", 0.5), ("ismif", "19200 8N1", 0.0), ("bwo900", "9600 8N2", 0.0)],
)
def test_a_controller_that_keeps_commands_waits_less_for_them(controller: str, form: str, hidden: float) -> None:
    """hidden: least part of the bytes that pass while it moves."""
    baud = form.partition(" ")[0]
    moves = [f"G1 X{10 + k % 2 * 0.5} Y{10 + 0.5 * k}" for k in range(100)]
    job = written("\n".join(["G21 G90", "G1 F1200 X10 Y10", *moves, "M2"]) + "\n", "chords.nc")
    twin = ("--controller", controller, "--machine", "4030" if controller == "ismif" else "4030-servo")
    alone, timed = checked(job, *twin), checked(job, *twin, "--line-speed", baud)
    bytes_s = timed["verdict"]["bytes_ns"] / 1e9
    assert timed["verdict"]["bytes_ns"] == alone["verdict"]["bytes_ns"]
    assert 0.0 < timed["cycle_s"] - alone["cycle_s"] <= (1.0 - hidden) * bytes_s * 1.001


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--line-speed", "3"), "--line-speed 3: must be a number of baud from 50 to 10000000"),
        (("--adapter-ms", "-1"), "--adapter-ms -1: must be a time up to 255 ms"),
        (("--adapter-ms", "nan"), "--adapter-ms nan: must be a time up to 255 ms"),
    ],
)
@pytest.mark.parametrize("command", [("run",), ("check",), ("tune",), ("golden", "record")])
def test_a_line_that_is_none_is_refused(command: tuple[str, ...], options: tuple[str, str], told: str) -> None:
    refused = isel_twin(*command, written(CHORDS), *options)
    assert (refused.returncode, refused.stderr) == (2, f"isel-twin: {told}\n")


def test_a_golden_run_is_made_on_its_line() -> None:
    job = written(FAR)
    assert (
        isel_twin(
            "golden", "record", job, "--plant", "kinematic", "--line-speed", "9600", "--adapter-ms", "2"
        ).returncode
        == 0
    )
    assert isel_twin("golden", "compare", job).returncode == 0
    assert checked(job, "--line-speed", "9600", "--adapter-ms", "2")["ok"]
    messages = [one["message"] for one in checked(job)["findings"]]
    assert any("line_speed: 9600 -> none" in message for message in messages)


def test_a_recording_is_replayed_on_its_line() -> None:
    job = written(FAR)
    line = ("--line-speed", "9600", "--adapter-ms", "16")
    assert isel_twin("run", job, "--plant", "kinematic", *line, "--record", "session.mcap").returncode == 0
    assert isel_twin("replay", "session.mcap").returncode == 0
