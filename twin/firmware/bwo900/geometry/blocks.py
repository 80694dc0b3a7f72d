"""Blocks for the path: elements in machine coordinates, and what happens before and after them.

    interpreter --- PathBlock ---> contour (G12, G123) ---> radius correction (G41, G42) ---> path, real time

Each stage takes blocks and gives blocks, in order, and changes elements only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from isel_twin.firmware.bwo900.geometry.curves import Bent, Cubic, Round
from isel_twin.firmware.bwo900.geometry.elements import XY, Arc, Element, Plane, Point, Straight
from isel_twin.firmware.bwo900.geometry.in_force import AT_REST, InForce
from isel_twin.firmware.bwo900.programs.words import Text


class BlockEnd(Enum):
    """How a block's path ends."""

    CONTINUOUS = "no stop: the next block joins"
    FEED_STOP = "speed 0, without waiting for the axes"
    EXACT_STOP = "speed 0, and the following error within its window"


class Stop(Enum):
    """What happens after a block's post functions."""

    NONE = ""
    SYNCHRONISE = "M01: analysis waits until the block has been executed"
    MEASURING_STOP = "M00: until Start; tool data are read again"
    END = "M30: end of the program"
    REPEAT = "M29: from its first block again"


@dataclass(frozen=True, slots=True)
class Correction:
    """Tool radius correction of a block: side +1 left (G41), -1 right (G42), 0 off; radius in mm, never negative."""

    side: int = 0
    radius_mm: float = 0.0


@dataclass(frozen=True, slots=True)
class MFunction:
    """An M function for the PLC: number, extensions; halt: until it is acknowledged."""

    code: int
    extensions: tuple[float, ...] = ()
    halt: bool = False
    jump: bool = False  # its acknowledgement deletes the path, and the program goes on elsewhere


@dataclass(frozen=True)
class PathBlock:
    """One analysed block of a program or a cycle."""

    program: str
    number: int  # of the block; of the block that called, within a cycle
    column: int = 0
    start: Point = (0.0, 0.0, 0.0)  # where it begins, in machine coordinates, before any radius correction
    elements: tuple[Element | Bent, ...] = ()  # empty: no path
    plane: Plane = XY
    rapid: bool = False
    feed_mm_min: float | None = None  # path feed; None with rapid
    end_feed_mm_min: float | None = None  # feed that the block ends with (`f`)
    per_turn: bool = False  # both feeds are in mm a revolution of the spindle
    override: bool = True  # False: G63, 100 %
    end: BlockEnd = BlockEnd.CONTINUOUS
    correction: Correction = Correction()
    tool_mm: float = 0.0  # radius of the cutting tool, for drawings; 0: unknown, or no cut
    chamfer_mm: float | None = None  # G12 with P70: at the corner to the next path
    rounding_mm: float | None = None  # G12 with P71
    spline: bool = False  # G50, G51: its only element is a line, which becomes a cubic with the next path
    contour_feed: bool = False  # G51
    three_points: bool = False  # G123: its only element is a line, which becomes an arc with the next one
    pre: tuple[MFunction, ...] = ()
    post: tuple[MFunction, ...] = ()
    dwell_s: float | None = None  # G04: after the path, before the post functions
    speeds: Mapping[int, float] = field(default_factory=dict)  # S words: spindle 1 to 8, in 1/min
    tool: int | None = None  # T word
    # parameters that are written when the block is executed: number, value
    parameters: tuple[tuple[int, float | None], ...] = ()
    text: Text | None = None
    stop: Stop = Stop.NONE
    watched: bool = False  # M26: a signal deletes its path and its dwell
    main: bool = True  # a block of a program; False: an intermediate one, of a cycle
    target: Point = (0.0, 0.0, 0.0)  # where it ends, in the program's coordinates, mm
    in_force: InForce = AT_REST  # other modal state

    def like(self, **changes: object) -> PathBlock:
        """As `dataclasses.replace`, twenty times as fast."""
        made, fields = object.__new__(PathBlock), self.__dict__.copy()
        fields.update(changes)
        object.__setattr__(made, "__dict__", fields)
        return made

    @property
    def finish(self) -> Point:
        return self.elements[-1].end if self.elements else self.start

    @property
    def turns_corner(self) -> bool:
        """True if it changes the corner to the next path, or its path with that."""
        return self.chamfer_mm is not None or self.rounding_mm is not None or self.three_points

    @property
    def asks_filters(self) -> bool:
        """True if a stage between interpreter and path may change it, whatever came before it."""
        return self.turns_corner or self.spline or bool(self.correction.side)

    @property
    def in_space(self) -> bool:
        """True for splines, polynomials and circles in space, which no correction in a plane can follow."""
        return self.spline or any(isinstance(element, Cubic | Round) for element in self.elements)

    @property
    def drawn(self) -> tuple[Element, ...]:
        """Its lines and arcs; without curves in space."""
        return tuple(element for element in self.elements if isinstance(element, Straight | Arc))

    @property
    def length_mm(self) -> float:
        return sum(element.length_mm for element in self.elements)

    @property
    def speaks(self) -> bool:
        """True if it has an effect when it begins."""
        said = self.text is not None or self.tool is not None
        return bool(self.pre or self.parameters or self.speeds or self.watched or said)

    @property
    def in_real_time(self) -> bool:
        """True unless it has only assignments and jumps."""
        return bool(self.elements or self.post or self.dwell_s is not None or self.stop is not Stop.NONE or self.speaks)

    @property
    def stands(self) -> bool:
        """True if the axes stop at its end to wait: for their following error, a time, M00, M01."""
        return self.end is BlockEnd.EXACT_STOP or self.dwell_s is not None or self.stop is not Stop.NONE

    @property
    def motion(self) -> float | None:
        """0 to 3, for G00 to G03; None without a path, and on curves in space, which their G function tells."""
        element = self.elements[0] if self.elements else None
        if element is None or isinstance(element, Cubic | Round):
            return None
        return 0.0 if self.rapid else (2.0 if element.sweep_rad < 0.0 else 3.0) if isinstance(element, Arc) else 1.0
