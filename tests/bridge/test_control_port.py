"""The control port over real sockets, and `isel-twin ctl` beside a host that moves the machine."""

from __future__ import annotations

import contextlib
import io
import json
import logging
import re
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.bridge.operate.client import Client, ClientError
from isel_twin.bridge.operate.control_port import CLIENTS, LINE_BYTES, TOKEN_S, UNREAD_BYTES, ControlPort
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Server
from isel_twin.bridge.serve.tcp import TcpEndpoint, parse_address
from isel_twin.bridge.serve.wire_log import WireLog
from isel_twin.cli import main
from tests.bridge.conftest import REPLY_S, STOP_S, ask, until
from tests.in_process import isel_twin

LOOPBACK = "127.0.0.1:0"
PAGE = Path(__file__).parents[2] / "docs" / "bench.md"


class Bench:
    """A served twin with a control port, in a thread."""

    def __init__(
        self, speed: float | None = None, address: str = LOOPBACK, token: str | None = None, token_s: float = TOKEN_S
    ) -> None:
        self.port = ControlPort(address, token, token_s)
        self.line = TcpEndpoint(LOOPBACK)
        self.twin = Twin(plant="kinematic", line_speed=speed is not None)
        wire = WireLog(self.twin.language)
        self.server = Server(self.twin, Pacer(speed), [self.line], wire, guests=[self.port])
        self.thread = threading.Thread(target=self.server.run, daemon=True)
        self.thread.start()

    def connect(self) -> Connection:
        where = ("127.0.0.1", parse_address(self.port.address)[1])
        return Connection(socket.create_connection(where, timeout=REPLY_S))


class Connection:
    """A client of the control port."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self.file = connection.makefile("rb")

    def send(self, line: bytes) -> None:
        self.socket.sendall(line)

    def answer(self) -> dict[str, Any]:
        line = self.file.readline()
        assert line.endswith(b"\n"), f"closed after {line!r}"
        return json.loads(line)

    def ask(self, **request: Any) -> dict[str, Any]:
        self.send(json.dumps(request).encode() + b"\n")
        return self.answer()

    def ok(self, **request: Any) -> Any:
        answer = self.ask(**request)
        assert answer.keys() == {"ok"}, answer
        return answer["ok"]

    def closed(self) -> bool:
        return self.file.readline() == b""

    def close(self) -> None:
        self.file.close()
        self.socket.close()


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    running: list[Bench] = []

    def start(**options: Any) -> Bench:
        running.append(Bench(**options))
        return running[-1]

    yield start
    for one in running:
        one.server.stop()
        one.thread.join(STOP_S)
        assert not one.thread.is_alive()


def test_two_clients_operate_one_machine(bench):
    here = bench()
    one, other = here.connect(), here.connect()
    assert one.ok(set={"estop": "pressed"})["inputs"] == {"estop": "pressed"}
    assert other.ok(state=True)["inputs"]["estop"] == "pressed"
    assert other.ok(state=True)["outputs"]["power"] == 0
    assert other.ok(set={"limit_x2": "broken"})["inputs"] == {"limit_x2": "broken"}
    assert one.ok(state=True)["faults"] == {"limit_x2": "broken"}
    assert one.ok(settable=True)["estop"] == ["released", "pressed"]


def test_a_wait_of_one_ends_by_what_the_other_does_and_answers_keep_their_order(bench):
    here = bench()
    one, other = here.connect(), here.connect()
    one.send(b'{"wait": {"input": "hood", "is": "open"}}\n{"state": true}\n')
    other.ok(set={"hood": "open"})
    assert one.answer()["ok"].keys() == {"time_s", "time_ns"}
    assert one.answer()["ok"]["inputs"]["hood"] == "open"


def test_stop_during_a_wait(bench):
    here = bench()
    one, other = here.connect(), here.connect()
    one.send(b'{"wait": {"output": "spindle", "is": 1}}\n')
    other.ok(stop=True)
    assert one.answer() == {"error": "wait: the server stops", "timeout": True}
    assert one.closed()
    here.thread.join(STOP_S)
    assert not here.thread.is_alive()


WRONG = [
    (b"{]", "no JSON"),
    (b"[1]", "no object"),
    (b'{"speed": NaN}', "NaN is no number"),
    (b'{"speed": 1e999}', "speed: inf; allowed"),
    (b'{"speed": -Infinity}', "-Infinity is no number"),
    (b'{"speed": ' + b"9" * 5000 + b"}", "no JSON"),
    (b'{"stop": true, "stop": true}', "a key stands twice"),
    (b'{"stop": "__import__(1)"}', "stop: "),
    (b"[" * 30_000 + b"]" * 30_000, "nested too deeply"),
    (b"\xff\xfe", "no JSON"),
    (b'{"set": {"estop": "' + b"x" * 5000 + b'"}}', "input 'estop' cannot be"),
    (b'{"set": {"\\ud800": "x"}}', "unknown input"),
    (b'{"wait": {"output": "' + b"y" * 5000 + b'", "is": 1}}', "wait.output"),
]


@pytest.mark.parametrize(("line", "said"), WRONG, ids=[str(number) for number in range(len(WRONG))])
def test_what_is_wrong_is_one_line_and_the_connection_goes_on(bench, line: bytes, said: str):
    here = bench()
    client = here.connect()
    before = client.ok(state=True)
    client.send(line + b"\n")
    answer = client.answer()
    assert answer.keys() == {"error"}
    assert said in answer["error"]
    assert len(answer["error"]) < 1000
    assert client.ok(state=True) == before


def test_a_line_too_long_is_refused_and_the_next_one_heard(bench):
    client = bench().connect()
    client.ok(state=True)
    client.send(b'{"set": {"estop": "' + b"x" * (3 * LINE_BYTES) + b'"}}\n{"state": true}\n')
    assert client.answer() == {"error": f"request: longer than {LINE_BYTES} bytes; allowed: one object a line"}
    assert client.answer()["ok"]["inputs"]["estop"] == "released"


def test_a_line_too_long_behind_a_wait_is_refused_in_its_turn(bench):
    here = bench()
    client, other = here.connect(), here.connect()
    long = b'{"set": {"estop": "' + b"x" * (2 * LINE_BYTES) + b'"}}\n'
    sender = threading.Thread(
        target=client.send, args=(b'{"wait": {"input": "hood", "is": "open"}}\n' + long + b'{"state": true}\n',)
    )
    sender.start()
    until(lambda: here.port.operator._pending)
    other.ok(set={"hood": "open"})
    assert "ok" in client.answer()
    assert "longer than" in client.answer()["error"]
    assert client.answer()["ok"]["inputs"]["hood"] == "open"
    sender.join(REPLY_S)


def test_a_server_that_stands_still_hears_a_signal(serve):
    served = serve("--control", LOOPBACK, speed="1")
    assert ctl(served, "pause").returncode == 0
    assert served.stop(signal.SIGTERM) == 0


@pytest.mark.parametrize("speed", [None, 1.0])
def test_a_host_that_floods_a_paused_twin_is_made_to_wait(bench, speed):
    here = bench(speed=speed)
    here.connect().ok(pause=True)
    where = parse_address(here.line.address)
    with socket.create_connection(where, timeout=0.3) as host, pytest.raises(TimeoutError):
        host.sendall(b"@0P\r" * 10_000_000)
    assert here.server._unheard < 3 * 4096 + 4096


@pytest.mark.parametrize(
    "data",
    [
        b'POST / HTTP/1.1\r\nHost: localhost\r\n\r\n{"stop": true}\n',
        bytes.fromhex("1603010200010001fc0303"),  # TLS: no line ends
        bytes.fromhex("000100002112a442") + bytes(12),  # STUN
    ],
    ids=["a form", "https", "WebRTC"],
)
def test_a_browser_is_sent_away(bench, data):
    """A page can make it send to the loopback interface; nothing must be taken for a request, and no place be kept."""
    here = bench()
    client = here.connect()
    client.send(data)
    assert "request: no" in client.answer()["error"]
    assert client.closed()
    assert here.connect().ok(state=True)


def test_a_client_that_does_not_read_holds_nobody_up(bench):
    here = bench()
    deaf, other = here.connect(), here.connect()
    deaf.socket.setblocking(False)
    until = time.monotonic() + REPLY_S
    while not any(len(one.outbox) > UNREAD_BYTES for one in here.port._clients):
        assert time.monotonic() < until
        with contextlib.suppress(BlockingIOError):
            deaf.socket.send(b'{"state": true}\n' * 100)
    assert other.ok(set={"hood": "open"})
    assert all(len(one.buffer) <= 2 * LINE_BYTES for one in here.port._clients)
    assert all(len(one.outbox) <= 2 * UNREAD_BYTES for one in here.port._clients)


def test_a_client_that_goes_while_it_waits_is_forgotten(bench):
    here = bench()
    gone, other = here.connect(), here.connect()
    gone.ok(state=True)
    gone.send(b'{"wait": {"input": "hood", "is": "open", "pause": true}}\n')
    until(lambda: here.port.operator._pending)
    gone.close()
    until(lambda: not here.port.operator._pending)
    other.ok(set={"hood": "open"})
    assert other.ok(state=True)["paused"] is False


def test_more_clients_than_there_is_room_for_are_told(bench):
    here = bench()
    clients = [here.connect() for _ in range(CLIENTS)]
    clients[-1].ok(state=True)
    late = here.connect()
    assert "clients already" in late.answer()["error"]
    clients[0].close()
    until(lambda: len(here.port._clients) < CLIENTS)
    assert here.connect().ok(state=True)


def test_beyond_the_loopback_interface_a_token_is_needed(bench):
    here = bench(address="0.0.0.0:0")
    token = here.port.token
    assert token is not None
    assert len(token) >= 16
    for first in ({"state": True}, {"token": "guess"}, {"token": 5}, {"token": token, "stop": True}):
        client = here.connect()
        answer = client.ask(**first)
        assert "token" in answer["error"]
        assert token not in answer["error"]
        assert client.closed()
    client = here.connect()
    assert client.ok(token=token) == {}
    assert client.ok(state=True)


def test_clients_that_never_send_the_token_do_not_shut_the_port(bench):
    """They have TOKEN_S, here a second; who has sent it stays."""
    here = bench(token="secret", token_s=1.0)
    friend = here.connect()
    friend.ok(token="secret")
    silent = [here.connect() for _ in range(CLIENTS - 1)]
    assert "clients already" in here.connect().answer()["error"]
    until(lambda: len(here.port._clients) == 1)
    assert all(client.closed() for client in silent)
    late = here.connect()
    assert late.ok(token="secret") == {}
    assert friend.ok(state=True)


def test_the_operating_system_looks_for_clients_that_vanish(bench):
    here = bench()
    client = here.connect()
    client.ok(state=True)
    (served,) = here.port._clients
    assert served.connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)


def test_on_the_loopback_interface_none_unless_one_is_given(bench):
    assert bench().port.token is None
    client = bench(token="secret").connect()
    assert "token: missing" in client.ask(state=True)["error"]


def test_what_is_done_is_logged(bench, caplog):
    caplog.set_level(logging.INFO, "isel_twin.wire")
    client = bench().connect()
    client.ok(set={"estop": "pressed"})
    client.ask(set={"estop": "half"})
    client.ok(state=True)
    lines = [" ".join(record.getMessage().split()) for record in caplog.records]
    assert lines == ['0.000000 s ctl {"set": {"estop": "pressed"}}']


def test_hosts_stay_connected_while_time_stands_still(bench):
    here = bench(speed=1.0)
    client = here.connect()
    with socket.create_connection(parse_address(here.line.address), timeout=REPLY_S) as host:
        host.sendall(b"@07\r")
        assert host.recv(1) == b"0"
        stood = client.ok(pause=True)["time_ns"]
        host.sendall(b"@0R7\r@0P\r")
        host.settimeout(0.3)
        with pytest.raises(TimeoutError):
            host.recv(1)
        assert client.ok(state=True)["time_ns"] == stood
        assert client.ok(step=0.25)["time_ns"] == stood + 250_000_000
        client.ok(speed=100)
        client.ok(resume=True)
        host.settimeout(REPLY_S)
        assert host.recv(1) == b"0"


def test_a_reply_at_whose_last_byte_time_stands_still_is_with_the_host(bench):
    """Nothing of it waits for a silence that a paused line does not come to."""
    here = bench(speed=1.0)
    client = here.connect()
    with socket.create_connection(parse_address(here.line.address), timeout=REPLY_S) as host:
        for text, reply in ((b"@07", b"0"), (b"@0P", b"0" * 19)):
            client.send(b'{"wait": {"replied": "0", "pause": true}}\n')
            host.sendall(text + b"\r")
            client.answer()
            assert client.ok(state=True)["paused"] is True
            assert host.recv(64) == reply
            client.ok(resume=True)


# ---- processes ------------------------------------------------------------------------------------------------------


def ctl(served: Any, *arguments: object) -> subprocess.CompletedProcess[str]:
    return isel_twin("ctl", served.info["control"], *arguments)


def test_emergency_stop_in_motion_by_ctl(serve):
    """A host moves X; ctl presses: reply 9 (safety chain open), standstill, lamp; released and referenced, it goes."""
    served = serve("--control", LOOPBACK, speed="1")
    with served.open() as port:
        assert ask(port, "@07") == "0"
        assert ctl(served, "speed", "20").returncode == 0
        assert ask(port, "@0R7") == "0"
        assert ctl(served, "speed", "1").returncode == 0
        port.write(b"@0A64000,3000,0,30,0,30,0,30\r")
        moving = ctl(served, "wait", "position=x", "above=2", "pause")
        assert moving.returncode == 0, moving.stderr
        caught = json.loads(ctl(served, "state").stdout)
        assert caught["outputs"]["moving"] == 1
        assert 2.0 < caught["position_mm"][0] < 199.0
        pressed = ctl(served, "set", "estop=pressed")
        assert json.loads(pressed.stdout)["inputs"] == {"estop": "pressed"}
        assert json.loads(ctl(served, "resume").stdout)
        assert port.read(1) == b"9"
        state = json.loads(ctl(served, "state").stdout)
        assert state["outputs"]["moving"] == 0
        assert state["outputs"]["lamp_fault"] == 1
        assert state["outputs"]["power"] == 0
        assert state["position_mm"][0] == pytest.approx(caught["position_mm"][0], abs=0.1), "ends at once"
        before = state["counts"]
        assert ctl(served, "step", "0.1").returncode == 2
        assert json.loads(ctl(served, "state").stdout)["counts"] == before
        assert ctl(served, "set", "estop=released").returncode == 0
        assert ctl(served, "speed", "max").returncode == 0
        assert ask(port, "@07") == "0"
        assert ask(port, "@0R7") == "0"
    assert ctl(served, "stop").returncode == 0
    assert served.process.wait(STOP_S) == 0


def test_what_ctl_says_of_wrong_calls(serve):
    served = serve("--control", LOOPBACK)
    for arguments, code, said in (
        (("set", "estop=half"), 2, "input 'estop' cannot be 'half'; it can be: released, pressed"),
        (("set",), 2, "set: needs NAME=VALUE"),
        (("set", "estop"), 2, "set: 'estop' is not NAME=VALUE"),
        (("fault", "limit_x9=broken"), 2, "unknown input 'limit_x9'; did you mean"),
        (("step", "1"), 2, "step: virtual time does not stand still; allowed: after pause"),
        (("speed", "nan"), 2, "speed"),
        (("pause", "now"), 2, "pause: takes nothing"),
        (("wait",), 2, "wait: needs what to wait for"),
        (("wait", "output=spindle", "is=1", "wall_s=0.1"), 1, "wait: not so in time"),
        (("force", "x=-5"), 2, "force_n: does nothing without physics"),
    ):
        done = ctl(served, *arguments)
        assert (done.returncode, done.stdout) == (code, ""), arguments
        assert said in done.stderr, arguments
        assert done.stderr.count("\n") == 1, done.stderr
    assert served.stop(signal.SIGTERM) == 0
    done = ctl(served, "state")
    assert done.returncode == 2
    assert "is there a serve --control?" in done.stderr


def test_a_token_comes_from_a_file_or_the_environment(serve, tmp_path, monkeypatch):
    served = serve("--control", "0.0.0.0:0")
    address = f"127.0.0.1:{parse_address(served.info['control'])[1]}"
    served.info["control"] = address
    assert "token: missing" in ctl(served, "state").stderr
    (wrong := tmp_path / "wrong").write_text("wrong\n")
    (right := tmp_path / "right").write_text(served.info["control_token"] + "\n")
    assert ctl(served, "state", "--token-file", wrong).returncode == 2
    assert ctl(served, "state", "--token-file", right).returncode == 0
    given = serve("--control", LOOPBACK, "--token-file", right)
    assert "control_token" not in given.info
    assert ctl(given, "state").returncode == 2
    monkeypatch.setenv("ISEL_TWIN_TOKEN", right.read_text())
    assert ctl(given, "state").returncode == 0
    assert ctl(given, "state", "--token-file", wrong).returncode == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--control", "nonsense"], "address 'nonsense' is not HOST:PORT"),
        (["--token-file", "x"], "--token-file: goes with --control HOST:PORT"),
    ],
)
def test_a_control_port_that_cannot_be(capsys, arguments, said):
    with pytest.raises(SystemExit) as caught:
        main(["serve", "--plant", "kinematic", *arguments])
    assert caught.value.code == 2
    assert said in capsys.readouterr().err


def test_the_example_of_the_page(serve):
    found = re.search(r"( {4}import json.*?)\n\n[^ ]", PAGE.read_text(), re.DOTALL)
    assert found is not None
    code = "\n".join(line[4:] for line in found[1].splitlines())
    served = serve("--control", LOOPBACK)
    code = code.replace('"127.0.0.1", 4002', f'"127.0.0.1", {parse_address(served.info["control"])[1]}')
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(code, {})
    assert printed.getvalue() == "0 pressed\n"


@pytest.mark.parametrize("answer", [b"hello", b"[" * 60_000, b'{"ok": 1}', b'{"ok": null}', b"{}"])
def test_a_stranger_at_the_address_is_told_in_one_line(answer: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        address = f"127.0.0.1:{listener.getsockname()[1]}"
        with Client(address) as client:
            stranger, _ = listener.accept()
            with stranger:
                stranger.sendall(answer + b"\n")
                with pytest.raises(ClientError, match="is no control port; it answers") as caught:
                    client.ask({"state": True})
    assert "\n" not in str(caught.value)
