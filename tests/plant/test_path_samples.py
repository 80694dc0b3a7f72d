"""Samples of the kinematic plant are what looks at it show, at the same times; none while nothing moves."""

import numpy as np
import pytest

from isel_twin.machine import load_machine
from isel_twin.plant import MOST_SAMPLES
from isel_twin.plant.kinematic import KinematicPlant

EVERY_NS = 1000
SEEN = ("position_mm", "velocity_mm_s", "commanded", "rotor", "supply_v", "margin", "current_fraction")
RNG = np.random.default_rng(5)
T_NS = np.sort(RNG.integers(1, 40_000, 60))
DELTA = RNG.integers(-3, 4, (60, 4)).astype(np.int32)


def plant():
    return KinematicPlant(load_machine("4030"), [], np.full(3, 50.0))


def advance(one, until_ns, lead_ns):
    due = (one.time_ns < T_NS) & (until_ns >= T_NS)
    one.advance(until_ns, T_NS[due], DELTA[due], lead_ns)


@pytest.mark.parametrize("lead_ns", [0, 2500])
@pytest.mark.parametrize("cuts_ns", [[50_000], [700, 4000, 4001, 17_777, 50_000]])
def test_samples_are_looks_at_the_same_times(lead_ns, cuts_ns):
    sampled, seen = plant(), plant()
    sampled.sample_every(EVERY_NS, from_ns=300)
    for until_ns in cuts_ns:
        advance(sampled, until_ns, lead_ns)
    assert sampled.samples_waiting
    samples = sampled.take_samples()
    assert not sampled.samples_waiting
    assert samples.time_ns[0] == 300
    held = -1
    for time_ns in range(300, 50_000, EVERY_NS):
        advance(seen, time_ns, lead_ns)
        held = int(np.searchsorted(samples.time_ns, time_ns, side="right")) - 1
        for name in SEEN:
            np.testing.assert_array_equal(
                getattr(samples, name)[held], getattr(seen, name), err_msg=f"{name} {time_ns}"
            )
    assert held == len(samples.time_ns) - 1
    assert samples.time_ns[-1] <= T_NS[-1] + lead_ns + EVERY_NS  # at rest, the last one says all


def test_at_rest_there_is_one_sample_until_another_is_wanted():
    one = plant()
    one.sample_every(EVERY_NS)
    nothing = np.empty(0, np.int64), np.empty((0, 4), np.int8)
    one.advance(10**15, *nothing)
    assert one.take_samples().time_ns.tolist() == [EVERY_NS]
    one.advance(10**15 + 5 * EVERY_NS, *nothing)
    one.sample_again()
    one.advance(10**15 + 9 * EVERY_NS, *nothing)
    assert one.take_samples().time_ns.tolist() == [10**15 + 6 * EVERY_NS]


def test_no_more_wait_than_may_and_restored_it_keeps_its_grid():
    one = plant()
    state = one.save()
    one.sample_every(1)
    advance(one, 40_000, 2500)
    assert one.samples_waiting == MOST_SAMPLES
    one.sample_every(7 * EVERY_NS, from_ns=100)
    one.restore(state)
    assert one.samples_waiting == 0
    advance(one, 9000, 0)
    assert one.take_samples().time_ns.tolist() == [100, 7100]
    one.sample_every(0)
    advance(one, 40_000, 0)
    assert one.samples_waiting == 0
    with pytest.raises(ValueError, match="-1 ns"):
        one.sample_every(-1)
