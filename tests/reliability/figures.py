"""What a measurement gives: figures with their limits, and the parts every measuring program needs.

A program is a module of this folder with `measure(number) -> list[Figure]` and a number of its own by default:

    python -m tests.reliability.queries          # as in docs/reliability.md
    python -m tests.reliability.queries 1000     # in a minute
    python -m tests.reliability                  # all of them: `make reliability`

Exit code 1 if a figure is beyond its limit.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import serial

__all__ = ["Figure", "Process", "ask", "growth_mb", "main", "resident_mb", "serving", "table"]

START_S = 300.0
"""Longest wait for a server to listen; the first one may have to compile."""

REPLY_S = 60.0
"""Longest wait for a reply; a healthy twin needs a small part of it."""


@dataclass(frozen=True)
class Figure:
    """A measured value; `limit`: what it may be at most, None for a figure that stands for itself."""

    what: str
    value: float
    unit: str
    limit: float | None = None

    @property
    def holds(self) -> bool:
        return self.limit is None or self.value <= self.limit

    @property
    def row(self) -> str:
        """A row of the table in docs/reliability.md."""
        limit = "" if self.limit is None else f"{self.limit:g} {self.unit}"
        return f"| {self.what} | {self.value:.4g} {self.unit} | {limit} | {'' if self.holds else 'NO'} |"


def table(figures: Sequence[Figure]) -> str:
    return "\n".join(["| figure | measured | at most | |", "|---|---|---|---|", *(figure.row for figure in figures)])


def main(measure: Callable[[int], list[Figure]], number: int) -> None:
    """The command line of a program: an optional number; prints the figures and exits."""
    figures = measure(int(sys.argv[1]) if len(sys.argv) > 1 else number)
    print(table(figures))
    sys.exit(not all(figure.holds for figure in figures))


@dataclass
class Process:
    """A running `isel-twin serve`; nobody reads its standard error until it has ended."""

    process: subprocess.Popen[str]
    info: dict[str, Any]

    @property
    def pid(self) -> int:
        return self.process.pid

    def open(self, kind: str) -> serial.Serial:
        """A host's port to one of its endpoints."""
        address = self.info[kind]
        url = {"pty": address, "tcp": f"socket://{address}", "rfc2217": f"rfc2217://{address}"}[kind]
        return serial.serial_for_url(url, baudrate=19_200, timeout=REPLY_S)


def start(*words: str) -> subprocess.Popen[str]:
    """`isel-twin words...` with text in pipes."""
    command = [sys.executable, "-m", "isel_twin", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@contextmanager
def serving(*options: str, speed: str = "max", plant: str = "kinematic") -> Iterator[Process]:
    """A server that listens while the block lasts."""
    process = start("serve", "--plant", plant, "--speed", speed, *options)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        if not line:
            raise RuntimeError(f"serve did not listen: {process.communicate(timeout=START_S)[1]}")
        yield Process(process, json.loads(line))
    finally:
        process.kill()
        process.communicate()


def ask(port: serial.Serial, command: str, size: int = 1) -> str:
    """Send a command with CR, read a reply of `size` bytes. Raises RuntimeError if it does not come."""
    port.write(command.encode("latin-1") + b"\r")
    reply = port.read(size)
    if len(reply) < size:
        raise RuntimeError(f"{command}: {reply!r} where {size} bytes were expected")
    return reply.decode("latin-1")


def resident_mb(pid: int) -> float:
    """Memory of a process in MB (Linux)."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def growth_mb(pid: int, work: Callable[[], object]) -> float:
    """How many MB a process has grown while `work` was done."""
    before = resident_mb(pid)
    work()
    return max(0.0, resident_mb(pid) - before)


def wall_ms() -> float:
    """Wall time in ms."""
    return time.perf_counter() * 1e3
