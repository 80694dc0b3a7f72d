"""Variance-based sensitivity of the outcome of a job, from the rows of a sweep, by SALib.

    first order    S_i  = V[E(Y | x_i)] / V[Y]         part of the variance that vanishes if x_i is known
    total          ST_i = E[V(Y | all but x_i)] / V[Y] part that remains if all but x_i is known

Y is the least margin outside reference runs, the duration, and whether the job fails (1) or not (0). The rest of the
S_i to 1 is due to interactions and to the seed.

    sampling      sampled parameters                        parameters with values
    sobol         S_i by RBD-FAST (E. Plischke 2010,        S_i by groups of equal values, less the expectation of
                  bias by Tissot and Prieur 2012)           chance: (SSB - (k - 1) MSW) / SST
    saltelli      S_i and ST_i of the mean over grid and    none: they are averaged over
                  seeds (Saltelli 2010)

Intervals are 95 % by bootstrap, with a fixed seed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.errors import CallError
from isel_twin.base.files import atomic_write
from isel_twin.base.pictures import picture_bytes, plain_text
from isel_twin.many.studies.plan import Plan
from isel_twin.many.studies.points import all_points

# analysed outcomes and their names
OUTCOME_TITLES: Mapping[str, str] = {"margin_moves": "least torque margin", "cycle_s": "duration", "ok": "failure"}
LEAST_ROWS = 64  # fewer are not enough
HARMONICS = 10  # of RBD-FAST: its usual number
RESAMPLES = 100


@dataclass(frozen=True)
class Index:
    """How much an outcome depends on a parameter."""

    outcome: str
    parameter: str
    first: float
    first_conf: float  # half of the interval
    total: float | None = None
    total_conf: float | None = None


def check(plan: Plan) -> None:
    """Raise CallError unless the sensitivity of a plan can be computed and drawn."""
    for package in ("SALib", "matplotlib"):
        try:
            __import__(package)
        except ImportError:
            raise CallError(f"sensitivity needs {package}: pip install 'isel-twin[tune]'", option=True) from None
    if not plan.parameters:
        raise CallError(f"sensitivity: nothing varies in {plan.file}", option=True)
    number = sum(1 for _ in all_points(plan))
    if number < LEAST_ROWS:
        raise CallError(f"sensitivity: {number} points tell too little; take {LEAST_ROWS} or more", option=True)


def indices(plan: Plan, rows: Sequence[Mapping[str, Any]]) -> list[Index]:
    """Sensitivity of each outcome that varies to each parameter, from the rows of a plan (of all its points)."""
    found: list[Index] = []
    for outcome in OUTCOME_TITLES:
        found += (_saltelli if plan.sampling == "saltelli" else _given)(plan, rows, outcome)
    return found


def _value(row: Mapping[str, Any], outcome: str) -> float:
    """The outcome as a number; nan: it has none."""
    value = row[outcome]
    if value is None:
        return math.nan
    return float(not value) if outcome == "ok" else float(value)


def _varies(values: NDArray[np.float64]) -> bool:
    return len(values) > 1 and float(np.ptp(values)) > 1e-9 * float(np.abs(values).max(initial=0.0))


def _given(plan: Plan, rows: Sequence[Mapping[str, Any]], outcome: str) -> list[Index]:
    """First order, from any rows."""
    from SALib.analyze import rbd_fast

    draw = np.random.default_rng(0)
    known = [row for row in rows if not math.isnan(_value(row, outcome))]
    known = [known[i] for i in draw.permutation(len(known))]  # break ties at random
    y = np.array([_value(row, outcome) for row in known])
    if len(known) < LEAST_ROWS // 2 or not _varies(y):
        return []
    found = []
    for parameter in plan.parameters:
        if not parameter.sampled:
            if len(parameter.values) > 1:
                groups = np.array([parameter.values.index(row[parameter.name]) for row in known])
                again = [draw.integers(len(y), size=len(y)) for _ in range(RESAMPLES)]
                spread = float(np.std([by_groups(groups[chosen], y[chosen]) for chosen in again]))
                found.append(Index(outcome, parameter.name, by_groups(groups, y), 1.96 * spread))
            continue
        x = np.array([[float(row[parameter.name])] for row in known])
        problem = {"num_vars": 1, "names": [parameter.name], "bounds": [[parameter.low, parameter.high]]}
        harmonics = min(HARMONICS, len(y) // 8)
        answer = rbd_fast.analyze(problem, x, y, M=harmonics, num_resamples=RESAMPLES, seed=0)
        found.append(Index(outcome, parameter.name, float(answer["S1"][0]), float(answer["S1_conf"][0])))
    return found


def by_groups(groups: NDArray[np.int64], y: NDArray[np.float64]) -> float:
    """Part of the variance of y [n] between groups [n], less the expectation for random groups."""
    total = float(((y - y.mean()) ** 2).sum())
    if total == 0.0:
        return 0.0
    names = np.unique(groups)
    within = sum(float(((y[groups == name] - y[groups == name].mean()) ** 2).sum()) for name in names)
    left = max(len(y) - len(names), 1)
    return ((total - within) - (len(names) - 1) * within / left) / total


def _saltelli(plan: Plan, rows: Sequence[Mapping[str, Any]], outcome: str) -> list[Index]:
    """First order and total, of the mean over grid and seeds."""
    from SALib.analyze import sobol

    sampled = [parameter for parameter in plan.parameters if parameter.sampled]
    by_id = {row["point"]: _value(row, outcome) for row in rows}
    values = np.array([by_id.get(point.id, math.nan) for point in all_points(plan)])
    size = len(sampled) + 2
    y = values.reshape(-1, plan.samples * size, len(plan.seeds)).mean(axis=(0, 2)).reshape(-1, size)
    y = y[~np.isnan(y).any(axis=1)].ravel()  # drop samples with a missing row
    if len(y) < LEAST_ROWS // 2 or not _varies(y):
        return []
    names = [parameter.name for parameter in sampled]
    problem = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    answer = sobol.analyze(problem, y, calc_second_order=False, num_resamples=RESAMPLES, seed=0)
    columns = (answer[key] for key in ("S1", "S1_conf", "ST", "ST_conf"))
    return [Index(outcome, name, *map(float, each)) for name, *each in zip(names, *columns, strict=True)]


# ---- picture ---------------------------------------------------------------------------------------------------------

_FIRST, _TOTAL, _INK = "#1f5f8b", "#a9cbe0", "#1d2733"


def draw(path: Path, plan: Plan, rows: Sequence[Mapping[str, Any]], found: Sequence[Index]) -> None:
    """Draw the indices: bars for each outcome, with the parameters by weight. Raises OSError, and CallError if nothing
    varies."""
    from matplotlib.figure import Figure

    outcomes = list(dict.fromkeys(index.outcome for index in found))
    if not outcomes:
        raise CallError("sensitivity: no outcome varies; take wider ranges", option=True)
    weight: dict[str, float] = {}
    for index in found:
        size = index.first if index.total is None else index.total
        weight[index.parameter] = max(weight.get(index.parameter, 0.0), size)
    names = sorted(weight, key=lambda name: weight[name])
    with_total = any(index.total is not None for index in found)
    figure = Figure(figsize=(3.1 + 3.0 * len(outcomes), 1.9 + 0.5 * len(names)), layout="constrained", dpi=110)
    fields = figure.subplots(1, len(outcomes), sharey=True, squeeze=False)[0]
    height = 0.36 if with_total else 0.55
    for field, outcome in zip(fields, outcomes, strict=True):
        of = {index.parameter: index for index in found if index.outcome == outcome}
        for row, name in enumerate(names):
            if (one := of.get(name)) is None:
                continue
            bars = [(0.0, one.first, one.first_conf, _FIRST)]
            if one.total is not None and one.total_conf is not None:
                bars = [
                    (0.5 * height, one.first, one.first_conf, _FIRST),
                    (-0.5 * height, one.total, one.total_conf, _TOTAL),
                ]
            for shift, size, conf, colour in bars:
                whisker = {"ecolor": _INK, "elinewidth": 1.0, "capsize": 2.5}
                field.barh(row + shift, max(size, 0.0), height, color=colour, xerr=conf, error_kw=whisker)
        known = [value for each in rows if not math.isnan(value := _value(each, outcome))]
        field.set_title(f"{OUTCOME_TITLES[outcome]}\n{_range(outcome, known)}", fontsize=10, color=_INK)
        field.set_xlim(0.0, 1.05)
        field.set_xlabel("part of the variance")
        field.grid(axis="x", color="#d8dde2", linewidth=0.7)
        field.set_axisbelow(True)
        for side in ("top", "right", "left"):
            field.spines[side].set_visible(False)
        field.tick_params(axis="y", length=0)
    fields[0].set_yticks(range(len(names)), names)
    if with_total:
        from matplotlib.patches import Patch

        words = {"alone (first order)": _FIRST, "with all others (total)": _TOTAL}
        handles = [Patch(color=colour, label=label) for label, colour in words.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    subject = f"{plan.work.job_name} depends" if plan.work.job else "the moves depend"
    figure.suptitle(plain_text(f"What {subject} on, by {len(rows)} rows"), color=_INK)
    atomic_write(path, picture_bytes(figure, path.suffix.lower().removeprefix(".")))


def _range(outcome: str, values: Sequence[float]) -> str:
    if outcome == "ok":
        return f"{100.0 * sum(values) / len(values):.0f} % of the rows"
    if outcome == "margin_moves":
        return f"{100.0 * min(values):.0f} to {100.0 * max(values):.0f} %"
    return f"{min(values):.3g} to {max(values):.3g} s"
