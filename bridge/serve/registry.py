"""Which virtual ports are served on this computer now: one small file for each server, in the user's own folder.

    XDG_RUNTIME_DIR/isel-twin/ports/PID-NUMBER.json        Linux; LOCALAPPDATA on Windows; else the temporary folder
        {"pid": 4711, "command": "serve", "machine": "4030", "controller": "imc-s8",
         "ports": [{"kind": "pty", "address": "/tmp/imc", "device": "/dev/pts/7"}]}

A server keeps its file open and locked as long as it lives. A reader removes the file of one that was killed, told by
the lock, or on Windows by the fact that an open file cannot be removed; the number of a process may be somebody else's
by then. A folder that cannot be written to is no reason not to serve.
"""

from __future__ import annotations

import getpass
import itertools
import json
import logging
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

log = logging.getLogger("isel_twin")

_numbers = itertools.count()


def folder() -> Path:
    """Where this user's servers are written down; it may be missing."""
    for variable in ("XDG_RUNTIME_DIR", "LOCALAPPDATA"):
        if (place := os.environ.get(variable)) and os.path.isdir(place):
            return Path(place, "isel-twin", "ports")
    return Path(tempfile.gettempdir(), f"isel-twin-{_user()}", "ports")


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # nobody knows
        return "user"


@contextmanager
def registered(content: Mapping[str, Any]) -> Iterator[None]:
    """While the block lasts, this server is found by `served`. Never raises by itself."""
    file: IO[str] | None = None
    path = folder() / f"{os.getpid()}-{next(_numbers)}.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        file = _held(path, json.dumps({"pid": os.getpid(), **content}))
    except OSError as error:
        log.info("%s: not written down for `isel-twin ports`: %s", path, error.strerror or error)
    try:
        yield
    finally:
        if file is not None:
            if sys.platform == "win32":
                file.close()  # or it cannot be removed
            with suppress(OSError):
                path.unlink()
            file.close()


def _held(path: Path, text: str) -> IO[str]:
    """A file of this process that others can read but not take for abandoned, from the moment it has its name."""
    temporary = path.with_suffix(".new")
    file = open(temporary if sys.platform != "win32" else path, "w", encoding="utf-8")  # noqa: SIM115
    try:
        _lock(file)
        file.write(text)
        file.flush()
        if sys.platform != "win32":  # which renames no open file
            temporary.rename(path)
    except BaseException:
        file.close()
        temporary.unlink(missing_ok=True)
        raise
    return file


def _lock(file: IO[str]) -> bool:
    """Lock a file for oneself; False: somebody has it, or there are no locks."""
    try:
        import fcntl
    except ImportError:  # Windows
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def served() -> list[dict[str, Any]]:
    """What the living servers have written down, the oldest first. Files of those that were killed are removed."""
    try:
        paths = sorted(folder().glob("*.json"), key=lambda path: (path.stat().st_mtime_ns, path.name))
    except OSError:
        return []
    return [content for path in paths if (content := _living(path)) is not None]


def _living(path: Path) -> dict[str, Any] | None:
    try:
        if sys.platform == "win32":
            with suppress(PermissionError):
                path.unlink()
                return None
        with path.open(encoding="utf-8") as file:
            if sys.platform != "win32" and _lock(file):
                path.unlink()
                return None
            content = json.load(file)
    except (OSError, ValueError):  # it has gone meanwhile, or is being written
        return None
    return content if isinstance(content, dict) and isinstance(content.get("ports"), list) else None
