"""Reads recordings: complete ones, incomplete ones, and those of a real controller.

    read("real.mcap")  ->  Recorded: metadata, attachments, messages in the order in which they were written

A file that ends in the middle, after a kill or on a full disk, is read up to its last whole chunk.
"""

from __future__ import annotations

import os
import struct
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.parameters import parse_json
from isel_twin.motion import Steps
from isel_twin.recordings import samples as cdr
from isel_twin.recordings import sound
from isel_twin.recordings.mcap import CHANNELS, METADATA, SAMPLES
from isel_twin.recordings.recorder import Change, sample_dtype
from isel_twin.recordings.recording import GROUPS
from isel_twin.recordings.runs import add_run

MOST_AXES = 8


class RecordingError(ValueError):
    """A file is no recording, or not a suitable one; the message is one line that begins with its name."""


class Entry(NamedTuple):
    """One message of any channel but `/samples`."""

    channel: str
    time_ns: int
    content: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Recorded:
    path: Path
    metadata: Mapping[str, str]
    attachments: Mapping[str, bytes]
    entries: tuple[Entry, ...]  # in the order in which they were written
    sample_times_ns: NDArray[np.int64]  # never decreasing
    sample_bytes: bytes  # all samples, without their headers
    whole: bool  # False if it is incomplete: the process was killed, or the disk was full

    @property
    def controller(self) -> str:
        """Name of the controller; "" if unknown."""
        return self.metadata.get("controller", "")

    @property
    def of_twin(self) -> bool:
        """True for a twin; a recording of a real controller has only bytes."""
        return self.metadata.get("kind") == "twin"

    @cached_property
    def end_ns(self) -> int:
        """Time of the last recorded event, without bytes that arrive at the host later."""
        times = [entry.time_ns for entry in self.entries if entry.channel != "/host/received" or not self.of_twin]
        return max([0, *times, *self.sample_times_ns[-1:].tolist()])

    @property
    def axes(self) -> int:
        return self._number("axes", 1, MOST_AXES)

    @property
    def interval_ns(self) -> int:
        """Sampling interval."""
        return self._number("interval_ns", 1, 1 << 62)

    @property
    def has_forces(self) -> bool:
        """True if the samples tell the forces of the nuts."""
        return self.metadata.get("forces") == "true"

    @cached_property
    def samples(self) -> NDArray[np.void]:
        """The samples, with the fields of samples.py. Raises RecordingError if they do not fit."""
        dtype = cdr.sample_dtype(self.axes, self._number("motors", 0, MOST_AXES), self.has_forces)
        if len(self.sample_bytes) != dtype.itemsize * len(self.sample_times_ns):
            raise RecordingError(f"{self.path}: the samples have not the fields that its metadata say")
        return np.frombuffer(self.sample_bytes, dtype=dtype)

    def _number(self, key: str, low: int, high: int) -> int:
        text = self.metadata.get(key, "")
        if not text.isascii() or not text.isdigit() or not low <= int(text) <= high:
            raise RecordingError(f"{self.path}: {key} of the recording is {text!r}; it must be from {low} to {high}")
        return int(text)

    def of(self, *channels: str) -> Iterator[Entry]:
        return (entry for entry in self.entries if entry.channel in channels)

    def data(self, entry: Entry) -> bytes:
        """The bytes of a message of the line. Raises RecordingError if it has none."""
        try:
            return bytes.fromhex(entry.content["hex"])
        except (KeyError, TypeError, ValueError):
            raise RecordingError(f"{self.path}: {entry.channel} at {entry.time_ns} ns has no bytes") from None

    def steps(self) -> Steps:
        """The exact stream of the recording. Raises RecordingError."""
        steps = Steps(self.axes)
        for entry in self.of("/runs"):
            try:
                add_run(steps, entry.time_ns, entry.content)
            except ValueError as error:
                raise RecordingError(f"{self.path}: /runs at {entry.time_ns} ns: {error}") from None
        return steps.until(self.end_ns)


class Played:
    """A recording as `recorder.Samples`, read back."""

    def __init__(self, recorded: Recorded) -> None:
        """Raises RecordingError for wrong samples."""
        self.axes = recorded.axes
        self.dtype = sample_dtype(self.axes)
        self.changes: list[Change] = []
        self._names: dict[str, dict[str, None]] = {group: {} for group in GROUPS}
        groups = {channel: group for group, channel in GROUPS.items()}
        for channel, time_ns, content in recorded.of(*groups):
            self._names[groups[channel]] |= dict.fromkeys(content)
            self.changes += [Change(time_ns, groups[channel], name, value) for name, value in content.items()]
        times_ns, every = recorded.sample_times_ns, recorded.samples
        last = np.append(np.diff(times_ns) > 0, True)[: len(times_ns)]  # the last of several samples at one instant
        self._times_ns, self._rows = times_ns[last], np.flatnonzero(last)
        if recorded.metadata.get("held") == "true":
            self._hold(recorded.interval_ns, recorded.end_ns)
        self._every = every

    def _hold(self, interval_ns: int, end_ns: int) -> None:
        """Fill the grid: samples missing because nothing moved repeat the one before."""
        if not len(self._times_ns):
            return
        grid_ns = np.arange(-(-self._times_ns[0] // interval_ns) * interval_ns, end_ns + 1, interval_ns)
        times_ns = np.union1d(self._times_ns, grid_ns)
        self._rows = self._rows[np.searchsorted(self._times_ns, times_ns, side="right") - 1]
        self._times_ns = times_ns

    def __len__(self) -> int:
        return len(self._times_ns)

    def samples(self, size: int = 65_536) -> Iterator[NDArray[np.void]]:
        for first in range(0, len(self), size):
            part = slice(first, min(first + size, len(self)))
            samples = np.empty(part.stop - first, dtype=self.dtype)
            samples["time_ns"] = self._times_ns[part]
            for name in ("counts", "position_mm", "lost_steps"):
                samples[name] = self._every[name][self._rows[part]]
            yield samples

    def names(self) -> list[tuple[str, str]]:
        return [(group, name) for group, names in self._names.items() for name in names]


def read(path: str | os.PathLike[str]) -> Recorded:
    """Read a recording. Raises RecordingError for another file, OSError for one that cannot be read."""
    from mcap.records import Attachment, Channel, Footer, Message, Metadata
    from mcap.stream_reader import StreamReader

    path = Path(path)
    metadata: dict[str, str] | None = None
    attachments: dict[str, bytes] = {}
    channels: dict[int, str] = {}
    entries: list[Entry] = []
    times_ns, sample_bytes = array("q"), bytearray()
    whole = False
    try:
        sound.check(path)
    except sound.UnsoundError as error:
        raise RecordingError(f"{path}: {error}") from None
    with path.open("rb") as file:
        records = StreamReader(file, validate_crcs=True).records
        while (record := _next(records)) is not None:
            if isinstance(record, Message):
                channel = channels.get(record.channel_id, "")
                if channel == SAMPLES:
                    times_ns.append(record.log_time)
                    sample_bytes += record.data[len(cdr.HEADER) :]
                elif channel:
                    entries.append(Entry(channel, record.log_time, _content(path, channel, record)))
            elif isinstance(record, Channel):
                channels[record.id] = record.topic
            elif isinstance(record, Metadata) and record.name == METADATA:
                metadata = dict(record.metadata)
            elif isinstance(record, Attachment):
                attachments[record.name] = record.data
            elif isinstance(record, Footer):
                whole = True
    if metadata is None:
        raise RecordingError(f"{path}: is no recording of isel-twin; allowed: a file that --record NAME.mcap has made")
    samples = np.array(times_ns, dtype=np.int64), bytes(sample_bytes)
    return Recorded(path, metadata, attachments, tuple(entries), *samples, whole)


def _next(records: Iterator[Any]) -> Any:
    """The next record, None at the end or at an incomplete one."""
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    try:
        return next(records, None)
    except (McapError, struct.error, ValueError, MemoryError, KeyError, ZstdError):
        return None


def _content(path: Path, channel: str, message: Any) -> dict[str, Any]:
    try:
        content = parse_json(message.data)
    except ValueError:
        content = None
    if not isinstance(content, dict):
        raise RecordingError(f"{path}: a message of {channel} at {message.log_time} ns is no table")
    for name, rule in CHANNELS.get(channel, ("", {}))[1].items():
        if name in content and not _fits(content[name], rule["type"]):
            raise RecordingError(f"{path}: {name} in {channel} at {message.log_time} ns is no {rule['type']}")
    return content


_KINDS: Mapping[str, tuple[type, ...]] = {
    "string": (str,),
    "integer": (int,),
    "number": (int, float),
    "boolean": (bool,),
    "object": (dict,),
    "array": (list,),
    "null": (type(None),),
}


def _fits(value: Any, kinds: str | list[str]) -> bool:
    """Is a value of one of these kinds of a JSON schema?"""
    asked = [kinds] if isinstance(kinds, str) else kinds
    if isinstance(value, bool):
        return "boolean" in asked
    return any(isinstance(value, _KINDS[kind]) for kind in asked)
