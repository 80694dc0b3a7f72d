"""Reference run (2.2.22, 4.2.2) and running free (2.2.9).

    position   switch  |  travel ->
               #########
       start           |<----------------------------- approach at reference speed, ends at once when the switch opens
       settle          |  50 ms
       step out        |-|-|-|-|-|>                    one step, check, one step, check ... until the switch closes
       run free                   |--------->          the run-free steps of the axis, at reference speed
       zero                                 0

An axis on its switch skips the approach. Directions are those of the counter: negative, or positive for axes of `@0IR`.
The first switch of the axis to open on the way is its reference switch (imc/8).
"""

from __future__ import annotations

from collections.abc import Generator
from fractions import Fraction
from typing import Any, NoReturn

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.controller import ReferenceSearch
from isel_twin.firmware.activity import Activity, Ended, Pause, Request, Travel
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.limits import name_of, switches_of
from isel_twin.firmware.imc.moves import as_steps, set_off
from isel_twin.firmware.imc.purpose import REFERENCE, Reference
from isel_twin.firmware.imc.replies import LIMIT_SWITCH, Refusal
from isel_twin.motion import constant, line

ORDER = (2, 1, 0, 3)  # Z, Y, X, A (2.2.22)
REFERENCE_RUN, RUNNING_FREE = "reference run", "running free"


def admit_reference_run(device: Device, mask: int) -> tuple[int]:
    """`@0R`, `7`: it may begin; two struck switches of one axis (2) matter only outside test mode."""
    device.require_reference_run()
    if not device.test_mode:
        _require_ways_off(device, mask)
    return (mask,)


def admit_run_free(device: Device, mask: int) -> tuple[int]:
    """`@0F`: axes may move, and no axis has both switches struck (2)."""
    device.require_power()
    _require_ways_off(device, mask)
    return (mask,)


def _require_ways_off(device: Device, mask: int) -> None:
    """Raise Refusal(2) if both switches of an axis are struck: every direction leads onto one of them."""
    if any(len(device.limits.struck(axis)) > 1 for axis in ORDER if mask >> axis & 1):
        raise Refusal(LIMIT_SWITCH)


def reference_run(device: Device, mask: int) -> Activity:
    """`@0R`, `7`: find the reference points of the axes in `mask`; in test mode take the present positions."""
    device.begin_reference_run()
    device.set_modal(three_d=False)
    axes = [axis for axis in ORDER if mask >> axis & 1]
    for axis in axes:
        device.referenced[axis] = False
    return _reference_run(device, axes)


def _reference_run(device: Device, axes: list[int]) -> Activity:
    for axis in axes:
        if not device.test_mode:
            device.tell(ReferenceSearch(axis))
            yield from _find_switch(device, axis)
            device.tell(ReferenceSearch(axis, found=True))
        device.set_reference(axis)


def run_free(device: Device, mask: int) -> Activity:
    """`@0F`: run the axes in `mask` off their struck switches; all references are then lost (imc/38)."""
    device.lose_references()
    return _run_free(device, [axis for axis in ORDER if mask >> axis & 1])


def _run_free(device: Device, axes: list[int]) -> Activity:
    for axis in axes:
        struck = device.limits.struck(axis)
        if struck:
            yield from _leave(device, axis, -device.limits.lies(struck[0]), RUNNING_FREE)


def _find_switch(device: Device, axis: int) -> Activity:
    direction = 1 if device.settings.reference_inverted >> axis & 1 else -1
    if not device.limits.blocks(axis, direction):
        farthest = device.profile.search_steps
        path = line(as_steps({axis: direction * farthest}))
        law = device.law(device.reference_hz(axis))(path.ticks)
        ended = yield from set_off(device, Travel(path, law, purpose=Reference(seek=axis)))
        if not ended.by_event:
            ahead = (name_of(bit) for bit in switches_of(axis) if device.limits.lies(bit) == direction)
            awaited = " or ".join(ahead) or "a switch"
            _fail(device, axis, REFERENCE_RUN, f"{awaited} has not been struck in {farthest} steps towards it")
        yield Pause(device.profile.settle_ms * MILLISECOND_NS, REFERENCE)
    yield from _leave(device, axis, -direction, REFERENCE_RUN)


def _fail(device: Device, axis: int, what: str, why: str) -> NoReturn:
    """Raise Refusal(2), as after a limit switch, with its reason as a remark."""
    cause = f"{what} of {AXIS_NAMES[axis].upper()}: {why}"
    device.limit_struck(axis, cause)
    device.remark(cause)
    raise Refusal(LIMIT_SWITCH)


def _leave(device: Device, axis: int, direction: int, what: str) -> Activity:
    """Step out of the switch until it is read closed, then run free."""
    made, farthest = 0, device.profile.leave_steps
    while struck := device.limits.struck(axis):
        if made == farthest:
            names = " and ".join(map(name_of, struck))
            _fail(device, axis, what, f"{names} is still struck {farthest} steps away from it")
        made += yield from _step_out(device, axis, direction, farthest - made)
    free = line(as_steps({axis: direction * device.settings.run_free_steps[axis]}))
    if free.ticks:
        law = device.law(device.reference_hz(axis))(free.ticks)
        yield from set_off(device, Travel(free, law, purpose=REFERENCE))


def _step_out(device: Device, axis: int, direction: int, most: int) -> Generator[Request, Any, int]:
    """Steps, `most` at most, until the switch closes; their number. The level is read half a period after each step:

    step       |       |       |
    read           r       r       r
    closes               c              after it has been read struck: one more step, then read again
    """
    half_hz = 2 * device.profile.step_out_hz
    rest_ns = SECOND_NS // half_hz
    period_ns = round(Fraction(SECOND_NS, half_hz)) + rest_ns

    def steps(count: int, each_ns: int, purpose: Reference) -> Generator[Request, Ended, Ended]:
        law = constant(count, Fraction(SECOND_NS, each_ns))
        return set_off(device, Travel(line(as_steps({axis: direction * count})), law, purpose=purpose))

    yield from steps(1, period_ns - rest_ns, REFERENCE)
    made, since_ns = 1, 0
    if made < most and device.limits.struck(axis):
        began_ns = device.now_ns
        made += (yield from steps(most - made, period_ns, Reference(leave=axis))).ticks
        since_ns = (device.now_ns - began_ns) % period_ns
        if since_ns > rest_ns:
            yield from steps(1, period_ns - since_ns, REFERENCE)
            made, since_ns = made + 1, 0
    yield Pause(rest_ns - since_ns, REFERENCE)
    return made
