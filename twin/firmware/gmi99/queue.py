"""Waiting commands of the host, programs in progress, and the command in progress.

    host ---> queue of commands ---------+
    program, its subprograms ------------+---> next command (sequencer.py)

While a program runs its commands come first; commands of the host wait.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from dataclasses import dataclass

from isel_twin.firmware.gmi99 import images
from isel_twin.firmware.gmi99.board import Board
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError
from isel_twin.firmware.gmi99.waiting import Wait


@dataclass
class _Running:
    commands: tuple[Instruction, ...]
    next: int = 0


class Queue:
    def __init__(self, board: Board) -> None:
        self._board = board
        self.waiting: deque[tuple[bytes, Instruction]] = deque()  # commands of the host, each with its bytes
        self._programs: list[_Running] = []  # the main program and the subprograms open in it
        self._current: Generator[Wait, None, None] | None = None
        self._wait = Wait()
        self._going = False  # the command in progress is running now: it may drop itself
        self.recording = False  # commands of the host are recorded in their turn

    @property
    def busy(self) -> bool:
        return bool(self.waiting or self._programs or self._current is not None)

    @property
    def depth(self) -> int:
        """Programs open: 0 without one, 1 in the main program."""
        return len(self._programs)

    @property
    def block_number(self) -> int:
        """Number of the program's last begun command, from 1 (FB 254.6); 0 without a program."""
        return self._programs[-1].next if self._programs else 0

    @property
    def next_ns(self) -> int | None:
        """When the command in progress continues."""
        return self._wait.at_ns if self._current is not None else None

    def peek(self) -> tuple[bytes, Instruction] | None:
        """The next command, with its bytes if it is the host's."""
        if self._programs:
            running = self._programs[-1]
            return b"", running.commands[running.next]
        return self.waiting[0] if self.waiting else None

    def take(self) -> None:
        if self._programs:
            self._programs[-1].next += 1
        else:
            self.waiting.popleft()

    def enter(self, commands: tuple[Instruction, ...]) -> None:
        """Begin a program, as a subprogram if one runs."""
        if not self._programs:
            self._board.images.set_flag(images.PROGRAM_ENDED, False)
            self._board.images.set_flag(images.PROGRAM_RUNS, True)
        self._programs.append(_Running(commands))

    def leave(self) -> None:
        """p3;2: skip the rest of its program."""
        if self._programs:
            self._programs[-1].next = len(self._programs[-1].commands)

    @property
    def at_end(self) -> bool:
        return bool(self._programs) and self._programs[-1].next == len(self._programs[-1].commands)

    def close(self) -> None:
        self._programs.pop()
        if not self._programs:
            self._board.images.set_flag(images.PROGRAM_RUNS, False)
            self._board.images.set_flag(images.PROGRAM_ENDED, True)

    def drop(self) -> None:
        """Drop everything that waits, close the command in progress, end programs and a recording."""
        self.waiting.clear()
        if self._programs:
            self._programs.clear()
            self._board.images.set_flag(images.PROGRAM_RUNS, False)
        current, self._current, self._wait = self._current, None, Wait()
        if current is not None and not self._going:
            current.close()
        if self.recording or self._board.store.recording is not None:
            self.recording = False
            self._board.store.forget()

    @property
    def in_progress(self) -> bool:
        return self._current is not None

    @property
    def due(self) -> bool:
        due = self._wait.at_ns is not None and self._wait.at_ns <= self._board.now_ns
        return due or self._wait.until()

    def start(self, steps: Generator[Wait, None, None]) -> None:
        self._current = steps
        self.go_on()

    def go_on(self) -> None:
        """Continue the command in progress up to its next wait."""
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
            self._board.refuse(str(error))
        else:
            self._wait = wait
            if self._current is not current:  # it has dropped itself
                current.close()
        finally:
            self._going = False
