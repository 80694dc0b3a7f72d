"""Switches scatter from the first reference run on, and one that has been released stays released where it stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.machine import load_machine, with_overrides
from isel_twin.wiring import TripPoints
from tests.near import near_switches

SCATTER = {"switches.repeatability": 0.1}
"""Ten times what a snap switch has, on 0.2 mm of hysteresis."""


@pytest.mark.parametrize("seed", range(12))
def test_a_reference_run_ends_clear_of_all_switches(seed: int) -> None:
    """The iSMIF goes on a quarter of a millimetre from where its switch has let go, and all of them are one input."""
    twin = Twin(controller="ismif", plant="kinematic", seed=seed, overrides=SCATTER)
    for _ in range(4):
        twin.query("#OX,1\r#OY,1\r#OZ,1\r$HZXY\x01")
        assert not twin.fault
        switches = {switch.name for switch in twin.machine.switches}
        assert {twin.inputs[name] for name in switches} == {"free"}


STRUCK = "\n".join(
    f'[[event]]\nname = "{axis}"\nwhen = "input limit_{axis}1 == struck"\nset = {{ user_{number} = "high" }}\n'
    for number, axis in enumerate("xyz")
)
SIGMA_MM = 0.05


def struck_mm(folder: Path, controller: str, seed: int) -> list[float]:
    """Where each carriage first strikes its switch in the first reference run after power-on."""
    overrides = {"switches.repeatability": SIGMA_MM}
    scenario = folder / "struck.toml"
    twin = Twin(folder, controller, plant="kinematic", seed=seed, scenario=scenario, overrides=overrides)
    found: dict[int, float] = {}

    def note(_: int, kind: str, what: Any) -> None:
        if kind == "scenario":
            (name,) = what["set"]
            axis = int(name.removeprefix("user_"))
            found.setdefault(axis, twin.machine_position_mm[axis])

    twin.listen(note)
    for data in twin.language.reference():
        twin.write(data)
        twin.run_until_idle()
    assert not twin.fault
    return [found[axis] for axis in range(3)]


@pytest.mark.parametrize(
    ("controller", "machine"),
    [("imc-s8", "4030"), ("ismif", "4030"), ("gmi99", "4030-servo"), ("bwo900", "4030-servo")],
)
def test_the_first_reference_run_scatters_as_stated(controller: str, machine: str, tmp_path: Path) -> None:
    """Twenty power-ons, three switches: the sum of squares over sigma^2 is chi-square with 57 degrees of freedom, of
    which one in a thousand lies outside 28.2 to 98.8."""
    near_switches(tmp_path, 2.0, machine)
    (tmp_path / "struck.toml").write_text(STRUCK)
    places = np.array([struck_mm(tmp_path, controller, seed) for seed in range(20)])
    assert 28.2 < ((places - places.mean(axis=0)) ** 2).sum() / SIGMA_MM**2 < 98.8
    assert np.abs(places.mean(axis=0)).max() < 3.3 * SIGMA_MM / 20**0.5 + 0.02, "around the nominal place, at a speed"


def test_the_first_touch_of_a_probe_scatters_as_stated() -> None:
    """57 power-ons around the pretravel of the file: chi-square of 57 degrees of freedom, as above."""
    machine = with_overrides(load_machine("4030"), {"probe.enabled": True, "probe.repeatability": 2.0})
    assert machine.feeler is not None
    drawn = np.array([TripPoints(machine, np.random.default_rng(seed)).feeler_mm for seed in range(57)])
    assert 28.2 < ((drawn - machine.feeler.pretravel_mm) ** 2).sum() / 0.002**2 < 98.8
