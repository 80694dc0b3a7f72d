"""Host programs in virtual time: what they may do, what it costs, how they end."""

from __future__ import annotations

import builtins
import datetime
import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
import serial
from serial import serialutil

from isel_twin.base.errors import CallError
from isel_twin.bridge.virtual import cpython, locks, turns, windows
from isel_twin.bridge.virtual.host_code import LIBRARIES
from isel_twin.bridge.virtual.turns import EPOCH_NS, here
from isel_twin.bridge.virtual.virtual_host import HostProgram, parse_program, run_host
from isel_twin.bridge.virtual.virtual_time import VirtualTime
from isel_twin.core.twin import Twin

pytestmark = pytest.mark.long(seconds=6)

OPEN = "import serial, time, threading, queue, sys\nport = serial.Serial('COM4', 19200, timeout=1)\n"
ASK = (
    OPEN
    + """
def ask(command, size=1):
    port.write(command.encode() + b"\\r")
    return port.read(size).decode()
"""
)
BYTE_NS = 520_833
"""Ten bits at 19200 baud."""


@pytest.fixture
def twin():
    return Twin(plant="kinematic", line_speed=True)


@pytest.fixture
def host(twin, tmp_path):
    """host(text, *arguments) runs a program; its exit code, its ending and the machine are in what it returns."""

    def run(text, *arguments, port="COM4"):
        file = tmp_path / "host.py"
        file.write_text(text)
        return run_host(twin, ["python", str(file), *arguments], port)

    return run


def printed(capsys):
    return capsys.readouterr().out.split()


# Time


@pytest.fixture
def no_thread_left() -> Iterator[None]:
    """What other tests of this worker have left is theirs."""
    before = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) <= before


@pytest.mark.parametrize(
    "wait",
    [
        "time.sleep(600)",
        "from time import sleep; sleep(600)",
        "threading.Event().wait(600)",
        "l = threading.Lock(); l.acquire(); l.acquire(timeout=600)",
        "c = threading.Condition()\nwith c: c.wait(600)",
        "c = threading.Condition()\nwith c: c.wait_for(lambda: False, 600)",
        "s = threading.Semaphore(0); s.acquire(timeout=600)",
        "try: queue.Queue().get(timeout=600)\nexcept queue.Empty: pass",
        "try: queue.SimpleQueue().get(timeout=600)\nexcept queue.Empty: pass",
        "t = threading.Thread(target=time.sleep, args=(9e4,), daemon=1); t.start()\nt.join(600); assert t.is_alive()",
        "t = threading.Timer(600, print); t.start(); t.join()",
        "import sched\ns = sched.scheduler(); s.enter(600, 1, print); s.run()",
        "import select; select.select([port], [], [], 600)",
        "import select; select.select([port.fileno()], [], [], 600)",
        "port.timeout = 600; assert port.read() == b''",
        "port.timeout = 600; assert port.readline() == b''",
        "port.timeout = 600; assert port.read_until(b'x') == b''",
        "import concurrent.futures as f\nwith f.ThreadPoolExecutor(2) as p: list(p.map(time.sleep, (600, 300)))",
        "threading.Barrier(2)\ntry: threading.Barrier(2).wait(600)\nexcept threading.BrokenBarrierError: pass",
        "port.send_break(600)",
    ],
)
def test_every_way_to_wait_ten_minutes_takes_ten_virtual_ones(wait, host, twin):
    began = time.process_time()
    done = host(OPEN + "began = time.monotonic()\n" + wait + "\nassert 600 <= time.monotonic() - began < 600.001")
    assert (done.code, done.reason) == (0, "")
    assert 600e9 <= done.ended_ns < 600.001e9
    assert time.process_time() - began < 5.0


@pytest.mark.parametrize(
    "loop",
    [
        "while time.time() < end: pass",
        "while time.time() < end: port.in_waiting",
        "port.timeout = 0\nwhile time.time() < end: port.read(10)",
        "while time.time() < end: time.sleep(0)",
        "while time.time() < end: time.sleep(0.01); port.in_waiting",
    ],
)
def test_a_loop_that_spins_for_a_minute_ends(loop, host):
    began = time.process_time()
    done = host(OPEN + "end = time.time() + 60\n" + loop)
    assert (done.code, done.reason) == (0, "")
    assert done.ended_ns == pytest.approx(60e9, rel=1e-3)
    assert time.process_time() - began < 10.0


@pytest.mark.parametrize(
    "loop",
    [
        "t = threading.Timer(60, print); t.start()\nwhile t.is_alive(): pass",
        "e = threading.Event(); threading.Timer(60, e.set).start()\nwhile not e.is_set(): pass",
        "q = queue.Queue(); threading.Timer(60, q.put, 'x').start()\nwhile q.empty(): pass",
        "l = threading.Lock(); l.acquire(); threading.Timer(60, l.release).start()\nwhile not l.acquire(False): pass",
    ],
)
def test_a_loop_that_looks_at_what_another_thread_does_ends(loop, host, monkeypatch):
    """By the same law, here with a tenth of the looks: each of these changes threads."""
    monkeypatch.setattr(turns, "SPIN", 1000)
    done = host(OPEN + loop)
    assert (done.code, done.reason) == (0, "")
    assert done.ended_ns == pytest.approx(60e9, rel=2e-3)


def test_time_stamps_of_a_computation_are_no_wait(host):
    """Five thousand lines in a log, each with its time and its lock, are 5 ms of looks."""
    done = host(
        "import logging, io\nlogging.basicConfig(stream=io.StringIO())\nfor i in range(5000): logging.warning('%s', i)"
    )
    assert done.code == 0
    assert done.ended_ns <= 50_000_000


def test_all_clocks_are_the_twins(host, capsys, twin):
    twin.run(5.0)
    done = host(
        "import time, datetime\n"
        "a = [time.time(), time.time_ns() / 1e9, datetime.datetime.now(datetime.timezone.utc).timestamp(),\n"
        "     datetime.datetime.now().timestamp(), time.clock_gettime(time.CLOCK_REALTIME),\n"
        "     time.mktime(time.localtime())]\n"
        "b = [time.monotonic(), time.perf_counter(), time.monotonic_ns() / 1e9, time.perf_counter_ns() / 1e9]\n"
        "print(*(round(x - a[0], 2) for x in a), *(round(x - b[0], 2) for x in b))\n"
        "print(time.gmtime()[:6] == (2026, 1, 1, 0, 0, 5), datetime.date.today().year, isinstance(\n"
        "    datetime.datetime.now(), datetime.datetime), time.strftime('%Y'))\n"
    )
    assert done.code == 0
    assert printed(capsys) == [*["0.0"] * 5, "-0.0", *["0.0"] * 4, "True", "2026", "True", "2026"]
    assert datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC).timestamp() * 1e9 == EPOCH_NS


def test_bytes_take_their_time_on_the_line(host, capsys):
    """@07 and a carriage return are four bytes, the reply one more."""
    host(OPEN + "a = time.perf_counter_ns(); port.write(b'@07\\r'); port.read(); print(time.perf_counter_ns() - a)")
    assert int(printed(capsys)[0]) == pytest.approx(5 * BYTE_NS, abs=100_000)


def test_flush_and_out_waiting_know_the_line(host, capsys):
    host(OPEN + "port.write(b'x' * 100); print(port.out_waiting); port.flush(); print(port.out_waiting, time.time())")
    first, left, ended = printed(capsys)
    assert (first, left) == ("100", "0")
    assert (float(ended) - EPOCH_NS / 1e9) == pytest.approx(100 * BYTE_NS / 1e9, abs=1e-4)


def test_a_write_beyond_the_buffer_waits_or_times_out(host, capsys):
    done = host(
        OPEN
        + "port.write(bytes(8000)); a = time.time(); port.write(b'x'); print(round(time.time() - a, 1))\n"
        + "port.write_timeout = 0.1\ntry: port.write(bytes(4000))\n"
        + "except serial.SerialTimeoutException: print('late')"
    )
    assert done.code == 0
    assert printed(capsys) == [str(round((8001 - 4096) * BYTE_NS / 1e9, 1)), "late"]


def test_inter_byte_timeout(host, capsys):
    """A read of many bytes ends when the line has been silent for the time given."""
    host(
        OPEN
        + "port.timeout = 60; port.inter_byte_timeout = 0.5\nport.write(b'@07\\r'); print(port.read(10), time.time())"
    )
    reply, ended = printed(capsys)
    assert reply == "b'0'"
    assert float(ended) - EPOCH_NS / 1e9 == pytest.approx(0.5 + 5 * BYTE_NS / 1e9, abs=1e-3)


def test_inter_byte_timeout_alone(host, capsys):
    host(
        OPEN
        + "port.timeout = None; port.inter_byte_timeout = 0.5\nport.write(b'@07\\r'); print(port.read(10), time.time())"
    )
    reply, ended = printed(capsys)
    assert reply == "b'0'"
    assert float(ended) - EPOCH_NS / 1e9 == pytest.approx(0.5 + 5 * BYTE_NS / 1e9, abs=1e-3)


# Threads


def test_threads_run_in_turn_and_by_their_deadlines(host, capsys):
    program = """
import threading, time
def run(name, period):
    for _ in range(3):
        time.sleep(period)
        print(name, round(time.monotonic() - began, 3))
began = time.monotonic()
threads = [threading.Thread(target=run, args=a) for a in (("a", 0.3), ("b", 0.2))]
for t in threads: t.start()
for t in threads: t.join()
"""
    assert host(program).code == 0
    assert printed(capsys) == ["b", "0.2", "a", "0.3", "b", "0.4", "a", "0.6", "b", "0.6", "a", "0.9"]


def test_a_program_waits_for_its_threads_but_not_for_daemons(host, capsys, twin, no_thread_left: None):
    done = host(
        "import threading, time\n"
        "threading.Thread(target=lambda: (time.sleep(3), print('last'))).start()\n"
        "threading.Thread(target=lambda: (time.sleep(1e6), print('never')), daemon=True).start()\n"
    )
    assert done.code == 0
    assert printed(capsys) == ["last"]
    assert 3e9 <= done.ended_ns < 3.001e9


def test_an_executor_left_open_ends_with_the_program(host):
    done = host(
        "import concurrent.futures, time\np = concurrent.futures.ThreadPoolExecutor(2)\n"
        "p.submit(time.sleep, 2)\np.submit(time.sleep, 3)\n"
    )
    assert (done.code, done.reason) == (0, "")
    assert 3e9 <= done.ended_ns < 3.001e9
    import concurrent.futures

    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        assert pool.submit(lambda: 5).result() == 5


def test_an_exception_in_a_thread_is_printed_and_the_program_goes_on(host, capsys):
    done = host("import threading\nt = threading.Thread(target=lambda: 1 / 0)\nt.start(); t.join(); print('on')")
    assert done.code == 0
    out, err = capsys.readouterr()
    assert out == "on\n"
    assert "Exception in thread" in err
    assert "ZeroDivisionError" in err
    (note,) = done.notes
    assert note.startswith("the thread Thread-")
    assert note.endswith("has ended with ZeroDivisionError: division by zero")


def test_a_thread_without_an_object(host, capsys):
    done = host(
        "import _thread, time\n_thread.start_new_thread(lambda: (time.sleep(1), print('ran')), ())\ntime.sleep(2)"
    )
    assert (done.code, done.ended_ns) == (0, 2_000_000_000)
    assert printed(capsys) == ["ran"]


def test_dates_can_be_pickled_and_subclassed(host):
    done = host(
        "import datetime, pickle\nclass Mine(datetime.datetime): pass\nnow = datetime.datetime.now()\n"
        "assert pickle.loads(pickle.dumps((now, now.date()))) == (now, datetime.date.today())\n"
        "assert type(now) is datetime.datetime and not isinstance(now, Mine) and isinstance(Mine.now(), Mine)\n"
        "assert eval(repr((now, now.date()))) == (now, now.date())\n"
    )
    assert done.code == 0


@pytest.mark.parametrize(
    ("real", "virtual"),
    [(threading.Lock(), locks.VirtualLock()), (threading.RLock(), locks.VirtualRLock())],
    ids=["lock", "rlock"],
)
def test_a_lock_has_what_locks_of_this_python_have(real, virtual):
    """threading.Condition of Python 3.14 asks for one method more than that of 3.13."""
    older_names = {"acquire_lock", "release_lock", "locked_lock"}
    assert {name for name in dir(real) if not hasattr(virtual, name)} <= older_names


def test_an_rlock_is_locked_by_whoever_has_it():
    lock = locks.VirtualRLock()
    assert not lock.locked()
    with lock, lock:
        assert lock.locked()
    assert not lock.locked()


def test_an_rlock_and_its_condition(host, capsys):
    done = host(
        "import threading, time\nl = threading.RLock()\n"
        "def other():\n    with l: print('other', round(time.monotonic() - began))\n"
        "began = time.monotonic()\n"
        "with l:\n    with l:\n        t = threading.Thread(target=other); t.start(); time.sleep(5)\n"
        "t.join()\ntry: l.release()\nexcept RuntimeError: print('not mine')\n"
    )
    assert done.code == 0
    assert printed(capsys) == ["other", "5", "not", "mine"]


def test_a_pyserial_reader_thread(host, capsys):
    """pySerial's own, which was not written for this."""
    done = host(
        OPEN
        + "from serial.threaded import ReaderThread, Protocol\n"
        + "class P(Protocol):\n    def data_received(self, data): print(data)\n"
        + "with ReaderThread(port, P): port.write(b'@07\\r'); time.sleep(1)\n"
    )
    assert (done.code, done.reason) == (0, "")
    assert printed(capsys) == ["b'0'"]


# The port


def test_a_session(host, capsys):
    done = host(
        ASK + "port.timeout = 90\nprint(ask('@07'), ask('@0R7'), ask('@0M3200,8000,0,30,0,30,0,30'), ask('@0P', 19))"
    )
    assert done.ok
    assert printed(capsys) == ["0", "0", "0", "0000C80" + "0" * 12]
    assert done.verdict.counts[0] == 3200
    assert done.was_struck == ("limit_x1", "limit_y1", "limit_z1")


@pytest.mark.parametrize("name", ["com4", "\\\\\\\\.\\\\COM4"])
def test_a_windows_name_has_no_case_and_may_have_a_prefix(name, host):
    assert host(f"import serial\nserial.Serial('{name}')").code == 0


def test_any_name_is_the_twin_if_none_is_given(host):
    assert host("import serial\nserial.serial_for_url('/dev/ttyS7', do_not_open=True).open()", port=None).code == 0


def test_another_name_is_refused_with_the_right_one(host, capsys):
    done = host("import serial\nserial.Serial('COM5')")
    assert (done.code, done.ending) == (1, "exception")
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("serial.serialutil.SerialException: [Errno 2] could not open port COM5")
    assert "COM4" in last


def test_a_second_opening_is_refused_and_one_after_the_close_is_not(host, capsys):
    done = host(
        OPEN
        + "try: serial.Serial('COM4')\nexcept serial.SerialException as e: print(e.errno)\n"
        + "port.close()\nwith serial.Serial('COM4', exclusive=True) as p: print(p.is_open)\n"
        + "try: p.read()\nexcept serial.PortNotOpenError: print('closed')\np.open(); print(p.read_all())"
    )
    assert done.code == 0
    assert printed(capsys) == ["13", "True", "closed", "b''"]


def test_list_ports_shows_the_port(host, capsys):
    host("from serial.tools import list_ports as l\nprint(*(p.device for p in l.comports()), len(list(l.grep('COM'))))")
    assert printed(capsys) == ["COM4", "1"]


def test_another_speed_is_told(host):
    (note,) = host("import serial\nserial.Serial('COM4', 9600).write(b'x')").notes
    assert note.startswith("the host's port is set to 9600 8N1, the controller's line has 19200 8N1")


def test_settings_made_after_the_opening_are_those_that_count(host):
    assert host("import serial\np = serial.Serial('COM4')\np.baudrate = 19200\np.write(b'x')").notes == ()


def test_a_read_cancelled_and_a_port_closed_by_another_thread(host, capsys):
    done = host(
        OPEN
        + "port.timeout = None\nthreading.Timer(1, port.cancel_read).start(); print(port.read())\n"
        + "threading.Timer(1, port.close).start()\ntry: port.read()\nexcept serial.SerialException: print('closed')"
    )
    assert done.code == 0
    assert printed(capsys) == ["b''", "closed"]


# How it ends


@pytest.mark.parametrize(
    ("text", "code", "err"),
    [
        ("", 0, ""),
        ("import sys; sys.exit()", 0, ""),
        ("import sys; sys.exit(3)", 3, ""),
        ("raise SystemExit('so not')", 1, "so not\n"),
    ],
)
def test_exit_codes(text, code, err, host, capsys):
    done = host(text)
    assert (done.code, done.ending) == (code, "exit")
    assert capsys.readouterr().err == err


@pytest.mark.parametrize(
    ("name", "first", "runs"),
    [
        ("host", b"#!/usr/bin/env python3\n", True),
        ("host", b"#!/bin/sh\n", False),
        ("host", b"import python\n", False),
        ("host", b"", False),
        ("host.py", b"", True),
    ],
)
def test_a_file_named_without_an_interpreter_is_python_by_its_name_or_first_line(name, first, runs, tmp_path):
    file = tmp_path / name
    file.write_bytes(first)
    if runs:
        assert parse_program([str(file), "-v"]) == HostProgram(("-v",), path=str(file))
    else:
        with pytest.raises(
            CallError, match=r"host: only Python programs run in virtual time \(exec -- python host\.py\)"
        ):
            parse_program([str(file)])


def test_a_host_is_over_at_its_limit_and_not_after_it(twin, capsys):
    done = run_host(twin, ["python", "-c", "import time; time.sleep(10); print('after')"], "COM4", limit_s=10)
    assert (done.ending, done.ended_ns, printed(capsys)) == ("timeout", 10_000_000_000, [])


def test_a_host_that_only_looks_at_the_clock_is_over_at_its_limit(twin, capsys):
    """Each look takes a microsecond."""
    program = "import time\nfor _ in range(20_000): time.time()\nprint('after')"
    done = run_host(twin, ["python", "-c", program], "COM4", limit_s=0.01)
    assert (done.ending, done.ended_ns, printed(capsys)) == ("timeout", 10_000_000, [])


def test_a_main_thread_that_never_yields_is_given_up(twin, capsys):
    """It catches all that is to end it, 3^4 times."""
    given_up = []
    program = (
        "import os, time\n"
        "for _ in range(1000):\n"
        "    try: time.sleep(1)\n"
        "    except BaseException: print('caught')\n"
        "    if 'GIVEN_UP' in os.environ: break\n"
    )

    def give_up(time: VirtualTime) -> None:
        """As if it returned, which ends the program."""
        given_up.append(time.ending.kind)
        os.environ["GIVEN_UP"] = "1"

    done = run_host(twin, ["python", "-c", program], "COM4", limit_s=10, give_up=give_up)
    assert (done.code, done.ending, given_up) == (1, "timeout", ["timeout"])
    assert len(printed(capsys)) == 81 + 1


def test_a_traceback_is_as_python_prints_it(host, tmp_path, capsys):
    text = "def f():\n    raise ValueError('so')\nf()\n"
    assert host(text).code == 1
    by_python = subprocess.run([sys.executable, str(tmp_path / "host.py")], capture_output=True, text=True, check=False)
    assert by_python.returncode == 1
    assert capsys.readouterr().err == by_python.stderr


def test_a_deadlock_is_one_line_with_who_waits_where(host, no_thread_left: None):
    done = host(
        OPEN
        + "port.timeout = None\n"
        + "threading.Thread(target=lambda: queue.Queue().get(), name='A worker').start()\n"
        + "port.read()\n"
    )
    assert (done.code, done.ending) == (1, "deadlock")
    assert "\n" not in done.reason
    assert "MainThread in read of COM4 (host.py:5)" in done.reason
    assert "worker in Lock.acquire (host.py:4)" in done.reason
    assert done.reason.index("MainThread in ") < done.reason.index("worker in "), "the main one first"


def test_a_deadlock_of_threads_is_told_at_once(tmp_path):
    """Without waiting for the stop button, which gives nobody his lock."""
    scenario = tmp_path / "stop.toml"
    scenario.write_text('[[event]]\nat = 600.0\nset = { estop = "pressed" }\n')
    twin = Twin(plant="kinematic", scenario=scenario)
    done = run_host(twin, ["python", "-c", "import threading\nthreading.Event().wait()"], "COM4")
    assert (done.ending, done.ended_ns) == ("deadlock", 0)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("import asyncio\nasyncio.run(asyncio.create_subprocess_exec('ls'))", "subprocess"),
        ("import asyncio\nasyncio.SelectorEventLoop()", "asyncio"),
        ("import subprocess\nsubprocess.run(['ls'])", "subprocess"),
        ("import os\nos.system('ls')", "system"),
        ("import os\nos.fork()", "fork"),
        ("import os\nos.popen('ls')", "subprocess"),
        ("import multiprocessing as m\nm.Process(target=print).start()", "multiprocessing"),
        (
            "import multiprocessing as m\nm.set_start_method('spawn', True)\nm.Process(target=print).start()",
            "multiprocessing",
        ),
        ("import signal\nsignal.setitimer(signal.ITIMER_REAL, 1)", "setitimer"),
        ("import signal\nsignal.alarm(1)", "alarm"),
        ("import socket\nsocket.create_connection(('192.0.2.1', 9))", "connection to 192.0.2.1, another computer"),
        ("import socket\nsocket.create_connection(('lab.example', 9))", "address of lab.example, another computer"),
        ("import socket\nsocket.socketpair()[0].detach()", "file number of a socket"),
        ("import socket\nsocket.socket(fileno=0)", "socket made of a file number"),
        ("import select\nselect.epoll()", "epoll"),
        ("import selectors, sys, os\nselectors.DefaultSelector().register(os.pipe()[0], 1)", "selector"),
        ("import select, os\nselect.poll().register(os.pipe()[0], 1)", "poll"),
        ("import threading, os\nt = threading.Thread(target=os.fork); t.start(); t.join()", "fork"),
        ("try:\n    import asyncio\n    asyncio.SelectorEventLoop()\nexcept Exception: pass", "asyncio"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(text, what, host):
    done = host(text)
    assert (done.code, done.ending) == (2, "refused")
    assert what in done.reason
    assert "isel-twin serve" in done.reason
    assert "\n" not in done.reason


def test_a_library_that_looks_for_a_compiled_one_may(host, capsys):
    """ctypes asks other programs; virtual time stands still meanwhile."""
    done = host("import ctypes.util, time\nprint(ctypes.util.find_library('no-such-library'))\ntime.sleep(1)\n")
    assert (done.code, done.ended_ns, printed(capsys)) == (0, 1_000_000_000, ["None"])


def test_functions_for_the_end_run_at_the_end(host, capsys, twin):
    done = host(
        "import atexit, time\natexit.register(print, 'first')\n"
        "@atexit.register\ndef last(): time.sleep(2); print('last')\n"
    )
    assert done.code == 0
    assert printed(capsys) == ["last", "first"]
    assert done.ended_ns == 2_000_000_000


def test_a_wait_for_as_long_as_there_is_is_one_without_timeout(host):
    assert host("import threading\nthreading.Event().wait(threading.TIMEOUT_MAX)").ending == "deadlock"


def test_after_a_long_sleep_a_byte_may_still_come(tmp_path, capsys):
    """Two hours of sleep are no sign that nothing comes any more: the stop button is pressed ten minutes later."""
    scenario = tmp_path / "stop.toml"
    scenario.write_text('[[event]]\nat = 7800.0\nset = { estop = "pressed" }\n')
    twin = Twin(plant="kinematic", line_speed=True, scenario=scenario)
    file = tmp_path / "host.py"
    file.write_text(OPEN + "time.sleep(7200)\nport.timeout = None\nport.read()\n")
    assert run_host(twin, [str(file)]).ending == "deadlock"
    assert twin.time_ns > 7800e9


def test_the_log_of_a_host_is_its_own(host, capsys):
    """Its basicConfig works under a test runner that has handlers of its own, and the twin's words are not in it."""
    done = host(
        "import logging, sys\nlogging.basicConfig(stream=sys.stdout, format='%(message)s', level=logging.INFO)\n"
        "logging.info('mine')\nlogging.getLogger('isel_twin').warning('not mine')\n"
    )
    assert done.code == 0
    assert printed(capsys) == ["mine"]


def test_a_host_in_the_twins_own_repository_is_no_library(twin):
    hosts = Path(__file__).parents[1] / "hosts"
    assert not str(hosts / "polling.py").startswith(LIBRARIES)
    for library in (
        serial.__file__,
        threading.__file__,
        run_host.__code__.co_filename,
        Twin.__init__.__code__.co_filename,
    ):
        assert library.startswith(LIBRARIES)


# Around it


def test_the_page_says_how(tmp_path, monkeypatch):
    """Both programs of docs/exec.md, as they stand there."""
    page = (Path(__file__).parents[2] / "docs" / "exec.md").read_text()
    blocks = [block for block in page.split("## From a test")[1].split("\n\n") if block.startswith("    ")]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["pytest"])
    (tmp_path / "host.py").write_text("import sys\n" + OPEN + "assert sys.argv[1:] == ['--job', 'circle']")
    names = {"serial": serial, "time": time}
    for block in blocks:
        exec("\n".join(line.removeprefix("    ") for line in block.splitlines()), names)
    assert len(blocks) == 4
    assert names["twin"].time_ns >= 600e9


def test_what_a_test_runner_raises_goes_through_the_host(host, monkeypatch, no_thread_left: None):
    """A time limit of a test, raised by a signal handler wherever the main thread is."""

    class Late(BaseException):
        pass

    def late(*_):
        raise Late

    alarm = partial(signal.setitimer, signal.ITIMER_REAL, 0.1)
    monkeypatch.setattr(builtins, "alarm", alarm, raising=False)
    before = signal.signal(signal.SIGALRM, late)
    try:
        with pytest.raises(Late):
            host(
                "import time, threading\nalarm()\n"
                "threading.Thread(target=time.sleep, args=(1e6,), daemon=True).start()\n"
                "while True:\n    try: time.sleep(0.01)\n    except Exception: pass\n"
            )
    finally:
        signal.signal(signal.SIGALRM, before)
    assert here() is None
    assert host("import time; time.sleep(1)").code == 0


def test_what_is_raised_while_the_host_is_prepared_leaves_everything_as_it_was(host, monkeypatch):
    """A time limit may run out before the host has begun."""

    class Late(BaseException):
        pass

    def late(*_):
        raise Late

    before = [time.sleep, time.time, threading.Thread.join, datetime.datetime, serialutil.Timeout.TIME]
    with monkeypatch.context() as patched:
        patched.setattr(windows, "loaded", late)
        with pytest.raises(Late):
            host("pass")
    assert here() is None
    now = [time.sleep, time.time, threading.Thread.join, datetime.datetime, serialutil.Timeout.TIME]
    assert before == now
    assert host("import time; time.sleep(1)").code == 0


def test_ctrl_c_that_the_host_does_not_catch_stops_the_test_runner(host):
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        host("import time\nwhile True: time.sleep(0.01)")
    assert here() is None


INTERRUPTED = """
import threading, time
def busy():
    while True: time.sleep(0.01)
try: threading.Thread(target=busy, daemon=True).start()
except KeyboardInterrupt: raise SystemExit(9)
time.sleep(10)
"""


@pytest.mark.parametrize("after", [False, True], ids=["before", "after"])
def test_ctrl_c_while_a_thread_starts(after, host, monkeypatch):
    """A thread in the row that never runs would be waited for without end."""
    started = cpython.started

    def interrupted(*words):
        if not after:
            signal.raise_signal(signal.SIGINT)
        result = started(*words)
        if after:
            signal.raise_signal(signal.SIGINT)
        return result

    monkeypatch.setattr(cpython, "started", interrupted)
    assert host(INTERRUPTED).code == 9
    assert here() is None


def test_ctrl_c_that_another_thread_gets(host):
    """It does not wake the main thread, as one that comes just before that one waits."""
    text = """
def busy():
    time.sleep(1)
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)
    while True: time.sleep(0.01)
threading.Thread(target=busy, daemon=True).start()
try: threading.Event().wait()
except KeyboardInterrupt: sys.exit(9)
"""
    assert host(OPEN + "import signal\n" + text).code == 9


def test_a_thread_that_cannot_start_is_not_waited_for(host, monkeypatch):
    def refused(*_):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(cpython, "started", refused)
    text = "try: threading.Thread(target=print).start()\nexcept RuntimeError: time.sleep(1); sys.exit(8)"
    assert host(OPEN + text).code == 8


def test_ctrl_c_during_a_call_of_the_port_comes_after_it(host, twin, monkeypatch):
    """And not at the next wait, which a host that computes does not come to."""
    write = twin.write

    def interrupted(data):
        signal.raise_signal(signal.SIGINT)
        write(data)

    monkeypatch.setattr(twin, "write", interrupted)
    text = "try: port.write(b'@07\\r')\nexcept KeyboardInterrupt: print(port.read()); sys.exit(9)"
    assert host(OPEN + text).code == 9


@pytest.mark.parametrize("moment", ["_end_threads", "_as_before"])
def test_ctrl_c_when_the_host_has_ended_leaves_nothing_of_it(moment, host, monkeypatch):
    now = getattr(VirtualTime, moment)

    def interrupted(self):
        signal.raise_signal(signal.SIGINT)
        now(self)

    monkeypatch.setattr(VirtualTime, moment, interrupted)
    before = [time.sleep, threading.Lock, signal.getsignal(signal.SIGINT)]
    with pytest.raises(KeyboardInterrupt):
        host("import threading, time\nthreading.Thread(target=time.sleep, args=(9,), daemon=True).start()")
    assert [time.sleep, threading.Lock, signal.getsignal(signal.SIGINT)] == before
    assert here() is None


def test_nothing_of_it_is_left(host, tmp_path):
    (tmp_path / "part_of_host.py").write_text("from time import sleep\n")
    before = [time.sleep, time.time, threading.Lock, threading.Thread.join, serial.Serial, datetime.datetime, os.fork]
    place, path, words, handler = os.getcwd(), list(sys.path), list(sys.argv), signal.getsignal(signal.SIGINT)
    done = host(
        "import os, sys, signal, logging, part_of_host\npart_of_host.sleep(1)\n"
        "os.chdir('/')\nos.environ['X_TWIN'] = '1'\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\nsignal.signal(signal.SIGUSR1, lambda *_: None)\n"
        "logging.basicConfig()\nsys.argv.append('x')\nraise SystemExit(4)"
    )
    assert done.code == 4
    assert before == [
        time.sleep,
        time.time,
        threading.Lock,
        threading.Thread.join,
        serial.Serial,
        datetime.datetime,
        os.fork,
    ]
    assert (os.getcwd(), sys.path, sys.argv, signal.getsignal(signal.SIGINT)) == (place, path, words, handler)
    assert signal.getsignal(signal.SIGUSR1) == signal.SIG_DFL
    assert "X_TWIN" not in os.environ
    assert "part_of_host" not in sys.modules
    assert here() is None


def test_other_threads_of_the_process_keep_the_real_time(host):
    seen = []
    stop = threading.Event()

    def watch():
        while not stop.is_set():
            began = time.monotonic()
            time.sleep(0.01)
            seen.append(time.monotonic() - began)

    thread = threading.Thread(target=watch)
    thread.start()
    done = host("import time\nfor _ in range(20000): time.sleep(0.1)")
    stop.set()
    thread.join()
    assert done.code == 0
    assert seen
    assert max(seen) < 60.0  # of the 2000 s of the host


def test_a_test_may_live_in_virtual_time_itself(twin):
    with VirtualTime(twin, "COM4"):
        port = serial.Serial("COM4", 19200, timeout=60)
        port.write(b"@07\r")
        assert port.read() == b"0"
        time.sleep(100)
    assert twin.time_ns >= 100_000_000_000
    assert time.time() > 1e9


def test_one_at_a_time(twin):
    with VirtualTime(twin), pytest.raises(RuntimeError, match="one at a time"), VirtualTime(twin):
        pass


def test_an_emergency_stop_of_a_scenario_comes_in_the_middle(tmp_path, capsys):
    scenario = tmp_path / "stop.toml"
    scenario.write_text('[[event]]\nat = 60.0\nset = { estop = "pressed" }\n')
    twin = Twin(plant="kinematic", line_speed=True, scenario=scenario)
    file = tmp_path / "host.py"
    file.write_text(
        ASK + "port.timeout = 50\nprint(ask('@07'), ask('@0R7'))\nwhile time.monotonic() < 1059.9: time.sleep(0.01)\n"
        "print(ask('@0M32000,1000,0,30,0,30,0,30'))"
    )
    assert run_host(twin, [str(file)], "COM4").code == 0
    replies = printed(capsys)
    assert replies[:2] == ["0", "0"]
    assert replies[2] != "0"


def test_the_same_host_twice_to_the_nanosecond(tmp_path, capsys):
    file = tmp_path / "host.py"
    file.write_text(
        ASK + "import random\nport.timeout = 90\nask('@07'), ask('@0R7')\n"
        "def run(n):\n    for _ in range(20): time.sleep(random.random()); print(n, time.time_ns())\n"
        "for n in range(4): threading.Thread(target=run, args=(n,)).start()\n"
    )
    seen = []
    for _ in range(2):
        twin = Twin(plant="kinematic", line_speed=True)
        seen.append((run_host(twin, [str(file)]), capsys.readouterr().out, twin.steps.t_ns.tobytes()))
    assert seen[0] == seen[1]


def test_a_python_without_what_threads_rest_on_is_named_in_one_line():
    code = "import queue, sys\ndel queue._PySimpleQueue\nfrom isel_twin.cli import main\nmain(['exec', 'host.py'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"isel-twin: virtual time needs queue._PySimpleQueue, which Python {version} does not have: "
        "use Python 3.11 to 3.14, or `isel-twin serve` in real time\n"
    )


def test_a_thread_that_reads_a_pipe_at_the_end_is_left(host, monkeypatch):
    """And the interpreter is told not to wait for it."""
    monkeypatch.setattr("isel_twin.bridge.virtual.turns.GRACE_S", 0.05)
    not_waited_for = []
    monkeypatch.setattr("isel_twin.bridge.virtual.turns.let_exit_without", lambda it: not_waited_for.append(it.name))
    read, write = os.pipe()
    stubborn = (
        "import os, sys, threading, time\n"
        "def wait():\n"
        "    try:\n        time.sleep(1e6)\n"
        "    finally:\n        os.read(int(sys.argv[1]), 1)\n"
        "threading.Thread(target=wait, name='stubborn', daemon=True).start()\ntime.sleep(1)\n"
    )
    try:
        assert host(stubborn, str(read)).left == ("stubborn",)
        assert not_waited_for == ["stubborn"]
    finally:
        os.write(write, b"x")
        os.close(write)


def test_what_a_library_of_the_test_runner_does_when_garbage_is_collected_is_not_the_hosts(host):
    """Hypothesis asks for the time then; in a host's thread that would be a change of turns amid another."""
    asked = []
    gc.callbacks.append(lambda phase, info: asked.append(phase))
    known = list(gc.callbacks)
    try:
        assert host("import gc, time\ngc.collect()\ngc.callbacks.append(print)\ntime.sleep(1)").code == 0
        assert not asked
        assert gc.callbacks == known
    finally:
        gc.callbacks.pop()
