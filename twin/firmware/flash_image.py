"""Flash images as a line of text with a checksum over the rest, then JSON.

<magic><crc32, 8 hex digits>\\n{"settings": {...}, ...}
"""

from __future__ import annotations

import json
import zlib
from dataclasses import fields
from typing import Any

from isel_twin.base.parameters import parse_json


def encode(magic: bytes, tree: object) -> bytes:
    """The image of what JSON can hold."""
    body = json.dumps(tree, separators=(",", ":")).encode("ascii")
    return magic + b"%08x\n" % zlib.crc32(body) + body


def decode(magic: bytes, image: bytes) -> Any:
    """What the image holds. Raises ValueError if it is damaged or of another version."""
    head, _, body = image.partition(b"\n")
    if head != magic + b"%08x" % zlib.crc32(body):
        raise ValueError("a damaged flash image")
    return parse_json(body)


def build(kind: type[Any], tree: dict[str, Any]) -> Any:
    """A frozen dataclass from its JSON form: lists are tuples. Raises TypeError or KeyError for other fields."""
    values = {f.name: tree[f.name] for f in fields(kind)}
    if len(values) != len(tree):
        raise TypeError("unknown fields")
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})


def whole(value: Any, low: int, high: int) -> bool:
    """True for a whole number (no bool) in this range."""
    return type(value) is int and low <= value <= high
