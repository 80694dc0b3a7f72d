"""Every command once, and a job on every controller: what has to work on every interpreter and with every version of a
library that pyproject.toml allows (`make others`, `make lowest`)."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from isel_twin.cli import app
from tests.forked import PATIENCE_S, start
from tests.in_process import isel_twin
from tests.near import COARSE, near_switches
from tests.near import NEAR as START

pytestmark = pytest.mark.long(seconds=8)

JOB = "@07\n@0N7\n@0A1600,800,0,30,0,30,0,30\n"
JOBS = {
    "imc-s8": ("4030", JOB),
    "imc-m": ("4030", JOB),
    "imc-mp": ("4030", JOB),
    "c142": ("4030", "@07\n@0R7\n@0A1600,800,0,30,0,30,0,30\n"),
    "it116": ("4030", "@01\n@0R1\n@0A1600,800\n"),
    "ismif": ("4030", "L1,X3000<1>\n"),
    "gmi99": ("4030-servo", "Q7;1\nf2000\nM5000\n81h 9000\n"),
    "bwo900": ("4030-servo", "N10 G1 F300 G91 X10\nN20 M30\n"),
    "external": ("4030", "out power_request=1 stages=1 brake=1\ngo 2000 1600 800 0\n"),
}
PLAN = '[sweep]\njob = "job.txt"\nplant = "kinematic"\nseeds = 2\n'
HOST = 'import serial\nport = serial.Serial("COM1", timeout=5)\nport.write(b"@07\\r")\nassert port.read(1) == b"0"\n'
KINEMATIC = ("--plant", "kinematic")
NEAR = ("--machine", "near")
IN_ORDER: dict[str, tuple[object, ...]] = {
    "doctor": (),
    "demo": (),
    "init": ("shop",),
    "controllers": (),
    "machines": (),
    "describe": ("4030",),
    "motors": (),
    "motor": ("23HS32-4004S", "--picture", "motor.png"),
    "ports": (),
    "decode": ("@07", "--text"),
    "run": ("job.txt", "--record", "run.mcap", "--steps", "run.npz", "--trace", "run.parquet", "--report", "run.html"),
    "check": ("job.txt", "--margin", "0.1", "--junit", "check.xml"),
    "golden record": ("job.txt", *KINEMATIC),
    "golden compare": ("job.txt",),
    "convert": ("part.nc",),
    "replay": ("run.mcap",),
    "compare": ("run.mcap", "run.mcap"),
    "learn": ("run.mcap",),
    "export": ("run.mcap", "out.vcd"),
    "panel": ("run.mcap", "--html", "run-session.html"),
    "drive": ("run.npz",),
    "fmu": ("model.fmu",),
    "exec": (*KINEMATIC, "--", "python", "host.py"),
    "sweep": ("plan.toml", "--workers", "1"),
    "tune": ("job.txt", "--trials", "2", "--robust", "0", "--confirm", "1", "--margin", "0"),
    "experiment": ("day", "--axes", "x", "--blocks", "1", "--fit", "friction.x", *NEAR, "--carry-out", "near"),
    "identify": ("day.mcap", "--measured", "day.toml", "--fit", "friction.x", *NEAR),
    "plc assemble": ("plc.awl", "--out", "plc.bin"),
    "plc disassemble": ("plc.bin",),
    "plc explain": ("plc.awl",),
    "plc load": ("plc.awl", "--controller", "gmi99"),
}
SERVED = ("serve", "ctl", "tap", "lsp", "mtconnect", "opcua", "linuxcnc")
"""In processes of their own, by the tests below; lsp and what is beside a twin by tests in tests/bridge."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("project")
    files = {
        "job.txt": JOB,
        "part.nc": "G21 G90 F600\nG1 X5\nM2\n",
        "plan.toml": PLAN,
        "host.py": HOST,
        "plc.awl": "OB 1\nU E 0.0\n= A 0.0\nBE\n",
    }
    for name, text in files.items():
        (folder / name).write_text(text)
    (folder / "near").mkdir()
    near_switches(folder / "near", 1.0, more=COARSE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder


@pytest.mark.parametrize("command", IN_ORDER)
def test_a_command(command: str, folder: Path) -> None:
    """In the order of the table: later ones read what earlier ones have written."""
    done = isel_twin(*command.split(), *IN_ORDER[command])
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done


def test_the_picture_of_a_motor_is_one(folder: Path) -> None:
    assert (folder / "motor.png").read_bytes().startswith(b"\x89PNG")


def test_all_commands_are_tried() -> None:
    assert {command.split()[0] for command in IN_ORDER} | set(SERVED) == {name for name in app if name[0] != "-"}


@pytest.mark.parametrize("controller", JOBS)
def test_a_job(controller: str, tmp_path: Path) -> None:
    machine, job = JOBS[controller]
    (tmp_path / "job.txt").write_text(job)
    done = isel_twin("run", tmp_path / "job.txt", "--machine", machine, "--controller", controller, *START)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done


def test_a_served_machine_is_operated_and_tapped(folder: Path) -> None:
    """By its control port, and through a tap."""
    serve = start("serve", *KINEMATIC, "--speed", "max", "--tcp", "127.0.0.1:0", "--control", "127.0.0.1:0")
    info = json.loads(serve.stdout.readline())
    tap = start("tap", f"tcp://{info['tcp']}", "--tcp", "127.0.0.1:0", "--record", "tap.mcap")
    assert json.loads(tap.stdout.readline())["tcp"]
    assert isel_twin("ctl", info["control"], "set", "hood=open").returncode == 0
    assert '"open"' in isel_twin("ctl", info["control"], "state").stdout
    for process in (tap, serve):
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0
