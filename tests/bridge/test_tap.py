"""A tap between a host and a twin that stands in for the real controller."""

from __future__ import annotations

import json
import logging
import os
import signal
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
import serial
from mcap.reader import NonSeekingReader

from isel_twin.bridge.serve.borders import Endpoint, WireTap
from isel_twin.bridge.serve.outbox import OUTBOX_BYTES
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.rfc2217 import Rfc2217Codec
from isel_twin.bridge.serve.server import Server
from isel_twin.bridge.serve.tcp import TcpEndpoint
from isel_twin.bridge.tap import real_port
from isel_twin.bridge.tap.tap import LOOK_S, BookWriter, Tap
from isel_twin.cli import main
from isel_twin.controller import SerialFormat
from isel_twin.core.twin import Twin
from isel_twin.language import Language, create_language
from isel_twin.recordings.judging import Limits, compare
from isel_twin.recordings.reading import read
from tests.bridge.conftest import REPLY_S, STOP_S, Served, ask, until

SESSION = (("@07", 1), ("@0R7", 1), ("@0A 1600,5000,800,5000,0,5000,0,30", 1), ("@0P", 19), ("@0Q", 1), ("@0P", 19))
BURST = bytes(range(256)) * 256
"""64 KiB with every byte there is."""


# ---- in this process -------------------------------------------------------------------------------------------------


class Notes:
    """A recording in memory, of a tap or of a server."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, str, bytes]] = []
        self.said: list[str] = []
        self.broken = False
        self.tap: Tap | None = None

    def sent(self, time_ns: int, data: bytes) -> None:
        self.rows.append((time_ns, "sent", data))

    def received(self, time_ns: int, data: bytes) -> None:
        self.rows.append((time_ns, "received", data))

    def message(self, channel: str, time_ns: int, content: Any) -> None:
        self.said.append(content["text"])

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        (self.sent if sent else self.received)(time_ns, data)

    def look(self, time_ns: int) -> None: ...
    def act(self, time_ns: int, text: str) -> None: ...
    def flush(self) -> None: ...
    def close(self) -> None: ...

    def bytes_of(self, kind: str) -> bytes:
        return b"".join(data for _, which, data in self.rows if which == kind)


def endpoint(kind: str) -> Endpoint:
    if kind == "pty":
        return PtyEndpoint()
    return TcpEndpoint("127.0.0.1:0") if kind == "tcp" else TcpEndpoint("127.0.0.1:0", "rfc2217", Rfc2217Codec)


def url(end: Endpoint) -> str:
    """What a tap calls it."""
    return end.address if end.kind == "pty" else f"{end.kind}://{end.address}"


@contextmanager
def running(loop: Server | Tap) -> Iterator[None]:
    thread = threading.Thread(target=loop.run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        loop.stop()
        thread.join(STOP_S)
        assert not thread.is_alive()


@contextmanager
def tapping(device: str, *ends: Endpoint, language: Language | None = None) -> Iterator[Notes]:
    """A tap that runs, and what it writes down."""
    notes = Notes()
    tap = Tap(device, ends, SerialFormat(19_200), language=language)
    tap.writer = BookWriter(notes)
    notes.tap = tap
    with running(tap):
        yield notes
    assert tap.writer.close()


@contextmanager
def twin_at(end: Endpoint, speed: float | None = None) -> Iterator[Notes]:
    """A served twin, and what it sees."""
    notes = Notes()
    server = Server(Twin(plant="kinematic", line_speed=speed is not None), Pacer(speed), [end], wire=notes)
    with running(server):
        yield notes


def opened(end: Endpoint, **settings: Any) -> serial.Serial:
    """A host's port."""
    where = {"pty": end.address, "tcp": f"socket://{end.address}", "rfc2217": f"rfc2217://{end.address}"}[end.kind]
    return serial.serial_for_url(where, **{"baudrate": 19_200, "timeout": REPLY_S, **settings})


def talk(port: serial.Serial) -> bytes:
    """The session; what was answered."""
    return "".join(ask(port, command, size) for command, size in SESSION).encode()


SENT = b"".join(command.encode() + b"\r" for command, _ in SESSION)


@pytest.mark.parametrize(
    ("host", "real"), [("pty", "pty"), ("tcp", "pty"), ("pty", "tcp"), ("rfc2217", "rfc2217"), ("tcp", "tcp")]
)
def test_what_passes_is_what_the_controller_sees_and_what_is_written_down(host, real):
    there, here = endpoint(real), endpoint(host)
    with twin_at(there) as seen, tapping(url(there), here) as notes, opened(here) as port:
        came = talk(port)
        assert came.startswith(b"000")
        assert len(came) == sum(size for _, size in SESSION)
    assert notes.bytes_of("sent") == seen.bytes_of("sent") == SENT
    assert notes.bytes_of("received") == seen.bytes_of("received") == came


def test_times_go_on_and_are_those_of_the_clock_on_both_sides():
    """As `python -m tests.reliability.tap` measures to the millisecond; here on a computer that may be busy."""
    began_ns = time.perf_counter_ns()
    there, here = endpoint("pty"), endpoint("pty")
    with twin_at(there, 1.0) as seen, tapping(there.address, here) as notes, opened(here) as port:
        for _ in range(3):
            assert ask(port, "@0P", 19) == "0" * 19
            time.sleep(0.3)
    times = [time_ns for time_ns, _, _ in notes.rows]
    assert times == sorted(times)
    lasted_ns = time.perf_counter_ns() - began_ns
    assert 0.6e9 < times[-1] - times[0] < lasted_ns
    assert 0 < seen.rows[-1][0] - seen.rows[0][0] < lasted_ns  # a twin that is too slow gives up some of its time


def test_the_controllers_port_is_set_as_the_host_sets_its_own():
    """The controller's side is a device whose settings can be read: a pseudo terminal keeps speed and stop bits."""
    there, here = endpoint("pty"), endpoint("pty")
    with twin_at(there) as seen, tapping(there.address, here) as notes:
        assert there.settings["baudrate"] == 19_200
        with opened(here, baudrate=9600, stopbits=2) as port:
            assert ask(port, "@07") == "0"
            assert there.settings == {"baudrate": 9600, "stopbits": 2}
        with opened(here, baudrate=31_250) as port:  # no speed that has a name
            assert ask(port, "@07") == "0"
            assert there.settings == {"baudrate": 31_250, "stopbits": 1}
    assert seen.bytes_of("sent") == b"@07\r@07\r"
    assert notes.said == ["host sets baudrate 9600, stopbits 2", "host sets baudrate 31250, stopbits 1"]


def test_settings_pass_from_rfc_2217_to_rfc_2217():
    there, here = endpoint("rfc2217"), endpoint("rfc2217")
    with twin_at(there), tapping(url(there), here), opened(here, baudrate=9600) as port:
        assert ask(port, "@07") == "0"
        assert there.settings["baudrate"] == 9600
        port.parity, port.bytesize = "E", 7
        assert ask(port, "@07") == "0"
        assert {name: there.settings[name] for name in ("baudrate", "bytesize", "parity")} == {
            "baudrate": 9600,
            "bytesize": 7,
            "parity": "E",
        }


def test_a_host_leaves_and_comes_back_and_a_second_one_is_turned_away():
    there, here = endpoint("pty"), endpoint("tcp")
    with twin_at(there), tapping(there.address, here) as notes:
        with opened(here) as port:
            assert ask(port, "@07") == "0"
            host, _, number = here.address.rpartition(":")
            with socket.create_connection((host, int(number)), REPLY_S) as second, second.makefile("rb") as told:
                assert told.read() == f"isel-twin: port {here.address} is in use by another client\r\n".encode()
            assert ask(port, "@0P", 19) == "0" * 19
        with opened(here) as port:
            assert ask(port, "@0P", 19) == "0" * 19
    assert notes.bytes_of("sent") == b"@07\r@0P\r@0P\r"


class Device:
    """A serial device that can be read, written and unplugged: a pseudo terminal behind a link."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.plug_in()

    def plug_in(self) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.link.symlink_to(os.ttyname(slave))
        os.close(slave)
        self.open = True

    def unplug(self) -> None:
        self.link.unlink()
        os.close(self.master)
        self.open = False

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            try:
                data += os.read(self.master, count - len(data))
            except OSError:  # nobody has it open at the moment
                time.sleep(0.01)
        return data

    def write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self.master, data) :]


@pytest.fixture
def device(tmp_path: Path) -> Iterator[Device]:
    device = Device(tmp_path / "ttyUSB0")
    yield device
    if device.open:
        device.unplug()


def test_a_device_that_is_unplugged_in_use_is_said_waited_for_and_taken_again(device, monkeypatch, caplog):
    monkeypatch.setattr(real_port, "RETRY_S", 0.05)
    caplog.set_level(logging.WARNING)
    here = endpoint("pty")
    with tapping(str(device.link), here) as notes, opened(here, baudrate=9600) as port:
        assert notes.tap is not None
        port.write(b"first")
        assert device.read(5) == b"first"
        device.unplug()
        until(lambda: any("has gone" in text for text in notes.said))
        port.write(b"nowhere")
        until(lambda: notes.tap.lost_bytes == len(b"nowhere"))
        device.plug_in()
        until(lambda: any("is back" in text for text in notes.said))
        port.write(b"again")
        assert device.read(5) == b"again"
        device.write(b"heard")
        assert port.read(5) == b"heard"
        assert termios_speed(device.link) == 9600
    gone, back = (text for text in notes.said if "host sets" not in text)
    assert gone.startswith(f"{device.link} has gone: ")
    assert back == f"{device.link} is back"
    assert "7 bytes of the host went nowhere" in caplog.text


@pytest.mark.parametrize("kind", ["tcp", "rfc2217"])
def test_a_terminal_server_that_goes_and_comes_back(kind, monkeypatch):
    monkeypatch.setattr(real_port, "RETRY_S", 0.05)
    here, there = endpoint("pty"), endpoint(kind)
    with ExitStack() as stack:
        with twin_at(there):
            notes = stack.enter_context(tapping(url(there), here))
            port = stack.enter_context(opened(here))
            assert ask(port, "@07") == "0"
        until(lambda: any("has gone" in text for text in notes.said))
        codec = {"codec": Rfc2217Codec} if kind == "rfc2217" else {}
        with twin_at(TcpEndpoint(there.address, kind, **codec)) as seen:
            until(lambda: any("is back" in text for text in notes.said))
            assert ask(port, "@0P", 19) == "0" * 19
    assert seen.bytes_of("sent") == b"@0P\r"


def termios_speed(link: Path) -> int:
    import termios

    file = os.open(link, os.O_RDWR | os.O_NOCTTY)
    try:
        return {termios.B9600: 9600, termios.B19200: 19_200}[termios.tcgetattr(file)[5]]
    finally:
        os.close(file)


@pytest.mark.parametrize("host", ["pty", "tcp", "rfc2217"])
def test_a_long_burst_both_ways_with_slow_readers_loses_nothing(device, host):
    here = endpoint(host)
    with tapping(str(device.link), here) as notes, opened(here) as port:
        threads = [
            threading.Thread(target=port.write, args=(BURST,)),
            threading.Thread(target=device.write, args=(BURST,)),
        ]
        for thread in threads:
            thread.start()
        time.sleep(0.3)  # meanwhile everything is full
        heard = device.read(1)
        read = port.read(1)
        while len(heard) < len(BURST) or len(read) < len(BURST):
            heard += device.read(min(700, len(BURST) - len(heard)))
            read += port.read(min(700, len(BURST) - len(read)))
        for thread in threads:
            thread.join()
    assert heard == BURST
    assert read == BURST
    assert notes.bytes_of("sent") == BURST
    assert notes.bytes_of("received") == BURST


def test_what_is_held_is_bounded(device):
    """A controller that talks without end to a host that does not read is not read any more, and nothing is lost."""
    here = endpoint("pty")
    tap = Tap(str(device.link), [here], SerialFormat(19_200))
    with running(tap), opened(here) as port:
        os.set_blocking(device.master, False)
        written = 0
        quiet = time.monotonic()
        while time.monotonic() - quiet < 0.5 and written < 1 << 22:
            try:
                written += os.write(device.master, bytes(4096))
                quiet = time.monotonic()
            except BlockingIOError:
                time.sleep(0.01)
        assert tap.held <= OUTBOX_BYTES + real_port.HELD_BYTES  # handed on, and not yet
        assert written < 1 << 22
        assert port.read(written) == bytes(written)


class FullDisk(Notes):
    """Takes one entry."""

    def sent(self, time_ns: int, data: bytes) -> None:
        super().sent(time_ns, data)
        self.broken = True


def test_a_recording_that_ends_does_not_end_the_session(device):
    here, notes = endpoint("pty"), FullDisk()
    tap = Tap(str(device.link), [here], SerialFormat(19_200))
    tap.writer = BookWriter(notes)
    with running(tap), opened(here) as port:
        for _ in range(3):
            port.write(b"ask")
            assert device.read(3) == b"ask"
            device.write(b"told")
            assert port.read(4) == b"told"
    assert not tap.writer.close()


def test_the_log_of_the_wire_is_closed_with_the_tap_once(device):
    """So that a message that is not complete is printed, too."""
    ended = []

    class Log(WireTap):
        def close(self) -> None:
            ended.append(True)

    tap = Tap(str(device.link), [endpoint("pty")], SerialFormat(19_200), Log())
    tap.close()
    tap.close()
    assert ended == [True]


# ---- the command -----------------------------------------------------------------------------------------------------


@pytest.fixture
def tap() -> Iterator[Callable[..., Served]]:
    """tap(*arguments) starts one and waits until it listens."""
    started: list[Served] = []

    def start(*arguments: str) -> Served:
        started.append(Served(arguments, "tap"))
        return started[-1]

    yield start
    for tapped in started:
        if tapped.process.poll() is None:
            tapped.process.terminate()
        tapped.process.communicate(timeout=STOP_S)


def traffic(file: Path) -> tuple[bytes, bytes]:
    """Bytes sent and received in a recording, also in one that is cut off."""
    found = {"/host/sent": b"", "/host/received": b""}
    with file.open("rb") as stream:
        rows = NonSeekingReader(stream).iter_messages(log_time_order=False)
        while True:
            try:
                _, channel, message = next(rows)
            except Exception:  # the end, or where it is cut off
                return found["/host/sent"], found["/host/received"]
            if channel.topic in found:
                found[channel.topic] += bytes.fromhex(json.loads(message.data)["hex"])


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """refused(*arguments): the one line that a call that cannot be carried out gives."""

    def call(*arguments: str) -> str:
        with pytest.raises(SystemExit) as ended:
            main(["tap", *arguments])
        said = capsys.readouterr()
        assert (ended.value.code, said.out) == (2, "")
        (line,) = said.err.splitlines()
        return line

    return call


def test_a_session_recorded_by_the_command(device, tap, tmp_path):
    file = tmp_path / "real.mcap"
    tapped = tap(str(device.link), "--pty", str(tmp_path / "imc"), "--record", str(file), "--log", "wire")
    assert tapped.info["pty"] == str(tmp_path / "imc")
    with tapped.open() as port:
        port.write(b"@0P\r")
        assert device.read(4) == b"@0P\r"
        device.write(b"0" * 19)
        assert port.read(19) == b"0" * 19
        until(lambda: traffic(file) == (b"@0P\r", b"0" * 19))  # while it goes on
    assert tapped.stop(signal.SIGTERM) == 0
    assert traffic(file) == (b"@0P\r", b"0" * 19)
    log = tapped.process.communicate()[1]
    assert "host  @0P" in log
    assert "real  0000000000000000000" in log
    assert not os.path.lexists(tmp_path / "imc")


def test_bytes_that_went_nowhere_are_in_the_exit_code(device, tap, tmp_path):
    file = tmp_path / "real.mcap"
    tapped = tap(str(device.link), "--record", str(file))
    with tapped.open() as port:
        device.unplug()
        until(lambda: b"has gone" in file.read_bytes())
        port.write(b"@07\r")
        until(lambda: traffic(file)[0] == b"@07\r")
    assert tapped.stop(signal.SIGTERM) == 1
    assert traffic(file)[0] == b"@07\r"


def test_it_agrees_with_the_recording_of_the_controller_itself(serve, tap, tmp_path):
    """A twin in place of the real controller, which records itself: the same bytes, no difference."""
    files = {"twin": tmp_path / "twin.mcap", "tap": tmp_path / "real.mcap"}
    served = serve("--record", str(files["twin"]), speed="20")
    tapped = tap(served.info["pty"], "--record", str(files["tap"]))
    with tapped.open() as port:
        came = talk(port)
    assert tapped.stop(signal.SIGTERM) == 0
    assert served.stop(signal.SIGTERM) == 0
    recorded = {who: read(file) for who, file in files.items()}
    assert recorded["tap"].metadata["kind"] == "tap"
    for recording in recorded.values():
        assert b"".join(bytes.fromhex(entry.content["hex"]) for entry in recording.of("/host/sent")) == SENT
        assert b"".join(bytes.fromhex(entry.content["hex"]) for entry in recording.of("/host/received")) == came
    language = [create_language("imc-s8") for _ in recorded]
    limits = Limits(10**12)  # 20 times as fast: not the times
    between = compare(recorded["tap"], recorded["twin"], language[0], language[1], limits)
    assert between.same
    assert len(between.pairs) == len(SESSION)


def test_after_a_kill_the_last_second_at_most_is_missing(device, tap, tmp_path):
    file = tmp_path / "real.mcap"
    tapped = tap(str(device.link), "--record", str(file))
    with tapped.open() as port:
        port.write(b"@07\r")
        assert device.read(4) == b"@07\r"
        assert LOOK_S < 0.5  # so often is written what there is
        until(lambda: traffic(file) == (b"@07\r", b""))
        assert tapped.stop(signal.SIGKILL) == -signal.SIGKILL
    assert traffic(file) == (b"@07\r", b"")


def test_what_cannot_be_tapped_is_one_line(device, tap, refused, tmp_path):
    file = tmp_path / "real.mcap"
    missing = refused(str(tmp_path / "ttyUSB7"))
    assert missing.startswith(f"isel-twin: {tmp_path}/ttyUSB7: No such file or directory; serial ports here: ")
    file.write_bytes(b"precious")
    assert refused(str(device.link), "--record", str(file)) == (
        f"isel-twin: {file}: exists already; choose another name, or add --replace"
    )
    assert file.read_bytes() == b"precious"
    assert "the name must end in .mcap" in refused(str(device.link), "--record", str(tmp_path / "real.vcd"))
    assert "Connection refused; is something listening there?" in refused("tcp://127.0.0.1:1")
    full = tmp_path / "full.mcap"
    full.symlink_to("/dev/full")
    assert "No space left on device" in refused(str(device.link), "--record", str(full))
    assert "--frame '9N1': write data bits" in refused(str(device.link), "--frame", "9N1")
    assert "unknown controller 'imx'" in refused(str(device.link), "--controller", "imx")
    tap(str(device.link))
    assert "is in use by another program; close that one first" in refused(str(device.link))


def test_a_recording_may_be_replaced_if_told_so_and_an_unwritable_one_is_told_at_once(device, tap, refused, tmp_path):
    file = tmp_path / "real.mcap"
    file.write_bytes(b"old")
    assert "cannot write in folder" in refused(str(device.link), "--record", str(tmp_path / "no" / "real.mcap"))
    tapped = tap(str(device.link), "--record", str(file), "--replace")
    assert tapped.stop(signal.SIGINT) == 0
    assert traffic(file) == (b"", b"")
    assert file.read_bytes() != b"old"
