"""The command line: what is printed, which exit code."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from isel_twin.cli import main
from tests import forked
from tests.in_process import isel_twin

GOOD = """\
# go to 50, 25 mm
@07
@0R7                                       # reference run
@0M16000,5000,8000,5000,0,5000,0,30
@0P
"""


def run(*arguments: str | Path, stdin: str) -> subprocess.CompletedProcess[str]:
    return isel_twin("run", "-", "--plant", "kinematic", *arguments, stdin=stdin)


def test_a_good_job_in_json(tmp_path):
    steps = tmp_path / "out.npz"
    done = run("--json", "--steps", steps, stdin=GOOD)
    assert done.returncode == 0, done.stderr
    *lines, summary = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(line["command"], line["reply"]) for line in lines] == [
        ("@07", "0"),
        ("@0R7", "0"),
        ("@0M16000,5000,8000,5000,0,5000,0,30", "0"),
        ("@0P", "0003E80001F40000000"),
    ]
    assert [line["number"] for line in lines] == [2, 3, 4, 5]
    assert lines[-1]["counts"] == [16_000, 8_000, 0, 0]
    assert lines[-1]["position_mm"] == pytest.approx([50.0, 25.0, 0.0], abs=1e-6)
    assert summary["ok"] is True
    assert (summary["commands"], summary["refused"]) == (4, 0)
    with np.load(steps) as stream:
        moved = stream["delta"][stream["t_ns"] > lines[1]["end_ns"]]
        assert moved.sum(axis=0).tolist() == [16_000, 8_000, 0, 0]
        assert len(stream["t_ns"]) == summary["steps"]


@pytest.mark.parametrize("afterwards", ["", "@0R7\n"], ids=["lost", "lost and forgotten"])
def test_a_job_that_loses_steps_fails_though_every_reply_is_0(afterwards):
    done = isel_twin("run", "-", "--json", stdin=f"@07\n@0R7\n@0A64000,40000,0,30,0,30,0,30\n{afterwards}")
    *lines, summary = [json.loads(line) for line in done.stdout.splitlines()]
    assert {line["reply"] for line in lines} == {"0"}
    assert summary["refused"] == 0
    assert abs(summary["lost_steps"][0]) + summary["lost_before_reference"][0] > 32
    assert done.returncode == 1


def test_a_good_job_as_a_table(tmp_path):
    job = tmp_path / "job.txt"
    job.write_text(GOOD)
    done = isel_twin("run", job, "--plant", "kinematic")
    assert done.returncode == 0, done.stderr
    assert "0003E80001F40000000" in done.stdout
    assert "all well as far as simulated" in done.stdout


def test_a_refused_command_is_exit_1():
    done = run("--json", stdin="@07\n@0M16000,5000,0,30,0,30,0,30\n@07\n")
    assert done.returncode == 1
    *lines, summary = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["reply"] for line in lines] == ["0", "R", "0"]  # the job goes on
    assert [line["ok"] for line in lines] == [True, False, True]
    assert summary["ok"] is False
    assert summary["refused"] == 1


def test_a_stop_in_mid_move_and_the_rest_of_it():
    job = "@07\n@0R7\n@0A 16000,5000,0,30,0,30,0,30<13> <0.5s> <253>\n@0P\n@0S\n@0P\n"
    lines = [json.loads(line) for line in run("--json", stdin=job).stdout.splitlines()]
    assert lines[2]["reply"] == "F"
    assert 0 < int(lines[3]["reply"][1:7], 16) < 16_000
    assert lines[4]["reply"] == "0"
    assert lines[5]["reply"] == "0003E80000000000000"


def test_all_traces_at_once(tmp_path):
    job = tmp_path / "job.txt"
    job.write_text(GOOD)
    kinds = {"steps": "npz", "vcd": "vcd", "trace": "parquet", "report": "html"}
    files = {option: tmp_path / f"out.{kind}" for option, kind in kinds.items()}
    options = [part for option, file in files.items() for part in (f"--{option}", file)]
    done = isel_twin("run", job, "--plant", "kinematic", "--interval", "0.01", *options)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"job.txt", *(file.name for file in files.values())}
    assert files["steps"].read_bytes()[:2] == b"PK"
    assert "$timescale 1 ns $end" in files["vcd"].read_text()
    assert files["trace"].read_bytes()[:4] == b"PAR1"
    page = files["report"].read_text()
    assert "<svg" in page
    assert "@0M16000,5000,8000,5000,0,5000,0,30" in page
    assert "://" not in page  # nothing is fetched from elsewhere


def test_the_same_job_gives_the_same_bytes(tmp_path):
    first, second = tmp_path / "1.npz", tmp_path / "2.npz"
    assert run("--steps", first, stdin=GOOD).returncode == 0
    assert run("--steps", second, stdin=GOOD).returncode == 0
    assert first.read_bytes() == second.read_bytes()


def test_a_scenario_plays_along(tmp_path):
    scenario = tmp_path / "press.toml"
    scenario.write_text('[[event]]\nat = 60.0\nset = { estop = "pressed" }\n')
    job = "@07\n@0R7\n<70s>\n@0A 100,5000,0,30,0,30,0,30\n"
    assert run("--json", stdin=job).returncode == 0
    done = run("--json", "--scenario", scenario, stdin=job)
    assert done.returncode == 1
    assert json.loads(done.stdout.splitlines()[3])["reply"] == "9"


@pytest.fixture
def taken():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield f"127.0.0.1:{listener.getsockname()[1]}"


@pytest.fixture
def odd(tmp_path):
    """A place with things that are not what is asked for."""
    (tmp_path / "job.txt").write_text("@07\n")
    (tmp_path / "bad.txt").write_text("@07\n<256>\n")
    (tmp_path / "long.txt").write_text(f"@07\n<{'9' * 400}s>\n")
    (tmp_path / "folder").mkdir()
    (tmp_path / "bad.toml").write_text("[[event]]\nat = 'noon'\n")
    (tmp_path / "there").write_text("")
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["run", "{odd}/none.txt"], "none.txt"),
        (["run", "{odd}/folder"], "folder"),
        (["run", "{odd}/bad.txt"], "line 2"),
        (["run", "/proc/self/mem"], "/proc/self/mem"),  # cannot be read, not even by root
        (["run"], "argument"),
        (["run", "{odd}/job.txt", "--machine", "9999"], "9999"),
        (["run", "{odd}/job.txt", "--controller", "imc-s9"], "imc-s9"),
        (["run", "{odd}/job.txt", "--plant", "steam"], "steam"),
        (["run", "{odd}/job.txt", "--seed", "one"], "one"),
        (["run", "{odd}/job.txt", "--scenario", "{odd}/none.toml"], "none.toml"),
        (["run", "{odd}/job.txt", "--scenario", "{odd}/bad.toml"], "bad.toml"),
        (["run", "{odd}/job.txt", "--steps", "{odd}/none/out.npz"], "none"),
        (["run", "{odd}/job.txt", "--trace", "{odd}/folder"], "folder"),
        (["run", "{odd}/job.txt", "--vcd", "{odd}/o.vcd", "--interval", "0"], "--interval"),
        *(
            (["run", "{odd}/job.txt", option, value], f"{option} {value}: must be a time")
            for option in ("--interval", "--timeout")
            for value in ("nan", "inf", "-1", "1e+10")
        ),
        *((["serve", "--interval", value], f"--interval {value}") for value in ("nan", "inf", "0")),
        (["run", "{odd}/long.txt"], "line 2: a pause of more than"),
        (["run", "{odd}/job.txt", "--seed", "-1"], "--seed -1"),
        (["serve", "--seed", "-1"], "--seed -1"),
        *((["serve", "--speed", value], value) for value in ("nan", "inf", "-1", "1e308", "1e-320")),
        *((["serve", "--tcp", f"localhost:{value}"], "0 to 65535") for value in ("65536", "-1", "9" * 5000)),
        (["serve", "--tcp", "{taken}"], "{taken}"),
        (["serve", "--rfc2217", "{taken}"], "{taken}"),
        (["serve", "--tcp", "nowhere"], "nowhere"),
        (["serve", "--machine", "9999"], "9999"),
        (["serve", "--controller", "imc-s9"], "imc-s9"),
        (["serve", "--speed", "fast"], "fast"),
        (["serve", "--speed", "0"], "0"),
        (["serve", "--flash", "{odd}/folder"], "folder"),
        (["serve", "--flash", "{odd}/none/flash"], "none"),
        (["serve", "--scenario", "{odd}/none.toml"], "none.toml"),
        (["serve", "--pty", "{odd}/there"], "there"),
        (["serve", "--record", "{odd}/out.txt"], "out.txt"),
        (["serve", "--panel", "127.0.0.1:odd"], "127.0.0.1:odd"),
        (["serve", "--bogus"], "--bogus"),
        (["describe", "9999"], "9999"),
        (["motor", "nema17-perpetuum"], "nema17-perpetuum"),
        (["frobnicate"], "frobnicate"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_bad_call_is_one_line_and_exit_2(arguments, named, odd, taken, capfd):
    places = {"odd": odd, "taken": taken}
    with pytest.raises(SystemExit) as caught:
        main([argument.format(**places) for argument in arguments])
    out, err = capfd.readouterr()
    assert caught.value.code == 2, err
    assert out == ""
    assert err.count("\n") == 1, err
    assert named.format(**places) in err


@pytest.mark.parametrize("arguments", [["run", "/nonexistent"], ["serve", "--tcp", "{taken}"], ["frobnicate"]])
def test_a_bad_call_as_a_process(arguments, taken):
    done = isel_twin(*(argument.format(taken=taken) for argument in arguments))
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_help_names_every_command():
    done = isel_twin("--help")
    assert done.returncode == 0
    for command in ("serve", "run", "exec", "machines", "describe", "motor", "controllers"):
        assert command in done.stdout


LIGHT = """
import sys
from isel_twin.cli import main
heavy = {"numpy", "mujoco", "pyarrow", "matplotlib", "scipy"}
commands = [[command, "--help"] for command in ("serve", "run", "exec", "describe", "motor")]
for words in [["--help"], ["--version"], ["machines"], ["controllers"], *commands]:
    try:
        main(words)
    except SystemExit as end:
        assert not end.code, words
    assert not heavy & set(sys.modules), words
"""


def test_help_and_lists_import_nothing_heavy():
    done = subprocess.run([sys.executable, "-c", LIGHT], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_kinematic_run_imports_only_what_it_calls(tmp_path):
    """Straight moves without physics: MuJoCo stays away, and all that draws or checks."""
    (tmp_path / "job.txt").write_text("@07\n@0R7\n@0A800,5000,0,30,0,30,0,30\n")
    code = (
        "import sys\nfrom isel_twin.cli import main\n"
        "try: main(['run', 'job.txt', '--plant', 'kinematic'])\nexcept SystemExit as end: assert not end.code\n"
        "idle = {'mujoco', 'rich', 'matplotlib', 'scipy.linalg', 'isel_twin.cli.serve',\n"
        "  'isel_twin.jobs.checks.job', 'isel_twin.firmware.bwo900.programs.syntax'} & set(sys.modules)\n"
        "print(sorted(idle), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "[]\n")


def test_the_version_is_that_of_the_package():
    import importlib.metadata

    import isel_twin as package
    from isel_twin.version import VERSION

    assert isel_twin("--version").stdout == f"{VERSION}\n"
    assert package.__version__ == VERSION == importlib.metadata.version("isel-twin")


def test_what_serve_records_must_be_a_kind_of_trace(tmp_path, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["serve", "--record", str(tmp_path / "out.txt")])
    assert caught.value.code == 2
    line = f"isel-twin: --record {tmp_path}/out.txt: the name must end in .mcap, .npz, .vcd, .parquet or .csv\n"
    assert capsys.readouterr() == ("", line)


def test_machines_and_controllers_are_listed_and_described():
    assert "4030" in isel_twin("machines").stdout.split()
    assert {"imc-s8", "ismif"} <= set(isel_twin("controllers").stdout.split())
    described = isel_twin("describe", "4030").stdout
    assert "lead" in described
    assert "datasheet" in described


def test_output_that_nobody_reads_is_no_error_message(tmp_path):
    job = tmp_path / "job.txt"
    job.write_text("@07\n" * 20_000)
    with forked.start("run", job, "--plant", "kinematic", "--json") as process:
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""


JOB = "@07\n@0IUx\n@0IW\n"


def test_a_file_that_is_no_flash_image_is_refused_and_kept(tmp_path):
    precious = tmp_path / "thesis.txt"
    precious.write_text("years of work")
    done = run("--flash", precious, stdin=JOB)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"isel-twin: {precious}: is no flash image of imc-s8; remove it or name another file\n"
    assert precious.read_text() == "years of work"


@pytest.mark.parametrize("options", [("--trace", "job.csv"), ("--trace", "o.csv", "--record", "o.csv")])
def test_a_file_named_twice_is_refused_and_kept(tmp_path, options):
    job = tmp_path / "job.csv"
    job.write_text(JOB)
    done = isel_twin("run", job, "--plant", "kinematic", *(o if o.startswith("-") else tmp_path / o for o in options))
    assert done.returncode == 2
    assert "is named twice in this call" in done.stderr
    assert done.stderr.count("\n") == 1
    assert job.read_text() == JOB


def test_left_overs_of_killed_processes_are_removed(tmp_path):
    killed = subprocess.Popen([sys.executable, "-c", ""])
    killed.wait()
    left_over = tmp_path / f".flash.bin.{killed.pid}.tmp"
    left_over.write_bytes(b"half")
    done = forked.run("run", "-", "--plant", "kinematic", "--flash", tmp_path / "flash.bin", input=JOB)
    assert done.returncode == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["flash.bin"]


def test_a_full_disk_behind_standard_output_is_one_line(tmp_path):
    with open("/dev/full", "w") as full:
        done = forked.run("run", "-", "--plant", "kinematic", input=JOB, stdout=full)
    assert (done.returncode, done.stderr) == (2, "isel-twin: standard output: No space left on device\n")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("run", "a.txt", "b.txt"), "'b.txt': run takes no such word; isel-twin run --help says what it takes"),
        (("machines", "x", "y"), "'x', 'y': machines takes no such word; isel-twin machines --help says what it takes"),
    ],
)
def test_a_word_too_many_is_named(words, said, capsys):
    with pytest.raises(SystemExit) as caught:
        main([*words])
    assert (caught.value.code, capsys.readouterr().err) == (2, f"isel-twin: {said}\n")


def test_a_controller_without_a_plc_line_is_told_who_has_one(capsys, tmp_path):
    (tmp_path / "x.awl").write_text("BE\n")
    with pytest.raises(SystemExit) as caught:
        main(["plc", "load", str(tmp_path / "x.awl"), "--controller", "imc-s8"])
    said = "isel-twin: controller 'imc-s8' takes no PLC program over its line; gmi99 does\n"
    assert (caught.value.code, capsys.readouterr().err) == (2, said)
