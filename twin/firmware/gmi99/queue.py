"""Order: what the host sent and what programs say, one after the other, with barriers where motion must have ended.

    host ---> queue of 100 moves and 100 others ---+
    program, its subprograms (store.py) -----------+---> next command
                                                            move, (F)   planned at once behind what is planned already
                                                            any other   a barrier: when nothing moves, then it is done,
                                                                        then the next

While a program runs its commands come first; what the host has sent waits. Commands behind `p3;100` are recorded in
their turn instead of being carried out.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from dataclasses import dataclass

from isel_twin.firmware.gmi99 import images
from isel_twin.firmware.gmi99.board import Board
from isel_twin.firmware.gmi99.commands import Kind, command_of
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError
from isel_twin.firmware.gmi99.programming import BEGIN, END, PROGRAM
from isel_twin.firmware.gmi99.store import DEPTH
from isel_twin.firmware.gmi99.waiting import Wait

MOVES = 100
OTHERS = 100
_NOT_IN_PROGRAMS = "rs"


@dataclass
class _Running:
    """A program and where it is."""

    commands: tuple[Instruction, ...]
    next: int = 0


class Queue:
    """See the module."""

    def __init__(self, card: Board) -> None:
        self._card = card
        self._entries: deque[tuple[bytes, Instruction]] = deque()
        self._programs: list[_Running] = []
        self._current: Generator[Wait, None, None] | None = None
        self._wait = Wait()
        self._going = False
        """The command in progress is being gone on with now: what it does itself may drop it."""
        self.recording = False
        """What the host sends now is recorded in its turn."""

    # ---- what there is to see ---------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """A command waits or is being carried out, or a program runs."""
        return bool(self._entries or self._programs or self._current is not None)

    @property
    def in_program(self) -> bool:
        """A program runs."""
        return bool(self._programs)

    @property
    def block_number(self) -> int:
        """Number of the command of the program that was begun last, from 1 on (FB 254.6); 0 without a program."""
        return self._programs[-1].next if self._programs else 0

    @property
    def next_ns(self) -> int | None:
        """When the command in progress is gone on with."""
        return self._wait.at_ns if self._current is not None else None

    def full(self, instruction: Instruction) -> bool:
        """There is no room for this command."""
        moves = sum(entry.is_move for _, entry in self._entries)
        if instruction.is_move:
            return moves + self._card.path.host_moves >= MOVES
        return len(self._entries) - moves >= OTHERS

    # ---- what comes in ----------------------------------------------------------------------------------------------

    def put(self, data: bytes, instruction: Instruction) -> None:
        """A command of the host that there is room for."""
        if instruction.code == ord("p") and instruction.p1 == PROGRAM and instruction.p2 in (BEGIN, END):
            self.recording = instruction.p2 == BEGIN
        self._entries.append((data, instruction))

    def put_drive(self, slot: int, *, run: bool) -> None:
        """The host tells a drive, through the card, to take its place for zero or to make a reference run; not heard
        while anything is under way."""
        if not self._card.busy:
            self._current = self._card.drives.make_ready(1 << slot, run=run, indexer=False)
            self._go_on()

    def call(self, number: int) -> None:
        """p3;1: start a program, or go on with it as a subprogram."""
        card = self._card
        commands = card.store.program(number)
        if not self._programs:
            card.images.flags[images.PROGRAM_NUMBER] = number
        if not commands:
            card.store.error = True
            card.refuse(f"program {number} is empty")
            return
        if len(self._programs) > DEPTH:
            card.store.error = True
            card.refuse(f"program {number} is called {DEPTH + 1} deep")
            card.abort()
            return
        if not self._programs:
            card.images.set_flag(images.PROGRAM_ENDED, False)
            card.images.set_flag(images.PROGRAM_RUNS, True)
        self._programs.append(_Running(commands))

    def leave(self) -> None:
        """p3;2: end the program that contains it."""
        if self._programs:
            self._programs[-1].next = len(self._programs[-1].commands)

    def drop(self) -> None:
        """Everything that waits is forgotten, what is being carried out is closed, a program or a recording ends."""
        self._entries.clear()
        if self._programs:
            self._programs.clear()
            self._card.images.set_flag(images.PROGRAM_RUNS, False)
        current, self._current, self._wait = self._current, None, Wait()
        if current is not None and not self._going:
            current.close()
        if self.recording or self._card.store.recording is not None:
            self.recording = False
            self._card.store.forget()

    # ---- going on ---------------------------------------------------------------------------------------------------

    def pump(self) -> None:
        """Carry out whatever can be carried out now."""
        while self._step():
            pass

    def _step(self) -> bool:
        card = self._card
        if self._current is not None:
            due = self._wait.at_ns is not None and self._wait.at_ns <= card.now_ns
            return (due or self._wait.until()) and self._go_on()
        if self._programs and self._programs[-1].next == len(self._programs[-1].commands):
            return self._return()
        entry = self._peek()
        if entry is None:
            return False
        data, instruction = entry
        if card.store.recording is not None and not self._programs:
            self._take()
            self._record(data, instruction)
            return True
        kind = command_of(instruction).kind(instruction)
        if kind is Kind.MOVE or kind is Kind.SYNCHRONOUS:
            if not card.path.accepts or not card.drives.at_rest or (self._programs and card.path.moves >= MOVES):
                return False
            self._take()
            if kind is Kind.MOVE and not card.drives.ready:
                card.refuse("a move while the indexer is not ready")
            elif kind is Kind.SYNCHRONOUS and instruction.code == ord("p"):  # outputs switch where they stand
                card.path.on_the_way(lambda: self._begin(instruction))
            else:
                self._begin(instruction)
            return True
        if not card.path.at_rest or not card.drives.at_rest or card.images.flag(images.SYNCHRONISATION):
            return False
        self._take()
        self._begin(instruction)
        return True

    def _peek(self) -> tuple[bytes, Instruction] | None:
        if self._programs:
            running = self._programs[-1]
            return b"", running.commands[running.next]
        return self._entries[0] if self._entries else None

    def _take(self) -> None:
        if self._programs:
            self._programs[-1].next += 1
        else:
            self._entries.popleft()

    def _return(self) -> bool:
        """A program has ended: go on with its caller, or be through when the last motion has ended."""
        card = self._card
        if len(self._programs) > 1:
            self._programs.pop()
            return True
        if not card.path.at_rest or not card.drives.at_rest:
            return False
        self._programs.pop()
        card.images.set_flag(images.PROGRAM_RUNS, False)
        card.images.set_flag(images.PROGRAM_ENDED, True)
        return True

    def _record(self, data: bytes, instruction: Instruction) -> None:
        card = self._card
        is_p = instruction.code == ord("p")
        if is_p and instruction.p1 == PROGRAM and instruction.p2 == END:
            card.store.end()
            card.keep(programs=card.store.kept)
        elif (
            chr(instruction.code) in _NOT_IN_PROGRAMS
            or (is_p and instruction.p1 == 1)
            or (is_p and instruction.p1 == PROGRAM and instruction.p2 == BEGIN)
        ):
            card.store.error = True
        elif not card.store.record(data, instruction):
            self.recording = False

    def _begin(self, instruction: Instruction) -> None:
        try:
            steps = command_of(instruction).run(self._card, instruction)
        except OutOfRangeError as error:
            self._card.refuse(str(error))
            return
        if steps is not None:
            self._current = steps
            self._go_on()

    def _go_on(self) -> bool:
        current = self._current
        assert current is not None
        self._going = True
        try:
            wait = next(current)
        except StopIteration:
            if self._current is current:
                self._current, self._wait = None, Wait()
        except OutOfRangeError as error:
            self._current, self._wait = None, Wait()
            self._card.refuse(str(error))
        else:
            self._wait = wait
            if self._current is not current:  # dropped by what it did itself
                current.close()
        finally:
            self._going = False
        return True
