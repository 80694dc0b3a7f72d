"""Lines sent as a host sends them, each when the one before is over: for a job (job.py) and for the desk (desk.py).

    idle -- begin --> running --- all lines well ----------------> done
                     |   |  |--- a refusal, an unmet condition --> failed
                     |   |  '--- stop, a host that takes the line -> stopped
                     |   '------ single: behind a line of the file -> paused -- go_on --> running
                     '---------- hold: pausing, until it stands ----> paused

Virtual time is not hurried: a line is over when time has come so far. After a stop the motion is broken off, in the
words of the controller's language.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from isel_twin.bridge.serve.borders import Endpoint
from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.server import Server
from isel_twin.controller import offers
from isel_twin.core.twin import Twin
from isel_twin.jobs.job import Line
from isel_twin.jobs.result import Result
from isel_twin.jobs.sending import Sent, Wait, conversation, ends_job, look
from isel_twin.language import HoldsMotion, readable

TIMEOUT_S = 86_400.0  # virtual seconds: somebody stands beside it
SHOWN = 120  # characters of a command
STILL_NS = 50_000_000  # virtual time without a step after which a held motion stands
LOOK_S = 0.02  # wall time between looks at a controller that is idle, and a line that is not over


class PanelEnd(Endpoint):
    """An endpoint of the panel, which nobody connects to; the monitor shows the replies."""

    kind = "panel"
    address = ""
    gathers = False
    busy = False
    waiting = 0
    settings: Mapping[str, Any] = MappingProxyType({})  # as those of the line

    def watches(self, listening: bool) -> Iterable[FileWatch]:
        return ()


class Sender(PanelEnd):
    """Sends lines. Used in the thread of the server's loop only."""

    def __init__(self, server: Server, twin: Twin) -> None:
        self._server, self._twin = server, twin
        self.state, self.why = "idle", ""
        self.lines: Sequence[Line] = ()
        self.index = 0  # of the line that is being sent
        self._ended = 0  # number of the line of the file with which it ended
        self.begin_ns = self.end_ns = self._moved_ns = 0
        self._single = self._held = False
        self._broken: int | None = None  # motions begun when one was broken off, until the controller is idle
        # of the line that is being sent
        self._sent: Sent | None = None
        self._steps: Iterator[bytes | int | Wait] = iter(())
        self._due: bytes | int | Wait | None = None
        self._until_ns: int | None = None
        self._reply = b""
        self._last: Result | None = None

    # As an endpoint

    def send(self, data: bytes) -> None:
        self._reply += data

    # What can be done

    @property
    def number(self) -> int:
        """Of the line of the file that is being made, or was when it ended."""
        if self._sent is not None:
            return self._sent.number
        return self.lines[self.index].number if self.active and self.index < len(self.lines) else self._ended

    @property
    def active(self) -> bool:
        """True until all is over: also while it is paused."""
        return self.state in ("running", "pausing", "paused")

    @property
    def pauses(self) -> str:
        """When a pause takes effect: "now", or "after the line" if a motion cannot be held over the line."""
        language = self._twin.language
        return "now" if offers(language, HoldsMotion) else "after the line"

    def begin(self, lines: Sequence[Line], single: bool = False) -> None:
        """single: only the first line of the file, then a pause."""
        self.lines, self.index, self.state, self.why = lines, 0, "running", ""
        self.begin_ns, self._sent, self._last = self._twin.time_ns, None, None
        self._single, self._held, self._broken = single, False, None

    def hold(self) -> str:
        """Pause as soon as it can be; returns why this cannot be done, "" if it is."""
        self.advance()
        if not self.active:
            return "it is over"
        language, line = self._twin.language, self.lines[self.index]
        if self._sent is None or not offers(language, HoldsMotion):
            self._single = True
            return ""
        made = isinstance(self._due, Wait) and self._due.last and self._twin.steps_made
        if line.program and not made:
            return "neither a transfer nor a reference run can be held; allowed: when the program is being made"
        self.state, self._held, self._moved_ns = "pausing", True, self._twin.time_ns
        self._server.receive(self, language.hold())
        return ""

    def go_on(self, single: bool = False) -> None:
        """Go on behind a pause. single: up to the end of the line of the file."""
        self.state, self._single = "running", single
        language, due = self._twin.language, self._due
        if self._held and offers(language, HoldsMotion):
            unfinished = isinstance(due, Wait) and not due.so()
            if unfinished or language.held(self._reply):
                self._reply = b""  # the line is answered when the rest has been made
                self._server.receive(self, language.go_on())
        self._held = False

    def stop(self, why: str) -> None:
        """Send no more, and break off what moves."""
        if not self.active:
            return
        language, held = self._twin.language, self._held
        self._over("stopped", why)
        if self.host() is None and language is not None:
            data = language.give_up() if held and offers(language, HoldsMotion) else language.break_off()
            self._server.receive(self, data)
            self._broken = self._begun

    def _break_off_again(self) -> None:
        """A controller with more motions in store makes the next one: it is broken off, too."""
        assert self._broken is not None
        language = self._twin.language
        if self._twin.idle or language is None or self.host() is not None:
            self._broken = None
        elif self._begun > self._broken:
            self._broken = self._begun
            self._server.receive(self, language.break_off())

    @property
    def _begun(self) -> int:
        """How many motions there have been."""
        steps = self._twin.steps
        return steps.dropped + len(steps.motions)

    def host(self) -> str | None:
        """The kind of an endpoint whose host holds the line."""
        return next((endpoint.kind for endpoint in self._server.endpoints if endpoint.busy), None)

    # In each round of the server

    @property
    def wait_s(self) -> float | None:
        """Wall seconds until it has to be looked at though nothing happens."""
        if self._broken is not None:
            return LOOK_S
        if self.state not in ("running", "pausing") or self._server.pacer.paused:
            return None
        if self._until_ns is None or self.state == "pausing":
            return LOOK_S if self._twin.idle else None
        return 0.0 if self._server.pacer.speed is None else max(0.0, self._server.pacer.until_s(self._until_ns))

    def advance(self) -> None:
        """Send what is due."""
        if self._broken is not None:
            self._break_off_again()
        if not self.active:
            return
        if (kind := self.host()) is not None:
            self.stop(f"a host has taken the line ({kind})")
            return
        if self.state == "pausing":
            self._look_whether_it_stands()
        while self.state == "running" and not self._server.pacer.paused and self._step():
            pass

    def _look_whether_it_stands(self) -> None:
        """Between two steps that are far apart, and before the first one, it only seems to."""
        twin = self._twin
        if twin.commands_due or twin.step_hz.any():
            self._moved_ns = twin.time_ns
        elif twin.idle or twin.time_ns - self._moved_ns >= STILL_NS:
            self.state = "paused"

    def _step(self) -> bool:
        """One step; False if there is nothing to do now."""
        twin = self._twin
        if self.index == len(self.lines):
            self._over("done", "")
            return False
        line = self.lines[self.index]
        if line.condition is not None:
            self._judge(line, look(twin, line, line.condition, self._last))
            return True
        if self._sent is None:
            self._sent, self._steps, self._reply = Sent(twin, line), conversation(twin, line), b""
            self._due, self._until_ns = next(self._steps, None), None
        if self._due is None:
            self._judge(line, self._sent.result(True, self._reply, TIMEOUT_S))
            return True
        if not self._done(self._due):
            return False
        self._due, self._until_ns = next(self._steps, None), None
        return True

    def _done(self, due: bytes | int | Wait) -> bool:
        twin = self._twin
        if isinstance(due, bytes):
            if not self._server.listening:
                return False
            self._server.receive(self, due)
            return True
        for_ns = due if isinstance(due, int) else due.for_ns
        if for_ns is not None:
            self._until_ns = twin.time_ns + for_ns if self._until_ns is None else self._until_ns
            if self._server.pacer.speed is None:  # at this speed time stands still while all wait
                twin.run_until(self._until_ns)
            return twin.time_ns >= self._until_ns
        assert isinstance(due, Wait)
        return due.so() and not (twin.replies_due or twin.commands_due or twin.reply_waiting)

    def _judge(self, line: Line, result: Result) -> None:
        self._ended = line.number if self._sent is None else self._sent.number
        self._ended = next((part.at[0] for part in reversed(result.parts) if part.at is not None), self._ended)
        self._sent = None
        if not result.condition:
            self._last = result
        if not result.ok:
            command = result.command or readable(line.sent)
            self._over("failed", f"{command[:SHOWN]}: {result.shown_reply or 'no reply'}")
        elif ends_job(line, result):
            self._over("failed", result.why)
        else:
            self.index += 1
            following = self.lines[self.index : self.index + 1]
            if self._single and following and following[0].number != line.number:
                self.state = "paused"

    def _over(self, state: str, why: str) -> None:
        if self._sent is not None:
            self._ended = self._sent.number
        self.state, self.why, self.end_ns, self._sent, self._until_ns = state, why, self._twin.time_ns, None, None
        self._held = False
