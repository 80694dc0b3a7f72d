"""What docs/hosts.md tells a stranger to do works."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
import serial

from isel_twin import Twin
from isel_twin.bridge.serve.tcp import TcpEndpoint, parse_address
from isel_twin.bridge.virtual.virtual_host import run_host
from isel_twin.cli import main
from tests.bridge.conftest import REPLY_S, ask, until

PAGE = (Path(__file__).parents[2] / "docs" / "hosts.md").read_text()


def block(first: str) -> str:
    """The indented block of the page that begins with a line that begins so."""
    found = re.search(rf"^    {re.escape(first)}.*\n(?:(?:    .*)?\n)*", PAGE, re.MULTILINE)
    assert found is not None, first
    return textwrap.dedent(found[0])


def test_a_session_from_a_shell_with_nothing_but_python(serving):
    found = re.search(r"python3 -c '\n(.*?)'\n", PAGE, re.DOTALL)
    assert found is not None
    endpoint = TcpEndpoint("127.0.0.1:0")
    serving(endpoint)
    code = "\n".join(line.strip() for line in found[1].splitlines())
    code = code.replace("4000", str(parse_address(endpoint.address)[1]))
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(code, {})
    assert printed.getvalue() == f"{b'00' + b'0' * 19!r}\n"


def test_a_machine_whose_z_counts_negative_downwards():
    found = re.search(r"printf '(@0ID4.*?)' \| isel-twin run", PAGE)
    assert found is not None
    twin = Twin(plant="kinematic")
    for command in found[1].split(r"\n"):
        if command:
            assert twin.query(command) == "0"
    host = Twin(plant="kinematic", flash=twin.flash)
    assert [host.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    top_mm = host.machine_position_mm[2]
    assert top_mm < 5.0
    move = "@0A0,900,0,900,-3200,5000,0,900"
    assert move in PAGE
    assert host.query(move) == "0"
    assert host.machine_position_mm[2] == pytest.approx(top_mm + 10.0, abs=0.02)
    assert host.query("@0A0,900,0,900,6400,5000,0,900") == "2"  # the upper switch
    assert [host.query(command) for command in ("@07", "@0N7", move)] == ["0", "0", "0"]  # and off it again, downwards


def test_the_sample_job(tmp_path, capsys):
    job = tmp_path / "job.txt"
    job.write_text(re.search(r"( {4}# set up.*?)\n\n", PAGE, re.DOTALL)[1])
    with pytest.raises(SystemExit) as caught:
        main(["run", str(job), "--json", "--plant", "kinematic"])
    *lines, summary = map(json.loads, capsys.readouterr().out.splitlines())
    assert (caught.value.code, [line["reply"] for line in lines]) == (0, ["0", "0", "F0"])
    assert summary["counts"][0] == 16000
    named = set(re.findall(r"`(\w+)`", PAGE))
    told = {"machine", "controller", "plant", "seed", "interrupted"}  # "and what was called"
    assert set(summary) - told - {"summary", "ok"} <= named


def test_modem_lines_of_a_pseudo_terminal_are_refused_as_the_page_says(serve):
    with serve().open() as port:
        for ask in (lambda: port.cts, lambda: port.dsr, lambda: setattr(port, "dtr", True)):
            with pytest.raises(OSError, match="Inappropriate ioctl"):
                ask()
        port.break_condition = True


# Recipes


def test_four_values_and_a_move_before_a_reference_run(tmp_path):
    commands = ("@07", "@0d2000,2000,2000,0", "@0A300,900,0,900,0,900,0,900")
    strict = Twin(plant="kinematic")
    assert [strict.query(command) for command in commands] == ["0", "7", "R"]
    (tmp_path / "machine.toml").write_text(block('based_on = "4030"'))
    told = Twin(tmp_path, plant="kinematic")
    assert [told.query(command) for command in commands] == ["0", "0", "0"]
    of_old = Twin(controller="c142", plant="kinematic")
    assert [of_old.query(command) for command in commands] == ["0", "0", "0"]


def test_one_axis_first(tmp_path, capsys):
    job = tmp_path / "job.txt"
    job.write_text(block("@01"))
    with pytest.raises(SystemExit) as caught:
        main(["run", str(job), "--json", "--plant", "kinematic"])
    *lines, summary = map(json.loads, capsys.readouterr().out.splitlines())
    assert (caught.value.code, summary["unmet"]) == (0, [])
    assert [line["reply"] for line in lines] == ["0", "0", "0", "3", "7", "0", "0", f"0{3200:06X}{0:012X}"]


def test_a_host_at_9600_baud(serve, tmp_path):
    found = re.search(r"printf '(@0IC1.*?)' \| isel-twin run", PAGE)
    assert found is not None
    twin = Twin(plant="kinematic")
    assert [twin.query(command) for command in found[1].split(r"\n") if command] == ["0", "0"]
    flash = tmp_path / "slow.flash"
    flash.write_bytes(twin.flash)
    served = serve("--flash", str(flash), "--strict-baud")
    with serial.Serial(served.info["pty"], 9600, timeout=REPLY_S) as port:
        assert ask(port, "@0P", 19) == "0" * 19


@pytest.mark.skipif(sys.platform != "linux" or not shutil.which("cc"), reason="the library is for Linux, and compiled")
def test_a_host_that_wants_modem_lines(serve, tmp_path):
    library, commands = block("/* modem_lines.c */").split("\n\ncc ")
    (tmp_path / "modem_lines.c").write_text(library + "\n")
    subprocess.run(["cc", *commands.splitlines()[0].split()], cwd=tmp_path, check=True)
    host = (
        "import serial, sys\n"
        f"port = serial.Serial(sys.argv[1], 19200, timeout={REPLY_S})\n"
        "port.dtr = port.rts = True\n"
        "assert port.dsr and port.cd\n"
        "port.write(b'@07\\r')\n"
        "print(port.read().decode())"
    )
    command = [sys.executable, "-c", host, serve().info["pty"]]
    loaded = os.environ | {"LD_PRELOAD": str(tmp_path / "modem_lines.so")}
    done = subprocess.run(command, env=loaded, capture_output=True, text=True, timeout=REPLY_S, check=False)
    assert (done.returncode, done.stdout) == (0, "0\n"), done.stderr
    bare = subprocess.run(command, capture_output=True, text=True, timeout=REPLY_S, check=False)
    assert "Inappropriate ioctl" in bare.stderr


AS_PYVISA_PY = """
import serial
port = serial.serial_for_url("{name}", timeout=60, write_timeout=60)
port.baudrate = 19200
port.write(b"@07\\r")
assert port.read(1) == b"0"
"""
"""What pyvisa-py 0.8 does with a resource name: the part between ASRL and ::INSTR goes to pySerial, settings follow."""


def test_a_name_of_pyvisa(serve, tmp_path):
    found = re.search(r'"ASRL(\S+)::INSTR", baud_rate=19200', PAGE)
    assert found is not None
    exec(AS_PYVISA_PY.format(name=serve().info["pty"]), {})
    host = tmp_path / "host.py"
    host.write_text(AS_PYVISA_PY.format(name=found[1]))
    done = run_host(Twin(plant="kinematic", line_speed=True), ["python", str(host)], found[1])
    assert (done.code, done.notes) == (0, ())


def test_a_host_that_waits_two_seconds(tmp_path):
    host = tmp_path / "host.py"
    host.write_text(
        "import serial\nport = serial.Serial('COM4', 19200, timeout=2)\n"
        "port.write(b'@07\\r')\nassert port.read() == b'0'\n"
        "port.write(b'@0R7\\r')\nassert port.read() == b''"
    )
    assert run_host(Twin(plant="kinematic", line_speed=True), ["python", str(host)], "COM4").code == 0
    found = re.search(r"--plant kinematic --speed (\d+) --pty", PAGE)
    assert found is not None
    far = Twin(plant="kinematic", start_mm=(394.0, 299.0, 139.0))
    assert [far.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    assert 60.0 < far.time_ns / 1e9 < 2.0 * int(found[1])


def test_a_host_that_waits_for_the_link(serve, tmp_path):
    assert "until [ -e /tmp/imc ]" in PAGE
    link = tmp_path / "imc"
    waiting = subprocess.Popen(["sh", "-c", f"until [ -e {link} ]; do sleep 0.1; done"])
    serve("--pty", str(link))
    until(lambda: waiting.poll() == 0)
    with serial.Serial(str(link), 19_200, timeout=REPLY_S) as port:
        assert ask(port, "@07") == "0"
