"""Writes MCAP (https://mcap.dev/spec), the container of recordings, fast enough for thousands of samples.

    magic | header | metadata, attachments | chunk, message indexes | ... | data end | summary, offsets | footer | magic

A chunk holds messages, compressed by zstandard, and their new schemas and channels. The writer of the `mcap` package
takes 6 us a message, more than the twin needs between two samples: here many messages are one array.
"""

from __future__ import annotations

import struct
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

MAGIC: Final = bytes((137, 77, 67, 65, 80, 48, 13, 10))
(
    _HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX, _ATTACHMENT, _ATTACHMENT_INDEX,
    _STATISTICS, _METADATA, _METADATA_INDEX, _SUMMARY_OFFSET, _DATA_END,
) = range(1, 16)  # fmt: skip
_COMPRESSION: Final = "zstd"
INDEX_BYTES = 64 * 1024  # of the index of chunks that stay in memory
_PIECE_BYTES = 1 << 20  # of it that are copied at once
_LEVEL: Final = -3  # four times as fast as the library's default, and a quarter larger
_MESSAGE_HEAD: Final = struct.Struct("<BQHIQQ")  # opcode, length, channel, number in it, log time, publish time
_ENTRY: Final = np.dtype([("time_ns", "<u8"), ("offset", "<u8")])


class Output(Protocol):
    def write(self, data: bytes) -> object: ...
    def tell(self) -> int: ...
    def flush(self) -> None: ...


@dataclass
class _Chunk:
    """The chunk in progress: its records, and the offsets of each channel."""

    data: bytearray = field(default_factory=bytearray)
    entries: dict[int, list[NDArray[np.void]]] = field(default_factory=dict)
    single: dict[int, list[tuple[int, int]]] = field(default_factory=dict)  # single messages: time in ns, offset

    def indexes(self) -> dict[int, NDArray[np.void]]:
        """Times and offsets by channel, in the order of time."""
        every = {channel: list(entries) for channel, entries in self.entries.items()}
        for channel, single in self.single.items():
            every.setdefault(channel, []).append(np.array(single, dtype=_ENTRY))
        return {channel: _in_order(entries) for channel, entries in every.items()}

    def add(self, channel: int, times_ns: NDArray[Any], size: int) -> None:
        """Note messages of `size` bytes each, record included, that are about to be appended."""
        entries = np.empty(len(times_ns), dtype=_ENTRY)
        entries["time_ns"] = times_ns
        entries["offset"] = len(self.data) + size * np.arange(len(times_ns))
        self.entries.setdefault(channel, []).append(entries)


class Container:
    """One file. Raises OSError as the output does."""

    def __init__(self, output: Output, library: str, folder: str | None = None) -> None:
        """folder: for a nameless file with the index of chunks, which grows with each `flush` and is written last."""
        import zstandard

        self._compressor = zstandard.ZstdCompressor(level=_LEVEL)
        self._output = output
        self._chunk = _Chunk()
        self._messages: dict[int, int] = {}  # number of messages of each channel
        self._first_ns, self._last_ns = 1 << 63, 0
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._chunks = 0
        self._index = tempfile.SpooledTemporaryFile(INDEX_BYTES, dir=folder)  # noqa: SIM115  (closed by close())
        self._attachments: list[bytes] = []
        self._metadata: list[bytes] = []
        output.write(MAGIC + _record(_HEADER, _text("") + _text(library)))

    @property
    def waiting(self) -> int:
        """Bytes of the chunk in progress."""
        return len(self._chunk.data)

    def metadata(self, name: str, content: Mapping[str, str]) -> None:
        """Write plain text by key."""
        offset = self._output.tell()
        record = _record(_METADATA, _text(name) + _map(content.items(), _text, _text))
        self._output.write(record)
        self._metadata.append(_record(_METADATA_INDEX, struct.pack("<QQ", offset, len(record)) + _text(name)))

    def attachment(self, name: str, data: bytes) -> None:
        offset, kind = self._output.tell(), _text("application/octet-stream")
        content = struct.pack("<QQ", 0, 0) + _text(name) + kind + struct.pack("<Q", len(data)) + data
        record = _record(_ATTACHMENT, content + struct.pack("<I", zlib.crc32(content)))
        self._output.write(record)
        index = struct.pack("<QQQQQ", offset, len(record), 0, 0, len(data)) + _text(name) + kind
        self._attachments.append(_record(_ATTACHMENT_INDEX, index))

    def channel(self, topic: str, encoding: str, schema: tuple[str, str, bytes]) -> int:
        """Add a channel with messages in `encoding`; schema: name, encoding and content. Returns its number."""
        name, kind, data = schema
        number = len(self._channels) + 1
        text = struct.pack("<H", number) + _text(name) + _text(kind) + struct.pack("<I", len(data)) + data
        self._schemas.append(_record(_SCHEMA, text))
        topic_text = struct.pack("<HH", number, number) + _text(topic) + _text(encoding) + _map((), _text, _text)
        self._channels.append(_record(_CHANNEL, topic_text))
        self._chunk.data += self._schemas[-1] + self._channels[-1]
        self._messages[number] = 0
        return number

    def message(self, channel: int, time_ns: int, data: bytes) -> None:
        self._chunk.single.setdefault(channel, []).append((time_ns, len(self._chunk.data)))
        count = self._count(channel, time_ns, time_ns, 1)
        head = _MESSAGE_HEAD.pack(_MESSAGE, 22 + len(data), channel, count & 0xFFFFFFFF, time_ns, time_ns)
        self._chunk.data += head + data

    def messages(self, channel: int, times_ns: NDArray[np.int64], rows: NDArray[np.void], head: bytes) -> None:
        """Append a message for each row: `head`, then the bytes of the row. times_ns: never decreasing."""
        if not len(rows):
            return
        size = _MESSAGE_HEAD.size + len(head) + rows.dtype.itemsize
        first = self._count(channel, int(times_ns[0]), int(times_ns[-1]), len(rows)) - len(rows) + 1
        every = _MESSAGE_HEAD.pack(_MESSAGE, size - 9, channel, 0, 0, 0) + head
        records = np.empty((len(rows), size), dtype=np.uint8)
        records[:, : len(every)] = np.frombuffer(every, dtype=np.uint8)
        records[:, 11:15] = _bytes(np.arange(first, first + len(rows)).astype("<u4"))
        records[:, 15:23] = records[:, 23:31] = _bytes(times_ns.astype("<u8"))
        records[:, len(every) :] = _bytes(rows)
        self._chunk.add(channel, times_ns, size)
        self._chunk.data += records.data

    def _count(self, channel: int, first_ns: int, last_ns: int, count: int) -> int:
        self._messages[channel] += count
        self._first_ns, self._last_ns = min(self._first_ns, first_ns), max(self._last_ns, last_ns)
        return self._messages[channel]

    def flush(self) -> None:
        """Write the chunk in progress and pass everything to the operating system."""
        if self._chunk.entries or self._chunk.single:
            chunk, self._chunk = self._chunk, _Chunk()
            self._write(chunk)
        self._output.flush()

    def _write(self, chunk: _Chunk) -> None:
        data, indexes = chunk.data, chunk.indexes()
        times = [entries["time_ns"] for entries in indexes.values()]
        span = min(int(each[0]) for each in times), max(int(each[-1]) for each in times)
        small = self._compressor.compress(data)
        content = struct.pack("<QQQI", *span, len(data), zlib.crc32(data)) + _text(_COMPRESSION)
        record = _record(_CHUNK, content + struct.pack("<Q", len(small)) + small)
        offset = self._output.tell()
        offsets, after = {}, b""
        for channel, entries in indexes.items():
            offsets[channel] = offset + len(record) + len(after)
            after += _record(_MESSAGE_INDEX, struct.pack("<HI", channel, entries.nbytes) + entries.tobytes())
        self._output.write(record + after)
        index = struct.pack("<QQQQ", *span, offset, len(record)) + _map(offsets.items(), _short, _long)
        index += _long(len(after)) + _text(_COMPRESSION) + struct.pack("<QQ", len(small), len(data))
        self._index.write(_record(_CHUNK_INDEX, index))
        self._chunks += 1

    def finish(self) -> None:
        """Write the rest and the summary."""
        self.flush()
        self._output.write(_record(_DATA_END, struct.pack("<I", 0)))
        start = self._output.tell()
        first_ns = min(self._first_ns, self._last_ns)
        counted = (len(self._schemas), len(self._channels), len(self._attachments), len(self._metadata))
        statistics = struct.pack("<QHIII", sum(self._messages.values()), *counted)
        statistics += struct.pack("<IQQ", self._chunks, first_ns, self._last_ns)
        statistics += _map(self._messages.items(), _short, _long)
        end, crc, offsets = start, 0, b""
        for opcode, pieces in (
            (_SCHEMA, self._schemas),
            (_CHANNEL, self._channels),
            (_STATISTICS, [_record(_STATISTICS, statistics)]),
            (_CHUNK_INDEX, self._index_pieces()),
            (_ATTACHMENT_INDEX, self._attachments),
            (_METADATA_INDEX, self._metadata),
        ):
            group = end
            for piece in pieces:
                self._output.write(piece)
                end, crc = end + len(piece), zlib.crc32(piece, crc)
            if end > group:
                offsets += _record(_SUMMARY_OFFSET, struct.pack("<BQQ", opcode, group, end - group))
        footer = struct.pack("<BQQQ", _FOOTER, 20, start, end)
        crc = zlib.crc32(offsets + footer, crc)
        self._output.write(offsets + footer + struct.pack("<I", crc) + MAGIC)
        self._output.flush()
        self.close()

    def _index_pieces(self) -> Iterator[bytes]:
        self._index.seek(0)
        while piece := self._index.read(_PIECE_BYTES):
            yield piece

    def close(self) -> None:
        """Give up what `finish` has not written. May be called again."""
        self._index.close()


def _in_order(entries: list[NDArray[np.void]]) -> NDArray[np.void]:
    """All entries of a channel in the order of time; mostly they already are."""
    every = np.concatenate(entries) if len(entries) > 1 else entries[0]
    times = every["time_ns"]
    return every if (times[1:] >= times[:-1]).all() else every[np.argsort(times, kind="stable")]


def _bytes(values: NDArray[Any]) -> NDArray[np.uint8]:
    """uint8 [n, size], the bytes of values [n]."""
    return np.ascontiguousarray(values).view(np.uint8).reshape(len(values), values.dtype.itemsize)


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


_short, _long = struct.Struct("<H").pack, struct.Struct("<Q").pack


def _map(items: Any, key: Callable[[Any], bytes], value: Callable[[Any], bytes]) -> bytes:
    data = b"".join(key(k) + value(v) for k, v in items)
    return struct.pack("<I", len(data)) + data
