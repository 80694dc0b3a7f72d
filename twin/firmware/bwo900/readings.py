"""Readings of the manual that a setting of the machine file chooses. Without one its plain words hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Final


@dataclass(frozen=True)
class Readings:
    ramped_halts: bool = False  # bwo900/71, bwo900/92, bwo900/62
    plane_change_in_place: bool = False  # bwo900/63
    rotation_stays: bool = False  # bwo900/6


# what holds without a setting and with it, for people
WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "ramped_halts": (
        "P8701 = 0, byte 3 of P12137 and byte 2 of P8855 stop the axes without ramps",
        "P8701 = 0, byte 3 of P12137 and byte 2 of P8855 stop the axes with their ramps; the manual's control has none",
    ),
    "plane_change_in_place": (
        "G40 in a block without a path, then another plane: the next place is wrong by the tool's offset",
        "G40 in a block without a path, then another plane: the place is right; at the manual's control it is wrong",
    ),
    "rotation_stays": (
        "P165, P166, P168 in a block with a path: both axes of the plane go to their places as turned or shifted",
        "P165, P166, P168 in a block with a path: axes that it does not program stay; the manual's example moves them",
    ),
}


def readings_of(settings: Mapping[str, Any]) -> Readings:
    """The readings that these settings choose; others are ignored."""
    return Readings(**{item.name: bool(settings.get(item.name, False)) for item in fields(Readings)})


def readings_in_force(name: str, settings: Mapping[str, Any]) -> Mapping[str, tuple[bool, str]]:
    """Value and words of each reading."""
    return {key: (value, WORDS[key][value]) for key, value in asdict(readings_of(settings)).items()}
