"""A host program opens the pseudo terminal of a real `isel-twin serve`, as it would open the machine's serial port."""

from __future__ import annotations

import itertools
import os
import signal
from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.server import Server
from tests.bridge.conftest import REPLY_S, Served, ask

MOVED = "0003E80001F40000000"
"""`@0P` at X 16000, Y 8000, Z 0: 0 and three 24-bit hexadecimal numbers."""


def test_two_commands_in_one_write_get_two_replies_in_order(serve):
    with serve().open() as port:
        port.write(b"@07\r@0R7\r@0P\r")
        assert port.read(21) == b"00" + b"0" * 19


@pytest.mark.parametrize("end", [b"\r", b"\r\n", b"\n\r"], ids=["CR", "CR LF", "LF CR"])
def test_line_feeds_beside_the_carriage_return_do_not_matter(serve, end):
    with serve().open() as port:
        port.write(b"@07" + end + b"@0R7" + end + b"@0P" + end)
        assert port.read(21) == b"00" + b"0" * 19


def test_bytes_may_come_one_by_one(serve):
    with serve().open() as port:
        for byte in b"@07\r@0R7\r@0A 16000,5000,8000,5000,0,5000,0,30\r@0P\r":
            assert port.write(bytes([byte])) == 1
            port.flush()
        assert port.read(22).decode() == "000" + MOVED


def test_closing_and_reopening_keep_position_and_reference(serve):
    served = serve()
    with served.open() as port:
        assert [ask(port, command) for command in ("@07", "@0R7", "@0M16000,5000,8000,5000,0,5000,0,30")] == ["0"] * 3
    for _ in range(3):
        with served.open() as port:
            assert ask(port, "@0P", 19) == MOVED
    with served.open() as port:
        assert ask(port, "@0A 0,5000,0,5000,100,5000,0,30") == "0"  # no R: the reference has survived
        assert ask(port, "@0P", 19) == MOVED[:-6] + "000064"


def test_a_session_with_physics_and_a_port_opened_for_each_command():
    """The default: MuJoCo. A host as some are: open, send, read, close."""
    served = Served(("--speed", "max"))
    session = (
        ("@07", "0"),
        ("@0M16000,10000,8000,10000,0,10000,0,30", "R"),
        ("@0d5000,5000,5000", "0"),
        ("@0R7", "0"),
        ("@0P", "0" * 19),
        ("@0M16000,10000,8000,10000,0,10000,0,30", "0"),
        ("@0P", MOVED),
    )
    try:
        for command, reply in session:
            with served.open() as port:
                assert ask(port, command, len(reply)) == reply
    finally:
        assert served.stop(signal.SIGTERM) == 0
        served.process.communicate()


def test_a_new_serve_knows_no_reference(serve):
    with serve().open() as port:
        assert ask(port, "@07") == "0"
        assert ask(port, "@0A 0,5000,0,5000,100,5000,0,30") == "R"


def test_nothing_is_echoed_and_no_byte_is_a_terminal_control(serve):
    with serve().open() as port:
        assert ask(port, "@07") == "0"
        port.write(b"\x11\x13\x04\x03\x1a\x7f\r")  # XON, XOFF, EOF, INTR, SUSP, ERASE of a terminal
        assert len(port.read(1)) == 1  # the controller's complaint, whichever
        assert ask(port, "@0P", 19) == "0" * 19


def test_a_byte_sent_in_mid_move_acts_at_once(serve):
    """At real time a move of 20 s is stopped by byte 253; the pending command answers F before it is over."""
    with serve(speed="20").open() as port:
        assert ask(port, "@07") == "0"
        assert ask(port, "@0R7") == "0"
        port.write(b"@0A 100000,1000,0,30,0,30,0,30\r")
        port.write(b"\xfd")
        assert port.read(1) == b"F"
        position = ask(port, "@0P", 19)
        assert position[0] == "0"
        assert 0 <= int(position[1:7], 16) < 100_000


def test_at_real_time_bytes_take_their_time_on_the_line(serve):
    """4 bytes to and 19 bytes from the controller at 19200 baud, 8N1: not before 11.9 ms."""
    import time

    with serve(speed="1").open() as port:
        assert ask(port, "@07") == "0"
        began = time.monotonic()
        assert ask(port, "@0P", 19) == "0" * 19
        assert time.monotonic() - began >= (4 + 19) * 10 / 19_200


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_link_leads_to_the_port_and_goes_with_the_server(serve, tmp_path, number):
    link = tmp_path / "imc"
    served = serve("--pty", str(link))
    assert served.info["pty"] == str(link)
    assert os.readlink(link) == served.info["device"]
    with served.open() as port:
        assert ask(port, "@07") == "0"
    assert served.stop(number) == 0
    assert not os.path.lexists(link)


def test_a_link_left_behind_by_a_killed_server_is_replaced(serve, tmp_path):
    link = tmp_path / "imc"
    serve("--pty", str(link)).stop(signal.SIGKILL)
    assert link.is_symlink()
    served = serve("--pty", str(link))
    assert os.readlink(link) == served.info["device"]


def test_a_link_left_behind_whose_device_is_somebody_elses_by_now_is_replaced(serve, tmp_path):
    """Numbers of pseudo terminals are used again: the link of a killed server may lead to a living one."""
    link = tmp_path / "imc"
    killed = serve("--pty", str(link))
    killed.stop(signal.SIGKILL)
    others = []
    try:
        while not link.exists():  # until somebody has the number
            others.append(os.openpty())
        served = serve("--pty", str(link))
        assert os.readlink(link) == served.info["device"]
        with served.open() as port:
            assert ask(port, "@07") == "0"
    finally:
        for file in itertools.chain.from_iterable(others):
            os.close(file)


def test_a_link_that_is_in_use_is_left_alone(serve, tmp_path):
    link = tmp_path / "imc"
    served = serve("--pty", str(link))
    with pytest.raises(OSError, match=f"in use by another twin, in process {served.process.pid}"):
        PtyEndpoint(str(link))
    assert os.readlink(link) == served.info["device"]
    with served.open() as port:
        assert ask(port, "@07") == "0"


def test_a_link_of_another_program_is_left_alone(tmp_path):
    link = tmp_path / "imc"
    link.symlink_to("/dev/null")
    with pytest.raises(FileExistsError, match="exists already"):
        PtyEndpoint(str(link))
    assert os.readlink(link) == "/dev/null"
    assert os.listdir(tmp_path) == ["imc"]


def test_the_server_survives_a_host_that_leaves_in_mid_reply(serve):
    served = serve()
    with served.open() as port:
        port.write(b"@07\r" + b"@0P\r" * 100)
    with served.open() as port:
        port.timeout = REPLY_S
        port.write(b"@0P\r")
        assert port.read(19) == b"0" * 19


@pytest.mark.parametrize("options", [("--pty", "--tcp", "127.0.0.1:0"), ("--tcp=127.0.0.1:0", "--pty")])
def test_a_pty_needs_no_link_and_goes_well_with_others(serve, options):
    info = serve(*options).info
    assert Path(info["pty"]).is_char_device()
    assert info["tcp"].startswith("127.0.0.1:")
    assert "device" not in info


def test_a_pty_is_what_serve_offers_when_nothing_is_asked_for(serve):
    assert Path(serve().info["pty"]).is_char_device()


def test_a_link_comes_with_somebody_who_answers(tmp_path):
    """A host that waits for the link, as scripts do, is not left alone with it while the physics is compiled."""
    link = tmp_path / "imc"
    endpoint = PtyEndpoint(str(link))
    assert not os.path.lexists(link)
    server = Server(Twin(plant="kinematic"), Pacer(None), [endpoint])
    assert os.readlink(link) == endpoint.address
    server.stop()
    server.run()
    assert not os.path.lexists(link)
