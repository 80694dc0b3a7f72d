"""Fewer points of a curve or a path for a picture, with the extremes of what is left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def extremes(values: NDArray[np.float64], most: int) -> NDArray[np.int64]:
    """Indices of at most `most` rows of [n, m]: all, or of each stretch the first, and those with the least and the
    largest value of each column; and the last. nan is no value."""
    number, columns = values.shape
    if number <= most:
        return np.arange(number)
    size = -(-number * (2 * columns + 1) // (most - 1 - 2 * columns))  # of a stretch; the last one may be short
    starts = np.arange(0, number, size)
    rows = np.minimum(starts[:, None] + np.arange(size), number - 1)
    stretches = values[rows]
    low = np.where(np.isnan(stretches), np.inf, stretches).argmin(axis=1)
    high = np.where(np.isnan(stretches), -np.inf, stretches).argmax(axis=1)
    found = np.concatenate([starts, *(rows[np.arange(len(starts)), at] for at in (*low.T, *high.T)), [number - 1]])
    return np.unique(found)
