"""What would explain data that the fitted model does not: laws that were not fitted, the likeliest first.

Chi-square says that something is wrong, not what. So each number of LAWS that the fit has left alone is moved by WIDE
of a prior of half to twice, both ways, at the result u, where the cost |r|^2 + |u|^2 has no slope along what was
fitted:

    c = dr/dv                                             0 if within the scatter of the model
    gain = (c'r)^2 / (1 + c'c - c'J (J'J + 1)^-1 J'c)     by which the cost falls if v is fitted, too, and u again

What the fitted parameters could take over they have taken: only what they cannot imitate counts. A law is named if it
takes ENOUGH of the excess of chi-square away; those that take nearly as much are named with it, since these data do not
tell them apart (many/17).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isel_twin.base.crew import Crew
from isel_twin.base.parameters import rows
from isel_twin.many.identification.model import STEP, Floats, Model
from isel_twin.many.identification.unknowns import Unknown, changes, unknown

LAWS = {  # numbers of an axis, and what each stands for
    "specimen.torque_constant": "another motor",
    "specimen.iron_loss": "the motor's iron loss",
    "specimen.rotor_inertia": "another rotor",
    "guide_friction": "dry friction of the guide",
    "shaft_coulomb": "dry friction of the screw",
    "shaft_viscous": "viscous friction",
    "stribeck_speed": "friction that falls with speed",
    "lead_error": "an error of the lead",
}
WIDE = 1.5 * STEP
ENOUGH = 0.5  # part of the excess of chi-square that a law must take away to be named
NEARLY = 0.8  # of the best one's part, from which on another is alike


@dataclass(frozen=True)
class Suspect:
    """A number that was not fitted and would explain what is left."""

    key: str  # of the machine file
    law: str
    share: float  # of the excess of chi-square that it takes away, at most 1


def suspects(model: Model, u: Floats, jacobian: Floats, crew: Crew | None = None) -> tuple[tuple[Suspect, ...], int]:
    """The suspects at u, the likeliest first, and how many replays that took. jacobian: of what was fitted, there."""
    added = _candidates(model, u)
    if not added:
        return (), 0
    wider = Model(model.machine, [*model.unknowns, *(item for item, _ in added)], model.sessions, crew)
    base = np.concatenate((u, np.zeros(len(added))))
    ways = WIDE * np.eye(len(base))[len(u) :]
    points = [point for way in ways for point in (base + way, base - way)]
    found = [wider.residuals(one) for one in wider.predictions(points)]
    here = model.residuals_at(u)
    excess = float(here @ here) - model.freedom(here)
    inner = np.linalg.inv(jacobian.T @ jacobian + np.eye(len(u)))
    told = []
    for (item, law), ahead, back in zip(added, found[::2], found[1::2], strict=True):
        column = wider.told(ahead - back) / (2.0 * WIDE)
        along = jacobian.T @ column
        gain = float(column @ here) ** 2 / (1.0 + float(column @ column) - float(along @ inner @ along))
        told.append(Suspect(item.keys[0], law, min(1.0, gain / excess)))
    told.sort(key=lambda one: -one.share)
    named = [one for one in told if one.share >= max(ENOUGH, NEARLY * told[0].share)]
    return tuple(named), wider.replays


def _candidates(model: Model, u: Floats) -> list[tuple[Unknown, str]]:
    """The numbers that could explain something, with a prior of half to twice what they are at u, and their laws."""
    machine = model.machine
    axes = dict.fromkeys(axis for session in model.sessions for axis in session.measured.axes)
    fitted = {key for item in model.unknowns if len(item.keys) == 1 for key in item.keys}
    now = {row.parameter: float(row.value) for row in rows(machine.tree) if isinstance(row.value, int | float)}
    now |= changes(machine, model.unknowns, model.values(u))
    found = []
    for axis in axes:
        for part, law in LAWS.items():
            key = f"axes.{axis}.{part}"
            if key in fitted or not now.get(key):
                continue
            if part == "lead_error":
                found.append((unknown(machine, f"lead.{axis}"), law))
            else:
                span = (0.5 * now[key], 2.0 * now[key])
                found.append((replace(unknown(machine, key, span), prior=now[key]), law))
    return found
