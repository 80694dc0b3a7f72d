"""The machine as the scene has it: meshes of geoms, places of bodies, the trail of the tool."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest

from isel_twin.machine import load_machine, machine_names
from isel_twin.plant.model import load_model
from isel_twin.plant.scene import PIECE_POINTS, PIECES, Poses, Trail, body_meshes, deviation_colour

SHAPES = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="one" pos="1 2 3">
      <geom type="box" size="0.1 0.2 0.3" pos="1 0 0" rgba="1 0 0 1"/>
      <geom type="cylinder" size="0.1 0.4" quat="0.70710678 0.70710678 0 0" rgba="1 0 0 1"/>
      <geom type="sphere" size="0.5" rgba="0 1 0 0.5"/>
      <geom type="capsule" size="0.1 0.4" rgba="0 0 1 1"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3" rgba="1 1 0 1"/>
      <geom type="box" size="9 9 9" group="3"/>
    </body>
  </worldbody>
</mujoco>
"""


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Of a closed surface whose faces turn outwards."""
    a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def test_meshes_have_the_volume_of_their_geoms_and_faces_that_look_outwards():
    """A prism of 20 sides has sin(18 deg) / 18 deg of the circle's area; nothing of a collision geom is drawn."""
    meshes = {mesh.rgba: mesh for mesh in body_meshes(mujoco.MjModel.from_xml_string(SHAPES))}
    assert {mesh.body for mesh in meshes.values()} == {"one"}
    polygon = np.sin(2 * np.pi / 20) / (2 * np.pi / 20)
    red = meshes[1.0, 0.0, 0.0, 1.0]
    assert volume(red.vertices, red.faces) == pytest.approx(8 * 0.006 + polygon * np.pi * 0.01 * 0.8, rel=1e-6)
    assert red.vertices.max(axis=0) == pytest.approx([1.1, 0.4, 0.3])
    assert red.vertices.min(axis=0) == pytest.approx([-0.1, -0.4, -0.3])
    green = meshes[0.0, 1.0, 0.0, 0.5]
    assert volume(green.vertices, green.faces) == pytest.approx(4 / 3 * np.pi * 0.125, rel=0.05)
    blue = meshes[0.0, 0.0, 1.0, 1.0]
    assert volume(blue.vertices, blue.faces) == pytest.approx(np.pi * 0.01 * 0.8 + 4 / 3 * np.pi * 0.001, rel=0.05)
    assert blue.vertices[:, 2].max() == pytest.approx(0.5)
    yellow = meshes[1.0, 1.0, 0.0, 1.0]
    assert volume(yellow.vertices, yellow.faces) == pytest.approx(4 / 3 * np.pi * 0.006, rel=0.05)


@pytest.mark.parametrize("name", machine_names())
def test_the_tool_goes_where_the_axes_go_on_every_machine(name: str):
    """In the frame of the table, whichever of the two moves: one millimetre an axis, and back again."""
    machine = load_machine(name)
    poses = Poses(load_model(machine), [axis.name for axis in machine.axes])
    poses.at([10.0, 20.0, 30.0])
    start = poses.tool
    ways = []
    for axis in range(3):
        position = [10.0, 20.0, 30.0]
        position[axis] += 1.0
        poses.at(position)
        ways.append(poses.tool - start)
    ways_mm = 1e3 * np.array(ways)
    assert np.linalg.norm(ways_mm, axis=1) == pytest.approx(1.0)
    assert np.abs(np.linalg.det(ways_mm)) == pytest.approx(1.0)
    assert ways_mm[2, 2] == pytest.approx(-1.0)  # Z is positive downwards
    poses.at([10.0, 20.0, 30.0])
    assert (poses.tool == start).all()


def test_colours_of_the_deviation():
    """Green, yellow and red at nothing, half and all of what is bad; between them between them; red beyond."""
    green, yellow, red = (deviation_colour(part, 1.0) for part in (0.0, 0.5, 1.0))
    assert green[1] > green[0]
    assert yellow[0] > yellow[1] > green[1]
    assert red[0] > 3 * red[1]
    assert deviation_colour(-0.25, 1.0) == deviation_colour(0.25, 1.0)
    assert deviation_colour(7.0, 1.0) == red
    assert green[0] < deviation_colour(0.25, 1.0)[0] < yellow[0]


def test_the_trail_is_bounded_and_has_no_gap():
    trail = Trail(0.1)
    assert not trail.add(np.zeros(3), 0.0)
    assert not trail.add(np.full(3, 1e-6), 0.0)
    kept: dict[int, np.ndarray] = {}
    for number in range(1, PIECE_POINTS * (PIECES + 2)):
        assert trail.add(np.array([number * 1e-3, 0.0, 0.0]), 0.01)
        points, colours = trail.segments
        assert points.shape == colours.shape == (len(points), 2, 3)
        kept[trail.piece] = points
    assert len(kept) == PIECES
    ends = sorted((float(points[0, 0, 0]), float(points[-1, 1, 0])) for points in kept.values())
    assert all(end == pytest.approx(start) for (_, end), (start, _) in itertools.pairwise(ends))
