"""Everything but pseudo terminals works where there is nothing but what Windows has, too. See bare.py."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import serial

from isel_twin.base import files
from isel_twin.bridge.serve import tcp
from isel_twin.plant import native
from tests import forked
from tests.forked import PATIENCE_S

HERE = Path(__file__).parent
WAIT_S = PATIENCE_S


def bare(*arguments: str, given: str = "") -> subprocess.CompletedProcess[str]:
    return forked.run(*arguments, input=given, bare=True)


@pytest.fixture
def listening() -> Iterator[list[Any]]:
    """Processes that are to be ended."""
    started: list[Any] = []
    yield started
    for process in started:
        process.terminate()
        process.communicate(timeout=WAIT_S)


def start(started: list[Any], *arguments: str) -> dict[str, str]:
    started.append(process := forked.start(*arguments, bare=True))
    line = process.stdout.readline()
    assert line, process.communicate(timeout=WAIT_S)[1]
    info: dict[str, str] = json.loads(line)
    return info


def test_the_modules_are_hidden():
    """Else the rest of this file shows nothing."""
    code = "import bare; bare.hide(); import isel_twin.bridge.serve.pty"
    ended = subprocess.run([sys.executable, "-c", code], cwd=HERE, capture_output=True, text=True)
    assert "No module named 'fcntl'" in ended.stderr
    assert "bridge/serve/pty.py" in ended.stderr
    code = "import bare; bare.hide(); import os, select; print(hasattr(os, 'fork'), hasattr(select, 'poll'))"
    ended = subprocess.run([sys.executable, "-c", code], cwd=HERE, capture_output=True, text=True)
    assert ended.stdout == "False False\n"


def test_a_job_with_physics(tmp_path):
    job, flash = tmp_path / "job.txt", tmp_path / "imc.flash"
    job.write_text("@07\n@0R7\n@0A 1600,5000,800,5000,0,5000,0,30\n@0IW\n@0P\n")
    ended = bare("run", str(job), "--flash", str(flash), "--vcd", str(tmp_path / "job.vcd"), "--json")
    assert ended.returncode == 0, ended.stderr
    assert "000640" in ended.stdout  # 1600 steps
    assert flash.stat().st_size > 0
    assert (tmp_path / "job.vcd").stat().st_size > 0


def test_small_commands():
    assert "set the axes" in bare("decode", "@07").stdout
    assert "set the axes" in bare("decode", "-", given="@07\r").stdout
    ended = bare("ports")
    assert ended.returncode == 0, ended.stderr


def test_no_pseudo_terminals_is_one_line():
    ended = bare("serve", "--plant", "kinematic")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr == (
        "isel-twin: --pty: this system has no pseudo terminals; name --tcp HOST:PORT or --rfc2217 HOST:PORT\n"
    )


def test_a_served_machine_operated_and_tapped(listening, tmp_path):
    here = ("--tcp", "127.0.0.1:0", "--rfc2217", "127.0.0.1:0")
    file = tmp_path / "real.mcap"
    served = start(listening, "serve", "--plant", "kinematic", "--speed", "max", *here, "--control", "127.0.0.1:0")
    tapped = start(listening, "tap", f"rfc2217://{served['rfc2217']}", "--tcp", "127.0.0.1:0", "--record", str(file))
    with serial.serial_for_url(f"socket://{tapped['tcp']}", timeout=WAIT_S) as port:
        port.write(b"@07\r@0P\r")
        assert port.read(20) == b"0" * 20
    ended = bare("ctl", served["control"], "state")
    assert ended.returncode == 0, ended.stderr
    state = json.loads(ended.stdout)
    assert state["serial_format"] == "19200 8N1"
    assert [port["kind"] for port in state["ports"]] == ["tcp", "rfc2217"]
    assert bare("ctl", served["control"], "stop").returncode == 0
    assert listening[0].wait(WAIT_S) == 0
    assert file.stat().st_size > 0


def test_the_library_of_mujoco_is_found_by_its_name_on_each_system(tmp_path):
    for number, name in enumerate(("libmujoco.so.4.0.0", "libmujoco.4.0.0.dylib", "mujoco.dll")):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "_structs.cp311-win_amd64.pyd").touch()
        (folder / name).touch()
        assert native.library(folder) == folder / name
    with pytest.raises(FileNotFoundError, match=r"no library of MuJoCo here .*mujoco\*\.dll"):
        native.library(tmp_path)


def test_a_file_is_replaced_where_folders_cannot_be_opened_and_only_what_is_writable_is_flushed(monkeypatch, tmp_path):
    """As Windows does it: os.open of a folder is refused, and so is os.fsync of a descriptor that only reads."""
    real_open, real_fsync, writable = os.open, os.fsync, set()

    def open_(path, flags, *rest, **options):
        if os.path.isdir(path):
            raise PermissionError(13, "Permission denied", str(path))
        handle = real_open(path, flags, *rest, **options)
        (writable.add if flags & (os.O_RDWR | os.O_WRONLY) else writable.discard)(handle)
        return handle

    def fsync(handle):
        if handle not in writable:
            raise OSError(9, "Bad file descriptor")
        real_fsync(handle)

    monkeypatch.setattr(files, "_WINDOWS", True)
    monkeypatch.setattr(os, "open", open_)
    monkeypatch.setattr(os, "fsync", fsync)
    target = tmp_path / "imc.flash"
    for data in (b"old", b"new"):
        files.atomic_write(target, data)
        assert target.read_bytes() == data
    assert list(tmp_path.iterdir()) == [target]


def test_a_client_that_has_hung_up_is_found_out_without_poll(monkeypatch):
    monkeypatch.delattr("select.POLLRDHUP")
    one, other = socket.socketpair()
    with one, other:
        one.setblocking(False)
        assert not tcp._hung_up(one)
        other.sendall(b"x")
        assert not tcp._hung_up(one)
        assert one.recv(1) == b"x"
        other.close()
        assert tcp._hung_up(one)
