"""A switch that has been released stays released where the carriage stands, however much its trip point scatters."""

from __future__ import annotations

import pytest

from isel_twin import Twin

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
