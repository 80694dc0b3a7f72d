"""Torque to motion: the plants, and the protocol that every plant offers to the twin.

kinematic.py   the carriage follows its command exactly; thresholds still work: following.py, compiled; ideal.py: its
               drives
mujoco.py      the MuJoCo plant (default)
built.py       a machine put together for it (prepared.py): model.py (the MuJoCo model), memory.py (arrays), weighing.py
reach.py       which shapes can meet; clamped.py: what is clamped on the table, and who must not meet whom
contact.py     collisions and least distances, on both plants; collision.py: one as a value
altered.py     what events change in the model while it works; pushing.py: forces from outside; power.py: what the
               drives are told
touch.py       a touch probe, or a plate for tool lengths
kernel.c       the compiled loop: drives and MuJoCo together, up to the first threshold passed; in it
               lead.h (commands between set points), window.h (from MuJoCo's step to the next), glide.h (that step
               between the stops), thread.h (uneven screws), feed.h (common supply), margin.h (distance from falling
               out of step), teeth.h (of a cut), touch.h, samples.h; their data are in the modules of the same name,
               and memory.py
cutting.py     a cut as data; materials.py: specific cutting forces
samples.py     samples that the loop takes by itself
picture.py     what it looks like
scene.py       its bodies as meshes, where they are, the trail of the tool
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeAlias, get_args, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.drives.stage import AnyStage
from isel_twin.plant.collision import Clearance, Collision
from isel_twin.plant.cutting import Cut
from isel_twin.plant.cutting import torque_nm as cutting_torque_nm

__all__ = [
    "MOST_CLEARANCE_MM",
    "MOST_SAMPLES",
    "PLACES",
    "Clearance",
    "Collision",
    "Cut",
    "Plant",
    "PlantError",
    "Quantity",
    "Sampled",
    "Samples",
    "Threshold",
    "cutting_torque_nm",
]

PLACES: Mapping[str, str] = {"tool": "tool", "table": "table_top"}  # where a force can act: name, site of the model
MOST_CLEARANCE_MM = 20.0  # two bodies that never come nearer are not looked at
Quantity = Literal["position", "lag", "fault", "touch"]  # what a threshold watches


class PlantError(RuntimeError):
    """A joint has run away: the state is meaningless."""


@dataclass(frozen=True)
class Threshold:
    """A limit of one quantity of one axis; `Plant.advance` returns early where it is passed.

        position   a switch: passed while sense * (carriage - limit) > 0, in mm of machine coordinates
        lag        following error: passed while |momentary command - rotor| > limit, in microsteps of the command
        fault      passed while the drive of the axis is faulty; limit, sense and hysteresis are not used
        touch      passed while the machine's feeler (touch.py) is deflected by more than the limit in mm; without sense

    It stays passed until the quantity is back by at least the hysteresis. Raises ValueError for impossible values.
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

    so a tick that comes during the lead of the one before takes over the rest of it, and nothing jumps; a tick without
    a change of the axis does not touch its lead. A step during a lead is made at once, and the lead goes on. When a
    motion is cut, the leads of the ticks that were made are still finished.

    Axes beyond the carriages have no mechanics: they always are at their command.

    Time: the result is the same to the bit however a stretch of time is cut into calls. A plant with drives runs on a
    fixed grid of sub-steps counted from power-on; ticks after the last whole sub-step are kept, with their lead, for
    the next call. One without drives has no grid.
    """

    physics: bool  # forces from outside and lost motor phases have an effect
    time_ns: int  # time reached: a multiple of the sub-step, if there are sub-steps
    edge: bool  # the last `advance` ended because a threshold was passed or left, or two bodies met

    def advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int = 0) -> int:
        """Advance to until_ns or to the end of the first sub-step in which a threshold was passed or left, or two
        bodies that must not meet were found to touch (without sub-steps: to the first nanosecond at which that is so);
        return the time reached.

        t_ns [n], never decreasing, delta [n, axes]: all ticks in (last until_ns or time reached, until_ns]; lead_ns:
        the time over which each is led, 0 for steps. When it returns early, the ticks after that time have not been
        made and must be handed in again if they still happen.
        """

    def trips(self) -> NDArray[np.bool_]:
        """bool [m], which of the thresholds given to the plant are passed now, in the order given."""

    def take_collisions(self) -> tuple[Collision, ...]:
        """Who has met since the last call, in machine coordinates. Empty unless something is clamped on the table, or,
        with physics, the tool reaches the table."""

    @property
    def may_collide(self) -> bool:
        """True if there are bodies that must not meet, and can."""

    def watch_clearance(self) -> Any:
        """Something that keeps the least distance of bodies that must not meet (contact.Least) from now on, told of the
        path by the plant, or by whoever samples it. None if there are no such bodies."""

    def set_power(self, stages: bool, brake_released: bool, lowering: bool) -> None:
        """Stages on or off (open phases: motors go limp), holding brake, current lowered at rest or not."""

    def set_trip_point(self, threshold: int, position_mm: float) -> None:
        """Move one threshold of a position, or of a touch (its repeatability, drawn by the wiring for each approach).

        ValueError if it is neither. A carriage that is now beyond the point is noticed when something moves next.
        """

    def apply_force(self, axis: int, force_n: float, place: str = "") -> None:
        """Push the machine from outside along one axis (0 X .. 2 Z), in N, until the next call: a hand (plant/11).

        place: one of PLACES; "": the one that this axis moves. A positive force pushes tool or table the way that
        `position_mm` rises, and loads every joint between there and the ground. A new push replaces that of the axis,
        wherever it was. ValueError for a place that does not exist.
        """

    def set_cut(self, cut: Cut | None) -> None:
        """Begin a cut (cutting.py) in place of the present one: it pushes the tool, and the table the other way, while
        the tool goes over the table. None ends it."""

    def turn_cut(self, speed_rev_min: float) -> None:
        """Turn the cutter of the present cut, if any, at another speed, more than 0."""

    def reset_drives(self) -> None:
        """Clear the faults of drives that have switched themselves off, as switching the stages on does."""

    def set_phase_lost(self, axis: int, phases: str) -> None:
        """Interrupt motor phases of one axis: "a", "b", "ab", or "" to restore them. A servo motor has no current with
        any of them broken, and its drive does not know (plant/17)."""

    def set_friction(self, axis: int, extra_n: float) -> None:
        """Add dry friction to the guides of one axis, in N, 0 or more."""

    def set_obstacle(self, axis: int, position_mm: float | None) -> None:
        """Put something as firm as a hard stop in the way of a carriage, at this position in machine coordinates, which
        it cannot pass from where it is now. None takes it away."""

    def set_payload(self, place: str, mass_kg: float) -> None:
        """Add a load of 0 or more at the site of one of PLACES."""

    def set_undervoltage(self, missing: float) -> None:
        """Take away this part, 0 to 0.95, of the supply voltage of all drives, or of the source of a common supply."""

    @property
    def position_mm(self) -> NDArray[np.float64]:
        """float64 [3], true carriage positions X, Y, Z in machine coordinates, at the time last advanced to, as a gauge
        at the tip of the tool shows them: with what frame and tool give."""

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        """float64 [3]."""

    @property
    def commanded(self) -> NDArray[np.int64]:
        """int64 [axes], sum of the changes that the drives have been given since power-on, in microsteps."""

    @property
    def told(self) -> NDArray[np.int64]:
        """int64 [axes], `commanded` plus the changes after the last whole sub-step, which no drive has got yet."""

    @property
    def command(self) -> NDArray[np.float64]:
        """float64 [axes], the momentary command in microsteps; equal to `commanded` outside leads."""

    @property
    def rotor(self) -> NDArray[np.float64]:
        """float64 [axes], measured rotor positions in microsteps; equal to `command` for unloaded motors at rest that
        lost nothing, and for axes beyond the carriages."""

    @property
    def lag(self) -> NDArray[np.float64]:
        """float64 [axes], following error in microsteps: command - rotor, for a servo drive without the difference that
        it had when it was switched on."""

    @property
    def powered(self) -> NDArray[np.bool_]:
        """bool [axes], which drives have current."""

    @property
    def fault(self) -> NDArray[np.bool_]:
        """bool [axes], which drives have switched themselves off: a stepper's stage while a common supply has too
        little voltage; a servo drive for that, or a following error, until `reset_drives`."""

    @property
    def closed_loop(self) -> NDArray[np.bool_]:
        """bool [axes], which axes have servo drives: they lose no steps."""

    @property
    def drive_faults(self) -> tuple[tuple[int, str], ...]:
        """[axes], how often each servo drive has switched itself off since power-on, and why last ("": never)."""

    @property
    def overloaded(self) -> NDArray[np.bool_]:
        """bool [axes], which servo drives are held to the rated current by their I2t."""

    @property
    def in_position(self) -> NDArray[np.bool_]:
        """bool [axes], where the following error has been within its window for its time (servo drives), or is 0."""

    @property
    def rotor_speed(self) -> NDArray[np.float64]:
        """float64 [axes], speeds of the rotors in microsteps/s."""

    @property
    def turn_steps(self) -> NDArray[np.float64]:
        """float64 [axes], microsteps in a revolution of each motor; 1 for axes beyond the carriages."""

    @property
    def stages(self) -> tuple[AnyStage, ...]:
        """Stages of the axes; none if the plant has no currents."""

    @property
    def current_fraction(self) -> NDArray[np.float64]:
        """float64 [stages], phase current over nominal now, 0 while off; of a servo drive: current over the rated one,
        root mean square over the time of its I2t."""

    @property
    def force_n(self) -> NDArray[np.float64]:
        """float64 [3], of each nut upon its carriage in N, the mean of the last window; nan without physics."""

    @property
    def supply_v(self) -> float:
        """Voltage of the common supply of the stages; nan if the machine has none, or the plant no currents."""

    @property
    def margin(self) -> NDArray[np.float64]:
        """float64 [axes], least pull-out margin of each motor since `watch_margin`, or power-on: from 1 (idle) to 0
        (may have lost its hold; margin.py), nan without a motor. Of a servo drive: part of its lag limit that is
        left."""

    @property
    def fastest_rad_s(self) -> NDArray[np.float64]:
        """float64 [axes], largest speed of each stepper motor since `watch_margin`, or power-on, smoothed over ten
        windows; with a supply that sags, over its voltage. nan without such a motor."""

    def take_margin(self) -> NDArray[np.float64]:
        """float64 [axes], the same since the last call of this: 1 until the next window is over. `margin` stays."""

    def watch_margin(self) -> None:
        """Reset the least margins to those of now."""

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        """float64 [axes], microsteps in one slip of a motor, four full steps; 1 for one that does not slip."""

    @property
    def at_rest(self) -> bool:
        """True when nothing moves, nor will before the next tick or setting: time may be skipped."""

    def save(self) -> Mapping[str, Any]:
        """The whole state as copies that can be pickled, without unread samples."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over the state saved by a plant of the same machine, thresholds and axes, to the bit. Unread samples are
        dropped; the sampling interval stays."""


@dataclass(frozen=True, eq=False)
class Samples:
    """n samples of a plant: its properties at those times, as copies."""

    time_ns: NDArray[np.int64]  # int64 [n], rising
    position_mm: NDArray[np.float64]  # float64 [n, 3]
    velocity_mm_s: NDArray[np.float64]  # float64 [n, 3]
    commanded: NDArray[np.int64]  # int64 [n, axes]
    rotor: NDArray[np.float64]  # float64 [n, axes]
    current_fraction: NDArray[np.float64]  # float64 [n, m], of the stages
    margin: NDArray[np.float64]  # float64 [n, axes]
    force_n: NDArray[np.float64]  # float64 [n, 3], of the nuts; nan without physics
    supply_v: NDArray[np.float64]  # float64 [n]


@runtime_checkable
class Sampled(Protocol):
    """A plant that takes samples while it advances, on a grid of time. While nothing moves it takes only the first one:
    the others would be the same.
    """

    def fits(self, interval_ns: int) -> bool:
        """True if the plant can take samples at this interval, by its own grid."""

    def sample_every(self, interval_ns: int, from_ns: int = 0) -> None:
        """Take samples from now on, on a grid that has from_ns; 0: stop, and drop unread ones. Between sub-steps
        positions are those of `Plant.position_mm`, all else is of the last whole one. ValueError if the interval does
        not fit."""

    def sample_again(self) -> None:
        """Take a sample at the next time of the grid even if nothing moves: something outside the plant has changed."""

    @property
    def samples_waiting(self) -> int:
        """Samples not read yet; beyond MOST_SAMPLES they are lost."""

    def take_samples(self) -> Samples: ...


# counts int64 [n, axes] from the beginning of a way, in the sense of the motors, at rising times int64 [n] on it
Along: TypeAlias = Callable[[NDArray[np.int64]], NDArray[np.int64]]


@runtime_checkable
class GoesStraight(Protocol):
    """A plant that need not be told of each step of a straight way."""

    def room(self) -> tuple[list[int], list[int]] | None:
        """How far each axis may go from here, below and above, in counts [axes] in the sense of the motors, until
        something may change that the plant looks out for; None if it has to be told of each step."""

    def go_straight(self, until_ns: int, way: Sequence[int], along: Along) -> None:
        """Advance to until_ns while each axis goes one way by so many counts, [axes] in the sense of the motors. It
        leaves its `room` with the last step at most. along: where it is on the way, if samples ask for it."""


@runtime_checkable
class FindsArrival(Protocol):
    """A plant that can tell when its drives are in position without being asked again and again."""

    def finds_arrival(self, period_ns: int) -> bool:
        """True if it can, on a grid of this period."""

    def arrive(self, until_ns: int, first_ns: int, period_ns: int) -> tuple[int, bool]:
        """Advance without a tick, as `advance` does, but at most to the first time first_ns, first_ns + period_ns ...
        not before the present at which all axes are in position; return the time reached, and whether it is that."""


MOST_SAMPLES = 2048  # unread samples that a plant keeps
