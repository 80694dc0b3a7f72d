"""What there is to see of a twin, all of it at one instant."""

from __future__ import annotations

import numpy as np
import pytest

from isel_twin.core.position import position_error_mm
from isel_twin.core.snapshot import snapshot
from isel_twin.core.twin import Twin

STEP_MM = np.array([0.003125, 0.003125, 0.00625])


@pytest.mark.parametrize(
    ("counts", "error_mm"),
    [
        ([16_000, -8_000, 80, 0], [0.0, 0.0, 0.5]),
        ([16_000, -8_000, 80, 5, 6, 7], [0.0, 0.0, 0.5]),
        ([16_000, -8_000], [0.0, 0.0, 1.0]),
    ],
    ids=["four axes", "six axes", "two axes"],
)
def test_the_position_error_is_position_minus_counter(counts: list[int], error_mm: list[float]) -> None:
    position_mm = np.array([50.0, -25.0, 1.0])
    assert position_error_mm(position_mm, np.array(counts), STEP_MM).tolist() == pytest.approx(error_mm, abs=1e-12)
    assert position_mm.tolist() == [50.0, -25.0, 1.0]


def test_the_position_error_of_many_samples() -> None:
    counts = np.arange(12).reshape(3, 4) * 320
    position_mm = counts[:, :3] * STEP_MM + [0.0, 0.01, -0.02]
    error_mm = position_error_mm(position_mm, counts, STEP_MM)
    np.testing.assert_allclose(error_mm, [[0.0, 0.01, -0.02]] * 3, atol=1e-12)


def test_a_snapshot_shows_what_the_twin_shows_and_stays() -> None:
    twin = Twin(plant="kinematic", seed=3)
    for command in ("@07", "@0R7"):
        twin.query(command)
    seen = snapshot(twin)
    assert seen.time_ns == twin.time_ns
    for name in ("counts", "position_mm", "position_error_mm", "lost_steps"):
        np.testing.assert_array_equal(getattr(seen, name), getattr(twin, name))
    assert (seen.inputs, seen.outputs, seen.levels) == (twin.inputs, twin.outputs, twin.levels)

    twin.query("@0A1600,5000,0,30,0,30,0,30")
    twin.set_input("estop", "pressed")
    assert seen.counts.tolist() == [0, 0, 0, 0]
    assert (seen.inputs["estop"], seen.outputs["power"]) == ("released", 1)
    assert snapshot(twin).inputs["estop"] == "pressed"


def test_the_way_of_a_step_is_lead_over_steps() -> None:
    twin = Twin(controller="ismif", plant="kinematic")
    np.testing.assert_array_equal(twin.step_mm, [axis.screw.lead_mm / axis.steps_per_rev for axis in twin.machine.axes])
