"""Machines, gauges and people that differ from the model in a way that no parameter of a fit is: twenty effects.

    numbers of the machine file that nobody fits        as factors, or as they are
    a guide that rubs as no number says                 more newton on each command, by direction, speed, place or time
    a gauge, a nut, a frame, a person                   what is read, or how hard is pulled, is altered

Each has a size, of which a machine has half to one and a half. The numbers sought stay what they were drawn as: of a
friction that varies its mean, of springs in series and of frictions that add up the sum.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from unittest.mock import patch

import numpy as np

from isel_twin.core.twin import Twin
from isel_twin.machine import Machine, with_overrides
from isel_twin.machine.spread import numbers
from isel_twin.many.identification import stand_in
from isel_twin.many.identification.experiment import Experiment
from isel_twin.many.identification.measured import Measured, Reading
from isel_twin.recordings.reading import Recorded

CREEP_HZ = 7000  # moves up to here creep, coasts do not
SOFT_N = 50.0  # force at which a soft nut has seated to 63 %
RUBBED_N = 30.0  # by which a carriage that has come to rest holds its nut


@dataclass(frozen=True)
class Rub:
    """A move that a guide may rub at."""

    way: int  # 1 upwards, -1 downwards
    speed_hz: int
    mm: float  # where it ends
    part: float  # of the day that is over


@dataclass(frozen=True)
class Effect:
    """One way to be unlike the model, by a size."""

    name: str
    size: float = 1.0
    factors: dict[str, float] = field(default_factory=dict)  # of a key, at this size: 1 + size (factor - 1)
    as_is: dict[str, Any] = field(default_factory=dict)
    rubs: Callable[[Rub], float] | None = None  # of the guide's friction
    reads: Callable[[Reading, Reading | None, int], float] | None = None  # mm more, of it, the one before, the how many
    pulls: float = 0.0  # of the force, more


def _way(reading: Reading, last: Reading | None, at: int) -> int:
    """Where the reading's load comes from: pulled, or stopped after a move upwards (every other reversal)."""
    return int(np.sign(reading.push_n)) if reading.push_n else -1 if at % 2 == 0 else 1


def _soft(reading: Reading, last: Reading | None, at: int) -> float:
    load_n = abs(reading.push_n) or RUBBED_N
    return 0.0 if reading.counter_mm is not None else _way(reading, last, at) * 0.008 * (1.0 - np.exp(-load_n / SOFT_N))


def _kept(reading: Reading, last: Reading | None, at: int) -> float:
    return 0.006 * float(np.sign(reading.push_n))


def _sticks(reading: Reading, last: Reading | None, at: int) -> float:
    """Behind by 3 um: a pull upwards is read as less, and so is a way downwards."""
    behind = -_way(reading, last, at) if reading.push_n else _way(reading, last, at)
    return 0.0 if reading.counter_mm is not None else 0.003 * behind


def _long(reading: Reading, last: Reading | None, at: int) -> float:
    return 0.0 if reading.counter_mm is not None else 0.04 * (reading.mm - 1.0)


def _strays(reading: Reading, last: Reading | None, at: int) -> float:
    """One in eight readings is off by 20 um."""
    draw = np.random.default_rng([round(1e6 * abs(reading.mm)), 3])
    return float(draw.choice([-0.02, 0.02])) if draw.random() < 0.125 else 0.0


NONE = Effect("none")
EFFECTS = (
    Effect("a nut whose friction rises when slow", factors={"axes.x.breakaway": 1.8, "axes.x.stribeck_speed": 5.0}),
    Effect("a guide whose friction rises when slow", rubs=lambda rub: 0.5 * (rub.speed_hz < CREEP_HZ)),
    Effect("friction that differs with direction", rubs=lambda rub: 0.4 * rub.way),
    Effect("friction that differs with place", rubs=lambda rub: 0.4 * np.sin(rub.mm / 10.0)),
    Effect("friction that falls through the day", rubs=lambda rub: 0.4 * (1.0 - 2.0 * rub.part)),
    Effect("a nut softer at small force", reads=_soft),
    Effect("a frame that keeps 12 um", reads=_kept),
    Effect("a gauge that sticks by 3 um", reads=_sticks),
    Effect("a gauge that shows 4 % too much", reads=_long),
    Effect("a gauge that drifts by 1 um a reading", reads=lambda reading, last, at: 0.001 * at),
    Effect("a gauge that strays", reads=_strays),
    Effect("a spring scale that shows 5 % too little", pulls=0.05),
    Effect("another motor", as_is={"axes.x.motor": "QSH6018-86-28-310"}),
    Effect("a stage that gives 12 % less current", factors={"axes.x.stage.current": 0.88}),
    Effect("a motor that loses three times as much iron", factors={"axes.x.specimen.iron_loss": 3.0}),
    Effect(
        "a screw with a cyclic error of 8 um",
        as_is={"imperfections.cyclic_error": True},
        factors={"axes.x.cyclic_error": 2.0},
    ),
    Effect("a screw that is warm", as_is={"imperfections.growth": True}, factors={"axes.x.screw_warming": 3.0}),
    Effect("more damping", factors={"axes.x.damping": 3.0, "structure.flex_x.damping_ratio": 3.0}),
    Effect(
        "a guide that rubs more and a nut that rubs less",
        factors={"axes.x.guide_friction": 2.0, "axes.x.shaft_coulomb": 0.735},
    ),
    Effect(
        "a screw that is softer and a frame that is stiffer",
        factors={"axes.x.stiffness": 0.6, "structure.flex_x.stiffness": 1.125},
    ),
)


def effect_of(number: int) -> Effect:
    """That of the machine of this number, each in turn, from half to one and a half of its size."""
    return replace(EFFECTS[number % len(EFFECTS)], size=float(np.random.default_rng([number, 31]).uniform(0.5, 1.5)))


def changed(machine: Machine, effect: Effect) -> Machine:
    """The machine with the effect's numbers."""
    values = {key: float(entry["value"]) for key, entry in numbers(machine.tree)}
    more = {key: values[key] * (1.0 + effect.size * (by - 1.0)) for key, by in effect.factors.items()}
    return with_overrides(machine, {**effect.as_is, **more})


def carry_out(
    effect: Effect, experiment: Experiment, machine: Machine, controller: str, **noise: Any
) -> tuple[Recorded, Measured]:
    """As `stand_in.carry_out`, at a machine that is unlike its model."""
    commands, guide_n = len(experiment.steps), machine.axes[0].guide_friction_n

    class Unlike(Twin):
        at = 0
        steps = 0

        def write(self, data: bytes) -> None:
            move = re.match(rb"@0M(-?\d+),(\d+)", data)
            if move and effect.rubs is not None:
                target, speed_hz = int(move[1]), int(move[2])
                way = (target > self.steps) - (target < self.steps)
                rub = Rub(way, speed_hz, target * float(self.step_mm[0]), self.at / commands)
                self._plant.set_friction(0, effect.size * effect.rubs(rub) * guide_n)
                self.steps = target
            self.at += 1
            super().write(data)

        def apply_force(self, axis: int, force_n: float, at: str = "tool") -> None:
            super().apply_force(axis, force_n * (1.0 + effect.size * effect.pulls), at)

    with patch.object(stand_in, "Twin", Unlike):
        recorded, measured = stand_in.carry_out(experiment, changed(machine, effect), controller, **noise)
    return recorded, replace(measured, readings=_read(effect, measured.readings))


def _read(effect: Effect, readings: Sequence[Reading]) -> tuple[Reading, ...]:
    if effect.reads is None:
        return tuple(readings)
    found: list[Reading] = []
    last: Reading | None = None
    at = 0
    for one in readings:
        at = at + 1 if last is not None and last.gauge == one.gauge else 0
        found.append(replace(one, mm=one.mm + effect.size * effect.reads(one, last, at)))
        last = one
    return tuple(found)
