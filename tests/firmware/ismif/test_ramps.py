"""Ramp law and full steps against their closed forms, to the nanosecond."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.ismif_desk import job, line, moved, pulse_times_ns, referenced, send_job
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.firmware.ismif.moves import PairedPath, paired, profile
from isel_twin.motion import line as straight

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
    times = profile(steps, v, f0, ramp_ms, error_ppm).times(0, steps)
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
    expected = pulse_times_ns(steps, v, f0, ramp_ms)
    times = profile(steps, v, f0, ramp_ms).times(0, steps)
    assert times[sample - 1].tolist() == [expected[k - 1] for k in sample]


def test_ramp_takes_its_length() -> None:
    """200 to 600 Hz in 500 ms are 200 steps: step 200 falls at 500 ms, and the cruise has 600 Hz exactly."""
    times = profile(1000, 600, 200, 500).times(0, 1000)
    assert times[199] == 500_000_000
    assert times[799] - times[199] == 1_000_000_000
    assert times[999] == 2_000_000_000


@settings(deadline=None, max_examples=30)
@given(st.tuples(*[st.integers(-400, 400)] * 3).filter(any))
def test_sum_and_interpolation(steps: tuple[int, int, int]) -> None:
    x, y, z = steps
    desk = referenced("#S5000", "#E1,5000")
    desk.carriage += 2000
    assert np.array_equal(moved(desk, f"L1,x{x},y{y},z{z}").delta, line(x, y, z))


# --- full steps ---------------------------------------------------------------------------------------------------


@given(st.integers(0, 30), st.integers(0, 30))
def test_paired_path_and_profile_in_any_stretch(a: int, b: int) -> None:
    """Every stretch is cut out of the whole: each step twice, the second 1 ns later."""
    first, last = sorted((a, b))
    path, law = PairedPath(straight((15, -7, 3, 0))), paired(profile(15, 600, 200, 500))
    codes = np.repeat(straight((15, -7, 3, 0)).deltas(0, 15), 2)
    times = [t + extra for t in pulse_times_ns(15, 600) for extra in (0, 1)]
    assert path.ticks == law.ticks == 30
    assert path.deltas(first, last).tolist() == codes[first:last].tolist()
    assert law.times(first, last).tolist() == times[first:last]
    made = np.repeat(line(15, -7, 3), 2, axis=0)[:last].sum(axis=0, dtype=int)
    assert path.displacement(last) == tuple(made)


@given(st.integers(-10, 70_000_000))
def test_paired_count_and_cut(t_ns: int) -> None:
    times = [t + extra for t in pulse_times_ns(15, 600) for extra in (0, 1)]
    for t in (t_ns, *times[:6]):
        made = sum(time <= t for time in times)
        law = paired(profile(15, 600, 200, 500))
        assert law.count(t) == made
        assert law.cut(t).times(0, made).tolist() == times[:made]
        assert law.cut(t).duration_ns == (times[made - 1] if made else 0)


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
    assert x.delta[::2, 0].tolist() == x.delta[1::2, 0].tolist()
    assert x.delta[-50:, 0].tolist() == [1] * 50
    assert job(desk, "L1,X5") == "\r\x02\r"
    assert desk.counts == (10, 0, 0, 0)
