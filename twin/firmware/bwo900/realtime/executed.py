"""The block in execution: its place in the program, its modal state, and display coordinates."""

from __future__ import annotations

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.elements import Point
from isel_twin.firmware.bwo900.geometry.frames import Frame
from isel_twin.firmware.bwo900.geometry.in_force import AT_REST, InForce
from isel_twin.firmware.bwo900.messages import Message, message


class Executed:
    """The block that the channel entered last."""

    def __init__(self, interpreter: Interpreter) -> None:
        self._interpreter = interpreter
        self.active = False
        self.block: PathBlock | None = None  # None: no program, or its first block has not begun
        self.place = ("", 0)  # program and number of the block; kept after the end of the program
        self.column = 0  # of the path's words in the text of the block

    def start(self) -> None:
        self.active, self.place = True, ("", 0)

    def end(self) -> None:
        self.active, self.block = False, None

    def enter(self, block: PathBlock) -> bool:
        """Take the beginning of a block; return True if it is another block of a program than before."""
        place = block.program, block.number
        other = place != self.place and block.number != 0
        self.block, self.place, self.column = block, place, block.column
        return other

    @property
    def in_force(self) -> InForce:
        """Modal state of the block; without a program that at the start of one."""
        return AT_REST if self.block is None else self.block.in_force

    @property
    def feed_mm_min(self) -> tuple[float, float]:
        """Programmed feed of the block, and the feed at its end; 0: none."""
        block = self.block
        if block is None:
            return 0.0, 0.0
        return block.feed_mm_min or block.in_force.feed_mm_min, block.end_feed_mm_min or 0.0

    @property
    def dwell_s(self) -> float:
        return 0.0 if self.block is None else self.block.dwell_s or 0.0

    @property
    def motion(self) -> float:
        """0 to 3 for G00 to G03: of the block, or the one in force if it has no path."""
        motion = None if self.block is None else self.block.motion
        return float(self.in_force.modal.motion) if motion is None else motion

    @property
    def target(self) -> Point:
        """End of the block in the program's coordinates; without a program the end of the last one."""
        return self._interpreter.program_position if self.block is None else self.block.target

    @property
    def frame(self) -> Frame:
        """Coordinates of the block; without a program those of the last one, or of HAND."""
        return self._interpreter.frame if self.block is None else self.block.in_force.frame

    def display_shift_mm(self, axis: int) -> float:
        """Machine coordinate minus displayed coordinate of an axis: zero point, G92, tool length."""
        frame = self.frame
        return frame.zero[axis] + frame.shift[axis] + (frame.length if axis == frame.plane.third else 0.0)

    def message(self, number: int, detail: str = "") -> Message:
        """The message of that number, about the block if there is one."""
        if not self.active:
            return message(number, detail=detail)
        program, block = self.place
        return message(number, program=program, block=block, column=self.column, detail=detail)
