r"""Milling cycles G71 to G75: rectangular and circular pockets (manual 5.2; figures lost: decisions Z40 to Z49).

    P11, P12 sizes, G74: radius drilled    P15 allowance on the contour    P18 allowance on the depth
    P13 depth                              P16 infeed across, signed       P19 safety distance
    P14 corner radius, pocket radius       P17 infeed in depth             P20 infeed of finishing    P21 plunging feed

The tool stands in the middle of the pocket, P19 above the workpiece, or the block's words bring it there. Everything is
reckoned beside the tool's centre, in coordinates along (x) and across (y) the rows; the plane's are these turned by
quarters, so that what is conventional stays so:

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
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from isel_twin.firmware.bwo900.analysis.cycles.call import Call, CycleMove, Kind
from isel_twin.firmware.bwo900.messages import Code, ProgramError, invalid
from isel_twin.firmware.bwo900.numbers import P

RETRACT_MM: Final = 2.0
"""Above the floor, between rows and layers (manual)."""
HALF_CIRCLE_MM: Final = 2.5
"""Largest radius of the half circle away from the wall (manual)."""
FINISHING: Final = 0.5
"""Of the feed, when finishing (manual)."""
MOST: Final = 10_000
"""Infeeds in one direction; more is a slip in a parameter."""
NEAR_MM: Final = 1e-9

UV: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Way:
    """A piece of a path in the plane: to a place, straight or about a centre (turn +1 counter-clockwise)."""

    start: UV
    end: UV
    centre: UV | None = None
    turn: int = 1

    @property
    def back(self) -> _Way:
        """The same, the other way."""
        return _Way(self.end, self.start, self.centre, -self.turn)


@dataclass(frozen=True, slots=True)
class _Job:
    """What all milling cycles know: where, how deep, how fast. Heights along the third axis, feeds in mm/min."""

    call: Call
    middle: UV
    height: float
    """Where it begins and ends: the safety distance above the workpiece."""
    floors: tuple[float, ...]
    radius: float
    """Of the tool."""
    infeed: float
    """Across, more than 0."""
    allowance: float
    feed: float
    plunge: float
    quarters: int = 0
    """Turns of 90 degrees from along and across to the plane's axes."""

    def place(self, way: UV) -> dict[int, float]:
        """A place along and across, as axes of the plane."""
        x, y = way
        u, v = ((x, y), (-y, x), (-x, -y), (y, -x))[self.quarters % 4]
        plane = self.call.plane
        return {plane.first: self.middle[0] + u, plane.second: self.middle[1] + v}


@dataclass(frozen=True, slots=True)
class _Pocket:
    """A rectangle with rounded corners, of the tool's centre: half its length and width, radius of its corners."""

    a: float
    b: float
    c: float

    def extent(self, y: float) -> float:
        """Half its length at y."""
        into = max(abs(y) - (self.b - self.c), 0.0)
        return self.a - self.c + math.sqrt(max(self.c * self.c - into * into, 0.0))

    @property
    def start(self) -> UV:
        """S."""
        return -(self.a - self.c), -self.b

    @property
    def ways(self) -> tuple[_Way, ...]:
        """Around it from S, counter-clockwise: along, corner, across, corner, along, corner, across, corner."""
        a, b, c = self.a, self.b, self.c
        x, y = a - c, b - c
        p = ((-x, -b), (x, -b), (a, -y), (a, y), (x, b), (-x, b), (-a, y), (-a, -y))
        centres = (None, (x, -y), None, (x, y), None, (-x, y), None, (-x, -y))
        return tuple(_Way(p[k], p[(k + 1) % 8], centres[k]) for k in range(8))


def layers(depth: float, infeed: float) -> list[float]:
    """Depths of the layers: infeed by infeed, the last one what is left."""
    count = max(math.ceil(depth / infeed - 1e-9), 1)
    return [infeed * number for number in range(1, count)] + [depth]


def rows(half: float, infeed: float) -> list[float]:
    """Places of the rows, from -half to half: infeed by infeed, the last one what is left."""
    if half <= NEAR_MM:
        return [0.0]
    return [-half] + [reached - half for reached in layers(2.0 * half, infeed)]


# ---- rectangular pockets ---------------------------------------------------------------------------------------------


def rectangle(call: Call) -> Iterator[CycleMove]:
    """G71: rows in conventional milling, back above each of them."""
    job, pocket = _rectangular(call)
    yield from _begin(job)
    yield _rapid(job, pocket.start)
    ways = pocket.ways
    for layer, floor in enumerate(job.floors):
        yield from _down(job, layer)
        lines = rows(pocket.b, job.infeed)
        for number, y in enumerate(lines):
            x = pocket.extent(y)
            if number:
                before = -pocket.extent(lines[number - 1]), lines[number - 1]
                yield _level(job, floor + RETRACT_MM, Kind.RAPID)
                yield _rapid(job, before)
                yield _level(job, floor, Kind.LINE)
                yield from _mill(job, [_Way(before, (-x, y))])
            yield from _mill(job, [_Way((-x, y), (x, y))])
        yield from _mill(job, [ways[k].back for k in (3, 2, 1, 0, 7, 6, 5)])  # burrs, the wall on the left, too
        yield from _up(job)
        yield _rapid(job, pocket.start)
    yield _rapid(job, (0.0, 0.0))


def rectangle_zigzag(call: Call) -> Iterator[CycleMove]:
    """G72: rows forth and back."""
    job, pocket = _rectangular(call)
    yield from _begin(job)
    yield _rapid(job, pocket.start)
    ways = pocket.ways
    lines = rows(pocket.b, job.infeed)
    here = [ways[k].back for k in (3, 2, 1)] if len(lines) % 2 else [ways[k] for k in (5, 6, 7)]
    there = [ways[k].back for k in (7, 6, 5)] if len(lines) % 2 else [ways[k] for k in (0, 1, 2, 3)]
    for layer, floor in enumerate(job.floors):
        yield from _down(job, layer)
        yield from _mill(job, _zigzag(pocket, lines))
        yield from _mill(job, here)
        yield from _up(job)
        yield _rapid(job, pocket.start)
        yield _level(job, floor + min(RETRACT_MM, job.height - floor), Kind.RAPID)
        yield _level(job, floor, Kind.LINE)
        yield from _mill(job, there)
        yield from _up(job)
        yield _rapid(job, pocket.start)
    yield _rapid(job, (0.0, 0.0))


def rectangle_finished(call: Call) -> Iterator[CycleMove]:
    """G73: the contour in all layers, what is left inside in all layers, then the contour to its size."""
    job, pocket = _rectangular(call)
    finishing = _finishing(call, job)
    yield from _begin(job)
    yield _rapid(job, pocket.start)
    for layer in range(len(job.floors)):
        yield _level(job, job.floors[layer], Kind.LINE, job.plunge)
        yield from _mill(job, pocket.ways)
    yield from _up(job)
    # A band of the tool's width is free along the contour: the rows end where they still meet it.
    inset = job.radius - job.infeed / 2.0
    core = _Pocket(pocket.a - inset, pocket.b - inset, max(pocket.c - inset, 0.0))
    lines = [y for y in rows(pocket.b, job.infeed)[1:-1] if core.a > 0.0 and abs(y) <= core.b]
    if lines:
        for layer in range(len(job.floors)):
            yield _rapid(job, (-core.extent(lines[0]), lines[0]))
            yield from _down(job, layer)
            yield from _mill(job, _zigzag(core, lines))
            yield from _up(job)
            yield _rapid(job, pocket.start)
    slow = FINISHING * job.feed
    before: UV | None = None
    for allowance in finishing:
        grown = _grown(call, job, allowance)
        if before is None:
            yield _rapid(job, grown.start)
            yield _level(job, job.floors[-1], Kind.LINE, slow)
        else:
            yield from _mill(job, [_Way(before, grown.start)], slow)
        yield from _mill(job, grown.ways, slow)
        before = grown.start
    yield _level(job, job.height, Kind.LINE, job.feed)
    yield CycleMove(Kind.LINE, job.place((0.0, 0.0)), None, job.feed)


def _zigzag(pocket: _Pocket, lines: Sequence[float]) -> Iterator[_Way]:
    """Rows forth and back; from one to the next straight."""
    at: UV | None = None
    for number, y in enumerate(lines):
        x = pocket.extent(y) if number % 2 == 0 else -pocket.extent(y)
        if at is not None:
            yield _Way(at, (-x, y))
        yield _Way((-x, y), (x, y))
        at = x, y


def _rectangular(call: Call) -> tuple[_Job, _Pocket]:
    """Checks the parameters of G71 to G73. Raises ProgramError: M8001 to M8021."""
    radius = _tool(call)
    first, second = _positive(call, P.SIZE_1), _positive(call, P.SIZE_2)
    job = _job(call, radius, 0)
    corner = call.get(P.POCKET_RADIUS)
    if corner is not None and corner < 0.0:
        raise ProgramError(invalid(P.POCKET_RADIUS), f"P14 is {corner:g}")
    if corner is None:
        corner = radius
    if min(first, second) - 2.0 * (job.allowance + radius) < -NEAR_MM:
        raise ProgramError(
            Code.POCKET_IMPOSSIBLE, f"a tool of radius {radius:g} mm does not fit {min(first, second):g} mm with P15"
        )
    if corner < radius:
        raise ProgramError(Code.POCKET_IMPOSSIBLE, f"P14 is {corner:g}, the tool's radius {radius:g} mm")
    if 2.0 * corner > min(first, second) + NEAR_MM:
        raise ProgramError(Code.CORNER_TOO_LARGE, f"P14 is {corner:g}, the shorter side {min(first, second):g} mm")
    quarters = 0 if first >= second else 3
    if call.needed(P.INFEED_ACROSS) < 0.0:
        quarters += 2
    job = _job(call, radius, quarters)
    pocket = _grown(call, job, job.allowance)
    _counted(P.INFEED_ACROSS, 2.0 * pocket.b, job.infeed)
    return job, pocket


def _grown(call: Call, job: _Job, allowance: float) -> _Pocket:
    """The pocket of the tool's centre with an allowance."""
    sizes = call.needed(P.SIZE_1), call.needed(P.SIZE_2)
    inset = allowance + job.radius
    corner = call.given(P.POCKET_RADIUS) or job.radius
    b = min(sizes) / 2.0 - inset
    return _Pocket(max(sizes) / 2.0 - inset, b, max(min(corner - inset, b), 0.0))


# ---- circular pockets ------------------------------------------------------------------------------------------------


def circle(call: Call) -> Iterator[CycleMove]:
    """G74: from the middle outwards, a spiral in each layer."""
    job, turn = _circular(call)
    radius = _radius(call, job, job.allowance)
    yield from _begin(job)
    for layer, floor in enumerate(job.floors):
        yield from _down(job, layer)
        yield from _mill(job, _spiral(call, job, radius, turn))
        yield from _mill(job, [_away(radius, turn)])
        yield _level(job, floor + RETRACT_MM, Kind.RAPID)
        yield _rapid(job, (0.0, 0.0))
    yield from _up(job)


def circle_finished(call: Call) -> Iterator[CycleMove]:
    """G75: the same, then circles with half the feed until the pocket has its size."""
    job, turn = _circular(call)
    finishing = _finishing(call, job)
    radius = _radius(call, job, job.allowance)
    yield from _begin(job)
    for layer, floor in enumerate(job.floors):
        yield from _down(job, layer)
        yield from _mill(job, _spiral(call, job, radius, turn))
        yield from _mill(job, [_away(radius, turn)])
        if layer < len(job.floors) - 1:
            yield _level(job, floor + RETRACT_MM, Kind.RAPID)
            yield _rapid(job, (0.0, 0.0))
    slow = FINISHING * job.feed
    at = _away(radius, turn).end
    for allowance in finishing:
        grown = _radius(call, job, allowance)
        yield from _mill(job, [_Way(at, (grown, 0.0), ((at[0] + grown) / 2.0, 0.0), turn)], slow)
        yield from _mill(job, [*_full(grown, turn), _away(grown, turn)], slow)
        at = _away(grown, turn).end
    yield _level(job, job.height, Kind.LINE, job.feed)
    yield CycleMove(Kind.LINE, job.place((0.0, 0.0)), None, job.feed)


def _circular(call: Call) -> tuple[_Job, int]:
    """Checks the parameters of G74 and G75; the turn. Raises ProgramError: M8001 to M8021."""
    tool = _tool(call)
    radius = _positive(call, P.POCKET_RADIUS)
    drilled = call.get(P.SIZE_1) or 0.0
    if drilled < 0.0:
        raise ProgramError(Code.INNER_RADIUS, f"P11 is {drilled:g}")
    if radius < tool:
        raise ProgramError(Code.POCKET_TOO_SMALL, f"P14 is {radius:g}, the tool's radius {tool:g} mm")
    job = _job(call, tool, 0)
    if drilled + job.infeed > radius:
        raise ProgramError(Code.INFEED_BEYOND_POCKET, f"P11 and P16 are {drilled + job.infeed:g}, P14 {radius:g}")
    _counted(P.INFEED_ACROSS, radius, job.infeed)
    if _radius(call, job, job.allowance) < -NEAR_MM:
        raise ProgramError(
            Code.POCKET_IMPOSSIBLE, f"a tool of radius {tool:g} mm does not fit radius {radius:g} mm with P15"
        )
    return job, -1 if call.needed(P.INFEED_ACROSS) > 0.0 else 1


def _radius(call: Call, job: _Job, allowance: float) -> float:
    """Of the tool's centre on the wall."""
    return call.needed(P.POCKET_RADIUS) - allowance - job.radius


def _spiral(call: Call, job: _Job, last: float, turn: int) -> Iterator[_Way]:
    """From the middle to the wall: along the first axis, a circle, half circles that grow, a circle."""
    if last <= NEAR_MM:
        return
    at = min((call.get(P.SIZE_1) or 0.0) + job.infeed, last)
    yield _Way((0.0, 0.0), (at, 0.0))
    yield from _full(at, turn)
    while at < last - NEAR_MM:
        grown = min(at + job.infeed, last)
        middle = -(at + grown) / 2.0
        yield _Way((at, 0.0), (middle, 0.0), ((at + middle) / 2.0, 0.0), turn)
        yield _Way((middle, 0.0), (grown, 0.0), ((middle + grown) / 2.0, 0.0), turn)
        if grown >= last - NEAR_MM:
            yield from _full(last, turn)
        at = grown


def _full(radius: float, turn: int) -> Iterator[_Way]:
    """A full circle from the first axis, in halves."""
    yield _Way((radius, 0.0), (-radius, 0.0), (0.0, 0.0), turn)
    yield _Way((-radius, 0.0), (radius, 0.0), (0.0, 0.0), turn)


def _away(radius: float, turn: int) -> _Way:
    """The half circle away from the wall."""
    inwards = min(HALF_CIRCLE_MM, radius / 2.0)
    return _Way((radius, 0.0), (radius - 2.0 * inwards, 0.0), (radius - inwards, 0.0), turn)


# ---- both ------------------------------------------------------------------------------------------------------------


def _tool(call: Call) -> float:
    if call.tool_radius_mm <= 0.0:
        raise ProgramError(Code.POCKET_IMPOSSIBLE, "the tool has no radius")
    return call.tool_radius_mm


def _positive(call: Call, number: int) -> float:
    value = call.needed(number)
    if value <= 0.0:
        raise ProgramError(invalid(number), f"P{number} is {value:g}; allowed: more than 0")
    return value


def _counted(number: int, way: float, step: float) -> None:
    if way > MOST * step:
        raise ProgramError(invalid(number), f"P{number} is {step:g}: more than {MOST} infeeds to {way:g} mm")


def _not_negative(call: Call, number: int) -> float:
    value = call.get(number) or 0.0
    if value < 0.0:
        raise ProgramError(invalid(number), f"P{number} is {value:g}; allowed: 0 and more")
    return value


def _job(call: Call, radius: float, quarters: int) -> _Job:
    """What all of them check. Raises ProgramError: M8009, M8013, M8015 to M8019, M8021, M1230 no feed."""
    depth = _positive(call, P.POCKET_DEPTH)
    allowance = _not_negative(call, P.ALLOWANCE)
    infeed = abs(call.needed(P.INFEED_ACROSS))
    if not 0.0 < infeed <= 2.0 * radius + NEAR_MM:
        raise ProgramError(
            invalid(P.INFEED_ACROSS),
            f"P16 is {call.get(P.INFEED_ACROSS):g}; allowed: to the tool's diameter, {2.0 * radius:g} mm",
        )
    step = _positive(call, P.INFEED_DEPTH)
    left = _not_negative(call, P.DEPTH_ALLOWANCE)
    if left >= depth:
        raise ProgramError(invalid(P.DEPTH_ALLOWANCE), f"P18 is {left:g}, P13 {depth:g}")
    if step > depth - left + NEAR_MM:
        raise ProgramError(Code.INFEED_BEYOND_DEPTH, f"P17 is {step:g}, P13 less P18 {depth - left:g}")
    _counted(P.INFEED_DEPTH, depth - left, step)
    safety = _positive(call, P.POCKET_SAFETY)
    plunge = _not_negative(call, P.PLUNGING_FEED) or call.feed_mm_min
    if call.feed_mm_min is None or plunge is None:
        raise ProgramError(Code.NO_FEED)
    plane = call.plane
    u, v = plane.of(call.position)
    height = call.words.get(plane.third, call.position[plane.third])
    return _Job(
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


def _finishing(call: Call, job: _Job) -> list[float]:
    """Allowances of the finishing cuts, 0 the last; none where there is no allowance. Raises ProgramError: M8020."""
    if not job.allowance:
        return []
    step = _positive(call, P.FINISHING_INFEED)
    _counted(P.FINISHING_INFEED, job.allowance, step)
    return [job.allowance - reached for reached in layers(job.allowance, step)]


def _begin(job: _Job) -> Iterator[CycleMove]:
    """To the middle, where the block says it."""
    if job.call.words:
        yield CycleMove(Kind.RAPID, job.call.words)


def _rapid(job: _Job, place: UV) -> CycleMove:
    return CycleMove(Kind.RAPID, job.place(place))


def _level(job: _Job, height: float, kind: Kind, feed: float | None = None) -> CycleMove:
    """To a height; with feed it is a floor, which is reached before the tool goes on."""
    return CycleMove(kind, {job.call.plane.third: height}, None, feed, exact_stop=kind is Kind.LINE)


def _down(job: _Job, layer: int) -> Iterator[CycleMove]:
    """To a layer's floor: rapid through what is free, with a safety distance, then with the plunging feed."""
    if layer:
        over = job.floors[layer - 1] + job.call.needed(P.POCKET_SAFETY)
        if over < job.height:
            yield _level(job, over, Kind.RAPID)
    yield _level(job, job.floors[layer], Kind.LINE, job.plunge)


def _up(job: _Job) -> Iterator[CycleMove]:
    """To the safety distance above the workpiece."""
    yield _level(job, job.height, Kind.RAPID)


def _mill(job: _Job, ways: Iterable[_Way], feed: float | None = None) -> Iterator[CycleMove]:
    """Along the ways; those without a length are none."""
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
