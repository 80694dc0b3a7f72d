"""`isel-twin run`: what is refused before anything begins, what is said at the end, and what survives a Ctrl-C."""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import unknown

from isel_twin.base.units import SECOND_NS
from isel_twin.cli import main
from isel_twin.cli import options as common
from isel_twin.core.twin import Twin
from tests.forked import PATIENCE_S, PIPE, run, start, start_anew
from tests.in_process import isel_twin

pytestmark = pytest.mark.long(seconds=7)

Call = tuple[int, str, str]


@pytest.fixture
def call(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> Any:
    """call(job, options...) -> exit code, standard output, standard error, of a job in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run(job: str | bytes, *options: str, plant: str = "kinematic") -> Call:
        (tmp_path / "job.txt").write_bytes(job if isinstance(job, bytes) else job.encode())
        with pytest.raises(SystemExit) as caught:
            main(["run", "job.txt", "--plant", plant, *options])
        assert isinstance(caught.value.code, int)
        out, err = capsys.readouterr()
        logged = "".join(f"isel-twin: {record.getMessage()}\n" for record in caplog.records)  # pytest takes the log
        caplog.clear()
        return caught.value.code, out, logged + err

    return run


def lines_of(out: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Results and summary of `--json`."""
    *results, summary = [json.loads(line) for line in out.splitlines()]
    return results, summary


# ---- outputs --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("option", "name"),
    [(option, "-") for option in ("--steps", "--vcd", "--trace", "--report")]
    + [("--vcd", name) for name in ("/dev/stdin", "/dev/fd/0", "precious.vcd")],
)
def test_nothing_is_written_to_the_file_behind_standard_input(tmp_path: Path, option: str, name: str) -> None:
    (tmp_path / "job.txt").write_text("@07\n")
    precious = tmp_path / "precious.vcd"
    precious.write_text("years of work")
    with precious.open() as stdin:
        done = run("run", "job.txt", "--plant", "kinematic", option, name, stdin=stdin, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert "standard input" in done.stderr
    assert precious.read_text() == "years of work"


def test_nor_to_the_file_behind_standard_output(tmp_path: Path) -> None:
    (tmp_path / "job.txt").write_text("@07\n")
    with (tmp_path / "out.txt").open("w") as stdout:
        done = run("run", "job.txt", "--plant", "kinematic", "--vcd", "/dev/stdout", stdout=stdout, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "standard output" in done.stderr


def test_a_stream_into_a_place_nobody_can_look_at_is_well(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The output of `sudo -u other isel-twin run ... > report` lies where the other user may not go. Root may go
    anywhere, so the place here is one whose name is too long for any user."""
    monkeypatch.setattr(common, "STREAMS", {"x" * 300: "standard output"})
    common.check_writable(tmp_path / "steps.npz")
    assert not (tmp_path / "steps.npz").exists()


def test_a_pipe_is_written_to(tmp_path: Path) -> None:
    (tmp_path / "job.txt").write_text("@07\n")
    done = run("run", "job.txt", "--plant", "kinematic", "--vcd", "/dev/stderr", cwd=tmp_path)
    assert done.returncode == 0
    assert "$timescale" in done.stderr


def test_a_minus_for_the_job_is_standard_input_wherever_it_stands(tmp_path: Path) -> None:
    for words in (["-", "--json"], ["--json", "-"]):
        done = run("run", "--plant", "kinematic", *words, input="@07\n", start=start_anew)
        assert (done.returncode, done.stderr) == (0, "")


# ---- job files ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("job", ["", "\n\n", "# nothing but words\n", "   # and blanks"])
def test_a_job_without_commands_is_refused(call: Any, job: str) -> None:
    assert call(job) == (2, "", "isel-twin: job.txt: there is no command in it\n")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_a_job_in_utf_16_is_refused(call: Any, encoding: str) -> None:
    code, out, err = call("# Ångström\n@07\n".encode(encoding))
    assert (code, out) == (2, "")
    assert re.fullmatch(r"isel-twin: job\.txt: .*UTF-16.*; save it as UTF-8\n", err)


def test_a_picture_is_no_job(call: Any) -> None:
    code, _, err = call(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR")
    assert (code, err.count("\n")) == (2, 1)


def test_what_is_wrong_with_standard_input_is_said_of_standard_input(tmp_path: Path) -> None:
    done = isel_twin("run", "-", stdin="@07\n<256>\n")
    assert done.stderr == (
        "isel-twin: standard input: line 2: <256> is neither a byte (<0> to <255>) nor a pause (<0.5s>)\n"
    )


# ---- what a reply belongs to ----------------------------------------------------------------------------------------

LATE = "@07\n@0R7\n@0A16000,5000,0,30,0,30,0,30\n@0P\n@0V\n"
"""The third command takes more than three seconds."""


def test_a_reply_that_comes_too_late_is_credited_to_nobody(call: Any) -> None:
    code, out, err = call("@07\n@0R7\n", "--json")
    assert code == 0
    code, out, err = call(LATE.replace("@0R7", "@0N7"), "--timeout", "1", "--json")
    results, summary = lines_of(out)
    assert [(result["command"][:3], result["reply"], result["ok"], result["complete"]) for result in results] == [
        ("@07", "0", True, True),
        ("@0N", "0", True, True),
        ("@0A", "", False, False),
    ]
    assert (code, summary["ok"], summary["commands"], summary["refused"], summary["unsent"]) == (1, False, 3, 0, 2)
    assert summary["unfinished"] == 1
    assert err == (
        "isel-twin: job.txt: line 3: no complete reply within 1 s of virtual time; the job ends there and "
        "2 lines are not sent; --timeout waits longer\n"
    )


def test_the_last_line_may_be_late_as_well(call: Any) -> None:
    code, out, err = call("@07\n@0N7\n@0A16000,5000,0,30,0,30,0,30\n", "--timeout", "1")
    assert code == 1
    assert "failed: 3 commands, 1 unfinished" in out
    assert "line 3: no complete reply within 1 s of virtual time; the job ends there; --timeout waits longer" in err


# ---- what had no effect ---------------------------------------------------------------------------------------------


def test_what_had_no_effect_is_said_and_counted(call: Any, tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(
        "[[event]]\nat = 0.0\nforce_n = { x = 50 }\n[[event]]\nat = 0.5\nphase_lost = { y = 'a' }\n"
        "[[event]]\nat = 90.0\nset = { estop = 'pressed' }\n[[event]]\nat = 5.2\nset = { user_0 = 'high' }\n"
    )
    job = "@07\n<5s>\n"
    code, out, err = call(job, "--scenario", "scenario.toml", "--json")
    _, summary = lines_of(out)
    assert (code, summary["ok"]) == (0, True)
    assert (summary["events_without_effect"], summary["events_after_end"]) == (2, 2)
    assert err.count("\n") == 1
    assert "scenario.toml: 2 of 4 events have no effect without physics" in err

    code, out, _ = call(job, "--scenario", "scenario.toml")
    assert code == 0
    idle = "2 events without effect (no physics), 2 events after the end of the job"
    assert f"all well as far as simulated, but for the scenario: {idle}" in out

    code, out, err = call("@07\n<91s>\n", "--scenario", "scenario.toml", "--json", plant="mujoco")
    _, summary = lines_of(out)
    assert (summary["events_without_effect"], summary["events_after_end"], err) == (0, 0, "")


@pytest.mark.parametrize(("job", "code"), [("@07\n", 1), ("@07\n@0IUx\n@0IW\n", 0)], ids=["left", "written anew"])
def test_a_damaged_flash_image_fails_the_job(call: Any, tmp_path: Path, job: str, code: int) -> None:
    assert call("@07\n@0IUx\n@0IW\n", "--flash", "flash.bin")[0] == 0
    image = bytearray((tmp_path / "flash.bin").read_bytes())
    image[-1] ^= 1
    (tmp_path / "flash.bin").write_bytes(image)
    returned, out, _ = call(job, "--flash", "flash.bin", "--json")
    _, summary = lines_of(out)
    assert (returned, summary["flash_fault"], summary["ok"]) == (code, bool(code), not code)
    (tmp_path / "flash.bin").write_bytes(image)
    _, out, _ = call(job, "--flash", "flash.bin")
    assert ("the flash memory cannot be read" in out) == bool(code)


# ---- the table, as it goes ------------------------------------------------------------------------------------------


def test_the_table_has_a_row_a_command(call: Any) -> None:
    _, out, _ = call(f"@07\n@0R7\n@0P\n{unknown.DNC[0]}\n<253>\n")
    head, *rows = out.splitlines()[:7]
    assert rows.pop(4).strip() == "no such command"
    assert " ".join(head.split()) == "line time / s command reply X / mm Y / mm Z / mm margin"
    assert [row.split()[0] for row in rows] == ["1", "2", "3", "4", "5"]
    answers = [("@07", "0"), ("@0R7", "0"), ("@0P", "0" * 19), (unknown.DNC[0], "5"), ("<253>", "none")]
    assert [tuple(row.split()[2:4]) for row in rows] == answers
    assert {len(row) for row in rows} == {len(head)}
    assert head.index("command") == rows[0].index("@07")
    assert head.index("reply") == rows[2].index("0" * 19)


def test_brackets_and_strange_bytes_are_shown_as_they_are(call: Any) -> None:
    _, out, _ = call("@0[bold]\n@07 [/]\n")
    assert "@0[bold]" in out
    assert "@07 [/]" in out


def test_each_row_is_there_when_its_command_is_over(tmp_path: Path) -> None:
    """The job goes on for ever: its third command is a pause of thirty years, with a look every 10 ms."""
    (tmp_path / "job.txt").write_text("@07\n@0R7\n<1000000000s>\n")
    with start("run", "job.txt", "--plant", "kinematic", "--interval", "20", cwd=tmp_path) as process:
        rows = [process.stdout.readline() for _ in range(3)]
        assert [row.split()[2] for row in rows[1:]] == ["@07", "@0R7"]
        assert process.poll() is None
        process.kill()


def test_two_thousand_rows_cost_little(call: Any) -> None:
    job = "@0b1\n" * 2000
    times = []
    for options in ((), ("--json",)):
        began = time.process_time()
        assert call(job, *options)[0] == 0
        times.append(time.process_time() - began)
    assert times[0] < times[1] + 0.8, "seconds; it was three"


# ---- Ctrl-C ---------------------------------------------------------------------------------------------------------

FOR_EVER = "@07\n@0R7\n@0A3200,5000,0,30,0,30,0,30\n<1000000000s>\n@0P\n@0P\n"


@pytest.fixture
def struck(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """struck(number) sends this process a signal amid the pause of FOR_EVER."""
    run_until = Twin.run_until

    def strike(number: int) -> None:
        asked = count()

        def run(twin: Twin, time_ns: int, stop: Callable[[], bool] | None = None) -> None:
            def amid() -> bool:
                if next(asked) == 3:
                    os.kill(os.getpid(), number)
                return stop is not None and stop()

            run_until(twin, time_ns, amid if time_ns > 1_000_000_000 * SECOND_NS else stop)

        monkeypatch.setattr(Twin, "run_until", run)

    return strike


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ctrl_c_keeps_table_trace_and_report(
    call: Any, struck: Callable[[int], None], tmp_path: Path, number: int, code: int
) -> None:
    files = {"--steps": "o.npz", "--vcd": "o.vcd", "--trace": "o.parquet", "--report": "o.html"}
    struck(number)
    ended, out, err = call(FOR_EVER, "--interval", "20", *(word for option in files.items() for word in option))
    assert ended == code
    assert re.search(r"<1000000000s> +no complete", out)
    assert "failed: 4 commands, interrupted, 2 not sent" in out
    assert err == "isel-twin: job.txt: line 4: interrupted; the job ends there and 2 lines are not sent\n"
    assert {path.name for path in tmp_path.iterdir()} == {"job.txt", *files.values()}
    assert pq.read_table(tmp_path / "o.parquet")["count_x"][-1].as_py() == 3200
    assert "@0A3200" in (tmp_path / "o.html").read_text()


def test_ctrl_c_keeps_the_summary(call: Any, struck: Callable[[int], None]) -> None:
    struck(signal.SIGINT)
    code, out, _ = call(FOR_EVER, "--json", "--vcd", "o.vcd", "--interval", "20")
    results, summary = lines_of(out)
    assert [result["complete"] for result in results] == [True, True, True, False]
    assert (code, summary["interrupted"], summary["unsent"], summary["ok"]) == (130, True, 2, False)


# ---- traces of any size ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("option", ["--vcd", "--trace", "--report"])
@pytest.mark.parametrize(
    ("job", "interval", "least"), [("@07\n<1000000s>", "0.001", "0.0101"), ("@07\n", "1e-09", "5.05e-09")]
)
def test_a_trace_that_is_too_long_is_refused_before(
    call: Any, tmp_path: Path, option: str, job: str, interval: str, least: str
) -> None:
    began = time.process_time()
    code, out, err = call(job, option, "out", "--interval", interval)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"isel-twin: --interval {interval}" in err
    assert f"take {least} or more" in err
    assert time.process_time() - began < 10.0
    assert not (tmp_path / "out").exists()
    assert call("@07\n", "--steps", "out", "--interval", interval)[0] == 0, "the stream has no interval"


def test_a_trace_that_grows_long_is_said_as_it_grows(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("isel_twin.cli.outputs.MANY_SAMPLES", 100)
    code, _, err = call("@07\n<1.1s>\n", "--trace", "out", "--interval", "1e-3")
    assert code == 0
    said = [line for line in err.splitlines() if "samples" in line]
    assert [line.split()[2] for line in said] == ["100", "1,000"]
    assert "--interval" in said[0]


@pytest.mark.parametrize("option", ["--steps", "--vcd", "--trace", "--report"])
def test_a_file_that_cannot_be_written_is_named_as_the_user_did(tmp_path: Path, option: str) -> None:
    """No file grows beyond 2 kB, which is what a full disk does, for whoever runs the tests."""
    with start("run", "-", "--plant", "kinematic", option, "out", stdin=PIPE, cwd=tmp_path) as process:
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (2048, 2048))
        out, err = process.communicate("@07\n@0N7\n@0A16000,5000,0,30,0,30,0,30\n", timeout=PATIENCE_S)
    assert (process.returncode, err) == (2, "isel-twin: out: File too large\n")
    assert "\nfailed: 3 commands, not written: out, " in out  # and what the job did
    assert list(tmp_path.iterdir()) == []


def test_a_picture_of_a_kind_that_does_not_exist_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        main(["motor", "23HS32-4004S", "--picture", "out.xyz"])
    assert caught.value.code == 2
    assert "isel-twin: --picture out.xyz: " in capsys.readouterr().err


def test_one_file_that_cannot_be_written_costs_neither_the_verdict_nor_another_file(call: Any, tmp_path: Path) -> None:
    """The verdict, VCD and page of a job are there although its stream met a full disk."""
    outputs = ("--steps", "/dev/full", "--vcd", "job.vcd", "--report", "job.html")
    code, out, err = call("@07\n@0R7\n", *outputs)
    assert (code, err) == (2, "isel-twin: /dev/full: No space left on device\n")
    assert "failed: 2 commands, not written: /dev/full, " in out
    assert (tmp_path / "job.vcd").stat().st_size > 1000
    assert "</html>" in (tmp_path / "job.html").read_text()


@pytest.mark.parametrize(("job", "told"), [("@07\n", "1 command"), ("@07 => 0\n", "1 command, 1 expectation")])
def test_one_of_a_thing_is_told_as_one(call: Any, job: str, told: str) -> None:
    _, out, _ = call(job)
    assert told in out
    assert "1 commands" not in out
    assert "1 expectations" not in out
