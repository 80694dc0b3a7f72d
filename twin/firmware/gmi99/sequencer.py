"""Order: commands of the host and of programs one after the other, with barriers where motion must have ended.

    next command (queue.py) ---> move, (F)   planned at once after the present plan
                                 any other   a barrier: waits until nothing moves, then it is carried out

There is room for 100 moves and 100 others. Commands after `p3;100` are recorded instead of carried out.
"""

from __future__ import annotations

from isel_twin.firmware.gmi99 import images
from isel_twin.firmware.gmi99.commands import Kind, command_of
from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError
from isel_twin.firmware.gmi99.programming import Do, Of

MOVES = 100
OTHERS = 100
_NOT_IN_PROGRAMS = "rs"


class Sequencer:
    def __init__(self, card: Card) -> None:
        self._card = card

    def full(self, instruction: Instruction) -> bool:
        waiting = self._card.queue.waiting
        moves = sum(entry.is_move for _, entry in waiting)
        if instruction.is_move:
            return moves + self._card.interpolator.host_moves >= MOVES
        return len(waiting) - moves >= OTHERS

    def put(self, data: bytes, instruction: Instruction) -> None:
        if _is_p(instruction, Of.PROGRAM) and instruction.p2 in (Do.BEGIN, Do.END):
            self._card.queue.recording = instruction.p2 == Do.BEGIN
        self._card.queue.waiting.append((data, instruction))

    def put_drive(self, slot: int, *, run: bool) -> None:
        """Zero or reference a drive for the host; ignored while anything is in progress."""
        if not self._card.busy:
            self._card.queue.start(self._card.drives.make_ready(1 << slot, run=run, indexer=False))

    def pump(self) -> None:
        while self._step():
            pass

    def _step(self) -> bool:
        """Do the next thing; False if it must wait."""
        card, queue = self._card, self._card.queue
        if queue.in_progress:
            due = queue.due
            if due:
                queue.go_on()
            return due
        if queue.at_end:
            return self._return()
        entry = queue.peek()
        if entry is None:
            return False
        data, instruction = entry
        if card.store.recording is not None and not card.in_program:
            queue.take()
            self._record(data, instruction)
            return True
        kind = command_of(instruction).kind(instruction)
        if kind in (Kind.MOVE, Kind.SYNCHRONOUS):
            full = card.in_program and card.interpolator.moves >= MOVES
            if full or card.interpolator.breaking or not card.drives.at_rest:
                return False
            queue.take()
            if kind is Kind.MOVE and not card.drives.ready:
                card.refuse("a move while the indexer is not ready")
            elif kind is Kind.SYNCHRONOUS and instruction.code == ord("p"):  # outputs switch at their place in the path
                card.interpolator.on_the_way(lambda: self._begin(instruction))
            else:
                self._begin(instruction)
            return True
        if not card.interpolator.at_rest or not card.drives.at_rest or card.images.flag(images.SYNCHRONISATION):
            return False
        queue.take()
        self._begin(instruction)
        return True

    def _return(self) -> bool:
        """Return from a program to its caller; the main program ends after its last motion."""
        card = self._card
        if card.queue.depth == 1 and not (card.interpolator.at_rest and card.drives.at_rest):
            return False
        card.queue.close()
        return True

    def _record(self, data: bytes, instruction: Instruction) -> None:
        card = self._card
        of_program = _is_p(instruction, Of.PROGRAM)
        if of_program and instruction.p2 == Do.END:
            card.store.end()
            card.keep(programs=card.store.kept)
        elif (
            chr(instruction.code) in _NOT_IN_PROGRAMS
            or _is_p(instruction, Of.PLC)
            or (of_program and instruction.p2 == Do.BEGIN)
        ):
            card.store.error = True
        elif not card.store.record(data, instruction):
            card.queue.recording = False

    def _begin(self, instruction: Instruction) -> None:
        try:
            steps = command_of(instruction).run(self._card, instruction)
        except OutOfRangeError as error:
            self._card.refuse(str(error))
            return
        if steps is not None:
            self._card.queue.start(steps)


def _is_p(instruction: Instruction, of: Of) -> bool:
    return instruction.code == ord("p") and instruction.p1 == of
