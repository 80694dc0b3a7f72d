"""Measuring cycles G69 (manual 5.1; bwo900/87 to bwo900/89).

    P140   1: probe calibrated in a bore       P150: its centre (+0 to +2), diameter (+3)   P149: trigger points, result
           2: on a surface, by the third axis  P150: the surface (+0 to +2)                 the same
          60: centre of a bore                 P152: its diameter      P149 --> P154: centre (+0 to +2)
          40: a place on a surface             P148: axis, 1 to 3      P149 --> P154: the place (+0 to +2)
    P141   safety distance    P143 feed of measuring    P144 touches of each place    P147: range of confidence (+4)

    touch     F      towards the surface, up to P141 before it         the probe answers: M8167
              P143   on, up to the range of confidence behind it       it does not: M8136; else the axis stops
              F      back to P141 before it; P144 times, the mean counts

Places are those of the probe's middle across its axis, of its ball's lowest point along it. A trigger point is that
place less the place of the surface: XN after a motion in +, negative, XP after one in -.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

from isel_twin.firmware.bwo900.analysis.cycles.call import Answer, Call, CycleMove, Kind
from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters

IN_BORE, ON_SURFACE, PLACE, CENTRE = 1, 2, 40, 60
FIELDS: Final[Mapping[int, int]] = {P.TOLERANCES: 5, P.TRIGGERS: 6, P.GAUGE: 4, P.MEASURED_DATA: 3}
"""Parameters that point to others, and how many there are."""
CONFIDENCE: Final = 4  # of the tolerances
DIAMETER: Final = 3  # of the gauge
MOST: Final = 1_000  # touches of one place
LAST: Final = 60_000

Measuring: TypeAlias = Generator[CycleMove, Answer, None]
Touching: TypeAlias = Generator[CycleMove, Answer, float]


def pointed(parameters: Parameters) -> dict[int, float]:
    """Values of the fields that the parameters of a cycle point to, by their numbers; those that are deleted are left
    out."""
    found: dict[int, float] = {}
    for pointer, count in FIELDS.items():
        first = int(parameters.get(pointer)) if parameters.loaded(pointer) else -1
        if 0 <= first < LAST - count:
            found |= {n: parameters.get(n) for n in range(first, first + count) if parameters.loaded(n)}
    return found


def measuring(call: Call) -> Measuring:
    """G69: the cycle that P140 names. Raises ProgramError: M8134 to M8168."""
    kind = call.get(P.MEASURING_KIND)
    if not call.has_tool:
        raise ProgramError(Code.NO_PROBE, "T with M06 or M16 comes first")
    match kind:
        case 1.0:
            yield from _calibrate_in_bore(call)
        case 2.0:
            yield from _calibrate_on_surface(call)
        case 40.0:
            yield from _place(call)
        case 60.0:
            yield from _centre(call)
        case _:
            what = "has no value" if kind is None else f"is {kind:g}"
            raise ProgramError(Code.WRONG_MEASURING_KIND, f"P140 {what}; allowed: 1, 2, 40, 60")


@dataclass(frozen=True, slots=True)
class _Touch:
    """How a place is touched."""

    call: Call
    safety: float
    feed: float
    times: int
    confidence: float

    def edge(self, axis: int, way: int, stands: float, here: float) -> Touching:
        """Touch an edge at which the probe will stand there, going along an axis in + (way 1) or - (-1), from `here`
        on; returns where it stood at the signal, and leaves it at the safety distance."""
        before = stands - way * self.safety
        touched = 0.0
        for number in range(self.times):
            if number == 0 and way * (before - here) > 0.0:
                yield from self._free(axis, before)
            touched += yield from self._signal(axis, stands + way * self.confidence)
            yield self._to({axis: before})
        return touched / self.times

    def down(self, axis: int, start: float) -> Touching:
        """Touch a surface in -, from the start on, up to the range of confidence; returns where the probe stood, and
        leaves it at the safety distance from there."""
        touched = 0.0
        for _ in range(self.times):
            found = yield from self._signal(axis, start - self.confidence)
            touched += found
            yield self._to({axis: min(start, found + self.safety)})
        return touched / self.times

    def _free(self, axis: int, goal: float) -> Generator[CycleMove, Answer, None]:
        """A way on which nothing may be touched."""
        answer = yield CycleMove(Kind.LINE, {axis: goal}, exact_stop=True, watched=True)
        if answer is not None:
            raise ProgramError(Code.TOUCHED_TOO_EARLY)

    def _signal(self, axis: int, limit: float) -> Touching:
        answer = yield CycleMove(Kind.LINE, dwell_s=0.0, watched=True)
        if answer is not None:
            raise ProgramError(Code.TOUCHED_TOO_EARLY, "before it has moved")
        answer = yield CycleMove(Kind.LINE, {axis: limit}, feed_mm_min=self.feed, exact_stop=True, watched=True)
        if answer is None:
            raise ProgramError(Code.NOT_TOUCHED)
        return answer[axis]

    def _to(self, target: Mapping[int, float]) -> CycleMove:
        return CycleMove(Kind.LINE, target, exact_stop=True)


def _touch(call: Call) -> _Touch:
    safety = _positive(call, P.MEASURING_SAFETY, Code.WRONG_SAFETY)
    feed = _positive(call, P.MEASURING_FEED, Code.WRONG_MEASURING_FEED)
    times = call.get(P.TOUCHES)
    if times is None or not 1 <= times <= MOST:
        raise ProgramError(Code.WRONG_TOUCHES, f"P144 is {times}; allowed: 1 to {MOST}")
    first = _first(call, P.TOLERANCES, Code.WRONG_POINTER)
    confidence = call.get(first + CONFIDENCE)
    if confidence is None or confidence <= 0.0:
        raise ProgramError(Code.WRONG_CONFIDENCE, f"P{first + CONFIDENCE} is {confidence}; allowed: more than 0")
    return _Touch(call, safety, feed, int(times), confidence)


def _calibrate_in_bore(call: Call) -> Measuring:
    touch, triggers = _touch(call), _first(call, P.TRIGGERS, Code.WRONG_POINTER)
    gauge = _first(call, P.GAUGE, Code.WRONG_POINTER)
    axes = (call.plane.first, call.plane.second)
    centre = {axis: _needed(call, gauge + axis, Code.WRONG_GAUGE_I + axis) for axis in axes}
    diameter = _needed(call, gauge + DIAMETER, Code.WRONG_GAUGE_DIAMETER)
    reach = _reach(call, diameter, Code.WRONG_GAUGE_DIAMETER)
    yield CycleMove(Kind.LINE, centre, exact_stop=True)
    for axis in axes:
        here = centre[axis]
        for way in (1, -1):
            stood = yield from touch.edge(axis, way, centre[axis] + way * reach, here)
            here = centre[axis] + way * (reach - touch.safety)
            edge = centre[axis] + way * 0.5 * diameter
            yield _result(triggers + _trigger(axis, way), stood - edge)
        yield touch._to(centre)


def _calibrate_on_surface(call: Call) -> Measuring:
    touch, triggers = _touch(call), _first(call, P.TRIGGERS, Code.WRONG_POINTER)
    gauge, axis = _first(call, P.GAUGE, Code.WRONG_POINTER), call.plane.third
    surface = _needed(call, gauge + axis, Code.WRONG_GAUGE_I + axis)
    here = call.position[axis]
    way = -1 if here > surface else 1
    stood = yield from touch.edge(axis, way, surface, here)
    yield _result(triggers + _trigger(axis, way), stood - surface)


def _centre(call: Call) -> Measuring:
    touch, triggers = _touch(call), _first(call, P.TRIGGERS, Code.WRONG_POINTER)
    results = _first(call, P.MEASURED_DATA, Code.WRONG_RESULT)
    reach = _reach(call, _needed(call, P.BORE, Code.WRONG_BORE), Code.WRONG_BORE)
    axes = (call.plane.first, call.plane.second)
    offsets = {(axis, way): _offset(call, triggers, axis, way) for axis in axes for way in (1, -1)}
    for axis in axes:
        middle = here = call.position[axis]
        edges = 0.0
        for way in (1, -1):
            stood = yield from touch.edge(axis, way, middle + way * reach, here)
            here = middle + way * (reach - touch.safety)
            edges += 0.5 * (stood - offsets[axis, way])
        yield touch._to({axis: edges})
        yield _result(results + axis, edges)


def _place(call: Call) -> Measuring:
    touch, triggers = _touch(call), _first(call, P.TRIGGERS, Code.WRONG_POINTER)
    number = call.get(P.MEASURING_AXIS)
    if number not in (1.0, 2.0, 3.0):
        raise ProgramError(Code.WRONG_MEASURING_AXIS, f"P148 is {number}; allowed: 1 to 3")
    axis = (call.plane.first, call.plane.second, call.plane.third)[int(number) - 1]
    results = _first(call, P.MEASURED_DATA, Code.WRONG_RESULT)
    offset = _offset(call, triggers, axis, -1)
    stood = yield from touch.down(axis, call.position[axis])
    yield _result(results + int(number) - 1, stood - offset)


def _trigger(axis: int, way: int) -> int:
    """Place among the trigger points: negative, positive of X, Y, Z; after a motion in + the negative one."""
    return 2 * axis + (0 if way > 0 else 1)


def _offset(call: Call, triggers: int, axis: int, way: int) -> float:
    place = _trigger(axis, way)
    return _needed(call, triggers + place, Code.WRONG_TRIGGER_XN + place)


def _reach(call: Call, diameter: float, wrong: int) -> float:
    """How far the probe's middle can go from that of a bore."""
    if diameter <= 0.0:
        raise ProgramError(wrong, f"a diameter of {diameter:g} mm")
    reach = 0.5 * diameter - call.tool_radius_mm
    if reach <= 0.0:
        raise ProgramError(Code.BORE_TOO_SMALL, f"{diameter:g} mm, and a probe of {2.0 * call.tool_radius_mm:g} mm")
    return reach


def _result(number: int, value: float) -> CycleMove:
    return CycleMove(Kind.LINE, writes={number: value})


def _needed(call: Call, number: int, wrong: int) -> float:
    value = call.get(number)
    if value is None:
        raise ProgramError(wrong, f"P{number} has no value")
    return value


def _positive(call: Call, number: int, wrong: int) -> float:
    value = _needed(call, number, wrong)
    if value <= 0.0:
        raise ProgramError(wrong, f"P{number} is {value:g}; allowed: more than 0")
    return value


def _first(call: Call, pointer: int, wrong: int) -> int:
    """The number that a parameter points to."""
    value = _needed(call, pointer, wrong)
    if not (value == int(value) and 0 <= value < LAST - FIELDS[pointer]):
        raise ProgramError(wrong, f"P{pointer} is {value:g}; allowed: the number of a parameter")
    return int(value)
