"""A machine prepared for the compiled loop: its MuJoCo model, the arrays of memory.py, and what it takes to change them
later. built.py makes it, weighing.py fills in what follows from masses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.machine import Machine
from isel_twin.plant.glide import Slides
from isel_twin.plant.memory import Parts
from isel_twin.plant.model import Bare


@dataclass(frozen=True, eq=False)
class Frame:
    """What follows from the bodies of a model, whatever they weigh."""

    bare: Bare
    slides: Slides
    reach: Mapping[str, NDArray[np.float64]]  # by place (model.py)
    left: float  # `left_of_x` of model.py
    targets: NDArray[np.void]  # TARGET [t]


@dataclass(frozen=True, eq=False)
class Built:
    """A machine prepared for the loop. Arrays change in place; never replace one, as the loop has its address."""

    machine: Machine
    model: mujoco.MjModel
    data: mujoco.MjData
    scratch: mujoco.MjData  # for steps that nobody sees; `data` itself until there is another machine
    parts: Parts
    memory: NDArray[np.void]  # MEMORY [1] of the parts
    dof: NDArray[np.int64]  # [3], index of the joint of X, Y and Z in qpos and qvel
    shape_mm: NDArray[np.float64]  # [3, nv], mm of tool over table by a metre of each joint
    frame: Frame
    room: list[NDArray[np.uint8]]  # all parts but samples and MuJoCo's, each in memory of its own
    begun: list[NDArray[np.uint8]]  # what of the room is the same wherever the machine stands at power-on
    closed: NDArray[np.bool_]  # [3], which axes have servo drives
    coulomb_nm: NDArray[np.float64]  # [3], dry friction of each shaft with its brake released
    brake_nm: NDArray[np.float64]  # [3], what the brake adds when it holds (plant/9)
    inertia: NDArray[np.float64]  # [nv, nv], kg
    mobility: NDArray[np.float64]  # [nv, nv], its inverse
    weight: NDArray[np.float64]  # [nv], N

    def split(self, joints_n: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Split forces on the joints [nv]: forces on the nuts [3] with the same acceleration of the carriages (second),
        for the sub-steps, and the rest [nv] (first), for MuJoCo."""
        nuts_n = (self.mobility @ joints_n)[self.dof] / self.parts.axes["mobility_per_kg"]
        joints_n = joints_n.copy()
        joints_n[self.dof] -= nuts_n
        return joints_n, nuts_n
