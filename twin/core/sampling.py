"""Samples taken by the plant, converted to the zero, direction and counters of the controller.

A look at a twin takes 100 us, enough to compute 20 ms of motion. Sampling in the plant's compiled loop
(isel_twin.plant.Sampled) costs next to nothing; samples are converted hundreds at a time:

    plant:  | . . . . . | . . . . . . . . | . .        samples wait
                        ^ a counter is set              they are converted before zero or direction change

Between two such changes counter = direction * command + constant.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.core.position import Position
from isel_twin.plant import MOST_SAMPLES, Sampled


@dataclass(frozen=True, eq=False)
class TwinSamples:
    """n samples, equal to the properties of `Twin` at those times."""

    time_ns: NDArray[np.int64]
    counts: NDArray[np.int64]
    position_mm: NDArray[np.float64]
    machine_position_mm: NDArray[np.float64]
    velocity_mm_s: NDArray[np.float64]
    lost_steps: NDArray[np.float64]
    margin: NDArray[np.float64]
    current_fraction: NDArray[np.float64]
    force_n: NDArray[np.float64]
    supply_v: NDArray[np.float64]


class Sampler:
    """Reads the samples of a plant before they are overwritten, and hands them on."""

    def __init__(
        self,
        plant: Sampled,
        position: Position,
        interval_ns: int,
        take: Callable[[TwinSamples], None],
        from_ns: int = 0,
    ) -> None:
        """take: called with samples, in order. from_ns: a time of the grid. Raises ValueError for an interval that the
        plant does not allow."""
        plant.sample_every(interval_ns, from_ns)
        self.interval_ns = interval_ns
        self.from_ns = from_ns
        self.span_ns = interval_ns * (MOST_SAMPLES // 2 - 1)
        """Longest time to advance between two calls of `keep_up`."""
        self._plant = plant
        self._position = position
        self._takers = [take]
        self._offset: NDArray[np.int64] | None = None
        position.before_change = self._changes

    def share(self, take: Callable[[TwinSamples], None]) -> None:
        """Call `take` as well from now on."""
        self.hand_on()
        self._takers.append(take)

    def leave(self, take: Callable[[TwinSamples], None]) -> bool:
        """Hand on what waits, and remove `take`; return True if it was the last one, which ends sampling."""
        self.hand_on()
        self._takers.remove(take)
        if self._takers:
            return False
        self._plant.sample_every(0)
        self._position.before_change = None
        return True

    @property
    def waiting(self) -> int:
        """Samples that have not been handed on."""
        return self._plant.samples_waiting

    def prepare(self) -> None:
        """Call this before the plant advances."""
        self._position.follow_direction()
        if self._offset is None:
            self._offset = self._position.offset

    def keep_up(self) -> None:
        """Call this after the plant has advanced."""
        if self._plant.samples_waiting >= MOST_SAMPLES // 2:
            self.hand_on()

    def hand_on(self) -> None:
        if not self._plant.samples_waiting:
            return
        if self._offset is None:
            self._offset = self._position.offset
        raw, position = self._plant.take_samples(), self._position
        samples = TwinSamples(
            time_ns=raw.time_ns,
            counts=position.turned * raw.commanded + self._offset,
            position_mm=position.of_carriages_mm(raw.position_mm),
            machine_position_mm=raw.position_mm,
            velocity_mm_s=position.of_velocities_mm_s(raw.velocity_mm_s),
            lost_steps=position.lost_of(raw.commanded, raw.rotor),
            margin=raw.margin,
            current_fraction=raw.current_fraction,
            force_n=position.of_velocities_mm_s(raw.force_n),  # in the same sense
            supply_v=raw.supply_v,
        )
        for take in self._takers:
            take(samples)

    def begin_anew(self) -> None:
        """Call this after the twin was restored."""
        self._offset = None

    def _changes(self) -> None:
        self.hand_on()
        self._offset = None
        self._plant.sample_again()
