"""asyncio hosts and programs with windows in virtual time."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest

from isel_twin.bridge.virtual.virtual_host import HostRun, run_host
from isel_twin.core.twin import Twin

BYTE_S = 10 / 19_200
HOST = """
    import asyncio, time
    import serial

    def blocking(seconds):
        time.sleep(seconds)
        return seconds

    class Line(asyncio.Protocol):
        def __init__(self, loop, port):
            self.loop, self.port, self.queue = loop, port, asyncio.Queue()
            loop.add_reader(port.fileno(), self.come)

        def come(self):
            self.queue.put_nowait(self.port.read(self.port.in_waiting or 1))

    async def main():
        loop = asyncio.get_running_loop()
        began = loop.time()
        told = lambda *what: print(*what, f"{loop.time() - began:.6f}")
        await asyncio.sleep(600)
        told("slept")
        try:
            await asyncio.wait_for(asyncio.Event().wait(), 5)
        except asyncio.TimeoutError:
            told("timeout")
        told(await loop.run_in_executor(None, blocking, 3))
        told(await asyncio.gather(*(asyncio.sleep(n, n) for n in (3, 1, 2))))
        line = Line(loop, serial.Serial("COM4", 19200, timeout=0))
        sent = loop.time()
        line.port.write(b"@07\\r")
        print(await line.queue.get(), f"{loop.time() - sent:.6f}")
        loop.remove_reader(line.port.fileno())

    asyncio.run(main())
"""


@pytest.fixture
def host(tmp_path: Path) -> Callable[..., HostRun]:
    def run(text: str, **files: str) -> HostRun:
        for name, content in files.items():
            (tmp_path / f"{name}.py").write_text(content)
        (tmp_path / "host.py").write_text(textwrap.dedent(text))
        return run_host(Twin(plant="kinematic", line_speed=True), [str(tmp_path / "host.py")], "COM4")

    return run


def test_sleeps_timeouts_executors_and_the_port_take_exactly_their_virtual_time(
    host: Callable[..., HostRun], capsys: pytest.CaptureFixture[str]
) -> None:
    assert host(HOST).code == 0
    slept, timeout, executor, gathered, answered = capsys.readouterr().out.splitlines()
    assert (slept, timeout) == ("slept 600.000000", "timeout 605.000000")
    assert float(executor.split()[1]) == pytest.approx(608.0, abs=1e-4)  # a worker thread looks a few times
    assert gathered.startswith("[3, 1, 2] 611.0")
    assert answered.startswith("b'0' ")
    assert float(answered.split()[1]) == pytest.approx(5 * BYTE_S, abs=1e-4)  # four bytes there, one back


def test_the_same_bits_every_time(host: Callable[..., HostRun], capsys: pytest.CaptureFixture[str]) -> None:
    told = []
    for _ in range(3):
        done = host(HOST)
        told.append((done.ended_ns, capsys.readouterr().out))
    assert told[0] == told[1] == told[2]


@pytest.mark.parametrize("make", ["asyncio.new_event_loop()", "asyncio.get_event_loop_policy().new_event_loop()"])
def test_loops_made_by_hand_are_virtual_and_those_of_others_real(
    make: str, host: Callable[..., HostRun], capsys: pytest.CaptureFixture[str]
) -> None:
    done = host(f"import asyncio\nloop = {make}\nprint(loop.run_until_complete(asyncio.sleep(90, 5)))\nloop.close()\n")
    assert (done.code, capsys.readouterr().out, done.ended_ns) == (0, "5\n", 90_000_000_000)
    import asyncio

    loop = asyncio.new_event_loop()
    assert not hasattr(loop, "in_virtual_time")
    loop.close()


def test_another_thread_wakes_the_loop(host: Callable[..., HostRun], capsys: pytest.CaptureFixture[str]) -> None:
    text = """
        import asyncio, threading, time
        async def main():
            loop, come = asyncio.get_running_loop(), asyncio.Event()
            def later():
                time.sleep(7)
                loop.call_soon_threadsafe(come.set)
            threading.Thread(target=later).start()
            began = loop.time()
            await come.wait()
            print(f"{loop.time() - began:.3f}")
        asyncio.run(main())
    """
    assert host(text).code == 0
    assert capsys.readouterr().out == "7.000\n"


def test_a_loop_that_waits_for_ever_is_told(host: Callable[..., HostRun]) -> None:
    done = host("import asyncio\nasyncio.run(asyncio.Event().wait())")
    assert (done.ending, done.code) == ("deadlock", 1)
    assert "MainThread in asyncio loop" in done.reason


WX = "class App:\n    def __init__(self): self.made = True\n    def MainLoop(self): raise AssertionError\n"


def test_a_window_library_may_be_imported_and_its_application_not_made(
    host: Callable[..., HostRun], capsys: pytest.CaptureFixture[str]
) -> None:
    """A module of that name stands for the real one, which needs a display."""
    text = "import time\nimport wx\nclass Mine(wx.App):\n    pass\ntime.sleep(5)\nprint('logic')\n"
    done = host(text, wx=WX)
    assert (done.code, done.ended_ns, capsys.readouterr().out) == (0, 5_000_000_000, "logic\n")
    done = host(text + "Mine()\n", wx=WX)
    assert (done.code, done.ending) == (2, "refused")
    assert "host.py:7: wx.App, whose main loop waits in real time, cannot be had" in done.reason
    assert "run the program's logic without its window" in done.reason
