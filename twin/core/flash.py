"""A controller's flash memory in a file that is kept up to date."""

from __future__ import annotations

import errno
import logging
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from isel_twin.base.files import Claim, atomic_write, remove_left_overs

log = logging.getLogger("isel_twin")

FLASH_BYTES = 1 << 24  # largest file taken for a flash image: 16 MiB, hundreds of times what a controller stores


class HasFlash(Protocol):
    flash: bytes | None
    on_flash: Callable[[bytes], None] | None


class FlashFile:
    """A controller's flash memory in a file.

    `image` is the first content of the file, None for a new device. From `attach` on the file belongs to that twin and
    follows its flash. Raises OSError if the file cannot be read, is no regular one or larger than FLASH_BYTES.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._target = Path(os.path.realpath(path))
        self._claim: Claim | None = None
        self._check()
        self._stored = self._read()
        self.image = self._stored or None

    def _check(self) -> None:
        try:
            status = os.stat(self._target)
        except FileNotFoundError:
            return
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(self._path))
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "is no regular file, so no flash memory", str(self._path))
        if status.st_size > FLASH_BYTES:
            raise OSError(errno.EFBIG, f"is no flash image: larger than {FLASH_BYTES >> 20} MiB", str(self._path))

    def _read(self) -> bytes:
        return self._path.read_bytes() if self._path.exists() else b""

    def attach(self, twin: HasFlash) -> None:
        """Store what this twin writes to its flash; an unwritten flash is an empty file. Raises OSError as `hold` does,
        or if the file cannot be written (core/5)."""
        self.hold()
        remove_left_overs(self._target)
        if twin.flash != self.image or self.image is None:
            try:
                self._write(twin.flash or b"")
            except OSError:
                self.release()
                raise
        twin.on_flash = self._store

    def hold(self) -> None:
        """Claim the file. Raises OSError if it has another owner, or has changed."""
        if self._claim is not None:
            return
        claim = Claim(self._target, name=self._path)
        if self._read() != self._stored:
            claim.release()
            raise OSError(errno.EBUSY, "has been changed by another twin meanwhile", str(self._path))
        self._claim = claim

    def release(self) -> None:
        """Release the file for another twin; later writes of this one are lost. May be called again."""
        if self._claim is not None:
            self._claim.release()
            self._claim = None

    def _write(self, image: bytes) -> None:
        atomic_write(self._path, image)
        self._stored = image

    def _store(self, image: bytes) -> None:
        """Raises OSError; the file is as it was then."""
        try:
            if self._claim is None:
                raise OSError(errno.EBADF, "the file has been let go", str(self._path))
            self._write(image)
        except OSError as error:  # the machine runs on, and no reply reports it (core/6)
            log.error("%s: the flash image could not be stored, the file is as it was: %s", self._path, error.strerror)
            raise


def flash_file(twin: HasFlash) -> FlashFile | None:
    """The flash file of this twin, None without one."""
    keeper = getattr(twin.on_flash, "__self__", None)
    return keeper if isinstance(keeper, FlashFile) else None
