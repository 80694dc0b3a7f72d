"""`isel-twin exec`, as a process: what is printed, which exit code, how it is stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from isel_twin.cli import main
from tests import forked
from tests.in_process import isel_twin

HOSTS = Path(__file__).parents[1] / "hosts"
MOVE = """\
import serial
with serial.Serial("COM4", 19200, timeout=90) as port:
    for command in ("@07", "@0R7", "@0A{way},{speed},0,30,0,30,0,30"):
        port.write(command.encode() + b"\\r")
        assert port.read() == b"0"
"""


STARTED: list[Any] = []
"""Of the present test."""


@pytest.fixture(autouse=True)
def none_left():
    """A host that spins does not outlive a test that has failed."""
    yield
    for process in STARTED:
        process.kill()
    STARTED.clear()


def start(*arguments: str | Path, **kwargs) -> Any:
    process = forked.start("exec", *arguments, **kwargs)
    STARTED.append(process)
    return process


def execute(*arguments: str | Path, plant: str = "kinematic", **kwargs) -> subprocess.CompletedProcess[str]:
    process = start("--plant", plant, *arguments, **kwargs)
    out, err = process.communicate(timeout=forked.PATIENCE_S)
    return subprocess.CompletedProcess([], process.returncode, out, err)


@pytest.fixture
def host(tmp_path):
    def write(text: str) -> Path:
        file = tmp_path / "host.py"
        file.write_text(text)
        return file

    return write


def test_the_verdict_follows_in_one_line(host):
    done = execute("--port", "COM4", "--", "python3", host(MOVE.format(way=3200, speed=8000)))
    assert (done.returncode, done.stdout) == (0, "")
    last = done.stderr.splitlines()[-1]  # before it there may be a word about compiling
    assert "all well as far as simulated; lost steps, margins and loads were not simulated" in last
    meanwhile = "(meanwhile: limit_x1, limit_y1, limit_z1)"
    assert f"; no end switch struck at the end {meanwhile}; at X 10.000, Y 0.000, Z 0.000 mm" in last
    plain = execute("--", "python3", host("import serial\nserial.Serial('COM4', 19200).write(b'@07\\r')\n"))
    assert "; no end switch struck; at X " in plain.stderr.splitlines()[-1]


def test_lost_steps_are_exit_1_if_asked_for(host):
    """64000 steps at 40 kHz are more than the motor can do: the host is answered 0 all the same."""
    file = host(MOVE.format(way=64000, speed=40000))
    done = execute("--json", "--", "python", file, plant="mujoco")
    summary = json.loads(done.stdout)
    assert (done.returncode, summary["code"], summary["ending"], summary["machine_ok"]) == (0, 0, "exit", False)
    assert abs(summary["lost_steps"][0]) > 32
    done = execute("--check", "--", "python", file, plant="mujoco")
    assert done.returncode == 1
    assert "the machine failed; lost steps" in done.stderr


def test_the_hosts_own_code_comes_first(host):
    assert execute("--check", "--", "python", host("import sys; sys.exit(7)")).returncode == 7


def test_its_words_reach_it_as_they_are(host):
    file = host("import sys; print(sys.argv[1:], __name__, __file__ == sys.argv[0])")
    done = execute("--", sys.executable, "-u", file, "--pty", "-", "--", "--json")
    assert done.stdout == "['--pty', '-', '--', '--json'] __main__ True\n"


def test_a_module_a_folder_and_a_text(tmp_path):
    (tmp_path / "part.py").write_text("WORD = 'part'\n")
    (tmp_path / "app").mkdir()
    (tmp_path / "app" / "__main__.py").write_text("import sys\nprint(__name__, sys.argv[1:])\n")
    (tmp_path / "app" / "__init__.py").write_text("import part\nprint(part.WORD)\n")
    assert execute("--", "python", "-m", "app", "x", cwd=tmp_path).stdout == "part\n__main__ ['x']\n"
    assert execute("--", "python", "app", "y", cwd=tmp_path).stdout == "__main__ ['y']\n"
    (tmp_path / "tool").write_text(
        "#!/usr/bin/env python3\nimport part, sys; print(sys.argv); assert __file__[0] == '/'\n"
    )
    assert execute("--", "./tool", "z", cwd=tmp_path).stdout == "['./tool', 'z']\n"
    missing = execute("--", "python", "-m", "none.such", cwd=tmp_path)
    assert missing.returncode == 1
    assert "none.such" in missing.stderr
    assert "Traceback" not in missing.stderr
    assert (
        execute("--", "python", "-c", "import sys, part; print(sys.argv)", "z", cwd=tmp_path).stdout == "['-c', 'z']\n"
    )


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "no host program"),
        (["--", "python"], "no program"),
        (["--", "python", "none.py"], "none.py: there is no such file"),
        (["--", "python", "-X", "dev"], "-X"),
        (["--", "./host", "COM4"], "isel-twin serve"),
        (["--", "java", "-jar", "host.jar"], "isel-twin serve"),
        (["--machine", "9999", "--", "python", "-c", "1"], "9999"),
        (["--set", "axes.x.nonsense=1", "--", "python", "-c", "1"], "nonsense"),
        (["--set", "nonsense", "--", "python", "-c", "1"], "--set 'nonsense'"),
        (["--seed", "-1", "--", "python", "-c", "1"], "--seed"),
        (["--timeout", "nan", "--", "python", "-c", "1"], "--timeout nan"),
        (["--", "python", "-c", "import asyncio; asyncio.SelectorEventLoop()"], "asyncio"),
        (["--", "python", "-c", "import subprocess; subprocess.run(['ls'])"], "subprocess"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_bad_call_is_one_line_and_exit_2(arguments, named, capfd):
    with pytest.raises(SystemExit) as caught:
        main(["exec", "--plant", "kinematic", *arguments])
    done = subprocess.CompletedProcess([], caught.value.code, *capfd.readouterr())
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert named in done.stderr
    assert done.stderr.startswith("isel-twin: ")


def test_a_parameter_of_the_machine(host):
    """5 mm of lead moved 10 mm with 3200 steps; 10 mm of lead move 20."""
    file = host(MOVE.format(way=3200, speed=8000))
    done = execute("--set", "axes.x.lead=10.0", "--json", "--", "python", file)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["position_mm"][0] == pytest.approx(20.0)


def test_a_recording_replays(host, tmp_path):
    record = tmp_path / "host.mcap"
    done = execute("--record", record, "--", "python", host(MOVE.format(way=3200, speed=8000)))
    assert done.returncode == 0, done.stderr
    again = isel_twin("replay", record)
    assert again.returncode == 0, again.stderr


def test_a_host_that_never_ends_is_ended(host):
    done = execute("--timeout", "100", "--", "python", host("import time\nwhile True: time.sleep(1)"))
    assert done.returncode == 1
    assert "the host has not ended within 100 s of virtual time" in done.stderr


@pytest.mark.parametrize(
    ("ending", "code", "out"),
    [
        ("", 130, "going\n"),
        ("except KeyboardInterrupt: print('stopped')", 0, "going\nstopped\n"),
        ("except KeyboardInterrupt:\n    time.sleep(5); sys.exit(9)", 9, "going\n"),
    ],
    ids=["uncaught", "caught", "caught, and time goes on"],
)
@pytest.mark.parametrize(
    ("begin", "loop"),
    [
        ("pass", "while True: time.sleep(0.5)"),
        ("pass", "while True: time.time()"),
        ("pass", "while True: len(sys.argv)"),
        ("threading.Thread(target=busy, daemon=True).start()", "threading.Event().wait()"),
    ],
    ids=["sleep", "clock", "computing", "another thread"],
)
def test_ctrl_c(begin, loop, ending, code, out, host):
    text = (
        "import sys, time, threading\ndef busy():\n    while True: time.sleep(0.01)\n"
        f"{begin}\ntry:\n    print('going', flush=True)\n    {loop}\n{ending or 'finally: pass'}\n"
    )
    process = start("--plant", "kinematic", "--", "python", host(text))
    assert process.stdout is not None
    assert process.stdout.readline() == "going\n"
    process.send_signal(signal.SIGINT)
    rest, err = process.communicate(timeout=forked.PATIENCE_S)
    assert ("going\n" + rest, process.returncode) == (out, code), err
    assert ("KeyboardInterrupt" in err) is (code == 130)


@pytest.mark.parametrize("daemon", [True, False])
def test_a_thread_that_will_not_end_does_not_hold_the_process(daemon, host):
    text = (
        "import threading, time\ndef stubborn():\n    while True:\n        try: time.sleep(1)\n        except: pass\n"
        f"threading.Thread(target=stubborn, name='stubborn', daemon={daemon}).start()\ntime.sleep(3)\n"
    )
    done = execute("--timeout", "10", "--", "python", host(text))
    assert done.returncode == (0 if daemon else 1), done.stderr
    assert "left: stubborn" in done.stderr


def test_a_main_thread_that_will_not_end_does_not_either(host):
    done = execute(
        "--timeout", "10", "--", "python", host("import time\nwhile 1:\n  try: time.sleep(1)\n  except: pass")
    )
    assert done.returncode == 1
    assert "has not ended within 10 s" in done.stderr


def test_ten_virtual_minutes_take_less_than_five_seconds(host):
    """Of the processor, whoever else wants it; the start of the interpreter and of the package among them."""
    began = os.times()
    file = host("import time, serial\np = serial.Serial('COM4')\nfor _ in range(6000): p.in_waiting; time.sleep(0.1)")
    options = ("--plant", "kinematic", "--json", "--", "python", file)
    done = forked.run("exec", *options, start=forked.start_anew)
    assert json.loads(done.stdout)["virtual_s"] == pytest.approx(600.0, abs=0.1)
    ended = os.times()
    assert ended.children_user + ended.children_system - began.children_user - began.children_system < 5.0
