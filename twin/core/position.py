"""Lost steps and true positions: the relation of counters, motors and carriages.

Each axis has three numbers, in steps of the controller:

    count       the controller's counter, which it may set without a motion (reference run)
    command     sum of the ticks given to the drive since power-on, in the sense of the motor
    rotor       position of the motor, in the sense of the motor

A motor loses whole slips, each one period of its torque. Setting a counter clears the slips before it: (core/1)
(core/2)

    lost  = direction (command - rotor - slip)             slip: whole periods at the last setting of the counter
    zero  = where the carriage is when the counter is 0 and nothing is lost

The zero changes only when a counter is set, because within a sub-step command and count may differ by a pulse.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.controller import Controller
from isel_twin.plant import Plant


def position_error_mm(
    position_mm: NDArray[np.float64], counts: NDArray[np.int64], step_mm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """float64 [..., 3], true position minus counter. counts: int64 [..., axes]; a carriage without one counts as 0."""
    axes = min(counts.shape[-1], len(step_mm))
    error_mm = position_mm.copy()
    error_mm[..., :axes] -= counts[..., :axes] * step_mm[:axes]
    return error_mm


class Position:
    """Relates one controller's counters to the plant it moves. Implements `isel_twin.controller.Drives`."""

    def __init__(self, controller: Controller, plant: Plant, step_mm: NDArray[np.float64]) -> None:
        """step_mm: float64 [3], nominal travel of each carriage per step."""
        self._controller = controller
        self._plant = plant
        self.step_mm = step_mm
        self._start_mm = plant.position_mm.copy()
        self._period = plant.slip_steps.copy()
        self._closed = plant.closed_loop.copy()
        """bool [axes], with servo drives: a difference when a counter is set is a new zero, no slip."""
        self._slip = np.zeros(len(controller.counts))
        self._forgotten = np.zeros(len(controller.counts))
        self._encoder_zero = np.zeros(len(controller.counts))
        self.spindle_now: Callable[[], float | None] = lambda: None
        """Speed of the spindle in rev/min at the present, None without one."""
        self.before_change: Callable[[], None] | None = None  # called before zeros or directions change
        self._turned = tuple(controller.direction)  # directions that the zeros belong to
        self._zero_mm = self._zeros()
        self._sense, self._mirrored = self._senses()

    def start_anew(self, controller: Controller) -> None:
        """Take another controller of the same axes; its counters are true at the present positions."""
        self._controller = controller
        for axis, count in enumerate(controller.counts):
            self.counter_set(axis, count)

    def counter_set(self, axis: int, value: int) -> None:
        """Take a counter that the controller has set without a motion."""
        self.follow_direction()
        if self.before_change is not None:
            self.before_change()
        told, rotor, sense = self._plant.told[axis], self._plant.rotor[axis], self._direction[axis]
        if self._closed[axis]:  # a servo drive keeps its zero from switching on; its lag is no slip
            slip = float(self._plant.command[axis] - rotor - self._plant.lag[axis])
        else:
            slip = round((told - rotor) / self._period[axis]) * self._period[axis]
            self._forgotten[axis] += abs(slip - self._slip[axis])
        self._slip[axis] = slip
        self._encoder_zero[axis] = value - sense * told
        if axis < len(self._zero_mm):
            self._zero_mm[axis] = self._zeros()[axis]

    def follow_direction(self) -> tuple[int, ...]:
        """Compute new zeros if a direction has changed; return the directions. Called before a motion, when counters
        and drives agree."""
        direction = self._controller.direction
        if direction != self._turned:
            if self.before_change is not None:
                self.before_change()
            self._turned = tuple(direction)
            self._sense, self._mirrored = self._senses()
            self._zero_mm = self._zeros()
        return self._turned

    @property
    def counts(self) -> NDArray[np.int64]:
        """int64 [axes], the controller's counters."""
        return np.array(self._controller.counts, dtype=np.int64)

    @property
    def position_mm(self) -> NDArray[np.float64]:
        """float64 [3], true positions in the zero and direction of the counters."""
        if self._controller.direction is not self._turned:
            self.follow_direction()
        return self.of_carriages_mm(self._plant.position_mm)

    def of_carriages_mm(self, carriages_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [..., 3], from machine coordinates to zero and direction of the counters."""
        beyond_mm: NDArray[np.float64] = carriages_mm - self._zero_mm
        return self._sense * beyond_mm if self._mirrored else beyond_mm

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        """float64 [3], true velocities in the direction of the counters."""
        self.follow_direction()
        return self.of_velocities_mm_s(self._plant.velocity_mm_s)

    def of_velocities_mm_s(self, velocity_mm_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [..., 3], from machine coordinates to the direction of the counters."""
        return self._sense * velocity_mm_s if self._mirrored else velocity_mm_s.copy()

    @property
    def error_mm(self) -> NDArray[np.float64]:
        """float64 [3], true position minus counter: lag, lost steps, backlash, load and errors of the screw."""
        return position_error_mm(self.position_mm, self.counts, self.step_mm)

    @property
    def lost_steps(self) -> NDArray[np.float64]:
        """float64 [axes], counter minus rotor since each counter was set; fractions are load angle. 0 for servo
        drives, which lag and lose nothing."""
        lost: NDArray[np.float64] = self._direction * (self._plant.commanded - self._plant.rotor - self._slip)
        lost[self._closed] = 0.0
        return lost

    def lost_of(self, commanded: NDArray[np.int64], rotor: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [..., axes], lost steps for other commands and rotors."""
        lost: NDArray[np.float64] = self.turned * (commanded - rotor - self._slip)
        lost[..., self._closed] = 0.0
        return lost

    @property
    def turned(self) -> NDArray[np.int64]:
        """int64 [axes], the directions that the zeros belong to."""
        return np.array(self._turned, dtype=np.int64)

    @property
    def offset(self) -> NDArray[np.int64]:
        """int64 [axes], counters minus commands, in the direction of the counters."""
        self.follow_direction()
        return self.counts - self.turned * self._plant.told

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        """float64 [axes], steps in one slip of each motor, four full steps."""
        return self._period.copy()

    @property
    def forgotten_steps(self) -> NDArray[np.float64]:
        """float64 [axes], steps lost since power-on, either way, that `lost_steps` dropped when counters were set."""
        return self._forgotten.copy()

    # Drives, for controllers that read them

    @property
    def encoder(self) -> tuple[int, ...]:
        measured = self._direction * (self._plant.rotor + self._slip) + self._encoder_zero
        return tuple(int(n) for n in measured.round())

    @property
    def lag(self) -> tuple[float, ...]:
        slip = np.where(self._closed, 0.0, self._slip)  # a drive that was switched on again has no slip
        return tuple((self._direction * (self._plant.lag - slip)).tolist())

    @property
    def in_position(self) -> tuple[bool, ...]:
        return tuple(self._plant.in_position.tolist())

    @property
    def overloaded(self) -> tuple[bool, ...]:
        return tuple(self._plant.overloaded.tolist())

    @property
    def speed(self) -> tuple[float, ...]:
        return tuple((self._direction * self._plant.rotor_speed).tolist())

    @property
    def past_zero_pulse(self) -> tuple[int, ...]:  # plant/18
        turn = self._plant.turn_steps
        start = np.zeros(len(turn))
        start[: len(self._start_mm)] = (self._start_mm / self.step_mm)[: len(turn)]
        return tuple(int(n) for n in np.floor(self._direction * (self._plant.rotor + start)) % turn)

    @property
    def on(self) -> tuple[bool, ...]:
        return tuple(self._plant.powered.tolist())

    @property
    def fault(self) -> tuple[bool, ...]:
        return tuple(self._plant.fault.tolist())

    def _senses(self) -> tuple[NDArray[np.int64], bool]:
        """int64 [3], direction of each carriage; True if one is turned round."""
        sense = _of_carriages(self._direction, 1)
        return sense, bool((sense < 0).any())

    def _zeros(self) -> NDArray[np.float64]:
        beyond = _of_carriages(self._plant.told - self._direction * self.counts - self._slip)
        zero_mm: NDArray[np.float64] = self._start_mm + beyond * self.step_mm
        return zero_mm

    @property
    def spindle_rev_min(self) -> float | None:
        return self.spindle_now()

    @property
    def _direction(self) -> NDArray[np.int64]:
        return np.array(self._controller.direction, dtype=np.int64)


def _of_carriages(values: NDArray[Any], missing: int = 0) -> NDArray[Any]:
    """The first three of values [axes], filled up with `missing`."""
    if len(values) >= len(CARRIAGES):
        return values[: len(CARRIAGES)]
    return np.concatenate((values, np.full(len(CARRIAGES) - len(values), missing, dtype=values.dtype)))
