"""The kinematic plant: the carriage follows its command exactly, thresholds still work.

    position = start + command * lead of the screw / steps_per_rev

For host tests of protocol and timing. Nothing lags, but servo drives say that they are in position when they would be
by the law of their loops (settling.py). A switch changes at the tick that strikes it or, between set points
(lead.py), at the first whole nanosecond at which the carriage is beyond its trip point:

    motor end:  struck while position <  trip, free again from trip + hysteresis on
    far end:    struck while position >  trip, free again from trip - hysteresis on
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from operator import add, lt, sub
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.drives.servo_drive import ServoDrive
from isel_twin.machine import Machine
from isel_twin.native import core
from isel_twin.plant import Along as WayAlong
from isel_twin.plant import Collision, Threshold
from isel_twin.plant.following import SWITCH, places_on_the_way
from isel_twin.plant.ideal import IdealDrives
from isel_twin.plant.lead import all_behind, no_leads
from isel_twin.plant.path_samples import PathSamples
from isel_twin.plant.settling import Settling

if TYPE_CHECKING:
    from isel_twin.plant.contact import Along, Least
    from isel_twin.plant.touch import Felt


class _Way(NamedTuple):
    """Where the carriages go: times [n] and places [n, 3]; jumps: from one to the next, else straight on."""

    times_ns: NDArray[np.int64]
    places_mm: NDArray[np.float64]
    jumps: bool


def _look_out(machine: Machine) -> Along:
    """Only who has something on the table waits for MuJoCo."""
    from isel_twin.plant.contact import Along, Geometry
    from isel_twin.plant.model import load_model

    return Along(Geometry(load_model(machine, visual=False, watched=True)))


def _feeler(machine: Machine, threshold: Threshold) -> Felt:
    """Only who has a probe or a plate waits for MuJoCo."""
    from isel_twin.plant.model import found_targets, load_model
    from isel_twin.plant.touch import Felt

    records = found_targets(machine, load_model(machine, visual=False))
    return Felt(machine, records, threshold.limit, threshold.hysteresis)


def _of_carriages(delta: NDArray[Any]) -> NDArray[Any]:
    """The first three columns of changes [n, axes], filled up with zeros."""
    missing = len(CARRIAGES) - delta.shape[1]
    return np.pad(delta, ((0, 0), (0, missing))) if missing > 0 else delta[:, : len(CARRIAGES)]


class KinematicPlant(IdealDrives, PathSamples):
    """Implements `isel_twin.plant.Plant` and `Sampled` without physics."""

    physics = False

    def __init__(
        self, machine: Machine, thresholds: Sequence[Threshold], start_mm: NDArray[np.float64], axes: int = 4
    ) -> None:
        """start_mm [3]: carriages, in machine coordinates. axes: number of the controller's axes."""
        super().__init__()
        self.time_ns = 0
        self.edge = False
        self._start_mm = np.array(start_mm, dtype=np.float64)
        self._step_mm = np.array([axis.step_mm for axis in machine.axes])
        self._count = axes
        self._closed = np.array([*(axis.closed_loop for axis in machine.axes), *[False] * axes])[:axes]
        self._turn_steps = np.array([*(float(axis.steps_per_rev) for axis in machine.axes), *[1.0] * axes])[:axes]
        self._commanded = np.zeros(max(axes, len(CARRIAGES)), dtype=np.int64)
        self._leads = no_leads(len(self._commanded))
        self._no_ticks = np.empty(0, dtype=np.int64), np.empty((0, axes), dtype=np.int32)
        self._led_until_ns = 0
        self._stages_on = False
        drives = {i: axis.stage for i, axis in enumerate(machine.axes[:axes]) if isinstance(axis.stage, ServoDrive)}
        self._settling = Settling(drives)
        self._along: Along | None = None
        self._least: Least | None = None
        self._collisions: tuple[Collision, ...] = ()
        if machine.is_clamped:
            self._along = _look_out(machine)
        self._touch = next((n for n, t in enumerate(thresholds) if t.quantity == "touch"), None)
        self._felt = None if self._touch is None else _feeler(machine, thresholds[self._touch])
        self._machine = machine

        self._thresholds = tuple(thresholds)
        self._passed = np.array([t.quantity == "lag" and t.limit < 0.0 for t in thresholds], dtype=np.bool_)
        if self._felt is not None and self._felt.take(self._start_mm):
            self._passed[self._touch] = self._felt.touched
        self._places = np.flatnonzero([t.quantity == "position" for t in thresholds])  # of switches among thresholds
        self._only_places = len(self._places) == len(self._passed)
        switches = [self._thresholds[place] for place in self._places]
        self._switches = np.zeros(len(switches), SWITCH)
        self._switches["axis"] = [switch.axis for switch in switches]
        self._switches["sense"] = [switch.sense for switch in switches]
        for number, place in enumerate(self._places):
            self.set_trip_point(int(place), switches[number].limit)
        self._switches["struck"] = self._switches["strike"] < 0.0
        self._bounds: tuple[list[int], list[int]] | None = None  # counts between which no switch changes
        self._scratch = np.empty((3, len(self._commanded)), dtype=np.int64)
        self._reached_ns = np.empty(1, dtype=np.int64)

    def advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int = 0) -> int:
        if len(t_ns) != len(delta) or delta.shape[1] > len(self._commanded):
            raise ValueError(f"{len(t_ns)} ticks with changes {delta.shape} for {len(self._commanded)} axes")
        if self._sample_ns > until_ns:
            return self._advance(until_ns, t_ns, delta, lead_ns)
        if not len(t_ns) and self.at_rest and not self._along:
            self._sample_straight(until_ns)
            return self._advance(until_ns, t_ns, delta, lead_ns)
        before = self._before()
        reached = self._advance(until_ns, t_ns, delta, lead_ns)
        self._sample(before, t_ns, delta, lead_ns)
        return reached

    def finds_arrival(self, period_ns: int) -> bool:
        return True

    def arrive(self, until_ns: int, first_ns: int, period_ns: int) -> tuple[int, bool]:
        look_ns = first_ns - min(first_ns - self._settling.arrival_ns, 0) // period_ns * period_ns
        reached = self.advance(min(until_ns, look_ns), *self._no_ticks)
        return reached, reached == look_ns

    def room(self) -> tuple[list[int], list[int]] | None:
        """Up to the step that may change a switch; none where something is looked out for."""
        if self._along or self._felt or self._led_until_ns > self.time_ns:
            return None
        if self._bounds is None:
            low, high, _ = self._scratch
            core.switch_bounds(low, high, self._switches)
            self._bounds = low.tolist(), high.tolist()
        now = self._commanded.tolist()
        below, above = list(map(sub, self._bounds[0], now)), list(map(sub, self._bounds[1], now))
        return (below, above) if max(below) < 0 < min(above) else None

    def go_straight(self, until_ns: int, way: Sequence[int], along: WayAlong) -> None:
        assert self._bounds is not None
        if self._sample_ns <= until_ns:
            self._sample_straight(until_ns, along)
        there = list(map(add, self._commanded.tolist(), way))
        self._commanded[: len(there)] = there
        self.edge, self.time_ns = False, until_ns
        if all(map(lt, self._bounds[0], there)) and all(map(lt, there, self._bounds[1])):
            return
        of = self._switches
        beyond = of["sense"] * self._commanded[of["axis"]] > np.where(of["struck"], of["release"], of["strike"])
        self.edge = bool((beyond != of["struck"]).any())
        if self.edge:
            of["struck"] = beyond
            self._bounds = None

    def _advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int) -> int:
        if self._felt is None:
            return self._go(until_ns, t_ns, delta, lead_ns)
        path, here_mm = self._along_path(until_ns, t_ns, delta, lead_ns), self.position_mm
        found = self._felt.first(path.places_mm)
        if found < len(path.places_mm):
            before_ns = int(path.times_ns[found - 1]) if found else self.time_ns
            ends_mm = np.array([path.places_mm[found - 1] if found else here_mm, path.places_mm[found]])
            share = 1.0 if path.jumps else self._felt.share(ends_mm)
            until_ns = before_ns + math.ceil(share * (int(path.times_ns[found]) - before_ns))
            count = int(np.searchsorted(t_ns, until_ns, side="right"))
            t_ns, delta = t_ns[:count], delta[:count]
        reached = self._go(until_ns, t_ns, delta, lead_ns)
        if self._felt.take(self.position_mm):
            self.edge = True
            self._passed[self._touch] = self._felt.touched
            self._break()
        return reached

    def _break(self) -> None:
        """Tell of the feeler if it has just given way too far."""
        from isel_twin.plant.touch import NEWS, crash

        assert self._felt is not None
        feeler = self._felt.record
        if feeler["broken"][0] == NEWS:
            feeler["broken"] = 1
            at, place_mm = int(feeler["at"][0]), self.position_mm
            self._collisions += (crash(self._machine, at, place_mm, self.time_ns, math.nan),)

    def _go(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int) -> int:
        if self._along is None:
            return self._move(until_ns, t_ns, delta, lead_ns)
        if not self._along.begun and self._meet(self.position_mm[None]):
            return self.time_ns
        times_ns, path_mm, jumps = self._along_path(until_ns, t_ns, delta, lead_ns)
        found = self._along.first(path_mm)
        meets = found < len(path_mm)
        if meets and not jumps and found > 0:
            share = self._along.share(path_mm[found - 1 : found + 1])
            path_mm[found] += (share - 1.0) * (path_mm[found] - path_mm[found - 1])
            times_ns[found] += math.ceil((share - 1.0) * (times_ns[found] - times_ns[found - 1]))
        if meets:
            until_ns = int(times_ns[found])
            count = int(np.searchsorted(t_ns, until_ns, side="right"))
            t_ns, delta = t_ns[:count], delta[:count]
        reached = self._move(until_ns, t_ns, delta, lead_ns)
        end = found + 1 if meets and reached == until_ns else int(np.searchsorted(times_ns, reached, side="right"))
        self._meet(path_mm[:end])
        if self._least is not None:
            self._least.look(times_ns[:end], path_mm[:end])
        return reached

    def _meet(self, path_mm: NDArray[np.float64]) -> bool:
        """Go along a path, on which nothing is met before its end; whether something is there."""
        assert self._along is not None
        who = self._along.follow(path_mm)
        for names in who:
            x, y, z = path_mm[-1].tolist()
            self._collisions += (Collision(*names, (x, y, z), self.time_ns, math.nan, None),)
            self.edge = True
        return bool(who)

    def _along_path(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int) -> _Way:
        jumps = lead_ns == 0 and self._led_until_ns <= self.time_ns
        return _Way(*(self._ticks if jumps else self._path)(until_ns, t_ns, delta, lead_ns), jumps)

    def _ticks(
        self, _: int, t_ns: NDArray[np.int64], delta: NDArray[Any], __: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Times [n] and places [n, 3] of the carriages after each tick; nothing is led."""
        counts = self._commanded[: len(CARRIAGES)] + np.cumsum(_of_carriages(delta), axis=0, dtype=np.int64)
        return t_ns, self._start_mm + counts * self._step_mm

    def _path(
        self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The same so near to each other that they stand for all that is between them."""
        from isel_twin.plant.contact import fine

        times_ns, places = places_on_the_way(
            *(self.time_ns, until_ns, lead_ns),
            *(np.ascontiguousarray(t_ns, dtype=np.int64), np.ascontiguousarray(delta, dtype=np.int32)),
            *(self._commanded.copy(), self._leads.copy()),
        )
        times, path_mm = fine(times_ns, self._start_mm + places[:, :3] * self._step_mm)
        return np.ceil(times).astype(np.int64), path_mm

    def take_collisions(self) -> tuple[Collision, ...]:
        taken, self._collisions = self._collisions, ()
        return taken

    @property
    def may_collide(self) -> bool:
        return self._along is not None

    def watch_clearance(self) -> Least | None:
        """It is told of the path here."""
        if self._along is None:
            return None
        from isel_twin.plant.contact import Least

        self._least = Least(self._along.geometry)
        return self._least

    def _move(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int) -> int:
        unled = lead_ns == 0 and self._led_until_ns <= self.time_ns
        if unled and len(t_ns) == 0:
            self.edge, self.time_ns = False, until_ns
            return until_ns
        t_ns, reached = np.ascontiguousarray(t_ns, dtype=np.int64), self._reached_ns
        of = self._commanded, self._leads, self._switches
        if unled and delta.dtype == np.int8:
            steps = np.ascontiguousarray(delta)
            self.edge = bool(core.make_steps(until_ns, t_ns, steps, *of, self._scratch, reached))
            self.time_ns = int(reached[0])
        else:
            wide = np.ascontiguousarray(delta, dtype=np.int32)  # one function for all kinds of ticks
            self.edge = bool(core.lead_on(self.time_ns, until_ns, lead_ns, t_ns, wide, *of, reached))
            self.time_ns = int(reached[0])
            self._led_until_ns = int(self._leads["end_ns"].max())
            if lead_ns:
                made = int(t_ns.searchsorted(self.time_ns, side="right")) if self.edge else len(t_ns)
                self._settling.lead(t_ns[:made], delta[:made], lead_ns)
        if self.edge:
            self._bounds = None
        return self.time_ns

    def trips(self) -> NDArray[np.bool_]:
        if self._only_places:
            return self._switches["struck"].astype(np.bool_)
        passed = self._passed.copy()
        passed[self._places] = self._switches["struck"]
        return passed

    def set_power(self, stages: bool, brake_released: bool, lowering: bool) -> None:
        if stages and not self._stages_on:
            self._settling.begin(self.time_ns)
        self._stages_on = stages

    def set_trip_point(self, threshold: int, position_mm: float) -> None:
        switch = self._thresholds[threshold]
        if switch.quantity == "touch" and self._felt is not None:
            self._felt.limit_mm = position_mm
            return
        if switch.quantity != "position":
            raise ValueError(f"threshold {threshold} is a {switch.quantity}, not a position")
        number = int(np.searchsorted(self._places, threshold))
        step_mm, start_mm = self._step_mm[switch.axis], self._start_mm[switch.axis]
        strike = switch.sense * (position_mm - start_mm) / step_mm
        self._switches["strike"][number] = strike
        self._switches["release"][number] = strike - switch.hysteresis / step_mm
        self._bounds = None

    @property
    def position_mm(self) -> NDArray[np.float64]:
        return self._start_mm + self._command()[:3] * self._step_mm

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        return self._speed()[:3] * self._step_mm

    @property
    def commanded(self) -> NDArray[np.int64]:
        return self._commanded[: self._count].copy()

    @property
    def told(self) -> NDArray[np.int64]:
        return self.commanded

    @property
    def command(self) -> NDArray[np.float64]:
        return self._command()[: self._count]

    @property
    def rotor(self) -> NDArray[np.float64]:
        return self.command

    @property
    def powered(self) -> NDArray[np.bool_]:
        return np.full(self._count, self._stages_on)

    @property
    def closed_loop(self) -> NDArray[np.bool_]:
        return self._closed.copy()

    @property
    def in_position(self) -> NDArray[np.bool_]:
        return np.array([self._settling.in_position(axis, self.time_ns) for axis in range(self._count)])

    @property
    def rotor_speed(self) -> NDArray[np.float64]:
        return self._speed()[: self._count]

    @property
    def turn_steps(self) -> NDArray[np.float64]:
        return self._turn_steps.copy()

    @property
    def at_rest(self) -> bool:
        return self._led_until_ns <= self.time_ns

    def save(self) -> Mapping[str, Any]:
        return {
            "arrays": [array.copy() for array in self._kept],
            "values": (self.time_ns, self.edge, self._led_until_ns, self._stages_on),
            "settling": self._settling.save(),
            "felt": None if self._felt is None else (self._felt.record.copy(), self._felt.limit_mm, self._felt.touched),
            "contact": None if self._along is None else (self._along.begun, self._along.touching.copy()),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        for array, saved in zip(self._kept, state["arrays"], strict=True):
            array[...] = saved
        self.time_ns, self.edge, self._led_until_ns, self._stages_on = state["values"]
        self._settling.restore(state["settling"])
        if self._felt is not None:
            record, self._felt.limit_mm, self._felt.touched = state["felt"]
            self._felt.record[...] = record
        if self._along is not None:
            self._along.begun, touching = state["contact"]
            self._along.touching = touching.copy()
        self._bounds = None
        self._aim()

    @property
    def _kept(self) -> tuple[NDArray[Any], ...]:
        """Arrays that change."""
        return self._start_mm, self._passed, self._commanded, self._leads, self._switches

    def _speed(self) -> NDArray[np.float64]:
        """Zero for an axis that jumps from step to step."""
        leads = self._leads
        return np.where(leads["end_ns"] > self.time_ns, leads["pending"] * SECOND_NS / leads["lead_ns"], 0.0)

    def _command(self) -> NDArray[np.float64]:
        if self.at_rest:
            return self._commanded.astype(np.float64)
        return self._commanded - all_behind(self._leads, self.time_ns)
