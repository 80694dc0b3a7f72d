"""MuJoCo's step written out for sliding joints between their stops, without contact.

It gives the numbers of `mj_step` at a thirtieth of its cost. If all joints slide, masses and directions do not depend
on positions. So without a stop or a collision the equations that MuJoCo solves in each step (its chapter "Computation")
are linear but for dry friction:

    a0  = M^-1 (F - g - k (q - q_s) - d v)           M: mass matrix, F: forces on the joints, g: weights
    f_i = clip(-(a0_i + b v_i) / (A_ii + R_i))       dry friction of a joint, at most its loss either way
    a   = a0 + M^-1 f                                A = M^-1, b and R: as MuJoCo softens the friction of that joint
    v'  = v + h a,   q' = q + h v'

which is exact as long as no two joints with friction are coupled by their masses (A_ij = 0), and so needs no solver.
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

from isel_twin.base.compiling import contains, njit
from isel_twin.native import record
from isel_twin.plant import native
from isel_twin.plant.model import blank
from isel_twin.plant.native import call_mj_step, mj_step_address
from isel_twin.plant.reach import can_meet, collide, joint_bounds

LEAST_SOFT = 1e-15  # of R, MuJoCo's mjMINVAL
AGREE_M_S = 1e-9  # largest difference to MuJoCo's speed after a step; its solver stops at a tenth of that

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


@njit(inner=True, nogil=True, error_model="numpy")
def glide(joints, mobility, h_s, qpos, qvel, qacc, qacc_smooth, qfrc):
    """One step of h_s with the forces qfrc on the joints: joints [nv] JOINT, mobility [nv, nv], q... as MuJoCo's.

    Returns False and changes nothing if a joint is out of its bounds.
    """
    n = qpos.shape[0]
    for j in range(n):
        if not joints[j].low_m < qpos[j] < joints[j].high_m:
            return False
    for j in range(n):
        joint = joints[j]
        joint.force_n = qfrc[j] + joint.rest_n - joint.spring_n_per_m * qpos[j] - joint.damper_n_s_per_m * qvel[j]
    for i in range(n):
        free_m_s2 = 0.0
        for j in range(n):
            free_m_s2 += mobility[i, j] * joints[j].force_n
        qacc_smooth[i] = free_m_s2
        qacc[i] = free_m_s2
    for i in range(n):
        joint = joints[i]
        if joint.friction_n > 0.0:
            friction_n = -joint.stuck_kg * (qacc_smooth[i] + joint.creep_per_s * qvel[i])
            friction_n = min(joint.friction_n, max(-joint.friction_n, friction_n))
            for j in range(n):
                qacc[j] += mobility[j, i] * friction_n
    for j in range(n):
        qvel[j] += h_s * qacc[j]
        qpos[j] += h_s * qvel[j]
    return True


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
    _write_out(
        joints, known.bounds_m, mobility, weight_n, model.jnt_stiffness, model.qpos_spring, model.dof_damping,
        model.dof_frictionloss, model.dof_invweight0, known.creep_per_s, known.impedance,
    )  # fmt: skip
    state = data.qpos, data.qvel, data.qfrc_applied, np.zeros((4, model.nv))
    step = mj_step_address(), model._address, data._address
    if not _agrees(joints, mobility, model.opt.timestep, *step, known.bounds_m, *state):
        joints["low_m"] = joints["high_m"] = np.nan


@njit(nogil=True, error_model="numpy")
def _write_out(joints, bounds, mobility, weight_n, stiffness, place, damping, loss, inverse_kg, creep, impedance):
    """Fill in joints. bounds [2, n], mobility [n, n], others [n]; place: where the spring is without force."""
    for j in range(joints.shape[0]):
        joint = joints[j]
        joint.low_m, joint.high_m = bounds[0, j], bounds[1, j]
        joint.rest_n = stiffness[j] * place[j] - weight_n[j]
        joint.spring_n_per_m = stiffness[j]
        joint.damper_n_s_per_m = damping[j]
        joint.friction_n = loss[j]
        joint.creep_per_s = creep[j]
        soft_per_kg = max(LEAST_SOFT, (1.0 - impedance[j]) * inverse_kg[j] / impedance[j])  # R
        joint.stuck_kg = 1.0 / (mobility[j, j] + soft_per_kg)


@njit(nogil=True, error_model="numpy")
def _agrees(joints, mobility, h_s, mj_step, model, data, bounds, qpos, qvel, qfrc, scratch):
    """True if steps equal MuJoCo's: at rest, creeping, moving, each unpushed and pushed, at one end of the bounds, the
    other or between. scratch [4, nv]."""
    n = qpos.shape[0]
    for case in range(12):
        share = 0.01 if case % 3 == 0 else 0.5 if case % 3 == 1 else 0.99
        speed_m_s = 0.0 if case < 3 else 1e-6 if case < 6 else -0.1 if case < 9 else 0.3
        turned = (case + case // 3) % 3  # each push at each place, and with each speed
        push_n = 0.0 if turned == 0 else 10.0 if turned == 1 else -200.0
        for j in range(n):
            qpos[j] = (1.0 - share) * bounds[0, j] + share * bounds[1, j]
            qvel[j] = speed_m_s if j % 2 else -speed_m_s
            qfrc[j] = push_n
            scratch[0, j] = qpos[j]
            scratch[1, j] = qvel[j]
        glide(joints, mobility, h_s, scratch[0], scratch[1], scratch[2], scratch[3], qfrc)
        call_mj_step(mj_step, model, data)
        for j in range(n):
            if not abs(scratch[1, j] - qvel[j]) < AGREE_M_S:
                return False
    return True


contains(__name__, str(native.__file__))
