"""Two bodies that must not meet: how they met, or how near they came. The words for it are made here, once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import SECOND_NS


@dataclass(frozen=True)
class Collision:
    """The first contact of two bodies, until they part again."""

    first: str  # of the tool's side: cutter, spindle, x_carriage ...
    second: str  # what stands on the table, or the table
    position_mm: tuple[float, float, float]
    """Of the carriages: from a plant in machine coordinates, from a twin in zero and direction of the counters."""
    time_ns: int
    speed_mm_s: float  # of the tool over the table
    force_n: float | None  # with which they meet; None: not known without physics

    @property
    def who(self) -> str:
        return f"{self.first} hits {self.second}"

    def __str__(self) -> str:
        where = " ".join(f"{name.upper()} {mm:.3f}" for name, mm in zip(CARRIAGES, self.position_mm, strict=True))
        force = "force not known without physics" if self.force_n is None else f"{self.force_n:.0f} N"
        return f"{self.who} at {where} mm, {self.time_ns / SECOND_NS:.3f} s, {self.speed_mm_s:.0f} mm/s, {force}"

    @property
    def content(self) -> dict[str, Any]:
        """In JSON's types."""
        return {
            "first": self.first,
            "second": self.second,
            "position_mm": [round(mm, 6) for mm in self.position_mm],
            "time_ns": self.time_ns,
            "speed_mm_s": round(self.speed_mm_s, 3),
            "force_n": None if self.force_n is None else round(self.force_n, 1),
        }


@dataclass(frozen=True)
class Clearance:
    """The least distance of bodies that must not meet."""

    apart_mm: float  # 0: they met
    first: str
    second: str
    position_mm: tuple[float, float, float]
    """Of the carriages: from a plant in machine coordinates, from a twin in zero and direction of the counters."""
    time_ns: int

    def __str__(self) -> str:
        where = " ".join(f"{name.upper()} {mm:.3f}" for name, mm in zip(CARRIAGES, self.position_mm, strict=True))
        return f"{self.first} is {self.apart_mm:.3f} mm from {self.second} at {where} mm"
