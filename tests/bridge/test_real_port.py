"""The threads of a real controller's port: who waits is woken, and what blocks is cancelled."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from queue import SimpleQueue
from typing import Any

import pytest

from isel_twin.bridge.tap import real_port
from isel_twin.bridge.tap.real_port import HELD_BYTES, PIECE_BYTES, RealPort
from tests.bridge.conftest import REPLY_S, until


class Wire:
    """A port that blocks until it is told: what comes is put into `comes`; nothing goes out before `room` is set."""

    def __init__(self) -> None:
        self.comes: SimpleQueue[bytes | OSError] = SimpleQueue()
        self.room, self.writing = threading.Event(), threading.Event()
        self.done: list[str] = []
        self.cancels = True

    def read(self) -> bytes:
        data = self.comes.get(timeout=REPLY_S)
        if isinstance(data, OSError):
            raise data
        return data

    def write(self, data: bytes) -> None:
        self.writing.set()
        assert self.room.wait(REPLY_S)
        self.done.append("written")

    def set(self, settings: Mapping[str, Any]) -> None:
        self.done.append("set")

    def cancel(self) -> None:
        self.done.append("cancelled")
        if self.cancels:
            self.room.set()
        self.comes.put(b"")

    def close(self) -> None:
        self.done.append("closed")


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    """What every port that is opened is; who waits for a while waits for longer than a test."""
    wire = Wire()
    monkeypatch.setattr(real_port, "open_port", lambda address, settings: wire)
    monkeypatch.setattr(real_port, "LOOK_S", 10 * REPLY_S)
    monkeypatch.setattr(real_port, "RETRY_S", REPLY_S)
    return wire


@pytest.fixture
def woken() -> threading.Event:
    return threading.Event()


@pytest.fixture
def port(wire: Wire, woken: threading.Event) -> Iterator[RealPort]:
    """It is closed, and its threads end, though they wait."""
    port = RealPort("COM9", {}, woken.set)
    yield port
    wire.room.set()
    closing = threading.Thread(target=port.close, daemon=True)
    closing.start()
    closing.join(REPLY_S / 2)
    assert not closing.is_alive()
    assert not any(thread.is_alive() for thread in port._threads)


def test_a_read_that_blocks_is_cancelled_and_then_the_port_closed(wire: Wire, port: RealPort) -> None:
    port.close()
    assert wire.done == ["cancelled", "closed"]
    assert not any(thread.is_alive() for thread in port._threads)


def test_what_was_put_is_written_before_the_port_is_closed(wire: Wire, port: RealPort) -> None:
    port.put(b"last")
    assert wire.writing.wait(REPLY_S)
    closing = threading.Thread(target=port.close)
    closing.start()
    wire.room.set()
    closing.join(REPLY_S / 2)
    assert not closing.is_alive(), "who closes is told that it is written"
    assert wire.done == ["written", "cancelled", "closed"]


def test_a_reader_that_holds_too_much_goes_on_when_something_is_taken(
    wire: Wire, port: RealPort, woken: threading.Event
) -> None:
    for _ in range(HELD_BYTES // PIECE_BYTES):
        wire.comes.put(bytes(PIECE_BYTES))
    wire.comes.put(b"more")
    until(lambda: port.held == HELD_BYTES)
    woken.clear()
    assert sum(len(piece.data) for piece in port.take(HELD_BYTES)) == HELD_BYTES
    assert woken.wait(REPLY_S / 2)
    assert [piece.data for piece in port.take(4)] == [b"more"]


def test_who_has_been_told_that_it_is_full_is_told_when_there_is_room(
    wire: Wire, port: RealPort, woken: threading.Event
) -> None:
    port.put(bytes(HELD_BYTES))
    assert port.full
    assert not woken.is_set()
    wire.room.set()
    assert woken.wait(REPLY_S / 2)
    assert not port.full


def test_a_port_that_goes_is_closed_after_the_write_that_blocks_is_cancelled(
    wire: Wire, port: RealPort, woken: threading.Event
) -> None:
    port.put(b"lost")
    assert wire.writing.wait(REPLY_S)
    wire.comes.put(OSError(5, "Input/output error"))
    assert woken.wait(REPLY_S / 2)
    assert wire.done == ["cancelled", "written", "closed"]
    (piece,) = port.take(1)
    assert (piece.data, piece.note) == (b"", "has gone: Input/output error")


def test_who_closes_does_not_wait_for_a_port_that_has_gone(wire: Wire, port: RealPort) -> None:
    """Not every adapter can cancel a write."""
    wire.cancels = False
    port.put(b"lost")
    assert wire.writing.wait(REPLY_S)
    closing = threading.Thread(target=port.close)
    closing.start()
    wire.comes.put(OSError(5, "Input/output error"))
    until(lambda: port._ending)
    assert "written" not in wire.done
    wire.room.set()
    closing.join(REPLY_S)
    assert not closing.is_alive()
