"""The ways in: pySerial's twin://ismif (importing isel_twin registers it), a served port, a job, a machine file."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import serial

from isel_twin import Twin
from tests.bridge.conftest import Served
from tests.forked import PATIENCE_S

JOB = """# reference, a square of 10 mm, status
$HZXY<1>
#E5,1000
L5,x800
L5,y800
L5,x-800
L5,y-800<1>
@X
@LY
"""


def session(port: serial.Serial) -> None:
    """What a host program does, on any kind of port."""
    port.write(b"@V\r")
    assert port.read_until(b"\r") == b"@V SMC-ISMIF 1.00\r"
    port.write(b"$HZXY\x01")
    assert port.read_until(b"\x02\r") == b"\r\x02\r"
    port.write(b"#E1,5000\rL1,X800,Y-8\x01")
    assert port.read_until(b"\x02\r") == b"\r\r\x02\r"
    port.write(b"@X\r@LX\r@LY\r")
    assert port.read(9 + 7 + 6) == b"@X000000\r@LX800\r@LY-8\r"


def test_pyserial_url() -> None:
    with serial.serial_for_url("twin://ismif?plant=kinematic&speed=max", timeout=3600) as port:
        session(port)


def test_status_in_mid_job_over_a_url() -> None:
    with serial.serial_for_url("twin://ismif?plant=kinematic&speed=max", timeout=3600) as port:
        port.write(b"L1,x8000\x01")
        assert port.read_until(b"\r") == b"\r"
        port.write(b"@X\r")
        assert port.read_until(b"\r") == b"@X100101\r"
        assert port.read_until(b"\r") == b"\x02\r"


def test_served_port() -> None:
    served = Served(("--controller", "ismif", "--plant", "kinematic", "--speed", "max", "--pty"))
    try:
        with served.open() as port:
            session(port)
    finally:
        code = served.stop(signal.SIGTERM)
    assert code == 0


def test_job_file(tmp_path: Path) -> None:
    """In the physics: everything accepted, nothing lost, back at the start of the square."""
    (tmp_path / "square.job").write_text(JOB, encoding="utf-8")
    command = [sys.executable, "-m", "isel_twin", "run", "--controller", "ismif", "--json", "square.job"]
    call = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    *lines, summary = [json.loads(line) for line in call.stdout.splitlines()]
    ack, done = "\r", "\r\x02\r"
    assert [line["reply"] for line in lines] == [done, ack, ack, ack, ack, done, "@X000000\r", "@LY0\r"]
    assert call.returncode == 0
    assert summary["ok"] is True


def test_frequency_error_of_a_machine(tmp_path: Path) -> None:
    """The setting stands in the machine file; 570 Hz instead of 600, so pulses every 1/570 s."""
    (tmp_path / "machine.toml").write_text(
        'based_on = "4030"\nname = "slow"\n[controller]\nfrequency_error_ppm = '
        '{ value = -50000, unit = "1", grade = "setting", source = "technical data: 5 %" }\n',
        encoding="utf-8",
    )
    twin = Twin(machine=tmp_path, controller="ismif", plant="kinematic")
    assert twin.query("#S600\rL1,x3\x01") == "\r\r\x02\r"
    assert twin.steps.t_ns.tolist() == [1754386, 3508772, 5263158]


def test_power_comes_back_with_a_reset() -> None:
    """The interface is not told of an emergency stop; only `@R` asks for power again, and the cabinet decides."""
    twin = Twin(controller="ismif", plant="kinematic")
    twin.set_input("estop", "pressed")
    assert twin.query("@R") == "\r"
    assert twin.outputs["power"] == 0
    twin.set_input("estop", "released")
    assert twin.query("@S") == "\r"
    assert twin.outputs["power"] == 0
    twin.set_input("hood", "open")
    assert twin.query("@R") == "\r"
    assert twin.outputs["power"] == 0
    twin.set_input("hood", "closed")
    assert twin.query("@R") == "\r"
    assert twin.outputs["power"] == 1
    assert twin.query("$HZXY\x01") == "\r\x02\r"
    before_mm = twin.machine_position_mm[0]
    assert twin.query("L1,X800\x01") == "\r\x02\r"
    assert abs(twin.machine_position_mm[0] - before_mm - 10.0) < 0.03
