"""Two controllers, one machine: the same job ends at the same place, and a stop without a ramp is physics."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin import Twin
from isel_twin.language import MoveSettings

SQUARE_MM = [(10.0, 10.0), (40.0, 10.0), (40.0, 40.0), (10.0, 40.0), (10.0, 10.0)]
TOLERANCE_MM = 0.03
ISMIF_STEPS_MM = 80  # half steps


def corners(twin: Twin, square_mm: Iterable[tuple[float, float]]) -> list[NDArray[np.float64]]:
    """Reference run and absolute moves at 12.5 mm/s, by whatever language the controller has; true positions there."""
    assert twin.language is not None
    steps_mm = twin.machine.axes[0].steps_per_mm
    settings = MoveSettings(round(12.5 * steps_mm), acceleration_hz_per_ms=2, start_stop_hz=round(2.5 * steps_mm))
    for data in twin.language.reference():
        converse(twin, data)
    positions = []
    for x, y in square_mm:
        for data in twin.language.move([round(x * steps_mm), round(y * steps_mm), 0], settings):
            converse(twin, data)
        positions.append(settled(twin))
    return positions


def converse(twin: Twin, data: bytes) -> None:
    """Send, wait for the reply, and have it accepted."""
    assert twin.language is not None
    twin.write(data)
    assert twin.run_until_idle(60.0)
    assert twin.language.accepted(data, twin.read())


def settled(twin: Twin) -> NDArray[np.float64]:
    """True position once the machine has come to rest."""
    twin.run(0.5)
    return twin.position_mm


@pytest.mark.parametrize("seed", [0, 7])
def test_the_same_square_ends_at_the_same_place(seed: int) -> None:
    reached = {}
    for controller in ("imc-s8", "ismif"):
        twin = Twin(controller=controller, seed=seed)
        reached[controller] = corners(twin, SQUARE_MM)
        assert np.abs(twin.lost_steps).max() < 1.0
    for imc, ismif, (x, y) in zip(reached["imc-s8"], reached["ismif"], SQUARE_MM, strict=True):
        assert np.abs(imc - ismif).max() < TOLERANCE_MM
        assert np.abs(ismif - (x, y, 0.0)).max() < TOLERANCE_MM


def ismif_at_speed(speed_hz: int) -> Twin:
    """A referenced iSMIF, 1.2 s after the start of a long X vector; the ramp takes 0.5 s."""
    twin = Twin(controller="ismif", seed=3)
    assert twin.query("$HZXY\x01") == "\r\x02\r"
    assert twin.query(f"#E1,{speed_hz}\x01") == "\r\x02\r"
    twin.write(b"L1,X8000\x01")
    twin.run(1.2)
    assert twin.read() == b"\r"
    return twin


def status(twin: Twin) -> str:
    return twin.query("@X").removeprefix("@X").removesuffix("\r")


@pytest.mark.parametrize("stop", ["@S", "@R"])
def test_a_stop_without_a_ramp_overshoots_and_loses_the_position(stop: str) -> None:
    """From 3000 Hz, 37.5 mm/s, the rotor cannot stand still at once: it slips by whole electrical periods of 8 half
    steps (0.1 mm). Where the last pulse fell is the counter's new zero; the carriage is not there."""
    twin = ismif_at_speed(3000)
    last_pulse_mm = twin.machine_position_mm[0]
    assert twin.query(stop) == "\r"
    ticks = len(twin.steps)
    assert status(twin) == "000100"
    assert twin.counts.tolist() == [0, 0, 0, 0]
    twin.run(1.0)
    assert len(twin.steps) == ticks
    assert twin.machine_position_mm[0] - last_pulse_mm > 0.1
    assert twin.position_mm[0] > 0.08
    slips = twin.lost_steps[0] / 8
    assert slips == pytest.approx(round(slips), abs=0.1)
    assert round(slips) <= -1


@pytest.mark.parametrize("stop", ["@B", "@A"])
def test_a_stop_with_a_ramp_keeps_the_position(stop: str) -> None:
    twin = ismif_at_speed(3000)
    before = twin.counts[0]
    assert twin.query(stop).startswith("\r")
    twin.run(1.0)
    assert twin.counts[0] - before == pytest.approx((3000**2 - 200**2) / (2 * 5600), abs=1)
    assert twin.position_mm[0] == pytest.approx(twin.counts[0] / ISMIF_STEPS_MM, abs=TOLERANCE_MM)
    assert status(twin)[3] == "0"


def test_counters_do_not_know_of_lost_steps() -> None:
    """5000 Hz without a ramp is 62.5 mm/s from a standing start."""
    twin = Twin(controller="ismif", seed=3)
    twin.query("$HZXY\x01")
    assert twin.query("#S5000\r#E1,5000\rL1,X4000\x01") == "\r\r\r\x02\r"
    twin.run(0.5)
    assert twin.query("@LX") == "@LX4000\r"
    assert twin.lost_steps[0] > 100
    assert twin.position_mm[0] < 4000 / ISMIF_STEPS_MM - 1.0


def test_reference_run_to_the_far_end() -> None:
    """With `#DY,1` Y runs to its far switch at 300 mm, off it, and 25 half steps (0.3125 mm) further."""
    twin = Twin(controller="ismif", seed=2, start_mm=(50.0, 290.0, 30.0))
    assert twin.query("#DY,1,1,2,3\r$HY\x01") == "\r\r\x02\r"
    twin.run(0.5)
    hysteresis_mm, scatter_mm = 0.2, 0.06
    assert twin.machine_position_mm[1] == pytest.approx(300 - hysteresis_mm - 0.3125, abs=scatter_mm)
    assert twin.counts[1] == 0
    assert status(twin) == "000100"  # X and Z are not known yet


def test_full_steps_go_twice_as_far() -> None:
    twin = Twin(controller="ismif", seed=1)
    twin.query("$HZXY\x01")
    assert twin.query("F1\r#E1,300\rL1,X800,Y-0\x01") == "\r\r\r\x02\r"
    twin.run(0.5)
    assert twin.query("@LX") == "@LX800\r"
    assert twin.position_mm[0] == pytest.approx(2 * 800 / ISMIF_STEPS_MM, abs=TOLERANCE_MM)
    assert abs(twin.lost_steps[0]) < 1.0


def test_emergency_stop_is_hardware() -> None:
    """The interface is not told: it counts on while the stages have no power."""
    twin = ismif_at_speed(600)
    before = twin.position_mm[0]
    twin.set_input("estop", "pressed")
    twin.run(3.0)
    assert twin.counts[0] > 2000
    assert abs(twin.position_mm[0] - before) < 1.0


@pytest.mark.parametrize("opened_at_s", [0.5, 0.7], ids=["before the job", "during the job"])
def test_the_cabinet_keeps_an_open_hood_safe_from_a_controller_that_knows_no_hood(opened_at_s: float) -> None:
    twin = Twin(controller="ismif", start_mm=(30.0, 30.0, 30.0))
    events = sorted([(opened_at_s, "hood"), (0.6, "job")])
    for at_s, event in events:
        twin.run(at_s - twin.time_ns / 1e9)
        if event == "hood":
            twin.set_input("hood", "open")
        else:
            twin.write(b"L1,X2000\x01\r")
    cut_mm = twin.machine_position_mm[0]
    twin.run(2.0)
    assert twin.outputs["power"] == 0
    assert twin.machine_position_mm[0] - cut_mm < 0.1, "the stages are dead, whatever is stepped"
