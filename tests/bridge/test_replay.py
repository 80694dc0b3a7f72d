"""A session of a real server, with people at its control port, replays to the bit whatever its speed was."""

from __future__ import annotations

import json
import signal
import socket
import time
from collections.abc import Callable
from typing import Any

import pytest

from isel_twin.controller import controller_names, offers
from isel_twin.language import MoveSettings, TakesSetPoints, create_language, needed
from isel_twin.recordings.mcap import RecordingWriter
from isel_twin.recordings.reading import read
from tests.bridge.conftest import REPLY_S, STOP_S, until
from tests.in_process import isel_twin as cli
from tests.near import near_switches

pytestmark = pytest.mark.long(seconds=6)

SCENARIO = """
[[event]]
at = 1.5
friction_n = { y = 5 }
"""


class Control:
    """A client of the control port."""

    def __init__(self, address: str) -> None:
        host, number = address.rsplit(":", 1)
        self._lines = socket.create_connection((host, int(number)), REPLY_S).makefile("rw")

    def ask(self, **request: Any) -> Any:
        if "wait" in request:
            request["wait"]["wall_s"] = REPLY_S
        self._lines.write(json.dumps(request) + "\n")
        self._lines.flush()
        answer = json.loads(self._lines.readline())
        assert "ok" in answer, answer
        return answer["ok"]


def say(port, *data: bytes) -> None:
    """And hear what is answered, if it is soon."""
    for one in data:
        port.write(one)
        port.read(1)
        port.read(port.in_waiting)


def session(served, controller: str) -> None:
    """What a host and a person do at the same time."""
    language = needed(create_language(controller), controller)
    control = Control(served.info["control"])
    with served.open() as port:
        port.timeout = 0.3
        say(port, *language.reference())
        control.ask(wait={"idle": True})
        control.ask(force_n={"x": 15.0})
        begin_mm = control.ask(state=True)["position_mm"][0]
        *before, move = language.move((4000, 2000, 100), MoveSettings(speed_hz=2000))
        say(port, *before)
        port.write(move)
        control.ask(wait={"position": "x", "above": begin_mm + 0.5, "pause": True})
        control.ask(step=0.03)
        control.ask(set={"limit_x2": "stuck_closed"}, noise=0.01)
        control.ask(resume=True)
        port.write(language.break_off())
        control.ask(wait={"idle": True})
        control.ask(pause=True)
        control.ask(set={"estop": "pressed"})
        control.ask(step=0.1)
        control.ask(resume=True)
        control.ask(speed=5)
        control.ask(set={"estop": "released"}, noise=0)
        say(port, b"\xfe")
    with served.open() as port:  # another client
        port.timeout = 0.3
        say(port, *language.reference()[:1])


def serve_session(serve: Callable[..., Any], tmp_path, controller: str, speed: str) -> Any:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(SCENARIO)
    path = tmp_path / "session.mcap"
    language = create_language(controller)
    silent = language.unwatched if offers(language, TakesSetPoints) else {}  # 1 s of it is 50 ms here
    machine = near_switches(tmp_path, 1.0, "4030-servo" if controller in ("gmi99", "bwo900") else "4030")
    served = serve(
        *("--controller", controller, "--machine", str(machine), "--scenario", str(scenario), "--seed", "4"),
        *("--record", str(path), "--control", "127.0.0.1:0"),
        *(word for key, value in silent.items() for word in ("--set", f"{key}={value}")),
        speed=speed,
        plant="mujoco",
    )
    session(served, controller)
    return served, path


@pytest.mark.parametrize("speed", ["1", "20", "max"])
def test_a_session_at_any_speed(serve, tmp_path, speed):
    served, path = serve_session(serve, tmp_path, "imc-s8", speed)
    assert served.stop(signal.SIGTERM) == 0
    recorded = read(path)
    assert recorded.whole
    assert len(list(recorded.of("/operator"))) >= 4
    done = cli("replay", path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("no difference in replies, times, stream and positions, ")


@pytest.mark.parametrize("controller", [name for name in controller_names() if name != "imc-s8"])
def test_a_session_of_each_controller(serve, tmp_path, controller):
    served, path = serve_session(serve, tmp_path, controller, "20")
    assert served.stop(signal.SIGTERM) == 0
    done = cli("replay", path, "--json")
    assert done.returncode == 0, done.stdout
    assert json.loads(done.stdout) == {"same": True, "difference": None, "time_ns": read(path).end_ns, "told": []}


def test_what_a_killed_server_leaves_replays_as_far_as_it_goes(serve, tmp_path):
    served, path = serve_session(serve, tmp_path, "imc-s8", "20")
    until(lambda: list(read(path).of("/host/sent")))
    served.process.send_signal(signal.SIGKILL)
    served.process.wait(STOP_S)
    done = cli("replay", path)
    assert done.returncode == 0, done.stdout
    assert (
        done.stderr == f"isel-twin: {path}: the recording has no end, it was cut off; it is played as far as it goes\n"
    )


def test_replay_at_a_speed_takes_its_time_and_can_be_recorded_again(tmp_path):
    job = tmp_path / "job.txt"
    job.write_text("@07\n<0.5s>\n@0P\n")
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    assert cli("run", job, "--plant", "kinematic", "--record", first).returncode == 0
    began = time.monotonic()
    done = cli("replay", first, "--speed", "1", "--record", second)
    assert done.returncode == 0, done.stdout
    assert time.monotonic() - began > 0.5
    assert [e for e in read(second).entries if e.channel != "/time"] == [
        e for e in read(first).entries if e.channel != "/time"
    ]


def test_another_machine_is_a_difference_and_exit_code_1(tmp_path):
    """The recording has its machine with it: what has become of the machine's name elsewhere is no matter."""
    job = tmp_path / "job.txt"
    job.write_text("@07\n@0P\n")
    path, other = tmp_path / "session.mcap", tmp_path / "other.mcap"
    assert cli("run", job, "--plant", "kinematic", "--record", path).returncode == 0
    recorded = read(path)
    with RecordingWriter(other, {**recorded.metadata, "seed": "9"}, recorded.attachments) as writer:
        for entry in recorded.entries:
            writer.message(*entry)
    done = cli("replay", other)
    assert done.returncode == 1
    assert done.stdout.startswith("first difference: 0.000000000 s, /samples: recorded nothing, now ")


@pytest.mark.parametrize("command", ["replay", "export"])
@pytest.mark.parametrize("content", [b"", b"@07\r0", b"\x89MCAP0\r\n"])
def test_files_that_are_no_recordings_are_refused_in_one_line(tmp_path, command, content):
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    done = cli(command, path, *([tmp_path / "out.npz"] if command == "export" else []))
    assert done.returncode == 2
    assert done.stderr.startswith(f"isel-twin: {path}: is no recording of isel-twin; allowed: a file that ")
    assert len(done.stderr.splitlines()) == 1
    assert [file.name for file in tmp_path.iterdir()] == ["other.mcap"]


def test_a_recording_is_not_written_onto_itself(tmp_path):
    path = tmp_path / "session.mcap"
    path.write_bytes(b"precious")
    done = cli("replay", path, "--record", path)
    assert done.returncode == 2
    assert "is named twice in this call" in done.stderr
    assert path.read_bytes() == b"precious"


def test_a_real_controllers_host_is_played_to_a_twin_and_both_are_compared(serve, tmp_path):
    """A served twin stands for the real controller: of its recording the bytes are kept, and nothing else."""
    served = serve("--record", str(tmp_path / "all.mcap"), speed="20")
    with served.open() as port:
        for command, size in (("@07", 1), ("@0R7", 1), ("@0A800,2000,400,2000,0,30,0,30", 1), ("@0P", 19)):
            port.write(command.encode() + b"\r")
            assert port.read(size)[:1] == b"0"
    assert served.stop(signal.SIGTERM) == 0
    real, twin = tmp_path / "real.mcap", tmp_path / "twin.mcap"
    with RecordingWriter(real, {"kind": "tap", "controller": "imc-s8"}) as writer:
        for entry in read(tmp_path / "all.mcap").of("/host/sent", "/host/received"):
            data = bytes.fromhex(entry.content["hex"])
            (writer.sent if entry.channel == "/host/sent" else writer.received)(entry.time_ns, data)
    done = cli("replay", real, "--plant", "kinematic", "--record", twin)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("no difference in replies, ")
    done = cli("compare", real, twin, "--time-tolerance", "0.02", "--json")
    assert done.returncode == 0, done.stdout
    summary = json.loads(done.stdout.splitlines()[-1])
    assert (summary["commands"], summary["different"], summary["same"]) == (4, 0, True)
    # the place at power-on is found, whatever the seed; a place that is said is kept, and told
    assert cli("replay", real, "--plant", "kinematic", "--seed", "5", "--time-tolerance", "0.02").returncode == 0
    placed = cli("replay", real, "--plant", "kinematic", "--start", "9,9,9", "--time-tolerance", "0.02")
    assert placed.returncode == 1
    assert "@0R7: start, first reference run " in placed.stdout
