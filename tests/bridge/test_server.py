"""The loop: what it says about itself, and how it ends."""

from __future__ import annotations

import gc
import logging
import os
import signal
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from isel_twin.bridge.serve.keeping import keep, serve_and_keep
from isel_twin.bridge.serve.loop import on_signals
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.server import Server
from isel_twin.core.twin import Twin
from isel_twin.recordings.recorder import Recorder
from tests.bridge.test_network import Mouth
from tests.bridge.test_pacing import MS, Clock


def test_falling_behind_is_said_with_the_factor_and_catching_up_too(caplog):
    """Somebody looks at the twin every 10 ms and takes 5 ms for it: twice real time, where 20 were asked for."""
    clock = Clock()
    twin = Twin(plant="kinematic")
    busy_until = clock.now + 10_000 * MS

    def look(_: Twin) -> None:
        clock.now += 5 * MS if clock.now < busy_until else 0

    twin.observe(look, 10 * MS)
    seconds = 20
    Server(twin, Pacer(20.0, clock=clock), [Mouth(b"\n", clock, looks=seconds * 1000, look_ns=1 * MS)]).run()
    said = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert len(said) == 2
    assert said[0].startswith("this computer does not reach speed 20: 1.")
    assert said[1].startswith("speed 20 is reached again; it was 1.")


def test_a_server_that_breaks_lets_go_of_everything(tmp_path):
    """An observer raises: the link is gone, and whoever called `run` is told why."""
    link = tmp_path / "imc"
    twin = Twin(plant="kinematic")

    def look(_: Twin) -> None:
        if twin.time_ns > 0:
            raise OSError(28, "No space left on device", "/tmp/somewhere")

    twin.observe(look, 10 * MS)
    server = Server(twin, Pacer(1.0), [PtyEndpoint(str(link))])
    assert link.is_symlink()
    with pytest.raises(OSError, match="No space left"):
        server.run()
    assert list(tmp_path.iterdir()) == []


def breaking(twin: Twin, error: Exception) -> Server:
    """A server whose twin breaks after 0.5 s."""

    def look(_: Twin) -> None:
        if twin.time_ns >= 500 * MS:
            raise error

    twin.observe(look, 10 * MS)
    return Server(twin, Pacer(1.0), [PtyEndpoint()])


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(28, "No space left on device", "/tmp/samples"), "/tmp/samples: No space left on device"),
        (ZeroDivisionError("a mistake of ours"), "ZeroDivisionError: a mistake of ours"),
    ],
    ids=["disk full", "mistake"],
)
def test_what_was_recorded_is_kept_when_the_server_breaks(tmp_path, caplog, error, said):
    twin, record = Twin(plant="kinematic"), tmp_path / "session.npz"
    with Recorder(twin, 100 * MS) as recorder:
        code = serve_and_keep(breaking(twin, error), record, lambda path: path.write_text(str(len(recorder))))
    assert code == 1
    assert int(record.read_text()) >= 5
    assert said in caplog.text


def test_what_was_recorded_is_kept_when_the_interpreter_is_told_to_exit(tmp_path):
    record = tmp_path / "session.npz"
    server = breaking(Twin(plant="kinematic"), ZeroDivisionError())
    server.run = lambda: sys.exit(3)  # type: ignore[method-assign]
    with pytest.raises(SystemExit):
        serve_and_keep(server, record, lambda path: path.write_text("all"))
    assert record.read_text() == "all"


def test_a_recording_whose_disk_is_full_is_kept_elsewhere(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def write(path: Path) -> None:
        if path == Path("/full/session.npz"):
            raise OSError(28, "No space left on device", str(path))
        path.write_text("all")

    assert not keep(Path("/full/session.npz"), write)
    (kept,) = tmp_path.glob("isel-twin-*/session.npz")
    assert kept.read_text() == "all"
    assert str(kept) in caplog.text
    assert "/full/session.npz: could not be written" in caplog.text


def test_a_recording_that_can_be_written_nowhere_is_said_to_be_lost(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))

    def write(path: Path) -> None:
        raise OSError(28, "No space left on device")

    assert not keep(Path("session.npz"), write)
    assert "session.npz: could not be written, and is lost" in caplog.text


def test_signals_are_asked_for_and_given_back():
    heard: list[int] = []
    before = signal.getsignal(signal.SIGHUP)
    with on_signals(lambda: heard.append(1)):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(os.getpid(), number)
    assert heard == [1, 1, 1]
    assert signal.getsignal(signal.SIGHUP) is before


def test_a_signal_that_another_thread_gets_wakes_the_server():
    """Nor is one lost that comes just before it falls asleep: without this it slept until a host said something."""
    server = Server(Twin(plant="kinematic"), Pacer(None), [])
    stopped_by: list[str] = []

    def stop(by: str) -> None:
        stopped_by.append(by)
        server.stop()

    def hit() -> None:
        signal.pthread_kill(threading.get_ident(), signal.SIGTERM)

    late, soon = threading.Timer(20.0, stop, ["nobody else"]), threading.Timer(0.3, hit)
    with on_signals(lambda: stop("signal")):
        late.start()
        soon.start()
        server.run()
        late.cancel()
        soon.join()
    assert stopped_by == ["signal"]


def test_a_hang_up_that_is_ignored_stays_so():
    """`nohup isel-twin serve`: the terminal goes, the machine stays."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    heard: list[int] = []
    try:
        with on_signals(lambda: heard.append(1)):
            os.kill(os.getpid(), signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert heard == []


def test_the_collector_does_not_hold_the_server_up():
    """Looking at all there is takes a tenth of a second; while a server runs, what was there before is left out."""
    clock = Clock()
    mouth = Mouth(b"\n", clock)
    frozen: list[int] = []

    def look(_: Twin) -> None:
        frozen.append(gc.get_freeze_count())

    twin = Twin(plant="kinematic")
    server = Server(twin, Pacer(1.0, clock=clock), [mouth])
    before = gc.get_freeze_count()
    twin.observe(look, 1000 * MS)  # counting them takes as long as looking at them
    server.run()
    assert frozen[-1] > before + 10_000
    assert gc.get_freeze_count() == 0


def test_a_single_stall_is_not_called_a_speed_that_is_not_reached(caplog) -> None:
    """Two seconds in which the computer did something else, at a speed that it reaches."""
    clock = Clock()
    twin = Twin(plant="kinematic")
    stalls = [2_000 * MS]

    def look(_: Twin) -> None:
        clock.now += stalls.pop() if stalls and twin.time_ns > 1_000 * MS else MS // 5

    twin.observe(look, 10 * MS)
    Server(twin, Pacer(20.0, clock=clock), [Mouth(b"\n", clock, looks=10_000, look_ns=1 * MS)]).run()
    (said,) = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert said.startswith("this computer was late once at speed 20: 0.")
    assert said.endswith(" times real time for 2 s")
