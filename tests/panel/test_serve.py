"""`isel-twin serve --panel` as a process: its address, its recording, a port that is taken."""

from __future__ import annotations

import http.client
import json
import select
import socket
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from mcap.exceptions import EndOfFile
from mcap.stream_reader import StreamReader
from websockets.sync.client import connect

from isel_twin.cli import main
from tests import forked
from tests.forked import PATIENCE_S
from tests.panel.conftest import LOOPBACK, WAIT_S

START_S = PATIENCE_S
"""Longest wait for a process to listen: the first one may have to compile."""


@pytest.fixture
def serve() -> Iterator[Callable[..., dict[str, Any]]]:
    """serve(*arguments) -> the line that it has printed."""
    started: list[Any] = []

    def start(*arguments: str) -> dict[str, Any]:
        process = forked.start("serve", "--plant", "kinematic", *arguments)
        started.append(process)
        ready, _, _ = select.select([process.stdout], [], [], START_S)
        line = process.stdout.readline() if ready else ""
        assert line, process.communicate()[1]
        info: dict[str, Any] = json.loads(line)
        return info

    yield start
    for process in started:
        process.terminate()
        out, _ = process.communicate(timeout=WAIT_S)
        assert (process.returncode, out) == (0, "")  # nothing but its line, whatever viser says


def get(url: str, path: str) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=WAIT_S)
    connection.request("GET", path)
    answer = connection.getresponse()
    data = answer.read()
    connection.close()
    return answer.status, data


def test_the_address_is_printed_and_the_recording_can_be_had(serve, tmp_path: Path) -> None:
    info = serve("--tcp", LOOPBACK, "--panel", LOOPBACK, "--record", str(tmp_path / "a.mcap"), "--speed", "max")
    assert get(info["panel"], "/")[0] == 200
    with connect(f"ws://{urlsplit(info['panel']).netloc}/operate", max_size=None) as page:
        about = json.loads(page.recv(timeout=WAIT_S))["about"]
        assert about["recording"] == "a.mcap"
        page.send(json.dumps({"id": 1, "ask": {"set": {"estop": "pressed"}}}))
        while not any(one["id"] == 1 for one in json.loads(page.recv(timeout=WAIT_S)).get("answers", [])):
            pass
    data = b""
    while b"pressed" not in b"".join(contents(data)):
        status, data = get(info["panel"], "/recording")
        assert status == 200


def contents(data: bytes) -> Iterator[bytes]:
    """What the messages of a recording hold, as far as it goes."""
    try:
        for record in StreamReader(BytesIO(data)).records if data else ():
            yield bytes(getattr(record, "data", b""))
    except EndOfFile:
        return


def test_without_a_recording_there_is_none(serve) -> None:
    assert get(serve("--tcp", LOOPBACK, "--panel", LOOPBACK)["panel"], "/recording")[0] == 404


def test_the_panel_alone_has_a_port_of_its_own(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    """Which is taken here, and so it says."""
    from isel_twin.cli import serve as command

    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        monkeypatch.setattr(command, "PANEL", address)
        for words in (["serve", "--panel", "--tcp", LOOPBACK], ["serve", "--tcp", LOOPBACK, "--panel"]):
            with pytest.raises(SystemExit) as caught:
                main(words)
            out, err = capsys.readouterr()
            assert caught.value.code != 0
            assert out == ""
            assert err.count("\n") == 1
            assert address in err
            assert "choose another address" in err


def test_a_token_without_a_word_in_it(tmp_path: Path, capsys) -> None:
    (empty := tmp_path / "token").write_text("\n")
    with pytest.raises(SystemExit) as caught:
        main(["serve", "--panel", LOOPBACK, "--token-file", str(empty)])
    assert caught.value.code == 2
    assert capsys.readouterr().err == f"isel-twin: {empty}: holds no token in its first line\n"
