"""The command line in this process: as a process of its own, but for two seconds of imports."""

from __future__ import annotations

import contextlib
import io
import logging
import sys
from subprocess import CompletedProcess

from isel_twin.base.printable import ShownStream
from isel_twin.cli import main


def isel_twin(*arguments: object, stdin: str = "") -> CompletedProcess[str]:
    """What `isel-twin arguments...` prints, and its exit code."""
    words = [str(argument) for argument in arguments]
    out, err, given = (io.TextIOWrapper(io.BytesIO(data), "utf-8") for data in (b"", b"", stdin.encode()))
    root = logging.getLogger()
    handlers, root.handlers = root.handlers, []  # pytest's: the log goes to standard error, as without it
    before, sys.stdin = sys.stdin, given
    code: object = 0
    try:
        with contextlib.redirect_stdout(ShownStream(out)), contextlib.redirect_stderr(ShownStream(err)):
            main(words)
    except SystemExit as ended:
        code = ended.code
    finally:
        sys.stdin, root.handlers = before, handlers
    assert code is None or isinstance(code, int), code
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode())  # type: ignore[attr-defined]
    return CompletedProcess(words, code or 0, *texts)
