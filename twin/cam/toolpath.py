"""A toolpath: what a job file asks of the tool, in the words of no format and of no controller.

A toolpath is an iterator of elements, made while a file is read, so that a file of a million lines needs little memory:

    Rapid Line Arc       motion of the tool's tip to a point
    Reference            axes run to their reference switches
    Dwell                the tool stands
    PathMode             how the motions after it are joined
    Tool Spindle Coolant Output Stop     what the machine does between motions, in the order of the file
    Remark               words for people
    Caution              what the reader took in one of several ways, or left out: shown to the user once
    End                  of the program; always the last one

Points are X Y Z of the machine in mm, Z upwards: 0 is where the counters are 0. Work offsets and lengths of tools are
already in them; the writer only knows which way an axis counts. The tool stands at `CamSettings.start` before the first
element.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

Point: TypeAlias = tuple[float, float, float]  # X Y Z, mm


class Place(NamedTuple):
    """Place of something in a file. line, column: from 1. word: as it is written."""

    line: int
    column: int = 1
    word: str = ""


class CamError(ValueError):
    """A job file cannot be read, or cannot be made by this machine; the message is one line with place and remedy."""

    def __init__(self, message: str, place: Place | None = None) -> None:
        where = "" if place is None else f"line {place.line}, column {place.column}: "
        super().__init__(f"{where}{message}")
        self.place = place


class Rapid(NamedTuple):
    """Straight motion in the air. speed_mm_s: 0 for the machine's own rapid (`CamSettings.rapid_mm_s`)."""

    place: Place
    to: Point
    speed_mm_s: float = 0.0


class Line(NamedTuple):
    """Straight motion at a feed along the path."""

    place: Place
    to: Point
    feed_mm_s: float


class Arc(NamedTuple):
    """Arc or helix at a feed along the path.

    plane: index of the axis it turns about: 2 for XY, 1 for ZX, 0 for YZ. centre: its component along that axis has no
    meaning. turns: of RS274's ARC_FEED: 1 up to a full turn, 2 up to two; positive counter-clockwise, seen from the
    positive end of that axis. An end on the start is a full circle. Where start and end have different radii, the
    radius changes in proportion to the angle; so does the coordinate along the axis.
    """

    place: Place
    to: Point
    centre: Point
    plane: int
    turns: int
    feed_mm_s: float


class Reference(NamedTuple):
    """A reference run of these axes (0, 1, 2: X, Y, Z), behind which they stand at 0."""

    place: Place
    axes: tuple[int, ...]

    def ends(self, at: Point) -> Point:
        """Place of the tool behind it."""
        x, y, z = (0.0 if axis in self.axes else old for axis, old in enumerate(at))
        return x, y, z


class PathMode(NamedTuple):
    """exact: each motion from here on ends at rest; else they are joined, and the tool leaves its path by at most
    tolerance_mm (None: by what is set)."""

    place: Place
    exact: bool
    tolerance_mm: float | None = None


class Dwell(NamedTuple):
    place: Place
    seconds: float


class Tool(NamedTuple):
    """Change to a tool. The operator or a changer does it; the job goes on after it."""

    place: Place
    number: int
    name: str = ""


class Spindle(NamedTuple):
    """turns: 1 clockwise, -1 counter-clockwise, 0 off. speed_rpm: None for the one before."""

    place: Place
    turns: int
    speed_rpm: float | None = None
    wait_s: float = 0.0  # until it has its speed


class Coolant(NamedTuple):
    """number: 1 flood, 2 mist (second coolant)."""

    place: Place
    number: int
    on: bool


class Output(NamedTuple):
    """Outputs by the file's name for them: a port ("A4", with the bits to write and their values) or a consumer such as
    "PUMP" (mask 1)."""

    place: Place
    name: str
    mask: int
    value: int


class Stop(NamedTuple):
    """Wait for the operator. optional: M1."""

    place: Place
    optional: bool = False


class Remark(NamedTuple):
    place: Place
    text: str


class Caution(NamedTuple):
    """One line for the user. Readers say each kind once a file, at its first place."""

    place: Place
    text: str

    def __str__(self) -> str:
        return f"line {self.place.line}: {self.text}"


class End(NamedTuple):
    """Spindle and coolant go off; there is no motion of its own."""

    place: Place


Element: TypeAlias = (
    Rapid
    | Line
    | Arc
    | Reference
    | PathMode
    | Dwell
    | Tool
    | Spindle
    | Coolant
    | Output
    | Stop
    | Remark
    | Caution
    | End
)
Toolpath: TypeAlias = Iterator[Element]
