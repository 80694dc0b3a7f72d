"""Can two shapes meet? Boxes around them, moved to the ends of all joints: who never meets is not looked at."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

DEFLECTION_M = 2e-3  # bounds of a joint without stops: no frame gives as much in service
_SHAPELESS = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)


def joint_bounds(model: mujoco.MjModel) -> NDArray[np.float64]:
    """float64 [2, nv], the stops of the joints, or as far as they may be deflected."""
    limited = model.jnt_limited != 0
    bounds = np.array([model.qpos0 - DEFLECTION_M, model.qpos0 + DEFLECTION_M])
    bounds[0, limited] = (model.jnt_range[:, 0] + model.jnt_margin)[limited]
    bounds[1, limited] = (model.jnt_range[:, 1] - model.jnt_margin)[limited]
    return bounds


def collide(model: mujoco.MjModel, a: int, b: int) -> bool:
    """Whether MuJoCo looks for contacts of two geoms that move against each other."""
    felt = model.geom_contype[a] & model.geom_conaffinity[b] or model.geom_contype[b] & model.geom_conaffinity[a]
    bodies = model.geom_bodyid[[a, b]]
    return bool(felt) and bool(model.body_weldid[bodies[0]] != model.body_weldid[bodies[1]])


def can_meet(
    model: mujoco.MjModel, data: mujoco.MjData, bounds: NDArray[np.float64], a: int, b: int, apart_m: float = 0.0
) -> bool:
    """True if the boxes around two geoms can come as near as apart_m with all joints within bounds [2, nv]. data: after
    `mj_forward`; only slides."""
    if model.geom_type[a] in _SHAPELESS or model.geom_type[b] in _SHAPELESS:
        return True
    way = bounds - data.qpos
    bodies = model.geom_bodyid[[a, b]]
    (centre_a, half_a), (centre_b, half_b) = _box(model, data, a), _box(model, data, b)
    low = high = centre_a - centre_b
    for joint in range(model.njnt):
        carries = [carried(model, model.jnt_bodyid[joint], body) for body in bodies]
        if carries[0] != carries[1]:
            ends = np.outer(way[:, joint], data.xaxis[joint]) * (1.0 if carries[0] else -1.0)
            low, high = low + ends.min(axis=0), high + ends.max(axis=0)
    near = half_a + half_b + model.geom_margin[a] + model.geom_margin[b] + apart_m
    return bool(((low <= near) & (high >= -near)).all())


def _box(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre and half sizes, [3] each, of the box along the axes of the world around a geom."""
    turn = data.geom_xmat[geom].reshape(3, 3)
    centre, half = model.geom_aabb[geom].reshape(2, 3)
    return data.geom_xpos[geom] + turn @ centre, np.abs(turn) @ half


def carried(model: mujoco.MjModel, carrier: int, body: int) -> bool:
    """True if `body` is `carrier` or hangs on it."""
    while body > carrier:  # a parent's number is less than its children's
        body = int(model.body_parentid[body])
    return bool(body == carrier)
