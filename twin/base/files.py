"""Files that are never seen half written, and files with one owner at a time.

A file is written under a temporary name in the same folder, flushed to the disk, and only then renamed over the old
one; the folder is flushed too, so that a power cut leaves the old file or the new one:

    write .NAME.PID-NUMBER.tmp -> fsync -> rename to NAME -> fsync folder

A file that is kept up to date is claimed, within this process and, where the operating system has `flock`, among all
processes. The lock is on .NAME.lock beside it and ends with the process. Only a killed process leaves the empty lock
file behind, which does no harm (bridge/4).
"""

from __future__ import annotations

import errno
import gc
import itertools
import logging
import os
import threading
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

log = logging.getLogger("isel_twin")

_numbers = itertools.count()
_WINDOWS = os.name == "nt"
_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}


def kind_of(path: str | os.PathLike[str], kinds: Sequence[str], bare: bool = False) -> str:
    """The kind of a file, one of `kinds`, by the ending of its name; bare: without an ending it is the first of them.
    Raises ValueError."""
    kind = Path(path).suffix.lower()
    if kind in kinds or (bare and not kind):
        return kind or kinds[0]
    raise ValueError(f"{path}: the name must end in {' or '.join(filter(None, (', '.join(kinds[:-1]), kinds[-1])))}")


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path to write to. It replaces `path` when the block ends and is removed if the block raises.

    A symbolic link is followed, so the link stays and its target is replaced. Devices and pipes (/dev/stdout) cannot be
    replaced and are written to directly. Raises OSError, which names the path.
    """
    given, target = Path(path), Path(os.path.realpath(path))
    if given.exists() and not given.is_file():  # a pipe behind /dev/stdout has no path of its own
        if given.is_dir():
            raise IsADirectoryError(errno.EISDIR, "is a folder, not a file", str(path))
        with _full_disk_names(path):
            yield given
        return
    temporary = target.with_name(f".{target.name}.{os.getpid()}-{next(_numbers)}.tmp")
    try:
        with _full_disk_names(path):
            yield temporary
        if target.exists():
            temporary.chmod(target.stat().st_mode)
        _flush(temporary)
        temporary.replace(target)
        _flush(target.parent)
    except OSError as error:
        if str(temporary) in (str(error.filename), str(error.filename2)):
            error.filename, error.filename2 = str(path), None  # the name that the user gave
        raise
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def _full_disk_names(path: str | os.PathLike[str]) -> Iterator[None]:
    """Give the error of a full disk, which knows a descriptor and no file, this path for its name."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno in _FULL:
            error.filename = str(path)
        raise


def atomic_write(path: str | os.PathLike[str], data: bytes) -> None:
    """Replace the contents of `path` by `data`, or leave it as it was. Raises OSError."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def _flush(path: Path) -> None:
    if _WINDOWS and path.is_dir():
        return  # Windows cannot open a folder, and its file system keeps a journal of names
    handle = os.open(path, os.O_RDWR if _WINDOWS else os.O_RDONLY)  # Windows flushes only what is open for writing
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


# ---- one owner -----------------------------------------------------------------------------------------------------

_claims: weakref.WeakValueDictionary[str, Claim] = weakref.WeakValueDictionary()
_claiming = threading.Lock()


class Claim:
    """Ownership of a path, until `release`, garbage collection or the end of the process.

    Raises OSError (EBUSY) if it has another owner. The path may be of any kind and need not exist. In a read-only
    folder the claim holds within this process only. `name`: what the user calls it, for the error.
    """

    def __init__(self, path: str | os.PathLike[str], name: str | os.PathLike[str] | None = None) -> None:
        name = os.fspath(name or path)
        folder, base = os.path.split(os.path.abspath(path))
        self._key = os.path.join(os.path.realpath(folder), base)
        with _claiming:
            if self._key in _claims:
                gc.collect()  # its owner may be garbage already
            if self._key in _claims:
                raise _in_use(name, os.getpid())
            lock = os.path.join(os.path.dirname(self._key), f".{base}.lock")
            handle, self.abandoned = _lock(name, lock)  # True if its last owner was killed
            _claims[self._key] = self
        self._finalizer = weakref.finalize(self, _unlock, os.getpid(), handle, lock)

    def release(self) -> None:
        """End the ownership. May be called again."""
        with _claiming:
            if _claims.get(self._key) is self:
                del _claims[self._key]
        self._finalizer()


def _in_use(name: str, pid: int) -> OSError:
    who = "this process" if pid == os.getpid() else f"process {pid}" if pid else "another process"
    return OSError(errno.EBUSY, f"is in use by another twin, in {who}; stop that one or choose another name", name)


def _lock(name: str, lock: str) -> tuple[int | None, bool]:
    """Descriptor of the locked file `lock` (None: no locks here), and True if the file existed before.

    Raises OSError if it has an owner.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        return None, False
    while True:
        handle, found = _open_lock(lock)
        if handle is None:
            return None, False
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(handle, 20)
            os.close(handle)
            raise _in_use(name, int(owner) if owner.isdigit() else 0) from None
        except OSError:  # a file system without locks
            os.close(handle)
            return None, found
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), os.stat(lock)):
                with suppress(OSError):  # read-only, or a full disk: the owner stays unknown
                    os.ftruncate(handle, 0)
                    os.write(handle, b"%d" % os.getpid())
                return handle, found
        os.close(handle)  # its last owner has removed it while we waited for it


def _open_lock(lock: str) -> tuple[int | None, bool]:
    """Descriptor of the lock file (None: it can be neither made nor opened), and True if it existed before.

    Another user's file can only be read, which is enough to lock it.
    """
    while True:
        errors: list[type[OSError]] = []
        for flags, found in ((os.O_RDWR | os.O_CREAT | os.O_EXCL, False), (os.O_RDWR, True), (os.O_RDONLY, True)):
            try:
                return os.open(lock, flags | os.O_CLOEXEC, 0o666), found
            except OSError as error:
                errors.append(type(error))
        came_and_went = (errors[0], errors[-1]) == (FileExistsError, FileNotFoundError) and not os.path.islink(lock)
        if not came_and_went:  # else its owner released it in between
            return None, False


def _unlock(pid: int, handle: int | None, lock: str) -> None:
    if handle is None or pid != os.getpid():  # a fork of the owner owns nothing
        return
    with suppress(OSError):
        os.unlink(lock)
    os.close(handle)
