"""A controller from outside with six axes, set points, binary frames and 8E1 needs no change in the package.

It is installed in a folder of its own, as a third party's would be, and reached by everything the package has.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from tests.forked import PATIENCE_S

pytestmark = pytest.mark.long(seconds=7)

HERE = Path(__file__).parent
OPTIONS = ["--controller", "card6", "--plant", "kinematic"]


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment in which the card is installed."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("plugins")
    for name in ("card6.py", "pyproject.toml"):
        shutil.copy(HERE / name, source)
    install = [sys.executable, "-m", "uv", "pip", "install", "--quiet", "--python", sys.executable, "--offline"]
    subprocess.run([*install, "--no-deps", "--no-build-isolation", "--target", str(target), str(source)], check=True)
    return {**os.environ, "PYTHONPATH": str(target)}


TOLD = """
import contextlib, io, json, sys, traceback
for name, code in json.load(sys.stdin).items():
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            exec(code, {})
        except Exception:
            traceback.print_exc(file=out)
    print(json.dumps([name, out.getvalue().splitlines()]))
"""


@pytest.fixture(scope="module")
def told(environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """What programs print, one after the other in one process."""
    folder = tmp_path_factory.mktemp("recorded")
    programs = dict(kinematic=KINEMATIC, physics=PHYSICS, everything=EVERYTHING, margin=MARGIN, serial=SERIAL)
    for plant in ("kinematic", "mujoco"):
        programs[f"recorded {plant}"] = RECORDED.format(path=str(folder / f"{plant}.mcap"), plant=plant)
    command = [sys.executable, "-c", TOLD]
    given = json.dumps(programs)
    call = subprocess.run(command, env=environment, input=given, capture_output=True, text=True, timeout=PATIENCE_S)
    assert call.returncode == 0, call.stderr
    return dict(map(json.loads, call.stdout.splitlines()))


def frame(address: int, content: bytes) -> bytes:
    """As the card's description says, written once more."""
    head = bytes([2, address, len(content)]) + content
    return head + bytes([sum(head) & 255])


KINEMATIC = """
from isel_twin import Twin
import numpy as np
twin = Twin(controller="card6", plant="kinematic", start_mm=(100.0, 50.0, 30.0))
print(twin.serial_format, twin.counts.tolist())
print(twin.query("zero"), twin.query("move 3200 -1600 320 7 0 -9 16000"))
print(twin.counts.tolist(), np.round(twin.position_mm, 9).tolist(), twin.steps.delta.dtype, twin.steps.delta.shape[1])
twin.run(0.004)
print(np.round(twin.position_mm, 9).tolist(), twin.lost_steps.tolist())
t = twin.steps.t_ns
print(set(np.diff(t).tolist()), twin.steps.delta.sum(axis=0).tolist(), twin.steps.delta.max())
twin.write(twin.language.frame("move 0 0 0 0 0 0 16000")); twin.run(0.05)
print(twin.query("stop"), twin.counts[0] < 3200)
print(twin.query("move -90000 0 0 0 0 0 40000"), round(twin.machine_position_mm[0], 4), twin.inputs["limit_x1"])
print(twin.query("lamps"))
"""


def test_it_moves_six_axes_by_set_points_that_are_led(told: dict[str, list[str]]) -> None:
    """3200 increments at 16000/s, ramps of 200000/s^2: T = 3200 / 16000 + 16000 / 200000 = 0.28 s, 70 set points; the
    carriage comes one period after the last of them. At 320 increments/mm it has made 10 mm then."""
    lines = told["kinematic"]
    assert lines[0] == "38400 8E1 [0, 0, 0, 0, 0, 0]"
    done = frame(0x81, b"K").hex(" ")
    assert lines[1] == f"{done} {done}"
    assert lines[2].startswith("[3200, -1600, 320, 7, 0, -9] [")
    assert lines[2].endswith("] int32 6")
    assert lines[2].split("] [")[1].split(",")[0] != "10.0", "the last set point is only being led to"
    assert lines[3] == "[10.0, -5.0, 1.0] [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"
    assert lines[4] == "{4000000} [3200, -1600, 320, 7, 0, -9] 64"
    assert lines[5] == f"{done} {frame(0x81, b'F').hex(' ')} True"
    answer, position, switch = lines[6].rsplit(" ", 2)
    assert (answer, switch) == (frame(0x81, b"L").hex(" "), "struck")
    assert float(position) == pytest.approx(0.0, abs=0.2)
    assert lines[7] == frame(0x82, b"K\x00").hex(" ")


PHYSICS = """
from isel_twin import Twin
import struct
def encoders(twin):
    return struct.unpack(">12i", bytes.fromhex(twin.query("encoders"))[4:-1])
twin = Twin(controller="card6", start_mm=(100.0, 50.0, 30.0))
twin.query("zero"); twin.query("move 3200 1600 -320 5 6 7 16000"); twin.run(0.5)
print(*encoders(twin)[:6])
twin.apply_force(0, 900.0); twin.run(0.5)
print(encoders(twin)[6])
twin.apply_force(0, 4000.0); twin.run(0.5)
print(twin.query("lamps"))
"""


def test_its_drives_report(told: dict[str, list[str]]) -> None:
    """With motors: encoders at the command within the load angle, which a push of 900 N shows; one of 4000 N is more
    than the motor holds, and the following error lights the second lamp."""
    encoders, lag, lamps = told["physics"]
    expected = (3200, 1600, -320, 5, 6, 7)
    assert all(abs(int(a) - b) <= 3 for a, b in zip(encoders.split(), expected, strict=True))
    assert 10 < abs(int(lag)) < 80, "1 to 8 of the 8 steps that are a load angle of 90 degrees"
    assert lamps == frame(0x82, b"K\x02").hex(" ")


EVERYTHING = """
from isel_twin import Twin
from isel_twin.plant import Cut
from isel_twin.wiring import ScenarioEvent
import numpy as np
def life(phases, pieces):
    twin = Twin(controller="card6", start_mm=(100.0, 50.0, 30.0), overrides={"payload.mass": 6.0})
    twin.query("zero")
    twin.set_cut(Cut(diameter_mm=6.0, flutes=2, depth_mm=0.5, width_mm=6.0, spindle_rpm=6000.0, kc_n_mm2=800.0))
    twin.carry_out(ScenarioEvent(twin.time_ns, {"phase_lost": {"x": phases}}))
    twin.watch_margin()
    twin.write(twin.language.frame("move 6400 3200 0 5 0 0 8000"))
    for _ in range(pieces):
        twin.run(2.0 / pieces)
    amid = twin.margin[:2].tolist()
    twin.set_cut(None)
    twin.carry_out(ScenarioEvent(twin.time_ns, {"phase_lost": {"x": ""}}))
    twin.run(1.0)
    return twin, amid
for phases in ("a", "ab"):
    twin, amid = life(phases, 1)
    other, _ = life(phases, 1000)
    print(*twin.lost_steps.tolist(), *amid)
    alike = (twin.position_mm == other.position_mm).all() and (twin.lost_steps == other.lost_steps).all()
    print(twin.counts.tolist(), alike)
"""


def test_a_lost_phase_in_a_cut_with_a_payload_under_set_points(told: dict[str, list[str]]) -> None:
    """X on one phase hardly holds: its margin shows it, and what it has lost is whole slips of 32 in the end.
    Without both it stands still, held by friction against the cut, and has lost all of the move to a slip; a motor
    without current has no margin to lose. Y follows all the same, and so do axes without mechanics; how time is cut
    changes no bit."""
    one, counts, none, counts_too = told["everything"]
    assert counts == counts_too == "[6400, 3200, 0, 5, 0, 0] True"
    (x, y, z, *others, of_x, of_y), (gone, *_, of_none, _) = (list(map(float, line.split())) for line in (one, none))
    assert abs(x - 32 * round(x / 32)) < 4
    assert (abs(y) < 4, abs(z) < 4, others) == (True, True, [0.0, 0.0, 0.0])
    assert of_x < 0.5 * of_y
    assert of_y > 0.3
    assert abs(gone - 6400) <= 36
    assert abs(gone - 32 * round(gone / 32)) < 4
    assert of_none == 1.0


MARGIN = """
from isel_twin import Twin
import math
FREE = {"shaft_coulomb": 0.0, "shaft_viscous": 0.0, "guide_friction": 0.0, "efficiency": 1.0}
twin = Twin(controller="card6", start_mm=(100.0, 50.0, 30.0), overrides={f"axes.all.{k}": v for k, v in FREE.items()})
twin.query("zero")
motor, stage = twin.machine.axes[0].motor, twin.machine.axes[0].stage
peak_nm = motor.torque_constant_nm_per_a * stage.current_a
print(0.06 / peak_nm)
for part in (0.0, 0.3):
    twin.apply_force(0, -part * peak_nm * 2.0 * math.pi / 5e-3)
    twin.run(2.0)
    twin.write(twin.language.frame(f"move {8000 if part else 4000} 0 0 0 0 0 4000"))
    twin.run(0.5)
    twin.watch_margin()
    twin.run(0.25)
    print(twin.margin[0])
    twin.run(1.0)
"""


def test_its_margin_is_that_of_the_command_that_is_led(told: dict[str, list[str]]) -> None:
    """A set point is 16 increments, two full steps, from the next: a motor that had to leap so far would have no margin
    left. Led, it goes at an even 4000/s and keeps all but what a push takes of its torque, and some 6 % of iron loss
    and swing."""
    detent, without, pushed = map(float, told["margin"])
    assert without == pytest.approx(1.0, abs=detent + 0.1)
    assert pushed == pytest.approx(without - 0.3, abs=detent + 0.03)


def test_it_runs_jobs(environment: dict[str, str], tmp_path: Path) -> None:
    job = tmp_path / "job.txt"
    job.write_text("zero\nmove 640 0 0 0 0 640 8000  # 2 mm\n<2><1><1><80><84> # where, byte by byte\n")
    files = {"--steps": "s.npz", "--vcd": "s.vcd", "--trace": "s.parquet"}
    outputs = [word for option, name in files.items() for word in (option, str(tmp_path / name))]
    command = [sys.executable, "-m", "isel_twin", "run", str(job), *OPTIONS, *outputs, "--json"]
    call = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert call.stderr == ""
    *results, summary = map(json.loads, call.stdout.splitlines())
    assert (call.returncode, summary["ok"], summary["refused"]) == (0, True, 0)
    assert summary["counts"] == [640, 0, 0, 0, 0, 640]
    assert results[2]["reply"] == frame(0x81, b"K" + struct.pack(">6i", 640, 0, 0, 0, 0, 640)).hex(" ")
    job.write_text("zero\njump\n")
    call = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert call.returncode == 2
    assert "line 2" in call.stderr
    assert "none of: move" in call.stderr


def test_its_edges_are_those_that_need_no_other_commands(environment: dict[str, str], tmp_path: Path) -> None:
    """Its language changes no speeds. X has 4.2 A times 0.424 Nm/A, and breaks away from 1.3 times 0.9 Nm."""
    job = tmp_path / "job.txt"
    job.write_text("zero\nmove 640 0 0 0 0 0 16000\n")
    words = ["run", str(job), "--controller", "card6", "--edge", "--set", "axes.x.shaft_coulomb=0.9", "--json"]
    command = [sys.executable, "-m", "isel_twin", *words]
    call = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert call.stderr == ""
    summary = json.loads(call.stdout.splitlines()[-1])
    assert (call.returncode, list(summary["edge"])) == (0, ["x"])
    assert list(summary["edge"]["x"]) == ["supply", "inductance", "load"]
    assert 0.85 < summary["edge"]["x"]["load"] * 1.3 * 0.9 / 1.78 < 1.0
    assert summary["edge_lines"]["x"]["load"] == 2


SERIAL = """
import serial, isel_twin
port = serial.serial_for_url("twin://card6?plant=kinematic", timeout=5)
port.write(bytes.fromhex("0201015054")); print(port.read(29).hex())
port.write(bytes.fromhex("0201015055")); print(port.read(5).hex())
"""


def test_it_is_a_serial_port(told: dict[str, list[str]]) -> None:
    whole, damaged = told["serial"]
    assert whole == frame(0x81, b"K" + bytes(24)).hex()
    assert damaged == frame(0x81, b"N").hex()


def test_it_is_served(environment: dict[str, str]) -> None:
    command = [sys.executable, "-m", "isel_twin", "serve", *OPTIONS, "--tcp", "127.0.0.1:0", "--speed", "max"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            host, port = json.loads(server.stdout.readline())["tcp"].split(":")
            address = host, int(port)
            with socket.create_connection(address, PATIENCE_S) as line, line.makefile("rb") as replies:
                line.sendall(frame(2, b"?"))
                assert replies.read(6) == frame(0x82, b"K\x00")
        finally:
            server.terminate()


RECORDED = """
from pathlib import Path
from isel_twin import Twin
from isel_twin.recordings.reading import read
from isel_twin.recordings.recording import FileRecording
from isel_twin.recordings.replay import rebuilt, replay
path = Path({path!r})
twin = Twin(controller="card6", plant={plant!r}, start_mm=(100.0, 50.0, 30.0), line_speed=True)
recording = FileRecording(path, twin, 10_000_000)
twin.query("zero"); twin.query("move 3200 -1600 320 7 0 -9 16000")
twin.write(twin.language.frame("move 0 0 0 0 0 0 16000")); twin.run(0.05)
twin.query("stop"); twin.set_input("estop", "pressed"); twin.run(0.2)
recording.close()
again = read(path)
steps = again.steps()
made = twin.steps
print(len(steps) > 10, made.t_ns.tobytes() == steps.t_ns.tobytes(), made.delta.tobytes() == steps.delta.tobytes())
print(replay(again, rebuilt(again, path.parent)))
"""


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_its_sessions_are_recorded_and_replayed_to_the_bit(told: dict[str, list[str]], plant: str) -> None:
    assert told[f"recorded {plant}"] == ["True True True", "None"]
