"""A motor that has lost its step at a stop shakes the structure: the simulation keeps up with it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin import Twin

from .conftest import MS, Bench, ramp_ns, ticks

STALL_HZ = 4800.0
STEPS = 9600  # two seconds of it


def stall(bench) -> tuple[Bench, NDArray[np.int64]]:
    """The 4030, Y just before its stop, and pulses at a speed at which its motor then only hums."""
    b = bench(start_mm=(60.0, 3.0, 20.0), lowering=False)
    return b, b.now_ns + ramp_ns(STEPS, STALL_HZ, STALL_HZ)


def advance(b: Bench, times_ns: NDArray[np.int64], until_ns: int) -> None:
    due = times_ns[(times_ns > b.now_ns) & (times_ns <= until_ns)]
    b.feed(until_ns - b.now_ns, due - b.now_ns, ticks(len(due), 0, -1))


@pytest.mark.parametrize("seed", range(3))
def test_a_stall_at_a_stop_stays_at_the_stop(seed: int) -> None:
    """And what it has lost is what it was sent less the way to the stop, 3 mm behind the switch at 0. With windows of
    0.5 ms throughout each of these ran away within two seconds."""
    start_mm = 3.0 + seed
    twin = Twin(
        controller="external", overrides={"controller.watchdog_ms": 0}, start_mm=(60.0, start_mm, 20.0), seed=seed
    )
    for line in (b"out power_request=1 stages=1 brake=1\n", b"go 4800 0 -14400 0\n"):
        twin.write(line)
        assert twin.run_until_idle()
    place_mm = float(twin.machine_position_mm[1])
    assert place_mm == pytest.approx(-3.0, abs=0.5), "it bounces"
    assert float(twin.lost_steps[1]) == pytest.approx(-(14400 - (start_mm - place_mm) * 320.0), abs=64)


def test_fine_windows_are_the_same_however_time_is_cut_and_saved(bench) -> None:
    whole, times = stall(bench)
    cut, _ = stall(bench)
    other, _ = stall(bench)
    end_ns = int(times[0]) + 1500 * MS
    fine = 0
    for until_ns in range(whole.now_ns + MS, end_ns, MS + 3):
        advance(cut, times, until_ns)
        plant = cut.plant.parts.plant
        if plant["window"][0] != plant["usual"][0]:
            fine += 1
            if fine == 3:  # goes on in another plant
                other.plant.restore(cut.plant.save())
                other.now_ns = cut.now_ns
                cut, other = other, cut
    assert fine > 3
    advance(cut, times, end_ns)
    advance(whole, times, end_ns)
    assert (whole.plant.position_mm == cut.plant.position_mm).all()
    assert (whole.plant.rotor == cut.plant.rotor).all()
    assert whole.plant.model.opt.timestep == cut.plant.model.opt.timestep == 0.0005


def test_what_keeps_step_is_not_shaken(bench) -> None:
    b = bench()
    b.move((0, 6400, 0), 16000.0)
    b.wait(50)
    assert abs(b.lost[1]) < 1
    assert b.plant.parts.plant["window"][0] == b.plant.parts.plant["usual"][0]
    assert b.plant.parts.plant["calm"][0] == 0
