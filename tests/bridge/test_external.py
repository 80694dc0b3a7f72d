"""Another control at a port: in lockstep, with peers that go wrong, and its session as a file."""

from __future__ import annotations

import json
import signal
import socket
from pathlib import Path
from typing import Any

from isel_twin.recordings.reading import read
from tests.bridge.conftest import REPLY_S, until
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
        self.socket.sendall(line.encode() + b"\n")
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
