r"""Milling cycles G71 to G75: rectangular and circular pockets (manual 5.2; figures lost: bwo900/36 to bwo900/45).

    P11, P12 sizes, G74: radius drilled    P15 allowance on the contour    P18 allowance on the depth
    P13 depth                              P16 infeed across, signed       P19 safety distance
    P14 corner radius, pocket radius       P17 infeed in depth             P20 infeed of finishing    P21 plunging feed

The tool is in the middle of the pocket, P19 above the workpiece, or the block's words move it there. Coordinates are of
the tool's centre, along (x) and across (y) the rows, rotated by quarter turns to the plane's axes, which keeps
conventional milling:

                          5
          b   .--<-------------------<--.      corners' radius c = P14 - P15 - r, at least 0
            6/ x--------> last row       \4    a, b = half the sizes - P15 - r
             |                            |    rows: -b, -b + |P16| ... b, each as long as the pocket is there
            7| -------->                  |3
             |                            |    S1, P16 > 0: rows go on in + of the second axis (of the first, where the
          -b 8\_S--------> first row ____/2     second is longer), in conventional milling with M03; S2, P16 < 0: turned
             -a          1             a       by 180 degrees

    circular     ->- P16 ->- full circle ->- half circles that grow by P16 a turn ->- full circle ->- half circle back
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from isel_twin.firmware.bwo900.analysis.cycles.call import Call, CycleMove, Kind
from isel_twin.firmware.bwo900.analysis.cycles.milling_job import (
    NEAR_MM,
    UV,
    Job,
    Way,
    counted,
    down,
    finishing_cuts,
    job_of,
    layers,
    level,
    mill,
    positive,
    rapid,
    to_middle,
    tool_radius,
    up,
)
from isel_twin.firmware.bwo900.messages import Code, ProgramError, invalid
from isel_twin.firmware.bwo900.numbers import P

RETRACT_MM: Final = 2.0  # above the floor, between rows and layers (manual)
HALF_CIRCLE_MM: Final = 2.5  # largest radius of the half circle away from the wall (manual)
FINISHING: Final = 0.5  # of the feed, when finishing (manual)


@dataclass(frozen=True, slots=True)
class _Pocket:
    """The tool centre's rectangle: half its length and width, radius of its corners."""

    a: float
    b: float
    c: float

    def extent(self, y: float) -> float:
        """Half its length at y."""
        into = max(abs(y) - (self.b - self.c), 0.0)
        return self.a - self.c + math.sqrt(max(self.c * self.c - into * into, 0.0))

    @property
    def start(self) -> UV:
        return -(self.a - self.c), -self.b

    @property
    def ways(self) -> tuple[Way, ...]:
        """The contour from S, counter-clockwise: along, corner, across, corner, twice."""
        a, b, c = self.a, self.b, self.c
        x, y = a - c, b - c
        p = ((-x, -b), (x, -b), (a, -y), (a, y), (x, b), (-x, b), (-a, y), (-a, -y))
        centres = (None, (x, -y), None, (x, y), None, (-x, y), None, (-x, -y))
        return tuple(Way(p[k], p[(k + 1) % 8], centres[k]) for k in range(8))


def rows(half: float, infeed: float) -> list[float]:
    """Places of the rows, from -half to half, the last infeed shorter."""
    if half <= NEAR_MM:
        return [0.0]
    return [-half] + [reached - half for reached in layers(2.0 * half, infeed)]


def rectangle(call: Call) -> Iterator[CycleMove]:
    """G71: rows in conventional milling, back above each of them."""
    job, pocket = _rectangular(call)
    yield from to_middle(job)
    yield rapid(job, pocket.start)
    ways = pocket.ways
    for layer, floor in enumerate(job.floors):
        yield from down(job, layer)
        lines = rows(pocket.b, job.infeed)
        for number, y in enumerate(lines):
            x = pocket.extent(y)
            if number:
                before = -pocket.extent(lines[number - 1]), lines[number - 1]
                yield level(job, floor + RETRACT_MM, Kind.RAPID)
                yield rapid(job, before)
                yield level(job, floor, Kind.LINE)
                yield from mill(job, [Way(before, (-x, y))])
            yield from mill(job, [Way((-x, y), (x, y))])
        yield from mill(job, [ways[k].back for k in (3, 2, 1, 0, 7, 6, 5)])  # back along the wall, against burrs
        yield from up(job)
        yield rapid(job, pocket.start)
    yield rapid(job, (0.0, 0.0))


def rectangle_zigzag(call: Call) -> Iterator[CycleMove]:
    """G72: rows forth and back."""
    job, pocket = _rectangular(call)
    yield from to_middle(job)
    yield rapid(job, pocket.start)
    ways = pocket.ways
    lines = rows(pocket.b, job.infeed)
    here = [ways[k].back for k in (3, 2, 1)] if len(lines) % 2 else [ways[k] for k in (5, 6, 7)]
    there = [ways[k].back for k in (7, 6, 5)] if len(lines) % 2 else [ways[k] for k in (0, 1, 2, 3)]
    for layer, floor in enumerate(job.floors):
        yield from down(job, layer)
        yield from mill(job, _zigzag(pocket, lines))
        yield from mill(job, here)
        yield from up(job)
        yield rapid(job, pocket.start)
        yield level(job, floor + min(RETRACT_MM, job.height - floor), Kind.RAPID)
        yield level(job, floor, Kind.LINE)
        yield from mill(job, there)
        yield from up(job)
        yield rapid(job, pocket.start)
    yield rapid(job, (0.0, 0.0))


def rectangle_finished(call: Call) -> Iterator[CycleMove]:
    """G73: the contour in all layers, the inside in all layers, then the contour to its size."""
    job, pocket = _rectangular(call)
    finishing = finishing_cuts(call, job)
    yield from to_middle(job)
    yield rapid(job, pocket.start)
    for layer in range(len(job.floors)):
        yield level(job, job.floors[layer], Kind.LINE, job.plunge)
        yield from mill(job, pocket.ways)
    yield from up(job)
    # The contour has freed a band of the tool's width: rows end where they still reach it.
    inset = job.radius - job.infeed / 2.0
    core = _Pocket(pocket.a - inset, pocket.b - inset, max(pocket.c - inset, 0.0))
    lines = [y for y in rows(pocket.b, job.infeed)[1:-1] if core.a > 0.0 and abs(y) <= core.b]
    if lines:
        for layer in range(len(job.floors)):
            yield rapid(job, (-core.extent(lines[0]), lines[0]))
            yield from down(job, layer)
            yield from mill(job, _zigzag(core, lines))
            yield from up(job)
            yield rapid(job, pocket.start)
    slow = FINISHING * job.feed
    before: UV | None = None
    for allowance in finishing:
        grown = _grown(call, job, allowance)
        if before is None:
            yield rapid(job, grown.start)
            yield level(job, job.floors[-1], Kind.LINE, slow)
        else:
            yield from mill(job, [Way(before, grown.start)], slow)
        yield from mill(job, grown.ways, slow)
        before = grown.start
    yield level(job, job.height, Kind.LINE, job.feed)
    yield CycleMove(Kind.LINE, job.place((0.0, 0.0)), None, job.feed)


def _zigzag(pocket: _Pocket, lines: Sequence[float]) -> Iterator[Way]:
    at: UV | None = None
    for number, y in enumerate(lines):
        x = pocket.extent(y) if number % 2 == 0 else -pocket.extent(y)
        if at is not None:
            yield Way(at, (-x, y))
        yield Way((-x, y), (x, y))
        at = x, y


def _rectangular(call: Call) -> tuple[Job, _Pocket]:
    """Raises ProgramError: M8001 to M8021."""
    radius = tool_radius(call)
    first, second = positive(call, P.SIZE_1), positive(call, P.SIZE_2)
    job = job_of(call, radius, 0)
    corner = call.get(P.POCKET_RADIUS)
    if corner is not None and corner < 0.0:
        raise ProgramError(invalid(P.POCKET_RADIUS), f"P14 is {corner:g}")
    if corner is None:
        corner = radius
    if min(first, second) - 2.0 * (job.allowance + radius) < -NEAR_MM:
        detail = f"a tool of radius {radius:g} mm does not fit {min(first, second):g} mm with P15"
        raise ProgramError(Code.POCKET_IMPOSSIBLE, detail)
    if corner < radius:
        raise ProgramError(Code.POCKET_IMPOSSIBLE, f"P14 is {corner:g}, the tool's radius {radius:g} mm")
    if 2.0 * corner > min(first, second) + NEAR_MM:
        raise ProgramError(Code.CORNER_TOO_LARGE, f"P14 is {corner:g}, the shorter side {min(first, second):g} mm")
    quarters = 0 if first >= second else 3
    if call.needed(P.INFEED_ACROSS) < 0.0:
        quarters += 2
    job = job_of(call, radius, quarters)
    pocket = _grown(call, job, job.allowance)
    counted(P.INFEED_ACROSS, 2.0 * pocket.b, job.infeed)
    return job, pocket


def _grown(call: Call, job: Job, allowance: float) -> _Pocket:
    """The pocket of the tool's centre with an allowance."""
    sizes = call.needed(P.SIZE_1), call.needed(P.SIZE_2)
    inset = allowance + job.radius
    corner = call.given(P.POCKET_RADIUS) or job.radius
    b = min(sizes) / 2.0 - inset
    return _Pocket(max(sizes) / 2.0 - inset, b, max(min(corner - inset, b), 0.0))


def circle(call: Call) -> Iterator[CycleMove]:
    """G74: from the middle outwards, a spiral in each layer."""
    job, turn = _circular(call)
    yield from _layers(call, job, turn)
    yield level(job, job.floors[-1] + RETRACT_MM, Kind.RAPID)
    yield rapid(job, (0.0, 0.0))
    yield from up(job)


def circle_finished(call: Call) -> Iterator[CycleMove]:
    """G75: the same, then circles with half the feed until the pocket has its size."""
    job, turn = _circular(call)
    finishing = finishing_cuts(call, job)
    yield from _layers(call, job, turn)
    slow = FINISHING * job.feed
    at = _away(_radius(call, job, job.allowance), turn).end
    for allowance in finishing:
        grown = _radius(call, job, allowance)
        yield from mill(job, [Way(at, (grown, 0.0), ((at[0] + grown) / 2.0, 0.0), turn)], slow)
        yield from mill(job, [*_full(grown, turn), _away(grown, turn)], slow)
        at = _away(grown, turn).end
    yield level(job, job.height, Kind.LINE, job.feed)
    yield CycleMove(Kind.LINE, job.place((0.0, 0.0)), None, job.feed)


def _layers(call: Call, job: Job, turn: int) -> Iterator[CycleMove]:
    """A spiral in each layer; the tool stays at the end of the last one."""
    radius = _radius(call, job, job.allowance)
    yield from to_middle(job)
    for layer in range(len(job.floors)):
        if layer:
            yield level(job, job.floors[layer - 1] + RETRACT_MM, Kind.RAPID)
            yield rapid(job, (0.0, 0.0))
        yield from down(job, layer)
        yield from mill(job, _spiral(call, job, radius, turn))
        yield from mill(job, [_away(radius, turn)])


def _circular(call: Call) -> tuple[Job, int]:
    """Raises ProgramError: M8001 to M8021. Returns the turn, too."""
    tool = tool_radius(call)
    radius = positive(call, P.POCKET_RADIUS)
    drilled = call.get(P.INNER_RADIUS) or 0.0
    if drilled < 0.0:
        raise ProgramError(Code.INNER_RADIUS, f"P11 is {drilled:g}")
    if radius < tool:
        raise ProgramError(Code.POCKET_TOO_SMALL, f"P14 is {radius:g}, the tool's radius {tool:g} mm")
    job = job_of(call, tool, 0)
    if drilled + job.infeed > radius:
        raise ProgramError(Code.INFEED_BEYOND_POCKET, f"P11 and P16 are {drilled + job.infeed:g}, P14 {radius:g}")
    counted(P.INFEED_ACROSS, radius, job.infeed)
    if _radius(call, job, job.allowance) < -NEAR_MM:
        detail = f"a tool of radius {tool:g} mm does not fit radius {radius:g} mm with P15"
        raise ProgramError(Code.POCKET_IMPOSSIBLE, detail)
    return job, -1 if call.needed(P.INFEED_ACROSS) > 0.0 else 1


def _radius(call: Call, job: Job, allowance: float) -> float:
    """Of the tool's centre at the wall."""
    return call.needed(P.POCKET_RADIUS) - allowance - job.radius


def _spiral(call: Call, job: Job, last: float, turn: int) -> Iterator[Way]:
    """From the middle to the wall: along the first axis, a circle, half circles that grow, a circle."""
    if last <= NEAR_MM:
        return
    at = min((call.get(P.INNER_RADIUS) or 0.0) + job.infeed, last)
    yield Way((0.0, 0.0), (at, 0.0))
    yield from _full(at, turn)
    while at < last - NEAR_MM:
        grown = min(at + job.infeed, last)
        middle = -(at + grown) / 2.0
        yield Way((at, 0.0), (middle, 0.0), ((at + middle) / 2.0, 0.0), turn)
        yield Way((middle, 0.0), (grown, 0.0), ((middle + grown) / 2.0, 0.0), turn)
        if grown >= last - NEAR_MM:
            yield from _full(last, turn)
        at = grown


def _full(radius: float, turn: int) -> Iterator[Way]:
    yield Way((radius, 0.0), (-radius, 0.0), (0.0, 0.0), turn)
    yield Way((-radius, 0.0), (radius, 0.0), (0.0, 0.0), turn)


def _away(radius: float, turn: int) -> Way:
    inwards = min(HALF_CIRCLE_MM, radius / 2.0)
    return Way((radius, 0.0), (radius - 2.0 * inwards, 0.0), (radius - inwards, 0.0), turn)
