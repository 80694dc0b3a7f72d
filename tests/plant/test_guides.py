"""Guides that are not straight: bows, and turns by their arms, as closed forms at places of rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from isel_twin.machine import Machine, MachineError, load_machine, with_overrides
from isel_twin.plant.guides import along_guides_mm
from isel_twin.plant.mujoco import MujocoPlant

MACHINE = load_machine("4030")
X_MM, Y_MM = (axis.travel_mm for axis in MACHINE.axes[:2])


def machine(**numbers: float) -> Machine:
    """With these guides, and all others straight."""
    straight = {f"guides.{key}": 0.0 for key in MACHINE.tree["guides"]}
    flags = {"imperfections": "ideal", "imperfections.straightness": True, "imperfections.abbe": True}
    return with_overrides(MACHINE, {**flags, **straight, **{f"guides.{key}": one for key, one in numbers.items()}})


def at(machine: Machine, *place_mm: float) -> list[float]:
    position_mm: list[float] = MujocoPlant(machine, (), np.array(place_mm)).position_mm.tolist()
    return position_mm


@pytest.mark.parametrize(
    ("numbers", "place", "off_um"),
    [
        ({"x_y": 20.0}, (0.5 * X_MM, 0.0, 0.0), (0.0, 20.0, 0.0)),
        ({"x_z": -20.0}, (0.25 * X_MM, 0.0, 0.0), (0.0, 0.0, -15.0)),
        ({"y_x": 20.0}, (0.0, Y_MM, 0.0), (0.0, 0.0, 0.0)),
        ({"turn_x": 0.2, "arm_x": 100.0}, (X_MM, 0.0, 50.0), (30.0, 0.0, 0.0)),  # 0.2 mrad x 150 mm
        ({"turn_y": 0.2, "arm_y": 100.0}, (0.0, 0.5 * Y_MM, 50.0), (0.0, 5.0, 0.0)),  # the table's: 0.1 mrad x 50 mm
    ],
)
def test_where_the_tool_is(numbers: dict[str, float], place: tuple[float, ...], off_um: tuple[float, ...]) -> None:
    expected = [mm + 1e-3 * um for mm, um in zip(place, off_um, strict=True)]
    assert at(machine(**numbers), *place) == pytest.approx(expected, abs=1e-9)


def test_on_a_portal_the_arm_of_y_grows_with_z() -> None:
    portal = with_overrides(load_machine("4030-portal"), {"imperfections": "ideal", "imperfections.abbe": True})
    portal = with_overrides(portal, {"guides.turn_x": 0.0, "guides.turn_y": 0.2, "guides.arm_y": 100.0})
    travel_mm = portal.axes[1].travel_mm
    assert at(portal, 0.0, travel_mm, 50.0)[1] - travel_mm == pytest.approx(0.03, abs=1e-9)


@pytest.mark.parametrize("flags", [{}, {"imperfections.straightness": False, "imperfections.abbe": False}])
def test_off_guides_are_straight(flags: dict[str, Any]) -> None:
    off = with_overrides(MACHINE, flags)
    assert off.guides is None
    place = np.array([[1.0, 2.0, 3.0]])
    assert along_guides_mm(off, place) is place


def test_one_flag_leaves_the_other_out() -> None:
    bowed = with_overrides(MACHINE, {"imperfections.straightness": True})
    turned = with_overrides(MACHINE, {"imperfections.abbe": True})
    assert bowed.guides is not None
    assert turned.guides is not None
    assert (bowed.guides.x_y, bowed.guides.turn_x) == (0.015, 0.0)
    assert (turned.guides.x_y, turned.guides.turn_x) == (0.0, 1e-4)


def test_samples_and_positions_are_alike() -> None:
    both = machine(x_y=20.0, turn_x=0.2, arm_x=100.0)
    places = np.array([[10.0, 20.0, 30.0], [200.0, 20.0, 30.0]])
    told = np.array([at(both, *place) for place in places.tolist()])
    assert told == pytest.approx(along_guides_mm(both, places))


def test_an_unknown_guide_is_refused() -> None:
    with pytest.raises(MachineError, match=r"guides\.x_x"):
        with_overrides(MACHINE, {"guides.x_x": 1.0})
