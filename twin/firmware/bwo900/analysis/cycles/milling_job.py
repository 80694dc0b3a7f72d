"""Common to the milling cycles G71 to G75: parameters and their limits, layers, moves (manual 5.2)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

from isel_twin.firmware.bwo900.analysis.cycles.call import Call, CycleMove, Kind
from isel_twin.firmware.bwo900.messages import Code, ProgramError, invalid
from isel_twin.firmware.bwo900.numbers import P

MOST: Final = 10_000  # infeeds in one direction; more is an error
NEAR_MM: Final = 1e-9

UV: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Way:
    """A piece of a path in the plane: to a place, straight or about a centre (turn +1 counter-clockwise)."""

    start: UV
    end: UV
    centre: UV | None = None
    turn: int = 1

    @property
    def back(self) -> Way:
        return Way(self.end, self.start, self.centre, -self.turn)


@dataclass(frozen=True, slots=True)
class Job:
    """Where, how deep, how fast. Heights along the third axis, feeds in mm/min."""

    call: Call
    middle: UV
    height: float  # where it begins and ends: the safety distance above the workpiece
    floors: tuple[float, ...]
    radius: float  # of the tool
    infeed: float  # across, more than 0
    allowance: float
    feed: float
    plunge: float
    quarters: int = 0  # turns of 90 degrees from along and across to the plane's axes

    def place(self, way: UV) -> dict[int, float]:
        """A place along and across, as axes of the plane."""
        x, y = way
        u, v = ((x, y), (-y, x), (-x, -y), (y, -x))[self.quarters % 4]
        plane = self.call.plane
        return {plane.first: self.middle[0] + u, plane.second: self.middle[1] + v}


def layers(depth: float, infeed: float) -> list[float]:
    """Depths of the layers: infeed by infeed, then the rest."""
    count = max(math.ceil(depth / infeed - 1e-9), 1)
    return [infeed * number for number in range(1, count)] + [depth]


def tool_radius(call: Call) -> float:
    if call.tool_radius_mm <= 0.0:
        raise ProgramError(Code.POCKET_IMPOSSIBLE, "the tool has no radius")
    return call.tool_radius_mm


def positive(call: Call, number: int) -> float:
    value = call.needed(number)
    if value <= 0.0:
        raise ProgramError(invalid(number), f"P{number} is {value:g}; allowed: more than 0")
    return value


def counted(number: int, way: float, step: float) -> None:
    if way > MOST * step:
        raise ProgramError(invalid(number), f"P{number} is {step:g}: more than {MOST} infeeds to {way:g} mm")


def not_negative(call: Call, number: int) -> float:
    value = call.get(number) or 0.0
    if value < 0.0:
        raise ProgramError(invalid(number), f"P{number} is {value:g}; allowed: 0 and more")
    return value


def job_of(call: Call, radius: float, quarters: int) -> Job:
    """Raises ProgramError: M8009, M8013, M8015 to M8019, M8021, M1230 no feed."""
    depth = positive(call, P.POCKET_DEPTH)
    allowance = not_negative(call, P.ALLOWANCE)
    infeed = abs(call.needed(P.INFEED_ACROSS))
    if not 0.0 < infeed <= 2.0 * radius + NEAR_MM:
        raise ProgramError(
            invalid(P.INFEED_ACROSS),
            f"P16 is {call.get(P.INFEED_ACROSS):g}; allowed: to the tool's diameter, {2.0 * radius:g} mm",
        )
    step = positive(call, P.INFEED_DEPTH)
    left = not_negative(call, P.DEPTH_ALLOWANCE)
    if left >= depth:
        raise ProgramError(invalid(P.DEPTH_ALLOWANCE), f"P18 is {left:g}, P13 {depth:g}")
    if step > depth - left + NEAR_MM:
        raise ProgramError(Code.INFEED_BEYOND_DEPTH, f"P17 is {step:g}, P13 less P18 {depth - left:g}")
    counted(P.INFEED_DEPTH, depth - left, step)
    safety = positive(call, P.POCKET_SAFETY)
    plunge = not_negative(call, P.PLUNGING_FEED) or call.feed_mm_min
    if call.feed_mm_min is None or plunge is None:
        raise ProgramError(Code.NO_FEED)
    plane = call.plane
    u, v = plane.of(call.position)
    height = call.words.get(plane.third, call.position[plane.third])
    return Job(
        call=call,
        middle=(call.words.get(plane.first, u), call.words.get(plane.second, v)),
        height=height,
        floors=tuple(height - safety - reached for reached in layers(depth - left, step)),
        radius=radius,
        infeed=infeed,
        allowance=allowance,
        feed=call.feed_mm_min,
        plunge=plunge,
        quarters=quarters,
    )


def finishing_cuts(call: Call, job: Job) -> list[float]:
    """Allowances of the finishing cuts, the last one 0; none without an allowance. Raises ProgramError: M8020."""
    if not job.allowance:
        return []
    step = positive(call, P.FINISHING_INFEED)
    counted(P.FINISHING_INFEED, job.allowance, step)
    return [job.allowance - reached for reached in layers(job.allowance, step)]


def to_middle(job: Job) -> Iterator[CycleMove]:
    """To the middle, if the block names it."""
    if job.call.words:
        yield CycleMove(Kind.RAPID, job.call.words)


def rapid(job: Job, place: UV) -> CycleMove:
    return CycleMove(Kind.RAPID, job.place(place))


def level(job: Job, height: float, kind: Kind, feed: float | None = None) -> CycleMove:
    """To a height; a floor (with feed) ends with an exact stop."""
    return CycleMove(kind, {job.call.plane.third: height}, None, feed, exact_stop=kind is Kind.LINE)


def down(job: Job, layer: int) -> Iterator[CycleMove]:
    """To a layer's floor: rapid through free space, with a safety distance, then with the plunging feed."""
    if layer:
        over = job.floors[layer - 1] + job.call.needed(P.POCKET_SAFETY)
        if over < job.height:
            yield level(job, over, Kind.RAPID)
    yield level(job, job.floors[layer], Kind.LINE, job.plunge)


def up(job: Job) -> Iterator[CycleMove]:
    """To the safety distance above the workpiece."""
    yield level(job, job.height, Kind.RAPID)


def mill(job: Job, ways: Iterable[Way], feed: float | None = None) -> Iterator[CycleMove]:
    """Along the ways that have a length."""
    for way in ways:
        if math.dist(way.start, way.end) <= NEAR_MM:
            continue
        if way.centre is None:
            yield CycleMove(Kind.LINE, job.place(way.end), None, feed)
            continue
        centre = job.place(way.centre)
        kind = Kind.COUNTER_CLOCKWISE if way.turn > 0 else Kind.CLOCKWISE
        plane = job.call.plane
        yield CycleMove(kind, job.place(way.end), (centre[plane.first], centre[plane.second]), feed)
