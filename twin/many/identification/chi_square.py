"""Chi-square by kind of datum, so that what carries nothing does not dilute what misfits.

Half of a day's data are durations that no parameter moves. Their noise is stated, not measured: a true model leaves 0.3
per datum of a day, and with pulls that are beyond chance the sum may still be what chance makes it. So each kind is
judged by itself, and what is known beforehand of the numbers fitted beside is one of them:

    chi^2 = sum of r^2 of a kind / sum of (1 - h)      h: leverage, the part of a datum that the fit has bent to

h is the diagonal of D (D'D + P)^-1 D', with D the Jacobian, the zeros of gauges and a row a prior, P of the zeros next
to nothing. A kind is beyond chance from the quantile on that all kinds of a true model stay below in FITS of all fits
(many/31).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isel_twin.many.identification.model import Floats, Model

FITS = 0.999  # part of all fits of a true model that keep all limits
LEAST_FREEDOM = 0.5  # degrees of freedom from which a kind is judged
BESIDE = "beside"  # the kind of what is known beforehand
ZERO_PRECISION = 1e-6  # of the zero of a gauge, 1/mm^2, and of the delay of a line, 1/s^2: next to nothing is known


@dataclass(frozen=True)
class ChiSquare:
    kind: str  # "": of all data
    value: float  # per degree of freedom
    limit: float
    freedom: float

    @property
    def line(self) -> str:
        of = f" of what is known {self.kind}" if self.kind == BESIDE else f" of each {self.kind}" if self.kind else ""
        return f"chi-square{of} {self.value:.1f} per degree of freedom, by chance at most {self.limit:.1f}"

    @property
    def short(self) -> str:
        return f"{self.kind} {self.value:.2f} (at most {self.limit:.1f})"

    @property
    def fits(self) -> bool:
        return self.value <= self.limit


def chi_squares(model: Model, asked: int, u: Floats, jacobian: Floats) -> tuple[ChiSquare, ...]:
    """Of each kind that has LEAST_FREEDOM, at u. asked: how many parameters were, the others are beside. jacobian: at
    u."""
    from scipy.stats import chi2

    residuals, zeros, count = model.residuals_at(u), model.zeros(), len(u)
    design = np.zeros((len(model.data) + count, count + zeros.shape[1]))
    design[: len(model.data)] = np.column_stack([jacobian, zeros])
    design[len(model.data) :, :count] = np.eye(count)
    faint = np.concatenate((np.zeros(count), np.full(zeros.shape[1], ZERO_PRECISION)))
    inner = np.linalg.inv(design.T @ design + np.diag(faint))
    free = 1.0 - np.einsum("ij,jk,ik->i", design, inner, design)
    bounds = np.array([item.side != 0 for item in model.data], dtype=bool)
    free[: len(model.data)][bounds] = model.missed(residuals)[bounds]  # a bound that is met is no degree of freedom
    kinds = np.array([*(item.kind for item in model.data), *[""] * asked, *[BESIDE] * (count - asked)])
    squares = np.concatenate((model.each_square(residuals), u**2))
    told = [(kind, float(squares[own].sum()), float(free[own].sum())) for kind, own in _by(kinds)]
    judged = [one for one in told if one[2] >= LEAST_FREEDOM]
    part = FITS ** (1.0 / max(1, len(judged)))
    return tuple(ChiSquare(kind, sum_ / n, float(chi2.ppf(part, n)) / n, n) for kind, sum_, n in judged)


def _by(kinds: np.ndarray) -> list[tuple[str, np.ndarray]]:
    return [(kind, kinds == kind) for kind in dict.fromkeys(kinds.tolist()) if kind]


def scale(model: Model, told: tuple[ChiSquare, ...]) -> Floats:
    """[data]: variance of each datum over that of its noise, by chi-square of its kind, at least 1."""
    by = {one.kind: max(1.0, one.value) for one in told}
    return np.array([by.get(item.kind, 1.0) for item in model.data])
