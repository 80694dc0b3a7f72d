"""`isel-twin ports`: what is served on this computer now."""

from __future__ import annotations

import json
import os
import signal
import stat
from pathlib import Path
from typing import Any

import pytest
import serial

from isel_twin.bridge.serve import registry
from isel_twin.cli import ports
from tests.forked import PATIENCE_S, run, start, start_anew
from tests.in_process import isel_twin

STOP_S = PATIENCE_S


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A runtime folder of this test's own."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "isel-twin" / "ports"


class Serving:
    """A server that listens while the block lasts."""

    def __init__(self, *arguments: str) -> None:
        self.process = start(*arguments)
        self.info: dict[str, Any] = json.loads(self.process.stdout.readline())

    def __enter__(self) -> Serving:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.communicate(timeout=STOP_S)


def listed() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(isel_twin("ports", "--json").stdout)["served"]
    return found


def test_several_endpoints_of_a_kind_are_served_and_listed(tmp_path, home):
    first, second = str(tmp_path / "a"), str(tmp_path / "b")
    arguments = (*("--pty", first, "--pty", second), *("--tcp", "127.0.0.1:0") * 2, "--plant", "kinematic")
    with Serving("serve", *arguments, "--speed", "max") as server:
        assert server.info["pty"] == first
        assert [port["kind"] for port in server.info["ports"]] == ["pty", "pty", "tcp", "tcp"]
        assert server.info["tcp"] == server.info["ports"][2]["address"] != server.info["ports"][3]["address"]
        (entry,) = listed()
        assert entry == {
            "pid": server.process.pid,
            "command": "serve",
            "machine": "4030",
            "controller": "imc-s8",
            "ports": server.info["ports"],
        }
        names = [first, second, *(f"socket://{port['address']}" for port in server.info["ports"][2:])]
        for name in names:  # one after the other: a controller has one line
            with serial.serial_for_url(name, baudrate=19_200, timeout=60) as port:
                port.write(b"@0P\r")
                assert port.read(19) == b"0" * 19
        text = run("ports", start=start_anew).stdout
        assert f"{first} -> {server.info['device']}" in text
        assert f"socket://{server.info['tcp']}" in text
    assert listed() == []
    assert list(home.iterdir()) == []


def test_what_a_killed_server_has_left_is_cleaned_up(home):
    with Serving("serve", "--plant", "kinematic") as server:
        assert len(listed()) == 1
        server.process.send_signal(signal.SIGKILL)
        server.process.wait(STOP_S)
        assert len(list(home.iterdir())) == 1
        assert listed() == []
        assert list(home.iterdir()) == []


def test_a_number_of_a_process_that_lives_is_no_proof(home):
    """The file of a server that was killed; its number is that of this test now."""
    home.mkdir(parents=True)
    (home / f"{os.getpid()}-7.json").write_text(json.dumps({"pid": os.getpid(), "ports": []}))
    assert registry.served() == []
    assert list(home.iterdir()) == []


def test_a_tap_is_listed_too(tmp_path):
    with (
        Serving("serve", "--plant", "kinematic") as server,
        Serving("tap", server.info["pty"], "--pty", str(tmp_path / "imc")) as tap,
    ):
        entry = next(entry for entry in listed() if entry["command"] == "tap")
        assert entry["tap"] == server.info["pty"]
        assert entry["ports"] == [{"kind": "pty", "address": str(tmp_path / "imc"), "device": tap.info["device"]}]


def test_no_folder_is_no_reason_not_to_serve(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setattr(registry, "folder", lambda: blocked / "ports")
    with registry.registered({"ports": []}):
        assert registry.served() == []


# ---- a temporary folder that others can write to ---------------------------------------------------------------------


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The registry's folder in a temporary folder of all users, not made yet."""
    for variable in ("XDG_RUNTIME_DIR", "LOCALAPPDATA"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(registry.tempfile, "gettempdir", lambda: str(tmp_path))
    return registry.folder()


def test_the_folder_is_made_for_this_user_alone(shared: Path) -> None:
    with registry.registered({"ports": []}):
        (entry,) = registry.served()
        (file,) = shared.glob("*.json")
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert entry["pid"] == os.getpid()
    assert [stat.S_IMODE(place.stat().st_mode) for place in (shared, shared.parent)] == [0o700, 0o700]
    assert registry.served() == []


def prepared_by_link(shared: Path, target: Path) -> None:
    target.mkdir()
    shared.parent.symlink_to(target)


def prepared_open(shared: Path, target: Path) -> None:
    shared.mkdir(parents=True)
    shared.chmod(0o777)


def prepared_by_another(shared: Path, target: Path) -> None:
    shared.mkdir(parents=True, mode=0o700)


@pytest.mark.parametrize("prepare", [prepared_by_link, prepared_open, prepared_by_another])
def test_what_somebody_else_has_prepared_is_refused_in_one_line(prepare, shared, tmp_path, caplog, monkeypatch) -> None:
    if prepare is prepared_by_another:
        me = os.getuid() + 1
        monkeypatch.setattr(registry.os, "getuid", lambda: me)
    mine = tmp_path / "mine.txt"
    mine.write_text("precious")
    prepare(shared, tmp_path / "elsewhere")
    shared.mkdir(exist_ok=True)
    for number in range(50):
        (shared / f"{os.getpid()}-{number}.new").symlink_to(mine)
        (shared / f"{os.getpid()}-{number}.json").symlink_to(mine)
    with registry.registered({"ports": []}):
        assert registry.served() == []
    assert mine.read_text() == "precious"
    assert len(caplog.records) == 1
    assert "is not a folder of this user alone; remove it" in caplog.text


def test_nothing_is_made_where_a_link_of_somebody_else_leads(shared: Path, tmp_path: Path, caplog) -> None:
    prepared_by_link(shared, tmp_path / "elsewhere")
    with registry.registered({"ports": []}):
        assert list((tmp_path / "elsewhere").iterdir()) == []
    assert "is not a folder of this user alone; remove it" in caplog.text


def test_a_link_within_ones_own_folder_is_not_followed(shared: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.txt"
    mine.write_text("precious")
    shared.mkdir(parents=True, mode=0o700)
    shared.parent.chmod(0o700)
    for number in range(1000):
        (shared / f"{os.getpid()}-{number}.new").symlink_to(mine)
    with registry.registered({"ports": []}):
        assert len(registry.served()) == 1
    assert mine.read_text() == "precious"


@pytest.mark.parametrize("content", [b"", b"{}", b"[]", b"\xff", b"[" * 99999, b'{"ports": 7}', b'{"ports": [7]}'])
def test_a_damaged_entry_of_a_running_server_is_passed_over(
    shared: Path, content: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    with registry.registered({"ports": []}):
        (file,) = shared.iterdir()
        file.write_bytes(content)
        assert ports.ports() == 0
    assert "served now: none" in capsys.readouterr().out
