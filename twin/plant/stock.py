"""Stock as heights over a grid: what a tool has left of it, and how deep a point is in that.

    model --- stocks ---> Stock: a height above the table for each cell of X and Y, cast down on the fixture's shapes
    cut(points)   lowers the cells under the tool           depth_mm(points)   of a tool's tip, below what is left

Coordinates are those of fixtures: X and Y of the machine, and the height above the table. A tool comes from above, so
what is below the surface is in the stock.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.machine import Machine
from isel_twin.plant import PLACES
from isel_twin.plant.clamped import PREFIX, TIP, of_fixture, ways_of
from isel_twin.plant.model import load_model

Floats: TypeAlias = NDArray[np.float64]

CELLS: Final = 200  # along the longer side
DISCS: Final = 3.0  # in the radius of a tool: what stands between them is a hundredth of it
LEAST_CELL_MM: Final = 0.25
_ABOVE_MM: Final = 1.0  # the rays begin


class Stock:
    """One fixture that is stock."""

    def __init__(self, name: str, corner_mm: Floats, cell_mm: float, top_mm: Floats) -> None:
        """corner_mm [2]: of the first cell; top_mm [cells along X, along Y]: -inf where nothing is."""
        self.name, self.whole_mm = name, top_mm
        self._corner_mm, self.cell_mm, self._highest_mm = corner_mm, cell_mm, float(top_mm.max())
        self.restore()

    def restore(self) -> None:
        """Nothing has been cut."""
        self._left_mm = self.whole_mm.copy()

    def cut(self, points_mm: Floats, radius_mm: float) -> None:
        """A tool of that radius stands with its tip at each point [n, 3]."""
        reach = int(radius_mm / self.cell_mm)
        around = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)
        around = around[:, (around**2).sum(axis=0) * self.cell_mm**2 <= radius_mm**2]
        i, j = (self._cells(points_mm)[:, :, None] + around[:, None, :]).reshape(2, -1)
        there = (i >= 0) & (j >= 0) & (i < self.whole_mm.shape[0]) & (j < self.whole_mm.shape[1])
        heights = np.repeat(points_mm[:, 2], around.shape[1])
        np.minimum.at(self._left_mm, (i[there], j[there]), heights[there])

    def depth_mm(self, points_mm: Floats, *, whole: bool = False) -> Floats:
        """float64 [n], how far points [n, 3] are below what is left of it, or of the whole; -inf beside it."""
        i, j = self._cells(points_mm)
        there = (i >= 0) & (j >= 0) & (i < self.whole_mm.shape[0]) & (j < self.whole_mm.shape[1])
        depth = np.full(len(points_mm), -np.inf)
        depth[there] = (self.whole_mm if whole else self._left_mm)[i[there], j[there]] - points_mm[there, 2]
        return depth

    def samples(self, start_mm: Floats, end_mm: Floats, radius_mm: float = 0.0) -> Floats:
        """float64 [n, 3], points of the straight way of a tool of that radius; none if it passes by."""
        low, high = np.minimum(start_mm, end_mm), np.maximum(start_mm, end_mm)
        far = self._corner_mm + self.cell_mm * np.array(self.whole_mm.shape) + radius_mm
        if (high[:2] < self._corner_mm - radius_mm).any() or (low[:2] > far).any() or low[2] >= self._highest_mm:
            return np.zeros((0, 3))
        apart_mm = max(self.cell_mm, radius_mm / DISCS)
        number = 1 + int(np.linalg.norm(end_mm - start_mm) / apart_mm)
        way: Floats = start_mm + np.linspace(0.0, 1.0, number + 1)[:, None] * (end_mm - start_mm)
        return way

    def _cells(self, points_mm: Floats) -> NDArray[np.int64]:
        return np.floor((points_mm[:, :2] - self._corner_mm) / self.cell_mm).astype(np.int64).T


def stocks(machine: Machine) -> tuple[tuple[Stock, ...], float, float]:
    """The machine's stock; how high the tip is above the table with Z at 0, and the radius of its cutter, mm."""
    if not any(one.stock for one in machine.fixtures):
        return (), 0.0, 0.0
    model = load_model(machine, visual=False)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    ways, tool = ways_of(model, data), data.site(PLACES["tool"]).xpos
    high_mm = 1e3 * float(ways[2] @ (data.site(PLACES["table"]).xpos - tool))
    tips = [geom for geom in range(model.ngeom) if model.geom(geom).name == TIP]
    radius_mm = 1e3 * float(model.geom_size[tips[0], 0]) if tips else 0.0
    found = []
    for fixture in machine.fixtures:
        if fixture.stock:
            geoms = [k for k in range(model.ngeom) if of_fixture(model.geom(k).name) == PREFIX + fixture.name]
            found.append(_cast(fixture.name, model, data, geoms, high_mm))
    return tuple(found), high_mm, radius_mm


def _cast(name: str, model: mujoco.MjModel, data: mujoco.MjData, geoms: list[int], high_mm: float) -> Stock:
    """The heights of these shapes."""
    ways, tool = ways_of(model, data), data.site(PLACES["tool"]).xpos
    corners = np.concatenate([_corners(model, data, geom) for geom in geoms])
    along_mm = 1e3 * (corners - tool) @ ways.T  # X, Y, and down from the tip
    low_mm, high = along_mm.min(axis=0), along_mm.max(axis=0)
    cell_mm = max(LEAST_CELL_MM, float((high - low_mm)[:2].max()) / CELLS)
    shape = np.maximum(np.ceil((high - low_mm)[:2] / cell_mm - 1e-9).astype(int), 1)
    grid_mm = low_mm[:2] + (np.indices(shape).reshape(2, -1).T + 0.5) * cell_mm
    begins = tool + 1e-3 * (grid_mm @ ways[:2] + (low_mm[2] - _ABOVE_MM) * ways[2])
    near_mm = np.full(len(begins), np.inf)
    for geom in geoms:
        beside_m = np.linalg.norm((begins - data.geom_xpos[geom]) @ ways[:2].T, axis=1)
        for k in np.flatnonzero(beside_m <= model.geom_rbound[geom]).tolist():
            near_mm[k] = min(near_mm[k], _ray_mm(model, data, geom, begins[k], ways[2]))
    top_mm = (high_mm - low_mm[2] + _ABOVE_MM - near_mm).reshape(shape)
    return Stock(name, low_mm[:2], cell_mm, top_mm)


def _corners(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Floats:
    """float64 [8, 3] in the world, of the box around a shape."""
    middle, half = model.geom_aabb[geom].reshape(2, 3)
    signs = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    corners: Floats = data.geom_xpos[geom] + (middle + signs * half) @ data.geom_xmat[geom].reshape(3, 3).T
    return corners


def _ray_mm(model: mujoco.MjModel, data: mujoco.MjData, geom: int, begin: Floats, way: Floats) -> float:
    """Distance from a point to a shape, mm; inf: it does not meet it."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        far_m = mujoco.mj_rayMesh(model, data, geom, begin, way)
    else:
        pose = data.geom_xpos[geom], data.geom_xmat[geom]
        far_m = mujoco.mju_rayGeom(*pose, model.geom_size[geom], begin, way, model.geom_type[geom])
    return 1e3 * float(far_m) if far_m >= 0.0 else np.inf
