"""Jobs: lines become stored commands, which are carried out one after the other (5.2), with pause, halt and clear.

line ---> receive queue ---> job memory ---released---> the command in progress ---> 02h when its job is over
          no room: waits     wrong: its job is invalid  fails: its job is dropped
                                                        @A pause, @C continue, @B halt it, @S stop all
"""

from __future__ import annotations

from collections.abc import Callable

from isel_twin.firmware.activity import Unfinished
from isel_twin.firmware.ismif.actions import Actions, Failure, Standing, failed
from isel_twin.firmware.ismif.commands import LINE_LIMIT, CommandError, Instruction, parse
from isel_twin.firmware.ismif.memory import ROOM, Entry, JobMemory, ReceiveQueue

ACKNOWLEDGED, READY, FULL = b"", b"\x02", b"\x03"  # replies, each with its CR


class Halted(Unfinished):
    """The host has ended the command in progress (6.15)."""


class Jobs:
    """Stores and carries out commands; `reply(data)` sends a reply and its CR to the host."""

    def __init__(self, actions: Actions, reply: Callable[[bytes], None]) -> None:
        self.error = ""
        """Third character of the status: what has gone wrong first since the last reset."""
        self.paused = False
        self._actions = actions
        self._executor = actions.executor
        self._reply = reply
        self._memory = JobMemory()
        self._waiting_lines = ReceiveQueue()
        self._void = False
        self._told_full = False
        self._entry: Entry | None = None

    def receive(self, line: bytes, starts: bool) -> None:
        """Take a line without its end that is no master command; `starts`: it came with 01h."""
        if line or starts:
            if not self._waiting_lines.append(line, starts):
                self.go_wrong("lines have come faster than they are taken")
            self._store_lines()

    def _store_lines(self) -> None:
        """Move lines to the memory while they fit; others stay in the receive queue, unanswered (ismif/2)."""
        while self._waiting_lines:
            line, starts = self._waiting_lines.head
            if line is None:
                self._waiting_lines.take()
                self._void_job("a line that has found no room")
                continue
            if len(line) + 1 > self._memory.free:
                return
            self._waiting_lines.take()
            command = self._checked(line)
            if command is not None or starts:
                self._memory.store(Entry(command, len(line) + 1, starts))
            full = self._memory.full
            self._void &= not starts
            self._told_full |= full
            if starts or full:
                self._memory.release()
            if line:
                self._reply(FULL if full else ACKNOWLEDGED)

    def _checked(self, line: bytes) -> Instruction | None:
        """The command to store; None for an empty line and in an invalid job. A wrong command makes its job invalid
        (ismif/1)."""
        command = None
        try:
            command = read(line) if line else None
        except CommandError as error:
            self._void_job(str(error))
        return None if self._void else command

    def go_wrong(self, why: str) -> None:
        """Set the third character of the status."""
        self.error = self.error or why

    def _void_job(self, why: str) -> None:
        """Drop the stored part of the job in reception, and ignore the rest up to its 01h (ismif/1)."""
        self.go_wrong(why)
        self._void = True
        self._memory.drop_stored()

    def work(self) -> None:
        """Carry out commands until one takes time or none is left."""
        while not self.paused:
            if self._executor.parked is not None:
                self._executor.resume()
            elif self._executor.busy:
                return
            elif self._entry is not None:
                ended, self._entry = self._entry, None
                if ended.ends_job:
                    self._reply(READY)
            elif self._memory.released:
                self._begin_command(self._memory.take())
            else:
                return

    def _begin_command(self, entry: Entry) -> None:
        self._entry = entry
        self._use_room()
        activity = None if entry.command is None else self._actions.carry_out(entry.command)
        if activity is not None:
            self._executor.start(activity, self._ended)

    def _use_room(self) -> None:
        """After commands have left the memory: take waiting lines, or tell the host that there is room."""
        self._store_lines()
        if self._told_full and self._memory.free >= ROOM:
            self._told_full = False
            self._reply(READY)

    def _ended(self, reason: Unfinished | None) -> None:
        """Note the end of the activity in progress; `work` ends the command."""
        if isinstance(reason, Failure):
            self._fail(str(reason))

    def _fail(self, why: str) -> None:
        """Drop the rest of a job that cannot be carried out, in the memory and still to come (ismif/1)."""
        self.go_wrong(why)
        while self._entry is not None and not self._entry.ends_job and self._memory.released:
            self._entry = self._memory.take()
        if self._entry is not None and self._entry.ends_job:
            self._entry = Entry(None, 0, ends_job=True)
        else:  # a full memory started the job: its 01h is still to come and gets the 02h
            self._entry = None
            self._void_job(why)
        self._use_room()

    def pause(self) -> None:
        """6.17: ramp down to rest; a waiting time is also interrupted (ismif/10)."""
        if not self.paused:
            self.paused = True
            self._executor.park(self._stands)
            self._actions.settle()

    def _stands(self) -> None:
        """At the beginning of the pause: a search that reached its end while slowing down has failed."""
        if self._executor.parked is not None and failed(self._executor.parked):
            self._executor.resume()

    def go_on(self) -> None:
        """6.18."""
        self.paused = False

    def halt(self) -> None:
        """6.15: end this motion and go on with the next command. A waiting time is no motion and goes on."""
        if self._actions.purpose is Standing.WAITING:
            return
        self._executor.forget()
        self._executor.break_off(Halted())
        self._actions.settle()

    def clear(self) -> None:
        """6.16: drop every job and end a pause; the error character stays."""
        self.paused = False
        self._entry = None
        self._memory.clear()
        self._waiting_lines.clear()
        self._void = self._told_full = False

    @property
    def referencing(self) -> bool:
        return self._entry is not None and self._entry.command is not None and self._entry.command.code == "$H"

    @property
    def in_progress(self) -> bool:
        """True if a released command is not yet carried out."""
        return self._entry is not None or self._memory.released > 0

    @property
    def idle(self) -> bool:
        return self.paused or not (self.in_progress or self._waiting_lines)


def read(line: bytes) -> Instruction:
    """Read a line; one that has reached LINE_LIMIT has lost its end. Raises CommandError."""
    if len(line) >= LINE_LIMIT:
        raise CommandError(f"a line of {LINE_LIMIT} bytes or more")
    return parse(line)
