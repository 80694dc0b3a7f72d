"""What gives way where it is touched: a touch probe in the spindle, or a plate for tool lengths on the table.

Goal: the contact changes at the sub-step in which the deflection says so, from whatever side it was touched. Law and
distances are in touch.h. A stylus weighs a few grams, so its spring pushes on the tool as it stands, and back on the
table; the forces go to MuJoCo's joints like those of a cut. The shapes are MuJoCo's, too: they are seen, and the stem
collides.

On the kinematic plant the same without forces: `Felt` searches the path.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.machine import Machine, Probe
from isel_twin.machine.fixture import CUTTER, Fixture
from isel_twin.native import core, record
from isel_twin.plant.collision import Collision

FEELER = record(
    "FEELER",
    [
        ("on", "i8"),
        ("broken", "i8"),  # 1: it gave way too far; 2: and nobody has been told
        ("at", "i8"),  # the nearest target
        ("radius_m", "f8"),  # of the ball
        ("below_m", "f8"),  # of its middle under the tool of the model
        ("pretravel_m", "f8"),
        ("lobing_m", "f8"),
        ("over_m", "f8"),
        ("force_n", "f8"),
        ("force_z_n", "f8"),
        ("rate_n_per_m", "f8"),
        ("deflected_m", "f8"),  # less what it is more by the lobing in this direction
        ("push_n", "f8", (3,)),  # on the tool, machine coordinates
        ("sum_n", "f8", (3,)),  # of this window
        ("mean_n", "f8", (3,)),  # in the window before
    ],
)
BOX, CYLINDER, RING, PLANE = 0, 1, 2, 3
_KINDS = {"box": BOX, "cylinder": CYLINDER, "ring": RING}
TARGET = record(
    "TARGET",
    [
        ("kind", "i8"),
        ("x_m", "f8"),  # of its middle, in machine coordinates of the tool's point
        ("y_m", "f8"),
        ("z_m", "f8"),
        ("a_m", "f8"),  # box: half sizes; others: outer radius, inner radius, half the height
        ("b_m", "f8"),
        ("c_m", "f8"),
        ("cosine", "f8"),
        ("sine", "f8"),
    ],
)
NEWS = 2  # of `broken`
IN_C = ("BOX", "RING", "PLANE", "NEWS")  # records.h has them, too
EXACT_MM = 1e-6  # to which a place between two others is found


def feelers(machine: Machine) -> NDArray[np.void]:
    """FEELER [1] of a machine; off if nothing on it feels."""
    record, law = np.zeros(1, FEELER), machine.feeler
    if law is None:
        return record
    record["on"] = 1
    if isinstance(law, Probe):
        record["radius_m"] = 0.5e-3 * law.ball_mm
        record["below_m"] = 1e-3 * law.reach_mm - record["radius_m"]
        record["lobing_m"] = 1e-3 * law.lobing_mm
    record["pretravel_m"], record["over_m"] = 1e-3 * law.pretravel_mm, 1e-3 * law.overtravel_mm
    record["force_n"], record["force_z_n"], record["rate_n_per_m"] = law.force_n, law.force_z_n, law.rate_n_per_m
    return record


def felt(machine: Machine) -> tuple[Fixture | None, ...]:
    """What the feeler of a machine can touch: fixtures that are no meshes, None for the table."""
    if isinstance(machine.feeler, Probe):
        return (*(one for one in machine.fixtures if one.shape in _KINDS), None)
    return tuple(one for one in machine.fixtures if one.plate and machine.feeler is not None)


def targets(machine: Machine, table_mm: float, cutter_mm: float) -> NDArray[np.void]:
    """TARGET [n] in the order of `felt`. table_mm: Z of the tool's point on the table, machine coordinates; cutter_mm:
    radius of the cutter, whose end touches plates."""
    found = felt(machine)
    wider_m = 0.0 if isinstance(machine.feeler, Probe) else 1e-3 * cutter_mm
    targets = np.zeros(len(found), TARGET)
    for target, one in zip(targets, found, strict=True):
        target["cosine"], target["z_m"] = 1.0, 1e-3 * table_mm
        if one is None:
            target["kind"] = PLANE
            continue
        target["kind"] = _KINDS[one.shape]
        target["x_m"], target["y_m"] = 1e-3 * one.at_mm[0], 1e-3 * one.at_mm[1]
        target["c_m"] = 0.5e-3 * one.size_mm[-1]
        target["z_m"] -= 1e-3 * one.at_mm[2] + target["c_m"]
        target["a_m"] = 0.5e-3 * one.size_mm[0] + wider_m
        target["b_m"] = 0.5e-3 * one.size_mm[1] + wider_m
        turn = math.radians(one.turn_deg)
        target["cosine"], target["sine"] = math.cos(turn), math.sin(turn)
    return targets


def crash(machine: Machine, at: int, place_mm: NDArray[np.float64], time_ns: int, speed_mm_s: float) -> Collision:
    """The feeler breaks at the target of that number. Its force is not known: it was made for less."""
    target = felt(machine)[at]
    names = "probe" if isinstance(machine.feeler, Probe) else CUTTER, "table" if target is None else target.name
    x, y, z = place_mm.tolist()
    return Collision(*names, (x, y, z), time_ns, speed_mm_s, None)


class Felt:
    """The feeler of a machine whose carriages go where they are told."""

    def __init__(self, machine: Machine, records: NDArray[np.void], limit_mm: float, hysteresis_mm: float) -> None:
        """records: TARGET [n]; limit_mm, hysteresis_mm: of the contact, as a threshold has them."""
        self.record, self._targets = feelers(machine), records
        self.limit_mm, self._hysteresis_mm = limit_mm, hysteresis_mm
        self.touched = False

    def first(self, path_mm: NDArray[np.float64]) -> int:
        """The first place of a path [n, 3] at which the contact changes or the feeler breaks; n: none."""
        return int(self._first(self.record.copy(), path_mm))

    def take(self, place_mm: NDArray[np.float64]) -> bool:
        """Be at this place [3]; return whether the contact has changed, or the feeler has just broken."""
        if self._first(self.record, place_mm[None]) == 1:
            return False
        self.touched = bool(self.record["deflected_m"][0] > self._threshold_m)
        return True

    def share(self, ends_mm: NDArray[np.float64]) -> float:
        """Which part of a straight way [2, 3] is over when that happens, which happens on it."""
        before, after = 0.0, 1.0
        while (after - before) * np.linalg.norm(ends_mm[1] - ends_mm[0]) > EXACT_MM:
            middle = 0.5 * (before + after)
            changed = self.first((ends_mm[0] + middle * (ends_mm[1] - ends_mm[0]))[None]) == 0
            before, after = (before, middle) if changed else (middle, after)
        return after

    @property
    def _threshold_m(self) -> float:
        return 1e-3 * (self.limit_mm - (self._hysteresis_mm if self.touched else 0.0))

    def _first(self, record: NDArray[np.void], path_mm: NDArray[np.float64]) -> Any:
        path_mm = np.ascontiguousarray(path_mm, np.float64)
        return core.first_felt(record, self._targets, path_mm, self._threshold_m, self.touched)
