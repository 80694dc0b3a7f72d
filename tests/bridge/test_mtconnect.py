"""An agent by the book: heartbeat, every line split as the standard says, keys and words as in Devices.xml."""

from __future__ import annotations

import datetime
import itertools
import json
import re
import signal
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from isel_twin.bridge.mtconnect.adapter import Adapter, lines
from isel_twin.bridge.mtconnect.items import ITEMS, SCHEMA, devices, values
from tests.bridge.conftest import REPLY_S, Served
from tests.bridge.test_network import read_all
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
        assert re.fullmatch(r"[-\dT:.]+Z", stamp), "an instant: a duration, behind @, is told of a statistic only"
        datetime.datetime.fromisoformat(stamp)
        item = self.items[fields[0]]
        if item.get("category") == "CONDITION":
            assert len(fields) == 6
            assert fields[1] in LEVELS
            assert fields[1] == "FAULT" or fields[2:] == [""] * 4, "without a code NORMAL ends all that was wrong"
            self.values[fields[0]] = fields[5] or fields[1]
            return
        assert len(fields) % 2 == 0
        for key, value in zip(fields[::2], fields[1::2], strict=True):
            about = self.items[key].attrib
            assert about["category"] != "CONDITION"
            assert value, "an agent would take nothing for the value"
            assert "statistic" not in about
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
    """Nonsense behind a heartbeat, a line without an end, half a heartbeat, who is no agent, a vanished agent, more
    agents than there may be; and a second adapter at the same address."""
    _, beside, path = adapter
    address = beside.info["mtconnect"]
    agent = Agent(address, path)
    agent.until(lambda seen: "power" in seen)
    agent.socket.sendall(b"* PING\n\x00\xff|avail|UNAVAILABLE\n" + b"x" * 10_000 + b"\n* PI")
    agent.socket.sendall(b"NG\n")
    agent.until(lambda _: agent.pongs == ["* PONG 10000"] * 2)
    for foreign in (b"GET / HTTP/1.1\r\n\r\n* PING\n", b"* / HTTP/1.1\r\n", b"\x00\x14\x00\x01"):
        stranger = Agent(address, path)
        stranger.socket.sendall(foreign)
        assert b"PONG" not in read_all(stranger.socket)
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
    agent.until(lambda _: len(agent.pongs) == 3)


def state(**changed: Any) -> dict[str, Any]:
    """As the control port tells it, of a machine where nothing is wrong."""
    plain = {"idle": True, "fault": False, "unfinished": "", "outputs": {"power": 1}, "faults": {}, "inputs": {}}
    axes = {"lost_steps": [0, 0, 0], "slip_steps": [32, 32, 32], "drive_faults": [[0, ""]] * 3}
    places = {"position_mm": [1.0, 2.0, 3.0], "position_error_mm": [0.25, 0.0, -1.0]}
    return {**plain, **axes, **places, **changed}


def test_values_of_a_machine_where_nothing_is_wrong_and_of_one_in_trouble() -> None:
    fine = values(state())
    assert fine == {
        **{"avail": "AVAILABLE", "estop": "ARMED", "sys": "", "logic": "", "comms": "", "exec": "READY"},
        **{"mode": "SEMI_AUTOMATIC", "hood": "CLOSED", "power": "ON"},
        **{"Xact": "1.0000", "Xcom": "0.7500", "Xpos": "", "Xdrive": ""},
        **{"Yact": "2.0000", "Ycom": "2.0000", "Ypos": "", "Ydrive": ""},
        **{"Zact": "3.0000", "Zcom": "4.0000", "Zpos": "", "Zdrive": ""},
    }
    changed = {"lost_steps": [15.9, -16.0, 0], "faults": {"line_cut": True}, "fault": True, "outputs": {"power": 0}}
    inputs = {"estop": "pressed", "hood": "forced", "key": "setup"}
    changed["fault_cause"] = "emergency stop"
    told = values(state(**changed, inputs=inputs, drive_faults=[[0, ""], [0, ""], [3, "too hot"]]))
    assert {key: value for key, value in told.items() if value != fine[key]} == {
        **{"estop": "TRIGGERED", "power": "OFF", "hood": "OPEN", "mode": "MANUAL", "exec": "STOPPED"},
        **{"sys": "the safety relay is open", "Ypos": "y has lost -16 steps", "Zdrive": "drive of z: too hot"},
        **{"logic": "emergency stop", "comms": "the line to the host is cut"},
    }


@pytest.mark.parametrize(
    ("changed", "execution"),
    [
        ({}, "READY"),
        ({"idle": False}, "ACTIVE"),
        ({"idle": False, "outputs": {"power": 0}}, "INTERRUPTED"),
        ({"unfinished": "program 3"}, "INTERRUPTED"),
        ({"fault": True}, "STOPPED"),
    ],
)
def test_execution(changed: dict[str, Any], execution: str) -> None:
    assert values(state(**changed))["exec"] == execution


def test_devices_of_a_machine() -> None:
    """The whole file: components as part 2 of the standard nests them, and each item in its own."""
    text = devices({"machine": "my machine", "controller": "a controller"})
    assert text.startswith(b"<?xml version")
    assert len(text.splitlines()) > 50, "for people, too"
    root = ElementTree.fromstring(text)
    assert root.tag == f"{{{SCHEMA}}}MTConnectDevices"
    inside = f"{{{SCHEMA}}}"

    def nested(element: ElementTree.Element) -> Any:
        plain = element.tag.removeprefix(inside)
        if plain == "DataItem":
            return "|".join(value for name, value in element.attrib.items() if name != "id")
        named = " ".join([plain, *element.attrib.values()])
        return {named: [nested(one) for one in element] or element.text}

    mm = "MILLIMETER|MILLIMETER"

    def axis(name: str) -> Any:
        samples = [
            f"{name}{kind}|SAMPLE|POSITION|{sub}|{mm}" for kind, sub in (("act", "ACTUAL"), ("com", "COMMANDED"))
        ]
        told = [*samples, f"{name}pos|CONDITION|POSITION", f"{name}drive|CONDITION|SYSTEM"]
        return {f"Linear {name.lower()} {name}": [{"DataItems": told}]}

    conditions = ("sys|CONDITION|SYSTEM", "logic|CONDITION|LOGIC_PROGRAM", "comms|CONDITION|COMMUNICATIONS")
    door = {"DataItems": ["hood|EVENT|DOOR_STATE"]}
    path = {"DataItems": ["exec|EVENT|EXECUTION", "mode|EVENT|CONTROLLER_MODE"]}
    assert nested(root[0][0]) == {
        "Device d isel-my machine-twin my_machine": [
            {"Description isel (simulated) my machine": "controlled by a controller"},
            {"DataItems": ["avail|EVENT|AVAILABILITY"]},
            {
                "Components": [
                    {"Axes axes base": [{"Components": [axis("X"), axis("Y"), axis("Z")]}]},
                    {
                        "Controller c controller": [
                            {"DataItems": ["estop|EVENT|EMERGENCY_STOP", *conditions]},
                            {"Components": [{"Path p path": [path]}]},
                        ]
                    },
                    {"Door hood_door hood": [door]},
                    {
                        "Systems systems": [
                            {"Components": [{"Electric electric supply": [{"DataItems": ["power|EVENT|POWER_STATE"]}]}]}
                        ]
                    },
                ]
            },
        ]
    }
    assert {one.get("id") for one in root.iter(f"{inside}DataItem")} == {item.key for item in ITEMS}


def little_room(adapter: Adapter) -> socket.socket:
    """An agent at an adapter, with the smallest buffers that the operating system makes."""
    adapter._listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    agent = socket.socket()
    agent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    agent.settimeout(REPLY_S)
    agent.connect(("127.0.0.1", int(adapter.address.rpartition(":")[2])))
    return agent


def test_an_agent_that_does_not_read_is_dropped_before_it_misses_a_line() -> None:
    """Small buffers of the operating system; positions change at every look, and 2000 of them are 240 kB."""
    enough, looks = threading.Event(), itertools.count()

    def look() -> dict[str, Any]:
        if (number := next(looks)) == 2000:
            enough.set()
        return state(position_mm=[float(number)] * 3)

    adapter = Adapter("127.0.0.1:0", look, 0.0001)
    with little_room(adapter) as agent:
        running = threading.Thread(target=adapter.run)
        running.start()
        assert enough.wait(REPLY_S)
        told = b""
        with suppress(ConnectionResetError):
            while piece := agent.recv(65_536):
                told += piece
    adapter.stop()
    running.join(REPLY_S)
    seen = [float(text) for text in re.findall(rb"Xact\|(\d+\.0000)\|", told)]
    assert 10 < len(seen) < 2000
    assert seen == [seen[0] + number for number in range(len(seen))]


def test_a_silent_agent_that_reads_late_misses_no_line_and_is_looked_after() -> None:
    """300 positions are 36 kB: more than both buffers of the operating system, less than an agent may leave unread."""
    enough, looks = threading.Event(), itertools.count()

    def look() -> dict[str, Any]:
        if (number := min(next(looks), 300)) == 300:
            enough.set()
        return state(position_mm=[float(number)] * 3)

    adapter = Adapter("127.0.0.1:0", look, 0.0001)
    with little_room(adapter) as agent:
        running = threading.Thread(target=adapter.run, daemon=True)
        running.start()
        assert enough.wait(REPLY_S)
        (known,) = adapter._agents
        assert known.connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        told = b""
        while b"|Xact|300.0000|" not in told:
            told += agent.recv(65_536)
        adapter.stop()
        running.join(REPLY_S)
    seen = [float(text) for text in re.findall(rb"Xact\|(\d+\.0000)\|", told)]
    assert seen == [float(number) for number in range(int(seen[0]), 301)]


def test_a_stop_does_not_wait_for_the_next_look() -> None:
    looked = threading.Event()

    def look() -> dict[str, Any]:
        looked.set()
        return state()

    adapter = Adapter("127.0.0.1:0", look, 3600.0)
    running = threading.Thread(target=adapter.run)
    running.start()
    looked.wait(REPLY_S)
    adapter.stop()
    running.join(REPLY_S)
    assert not running.is_alive()


@pytest.mark.parametrize(
    "text",
    [
        *('a|b "c"', r"C:\jobs\part.nc", r'C:\jobs\"part".nc', '"', "\\|", '"a', 'a"', "|", '""', "\\"),
        *("UNAVAILABLE", "@100.0", "part:3", "* PONG 1", "{a}"),
    ],
)
def test_texts_come_as_they_are(text: str) -> None:
    """In quotes an agent takes what follows a backslash as it is, outside it takes the backslash as it is."""
    normal = {item.key: "" if item.category == "CONDITION" else "1" for item in ITEMS}
    (line,) = lines({**normal, "Xpos": text}, normal, "T")
    assert split(line) == ["T", "Xpos", "FAULT", "Xpos", "", "", text]
    assert lines(normal, normal, "T") == []


def test_what_is_not_available_is_said_of_each_item() -> None:
    """Part 3: UNAVAILABLE is the value of a sample or an event, and the level of a condition, alone on its line."""
    plain, *conditions = [split(line) for line in lines(dict.fromkeys(item.key for item in ITEMS), {}, "T")]
    names = [item.key for item in ITEMS if item.category != "CONDITION"]
    assert plain == ["T", *itertools.chain.from_iterable((name, "UNAVAILABLE") for name in names)]
    assert [one[2:] for one in conditions] == [["UNAVAILABLE", "", "", "", ""]] * (len(ITEMS) - len(names))


def test_texts_of_a_machine_neither_end_a_line_nor_break_the_file_of_devices() -> None:
    """A line end begins a line of its own (part 5), and XML has no control characters (XML 1.0, 2.2)."""
    evil = "x\r\n2026-11-22T12:00:00Z|Xact|9\x1b\0"
    told = lines(values(state(fault=True, fault_cause=evil)), values(state()), "T")
    assert [one for one in told if set(one) & set("\r\n\x1b\0")] == []
    assert not any(line.startswith("2026") for line in "\n".join(told).splitlines())
    ElementTree.fromstring(devices(state(machine=evil, controller=evil)))


@pytest.mark.parametrize("command", ["mtconnect", "opcua"])
@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (b'{"ok": {}}\n', "is served by another version, which does not say controller, "),
        (b'{"ok": 5}\n', "is no control port; it answers "),
        (b"[" * 60_000 + b"\n", "is no control port; it answers "),
    ],
    ids=["another version", "a number", "deep"],
)
def test_a_foreign_server_is_told_in_one_line(command: str, answer: bytes, told: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def reply() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(4096)
                connection.sendall(answer)

        thread = threading.Thread(target=reply)
        thread.start()
        done = isel_twin(command, f"127.0.0.1:{server.getsockname()[1]}")
        thread.join()
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert told in done.stderr


def test_without_a_machine_it_says_so() -> None:
    done = isel_twin("mtconnect", "127.0.0.1:1")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert json.dumps("is there a serve --control?").strip('"') in done.stderr
