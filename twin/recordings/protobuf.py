"""Foxglove's messages as Protocol Buffers, with the definitions of the package foxglove-schemas-protobuf."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from typing import Any

_NAMES = {"sec": "seconds", "nsec": "nanos"}  # of the parts of a time, as JSON has them, here


def has_schemas() -> bool:
    """The package is installed."""
    return find_spec("foxglove_schemas_protobuf") is not None


def definition(name: str) -> tuple[bytes, Callable[[Mapping[str, Any]], bytes]]:
    """Definition of a message foxglove.NAME, with all that it needs, and its encoder. Raises ImportError without it."""
    from foxglove_schemas_protobuf import FrameTransforms_pb2, Log_pb2, SceneUpdate_pb2
    from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet

    (kind,) = (getattr(part, name) for part in (FrameTransforms_pb2, Log_pb2, SceneUpdate_pb2) if hasattr(part, name))
    files: dict[str, Any] = {}

    def add(file: Any) -> None:
        for needed in file.dependencies:
            add(needed)
        files.setdefault(file.name, FileDescriptorProto.FromString(file.serialized_pb))

    add(kind.DESCRIPTOR.file)
    every = FileDescriptorSet(file=files.values()).SerializeToString()
    return every, lambda content: kind(**_renamed(content)).SerializeToString()


def _renamed(value: Any) -> Any:
    if isinstance(value, dict):
        return {_NAMES.get(name, name): _renamed(part) for name, part in value.items()}
    return [_renamed(part) for part in value] if isinstance(value, list) else value
