"""Paths for a tool to follow: polylines in mm, by name, random or given, and finely sampled.

    points [n, 3]  --- sampled --->  [m, 4]: X, Y, Z and the distance along it, every corner kept

Coordinates are relative to the first point of a path, which is the present position of the machine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

SPACING_MM = 0.1  # longest piece of a sampled path
MOST_POINTS = 200_000  # in a sampled path: twenty metres

_CORNER = ((0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 15.0, 0.0))
_SQUARE = (*_CORNER, (0.0, 15.0, 0.0), (0.0, 0.0, 0.0))
_RADIUS_MM = 10.0
_LEGS, _LEG_MM, _BEND_RAD = 4, (5.0, 20.0), 2.0
NAMES = ("corner", "square", "circle", "random")  # named paths; a random one is new in every episode


def lay_path(path: str | ArrayLike, draw: np.random.Generator) -> NDArray[np.float64]:
    """float64 [n, 3], the corners of a path in mm from its first point. draw: for a random one.

    path: one of NAMES, or points [n, 2] or [n, 3] in mm, n at least 2. Raises ValueError with one line otherwise.
    """
    if isinstance(path, str):
        if path not in NAMES:
            raise ValueError(f"path is {path!r}; there are: {', '.join(NAMES)}, or points [n, 2] or [n, 3] in mm")
        return _random(draw) if path == "random" else np.array(_named(path))
    try:
        points = np.asarray(path, dtype=np.float64)
    except (TypeError, ValueError):
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or len(points) < 2 or not np.isfinite(points).all():
        raise ValueError("path is no list of at least two points of two or three finite numbers, in mm")
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    return points - points[0]


def sampled(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """float64 [m, 4], the path in pieces of at most SPACING_MM: X, Y, Z, and the distance from the start, all in mm.

    points [n, 3]; corners are kept. Raises ValueError for a path without length, or with too much.
    """
    legs = np.diff(points, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    legs, starts, lengths = legs[lengths > 0.0], points[:-1][lengths > 0.0], lengths[lengths > 0.0]
    counts = np.ceil(lengths / SPACING_MM).astype(np.int64)
    if not 0 < counts.sum() < MOST_POINTS:
        raise ValueError(f"path is {lengths.sum():g} mm long; allowed: more than 0, up to {MOST_POINTS * SPACING_MM:g}")
    leg = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(leg)) - (counts.cumsum() - counts)[leg]) / counts[leg]
    path = np.zeros((len(leg) + 1, 4))
    path[:-1, :3] = starts[leg] + share[:, None] * legs[leg]
    path[-1, :3] = points[-1]
    np.cumsum((lengths / counts)[leg], out=path[1:, 3])
    return path


def _named(name: str) -> Sequence[tuple[float, float, float]]:
    if name == "circle":
        turns = [2.0 * math.pi * k / 720 for k in range(721)]
        return [(_RADIUS_MM * (1.0 - math.cos(turn)), _RADIUS_MM * math.sin(turn), 0.0) for turn in turns]
    return {"corner": _CORNER, "square": _SQUARE}[name]


def _random(draw: np.random.Generator) -> NDArray[np.float64]:
    """Straight legs in the plane, each bent off the one before by up to 115 degrees."""
    turns = draw.uniform(-math.pi, math.pi) + np.cumsum([0.0, *draw.uniform(-_BEND_RAD, _BEND_RAD, _LEGS - 1)])
    lengths = draw.uniform(*_LEG_MM, _LEGS)
    legs = np.column_stack([lengths * np.cos(turns), lengths * np.sin(turns), np.zeros(_LEGS)])
    return np.concatenate([np.zeros((1, 3)), np.cumsum(legs, axis=0)])
