"""G functions: which overwrite each other, what is in force at the start of a program (manual, chapter 4).

Members of a group overwrite each other; what is modal stays for the blocks that follow. Numbers that are neither here
nor cycles call the user cycle of their number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

MOTION, POLAR, TANGENT, TRANSFORMED, PLANE, EXACT, RADIUS, CORRECTION = range(8)
ROTATION, COORDINATES, ZERO, MIRROR, OVERRIDE, DIMENSION, SHIFT, FEED, SPEED, INCH = range(8, 18)

ZERO_POINTS: Final = frozenset(
    (53, 153, *range(54, 60), *(hundred * 100 + number for hundred in range(1, 10) for number in range(54, 60)))
)
"""G53 to G59, G153, and G154 to G959."""

GROUPS: Final[Mapping[int, int]] = {
    **dict.fromkeys((0, 1, 2, 3), MOTION),
    **dict.fromkeys((10, 11), POLAR),
    **dict.fromkeys((13,), TANGENT),
    **dict.fromkeys((15,), TRANSFORMED),
    **dict.fromkeys((17, 18, 19, 117, 118, 119), PLANE),
    **dict.fromkeys((28, 29), EXACT),
    **dict.fromkeys((40, 41, 42), RADIUS),
    **dict.fromkeys((43, 44), CORRECTION),
    **dict.fromkeys((45, 46), ROTATION),
    **dict.fromkeys((47, 48, 49, 147), COORDINATES),
    **dict.fromkeys(ZERO_POINTS, ZERO),
    **dict.fromkeys((60, 61, 62), MIRROR),
    **dict.fromkeys((63, 64), OVERRIDE),
    **dict.fromkeys((90, 91), DIMENSION),
    **dict.fromkeys((92,), SHIFT),
    **dict.fromkeys((94,), FEED),
    **dict.fromkeys((97,), SPEED),
}
"""Group of each modal G function that the twin knows."""

BLOCKWISE: Final = frozenset((4, 8, 9, 12, 66, 123))
"""In force for the block they stand in; G123 for its pairs of blocks."""

BEYOND: Final[Mapping[int, str]] = {
    5: "rotary axes", 6: "rotary axes", 7: "rotary axes", 14: "a tangential axis", 16: "the polar transformation",
    50: "splines", 51: "splines", 52: "polynomials", 69: "measuring cycles", 95: "feed per revolution",
    96: "constant cutting speed", 151: "an undocumented function", 152: "an undocumented function",
    170: "inches", 171: "inches",
}  # fmt: skip
"""G functions of the manual that the twin has not: refused by M1232 with what they are for."""


@dataclass(frozen=True, slots=True)
class Modal:
    """What is in force, by the numbers of the G functions; mirrors are two."""

    motion: int = 1
    polar: int = 11
    plane: int = 17
    exact: int = 29
    radius: int = 40
    correction: int = 43
    rotation: int = 46
    coordinates: int = 147
    zero: int = 53
    mirror_first: bool = False
    mirror_second: bool = False
    override: int = 64
    dimension: int = 90

    _FIELDS = {  # noqa: RUF012  (not a field: it has no annotation)
        MOTION: "motion",
        POLAR: "polar",
        PLANE: "plane",
        EXACT: "exact",
        RADIUS: "radius",
        CORRECTION: "correction",
        ROTATION: "rotation",
        COORDINATES: "coordinates",
        ZERO: "zero",
        OVERRIDE: "override",
        DIMENSION: "dimension",
    }

    def with_g(self, number: int) -> Modal:
        """This with a G function of GROUPS in force."""
        group = GROUPS[number]
        if group == MIRROR:
            return replace(
                self,
                mirror_first=number == 61 or (self.mirror_first and number != 60),
                mirror_second=number == 62 or (self.mirror_second and number != 60),
            )
        name = self._FIELDS.get(group)
        return self if name is None else replace(self, **{name: number})  # type: ignore[arg-type]


START: Final = Modal()
"""At the start of a program, before P8650 and what follows."""
