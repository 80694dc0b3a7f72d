"""A recorded twin: what is exported from the recording is what would have been written at once, and nothing is lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

from isel_twin.base.units import SECOND_NS
from isel_twin.core.twin import Twin
from isel_twin.recordings.mcap import RecordingWriter
from isel_twin.recordings.reading import Played, RecordingError, read
from isel_twin.recordings.recorder import Recorder
from isel_twin.recordings.recording import Recording, attachments, metadata
from isel_twin.recordings.write import KINDS, write_trace

INTERVAL_NS = 10_000_000

SCENARIO = """
[[event]]
at = 30.4
set = { limit_x2 = "broken" }

[[event]]
at = 30.9
set = { estop = "pressed" }

[[event]]
at = 31.1
set = { estop = "released" }
"""


def session(twin: Twin) -> None:
    """Motions that end by themselves, by a stop, by the E-stop; a circle; a fault; a person."""
    twin.query("@07")
    twin.query("@0d5000,5000,5000")
    assert twin.query("@0R7") == "0"
    twin.write(b"@0A3000,9000,1500,9000,0,30,0,30\r")
    twin.run(0.2)
    twin.write(b"\xfd")
    twin.run(0.3)
    assert twin.query("@0S") == "0"
    assert twin.query("@0y8000,2000,0,1000,0,1,1") == "0"
    assert twin.time_ns < 30 * SECOND_NS
    twin.run_until(30 * SECOND_NS)
    twin.write(b"@0A20000,9000,0,30,0,30,0,30\r")
    twin.run(0.7)
    twin.query("@07")
    twin.write(b"@0A2000,1000,0,30,0,30,0,30\r")
    twin.run_until(32 * SECOND_NS)
    twin.set_input("hood", "open")
    twin.set_input("hood", "closed")
    assert twin.query("@07") == "0"
    twin.run(0.123456789)


def recorded(path: Path, **how: Any) -> tuple[Twin, Recorder]:
    """A session recorded in both ways."""
    scenario = path.with_suffix(".toml")
    scenario.write_text(SCENARIO)
    twin = Twin(scenario=scenario, seed=3, **{"start_mm": (5.0, 5.0, 5.0), **how})
    recorder = Recorder(twin, INTERVAL_NS)
    with RecordingWriter(path, metadata(twin, INTERVAL_NS), attachments(twin.origin)) as writer:
        recording = Recording(twin, writer, INTERVAL_NS)
        session(twin)
        recording.end()
    return twin, recorder


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_exports_are_what_is_written_directly(plant: str, tmp_path: Path) -> None:
    twin, recorder = recorded(tmp_path / "session.mcap", plant=plant)
    again = read(tmp_path / "session.mcap")
    assert again.whole
    assert again.end_ns == twin.time_ns
    steps, played = again.steps(), Played(again)
    assert len(steps) > 5000
    np.testing.assert_array_equal(steps.t_ns, twin.steps.t_ns)
    np.testing.assert_array_equal(steps.delta, twin.steps.delta)
    assert played.changes == recorder.changes
    for kind in KINDS:
        direct, exported = tmp_path / f"direct{kind}", tmp_path / f"exported{kind}"
        write_trace(direct, twin.steps, recorder)
        write_trace(exported, steps, played)
        assert exported.read_bytes() == direct.read_bytes(), kind


def test_what_a_recording_says_of_its_twin(tmp_path: Path) -> None:
    recorded(tmp_path / "session.mcap", overrides={"axes.x.backlash": 0.01}, start_mm=(1.0, 2.0, 3.0))
    again = read(tmp_path / "session.mcap")
    said = {"kind": "twin", "controller": "imc-s8", "plant": "mujoco", "seed": "3", "axes": "4", "machine": "4030"}
    assert said.items() <= again.metadata.items()
    assert again.metadata["start_mm"] == "[1.0, 2.0, 3.0]"
    assert again.attachments["scenario.toml"].decode() == SCENARIO
    assert b"[axes" in again.attachments["machine.toml"]
    assert "model/4030.xml" in again.attachments
    scenario = [entry.content for entry in again.of("/scenario")]
    assert scenario == [{"set": {"limit_x2": "broken"}}, {"set": {"estop": "pressed"}}, {"set": {"estop": "released"}}]
    assert [entry.content for entry in again.of("/operator")] == [
        {"set": {"hood": "open"}},
        {"set": {"hood": "closed"}},
    ]
    assert [entry.content["faults"] for entry in again.of("/faults")] == [{"limit_x2": "broken"}]


def test_a_file_cut_anywhere_reads_as_far_as_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    recorded(path, plant="kinematic")
    data, whole = path.read_bytes(), read(path).entries
    cut = tmp_path / "cut.mcap"
    lengths = []
    for length in range(len(data) // 3, len(data), len(data) // 40):
        cut.write_bytes(data[:length])
        again = read(cut)
        assert not again.whole
        assert again.entries == whole[: len(again.entries)]
        lengths.append(len(again.entries))
    assert lengths == sorted(lengths)


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + b"\x03" + b"\xff" * 400])
def test_what_is_no_recording_is_refused_in_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="is no recording of isel-twin") as caught:
        read(path)
    assert "\n" not in str(caught.value)


def test_another_tools_mcap_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/samples", "json", writer.register_schema("x", "jsonschema", b"{}"))
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(RecordingError, match="is no recording of isel-twin"):
        read(path)


@pytest.mark.parametrize(
    ("channel", "content", "told"),
    [
        ("/runs", {"run": {"steps": {"line": [1]}, "law": [1], "start_ns": 0, "first": 0}}, "/runs at 5 ns: "),
        ("/runs", {"run": {"ticks": {"dtype": "object"}, "axes": 1}}, "/runs at 5 ns: "),
        ("/runs", {"run": None, "continues": True, "other": 1}, ""),
    ],
)
def test_runs_that_are_none_are_refused_in_one_line(
    tmp_path: Path, channel: str, content: dict[str, Any], told: str
) -> None:
    path = tmp_path / "odd.mcap"
    with RecordingWriter(path, {"kind": "twin", "axes": "4", "motors": "3"}) as writer:
        writer.message(channel, 5, content)
    if not told:
        assert len(read(path).steps()) == 0
        return
    with pytest.raises(RecordingError, match=told) as caught:
        read(path).steps()
    assert "\n" not in str(caught.value)
