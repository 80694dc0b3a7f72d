"""The machine as writers of toolpaths are told of it, and what they give: lines of a job with their places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from isel_twin.cam.toolpath import Caution, Place

Counts: TypeAlias = tuple[int, int, int]  # X Y Z in steps or increments, in the sense of the counters

AXES = "XYZ"


@dataclass(frozen=True)
class MachineAxes:
    """The axes of a machine, as the controller counts them. Raises ValueError for values that are not possible."""

    steps_mm: tuple[float, float, float]  # counts per mm
    # least and greatest reading of the counter, mm; (0, 0) for an axis that there is not
    travel_mm: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    top_mm_s: tuple[float, float, float] | None = None  # None: what the controller makes, the axis follows
    speed_along_path: bool = False  # the controller is set so that speeds of straight moves are those of the path
    lag_s: float = 0.0  # by which drives follow, the slowest of them; stepper motors do not
    # following error by which the speed loop of a drive, without its integral, turns an axis round against friction ...
    held_mm: float = 0.0
    reset_s: float = 1.0  # ... and the time in which the integral of an error does as much as the error itself
    spindle_max_rpm: float = 0.0  # at 10 V of the analog output; 0: not known, or it does not follow it
    spindle_fixed_rpm: float = 0.0  # by hand; 0: not known, or it follows the output

    def __post_init__(self) -> None:
        if not all(steps > 0 for steps in self.steps_mm):
            raise ValueError(f"steps_mm is {self.steps_mm}; each must be more than 0")
        if not all(low <= high for low, high in self.travel_mm):
            raise ValueError(f"travel_mm is {self.travel_mm}; each is the least and the greatest reading")
        if self.top_mm_s is not None and not all(top > 0 for top in self.top_mm_s):
            raise ValueError(f"top_mm_s is {self.top_mm_s}; each must be more than 0")
        if self.lag_s < 0 or self.held_mm < 0:
            raise ValueError(f"lag_s is {self.lag_s}, held_mm {self.held_mm}; both must be 0 or more")
        if not self.reset_s > 0:
            raise ValueError(f"reset_s is {self.reset_s}; it must be more than 0")

    @property
    def count(self) -> int:
        """1: X; 2: X and Y; 3: all."""
        return max((index for index, (low, high) in enumerate(self.travel_mm, 1) if low < high), default=1)

    @property
    def range_counts(self) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
        """Least and greatest count of each axis."""
        pairs = zip(self.travel_mm, self.steps_mm, strict=True)
        x, y, z = ((round(low * steps), round(high * steps)) for (low, high), steps in pairs)
        return x, y, z


class Written(NamedTuple):
    """A line of a job file, or of a controller's program, without its end."""

    text: str
    place: Place | None = None  # in the user's file; None: no line of it asked for this
    caution: Caution | None = None  # of a remark that the user has to see
