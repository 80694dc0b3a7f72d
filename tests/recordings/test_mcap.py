"""The file of a recording: what is in it for a reader that is not ours, and how it begins and ends."""

from __future__ import annotations

import json
import os
import tracemalloc
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader

from isel_twin.language import create_language
from isel_twin.recordings.mcap import RecordingWriter


def messages(data: bytes) -> list[tuple[str, int, dict[str, object]]]:
    """Channel, time and content of every message, by the package's own reader."""
    found = make_reader(BytesIO(data)).iter_messages()
    return [(channel.topic, message.log_time, json.loads(message.data)) for _, channel, message in found]


def test_bytes_of_both_directions_with_their_meaning(tmp_path: Path) -> None:
    path = tmp_path / "real.mcap"
    with RecordingWriter(path, {"kind": "tap", "controller": "imc-s8"}, language=create_language("imc-s8")) as writer:
        writer.sent(1_000_000, b"@0")
        writer.sent(1_500_000, b"7\r")
        writer.received(3_000_000, b"0", 520_833)
    first, second, third = messages(path.read_bytes())
    assert first == ("/host/sent", 1_000_000, {"hex": "4030", "text": "@0", "explanation": "", "byte_ns": 0})
    assert (second[1], second[2]["text"]) == (1_500_000, "7<13>")
    assert str(second[2]["explanation"]).startswith("@07: ")
    assert (third[0], third[1], third[2]["hex"], third[2]["byte_ns"]) == ("/host/received", 3_000_000, "30", 520_833)
    language = create_language("imc-s8")
    (said, answered) = (*language.messages(b"@07\r", True), *language.messages(b"0", False))
    assert second[2]["explanation"] == f"@07: {said.explanation}"
    assert third[2]["explanation"] == f"0: {answered.explanation}"
    reader = make_reader(BytesIO(path.read_bytes()))
    ((metadata),) = reader.iter_metadata()
    assert metadata.name == "isel-twin"
    assert {"kind": "tap", "controller": "imc-s8"}.items() <= metadata.metadata.items()
    assert {schema.encoding for schema, *_ in reader.iter_messages() if schema} == {"jsonschema"}
    assert [path.name for path in tmp_path.iterdir()] == ["real.mcap"]


def test_what_was_flushed_can_be_read_without_an_end(tmp_path: Path) -> None:
    path = tmp_path / "real.mcap"
    writer = RecordingWriter(path, {})
    writer.sent(1, b"a")
    writer.flush()
    writer.sent(2, b"b")
    assert times_until_cut(path.read_bytes()) == [1]
    writer.close()
    assert [time for _, time, _ in messages(path.read_bytes())] == [1, 2]


def test_a_week_of_flushes_takes_no_memory_and_all_are_in_the_index(tmp_path: Path) -> None:
    path = tmp_path / "long.mcap"
    writer = RecordingWriter(path, {})

    def flush(times: range) -> int:
        """Bytes in use after a flush at each time."""
        for time_ns in times:
            writer.sent(time_ns, b"a")
            writer.flush()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        after_1000, after_4000 = flush(range(1000)), flush(range(1000, 4000))
    finally:
        tracemalloc.stop()
    assert after_4000 - after_1000 < 3000 * 10  # an entry of the index has 150 bytes
    writer.close()
    summary = make_reader(BytesIO(path.read_bytes())).get_summary()
    assert summary is not None
    assert [chunk.message_start_time for chunk in summary.chunk_indexes] == list(range(4000))
    assert [path.name for path in tmp_path.iterdir()] == ["long.mcap"]


def times_until_cut(data: bytes) -> list[int]:
    """Times of the messages of a file that may have no end."""
    times = []
    with suppress(EndOfFile):
        for record in StreamReader(BytesIO(data)).records:
            times += [record.log_time] if isinstance(record, Message) else []
    return times


def test_one_recording_at_a_time_has_the_file(tmp_path: Path) -> None:
    path = tmp_path / "real.mcap"
    with RecordingWriter(path, {}), pytest.raises(OSError, match="is in use by another twin"):
        RecordingWriter(path, {})


def test_a_recording_that_cannot_begin_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "real.mcap"
    path.write_bytes(b"an older recording")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left") as caught:
        RecordingWriter(path, {})
    assert caught.value.filename == str(path)
    monkeypatch.undo()
    assert path.read_bytes() == b"an older recording"
    assert [entry.name for entry in tmp_path.iterdir()] == ["real.mcap"]
    RecordingWriter(path, {}).close()
    assert path.read_bytes().startswith(b"\x89MCAP")


def test_a_link_stays_and_what_it_names_is_written(tmp_path: Path) -> None:
    target, link = tmp_path / "target.mcap", tmp_path / "link.mcap"
    link.symlink_to(target)
    with RecordingWriter(link, {}) as writer:
        writer.sent(1, b"a")
    assert link.is_symlink()
    assert len(messages(target.read_bytes())) == 1


def test_on_a_full_disk_the_recording_ends_with_one_line(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "real.mcap"
    writer = RecordingWriter(path, {})
    writer.sent(1, b"a")
    writer.flush()

    class Full:
        """A file on a disk that is full."""

        def write(self, data: bytes) -> int:
            raise OSError(28, "No space left on device")

        def close(self) -> None:
            raise OSError(28, "No space left on device")

    writer._file._file.close()
    writer._file._file = Full()
    for time in range(2, 10):
        writer.sent(time, b"a")
        writer.flush()
    writer.close()
    assert writer.ended
    (line,) = [record.getMessage() for record in caplog.records]
    assert line == f"{path}: the recording ends here, the machine goes on: No space left on device"
    assert times_until_cut(path.read_bytes()) == [1]


def test_no_room_on_a_device_is_told_when_it_begins() -> None:
    with pytest.raises(OSError, match="No space left"):
        RecordingWriter("/dev/full", {})
