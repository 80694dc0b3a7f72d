"""A measuring day for one person with a dial gauge, a scale and a phone, and what comes of it as numbers.

    positioning   ISO 230-2: five places, five times from either side          accuracy, repeatability, reversal
    circle        ISO 230-4, at rest at sixteen places of a circle, either way  circular deviation, reversal, squareness
    ring          let go, listened to by a phone                               frequency and damping
    reversal, push, coast, stall                                               as experiment.py has them

The terms are those of the standards, with x the deviation from the place commanded, up and down the ways to it:

    mean m, standard deviation s at each place and way         reversal B = max |m_up - m_down|
    repeatability R = max(4 s_up, 4 s_down, 2 s_up + 2 s_down + |m_up - m_down|)
    accuracy A = max(m + 2 s) - min(m - 2 s)                   over places and ways
    circular deviation G = greatest less least radius, its centre by least squares; H = greatest difference of the ways

A circle at rest does not show what a fast one does. Squareness is read from it: a second axis that leans by q gives the
radius q/2 sin 2a over its mean. Characteristics are computed from a filled form, whoever filled it: so the twin's
predictions (sealed.py) and the machine's results are the same calculation.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.language import MoveSettings, create_language, needed
from isel_twin.machine import Machine
from isel_twin.many.identification.experiment import FAR_SIGMA_MM, PUSH_N, Block, Step, Teller, blocks
from isel_twin.many.identification.measured import Measured, Reading, Ring

PLACES, RUNS = 5, 5  # of ISO 230-2, for axes up to 2 m
EDGE_MM = 10.0  # of the travel that is left out at either end
AROUND = 16  # places on a circle, those between the axes among them
OVER_MM = 2.0  # beyond the last place, before the way back
BRISK = (10_000, 100, 300)  # speed, acceleration and start-stop frequency on long ways
FASTEST_HZ = 12_000  # of a coast: a machine that stalls before it is stopped says nothing of its friction

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Characteristic:
    """One number that a measuring day gives."""

    what: str
    unit: str
    value: float


def day(machine: Machine, controller: str, axes: Sequence[str], seed: int, runs: int = RUNS) -> list[Block]:
    """The blocks of a measuring day for these axes, in the order of the day. Raises ValueError for a controller that
    does not reply to moves."""
    language = needed(create_language(controller), controller)
    draw = np.random.default_rng([seed, 17])
    found: list[Block] = []
    for name in axes:
        axis = machine.axes[CARRIAGES.index(name)]
        tell = Teller(language, name, axis.steps_per_mm)
        found.append(_positioning(tell, axis.travel_mm, draw, runs))
        found.append(_ring(tell, round(0.4 * min(axis.travel_mm, 100.0))))
    if {"x", "y"} <= set(axes):
        found.append(_circle(language, machine))
    others = blocks(machine, controller, axes, [], seed)
    return [*found, *(one for one in others if not one.name.startswith("coast") or _speed_hz(one) <= FASTEST_HZ)]


def _speed_hz(coast: Block) -> int:
    return int(coast.name.rpartition(" ")[2])


def _positioning(tell: Teller, travel_mm: float, draw: np.random.Generator, runs: int) -> Block:
    """Five places, not evenly apart (errors of a turn would hide), up and down again, `runs` times."""
    name, between = f"positioning {tell.axis}", (travel_mm - 2.0 * EDGE_MM) / (PLACES - 1)
    odd = draw.uniform(-0.2, 0.2, PLACES) * between
    scale = tell.steps_per_mm
    places = [
        round((EDGE_MM + n * between + (odd[n] if 0 < n < PLACES - 1 else 0.0)) * scale) / scale for n in range(5)
    ]
    steps: tuple[Step, ...] = ()
    for run in range(runs):
        steps += tell.move(places[0] - OVER_MM, BRISK)
        for way, order in (("up", places), ("down", places[::-1])):
            if way == "down":
                steps += tell.move(places[-1] + OVER_MM, BRISK)
            for mm in order:
                read = (tell.reading(name, counter_mm=mm, sigma_mm=FAR_SIGMA_MM),)
                steps += tell.move(mm, BRISK, read, comment=f"read the scale on {tell.axis}: run {run + 1}, {way}")
    return Block(name, f"{tell.axis}: ISO 230-2, {PLACES} places, {runs} times from either side, scale", steps)


def _circle(language: object, machine: Machine) -> Block:
    """Around the middle of the smaller travel, once each way; the gauge is in a bar between table and tool."""
    x, y = machine.axes[0], machine.axes[1]
    radius_mm = 0.4 * min(x.travel_mm, y.travel_mm, 300.0)
    middle = (radius_mm + EDGE_MM, radius_mm + EDGE_MM, 0.0)
    how = MoveSettings(*BRISK)
    steps: list[Step] = []
    for way in (1, -1):
        for number in range(-1, AROUND):
            angle = way * 2.0 * math.pi * number / AROUND
            place = (middle[0] + radius_mm * math.cos(angle), middle[1] + radius_mm * math.sin(angle))
            target = [round(place[0] * x.steps_per_mm), round(place[1] * y.steps_per_mm), 0]
            read = (Reading("", 1, "x", math.nan, gauge="circle", about_mm=middle),) if number >= 0 else ()
            *before, last = language.move(target, how)  # type: ignore[attr-defined]
            clock = "against the clock" if way > 0 else "with it"
            said = f"read the gauge of the bar: {clock}, {number * 360 / AROUND:g} deg"
            steps += [*(Step(data) for data in before), Step(last, read, comment=said if read else "")]
    what = f"X and Y: ISO 230-4 at rest, radius {radius_mm:g} mm about ({middle[0]:g}, {middle[1]:g}), bar with gauge"
    return Block("circle", what, tuple(steps))


def _ring(tell: Teller, mm: float) -> Block:
    ring = Ring("", 1, tell.axis, PUSH_N)
    comment = f"pull the tool along {tell.axis} with {PUSH_N:g} N, let go at once, record it: sound, or acceleration"
    steps = tell.move(mm - OVER_MM) + tell.move(mm, comment=comment, rings=(ring,))
    return Block(f"ring {tell.axis}", f"{tell.axis}: let go and listened to, phone", steps)


# What comes of it ---


def characteristics(measured: Measured) -> list[Characteristic]:
    """All numbers of a filled form, in its order; of what was not read, none."""
    found: list[Characteristic] = []
    for gauge, readings in itertools.groupby(measured.readings, key=lambda one: one.gauge):
        own, kind = list(readings), gauge.partition(" ")[2]
        of = {"positioning": _of_positions, "circle": _of_circle, "reversal": _of_reversal, "push": _of_push}
        of["coast"] = _of_coast
        make = of.get(kind.split(" ")[0])
        if make is not None:
            found += [replace(one, what=f"{kind}: {one.what}") for one in make(own)]
    for ring in measured.rings:
        found.append(Characteristic(f"ring {ring.axis}: frequency", "Hz", ring.frequency_hz))
        if math.isfinite(ring.damping):
            found.append(Characteristic(f"ring {ring.axis}: damping", "%", 100.0 * ring.damping))
    for stall in measured.stalls:
        at = "" if stall.supply_v is None else f" at {stall.supply_v:g} V"
        if stall.held_hz > 0.0 and stall.lost_hz < math.inf:
            name = f"stall {stall.axis} {stall.acceleration_hz_per_ms}{at}: speed"
            found.append(Characteristic(name, "Hz", stall.middle_hz))
    return found


def _runs(readings: Sequence[Reading]) -> Iterator[tuple[float, bool, float]]:
    """Place, True for the way up, and deviation of each reading."""
    last, up = -math.inf, True
    for one in readings:
        place = one.counter_mm or 0.0
        up = place > last if place != last else not up
        last = place
        yield place, up, one.mm - place


def _of_positions(readings: Sequence[Reading]) -> Iterator[Characteristic]:
    """Needs two runs: a standard deviation."""
    by: dict[float, tuple[list[float], list[float]]] = {}
    for place, up, deviation in _runs(readings):
        by.setdefault(place, ([], []))[0 if up else 1].append(deviation)
    if any(len(one) < 2 for ways in by.values() for one in ways):
        return
    mean = np.array([[np.mean(one) for one in ways] for ways in by.values()])
    spread = np.array([[np.std(one, ddof=1) for one in ways] for ways in by.values()])
    reversal = np.abs(mean[:, 0] - mean[:, 1])
    both = 2.0 * spread.sum(axis=1) + reversal
    accuracy = (mean + 2.0 * spread).max() - (mean - 2.0 * spread).min()
    slope = np.polyfit(np.array(list(by)), mean.mean(axis=1), 1)[0]
    yield Characteristic("accuracy A", "mm", float(accuracy))
    yield Characteristic("repeatability R", "mm", float(max(4.0 * spread.max(), both.max())))
    yield Characteristic("reversal B", "mm", float(reversal.max()))
    yield Characteristic("lead error", "%", float(100.0 * slope))


def _of_circle(readings: Sequence[Reading]) -> Iterator[Characteristic]:
    """Readings of one way, then of the other, both from the angle 0."""
    half = len(readings) // 2
    if half < 6 or len(readings) != 2 * half:
        return
    radius = np.array([one.mm for one in readings]).reshape(2, half)
    angle = 2.0 * math.pi * np.arange(half) / half
    shape = np.column_stack([np.ones(half), np.cos(angle), np.sin(angle), np.sin(2.0 * angle)])
    radius[1] = np.roll(radius[1][::-1], 1)  # the other way round: -angle
    found = [np.linalg.lstsq(shape, one, rcond=None)[0] for one in radius]
    round_ = np.array([one - shape[:, :3] @ terms[:3] for one, terms in zip(radius, found, strict=True)])
    yield Characteristic("circular deviation G", "mm", float((round_.max(axis=1) - round_.min(axis=1)).max()))
    yield Characteristic("reversal H", "mm", float(np.abs(radius[0] - radius[1]).max()))
    lean = float(np.mean([terms[3] for terms in found]))
    yield Characteristic("squareness", "mm/m", 2000.0 * lean / _radius_mm(readings))


def _radius_mm(readings: Sequence[Reading]) -> float:
    """By the place of its middle (`_circle`): a bar's zero is unknown."""
    about = readings[0].about_mm
    assert about is not None
    return about[0] - EDGE_MM


def _of_reversal(readings: Sequence[Reading]) -> Iterator[Characteristic]:
    """Each place from below, then from above."""
    differences = [above.mm - below.mm for below, above in zip(readings[::2], readings[1::2], strict=True)]
    yield Characteristic("reversal", "mm", float(np.mean(differences)))


def _of_push(readings: Sequence[Reading]) -> Iterator[Characteristic]:
    most = max(one.push_n for one in readings)
    ends = [[one.mm for one in readings if one.push_n == way] for way in (most, -most)]
    if all(ends):
        yield Characteristic("both ways", "mm", float(np.mean(ends[0]) - np.mean(ends[1])))


def _of_coast(readings: Sequence[Reading]) -> Iterator[Characteristic]:
    if len(readings) == 2:
        before, after = (one.mm - (one.counter_mm or 0.0) for one in readings)
        yield Characteristic("overrun", "mm", after - before)
