"""Studies: one job under many conditions, as a table.

    plan.py         constants and varying parameters: a TOML file, checked when it is read
    parameters.py   a parameter of a plan, checked against its target
    points.py       grid, samples and seeds: the points of a plan
    row.py          one point, one row: a function that runs in any process
    table.py        rows as they come, in a Parquet file that is always complete
    sensitivity.py  dependence of the outcome on parameters, from the rows

Used by `isel-twin sweep`; see docs/sweeps.md.
"""

from __future__ import annotations

import math

__all__ = ["wilson"]


def wilson(hits: int, total: int, z: float = 1.96) -> tuple[float, float]:
    """Confidence interval of the probability of a hit after `hits` in `total` tries; z = 1.96: 95 %.

    (p + z^2/2n +- z sqrt(p (1 - p)/n + z^2/4n^2)) / (1 + z^2/n), E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    p, n = hits / total, total
    middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n)
    half = z * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n)) / (1.0 + z * z / n)
    return max(0.0, middle - half), min(1.0, middle + half)
