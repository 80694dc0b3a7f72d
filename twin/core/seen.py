"""The readable state of a twin. Reading changes nothing, except that the controller may be advanced to the present."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.controller import Arrival, Controller, EndsPrograms, HasKeys, KeyValue, SerialFormat, TellsFault, offers
from isel_twin.core.position import Position
from isel_twin.core.spec import TwinSpec
from isel_twin.drives.motor import Motor
from isel_twin.drives.stage import Stage
from isel_twin.machine import Machine
from isel_twin.motion import Steps, Stream
from isel_twin.plant import Plant
from isel_twin.wiring import LineFaults, SerialLine, Wiring

_MOVING_SLICE_NS = 10 * MILLISECOND_NS  # time after which to look again while something moves


SLOW_RAD_S = 1.0  # no motor swings at ten revolutions a minute
IN_C = ("SLOW_RAD_S",)  # records.h has them, too


class Seen:
    """The part of a `Twin` that is read."""

    origin: TwinSpec
    machine: Machine
    time_ns: int  # virtual time since power-on
    _controller: Controller
    _plant: Plant
    _position: Position
    _stream: Stream
    _line: SerialLine
    _wiring: Wiring
    _levels: Mapping[str, bool]
    _arrival: Arrival | None

    def _tell(self) -> None:
        raise NotImplementedError

    @property
    def key_values(self) -> Mapping[str, KeyValue]:
        """State of the controller's keys; empty without any, and without supply."""
        self._tell()
        return self._controller.key_values if offers(self._controller, HasKeys) else {}

    @property
    def unfinished(self) -> str:
        """Where and why the controller's program stopped before its end; "" if it did not."""
        self._tell()
        return self._controller.unfinished if offers(self._controller, EndsPrograms) else ""

    @property
    def counts(self) -> NDArray[np.int64]:
        """int64 [axes], the controller's counters X Y Z A ..."""
        self._tell()
        return self._position.counts

    @property
    def position_mm(self) -> NDArray[np.float64]:
        """float64 [3], true carriage positions in mm, in the zero and direction of the counters."""
        return self._position.position_mm

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        """float64 [3], true carriage velocities in mm/s, in the direction of the counters."""
        return self._position.velocity_mm_s

    @property
    def force_n(self) -> NDArray[np.float64]:
        """float64 [3], force of each nut upon its carriage in N, in the direction of the counters: the mean of the last
        window of MuJoCo's steps; nan without physics."""
        return self._position.of_velocities_mm_s(self._plant.force_n)

    @property
    def current_fraction(self) -> NDArray[np.float64]:
        """float64, phase current over nominal of each motor at this moment; empty without physics."""
        return self._plant.current_fraction

    @property
    def position_error_mm(self) -> NDArray[np.float64]:
        """float64 [3], true position minus counter, in mm."""
        self._tell()
        return self._position.error_mm

    @property
    def step_mm(self) -> NDArray[np.float64]:
        """float64 [3], nominal travel of each carriage for one step of its counter, in mm."""
        return self._position.step_mm.copy()

    @property
    def lost_steps(self) -> NDArray[np.float64]:
        """float64 [axes], counter minus rotor position in steps since each counter was set; meaningful at rest."""
        return self._position.lost_steps

    @property
    def closed_loop(self) -> NDArray[np.bool_]:
        """bool [axes], which axes have servo drives: they lose no steps, but lag."""
        return self._plant.closed_loop

    @property
    def following_error(self) -> NDArray[np.float64]:
        """float64 [axes], command minus encoder of servo drives, increments in the sense of the counters; else 0."""
        return np.where(self._plant.closed_loop, self._position.lag, 0.0)

    @property
    def in_position(self) -> NDArray[np.bool_]:
        """bool [axes], False where a servo drive that has power has not brought its axis to its command yet."""
        return self._plant.in_position | ~(self._plant.closed_loop & self._plant.powered)

    @property
    def drive_faults(self) -> tuple[tuple[int, str], ...]:
        """[axes], how often each servo drive has switched itself off since power-on, and why last ("": never)."""
        return self._plant.drive_faults

    @property
    def may_collide(self) -> bool:
        """True if there are bodies that must not meet, and can: something is clamped on the table."""
        return self._plant.may_collide

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        """float64 [axes], steps in one slip of each motor, four full steps."""
        return self._position.slip_steps

    @property
    def margin(self) -> NDArray[np.float64]:
        """float64 [axes], least pull-out margin of each motor since `watch_margin`, or since power-on: 1 no load, 0 it
        may have lost steps; nan for axes without a motor (isel_twin.plant.margin)."""
        return self._plant.margin

    @property
    def fastest_rad_s(self) -> NDArray[np.float64]:
        """float64 [axes], the largest speed of each motor since `watch_margin`, or since power-on; nan without one."""
        return self._plant.fastest_rad_s.copy()

    @property
    def torque_band(self) -> NDArray[np.float64]:
        """float64 [axes, 2], the least and the most torque of each stepper motor over the predicted one, at its largest
        speed since `watch_margin` (drives/bands.py); nan without such a motor."""
        from isel_twin.drives.bands import torque_band

        speeds = self._plant.fastest_rad_s.tolist()
        found = np.full((len(speeds), 2), math.nan)
        for i, (axis, rad_s) in enumerate(zip(self.machine.axes, speeds, strict=False)):
            if not math.isnan(rad_s) and isinstance(axis.motor, Motor) and isinstance(axis.stage, Stage):
                found[i] = torque_band(axis.motor, axis.stage, rad_s * 30.0 / math.pi)
        return found

    @property
    def speed_edge(self) -> NDArray[np.float64]:
        """float64 [axes], how many times the largest speed since `watch_margin`, or since power-on, each stepper motor
        may turn until a swing of its rotor grows (drives/stability.py); inf at rest and where no limit could be told,
        nan without such a motor."""
        edge = self.fastest_rad_s
        for i, axis in enumerate(self.machine.axes[: len(edge)]):
            if edge[i] >= SLOW_RAD_S:
                edge[i] = axis.swing_limit_rad_s / edge[i]
            elif edge[i] < SLOW_RAD_S:
                edge[i] = math.inf
        return edge

    @property
    def supply_v(self) -> float:
        """Voltage of the common supply of the drives; nan if the machine has none, or without physics."""
        return self._plant.supply_v

    @property
    def spindle_rev_min(self) -> float:
        """How fast the tool turns, rev/min, positive clockwise from above; nan if the machine file does not say how
        (docs/machines.md)."""
        turning = self._wiring.turning
        return math.nan if turning is None else turning.speed_rev_min(self.time_ns)

    @property
    def spindle_turns(self) -> float:
        """Turns of the tool since power-on, signed; nan like `spindle_rev_min`."""
        turning = self._wiring.turning
        return math.nan if turning is None else turning.turns(self.time_ns)

    @property
    def forgotten_steps(self) -> NDArray[np.float64]:
        """float64 [axes], steps lost since power-on that `lost_steps` dropped when the counter was set."""
        return self._position.forgotten_steps

    @property
    def machine_position_mm(self) -> NDArray[np.float64]:
        """float64 [3], true carriage positions in machine coordinates: 0 at the motor-end switch."""
        return self._plant.position_mm

    @property
    def direction(self) -> NDArray[np.int64]:
        """int64 [axes], 1 or -1: the sense of each counter against its axis of the machine."""
        return self._position.turned

    @property
    def step_hz(self) -> NDArray[np.float64]:
        """float64 [axes], present step frequencies, signed like the counters (`Stream.rate_hz`)."""
        return self._stream.rate_hz()

    @property
    def steps(self) -> Steps:
        """The stream made since power-on, as far as it is kept: `.t_ns` int64 [n], `.delta` int8 [n, axes] or int32."""
        return self._stream.steps(self.time_ns)

    @property
    def inputs(self) -> Mapping[str, str]:
        """State of every element and end switch (`free`, `struck`), and the fault of each contact that has one."""
        return self._wiring.inputs

    @property
    def outputs(self) -> Mapping[str, int]:
        """Outputs of the controller, and the cabinet's relays that they switch."""
        return self._wiring.outputs

    @property
    def events_left(self) -> int:
        """Events of the scenario that are still to come."""
        return self._wiring.events_left

    @property
    def events_without_effect(self) -> int:
        """Events that have happened without effect: the plant has no physics."""
        return self._wiring.events_without_effect

    @property
    def faults(self) -> Mapping[str, str | float]:
        """Injected faults: of contacts by name, others by key of an event (`noise`, `phase_lost.x`;
        `isel_twin.wiring.ACTS`)."""
        return self._wiring.faults

    @property
    def settable(self) -> Mapping[str, tuple[str, ...]]:
        """Names that `set_input` takes, and the states of each."""
        return self._wiring.settable

    @property
    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        """Input terminals of the controller, and the contacts wired to each in series."""
        return self._controller.terminals()

    @property
    def physics(self) -> bool:
        """True if the plant has physics: forces and lost motor phases have an effect."""
        return self._plant.physics

    @property
    def levels(self) -> Mapping[str, bool]:
        """Electrical level (True: high) of every wired input terminal of the controller."""
        return dict(self._levels)

    @property
    def fault(self) -> bool:
        """The controller stands in an error that somebody must do something about (`Controller.fault`)."""
        self._tell()
        return self._controller.fault

    @property
    def fault_cause(self) -> str:
        """The cause in a few words, if the controller says it; "" while `fault` is False."""
        if not self.fault:
            return ""
        return self._controller.fault_cause if offers(self._controller, TellsFault) else "the controller shows an error"

    @property
    def reply_waiting(self) -> bool:
        """Whether `read` would return something."""
        arrival_ns = self._line.next_reply_ns
        return arrival_ns is not None and arrival_ns <= self.time_ns

    @property
    def replies_due(self) -> int:
        """Bytes of replies on the line that have not arrived at the host yet."""
        return self._line.replies_due

    @property
    def commands_due(self) -> int:
        """Bytes written that have not arrived at the controller: on the line, or held back by its handshake
        (`isel_twin.controller.HoldsHost`)."""
        return self._line.commands_due_at(self.time_ns)

    @property
    def serial_format(self) -> SerialFormat:
        """Speed of the serial line and form of a byte."""
        form, speed = self._controller.serial_format, self.origin.line_speed
        return form if isinstance(speed, bool) else replace(form, baud=speed)

    @property
    def bytes_ns(self) -> int:
        """Time that all bytes of both directions take on the line, one after the other, since power-on; whether they
        take it (`line_speed`) or not."""
        return self._line.bytes_ns

    @property
    def astray(self) -> tuple[str, ...]:
        """Axes that the controller has referenced since power-on though no end switch of theirs was struck."""
        return self._wiring.astray

    @property
    def line_faults(self) -> LineFaults:
        """Bytes of both directions that have not arrived as they were sent, since power-on."""
        return self._line.faults

    @property
    def idle(self) -> bool:
        """True if all bytes sent are processed, all replies have arrived, and the controller makes no motion."""
        return self._controller.idle and not self._line.commands_due and self._line.quiet_ns <= self.time_ns

    @property
    def next_event_ns(self) -> int | None:
        """When something may happen without a call, None: never; while something moves, a short time from now."""
        waits = self._arrival
        controller_ns = self._controller.next_ns if waits is None else waits.look_ns(self.time_ns + 1)
        times = [controller_ns, self._line.next_ns, self._line.next_reply_ns, self._wiring.next_event_ns]
        if self._stream.moving or not self._plant.at_rest:
            times.append(self.time_ns + _MOVING_SLICE_NS)
        return min((t for t in times if t is not None), default=None)
