"""A fixture on the table, a straight way of the tool, and by closed forms how far they are from each other.

The tool of the 4030 is two upright cylinders, one on the other: a cutter of 6 x 18 mm and a spindle of 66 x 260 mm
(models/4030/README.md). Its tip is HIGH_MM above the table where Z is 0. A fixture is an upright box, turned, or an
upright cylinder. So the distance of two of them is that of two figures in the plane, and of two heights:

    d = hypot(max(0, plane), max(0, height))      plane: distance of the figures, height: of the ends, below 0: within

Who meets first, and where on the way, is found by halving it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.machine import Fixture

HIGH_MM = 147.0
TRAVEL_MM = (395.0, 300.0, 140.0)
STEPS_PER_MM = 320
TOOL = {"cutter": (3.0, 0.0, 18.0), "spindle": (33.0, 18.0, 278.0)}
"""Radius of each part, and how high above the tip it begins and ends, mm."""
NEAR_MM = 0.1
TOUCH_MM = 1e-6  # who is a nanometre apart touches: rounding


@dataclass(frozen=True)
class World:
    fixture: Fixture
    start_mm: tuple[float, float, float]
    steps: tuple[int, int, int]  # of the way, straight
    hz: float  # of the axis with most of them, all the way: no ramp

    @property
    def ways_mm(self) -> NDArray[np.float64]:
        return np.array(self.steps) / STEPS_PER_MM

    def apart_mm(self, name: str, places_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [n], from a part of the tool to the fixture with the carriages there [n, 3]; below 0: so deep in each
        other."""
        radius, low, high = TOOL[name]
        tip_mm = HIGH_MM - places_mm[:, 2]
        foot_mm = self.fixture.at_mm[2]
        height = np.maximum(tip_mm + low - (foot_mm + self.fixture.size_mm[-1]), foot_mm - (tip_mm + high))
        across = places_mm[:, :2] - np.array(self.fixture.at_mm[:2])
        if self.fixture.shape == "cylinder":
            plane = np.hypot(*across.T) - 0.5 * self.fixture.size_mm[0]
        else:
            turn = math.radians(self.fixture.turn_deg)
            there = np.abs(across @ np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]))
            beyond = there - 0.5 * np.array(self.fixture.size_mm[:2])
            plane = np.where((beyond > 0.0).any(axis=1), np.hypot(*np.maximum(beyond, 0.0).T), beyond.max(axis=1))
        plane = plane - radius
        outside = np.hypot(np.maximum(plane, 0.0), np.maximum(height, 0.0))
        return np.where((plane > 0.0) | (height > 0.0), outside, np.maximum(plane, height))

    def first(self, places_mm: NDArray[np.float64]) -> tuple[float, str] | None:
        """At which row of a path [n, 3], straight between its rows, two meet first, as a fraction, and who."""
        found = []
        for name in TOOL:
            met = self.apart_mm(name, places_mm) <= TOUCH_MM
            if not met.any():
                continue
            row = int(met.argmax())
            low, high = 0.0, 1.0
            ends = places_mm[max(0, row - 1)], places_mm[row]
            for _ in range(40):
                middle = 0.5 * (low + high)
                within = self.apart_mm(name, (ends[0] + middle * (ends[1] - ends[0]))[None])[0] <= TOUCH_MM
                low, high = (low, middle) if within else (middle, high)
            found.append((max(0.0, row - 1 + high), name))
        return min(found, default=None)

    @property
    def begins_mm(self) -> float:
        """Distance at the start."""
        return min(float(self.apart_mm(name, np.array([self.start_mm]))[0]) for name in TOOL)

    def least_mm(self) -> float:
        """Of all places on the way."""
        along = np.linspace(0.0, 1.0, 4001)[:, None] * self.ways_mm + np.array(self.start_mm)
        return min(float(self.apart_mm(name, along).min()) for name in TOOL)


def _fixture(random: np.random.Generator) -> Fixture:
    x, y = random.uniform(120.0, 280.0), random.uniform(100.0, 200.0)
    high = random.uniform(15.0, 90.0)
    at_mm = (x, y, float(random.choice([0.0, 0.0, 10.0])))
    if random.random() < 0.3:
        return Fixture("post", "cylinder", (random.uniform(4.0, 60.0), high), at_mm)
    size_mm = random.uniform(4.0, 90.0), random.uniform(4.0, 60.0), high
    return Fixture("jaw", "box", size_mm, at_mm, float(random.choice([0.0, 0.0, 30.0, random.uniform(-180.0, 180.0)])))


def crash(seed: int) -> World:
    """The tool sets out apart from the fixture and strikes it."""
    random = np.random.default_rng([seed, 1])
    while True:
        fixture = _fixture(random)
        top_mm = fixture.at_mm[2] + fixture.size_mm[-1]
        tip_mm = random.uniform(max(8.0, top_mm - 30.0), top_mm + 30.0)
        start = np.array([*(np.array(fixture.at_mm[:2]) + random.uniform(-90.0, 90.0, 2)), HIGH_MM - tip_mm])
        goal = np.array([*(np.array(fixture.at_mm[:2]) + random.uniform(-20.0, 20.0, 2)), HIGH_MM - top_mm + 5.0])
        kind = random.integers(3)
        if kind == 0:
            goal[2] = start[2]
        elif kind == 1:
            goal[:2] = start[:2] = goal[:2]
        way = goal - start
        way *= min(1.0, 30.0 / float(np.linalg.norm(way)))
        start = goal - way
        world = World(fixture, tuple(start.tolist()), _steps(way), float(random.uniform(400.0, 1400.0)))
        if _fits(world) and world.least_mm() < -0.2 and world.begins_mm > 1.0:
            return world


def near_miss(seed: int) -> World:
    """The tool passes the fixture along one axis, and comes as near as NEAR_MM."""
    random = np.random.default_rng([seed, 2])
    while True:
        fixture = _fixture(random)
        world = _passing(fixture, random)
        if world is None:
            continue
        if _fits(world) and abs(world.least_mm() - NEAR_MM) < 1e-3:
            return world


def _passing(fixture: Fixture, random: np.random.Generator) -> World | None:
    """A way above the fixture or beside it; None if there is none."""
    axis = int(random.integers(2))
    way = np.zeros(3)
    way[axis] = 30.0 * random.choice([-1.0, 1.0])
    middle = np.array([*fixture.at_mm[:2], HIGH_MM - (fixture.at_mm[2] + fixture.size_mm[-1])])
    if random.random() < 0.5:
        middle[2] -= NEAR_MM
        middle[:2] += random.uniform(-2.0, 2.0, 2)
    else:
        middle[2] += random.uniform(1.0, 12.0)
        if middle[2] > HIGH_MM - 5.0:
            return None
        if fixture.shape == "cylinder":
            half = 0.5 * fixture.size_mm[0]
        elif fixture.turn_deg == 0.0:
            half = 0.5 * fixture.size_mm[1 - axis]
        else:
            return None
        middle[1 - axis] += random.choice([-1.0, 1.0]) * (half + TOOL["cutter"][0] + NEAR_MM)
    start = middle - 0.5 * way
    return World(fixture, tuple(start.tolist()), _steps(way), float(random.uniform(400.0, 1400.0)))


def _steps(way_mm: NDArray[np.float64]) -> tuple[int, int, int]:
    x, y, z = (round(mm * STEPS_PER_MM) for mm in way_mm)
    return x, y, z


def _fits(world: World) -> bool:
    ends = np.array([world.start_mm, np.array(world.start_mm) + world.ways_mm])
    return bool((ends > 1.0).all() and (ends < np.array(TRAVEL_MM) - 1.0).all()) and max(map(abs, world.steps)) > 1000
