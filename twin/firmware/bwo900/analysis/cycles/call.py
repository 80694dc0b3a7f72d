"""A call of a cycle, and its moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TypeAlias

from isel_twin.firmware.bwo900.geometry.elements import Plane, Point
from isel_twin.firmware.bwo900.messages import ProgramError, invalid


class Kind(Enum):
    """How a move goes to its target."""

    RAPID = "G00"
    LINE = "G01"
    CLOCKWISE = "G02"
    COUNTER_CLOCKWISE = "G03"
    TAP = "G01, coupled with the spindle: feed = its speed times pitch, override 100 %"
    PROGRAMMED = "as the block says: G02 or G03 with its radius or centre, and F"


Answer: TypeAlias = Point | None
"""To a watched move: where the axes stood at the signal, in program coordinates, mm; None: there was none."""


@dataclass(frozen=True, slots=True)
class CycleMove:
    """One step of a cycle. Everything in program coordinates, absolute, mm.

    target: by axis number; axes that are not named stay. centre: of an arc, (first, second) axis of the plane. feed:
    mm/min, None: that of the program. dwell_s: after the path, exact stop before it. m: M functions after that, in
    order.
    """

    kind: Kind
    target: Mapping[int, float] = field(default_factory=dict)
    centre: tuple[float, float] | None = None
    feed_mm_min: float | None = None
    dwell_s: float | None = None
    m: tuple[int, ...] = ()
    exact_stop: bool = False
    cycle: int | None = None  # in a pattern: the machining cycle to call at the target
    watched: bool = False  # the probe ends its path, or its dwell; the cycle waits and is sent an `Answer`
    writes: Mapping[int, float] = field(default_factory=dict)  # parameters P, when analysis gets there


@dataclass(frozen=True, slots=True)
class Call:
    """Arguments of a cycle.

    parameters: P numbers that have a value. position: in program coordinates, before the
    block. words: axis words of the block, absolute program coordinates by axis number; empty: none. feed: F in force,
    mm/min, None: none. speed: S in force in 1/min, None: none. turning: +1 M03, -1 M04, 0 spindle off. motion: 0, 1, 2,
    3, of the G00 group. inner: number of the machining cycle that stands in the block of a pattern cycle. polar: the
    words are polar coordinates. coupled: there is a spindle whose speed can be measured. has_tool: T has called one for
    the path.
    """

    parameters: Mapping[int, float]
    position: Point
    plane: Plane
    words: Mapping[int, float] = field(default_factory=dict)
    feed_mm_min: float | None = None
    rapid_mm_min: float = 0.0
    speed_rpm: float | None = None
    turning: int = 0
    motion: int = 0
    tool_radius_mm: float = 0.0
    inner: int | None = None
    polar: bool = False
    coupled: bool = False
    has_tool: bool = False

    def get(self, number: int) -> float | None:
        """None if it is deleted."""
        return self.parameters.get(number)

    def given(self, number: int) -> float | None:
        """None if it is deleted or 0: the manual's "0 or --"."""
        return self.parameters.get(number) or None

    def needed(self, number: int) -> float:
        """Raises ProgramError, the message about that parameter, if it is deleted."""
        value = self.parameters.get(number)
        if value is None:
            raise ProgramError(invalid(number), f"P{number} has no value")
        return value
