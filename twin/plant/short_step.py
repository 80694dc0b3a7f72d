"""When a MuJoCo step may be the short one: what it keeps of the step before, and where that is exact.

Goal: not to find anew in each step what cannot have changed. Where all joints slide, where they are changes neither a
mass nor a direction; so unless a stop or a collision comes into play, all that the position stage of MuJoCo finds
(tree, mass matrix, collisions, constraint rows) is what it found in the step before, bit for bit:

    mj_step            position stage -> velocity stage -> acceleration, friction -> new velocity and position
    short step                           velocity stage -> acceleration, friction -> new velocity and position

A step is short if all joints lie within their bounds and did so in the last whole one. The bounds of a joint are its
stops, or a little deflection if it has none; a model in which something could meet within them has no short steps.

    stop |<---------------- bounds ---------------->| stop             outside: whole steps, with stops and collisions
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

DEFLECTION_M = 2e-3
"""Bounds of a joint without stops: no frame gives as much in service."""

_SHAPELESS = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)


def short_step_bounds(model: mujoco.MjModel) -> NDArray[np.float64]:
    """float64 [2, nv], joint positions in m between which steps may be short, both ends left out; all nan if none may.

    Actuators and sensors are not asked after: the plant has motors of its own, and `model` is told to leave its out.
    """
    never = np.full((2, model.nv), np.nan)
    if (
        model.jnt_type != mujoco.mjtJoint.mjJNT_SLIDE
    ).any() or model.opt.integrator != mujoco.mjtIntegrator.mjINT_EULER:
        return never
    if (
        model.neq
        or model.ntendon
        or model.nflex
        or model.npair
        or model.nplugin
        or model.opt.density
        or model.opt.wind.any()
    ):
        return never
    limited = model.jnt_limited != 0
    margin = model.jnt_margin
    bounds = np.array([model.qpos0 - DEFLECTION_M, model.qpos0 + DEFLECTION_M])
    bounds[0, limited] = (model.jnt_range[:, 0] + margin)[limited]
    bounds[1, limited] = (model.jnt_range[:, 1] - margin)[limited]
    return never if _can_meet(model, bounds) else bounds


def _can_meet(model: mujoco.MjModel, bounds: NDArray[np.float64]) -> bool:
    """Whether the boxes around two geoms that may collide can meet with all joints within their bounds [2, nv]."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    way = bounds - data.qpos
    for a in range(model.ngeom):
        for b in range(a):
            if not (
                model.geom_contype[a] & model.geom_conaffinity[b] or model.geom_contype[b] & model.geom_conaffinity[a]
            ):
                continue
            bodies = model.geom_bodyid[[a, b]]
            if model.body_weldid[bodies[0]] == model.body_weldid[bodies[1]]:
                continue
            if model.geom_type[a] in _SHAPELESS or model.geom_type[b] in _SHAPELESS:
                return True
            (centre_a, half_a), (centre_b, half_b) = _box(model, data, a), _box(model, data, b)
            low = high = centre_a - centre_b
            for joint in range(model.njnt):
                carries = [_carries(model, model.jnt_bodyid[joint], body) for body in bodies]
                if carries[0] != carries[1]:
                    ends = np.outer(way[:, joint], data.xaxis[joint]) * (1.0 if carries[0] else -1.0)
                    low, high = low + ends.min(axis=0), high + ends.max(axis=0)
            reach = half_a + half_b + model.geom_margin[a] + model.geom_margin[b]
            if ((low <= reach) & (high >= -reach)).all():
                return True
    return False


def _box(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre and half sizes, [3] each, of the box along the axes of the world around a geom."""
    turn = data.geom_xmat[geom].reshape(3, 3)
    centre, half = model.geom_aabb[geom].reshape(2, 3)
    return data.geom_xpos[geom] + turn @ centre, np.abs(turn) @ half


def _carries(model: mujoco.MjModel, carrier: int, body: int) -> bool:
    """Whether `body` is `carrier` or hangs on it."""
    while body > carrier:  # a parent's number is less than its children's
        body = int(model.body_parentid[body])
    return bool(body == carrier)
