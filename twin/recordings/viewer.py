"""A recording for viewers, in Foxglove's schemas: the machine in 3D, numbers by axis, events.

    /scene      foxglove.SceneUpdate        meshes of each body in its own frame, the path of the tool; once
    /tf         foxglove.FrameTransforms    where the bodies are, every TF_NS while something moves
    /machine    {"x": {"counts": ..., "position_mm": ...}, ..., "supply_v": ...}       each sample
    /levels /inputs /outputs                all of them, at each change; a point in a name is a low line here
    /log        foxglove.Log                messages of the line with what they mean, events, remarks, collisions

All of it is JSON with its schema, but Foxglove's messages are Protocol Buffers where their definitions are installed
(protobuf.py), as some viewers show no others. They know these messages by their names; the schemas here have the fields
that are used, of https://github.com/foxglove/foxglove-sdk (schemas/jsonschema). Times are those of the wall clock where
the session had one (`began`), else seconds of virtual time after 1970.
"""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.files import replacing
from isel_twin.base.thinning import extremes
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.language import readable
from isel_twin.plant.scene import Poses, body_meshes
from isel_twin.recordings.container import Container
from isel_twin.recordings.mcap import METADATA
from isel_twin.recordings.places import Places, places
from isel_twin.recordings.protobuf import definition, has_schemas
from isel_twin.recordings.reading import Recorded
from isel_twin.recordings.recording import GROUPS
from isel_twin.version import VERSION

TF_NS = 20 * MILLISECOND_NS
ROOT = "machine"  # the frame that does not move
PATH_POINTS = 5000  # most points of the path of the tool
CHUNK_BYTES = 1 << 18
INFO, WARNING, ERROR = 2, 3, 4  # levels of foxglove.Log

_NUMBER, _TEXT, _WHOLE, _YES = ({"type": name} for name in ("number", "string", "integer", "boolean"))


def _table(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _list(items: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_TIME = _table(sec=_WHOLE, nsec=_WHOLE)
_PLACE = _table(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_TURN = _table(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _table(position=_PLACE, orientation=_TURN)
_COLOUR = _table(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_SHAPE = {"pose": _POSE, "points": _list(_PLACE), "color": _COLOUR, "colors": _list(_COLOUR), "indices": _list(_WHOLE)}
_ENTITY = _table(
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_TIME,
    frame_locked=_YES,
    metadata=_list(_table(key=_TEXT, value=_TEXT)),
    **{kind: _list(_table()) for kind in ("arrows", "cubes", "spheres", "cylinders", "texts", "models")},
    lines=_list(_table(type=_WHOLE, thickness=_NUMBER, scale_invariant=_YES, **_SHAPE)),
    triangles=_list(_table(**_SHAPE)),
)
_TRANSFORM = _table(timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_PLACE, rotation=_TURN)
SCHEMAS: Final[Mapping[str, dict[str, Any]]] = {
    "foxglove.SceneUpdate": _table(
        deletions=_list(_table(timestamp=_TIME, type=_WHOLE, id=_TEXT)), entities=_list(_ENTITY)
    ),
    "foxglove.FrameTransforms": _table(transforms=_list(_TRANSFORM)),
    "foxglove.Log": _table(timestamp=_TIME, level=_WHOLE, message=_TEXT, name=_TEXT, file=_TEXT, line=_WHOLE),
}
_STILL = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
_JSON: Final = json.JSONEncoder(separators=(",", ":"), allow_nan=False)
Message = tuple[int, str, str, dict[str, Any]]  # virtual time in ns, topic, schema, content


def write_viewer(path: Path, recorded: Recorded) -> None:
    """Raises RecordingError for a recording that does not say where the machine was, OSError."""
    machine = places(recorded)
    epoch_ns = began_ns(recorded.metadata)
    streams = [_bodies(recorded, machine, epoch_ns), _samples(recorded), _states(recorded), _log(recorded, epoch_ns)]
    with replacing(path) as file:
        container = Container(file, f"isel-twin {VERSION}", str(path.parent))
        container.metadata(METADATA, {**recorded.metadata, "kind": "viewer"})
        _write(container, streams, epoch_ns)
        container.finish()


def _write(container: Container, streams: list[Iterator[Message]], epoch_ns: int) -> None:
    channels: dict[str, tuple[int, Callable[[Mapping[str, Any]], bytes]]] = {}
    for time_ns, topic, name, content in heapq.merge(*streams, key=lambda message: message[0]):
        if topic not in channels:
            channels[topic] = _channel(container, topic, name)
        number, to_bytes = channels[topic]
        container.message(number, epoch_ns + time_ns, to_bytes(content))
        if container.waiting >= CHUNK_BYTES:
            container.flush()


def _channel(container: Container, topic: str, name: str) -> tuple[int, Callable[[Mapping[str, Any]], bytes]]:
    """A new channel for messages of this schema, and their encoder."""
    if name in SCHEMAS and has_schemas():
        described, to_bytes = definition(name.removeprefix("foxglove."))
        return container.channel(topic, "protobuf", (name, "protobuf", described)), to_bytes
    text = json.dumps({"title": name, **SCHEMAS.get(name, _table())}).encode()
    return container.channel(topic, "json", (name, "jsonschema", text)), lambda content: _JSON.encode(content).encode()


def began_ns(metadata: Mapping[str, str]) -> int:
    """The wall clock at virtual time 0, ns since 1970 (UTC); 0: the session had none."""
    try:
        began = datetime.fromisoformat(metadata["began"])
    except (KeyError, ValueError):
        return 0
    return round(began.timestamp() * 1e6) * 1000


def _stamp(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // SECOND_NS, "nsec": time_ns % SECOND_NS}


def _point(values: Any) -> dict[str, float]:
    x, y, z = (round(float(value), 6) for value in values)
    return {"x": x, "y": y, "z": z}


def _entity(stamp: dict[str, int], frame: str, name: str, **shapes: Any) -> dict[str, Any]:
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    said = {"timestamp": stamp, "frame_id": frame, "id": name, "lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True}
    return {**said, "metadata": [], **{kind: shapes.get(kind, []) for kind in kinds}}


def _bodies(recorded: Recorded, machine: Places, epoch_ns: int) -> Iterator[Message]:
    """The scene, and the frames as they move."""
    poses = Poses(machine.model, [axis.name for axis in machine.machine.axes])
    times_ns, at_mm = recorded.sample_times_ns, machine.position_mm
    first_ns = int(times_ns[0]) if len(times_ns) else 0
    entities = []
    for number, mesh in enumerate(body_meshes(machine.model)):
        red, green, blue, alpha = mesh.rgba
        shape = {
            "pose": _STILL,
            "points": [_point(vertex) for vertex in mesh.vertices],
            "color": {"r": red, "g": green, "b": blue, "a": alpha},
            "colors": [],
            "indices": mesh.faces.ravel().tolist(),
        }
        frame = ROOT if mesh.body == "world" else mesh.body
        entities.append(_entity(_stamp(epoch_ns + first_ns), frame, f"{mesh.body}/{number}", triangles=[shape]))
    path = []
    for position_mm in at_mm[extremes(at_mm, PATH_POINTS)]:
        poses.at(position_mm.tolist())
        path.append(_point(poses.tool))
    line = {
        "type": 0,
        "pose": _STILL,
        "thickness": 1.5,
        "scale_invariant": True,
        "points": path,
        "color": {"r": 0.0, "g": 0.47, "b": 0.12, "a": 1.0},
        "colors": [],
        "indices": [],
    }
    entities.append(_entity(_stamp(epoch_ns + first_ns), poses.table_body, "path", lines=[line]))
    yield first_ns, "/scene", "foxglove.SceneUpdate", {"deletions": [], "entities": entities}
    names = sorted({mesh.body for mesh in body_meshes(machine.model)} | {poses.table_body} - {"world"})
    due_ns = first_ns
    for i, time_ns in enumerate(times_ns.tolist()):
        last = i + 1 == len(times_ns) or times_ns[i + 1] - time_ns > TF_NS  # it stands still from here on
        if time_ns < due_ns and not last:
            continue
        due_ns = time_ns + TF_NS
        transforms = []
        for name, pose in poses.at(at_mm[i].tolist()).items():
            if name in names and name != "world":
                w, x, y, z = (round(float(part), 9) for part in pose.wxyz)
                moved = {"translation": _point(pose.position), "rotation": {"x": x, "y": y, "z": z, "w": w}}
                frames = {"parent_frame_id": ROOT, "child_frame_id": name}
                transforms.append({"timestamp": _stamp(epoch_ns + time_ns), **frames, **moved})
        yield time_ns, "/tf", "foxglove.FrameTransforms", {"transforms": transforms}


def _samples(recorded: Recorded) -> Iterator[Message]:
    """Each sample, by axes. What has no value is left out."""
    fields = recorded.samples.dtype.names or ()
    for time_ns, sample in zip(recorded.sample_times_ns.tolist(), recorded.samples, strict=True):
        content: dict[str, Any] = {}
        for name in fields:
            values = np.atleast_1d(sample[name]).tolist()
            if name == "supply_v":
                if math.isfinite(values[0]):
                    content[name] = values[0]
                continue
            for axis, value in zip(AXIS_NAMES, values, strict=False):
                if math.isfinite(value):
                    content.setdefault(axis, {})[name] = value
        yield time_ns, "/machine", "isel_twin.machine", content


def _states(recorded: Recorded) -> Iterator[Message]:
    """All levels, inputs and outputs, at each change of one."""
    channels: dict[str, dict[str, Any]] = {channel: {} for channel in GROUPS.values()}
    for entry in recorded.of(*channels):
        now = channels[entry.channel]
        now |= {name.replace(".", "_"): value for name, value in entry.content.items()}
        yield entry.time_ns, entry.channel, f"isel_twin{entry.channel.replace('/', '.')}", dict(now)


def _log(recorded: Recorded, epoch_ns: int) -> Iterator[Message]:
    names = {"/host/sent": "host", "/host/received": "twin", "/operator": "hand", "/scenario": "event"}
    found = []
    for entry in recorded.of(*names, "/remarks", "/collisions", "/port"):
        content, level = entry.content, INFO
        if entry.channel in ("/host/sent", "/host/received"):
            text = content.get("explanation") or readable(recorded.data(entry))
        elif entry.channel == "/remarks":
            text, level = content.get("text", ""), WARNING
        elif entry.channel == "/collisions":
            text, level = f"{content.get('first')} and {content.get('second')} have met", ERROR
        elif content == {"watch_margin": True}:
            continue
        else:
            text = content.get("text") or json.dumps(content)
        said = {"timestamp": _stamp(epoch_ns + entry.time_ns), "level": level, "message": text}
        found.append((entry.time_ns, {**said, "name": names.get(entry.channel, "twin"), "file": "", "line": 0}))
    for time_ns, message in sorted(found, key=lambda one: one[0]):
        yield time_ns, "/log", "foxglove.Log", message
