"""What the law of iron loss and supply misses on a motor on which it was not fitted: the band of `isel-twin motor`.

Each motor with a maker's curve is left out in turn and the three numbers of the law are fitted on the others; curve C
is never fitted on. A number is held near what physics says it is (iron loss and knee within 35 %, supply factor within
10 %), as one curve cannot tell them apart.

    python -m pytest tests/drives/test_left_out.py -s      shows the misses
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pytest
from drives.published import CURVE_C, CURVE_D, DRIVE_C, DRIVE_D, POINTS, dm542t
from numpy.typing import NDArray

from isel_twin.drives.curves import pull_out_prediction, pull_out_torque
from isel_twin.drives.library import MOTORS
from isel_twin.drives.motor import IRON_KNEE_RAD_S, IRON_LOSS, Motor
from isel_twin.drives.report import BANDS, band
from isel_twin.drives.stage import Stage

Point: TypeAlias = tuple[Motor, Stage, float, float]  # motor, stage, rev/min, N m of the maker

_NEMA23, _NEMA17, _NEMA14 = (MOTORS[name] for name in ("23HS32-4004S", "17HS19-2004S", "14HS17-0504S"))
A: list[Point] = [(_NEMA23, dm542t(volt), rpm, nm) for volt, rpm, nm in POINTS]
D: list[Point] = [(_NEMA17, DRIVE_D, rpm, nm) for rpm, nm in CURVE_D.items()]
C: list[Point] = [(_NEMA14, DRIVE_C, rate * 60 / 400, gcm * 9.80665e-5) for rate, gcm in CURVE_C.items()]
KNOWN = np.log([IRON_LOSS, IRON_KNEE_RAD_S, 0.82])
WITHIN = np.array([0.35, 0.35, 0.10])
CURVE = 0.05  # accuracy of a maker's point


def misses(
    points: list[Point], law: NDArray[np.float64], torque: Callable[[Motor, Stage, float], float]
) -> NDArray[np.float64]:
    loss, knee, factor = np.exp(law)

    def one(motor: Motor, stage: Stage, rpm: float, nm: float) -> float:
        iron_ohm = loss * motor.inductance_h ** (2 / 3) * motor.resistance_ohm ** (1 / 3)
        lossy = replace(motor, iron_loss_ohm=iron_ohm, iron_knee_rad_s=knee / motor.pole_pairs)
        return torque(lossy, replace(stage, supply_factor=min(1.0, factor)), rpm) / nm - 1.0

    return np.array([one(*point) for point in points])


def fitted(points: list[Point]) -> NDArray[np.float64]:
    from scipy.optimize import least_squares

    def residuals(law: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([misses(points, law, pull_out_prediction) / CURVE, (law - KNOWN) / WITHIN])

    law: NDArray[np.float64] = least_squares(residuals, KNOWN).x
    return law


@pytest.mark.parametrize(("left_out", "others"), [(A, D), (D, A), (C, A + D)], ids=["A", "D", "C"])
def test_a_motor_left_out_lies_within_its_band(left_out: list[Point], others: list[Point]) -> None:
    missed = np.abs(misses(left_out, fitted(others), pull_out_torque))
    told = [band(motor, stage, rpm) for motor, stage, rpm, _ in left_out]
    for (_, stage, rpm, _), miss in zip(left_out, missed, strict=True):
        print(f"{stage.supply_v:g} V {rpm:.0f} rev/min: {100 * miss:.0f} %")
    assert all(given is not None and miss <= given for miss, given in zip(missed, told, strict=True))


def test_the_bands_are_no_wider_than_needed() -> None:
    """In each range of speed some motor that was left out came near its edge."""
    found: dict[float, float] = {}
    for left_out, others in ((A, D), (D, A), (C, A + D)):
        missed = np.abs(misses(left_out, fitted(others), pull_out_torque))
        for (motor, stage, rpm, _), miss in zip(left_out, missed, strict=True):
            told = band(motor, stage, rpm) or 0.0
            found[told] = max(found.get(told, 0.0), float(miss))
    assert {told: miss > 0.75 * told for told, miss in found.items()} == {told: True for _, told in BANDS}


def test_beyond_what_was_compared_there_is_no_band() -> None:
    assert band(_NEMA23, dm542t(48), 3000) is None
