"""Every command of the manual as data: code, section, parameters, conditions, handler.

Three tables, as in chapter 1: DNC (prefix `@<number>`), CNC (storable), INITIALISATION (prefix `@<number>I`). Refusals
come first: nothing changes before it is certain that the command will be carried out.

    refuse    axes set (4) -> numbers read (7, 1, the parameter's own code) -> check: parameters -> admit: state of the
              machine (5, 9, H, 2, R, 1; imc/16)
    do        changes something and returns nothing (reply `0`), a text (the reply) or an activity; never refuses

A stored command is read and checked when it is stored, admitted and done when it runs. A running activity may also end
by Refusal, which is then its result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from isel_twin.firmware.imc import adjust, moves, program, query, reference
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.grammar import AXES_CODE, Number, cut, read_numbers, split_dnc
from isel_twin.firmware.imc.replies import NOT_STORABLE, SYNTAX, Refusal
from isel_twin.firmware.imc.settings import AXES

Numbers = tuple[Number, ...]

SWITCH = Number(0, 1)
BYTE = Number(0, 255)
AXIS_MASK = Number(0, 15)
INPUT_PORT = Number(0, 3)
USER_PORT = Number(0, 0)  # imc/45
START_STOP_HZ = Number(20, 4000)
ACCELERATION = Number(1, 4000)
OFFSET = Number(-32768, 32767)
VISIBLE = Number(33, 126)
STEPS = Number(0)
WATCH = (INPUT_PORT, BYTE, BYTE)


@dataclass(frozen=True)
class Command:
    """One row of a table.

    parameters: numbers, or a function of the device that gives them; None: the rest of the line unchanged.
    check(device, *values) and admit(device, *values) raise Refusal and change nothing; a tuple that admit returns
    replaces the values for do. needs_axes: answers 4 without axes. spare_values: with `extra_values` of the profile,
    values for all four axes are accepted although fewer are set.
    """

    section: str
    purpose: str
    parameters: Numbers | Callable[[Device], Numbers] | None
    do: Callable[..., Any]
    check: Callable[..., None] | None = None
    admit: Callable[..., tuple[Any, ...]] | None = None
    needs_axes: bool = False
    spare_values: bool = False

    def read(self, device: Device, text: str) -> tuple[Any, ...]:
        """Read and check the parameters. Raises Refusal."""
        if self.needs_axes:
            device.require_axes()
        values: tuple[Any, ...] = (text,)
        if self.parameters is not None:
            numbers = self.parameters(device) if callable(self.parameters) else self.parameters
            if self.spare_values and device.profile.extra_values:
                text = cut(text, len(numbers), AXES)
            values = read_numbers(text, numbers)
        if self.check is not None:
            self.check(device, *values)
        return values

    def admitted(self, device: Device, values: tuple[Any, ...]) -> tuple[Any, ...]:
        """The arguments of `do`. Raises Refusal if the machine's state forbids it."""
        return values if self.admit is None else self.admit(device, *values)


_on_axes = partial(Command, needs_axes=True)

# DNC commands that a device carries out. `@0i` (2.2.13), `@0S` (2.2.23) and the control bytes (2.2.31) concern the flow
# of commands itself: controller.py. `@0I...` (2.2.14): INITIALISATION.
DNC: Mapping[str, Command] = {
    AXES_CODE: Command(
        "2.2.1",
        "set the axes, initialise",
        (Number(),),
        adjust.initialise,
        adjust.check_axis_choice,
        adjust.admit_initialisation,
    ),
    "A": _on_axes(
        "2.2.2", "relative move", moves.move_parameters, moves.follow, moves.check_relative, moves.plan_relative
    ),
    "b": Command("2.2.3", "read a port", (INPUT_PORT,), query.read_port),
    "B": Command(
        "2.2.4", "write a port", (Number(), Number()), adjust.write_outputs, adjust.check_port_value, adjust.admit_port
    ),
    "d": _on_axes(
        "2.2.5", "reference speeds", adjust.speed_for_each_axis, adjust.set_reference_speeds, spare_values=True
    ),
    "D": Command("2.2.6", "diagnosis", None, query.diagnosis, query.check_diagnosis),
    "e": Command("2.2.7", "plane of arcs", (Number(0, 2),), adjust.set_modal("plane")),
    "f": Command("2.2.8", "direction of arcs", (Number(-1, 0),), adjust.set_turn),
    "F": _on_axes("2.2.9", "run free", (Number(),), reference.run_free, adjust.check_axes, reference.admit_run_free),
    "g": Command("2.2.10", "brake", (SWITCH,), adjust.set_brake),
    "G": Command("2.2.11", "device number", (Number(0, 9),), adjust.set_number),
    "h": Command("2.2.12", "limit switches in words", (), query.limit_text),
    "H": Command("2.2.12", "state in words", (), query.status_text),
    "j": Command("2.2.15", "start-stop frequency", (START_STOP_HZ,), adjust.set_modal("start_stop_hz")),
    "J": Command("2.2.16", "acceleration", (ACCELERATION,), adjust.set_modal("acceleration_hz_per_ms")),
    "k": Command("2.2.17", "erase the program", (), adjust.erase),
    "M": _on_axes(
        "2.2.18", "absolute move", moves.move_parameters, moves.follow, moves.check_absolute, moves.plan_absolute
    ),
    "n": _on_axes("2.2.19", "virtual zero", (Number(),), adjust.set_virtual_zero, adjust.check_axes),
    "N": _on_axes(
        "2.2.20",
        "simulated reference run",
        (Number(),),
        adjust.simulate_reference,
        adjust.check_axes,
        adjust.admit_simulated_reference,
    ),
    "P": Command("2.2.21", "position", (), query.position),
    "R": _on_axes(
        "2.2.22",
        "reference run",
        (Number(),),
        reference.reference_run,
        adjust.check_axes,
        reference.admit_reference_run,
    ),
    "T": Command("2.2.24", "test mode", (SWITCH,), adjust.set_modal("test_mode", bool)),
    "U": Command("2.2.25", "user information", (), query.user_info),
    "V": Command("2.2.26", "version", (), query.version),
    "w": _on_axes("2.2.27", "helix", moves.helix_parameters, moves.follow, moves.check_arc, moves.plan_arc),
    "y": _on_axes("2.2.28", "arc", moves.arc_parameters, moves.follow, moves.check_arc, moves.plan_arc),
    "z": Command("2.2.29", "3D interpolation", (SWITCH,), adjust.set_modal("three_d", bool)),
    "Z": _on_axes(
        "2.2.30", "move until port event", moves.until_port_parameters, moves.travel, admit=moves.plan_until_port
    ),
}

# letters that are synonyms of others
DNC_ALIASES: Mapping[str, str] = {"a": "A", "m": "M", "r": "R", "s": "S", "p": "P", "?": "V"}

# initialisation commands
INITIALISATION: Mapping[str, Command] = {
    "Id": Command("4.2.1", "default reference speeds", adjust.default_speed_parameters, adjust.set_default_speeds),
    "IF": Command("4.2.2", "run-free steps", (STEPS,) * 4, adjust.set_values("run_free_steps")),
    "IJ": Command("4.2.3", "default acceleration", (ACCELERATION,), adjust.set_value("acceleration_hz_per_ms")),
    "Ij": Command("4.2.4", "default start-stop frequency", (START_STOP_HZ,), adjust.set_value("start_stop_hz")),
    "IO": Command("4.2.5", "IO-only mode", (SWITCH,), adjust.set_io_only),
    "IE": Command("4.2.6", "limit switches", (Number(0, 65535),), adjust.set_value("limit_switches")),
    "Ie": Command("4.2.7", "swapped limit switches", (AXIS_MASK,), adjust.set_swapped),
    "ID": Command("4.2.8", "inverted axes", (AXIS_MASK,), adjust.set_inverted),
    "IR": Command("4.2.9", "inverted reference directions", (AXIS_MASK,), adjust.set_value("reference_inverted")),
    "IT": Command("4.2.10", "rotary axes", (AXIS_MASK,), adjust.set_value("rotary")),
    "IA": Command("4.2.11", "abort input of programs", WATCH, adjust.set_values("abort")),
    "Ia": Command("4.2.12", "error output of programs", (USER_PORT, BYTE, BYTE), adjust.set_values("error_signal")),
    "IH": Command("4.2.13", "external hood input of programs", WATCH, adjust.set_values("hood")),
    "IN": Command("4.2.14", "external emergency input of programs", WATCH, adjust.set_values("emergency")),
    "IC": Command("4.2.15", "9600 baud from the next reset on", (SWITCH,), adjust.set_value("baud_9600")),
    "IU": Command("4.2.16", "set the user information", None, adjust.set_user_info, adjust.check_user_info),
    "IL": Command("4.2.17", "read the values from flash", (), adjust.load_settings),
    "IW": Command("4.2.18", "write the values to flash", (), adjust.save_settings),
    "IX": Command("4.2.19", "default values", (), adjust.default_all),
}


def _stored(section: str, code: str, **other: Any) -> Command:
    """The storable form of a DNC command, with another section and `other` fields."""
    return replace(DNC[code], section=section, **other)


# storable commands. `9` (3.2.9) ends the data field: controller.py.
CNC: Mapping[str, Command] = {
    "0": _stored("3.2.2", "A"),
    "1": Command("3.2.3", "send a character", (VISIBLE,), program.send_sync),
    "2": Command("3.2.4", "wait for a character", (VISIBLE, OFFSET), program.wait_for_sync),
    "3": Command("3.2.5", "loop, branch", (Number(0, 32767), OFFSET), program.loop, program.check_loop),
    "5": Command("3.2.6", "delay", (STEPS,), program.delay),
    "6": Command(
        "3.2.7", "condition of the next move", (USER_PORT, BYTE, BYTE), program.set_port_condition, program.check_input
    ),
    "7": _stored("3.2.8", "R"),
    "d": Command("3.2.10", "reference speeds", adjust.four_speeds, adjust.set_modals("reference_hz")),
    "e": _stored("3.2.11", "e"),
    "f": _stored("3.2.12", "f"),
    "g": _stored("3.2.13", "g"),
    "j": _stored("3.2.14", "j"),
    "J": _stored("3.2.15", "J"),
    "m": _stored("3.2.16", "M"),
    "n": _stored("3.2.17", "n"),
    "N": _stored("3.2.18", "N"),
    "o": Command(
        "3.2.19", "branch on a port", (INPUT_PORT, BYTE, BYTE, OFFSET), program.branch_on_input, program.check_input
    ),
    "p": Command(
        "3.2.20", "write a port", (Number(),) * 3, adjust.write_outputs, adjust.check_port_bit, adjust.admit_port_bit
    ),
    "T": _stored("3.2.21", "T"),
    "w": _stored("3.2.22", "w", check=moves.check_arc_numbers),
    "y": _stored("3.2.23", "y", check=moves.check_arc_numbers),
    "z": _stored("3.2.24", "z"),
}

# the overview prints these codes as capitals, their sections as small letters; both are taken
CNC_ALIASES: Mapping[str, str] = {"F": "f", "G": "g", "M": "m", "O": "o", "P": "p", "W": "w", "Y": "y", "Z": "z"}

# DNC commands that change nothing and take no time: they are answered even if held by a stop
QUESTIONS = frozenset("bDhHPUV")


def dnc_code(line: bytes, device_number: int) -> str | None:
    """Code of a DNC line: "" if it is no command, None if it is for another device."""
    try:
        parts = split_dnc(line, device_number, DNC_ALIASES)
    except Refusal:
        return ""
    return None if parts is None else parts[1]


def find_dnc(device: Device, code: str) -> Command:
    """The DNC or initialisation command with this code. Raises Refusal(5)."""
    command = DNC.get(code) or INITIALISATION.get(code)
    if command is None or code in device.profile.unknown_commands:
        raise Refusal(SYNTAX)
    return command


def find_cnc(code: str) -> Command:
    """The storable command with this code. Raises Refusal(8)."""
    if code not in CNC:
        raise Refusal(NOT_STORABLE)
    return CNC[code]
