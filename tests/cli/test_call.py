"""A call for a twin: command line and twin:// ask in their words, and get the same twin or the same line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import serial

import isel_twin  # noqa: F401  (registers twin://)
from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import main
from isel_twin.core.flash import flash_file
from isel_twin.core.spec import TwinSpec


class Asked(CallError):
    """Carries a call to the test instead of building it."""


@pytest.fixture
def asked(monkeypatch):
    """asked: what `TwinSpec.build` was called on; nothing is built."""
    calls = []

    def build(call, keep_motions=None):
        calls.append(call)
        raise Asked("enough")

    monkeypatch.setattr(TwinSpec, "build", build)
    return calls


def command_line(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as caught:
        main([*map(str, arguments)])
    assert isinstance(caught.value.code, int)
    return caught.value.code


def url_of(options: dict[str, str]) -> str:
    controller = options.get("controller", "")
    query = "&".join(f"{option}={value}" for option, value in options.items() if option != "controller")
    return f"twin://{controller}?{query}"


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"controller": "ismif", "machine": "traverse", "plant": "kinematic", "seed": "7"},
        {"scenario": "events.toml", "flash": "flash.bin"},
    ],
    ids=["defaults", "names", "files"],
)
def test_both_ask_for_the_same_twin(options, asked, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("job.txt").write_text("<64>07\n")
    words = [word for option, value in options.items() for word in (f"--{option}", value)]
    assert command_line("run", "job.txt", *words) == 2
    assert command_line("serve", "--tcp", "127.0.0.1:0", "--speed", "max", *words) == 2
    with pytest.raises(serial.SerialException):
        serial.serial_for_url(url_of(options))
    assert len(asked) == 3
    assert len({repr(call) for call in asked}) == 1
    expected = {**options, "seed": int(options.get("seed", 0))}
    paths = {name: Path(options[name]) for name in ("scenario", "flash") if name in options}
    assert asked[0] == TwinSpec(**{**expected, **paths})


@pytest.mark.parametrize(("speed", "line_speed"), [("max", False), ("1", True), ("0.5", True)])
def test_bytes_take_their_time_at_finite_speeds(speed, line_speed, asked):
    assert command_line("serve", "--tcp", "127.0.0.1:0", "--speed", speed) == 2
    with pytest.raises(serial.SerialException):
        serial.serial_for_url(f"twin://?speed={speed}")
    assert [call.line_speed for call in asked] == [line_speed, line_speed]


def test_the_same_twin_does_the_same(tmp_path, capsys):
    """Same seed: the same power-on positions, so the same reference run and the same bits afterwards."""
    commands = ["@07", "@0R7", "@0A1600,5000,800,5000,0,30,0,30"]
    job = tmp_path / "job.txt"
    job.write_text("\n".join(commands))
    assert command_line("run", job, "--plant", "kinematic", "--seed", "11", "--json") == 0
    *lines, _ = [json.loads(line) for line in capsys.readouterr().out.splitlines()]

    twin = TwinSpec(plant="kinematic", seed=11).build()
    with serial.serial_for_url("twin://?plant=kinematic&seed=11", timeout=3600) as port:
        for command, line in zip(commands, lines, strict=True):
            assert twin.query(command) == line["reply"]
            port.write(command.encode() + b"\r")
            assert port.read().decode() == line["reply"]
            assert port.twin.time_ns == twin.time_ns == line["end_ns"]
            assert port.twin.position_mm.tolist() == twin.position_mm.tolist() == line["position_mm"]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"seed": "-1"}, "seed -1: must be a whole number from 0"),
        ({"machine": "9999"}, "unknown machine '9999': not a folder"),
        ({"controller": "imc-s9"}, "unknown controller 'imc-s9'; installed: "),
        ({"plant": "steam"}, "unknown plant 'steam'; there are: mujoco, kinematic"),
        ({"scenario": "none.toml"}, "none.toml: there is no such file"),
        ({"scenario": "bad.toml"}, "bad.toml:2: event 1.at: 'noon'; allowed: 0 .. 1e+09 s"),
        ({"scenario": "folder"}, "folder: is a folder, not a file"),
        ({"scenario": "/proc/self/mem"}, "/proc/self/mem: Input/output error"),
        ({"flash": "folder"}, "folder: is a folder, not a file"),
        ({"flash": "none/flash"}, "none/flash: there is no such file"),
        ({"flash": "thesis.txt"}, "thesis.txt: is no flash image of imc-s8; remove it or name another file"),
    ],
    ids=lambda value: " ".join(f"{o}={v}" for o, v in value.items()) if isinstance(value, dict) else "",
)
def test_both_are_refused_with_the_same_line(options, line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("bad.toml").write_text("[[event]]\nat = 'noon'\n")
    Path("thesis.txt").write_text("years of work")
    Path("job.txt").write_text("@07\n")
    options = {"plant": "kinematic", **options}
    words = [word for option, value in options.items() for word in (f"--{option}", value)]
    for command in (["run", "job.txt"], ["serve", "--tcp", "127.0.0.1:0"]):
        assert command_line(*command, *words) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        said = err.removeprefix("isel-twin: ").rstrip("\n").removeprefix("--")
        assert said.startswith(line)
        with pytest.raises(serial.SerialException) as caught:
            serial.serial_for_url(url_of(options))
        assert str(caught.value) == f"{url_of(options)}: {said}"
    assert Path("thesis.txt").read_text() == "years of work"


def test_overrides_reach_the_machine():
    twin = TwinSpec(plant="kinematic", overrides={"axes.all.lead": 4.0}).build()
    assert twin.step_mm.tolist() == [4.0 / 1600] * 3
    with pytest.raises(CallError, match=r"axes\..*leed: unknown key"):
        TwinSpec(plant="kinematic", overrides={"axes.all.leed": 4.0}).build()


def test_a_flash_file_follows_the_twin(tmp_path):
    flash = tmp_path / "flash.bin"
    first = TwinSpec(plant="kinematic", flash=flash).build()
    assert flash.read_bytes() == b""
    first.query("@07")
    first.query("@0IUx")
    first.query("@0IW")
    assert flash.read_bytes() == first.flash
    flash_file(first).release()
    assert TwinSpec(plant="kinematic", flash=flash).build().flash == first.flash


def test_an_error_without_a_name_is_about_what_was_being_done():
    with pytest.raises(CallError, match=r"^the file: Input/output error$"), call_errors("the file"):
        raise OSError(5, "Input/output error")
    with pytest.raises(CallError, match=r"^No space$"), call_errors():
        raise OSError(28, "No space")
    with pytest.raises(CallError, match=r"^two lines$"), call_errors():
        raise ValueError("two\n  lines")
    original = CallError("seed -1", option=True)
    with pytest.raises(CallError) as caught, call_errors("other"):
        raise original
    assert caught.value is original
