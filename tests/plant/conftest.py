"""A bench for the MuJoCo plant: power, pulses by closed form, pushes, and nothing of the controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from conformance.closed_forms import times_ns
from numpy.typing import NDArray

from isel_twin.machine import load_machine, with_overrides
from isel_twin.plant import Threshold
from isel_twin.plant.mujoco import MujocoPlant

MS = 1_000_000
FULL_STEP = 8
"""Microsteps in a full step at 1600 a revolution."""
PERIOD = 4 * FULL_STEP
"""Microsteps in which the torque of a two-phase motor repeats: what a motor loses when it loses any."""
NONE = np.empty(0, dtype=np.int64), np.empty((0, 4), dtype=np.int8)


def ticks(count: int, *changes: int) -> NDArray[np.int8]:
    """int8 [count, 4]: as many ticks with the same changes of X, Y, Z, A; those not given stand."""
    return np.tile(np.array([*changes, 0, 0, 0, 0][:4], dtype=np.int8), (count, 1))


def ramp_ns(steps: int, top_hz: float, start_hz: float = 300.0, hz_per_ms: float = 100.0) -> NDArray[np.int64]:
    """Times of the pulses of a move."""
    return np.array(times_ns(steps, top_hz, start_hz, 1e3 * hz_per_ms), dtype=np.int64)


class Bench:
    """A plant and the time it has reached."""

    def __init__(self, plant: MujocoPlant) -> None:
        self.plant = plant
        self.now_ns = 0

    def wait(self, ms: float) -> None:
        """Let time pass without pulses."""
        self.feed(round(ms * MS), *NONE)

    def feed(self, duration_ns: int, after_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int = 0) -> None:
        """Let time pass with ticks at after_ns from now; nothing but a collision may stop it early."""
        until_ns, t_ns = self.now_ns + duration_ns, self.now_ns + after_ns
        while (reached := self.plant.advance(until_ns, t_ns, delta, lead_ns)) < until_ns:
            assert self.plant.take_collisions()
            t_ns, delta = t_ns[t_ns > reached], delta[t_ns > reached]
        self.now_ns = until_ns

    def move(self, steps: Sequence[int], top_hz: float, start_hz: float = 300.0, hz_per_ms: float = 100.0) -> None:
        """Move by steps X, Y, Z (equal or zero, with sign) to the end of the last pulse."""
        t_ns = ramp_ns(max(abs(n) for n in steps), top_hz, start_hz, hz_per_ms)
        self.feed(int(t_ns[-1]), t_ns, ticks(len(t_ns), *np.sign(steps)))

    @property
    def lost(self) -> NDArray[np.float64]:
        """Microsteps commanded and not made."""
        return self.plant.commanded - self.plant.rotor


@pytest.fixture
def bench() -> Callable[..., Bench]:
    """Build a plant: bench(overrides, start_mm, thresholds); stages on unless told otherwise."""

    def build(
        overrides: Mapping[str, Any] | None = None,
        start_mm: Sequence[float] = (100.0, 100.0, 30.0),
        thresholds: Sequence[Threshold] = (),
        *,
        machine: Any = "4030",
        power: bool = True,
        lowering: bool = True,
    ) -> Bench:
        plant = MujocoPlant(with_overrides(load_machine(machine), overrides or {}), thresholds, np.array(start_mm))
        result = Bench(plant)
        if power:
            plant.set_power(stages=True, brake_released=True, lowering=lowering)
            result.wait(50)
        return result

    return build
