"""Machines for which MuJoCo's step is written out (glide.h), and its constants: sliding joints between their stops,
without contact. That gives the numbers of `mj_step` at a thirtieth of its cost.

All constants are MuJoCo's own. When the plant is built, a few states are compared with MuJoCo's steps: if they differ,
or if bodies could collide within the bounds of the joints, MuJoCo makes every step (plant/4).

    stop |<---------------- bounds ---------------->| stop             outside: mj_step, with stops and collisions
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.native import core, record
from isel_twin.plant.model import blank
from isel_twin.plant.native import mj_step_address
from isel_twin.plant.reach import can_meet, collide, joint_bounds

JOINT = record(
    "JOINT",
    [
        ("low_m", "f8"),  # bounds, left out; nan: never within
        ("high_m", "f8"),
        ("rest_n", "f8"),  # force at position 0 and rest: weight and preloaded spring
        ("spring_n_per_m", "f8"),
        ("damper_n_s_per_m", "f8"),
        ("friction_n", "f8"),  # loss, 0: none
        ("creep_per_s", "f8"),  # b
        ("stuck_kg", "f8"),  # 1 / (A + R)
        ("force_n", "f8"),  # scratch
    ],
)


class Slides(NamedTuple):
    """What of a model does not depend on masses, springs and friction."""

    alone: bool  # slides alone, between whose stops nothing but dry friction acts on them
    bounds_m: NDArray[np.float64]  # [2, nv], of the joints
    creep_per_s: NDArray[np.float64]  # [nv], b
    impedance: NDArray[np.float64]  # [nv], d of MuJoCo's dry friction: R = (1 - d) / d times the joint's inverse mass


def slides(model: mujoco.MjModel, data: mujoco.MjData | None = None) -> Slides:
    """data: of the model, for scratch."""
    bounds = joint_bounds(model)
    special = model.neq or model.ntendon or model.nflex or model.nplugin or model.npair
    if special or (model.jnt_type != mujoco.mjtJoint.mjJNT_SLIDE).any():
        return Slides(False, bounds, np.zeros(model.nv), np.ones(model.nv))
    model = copy.copy(model)
    model.dof_frictionloss[:] = 1.0  # so that MuJoCo tells of each joint
    data = blank(model, data)
    data.qpos[:] = bounds.mean(axis=0)
    mujoco.mj_forward(model, data)
    other = (data.efc_type != mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF).any()
    alone = not other and not any(
        collide(model, a, b) and can_meet(model, data, bounds, a, b) for a in range(model.ngeom) for b in range(a)
    )
    creep_per_s, impedance = data.efc_KBIP[data.efc_type == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF, 1:3].T.copy()
    return Slides(alone, bounds, creep_per_s, impedance)


def gliding(model: mujoco.MjModel) -> tuple[NDArray[np.void], NDArray[np.float64]]:
    """JOINT [nv] and mobility M^-1 [nv, nv] of a model; bounds are nan if MuJoCo must make every step."""
    data, inertia = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, inertia)
    mobility = np.linalg.inv(inertia)
    joints = np.zeros(model.nv, JOINT)
    written_out(slides(model), model, mujoco.MjData(model), mobility, data.qfrc_bias, joints)
    return joints, mobility


def written_out(
    known: Slides,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    mobility: NDArray[np.float64],
    weight_n: NDArray[np.float64],
    joints: NDArray[np.void],
) -> None:
    """Fill in joints, JOINT [nv] of a model that is as `known` says, its bounds nan if MuJoCo must make every step.
    mobility, weight_n: M^-1 [nv, nv] and the forces [nv] at rest, anywhere. data: of it, reset or for this alone."""
    if not known.alone:
        joints["low_m"] = joints["high_m"] = np.nan
        return
    data.qacc_warmstart[:] = 0.0  # all else that a step looks at is set for each
    core.write_out(
        joints, known.bounds_m, mobility, weight_n, model.jnt_stiffness, model.qpos_spring, model.dof_damping,
        model.dof_frictionloss, model.dof_invweight0, known.creep_per_s, known.impedance,
    )  # fmt: skip
    state = data.qpos, data.qvel, data.qfrc_applied, np.zeros((4, model.nv))
    step = mj_step_address(), model._address, data._address
    if not core.agrees(joints, mobility, model.opt.timestep, *step, known.bounds_m, *state):
        joints["low_m"] = joints["high_m"] = np.nan
