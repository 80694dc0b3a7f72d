"""A log that nobody reads stops nothing, and a message that comes again and again is counted."""

from __future__ import annotations

import io
import logging
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from isel_twin.bridge.serve.log import QUEUE_LINES, SHOWN, PatientHandler, log_to
from isel_twin.bridge.serve.tcp import TcpEndpoint, parse_address
from tests.bridge.conftest import REPLY_S, until
from tests.forked import PATIENCE_S

log = logging.getLogger("tests.log")
CONNECTED = "client %d connected"


class Reader:
    """The other end of a pipe."""

    def __init__(self, file: int) -> None:
        self.file = file
        self.data = b""

    def read(self) -> None:
        """Read until the writing end is closed."""
        while piece := os.read(self.file, 65_536):
            self.data += piece

    def lines(self) -> list[str]:
        """Everything until the writing end is closed."""
        self.read()
        return self.data.decode().splitlines()


@contextmanager
def logging_to(handler: PatientHandler) -> Iterator[None]:
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        handler.close()


@pytest.fixture
def pipe() -> Iterator[tuple[int, Reader]]:
    reading, writing = os.pipe()
    try:
        yield writing, Reader(reading)
    finally:
        for file in (reading, writing):
            with suppress(OSError):  # closed by the test
                os.close(file)


def test_a_log_that_nobody_reads_stops_nothing(pipe):
    """Far more than a pipe and the queue hold; then somebody reads after all and is told how much is missing."""
    writing, reader = pipe
    with logging_to(PatientHandler(writing, count=False)):
        for _ in range(10 * QUEUE_LINES):
            log.info("x" * 200)
        thread = threading.Thread(target=reader.read)
        thread.start()
        until(lambda: log.info("still there") or b"are lost" in reader.data)
    os.close(writing)
    thread.join(PATIENCE_S)
    lines = reader.data.decode().splitlines()
    assert any("lines of this log are lost" in line for line in lines)
    assert lines.count("x" * 200) >= QUEUE_LINES


def test_a_handler_that_nobody_reads_is_closed_all_the_same(pipe):
    writing, _ = pipe
    handler = PatientHandler(writing, count=False)
    with logging_to(handler):
        for _ in range(QUEUE_LINES):
            log.info("x" * 200)
    # logging_to has closed it, and we are here


def test_a_log_whose_reader_has_gone_stops_nothing(pipe):
    writing, reader = pipe
    os.close(reader.file)
    with logging_to(PatientHandler(writing)):
        for number in range(1000):
            log.info("line %d", number)
            log.warning(CONNECTED, number)


def test_repeats_are_counted_not_printed(pipe):
    writing, reader = pipe
    with logging_to(PatientHandler(writing)):
        for number in range(SHOWN + 17):
            log.info(CONNECTED, number)
        log.info("something else")
    os.close(writing)
    lines = reader.lines()
    assert lines[:SHOWN] == [CONNECTED % number for number in range(SHOWN)]
    assert lines[SHOWN] == "something else"
    assert lines[SHOWN + 1 :] == [f"client {SHOWN + 16} connected (17 times more in the last minute)"]


def test_the_count_is_told_when_the_time_is_over_and_the_next_one_is_printed_again(pipe):
    writing, reader = pipe
    thread = threading.Thread(target=reader.read)
    thread.start()
    with logging_to(PatientHandler(writing, period_s=2.0)):
        for number in range(SHOWN + 2):
            log.info(CONNECTED, number)
        until(lambda: b"more in the last minute" in reader.data)
        log.info(CONNECTED, 99)
    os.close(writing)
    thread.join(REPLY_S)
    assert reader.data.decode().splitlines()[SHOWN:] == [
        f"client {SHOWN + 1} connected (2 times more in the last minute)",
        "client 99 connected",
    ]


def test_what_is_to_be_seen_each_time_is_printed_each_time(pipe):
    writing, reader = pipe
    with logging_to(PatientHandler(writing)):
        for number in range(100):
            log.info("message %d", number, extra={"each": True})
    os.close(writing)
    assert reader.lines() == [f"message {number}" for number in range(100)]


def test_clients_come_and_go_while_nobody_reads_the_log(serving, pipe):
    """Two lines of some 50 bytes each for 1500 clients: twice what a pipe holds."""
    writing, _ = pipe
    endpoint = TcpEndpoint("127.0.0.1:0")
    with log_to(writing, count=False):
        serving(endpoint)
        for _ in range(1500):
            with socket.create_connection(parse_address(endpoint.address), timeout=REPLY_S) as client:
                client.sendall(b"@07\r")
                assert client.recv(1) == b"0"


def test_a_stream_in_memory_will_do():
    stream = io.StringIO()
    with log_to(stream):
        logging.getLogger("isel_twin").info("said")
    assert stream.getvalue() == "isel-twin: said\n"


def test_a_process_ends_while_its_log_waits_for_a_reader():
    """Its standard error is a pipe that is full: it still comes to its end, and without a complaint."""
    code = (
        "import logging, sys\n"
        "from isel_twin.bridge.serve.log import log_to\n"
        "with log_to(2, count=False):\n"
        "    for _ in range(3000):\n"
        "        logging.getLogger('isel_twin').info('x' * 200)\n"
        "    print('done', flush=True)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "done\n"
    assert process.wait(PATIENCE_S) == 0
    process.communicate()
