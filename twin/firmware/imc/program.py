"""Stored programs (chapter 3): storing, checking, running.

Offsets count commands from the branch itself: 5 skips four commands, -5 repeats the last five. A loop runs its commands
once and then `count` times more (imc/31).

The flash state is `incomplete` from `@0i` and `valid` from `9` on, so a power loss or an error in between leaves a
program that cannot run and must be erased. Memory is counted in bytes of the text of a command without blanks but with
its CR (imc/12).
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from typing import Any

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.firmware.activity import Activity, Listen, Pause
from isel_twin.firmware.imc.adjust import WHOLE_BYTE
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.purpose import WAITING
from isel_twin.firmware.imc.replies import BAD_NUMBER, INVALID_FIELD, MEMORY_FULL, Refusal
from isel_twin.firmware.imc.settings import ProgramState, StoredProgram


@dataclass(frozen=True)
class Jump:
    """Go on `offset` commands away."""

    offset: int


@dataclass(frozen=True)
class Loop:
    """Repeat the commands from `offset` on, `count` times more."""

    count: int
    offset: int


# ---- storing -------------------------------------------------------------------------------------------------------


def admit_recording(device: Device) -> None:
    """`@0i`: axes are set (4), the memory is empty (G)."""
    device.require_axes()
    if device.flash.program.state is not ProgramState.EMPTY:
        raise Refusal(INVALID_FIELD)


class Recorder:
    """Takes the lines between `@0i` and `9`. A line with an error ends the field and makes it invalid (3.1)."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._lines: list[tuple[str, tuple[int, ...]]] = []
        self._depth: list[int] = []
        self._used = 0
        self.spoil()

    def add(self, code: str, values: tuple[int, ...]) -> None:
        """Store a command. Raises Refusal: 6 memory full, 1 a branch before the beginning or loops too deep."""
        self._used += len(code) + len(",".join(map(str, values))) + 1
        if self._used > self._device.profile.program_memory_bytes:
            raise Refusal(MEMORY_FULL)
        self._lines.append((code, values))
        offset = offset_of(code, values)
        if offset is not None and len(self._lines) - 1 + offset < 0:
            raise Refusal(BAD_NUMBER)
        is_loop = code == "3" and values[0] > 0
        self._depth.append(1 + max(self._depth[offset:], default=0) if is_loop else 0)
        if self._depth[-1] > self._device.profile.loop_depth:
            raise Refusal(BAD_NUMBER)

    def finish(self) -> None:
        """`9`: the program is valid. Raises Refusal(1) if a branch leads behind the end."""
        for number, (code, values) in enumerate(self._lines):
            if number + (offset_of(code, values) or 0) > len(self._lines):
                raise Refusal(BAD_NUMBER)
        device = self._device
        device.store(program=StoredProgram(ProgramState.VALID, tuple(self._lines), device.axes, device.modal))

    def spoil(self) -> None:
        """At the beginning, and after an error: mark the program as invalid."""
        lines, axes = tuple(self._lines), self._device.axes
        self._device.store(program=StoredProgram(ProgramState.INCOMPLETE, lines, axes))


def offset_of(code: str, values: tuple[int, ...]) -> int | None:
    """Offset of a command that branches, None for any other."""
    return values[-1] if code in ("2", "3", "o") else None


# ---- commands only for programs ------------------------------------------------------------------------------------


def check_loop(device: Device, count: int, offset: int) -> None:
    """Loops lead back; a branch (count 0) leads anywhere (3.2.5)."""
    if count > 0 and offset >= 0:
        raise Refusal(BAD_NUMBER)


def loop(device: Device, count: int, offset: int) -> Loop | Jump:
    """`3`: a loop, or with count 0 a branch."""
    return Loop(count, offset) if count else Jump(offset)


def send_sync(device: Device, char: int) -> None:
    """`1`: send a character to the host (3.2.3)."""
    device.send(chr(char))


def wait_for_sync(device: Device, char: int, offset: int) -> Activity:
    """`2`: wait for a byte; branch if it is the one (3.2.4, imc/41)."""
    heard = None
    while heard is None:
        heard = yield Listen()
    return Jump(offset) if heard == char else None


def delay(device: Device, tenths: int) -> Activity:
    """`5`: in tenths of a second; a stop does not shorten it (3.2.6)."""
    yield Pause(tenths * 100 * MILLISECOND_NS)


def check_input(device: Device, port: int, bit: int, value: int, *_: int) -> None:
    """Bits 0..7 with 0 or 1, or 128 with a byte (imc/35)."""
    highest = 255 if bit == WHOLE_BYTE else 1
    if (bit > 7 and bit != WHOLE_BYTE) or value > highest:
        raise Refusal(BAD_NUMBER)


def branch_on_input(device: Device, port: int, bit: int, value: int, offset: int) -> Jump | None:
    """`o`: branch if the input has the value (3.2.19)."""
    mask, wanted = _masked(bit, value)
    return Jump(offset) if (device.inputs.port(port) ^ wanted) & mask == 0 else None


def set_port_condition(device: Device, port: int, bit: int, value: int) -> None:
    """`6`: the next move ends when the input has the value (3.2.7)."""
    device.port_condition = (port, *_masked(bit, value))


def _masked(bit: int, value: int) -> tuple[int, int]:
    return (255, value) if bit == WHOLE_BYTE else (1 << bit, value << bit)


def run_program(device: Device, table: Mapping[str, Any]) -> Activity:
    """Run the stored program; `table` maps codes to commands. Ends like a command: return, or Refusal with its code.

    Commands without a duration take no time. Only a second branch back at the same instant takes a cycle, so that a
    loop can wait for an input and time always advances (imc/31).
    """
    lines = device.flash.program.lines
    loops: list[list[int]] = []
    last_branch_ns = -1
    number = 0
    try:
        while 0 <= number < len(lines):
            code, values = lines[number]
            command = table[code]
            result = command.do(device, *command.admitted(device, values))
            if isinstance(result, Generator):
                result = yield from result
            target = _next(number, result, loops, device.profile.loop_depth)
            if target <= number:
                if device.now_ns == last_branch_ns:
                    yield Pause(device.profile.cycle_ms * MILLISECOND_NS, WAITING)
                last_branch_ns = device.now_ns
            number = target
    finally:
        device.port_condition = None


def _next(number: int, result: Jump | Loop | None, loops: list[list[int]], depth: int) -> int:
    """Number of the next command; `loops` is the stack of [number of the loop command, repetitions left]."""
    match result:
        case Jump(offset):
            return number + offset
        case Loop(count, offset):
            while any(entry[0] == number for entry in loops) and loops[-1][0] != number:
                loops.pop()  # inner loops left by a branch
            if not loops or loops[-1][0] != number:
                if len(loops) == depth:
                    raise Refusal(INVALID_FIELD)
                loops.append([number, count])
            if loops[-1][1]:
                loops[-1][1] -= 1
                return number + offset
            loops.pop()
    return number + 1
