"""Experiments for identification: blocks of moves, written as a job with a file to fill in.

A block is a short piece of a job with measurements; it begins and ends at rest, referenced:

    reversal   slowly to a place from below, read; from above, read     backlash, friction
    push       at rest, tool pulled in both directions, read          stiffness, backlash; where the table
               carries the axis, the table as well: a pull at the tool never loads that screw
    coast      emergency stop at speed, read the overrun         friction, mass
    stall      the same move ever faster until steps are lost                   supply, mass, friction
    far        a place near the motor and one far away, by a scale              lead error
    switch     slowly into the far switch, read                                 its position

choice.py chooses among them. Speeds, places and forces vary with the seed, so that a second experiment, to be held
back, differs from the first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from isel_twin.base.axes import CARRIAGES
from isel_twin.controller import create_controller
from isel_twin.language import Language, MoveSettings, create_language, needed
from isel_twin.machine import Machine
from isel_twin.many.identification.measured import PUSHED_AT, Act, Measured, Reading, Ring, Stall
from isel_twin.many.identification.session import referenced, stall_speed_hz, with_supply
from isel_twin.many.identification.unknowns import Unknown

PUSH_N = 150.0  # a spring scale or a 15 kg weight over a pulley
STALL_HZ_PER_MS = (400, 1000)  # accelerations of the stall series: the chaos near stall differs for each
PULLS = 2
REVERSALS = 4
APART_MM = 0.3625  # between places of a reversal: not whole motor steps, so that the place of rest varies
APPROACH_MM = 2.0  # far more than any backlash
FAR_SIGMA_MM = 0.01  # of a scale or gauge blocks over a long distance
COASTS_HZ = (6000.0, 9000.0, 12_000.0)  # about these; at more, a machine of half the supply may lose steps (many/25)
COAST_S = 1.5  # duration of a move for an emergency stop: a person needs time to press it
PRESS_S, RELEASE_S = 0.5, 2.5  # after the command was sent; the coasting does not depend on it
GENTLE = (6000, 100, 300)  # speed, acceleration and start-stop frequency of moves between readings
CREEP = (1000, 10, 100)  # the same of the move to where a reversal is read (many/25)
SERIES = 1.04  # ratio of successive speeds of a stall series
SERIES_FROM, SERIES_TO = 0.7, 1.8  # of the stall speed expected: few moves before the first that may lose steps


@dataclass(frozen=True)
class Step:
    """One command of a job and the measurements after it."""

    data: bytes
    readings: tuple[Reading, ...] = ()  # without recording, command number and value
    acts: tuple[Act, ...] = ()
    comment: str = ""
    any_reply: bool = False  # any reply is accepted
    rings: tuple[Ring, ...] = ()


@dataclass(frozen=True)
class Block:
    """A short piece of a job with measurements, or a series of stalls."""

    name: str
    what: str  # description for people
    steps: tuple[Step, ...] = ()
    stall: Stall | None = None


@dataclass(frozen=True)
class Experiment:
    name: str
    steps: tuple[Step, ...]
    stalls: tuple[Stall, ...]

    def template(self) -> Measured:
        readings, acts, rings = [], [], []
        for command, step in enumerate(self.steps, 1):
            readings += [replace(reading, recording=self.name, command=command) for reading in step.readings]
            acts += [replace(act, recording=self.name, command=command) for act in step.acts]
            rings += [replace(ring, recording=self.name, command=command) for ring in step.rings]
        stalls = tuple(replace(stall, recording=self.name, held_hz=math.nan, lost_hz=math.nan) for stall in self.stalls)
        return Measured(tuple(readings), tuple(acts), stalls, rings=tuple(rings))

    def comments(self) -> dict[int, str]:
        """By command: what to measure after it."""
        return {number: step.comment for number, step in enumerate(self.steps, 1) if step.comment}


def blocks(
    machine: Machine,
    controller: str,
    axes: Sequence[str],
    unknowns: Sequence[Unknown],
    seed: int,
    supplies_v: Sequence[float] = (),
) -> list[Block]:
    """All blocks for these axes. supplies_v: of the stages for stall series, where they can be set. Raises ValueError
    for a controller that does not reply to moves."""
    language = needed(create_language(controller), controller)
    slow = MoveSettings(**{name: low for name, (low, _) in language.ranges.items()})
    if language.accepted(language.move([0] * len(CARRIAGES), slow)[-1], b""):
        raise ValueError(
            f"controller {controller!r} answers nothing to a move, so no recording tells when one is over; "
            "take one that answers, at the same drives"
        )
    wired = {contact for chain in create_controller(controller).terminals().values() for contact in chain}
    notices_stop = bool(wired & {"estop_1", "estop_2", "power_ok"})  # else it counts on while the carriage coasts
    draw = np.random.default_rng([seed, 13])
    names = {item.name for item in unknowns}
    found: list[Block] = []
    for name in axes:
        axis = machine.axes[CARRIAGES.index(name)]
        tell = Teller(language, name, axis.steps_per_mm)
        reach_mm = min(axis.travel_mm - 10.0, 120.0)
        place_mm = float(round(draw.uniform(0.2, 0.5) * reach_mm))
        found.append(_reversal(tell, place_mm))
        force_n = PUSH_N * float(draw.choice([0.8, 1.0, 1.2]))
        pushed_at = PUSHED_AT if machine.kinematics == "table" and name == "y" else PUSHED_AT[:1]
        found += [_push(tell, place_mm + 5.0, force_n, at) for at in pushed_at]
        fastest = min(language.ranges["speed_hz"][1], (axis.travel_mm - 20.0) * axis.steps_per_mm / COAST_S)
        for number, speed in enumerate(COASTS_HZ if notices_stop else ()):
            speed_hz = round(min(speed * draw.uniform(0.85, 1.15), fastest))
            found.append(_coast(tell, machine, language, speed_hz, down=number % 2 == 1))
        for supply_v, acceleration in itertools.product(supplies_v or (None,), STALL_HZ_PER_MS):
            far_mm = min(55.0, axis.travel_mm - 5.0)
            found.append(_stall(name, machine, controller, 15.0, far_mm, acceleration, supply_v))
        if f"lead.{name}" in names:
            found.append(_far(tell, axis.travel_mm))
        for contact in machine.switches:
            if f"switch.{contact.name}" in names and contact.axis == name and contact.end == "far":
                found.append(_switch(tell, language, axis.travel_mm, contact.name))
    return found


class Teller:
    """Moves of one axis in the language of a controller."""

    def __init__(self, language: Language, axis: str, steps_per_mm: float) -> None:
        self.language, self.axis, self.steps_per_mm = language, axis, steps_per_mm
        low, high = language.ranges["speed_hz"]
        self.gentle = (int(np.clip(GENTLE[0], low, high)), *GENTLE[1:])

    def move(
        self, mm: float, how: tuple[int, int, int] | None = None, readings: tuple[Reading, ...] = (), **of_last: object
    ) -> tuple[Step, ...]:
        """Move to a position; the other axes stay at 0. Readings and the rest belong to the moving command."""
        target = _target(self.axis, mm, self.steps_per_mm)
        *before, last = self.language.move(target, MoveSettings(*(how or self.gentle)))
        step = Step(last, readings)
        return (*(Step(data) for data in before), replace(step, **of_last))  # type: ignore[arg-type]

    def reading(self, gauge: str, **more: Any) -> Reading:
        return Reading("", 1, self.axis, math.nan, gauge=gauge, **more)


def _reversal(tell: Teller, mm: float) -> Block:
    name = f"reversal {tell.axis} {mm:g}"
    read = (tell.reading(name),)
    below, above = f"read the gauge on {tell.axis}: came from below", "read it again: came from above"
    steps: tuple[Step, ...] = ()
    for number in range(REVERSALS):
        place_mm = mm + number * APART_MM
        steps += tell.move(place_mm - APPROACH_MM) + tell.move(place_mm, CREEP, read, comment=below)
        steps += tell.move(place_mm + APPROACH_MM) + tell.move(place_mm, CREEP, read, comment=above)
    return Block(name, f"{tell.axis}: to {mm:g} mm and on from both sides, dial gauge between tool and table", steps)


def _push(tell: Teller, mm: float, force_n: float, at: str) -> Block:
    name = f"push {tell.axis} {force_n:g} at the {at}"
    ways = (force_n, -force_n, 0.5 * force_n, -0.5 * force_n) * PULLS
    readings = tuple(tell.reading(name, push_n=way, push_at=at) for way in ways)
    pulls = f"{force_n:g} N up, down, half of it up, down, all again"
    comment = f"pull at the {at} along {tell.axis}: {pulls}; read at each"
    steps = tell.move(mm - APPROACH_MM) + tell.move(mm, readings=readings, comment=comment)
    return Block(name, f"{tell.axis}: pulled at the {at} with {force_n:g} N both ways, dial gauge", steps)


def _coast(tell: Teller, machine: Machine, language: Language, speed_hz: int, down: bool = False) -> Block:
    """down: towards the switch, as friction may differ with direction."""
    name = f"coast {tell.axis} {speed_hz}"
    start_mm = 5.0
    end_mm = start_mm + COAST_S * speed_hz / tell.steps_per_mm
    if down:
        start_mm, end_mm = end_mm, start_mm
    before, after = tell.reading(name, counter_mm=start_mm), tell.reading(name, counter_mm=math.nan)
    pressed, released = ({"set": {"estop": state}} for state in ("pressed", "released"))
    acts = (Act("", 1, PRESS_S, pressed), Act("", 1, RELEASE_S, released))
    steps = tell.move(start_mm, readings=(before,), comment=f"read the scale on {tell.axis}")
    comment = "press the emergency stop at full speed, release it at rest, read the scale"
    steps += tell.move(end_mm, (speed_hz, 400, 300), (after,), acts=acts, comment=comment, any_reply=True)
    first, *others = language.reference()
    asked: Sequence[bytes] = getattr(language, "ask_counters", tuple)()
    comment = "enter the counter that this tells as counter_mm (isel-twin decode explains the reply)"
    steps += (Step(first), *(Step(data, comment=comment, any_reply=True) for data in asked))
    steps += tuple(Step(data) for data in others)
    how = f"{'down' if down else 'up'}: emergency stop at {speed_hz / tell.steps_per_mm:.1f} mm/s, scale"
    return Block(name, f"{tell.axis} {how}", steps)


def _stall(
    name: str,
    machine: Machine,
    controller: str,
    from_mm: float,
    to_mm: float,
    acceleration: int,
    supply_v: float | None,
) -> Block:
    middle = 0.5 * needed(create_language(controller), controller).ranges["speed_hz"][1]
    wanted = Stall("", name, from_mm, to_mm, acceleration, 300, middle, 1.02 * middle, supply_v=supply_v)
    expected = stall_speed_hz(referenced(controller, with_supply(machine, supply_v)), wanted)
    stall = replace(wanted, held_hz=expected / math.sqrt(SERIES), lost_hz=expected * math.sqrt(SERIES))
    at = "" if supply_v is None else f" at {supply_v:g} V"
    what = (
        f"{name}: {from_mm:g} to {to_mm:g} mm and back at {acceleration} Hz/ms{at}, ever faster, until steps are lost"
    )
    return Block(f"stall {name} {acceleration}{at}", what, stall=stall)


def _far(tell: Teller, travel_mm: float) -> Block:
    name, near_mm, far_mm = f"far {tell.axis}", 10.0, travel_mm - 10.0
    read = (tell.reading(name, sigma_mm=FAR_SIGMA_MM),)
    steps = tell.move(near_mm, readings=read, comment=f"read the scale on {tell.axis}")
    steps += tell.move(far_mm, readings=read, comment="read it again")
    return Block(name, f"{tell.axis}: from {near_mm:g} to {far_mm:g} mm, scale", steps)


def _switch(tell: Teller, language: Language, travel_mm: float, contact: str) -> Block:
    name = f"switch {contact}"
    read = (tell.reading(name, sigma_mm=FAR_SIGMA_MM),)
    steps = tell.move(travel_mm - 10.0, readings=read, comment=f"read the scale on {tell.axis}")
    slow = (1000, 100, 300)
    steps += tell.move(travel_mm + 5.0, slow, read, comment="stands in the switch: read it again", any_reply=True)
    steps += tuple(Step(data) for data in language.reference())
    return Block(name, f"{tell.axis}: slowly into {contact}, scale", steps)


def assemble(name: str, chosen: Sequence[Block], language: Language) -> Experiment:
    """A job of a reference run and these blocks; a repeated block has its own gauge zeros."""
    steps = [Step(data) for data in language.reference()]
    stalls = []
    for number, block in enumerate(chosen, 1):
        for index, step in enumerate(block.steps):
            readings = tuple(replace(reading, gauge=f"{number} {reading.gauge}") for reading in step.readings)
            heading = f"[{number}] {block.what}" if index == 0 else ""
            comment = "; ".join(part for part in (heading, step.comment) if part)
            steps.append(replace(step, readings=readings, comment=comment))
        if block.stall is not None and block.stall not in stalls:
            stalls.append(block.stall)
    return Experiment(name, tuple(steps), tuple(stalls))


def job_text(experiment: Experiment, language: Language) -> str:
    """The job as a file that `isel-twin run` takes."""
    lines = [f"# {experiment.name}: what to measure stands above the lines; enter it in {experiment.name}.toml"]
    for number, step in enumerate(experiment.steps, 1):
        if step.comment:
            lines += ["", f"# command {number}: {step.comment}"]
        text = _text(language, step.data)
        lines.append(f"{text} => *" if step.any_reply else text)
    return "\n".join(lines) + "\n"


def series_text(experiment: Experiment, machine: Machine, language: Language) -> str:
    """The stall series as a job of its own; "" if there is none."""
    if not experiment.stalls:
        return ""
    lines = [
        f"# {experiment.name}: ever faster. Stop as soon as an axis stands elsewhere than before (mark, gauge);",
        f"# enter the last speed that held and the one that lost in {experiment.name}.toml. After a stall: reference.",
    ]
    for stall in experiment.stalls:
        scale = machine.axes[CARRIAGES.index(stall.axis)].steps_per_mm
        at = "" if stall.supply_v is None else f"; stages at {stall.supply_v:g} V"
        lines += ["", f"# Z stays where the reference run leaves it, at the top{at}"]
        lines += [_text(language, data) for data in language.reference()]
        for speed in series_hz(stall, language):
            lines += ["", f"# {stall.axis} at {speed} Hz, {stall.acceleration_hz_per_ms} Hz/ms"]
            for mm in (stall.from_mm, stall.to_mm, stall.from_mm):
                target = _target(stall.axis, mm, scale)
                settings = MoveSettings(speed, stall.acceleration_hz_per_ms, stall.start_stop_hz)
                lines += [_text(language, data) for data in language.move(target, settings)]
    return "\n".join(lines) + "\n"


def series_hz(stall: Stall, language: Language) -> list[int]:
    """Speeds of the series for an expected stall."""
    middle = math.sqrt(stall.held_hz * stall.lost_hz)
    low, high = language.ranges["speed_hz"]
    count = math.ceil(math.log(SERIES_TO / SERIES_FROM) / math.log(SERIES))
    speeds = [round(middle * SERIES_FROM * SERIES**n) for n in range(count + 1)]
    return [speed for speed in speeds if low <= speed <= high]


def _target(axis: str, mm: float, steps_per_mm: float) -> list[int]:
    return [round(mm * steps_per_mm) if name == axis else 0 for name in CARRIAGES]


def _text(language: Language, data: bytes) -> str:
    return "".join(message.text for message in language.messages(data, True))
