"""Samples as CDR: read by the layout that their schema says, and by no code of the package."""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path

import pytest
from mcap.reader import make_reader

from isel_twin.core.twin import Twin
from isel_twin.recordings.recording import FileRecording

SIZES = {"int64": (8, "q"), "float64": (8, "d"), "float32": (4, "f")}


def decoded(schema: str, message: bytes) -> dict[str, list[float]]:
    """OMG's CDR, little endian: a header of four bytes, each number at a multiple of its size after it."""
    assert message[:4] == b"\x00\x01\x00\x00"
    body, at, found = message[4:], 0, {}
    for line in schema.splitlines():
        kind, name = line.split()
        count = int(kind[kind.index("[") + 1 : -1]) if "[" in kind else 1
        size, letter = SIZES[kind.split("[")[0]]
        at += -at % size
        found[name] = list(struct.unpack_from(f"<{count}{letter}", body, at))
        at += count * size
    assert at == len(body)
    return found


@pytest.mark.parametrize("plant", ["mujoco", "kinematic"])
def test_a_sample_says_what_the_twin_shows(tmp_path: Path, plant: str) -> None:
    twin = Twin(plant=plant, start_mm=(3.0, 4.0, 5.0))
    recording = FileRecording(tmp_path / "a.mcap", twin, 10_000_000)
    for command in ("@07", "@0R7", "@0A300,1000,200,1000,0,30,0,30"):
        assert twin.query(command) == "0"
    twin.run(1.0)
    twin.set_input("hood", "open")  # a change: a sample of this very moment
    recording.close()
    messages = list(make_reader(BytesIO((tmp_path / "a.mcap").read_bytes())).iter_messages(topics=["/samples"]))
    schema, channel, message = messages[-1]
    assert schema is not None
    assert (schema.encoding, channel.message_encoding, message.log_time) == ("ros2msg", "cdr", twin.time_ns)
    sample = decoded(schema.data.decode(), message.data)
    assert sample["counts"] == twin.counts.tolist() == [300, 200, 0, 0]
    assert sample["position_mm"] == twin.position_mm.tolist()
    assert sample["position_error_mm"] == twin.position_error_mm.tolist()
    assert sample["lost_steps"] == twin.lost_steps.tolist()
    assert sample["velocity_mm_s"] == pytest.approx(twin.velocity_mm_s.tolist(), rel=1e-6)
    assert sample["margin"] == pytest.approx(twin.margin.tolist(), rel=1e-6, nan_ok=True)
    assert sample.get("force_n", [float("nan")] * 3) == pytest.approx(twin.force_n.tolist(), rel=1e-6, nan_ok=True)
    assert sample.get("current", []) == pytest.approx(twin.current_fraction.tolist(), rel=1e-6)


def test_the_nut_holds_against_a_push() -> None:
    """A push of 400 N upon the table, along X: the nut pushes back, but for what the guide holds by friction."""
    twin = Twin(start_mm=(100.0, 100.0, 50.0))
    twin.query("@07")
    twin.run(0.5)
    at_rest = twin.force_n
    twin.apply_force(0, 400.0)
    twin.run(0.5)
    friction_n = twin.machine.axes[0].guide_friction_n
    assert twin.force_n[0] - at_rest[0] == pytest.approx(-400.0, abs=3.0 * friction_n)
    assert twin.force_n[1] == pytest.approx(at_rest[1], abs=1.0)


def test_no_samples_are_taken_while_nothing_moves(tmp_path: Path) -> None:
    twin = Twin()
    recording = FileRecording(tmp_path / "a.mcap", twin, 10_000_000)
    twin.run(3600.0)
    recording.close()
    reader = make_reader(BytesIO((tmp_path / "a.mcap").read_bytes()))
    assert len(list(reader.iter_messages(topics=["/samples"]))) < 100
