"""An agent by the book: heartbeat, every line split as the standard says, keys and words as in Devices.xml."""

from __future__ import annotations

import datetime
import json
import re
import signal
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from isel_twin.bridge.mtconnect.adapter import lines
from isel_twin.bridge.mtconnect.items import ITEMS
from tests.bridge.conftest import REPLY_S, Served
from tests.in_process import isel_twin

# part 3 of the standard, the controlled vocabularies that occur here
WORDS = {
    "AVAILABILITY": {"AVAILABLE"},
    "EMERGENCY_STOP": {"ARMED", "TRIGGERED"},
    "EXECUTION": {"READY", "ACTIVE", "INTERRUPTED", "FEED_HOLD", "STOPPED", "PROGRAM_COMPLETED"},
    "CONTROLLER_MODE": {"AUTOMATIC", "MANUAL", "MANUAL_DATA_INPUT", "SEMI_AUTOMATIC", "EDIT"},
    "DOOR_STATE": {"OPEN", "CLOSED", "UNLATCHED"},
    "POWER_STATE": {"ON", "OFF"},
}
LEVELS = {"NORMAL", "WARNING", "FAULT", "UNAVAILABLE"}


def split(line: str) -> list[str]:
    """Fields between bars; a quoted field may hold escaped ones."""
    fields = re.findall(r'(?:^|\|)("(?:\\.|[^"\\])*"|[^|]*)', line)
    return [re.sub(r"\\(.)", r"\1", one[1:-1]) if one.startswith('"') else one for one in fields]


class Agent:
    """Takes values by key from what the adapter says; checks all of it."""

    def __init__(self, address: str, devices: Path) -> None:
        host, _, port = address.rpartition(":")
        self.socket = socket.create_connection((host, int(port)), timeout=REPLY_S)
        self._file = self.socket.makefile("r", encoding="utf-8", newline="\n")
        tree = ElementTree.parse(devices)
        self.items = {one.get("name"): one for one in tree.iter() if one.tag.endswith("DataItem")}
        self.values: dict[str, str] = {}
        self.pongs: list[str] = []

    def close(self) -> None:
        self._file.close()
        self.socket.close()

    def until(self, true: Any) -> None:
        while not true(self.values):
            line = self._file.readline()
            assert line, "the adapter has closed the connection"
            self.take(line.rstrip("\n"))

    def take(self, line: str) -> None:
        if line.startswith("* "):
            self.pongs.append(line)
            return
        stamp, *fields = split(line)
        assert stamp.endswith("Z")
        datetime.datetime.fromisoformat(stamp)
        item = self.items[fields[0]]
        if item.get("category") == "CONDITION":
            assert len(fields) == 6
            assert fields[1] in LEVELS
            self.values[fields[0]] = fields[5] or fields[1]
            return
        assert len(fields) % 2 == 0
        for key, value in zip(fields[::2], fields[1::2], strict=True):
            about = self.items[key].attrib
            assert about["category"] != "CONDITION"
            if value != "UNAVAILABLE":
                assert value in WORDS.get(about["type"], {value})
                assert about["category"] != "SAMPLE" or abs(float(value)) < 1e4
            self.values[key] = value


@pytest.fixture
def adapter(serve: Any, tmp_path: Path) -> Iterator[tuple[Any, Served, Path]]:
    machine = serve("--control", "127.0.0.1:0", "--tcp", "127.0.0.1:0")
    path = tmp_path / "Devices.xml"
    call = (machine.info["control"], "--tcp", "127.0.0.1:0", "--devices", str(path), "--interval", "0.02")
    beside = Served(call, "mtconnect")
    yield machine, beside, path
    beside.process.kill()
    beside.process.communicate()


def test_an_agent_sees_what_happens(adapter: tuple[Any, Served, Path]) -> None:
    machine, beside, path = adapter
    agent = Agent(beside.info["mtconnect"], path)
    agent.until(lambda seen: seen.keys() == {item.key for item in ITEMS})
    assert agent.items.keys() == agent.values.keys()
    assert {key: agent.values[key] for key in ("avail", "exec", "estop", "hood", "power", "Xpos", "sys")} == {
        **{"avail": "AVAILABLE", "exec": "READY", "estop": "ARMED", "hood": "CLOSED", "power": "ON"},
        **{"Xpos": "NORMAL", "sys": "NORMAL"},
    }
    agent.socket.sendall(b"* PING\n")
    agent.until(lambda _: agent.pongs == ["* PONG 10000"])
    for what, sees in (
        ("estop=pressed", {"estop": "TRIGGERED", "power": "OFF", "sys": "the safety relay is open"}),
        ("estop=released", {}),
        ("power=on", {"estop": "ARMED", "power": "ON", "sys": "NORMAL"}),
        ("hood=open", {"hood": "OPEN"}),
        ("key=setup", {"mode": "MANUAL"}),
    ):
        assert isel_twin("ctl", machine.info["control"], "set", what).returncode == 0
        agent.until(lambda seen, sees=sees: sees.items() <= seen.items())
    assert machine.stop(signal.SIGTERM) == 0
    agent.until(lambda seen: set(seen.values()) == {"UNAVAILABLE"})
    assert beside.process.wait(REPLY_S) == 0, "the adapter ends with the machine"


def test_agents_that_go_wrong_trouble_no_other(adapter: tuple[Any, Served, Path]) -> None:
    """Nonsense, a line without an end, half a heartbeat, a vanished agent, more agents than there may be; and a second
    adapter at the same address."""
    _, beside, path = adapter
    address = beside.info["mtconnect"]
    agent = Agent(address, path)
    agent.until(lambda seen: "power" in seen)
    agent.socket.sendall(b"\x00\xff|avail|UNAVAILABLE\n" + b"x" * 10_000 + b"\n* PI")
    agent.socket.sendall(b"NG\n")
    agent.until(lambda _: agent.pongs == ["* PONG 10000"])
    gone = Agent(address, path)
    gone.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    gone.close()
    others = [Agent(address, path) for _ in range(14)]
    for other in others:
        other.until(lambda seen: "power" in seen)
    last = Agent(address, path)
    last.until(lambda seen: "power" in seen)
    with pytest.raises((AssertionError, ConnectionError)):
        Agent(address, path).until(lambda seen: "power" in seen)
    second = isel_twin("mtconnect", adapter[0].info["control"], "--tcp", address)
    assert (second.returncode, second.stderr.count("\n")) == (2, 1)
    assert "in use" in second.stderr
    agent.socket.sendall(b"* PING\n")
    agent.until(lambda _: len(agent.pongs) == 2)


def test_texts_with_bars_are_quoted() -> None:
    normal = {item.key: "" if item.category == "CONDITION" else "1" for item in ITEMS}
    (line,) = lines({**normal, "Xpos": 'a|b "c"'}, normal, "T")
    assert split(line) == ["T", "Xpos", "FAULT", "Xpos", "", "", 'a|b "c"']
    assert lines(normal, normal, "T") == []


def test_without_a_machine_it_says_so() -> None:
    done = isel_twin("mtconnect", "127.0.0.1:1")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert json.dumps("is there a serve --control?").strip('"') in done.stderr
