"""`serve --record FILE.mcap` with a host on the pseudo terminal: what is in the file, and what is left by a bad end."""

from __future__ import annotations

import json
import resource
import signal
import socket
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from isel_twin.bridge.serve.recording import FLUSH_S, Freshness
from isel_twin.recordings.reading import read
from tests.bridge.conftest import STOP_S, ask, until
from tests.forked import run
from tests.in_process import isel_twin


def heard(recorded, channel: str) -> bytes:
    """All bytes of one direction."""
    return b"".join(bytes.fromhex(entry.content["hex"]) for entry in recorded.of(channel))


def test_both_directions_are_in_the_recording_with_their_meaning(serve, tmp_path):
    path = tmp_path / "session.mcap"
    served = serve("--record", str(path), speed="1")
    with served.open() as port:
        assert ask(port, "@07") == "0"
        assert len(ask(port, "@0P", 19)) == 19
    assert served.stop(signal.SIGTERM) == 0
    assert [file.name for file in tmp_path.iterdir()] == ["session.mcap"]
    recorded = read(path)
    assert recorded.whole
    assert recorded.metadata["speed"] == "1"
    assert heard(recorded, "/host/sent") == b"@07\r@0P\r"
    replies = list(recorded.of("/host/received"))
    assert heard(recorded, "/host/received")[:2] == b"00"
    assert replies[1].content["byte_ns"] == pytest.approx(520_833, abs=1)  # 10 bits at 19200 baud
    assert any(entry.content["explanation"].startswith("@0P: ") for entry in recorded.of("/host/sent"))


@pytest.mark.parametrize("speed", ["1", "max"])
def test_a_killed_server_leaves_what_happened_until_a_second_before(serve, tmp_path, speed):
    assert FLUSH_S < 1.0  # what happened is on the disk so long after it
    path = tmp_path / "session.mcap"
    served = serve("--record", str(path), speed=speed)
    with served.open() as port:
        for _ in range(3):
            assert ask(port, "@0P", 19).startswith("0")
        until(lambda: len(heard(read(path), "/host/received")) == 3 * 19)
        served.process.send_signal(signal.SIGKILL)
        served.process.wait(STOP_S)
    recorded = read(path)
    assert not recorded.whole
    assert heard(recorded, "/host/sent") == b"@0P\r" * 3
    assert len(heard(recorded, "/host/received")) == 3 * 19


@pytest.mark.parametrize(("paused", "flushed"), [(True, 1), (False, 0)])
def test_what_happened_before_a_pause_is_on_the_disk_before_anybody_can_look(paused, flushed):
    recording = Mock(unwritten=1, writer=SimpleNamespace(ended=False))
    freshness = Freshness(recording)
    freshness.attach(SimpleNamespace(pacer=SimpleNamespace(paused=paused)))
    freshness.look()
    assert recording.flush.call_count == flushed
    assert (freshness.wait_s() is None) == paused


def moved_ns(recorded) -> int:
    """Virtual time recorded since the reference run was asked for."""
    begin_ns = [e.time_ns for e in recorded.of("/host/sent") if e.content["text"] == "@0R7<13>"]
    return recorded.end_ns - begin_ns[0] if begin_ns else 0


def test_a_machine_in_motion_is_recorded_while_it_moves(serve, tmp_path):
    path = tmp_path / "session.mcap"
    served = serve("--record", str(path), speed="1")
    with served.open() as port:
        assert ask(port, "@07") == "0"
        port.write(b"@0R7\r")  # takes many seconds
        until(lambda: moved_ns(read(path)) > 2_500_000_000)  # while it moves
        served.process.send_signal(signal.SIGKILL)
        served.process.wait(STOP_S)
    recorded = read(path)
    assert moved_ns(recorded) > 2_500_000_000
    assert len(recorded.steps()) > 1000


def test_two_servers_cannot_have_one_recording(serve, tmp_path, capfd):
    path = tmp_path / "session.mcap"
    served = serve("--record", str(path))
    done = run("serve", "--plant", "kinematic", "--record", path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"isel-twin: {path}: is in use by another twin, in process {served.process.pid};")
    assert len(done.stderr.splitlines()) == 1
    assert served.stop(signal.SIGTERM) == 0
    assert read(path).whole


def test_an_older_recording_is_replaced_and_only_when_the_new_one_begins(serve, tmp_path):
    path = tmp_path / "session.mcap"
    path.write_bytes(b"an older one")
    done = isel_twin("serve", "--record", path, "--scenario", "missing.toml")
    assert done.returncode == 2
    assert path.read_bytes() == b"an older one"
    served = serve("--record", str(path))
    assert served.stop(signal.SIGTERM) == 0
    assert read(path).whole


def test_what_is_done_through_the_control_port_is_in_the_recording(serve, tmp_path):
    path = tmp_path / "session.mcap"
    served = serve("--record", str(path), "--control", "127.0.0.1:0", speed="1")
    host, number = served.info["control"].rsplit(":", 1)
    requests = [
        {"set": {"hood": "open"}},
        {"pause": True},
        {"step": 0.25},
        {"set": {"limit_x2": "broken"}},
        {"resume": True},
        {"speed": "max"},
    ]
    with socket.create_connection((host, int(number))) as client, client.makefile("rw") as lines:
        for request in requests:
            lines.write(json.dumps(request) + "\n")
            lines.flush()
            assert json.loads(lines.readline())["ok"]
    assert served.stop(signal.SIGTERM) == 0
    recorded = read(path)
    assert [entry.content for entry in recorded.of("/operator")] == [
        {"set": {"hood": "open"}},
        {"set": {"limit_x2": "broken"}},
        {"line_speed": False},
    ]
    told = [entry.content["what"] for entry in recorded.of("/time")]
    assert told == ['{"pause": true}', '{"step": 0.25}', '{"resume": true}', '{"speed": "max"}', "end"]
    assert [entry.content for entry in recorded.of("/faults")] == [{"faults": {"limit_x2": "broken"}}]


@pytest.mark.parametrize("suffix", [".npz", ".vcd", ".parquet", ".csv"])
def test_other_kinds_are_written_at_the_end_from_the_same_recording(serve, tmp_path, suffix):
    path = tmp_path / f"session{suffix}"
    served = serve("--record", str(path))
    with served.open() as port:
        assert ask(port, "@07") == "0"
    assert served.stop(signal.SIGTERM) == 0
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.stat().st_size > 100


def test_a_recording_is_explained_with_its_times(serve, tmp_path):
    path = tmp_path / "session.mcap"
    served = serve("--record", str(path), "--controller", "c142")
    with served.open() as port:
        assert ask(port, "@07") == "0"
    assert served.stop(signal.SIGTERM) == 0
    done = isel_twin("decode", path)
    assert (done.returncode, done.stderr) == (0, "")
    head, asked, answered = done.stdout.splitlines()
    assert head.split()[:4] == ["no", "time", "/", "s"]
    assert asked.split()[2:4] == ["host", "@07"]
    assert answered.split()[2:4] == ["twin", "0"]
    refused = isel_twin("decode", path, "--sent")
    assert refused.returncode == 2
    assert "a recording says itself who has sent what" in refused.stderr


def test_without_room_the_recording_ends_in_one_line_and_the_machine_goes_on(serve, tmp_path):
    path = tmp_path / "session.mcap"
    served = serve("--record", str(path), speed="20")
    room = path.stat().st_size + 2000
    resource.prlimit(served.process.pid, resource.RLIMIT_FSIZE, (room, room))
    with served.open() as port:
        for _ in range(200):
            assert ask(port, "@0P", 19).startswith("0")
        said = next(line for line in served.process.stderr if "recording" in line)
        assert ask(port, "@0P", 19).startswith("0")
    assert served.stop(signal.SIGTERM) == 1
    assert said.startswith(f"isel-twin: {path}: the recording ends here, the machine goes on: ")
    assert "recording" not in served.process.stderr.read()
    recorded = read(path)
    assert not recorded.whole
    assert recorded.metadata["controller"] == "imc-s8"
