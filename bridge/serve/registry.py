"""Which virtual ports are served on this computer now: one small file for each server, in the user's own folder.

    XDG_RUNTIME_DIR/isel-twin/ports/PID-NUMBER.json        Linux; LOCALAPPDATA on Windows; else the temporary folder
        {"pid": 4711, "command": "serve", "machine": "4030", "controller": "imc-s8",
         "ports": [{"kind": "pty", "address": "/tmp/imc", "device": "/dev/pts/7"}]}

A server keeps its file open and locked while it runs. A reader removes the file of a killed one, detected by the lock
(on Windows an open file cannot be removed), as process numbers are reused. Without a writable folder the server runs
unlisted.

The temporary folder belongs to all users: somebody else could have prepared a folder of that name there, with links to
files of this user. So the folders must be this user's own and closed to others, and files are made, never opened: else
the server runs unlisted and says so.
"""

from __future__ import annotations

import errno
import getpass
import itertools
import json
import logging
import os
import stat
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from typing import IO, Any

from isel_twin.base.files import create, try_lock
from isel_twin.base.parameters import parse_json

log = logging.getLogger("isel_twin")

_numbers = itertools.count()


def folder() -> Path:
    """The folder of this user's servers; it may be missing."""
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
    """List this server for `served` during the block. Never raises by itself."""
    file: IO[str] | None = None
    path = folder() / f"{os.getpid()}-{next(_numbers)}.json"
    try:
        path.parent.parent.parent.mkdir(parents=True, exist_ok=True)
        for place in (path.parent.parent, path.parent):  # nothing is made in one of somebody else's
            place.mkdir(exist_ok=True, mode=0o700)
            _require_own(place)
        file = _held(path, json.dumps({"pid": os.getpid(), **content}))
    except OSError as error:
        foreign = isinstance(error, ForeignError)
        told = log.warning if foreign else log.info
        told(
            "%s: not written down for `isel-twin ports`: %s", path.parent if foreign else path, error.strerror or error
        )
    try:
        yield
    finally:
        if file is not None:
            if sys.platform == "win32":
                file.close()  # needed to remove it
            with suppress(OSError):
                path.unlink()
            file.close()


class ForeignError(PermissionError):
    """A folder of the registry is not this user's own."""


def _require_own(*places: Path) -> None:
    """Raise ForeignError unless these are real folders of this user that nobody else may write to."""
    if not hasattr(os, "getuid"):  # Windows: each user has a temporary folder of his own
        return
    for place in places:
        found = place.lstat()
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o022:
            raise ForeignError(errno.EPERM, f"{place} is not a folder of this user alone; remove it")


def _held(path: Path, text: str) -> IO[str]:
    """A file of this process that is locked from the moment it has its name."""
    temporary = path.with_suffix(".new")
    made = temporary if sys.platform != "win32" else path
    made.unlink(missing_ok=True)  # of a killed process of that number
    file = TextIOWrapper(create(made, 0o600), encoding="utf-8")
    try:
        try_lock(file.fileno())
        file.write(text)
        file.flush()
        if sys.platform != "win32":  # which cannot rename an open file
            temporary.rename(path)
    except BaseException:
        file.close()
        temporary.unlink(missing_ok=True)
        raise
    return file


def served() -> list[dict[str, Any]]:
    """The entries of running servers, the oldest first. Files of killed ones are removed."""
    try:
        _require_own(folder().parent, folder())
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
            if sys.platform != "win32" and try_lock(file.fileno()):
                path.unlink()
                return None
            content = parse_json(file.read())
    except (OSError, ValueError):  # it was removed meanwhile, or is being written
        return None
    return content if isinstance(content, dict) and isinstance(content.get("ports"), list) else None
