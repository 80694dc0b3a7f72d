"""STL files of boxes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np


def write_stl(path: Path, size_mm: Sequence[float]) -> Path:
    """A binary STL file of a box, its origin in the middle of its foot."""
    x, y, z = (0.5 * np.array(size_mm)).tolist()
    corners = [np.array([i * x, j * y, z + k * z]) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    record = np.dtype([("normal", "<f4", 3), ("ends", "<f4", (3, 3)), ("attribute", "<u2")])
    data = np.zeros(len(faces), record)
    data["ends"] = [[corners[k] for k in face] for face in faces]
    path.write_bytes(bytes(80) + len(faces).to_bytes(4, "little") + data.tobytes())
    return path
