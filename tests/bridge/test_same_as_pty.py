"""Host programs run unmodified by `exec` and against a pseudo terminal at speed 1 say, hear and move the same.

A wall clock shifts times between commands; so what must be equal are the bytes both ways, what the host prints, the
counters, and the step stream within each stretch of motion, to the nanosecond.
"""

from __future__ import annotations

import json
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.forked import PATIENCE_S, run, start
from tests.near import near_switches

HOSTS = Path(__file__).parents[1] / "hosts"
PROGRAMS = [["polling.py"], ["reader.py"], ["timer.py"]]
REST_NS = 10_000_000
"""A gap in the step stream that is longer ends a stretch: the shortest command that moves is 14 ms on the line."""


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return near_switches(tmp_path_factory.mktemp("near"), 2.0)


def traffic(log: str) -> list[tuple[str, str]]:
    """Direction and text of each message in a wire log."""
    rows = [line.removeprefix("isel-twin:").split() for line in log.splitlines() if line.startswith("isel-twin:")]
    return [(row[2], row[3]) for row in rows if len(row) > 3 and row[1] == "s" and row[2] in ("host", "twin")]


def stretches(path: Path) -> list[tuple[NDArray[np.int64], NDArray[Any]]]:
    """Times since the first step and directions, stretch by stretch of motion."""
    with np.load(path) as stream:
        t_ns, delta = stream["t_ns"], stream["delta"]
    cuts = np.flatnonzero(np.diff(t_ns) > REST_NS) + 1
    return [(t - t[0], d) for t, d in zip(np.split(t_ns, cuts), np.split(delta, cuts), strict=True)]


def by_pty(programs: list[list[str]], machine: Path, folder: Path) -> list[tuple[str, str, Path]]:
    """Output, wire log and steps of each program, all side by side, each at a pseudo terminal of its own at speed 1."""
    served, hosts = [], []
    for number, program in enumerate(programs):
        steps = folder / f"{number}.npz"
        options = ["--pty", "--speed", "1", "--plant", "kinematic", "--machine", machine, "--log", "wire"]
        log = (folder / f"{number}.log").open("w")
        server = start("serve", *options, "--record", steps, stderr=log)
        served.append((server, steps, folder / f"{number}.log"))
        assert server.stdout is not None
        assert select.select([server.stdout], [], [], PATIENCE_S)[0]
        port = json.loads(server.stdout.readline())["pty"]
        words = [sys.executable, str(HOSTS / program[0]), port, *program[1:]]
        hosts.append(subprocess.Popen(words, stdout=subprocess.PIPE, text=True))
    outputs = [host.communicate(timeout=PATIENCE_S)[0] for host in hosts]
    time.sleep(0.5)
    for server, *_ in served:
        server.send_signal(signal.SIGINT)
        server.communicate(timeout=PATIENCE_S)
    return [(out, log.read_text(), steps) for out, (_, steps, log) in zip(outputs, served, strict=True)]


def by_exec(program: list[str], machine: Path, steps: Path) -> subprocess.CompletedProcess[str]:
    options = ["--plant", "kinematic", "--machine", machine, "--log", "wire", "--steps", steps, "--check"]
    return run("exec", *options, "--", "python", HOSTS / program[0], "COM4", *program[1:])


@pytest.fixture(scope="module")
def at_ptys(machine: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, str, Path]]:
    done = by_pty(PROGRAMS, machine, tmp_path_factory.mktemp("pty"))
    return {program[0]: seen for program, seen in zip(PROGRAMS, done, strict=True)}


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program[0])
def test_the_same_bits_as_at_a_pseudo_terminal(program, machine, at_ptys, tmp_path):
    out, log, steps = at_ptys[program[0]]
    done = by_exec(program, machine, tmp_path / "steps.npz")
    assert done.returncode == 0, done.stderr
    assert done.stdout == out
    assert traffic(done.stderr) == traffic(log)
    assert len(traffic(log)) >= 8
    mine, theirs = stretches(tmp_path / "steps.npz"), stretches(steps)
    assert len(mine) == len(theirs)
    for (my_t, my_delta), (t, delta) in zip(mine, theirs, strict=True):
        assert np.array_equal(my_delta, delta)
        assert np.array_equal(my_t, t)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program[0])
def test_twice_the_same_bits(program, machine, tmp_path):
    first, second = (by_exec(program, machine, tmp_path / f"{number}.npz") for number in range(2))
    assert first.returncode == 0, first.stderr
    assert first.stdout == second.stdout
    wire = [[line for line in done.stderr.splitlines() if " s  " in line] for done in (first, second)]
    assert wire[0] == wire[1]
    assert len(wire[0]) >= 8
    assert (tmp_path / "0.npz").read_bytes() == (tmp_path / "1.npz").read_bytes()
