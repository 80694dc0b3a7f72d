"""Chooses the most informative blocks of moves, one after the other.

The information of a block is its Jacobian J_b (model.py) on the machine as it is believed to be, in standard deviations
of the data. A greedy choice takes the block that, with those before it, leaves the least uncertainty:

    C <- (C^-1 + J_b' J_b)^-1        D: least det C        E: least largest eigenvalue of C

C begins as the prior, 1, or as the covariance of an identification (`--known`). The same block may be taken, and
measured, again. For D the greedy choice is within 1 - 1/e of the best one (the gain is submodular), without a search.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.crew import Crew
from isel_twin.language import create_language, needed
from isel_twin.machine import Machine
from isel_twin.many.identification.experiment import Block, assemble
from isel_twin.many.identification.model import Model
from isel_twin.many.identification.replays import Replays
from isel_twin.many.identification.session import session_of
from isel_twin.many.identification.stand_in import carry_out
from isel_twin.many.identification.unknowns import Unknown


@dataclass(frozen=True)
class Choice:
    blocks: tuple[Block, ...]
    left: tuple[tuple[float, ...], ...]  # after each block, by parameter: standard deviation over that of the prior


def choose(
    machine: Machine,
    controller: str,
    candidates: Sequence[Block],
    unknowns: Sequence[Unknown],
    count: int,
    *,
    known: NDArray[np.float64] | None = None,
    criterion: str = "D",
    crew: Crew | None = None,
) -> Choice:
    """The best `count` blocks, one after the other; known: covariance [n, n] of the u so far."""
    language = needed(create_language(controller), controller)
    information = np.linalg.inv(np.eye(len(unknowns)) if known is None else known)
    told = []
    for block in candidates:
        experiment = assemble("block", [block], language)
        recorded, measured = carry_out(experiment, machine, controller, seed=0, noise_mm=0.0, time_noise_s=0.0)
        session = session_of(recorded, measured, controller, machine)
        model = Model(machine, unknowns, [session], Replays(crew))
        jacobian = model.jacobian(np.zeros(len(unknowns)), central=False)
        told.append(jacobian.T @ jacobian)
    chosen, left = [], []
    for _ in range(count):
        worth = [
            -math.inf if block.stall is not None and block in chosen else _worth(information + one, criterion)
            for block, one in zip(candidates, told, strict=True)
        ]  # the same series gives no new information
        best = int(np.argmax(worth))
        information = information + told[best]
        chosen.append(candidates[best])
        left.append(tuple(np.sqrt(np.diag(np.linalg.inv(information))).tolist()))
    return Choice(tuple(chosen), tuple(left))


def _worth(information: NDArray[np.float64], criterion: str) -> float:
    """The criterion to maximise: log det, or the least eigenvalue."""
    if criterion == "E":
        return float(np.linalg.eigvalsh(information)[0])
    return float(np.linalg.slogdet(information)[1])
