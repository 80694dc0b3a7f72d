"""Paths as corners, and how far places are from them, for the assertions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def arc(
    centre_mm: Sequence[float], radius_mm: float, begin_deg: float = 0.0, end_deg: float = 360.0, chords: int = 720
) -> NDArray[np.float64]:
    """float64 [chords + 1, 2], an arc in XY as corners of a path; angles from +X towards +Y.

    A chord is at most radius (1 - cos(angle / 2)) inside the arc: 0.1 um at 10 mm with the whole circle in 720.
    """
    angle = np.radians(np.linspace(begin_deg, end_deg, chords + 1))
    return np.asarray(centre_mm, dtype=np.float64)[:2] + radius_mm * np.column_stack([np.cos(angle), np.sin(angle)])


def from_path(where_mm: NDArray[np.float64], points_mm: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Distance [n] of places from a path, and the nearest points [n, axes] of it."""
    distance = np.full(len(where_mm), np.inf)
    nearest = np.empty_like(where_mm)
    ends = points_mm[1:] if len(points_mm) > 1 else points_mm
    for a, b in zip(points_mm, ends, strict=False):
        along = b - a
        square = float(along @ along)
        part = np.clip((where_mm - a) @ along / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(where_mm))
        foot = a + part[:, None] * along
        away = np.linalg.norm(where_mm - foot, axis=1)
        nearer = away < distance
        distance[nearer], nearest[nearer] = away[nearer], foot[nearer]
    return distance, nearest


def since_left(free: NDArray[np.bool_], far: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """bool [n], True after a far sample in the same stretch of free ones."""
    left = np.zeros(len(free), dtype=np.bool_)
    edges = np.flatnonzero(np.diff(free.astype(np.int8), prepend=0, append=0))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        left[begin:end] = np.maximum.accumulate(far[begin:end])
    return left
