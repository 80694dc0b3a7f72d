"""Initialisation values (chapter 4) and the flash image that keeps them, with the stored program, without power.

The image is one line of text with a checksum over the rest, then JSON:

    isel-twin imc flash 1 <crc32, 8 hex digits>\\n{"settings": {...}, "program": {...}}

A FlashWrite hands over a whole new image, and whoever keeps it replaces the old one in one go, so after a power loss
the flash holds the old image or the new one. An image that cannot be read (truncated, altered, another version) counts
as none: the device comes up with its defaults and says so (F34).
"""

from __future__ import annotations

import json
import zlib
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

from isel_twin.firmware.imc.profile import Profile

MAGIC = b"isel-twin imc flash 1 "
USER_INFO_LENGTH = 32
AXES = 4

Watch = tuple[int, int, int]
"""Port, mask, value of 4.2.11 to 4.2.14; mask 0 switches it off."""
NO_WATCH: Watch = (0, 0, 0)


@dataclass(frozen=True)
class Settings:
    """All values of chapter 4, in the manual's units; masks have one bit an axis, X lowest."""

    reference_hz: tuple[int, ...]
    run_free_steps: tuple[int, ...]
    start_stop_hz: int
    acceleration_hz_per_ms: int
    limit_switches: int
    swapped: int = 0
    inverted: int = 0
    reference_inverted: int = 0
    rotary: int = 0
    io_only: int = 0
    baud_9600: int = 0
    abort: Watch = NO_WATCH
    error_signal: Watch = NO_WATCH
    hood: Watch = NO_WATCH
    emergency: Watch = NO_WATCH
    user_info: str = ""


def default_settings(profile: Profile) -> Settings:
    """What the device comes with (4.2.19)."""
    return Settings(
        reference_hz=profile.reference_hz,
        run_free_steps=profile.run_free_steps,
        start_stop_hz=profile.start_stop_hz,
        acceleration_hz_per_ms=profile.acceleration_hz_per_ms,
        limit_switches=profile.limit_switches,
    )


@dataclass(frozen=True)
class Modal:
    """Values that commands set until the next reset; stored with a program by `9` (3.2.9). None: not set."""

    reference_hz: tuple[int, ...] | None = None
    start_stop_hz: int | None = None
    acceleration_hz_per_ms: int | None = None
    three_d: bool | None = None
    plane: int | None = None
    clockwise: bool | None = None
    test_mode: bool | None = None

    def filled(self, other: Modal) -> Modal:
        """These values, and those of a stored program where nothing is set; test mode is never taken from it (F38)."""
        names = {f.name for f in fields(self)} - {"test_mode"}
        unset = {name: getattr(other, name) for name in names if getattr(self, name) is None}
        return replace(self, **unset)


EMPTY, INCOMPLETE, VALID = "empty", "incomplete", "valid"


@dataclass(frozen=True)
class Program:
    """A stored program: lines of (code, values). `incomplete`: begun and not ended, or spoiled; only erasing helps."""

    state: str = EMPTY
    lines: tuple[tuple[str, tuple[int, ...]], ...] = ()
    axes: int = 0
    modal: Modal = field(default_factory=Modal)


@dataclass(frozen=True)
class Flash:
    """Content of the flash."""

    settings: Settings
    program: Program = field(default_factory=Program)


def encode(flash: Flash) -> bytes:
    """Flash image of this content."""
    body = json.dumps(asdict(flash), separators=(",", ":")).encode("utf-8")
    return MAGIC + b"%08x\n" % zlib.crc32(body) + body


def decode(image: bytes) -> Flash | None:
    """Content of a flash image; None if it cannot be read as a whole."""
    head, _, body = image.partition(b"\n")
    if head != MAGIC + b"%08x" % zlib.crc32(body):
        return None
    try:
        tree = json.loads(body)
        program = tree["program"]
        lines = tuple((str(code), tuple(int(n) for n in values)) for code, values in program["lines"])
        return Flash(
            _build(Settings, tree["settings"]),
            Program(str(program["state"]), lines, int(program["axes"]), _build(Modal, program["modal"])),
        )
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def _build(kind: type[Any], tree: dict[str, Any]) -> Any:
    """A frozen dataclass from its JSON form: lists are tuples. Raises TypeError or KeyError for other fields."""
    values = {f.name: tree[f.name] for f in fields(kind)}
    if len(values) != len(tree):
        raise TypeError("unknown fields")
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})
