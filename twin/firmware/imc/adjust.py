"""Commands that set something: axes, zeros, modal values, ports, initialisation values.

`check_...` check parameters, `admit_...` the state of the machine; both raise Refusal and change nothing. The other
functions never refuse.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.firmware.activity import Activity, Pause
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.grammar import Number
from isel_twin.firmware.imc.moves import ANY_SPEED, speed
from isel_twin.firmware.imc.ports import OUTPUT_PORTS
from isel_twin.firmware.imc.replies import BAD_AXES, BAD_NUMBER, FAULT, Refusal
from isel_twin.firmware.imc.safety import Event, State, circuits_closed, hood_safe, powered
from isel_twin.firmware.imc.settings import (
    AXES,
    Settings,
    StoredProgram,
    axes_of,
    default_settings,
    is_user_info,
)

A_AXIS = 8

# ---- axes ----------------------------------------------------------------------------------------------------------


def check_axis_choice(device: Device, mask: int) -> None:
    """Only 1, 3, 7 and 8 may be set (imc/1)."""
    if mask not in (1, 3, 7, A_AXIS):
        raise Refusal(BAD_AXES)


def admit_initialisation(device: Device, mask: int) -> tuple[int]:
    """Refuse (9) unless the stages have power or it can be switched on."""
    if not powered(device.inputs) and not (circuits_closed(device.inputs) and hood_safe(device.inputs)):
        raise Refusal(FAULT)
    return (mask,)


def initialise(device: Device, mask: int) -> Activity:
    """`@0<axes>`: close the safety relay if need be (else 9), switch the stages on, set the axes (2.2.1, imc/2)."""
    if not powered(device.inputs):
        device.outputs["power_request"] = 1
        try:
            yield Pause(device.profile.relay_ms * MILLISECOND_NS)
        finally:
            device.outputs["power_request"] = 0
        if not powered(device.inputs):
            raise Refusal(FAULT)
    device.note(Event.INITIALISED)
    device.energise()
    device.axes = device.axes | A_AXIS if mask == A_AXIS else mask


def check_axes(device: Device, mask: int) -> None:
    """Masks of 2.2.19 to 2.2.22: 1..7, or A alone; only axes that are set."""
    if not 1 <= mask <= A_AXIS or mask & ~device.axes:
        raise Refusal(BAD_AXES)


def admit_simulated_reference(device: Device, mask: int) -> tuple[int]:
    """Refuse as a reference run is."""
    device.require_reference_run()
    return (mask,)


def set_virtual_zero(device: Device, mask: int) -> None:
    """`@0n`, `n`: absolute moves are relative to this position."""
    for axis in axes_of(mask):
        device.virtual_zero[axis] = device.counts[axis]


def simulate_reference(device: Device, mask: int) -> None:
    """`@0N`, `N`: the reference point is here (imc/24)."""
    device.begin_reference_run()
    for axis in axes_of(mask):
        device.set_reference(axis)


# ---- modal values --------------------------------------------------------------------------------------------------


def speed_for_each_axis(device: Device) -> tuple[Number, ...]:
    """One speed for each axis that is set (2.2.5)."""
    return (speed(device),) * len(device.axis_list)


def four_speeds(device: Device) -> tuple[Number, ...]:
    """Always four speeds (3.2.10, 4.2.1)."""
    return (speed(device),) * AXES


def default_speed_parameters(device: Device) -> tuple[Number, ...]:
    """Four speeds; depending on the profile those of axes that are not set are unchecked (imc/46)."""
    if not (device.profile.extra_values and device.axes):
        return four_speeds(device)
    return tuple(speed(device) if axis in device.axis_list else ANY_SPEED for axis in range(AXES))


def set_default_speeds(device: Device, *speeds_hz: int) -> None:
    """`@0Id`: a number that is not a valid speed changes nothing."""
    valid, now = speed(device), device.settings.reference_hz
    new = (hz if valid.low <= hz <= valid.high else was for hz, was in zip(speeds_hz, now, strict=True))
    device.set_settings(reference_hz=tuple(new))


def set_reference_speeds(device: Device, *speeds_hz: int) -> None:
    """`@0d`: in the order of the axes that are set."""
    now = [device.reference_hz(axis) for axis in range(AXES)]
    for axis, speed_hz in zip(device.axis_list, speeds_hz, strict=False):
        now[axis] = speed_hz
    device.set_modal(reference_hz=tuple(now))


def set_modal(name: str, kind: type[int] = int) -> Callable[[Device, int], None]:
    """Handler that puts its parameter into the modal value `name`, as an int or a bool."""
    return lambda device, value: device.set_modal(**{name: kind(value)})


def set_modals(name: str) -> Callable[..., None]:
    """Handler that puts all its parameters into the modal value `name`."""
    return lambda device, *values: device.set_modal(**{name: values})


def set_turn(device: Device, turn: int) -> None:
    """`@0f`, `f`: 0 clockwise, -1 counter-clockwise."""
    device.set_modal(clockwise=turn == 0)


def set_number(device: Device, number: int) -> None:
    """`@0G`: until the next reset (imc/26)."""
    device.number = number


# ---- output ports --------------------------------------------------------------------------------------------------


def _aliased(device: Device, port: int) -> int:
    """The effective port: the profile may have another number for that of the spindle."""
    return 2 if port == device.profile.spindle_port else port


def check_port_value(device: Device, port: int, value: int) -> None:
    """Refuse ports that do not exist and values a port does not take (1)."""
    port = _aliased(device, port)
    if port not in OUTPUT_PORTS or not 0 <= value <= (255 if OUTPUT_PORTS[port].byte else 1):
        raise Refusal(BAD_NUMBER)


def admit_port(device: Device, port: int, value: int) -> tuple[Mapping[str, int]]:
    """`@0B`: the outputs and their new levels, unless spindle or stages may not be switched on (9, H; imc/37)."""
    levels = device.outputs.levels_for(_aliased(device, port), value)
    rising = {name for name, level in levels.items() if level and not device.outputs[name]}
    if rising & {"spindle", "stages"}:
        device.require_supply()
    if "spindle" in rising:
        device.require_hood()
    return (_with_brake(device, levels),)


def _with_brake(device: Device, levels: Mapping[str, int]) -> Mapping[str, int]:
    """The brake follows the stages: it closes before they go off, and opens when they are on (imc/23)."""
    stages = levels.get("stages", device.outputs["stages"])
    if stages == device.outputs["stages"]:
        return levels
    if stages:
        return {**levels, "brake": levels.get("brake", 1)}
    return {"brake": 0} | {name: level for name, level in levels.items() if name != "brake"}


def write_outputs(device: Device, levels: Mapping[str, int]) -> None:
    """`@0B`, `p`."""
    for name, level in levels.items():
        device.outputs[name] = level


def set_brake(device: Device, on: int) -> None:
    """`@0g`, `g`."""
    device.outputs["brake"] = on


WHOLE_BYTE = 128  # bit number that means the whole port (3.2.19, 3.2.20)


def check_port_bit(device: Device, port: int, bit: int, value: int) -> None:
    """Refuse what `p` cannot write (1)."""
    if bit == WHOLE_BYTE:
        check_port_value(device, port, value)
    elif _aliased(device, port) not in OUTPUT_PORTS or not (0 <= bit <= 7 and 0 <= value <= 1):
        raise Refusal(BAD_NUMBER)


def admit_port_bit(device: Device, port: int, bit: int, value: int) -> tuple[Mapping[str, int]]:
    """`p`: as `admit_port`, for one bit of an output port or the whole."""
    if bit != WHOLE_BYTE and port in OUTPUT_PORTS:
        value = device.outputs.read(port) & ~(1 << bit) | value << bit
    check_port_value(device, port, value)
    return admit_port(device, port, value)


# ---- initialisation values -----------------------------------------------------------------------------------------


def set_values(name: str) -> Callable[..., None]:
    """Handler that puts all its parameters into the initialisation value `name`."""
    return lambda device, *values: device.set_settings(**{name: values})


def set_value(name: str) -> Callable[[Device, int], None]:
    """Handler that puts its parameter into the initialisation value `name`."""
    return lambda device, value: device.set_settings(**{name: value})


def set_inverted(device: Device, mask: int) -> None:
    """`@0ID`: an axis that changes its direction is not referenced any more (imc/27)."""
    for axis in axes_of(device.settings.inverted ^ mask):
        device.referenced[axis] = False
    device.set_settings(inverted=mask)


def set_swapped(device: Device, mask: int) -> None:
    """`@0Ie`: which switch is at which end. It replaces what motions have found (imc/20)."""
    device.limits.forget_found(device.settings.swapped ^ mask)
    device.set_settings(swapped=mask)


def set_io_only(device: Device, on: int) -> None:
    """`@0IO`: without axes, the stages are off (imc/28)."""
    changed = device.settings.io_only != on
    device.set_settings(io_only=on)
    if changed and device.safety is not State.FAULT:
        device.energise()


def check_user_info(device: Device, text: str) -> None:
    if not is_user_info(text):
        raise Refusal(BAD_NUMBER)


def set_user_info(device: Device, text: str) -> None:
    """`@0IU`."""
    device.set_settings(user_info=text)


def load_settings(device: Device) -> None:
    """`@0IL`: load the values from flash; those set by `@0d`, `@0j` and `@0J` are dropped (imc/43)."""
    _put_in_force(device, device.flash.settings)


def save_settings(device: Device) -> Activity:
    """`@0IW`: the new values count once all of them are written; power lost before leaves the old ones (imc/51)."""
    yield Pause(device.profile.store_ms * MILLISECOND_NS)
    device.store(settings=device.settings)


def default_all(device: Device) -> None:
    """`@0IX`."""
    _put_in_force(device, default_settings(device.profile))


def _put_in_force(device: Device, settings: Settings) -> None:
    set_inverted(device, settings.inverted)
    set_swapped(device, settings.swapped)
    set_io_only(device, settings.io_only)
    device.settings = settings
    device.set_modal(reference_hz=None, start_stop_hz=None, acceleration_hz_per_ms=None)


def erase(device: Device) -> Activity:
    """`@0k`: forget the stored program, whatever state it is in (2.2.17)."""
    yield Pause(device.profile.erase_ms * MILLISECOND_NS)
    device.store(program=StoredProgram())
