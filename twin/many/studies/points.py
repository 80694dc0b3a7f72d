"""Points of a plan: a grid; in each of its points all samples, in each sample all seeds.

    number 1, 2, 3 ...    the seed changes fastest, then the sample, then the values from the last parameter to the
    first

Samples are one low-discrepancy sequence over all sampled parameters, the same in every point of the grid, so that grid
points can be compared sample by sample:

    sobol       points of a scrambled Sobol' sequence, [0, 1)^d; more samples begin with the same ones
    saltelli    A, B, and A with each column of B in turn: d + 2 points a sample, from which variances of first
                order and of all orders follow (A. Saltelli et al., Computer Physics Communications 181 (2010) 259)

The id of a point is a digest of all that its row depends on. So a plan extended by values, samples or seeds contains
the old points; one with another job has none of them.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.errors import CallError
from isel_twin.core.spec import TwinSpec
from isel_twin.many.studies.parameters import between
from isel_twin.many.studies.plan import Plan
from isel_twin.many.studies.row import Point


def unit_samples(plan: Plan) -> NDArray[np.float64]:
    """float64 [n, d]: the samples in [0, 1), one column for each sampled parameter; [1, 0] if there are none. Raises
    CallError without scipy."""
    count = sum(parameter.sampled for parameter in plan.parameters)
    if not count:
        return np.empty((1, 0))
    try:
        from scipy.stats import qmc
    except ImportError:
        raise CallError("samples need scipy: pip install 'isel-twin[tune]'") from None
    saltelli = plan.sampling == "saltelli"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # older versions warn that `seed` becomes `rng`
        sequence = qmc.Sobol(2 * count if saltelli else count, scramble=True, seed=plan.sample_seed)
        drawn = sequence.random(plan.samples)
    if not saltelli:
        return np.asarray(drawn, dtype=np.float64)
    a, b = drawn[:, None, :count], drawn[:, None, count:]
    mixed = np.where(np.eye(count, dtype=np.bool_)[None, :, :], b, a)
    return np.concatenate([a, mixed, b], axis=1).reshape(-1, count)


def all_points(plan: Plan) -> Iterator[Point]:
    """All points in order, with duplicates."""
    spec = plan.work.spec
    same = dataclasses.asdict(dataclasses.replace(plan.work, parameters=(), job_name="", spec=TwinSpec()))
    if same["bounds"]["clearance"] is None:
        del same["bounds"]["clearance"]  # keeps the ids of rows of older tables
    del same["bounds"]["uncertain"]  # of `check` alone
    del same["spec"]  # the content of job and machine counts, not their names
    same |= {"machine": "", "controller": spec.controller, "plant": spec.plant, "start_mm": spec.start_mm}
    digest = hashlib.sha256(_canonical(same))
    axes = [parameter.values or (None,) for parameter in plan.parameters]
    sampled = [parameter for parameter in plan.parameters if parameter.sampled]
    samples = [tuple(map(between, sampled, unit.tolist())) for unit in unit_samples(plan)]
    every = itertools.product(itertools.product(*axes), samples, plan.seeds)
    for number, (values, sample, seed) in enumerate(every, 1):
        drawn = iter(sample)
        point = tuple(next(drawn) if p.sampled else v for p, v in zip(plan.parameters, values, strict=True))
        content = sorted(zip(plan.work.parameters, point, strict=True), key=lambda pair: pair[0])
        whole = digest.copy()
        whole.update(_canonical([content, seed]))
        yield Point(number, whole.hexdigest()[:16], point, seed)


def points(plan: Plan) -> list[Point]:
    """All points without duplicates (whole numbers may be drawn twice), numbered from 1."""
    different = {point.id: point for point in reversed(list(all_points(plan)))}
    ordered = sorted(different.values(), key=lambda point: point.number)
    return [dataclasses.replace(point, number=number) for number, point in enumerate(ordered, 1)]


def _canonical(content: Any) -> bytes:
    return json.dumps(content, sort_keys=True, default=str).encode()
