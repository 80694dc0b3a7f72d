"""A host program in Python, unmodified, in this process and in virtual time: `isel-twin exec` and tests.

    twin = Twin("4030", "imc-s8", "kinematic", line_speed=True)
    run = run_host(twin, ["host.py", "--port", "COM4"], port="COM4")
    assert run.code == 0 and run.verdict.ok

The host is run as by `python host.py ...`: its folder first in `sys.path`, its words in `sys.argv`, its module
`__main__`. Its changes of the process are undone afterwards: signal handlers, folder, environment, `sys.path`, its own
modules, handlers of the root logger, state of `random`.

How it ends                                          code
    its last line, `sys.exit()`                      0, as in Python the number given; 1 for a text, which is printed
    an uncaught exception                            1, traceback printed
    an uncaught Ctrl-C                               130
    deadlock: all threads wait for ever              1, and `reason` says who waits where
    the limit of virtual time                        1, and `reason` says so
    something virtual time cannot do                 2, and `reason` says what, where, and what to do

Virtual time and the cost of looks: `isel_twin.bridge.virtual.turns`.
"""

from __future__ import annotations

import gc
import importlib.util
import logging
import os
import random
import runpy
import sys
import threading
import traceback
import types
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isel_twin.base.errors import CallError
from isel_twin.bridge.serve.borders import WireTap
from isel_twin.bridge.virtual.cpython import pools_told_to_end
from isel_twin.bridge.virtual.host_code import LIBRARIES
from isel_twin.bridge.virtual.host_thread import HostEnded
from isel_twin.bridge.virtual.virtual_time import VirtualTime
from isel_twin.jobs.verdict import Verdict, judge

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

INTERRUPTED = 130  # exit code of a host that Ctrl-C has ended, as a shell tells it
_HARMLESS = ("-u", "-B", "-s", "-E", "-I", "-P")  # options of the interpreter that change nothing here


@dataclass(frozen=True)
class HostProgram:
    """The program and arguments of `python ...`."""

    arguments: tuple[str, ...] = ()  # what comes after it
    path: str | None = None  # a script, or a folder or archive with a `__main__.py`, as typed
    module: str | None = None
    code: str | None = None


@dataclass(frozen=True)
class HostRun:
    """The outcome of a host and its machine."""

    code: int  # exit code of the host
    ending: str  # `exit`, `exception`, `interrupt`, `deadlock`, `timeout` or `refused`
    reason: str  # one line for people, if it was one of the last three
    began_ns: int
    ended_ns: int  # virtual time when the last thread of the host had ended
    verdict: Verdict  # on the machine, at rest after that; it counts no commands
    struck: tuple[str, ...]  # end switches that are struck then
    was_struck: tuple[str, ...]  # end switches that were struck at any time, in reference runs too
    notes: tuple[str, ...] = ()  # problems that a real machine would have had, and threads ended by an exception
    left: tuple[str, ...] = ()  # threads that did not end with the host; they are blocked for good

    @property
    def ok(self) -> bool:
        """True if the host ended with code 0, without lost steps or a remaining fault."""
        return self.code == 0 and self.verdict.ok


def parse_program(words: Sequence[str]) -> HostProgram:
    """`python host.py ...`, `python -m host ...`, `/path/of/python ...`, `host.py ...`; else raises CallError."""
    if not words:
        raise CallError("there is no host program; give one: exec -- python host.py")
    first, rest = words[0], list(words[1:])
    if not Path(first).name.removesuffix(".exe").startswith(("python", "pypy")) or first.endswith(".py"):
        if not _is_python(Path(first)):
            raise CallError(
                f"{first}: only Python programs run in virtual time (exec -- python host.py); "
                "for others start `isel-twin serve --pty` and give them its port"
            )
        rest = list(words)
    while rest and rest[0] in _HARMLESS:
        rest.pop(0)
    if not rest:
        raise CallError(f"{first}: there is no program after it; give one: exec -- python host.py")
    if rest[0] in ("-m", "-c"):
        if len(rest) < 2:
            raise CallError(f"{first} {rest[0]}: there is nothing after it")
        if rest[0] == "-m":
            return HostProgram(tuple(rest[2:]), module=rest[1])
        return HostProgram(tuple(rest[2:]), code=rest[1])
    if rest[0].startswith("-"):
        raise CallError(f"{first} {rest[0]}: of Python's options -m, -c and {', '.join(_HARMLESS)} are understood")
    if not Path(rest[0]).exists():
        raise CallError(f"{rest[0]}: there is no such file")
    return HostProgram(tuple(rest[1:]), path=rest[0])


def _is_python(file: Path) -> bool:
    """True if a file named without an interpreter is a Python program, by its name or its first line."""
    if file.suffix in (".py", ".pyz") or file.is_dir():
        return True
    try:
        with file.open("rb") as content:
            first = content.readline(200)
    except OSError:
        return False
    return first.startswith(b"#!") and b"python" in first


def run_host(
    twin: Twin,
    argv: Sequence[str] | HostProgram,
    port: str | None = None,
    *,
    wire: WireTap | None = None,
    limit_s: float | None = None,
    give_up: Callable[[VirtualTime], object] | None = None,
    raise_interrupt: bool = True,
) -> HostRun:
    """Run a host program until it and its threads have ended, and judge the machine.

    argv: as for `parse_program`; `python` in front is optional. port: name of the twin's serial port; None: every port
    that the host opens, one at a time. wire: gets the traffic. limit_s: virtual seconds after which the host is ended.
    give_up: called if the host does not end when it must, for processes that can end themselves. raise_interrupt: raise
    an uncaught Ctrl-C again, for test runners; False: it ends the host with code 130.

    A twin with `line_speed` gives bytes their time on the line, as a real one does. Raises CallError if there is
    nothing to run, RuntimeError if a host is running in this process already, and what goes wrong in the twin itself.
    """
    program = argv if isinstance(argv, HostProgram) else parse_program(argv)
    began_ns = twin.time_ns
    struck = _Struck(twin)
    with _put_back(), VirtualTime(twin, port, wire=wire, limit_s=limit_s) as time:
        if give_up is not None:
            time.give_up = lambda: give_up(time)
        try:
            code, ending = _run(program, time)
        except KeyboardInterrupt:  # between two calls of the host
            code, ending = INTERRUPTED, "interrupt"
        time.over()
    if time.broken is not None:
        raise time.broken
    if ending == "interrupt" and raise_interrupt:
        raise KeyboardInterrupt
    ended_ns = twin.time_ns
    reason = ""
    if time.ending is not None and time.ending.kind in ("deadlock", "timeout", "refused"):
        ending, reason = time.ending.kind, time.ending.reason
        code = 2 if ending == "refused" else 1
    verdict = judge(twin, (), host_since_ns=began_ns)
    seen, notes, left = tuple(sorted(struck.seen)), tuple(time.ports.notes), tuple(time.left)
    return HostRun(code, ending, reason, began_ns, ended_ns, verdict, struck.now(twin), seen, notes, left)


class _Struck:
    def __init__(self, twin: Twin) -> None:
        self.seen: set[str] = set()
        twin.observe(lambda twin: self.seen.update(self.now(twin)), 1 << 60)

    def now(self, twin: Twin) -> tuple[str, ...]:
        return tuple(sorted(name for name, state in twin.inputs.items() if state == "struck"))


# As an interpreter would run it


def _run(program: HostProgram, time: VirtualTime) -> tuple[int, str]:
    """Run the program, its threads and its exit functions; return its exit code and how it ended."""
    code, ending = _guarded(lambda: _execute(program), time)
    if time.ending is None:
        rest_code, rest_ending = _guarded(lambda: _wait_for_threads(time), time)
        if rest_ending != "exit":
            code, ending = rest_code, rest_ending
    while time.at_exit and time.ending is None:
        function, args, kwargs = time.at_exit.pop()
        _guarded(lambda function=function, args=args, kwargs=kwargs: function(*args, **kwargs), time)
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    return code, ending


def _wait_for_threads(time: VirtualTime) -> None:
    """Wait for the host's threads, after telling executors to end."""
    with pools_told_to_end(time.task_of) as workers:
        for worker in workers:
            worker.join()
    time.wait_for_threads()


def _guarded(call: Any, time: VirtualTime) -> tuple[int, str]:
    """Exit code and ending of a call; uncaught exceptions are printed as by an interpreter."""
    try:
        call()
    except HostEnded:
        return 1, "exit"
    except SystemExit as error:
        return _exit_code(error), "exit"
    except KeyboardInterrupt as error:
        _print(error)
        return INTERRUPTED, "interrupt"
    except Exception as error:  # BaseException, such as a test runner's time limit, is not the host's
        if time.ending is None:
            _print(error)
        return 1, "exception"
    return 0, "exit"


def _exit_code(error: SystemExit) -> int:
    if error.code is None:
        return 0
    if isinstance(error.code, int):
        return error.code & 0xFF
    print(error.code, file=sys.stderr)
    return 1


def _print(error: BaseException) -> None:
    """Print the traceback, without the calls in which the host is run."""
    tb = error.__traceback__
    while tb is not None and _ours(tb.tb_frame.f_code.co_filename):
        tb = tb.tb_next
    if sys.stdout is not None:
        sys.stdout.flush()
    hook = sys.excepthook
    try:
        if hook is sys.__excepthook__:
            traceback.print_exception(type(error), error, tb)
        else:
            hook(type(error), error, tb)
    except Exception:
        traceback.print_exc()


def _ours(file: str) -> bool:
    return file in (__file__, runpy.__file__) or file.startswith("<frozen")


def _execute(program: HostProgram) -> None:
    if program.module is not None:
        sys.path.insert(0, os.getcwd())
        sys.argv[:] = ["-m", *program.arguments]
        try:
            found = importlib.util.find_spec(program.module)
        except (ImportError, ValueError) as error:  # in the words of Python
            why = f"Error while finding module specification for {program.module!r} ({type(error).__name__}: {error})"
            raise SystemExit(f"{sys.executable}: {why}") from None
        if found is None:
            raise SystemExit(f"{sys.executable}: No module named {program.module}")
        runpy.run_module(program.module, run_name="__main__", alter_sys=True)
        return
    if program.code is not None:
        sys.path.insert(0, "")
        sys.argv[:] = ["-c", *program.arguments]
        _as_main(compile(program.code, "<string>", "exec"), None)
        return
    assert program.path is not None
    sys.argv[:] = [program.path, *program.arguments]
    path = Path(program.path).absolute()
    if path.is_dir() or path.suffix == ".pyz":
        runpy.run_path(str(path), run_name="__main__")
        return
    sys.path.insert(0, str(path.resolve().parent))
    _as_main(compile(path.read_bytes(), str(path), "exec", dont_inherit=True), str(path))


def _as_main(code: types.CodeType, file: str | None) -> None:
    module = types.ModuleType("__main__")
    if file is not None:
        module.__file__ = file
    module.__dict__["__builtins__"] = __builtins__
    sys.modules["__main__"] = module
    exec(code, module.__dict__)


@contextmanager
def _put_back() -> Iterator[None]:
    """Undo a host's changes of the process, and remove its modules."""
    argv, path, folder, environment = list(sys.argv), list(sys.path), os.getcwd(), dict(os.environ)
    streams = sys.stdin, sys.stdout, sys.stderr, sys.excepthook, threading.excepthook
    root = logging.getLogger()
    handlers, level = list(root.handlers), root.level
    log = logging.getLogger("isel_twin")
    its_handlers, propagates = list(log.handlers), log.propagate
    collected = list(gc.callbacks)
    chance = random.getstate()
    own = {name: module for name, module in sys.modules.items() if name == "__main__"}
    before = set(sys.modules)
    random.seed(0)
    gc.callbacks.clear()  # hypothesis's asks for the time, amid a change of turns
    root.handlers.clear()  # the host starts without handlers, as in its own process
    root.setLevel(logging.WARNING)
    if propagates:
        log.handlers += handlers  # the twin's messages keep their handlers
        log.propagate = False
    sys.excepthook, threading.excepthook = sys.__excepthook__, threading.__excepthook__
    try:
        with warnings.catch_warnings():
            yield
    finally:
        random.setstate(chance)
        gc.callbacks[:] = collected
        for name in set(sys.modules) - before:
            file = getattr(sys.modules[name], "__file__", None)
            if file is not None and not file.startswith(LIBRARIES):
                del sys.modules[name]
        sys.modules.update(own)
        log.handlers[:], log.propagate = its_handlers, propagates
        root.handlers[:] = handlers
        root.setLevel(level)
        sys.stdin, sys.stdout, sys.stderr, sys.excepthook, threading.excepthook = streams
        os.chdir(folder)
        if dict(os.environ) != environment:
            os.environ.clear()
            os.environ.update(environment)
        sys.argv[:], sys.path[:] = argv, path
