"""The machine in 3D: the bodies of its model as meshes, where they are, and the trail of the tool.

    geoms of a body, of one colour --- body_meshes ---> one mesh            sent to a browser once
    positions mm [3] --- Poses ---> places of the bodies that move          sent with each frame
    tool over table --- Trail ---> coloured pieces of line                  in the frame of the table

Positions are those of the joints, so every plant looks the same, with a stiff structure. The trail is relative to the
table, so it stays on the workpiece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.plant import PLACES

SEGMENTS = 20  # sides of a cylinder
SHOWN_GROUPS = (0, 1, 2)  # groups of geoms that are drawn; the others are for collisions and the hood

PIECE_POINTS = 128
PIECES = 40  # the trail: points in one piece of line, and pieces kept
LEAST_MM = 0.05  # distance between points of the trail

_GREEN, _YELLOW, _RED = (np.array(c, dtype=np.float64) for c in ((0, 120, 30), (235, 140, 0), (200, 0, 0)))

Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BodyMesh:
    body: str
    vertices: NDArray[np.float32]  # float32 [v, 3], m, in the frame of the body
    faces: NDArray[np.uint32]  # uint32 [f, 3]
    rgba: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Pose:
    """Of a body, in the world."""

    position: Float  # float64 [3], m
    wxyz: Float  # float64 [4], a quaternion


def body_meshes(model: mujoco.MjModel) -> list[BodyMesh]:
    """Visible meshes of a machine, without (infinite) planes."""
    parts: dict[tuple[int, tuple[float, ...]], list[tuple[Float, NDArray[np.int64]]]] = {}
    for number in range(model.ngeom):
        if model.geom_group[number] not in SHOWN_GROUPS:
            continue
        shape = _shape(model, number)
        if shape is None:
            continue
        vertices, faces = shape
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[number])
        placed = vertices @ rotation.reshape(3, 3).T + model.geom_pos[number]
        material = model.geom_matid[number]
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[number]
        key = int(model.geom_bodyid[number]), tuple(float(part) for part in rgba)
        parts.setdefault(key, []).append((placed, faces))
    return [_merged(model.body(body).name, rgba, shapes) for (body, rgba), shapes in parts.items()]


def _merged(body: str, rgba: tuple[float, ...], shapes: Sequence[tuple[Float, NDArray[np.int64]]]) -> BodyMesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    faces = np.concatenate([faces + start for (_, faces), start in zip(shapes, starts, strict=False)])
    vertices = np.concatenate([vertices for vertices, _ in shapes])
    red, green, blue, alpha = rgba
    return BodyMesh(body, vertices.astype(np.float32), faces.astype(np.uint32), (red, green, blue, alpha))


def _shape(model: mujoco.MjModel, number: int) -> tuple[Float, NDArray[np.int64]] | None:
    """Vertices [v, 3] and faces [f, 3] of a geom in its own frame; None for what has no end."""
    size, kind = model.geom_size[number], mujoco.mjtGeom(int(model.geom_type[number]))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return _box(size)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return _turned(np.array([0.0, size[0], size[0], 0.0]), np.array([-1.0, -1.0, 1.0, 1.0]) * size[1])
    if kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        quarter = np.linspace(0.0, np.pi / 2.0, SEGMENTS // 4 + 1)
        angles = np.concatenate([-quarter[::-1], quarter])  # the equator twice: with the cylinder of a capsule between
        radii, scale = (1.0, size) if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID else (size[0], np.ones(3))
        half = size[1] if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0
        sides = np.repeat([-half, half], len(quarter))
        vertices, faces = _turned(radii * np.cos(angles), radii * np.sin(angles) + sides)
        return vertices * scale, faces
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.mesh(model.geom_dataid[number])
        start, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
        first, many = int(mesh.faceadr[0]), int(mesh.facenum[0])
        vertices = model.mesh_vert[start : start + count].astype(np.float64)
        return vertices, model.mesh_face[first : first + many].astype(np.int64)
    return None


def _box(half: Float) -> tuple[Float, NDArray[np.int64]]:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return signs * half, np.array(faces)


def _turned(radii: Float, heights: Float) -> tuple[Float, NDArray[np.int64]]:
    """A profile [n] of radii and heights turned round z."""
    angles = np.arange(SEGMENTS) * 2.0 * np.pi / SEGMENTS
    rings = [
        np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(SEGMENTS, height)])
        for radius, height in zip(radii, heights, strict=True)
    ]
    low, after = np.arange(SEGMENTS), np.roll(np.arange(SEGMENTS), -1)
    faces = []
    for ring in range(len(rings) - 1):
        a, b = low + ring * SEGMENTS, after + ring * SEGMENTS
        c, d = b + SEGMENTS, a + SEGMENTS
        faces += [np.column_stack([a, b, c]), np.column_stack([a, c, d])]
    return np.concatenate(rings), np.concatenate(faces)


class Poses:
    """Poses of the bodies of a machine for positions of its axes."""

    def __init__(self, model: mujoco.MjModel, joints: Sequence[str] = CARRIAGES) -> None:
        """joints: of the axes, in their order."""
        self._model, self._data = model, mujoco.MjData(model)
        self._joints = [self._data.joint(name) for name in joints]
        self._names = [model.body(number).name for number in range(model.nbody)]
        self.tool = np.zeros(3)  # float64 [3], tip of the tool in the frame of the table's body, m
        self._tool, self._table = (model.site(PLACES[place]).id for place in ("tool", "table"))
        self.table_body: str = self._names[model.site_bodyid[self._table]]

    def at(self, position_mm: Sequence[float]) -> dict[str, Pose]:
        """Of every body by its name, with the carriages at position_mm [3] in machine coordinates."""
        data = self._data
        for joint, mm in zip(self._joints, position_mm, strict=True):
            joint.qpos[0] = mm * 1e-3
        mujoco.mj_kinematics(self._model, data)
        body = self._model.site_bodyid[self._table]
        self.tool = (data.site_xpos[self._tool] - data.xpos[body]) @ data.xmat[body].reshape(3, 3)
        return {name: Pose(data.xpos[i].copy(), data.xquat[i].copy()) for i, name in enumerate(self._names)}


def deviation_colour(deviation_mm: float, bad_mm: float) -> tuple[int, int, int]:
    """Green without deviation, yellow at half of bad_mm, red from bad_mm on."""
    part = min(abs(deviation_mm) / bad_mm, 1.0)
    low, high, share = (_GREEN, _YELLOW, 2.0 * part) if part < 0.5 else (_YELLOW, _RED, 2.0 * part - 1.0)
    red, green, blue = np.rint(low + (high - low) * share).astype(int).tolist()
    return red, green, blue


class Trail:
    """The path of the tool over the table, as pieces of line; a new piece replaces the oldest."""

    def __init__(self, bad_mm: float) -> None:
        """bad_mm: deviation that is red."""
        self._bad_mm = bad_mm
        self._points: list[Float] = []
        self._colours: list[tuple[int, int, int]] = []
        self.piece = 0  # number of the piece that grows, from 0 to PIECES - 1

    @property
    def full(self) -> bool:
        """True if the next point begins another piece."""
        return len(self._points) >= PIECE_POINTS

    def add(self, tool: Float, deviation_mm: float) -> bool:
        """Add a point of the tool [3] in m, if it is a new one; return whether the growing piece has changed."""
        if self._points and np.linalg.norm(tool - self._points[-1]) < LEAST_MM * 1e-3:
            return False
        if self.full:
            self.piece = (self.piece + 1) % PIECES
            self._points, self._colours = self._points[-1:], self._colours[-1:]
        self._points.append(tool)
        self._colours.append(deviation_colour(deviation_mm, self._bad_mm))
        return len(self._points) > 1

    @property
    def segments(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Of the growing piece: ends float32 [n, 2, 3] in m, colours uint8 [n, 2, 3]."""
        points, colours = np.array(self._points, dtype=np.float32), np.array(self._colours, dtype=np.uint8)
        return np.stack([points[:-1], points[1:]], axis=1), np.stack([colours[:-1], colours[1:]], axis=1)
