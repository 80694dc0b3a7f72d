"""Another control at a port: in lockstep, with peers that go wrong, and its session as a file."""

from __future__ import annotations

import json
import resource
import signal
import socket
import struct
import threading
from pathlib import Path
from typing import Any

from isel_twin.bridge.operate.client import Client
from isel_twin.core.twin import Twin
from isel_twin.recordings.reading import read
from tests.bridge.conftest import REPLY_S, Served, until
from tests.in_process import isel_twin

ON = "out power_request=1 stages=1 brake=1"
CALL = ("--controller", "external", "--tcp", "127.0.0.1:0", "--control", "127.0.0.1:0", "--seed", "3")


class Peer:
    """Another control: it sends a line and waits for the answer."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self.socket = socket.create_connection((host, int(port)), timeout=REPLY_S)
        self._file = self.socket.makefile("rb")

    def ask(self, line: str) -> str:
        self.socket.sendall(line.encode("latin-1") + b"\n")
        return self.read()

    def read(self) -> str:
        return self._file.readline().decode().rstrip("\n")

    def close(self) -> None:
        self._file.close()
        self.socket.close()


def state(served: Any) -> dict[str, Any]:
    done = isel_twin("ctl", served.info["control"], "state")
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def test_time_goes_with_the_rows_and_a_second_peer_is_turned_away(serve: Any) -> None:
    served = serve(*CALL)
    peer = Peer(served.info["tcp"])
    assert peer.ask(ON) == peer.ask("state")
    assert [peer.ask(f"row 1000000 {n} 0 0").split()[1] for n in (1, 2, 3)] == ["1001000", "2001000", "3001000"]
    second = Peer(served.info["tcp"])
    assert "is in use by another client" in second.ask("row 1000000 900 0 0")
    second.close()
    assert peer.ask("row 1 0 0 0").startswith("error '1'; allowed")
    assert state(served)["counts"] == [3, 0, 0]
    assert peer.ask("row 1000000 4 0 0").split()[1] == "4001000", "no time has passed meanwhile"
    peer.close()


def test_a_peer_that_vanishes_leaves_the_machine_where_it_is_for_the_next(serve: Any) -> None:
    served = serve(*CALL)
    peer = Peer(served.info["tcp"])
    peer.ask(ON)
    peer.socket.sendall(b"row 1000000 7 0 0\nrow 1000000 9")  # in the middle of a line
    until(lambda: state(served)["counts"] == [7, 0, 0])
    peer.close()
    again = Peer(served.info["tcp"])
    assert again.ask("state").startswith("error "), "the line that was begun"
    assert again.ask("state").startswith("ok 1001000 ")
    assert again.ask("row 1000000 8 0 0").startswith("ok 2001000 ")
    again.close()


def test_nonsense_and_an_emergency_stop_in_the_middle_of_a_row(serve: Any, tmp_path: Path) -> None:
    """Each line has its answer, whatever stands in it; the row that is being made is made to its end, without power."""
    served = serve(*CALL, "--record", str(tmp_path / "live.mcap"), plant="mujoco", speed="1")
    peer = Peer(served.info["tcp"])
    names = peer.ask("names").split()[2:]
    power = 1 << names.index("power_ok")
    assert int(peer.ask(ON).split()[2], 16) & power
    assert peer.ask("\x00\xff row 1 2 3").startswith("error '??': unknown")
    assert peer.ask("row 1000000 " + "9" * 3000) == "error a line of more than 1024 bytes"
    assert peer.ask("row 1000000 nan 0 0").startswith("error 'nan'; allowed")
    assert peer.ask("row 1000000 8 0").startswith("error 2 counters; allowed")
    peer.socket.sendall(b"row 1500000000 2400 0 0\nstate\n")
    until(lambda: state(served)["counts"][0] > 100)
    assert isel_twin("ctl", served.info["control"], "set", "estop=pressed").returncode == 0
    at_end = peer.read()
    assert at_end.startswith("ok ")
    assert not int(at_end.split()[2], 16) & power
    assert peer.read() == at_end, "nothing happens between a row and what was sent behind it"
    told = state(served)
    assert told["counts"][0] == 2400
    assert told["lost_steps"][0] > 100.0
    isel_twin("ctl", served.info["control"], "set", "estop=released")
    assert not int(peer.ask("out power_request=0").split()[2], 16) & power
    assert int(peer.ask("out power_request=1 stages=1").split()[2], 16) & power, "a rising edge closes the relay"
    peer.close()
    assert served.stop(signal.SIGTERM) == 0
    assert isel_twin("replay", tmp_path / "live.mcap").returncode == 0


def test_a_peer_killed_in_the_middle_of_a_row_and_its_session_as_a_file(serve: Any, tmp_path: Path) -> None:
    """What it has asked for is made; who comes next counts on. The recording of all that is played to the bit. The row
    takes seconds of a clock, so that its middle is not missed."""
    served = serve(*CALL, "--record", str(tmp_path / "live.mcap"), speed="1")
    peer = Peer(served.info["tcp"])
    peer.ask(ON)
    peer.socket.sendall(b"row 4000000000 6400 0 0\n")
    until(lambda: 0 < state(served)["counts"][0] < 6400)
    peer.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # as a killed process
    peer.close()
    until(lambda: state(served)["counts"] == [6400, 0, 0])
    again = Peer(served.info["tcp"])
    until(lambda: again.ask("row 1000000 6408 0 0").startswith("ok "))
    again.close()
    assert served.stop(signal.SIGTERM) == 0
    assert isel_twin("replay", tmp_path / "live.mcap").returncode == 0


def test_a_disk_that_gets_full_costs_the_recording_alone(serve: Any, tmp_path: Path) -> None:
    """The disk has room for so many bytes more of this process."""
    path = tmp_path / "live.mcap"
    served = serve(*CALL, "--record", str(path))
    peer = Peer(served.info["tcp"])
    peer.ask(ON)
    room = path.stat().st_size + 100
    resource.prlimit(served.process.pid, resource.RLIMIT_FSIZE, (room, room))
    assert [peer.ask(f"row 1000000 {n} 0 0")[:3] for n in range(1, 200)] == ["ok "] * 199
    peer.close()
    assert served.stop(signal.SIGTERM) == 1
    assert "the recording ends here, the machine goes on: File too large" in served.process.stderr.read()


def test_who_stands_beside_changes_no_bit(serve: Any, tmp_path: Path) -> None:
    """Rows to a twin that an MTConnect adapter and a client of the control port look at all the time, and to one
    alone: the same answers, the same place."""
    served = serve(*CALL, plant="mujoco")
    call = (served.info["control"], "--tcp", "127.0.0.1:0", "--interval", "0.01")
    beside = Served(call, "mtconnect")
    alone = Twin(controller="external", seed=3)
    stop = threading.Event()

    def look() -> None:
        with Client(served.info["control"]) as client:
            while not stop.is_set():
                client.ask({"state": True})

    looking = threading.Thread(target=look)
    looking.start()
    peer = Peer(served.info["tcp"])
    lines = [ON, *(f"row 1000000 {8 * n} {-5 * n} {n}" for n in range(1, 150)), "go 4000 0 0 0"]
    assert [peer.ask(line) for line in lines] == [alone.query(line) for line in lines]
    stop.set()
    looking.join()
    assert state(served)["machine_position_mm"] == alone.machine_position_mm.tolist()
    peer.close()
    beside.stop(signal.SIGTERM)


def test_hood_by_the_control_port_and_the_session_as_a_file(serve: Any, tmp_path: Path) -> None:
    """Every bug seen with another control becomes a file without it: for `replay` and for `drive`."""
    served = serve(*CALL, "--record", str(tmp_path / "live.mcap"), plant="mujoco")
    peer = Peer(served.info["tcp"])
    names = peer.ask("names").split()[2:]
    peer.ask(ON)
    answers = []
    for row in range(1, 120):
        answers.append(
            int(peer.ask(f"row 1000000 {8 * row} {-3 * row} 0").split()[2], 16) >> names.index("power_ok") & 1
        )
        if row == 60:
            assert isel_twin("ctl", served.info["control"], "set", "hood=open").returncode == 0
    assert answers == [1] * 60 + [0] * 59
    told = state(served)
    assert abs(told["lost_steps"][0]) > 200
    peer.close()
    assert served.stop(signal.SIGTERM) == 0
    assert isel_twin("replay", tmp_path / "live.mcap").returncode == 0
    assert len(read(tmp_path / "live.mcap").steps()) > 119 * 8
    assert isel_twin("export", tmp_path / "live.mcap", tmp_path / "live.vcd").returncode == 0
    done = isel_twin("drive", tmp_path / "live.vcd", "--seed", "3", "--plant", "kinematic", "--json")
    assert json.loads(done.stdout.splitlines()[-1])["capture"]["ticks"] > 119 * 8, done
