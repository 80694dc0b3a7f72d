"""The program store: 32 programs of recorded commands, in flash (4, 3.1.1 p3).

    p3;100;n   commands ...   p3;101          recorded, checked for form only
    p3;1;n                                    from the host, from a program (eight deep), from the PLC

Recording program 0 clears all programs. During a recording the program is empty in flash, and so it stays after a mains
failure; programs change in flash as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from isel_twin.firmware.gmi99.instruction import Instruction
from isel_twin.firmware.gmi99.settings import PROGRAMS

CAPACITY = 65_536
DEPTH = 8  # most nested subprograms


class Store:
    """The recorded commands. `error`: bit 4 of the memory status."""

    def __init__(self, programs: Mapping[str, tuple[str, ...]]) -> None:
        self._programs: dict[int, tuple[tuple[bytes, Instruction], ...]] = {}
        self.recording: int | None = None
        self.error = False
        self._lines: list[tuple[bytes, Instruction]] = []
        self._loaded = programs

    def restore(self, parse: Callable[[int, bytes], Instruction | None]) -> None:
        """Load the programs from flash; `parse`: commands.parse."""
        for number, commands in self._loaded.items():
            data = [bytes.fromhex(text) for text in commands]
            lines = [(line, instruction) for line in data if (instruction := parse(line[0], line[1:])) is not None]
            whole = len(lines) == len(data)
            self.error = self.error or not whole
            self._programs[int(number)] = tuple(lines) if whole else ()

    @property
    def kept(self) -> dict[str, tuple[str, ...]]:
        kept = sorted((number, lines) for number, lines in self._programs.items() if lines)
        return {str(number): tuple(data.hex() for data, _ in lines) for number, lines in kept}

    def program(self, number: int) -> tuple[Instruction, ...]:
        return tuple(instruction for _, instruction in self._programs.get(number, ()))

    def begin(self, number: int) -> None:
        assert 0 <= number < PROGRAMS
        if number == 0:
            self._programs.clear()
        self._programs.pop(number, None)
        self.recording, self._lines = number, []

    def record(self, data: bytes, instruction: Instruction) -> bool:
        """Record a command; False if there is no room, which ends the recording."""
        used = sum(len(line) + 1 for lines in self._programs.values() for line, _ in lines)
        if used + sum(len(line) + 1 for line, _ in self._lines) + len(data) + 1 > CAPACITY:
            self.forget()
            self.error = True
            return False
        self._lines.append((data, instruction))
        return True

    def end(self) -> None:
        assert self.recording is not None
        self._programs[self.recording] = tuple(self._lines)
        self.forget()
        self.error = False

    def forget(self) -> None:
        self.recording, self._lines = None, []

    def erase(self) -> None:
        self._programs.clear()
        self.forget()
