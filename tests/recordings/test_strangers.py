"""Recordings of strangers: what is changed, claims too much or is nested without end is refused in one line."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from isel_twin.base.parameters import MOST_DEPTH, Place, parse_json, parse_toml
from isel_twin.recordings import reading, sound
from isel_twin.recordings.container import Container
from isel_twin.recordings.reading import RecordingError, read
from isel_twin.recordings.replay import rebuilt
from tests.in_process import isel_twin
from tests.thorough import drawn

JOB = "@07\n@0N7\n@0A1600,800,0,30,0,30,0,30\n"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "job.txt").write_text(JOB)
    done = isel_twin("run", folder / "job.txt", "--plant", "kinematic", "--record", folder / "run.mcap")
    assert done.returncode == 0, done
    return folder / "run.mcap"


def retold(recording: Path, folder: Path, **metadata: str) -> Path:
    """The recording with other metadata: text in place of text, in a new container."""
    told = read(recording)
    path = folder / "retold.mcap"
    with path.open("wb") as file:
        out = Container(file, "somebody")
        out.metadata("isel-twin", {**told.metadata, **metadata})
        for name, data in told.attachments.items():
            out.attachment(name, data)
        out.finish()
    return path


@pytest.mark.parametrize(
    ("metadata", "why"),
    [
        ({"overrides": "4"}, "overrides are 4; they must be a table"),
        ({"overrides": '{"payload.mass": {"value": 4}}'}, "must be a table of numbers and words"),
        ({"start_mm": "-1"}, "start_mm is -1; it must be a list"),
        ({"start_mm": '[1, "2", 3]'}, "it must be a list"),
        ({"start_mm": "[1, 2, NaN]"}, "it must be a list"),
        ({"seed": "one"}, "does not say what was recorded"),
        ({"overrides": "[" * 3000 + "]" * 3000}, "nested too deeply"),
    ],
)
def test_metadata_that_make_no_sense(recording: Path, tmp_path: Path, metadata: dict[str, str], why: str) -> None:
    path = retold(recording, tmp_path, **metadata)
    with pytest.raises(RecordingError, match=why):
        rebuilt(read(path), tmp_path)
    done = isel_twin("replay", path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"isel-twin: {path}: ")
    assert done.stderr.count("\n") == 1


def test_one_digit_of_the_machine_is_seen(recording: Path, tmp_path: Path) -> None:
    data = bytearray(recording.read_bytes())
    at = data.index(b'"value"', data.index(b"machine.json")) + 10
    while not chr(data[at]).isdigit():
        at += 1
    data[at] ^= 1
    path = tmp_path / "changed.mcap"
    path.write_bytes(data)
    for words in (("replay", path), ("compare", path, recording)):
        done = isel_twin(*words)
        assert (done.returncode, done.stdout) == (2, "")
        assert (
            done.stderr == f"isel-twin: {path}: its attachment 'machine.json' is damaged: the checksum does not fit\n"
        )


def chunk(unpacked: int, data: bytes, name: bytes = b"zstd") -> bytes:
    content = struct.pack("<QQQI", 0, 0, unpacked, 0) + struct.pack("<I", len(name)) + name
    content += struct.pack("<Q", len(data)) + data
    return struct.pack("<BQ", 6, len(content)) + content


def bomb(told: int | None = None) -> bytes:
    """33 kB that claim 2.1 GB."""
    packed = zstandard.ZstdCompressor(level=1).compress(bytes(2_100_000_000 // 8))
    return chunk(len(packed) if told else 2_100_000_000, packed)


@pytest.mark.parametrize(
    ("what", "why"),
    [
        (lambda: bomb(), "a chunk claims 2100000000 bytes"),
        (lambda: bomb(told=1), "a chunk claims 262500000 bytes"),  # its own word is small, the compressed data's is not
        (lambda: chunk(10, b"x" * 10, b"lz4"), "compressed by 'lz4'"),
        (lambda: b"".join(chunk(60 << 20, b"") for _ in range(20)), "claims more than"),
        (lambda: struct.pack("<BQ", 6, 5) + b"12345", "a chunk is too short"),
    ],
)
def test_what_claims_too_much_is_not_unpacked(
    recording: Path, tmp_path: Path, what: Callable[[], bytes], why: str
) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(recording.read_bytes()[:-8] + what())
    with pytest.raises(RecordingError, match=why):
        read(path)


def test_a_counter_that_is_a_table_is_no_counter(recording: Path, tmp_path: Path) -> None:
    told = read(recording)
    path = tmp_path / "counter.mcap"
    with path.open("wb") as file:
        out = Container(file, "somebody")
        out.metadata("isel-twin", dict(told.metadata))
        number = out.channel("/counters", "json", ("x", "jsonschema", b"{}"))
        out.message(number, 0, json.dumps({"axis": 0, "value": {"of": 7}}).encode())
        out.finish()
    with pytest.raises(RecordingError, match="value in /counters at 0 ns is no integer"):
        read(path)


@pytest.mark.parametrize("text", ["[" * 3000 + "]" * 3000, '{"a":' * 3000 + "1" + "}" * 3000, "[" * 60 + "]" * 60])
def test_json_without_end_is_a_value_error(text: str) -> None:
    with pytest.raises(ValueError, match=f"nested too deeply; allowed: up to {MOST_DEPTH}"):
        parse_json(text)
    assert parse_json("[" * 20 + "]" * 20)


@pytest.mark.parametrize("text", ["a = " + "[" * 3000 + "]" * 3000, "a." * 3000 + "b = 1", "[" + "a." * 3000 + "b]\n"])
@pytest.mark.parametrize("kind", ["machine", "scenario", "settings", "plan"])
def test_toml_without_end_is_one_line(tmp_path: Path, text: str, kind: str) -> None:
    with pytest.raises(ValueError, match="nested too deeply"):
        parse_toml(text, Place(tmp_path / "x.toml", ValueError))
    (tmp_path / "job.txt").write_text(JOB)
    names = {"machine": "machine.toml", "scenario": "s.toml", "settings": "isel-twin.toml", "plan": "plan.toml"}
    (tmp_path / names[kind]).write_text(text)
    words = {
        "machine": ("describe", tmp_path),
        "scenario": ("run", tmp_path / "job.txt", "--scenario", tmp_path / "s.toml"),
        "settings": ("check", tmp_path / "job.txt"),
        "plan": ("sweep", tmp_path / "plan.toml"),
    }
    done = isel_twin(*words[kind])
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    assert done.stderr.count("\n") == 1


@settings(max_examples=drawn(200), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, 1 << 20), byte=st.integers(0, 255), cut=st.booleans())
def test_a_damaged_recording_is_read_or_refused(recording: Path, tmp_path: Path, at: int, byte: int, cut: bool) -> None:
    data = bytearray(recording.read_bytes())
    at %= len(data)
    data[at] = byte
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data[:at] if cut else data)
    said = ""
    try:
        told = read(path)
        if told.of_twin:
            told.steps()
    except RecordingError as error:
        said = str(error)
    assert not said or (said.startswith(str(path)) and "\n" not in said)


def test_checks_cost_little_beside_reading(recording: Path) -> None:
    """They read heads only: the attachments, and no chunk."""
    sound.check(recording)
    assert reading.read(recording).whole
    assert zlib.crc32(b"") == 0
