"""Is a file of others a recording that can be read without harm? Looked at before anything of it is expanded.

    head | attachment ... | chunk | chunk ...     the records of the file, one after the other, by their lengths
             checksum         size when expanded

A recording is data of strangers: a changed attachment would be a changed machine, and a few kilobytes could claim
gigabytes. Library readers skip the first and allocate the second.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

MOST_CHUNK_BYTES = 64 << 20  # a chunk when expanded; those of the twin have 256 KiB and a batch of samples
MOST_TIMES = 2000  # all chunks over the size of the file, beyond MOST_CHUNK_BYTES
_MAGIC_BYTES = 8
_ATTACHMENT, _CHUNK = 0x09, 0x06
_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")  # first and last time, size when expanded, checksum


class UnsoundError(ValueError):
    """The file is damaged or claims too much; the message says which."""


def check(path: Path) -> None:
    """Raise UnsoundError, or OSError. An incomplete file is sound as far as it goes."""
    claimed, size = 0, path.stat().st_size
    with path.open("rb") as file:
        for kind, length in _records(file, size):
            if kind == _ATTACHMENT:
                _check_attachment(file.read(length))
            elif kind == _CHUNK:
                claimed += _expanded_bytes(file.read(min(length, 4096)))
                if claimed > MOST_CHUNK_BYTES + MOST_TIMES * size:
                    raise UnsoundError(f"claims more than {claimed >> 20} MiB in {size} bytes")


def _records(file: IO[bytes], size: int) -> Iterator[tuple[int, int]]:
    """Kind and length of each whole record; the file stands at its content."""
    at = _MAGIC_BYTES
    while at + _HEAD.size <= size:
        file.seek(at)
        kind, length = _HEAD.unpack(file.read(_HEAD.size))
        at += _HEAD.size + length
        if at > size:
            return
        yield kind, length


def _check_attachment(content: bytes) -> None:
    if len(content) < 4 or zlib.crc32(content[:-4]) != int.from_bytes(content[-4:], "little"):
        name = content[20 : 20 + int.from_bytes(content[16:20], "little")][:80].decode("utf-8", "replace")
        raise UnsoundError(f"its attachment {name!r} is damaged: the checksum does not fit")


def _expanded_bytes(head: bytes) -> int:
    """The size of a chunk when expanded, by its own word and by that of the compressed data, whichever is more."""
    if len(head) < _CHUNK_HEAD.size + 12:
        raise UnsoundError("a chunk is too short")
    _, _, told, _ = _CHUNK_HEAD.unpack_from(head)
    begin = _CHUNK_HEAD.size + 4
    end = begin + int.from_bytes(head[begin - 4 : begin], "little")
    name = head[begin:end]
    if name not in (b"", b"zstd"):
        raise UnsoundError(f"a chunk is compressed by {name[:20].decode('latin-1')!r}; allowed: zstd")
    size = max(told, _frame_bytes(head[end + 8 :])) if name else told
    if size > MOST_CHUNK_BYTES:
        raise UnsoundError(f"a chunk claims {size} bytes; allowed: up to {MOST_CHUNK_BYTES}")
    return size


def _frame_bytes(data: bytes) -> int:
    from zstandard import ZstdError, frame_content_size

    try:
        return int(frame_content_size(data))
    except ZstdError:
        return 0  # no frame: the reader will say so
