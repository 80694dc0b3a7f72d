"""What follows from the masses and springs of a built machine: masses at the nuts, how springs of the structure push
the carriages, what a force on the tool does; and whether MuJoCo's step suits them."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.machine import Axis, MachineError
from isel_twin.native import core
from isel_twin.plant.prepared import Built

# Largest MuJoCo step times the highest frequency (rad/s) of the machine on all its springs, nuts and structure. Above 2
# the exchange of forces feeds oscillations; stick-slip can feed them below that (decision plant/3).
LARGEST_STEP_RATIO = 1.9
LEAST_PULL_N = 0.5e-6  # at a carriage; less is rounding


def weigh(built: Built, data: mujoco.MjData) -> None:
    """Fill in what follows from the masses. data: MuJoCo's, after `mj_forward` at the present place."""
    model = built.model
    mujoco.mj_fullM(model, data, built.inertia)
    built.weight[:] = data.qfrc_bias
    built.mobility[:] = np.linalg.inv(built.inertia)
    core.spring(built.memory, built.mobility, model.jnt_stiffness, model.dof_damping)
    if built.parts.feeler["on"][0] or built.parts.cut["on"][0]:
        share_tip(built)


def share_tip(built: Built) -> None:
    """Fill in what a force between tool and table does; only who feels or cuts asks for it."""
    parts, found = built.parts, built.frame.reach
    pulls = [built.split(way) for way in found["tool"] + found["table"]]
    joints, nuts = (np.array(part) for part in zip(*pulls, strict=True))
    parts.tip_joints[:], parts.tip_nuts[:] = joints, nuts


def check_steps(built: Built) -> None:
    """Refuse a MuJoCo step that is too long for the springs of the machine."""
    machine, model = built.machine, built.model
    stiffness = model.jnt_stiffness[model.dof_jntid]
    stiffness[built.dof] = [stiffest_n_per_m(axis) for axis in machine.axes]
    step_s = machine.timing.mujoco_step_ns * 1e-9
    if core.holds(built.inertia, stiffness, (LARGEST_STEP_RATIO / step_s) ** 2, np.empty_like(built.inertia)):
        return
    highest_rad_s, strain = _highest(built.inertia, stiffness)
    if step_s * highest_rad_s <= LARGEST_STEP_RATIO:
        return
    dof = int(np.argmax(strain))
    keys = {name: f"axes.{name}.stiffness" for name in CARRIAGES}
    name = model.joint(int(model.dof_jntid[dof])).name
    key = keys.get(name, f"structure.{name}.stiffness")
    least, most = 0.0, float(stiffness[dof])
    while most - least > 1e-3 * most:  # find the stiffness that would do, the others unchanged
        stiffness[dof] = 0.5 * (least + most)
        holds = step_s * _highest(built.inertia, stiffness)[0] <= LARGEST_STEP_RATIO
        least, most = (float(stiffness[dof]), most) if holds else (least, float(stiffness[dof]))
        if most < 1e3:
            break
    softer = f", or {key} up to {math.floor(least / 1e4) / 100:g} N/um" if least > 1e4 else ""
    raise MachineError(
        f"{machine.file}: timing.mujoco_step: {step_s * 1e3:g} ms is too long for {key} and "
        f"{1.0 / built.mobility[dof, dof]:.3g} kg; "
        f"allowed: up to {math.floor(1e5 * LARGEST_STEP_RATIO / highest_rad_s) / 100:g} ms{softer}"
    )


def _highest(inertia: NDArray[np.float64], stiffness: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Highest frequency in rad/s of masses [nv, nv] on springs [nv], and the energy in each spring as it swings so."""
    half = np.linalg.inv(np.linalg.cholesky(inertia))
    squares, shapes = np.linalg.eigh(half @ np.diag(stiffness) @ half.T)
    return math.sqrt(max(squares[-1], 0.0)), stiffness * (half.T @ shapes[:, -1]) ** 2


def stiffest_n_per_m(axis: Axis) -> float:
    """Stiffness of the screw where its nut is nearest to the fixed bearing."""
    return axis.screw.stiffness_at(-1e-3 * axis.stop_margin_mm)
