"""Pushes from outside on a built machine, split between the compiled loop and MuJoCo."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.native import core
from isel_twin.plant import PLACES, memory
from isel_twin.plant.prepared import Built


class Pushes:
    """One push along each axis."""

    def __init__(self, built: Built) -> None:
        self._built = built
        self.joints_n: NDArray[np.float64] = np.zeros((memory.AXES, built.model.nv))
        """[3, nv], forces on the joints by the push along each axis."""

    def push(self, axis: int, force_n: float, place: str = "") -> None:
        """Raises ValueError for a force that is not a finite number, and for an unknown place."""
        if not math.isfinite(force_n):
            raise ValueError(f"force on axis {CARRIAGES[axis]}: {force_n!r} N is not a finite number")
        if place and place not in PLACES:
            raise ValueError(f"a force cannot act at {place!r}; there are: {', '.join(PLACES)}")
        core.wake(self._built.memory)
        reach = self._built.frame.reach
        if not place:
            place = "tool" if reach["tool"][axis, self._built.dof[axis]] else "table"
        self.joints_n[axis] = force_n * reach[place][axis]
        self.share()

    def share(self) -> None:
        """Split the pushes: in the sub-steps one acts on a carriage as a force at the nut; MuJoCo's next step gets the
        rest. Also after masses have changed."""
        joints_n, nuts_n = self._built.split(self.joints_n.sum(axis=0))
        parts = self._built.parts
        plant, push = parts.plant[0], parts.push
        parts.axes["push_n"] = nuts_n
        over = plant["now"] % plant["window"]
        push[1] += over * (push[0] - joints_n)
        push[0] = joints_n
