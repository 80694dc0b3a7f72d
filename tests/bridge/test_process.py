"""`serve` as a process: signals while it ends, closed streams, files that cannot be."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from isel_twin.bridge.serve.tcp import parse_address
from tests.bridge.conftest import REPLY_S, STOP_S
from tests.in_process import isel_twin

SERVE = (sys.executable, "-m", "isel_twin", "serve", "--plant", "kinematic", "--speed", "max", "--tcp", "0")
SIGNALLED = """
import os, signal, sys
from isel_twin.cli.interruption import until_told
with until_told():
    if sys.argv[1] == "begun":
        os.kill(os.getpid(), signal.SIGTERM)
for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
    os.kill(os.getpid(), number)
"""


@pytest.mark.parametrize("when", ["begun", "over"])
def test_signals_while_it_ends_leave_exit_code_0(when: str) -> None:
    """Nobody who stops a server twice is told that it was killed: after the last handler of ours, none acts."""
    assert subprocess.run([sys.executable, "-c", SIGNALLED, when], timeout=REPLY_S).returncode == 0


def test_a_served_twin_is_stopped_thrice() -> None:
    with subprocess.Popen(SERVE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        while process.poll() is None:  # as many as find it alive, at every point of its end
            process.send_signal(signal.SIGTERM)
    assert process.returncode == 0


def test_it_serves_with_standard_error_closed() -> None:
    """No file that it opens gets the number of standard error: what libraries say would go into it."""
    with subprocess.Popen(SERVE, stdout=subprocess.PIPE, text=True, preexec_fn=lambda: os.close(2)) as process:
        assert process.stdout is not None
        told = process.stdout.readline()
        where = parse_address(json.loads(told or "{}").get("tcp", "0"))
        with socket.create_connection(where, REPLY_S) as line:
            line.sendall(b"@07\r")
            assert line.recv(1) == b"0"
        assert os.readlink(f"/proc/{process.pid}/fd/2") == os.devnull
        process.terminate()
        assert process.wait(STOP_S) == 0


def test_it_ends_with_the_program_that_has_started_it(tmp_path: Path) -> None:
    """However that ends, its end of the pipe is closed; the recording is whole. What comes by the pipe is dropped."""
    call = (*SERVE, "--end-with-stdin", "--record", str(tmp_path / "session.mcap"))
    with subprocess.Popen(call, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"@07\r")
        process.stdin.flush()
        assert process.stdout.readline()
        assert process.poll() is None
        process.stdin.close()
        assert process.wait(STOP_S) == 0
    assert isel_twin("export", tmp_path / "session.mcap", tmp_path / "session.npz").returncode == 0


def test_it_cannot_end_with_what_does_not_end() -> None:
    done = subprocess.run(
        (*SERVE, "--end-with-stdin"), stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "isel-twin: standard input is no pipe: start it by a program that holds one\n"


def test_a_flash_file_that_is_links_in_a_circle(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.symlink_to(other)
    other.symlink_to(one)
    done = isel_twin("serve", "--plant", "kinematic", "--tcp", "0", "--flash", one)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"isel-twin: {one}: Too many levels of symbolic links\n"
