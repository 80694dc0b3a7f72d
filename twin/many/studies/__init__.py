"""Studies: one job under many conditions, as a table.

    plan.py         what stays the same, what varies: a TOML file, checked when it is read
    parameters.py   a parameter of a plan, checked against what it changes
    points.py       grid, samples and seeds: the points of a plan
    row.py          one point, one row: a function that runs anywhere
    table.py        rows as they come, in a Parquet file that is whole at any time
    sensitivity.py  what the outcome depends on, from the rows

`isel-twin sweep` puts them together; docs/sweeps.md shows how they are used.
"""

from __future__ import annotations

import math

__all__ = ["wilson"]


def wilson(hits: int, total: int, z: float = 1.96) -> tuple[float, float]:
    """The interval in which the probability of a hit lies, after so many in `total` tries; z = 1.96: 95 %.

    (p + z^2/2n +- z sqrt(p (1 - p)/n + z^2/4n^2)) / (1 + z^2/n), E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    p, n = hits / total, total
    middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n)
    half = z * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n)) / (1.0 + z * z / n)
    return max(0.0, middle - half), min(1.0, middle + half)
