"""Straight moves and arcs: from parameters to legs, and the activity that travels them.

    numbers --plan_...--> legs --follow--> activity
            refuses                may end early: limit switch, fault, stop

A relative move in 2.5D is up to three legs: X and Y together, Z by z1, Z by z2; with an A axis its way is the last leg.
In 3D it is one leg, at the speed given for X (imc/22). Speeds are the leading axis's, or the path's (motion/1). A leg
starts at the time of the last pulse of the one before. All reasons for a refusal are checked in planning.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from functools import cache
from typing import NamedTuple

from isel_twin.firmware.activity import Activity, Ended, Request, Travel
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.grammar import Number
from isel_twin.firmware.imc.purpose import Reference, Until
from isel_twin.firmware.imc.replies import BAD_AXES, BAD_NUMBER, BAD_SPEED, LIMIT_SWITCH, Refusal
from isel_twin.firmware.imc.settings import AXES
from isel_twin.motion import Displacement, StepPath, TimeLaw, along_path, circle, line

XYZ = 7
ANY_SPEED = Number(-(1 << 62), 1 << 62)  # a speed whose range is checked later, as it may be unused
PAIRS = tuple((Number(), ANY_SPEED) * count for count in range(AXES + 1))  # steps and speed, so often


class Leg(NamedTuple):
    """A path, and a function that gives the time law for its remaining ticks."""

    path: StepPath
    law: Callable[[int], TimeLaw]


def travel(device: Device, legs: Sequence[Leg], until: Until | None = None) -> Activity | None:
    """Travel the legs one after the other; a stop in between resumes where it was. `until` ends all of it.

    None if there is nothing to travel: then a stopped move can still be resumed.
    """
    return _travel(device, legs, until) if any([leg.path.ticks for leg in legs]) else None


def _travel(device: Device, legs: Sequence[Leg], until: Until | None) -> Activity:
    for leg in legs:
        made = 0
        while made < leg.path.ticks:
            ended = yield from set_off(device, Travel(leg.path, leg.law(leg.path.ticks - made), made, until))
            if ended.by_event:
                return
            made = ended.ticks


def set_off(device: Device, way: Travel) -> Generator[Request, Ended, Ended]:
    """Make a travel, unless its condition already holds. Raises Refusal(2) if it leads onto a struck switch."""
    purpose = way.purpose
    if isinstance(purpose, Until) and purpose.condition():
        return Ended(way.first, by_event=True)
    seeks = isinstance(purpose, Reference) and purpose.seek is not None
    if not seeks and (axis := _blocked(device, way)) is not None:
        device.limit_struck(axis)
        raise Refusal(LIMIT_SWITCH)
    return (yield way)


def _blocked(device: Device, way: Travel) -> int | None:
    """An axis that this travel would drive further onto its struck switch."""
    if not device.limits.all_active():
        return None
    first, last = way.first, way.first + way.law.ticks
    # over the first ticks, as a curved path may turn later; over all if the axis rests in those
    spans = (first, min(first + 100, last)), (first, last)
    blocked = (
        axis
        for axis in device.axis_list
        if device.guards(axis)
        and device.limits.struck(axis)
        and device.limits.blocks(axis, sense(way.path, axis, *spans))
    )
    return next(blocked, None)


def sense(path: StepPath, axis: int, *spans: tuple[int, int]) -> int:
    """Direction (+1, -1) of an axis over the first of these spans of ticks in which it moves; 0 if it rests."""
    for begin, end in spans:
        steps = path.displacement(end)[axis] - path.displacement(begin)[axis]
        if steps:
            return 1 if steps > 0 else -1
    return 0


def move_parameters(device: Device) -> tuple[Number, ...]:
    """Pairs of steps and speed: one an axis, with X, Y and Z four (2.2.2)."""
    return PAIRS[4 if device.axes == XYZ else len(device.axis_list)]


def check_relative(device: Device, *values: int) -> None:
    """Refuse speeds out of range (D); that of a second Z way only if there is one."""
    second_z = device.axes == XYZ and values[6] and not device.three_d
    _check_speeds(device, values, 4 if second_z else len(device.axis_list))


def check_absolute(device: Device, *values: int) -> None:
    """Refuse speeds out of range (D); the second Z pair is ignored."""
    _check_speeds(device, values, len(device.axis_list))


def _check_speeds(device: Device, values: Sequence[int], count: int) -> None:
    allowed = speed(device)
    for speed_hz in values[1 : 2 * count : 2]:
        allowed.check(speed_hz)


def speed(device: Device) -> Number:
    return _speed(device.profile.min_speed_hz, device.profile.max_speed_hz)


@cache
def _speed(least_hz: int, most_hz: int) -> Number:
    return Number(least_hz, most_hz, BAD_SPEED)


# ---- linear moves --------------------------------------------------------------------------------------------------


def follow(device: Device, legs: Sequence[Leg]) -> Activity | None:
    """Travel planned legs; this consumes the port condition of a stored program (3.2.7)."""
    condition, device.port_condition = device.port_condition, None
    return travel(device, legs, None if condition is None else _until(device, *condition))


def plan_relative(device: Device, *values: int) -> tuple[Sequence[Leg]]:
    """`@0A`, `0`: by the given steps."""
    steps = dict(zip(device.axis_list, values[0::2], strict=False))
    second_z = values[6] if device.axes == XYZ else 0
    return _plan_linear(device, steps, values[1::2], second_z, unreferenced=device.profile.relative_unreferenced)


def plan_absolute(device: Device, *values: int) -> tuple[Sequence[Leg]]:
    """`@0M`, `m`: to the given positions, counted from the virtual zero."""
    steps = {
        axis: target + device.virtual_zero[axis] - device.counts[axis]
        for axis, target in zip(device.axis_list, values[0::2], strict=False)
    }
    return _plan_linear(device, steps, values[1::2], 0)


def _plan_linear(
    device: Device, steps: dict[int, int], speeds: Sequence[int], second_z: int, *, unreferenced: bool = False
) -> tuple[Sequence[Leg]]:
    device.require_move()
    if device.three_d:
        ways = [(steps, speeds[0])]
    else:
        plane = {axis: n for axis, n in steps.items() if axis < 2}
        leader = max(plane, key=lambda axis: abs(plane[axis]), default=0)
        speed_of = dict(zip(device.axis_list, speeds, strict=False))
        ways = [(plane, speed_of.get(leader, 0))]
        ways += [({axis: n}, speed_of[axis]) for axis, n in steps.items() if axis >= 2]
        if second_z:
            ways.append(({2: second_z}, speeds[3]))
    legs = [(as_steps(way), speed_hz) for way, speed_hz in ways if any(way.values())]
    device.require_room(*[leg for leg, _ in legs], unreferenced=unreferenced)
    # a program's fourth pair may have been stored in 3D, where it does not matter, and be travelled in 2.5D
    asked = [(leg, speed(device).check(speed_hz)) for leg, speed_hz in legs]
    if device.profile.path_speed:
        return ([Leg(line(leg), device.law(along_path(speed_hz, leg))) for leg, speed_hz in asked],)
    return ([straight_leg(device, leg, speed_hz) for leg, speed_hz in asked],)


def as_steps(way: dict[int, int]) -> Displacement:
    return way.get(0, 0), way.get(1, 0), way.get(2, 0), way.get(3, 0)


def straight_leg(device: Device, steps: Displacement, speed_hz: int) -> Leg:
    return Leg(line(steps), device.law(speed_hz))


def until_port_parameters(device: Device) -> tuple[Number, ...]:
    """Port, mask, value, speed, and the steps of each axis (2.2.30)."""
    byte = Number(0, 255)
    return (Number(0, 3), byte, byte, speed(device)) + (Number(),) * len(device.axis_list)


def plan_until_port(
    device: Device, port: int, mask: int, value: int, speed_hz: int, *steps: int
) -> tuple[Sequence[Leg], Until]:
    """`@0Z`: straight on until the masked bits of an input port have the given value (2.2.30, imc/39)."""
    device.require_move()
    way = as_steps(dict(zip(device.axis_list, steps, strict=True)))
    device.require_room(way)
    return [straight_leg(device, way, speed_hz)], _until(device, port, mask, value)


def _until(device: Device, port: int, mask: int, value: int) -> Until:
    return Until(lambda: (device.inputs.port(port) ^ value) & mask == 0)


# ---- arcs ----------------------------------------------------------------------------------------------------------

# the two axes of the plane, and the third axis of a helix, by the number `@0e` takes
PLANES = ((0, 1, 2), (0, 2, 1), (1, 2, 0))


def arc_parameters(device: Device) -> tuple[Number, ...]:
    """Length, speed, D, start point, directions (2.2.28)."""
    sign = Number(-1, 1)
    return Number(0), speed(device), Number(-(1 << 47), 1 << 47), Number(), Number(), sign, sign


def helix_parameters(device: Device) -> tuple[Number, ...]:
    """As for an arc, and the steps of the third axis (2.2.27)."""
    return (*arc_parameters(device), Number())


def check_arc_numbers(device: Device, *values: int) -> None:
    """Directions are +1 or -1 (1)."""
    if not values[5] or not values[6]:
        raise Refusal(BAD_NUMBER)


def _third(values: Sequence[int]) -> int:
    return values[7] if len(values) > 7 else 0


def check_arc(device: Device, *values: int) -> None:
    """As above; the axes of the plane, and of the third way, must be set (3)."""
    check_arc_numbers(device, *values)
    third = _third(values)
    first, second, other = PLANES[device.plane]
    used = 1 << first | 1 << second | (1 << other if third else 0)
    if used & ~device.axes:
        raise Refusal(BAD_AXES)


def plan_arc(device: Device, length: int, speed_hz: int, *rest: int) -> tuple[Sequence[Leg]]:
    """`@0y`, `@0w`, `y`, `w`: an arc in the plane of `@0e`, the way round of `@0f`; with S3 a helix."""
    device.require_move()
    check_arc(device, length, speed_hz, *rest)
    d, xs, ys, rx, ry, third = (*rest, 0)[:6]
    first, second, other = PLANES[device.plane]
    path = circle(length, d, xs, ys, rx, ry, device.clockwise, (first, second), other if third else None, third)
    if path.ticks:
        device.require_reference((first, second, *((other,) if third else ())))
    device.require_room(path.displacement(path.ticks))
    return ([Leg(path, device.law(speed_hz))],)
