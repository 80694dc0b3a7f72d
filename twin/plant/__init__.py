"""Torque to motion: the plants, and what every plant offers to the twin.

margin.py      how far a motor was from falling out of step
lead.py        the command of an axis between two set points, led evenly from one to the next
kernel.py      the compiled loop: drives and MuJoCo together, up to the first threshold passed
glide.py       MuJoCo's step between the stops, written out
built.py       a machine put together for it: model and arrays
altered.py     what events change in the model while it works
mujoco.py      the MuJoCo plant (default)
samples.py     samples that the loop takes by itself
model.py       the MuJoCo model of a machine
cutting.py     forces of a milling cutter: what it is, equations
teeth.py       and tooth by tooth, compiled
picture.py     what it looks like
kinematic.py   the carriage follows its command exactly; thresholds still work
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.drives.stage import AnyStage
from isel_twin.plant.cutting import Cut

__all__ = ["MOST_SAMPLES", "PLACES", "Cut", "Plant", "Quantity", "Sampled", "Samples", "Threshold"]

PLACES: Mapping[str, str] = {"tool": "tool", "table": "table_top"}
"""Where a force can act from outside, and the site of the MuJoCo model that stands for it."""

Quantity = Literal["position", "lag", "fault"]  # what a threshold watches


@dataclass(frozen=True)
class Threshold:
    """A limit of one quantity of one axis; `Plant.advance` returns early where it is passed.

        position   a switch: passed while sense * (carriage - limit) > 0, in mm of machine coordinates
        lag        following error: passed while |command as led by now - rotor| > limit, in microsteps of the command
        fault      passed while the drive of the axis is faulty; limit, sense and hysteresis mean nothing

    It stays passed until the quantity is back by at least the hysteresis. Raises ValueError for an unknown quantity, an
    axis that cannot have it, a sense that is neither 1 nor -1, and numbers that are not finite.
    """

    axis: int  # 0 X, 1 Y ...; a carriage (X, Y, Z) if it is a position
    quantity: Quantity
    limit: float = 0.0
    sense: int = 1  # of a position: -1 motor end, struck below the limit; +1 far end, struck above it
    hysteresis: float = 0.0  # in the unit of the limit

    def __post_init__(self) -> None:
        if self.quantity not in get_args(Quantity):
            raise ValueError(f"threshold: quantity {self.quantity!r}; there are: {', '.join(get_args(Quantity))}")
        names = CARRIAGES if self.quantity == "position" else AXIS_NAMES
        if self.axis not in range(len(names)):
            raise ValueError(f"threshold: axis {self.axis!r} has no {self.quantity}; allowed: 0 to {len(names) - 1}")
        if self.sense not in (-1, 1):
            raise ValueError(f"threshold: sense {self.sense!r}; allowed: -1, 1")
        if not math.isfinite(self.limit) or not 0.0 <= self.hysteresis < math.inf:
            raise ValueError(f"threshold: limit {self.limit!r}, hysteresis {self.hysteresis!r}; give finite numbers")


class Plant(Protocol):
    """A plant advances the machine and reports where it is.

    Coordinates: machine coordinates in mm, 0 at the motor-end switch's nominal trip point of each axis, increasing away
    from the motor; commands and rotors in microsteps of the stage, same sense. Changes handed to `advance` are in the
    sense of the motor (the twin has applied the controller's direction setting).

    Commands: a tick changes the command of an axis by a whole number, at once (lead 0: steps) or led evenly over a time
    that begins with the tick (set points). With `commanded` the sum of all ticks, the command as led by t is

        command(t) = commanded - pending max(0, (end - t) / lead)          a tick at t: pending' = rest at t + change,
                                                                           end' = t + lead

    so a tick that comes before the lead of the one before is over takes the rest of it along, and nothing jumps; a tick
    without a change of the axis leaves its lead alone. A step in that time is made at once, and the lead goes on beside
    it until it is over. When a motion is cut, the leads of the ticks that were made are finished all the same.

    Axes beyond the carriages have no mechanics: what they are told, they do.

    Time: how a stretch of time is cut into calls never changes a bit of the result. A plant with drives runs on a fixed
    grid of sub-steps counted from power-on; ticks after the last whole sub-step are kept, with their lead, for the next
    call. One without them knows no grid.
    """

    physics: bool  # forces from outside and lost motor phases have an effect
    time_ns: int  # time reached: a multiple of the sub-step, if there are sub-steps
    edge: bool  # the last `advance` has ended because a threshold was passed or left

    def advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int = 0) -> int:
        """Advance to until_ns or to the end of the first sub-step in which a threshold was passed or left (without
        sub-steps: to the first nanosecond at which one is); return the time reached.

        t_ns [n], never decreasing, delta [n, axes]: all ticks in (last until_ns or time reached, until_ns]; lead_ns:
        the time over which each of them is led, 0 if they are steps.
        When it returns early (at time t), the ticks after t have not been made and must be handed in again if they
        still happen; those at or before t have. Returns until_ns otherwise.
        """

    def trips(self) -> NDArray[np.bool_]:
        """bool [m], which of the thresholds given to the plant are passed now, in the order given."""

    def set_power(self, stages: bool, brake_released: bool, lowering: bool) -> None:
        """Stages on or off (open phases: motors go limp), holding brake, current lowered at rest or not."""

    def set_trip_point(self, threshold: int, position_mm: float) -> None:
        """Move one threshold of a position (the repeatability of a switch, drawn by the wiring for each approach).

        ValueError if it is not one. A carriage that the point has passed meets it when next something moves.
        """

    def apply_force(self, axis: int, force_n: float, place: str = "") -> None:
        """Push the machine from outside along one axis (0 X .. 2 Z), in N, until told otherwise: a hand.

        place: one of PLACES; "": the one that this axis moves. A positive force pushes tool or table the way that
        `position_mm` rises, and loads every joint between there and the ground. An axis has one push: a new one
        replaces it, wherever it was. ValueError for a place that does not exist.
        """

    def set_cut(self, cut: Cut | None) -> None:
        """Begin a cut (cutting.py), which pushes the tool, and the table the other way, as long as the tool goes over
        the table; None ends it. A new one replaces it.
        """

    def reset_drives(self) -> None:
        """Clear the faults of drives that have switched themselves off, so that they have current again while their
        stages are on. Switching the stages on clears them, too."""

    def set_phase_lost(self, axis: int, phases: str) -> None:
        """Interrupt motor phases of one axis: "a", "b", "ab", or "" to restore them. A servo motor has no current with
        any of them broken, and its drive does not know."""

    def set_friction(self, axis: int, extra_n: float) -> None:
        """Add dry friction to the guides of one axis, in N, 0 or more."""

    def set_obstacle(self, axis: int, position_mm: float | None) -> None:
        """Put something in the way of a carriage, as firm as its hard stops: it cannot go beyond this position in
        machine coordinates, seen from where it is now, whatever the other axes do. None takes it away."""

    def set_payload(self, place: str, mass_kg: float) -> None:
        """Add a load at one of PLACES to what the machine carries there: a mass at its site, 0 or more."""

    def set_undervoltage(self, missing: float) -> None:
        """Take away this part of the supply voltage of all drives, 0 to 0.95; of the source, if they have a common
        supply, so that they switch off where it goes too low."""

    @property
    def position_mm(self) -> NDArray[np.float64]:
        """float64 [3], true carriage positions X, Y, Z in machine coordinates, at the time last advanced to."""

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        """float64 [3], true carriage velocities X, Y, Z."""

    @property
    def commanded(self) -> NDArray[np.int64]:
        """int64 [axes], sum of the changes that the drives have been given since power-on, in microsteps."""

    @property
    def told(self) -> NDArray[np.int64]:
        """int64 [axes], the same with the changes after the last whole sub-step, which no drive has been given yet."""

    @property
    def command(self) -> NDArray[np.float64]:
        """float64 [axes], the command as led by now, in microsteps; equal to `commanded` while nothing is led."""

    @property
    def rotor(self) -> NDArray[np.float64]:
        """float64 [axes], measured rotor positions in microsteps; equal to `command` for unloaded motors that lost
        nothing and stand, and for axes beyond the carriages."""

    @property
    def lag(self) -> NDArray[np.float64]:
        """float64 [axes], following error in microsteps: command - rotor. A servo drive takes the place in which it
        was switched on for the one it is told; that difference is not in it."""

    @property
    def powered(self) -> NDArray[np.bool_]:
        """bool [axes], which drives have current."""

    @property
    def fault(self) -> NDArray[np.bool_]:
        """bool [axes], which drives have switched themselves off; the stage of a stepper motor only while a common
        supply has too little voltage for it; a servo drive for that, or a following error, until `reset_drives`."""

    @property
    def closed_loop(self) -> NDArray[np.bool_]:
        """bool [axes], which axes have servo drives: they lose no steps."""

    @property
    def drive_faults(self) -> tuple[tuple[int, str], ...]:
        """[axes], how often each servo drive has switched itself off since power-on, and why it did last ("": never);
        what has been forgotten counts, too."""

    @property
    def overloaded(self) -> NDArray[np.bool_]:
        """bool [axes], which servo drives let no more than the rated current flow, by their I2t."""

    @property
    def in_position(self) -> NDArray[np.bool_]:
        """bool [axes], where the following error has been within its window for its time (servo drives that are on), or
        is nothing (all others)."""

    @property
    def rotor_speed(self) -> NDArray[np.float64]:
        """float64 [axes], speeds of the rotors in microsteps/s."""

    @property
    def turn_steps(self) -> NDArray[np.float64]:
        """float64 [axes], microsteps in a revolution of each motor; 1 for axes beyond the carriages."""

    @property
    def stages(self) -> tuple[AnyStage, ...]:
        """The power stages, in the order of the axes; none if the plant has no currents."""

    @property
    def current_fraction(self) -> NDArray[np.float64]:
        """float64, one for each of `stages`: phase current over nominal at this moment, 0 while it is off. Of a servo
        drive: its current over the rated one, root mean square over the time of its I2t."""

    @property
    def supply_v(self) -> float:
        """Voltage of the common supply of the stages; nan if the machine has none, or the plant no currents."""

    @property
    def margin(self) -> NDArray[np.float64]:
        """float64 [axes], least pull-out margin of each motor since `watch_margin`, or since power-on: 1 nothing was
        asked of it, 0 it may have lost its hold (margin.py); nan for axes without a motor. Of a servo drive: what is
        left to the limit of its following error, 0 it has switched itself off."""

    def take_margin(self) -> NDArray[np.float64]:
        """float64 [axes], `margin`, which begins anew without a look of its own: 1 until the next window is over."""

    def watch_margin(self) -> None:
        """Begin anew with the least margins, from a look at the present."""

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        """float64 [axes], microsteps in one slip of a motor: a period of its torque, four full steps; one for a motor
        that does not slip."""

    @property
    def at_rest(self) -> bool:
        """True when nothing moves or is led, and nothing will before the next tick or setting: time may be skipped."""

    def save(self) -> Mapping[str, Any]:
        """The whole state as copies that can be pickled, without the samples that wait."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over the state saved by a plant of the same machine, thresholds and axes, to the bit. Samples that wait
        are dropped; how often they are taken stays as it is."""


@dataclass(frozen=True, eq=False)
class Samples:
    """n samples of a plant, as its properties would have been at those times. Arrays are copies."""

    time_ns: NDArray[np.int64]  # int64 [n], rising
    position_mm: NDArray[np.float64]  # float64 [n, 3]
    velocity_mm_s: NDArray[np.float64]  # float64 [n, 3]
    commanded: NDArray[np.int64]  # int64 [n, axes]
    rotor: NDArray[np.float64]  # float64 [n, axes]
    current_fraction: NDArray[np.float64]  # float64 [n, m], of the stages
    margin: NDArray[np.float64]  # float64 [n, axes]
    supply_v: NDArray[np.float64]  # float64 [n]


@runtime_checkable
class Sampled(Protocol):
    """A plant that takes samples by itself while it advances, on a grid of time.

    While nothing moves one sample is taken, at the first time of the grid: the others would be the same.
    """

    def fits(self, interval_ns: int) -> bool:
        """True if the plant can take samples at this interval: its own grid has these times."""

    def sample_every(self, interval_ns: int, from_ns: int = 0) -> None:
        """Take samples from now on, at from_ns and so often before and after it; 0: no more, and those that wait are
        dropped. Between sub-steps positions are as `Plant.position_mm` has them; all else is as after the last whole
        one. ValueError if the interval does not fit."""

    def sample_again(self) -> None:
        """Take a sample at the next time of the grid even if nothing moves: something beside the plant has changed."""

    @property
    def samples_waiting(self) -> int:
        """Samples not read yet; beyond MOST_SAMPLES they are lost."""

    def take_samples(self) -> Samples:
        """Read the samples that wait."""


MOST_SAMPLES = 2048  # samples that a plant keeps until they are read
