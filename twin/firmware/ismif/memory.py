"""The iSMIF's job memory: 64 KB of commands that wait for their start; and the lines that wait for room in it. It is a
queue (section 5.2): commands enter at the tail with their length on the line, and leave at the head when they are
carried out. Only *released* ones may leave: 01h releases everything stored so far, and so does a full memory.

      head |==========released==========|------stored------|.........free.........|
           next to be carried out                           ^ tail        RESERVE: 03h from here on

`ends_job` marks the command that came with 01h: after it 02h is sent. Lines that do not fit, from a host that ignores
03h, wait in the receive queue; beyond that they are lost.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from isel_twin.firmware.ismif.commands import LINE_LIMIT, Instruction

SIZE = 65_536  # bytes (technical data: 64 KB)
RESERVE = LINE_LIMIT  # free bytes below which the memory is full: the longest command no longer fits (ismif/2)
ROOM = 2 * LINE_LIMIT  # free bytes from which a memory that was full counts as ready again (ismif/2)
QUEUE_SIZE = SIZE  # bytes of lines, each with its end, that may wait for room in the memory (ismif/2)
GAP = (None, False)  # item of the receive queue in place of lines that have been lost


@dataclass(frozen=True)
class Entry:
    """A stored command (None: only the end of a job), its length on the line, and whether a job ends with it."""

    command: Instruction | None
    size: int
    ends_job: bool


class JobMemory:
    def __init__(self) -> None:
        self._entries: deque[Entry] = deque()
        self._used = 0
        self.released = 0
        """Number of commands that may be carried out."""

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def free(self) -> int:
        return SIZE - self._used

    @property
    def full(self) -> bool:
        return self.free < RESERVE

    def store(self, entry: Entry) -> None:
        """Append a command that fits; see `free`."""
        self._entries.append(entry)
        self._used += entry.size

    def release(self) -> None:
        """Everything stored by now may be carried out."""
        self.released = len(self._entries)

    def take(self) -> Entry:
        entry = self._entries.popleft()
        self._used -= entry.size
        self.released -= 1
        return entry

    def drop_stored(self) -> None:
        """Forget the job that has not been released yet."""
        while len(self._entries) > self.released:
            self._used -= self._entries.pop().size

    def clear(self) -> None:
        self._entries.clear()
        self._used = self.released = 0


class ReceiveQueue:
    """At most QUEUE_SIZE bytes of lines. An item is a line without its end, and whether it came with 01h, or a GAP."""

    def __init__(self) -> None:
        self._items: deque[tuple[bytes | None, bool]] = deque()
        self._used = 0

    def __len__(self) -> int:
        return len(self._items)

    @property
    def head(self) -> tuple[bytes | None, bool]:
        return self._items[0]

    def append(self, line: bytes, starts: bool) -> bool:
        """Append a line; False if it does not fit and is lost."""
        fits = self._used + len(line) + 1 <= QUEUE_SIZE
        if fits:
            self._items.append((line, starts))
            self._used += len(line) + 1
        elif self._items[-1] != GAP:
            self._items.append(GAP)
        return fits

    def take(self) -> None:
        line, _ = self._items.popleft()
        if line is not None:
            self._used -= len(line) + 1

    def clear(self) -> None:
        self._items.clear()
        self._used = 0
