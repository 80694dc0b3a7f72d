"""Changes that events make in the MuJoCo model of a built machine: friction, obstacles, payload."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.native import core
from isel_twin.plant import PLACES
from isel_twin.plant.glide import gliding
from isel_twin.plant.prepared import Built
from isel_twin.plant.weighing import weigh

Arrays = dict[str, NDArray[Any]]  # numbers of a model by name


class Alterations:
    def __init__(self, built: Built) -> None:
        model = built.model
        self._built = built
        self._friction_n = built.parts.axes["friction_n"].copy()
        self._loss_n = model.dof_frictionloss.copy()
        self._stops_m = model.jnt_range.copy()
        self._mass_kg = model.body_mass.copy()
        self._as_built: Arrays | None = None  # the model before its first change; None: unchanged

    def set_friction(self, axis: int, extra_n: float) -> None:
        built = self._begin()
        dof = built.dof[axis]
        built.parts.axes["friction_n"][axis] = self._friction_n[axis] + extra_n
        built.model.dof_frictionloss[dof] = self._loss_n[dof] + extra_n
        self._end()

    def set_obstacle(self, axis: int, position_mm: float | None) -> None:
        """Set another stop of the joint, unless its own comes before."""
        built = self._begin()
        joint = built.model.dof_jntid[built.dof[axis]]
        low_m, high_m = self._stops_m[joint]
        if position_mm is not None and built.parts.axes["x_m"][axis] < 1e-3 * position_mm:
            high_m = min(high_m, 1e-3 * position_mm)
        elif position_mm is not None:
            low_m = max(low_m, 1e-3 * position_mm)
        built.model.jnt_range[joint] = low_m, high_m
        self._end()

    def set_payload(self, place: str, mass_kg: float) -> None:
        """The caller must split the pushes again afterwards."""
        built = self._begin()
        body = built.model.site(PLACES[place]).bodyid[0]
        built.model.body_mass[body] = self._mass_kg[body] + mass_kg
        self._end()
        scratch = mujoco.MjData(built.model)
        scratch.qpos[:] = built.data.qpos
        mujoco.mj_forward(built.model, scratch)
        weigh(built, scratch)

    def save(self) -> Arrays | None:
        """The model as it is now; None: as built."""
        return None if self._as_built is None else _numbers(self._built.model)

    def restore(self, saved: Mapping[str, NDArray[Any]] | None) -> None:
        if saved is not None:
            self._keep()
        for name, numbers in (saved or self._as_built or {}).items():
            getattr(self._built.model, name)[...] = numbers

    def model_as_built(self) -> mujoco.MjModel:
        """A copy of the model as it was before anything was changed in it."""
        model = copy.copy(self._built.model)
        for name, numbers in (self._as_built or {}).items():
            getattr(model, name)[...] = numbers
        return model

    def _begin(self) -> Built:
        self._keep()
        core.wake(self._built.memory)
        return self._built

    def _end(self) -> None:
        """Fill in what follows from the model; effective from MuJoCo's next step on."""
        model, parts = self._built.model, self._built.parts
        mujoco.mj_setConst(model, mujoco.MjData(model))
        parts.joints_law[:], parts.mobility[:] = gliding(model)

    def _keep(self) -> None:
        if self._as_built is None:
            self._as_built = _numbers(self._built.model)


def _numbers(model: mujoco.MjModel) -> Arrays:
    """Every number of a model that mj_setConst may change, by name."""
    names = (name for name in dir(model) if not name.startswith("_"))
    arrays = {name: array for name in names if isinstance(array := getattr(model, name), np.ndarray)}
    return {name: array.copy() for name, array in arrays.items() if array.dtype == np.float64 and array.size}
