"""Pattern cycles G86 to G89: places at which a machining cycle is called (manual 5.4).

    G86 ray          A + k AB/(N-1)              P100, P101 vector | P103 angle, P104 length | P103, P105 division, P106
    G87 perimeter    of a parallelogram of two rays (P100 ..., P110 ...): along 1, along 2, back along 1, back along 2
    G88 grid         ray 1 forth, a step on ray 2, ray 1 back ...; at the end back to A
    G89 circle       centre P120, P121, diameter P122, from P123 on, over P124, division P125, N P126

A: the words of the block, or the tool's position. N = 0: straight to B, no cycle; N = 1: to B, the cycle once there; on
the circle by way of A. Places are approached with G00; on the circle, with G02 or G03 in force, along it with the
highest feed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Final

from isel_twin.firmware.bwo900.analysis.cycles.call import Call, CycleMove, Kind
from isel_twin.firmware.bwo900.geometry.frames import Rotation
from isel_twin.firmware.bwo900.messages import Code, ProgramError, invalid
from isel_twin.firmware.bwo900.numbers import G, P, Ray

TURNS: Final = {G.CIRCLE_CLOCKWISE: Kind.CLOCKWISE, G.CIRCLE_COUNTER_CLOCKWISE: Kind.COUNTER_CLOCKWISE}
AGREE_MM: Final = 1e-3  # tolerance of redundant parameters
# by first parameter of a ray: places missing, contradicting lengths, contradicting places
RAY_CODES: Final[Mapping[int, tuple[Code, Code, Code]]] = {
    P.RAY_1: (Code.RAY_1_PLACES_MISSING, Code.RAY_1_LENGTH_TWICE, Code.RAY_1_PLACES_TWICE),
    P.RAY_2: (Code.RAY_2_PLACES_MISSING, Code.RAY_2_LENGTH_TWICE, Code.RAY_2_PLACES_TWICE),
}


@dataclass(frozen=True, slots=True)
class _Ray:
    u: float
    v: float
    count: int

    def at(self, number: float) -> tuple[float, float]:
        """Place 0 .. count - 1; the end if there is one place or none."""
        share = number / (self.count - 1) if self.count > 1 else 1.0
        return share * self.u, share * self.v


def ray(call: Call) -> Iterator[CycleMove]:
    """G86."""
    begin, line = _start(call), _ray(call, P.RAY_1)
    yield from _come(call, begin)
    if line.count < 2:
        yield _place(call, begin, line.at(1.0), line.count == 1)
        return
    for number in range(line.count):
        yield _place(call, begin, line.at(number), True)


def perimeter(call: Call) -> Iterator[CycleMove]:
    """G87."""
    begin, first, second = _start(call), _ray(call, P.RAY_1), _ray(call, P.RAY_2)
    yield from _come(call, begin)
    n, m = max(first.count, 1), max(second.count, 1)
    along, across = ((i, 0) for i in range(n)), ((n - 1, j) for j in range(1, m))
    back = ((i, m - 1) for i in range(n - 2, -1, -1)) if m > 1 else ()
    home = ((0, j) for j in range(m - 2, 0, -1)) if n > 1 else ()
    for i, j in chain(along, across, back, home):
        yield _place(call, begin, _sum(first, i, second, j), bool(first.count and second.count))


def grid(call: Call) -> Iterator[CycleMove]:
    """G88."""
    begin, first, second = _start(call), _ray(call, P.RAY_1), _ray(call, P.RAY_2)
    yield from _come(call, begin)
    n, m = max(first.count, 1), max(second.count, 1)
    for j in range(m):
        for i in range(n) if j % 2 == 0 else range(n - 1, -1, -1):
            yield _place(call, begin, _sum(first, i, second, j), bool(first.count and second.count))
    yield CycleMove(Kind.RAPID, {call.plane.first: begin[0], call.plane.second: begin[1]})


def circle(call: Call) -> Iterator[CycleMove]:
    """G89."""
    centre = (call.needed(P.CENTRE_X), call.needed(P.CENTRE_Y))
    radius = abs(call.needed(P.DIAMETER)) / 2.0
    if not radius:
        raise ProgramError(invalid(P.DIAMETER), "P122 is 0")
    start = math.fmod(call.needed(P.START_ANGLE), 360.0)
    travel, count = _circle_places(call)
    kind = TURNS.get(call.motion, Kind.RAPID) if travel else Kind.RAPID
    yield _move(call, Kind.RAPID, _on_circle(centre, radius, start), count > 1, others=call.words)
    steps = max(count, 2)
    for number in range(1, steps):
        place = _on_circle(centre, radius, start + travel * (number / (steps - 1)))
        if kind is Kind.RAPID:
            yield _move(call, kind, place, count > 0)
        else:
            yield _move(call, kind, place, count > 0, centre=centre, feed=call.rapid_mm_min)


def _circle_places(call: Call) -> tuple[float, int]:
    """Travel angle in degrees, number of places. Raises ProgramError: M8124 to M8126, M8333, M8334."""
    travel, division, count = call.get(P.TRAVEL_ANGLE), call.get(P.DIVISION_ANGLE), call.get(P.PLACES)
    number = None if count is None else int(abs(count))
    if travel is None and number is None:
        if not division:
            raise ProgramError(invalid(P.DIVISION_ANGLE), "neither P124 nor P125 with P126 says where it ends")
        number = _places(360.0, abs(division), P.DIVISION_ANGLE) - 1  # a full circle
        return division * (number - 1), number
    if travel is None:
        if division is None:
            raise ProgramError(invalid(P.TRAVEL_ANGLE), "neither P124 nor P125")
        assert number is not None
        return division * (number - 1), number
    if number is None:
        if division is None:
            raise ProgramError(invalid(P.PLACES), "neither P125 nor P126")
        if not division:
            raise ProgramError(Code.DIVISION_ANGLE_ZERO)
        return travel, _places(abs(travel), abs(division), P.DIVISION_ANGLE)
    if division and number > 1 and abs(abs(division) * (number - 1) - abs(travel)) > AGREE_MM:
        detail = f"{number} places of {division:g} degrees are not {travel:g} degrees"
        raise ProgramError(Code.CIRCLE_PLACES_TWICE, detail)
    return travel, number


def _on_circle(centre: tuple[float, float], radius: float, angle_deg: float) -> tuple[float, float]:
    u, v = Rotation(angle_deg=angle_deg).turned(radius, 0.0)
    return centre[0] + u, centre[1] + v


def _ray(call: Call, base: int) -> _Ray:
    """The ray of P100 .. or P110 .. Raises ProgramError: missing or contradicting parameters."""
    u, v, angle, length, division, count = (
        call.get(base + k) for k in (Ray.X, Ray.Y, Ray.ANGLE, Ray.LENGTH, Ray.DIVISION, Ray.PLACES)
    )
    number = None if count is None else int(abs(count))
    division = None if division is None else abs(division)
    length = None if length is None else abs(length)
    missing, length_twice, places_twice = RAY_CODES[base]
    if u is not None or v is not None:
        if u is None or v is None:
            wrong = invalid(base + (Ray.X if u is None else Ray.Y))
            raise ProgramError(wrong, f"P{base} and P{base + 1} are the end, one has no value")
        size = math.hypot(u, v)
        if length is not None and abs(length - size) > AGREE_MM:
            raise ProgramError(length_twice, f"P{base + 4} is {length:g}, the vector {size:g} mm long")
        if angle is not None and math.dist(_along(angle, size), (u, v)) > AGREE_MM:
            detail = f"P{base + 3} is {angle:g} degrees, the vector goes elsewhere"
            raise ProgramError(invalid(base + Ray.ANGLE), detail)
    else:
        if angle is None:
            raise ProgramError(invalid(base + Ray.ANGLE), f"neither P{base}, P{base + 1} nor P{base + 3}")
        if length is None:
            if division is None or number is None:
                raise ProgramError(invalid(base + Ray.LENGTH), f"neither P{base + 4} nor P{base + 5} with P{base + 6}")
            length = division * (number - 1 if number > 1 else number)
        size = length
        u, v = _along(angle, size)
    if number is None:
        if division is None:
            raise ProgramError(missing, f"neither P{base + 5} nor P{base + 6}")
        if not division:
            raise ProgramError(invalid(base + Ray.DIVISION), f"P{base + 5} is 0")
        number = _places(size, division, base + Ray.DIVISION)
    elif division and number > 1 and abs(division * (number - 1) - size) > AGREE_MM:
        raise ProgramError(places_twice, f"{number} places of {division:g} mm are not {size:g} mm")
    return _Ray(u, v, number)


def _places(way: float, division: float, number_of_division: int) -> int:
    """Number of places on a way. Raises ProgramError about the division's P if it is not finite."""
    number = way / division
    if not math.isfinite(number):
        raise ProgramError(invalid(number_of_division), f"{way:g} in parts of {division:g}")
    return int(number + 1e-9) + 1


def _along(angle_deg: float, length: float) -> tuple[float, float]:
    return Rotation(angle_deg=math.fmod(angle_deg, 360.0)).turned(length, 0.0)


def _start(call: Call) -> tuple[float, float]:
    """A."""
    u, v = call.plane.of(call.position)
    return call.words.get(call.plane.first, u), call.words.get(call.plane.second, v)


def _come(call: Call, begin: tuple[float, float]) -> Iterator[CycleMove]:
    """To A, and the words of other axes, if there are words."""
    if call.words:
        yield CycleMove(Kind.RAPID, {**call.words, call.plane.first: begin[0], call.plane.second: begin[1]})


def _sum(first: _Ray, i: int, second: _Ray, j: int) -> tuple[float, float]:
    (a, b), (c, d) = first.at(i), second.at(j if second.count > 1 else 1.0)
    return a + c, b + d


def _place(call: Call, begin: tuple[float, float], offset: tuple[float, float], machines: bool) -> CycleMove:
    return _move(call, Kind.RAPID, (begin[0] + offset[0], begin[1] + offset[1]), machines)


def _move(
    call: Call,
    kind: Kind,
    place: tuple[float, float],
    machines: bool,
    centre: tuple[float, float] | None = None,
    feed: float | None = None,
    others: Mapping[int, float] | None = None,
) -> CycleMove:
    """To a place where the machining cycle is called; without one, with an exact stop. others: words of other axes."""
    target = {**(others or {}), call.plane.first: place[0], call.plane.second: place[1]}
    cycle = call.inner if machines else None
    return CycleMove(kind, target, centre, feed, exact_stop=cycle is None, cycle=cycle)
