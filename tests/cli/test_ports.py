"""`isel-twin ports`: what is served on this computer now."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest
import serial

from isel_twin.bridge.serve import registry
from tests.forked import run, start, start_anew
from tests.in_process import isel_twin

STOP_S = 60.0


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
