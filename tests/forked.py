"""Processes of the command line, forked from one that has imported everything: a tenth of the work of a start.

All workers of a session share one such process (`share`); it imports when somebody first asks it for something.

Each is as real as one that was started: it has its own number, signals, files, and end of the interpreter. What shows
the start itself (imports, compiling, what is read from the environment by then) needs `subprocess`.

Bare ones have been imported, and run, as on a computer without what only POSIX has (tests/bare.py).
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import gc
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

PIPE = subprocess.PIPE
REQUEST_BYTES = 1 << 18
NUMBER = struct.Struct("i")
BARE = "bare"
SHARED = "ISEL_TWIN_TESTS_TEMPLATE"
"""Variable of the environment: the address (Linux, abstract) of the template of all workers."""
PATIENCE_S = 900.0
"""Longest wait of a test for what must come, however busy the computer is: only what never comes takes that long."""


def start(*words: object, **options: Any) -> Any:
    """`isel-twin words...`, as `subprocess.Popen` with text in pipes. Options: cwd, stdin, stdout, stderr and
    start_new_session; bare: see above."""
    if sys.platform != "linux":
        return start_anew(*words, **options)
    return Forked([str(word) for word in words], **options)


def start_anew(*words: object, bare: bool = False, **options: Any) -> subprocess.Popen[str]:
    """The same with an interpreter that has imported nothing."""
    program = [str(Path(__file__).with_name("bare.py"))] if bare else ["-m", "isel_twin"]
    command = [sys.executable, *program, *map(str, words)]
    return subprocess.Popen(command, text=True, **{"stdout": PIPE, "stderr": PIPE, **options})


def run(*words: object, input: str = "", start: Any = start, **options: Any) -> subprocess.CompletedProcess[str]:
    """`isel-twin words...` to its end, as `subprocess.run` with text in pipes."""
    with start(*words, **{"stdin": PIPE, **options}) as process:
        try:
            out, err = process.communicate(input if process.stdin else None, timeout=PATIENCE_S)
        finally:
            process.kill()
    return subprocess.CompletedProcess([*words], process.returncode, out, err)


class Forked:
    """A forked process. What it has in common with `subprocess.Popen` means the same."""

    def __init__(
        self,
        words: Sequence[str],
        cwd: Path | str = ".",
        stdin: Any = None,
        stdout: Any = PIPE,
        stderr: Any = PIPE,
        start_new_session: bool = False,
        bare: bool = False,
    ) -> None:
        self.returncode: int | None = None
        self._news, news = socket.socketpair()
        with contextlib.ExitStack() as handed_over:
            files = []
            pipes = []
            for number, file in enumerate((stdin, stdout, stderr)):
                pipe = None
                if file == PIPE:
                    ends = os.pipe()
                    file, mine = (ends[0], ends[1]) if number == 0 else (ends[1], ends[0])
                    handed_over.callback(os.close, file)
                    pipe = os.fdopen(mine, "w" if number == 0 else "r", encoding="utf-8")
                files.append(number if file is None else file if isinstance(file, int) else file.fileno())
                pipes.append(pipe)
            self.stdin, self.stdout, self.stderr = pipes
            handed_over.callback(news.close)
            request = {
                "words": words,
                "folder": os.path.abspath(cwd),
                "environment": dict(os.environ),
                "session": start_new_session,
            }
            socket.send_fds(_template(bare), [json.dumps(request).encode()], [*files, news.fileno()])
        self.pid = NUMBER.unpack(self._news.recv(NUMBER.size))[0]

    def __enter__(self) -> Forked:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is not None:  # who fails does not wait for what may never end
            self.kill()
        for pipe in (self.stdin, self.stdout, self.stderr):
            if pipe is not None:
                pipe.close()
        self.wait()

    def poll(self) -> int | None:
        return self._ended(0.0)

    def wait(self, timeout: float | None = None) -> int:
        code = self._ended(timeout)
        if code is None:
            raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0.0)
        return code

    def _ended(self, timeout: float | None) -> int | None:
        if self.returncode is None and select.select([self._news], [], [], timeout)[0]:
            self.returncode = NUMBER.unpack(self._news.recv(NUMBER.size))[0]
            self._news.close()
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):  # it ends just now, and nobody has said so yet
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, input: str | None = None, timeout: float | None = None) -> tuple[str, str]:
        texts = {1: "", 2: ""}

        def read(number: int, pipe: Any) -> None:
            with pipe:
                texts[number] = pipe.read()

        pipes = {1: self.stdout, 2: self.stderr}
        readers = [threading.Thread(target=read, args=one, daemon=True) for one in pipes.items() if _open(one[1])]
        for reader in readers:
            reader.start()
        if _open(self.stdin):
            with contextlib.suppress(BrokenPipeError), self.stdin as pipe:
                pipe.write(input or "")
        self.wait(timeout)
        for reader in readers:
            reader.join(PATIENCE_S)
        return texts[1], texts[2]


def _open(pipe: Any) -> bool:
    return pipe is not None and not pipe.closed


@functools.cache
def share() -> socket.socket:
    """Have the processes that are started from here on ask one template, which ends when this process does."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind("")  # a free abstract address
        listener.listen()
        os.environ[SHARED] = listener.getsockname()[1:].decode()
        return _begin(listener.fileno())


@functools.cache
def _template(bare: bool) -> socket.socket:
    """The line to the template: the shared one, or one that ends when this process does."""
    if bare or SHARED not in os.environ:
        return _begin(*[BARE] * bare)
    line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    line.connect(f"\0{os.environ[SHARED]}")
    return line


def _begin(*how: object) -> socket.socket:
    """The line to a new template. how: BARE, or the number of a file at which others ask."""
    mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with its:
        words = [sys.executable, "-m", "tests.forked", *map(str, (its.fileno(), *how))]
        files = [its.fileno(), *[file for file in how if isinstance(file, int)]]
        subprocess.Popen(words, cwd=Path(__file__).parents[1], pass_fds=files)
    return mine


# ---- in the template ------------------------------------------------------------------------------------------------


fork, no_hang = getattr(os, "fork", None), getattr(os, "WNOHANG", 0)  # a bare template hides them from what it forks


def _be_template(line: socket.socket, *how: str) -> None:
    """Fork for each request until who has begun this one has gone."""
    assert fork is not None
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    bare = BARE in how
    if bare:
        from tests.bare import hide

        hide()
    listeners = [socket.socket(fileno=int(file)) for file in how if not bare]
    lines, ready = [line], False
    while True:
        for one in select.select([*lines, *listeners], [], [])[0]:
            if one in listeners:
                lines.append(one.accept()[0])
                continue
            request, files, *_ = socket.recv_fds(one, REQUEST_BYTES, 4)
            if request and not ready:
                _import_everything(bare)
                ready = True
            if request and fork() == 0:
                for each in (*lines, *listeners):
                    each.close()
                _be_keeper(json.loads(request), files)
            for file in files:
                os.close(file)
            if not request and one is line:
                return
            if not request:
                lines.remove(one)
                one.close()
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, no_hang)[0]:
                pass


def _import_everything(bare: bool) -> None:
    from tests.in_process import isel_twin

    for plant in ("kinematic", "mujoco"):
        isel_twin("run", "-", "--plant", plant, stdin="@07\n")
        if not bare:
            isel_twin("exec", "--plant", plant, "--", "python", "-c", "import serial")
        isel_twin("serve", "--plant", plant, "--tcp", "nowhere")
    gc.collect()
    gc.freeze()


def _be_keeper(request: dict[str, Any], files: list[int]) -> NoReturn:
    """The parent of the process; tells who it is and how it ended."""
    *files, news = files
    assert fork is not None
    pid = fork()
    if pid == 0:
        os.close(news)
        if request["session"]:
            os.setsid()
        _be_command(request, files)
    os.closerange(0, 3)  # who reads what the tests print does not wait for it
    for file in files:
        os.close(file)
    os.write(news, NUMBER.pack(pid))
    _, status = os.waitpid(pid, 0)
    with contextlib.suppress(BrokenPipeError):
        os.write(news, NUMBER.pack(os.waitstatus_to_exitcode(status)))
    os._exit(0)


def _be_command(request: dict[str, Any], files: list[int]) -> NoReturn:
    from isel_twin.cli import main

    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    sys.dont_write_bytecode = True  # whose files may not grow would leave half of one for all others
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.stdin = sys.__stdin__ = os.fdopen(0, closefd=False)
    sys.stdout = sys.__stdout__ = os.fdopen(1, "w", closefd=False)
    sys.stderr = sys.__stderr__ = os.fdopen(2, "w", errors="backslashreplace", buffering=1, closefd=False)
    sys.argv = ["isel-twin", *request["words"]]
    sys.path[0] = ""
    atexit.register(gc.freeze)  # or the last act of the interpreter is to look at all there is
    main()
    raise SystemExit


if __name__ == "__main__":
    _be_template(socket.socket(fileno=int(sys.argv[1])), *sys.argv[2:])
