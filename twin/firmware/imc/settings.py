"""Initialisation values (chapter 4) and the flash image that keeps them, with the stored program, without power.

The image is one line of text with a checksum over the rest, then JSON:

    isel-twin imc flash 1 <crc32, 8 hex digits>\\n{"settings": {...}, "program": {...}}

A FlashWrite has a whole new image that replaces the old one atomically. An image that is damaged, of another version,
or has a value that no command would have stored counts as none: the device takes its defaults and reports it (imc/33).
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from typing import Any

from isel_twin.firmware import flash_image
from isel_twin.firmware.flash_image import build, whole
from isel_twin.firmware.imc.profile import Profile

MAGIC = b"isel-twin imc flash 1 "
USER_INFO_LENGTH = 32
AXES = 4

Watch = tuple[int, int, int]  # port, mask, value of 4.2.11 to 4.2.14; mask 0 switches it off
NO_WATCH: Watch = (0, 0, 0)


@cache
def axes_of(mask: int) -> tuple[int, ...]:
    """Axes of a mask, in the order X, Y, Z, A."""
    return tuple(axis for axis in range(AXES) if mask >> axis & 1)


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
    """Factory settings (4.2.19)."""
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
        """These values, completed by those of a stored program, except test mode (imc/36)."""
        names = {f.name for f in fields(self)} - {"test_mode"}
        unset = {name: getattr(other, name) for name in names if getattr(self, name) is None}
        return replace(self, **unset)


class ProgramState(enum.StrEnum):
    """Of the memory for a stored program. INCOMPLETE: begun and not ended, or spoiled; only erasing helps."""

    EMPTY = "empty"
    INCOMPLETE = "incomplete"
    VALID = "valid"


@dataclass(frozen=True)
class StoredProgram:
    """Lines of (code, values), and the axes and modal values they were stored with."""

    state: ProgramState = ProgramState.EMPTY
    lines: tuple[tuple[str, tuple[int, ...]], ...] = ()
    axes: int = 0
    modal: Modal = field(default_factory=Modal)


@dataclass(frozen=True)
class Flash:
    settings: Settings
    program: StoredProgram = field(default_factory=StoredProgram)


def encode(flash: Flash) -> bytes:
    return flash_image.encode(MAGIC, asdict(flash))


WHOLE = 0, (1 << 23) - 1  # range of numbers without a narrower one
PORT, BYTE, MASK, SWITCH = (0, 3), (0, 255), (0, 15), (0, 1)

# axes that `@0<axes>` can have set: none, X, XY, XYZ, and A alone or with those
AXIS_SETS = frozenset((0, 1, 3, 7, 8, 9, 11, 15))

# Ranges of each value: those of the command that sets it (commands.py). The range of speeds is a setting of the
# profile, which may change at the next start; so for them any positive number is valid.
RANGES: Mapping[str, tuple[tuple[int, int], ...]] = {
    "reference_hz": ((1, WHOLE[1]),) * AXES,
    "run_free_steps": (WHOLE,) * AXES,
    "start_stop_hz": ((20, 4000),),
    "acceleration_hz_per_ms": ((1, 4000),),
    "limit_switches": ((0, 65_535),),
    **dict.fromkeys(("swapped", "inverted", "reference_inverted", "rotary"), (MASK,)),
    **dict.fromkeys(("io_only", "baud_9600"), (SWITCH,)),
    **dict.fromkeys(("abort", "hood", "emergency"), (PORT, BYTE, BYTE)),
    "error_signal": ((0, 0), BYTE, BYTE),
    "plane": ((0, 2),),
}


def decode(image: bytes) -> Flash | None:
    """None if the image is damaged or holds values that no command could have stored."""
    try:
        tree = flash_image.decode(MAGIC, image)
        program = tree["program"]
        lines = tuple((code, tuple(values)) for code, values in program["lines"])
        modal = build(Modal, program["modal"])
        stored = StoredProgram(ProgramState(program["state"]), lines, program["axes"], modal)
        flash = Flash(build(Settings, tree["settings"]), stored)
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    return flash if _possible(flash) else None


def _possible(flash: Flash) -> bool:
    settings, program = vars(flash.settings), flash.program
    modal = {name: value for name, value in vars(program.modal).items() if value is not None}
    return (
        all(_in_range(name, settings[name]) for name in settings.keys() & RANGES.keys())
        and is_user_info(settings["user_info"])
        and all(_in_range(name, value) if name in RANGES else isinstance(value, bool) for name, value in modal.items())
        and whole(program.axes, program.state is not ProgramState.EMPTY, MASK[1])
        and program.axes in AXIS_SETS
        and all(
            isinstance(code, str) and all(whole(value, -WHOLE[1] - 1, WHOLE[1]) for value in values)
            for code, values in program.lines
        )
    )


def is_user_info(text: Any) -> bool:
    """At most 32 printable characters (4.2.16, imc/42)."""
    return isinstance(text, str) and len(text) <= USER_INFO_LENGTH and text.isascii() and text.isprintable()


def _in_range(name: str, value: Any) -> bool:
    """True if the numbers of a value are within the range of the command that sets it."""
    ranges = RANGES[name]
    numbers = value if isinstance(value, tuple) else (value,)
    return (
        isinstance(value, tuple) == (len(ranges) > 1)
        and len(numbers) == len(ranges)
        and all(whole(number, *limits) for number, limits in zip(numbers, ranges, strict=True))
    )
