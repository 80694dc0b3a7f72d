"""The machine as it looks: the scene of its model, drawn without a window.

For environments, pages and documents:

    draw(load_machine("4030"), (200.0, 150.0, 70.0), height=900, width=1200)        uint8 [900, 1200, 3]

`draw` is for one picture; a `Picture` keeps model and renderer for more, a `Window` shows the machine on the screen. A
path is drawn on the workpiece and moves with the table.
"""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.thinning import extremes
from isel_twin.machine import Machine
from isel_twin.plant import PLACES
from isel_twin.plant.model import load_model

HEIGHT, WIDTH = 480, 640  # default size of a picture in pixels
MOST_PIECES = 300  # into which a path is divided for drawing
_RED = np.array([0.9, 0.1, 0.1, 1.0], dtype=np.float32)
_LINE_M = 5e-4


class Picture:
    """A machine in front of a camera. `close`, or the end of the context, frees the renderer."""

    def __init__(
        self, machine: Machine, height: int = HEIGHT, width: int = WIDTH, camera: str = "", near_m: float = 0.0
    ) -> None:
        """camera: a name from the machine's scene; "": `front`, or one that sees it all if there is no such camera.
        near_m: instead of that, a camera at this distance from the tool's tip, looking at it; 0: none.

        Raises ValueError for a camera that does not exist, MachineError if the model cannot be read, RuntimeError with
        one line if there is no OpenGL to draw with.
        """
        self._model = load_model(machine)
        self._data = mujoco.MjData(self._model)
        cameras = [self._model.camera(number).name for number in range(self._model.ncam)]
        if camera and camera not in cameras:
            raise ValueError(f"unknown camera {camera!r}; there are: {', '.join(cameras)}")
        self._camera: str | int | mujoco.MjvCamera = camera or ("front" if "front" in cameras else -1)
        if near_m:
            self._camera = _near(near_m)
        self._names = [axis.name for axis in machine.axes]
        self._path = self._from_table = np.empty((0, 3))
        buffer = self._model.vis.global_
        buffer.offheight, buffer.offwidth = max(buffer.offheight, height), max(buffer.offwidth, width)
        try:
            self._renderer = _renderer(self._model, height, width)
        except Exception as error:  # each backend fails in its own way
            reason = " ".join(str(error).split())
            raise RuntimeError(f"no picture without OpenGL: {reason}; install EGL, or set MUJOCO_GL") from None

    def draw(
        self, position_mm: Sequence[float] | NDArray[np.float64], path_mm: NDArray[np.float64] | None = None
    ) -> NDArray[np.uint8]:
        """uint8 [height, width, 3], with the carriages at position_mm [3] in machine coordinates.

        path_mm [n, 3]: a path of the tool over the workpiece, in machine coordinates.
        """
        _place(self._model, self._data, self._names, position_mm)
        if isinstance(self._camera, mujoco.MjvCamera):
            self._camera.lookat = self._data.site(PLACES["tool"]).xpos
        self._renderer.update_scene(self._data, camera=self._camera)
        if path_mm is not None:
            _lay(self._renderer.scene, self._line(path_mm) + self._data.site(PLACES["table"]).xpos)
        return self._renderer.render()

    def _line(self, path_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [m, 3], points of the path from the table, m; computed once for each path."""
        if self._path is not path_mm and not np.array_equal(self._path, path_mm):
            self._path, self._from_table = path_mm, on_table(self._model, self._names, path_mm)
        return self._from_table

    def close(self) -> None:
        self._renderer.close()

    def __enter__(self) -> Picture:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def has_screen() -> bool:
    """True if a window can be opened, as far as the environment tells."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


class Window:
    """A machine in a window of MuJoCo's viewer, which people can turn and zoom."""

    def __init__(self, machine: Machine) -> None:
        """Raises MachineError if the model cannot be read, RuntimeError with one line if there is no screen."""
        self._model = load_model(machine)
        self._data = mujoco.MjData(self._model)
        self._names = [axis.name for axis in machine.axes]
        self._path = self._from_table = np.empty((0, 3))
        if not has_screen():
            raise RuntimeError("no window without a screen: DISPLAY is not set; take pictures (rgb_array) instead")
        from mujoco import viewer

        try:
            self._viewer = viewer.launch_passive(self._model, self._data, show_left_ui=False, show_right_ui=False)
        except Exception as error:  # each platform fails in its own way
            raise RuntimeError(f"no window: {' '.join(str(error).split())}") from None

    def show(self, position_mm: Sequence[float] | NDArray[np.float64], path_mm: NDArray[np.float64]) -> None:
        """Show the carriages at position_mm [3] and a path [n, 3], both in machine coordinates."""
        if not np.array_equal(self._path, path_mm):
            self._path, self._from_table = path_mm, on_table(self._model, self._names, path_mm)
        with self._viewer.lock():
            _place(self._model, self._data, self._names, position_mm)
            self._viewer.user_scn.ngeom = 0
            _lay(self._viewer.user_scn, self._from_table + self._data.site(PLACES["table"]).xpos)
        self._viewer.sync()

    def close(self) -> None:
        self._viewer.close()


def on_table(model: mujoco.MjModel, names: Sequence[str], path_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """float64 [m, 3], a path [n, 3] of the tool in machine coordinates, in metres from the table's top; m at most
    MOST_PIECES + 1. names: the joints of X, Y and Z."""
    data = mujoco.MjData(model)
    points = path_mm[extremes(path_mm, MOST_PIECES + 1)]
    line = np.empty((len(points), 3))
    for at, point in zip(line, points, strict=True):
        _place(model, data, names, point)
        at[:] = data.site(PLACES["tool"]).xpos - data.site(PLACES["table"]).xpos
    return line


def _near(distance_m: float) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = distance_m, -60.0, -40.0
    return camera


def _place(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    names: Sequence[str],
    position_mm: Sequence[float] | NDArray[np.float64],
) -> None:
    for name, mm in zip(names, position_mm, strict=True):
        data.joint(name).qpos[0] = mm * 1e-3
    mujoco.mj_forward(model, data)


def _lay(scene: mujoco.MjvScene, line: NDArray[np.float64]) -> None:
    """Add a line [m, 3] to a scene, m in the world."""
    for start, end in itertools.pairwise(line):
        if scene.ngeom == scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.eye(3).ravel(), _RED)
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, _LINE_M, start, end)
        scene.ngeom += 1


def draw(
    machine: Machine,
    position_mm: Sequence[float] | NDArray[np.float64],
    height: int = HEIGHT,
    width: int = WIDTH,
    camera: str = "",
) -> NDArray[np.uint8]:
    """uint8 [height, width, 3], one picture of the machine; arguments and errors as those of Picture."""
    with Picture(machine, height, width, camera) as picture:
        return picture.draw(position_mm)


def _renderer(model: mujoco.MjModel, height: int, width: int) -> mujoco.Renderer:
    """A renderer. On Linux without a screen, and without MUJOCO_GL, it is one that needs no screen: by itself MuJoCo
    would choose one that does."""
    from mujoco.rendering.classic import gl_context

    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if screen or os.environ.get("MUJOCO_GL") or sys.platform != "linux":
        return mujoco.Renderer(model, height, width)
    from mujoco import egl

    chosen, gl_context.GLContext = gl_context.GLContext, egl.GLContext
    try:
        return mujoco.Renderer(model, height, width)
    finally:
        gl_context.GLContext = chosen
