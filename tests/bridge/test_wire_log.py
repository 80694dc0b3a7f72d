"""Traffic is printed message by message, with time and direction."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Server
from isel_twin.bridge.serve.wire_log import LINE_BYTES, WireLog
from isel_twin.core.twin import Twin
from tests.bridge.test_network import Mouth
from tests.bridge.test_pacing import Clock

MS = 1_000_000


@dataclass(frozen=True)
class Message:
    data: bytes
    text: str
    explanation: str


class Lines:
    """A language in which a command ends with CR and every byte of a reply is one message."""

    def __init__(self) -> None:
        self._begun = b""

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        if not sent:
            return iter([Message(bytes([byte]), chr(byte), "a reply") for byte in data])
        *complete, self._begun = (self._begun + data).split(b"\r")
        return iter([Message(line + b"\r", line.decode(), "a command") for line in complete])

    def rest(self, sent: bool) -> bytes:
        return self._begun if sent else b""


@pytest.fixture
def lines(caplog) -> Callable[[], list[str]]:
    """lines() is what has been printed so far, with single blanks."""
    caplog.set_level(logging.INFO, "isel_twin.wire")
    return lambda: [" ".join(record.getMessage().split()) for record in caplog.records]


def test_messages_with_a_language(lines):
    wire = WireLog(Lines())
    wire.carry(1 * MS, b"@0", sent=True)
    wire.carry(2 * MS, b"7\r@0P", sent=True)
    wire.carry(3 * MS, b"0", sent=False)
    wire.close()
    assert lines() == [
        "0.002000 s host @07 a command",
        "0.003000 s twin 0 a reply",
        "0.003000 s host 40 30 50 not complete",
    ]


def test_bytes_without_a_language_are_put_together_until_silence_or_the_other_side(lines):
    wire = WireLog(None)
    for time_ns, data in enumerate((b"@", b"0", b"7", b"\r")):
        wire.carry(time_ns * MS, data, sent=True)
    wire.carry(5 * MS, b"0", sent=False)
    wire.look(10 * MS)
    assert lines() == ["0.003000 s host 40 30 37 0d"]
    wire.look(100 * MS)
    assert lines()[1:] == ["0.005000 s twin 30"]
    wire.carry(200 * MS, b"\xfd", sent=True)
    wire.carry(300 * MS, b"\xff", sent=True)
    wire.close()
    assert lines()[2:] == ["0.200000 s host fd", "0.300000 s host ff"]


def test_lines_of_bytes_are_not_endless(lines):
    wire = WireLog(None)
    wire.carry(0, bytes(2 * LINE_BYTES + 1), sent=False)
    wire.close()
    assert [len(line.split()) - 3 for line in lines()] == [LINE_BYTES, LINE_BYTES, 1]


def test_a_server_shows_both_directions(lines):
    clock = Clock()
    mouth = Mouth(b"@07\r", clock)
    Server(Twin(plant="kinematic"), Pacer(None, clock=clock), [mouth], wire=WireLog(Lines())).run()
    assert [line.split(" s ")[1] for line in lines()] == ["host @07 a command", "twin 0 a reply"]


def test_nothing_of_the_traffic_is_counted_instead_of_printed(caplog):
    caplog.set_level(logging.INFO, "isel_twin.wire")
    wire = WireLog(Lines())
    wire.carry(0, b"@0P\r" * 10, sent=True)
    assert len(caplog.records) == 10
    assert all(record.each for record in caplog.records)
