"""The scene of viser: the machine at its present position, and the trail of its tool."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from isel_twin.bridge.operate.panel.frame import Frame
from isel_twin.machine import Machine
from isel_twin.plant.model import load_model
from isel_twin.plant.scene import Poses, Trail, body_meshes

BAD_MM = 0.1  # deviation of the tool that is drawn red
TRAIL_M = 0.005  # thickness of the trail
TRAIL_FRAMES = 4  # frames from one growth of the trail to the next


class MachineView:
    def __init__(self, server: viser.ViserServer, machine: Machine) -> None:
        model = load_model(machine)
        self._server = server
        self._poses = Poses(model, [axis.name for axis in machine.axes])
        self._trail = Trail(BAD_MM)
        self._pieces: dict[int, viser.LineSegmentsHandle] = {}
        self._grown, self._wait = False, 0
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        scene = server.scene
        scene.configure_default_lights(cast_shadow=False)
        cells: dict[str, Any] = {
            "cell_size": 0.1,
            "cell_color": (228, 231, 236),
            "section_size": 0.5,
            "section_color": (205, 211, 219),
        }
        scene.add_grid("/floor", width=4.0, height=4.0, **cells)
        start = self._poses.at([0.0] * len(machine.axes))
        self._frames = {name: scene.add_frame(f"/{name}", show_axes=False) for name in start if name}
        self._shown: dict[str, bytes] = {}
        for number, mesh in enumerate(body_meshes(model)):
            red, green, blue, alpha = mesh.rgba
            scene.add_mesh_simple(
                f"/{mesh.body}/{number}",
                mesh.vertices,
                mesh.faces,
                color=(red, green, blue),
                opacity=alpha if alpha < 1.0 else None,
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
            )
        # The camera is in front, looking at the middle of the machine.
        centre, towards = np.array(model.stat.center), np.array([-0.60, -0.86, 0.55])
        camera = server.initial_camera
        camera.look_at = tuple(centre.tolist())
        camera.position = tuple((centre + 1.22 * float(model.stat.extent) * towards).tolist())

    def show(self, frame: Frame) -> None:
        poses = self._poses.at(frame["machine_position_mm"])
        deviation_mm = float(np.linalg.norm(frame["position_error_mm"]))
        with self._server.atomic():
            for name, handle in self._frames.items():
                pose = poses[name]
                if self._shown.get(name) != (place := pose.position.tobytes() + pose.wxyz.tobytes()):
                    self._shown[name] = place
                    handle.position, handle.wxyz = pose.position, pose.wxyz
            self._draw_trail(deviation_mm)

    def _draw_trail(self, deviation_mm: float) -> None:
        """Show the growing piece: not in every frame, as it is sent as a whole, but before the next one begins."""
        if self._trail.full and self._grown:
            self._send_trail()
        self._grown = self._trail.add(self._poses.tool, deviation_mm) or self._grown
        self._wait -= 1
        if self._grown and self._wait <= 0:
            self._send_trail()

    def _send_trail(self) -> None:
        self._wait, self._grown = TRAIL_FRAMES, False
        points, colours = self._trail.segments
        if (handle := self._pieces.get(self._trail.piece)) is None:
            name = f"/{self._poses.table_body}/trail_{self._trail.piece}"
            handle = self._server.scene.add_line_segments(name, points, colours, thickness=TRAIL_M)
            self._pieces[self._trail.piece] = handle
        else:
            handle.points, handle.colors = points, colours
