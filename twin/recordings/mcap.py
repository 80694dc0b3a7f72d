"""Recordings as MCAP files: the traffic of the line and the behaviour of the machine, with times, in one file.

MCAP (https://mcap.dev) is a container of messages on named channels, in chunks that are compressed one by one.
`log_time` is virtual time in ns since power-on (of a real controller: since the recording began). The channels are in
CHANNELS; each but `/samples` carries JSON with its schema.

    head: metadata, attachments | chunk | chunk | chunk | ... | index, end
                                                 ^ killed here: everything up to the last whole chunk can be read

`flush` passes the chunk in progress to the operating system. An existing file is replaced only when the head of the new
one is on the disk, and one recording at a time claims it. If the disk is full, the recording ends with one line in the
log and keeps what it has; the twin goes on.
"""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from isel_twin.base.files import Claim, Replacement, open_device
from isel_twin.language import readable
from isel_twin.recordings.container import Container
from isel_twin.recordings.samples import HEADER
from isel_twin.version import VERSION

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from isel_twin.language import Language

METADATA: Final = "isel-twin"  # name of the metadata record: plain text by key
CHUNK_BYTES = 256 * 1024  # size before compression at which a chunk is written
TOGETHER = 100  # messages that wait for each other
log = logging.getLogger("isel_twin")

_TEXT: Final = {"type": "string"}
_NUMBER: Final = {"type": "integer"}
_TRAFFIC: Final = {"hex": _TEXT, "text": _TEXT, "explanation": _TEXT, "byte_ns": _NUMBER}
# content of each channel, and the properties of its messages; none: any names
CHANNELS: Final[Mapping[str, tuple[str, Mapping[str, Any]]]] = {
    "/host/sent": ("bytes the host has sent, at once", _TRAFFIC),
    "/host/received": ("bytes that reach the host: the last of them now, each byte_ns after the one before", _TRAFFIC),
    "/host/lost": ("of the bytes received: those that would have come now, had the line not been cut", {"hex": _TEXT}),
    "/operator": ("what somebody has done, in the keys of a scenario event; or how the line is", {}),
    "/scenario": ("an event of the scenario", {}),
    "/runs": (
        "the motion the controller makes from now on (isel_twin.recordings.runs), null: none; continues: the same with "
        "another future",
        {"run": {"type": ["object", "null"]}, "continues": {"type": "boolean"}},
    ),
    "/counters": ("a counter set without a motion: axis 0 X, 1 Y ...", {"axis": _NUMBER, "value": _NUMBER}),
    "/flash": ("the flash memory has been written", {"bytes": _NUMBER, "sha256": _TEXT}),
    "/remarks": ("why something has failed", {"text": _TEXT}),
    "/collisions": (
        "two bodies have met that must not: where (zero and direction of the counters) and, if that is known, how hard",
        {
            "first": _TEXT,
            "second": _TEXT,
            "position_mm": {"type": "array", "items": {"type": "number"}},
            "time_ns": _NUMBER,
            "speed_mm_s": {"type": "number"},
            "force_n": {"type": ["number", "null"]},
        },
    ),
    "/levels": ("electrical levels of the terminals that have changed, 1: high", {}),
    "/inputs": ("switches, elements and faults that have changed, in words", {}),
    "/outputs": ("outputs of the controller and relays that have changed", {}),
    "/faults": ("all that is wrong on purpose from now on", {"faults": {"type": "object"}}),
    "/time": ("how virtual time passes: speed, pause, end of the recording", {"what": _TEXT}),
    "/port": ("what became of the controller's port: gone, back, set otherwise", {"text": _TEXT}),
}
_JSON: Final = json.JSONEncoder(separators=(",", ":"))
SAMPLES: Final = "/samples"  # the channel of the samples (samples.py)


class RecordingWriter:
    """One recording, from its head to `close`. `sent` and `received` never raise."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        metadata: Mapping[str, str],
        attachments: Mapping[str, bytes] | None = None,
        language: Language | None = None,
    ) -> None:
        """Begin the file. Raises OSError, which names `path`, and then leaves an old file unchanged.

        metadata: plain text by key, such as `kind` and `controller`; the version is added. attachments: files by name.
        language: explains the bytes; a fresh instance.
        """
        self.path = Path(path)
        self.ended = False  # True once nothing more is recorded: closed, or the disk is full
        self.broken = False  # True if the disk was full and something is missing
        self.unwritten = False  # something has been recorded since the last `flush`
        self._language = language
        self._file = _File(self.path)
        self._channels: dict[str, int] = {}
        # messages that wait: channel, time in ns, table, or bytes of the line and the ns from one to the next
        self._waiting: list[tuple[str, int, Mapping[str, Any] | tuple[bytes, int]]] = []
        try:
            self._container = Container(self._file, f"isel-twin {VERSION}", self._file.folder)
            self._container.metadata(METADATA, {"isel_twin": VERSION, **metadata})
            for name, data in (attachments or {}).items():
                self._container.attachment(name, data)
            self._file.put_in_place()
        except BaseException as error:
            self._file.give_up()
            if isinstance(error, OSError):
                raise OSError(error.errno, error.strerror or str(error), str(path)) from error
            raise

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def sent(self, time_ns: int, data: bytes) -> None:
        self._add("/host/sent", time_ns, (data, 0))

    def received(self, time_ns: int, data: bytes, byte_ns: int = 0) -> None:
        """Record bytes that reach the host: the last one at time_ns, each byte_ns after the one before."""
        self._add("/host/received", time_ns, (data, byte_ns))

    def message(self, channel: str, time_ns: int, content: Mapping[str, Any]) -> None:
        """Write one message, a table that JSON can hold and that stays as it is, on one of CHANNELS."""
        self._add(channel, time_ns, content)

    def samples(self, time_ns: NDArray[np.int64], rows: NDArray[np.void], schema: str) -> None:
        """Write samples; `schema` describes their fields and is always the same (samples.py)."""
        self._write_waiting()
        if self.ended:
            return
        if (number := self._channels.get(SAMPLES)) is None:
            number = self._container.channel(SAMPLES, "cdr", ("isel_twin/Sample", "ros2msg", schema.encode()))
            self._channels[SAMPLES] = number
        self._container.messages(number, time_ns, rows, HEADER)
        self._grown()

    def _add(self, channel: str, time_ns: int, content: Mapping[str, Any] | tuple[bytes, int]) -> None:
        if not self.ended:
            self.unwritten = True
            self._waiting.append((channel, time_ns, content))
            if len(self._waiting) >= TOGETHER:
                self._write_waiting()

    def _write_waiting(self) -> None:
        """Put the messages that wait into the chunk. Explained and encoded one after the other they take half the time
        of as many with physics between them, which fills the processor's caches."""
        waiting, self._waiting = self._waiting, []
        for channel, time_ns, content in waiting:
            if isinstance(content, tuple):
                content = self._traffic(channel, *content)
            number = self._channels.get(channel) or self._register(channel)
            self._container.message(number, time_ns, _JSON.encode(content).encode())
            self._grown()
            if self.ended:
                return

    def _grown(self) -> None:
        self.unwritten = True
        if self._container.waiting >= CHUNK_BYTES:
            self.flush()

    def flush(self) -> None:
        """Pass everything recorded so far to the operating system, so that it outlives this process."""
        self._write_waiting()
        if self.ended or not self.unwritten:
            return
        self.unwritten = False
        try:
            self._container.flush()
        except OSError as error:
            self._end(error)

    def close(self) -> None:
        """Write the index, so that viewers need not read the whole file. May be called again."""
        self._write_waiting()
        if self.ended:
            return
        try:
            self._container.finish()
            self._file.close()
            self.ended = True
        except OSError as error:
            self._end(error)

    def _traffic(self, channel: str, data: bytes, byte_ns: int) -> Mapping[str, Any]:
        messages = [] if self._language is None else self._language.messages(data, channel == "/host/sent")
        meaning = "; ".join(f"{message.text}: {message.explanation}" for message in messages)
        return {"hex": data.hex(), "text": readable(data), "explanation": meaning, "byte_ns": byte_ns}

    def _register(self, channel: str) -> int:
        what, properties = CHANNELS[channel]
        schema = {"title": channel, "description": what, "type": "object", "properties": properties}
        name = "isel_twin" + channel.replace("/", ".")
        number = self._container.channel(channel, "json", (name, "jsonschema", json.dumps(schema).encode()))
        self._channels[channel] = number
        return number

    def _end(self, error: OSError) -> None:
        """End the recording on a full disk, and keep what there is."""
        self.ended = self.broken = True
        self._container.close()
        self._file.give_up()
        log.error("%s: the recording ends here, the machine goes on: %s", self.path, error.strerror or error)


class _File:
    """The file of a recording: its head under a temporary name, the rest in its place (recordings/1).

    Other than regular files (/dev/stdout) are written directly.
    """

    def __init__(self, path: Path) -> None:
        self._target = Path(os.path.realpath(path))
        self._claim: Claim | None = None
        self._new: Replacement | None = None
        self._written = 0
        self.folder: str | None = None  # for files beside it; None: it is no regular file
        if (device := open_device(path)) is not None:
            self._file = device
            return
        self._claim = Claim(self._target, name=path)
        try:
            self._new = Replacement(path)
        except BaseException:
            self._claim.release()
            raise
        self._file = self._new.file
        self.folder = str(self._target.parent)

    def put_in_place(self) -> None:
        """Replace the old file, once the head is written."""
        if self._new is None:
            self._file.flush()
        else:
            self._new.put()
            self._file = self._new.file

    def write(self, data: bytes) -> int:
        self._written += len(data)
        return self._file.write(data)

    def tell(self) -> int:
        """Bytes written; counted, as a pipe cannot tell."""
        return self._written

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._file.flush()
        if self._claim is not None:
            os.fsync(self._file.fileno())
        self._file.close()
        self._let_go()

    def give_up(self) -> None:
        """Close after an error; written data stay on the disk."""
        with suppress(OSError):
            self._file.close()
        self._let_go()

    def _let_go(self) -> None:
        if self._new is not None:
            self._new.close()
        if self._claim is not None:
            self._claim.release()
