"""One scenario file, whoever reads it: served, run as a job, in Python, behind `twin://`, in an episode; and ctl."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import serial

from isel_twin import Twin
from isel_twin.base.errors import CallError
from isel_twin.cli import main
from isel_twin.cli.ctl import _request
from isel_twin.envs import Settings, Setup, run_job
from tests.in_process import isel_twin

LOOPBACK = "127.0.0.1:0"
MOVE = "@0A8000,5000,0,30,0,30,0,30"
EVENTS = """
[[event]]
name = "far"
when = "x > 11 mm"
times = 2
noise = 0
[[event]]
when = "10 ms after far"
delay = 0.04
set = { limit_x2 = "broken" }
"""
"""At power-on X stands somewhere beyond; on the way out it passes 11 mm, and the limit switch opens: reply 2."""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "scenario.toml"
    path.write_text(EVENTS, encoding="utf-8")
    return path


def replies(port: Any) -> list[str]:
    said = []
    for command in ("@07", "@0R7", MOVE):
        port.write(command.encode() + b"\r")
        said.append(port.read(1).decode())
    return said


def test_in_python(file: Path) -> None:
    twin = Twin(plant="kinematic", scenario=file)
    assert [twin.query(command) for command in ("@07", "@0R7", MOVE)] == ["0", "0", "2"]


@pytest.mark.parametrize("speed", ["max", "20"])
def test_served(serve: Callable[..., Any], file: Path, speed: str) -> None:
    served = serve("--tcp", LOOPBACK, "--scenario", str(file), speed=speed)
    with served.open("tcp") as port:
        assert replies(port) == ["0", "0", "2"]


def test_behind_a_url(file: Path) -> None:
    with serial.serial_for_url(f"twin://imc-s8?plant=kinematic&speed=max&scenario={file}", timeout=60) as port:
        assert replies(port) == ["0", "0", "2"]


def test_run_as_a_job(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tmp_path / "job.txt"
    job.write_text(f"@07\n@0R7\n{MOVE}\n", encoding="utf-8")
    with pytest.raises(SystemExit) as caught:
        main(["run", str(job), "--plant", "kinematic", "--scenario", str(file), "--json"])
    assert caught.value.code == 1
    assert [json.loads(line).get("reply") for line in capsys.readouterr().out.splitlines()][:3] == ["0", "0", "2"]


def test_in_an_episode(file: Path) -> None:
    row = run_job(Setup(job=[(25.0, 0.0, 0.0)], plant="kinematic", scenario=file), Settings(10_000, 100, 300))
    assert row.reply == "2"


def test_a_wrong_file_is_the_same_line_for_everybody(file: Path, tmp_path: Path) -> None:
    file.write_text('[[event]]\nwhen = "x > 11 cm"\nnoise = 0\n', encoding="utf-8")
    said = f"{file}:2: event 1.when: 'x > 11 cm': unit 'cm'; allowed: 'mm'"
    with pytest.raises(ValueError, match="unit 'cm'") as error:
        Twin(plant="kinematic", scenario=file)
    assert str(error.value) == said
    job = tmp_path / "job.txt"
    job.write_text("@07\n", encoding="utf-8")
    for command in (["run", str(job)], ["serve", "--tcp", LOOPBACK]):
        done = isel_twin(*command, "--plant", "kinematic", "--scenario", file)
        assert done.returncode == 2
        assert said in done.stderr
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "request_"),
    [
        ("friction_n x=40 y=2.5", {"friction_n": {"x": 40, "y": 2.5}}),
        ("friction_n x=40 for=0.5", {"friction_n": {"x": 40}, "for": 0.5}),
        ("obstacle_mm y=off", {"obstacle_mm": {"y": "off"}}),
        ("payload_kg table=8", {"payload_kg": {"table": 8}}),
        ("swapped limit_x1=limit_x2", {"swapped": {"limit_x1": "limit_x2"}}),
        ("undervoltage 0.4", {"undervoltage": 0.4}),
        ("line_cut", {"line_cut": True}),
        ("line_cut false", {"line_cut": False}),
        ("brownout for=0.2", {"brownout": True, "for": 0.2}),
        ("reset", {"reset": True}),
        ("dropped 0.1 for=3", {"dropped": 0.1, "for": 3}),
        ("fault limit_x1=bounce", {"set": {"limit_x1": "bounce"}}),
        ("phase_lost x=a", {"phase_lost": {"x": "a"}}),
        ("phase x=", {"phase_lost": {"x": ""}}),
        ("set user_1=high for=1", {"set": {"user_1": "high"}, "for": 1}),
    ],
)
def test_what_ctl_asks_for(words: str, request_: dict[str, Any]) -> None:
    command, *what = words.split()
    assert _request(command, what, None) == request_  # type: ignore[arg-type]


@pytest.mark.parametrize("words", ["friction_n", "friction_n 40", "undervoltage", "dropped 0.1 0.2", "reset now then"])
def test_what_ctl_cannot_ask_for(words: str) -> None:
    command, *what = words.split()
    with pytest.raises(CallError, match=command):
        _request(command, what, None)  # type: ignore[arg-type]
