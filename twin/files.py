"""Files that are never seen half written.

A file is written under a temporary name in the same folder, flushed to the disk, and only then renamed over the old
one; the folder is flushed too, so that a power cut leaves the old file or the new one:

    write .NAME.PID.tmp -> fsync -> rename to NAME -> fsync folder
"""

from __future__ import annotations

import glob
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from isel_twin.twin import Twin

__all__ = ["FlashFile", "atomic_write", "replacing"]

log = logging.getLogger("isel_twin")


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path to write to; it replaces `path` when the block ends, and is removed when it raises.

    A symbolic link is followed, so the link stays and its target is replaced. Devices and pipes (/dev/stdout) cannot be
    replaced and are handed through. Raises OSError.
    """
    given, target = Path(path), Path(os.path.realpath(path))
    if given.exists() and not given.is_file():  # a pipe behind /dev/stdout has no path of its own
        if given.is_dir():
            raise IsADirectoryError(21, "is a folder, not a file", str(path))
        yield given
        return
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        if target.exists():
            temporary.chmod(target.stat().st_mode)
        _flush(temporary)
        temporary.replace(target)
        _flush(target.parent)
    except OSError as error:
        if error.filename is not None and Path(error.filename) == temporary:
            error.filename = str(path)  # what the user named, not what we made of it
        raise
    finally:
        temporary.unlink(missing_ok=True)


def atomic_write(path: str | os.PathLike[str], data: bytes) -> None:
    """Replace the contents of `path` by `data`, or leave it as it was. Raises OSError."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def _flush(path: Path) -> None:
    """Wait until a file or folder is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _remove_left_overs(target: Path) -> None:
    """Remove temporary files of processes that were killed while they replaced `target`."""
    for temporary in target.parent.glob(f".{glob.escape(target.name)}.*.tmp"):
        pid = temporary.name.split(".")[-2]
        if pid.isdigit() and not _alive(int(pid)):
            with suppress(OSError):
                temporary.unlink()


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    return True


class FlashFile:
    """A controller's flash memory in a file.

    `image` is what the file held, None for a new device; once `attach` has named the twin, the file follows its flash
    and exists. Raises OSError if the file cannot be read or written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        _remove_left_overs(Path(os.path.realpath(path)))
        self.image = (path.read_bytes() or None) if path.exists() else None

    def attach(self, twin: Twin) -> None:
        """Keep what this twin writes to its flash. A flash nobody has written to yet is an empty file."""
        if twin.flash != self.image or self.image is None:
            atomic_write(self._path, twin.flash or b"")
        twin.on_flash = self._store

    def _store(self, image: bytes) -> None:
        try:
            atomic_write(self._path, image)
        except OSError as error:  # the machine runs on; its operator must know
            log.error("%s: the flash image could not be stored: %s", self._path, error.strerror or error)
