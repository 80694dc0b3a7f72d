"""Plain blocks, `N120 X10.5 Y-3 Z0.2 F900`, on a short way: most of what CAM programs have.

What such a block comes to differs from the plain block before it only by number, column, place and feed, as long as
nothing else has happened. So the first one of a run goes the way of all blocks (interpreter.py) and is the pattern of
those that follow, to the bit:

    general   plain block ---> learn ---> pattern
    short     plain block ---> next  ---> PathBlock       same level, G functions, frame, parameters; no circle, no G91
              anything else ------------> general way     forgets the pattern
"""

from __future__ import annotations

import math
import re
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
_PLAIN = re.compile(rf"N(\d{{1,10}}) *(?:X{_NUMBER} *)?(?:Y{_NUMBER} *)?(?:Z{_NUMBER} *)?(?:F{_NUMBER})?")
_LETTERS: Final = "XYZ"  # of the first three axes
_FIRST_AXIS: Final = 2  # its group in _PLAIN


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

    def learn(self, level: Level, block: ProgramBlock, made: PathBlock) -> None:
        """Take a block of this level as the pattern if it is plain. made: what it has come to."""
        here, modal = self._coordinates, self._coordinates.modal
        if (
            made.elements
            and _PLAIN.fullmatch(block.text)
            and modal.motion in (G.RAPID, G.LINE)
            and modal.dimension == G.ABSOLUTE
            and modal.polar == G.POLAR_OFF
            and modal.radius == G.RADIUS_OFF
            and _shifts(here.frame)
            and all(here.names.get(letter) == axis for axis, letter in enumerate(_LETTERS))
        ):
            self._pattern, self._level, self._modal, self._frame = made, level, modal, here.frame
            self._revision, self._added = self._parameters.revision, _additions(here.frame)

    def next(self, level: Level) -> PathBlock | None:
        """Take the next block of this level; None, and nothing is taken, if it must go the way of all blocks."""
        pattern, here = self._pattern, self._coordinates
        if pattern is None or not self._holds(level):
            return None
        words = _PLAIN.fullmatch(level.program.line(level.place))
        if words is None:
            return None
        number, *axes, f = words.groups()
        goal, end = list(here.program_position), list(here.position)
        moved = [axis for axis, text in enumerate(axes) if text is not None]
        for axis in moved:
            goal[axis] = place = float(axes[axis])
            for addition in self._added[axis]:
                place += addition
            end[axis] = place
        start, there = here.position, tuple(end)
        length_mm = math.dist(start, there)
        if length_mm <= NEAR_MM:
            return None
        if f is not None and (feed := float(f)) != self._targets.feed_mm_min:
            self._targets.feed_mm_min = feed
            self._pattern = pattern = pattern.like(
                feed_mm_min=None if pattern.rapid else feed, in_force=self._output.in_force(None)
            )
        level.place += 1
        here.arrive(there, tuple(goal), moved)
        return pattern.like(
            number=int(number),
            column=words.start(moved[0] + _FIRST_AXIS),  # of its letter, from 1
            start=start,
            elements=(straight(start, there, length_mm),),
            target=here.program_position,
        )

    def _holds(self, level: Level) -> bool:
        here = self._coordinates
        return (
            level is self._level
            and here.modal is self._modal
            and here.frame is self._frame
            and self._parameters.revision == self._revision
        )


def _shifts(frame: Frame) -> bool:
    """True if each axis of the machine is one of the program and some additions."""
    turned = frame.rotation is not None or frame.mirror_first or frame.mirror_second or frame.senses is not None
    return not turned and frame.order == tuple(range(frame.axes))


def _additions(frame: Frame) -> tuple[tuple[float, ...], ...]:
    """For each axis, what `Frame.machine` adds to it, in order; of zeros one, which matters to -0.0 alone."""
    added = zip(frame.correction, frame.shift, frame.zero, frame.plane_length, strict=True)
    return tuple((0.0, *(value for value in values if value)) for values in added)
