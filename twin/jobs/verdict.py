"""The verdict on a job: was every command accepted, and is the machine where the controller believes it to be?

A motor holds its load up to half a period of its torque and then slips by whole periods, four full steps each. So at
rest

    steps are lost  <=>  |counter - rotor| >= slip / 2

and anything less is load angle. Almost half a slip is neither: dry friction holds the rotor at the unstable point
between two stable places, and the next touch moves it one way or the other. So it is reported as `halfway` and is not
ok. Steps lost before a reference run set the counter count, too.

Bytes that the line has altered, lost or doubled are not well, whatever was answered (jobs/13): an iMC takes 6410 for
6400 and answers 0.

Steps that are made while the stages have no power move nothing. With physics they are lost steps; the kinematic plant
follows them, so they are counted for themselves, and are not well on any plant. Neither is a controller that starts
anew before its last reply, whatever it answers afterwards.

A servo drive loses nothing; it switches itself off if its following error exceeds its limit. That is as bad as lost
steps, even if it was switched on again.

The line between host and controller takes no time unless that is asked for. What it would take is told where that is
more than a fiftieth of the job: the bits of all bytes, one after the other, at most, as a controller may move meanwhile
(jobs/16).

Events of a scenario without effect are no failure of the job, but they are counted: an emergency stop after the end of
the job, for example, has tested nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.units import SECOND_NS
from isel_twin.core.snapshot import snapshot
from isel_twin.jobs.odd import oddities
from isel_twin.jobs.result import Ends, Result, in_percent, least_band
from isel_twin.jobs.why import referenced_astray
from isel_twin.plant import Collision
from isel_twin.wiring import LineFaults
from isel_twin.wiring.contacts import FAULTS

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

HALFWAY = 0.375  # distance from the nearest stable place, in slips, beyond which a rotor counts as halfway

SHOWN_COLLISIONS = 3  # most collisions in words
AFTER_END = "after the end of the job"
HALF_A_SLIP = "stopped half a slip off, held there by friction alone"
NOT_SIMULATED = "lost steps, margins and loads were not simulated"

SHOWN_UNMET = 10  # lines of a job that are named if they did not get what they expected

LEAST_LINE = 0.02  # share of the time of a job from which on that of its bytes is told

SETTLE_S = 0.5  # virtual time for the machine to come to rest after the last command, before judging


def lost(steps: ArrayLike, slip_steps: ArrayLike) -> NDArray[np.bool_]:
    """bool [axes], whether an axis has lost steps.

    steps [axes]: counter minus rotor position at rest, or its change from one rest to another. slip_steps [axes]: steps
    in one slip of each motor. nan counts as lost.
    """
    return ~(np.abs(steps) < np.asarray(slip_steps) / 2.0)


def whole_slips(steps: ArrayLike, slip_steps: ArrayLike) -> NDArray[np.float64]:
    """float64 [axes], steps of the whole slips by which an axis is off, 0 if none are lost. Arguments as in `lost`."""
    slip = np.asarray(slip_steps, dtype=np.float64)
    return np.asarray(np.floor(np.abs(steps) / slip + 0.5) * slip)


def halfway(steps: ArrayLike, slip_steps: ArrayLike) -> NDArray[np.bool_]:
    """bool [axes], whether a rotor rests near the middle between two stable places. Arguments as in `lost`. A load
    alone cannot cause this: beyond a quarter of a slip the torque of a motor falls with the angle.
    """
    slips = np.asarray(steps) / np.asarray(slip_steps, dtype=np.float64)
    return np.abs(slips - np.round(slips)) >= HALFWAY


@dataclass(frozen=True)
class Verdict:
    """The verdict on a job. Tuples have one entry an axis, those of positions one a carriage."""

    commands: int
    refused: int  # commands that were refused, or went wrong without an expectation
    lost_steps: tuple[float, ...]  # counter minus rotor position in steps at rest, since each counter was set
    forgotten_steps: tuple[float, ...]  # steps lost before that, since power-on
    slip_steps: tuple[float, ...]  # steps in one slip of each motor
    fault_cause: str  # the error in which the controller stands; "": in none
    faults: Mapping[str, str]  # broken or stuck contacts, and how; no failure of the job, which may test them
    ticks: int  # ticks of the step stream since power-on
    counts: tuple[int, ...]
    position_mm: tuple[float, ...]
    position_error_mm: tuple[float, ...]
    began_ns: int  # when the first command was sent
    ended_ns: int  # when the last one was over
    time_ns: int  # time of the verdict, with the machine at rest
    machine: str
    margin: tuple[float | None, ...] = ()  # least pull-out margin of each axis in all lines; None without a motor
    margin_band: tuple[Ends | None, ...] = ()  # of each the least `Result.margin_band`
    edge: tuple[tuple[float, int] | None, ...] = ()
    """Of each axis the least `Result.edge`, and in which line; None without one."""
    unsent: int = 0  # commands of the job that were never sent
    interrupted: bool = False  # the caller stopped the job
    unfinished: int = 0  # commands that were not over when the job ended: 0 or 1
    stands: str = ""  # where and why the program of a host that has ended stopped before its end
    restarts: int = 0  # unexpected restarts of the controller before the end of the last command
    line_faults: LineFaults = field(default_factory=LineFaults)  # unexpected ones since power-on
    astray: tuple[str, ...] = ()  # axes that have been referenced though no end switch of theirs was struck
    unpowered_steps: int = 0  # unexpected steps of all axes while the stages had no power
    stores_lost: int = 0  # writes that the flash memory could not store
    odd: tuple[tuple[int, str], ...] = ()  # legal but absurd lines: number and description (odd.py)
    physics: bool = True  # False: lost steps, margins and loads are unknown
    flash_fault: bool = False  # the flash image could not be read and has not been rewritten
    expectations: int = 0  # expected replies and conditions of the lines that were played
    unmet: tuple[int, ...] = ()  # numbers of the lines with one that was not met
    lost_known: tuple[float, ...] = ()  # lost steps of each axis that the job expects: they do not count
    fault_known: str = ""  # the error of the controller that the job expects
    drive_faults: tuple[tuple[int, str], ...] = ()  # how often each servo drive switched itself off, and the last cause
    drive_faults_known: tuple[int, ...] = ()  # number of faults of each that the job expects
    following_error: tuple[float | None, ...] = ()  # of each servo drive at rest, in increments; None: no such drive
    off_position: tuple[bool, ...] = ()  # servo drives that have power and do not reach their command
    events_after_end: int = 0  # events of the scenario that were still to come when the last command was over
    collisions: tuple[Collision, ...] = ()  # of bodies that must not meet, since the first command was sent
    events_without_effect: int = 0  # forces, cuts and lost phases of the scenario on a plant without physics
    line: str = ""  # form of a byte on the line
    bytes_ns: int = 0  # time that the bytes of all commands and replies take on it, one after the other
    line_counts: bool = False  # they take it: it is in the time of the job
    unwritten: tuple[str, ...] = ()  # files about the job that are not on the disk, or not whole
    found: tuple[str, ...] = ()  # what else is wrong, such as signals of a capture that drives may misread
    not_made: str = ""  # lines of the file that were left out, as a part was asked for; no failure

    @property
    def cycle_s(self) -> float:
        return (self.ended_ns - self.began_ns) / SECOND_NS

    @property
    def line_told(self) -> str:
        """The part of the line in the time of the job, or what it would add; "" for little."""
        if self.bytes_ns <= LEAST_LINE * (self.ended_ns - self.began_ns):
            return ""
        took = f"up to {self.bytes_ns / SECOND_NS:.3f} s"
        return f"{took} of it on the line, {self.line}" if self.line_counts else f"{took} more on a line of {self.line}"

    @property
    def part(self) -> str:
        """What of the job was not made as it stands, in words; "" if it was made to its end. A number about the run is
        one about the rest (jobs/18)."""
        kinds = ((self.refused, "refused"), (self.unfinished, "not over"), (self.unsent, "not sent"))
        left = ", ".join(f"{number} {what}" for number, what in kinds if number)
        return left and f"{left}, of {self.commands + self.unsent} commands"

    @property
    def controller_fault(self) -> bool:
        """True if the controller stands in an error."""
        return bool(self.fault_cause)

    @property
    def fault_left(self) -> str:
        """The error in which the controller stands and that the job does not expect (jobs/15); "" without one."""
        return "" if self.fault_cause == self.fault_known else self.fault_cause

    @property
    def least_margin(self) -> float | None:
        """The least margin of all axes; None without physics."""
        return min((margin for margin in self.margin if margin is not None), default=None)

    @property
    def margin_told(self) -> str:
        """The least margin and its band in per cent; "" without physics."""
        return in_percent(self.margin, self.margin_band)

    @property
    def least_edge(self) -> tuple[float, str, int] | None:
        """The least edge of all axes, the axis and the line; None if none has turned, or no limit is told."""
        found = [(edge[0], name, edge[1]) for name, edge in zip(AXIS_NAMES, self.edge, strict=False) if edge]
        return min(found, default=None)

    @staticmethod
    def _edge_told(edge: tuple[float, int]) -> dict[str, float]:
        """Factors on speed, supply voltage and inductance at which a swing grows, the others unchanged: the limit goes
        with the voltage and with the power of -0.6 of the inductance."""
        speed, line = edge
        inductance = round(speed ** (1.0 / 0.6), 4)
        return {"speed": speed, "supply": round(1.0 / speed, 4), "inductance": inductance, "line": line}

    @property
    def accepted(self) -> int:
        return self.commands - self.refused - self.unfinished

    @property
    def whole_steps_lost(self) -> tuple[int, ...]:
        """Steps of each axis lost since its counter was set, by whole slips of its motor: no load angle."""
        steps = np.nan_to_num(np.copysign(whole_slips(self.lost_steps, self.slip_steps), self.lost_steps))
        return tuple(int(n) for n in steps)

    @property
    def lost(self) -> tuple[bool, ...]:
        """Which axes have lost steps unexpectedly, including those before the counter was set."""
        now = lost(self.lost_steps, self.slip_steps) | (np.array(self.forgotten_steps) != 0.0)
        if any(self.lost_known):
            known = np.array(self.lost_known)
            total = whole_slips(self.lost_steps, self.slip_steps) + np.array(self.forgotten_steps)
            now = np.where(known > 0.0, ~(total == known), now)
        return tuple(now.tolist())

    @property
    def switched_off(self) -> tuple[str, ...]:
        """Why the servo drive of each axis has switched itself off, "" if it has not or the job expects it."""
        known = (*self.drive_faults_known, *[0] * len(self.drive_faults))
        return tuple(
            cause if number != expected else ""
            for (number, cause), expected in zip(self.drive_faults, known, strict=False)
        )

    @property
    def halfway(self) -> tuple[bool, ...]:
        return tuple(halfway(self.lost_steps, self.slip_steps).tolist())

    @property
    def headline(self) -> str:
        """The verdict in a few words, "all well" only as far as it was looked at."""
        part = f", but {self.not_made} not made" if self.not_made else ""
        if not self.ok:
            return f"failed{part}"
        well = f"all well{'' if self.physics else ' as far as simulated'}{part}"
        idle = [(self.events_without_effect, "without effect (no physics)"), (self.events_after_end, AFTER_END)]
        but = ", ".join(f"{number} event{'' if number == 1 else 's'} {what}" for number, what in idle if number)
        return f"{well}, but for the scenario: {but}" if but else well

    @property
    def ok(self) -> bool:
        """True if every command was sent and accepted or answered as expected, every condition is met, no step is lost,
        half lost or made without power, every byte has arrived as it was sent, nothing has collided, no drive has
        switched itself off or rests short of its command, there was no restart, the controller has no error left, all
        files are on the disk, and nothing else was found."""
        return not self.problems()

    def problems(self, refused: str = "refused") -> tuple[str, ...]:
        """Everything that is wrong, in words. refused: the outcome of refused commands."""
        return tuple(_problems(self, refused))

    def summary(self) -> dict[str, Any]:
        """In JSON's types, as in `isel-twin run --json`; with values of servo drives if the machine has any."""
        told = {
            "ok": self.ok,
            "commands": self.commands,
            "refused": self.refused,
            "lost_steps": list(self.whole_steps_lost),
            "lost_before_reference": [int(steps) for steps in self.forgotten_steps],
            "controller_fault": self.controller_fault,
            "fault_cause": self.fault_cause,
            "steps": self.ticks,
            "counts": list(self.counts),
            "position_mm": [round(position, 6) for position in self.position_mm],
            "time_ns": self.time_ns,
            "machine": self.machine,
            "unsent": self.unsent,
            "interrupted": self.interrupted,
            "unfinished": self.unfinished,
            "restarts": self.restarts,
            "unpowered_steps": self.unpowered_steps,
            "stores_lost": self.stores_lost,
            "physics": self.physics,
            "odd": [{"line": line, "what": what} for line, what in self.odd],
            "flash_fault": self.flash_fault,
            "events_after_end": self.events_after_end,
            "events_without_effect": self.events_without_effect,
            "margin": list(self.margin),
            "margin_band": [ends and list(ends) for ends in self.margin_band],
            "edge": {name: self._edge_told(edge) for name, edge in zip(AXIS_NAMES, self.edge, strict=False) if edge},
            "halfway": list(self.halfway),
            "expectations": self.expectations,
            "unmet": list(self.unmet),
            "bytes_ns": self.bytes_ns,
            "line_counts": self.line_counts,
        }
        if any(error is not None for error in self.following_error):
            told |= {"following_error": list(self.following_error), "switched_off": list(self.switched_off)}
            told["off_position"] = list(self.off_position)
        if any(self.line_faults):
            told["line_faults"] = self.line_faults._asdict()
        if self.astray:
            told["astray"] = list(self.astray)
        told |= {name: list(values) for name in ("unwritten", "found") if (values := getattr(self, name))}
        if self.not_made:
            told["not_made"] = self.not_made
        if self.collisions:
            told |= {"collisions": [collision.content for collision in self.collisions]}
        return told


def judge(
    twin: Twin, results: Sequence[Result], unsent: int = 0, interrupted: bool = False, host_since_ns: int | None = None
) -> Verdict:
    """The verdict on a job with these results on this twin, after SETTLE_S to come to rest. unsent: commands without a
    result. interrupted: the caller stopped the job. host_since_ns: when a host began, whose commands have no results.
    """
    start_ns, events_after_end = twin.time_ns, twin.events_left
    began_ns = results[0].time_ns if results else start_ns if host_since_ns is None else host_since_ns
    twin.run(SETTLE_S)
    left = host_since_ns is not None and not twin.idle
    seen = snapshot(twin)
    return Verdict(
        commands=sum(not result.condition for result in results),
        refused=sum(not result.ok and result.complete and result.expected is None for result in results),
        unfinished=sum(not result.complete for result in results) + left,
        stands="" if host_since_ns is None else twin.unfinished,
        restarts=sum(result.restarts for result in _since_known(results)) if results else twin.restarts,
        line_faults=_unexpected(twin.line_faults, [result.line_known for result in results]),
        astray=twin.astray,
        unpowered_steps=int(twin.unpowered_steps.sum()) - _last([result.unpowered_known for result in results]),
        stores_lost=twin.stores_lost,
        physics=twin.physics,
        odd=tuple(oddities(results, twin.language)),
        lost_steps=tuple(seen.lost_steps.tolist()),
        forgotten_steps=tuple(twin.forgotten_steps.tolist()),
        slip_steps=tuple(twin.slip_steps.tolist()),
        fault_cause=twin.fault_cause,
        faults={name: state for name, state in seen.inputs.items() if state in FAULTS and state != "ok"},
        ticks=twin.steps.made,
        counts=tuple(seen.counts.tolist()),
        position_mm=tuple(seen.position_mm.tolist()),
        position_error_mm=tuple(seen.position_error_mm.tolist()),
        began_ns=began_ns,
        ended_ns=results[-1].end_ns if results else start_ns,
        time_ns=seen.time_ns,
        machine=twin.machine.name,
        margin=_least([result for result in results if not result.condition]),
        margin_band=tuple(map(least_band, zip(*(r.margin_band for r in results if not r.condition), strict=True))),
        edge=_nearest([result for result in results if not result.condition]),
        expectations=sum(result.expected is not None for result in results),
        unmet=tuple(result.number for result in results if result.expected is not None and not result.ok),
        lost_known=_known([result.lost_known for result in results]),
        fault_known=next((known for result in reversed(results) if (known := result.fault_known) is not None), ""),
        drive_faults=twin.drive_faults,
        drive_faults_known=tuple(int(n) for n in _known([result.drive_faults_known for result in results])),
        following_error=tuple(
            round(error, 3) if closed else None
            for error, closed in zip(twin.following_error.tolist(), twin.closed_loop.tolist(), strict=True)
        ),
        unsent=unsent,
        interrupted=interrupted,
        flash_fault=bool(twin.outputs.get("flash_fault")),
        off_position=tuple((~twin.in_position).tolist()),
        events_after_end=events_after_end,
        collisions=tuple(collision for collision in twin.collisions if collision.time_ns >= began_ns),
        events_without_effect=twin.events_without_effect,
        line=str(twin.serial_format),
        bytes_ns=sum(result.bytes_ns for result in results),
        line_counts=twin.line_speed,
    )


def _problems(verdict: Verdict, refused: str) -> Iterator[str]:
    axes = [axis.upper() for axis in AXIS_NAMES]
    if verdict.interrupted:
        yield "interrupted"
    if verdict.refused:
        yield f"{verdict.refused} {refused}"
    if verdict.unfinished and not verdict.interrupted:
        yield f"{verdict.unfinished} unfinished" if verdict.commands else "the controller is still busy"
    if verdict.stands:
        yield f"the program stands: {verdict.stands}"
    if verdict.unsent:
        yield f"{verdict.unsent} not sent"
    if verdict.unmet:
        lines = ", ".join(map(str, verdict.unmet[:SHOWN_UNMET])) + (", ..." if verdict.unmet[SHOWN_UNMET:] else "")
        yield f"{len(verdict.unmet)} of {verdict.expectations} expectations not met: line {lines}"
    if verdict.restarts:
        yield f"the controller restarted {'once' if verdict.restarts == 1 else f'{verdict.restarts} times'}"
    if any(verdict.line_faults):
        yield verdict.line_faults.in_words()
    if verdict.astray:
        yield referenced_astray(verdict.astray)
    if any(verdict.lost):
        now = [f"{axis} {n}" for axis, n in zip(axes, verdict.whole_steps_lost, strict=False) if n]
        before = [f"{axis} {int(n)}" for axis, n in zip(axes, verdict.forgotten_steps, strict=False) if n]
        now += [f"before a reference run: {', '.join(before)}"] if before else []
        yield f"lost steps: {', '.join(now) or 'none, but some were expected'}"
    if any(verdict.halfway):
        where = " ".join(axis for axis, is_so in zip(axes, verdict.halfway, strict=False) if is_so)
        yield f"{where} {HALF_A_SLIP}"
    if verdict.unpowered_steps:
        yield f"{verdict.unpowered_steps} steps made while the power stages were off"
    yield from (f"{axis}: {why}" for axis, why in zip(axes, verdict.switched_off, strict=False) if why)
    for axis, is_off, error in zip(axes, verdict.off_position, verdict.following_error, strict=False):
        if is_off and error is not None:
            yield f"{axis} rests {abs(error):.0f} increments from its command"
    yield from map(str, verdict.collisions[:SHOWN_COLLISIONS])
    if more := len(verdict.collisions[SHOWN_COLLISIONS:]):
        yield f"{more} more collision{'' if more == 1 else 's'}"
    if verdict.fault_left:
        yield f"fault left in the controller: {verdict.fault_left}"
    if verdict.stores_lost:
        yield "the flash memory did not keep what was stored"
    if verdict.flash_fault:
        yield "the flash memory cannot be read"
    yield from verdict.found
    if verdict.unwritten:
        yield f"not written: {', '.join(verdict.unwritten)}"


def _since_known(results: Sequence[Result]) -> Sequence[Result]:
    """The restarts after the last met condition on them."""
    known = [number for number, result in enumerate(results, 1) if result.restarts_known is not None]
    return results[known[-1] if known else 0 :]


def _unexpected(faults: LineFaults, known: Sequence[Sequence[int | None]]) -> LineFaults:
    """Faults of the line after the last met condition on each kind."""
    told = [each for each in known if each]
    return faults.since(LineFaults(*map(_last, zip(*told, strict=True))))


def _last(known: Sequence[int | None]) -> int:
    return next((number for number in reversed(known) if number is not None), 0)


def _known(found: Sequence[Sequence[float | None]]) -> tuple[float, ...]:
    """The last value of each axis that a condition expects; 0 without one."""
    known = [0.0] * max(map(len, found), default=0)
    for each in found:
        for axis, steps in enumerate(each):
            if steps is not None:
                known[axis] = steps
    return tuple(known)


def _nearest(results: Sequence[Result]) -> tuple[tuple[float, int] | None, ...]:
    """The least edge of each axis and its line."""
    axes = zip(*(result.edge for result in results), strict=True)
    numbers = [result.number for result in results]
    return tuple(
        min(((edge, number) for edge, number in zip(axis, numbers, strict=True) if edge is not None), default=None)
        for axis in axes
    )


def _least(results: Sequence[Result]) -> tuple[float | None, ...]:
    axes = zip(*(result.margin for result in results), strict=True)
    return tuple(min((value for value in axis if value is not None), default=None) for axis in axes)
