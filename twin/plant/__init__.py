"""Torque to motion: the plants, and what every plant offers to the twin.

kernel.py      the compiled loop: drives and MuJoCo together, up to the first switch edge
mujoco.py      the MuJoCo plant around it (default)
model.py       the MuJoCo model of a machine
picture.py     what it looks like
kinematic.py   the carriage follows the counter exactly; switches still work
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.stage import Stage

__all__ = ["Plant", "Switch"]


@dataclass(frozen=True)
class Switch:
    """A position switch as the plant sees it: struck while sense * (position - trip_mm) > 0, with hysteresis.

    Released again when the carriage is hysteresis_mm back from the trip point.
    """

    axis: int
    """0 X, 1 Y, 2 Z."""
    trip_mm: float
    """Trip point in machine coordinates."""
    sense: int
    """-1: motor end, struck below the trip point; +1: far end, struck above it."""
    hysteresis_mm: float


class Plant(Protocol):
    """A plant advances the machine and reports where it is.

    Coordinates: machine coordinates in mm, 0 at the motor-end switch's nominal trip point of each axis, increasing away
    from the motor; the rotor in microsteps of the stage, same sense. Steps handed to `advance` are in the sense of the
    motor (the twin has applied the controller's direction setting).

    Time: the plant runs on a fixed grid of sub-steps counted from power-on, so how a stretch of time is cut into calls
    never changes a bit of the result. Pulses after the last whole sub-step are kept for the next call.
    """

    time_ns: int
    """Time reached: a multiple of the sub-step."""

    def advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any]) -> int:
        """Advance to until_ns or to the end of the first sub-step in which a switch changed; return the time reached.

        t_ns [n], delta [n, axes]: all pulses in (last until_ns or time reached, until_ns].
        When it returns early (at time t), the pulses after t have not been made and must be handed in again if they
        still happen. Returns until_ns otherwise.
        """

    def trips(self) -> NDArray[np.bool_]:
        """bool [m], which of the position switches given to the plant are struck now, in the order given."""

    def set_power(self, stages: bool, brake_released: bool, lowering: bool) -> None:
        """Stages on or off (open phases: motors go limp), holding brake, current lowered at rest or not."""

    def set_trip_point(self, switch: int, position_mm: float) -> None:
        """Move the trip point of one position switch (its repeatability, drawn by the wiring for each approach)."""

    def apply_force(self, axis: int, force_n: float) -> None:
        """Push one carriage (0 X .. 2 Z) along its axis from outside, in N, until told otherwise: a hand, a cut."""

    def set_phase_lost(self, axis: int, phases: str) -> None:
        """Interrupt motor phases of one axis: "a", "b", "ab", or "" to restore them."""

    @property
    def position_mm(self) -> NDArray[np.float64]:
        """float64 [3], true carriage positions X, Y, Z in machine coordinates."""

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        """float64 [3], true carriage velocities X, Y, Z."""

    @property
    def commanded(self) -> NDArray[np.int64]:
        """int64 [axes], sum of the pulses received since power-on, in microsteps."""

    @property
    def rotor(self) -> NDArray[np.float64]:
        """float64 [axes], rotor positions in microsteps; equal to `commanded` for unloaded motors that lost nothing."""

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The power stages, in the order of the axes; none if the plant has no currents."""

    @property
    def current_fraction(self) -> NDArray[np.float64]:
        """float64, one for each of `stages`: phase current over nominal at this moment, 0 while it is off."""

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        """float64 [axes], microsteps in one slip of a motor: a period of its torque, four full steps."""

    @property
    def at_rest(self) -> bool:
        """True when nothing moves and nothing will before the next pulse or setting: time may be skipped."""
