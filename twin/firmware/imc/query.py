"""Commands that ask: position, input ports, diagnosis, texts. They answer in every state."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from isel_twin.firmware.imc.device import POSITION_LIMIT, Device
from isel_twin.firmware.imc.replies import OK, SYNTAX, Refusal
from isel_twin.firmware.imc.safety import State
from isel_twin.firmware.imc.settings import AXES, ProgramState

AXIS_NAMES = "XYZA"
END = "\r\n"
REVISION = "0.2.0"  # of the emulated firmware


def position(device: Device) -> str:
    """`@0P`: 24 bits an axis, two's complement, hexadecimal (2.2.21, imc/4)."""
    told = positions(device.axes, set_axes_only=device.profile.set_axes_only)
    for axis in told:
        if not -POSITION_LIMIT <= device.counts[axis] < POSITION_LIMIT:  # after a reference run that was broken off
            device.remark(f"{AXIS_NAMES[axis]} is at {device.counts[axis]}; @0P has 24 bits and tells it modulo 2^24")
    return OK + "".join(f"{device.counts[axis] & 0xFFFFFF:06X}" for axis in told)


def positions(axes: int, *, set_axes_only: bool) -> tuple[int, ...]:
    """The axes whose positions `@0P` tells: X Y Z, and A if it is set; set_axes_only: of the profile, those of the mask
    `axes`, or X before any are set."""
    if set_axes_only:
        return tuple(axis for axis in range(AXES) if axes >> axis & 1) or (0,)
    return tuple(range(4 if axes & 8 else 3))


def read_port(device: Device, port: int) -> str:
    """`@0b`: two hexadecimal digits (2.2.3)."""
    return f"{OK}{device.inputs.port(port):02X}"


def check_diagnosis(device: Device, text: str) -> None:
    """Refuse what DIAGNOSES does not list (5)."""
    if text.strip(" ") not in DIAGNOSES:
        raise Refusal(SYNTAX)


def diagnosis(device: Device, text: str) -> str:
    """`@0D`: a byte as two hexadecimal digits (2.2.6)."""
    return f"{OK}{DIAGNOSES[text.strip(' ')](device):02X}"


def _status(device: Device) -> int:
    """Bits: 0 stages on, 1 axes set, 2 all of them referenced, 3 limit switch struck, 4 fault, 5 3D interpolation,
    6 test mode, 7 valid program (imc/25)."""
    flags = (
        device.outputs["stages"],
        device.axes,
        device.axes and all(device.referenced[axis] for axis in device.axis_list),
        device.safety is State.LIMIT,
        device.safety is State.FAULT,
        device.three_d,
        device.test_mode,
        device.flash.program.state is ProgramState.VALID,
    )
    return sum(bool(flag) << bit for bit, flag in enumerate(flags))


def _blocked(device: Device, direction: int) -> int:
    return sum(device.limits.blocks(axis, direction) << axis for axis in range(AXES))


# limit switches struck in positive and in negative direction, one bit an axis; status
DIAGNOSES: Mapping[str, Callable[[Device], int]] = {
    "Rp": lambda device: _blocked(device, 1),
    "Rn": lambda device: _blocked(device, -1),
    "S0": _status,
}

# the lines of `@0H`: words, each with the levels of its inputs
STATUS_LINES: tuple[tuple[tuple[str, tuple[str, ...]], ...], ...] = (
    (("e-stop", ("estop_1", "estop_2")), ("cool", ("cool",)), ("power", ("power_ok",))),
    (("start", ("start",)), ("stop", ("stop_released",)), ("probe", ("probe",))),
    (("hood", ("hood_automatic", "hood_setup")), ("key", ("setup",)), ("spindle", ("spindle",))),
)


def status_text(device: Device) -> str:
    """`@0H`: operator's elements and safety inputs, then the handshake (2.2.12). Sent within 50 ms (imc/10)."""
    lines = [
        " ".join(f"{word} {''.join(str(int(device.inputs[name])) for name in names)}" for word, names in line)
        for line in STATUS_LINES
    ]
    lines.append(device.safety.value)
    if device.outputs["flash_fault"]:
        lines.append("flash unreadable")
    return "".join(line + END for line in lines) + OK


def limit_text(device: Device) -> str:
    """`@0h`: limit switches, 1 struck, then the handshake (2.2.12)."""
    lines = (
        f"{name}1 {int(device.limits.active(2 * axis))} {name}2 {int(device.limits.active(2 * axis + 1))}"
        for axis, name in enumerate(AXIS_NAMES)
    )
    return "".join(line + END for line in lines) + OK


def user_info(device: Device) -> str:
    """`@0U` (2.2.25)."""
    return f"{OK}UserInfo: {device.settings.user_info}{END}"


def version(device: Device) -> str:
    """`@0V`, `@0?` (2.2.26): the revision of the emulated firmware (imc/50)."""
    return f"{OK}{device.profile.name}{END}isel-twin {REVISION}{END}"
