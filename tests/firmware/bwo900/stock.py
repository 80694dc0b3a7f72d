"""A workpiece that a tool cuts, for tests: what each column of it is still high, reckoned from the path alone.

    height
      0 |''''|      |''''|     a flat tool of radius r with its end at z takes every column within r of its way to z
        |    |______|    |     rapid through a column that is higher than z is a crash
        +--- columns ----+

The path is told in machine coordinates and turned back into the program's by the manual's own formula (4.16, 4.21):
X = U cos E - V sin E + U0, a mirror about that origin, and the zero point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Plane

Places = NDArray[np.float64]
PLANES = {
    "G17": (Plane(0, 1, 2), ("X", "Y", "Z")),
    "G18": (Plane(2, 0, 1), ("Z", "X", "Y")),
    "G19": (Plane(1, 2, 0), ("Y", "Z", "X")),
}
"""Axes of each plane, and their letters: first, second, across."""
SHARP = 1e-6


@dataclass(frozen=True)
class Setting:
    """Where a program lies on the machine: plane, zero point, rotation, mirrors, by the axes of the plane."""

    plane: str = "G17"
    zero: tuple[float, float, float] = (0.0, 0.0, 0.0)
    origin: tuple[float, float] = (0.0, 0.0)
    angle_deg: float = 0.0
    mirrors: tuple[bool, bool] = (False, False)

    @property
    def words(self) -> str:
        """Path conditions that make it so."""
        mirrors = [g for g, on in zip(("G61", "G62"), self.mirrors, strict=True) if on]
        turned = f"P160:{self.origin[0]} P161:{self.origin[1]} P163:{self.angle_deg} G45"
        return " ".join([self.plane, "G54", *mirrors, turned])

    @property
    def parameters(self) -> dict[str, float]:
        """The zero point G54, axis by axis."""
        plane = PLANES[self.plane][0]
        axes = zip((plane.first, plane.second, plane.third), self.zero, strict=True)
        return {f"p{20_003 + axis}": value for axis, value in axes}

    def at(self, u: float, v: float, height: float) -> str:
        """Words of a place."""
        first, second, across = PLANES[self.plane][1]
        return f"{first}{u:.4f} {second}{v:.4f} {across}{height:.4f}"

    def back(self, u: float, v: float) -> tuple[float, float]:
        """Place of the plane: machine to program."""
        u, v = u - self.zero[0] - self.origin[0], v - self.zero[1] - self.origin[1]
        u, v = -u if self.mirrors[0] else u, -v if self.mirrors[1] else v
        angle = math.radians(-self.angle_deg)
        return u * math.cos(angle) - v * math.sin(angle), u * math.sin(angle) + v * math.cos(angle)

    def distances(self, places: Places, element: Element) -> Places:
        """Of places (n, 2) in program coordinates to an element, exact."""
        plane = PLANES[self.plane][0]
        begin = np.array(self.back(*plane.of(element.start)))
        end = np.array(self.back(*plane.of(element.end)))
        if isinstance(element, Arc):
            centre = np.array(self.back(*element.centre))
            sweep = element.sweep_rad * (-1.0 if self.mirrors[0] != self.mirrors[1] else 1.0)
            away = places - centre
            first = math.atan2(*(begin - centre)[::-1])
            passed = ((np.arctan2(away[:, 1], away[:, 0]) - first) * np.sign(sweep)) % (2.0 * math.pi)
            ends = np.minimum(np.hypot(*(places - begin).T), np.hypot(*(places - end).T))
            beside = np.abs(np.hypot(*away.T) - math.dist(begin, centre))
            return np.where(passed <= abs(sweep), beside, ends)
        way = end - begin
        size = float(way @ way)
        share = np.clip((places - begin) @ way / size, 0.0, 1.0) if size > 1e-18 else np.zeros(len(places))
        return np.hypot(*(places - begin - share[:, None] * way).T)

    def heights(self, element: Element) -> tuple[float, float]:
        """Of its two ends, program coordinates."""
        across = PLANES[self.plane][0].third
        return element.start[across] - self.zero[2], element.end[across] - self.zero[2]


@dataclass
class Stock:
    """Columns at places (n, 2) in program coordinates, and what is against the rules about the way they were cut."""

    setting: Setting
    places: Places
    radius: float
    outside: Callable[[Places, PathBlock], Places]
    """Signed distance of places to what a block may cut: positive must stay."""
    deepest: Callable[[PathBlock], float]
    """What a block may take off in depth."""
    height: Places = field(init=False)
    wrong: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.height = np.zeros(len(self.places))

    def cut(self, blocks: list[PathBlock]) -> None:
        """Go along a path."""
        for block in blocks:
            for element in block.elements:
                self._cut(block, element)

    def _cut(self, block: PathBlock, element: Element) -> None:
        low, high = sorted(self.setting.heights(element))
        if low >= 0.0:
            return
        away = self.setting.distances(self.places, element)
        if block.rapid:
            if (self.height[away < self.radius - SHARP] > low + SHARP).any():
                self.wrong.append(f"rapid through the workpiece to {element.end}")
            return
        if high - low > SHARP and math.dist(element.start, element.end) > high - low + SHARP:
            self.wrong.append(f"neither across nor down to {element.end}")
        within = away < self.radius - SHARP
        fresh = within & (self.height > low + SHARP)
        if not fresh.any():
            return
        if (self.outside(self.places[fresh], block) > 1e-4).any():
            self.wrong.append(f"cuts the wall on the way to {element.end}")
        if (self.height[fresh] - low).max() > self.deepest(block) + SHARP:
            self.wrong.append(f"{(self.height[fresh] - low).max():.3f} mm deep on the way to {element.end}")
        self.height[fresh] = low
