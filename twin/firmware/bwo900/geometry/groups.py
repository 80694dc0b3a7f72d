"""Groups of G functions, and those in force at the start of a program (manual, chapter 4).

Members of a group replace each other and are modal. Numbers that are neither here nor cycles call the user cycle of
their number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Final

from isel_twin.firmware.bwo900.numbers import G

MOTION, POLAR, TANGENT, TRANSFORMED, PLANE, EXACT, RADIUS, CORRECTION = range(8)
ROTATION, COORDINATES, ZERO, MIRROR, OVERRIDE, DIMENSION, SHIFT, FEED, SPEED = range(8, 17)

CIRCLES: Final = (G.CIRCLE_CLOCKWISE, G.CIRCLE_COUNTER_CLOCKWISE)
SPLINES: Final = (G.SPLINE, G.SPLINE_FEED)
# G53 to G59, G153, and G154 to G959
ZERO_POINTS: Final = frozenset(
    (G.MACHINE_ZERO, G.NO_ZERO, *(100 * more + n for more in range(10) for n in range(G.ZERO_1, G.ZERO_6 + 1)))
)

# group of each modal G function that the twin knows
GROUPS: Final[Mapping[int, int]] = {
    **dict.fromkeys((G.RAPID, G.LINE, *CIRCLES, *SPLINES, G.POLYNOMIAL), MOTION),
    **dict.fromkeys((G.POLAR_ON, G.POLAR_OFF), POLAR),
    **dict.fromkeys((G.TANGENT_OFF,), TANGENT),
    **dict.fromkeys((G.POLAR_TRANSFORMATION_OFF,), TRANSFORMED),
    **dict.fromkeys((G.PLANE_XY, G.PLANE_ZX, G.PLANE_YZ, G.FREE_PLANE_1, G.FREE_PLANE_2, G.FREE_PLANE_3), PLANE),
    **dict.fromkeys((G.EXACT_STOP_ON, G.EXACT_STOP_OFF), EXACT),
    **dict.fromkeys((G.RADIUS_OFF, G.RADIUS_LEFT, G.RADIUS_RIGHT), RADIUS),
    **dict.fromkeys((G.AXIS_CORRECTION_OFF, G.AXIS_CORRECTION_ON), CORRECTION),
    **dict.fromkeys((G.ROTATION_ON, G.ROTATION_OFF), ROTATION),
    **dict.fromkeys(
        (G.MACHINE_COORDINATES, G.TOOL_COORDINATES, G.WORKPIECE_COORDINATES, G.NO_TRANSFORMATION), COORDINATES
    ),
    **dict.fromkeys(ZERO_POINTS, ZERO),
    **dict.fromkeys((G.MIRROR_OFF, G.MIRROR_FIRST, G.MIRROR_SECOND), MIRROR),
    **dict.fromkeys((G.OVERRIDE_FIXED, G.OVERRIDE_FREE), OVERRIDE),
    **dict.fromkeys((G.ABSOLUTE, G.INCREMENTAL), DIMENSION),
    **dict.fromkeys((G.SHIFT,), SHIFT),
    **dict.fromkeys((G.FEED_PER_MINUTE, G.FEED_PER_TURN), FEED),
    **dict.fromkeys((G.TURNS_PER_MINUTE, G.CUTTING_SPEED), SPEED),
}

TURNING: Final = frozenset((G.FEED_PER_TURN, G.CUTTING_SPEED))  # only where there is a spindle (M1224)

# effective in their own block; G123 for its pairs of blocks
BLOCKWISE: Final = frozenset((G.DWELL, G.EXACT_STOP_HERE, G.NO_EXACT_STOP_HERE, G.CORNER, G.BARE, G.THREE_POINTS))

# G functions of the manual that the twin refuses (M1232), and their purpose
BEYOND: Final[Mapping[int, str]] = {
    G.ROTARY_POSITIVE: "rotary axes", G.ROTARY_NEGATIVE: "rotary axes", G.ROTARY_SHORTEST: "rotary axes",
    G.TANGENT_ON: "a tangential axis", G.POLAR_TRANSFORMATION_ON: "the polar transformation",
    G.WEIGHTING_1: "an undocumented function", G.WEIGHTING_2: "an undocumented function", G.INCH_OFF: "inches",
    G.INCH_METRIC: "inches",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Modal:
    """The G functions in force; both mirrors may be."""

    motion: int = G.LINE
    polar: int = G.POLAR_OFF
    plane: int = G.PLANE_XY
    exact: int = G.EXACT_STOP_OFF
    radius: int = G.RADIUS_OFF
    correction: int = G.AXIS_CORRECTION_OFF
    rotation: int = G.ROTATION_OFF
    coordinates: int = G.NO_TRANSFORMATION
    zero: int = G.MACHINE_ZERO
    mirror_first: bool = False
    mirror_second: bool = False
    override: int = G.OVERRIDE_FREE
    dimension: int = G.ABSOLUTE
    feed: int = G.FEED_PER_MINUTE
    speed: int = G.TURNS_PER_MINUTE

    _FIELDS: ClassVar = {
        MOTION: "motion", POLAR: "polar", PLANE: "plane", EXACT: "exact", RADIUS: "radius", CORRECTION: "correction",
        ROTATION: "rotation", COORDINATES: "coordinates", ZERO: "zero", OVERRIDE: "override", DIMENSION: "dimension",
        FEED: "feed", SPEED: "speed",
    }  # fmt: skip

    def with_g(self, number: int) -> Modal:
        group = GROUPS[number]
        if group == MIRROR:
            stays = number != G.MIRROR_OFF
            first = number == G.MIRROR_FIRST or (self.mirror_first and stays)
            second = number == G.MIRROR_SECOND or (self.mirror_second and stays)
            return replace(self, mirror_first=first, mirror_second=second)
        name = self._FIELDS.get(group)
        return self if name is None else replace(self, **{name: number})  # type: ignore[arg-type]


START: Final = Modal()  # at the start of a program, before P8650 and what follows
