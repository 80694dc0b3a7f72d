"""`twin://`: pySerial's interface on virtual time, in this process."""

from __future__ import annotations

import subprocess
import sys
import threading

import pytest
import serial
from serial import PortNotOpenError, SerialException

import isel_twin  # noqa: F401  (registers the scheme)
from tests.bridge.conftest import ask
from tests.forked import PATIENCE_S

URL = "twin://imc-s8?machine=4030&plant=kinematic&speed=max"
MOVE = "@0A 16000,8000,0,30,0,30,0,30"
"""A relative move of 16000 steps at 8000 Hz: at least 2 s."""


@pytest.fixture
def port():
    with serial.serial_for_url(URL, timeout=3600) as opened:
        assert ask(opened, "@07") == "0"
        assert ask(opened, "@0R7") == "0"
        yield opened


def test_the_import_of_the_package_registers_the_scheme_and_nothing_heavy():
    code = (
        "import sys, isel_twin, serial\n"
        "port = serial.serial_for_url('twin://imc-s8', do_not_open=True)\n"
        "assert type(port).__module__ == 'isel_twin.bridge.virtual.protocol_twin'\n"
        "assert not {'mujoco', 'pyarrow', 'matplotlib'} & set(sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_session(port):
    assert ask(port, MOVE) == "0"
    assert ask(port, "@0P", 19) == "0003E80000000000000"
    assert port.twin.position_mm == pytest.approx([50.0, 0.0, 0.0], abs=1e-6)


def test_time_passes_only_while_the_host_waits(port):
    before_ns = port.twin.time_ns
    port.write(MOVE.encode() + b"\r")
    assert port.twin.time_ns == before_ns
    assert port.read() == b"0"
    assert port.twin.time_ns - before_ns > 2_000_000_000


def test_a_timeout_is_virtual(port):
    port.timeout = 0.5
    before_ns = port.twin.time_ns
    port.write(MOVE.encode() + b"\r")
    assert port.read() == b""
    assert port.twin.time_ns == before_ns + 500_000_000
    port.timeout = 5
    assert port.read() == b"0"


def test_a_read_beyond_the_reply_ends_with_the_timeout(port):
    port.timeout = 2
    port.write(b"@0P\r")
    assert port.read(100) == b"0" * 19


def test_a_read_without_timeout_waits_as_long_as_the_machine_needs(port):
    port.timeout = None
    assert ask(port, MOVE) == "0"


def test_a_read_without_timeout_that_can_never_end_says_so(port):
    port.timeout = None
    port.write(b"@0P\r")
    with pytest.raises(SerialException, match="no byte can come"):
        port.read(20)
    assert port.read(19) == b"0" * 19


def test_a_read_without_timeout_ends_though_the_machine_is_never_at_rest(port, monkeypatch):
    """Something may always happen 10 ms from now; an idle controller is given up after an hour of virtual time."""
    monkeypatch.setattr(type(port.twin), "next_event_ns", property(lambda twin: twin.time_ns + 10_000_000))
    port.timeout = None
    assert ask(port, MOVE) == "0"
    before_ns = port.twin.time_ns
    with pytest.raises(SerialException, match="idle for 3600 s: no byte can come"):
        port.read()
    assert 3600 <= (port.twin.time_ns - before_ns) / 1e9 <= 3602
    port.timeout = 7200
    assert port.read() == b""  # a timeout is waited for, however long


def test_a_second_thread_is_refused_in_one_line_and_changes_nothing(port):
    """The first thread is stopped inside a read, by an observer, while the other one tries."""
    inside, tried = threading.Event(), threading.Event()
    started_ns = port.twin.time_ns

    def wait_inside(twin):
        if twin.time_ns > started_ns and not inside.is_set():
            inside.set()
            assert tried.wait(PATIENCE_S)

    port.twin.observe(wait_inside, 100_000_000)
    port.write(MOVE.encode() + b"\r")
    replies = []
    reader = threading.Thread(target=lambda: replies.append(port.read()))
    reader.start()
    assert inside.wait(PATIENCE_S)
    calls = [
        port.read,
        port.flush,
        port.reset_input_buffer,
        lambda: port.write(b"@0P\r"),
        lambda: port.in_waiting,
        lambda: port.out_waiting,
    ]
    try:
        for call in calls:
            with pytest.raises(SerialException, match=r"^another thread .*isel-twin serve`$"):
                call()
    finally:
        tried.set()
        reader.join(PATIENCE_S)
    assert replies == [b"0"]
    assert ask(port, "@0P", 19) == "0003E80000000000000"  # and afterwards this thread is welcome


def test_a_host_that_polls_sees_time_pass(port):
    port.write(MOVE.encode() + b"\r")
    polls = 0
    while port.in_waiting == 0:
        polls += 1
        assert polls < 10_000
    assert port.in_waiting == 1
    assert port.read(port.in_waiting) == b"0"
    assert polls >= 100  # more than 2 s in looks of 10 ms

    port.timeout = 0
    port.write(MOVE.encode() + b"\r")
    while not (reply := port.read(10)):
        polls += 1
        assert polls < 20_000
    assert reply == b"0"


def test_the_time_between_bytes_can_end_a_read(port):
    port.timeout, port.inter_byte_timeout = 100, 0.5
    before_ns = port.twin.time_ns
    port.write(b"@0P\r" + MOVE.encode() + b"\r")
    assert port.read(20) == b"0" * 19
    assert port.twin.time_ns == before_ns + 500_000_000


def test_a_control_byte_stops_a_move(port):
    port.write(MOVE.encode() + b"\r")
    port.timeout = 0.5
    assert port.read() == b""
    port.write(bytes([253]))
    port.timeout = 10
    assert port.read() == b"F"
    stopped_at = int(ask(port, "@0P", 19)[1:7], 16)
    assert 0 < stopped_at < 16_000
    assert ask(port, "@0S") == "0"
    assert ask(port, "@0P", 19) == "0003E80000000000000"


def test_closing_and_reopening_keep_position_and_reference(port):
    assert ask(port, MOVE) == "0"
    port.write(b"@0P\r")
    port.close()
    with pytest.raises(PortNotOpenError):
        port.read()
    port.open()
    assert port.in_waiting == 0  # what arrived before is lost
    assert ask(port, "@0P", 19) == "0003E80000000000000"
    assert ask(port, MOVE) == "0"


def test_a_reopened_port_has_its_flash_file_again(tmp_path):
    url = f"{URL}&flash={tmp_path / 'flash'}"
    with serial.serial_for_url(url) as first:
        first.close()
        first.open()
        with pytest.raises(SerialException, match="in use"):
            serial.serial_for_url(url)


def test_two_ports_are_two_machines(port):
    assert ask(port, MOVE) == "0"
    with serial.serial_for_url(URL, timeout=10) as other:
        assert ask(other, "@0P", 19) == "0" * 19


def test_input_can_be_thrown_away(port):
    port.write(b"@0P\r")
    port.timeout = 1
    assert port.read(9) == b"0" * 9
    port.reset_input_buffer()
    assert port.read() == b""


def test_pyserials_helpers_work(port):
    port.write(b"@0P\r")
    assert port.read_until(b"x", size=19) == b"0" * 19
    port.reset_output_buffer()
    port.rts = port.dtr = False
    port.break_condition = True
    assert (port.cts, port.dsr, port.ri, port.cd) == (True, True, False, True)
    port.baudrate = 9600
    assert ask(port, "@0P", 19) == "0" * 19


def test_at_a_finite_speed_bytes_take_their_time_on_the_line():
    """23 bytes of ten bits at 19200 baud are 11.98 ms of virtual time."""
    with serial.serial_for_url(URL.replace("max", "1000"), timeout=60) as port:
        assert ask(port, "@07") == "0"
        before_ns = port.twin.time_ns
        port.write(b"@0P\r")
        assert port.out_waiting <= 4
        assert port.read(19) == b"0" * 19
        assert port.twin.time_ns - before_ns >= 23 * 10 * 1_000_000_000 // 19_200
        port.write(b"@0P\r")
        port.flush()
        assert port.out_waiting == 0


def test_the_seed_decides_where_the_carriages_stand_at_power_on():
    def start(seed: int) -> list[float]:
        with serial.serial_for_url(f"{URL}&seed={seed}", timeout=10) as port:
            return list(port.twin.machine_position_mm)

    assert start(1) == start(1)
    assert start(1) != start(2)


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("twin://imc-s8?machin=4030", "unknown option 'machin'"),
        ("twin://imc-s8?speed=fast", "speed 'fast'"),
        ("twin://imc-s8?seed=one", "seed 'one': must be a whole number from 0"),
        ("twin://imc-s8?seed=1&seed=2", "given twice"),
        ("twin://imc-s8?machine=", "has no value"),
        ("twin://imc-s8?machine", "machine"),
        ("twin://imc-s8/machine", "expected twin://CONTROLLER"),
        ("twin://imc-s9", "imc-s9"),
        ("twin://?machine=9999", "9999"),
        ("twin://?plant=steam", "steam"),
        ("twin://?scenario=/nonexistent.toml", "nonexistent"),
        ("twin://?flash=/nonexistent/flash", "nonexistent"),
    ],
)
def test_bad_urls_are_refused_in_one_line(url, message):
    with pytest.raises(SerialException, match=message) as caught:
        serial.serial_for_url(url)
    assert "\n" not in str(caught.value)
