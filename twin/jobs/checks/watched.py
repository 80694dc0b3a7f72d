"""A twin under observation: its commands one by one, and the positions meanwhile, for assertions.

    twin --- listen, observe ---> Watched:  commands   text, line of the job, reply, begin, end, margin, losses
                                            samples    time, position of the carriages, every few milliseconds
                                            outputs    when which was switched

An error found at the end can be traced to the moment, the axis and the command in which it began, both for a played job
and for bytes from a host. A command begins with the first byte after a reply, or after the controller was idle; the
rest of an incomplete message belongs to it.
"""

from __future__ import annotations

import math
import os
import warnings
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.jobs.golden import Golden, Scribe
from isel_twin.jobs.job import JobError, Line, check_conditions
from isel_twin.jobs.playing import TIMEOUT_S, Played, played
from isel_twin.jobs.project import cam, find
from isel_twin.jobs.result import Result
from isel_twin.jobs.toolpaths import lines_of, source_of
from isel_twin.jobs.verdict import SETTLE_S, lost
from isel_twin.language import create_language, readable

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

LOOK_S = 0.005  # default virtual time between two samples


@dataclass
class Command:
    """What the host has sent at once, and its outcome."""

    begin_ns: int
    line: int | None = None  # of the job; None: there is no job
    sent: bytes = b""
    reply: bytes = b""
    end_ns: int = 0  # when its last reply arrived; until then, when it began
    margin: tuple[float, ...] = ()  # least pull-out margin of each axis meanwhile; nan for axes without a motor
    lost: dict[str, float] = field(default_factory=dict)  # lost steps of each axis that had none before
    counter_set: bool = False  # a counter was set in it, as by a reference run
    refused: bool = False
    text: str = ""

    def __str__(self) -> str:
        where = "" if self.line is None else f"line {self.line}: "
        return f"{where}{self.text or readable(self.sent)}"


@dataclass(frozen=True)
class JobRun(Played):
    """A job from a file that was played."""

    job: Path
    golden: Golden  # the run, without its call


class Heard(Protocol):
    """What can be heard of a controller, a twin's (`Watched`) or a real one, for the assertions that need no more."""

    begin_ns: int  # what was before is ignored

    @property
    def commands(self) -> list[Command]:
        """All commands since `begin`, in their order."""

    def reply_text(self, command: Command) -> str:
        """Its reply as text."""

    def accepts(self, command: Command) -> bool:
        """True if it was answered and not refused."""

    @property
    def job(self) -> tuple[Sequence[Result], int] | None:
        """The results of the job played since `begin`, and when its last line was over; None: there was no job."""

    def rest(self) -> None:
        """Let the machine come to rest."""

    @property
    def fault_left(self) -> str:
        """The fault in which the controller stands and that the job does not expect; "" for a real one, of which only
        replies are known."""

    @property
    def now_ns(self) -> int: ...

    def overlook(self, what: str) -> bool:
        """True if nobody can look inside the machine; then `what` is noted as not looked at."""


def lines_of_job(job: str | os.PathLike[str], twin: Twin) -> Sequence[Line]:
    """The lines of a job file, for this twin; what a file of a CAM program may mean otherwise is a warning. Raises
    JobError (ValueError) for a job that cannot be played, OSError."""
    __tracebackhide__ = True
    path = Path(job)
    try:
        settings, data = cam(find(path), twin.machine), path.read_bytes()
        language, controller = twin.language, twin.controller_name
        source = source_of(data, path.suffix, language, controller, lambda: twin.machine, settings)
        lines = lines_of(source, data, language, controller)
        check_conditions(lines, twin)
    except JobError as error:
        told = "\n".join([f"{path}: {error}", *([error.excerpt] if error.excerpt else [])])
        raise JobError(told, error.excerpt) from None
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from None
    if not lines:
        raise JobError(f"{path}: there is no command in it")
    for caution in () if source is None else source.cautions:
        warnings.warn(f"{path}: {caution}", stacklevel=3)
    return lines


class Watched:
    """A twin and the record of what it has done since. Only for the thread in which virtual time passes."""

    def __init__(self, twin: Twin, interval_s: float = LOOK_S) -> None:
        """interval_s: virtual time between two samples of the carriages."""
        if not 1e-9 <= interval_s < math.inf:
            raise ValueError(f"interval_s is {interval_s}; give the virtual seconds between two looks")
        self.twin = twin
        self.run: JobRun | None = None
        self.begin_ns = twin.time_ns  # what was before is ignored (`begin`)
        self.output_changes: dict[str, tuple[int, Command | None]] = {}  # time in ns and command of the last change
        self._commands: list[Command] = []
        self._current: Command | None = None
        self._line: int | None = None
        self._fresh = False  # True if the next byte begins a command
        self._samples = array("d")
        self._outputs: Mapping[str, int] = dict(twin.outputs)
        self._gone: set[str] = set()
        self._rested_ns = -1
        self._margins = twin.margin_reader()
        self._decoder = None if twin.language is None else create_language(twin.controller_name)
        twin.listen(self._note)
        twin.observe(self._look, round(interval_s * SECOND_NS))

    def begin(self) -> None:
        """Ignore what was before now: path, switches, margins, time and replies. Lost steps stay lost."""
        self._close()
        self.begin_ns = self.twin.time_ns

    def play(self, job: str | os.PathLike[str], timeout_s: float = TIMEOUT_S) -> JobRun:
        """Call `begin` and play a job file to its end. timeout_s: virtual seconds that a line may take. Raises JobError
        (ValueError) for a job that cannot be played, OSError."""
        __tracebackhide__ = True
        twin, lines = self.twin, lines_of_job(job, self.twin)
        self.begin()
        scribe = Scribe(twin)
        made = played(twin, lines, [scribe.take, self._ended], timeout_s, begins=self._begins)
        self._line = None
        self._rested_ns = twin.time_ns
        self.run = JobRun(made.results, made.verdict, Path(job), scribe.golden(made.verdict))
        return self.run

    def rest(self) -> None:
        """Let the machine come to rest, half a second of virtual time, unless it just did or is still busy."""
        if self._rested_ns != self.twin.time_ns and self.twin.idle:
            self.twin.run(SETTLE_S)
            self._rested_ns = self.twin.time_ns
        self._look_for_losses()

    @property
    def commands(self) -> list[Command]:
        """All commands since `begin`, in their order."""
        self._take_margin()
        return [command for command in self._commands if command.begin_ns >= self.begin_ns]

    @property
    def every_command(self) -> list[Command]:
        """All commands, from the start of the observation."""
        return self._commands

    def command_at(self, time_ns: int) -> Command | None:
        """The last command that began by then."""
        return next((command for command in reversed(self._commands) if command.begin_ns <= time_ns), None)

    def samples(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Since `begin`: times in ns [n], positions in mm [n, 3] by the counters, and in machine coordinates."""
        table = self._table()
        time_ns, position_mm, machine_mm = np.split(
            table[table[:, 0] >= self.begin_ns], (1, 1 + len(CARRIAGES)), axis=1
        )
        return time_ns[:, 0], position_mm, machine_mm

    def _table(self) -> NDArray[np.float64]:
        return np.array(self._samples).reshape(-1, 1 + 2 * len(CARRIAGES))

    def lost_in(self, axis: str) -> Command | None:
        """The command after which an axis first had lost steps."""
        return next((command for command in self._commands if axis in command.lost), None)

    def reply_text(self, command: Command) -> str:
        """Its reply as `Twin.query` gives it."""
        language = self.twin.language
        return readable(command.reply) if language is None else language.text(command.reply)

    def accepts(self, command: Command) -> bool:
        language = self.twin.language
        return language is None or language.accepted(command.sent, command.reply)

    @property
    def job(self) -> tuple[Sequence[Result], int] | None:
        if self.run is None or self.run.verdict.began_ns < self.begin_ns:
            return None
        return self.run.results, self.run.verdict.ended_ns

    @property
    def fault_left(self) -> str:
        known = "" if self.job is None or self.run is None else self.run.verdict.fault_known
        cause = self.twin.fault_cause
        return "" if cause == known else cause

    @property
    def now_ns(self) -> int:
        return self.twin.time_ns

    def overlook(self, what: str) -> bool:
        """False: all of a twin can be seen."""
        return False

    def _begins(self, line: Line) -> None:
        self._line, self._fresh = line.number, True

    def _ended(self, result: Result) -> None:
        if not result.condition and self._current is not None:
            self._current.refused = not result.ok
            self._current.text = result.command
        self._close()

    def _look(self, twin: Twin) -> None:
        self._samples.extend((float(twin.time_ns), *twin.position_mm.tolist(), *twin.machine_position_mm.tolist()))
        outputs = twin.outputs
        if outputs != self._outputs:
            changed = (name for name, value in outputs.items() if self._outputs.get(name) != value)
            command = self._commands[-1] if self._commands else None
            self.output_changes.update(dict.fromkeys(changed, (twin.time_ns, command)))
            self._outputs = dict(outputs)

    def _note(self, time_ns: int, kind: str, what: Any) -> None:
        current = self._current
        if kind == "sent":
            begun = self._decoder is not None and self._decoder.rest(True) != b""
            answered = current is None or bool(current.reply) or self.twin.idle
            if current is None or self._fresh or (self._line is None and answered and not begun):
                self._close()
                self._fresh = False
                self._margins.take()
                current = self._current = Command(time_ns, self._line, end_ns=time_ns)
                self._commands.append(current)
            assert current is not None
            current.sent += what
            if self._decoder is not None:
                texts = [message.text for message in self._decoder.messages(what, True)]
                current.text = " ".join([*([current.text] if current.text else []), *texts])
        elif kind == "received" and current is not None:
            current.reply += what.data
            current.end_ns = what.arrival_ns
        elif kind == "counter" and current is not None:
            current.counter_set = True
        elif kind == "restored":
            self._forget_after(what)

    def _forget_after(self, time_ns: int) -> None:
        """Drop what was seen after a time to which the twin is restored."""
        self._close()
        self._commands = [command for command in self._commands if command.begin_ns < time_ns]
        table = self._table()
        self._samples = array("d", table[table[:, 0] < time_ns].ravel().tolist())
        self.begin_ns = min(self.begin_ns, time_ns)

    def _close(self) -> None:
        self._take_margin()
        if (current := self._current) is None:
            return
        self._look_for_losses()
        if current.line is None and self.twin.language is not None:
            current.refused = not self.accepts(current)
        self._current = None

    def _take_margin(self) -> None:
        if self._current is None:
            return
        margin = self._margins.take().tolist()
        before = self._current.margin or (math.nan,) * len(margin)
        self._current.margin = tuple(float(np.fmin(a, b)) for a, b in zip(before, margin, strict=True))

    def _look_for_losses(self) -> None:
        """Find axes that have newly lost steps, and assign them to the last command."""
        twin = self.twin
        command = self._commands[-1] if self._commands else None
        if command is None or not twin.idle:
            return
        steps, forgotten = twin.lost_steps, twin.forgotten_steps
        for i in np.flatnonzero(lost(steps, twin.slip_steps) | (forgotten != 0.0)):
            if AXIS_NAMES[i] not in self._gone:
                self._gone.add(AXIS_NAMES[i])
                command.lost[AXIS_NAMES[i]] = float(steps[i] + forgotten[i])
