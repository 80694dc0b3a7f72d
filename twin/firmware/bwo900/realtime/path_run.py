"""The path in execution: goes from block to block, appends analysed blocks, brakes, is given up.

waiting blocks (ahead.py) --> joining.py --> stretch.py --> set points
                                ^ override, safety stop: scale      ^ M26, M function with a jump: cut
"""

from __future__ import annotations

from dataclasses import replace
from enum import Flag
from typing import Final

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import byte
from isel_twin.firmware.bwo900.realtime.ahead import REFILL, Ahead
from isel_twin.firmware.bwo900.realtime.joining import breaks_after, joining
from isel_twin.firmware.bwo900.realtime.length import add_length
from isel_twin.firmware.bwo900.realtime.path import MINUTE_S
from isel_twin.firmware.bwo900.realtime.spindle import LOOK_NS
from isel_twin.firmware.bwo900.realtime.stretch import Stretch
from isel_twin.firmware.bwo900.realtime.surroundings import Surroundings, enter, mute, send, speak

STANDS_S: Final = 1.0 / MINUTE_S  # revolutions a second below which a spindle stands
FINENESS: Final = 1e-3  # part of its speed by which a spindle must change for the path to be planned anew


class Cut(Flag):
    """Why the rest of the present block's path is given up."""

    NONE = 0
    JUMP = 1  # its M function with a jump was acknowledged in time
    SIGNAL = 2  # M26: a signal deletes it


class PathRun:
    """Runs one stretch after the other; the channel begins and ends them."""

    def __init__(self, interpreter: Interpreter, ahead: Ahead, around: Surroundings) -> None:
        self._interpreter, self._ahead, self._around = interpreter, ahead, around
        self._axes = around.axes
        self.stretch = Stretch()
        self.cut = Cut.NONE
        self.override = 1.0
        self.locked = False  # P8701, P8702: the axes may not move
        self._turns_s = 1.0  # revolutions a second that the feed of the stretch is reckoned with (G95)
        self._followed = 0.0  # those that it follows now

    @property
    def next_ns(self) -> int:
        """Next due time while set points are made."""
        now_ns, poll_ns = self._axes.now_ns, self._ahead.poll_ns
        next_ns = self.stretch.next_ns(now_ns, None if self._ahead.ended else REFILL)
        if self.per_turn:
            next_ns = min(next_ns, now_ns + LOOK_NS)
        if poll_ns is not None and not self.stretch.held:  # analysis waits while the axes do
            next_ns = min(next_ns, poll_ns)
        return max(next_ns, now_ns)

    @property
    def over(self) -> bool:
        return self.stretch.over(self._axes.now_ns)

    @property
    def scale(self) -> float:
        """The override for the present or the next path."""
        if any(map(self._axes.bars, self.stretch.blocks)):
            return 0.0
        waiting = self._ahead.blocks
        return self._scale_of(self.stretch.first or (waiting[0] if waiting else None))

    def _scale_of(self, block: PathBlock | None) -> float:
        scale = 0.0 if self.locked else 1.0 if block is not None and not block.override else self.override
        if block is None or not block.per_turn or self._test_feed:
            return scale
        return scale * self._turning / self._turns_s

    @property
    def per_turn(self) -> bool:
        """True if the feed of the present path counts by the turns of the spindle."""
        first = self.stretch.first
        return first is not None and first.per_turn

    @property
    def _test_feed(self) -> bool:
        return self._axes.limits().test_feed is not None

    @property
    def _turning(self) -> float:
        """Measured revolutions a second; 0 for a spindle that stands."""
        turning = abs(self._around.spindle.measured) / MINUTE_S
        return turning if turning >= STANDS_S else 0.0

    def follow_spindle(self) -> None:
        """G95, tapping: the feed follows the measured speed (bwo900/82, bwo900/84)."""
        if self.per_turn and abs(self._turning - self._followed) > FINENESS * self._turns_s:
            self._followed = self._turning
            self.rescale()

    def begin(self) -> None:
        """A stretch begins with the first of the waiting blocks. Raises ProgramError, about that block."""
        limits = self._axes.limits()
        chosen = joining(self._ahead.blocks, None, self._around)
        if chosen[0].per_turn:
            self._turns_s, self._followed = max(abs(self._around.spindle.wanted) / MINUTE_S, STANDS_S), self._turning
            limits = replace(limits, turns_s=self._turns_s)
        try:
            self.stretch.begin(chosen, limits, self._scale_of(chosen[0]), self._axes.now_ns)
        except ProgramError as error:
            raise _about(chosen[0], error) from None

    def pass_on(self) -> None:
        """Finish blocks whose path has been made, and begin the next ones."""
        for over, block, began_ns in self.stretch.passed(self._axes.now_ns):
            add_length(self._around.parameters, over)
            send(self._around, over.post)
            enter(self._around, block, began_ns)
            speak(self._around, block)

    def extend(self, *, holds: bool) -> bool:
        """Analyse further and append joining blocks, unless the channel is to hold; return True if a message asks to
        hold. Raises ProgramError about the first block to append."""
        stretch, ahead = self.stretch, self._ahead
        is_open = not holds and self._is_open()
        if not ahead.ended and not stretch.held and (ahead.poll_ns is not None or (is_open and len(stretch) <= REFILL)):
            if ahead.fill(len(stretch)):
                return True
            is_open = not holds and self._is_open()
        if ahead.blocks and is_open and not stretch.held:
            chosen = joining(ahead.blocks, stretch.last, self._around)
            try:
                if chosen:
                    stretch.append(chosen, self._axes.now_ns)
            except ProgramError as error:
                raise _about(chosen[0], error) from None
        return False

    def _is_open(self) -> bool:
        last = self.stretch.last
        return last is not None and not breaks_after(last, self._around)

    def finish(self) -> PathBlock | None:
        """At the end of the set points: the last block, whose path has been made or given up; None: it was held."""
        return self.stretch.finish(gives_up=bool(self.cut))

    def hold(self, wanted: bool) -> None:
        self.stretch.replan(self._axes.now_ns, hold=wanted)

    def rescale(self) -> None:
        sharpness = self._axes.path_sharpness(self.stretch.blocks)
        self.stretch.replan(self._axes.now_ns, scale=self.scale, sharpness=sharpness)

    def resume(self) -> None:
        self.stretch.resume(self.scale, self._axes.now_ns)

    def set_feed(self, mm_min: float) -> None:
        """P8817: another feed for the rest of the present block, in its unit; 0 and less: none. Rapids have no feed."""
        block = self.stretch.first
        if mm_min > 0.0 and block is not None and not block.rapid:
            speed = mm_min * self._turns_s if block.per_turn else mm_min / MINUTE_S
            self.stretch.hasten(speed, self._axes.now_ns)

    def give_up(self) -> bool:
        """Check for signals that delete the present block's path; True: the channel has nothing else to do now."""
        around, block = self._around, self.stretch.first
        if block is None:
            return False
        if has_jump(block) and not self.cut & Cut.JUMP and not mute(around) and around.plc.idle:
            if self._interpreter.waiting is Waiting.ACKNOWLEDGEMENT:
                self.cut |= Cut.JUMP
                self._drop()
                around.deletion.keep()
            return True
        if block.watched and not self.cut & Cut.SIGNAL and around.deletion.deletes(block):
            self.delete()
            self._drop()
            return True
        return False

    def delete(self) -> None:
        """Delete the path of a block with M26."""
        self.cut |= Cut.SIGNAL
        self._around.deletion.deleted()

    def _drop(self) -> None:
        """Brake and drop the rest of the path; after a signal without ramps if byte 2 of P8855 wants that."""
        display = byte(self._around.parameters.get(P.MEASURED_DISPLAY), 2)
        sharpness = self._axes.sharp(bool(display) and bool(self.cut & Cut.SIGNAL))
        self.stretch.replan(self._axes.now_ns, hold=True, drop=True, sharpness=sharpness)

    def stand(self) -> None:
        self.stretch.stand(self._axes.limits(), self._axes.position)

    def begin_anew(self) -> None:
        """After a deleted path: the next one begins at the present position, as the first of all."""
        self._interpreter.stand(self._axes.position)
        self.stand()
        self._ahead.renew_filters()


def has_jump(block: PathBlock) -> bool:
    return any(function.jump for function in block.pre)


def _about(block: PathBlock, error: ProgramError) -> ProgramError:
    return error.at(block.program, block.number, block.column)
