"""Plain blocks, `N120 X10.5 Y-3 Z0.2 F900`, on a short way: most of what CAM programs have.

What such a block comes to differs from the plain block before it only by number, column, place and feed, as long as
nothing else has happened. So the first one of a run goes the way of all blocks (interpreter.py) and is the pattern of
those that follow, to the bit:

    general   plain block ---> learn ---> pattern
    short     plain blocks --> run   ---> PathBlocks      same level, G functions, frame, parameters; no circle, no G91
              anything else ------------> general way     forgets the pattern
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import repeat
from typing import Final

from isel_twin.firmware.bwo900.analysis.coordinates import Coordinates
from isel_twin.firmware.bwo900.analysis.output import Output
from isel_twin.firmware.bwo900.analysis.stack import Level
from isel_twin.firmware.bwo900.analysis.targets import NEAR_MM, Targets
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.elements import straight
from isel_twin.firmware.bwo900.geometry.frames import Frame
from isel_twin.firmware.bwo900.geometry.groups import Modal
from isel_twin.firmware.bwo900.numbers import G
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.words import ProgramBlock

_NUMBER = r"([-+]?\d{1,12}(?:\.\d{0,12})?)"
_PLAIN = rf"(N(\d{{1,10}}) *)(?:X{_NUMBER} *)?(?:Y{_NUMBER} *)?(?:Z{_NUMBER} *)?(?:F{_NUMBER})?"
# a plain block: up to its first axis, number, X, Y, Z, F; or, as the last group, all from another block on
_ROW = re.compile(rf"{_PLAIN}\n|((?s:.+))")
_LONGEST: Final = 64  # blocks of a run: longer ones are not faster, and blocks that wait are looked at in vain
_LETTERS: Final = "XYZ"  # of the first three axes


class Plain:
    def __init__(self, parameters: Parameters, coordinates: Coordinates, targets: Targets, output: Output) -> None:
        self._parameters, self._coordinates = parameters, coordinates
        self._targets, self._output = targets, output
        self.forget()

    def forget(self) -> None:
        """The next block goes the way of all blocks."""
        self._pattern: PathBlock | None = None
        # what it holds for
        self._level: Level | None = None
        self._modal: Modal | None = None
        self._frame: Frame | None = None
        self._revision = 0
        self._added: tuple[tuple[float, ...], ...] = ()  # to a place in the program, for each of the first three axes

    @property
    def passes_filters(self) -> bool:
        """True if blocks of a run come out of idle filters as they are."""
        return self._pattern is not None and not self._pattern.asks_filters

    def learn(self, level: Level, block: ProgramBlock, made: PathBlock) -> None:
        """Take a block of this level as the pattern if it is plain. made: what it has come to."""
        here, modal = self._coordinates, self._coordinates.modal
        if (
            made.elements
            and re.fullmatch(_PLAIN, block.text)
            and modal.motion in (G.RAPID, G.LINE)
            and modal.dimension == G.ABSOLUTE
            and modal.polar == G.POLAR_OFF
            and modal.radius == G.RADIUS_OFF
            and _shifts(here.frame)
            and all(here.names.get(letter) == axis for axis, letter in enumerate(_LETTERS))
        ):
            self._pattern, self._level, self._modal, self._frame = made, level, modal, here.frame
            self._revision, self._added = self._parameters.revision, _additions(here.frame)

    def run(self, level: Level, most: int) -> list[PathBlock]:
        """Take the next blocks of this level, at most so many; none if the first must go the way of all blocks.

        All of them at once, column by column: what each has of its own are a number, a column, a place and a feed.
        """
        pattern, here = self._pattern, self._coordinates
        if pattern is None or not self._holds(level):
            return []
        rows = _ROW.findall(level.program.lines(level.place, min(most, level.left, _LONGEST)))
        if rows and rows[-1][-1]:
            rows.pop()  # what is not plain
        if not rows:
            return []
        heads, numbers, *texts, feeds, _ = zip(*rows, strict=True)
        axes = [_filled(*one) for one in zip(texts, here.program_position, here.position, self._added, strict=False)]
        rest = zip(here.program_position[len(axes) :], here.position[len(axes) :], strict=True)
        columns = [*axes, *((repeat(goal), repeat(end)) for goal, end in rest)]
        goals, ends = (list(zip(*places, strict=False)) for places in zip(*columns, strict=True))
        starts = [here.position, *ends[:-1]]
        lengths = list(map(math.dist, starts, ends))
        made: list[PathBlock] = []
        for head, number, feed, start, end, goal, length_mm in zip(
            heads, numbers, feeds, starts, ends, goals, lengths, strict=True
        ):
            if length_mm <= NEAR_MM:
                break
            if feed and float(feed) != self._targets.feed_mm_min:
                self._targets.feed_mm_min = float(feed)
                in_force, mm_min = self._output.in_force(None), None if pattern.rapid else float(feed)
                self._pattern = pattern = pattern.like(feed_mm_min=mm_min, in_force=in_force)
            made.append(
                pattern.like(
                    number=int(number),
                    column=len(head) + 1,  # of the first axis, from 1
                    start=start,
                    elements=(straight(start, end, length_mm),),
                    target=goal,
                )
            )
        if made:
            level.pass_over(len(made))
            moved = [axis for axis, column in enumerate(texts) if any(column[: len(made)])]
            here.arrive(ends[len(made) - 1], goals[len(made) - 1], moved)
        return made

    def _holds(self, level: Level) -> bool:
        here = self._coordinates
        return (
            level is self._level
            and here.modal is self._modal
            and here.frame is self._frame
            and self._parameters.revision == self._revision
        )


def _filled(texts: Sequence[str], goal: float, end: float, added: Sequence[float]) -> tuple[list[float], list[float]]:
    """Coordinates of one axis at the end of each block, in the program and in the machine. texts: the programmed ones,
    empty where the axis stays; goal, end: before the first."""
    goals, ends = [], []
    for text in texts:
        if text:
            goal = end = float(text)
            for addition in added:
                end += addition
        goals.append(goal)
        ends.append(end)
    return goals, ends


def _shifts(frame: Frame) -> bool:
    """True if each axis of the machine is one of the program and some additions."""
    turned = frame.rotation is not None or frame.mirror_first or frame.mirror_second or frame.senses is not None
    return not turned and frame.order == tuple(range(frame.axes))


def _additions(frame: Frame) -> tuple[tuple[float, ...], ...]:
    """For each axis, what `Frame.machine` adds to it, in order; of zeros one, which matters to -0.0 alone."""
    added = zip(frame.correction, frame.shift, frame.zero, frame.plane_length, strict=True)
    return tuple((0.0, *(value for value in values if value)) for values in added)
