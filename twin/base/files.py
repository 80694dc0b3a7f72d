"""Own files: never seen half written, never written through somebody else's link, and with one owner at a time.

A file is written under a temporary name in the same folder, flushed to the disk, and only then renamed over the old
one; the folder is flushed too, so that a power cut leaves the old file or the new one:

    make .NAME.PID-RANDOM.tmp -> write -> fsync -> rename to NAME -> fsync folder

Other users may write to the folder. So a file is made and never opened, under a name that nobody can guess; its data go
to the descriptor, not to a name; and a link of another user in a folder for everybody is not followed (bridge/35). All
files of the package are made here (tests/test_own_files.py). Temporary files of killed processes go when the same user
writes the file again.

A file that is kept up to date is claimed, within this process and, where the operating system has `flock`, among all
processes. The lock is on .NAME.lock beside it and ends with the process. Only a killed process leaves the empty lock
file behind, which does no harm (bridge/4).
"""

from __future__ import annotations

import errno
import gc
import logging
import os
import re
import secrets
import stat
import threading
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import IO, TextIO

log = logging.getLogger("isel_twin")

_WINDOWS = os.name == "nt"
_ALWAYS = getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_NEW = os.O_CREAT | os.O_EXCL | _ALWAYS
_AT_ONCE = getattr(os, "O_NONBLOCK", 0)  # a pipe in the place of a file keeps nobody waiting
DIGEST_BYTES = 32
_MOST_LINKS = 40  # in a row, as Linux follows
_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}


def kind_of(path: str | os.PathLike[str], kinds: Sequence[str], bare: bool = False) -> str:
    """The kind of a file, one of `kinds`, by the ending of its name; bare: without an ending it is the first of them.
    Raises ValueError."""
    kind = Path(path).suffix.lower()
    if kind in kinds or (bare and not kind):
        return kind or kinds[0]
    raise ValueError(f"{path}: the name must end in {' or '.join(filter(None, (', '.join(kinds[:-1]), kinds[-1])))}")


# ---- written -------------------------------------------------------------------------------------------------------


class Replacement:
    """A new file under a temporary name, written to `file`. `put` gives it its own name; else `close` removes it.

    A symbolic link is followed, so the link stays and its target is replaced. mode: permissions of a file that is not
    there yet, before the umask. Raises OSError.
    """

    def __init__(self, path: str | os.PathLike[str], mode: int = 0o666) -> None:
        self._path = path
        with _named(path):
            target = _followed(path)
            self._folder, self._name = _Folder(target.parent), target.name
            try:
                self._folder.remove_left_overs(self._name)
                self._temporary: str | None = f".{self._name}.{os.getpid()}-{secrets.token_hex(8)}.tmp"
                self._handle = self._folder.open(self._temporary, os.O_RDWR | _NEW, mode)
            except BaseException:
                self._folder.close()
                raise
        try_lock(self._handle)  # while it is held, nobody takes it for a left-over
        self.file: IO[bytes] = os.fdopen(self._handle, "wb", closefd=False)

    def put(self) -> None:
        """Replace the old file. What is written to `file` afterwards goes to the new one. Raises OSError."""
        assert self._temporary is not None
        with _named(self._path):
            if not self.file.closed:
                self.file.flush()
            self._folder.keep_mode(self._name, self._handle)
            os.fsync(self._handle)
            if _WINDOWS:  # it cannot rename an open file
                os.close(self._handle)
            self._folder.replace(self._temporary, self._name)
            self._temporary = None
            if _WINDOWS:
                self._handle = self._folder.open(self._name, os.O_WRONLY | os.O_APPEND | _ALWAYS)
                self.file = os.fdopen(self._handle, "wb", closefd=False)
            self._folder.flush()

    def close(self) -> None:
        """Close the file. May be called again."""
        if self._handle < 0:
            return
        with suppress(OSError):  # a full disk: who wanted to know has flushed it
            self.file.close()
        with suppress(OSError):
            os.close(self._handle)
        self._handle = -1
        if self._temporary is not None:
            with suppress(OSError):
                self._folder.unlink(self._temporary)
        self._folder.close()


@contextmanager
def replacing(path: str | os.PathLike[str], mode: int = 0o666) -> Iterator[IO[bytes]]:
    """A file to write to. It replaces `path` when the block ends and is removed if the block raises.

    Devices and pipes (/dev/stdout) cannot be replaced and are written to directly. mode: as of `Replacement`. Raises
    OSError.
    """
    if (device := open_device(path)) is not None:
        with _full_disk_names(path), device:  # closing writes, too
            yield device
        return
    new = Replacement(path, mode)
    try:
        with _full_disk_names(path):
            yield new.file
        new.put()
    finally:
        new.close()


@contextmanager
def _full_disk_names(path: str | os.PathLike[str]) -> Iterator[None]:
    """Give the error of a full disk, which knows a descriptor and no file, this path for its name."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno in _FULL:
            error.filename = os.fspath(path)
        raise


def atomic_write(path: str | os.PathLike[str], data: bytes) -> None:
    """Replace the contents of `path` by `data`, or leave it as it was. Raises OSError."""
    with replacing(path) as file:
        file.write(data)


def open_device(path: str | os.PathLike[str]) -> IO[bytes] | None:
    """A device or pipe to write to; None for a regular file and for none. Raises OSError."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    if stat.S_ISREG(found.st_mode):
        return None
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder, not a file", os.fspath(path))
    handle = os.open(path, os.O_WRONLY | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_CLOEXEC", 0))
    if stat.S_ISREG(os.fstat(handle).st_mode):  # exchanged in between
        os.close(handle)
        raise PermissionError(errno.EPERM, "has just become another file", os.fspath(path))
    return os.fdopen(handle, "wb")


def appending(path: str | os.PathLike[str]) -> TextIO:
    """A text file to add to, made if there is none. Raises OSError."""
    with _named(path):
        target = _followed(path)
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | _ALWAYS | _AT_ONCE
        folder = _Folder(target.parent)
        try:
            handle = folder.open(target.name, flags, 0o666)
        finally:
            folder.close()
        found, around = os.fstat(handle), target.parent.stat()
        if not stat.S_ISREG(found.st_mode) or (found.st_nlink > 1 and around.st_mode & stat.S_IWOTH):
            os.close(handle)
            raise PermissionError(errno.EPERM, "is no file of its own here (a pipe, a hard link); remove it")
    return open(handle, "a", encoding="utf-8")


def create(path: str | os.PathLike[str], mode: int = 0o666) -> IO[bytes]:
    """A new file to write to. Raises FileExistsError if there is anything of that name, OSError."""
    return os.fdopen(os.open(path, os.O_WRONLY | _NEW, mode), "wb")


def remove_left_overs(path: str | os.PathLike[str]) -> None:
    """Remove what killed processes of this user have begun to write in place of `path`."""
    with suppress(OSError):
        target = _followed(path)
        folder = _Folder(target.parent)
        folder.remove_left_overs(target.name)
        folder.close()


@contextmanager
def _named(path: str | os.PathLike[str]) -> Iterator[None]:
    """Errors name the file as the user does."""
    try:
        yield
    except OSError as error:
        error.filename, error.filename2 = os.fspath(path), None
        raise


def _followed(path: str | os.PathLike[str]) -> Path:
    """The place that a path leads to, through links that are safe to follow. Raises OSError."""
    place = Path.cwd() / path
    for _ in range(_MOST_LINKS):
        try:
            found = place.lstat()
        except FileNotFoundError:
            return place
        if not stat.S_ISLNK(found.st_mode):
            return place
        if planted(found, place.parent.stat(), _user()):
            reason = "is a link that another user has made in a folder for everybody; remove it or choose another name"
            raise PermissionError(errno.EPERM, reason, os.fspath(path))
        place = place.parent / os.readlink(place)
    raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), os.fspath(path))


def planted(link: os.stat_result, folder: os.stat_result, user: int | None) -> bool:
    """True for a link that may be a trap: in a folder where everybody may write, and neither of this user nor of the
    folder's or the system's (the rule of Linux's protected_symlinks)."""
    return bool(folder.st_mode & stat.S_IWOTH) and user is not None and link.st_uid not in (user, folder.st_uid, 0)


def _user() -> int | None:
    return os.geteuid() if hasattr(os, "geteuid") else None


class _Folder:
    """A folder that is opened once: its names are looked up in it, whatever becomes of its path."""

    def __init__(self, path: Path) -> None:
        self._path = path
        flags = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_CLOEXEC", 0)
        self._handle = None if _WINDOWS else os.open(path, flags)

    def _at(self, name: str) -> str:
        return name if self._handle is not None else os.path.join(self._path, name)

    def open(self, name: str, flags: int, mode: int = 0o666) -> int:
        return os.open(self._at(name), flags, mode, dir_fd=self._handle)

    def replace(self, old: str, new: str) -> None:
        os.replace(self._at(old), self._at(new), src_dir_fd=self._handle, dst_dir_fd=self._handle)

    def unlink(self, name: str) -> None:
        os.unlink(self._at(name), dir_fd=self._handle)

    def keep_mode(self, name: str, handle: int) -> None:
        """Give an open file the permissions of the one of this name; others may not write to it by those of theirs."""
        with suppress(FileNotFoundError):
            old = os.stat(self._at(name), dir_fd=self._handle, follow_symlinks=False)
            if stat.S_ISREG(old.st_mode) and hasattr(os, "fchmod"):
                os.fchmod(handle, old.st_mode & (0o777 if old.st_uid == _user() else 0o755))

    def flush(self) -> None:
        if self._handle is not None:  # Windows cannot open a folder, and its file system keeps a journal of names
            os.fsync(self._handle)

    def close(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def remove_left_overs(self, name: str) -> None:
        """Remove temporary files of killed processes that were to replace this name."""
        left_over = re.compile(rf"\.{re.escape(name)}\.(\d{{1,9}})(-[0-9a-f]+)?\.tmp")
        with suppress(OSError):  # one that stays is no reason to refuse the new one
            for one in os.listdir(self._path if self._handle is None else self._handle):
                if (found := left_over.fullmatch(one)) and self._abandoned(one, int(found[1])):
                    with suppress(OSError):  # Windows: it is still open
                        self.unlink(one)

    def _abandoned(self, name: str, pid: int) -> bool:
        """True for a regular file of this user that no process holds any more."""
        found = os.stat(self._at(name), dir_fd=self._handle, follow_symlinks=False)
        if not stat.S_ISREG(found.st_mode) or (_user() is not None and found.st_uid != _user()):
            return False
        if _WINDOWS:
            return True
        try:
            os.kill(pid, 0)
        except ProcessLookupError:  # here; in another container, its lock tells
            handle = self.open(name, os.O_RDONLY | _ALWAYS | _AT_ONCE)
            try:
                return try_lock(handle) is not False
            finally:
                os.close(handle)
        except OSError:
            pass
        return False


def try_lock(handle: int) -> bool | None:
    """Lock a file for this process. False: another process has it; None: there are no locks here."""
    try:
        import fcntl
    except ImportError:  # Windows
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return None
    return True


# ---- whole or damaged ----------------------------------------------------------------------------------------------


def sealed(data: bytes) -> bytes:
    """The data behind their digest, for what is not safe to look at when a bit of it has changed."""
    return sha256(data).digest() + data


def unsealed(data: bytes) -> bytes:
    """What was sealed. Raises ValueError unless every bit is as it was."""
    digest, inner = data[:DIGEST_BYTES], data[DIGEST_BYTES:]
    if digest != sha256(inner).digest():
        raise ValueError("damaged")
    return inner


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
    while not _WINDOWS:
        handle, found = _open_lock(lock, name)
        if handle is None:
            return None, False
        locked = try_lock(handle)
        if locked is False:
            owner = os.read(handle, 20)
            os.close(handle)
            raise _in_use(name, int(owner) if owner.isdigit() else 0)
        if locked is None:
            os.close(handle)
            if not found:
                with suppress(OSError):
                    os.unlink(lock)
            return None, found
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), os.lstat(lock)):
                with suppress(OSError):  # read-only, or a full disk: the owner stays unknown
                    if os.fstat(handle).st_uid == os.geteuid():
                        os.ftruncate(handle, 0)
                        os.write(handle, b"%d" % os.getpid())
                return handle, found
        os.close(handle)  # its last owner has removed it while we waited for it
    return None, False


def _open_lock(lock: str, name: str) -> tuple[int | None, bool]:
    """Descriptor of the lock file (None: it can be neither made nor opened), and True if it existed before.

    Another user's file can only be read, which is enough to lock it. Raises OSError for what is no file of its own.
    """
    while True:
        errors: list[type[OSError]] = []
        for flags, found in (
            (os.O_RDWR | _NEW, False),
            (os.O_RDWR | _ALWAYS | _AT_ONCE, True),
            (os.O_RDONLY | _ALWAYS | _AT_ONCE, True),
        ):
            try:
                handle = os.open(lock, flags, 0o666)
            except OSError as error:
                errors.append(type(error))
            else:
                status = os.fstat(handle)
                if stat.S_ISREG(status.st_mode) and status.st_nlink <= 1:
                    return handle, found
                os.close(handle)
                raise _no_lock(lock, name)
        if os.path.islink(lock):
            raise _no_lock(lock, name)
        if (errors[0], errors[-1]) != (FileExistsError, FileNotFoundError):  # else its owner released it in between
            return None, False


def _no_lock(lock: str, name: str) -> OSError:
    return OSError(errno.EPERM, f"its lock file {os.path.basename(lock)} is a link or no regular file; remove it", name)


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Wait until no other process of any user is in a block of this path, a file that stays. Raises OSError."""
    import fcntl

    handle, found = _open_lock(str(path), str(path))
    if handle is None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    try:
        if not found:
            os.fchmod(handle, 0o644)  # whatever the umask: the lock is for all users
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _unlock(pid: int, handle: int | None, lock: str) -> None:
    if handle is None or pid != os.getpid():  # a fork of the owner owns nothing
        return
    with suppress(OSError):
        os.unlink(lock)
    os.close(handle)
