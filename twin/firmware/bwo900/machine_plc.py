"""The PLC of the machine: spindle, coolant, tool change, clamping, as a program of the twin's PLC.

    control --- M code, S, T, strobe ---> flags ---> OB 1 ---> outputs, strobe reset: acknowledged

    MB 30      code of the M function, while M 32.0 is on        A 0.0   spindle on       A 0.3   coolant 1
    MW 34      speed in 1/min    MB 36  tool                      A 0.1   turns left       A 0.4   coolant 2
    M 32.0     strobe: set by the control, reset by the program   A 0.2   tool is changed  A 0.5   clamped (M10)
    M 38.0     emergency stop

DEFAULT is small on purpose; the setting `plc_program` of the machine file gives another one as text.
"""

from __future__ import annotations

from collections import deque
from functools import cache
from typing import Final

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.firmware.plc import Plc, PlcMemory, Rights
from isel_twin.firmware.plc.assembler import assemble

SHORTEST_NS: Final = 4 * MILLISECOND_NS
MOST_WAITING: Final = 32
CODE, STROBE, SPEED, TOOL, EMERGENCY = 30, 32, 34, 36, 38

DEFAULT: Final = """
OB 1
UN M 32.0        ; nothing to do
SPB =SAFE
L MB 30
L KB 3
!=F
S A 0.0          ; M03
R A 0.1
L MB 30
L KB 4
!=F
S A 0.0          ; M04
S A 0.1
L MB 30
L KB 5
!=F
R A 0.0          ; M05
L MB 30
L KB 0
!=F
R A 0.0          ; M00
L MB 30
L KB 7
!=F
S A 0.3          ; M07
L MB 30
L KB 8
!=F
S A 0.4          ; M08
L MB 30
L KB 9
!=F
R A 0.3          ; M09
R A 0.4
L MB 30
L KB 10
!=F
S A 0.5          ; M10
L MB 30
L KB 11
!=F
R A 0.5          ; M11
L MB 30
L KB 6
!=F
R A 0.0          ; M06: the spindle stands, the change takes two seconds
L KT 020.1
SE T 1
L MB 30
L KB 6
!=F
UN T 1
= A 0.2
U A 0.2
BEB
L KB 255
T MB 30          ; the timer sees that M06 is over
UN A 0.2
R M 32.0         ; acknowledged
SAFE: UN E 0.4   ; hood open, key not on setup: no spindle
R A 0.0
U M 38.0         ; nor after an emergency stop, until M03 or M04
R A 0.0
U M 32.0
BEB
L KB 0
L KB 1
!=F
L KT 020.1
SE T 1           ; off
BE
"""


@cache
def _image(text: str) -> bytes:
    return assemble(text).image


class MachinePlc:
    """The PLC and its flags from the control; M functions go to it one after the other."""

    OUTPUTS: Final = ("spindle", "hood_release", "analog", *(f"a0.{bit}" for bit in range(8)))

    def __init__(self, text: str | None = None) -> None:
        """text: STEP 5 in place of DEFAULT. Raises AssemblyError, ImageError."""
        self._plc = Plc(Rights(), {}, SHORTEST_NS)
        self._plc.load(_image(DEFAULT if text is None else text))
        self._memory = PlcMemory()
        self._waiting: deque[int] = deque()
        self._left = False  # the function shown is not waited for any more
        self._shown: dict[str, int] = {}
        self._shown_byte = 0  # what `_shown` was made from; unset outputs are off

    @property
    def next_ns(self) -> int | None:
        return self._plc.next_ns

    @property
    def idle(self) -> bool:
        return not self._waiting and self._free

    @property
    def _free(self) -> bool:
        return self._left or not self._memory.m[STROBE] & 1

    @property
    def room(self) -> bool:
        """True if the queue takes more M functions; otherwise a program waits."""
        return len(self._waiting) < MOST_WAITING

    def power_on(self, t_ns: int) -> None:
        self._plc.start(t_ns, self._memory, power_on=True)

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        """Terminals e0.n are inputs of the PLC, of the others it is told the emergency stop."""
        if terminal[:3] == "e0.":
            bit = 1 << int(terminal[3:])
            self._memory.e[0] = self._memory.e[0] | bit if level else self._memory.e[0] & ~bit
            self._plc.touch(t_ns)
        elif terminal == "estop":
            self._memory.m[EMERGENCY] = not level
            self._plc.touch(t_ns)

    def function(self, t_ns: int, code: int) -> None:
        self._waiting.append(code)
        self._hand_over(t_ns)

    def leave(self) -> None:
        """Wait for no acknowledgement any more: the queue is cleared, and the function shown to the PLC stands until
        the next one."""
        self._waiting.clear()
        self._left = True

    def forget(self) -> None:
        """Clear the queue; the function shown to the PLC goes on."""
        self._waiting.clear()

    def speed(self, spindle: int, value: float) -> None:
        """S of the first spindle, 1/min."""
        if spindle == 1:
            word = min(max(round(value), 0), 0xFFFF)
            self._memory.m[SPEED : SPEED + 2] = word.to_bytes(2, "little")

    def tool(self, number: int) -> None:
        self._memory.m[TOOL] = number & 0xFF

    def advance(self, t_ns: int) -> None:
        while (due := self._plc.next_ns) is not None and due <= t_ns:
            self._plc.end_pass(due, self._memory)
            self._hand_over(due)
            self._plc.begin_pass(due, self._memory)

    @property
    def spindle(self) -> int:
        """+1 turns right, -1 left, 0 off: A 0.0 and A 0.1."""
        a = self._memory.a[0]
        return (-1 if a & 2 else 1) if a & 1 else 0

    def take(self) -> dict[str, int]:
        """Outputs that have changed since the last call, by name."""
        byte = self._memory.a[0]
        if byte == self._shown_byte:
            return {}
        self._shown_byte = byte
        now = {**{f"a0.{bit}": byte >> bit & 1 for bit in range(8)}, "spindle": byte & 1}
        changed = {name: value for name, value in now.items() if self._shown.get(name, 0) != value}
        self._shown |= changed
        return changed

    def _hand_over(self, t_ns: int) -> None:
        """Show the PLC the next M function, if the one before has been acknowledged."""
        if self._waiting and self._free:
            self._left = False
            self._memory.m[CODE] = self._waiting.popleft() & 0xFF
            self._memory.m[STROBE] |= 1
            self._plc.touch(t_ns)
