"""A recording as one for viewers: messages that Foxglove's own definitions take, and what they say."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import foxglove_schemas_protobuf.FrameTransforms_pb2 as frames_pb
import foxglove_schemas_protobuf.Log_pb2 as log_pb
import foxglove_schemas_protobuf.SceneUpdate_pb2 as scene_pb
import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.json_format import ParseDict
from google.protobuf.message_factory import GetMessages
from mcap.reader import make_reader

from isel_twin import Twin
from isel_twin.plant.scene import Poses
from isel_twin.recordings.places import places
from isel_twin.recordings.reading import RecordingError, read
from isel_twin.recordings.recording import FileRecording
from isel_twin.recordings.write import export
from tests.in_process import isel_twin

BEGAN = "2026-01-02T03:04:05.500+00:00"
DEFINED = {
    "foxglove.SceneUpdate": scene_pb.SceneUpdate,
    "foxglove.FrameTransforms": frames_pb.FrameTransforms,
    "foxglove.Log": log_pb.Log,
}
Told = list[tuple[str, str, int, dict[str, Any]]]


def recorded_session(path: Path, said: dict[str, str]) -> Twin:
    twin = Twin(plant="kinematic", start_mm=(30.0, 20.0, 10.0))
    recording = FileRecording(path, twin, 10_000_000, said)
    for command in ("@07", "@0R7", "@0A3200,4000,1600,4000,0,30,0,30"):
        assert twin.query(command) == "0"
    twin.set_input("hood", "open")
    twin.run(0.1)
    recording.close()
    return twin


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("viewer")
    recorded_session(folder / "session.mcap", {"began": BEGAN})
    assert isel_twin("export", folder / "session.mcap", folder / "proto.mcap").returncode == 0
    with pytest.MonkeyPatch.context() as without:
        without.setitem(sys.modules, "foxglove_schemas_protobuf", None)
        assert isel_twin("export", folder / "session.mcap", folder / "view.mcap").returncode == 0
    return folder


@pytest.fixture(scope="module")
def told(folder: Path) -> Told:
    with (folder / "view.mcap").open("rb") as file:
        messages = list(make_reader(file).iter_messages())
    assert {schema.encoding for schema, _, _ in messages if schema is not None} == {"jsonschema"}
    return [(c.topic, s.name, m.log_time, json.loads(m.data)) for s, c, m in messages if s is not None]


def protobuf(value: Any, key: str = "") -> Any:
    """Times as the JSON of Protocol Buffers has them, which is strict: no field too many, no wrong kind."""
    if isinstance(value, dict):
        if value.keys() == {"sec", "nsec"}:
            moment = datetime.fromtimestamp(value["sec"], UTC).strftime("%Y-%m-%dT%H:%M:%S")
            return "0s" if key == "lifetime" else f"{moment}.{value['nsec']:09d}Z"
        return {name: protobuf(part, name) for name, part in value.items()}
    return [protobuf(part) for part in value] if isinstance(value, list) else value


def of(told: Told, topic: str) -> Iterator[tuple[int, dict[str, Any]]]:
    return ((time_ns, content) for where, _, time_ns, content in told if where == topic)


def test_foxglove_takes_each_message(told: Told) -> None:
    seen = set()
    for topic, name, _, content in told:
        if name in DEFINED:
            ParseDict(protobuf(content), DEFINED[name]())
            seen.add((topic, name))
    assert seen == {
        ("/scene", "foxglove.SceneUpdate"),
        ("/tf", "foxglove.FrameTransforms"),
        ("/log", "foxglove.Log"),
    }


def test_messages_of_foxglove_are_protocol_buffers_where_their_definitions_are(folder: Path, told: Told) -> None:
    """Decoded by what the file says of itself, as readers of protobuf in MCAP do: the messages of the JSON file."""
    with (folder / "proto.mcap").open("rb") as file:
        messages = [message for message in make_reader(file).iter_messages() if message[0] is not None]
    assert [(c.topic, s.name, m.log_time) for s, c, m in messages if s] == [one[:3] for one in told]
    kinds: dict[str, Any] = {}
    for (schema, channel, message), (_, name, _, content) in zip(messages, told, strict=True):
        assert schema is not None
        encodings = (schema.encoding, channel.message_encoding)
        if name not in DEFINED:
            assert (*encodings, json.loads(message.data)) == ("jsonschema", "json", content)
            continue
        assert encodings == ("protobuf", "protobuf")
        if name not in kinds:
            kinds[name] = GetMessages(FileDescriptorSet.FromString(schema.data).file)[name]
        wanted = ParseDict(protobuf(content), kinds[name]())
        assert kinds[name].FromString(message.data) == wanted
    assert {*kinds} == {*DEFINED}


def test_times_are_those_of_the_wall_clock_if_the_session_had_one(told: Told, tmp_path: Path) -> None:
    began_ns = round(datetime.fromisoformat(BEGAN).timestamp() * 1000) * 1_000_000
    assert min(time_ns for _, _, time_ns, _ in told) == began_ns
    _, first = next(of(told, "/tf"))
    assert first["transforms"][0]["timestamp"] == {"sec": began_ns // 10**9, "nsec": began_ns % 10**9}
    recorded_session(tmp_path / "none.mcap", {})
    export(tmp_path / "none.mcap", tmp_path / "view.mcap")
    with (tmp_path / "view.mcap").open("rb") as file:
        assert next(make_reader(file).iter_messages())[2].log_time == 0


def test_the_bodies_are_where_the_machine_was(folder: Path, told: Told) -> None:
    """Each body with a mesh in its own frame."""
    machine = places(read(folder / "session.mcap"))
    poses = Poses(machine.model).at(machine.position_mm[-1].tolist())
    *_, (_, last) = of(told, "/tf")
    frames = {one["child_frame_id"]: one["translation"] for one in last["transforms"]}
    for name, at in frames.items():
        assert [at[axis] for axis in "xyz"] == pytest.approx(poses[name].position.tolist(), abs=1e-6)
    ((_, scene),) = of(told, "/scene")
    assert {entity["frame_id"] for entity in scene["entities"]} <= {*frames, "machine"}


def test_a_machine_stays_where_it_is_when_its_counters_are_set(tmp_path: Path) -> None:
    twin = recorded_session(tmp_path / "session.mcap", {})
    found = places(read(tmp_path / "session.mcap")).position_mm
    assert found[0].tolist() == [30.0, 20.0, 10.0]
    assert found[-1] == pytest.approx(twin.machine_position_mm, abs=0.05)
    assert np.abs(np.diff(found, axis=0)).max() < 0.5  # no jump


def test_numbers_have_the_names_of_their_axes(folder: Path, told: Told) -> None:
    samples = read(folder / "session.mcap").samples
    *_, (_, last) = of(told, "/machine")
    assert [last[axis]["counts"] for axis in "xyz"] == samples["counts"][-1, :3].tolist() == [3200, 1600, 0]
    assert "margin" not in last["x"]  # none without physics
    assert np.isnan(samples["margin"][-1]).all()
    *_, (_, levels) = of(told, "/levels")
    assert levels["p2_5"] == 0  # the hood
    assert "hood" in [message["message"] for _, message in of(told, "/log")][-1]


def test_bytes_of_a_line_are_no_machine(tmp_path: Path) -> None:
    from isel_twin.recordings.mcap import RecordingWriter

    with RecordingWriter(tmp_path / "tap.mcap", {"kind": "tap", "controller": "imc-s8"}) as writer:
        writer.sent(0, b"a")
    with pytest.raises(RecordingError, match="bytes of a line and nothing else"):
        export(tmp_path / "tap.mcap", tmp_path / "view.mcap")
    assert not (tmp_path / "view.mcap").exists()
