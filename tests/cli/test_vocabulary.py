"""One vocabulary: the same thing has the same option in every command, and means the same."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cyclopts import App

from isel_twin.cli import GROUPS, app, main

BUILD_TWINS = "serve exec run check golden-record golden-compare drive replay tune experiment identify learn".split()  # noqa: SIM905
TELL = """
    ports exec run check golden-compare drive replay compare tune sweep identify experiment learn machines controllers
    describe motor decode export plc-assemble plc-explain doctor
""".split()  # noqa: SIM905
RETIRED = {"--jobs", "--processes", "--repetitions", "--timeout-s", "--update", "--output", "--overrides"}


def commands(of: App = app, above: str = "") -> Iterator[tuple[str, Any]]:
    """Name and parameters of every command, those of groups of commands as golden-record."""
    for name in of:
        inner = of[name]
        if name.startswith("-"):
            continue
        if inner.default_command is None:
            yield from commands(inner, f"{name}-")
        else:
            yield f"{above}{name}", inner.assemble_argument_collection()


COMMANDS = dict(commands())


def options(command: str) -> dict[str, Any]:
    """The options of a command, by name."""
    return {name: argument for argument in COMMANDS[command] for name in argument.names if name.startswith("--")}


def test_every_command_is_in_a_group() -> None:
    grouped = [command for group in GROUPS.values() for command in group]
    assert len(grouped) == len({name.partition("-")[0] for name in COMMANDS})


def test_the_help_tells_what_every_command_is_for() -> None:
    """In a process of its own, where no command has been imported yet."""
    call = [sys.executable, "-c", "from isel_twin.cli import main; main()", "--help"]
    lines = subprocess.run(call, capture_output=True, text=True, check=True).stdout.splitlines()
    told = {row[0]: row[1:] for line in lines if (row := line.strip("│ ").split())}
    assert all(told[name.partition("-")[0]] for name in COMMANDS)


@pytest.mark.parametrize("command", BUILD_TWINS)
def test_what_builds_a_twin_takes_parameters_of_the_machine(command: str) -> None:
    assert "--set" in options(command)


@pytest.mark.parametrize("command", TELL)
def test_what_tells_something_tells_it_to_programs(command: str) -> None:
    assert "--json" in options(command)


@pytest.mark.parametrize("command", COMMANDS)
def test_no_option_has_another_name_elsewhere(command: str) -> None:
    assert not RETIRED & set(options(command))


@pytest.mark.parametrize(
    ("command", "option"),
    [(command, name) for command in COMMANDS for name, argument in options(command).items() if argument.hint is int],
)
def test_whole_numbers_are_not_rounded(command: str, option: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*command.split("-", 1 if command.startswith(("golden", "plc")) else 0), "x", f"{option}=1.5"])
    told = capsys.readouterr().err
    assert ended.value.code == 2
    assert option in told
    assert "1.5 is no whole number" in told


def test_describe_without_a_name_says_which_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["describe"], ["machines"]):
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 0
    first, second = capsys.readouterr().out.split("4030\n")[1:]
    assert first == second


def test_describe_tells_programs_what_was_set(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["describe", "4030", "--set", "payload.mass=7.5", "--json"])
    rows = {row["parameter"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows["payload.mass"]["value"] == 7.5
    assert rows["payload.mass"]["unit"] == "kg"


@pytest.mark.parametrize(
    ("option", "name", "code"),
    [("trace", "a.csv", 0), ("trace", "a.vcd", 2), ("vcd", "a.csv", 2), ("steps", "a.txt", 2)],
)
def test_a_file_is_what_its_name_says_or_refused(
    option: str, name: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job, out = tmp_path / "job.txt", tmp_path / name
    job.write_text("@07\n")
    with pytest.raises(SystemExit) as ended:
        main(["run", str(job), "--plant", "kinematic", f"--{option}", str(out)])
    assert ended.value.code == code
    assert out.exists() == (code == 0)
    if code == 0:
        assert out.read_text().startswith("time_ns,")
    else:
        assert f"--{option} {out}: the name must end in" in capsys.readouterr().err


def test_golden_runs_keep_what_was_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tmp_path / "job.txt"
    job.write_text("@07\n@0R1\n")

    def golden(*words: str) -> int:
        with pytest.raises(SystemExit) as ended:
            main(["golden", words[0], str(job), *words[1:]])
        return int(str(ended.value.code))

    assert golden("record", "--plant", "kinematic", "--set", "axes.x.lead=10") == 0
    assert golden("compare") == 0
    assert golden("compare", "--set", "axes.x.lead=4") == 1
    assert "set: {'axes.x.lead': 10} -> {'axes.x.lead': 4}" in capsys.readouterr().out


def test_bounds_of_a_project_may_set_parameters(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "job.txt").write_text("@07\n@0R1\n")
    settings = tmp_path / "isel-twin.toml"
    for lead in (10, 9999999):
        settings.write_text(f"[check]\nplant = 'kinematic'\nset.axes.x.lead = {lead}\n")
        with pytest.raises(SystemExit) as ended:
            main(["check", str(tmp_path / "job.txt")])
        assert ended.value.code == (0 if lead == 10 else 2)
    assert "axes.x.lead" in capsys.readouterr().err


@pytest.mark.parametrize("set_to", [None, "true"])
def test_describe_says_which_reading_holds(set_to: str | None, capsys: pytest.CaptureFixture[str]) -> None:
    options = [] if set_to is None else ["--set", f"controller.path_speed={set_to}"]
    with pytest.raises(SystemExit):
        main(["describe", "4030", *options, "--json"])
    (row,) = [r for r in json.loads(capsys.readouterr().out) if r["parameter"] == "controller.path_speed"]
    assert row["value"] is (set_to is not None)
    assert ("1.41" if set_to else "step frequency of its leading axis") in row["source"]


def test_describe_says_it_of_the_controller_that_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    found = {}
    for controller in ("imc-s8", "c142"):
        with pytest.raises(SystemExit):
            main(["describe", "4030", "--controller", controller, "--json"])
        rows = {row["parameter"]: row["value"] for row in json.loads(capsys.readouterr().out)}
        found[controller] = rows["controller.reference_ends_limit"]
    assert found == {"imc-s8": False, "c142": True}
