"""The PathBlocks that analysis has made."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

from isel_twin.firmware.bwo900.analysis.coordinates import Coordinates
from isel_twin.firmware.bwo900.analysis.said import Said, correction, path_block
from isel_twin.firmware.bwo900.analysis.stack import Stack
from isel_twin.firmware.bwo900.analysis.targets import Targets
from isel_twin.firmware.bwo900.analysis.tools import Tools
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.geometry.curves import Bent
from isel_twin.firmware.bwo900.geometry.elements import Element
from isel_twin.firmware.bwo900.geometry.in_force import AT_REST, InForce
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.words import ProgramBlock


class Output:
    def __init__(
        self, parameters: Parameters, stack: Stack, coordinates: Coordinates, targets: Targets, tools: Tools
    ) -> None:
        self._parameters, self._stack, self._coordinates = parameters, stack, coordinates
        self._targets, self._tools = targets, tools
        self.ready: deque[PathBlock] = deque()
        self.clear()

    def clear(self) -> None:
        """A program begins."""
        self.ready.clear()
        self._told: tuple[object, InForce] = (None, AT_REST)
        """Cache: blocks share an InForce until something changes."""

    def empty(self, block: ProgramBlock) -> PathBlock:
        """A block of the program without a path."""
        name = self._stack.top.program.name if self._stack else ""
        return self.nothing(name, number=block.number or 0, column=block.column)

    def nothing(self, name: str, **others: object) -> PathBlock:
        """A block without a path."""
        here = self._coordinates
        fields: dict[str, object] = {"number": 0, "start": here.position, "plane": here.frame.plane, **others}
        fields |= {"target": here.program_position, "in_force": self.in_force(None)}
        fields |= {"correction": correction(here, self._tools)}
        return PathBlock(name, **fields)  # type: ignore[arg-type]

    def append(self, said: Said, elements: tuple[Element | Bent, ...], **changes: object) -> PathBlock:
        """Append the block of a path, or of a cycle's move; changes: fields that differ from `said`."""
        told = self.in_force(said.cycles[0] if said.cycles else None)
        feed = self._targets.feed_mm_min
        made = path_block(said, elements, self._coordinates, feed, self._tools, self._parameters, told)
        if changes:
            made = replace(made, **changes)  # type: ignore[arg-type]
        self.ready.append(made)
        return made

    def restop(self, stop: Stop) -> None:
        """Change the stop of the last block."""
        self.ready[-1] = replace(self.ready[-1], stop=stop)

    def in_force(self, cycle: int | None) -> InForce:
        """cycle: number of the one that the block is a move of."""
        here, stack = self._coordinates, self._stack
        user, called_by = stack.cycle or ("", None)
        number = int(user[1:]) if user else cycle
        feed = self._targets.feed_mm_min or 0.0
        now = here.modal, here.frame, feed, stack.depth, stack.caller, number, called_by, stack.loop
        if now != self._told[0]:
            self._told = now, InForce(*now)
        return self._told[1]
