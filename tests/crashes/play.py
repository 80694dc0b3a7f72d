"""A world on both plants: what was told, and what should have been."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.machine import load_machine, with_fixtures
from isel_twin.plant import Collision
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.plant.mujoco import MujocoPlant

from .world import World

SETTLE_NS = 50_000_000
STEP_NS = 500_000  # of MuJoCo
NEAR_NS = 200_000_000


@dataclass(frozen=True)
class Seen:
    """The first collision that a plant told, and what closed forms say of the way it went."""

    told: Collision | None
    who: str  # "" if nothing was met
    time_ns: float
    late_ns: float  # told after that; nan if one of the two is missing

    def holds(self, most_ns: float) -> bool:
        if self.told is None or not self.who:
            return self.told is None and not self.who
        return self.told.first == self.who and abs(self.late_ns) <= most_ns


def ticks(world: World) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """At constant frequency, the axes led by the one that goes farthest."""
    most = max(map(abs, world.steps))
    k = np.arange(most + 1)
    made = np.array([np.sign(n) * ((2 * k * abs(n) + most) // (2 * most)) for n in world.steps]).T
    delta = np.zeros((most, 4), dtype=np.int8)
    delta[:, :3] = np.diff(made, axis=0)
    return SETTLE_NS + np.round(k[1:] * 1e9 / world.hz).astype(np.int64), delta


def kinematic(world: World) -> Seen:
    """What is true follows from the ticks alone: the first at which the two are not apart."""
    t_ns, delta = ticks(world)
    path_mm = np.array(world.start_mm) + np.cumsum(delta[:, :3], axis=0, dtype=np.int64) / 320.0
    first = world.first(path_mm)
    plant = KinematicPlant(with_fixtures(load_machine("4030"), (world.fixture,)), [], np.array(world.start_mm))
    until_ns, told = int(t_ns[-1]) + SETTLE_NS, []
    while (reached := plant.advance(until_ns, t_ns, delta)) < until_ns:
        told += plant.take_collisions()
        t_ns, delta = t_ns[t_ns > reached], delta[t_ns > reached]
    return _seen(told, None if first is None else (float(ticks(world)[0][math.ceil(first[0])]), first[1]))


def physical(world: World) -> Seen:
    """What is true follows from where the machine went, step by step of MuJoCo where they should meet: motors swing,
    and a step is not a place."""
    plant = MujocoPlant(with_fixtures(load_machine("4030"), (world.fixture,)), [], np.array(world.start_mm))
    plant.set_power(True, True, False)
    t_ns, delta = ticks(world)
    looks_ns = _looks_ns(world, t_ns, delta)
    path_mm, told, ahead = np.empty((len(looks_ns), 3)), [], 0
    for row, until_ns in enumerate(looks_ns.tolist()):
        last = int(np.searchsorted(t_ns, until_ns, side="right"))
        reached = ahead
        while (now_ns := plant.advance(until_ns, t_ns[reached:last], delta[reached:last])) < until_ns:
            told += plant.take_collisions()
            reached = int(np.searchsorted(t_ns, now_ns, side="right"))
        told += plant.take_collisions()
        ahead = last
        path_mm[row] = plant.shape_mm @ plant.data.qpos
    first = world.first(path_mm)
    if first is None:
        return _seen(told, None)
    return _seen(told, (float(np.interp(first[0], np.arange(len(looks_ns)), looks_ns.astype(float))), first[1]))


def _looks_ns(world: World, t_ns: NDArray[np.int64], delta: NDArray[np.int8]) -> NDArray[np.int64]:
    """Every step of MuJoCo within NEAR_NS of the tick at which they should meet, every tenth before that; where they
    should not meet, every tenth to the end."""
    end_ns = int(t_ns[-1]) + SETTLE_NS
    first = world.first(np.array(world.start_mm) + np.cumsum(delta[:, :3], axis=0, dtype=np.int64) / 320.0)
    if first is None:
        return np.arange(10 * STEP_NS, end_ns, 10 * STEP_NS)
    meet_ns = int(t_ns[math.ceil(first[0])]) // (10 * STEP_NS) * 10 * STEP_NS
    begin_ns = max(meet_ns - NEAR_NS, 0)
    far = np.arange(10 * STEP_NS, begin_ns, 10 * STEP_NS)
    return np.concatenate([far, np.arange(begin_ns + STEP_NS, min(meet_ns + NEAR_NS, end_ns), STEP_NS)])


def _seen(told: list[Collision], true: tuple[float, str] | None) -> Seen:
    first = told[0] if told else None
    if true is None:
        return Seen(first, "", math.nan, math.nan)
    return Seen(first, true[1], true[0], math.nan if first is None else first.time_ns - true[0])
