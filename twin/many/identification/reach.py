"""Which of the numbers behind a common factor the data reach.

A factor such as `stiffness.y` multiplies several numbers. The data may depend on one of them alone: a push at the tool
of a machine whose table moves along Y bends the frame and never loads the screw. The factor is found all the same, and
says nothing of the screw. So after the fit each number is moved alone, by twice the step of model.py and to the side
where it is less, which data of softer, lighter and smoother machines show better:

    s = |r(number moved) - r| / WIDE       over the data; 0 if within the scatter of the model

A number is out of reach if s leaves it NOT_IDENTIFIED of its prior and it has less than SHARE of the largest effect
among its factor's numbers. It keeps its value and grade, and the remedy is named (many/14).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from isel_twin.base.crew import Crew
from isel_twin.machine import Machine
from isel_twin.many.identification.model import NOT_IDENTIFIED, STEP, Floats, Model
from isel_twin.many.identification.session import Session
from isel_twin.many.identification.unknowns import Unknown

SHARE = 0.2
WIDE = 2.0 * STEP
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


def out_of_reach(
    machine: Machine, unknowns: Sequence[Unknown], sessions: Sequence[Session], u: Floats, crew: Crew | None = None
) -> tuple[tuple[OutOfReach, ...], int]:
    """Numbers behind the factors among the unknowns that the data do not reach at u, and how many replays that took."""
    factors = [(at, item) for at, item in enumerate(unknowns) if item.factor and len(item.keys) > 1]
    if not factors:
        return (), 0
    single = [(at, replace(item, keys=(key,))) for at, item in factors for key in item.keys]
    model = Model(machine, [*unknowns, *(item for _, item in single)], sessions, crew)
    base = np.concatenate((u, [u[at] for at, _ in single]))
    points = [base - WIDE * np.eye(len(base))[len(u) + index] for index in range(len(single))]
    here, *moved = [model.residuals(one) for one in model.predictions([base, *points])]
    effect = [float(np.linalg.norm(model.told(one - here))) / WIDE for one in moved]
    found = []
    for at, factor in factors:
        own = [(item.keys[0], size) for (other, item), size in zip(single, effect, strict=True) if other == at]
        most = max(size for _, size in own)
        found += [
            OutOfReach(factor.name, key)
            for key, size in own
            if size < SHARE * most and 1.0 / np.sqrt(1.0 + size**2) >= NOT_IDENTIFIED
        ]
    return tuple(found), model.replays
