"""Ramp law and full steps against their closed forms, to the nanosecond."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.closed_forms import line
from conformance.ismif_desk import job, moved, pulse_times_ns, referenced, send_job
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.firmware.ismif.moves import FullSteps, ramp
from isel_twin.motion import StepRun
from isel_twin.motion import line as straight
from tests.thorough import drawn

frequencies = st.integers(65, 5000)


@settings(deadline=None)
@given(
    steps=st.integers(1, 3000),
    v=frequencies,
    f0=frequencies,
    ramp_ms=st.integers(0, 65_535),
    error_ppm=st.integers(-50_000, 50_000),
)
def test_pulse_times(steps: int, v: int, f0: int, ramp_ms: int, error_ppm: int) -> None:
    times = ramp(steps, v, f0, ramp_ms, error_ppm).times(0, steps)
    assert times.tolist() == pulse_times_ns(steps, v, f0, ramp_ms, error_ppm)


@pytest.mark.parametrize(
    ("steps", "v", "f0", "ramp_ms"),
    [
        (1_000_000, 5000, 200, 500),  # long
        (100, 5000, 65, 2000),  # turns around at its middle
        (1, 600, 200, 500),  # a single step
        (2, 600, 200, 500),
        (500, 150, 200, 500),  # slower than the start speed: no ramp
        (500, 200, 200, 500),
        (500, 600, 200, 0),  # no ramp at all
        (400, 600, 200, 500),  # exactly two ramps of 200 steps
    ],
)
def test_pulse_times_of_special_motions(steps: int, v: int, f0: int, ramp_ms: int) -> None:
    sample = np.unique(np.linspace(1, steps, 2000).astype(int))
    expected = pulse_times_ns(steps, v, f0, ramp_ms, ticks=sample.tolist())
    times = ramp(steps, v, f0, ramp_ms).times(0, steps)
    assert times[sample - 1].tolist() == expected


def test_ramp_takes_its_length() -> None:
    """200 to 600 Hz in 500 ms are 200 steps: step 200 falls at 500 ms, and the cruise has 600 Hz exactly."""
    times = ramp(1000, 600, 200, 500).times(0, 1000)
    assert times[199] == 500_000_000
    assert times[799] - times[199] == 1_000_000_000
    assert times[999] == 2_000_000_000


@settings(deadline=None, max_examples=drawn(30))
@given(st.tuples(*[st.integers(-400, 400)] * 3).filter(any))
def test_sum_and_interpolation(steps: tuple[int, int, int]) -> None:
    x, y, z = steps
    desk = referenced("#S5000", "#E1,5000")
    desk.carriage += 2000
    assert np.array_equal(moved(desk, f"L1,x{x},y{y},z{z}").delta, line(x, y, z))


# --- full steps ---------------------------------------------------------------------------------------------------


@given(st.integers(0, 15), st.integers(0, 15))
def test_full_steps_of_a_path_in_any_stretch(a: int, b: int) -> None:
    """As many ticks as the path of half steps has, each of twice its step."""
    first, last = sorted((a, b))
    half = line(15, -7, 3)
    path = FullSteps(straight((15, -7, 3, 0)))
    assert (path.ticks, path.axes) == (15, 4)
    assert path.deltas(first, last).dtype == np.int8
    assert path.deltas(first, last).tolist() == (2 * half[first:last]).tolist()
    assert path.displacement(last) == tuple(2 * half[:last].sum(axis=0, dtype=int))


def test_full_steps_of_equal_paths_are_equal() -> None:
    """So a run of them that is stopped or cut still continues the former one."""
    assert FullSteps(straight((15, -7, 3, 0))) == FullSteps(straight((15, -7, 3, 0)))
    assert FullSteps(straight((15, -7, 3, 0))) != FullSteps(straight((15, -7, 4, 0)))


@given(st.integers(-10, 70_000_000))
def test_a_run_of_full_steps_is_counted_and_cut_whole(t_ns: int) -> None:
    times = pulse_times_ns(15, 600)
    run = StepRun(FullSteps(straight((15, -7, 3, 0))), ramp(15, 600, 200, 500), 0)
    for t in (t_ns, *times[:6]):
        made = sum(time <= t for time in times)
        assert run.count(t) == made
        assert run.displacement(t)[0] == 2 * made
        assert run.cut(t).window(0, made)[0].tolist() == times[:made]
        assert run.cut(t).end_ns == (times[made - 1] if made else 0)
        assert run.cut(t).continues(run)


def test_full_steps_are_stopped_and_paused_whole() -> None:
    desk = referenced("F1")
    send_job(desk, "L1,X2000")
    desk.run(1.2)
    desk.send(b"@A\r")
    desk.finish()
    assert desk.counts[0] % 2 == 0
    assert 0 < desk.counts[0] < 4000
    desk.send(b"@C\r")
    desk.finish()
    assert desk.counts == (4000, 0, 0, 0)


def test_reference_run_in_full_steps_ends_on_whole_ones() -> None:
    """Search, free run and offset are whole full steps, though the switch changes at a half one."""
    desk = referenced("F1", "L1,X301")
    x = moved(desk, "$HX")
    assert set(x.delta[:, 0].tolist()) == {-2, 2}
    assert x.delta[-25:, 0].tolist() == [2] * 25
    assert job(desk, "L1,X5") == "\r\x02\r"
    assert desk.counts == (10, 0, 0, 0)
