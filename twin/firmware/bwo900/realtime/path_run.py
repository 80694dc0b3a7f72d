"""The path under way: passes on from block to block, takes in blocks that have been analysed, brakes, is given up.

waiting blocks (ahead.py) --> joining.py --> stretch.py --> set points
                                ^ override, safety stop: scale      ^ M26, M function with a jump: cut
"""

from __future__ import annotations

from enum import Flag

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.realtime.ahead import REFILL, Ahead
from isel_twin.firmware.bwo900.realtime.joining import breaks_after, joining
from isel_twin.firmware.bwo900.realtime.stretch import Stretch
from isel_twin.firmware.bwo900.realtime.surroundings import Surroundings, enter, mute, send, speak


class Cut(Flag):
    """Why the rest of the path of the block in execution is given up."""

    NONE = 0
    JUMP = 1  # its M function with a jump has been acknowledged in time
    SIGNAL = 2  # M26: a signal deletes it


class PathRun:
    """One stretch after the other; the channel decides when one begins and ends."""

    def __init__(self, interpreter: Interpreter, ahead: Ahead, around: Surroundings) -> None:
        self._interpreter, self._ahead, self._around = interpreter, ahead, around
        self._axes = around.axes
        self.stretch = Stretch()
        self.cut = Cut.NONE
        self.override = 1.0
        self.locked = False  # P8701, P8702: the axes may not move

    @property
    def next_ns(self) -> int:
        """When something is due while set points are made."""
        now_ns, poll_ns = self._axes.now_ns, self._ahead.poll_ns
        next_ns = self.stretch.next_ns(now_ns, None if self._ahead.ended else REFILL)
        if poll_ns is not None and not self.stretch.held:  # analysis waits while the axes do
            next_ns = min(next_ns, poll_ns)
        return max(next_ns, now_ns)

    @property
    def over(self) -> bool:
        return self.stretch.over(self._axes.now_ns)

    @property
    def scale(self) -> float:
        """The override, as it counts for the path under way, or for the next one."""
        waiting = self._ahead.blocks
        return self._scale_of(self.stretch.first or (waiting[0] if waiting else None))

    def _scale_of(self, block: PathBlock | None) -> float:
        return 0.0 if self.locked else 1.0 if block is not None and not block.override else self.override

    def begin(self) -> None:
        """A stretch begins with the first of the waiting blocks. Raises ProgramError, about that block."""
        limits = self._axes.limits()
        chosen = joining(self._ahead.blocks, None, self._around)
        try:
            self.stretch.begin(chosen, limits, self._scale_of(chosen[0]), self._axes.now_ns)
        except ProgramError as error:
            raise _about(chosen[0], error) from None

    def pass_on(self) -> None:
        """Blocks whose path has been made are over, and those behind them begin."""
        for over, block, began_ns in self.stretch.passed(self._axes.now_ns):
            send(self._around, over.post)
            enter(self._around, block, began_ns)
            speak(self._around, block)

    def extend(self, *, holds: bool) -> bool:
        """Analyse further and append what joins, unless the channel is to hold; True: a message asks it to. Raises
        ProgramError, about the first block that was to be appended."""
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
        """The set points have ended: the last block, whose path has been made or is given up; None: it was held."""
        return self.stretch.finish(gives_up=bool(self.cut))

    def hold(self, wanted: bool) -> None:
        self.stretch.replan(self._axes.now_ns, hold=wanted)

    def rescale(self) -> None:
        self.stretch.replan(self._axes.now_ns, scale=self.scale)

    def resume(self) -> None:
        self.stretch.resume(self.scale, self._axes.now_ns)

    def set_feed(self, mm_min: float) -> None:
        """P8817: another feed for what is left of the block in execution; 0 and less: none. Rapid has no feed."""
        block = self.stretch.first
        if mm_min > 0.0 and block is not None and not block.rapid:
            self.stretch.hasten(mm_min / 60.0, self._axes.now_ns)

    def give_up(self) -> bool:
        """Look for what deletes the path of the block in execution; True: the channel has nothing else to do now."""
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
        """A signal deletes the path of the block with M26."""
        self.cut |= Cut.SIGNAL
        self._around.deletion.deleted()

    def _drop(self) -> None:
        """Brake; what is left of the path is not made."""
        self.stretch.replan(self._axes.now_ns, hold=True, drop=True)

    def stand(self) -> None:
        self.stretch.stand(self._axes.limits(), self._axes.position)

    def begin_anew(self) -> None:
        """A path has been deleted: the next one begins where the axes stand, without corrections of the one before."""
        self._interpreter.stand(self._axes.position)
        self.stand()
        self._ahead.renew_filters()


def has_jump(block: PathBlock) -> bool:
    return any(function.jump for function in block.pre)


def _about(block: PathBlock, error: ProgramError) -> ProgramError:
    return error.at(block.program, block.number, block.column)
