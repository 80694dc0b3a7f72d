"""Samples that the compiled loop takes: their grid, and their arrays when they are read."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.plant import Samples, memory
from isel_twin.plant.guides import along_guides_mm
from isel_twin.plant.prepared import Built

GRID = ("sample_every", "sample_ahead_ns")  # fields of memory.PLANT that say when samples are taken
_SAMPLED = (memory.PLANT.names or ()).index("sampled")


class LoopSamples:
    """Implements `isel_twin.plant.Sampled` for a plant with the loop; axes: number of the controller's."""

    def __init__(self, built: Built, axes: int) -> None:
        self.built = built
        self._plant = built.parts.plant
        self._words = self._plant.view(np.int64)  # the same record as integers: faster to read one
        self._count = axes
        self._substep_ns = built.machine.timing.substep_ns

    def fits(self, interval_ns: int) -> bool:
        return interval_ns > 0 and interval_ns % self._substep_ns == 0

    def sample_every(self, interval_ns: int, from_ns: int = 0) -> None:
        if interval_ns == 0:
            self._plant["sample_every"] = self._plant["sample_ahead_ns"] = self._plant["sampled"] = 0
            self._plant["sample_at"] = memory.NEVER
            return
        if not self.fits(interval_ns):
            raise ValueError(f"samples every {interval_ns} ns; allowed: multiples of {self._substep_ns} ns")
        self._plant["sample_every"] = interval_ns // self._substep_ns
        self._plant["sample_ahead_ns"] = from_ns % self._substep_ns
        self._plant["held"] = 0
        self._aim(from_ns // self._substep_ns)

    def sample_again(self) -> None:
        self._plant["held"] = 0

    @property
    def samples_waiting(self) -> int:
        return self._words.item(_SAMPLED)

    def take_samples(self) -> Samples:
        parts, shape_mm, count = self.built.parts, self.built.shape_mm, self._count
        rows = parts.samples[: self.samples_waiting].copy()
        self._plant["sampled"] = 0
        joints, commands = len(parts.qpos), len(parts.commanded)
        widths = (1, joints, joints, commands, commands, *[memory.AXES] * 3, 1, 2)
        ends = itertools.accumulate(widths)
        columns = (rows[:, end - width : end] for width, end in zip(widths, ends, strict=True))
        now, place, rates, commanded, rotor, current, margin, force_n, supply_v, bend_m = columns
        margins = np.full((len(rows), commands), np.nan)
        margins[:, : memory.AXES] = margin
        return Samples(
            time_ns=now[:, 0].astype(np.int64) * self._substep_ns + self._plant["sample_ahead_ns"],
            position_mm=self._bent_mm(along_guides_mm(self.built.machine, _each(shape_mm, place)), bend_m),
            velocity_mm_s=_each(shape_mm, rates),
            commanded=commanded[:, :count].astype(np.int64),
            rotor=rotor[:, :count],
            current_fraction=current,
            margin=margins[:, :count],
            force_n=force_n,
            supply_v=supply_v[:, 0],
        )

    def _bent_mm(self, position_mm: NDArray[np.float64], bend_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions [..., 3] of a tool that is bent by [..., 2] along X and Y, in place."""
        if bend_m.any():
            position_mm[..., :2] += 1e3 * bend_m
        return position_mm

    def keep_grid(self, grid: Mapping[str, NDArray[Any]], sample_at: int) -> None:
        """After the loop's state was restored: drop unread samples and go on with this grid.

        sample_at: a sub-step of the grid.
        """
        same = all(grid[name][0] == self._plant[name][0] for name in GRID)
        self._plant["sampled"] = 0
        if not same:
            for name, value in grid.items():
                self._plant[name] = value
            self._plant["held"] = 0
            self._aim(sample_at)

    def _aim(self, phase: int) -> None:
        """Set the next sample to the first of the grid after now; phase: a sub-step of the grid."""
        now, every = int(self._plant["now"][0]), int(self._plant["sample_every"][0])
        self._plant["sample_at"] = now + 1 + (phase - now - 1) % every if every else memory.NEVER


def _each(matrix: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """The product with each of n vectors [n, k], the same to the bit as one by one."""
    products: NDArray[np.float64] = np.matmul(matrix, rows[:, :, None])[..., 0]
    return products
