"""What a common factor hides: numbers behind it that no datum moves, and numbers that the data cannot tell apart.

A factor such as `stiffness.y` multiplies several numbers. The data may depend on one of them alone: a push at the tool
of a machine whose table moves along Y bends the frame and never loads the screw. Or they depend on a sum: guides and
shaft both brake a coast. The factor is found all the same, and says nothing of the screw, and little of either
friction. So after the fit each number is moved alone, by WIDE of its factor's prior and to the side where it is less,
which data of softer, lighter and smoother machines show better:

    J_k = (r - r(number moved)) / WIDE          0 if within the scatter of the model
    s   = |J_k|

A number is **out of reach** if s leaves it NOT_IDENTIFIED of its prior and it has less than SHARE of the largest effect
among its factor's numbers. It keeps its value and grade, and the remedy is named (many/14).

The others are **not told apart** if, each free of its own with the factor's prior, one of them keeps WEAK of that prior
or more: the diagonal of (J'J / s + 1)^-1 (s: fit.py) with the J_k in place of the factor's column. Then the fit took
for granted that they are off by one factor; no datum says so, their grade is `fitted`, and their interval is that of
the free numbers (many/16).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isel_twin.many.identification.model import NOT_IDENTIFIED, WEAK, WIDE, Floats, Model

SHARE = 0.2
REMEDIES = (  # what would reach a key, by its beginning and end; {of} is its axis
    ("axes.", ".stiffness", "a push along {of} at what this axis moves (`push_at`)"),
    ("structure.", ".stiffness", "a push along its axis at the other side, tool or table (`push_at`)"),
    ("axes.", "", "a coast along {of}"),
    ("masses.", "", "a coast, or a stall series at steep ramps, of an axis that moves it"),
)


@dataclass(frozen=True)
class OutOfReach:
    """A number that no datum moves, though the factor it belongs to was fitted."""

    unknown: str  # name of the factor
    key: str  # of the machine file

    @property
    def line(self) -> str:
        head, _, rest = self.key.partition(".")
        remedy = next(text for begin, end, text in REMEDIES if f"{head}." == begin and self.key.endswith(end)).format(
            of=rest.partition(".")[0]
        )
        return f"{self.key}: no datum moves it, so it keeps its value and grade; {remedy} would reach it"


@dataclass(frozen=True)
class Alike:
    """Numbers behind a fitted factor that the data do not tell apart."""

    unknown: str  # name of the factor
    remaining: dict[str, float]  # by key: standard deviation of the number alone over that of the factor's prior

    @property
    def line(self) -> str:
        *some, last = self.remaining
        return (
            f"{self.unknown}: {', '.join(some)} and {last} cannot be told apart by these data; one factor for them is "
            f"an assumption, so none is measured; alone the worst keeps {max(self.remaining.values()):.0%} of its prior"
        )


def behind_factors(
    model: Model, u: Floats, jacobian: Floats, scale: Floats
) -> tuple[tuple[OutOfReach, ...], tuple[Alike, ...]]:
    """What the data do not reach, and do not tell apart, at u. jacobian: there. scale: s [data]."""
    unknowns = model.unknowns
    factors = [(at, item) for at, item in enumerate(unknowns) if item.factor and len(item.keys) > 1]
    if not factors:
        return (), ()
    single = [(at, replace(item, keys=(key,))) for at, item in factors for key in item.keys]
    here, moved = model.residuals_at(u), model.apart(u, [(item, u[at] - WIDE) for at, item in single])
    columns = [model.told(here - one) / WIDE for one in moved]
    unreached: list[OutOfReach] = []
    reached: list[int] = []
    for at, factor in factors:
        own = [index for index, (other, _) in enumerate(single) if other == at]
        size = {index: float(np.linalg.norm(columns[index])) for index in own}
        for index in own:
            if size[index] < SHARE * max(size.values()) and 1.0 / np.sqrt(1.0 + size[index] ** 2) >= NOT_IDENTIFIED:
                unreached.append(OutOfReach(factor.name, single[index][1].keys[0]))
            else:
                reached.append(index)
    whole = [at for at in range(len(unknowns)) if at not in {at for at, _ in factors}]
    free = np.column_stack([jacobian[:, whole], *(columns[index] for index in reached)])
    left = np.sqrt(np.diag(np.linalg.inv(free.T @ (free / scale[:, None]) + np.eye(free.shape[1]))))[len(whole) :]
    alike: list[Alike] = []
    for at, factor in factors:
        own_left = {
            single[index][1].keys[0]: float(one)
            for index, one in zip(reached, left, strict=True)
            if single[index][0] == at
        }
        if len(own_left) > 1 and max(own_left.values()) >= WEAK:
            alike.append(Alike(factor.name, own_left))
    return tuple(unreached), tuple(alike)
