"""Programs analysed to their end, for tests: what they come to as blocks of a path."""

from __future__ import annotations

from isel_twin.firmware.bwo900.analysis.functions import FACTORY_FUNCTIONS
from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.stored import Store, StoredProgram
from isel_twin.firmware.bwo900.readings import Readings

MOST = 10_000


def programs(text: str) -> Store:
    """Programs of lines; a line such as P12 or Z7 alone begins one, without any it is P1."""
    store, name, blocks = Store(), "P1", list[str]()
    for line in [*text.strip().splitlines(), "P0"]:
        word = line.strip()
        if word[:1] in ("P", "Z") and word[1:].isdigit():
            if blocks:
                store[name] = StoredProgram.of(name, blocks)
            name, blocks = word, []
        elif word and word != "#":
            blocks.append(word)
    return store


class Analysed:
    """A program analysed to its end: its blocks, the parameters as they are then."""

    def __init__(
        self,
        text: str,
        first: str | None = None,
        position=(0.0, 0.0, 0.0),
        readings: Readings = Readings(),  # noqa: B008 -- frozen
        **parameters: float,
    ) -> None:
        self.parameters = Parameters()
        self.parameters.readings = readings
        for number, value in {**FACTORY_FUNCTIONS, 12_004: 12_000.0, 12_204: 12_000.0, 12_404: 12_000.0}.items():
            self.parameters.write(number, value)
        for name, value in parameters.items():
            self.parameters.write(int(name[1:]), value, name[0].upper() if name[0] == "p" else "q")
        store = programs(text)
        self.interpreter = Interpreter(self.parameters, store)
        self.interpreter.begin(first or next(iter(store)), position, skips=True)
        self.blocks: list[PathBlock] = []
        for _ in range(MOST):
            block = self.interpreter.next()
            if block is Waiting.EXECUTION:
                self.interpreter.executed()
            elif block is Waiting.ACKNOWLEDGEMENT:
                self.interpreter.acknowledged(False)
            elif isinstance(block, PathBlock):
                self.blocks.append(block)
                for number, value in block.parameters:
                    self.parameters.write(number, value)
                if block.stop is Stop.END:
                    break
            else:
                break

    @property
    def path(self) -> list[PathBlock]:
        """Blocks with a path."""
        return [block for block in self.blocks if block.elements]

    @property
    def points(self) -> list[tuple[float, ...]]:
        """Where each of them ends."""
        return [block.finish for block in self.path]
