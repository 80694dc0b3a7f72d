"""The PLC in virtual time: pass after pass, each as long as its instructions take.

    begin             end = next begin
    |--- pass --------|--- pass ---- ...        the program works on copies taken at the begin;
    ^ images copied   ^ changes take effect      the changes take effect at the end

Only what a pass has *changed* is written back, so that it does not undo a flag that a host sets while the pass runs. At
the end outputs are written and inputs are read (manual of the card, section 6).

A pass that changes nothing and reads nothing that changes by itself would repeat unchanged until the memory is touched
or a timer runs out. The PLC skips those passes and continues on their grid, with the same result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from isel_twin.base.units import MICROSECOND_NS
from isel_twin.firmware.plc.image import ImageError, PlcProgram
from isel_twin.firmware.plc.memory import PlcMemory, Rights
from isel_twin.firmware.plc.processor import Elements, Function, Halt, Processor

# time of an instruction: 1000 of them take about 45 ms (manual of the card, section 9)
INSTRUCTION_NS: Final = 45 * MICROSECOND_NS

CYCLIC: Final = ("OB", 1)
AT_START: Final = ("OB", 21)  # once, when it is started by hand
AT_POWER_ON: Final = ("OB", 22)  # once, when it starts by itself at power-on


@dataclass(slots=True)
class _Made:
    """A computed pass that ends later: the memory before and after it."""

    before: PlcMemory
    after: PlcMemory
    begin_ns: int
    end_ns: int
    repeats: bool  # the next pass would do just the same


class Plc:
    """One PLC. `next_ns` is when `end_pass` and `begin_pass` are due."""

    def __init__(self, rights: Rights, functions: Mapping[int, Function], shortest_ns: int) -> None:
        """functions: built-in FBs by number. shortest_ns: a pass takes a multiple of it, at least one."""
        self._rights, self._functions, self._shortest_ns = rights, functions, shortest_ns
        self.image = b""  # of the program; empty: none
        self._processor: Processor | None = None
        self._elements = Elements()
        self._made: _Made | None = None
        self._touched = False
        self._stops = False
        self.stopped_by = ""  # why it has stopped by itself; empty if it has not

    @property
    def program(self) -> PlcProgram | None:
        return PlcProgram.read(self.image) if self.image else None

    @property
    def running(self) -> bool:
        return self._made is not None

    @property
    def inputs(self) -> bytes | bytearray:
        """Image of the inputs that the present pass works with, empty at rest."""
        return self._made.before.e if self._made else b""

    @property
    def next_ns(self) -> int | None:
        """End of the present pass; None at rest, and while passes would only repeat the last one."""
        made = self._made
        if made is None:
            return None
        if not made.repeats or self._touched:
            return made.end_ns
        ends = [timer.end_ns for timer in self._elements.timers if timer.end_ns is not None]
        return self._first_begin(made, min(ends)) if ends else None

    def load(self, image: bytes) -> None:
        """Load a program, at rest. Raises ImageError and changes nothing for a wrong image."""
        program = PlcProgram.read(image)
        if program.block(*CYCLIC) is None:
            raise ImageError("there is no OB 1")
        self.stop()
        self.image, self._processor = image, Processor(program, self._functions)

    def clear(self) -> None:
        self.stop()
        self.image, self._processor = b"", None

    def start(self, t_ns: int, memory: PlcMemory, power_on: bool = False) -> bool:
        """Begin with the start-up block, if there is one, and the first pass; False if there is no program."""
        if self._processor is None:
            return False
        self._elements, self.stopped_by, self._stops = Elements(), "", False
        self._begin(t_ns, memory, AT_POWER_ON if power_on else AT_START)
        return True

    def stop(self) -> None:
        """Stop at once: what the present pass would have changed is lost."""
        self._made = None

    def stop_at_end(self, t_ns: int) -> None:
        """Let the present pass be the last one."""
        self.touch(t_ns)
        self._stops = True

    def touch(self, t_ns: int) -> None:
        """Note that inputs, flags or data may have changed at t_ns, for the next pass."""
        made = self._made
        if made is not None and made.repeats and not self._touched and t_ns >= made.end_ns:  # skipped passes
            length = made.end_ns - made.begin_ns
            begin = made.begin_ns + (t_ns - made.begin_ns) // length * length
            made.begin_ns, made.end_ns = begin, begin + length
        self._touched = True

    def end_pass(self, t_ns: int, memory: PlcMemory) -> bool:
        """At `next_ns`: write what the pass has changed to memory; True if anything differs. Then `begin_pass`."""
        made = self._made
        if made is None or (due := self.next_ns) is None or t_ns < due:
            return False
        if self.stopped_by or self._stops:
            self._made = None
        return self._carry_over(made, memory)

    def begin_pass(self, t_ns: int, memory: PlcMemory) -> None:
        """After `end_pass`, at the same time: the next one, if it has not stopped."""
        if self._made is not None:
            self._begin(t_ns, memory)

    def _first_begin(self, made: _Made, t_ns: int) -> int:
        length = made.end_ns - made.begin_ns
        return max(made.end_ns, made.begin_ns - (made.begin_ns - t_ns) // length * length)

    def _begin(self, t_ns: int, memory: PlcMemory, start_up: tuple[str, int] | None = None) -> None:
        assert self._processor is not None
        self._touched = False
        before, after = memory.copy(), memory.copy()
        blocks = [CYCLIC] if start_up is None or not self._processor.has(*start_up) else [start_up, CYCLIC]
        executed, repeats = 0, len(blocks) == 1
        try:
            for kind, number in blocks:
                run = self._processor.run(kind, number, after, self._elements, t_ns)
                executed += run.executed
                repeats = repeats and not run.changed and not run.live
        except Halt as halt:
            self.stopped_by, repeats = str(halt), False
        length = -(-executed * INSTRUCTION_NS // self._shortest_ns) * self._shortest_ns
        repeats = repeats and all(a == b for a, b in zip(before.areas(), after.areas(), strict=True))
        self._made = _Made(before, after, t_ns, t_ns + max(length, self._shortest_ns), repeats)

    def _carry_over(self, made: _Made, memory: PlcMemory) -> bool:
        changed = False
        for before, after, now in zip(made.before.areas(), made.after.areas(), memory.areas(), strict=True):
            if before == after:
                continue
            for number, (old, new) in enumerate(zip(before, after, strict=True)):
                if old != new:
                    wanted = now[number] & ~(old ^ new) | new & (old ^ new)
                    if now is memory.m:
                        wanted = self._rights.allowed(number, now[number], wanted)
                    changed |= wanted != now[number]
                    now[number] = wanted
        return changed
