"""One pass over a program: instructions on a memory, until OB 1 ends.

The result of logic operations (VKE) of a chain, AND before OR:

    U E 0.0          group = E 0.0          first of a chain: it begins a group
    U E 0.1          group = group and E 0.1
    O                earlier = earlier or group; a new group begins
    U E 0.2          group = E 0.2
    = A 0.0          VKE = earlier or group; the chain ends

`O E 0.2` with an operand joins at once: (earlier or group) or E 0.2. A bracket is a chain of its own, up to eight deep.
Assignments, timers, counters, jumps and calls end a chain and leave the VKE; a conditional jump, call or end leaves it
at 1. Two accumulators of 16 bits: loads push 1 into 2, arithmetic leaves 2 as it is. The condition (less than, equal
to, more than zero) is that of the last arithmetic, comparison (accumulator 2 against 1), word or shift instruction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from isel_twin.firmware.plc.codes import Instruction, decode
from isel_twin.firmware.plc.elements import Counter, Timer
from isel_twin.firmware.plc.image import PlcBlock, PlcProgram
from isel_twin.firmware.plc.memory import PlcMemory

DEEPEST_CALLS: Final = 16  # blocks that may be open at once (manual of the card: a stack of 16 levels)
DEEPEST_BRACKETS: Final = 8
MOST_INSTRUCTIONS: Final = 20_000  # most instructions of a pass, 0.9 s of virtual time: beyond that the PLC stops
ELEMENTS: Final = 32

# A built-in function block: accumulators 1 and 2 and the memory it is called with; the accumulators afterwards
Function: TypeAlias = Callable[[int, int, PlcMemory], tuple[int, int]]


class Halt(Exception):
    """The PLC stops in the middle of a pass; the message says where and why."""


@dataclass(slots=True)
class Elements:
    """Timers and counters, which live from pass to pass."""

    timers: list[Timer] = field(default_factory=lambda: [Timer() for _ in range(ELEMENTS)])
    counters: list[Counter] = field(default_factory=lambda: [Counter() for _ in range(ELEMENTS)])


class Processor:
    def __init__(self, program: PlcProgram, functions: Mapping[int, Function]) -> None:
        """functions: built-in FBs by number; they take precedence over blocks of that name."""
        self._functions = functions
        self._blocks = {(block.kind, block.number): instructions_by_word(block) for block in program.blocks}

    def has(self, kind: str, number: int) -> bool:
        return (kind, number) in self._blocks

    def run(self, kind: str, number: int, memory: PlcMemory, elements: Elements, now_ns: int) -> Pass:
        """One pass from that block on, at now_ns. Writes `memory` and `elements`. Raises Halt."""
        run = Pass(self._blocks, self._functions, memory, elements, now_ns)
        run.call(kind, number)
        return run


def instructions_by_word(block: PlcBlock) -> list[Instruction | None]:
    """The instruction that begins at each word of a block; None at second words and where there is none."""
    found: list[Instruction | None] = []
    while 2 * len(found) < len(block.code):
        instruction = decode(block.code, 2 * len(found))
        found.append(instruction)
        if instruction is not None and instruction.words == 2:
            found.append(None)
    return found


class Pass:
    """A pass during its computation, and its results."""

    def __init__(
        self,
        blocks: Mapping[tuple[str, int], list[Instruction | None]],
        functions: Mapping[int, Function],
        memory: PlcMemory,
        elements: Elements,
        now_ns: int,
    ) -> None:
        self.executed = 0  # instructions
        self.changed = False  # a timer or counter has changed: the next pass may differ
        self.live = False
        """It has used something that changes by itself: a built-in function, the rest of a timer."""
        self._blocks, self._functions = blocks, functions
        self._memory, self._elements, self._now_ns = memory, elements, now_ns
        self._accumulator = (0, 0)
        self._condition = 0  # -1, 0, 1: less than, equal to, more than zero
        self._depth = 0
        self._vke = False
        self._first = True
        self._group = True
        self._earlier = False
        self._brackets: list[tuple[bool, bool, bool, bool]] = []
        """Chain outside each bracket: first, group, earlier, and whether the bracket is joined by or."""

    # Blocks

    def call(self, kind: str, number: int) -> None:
        if self._depth == DEEPEST_CALLS:
            raise Halt(f"{kind} {number} is called on the {DEEPEST_CALLS + 1}th level")
        instructions = self._blocks.get((kind, number))
        if instructions is None:
            raise Halt(f"{kind} {number} is called and is not there")
        self._depth += 1
        at = 0
        while True:
            instruction = instructions[at] if 0 <= at < len(instructions) else None
            if instruction is None:
                raise Halt(f"{kind} {number}: no instruction at word {at}")
            self.executed += 1
            if self.executed > MOST_INSTRUCTIONS:
                raise Halt(f"{kind} {number}: no end after {MOST_INSTRUCTIONS} instructions")
            form = instruction.form
            match form.operand:
                case "bit":
                    self._bit(form.mnemonic, form.area, instruction.number, instruction.bit)
                case "number":
                    self._number(form.mnemonic, form.area, instruction.number)
                case "constant":
                    self._load(instruction.number)
                case "jump":
                    self._end_chain()
                    if self._jumps(form.mnemonic):
                        at += instruction.number
                        continue
                case "block":
                    if form.area != "DB":
                        self._end_chain()
                        if form.mnemonic == "SPA" or self._conditional():
                            self._call_or_built_in(form.area, instruction.number)
                case _ if form.mnemonic in ("BE", "BEA"):
                    break
                case _ if form.mnemonic == "BEB":
                    self._end_chain()
                    if self._conditional():
                        break
                case _ if form.mnemonic == "STP":
                    raise Halt(f"{kind} {number}: STP")
                case _:
                    self._plain(form.mnemonic)
            at += instruction.words
        self._end_chain()
        self._depth -= 1

    def _call_or_built_in(self, kind: str, number: int) -> None:
        if kind == "FB" and number in self._functions:
            self.live = True
            first, second = self._functions[number](*self._accumulator, self._memory)
            self._accumulator = (first & 0xFFFF, second & 0xFFFF)
        else:
            self.call(kind, number)

    def _conditional(self) -> bool:
        """Return whether the VKE is 1, and set it to 1."""
        vke, self._vke = self._vke, True
        return vke

    def _jumps(self, mnemonic: str) -> bool:
        match mnemonic:
            case "SPA":
                return True
            case "SPB":
                return self._conditional()
            case "SPZ":
                return self._condition == 0
            case "SPN":
                return self._condition != 0
            case "SPP":
                return self._condition > 0
        return self._condition < 0

    # Logic

    def _join(self, mnemonic: str, value: bool) -> None:
        """U, O, UN, ON of a bit."""
        if mnemonic[-1] == "N":
            value = not value
        if self._first:
            self._first, self._group, self._earlier = False, value, False
        elif mnemonic[0] == "U":
            self._group = self._group and value
        else:
            self._group, self._earlier = self._earlier or self._group or value, False
        self._vke = self._earlier or self._group

    def _end_chain(self) -> None:
        self._first, self._group, self._earlier = True, True, False

    def _bit(self, mnemonic: str, area: str, number: int, bit: int) -> None:
        image = self._area(area)
        mask = 1 << bit
        if mnemonic in ("U", "O", "UN", "ON"):
            self._join(mnemonic, bool(image[number] & mask))
            return
        if mnemonic == "=":
            image[number] = image[number] | mask if self._vke else image[number] & ~mask
        elif self._vke:
            image[number] = image[number] | mask if mnemonic == "S" else image[number] & ~mask
        self._end_chain()

    def _open(self, joined_by_or: bool) -> None:
        if len(self._brackets) == DEEPEST_BRACKETS:
            raise Halt(f"more than {DEEPEST_BRACKETS} brackets are open")
        self._brackets.append((self._first, self._group, self._earlier, joined_by_or))
        self._end_chain()

    def _close(self) -> None:
        if not self._brackets:
            raise Halt("a bracket is closed that was not opened")
        value = self._vke
        self._first, self._group, self._earlier, joined_by_or = self._brackets.pop()
        self._join("O" if joined_by_or else "U", value)

    def _or(self) -> None:
        """`O` alone: the result so far, or the group that follows."""
        if not self._first:
            self._earlier, self._group = self._earlier or self._group, True
            self._vke = self._earlier

    # Timers, counters, words

    def _number(self, mnemonic: str, area: str, number: int) -> None:
        if area == "T":
            self._timer(mnemonic, self._elements.timers[number])
        elif area == "Z":
            self._counter(mnemonic, self._elements.counters[number])
        elif mnemonic == "L":
            self._load(number if area == "KB" else self._read(area, number))
        elif mnemonic == "T":
            self._write(area, number, self._accumulator[0])
        else:
            self._change(mnemonic, number)

    def _timer(self, mnemonic: str, timer: Timer) -> None:
        if mnemonic in ("U", "O", "UN", "ON"):
            self._join(mnemonic, timer.on(self._now_ns))
        elif mnemonic == "L":
            self.live = self.live or timer.end_ns is not None
            self._load(timer.left(self._now_ns))
        else:
            if mnemonic != "R":
                self.changed |= timer.start(mnemonic, self._vke, self._accumulator[0], self._now_ns)
            elif self._vke:
                self.changed |= timer.reset()
            self._end_chain()

    def _counter(self, mnemonic: str, counter: Counter) -> None:
        if mnemonic in ("U", "O", "UN", "ON"):
            self._join(mnemonic, counter.value > 0)
        elif mnemonic == "L":
            self._load(counter.value)
        else:
            if mnemonic != "R":
                self.changed |= counter.act(mnemonic, self._vke, self._accumulator[0])
            elif self._vke:
                self.changed |= counter.reset()
            self._end_chain()

    def _area(self, name: str) -> bytearray:
        return {"E": self._memory.e, "A": self._memory.a, "M": self._memory.m, "D": self._memory.d}[name]

    def _read(self, area: str, number: int) -> int:
        image, at = self._place(area, number)
        return image[at] | image[at + 1] << 8 if area[1] == "W" else image[at]

    def _write(self, area: str, number: int, word: int) -> None:
        image, at = self._place(area, number)
        image[at] = word & 0xFF
        if area[1] == "W":
            image[at + 1] = word >> 8

    def _place(self, area: str, number: int) -> tuple[bytearray, int]:
        """The bytes of an area such as DL, and the index of a word or byte in them."""
        at = 2 * number if area[0] == "D" else number
        return self._area(area[0]), at + (area == "DL")

    def _load(self, word: int) -> None:
        self._accumulator = (word, self._accumulator[0])

    def _change(self, mnemonic: str, number: int) -> None:
        """I, D, SLW, SRW."""
        first, second = self._accumulator
        if mnemonic in ("I", "D"):
            first = first & 0xFF00 | (first + (number if mnemonic == "I" else -number)) & 0xFF
        else:
            for _ in range(number):
                self._condition = first >> 15 if mnemonic == "SLW" else first & 1
                first = first << 1 & 0xFFFF if mnemonic == "SLW" else first >> 1
        self._accumulator = (first, second)

    def _plain(self, mnemonic: str) -> None:
        first, second = self._accumulator
        match mnemonic:
            case "U(" | "O(":
                self._open(mnemonic == "O(")
            case ")":
                self._close()
            case "O":
                self._or()
            case "!=F" | "><F" | ">F" | ">=F" | "<F" | "<=F":
                self._compare(mnemonic, _signed(second) - _signed(first))
            case "+F":
                self._result(second + first)
            case "-F":
                self._result(second - first)
            case "UW":
                self._bits(second & first)
            case "OW":
                self._bits(second | first)
            case "XOW":
                self._bits(second ^ first)
            case "KEW":
                self._accumulator = (first ^ 0xFFFF, second)
            case "KZW":
                self._result(-first)
            case "TAK":
                self._accumulator = (second, first)

    def _compare(self, mnemonic: str, difference: int) -> None:
        self._condition = (difference > 0) - (difference < 0)
        self._vke = {
            "!=F": difference == 0,
            "><F": difference != 0,
            ">F": difference > 0,
            ">=F": difference >= 0,
            "<F": difference < 0,
            "<=F": difference <= 0,
        }[mnemonic]
        self._first, self._group, self._earlier = False, self._vke, False

    def _result(self, number: int) -> None:
        """Of arithmetic: sixteen bits, two's complement."""
        value = _signed(number & 0xFFFF)
        self._condition = (value > 0) - (value < 0)
        self._accumulator = (number & 0xFFFF, self._accumulator[1])

    def _bits(self, word: int) -> None:
        """Of word logic: the condition tells zero from not zero."""
        self._condition = int(word != 0)
        self._accumulator = (word, self._accumulator[1])


def _signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word
