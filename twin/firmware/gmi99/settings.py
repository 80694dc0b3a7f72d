"""Settings of the host, and their non-volatile part: one flash image with version and checksum.

    at once, with the command    zero points, fine corrections, PLC program, CNC programs, DW0..79
    by command `s`               M, B, R, N 10 11 12 13 14 16 18 24 40 51 1000, W ratios, override activity
    never                        positions, flags, f, settings by G, N 8 and 17

An image is replaced as a whole; an unreadable one means defaults and the output `flash_fault`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

from isel_twin.firmware import flash_image
from isel_twin.firmware.flash_image import build, whole

SLOTS = 6
ZERO_POINTS = 16
FINE = 16
PROGRAMS = 32
MAGIC = b"GMI99 1 "

LOWEST, HIGHEST = -8_388_352, 8_388_607  # coordinates (3.1.1)
RATIO_ONE = 65_535

Axes = tuple[int, ...]

# n parameters with one value: field, lowest, highest. N 8, 18 and 40 have several.
NUMBERS: Mapping[int, tuple[str, int, int]] = {
    10: ("axis_mask", 0, 63),
    11: ("fs0_hz", 0, 1_000_000),
    12: ("output_cards", 0, 6),
    13: ("input_cards", 0, 6),
    14: ("fast_circles", 0, 1),
    16: ("fs90_hz", 0, 1_000_000),
    17: ("motion_off", 0, 1),
    24: ("sine_ramps", 0, 1),
    51: ("enable_input", 0, 1),
    1000: ("sgx", -(1 << 23), (1 << 23) - 1),
}


@dataclass(frozen=True)
class Settings:
    """Settings of the host. Speeds in Hz, accelerations in Hz/ms, first of the leading axis, then of each axis (3.1.1);
    defaults as printed there, or by decision gmi99/7."""

    m_hz: Axes = (2000,) * (SLOTS + 1)
    b_hz_per_ms: Axes = (50,) * (SLOTS + 1)
    r_hz: Axes = (0,) * (SLOTS + 1)
    axis_mask: int = 7
    fs0_hz: int = 50
    output_cards: int = 0
    input_cards: int = 0
    fast_circles: int = 0
    fs90_hz: int = 0
    motion_off: int = 0
    sine_ramps: int = 0
    enable_input: int = 0
    sgx: int = 0
    addresses: Axes = ()  # drives that the host reaches, of N18; FFh is unused. Empty: all
    per_turn: Axes = (0,) * SLOTS  # increments of a turn of a rotary axis, 0: none
    home_from: Axes = (0,) * SLOTS
    home_to: Axes = (0,) * SLOTS
    tool_speed: int = 1  # W: the resulting speed is programmed, not that of the longest axis
    ratios: Axes = (RATIO_ONE,) * SLOTS  # resolution of the leading axis over that of each, times 65535
    no_influence: Axes = (0,) * SLOTS  # 1: the axis does not count in the resulting speed
    override: int = 0  # 1: the override acts

    @property
    def kept(self) -> Settings:
        """The part that `s` stores."""
        zero = (0,) * SLOTS
        return replace(self, motion_off=0, home_from=zero, home_to=zero)


@dataclass(frozen=True)
class Stored:
    """Content of the non-volatile memories."""

    settings: Settings = field(default_factory=Settings)
    zero_points: tuple[Axes, ...] = ((0,) * SLOTS,) * ZERO_POINTS
    fine: tuple[Axes, ...] = ((0,) * SLOTS,) * FINE
    data: str = ""  # DW0..79 in hexadecimal
    plc: str = ""  # image of the PLC program in hexadecimal; empty: none
    # commands of the CNC programs in hexadecimal, by number
    programs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def encode(stored: Stored) -> bytes:
    return flash_image.encode(MAGIC, asdict(stored))


def decode(image: bytes) -> Stored | None:
    """Content of a flash image; None if it is damaged or has values that no command could have stored."""
    try:
        tree = flash_image.decode(MAGIC, image)
        if tree.keys() != {f.name for f in fields(Stored)}:
            return None
        stored = Stored(
            build(Settings, tree["settings"]),
            tuple(map(tuple, tree["zero_points"])),
            tuple(map(tuple, tree["fine"])),
            tree["data"],
            tree["plc"],
            {number: tuple(commands) for number, commands in tree["programs"].items()},
        )
        return stored if _possible(stored) else None
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None


def _possible(stored: Stored) -> bool:
    settings = stored.settings
    size = 1 << 23
    return (
        _axes(settings.m_hz, SLOTS + 1, 5, 1_000_000)
        and _axes(settings.b_hz_per_ms, SLOTS + 1, 1, 30_000)
        and _axes(settings.r_hz, SLOTS + 1, 0, 1_000_000)
        and all(whole(getattr(settings, name), low, high) for name, low, high in NUMBERS.values())
        and (settings.addresses == () or _axes(settings.addresses, SLOTS, 0, 255))
        and all(_axes(axes, SLOTS, -size, size - 1) for axes in (settings.home_from, settings.home_to))
        and _axes(settings.per_turn, SLOTS, 0, size - 1)
        and _axes(settings.ratios, SLOTS, 1, RATIO_ONE)
        and _axes(settings.no_influence, SLOTS, 0, 1)
        and whole(settings.tool_speed, 0, 1)
        and whole(settings.override, 0, 1)
        and len(stored.zero_points) == ZERO_POINTS
        and len(stored.fine) == FINE
        and all(_axes(axes, SLOTS, -size, size - 1) for axes in (*stored.zero_points, *stored.fine))
        and all(isinstance(bytes.fromhex(text), bytes) for text in (stored.data, stored.plc))
        and len(stored.data) <= 320
        and all(number.isdigit() and int(number) < PROGRAMS for number in stored.programs)
        and all(len(bytes.fromhex(text)) > 0 for commands in stored.programs.values() for text in commands)
    )


def _axes(values: Any, count: int, low: int, high: int) -> bool:
    return isinstance(values, tuple) and len(values) == count and all(whole(value, low, high) for value in values)
