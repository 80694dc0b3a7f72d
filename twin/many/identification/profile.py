"""Intervals by profile likelihood, beside those of the covariance, which take the model for a plane.

Of each parameter both ends of its interval by the covariance C are tried, and the others with it, as C says they go:

    u(t) = u + t C_k / sqrt(C_kk)          t = -1.96, 1.96
    cost = min over the others of |r|^2 / s + |u|^2       s = max(1, chi-square of the datum's kind), the others linear
                                                          about u(t), those that confound by chance among them (fit.py)

On a plane it is 3.84 more than at u. Where it is less, the data say less than the plane does, and the end lies farther
off, as if the cost were a parabola on this side: t sqrt(3.84 / more), at most FARTHEST times as far. The wider of both
is the interval: where a model loses steps, the cost jumps, and what then is nearer is no knowledge. A replay an end.
"""

from __future__ import annotations

import math

import numpy as np

from isel_twin.machine.spread import NORMAL_95
from isel_twin.many.identification.model import NOT_IDENTIFIED, Floats, Model

FARTHEST = 3.0


def profile(
    model: Model, asked: int, u: Floats, jacobian: Floats, chance: Floats, covariance: Floats, scale: Floats
) -> Floats:
    """float64 [asked, 2]: how far both ends lie from u, NORMAL_95 standard deviations or more, of the first `asked`
    parameters. jacobian: at u; chance: [data, m], effects of further numbers there; scale: s [data]."""
    deviation = np.sqrt(np.diag(covariance))[:asked]
    ends = NORMAL_95 * np.outer(deviation, np.ones(2))
    known = [(at, side) for at in range(asked) if deviation[at] < NOT_IDENTIFIED for side in (0, 1)]
    points = [u + (-1.0, 1.0)[side] * NORMAL_95 * covariance[:, at] / deviation[at] for at, side in known]
    effects, none = np.column_stack([jacobian, chance]), np.zeros(chance.shape[1])
    here = _cost(model.residuals_at(u), np.append(u, none), effects, scale, None)
    for (at, side), point, predicted in zip(known, points, model.predictions(points), strict=True):
        more = _cost(model.residuals(predicted), np.append(point, none), effects, scale, at) - here
        farther = NORMAL_95 / math.sqrt(max(more, 1e-9))
        ends[at, side] *= min(max(1.0, farther), FARTHEST)
    return ends


def _cost(residuals: Floats, u: Floats, jacobian: Floats, scale: Floats, kept: int | None) -> float:
    """The least cost about u, the residuals linear in all but `kept`."""
    others = [at for at in range(len(u)) if at != kept]
    design = np.concatenate((jacobian[:, others] / np.sqrt(scale)[:, None], np.eye(len(u))[:, others]))
    whole = np.concatenate((residuals / np.sqrt(scale), u))
    step = np.linalg.lstsq(design, -whole, rcond=None)[0]
    return float(((whole + design @ step) ** 2).sum())
