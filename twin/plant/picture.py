"""The machine as it looks: the scene of its model, drawn without a window.

Goal: whoever shows the machine (a rendering environment, a page, a document) gets the same picture from one place:

    draw(load_machine("4030"), (200.0, 150.0, 70.0), height=900, width=1200)        uint8 [900, 1200, 3]

`draw` is for one picture; a `Picture` keeps model and renderer for as many as wanted.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.machine import Machine
from isel_twin.plant.model import load_model

HEIGHT, WIDTH = 480, 640
"""Size of a picture in pixels, unless told otherwise."""


class Picture:
    """A machine in front of a camera. Frees the renderer when it is closed, or left as a context."""

    def __init__(self, machine: Machine, height: int = HEIGHT, width: int = WIDTH, camera: str = "") -> None:
        """camera: a name from the machine's scene; "": `front`, or one that sees it all if there is no such camera.

        Raises ValueError for a camera that does not exist, MachineError if the model cannot be read, RuntimeError with
        one line if there is no OpenGL to draw with.
        """
        self._model = load_model(machine)
        self._data = mujoco.MjData(self._model)
        cameras = [self._model.camera(number).name for number in range(self._model.ncam)]
        if camera and camera not in cameras:
            raise ValueError(f"unknown camera {camera!r}; there are: {', '.join(cameras)}")
        self._camera: str | int = camera or ("front" if "front" in cameras else -1)
        self._names = [axis.name for axis in machine.axes]
        buffer = self._model.vis.global_
        buffer.offheight, buffer.offwidth = max(buffer.offheight, height), max(buffer.offwidth, width)
        try:
            self._renderer = _renderer(self._model, height, width)
        except Exception as error:  # each backend fails in its own way
            reason = " ".join(str(error).split())
            raise RuntimeError(f"no picture without OpenGL: {reason}; install EGL, or set MUJOCO_GL") from None

    def draw(self, position_mm: Sequence[float] | NDArray[np.float64]) -> NDArray[np.uint8]:
        """uint8 [height, width, 3], with the carriages at position_mm [3] in machine coordinates."""
        for name, mm in zip(self._names, position_mm, strict=True):
            self._data.joint(name).qpos[0] = mm * 1e-3
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, camera=self._camera)
        return self._renderer.render()

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()

    def __enter__(self) -> Picture:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


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
    """A renderer; on a Linux machine without a screen, unless MUJOCO_GL says otherwise, one that needs none.

    MuJoCo chooses its OpenGL backend once and for all when it is imported, and then one that needs a screen.
    """
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
