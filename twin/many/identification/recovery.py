"""Can the fit find back what these data are said to tell? A gate for each family of parameters before it is promoted.

A family is what is named alike: friction of all axes, backlash of all axes, the supply. Its parameters are moved by
AWAY of the prior's deviation (towards the prior), and the data that the model then predicts stand for measured ones.
From the result u the search looks for them, by the Jacobian J at u, STEPS times:

    u <- u + (J'J + 1)^-1 (J'(y - p(u)) - (u - u_prior))       both of the data in standard deviations

A family that is not where it was put, within what its interval allows and TOLERANCE of the way, is not recovered: the
straight line that its interval rests on is no line there (lost steps, a nut that never crosses its play). Its numbers
are `fitted` then. Three replays a family; those that are known only roughly are no candidates and are not tried.
"""

from __future__ import annotations

import numpy as np

from isel_twin.machine.spread import NORMAL_95
from isel_twin.many.identification.model import WEAK, Floats, Model

AWAY = 1.0
STEPS = 2
TOLERANCE = 0.25  # of the way, beside the interval


def unrecovered(model: Model, u: Floats, jacobian: Floats, deviation: Floats) -> tuple[str, ...]:
    """Families that are not found back; deviation: of the u after the fit, of the first ones, which were asked for."""
    families: dict[str, list[int]] = {}
    for at, item in enumerate(model.unknowns[: len(deviation)]):
        if deviation[at] < WEAK:
            families.setdefault(family(item.name), []).append(at)
    inner = np.linalg.inv(jacobian.T @ jacobian + np.eye(len(u)))
    lost = []
    for name, members in families.items():
        put = u.copy()
        put[members] -= AWAY * np.where(u[members] >= 0.0, 1.0, -1.0)
        (wanted,) = model.predictions([put])
        now = u.copy()
        for _ in range(STEPS):
            apart = model.between(wanted, model.predictions([now])[0])
            now = now - inner @ (jacobian.T @ apart + (now - put))
        missed = np.abs(now - put)[members]
        if not np.isfinite(missed).all() or (missed > TOLERANCE * AWAY + NORMAL_95 * deviation[members]).any():
            lost.append(name)
    return tuple(lost)


def family(name: str) -> str:
    """The family of a parameter: friction of friction.x, guide_friction of axes.x.guide_friction."""
    first, _, rest = name.partition(".")
    return rest.rpartition(".")[2] if first in ("axes", "structure", "contacts", "controller") else first
