"""Time in the plant: the grid, the first switch edge, and that cutting time into calls changes nothing."""

from __future__ import annotations

import copy
import pickle
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.machine import load_machine
from isel_twin.plant import Threshold
from isel_twin.plant.mujoco import MujocoPlant
from tests.thorough import drawn

from .conftest import MS, NONE, ramp_ns, ticks

SUBSTEP = 25_000
END = 400 * MS
ADDRESSES = {"mj_step", "model", "data", "step_at"}  # differ from plant to plant


def build(thresholds=()) -> MujocoPlant:
    return MujocoPlant(load_machine("4030"), thresholds, np.array([100.0, 100.0, 30.0]))


def job() -> tuple[np.ndarray, np.ndarray]:
    """A diagonal move, a pause that goes to rest, single pulses."""
    move = ramp_ns(300, 6000)
    singles = np.array([310 * MS + 1, 310 * MS + SUBSTEP, 350_012_345], dtype=np.int64)
    t_ns = np.concatenate((move, singles))
    return t_ns, np.concatenate((ticks(len(move), 1, -1, 1), ticks(1, 1), ticks(1, 0, 0, -1), ticks(1, 0, 1)))


def run_cut(cuts: list[int], plant: MujocoPlant | None = None) -> list[bytes]:
    """The job with a power setting at 5 ms and a push at 320 ms, cut at these times; everything that can differ."""
    plant = plant or build()
    t_ns, delta = job()
    done = 0
    for until in sorted({*cuts, 5 * MS, 320 * MS, END}):
        last = int(np.searchsorted(t_ns, until, side="right"))
        assert plant.advance(until, t_ns[done:last], delta[done:last]) == until
        done = last
        if until == 5 * MS:
            plant.set_power(stages=True, brake_released=True, lowering=True)
        if until == 320 * MS:
            plant.apply_force(1, 50.0)
    return [
        a.tobytes()
        for a in (plant.position_mm, plant.velocity_mm_s, plant.rotor, plant.commanded, plant.parts.states["force_n"])
    ]


@settings(max_examples=drawn(25), deadline=None)
@given(st.lists(st.integers(0, END), max_size=12))
def test_cutting_time_into_calls_changes_no_bit(cuts):
    assert run_cut(cuts) == run_cut([])


def test_cutting_at_every_pulse_and_every_window_changes_no_bit():
    assert run_cut([*job()[0].tolist(), *range(0, END, 500_000)]) == run_cut([])


@pytest.mark.parametrize("lowering", [False, True])
@pytest.mark.parametrize("pause_ns", [12 * MS + 300_000, 24 * MS + 975_000, 26 * MS, 300 * MS])
def test_standstill_that_is_skipped_changes_no_bit(pause_ns, lowering):
    """From power-on to single pulses that come before, about and behind the moment at which the plant is frozen; with
    current that is lowered. Calls that end with each window skip nothing."""

    def whole(every_ns: int) -> list[bytes]:
        plant, made = build(), 0
        plant.set_power(stages=True, brake_released=True, lowering=lowering)
        t_ns = np.arange(1, 5) * pause_ns
        end_ns = int(t_ns[-1]) + 300 * MS
        for until in (*range(every_ns, end_ns, every_ns), end_ns):
            last = int(np.searchsorted(t_ns, until, side="right"))
            plant.advance(until, t_ns[made:last], ticks(last - made, 1, -1, 1))
            made = last
        parts = plant.parts
        told = [parts.plant[name] for name in parts.plant.dtype.names if name not in ADDRESSES]
        return [part.tobytes() for part in (*told, parts.axes, parts.states, parts.qpos, parts.qvel)]

    assert whole(1000 * MS) == whole(MS // 2)


def test_two_plants_in_two_threads_are_like_one():
    results: dict[int, list[bytes]] = {}
    threads = [threading.Thread(target=lambda n=n: results.update({n: run_cut([])})) for n in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results[0] == results[1] == run_cut([])


def moving(switch: Threshold) -> tuple[MujocoPlant, np.ndarray, np.ndarray]:
    plant = build([switch])
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.advance(50 * MS, *NONE)
    return plant, 50 * MS + ramp_ns(640, 4000), ticks(640, 1)


def test_returns_at_the_end_of_the_sub_step_in_which_a_switch_is_struck():
    plant, t_ns, delta = moving(Threshold(0, "position", limit=101.0, sense=1, hysteresis=0.2))
    assert not plant.trips()[0]
    at = plant.advance(1000 * MS, t_ns, delta)
    assert at < 1000 * MS
    assert at % SUBSTEP == 0
    assert plant.time_ns == at
    assert plant.trips()[0]
    step_mm = plant.velocity_mm_s[0] * SUBSTEP * 1e-9
    assert 0.0 < plant.parts.axes["x_m"][0] * 1e3 - 101.0 <= step_mm * 1.01
    assert plant.commanded[0] == np.searchsorted(t_ns, at, side="right")


def test_pulses_after_an_edge_are_handed_in_again_or_never_happen():
    plant, t_ns, delta = moving(Threshold(0, "position", limit=101.0, sense=1, hysteresis=0.2))
    whole = build()
    whole.set_power(stages=True, brake_released=True, lowering=True)
    whole.advance(50 * MS, *NONE)
    whole.advance(1000 * MS, t_ns, delta)
    at = plant.advance(1000 * MS, t_ns, delta)
    made = int(plant.commanded[0])
    rest = np.searchsorted(t_ns, at, side="right")
    assert plant.advance(1000 * MS, t_ns[rest:], delta[rest:]) == 1000 * MS
    assert np.array_equal(plant.position_mm, whole.position_mm)

    stopped, t_ns, delta = moving(Threshold(0, "position", limit=101.0, sense=1, hysteresis=0.2))
    stopped.advance(1000 * MS, t_ns, delta)
    stopped.advance(1000 * MS, *NONE)
    assert stopped.commanded[0] == made


def test_switch_is_free_again_after_its_hysteresis():
    plant = build([Threshold(0, "position", limit=100.5, sense=-1, hysteresis=0.2)])
    assert plant.trips()[0], "stands on the motor-end switch"
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.advance(50 * MS, *NONE)
    at = plant.advance(1000 * MS, 50 * MS + ramp_ns(640, 1000), ticks(640, 1))
    assert at < 1000 * MS
    assert not plant.trips()[0]
    assert plant.position_mm[0] == pytest.approx(100.7, abs=0.01)
    plant.set_trip_point(0, 105.0)
    assert plant.advance(1001 * MS, *NONE) < 1001 * MS, "the new trip point is beyond the carriage"


def test_at_rest_only_when_the_current_has_been_lowered():
    """Rest is 25 ms of standstill, the current is lowered 200 ms after the stages came on."""
    plant = build()
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.advance(199 * MS, *NONE)
    assert not plant.at_rest
    plant.advance(300 * MS, *NONE)
    assert plant.at_rest
    plant.set_power(stages=True, brake_released=True, lowering=False)
    assert not plant.at_rest


@pytest.mark.parametrize("make", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_plant_is_neither_copied_nor_pickled(bench, make):
    """Its kernel knows MuJoCo's memory by address, which a copy would share, and another process does not have."""
    with pytest.raises(TypeError, match="a plant cannot be copied or pickled"):
        make(bench().plant)
