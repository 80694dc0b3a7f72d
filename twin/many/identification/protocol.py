"""A measuring day for one person with a dial gauge, a scale and a phone, and what comes of it as numbers.

    positioning   ISO 230-2: five places, five times from either side          accuracy, repeatability, reversal
    circle        ISO 230-4, at rest at sixteen places of a circle, either way  circular deviation, reversal, squareness
    straightness  ISO 230-1: a gauge on a straightedge along the axis          deviation from the line of its ends
    heights       two lengths of the axis, Z up and down                       turn of the guide (Abbe)
    ring          let go, listened to by a phone                               frequency and damping
    reversal, push, coast, stall                                               as experiment.py has them

The terms are those of the standards, with x the deviation from the place commanded, up and down the ways to it:

    mean m, standard deviation s at each place and way         reversal B = max |m_up - m_down|
    repeatability R = max(4 s_up, 4 s_down, 2 s_up + 2 s_down + |m_up - m_down|)
    accuracy A = max(m + 2 s) - min(m - 2 s)                   over places and ways
    circular deviation G = greatest less least radius, its centre by least squares; H = greatest difference of the ways

A straightedge is laid down by its ends, so a gauge on it shows the bow alone. A guide that turns makes a length greater
by its angle times what the arm is longer: the lengths at two heights differ by a (z_2 - z_1), whatever the lead is.
Growth by heat is a longer lead, so one day cannot tell it, and the job says so: who wants it measures a second day,
warm, and fits `axes.x.screw_warming` to that one with the lead that the cold one gave.

A circle at rest does not show what a fast one does. Squareness is read from it: a second axis that leans by q gives the
radius q/2 sin 2a over its mean. Characteristics are computed from a filled form, whoever filled it: so the twin's
predictions (sealed.py) and the machine's results are the same calculation.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.language import Language, MoveSettings, create_language, needed
from isel_twin.machine import Machine
from isel_twin.many.identification.experiment import FAR_SIGMA_MM, PUSH_N, Block, Step, Teller, blocks
from isel_twin.many.identification.measured import Measured, Reading, Ring

PLACES, RUNS = 5, 5  # of ISO 230-2, for axes up to 2 m
EDGE_MM = 10.0  # of the travel that is left out at either end
AROUND = 16  # places on a circle, those between the axes among them
OVER_MM = 2.0  # beyond the last place, before the way back
ALONG = 9  # places along a straightedge
TWICE = 2  # readings of a length
BRISK = (10_000, 100, 300)  # speed, acceleration and start-stop frequency on long ways
FASTEST_HZ = 12_000  # of a coast: a machine that stalls before it is stopped says nothing of its friction
COLD = "on the cold machine: growth by heat takes a second day, measured warm"

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
        found += _straightness(language, machine, name)
        if name in ("x", "y"):
            found.append(_heights(language, machine, name))
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
    scale, brisk = tell.steps_per_mm, _brisk(tell.language)
    places = [
        round((EDGE_MM + n * between + (odd[n] if 0 < n < PLACES - 1 else 0.0)) * scale) / scale for n in range(5)
    ]
    steps: tuple[Step, ...] = ()
    for run in range(runs):
        steps += tell.move(places[0] - OVER_MM, brisk)
        for way, order in (("up", places), ("down", places[::-1])):
            if way == "down":
                steps += tell.move(places[-1] + OVER_MM, brisk)
            for mm in order:
                read = (tell.reading(name, counter_mm=mm, sigma_mm=FAR_SIGMA_MM),)
                steps += tell.move(mm, brisk, read, comment=f"read the scale on {tell.axis}: run {run + 1}, {way}")
    what = f"{tell.axis}: ISO 230-2, {PLACES} places, {runs} times from either side, scale; {COLD}"
    return Block(name, what, steps)


def _straightness(language: Language, machine: Machine, name: str) -> list[Block]:
    """A gauge across the axis at places of its travel, there and back; one block for each direction across."""
    travel_mm = machine.axes[CARRIAGES.index(name)].travel_mm
    found = []
    for across in (axis for axis in CARRIAGES if axis != name):
        gauge = f"straightness {name}_{across}"
        steps: tuple[Step, ...] = ()
        read = Reading("", 1, across, math.nan, gauge=gauge)
        for number in range(ALONG):
            mm = EDGE_MM + number * (travel_mm - 2.0 * EDGE_MM) / (ALONG - 1)
            said = f"read the gauge along {across} on the straightedge, {name} at {mm:.1f} mm"
            steps += _go(language, machine, {name: mm}, (read,), said)
        found.append(Block(gauge, f"{name}: a straightedge along it, gauge along {across}", steps))
    return found


def _heights(language: Language, machine: Machine, name: str) -> Block:
    """Both ends of the axis with Z up, then with Z down."""
    travel_mm, deep_mm = machine.axes[CARRIAGES.index(name)].travel_mm, machine.axes[2].travel_mm - EDGE_MM
    steps: tuple[Step, ...] = ()
    for z_mm in (0.0, deep_mm):
        for mm in (EDGE_MM, travel_mm - EDGE_MM) * TWICE:
            steps += _go(language, machine, {name: mm - OVER_MM, "z": z_mm})
            read = Reading("", 1, name, math.nan, FAR_SIGMA_MM, f"heights {name} {deep_mm:g}")
            said = f"read the scale on {name}, at the height of the tool, Z at {z_mm:g} mm"
            steps += _go(language, machine, {name: mm, "z": z_mm}, (read,), said)
    return Block(f"heights {name}", f"{name}: its length with Z up and {deep_mm:g} mm down, scale at the tool", steps)


def _brisk(language: Language) -> tuple[int, int, int]:
    """BRISK as far as the controller goes."""
    low, high = language.ranges["speed_hz"]
    return min(max(BRISK[0], low), high), *BRISK[1:]


def _go(
    language: Language, machine: Machine, mm: Mapping[str, float], readings: tuple[Reading, ...] = (), said: str = ""
) -> tuple[Step, ...]:
    """To a place; axes that are not named go to 0."""
    target = [round(mm.get(axis.name, 0.0) * axis.steps_per_mm) for axis in machine.axes]
    *before, last = language.move(target, MoveSettings(*_brisk(language)))
    return (*(Step(data) for data in before), Step(last, readings, comment=said))


def _circle(language: Language, machine: Machine) -> Block:
    """Around the middle of the smaller travel, once each way; the gauge is in a bar between table and tool."""
    x, y = machine.axes[0], machine.axes[1]
    radius_mm = 0.4 * min(x.travel_mm, y.travel_mm, 300.0)
    middle = (radius_mm + EDGE_MM, radius_mm + EDGE_MM, 0.0)
    steps: tuple[Step, ...] = ()
    for way in (1, -1):
        for number in range(-1, AROUND):
            angle = way * 2.0 * math.pi * number / AROUND
            place = {"x": middle[0] + radius_mm * math.cos(angle), "y": middle[1] + radius_mm * math.sin(angle)}
            read = (Reading("", 1, "x", math.nan, gauge="circle", about_mm=middle),) if number >= 0 else ()
            clock = "against the clock" if way > 0 else "with it"
            said = f"read the gauge of the bar: {clock}, {number * 360 / AROUND:g} deg"
            steps += _go(language, machine, place, read, said if read else "")
    what = f"X and Y: ISO 230-4 at rest, radius {radius_mm:g} mm about ({middle[0]:g}, {middle[1]:g}), bar with gauge"
    return Block("circle", what, steps)


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
        of |= {"coast": _of_coast, "straightness": _of_straightness, "heights": _of_heights}
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


def _of_straightness(readings: Sequence[Reading]) -> Iterator[Characteristic]:
    """Of places evenly apart: the bow, of a parabola with the line of its ends."""
    if len(readings) == ALONG:
        part = np.linspace(0.0, 1.0, ALONG)
        shape = np.column_stack([np.ones(ALONG), part, 4.0 * part * (1.0 - part)])
        bow = np.linalg.lstsq(shape, np.array([one.mm for one in readings]), rcond=None)[0][2]
        yield Characteristic("bow", "mm", float(bow))


def _of_heights(readings: Sequence[Reading]) -> Iterator[Characteristic]:
    """Near and far end, twice; then the same with Z down by what the gauge's name says."""
    if len(readings) == 4 * TWICE:
        mm = np.array([one.mm for one in readings]).reshape(2, TWICE, 2)
        lengths = (mm[..., 1] - mm[..., 0]).mean(axis=1)
        deep_mm = float(readings[0].gauge.rpartition(" ")[2])
        yield Characteristic("turn of the guide", "mm/m", 1000.0 * float(lengths[1] - lengths[0]) / deep_mm)


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
        first, last = ((one.mm, one.counter_mm or 0.0) for one in readings)
        beyond = (last[0] - first[0]) - (last[1] - first[1])
        yield Characteristic("overrun", "mm", math.copysign(1.0, last[1] - first[1]) * beyond)
