"""A job sent to a real controller, and judged by what can be seen from outside.

    lines --- converse (jobs/sending.py), in real time ---> RealController --- RealPort ---> the controller
                                                             |
                                     the language: which commands want a reply, and is it complete?

A line is over when its replies are complete; where none is due, when the line has been silent for QUIET_S. What is not
as expected ends the job, as the machine is real (bridge/26). A motion that may still be under way when the job ends
early is broken off in the words of the controller's language.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.crew import Stop
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.bridge.tap.real_port import PIECE_BYTES, RealPort
from isel_twin.bridge.tap.tap import port_settings
from isel_twin.controller import SerialFormat, offers
from isel_twin.jobs.checks.findings import of_answer, of_cycle, of_unsent
from isel_twin.jobs.checks.rules import RULES, Bounds, Finding, few
from isel_twin.jobs.job import Line
from isel_twin.jobs.result import Result
from isel_twin.jobs.sending import converse
from isel_twin.language import RunsPrograms, TellsCounters, create_language, needed, readable

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

TIMEOUT_S = 300.0  # real time that a line may take, if nobody says more: a reference run of a long machine
QUIET_NS = 200 * MILLISECOND_NS  # silence after a line that needs no reply
LOOK_S = 0.05  # between looks at a silent line


class SilentError(OSError):
    """Nothing at all came back, or the port has gone."""


class RealController:
    """The far end of a port, as `jobs.sending.Partner`. Times are real, from 0 at the opening. Raises as RealPort."""

    # of controllers that run programs, whose end cannot be heard: they are refused (`unfit`)
    commands_due = events_left = 0
    fault, unfinished = False, ""
    steps_made: Sequence[object] = ()

    def __init__(self, address: str, controller: str, form: SerialFormat) -> None:
        self.address = address
        self.language = needed(create_language(controller), controller)
        self._news = threading.Event()
        self._port = RealPort(address, port_settings(form), self._news.set)
        self._start_ns = self._heard_ns = time.perf_counter_ns()
        self.reply = b""  # since `begin`
        self.why = ""  # what the language says of its last message
        self.silent = True  # nothing has ever come
        self._due = 0  # replies that are still to come

    def begin(self) -> None:
        """A new line. What the controller said unasked since the last one counts with this one."""
        self.reply, self.why, self._due = b"", "", 0
        self._listen()

    @property
    def time_ns(self) -> int:
        return time.perf_counter_ns() - self._start_ns

    @property
    def idle(self) -> bool:
        if self._due > 0 or self.language.rest(False):
            return False
        return bool(self.reply) or time.perf_counter_ns() - self._heard_ns >= QUIET_NS

    @property
    def ended_ns(self) -> int:
        """When the last byte came or went."""
        return self._heard_ns - self._start_ns

    def write(self, data: bytes) -> None:
        accepted = self.language.accepted
        self._due += sum(not accepted(one.data, b"") for one in self.language.messages(data, sent=True))
        self._heard_ns = time.perf_counter_ns()
        self._port.put(data)

    def run_until(self, time_ns: int, stop: Stop | None = None) -> None:
        """Listen until then, or until `stop` is true. Raises SilentError if the port goes."""
        while True:
            self._news.clear()
            self._listen()
            left_s = (time_ns - self.time_ns) / SECOND_NS
            if (stop is not None and stop()) or left_s <= 0.0:
                return
            self._news.wait(min(left_s, LOOK_S))

    def break_off(self) -> str:
        """Stop the machine with its ramp; return what was sent, in words."""
        data = self.language.break_off()
        self._port.put(data)
        return readable(data)

    def close(self) -> None:
        self._port.close()

    def _listen(self) -> None:
        for piece in self._port.take(PIECE_BYTES):
            if piece.note:
                raise SilentError(f"{self.address}: {piece.note}")
            self.silent = False
            self._heard_ns = piece.time_ns
            self.reply += piece.data
            for message in self.language.messages(piece.data, sent=False):
                self._due -= 1
                self.why = message.explanation.removeprefix("reply: ")


@dataclass(frozen=True)
class RealVerdict:
    """What was heard of a job."""

    commands: int
    cycle_s: float  # from the first command to the last byte of the last reply
    device: str
    controller: str
    unsent: int
    interrupted: bool
    margin_told = ""
    line_told = ""  # the time of the line is in that of the job

    def summary(self) -> dict[str, Any]:
        told = {"commands": self.commands, "cycle_s": self.cycle_s, "unsent": self.unsent}
        return {**told, "interrupted": self.interrupted, "isel_port": self.device, "controller": self.controller}


@dataclass(frozen=True)
class RealReport:
    """The outcome of a job at a real controller, and what is wrong with it."""

    job: str
    findings: tuple[Finding, ...]
    verdict: RealVerdict
    conditions_unseen: tuple[str, ...]  # that nobody could look at
    results: tuple[Result, ...]
    stopped: str = ""  # what was sent to break a motion off
    not_made: str = ""  # lines of the file that were left out

    @property
    def ok(self) -> bool:
        return all(finding.warning for finding in self.findings)

    @property
    def unseen(self) -> tuple[str, ...]:
        """Lines that were not made, rules and conditions that nobody could look at."""
        left_out = [self.not_made] if self.not_made else []
        return (*left_out, *(name for name, rule in RULES.items() if not rule.heard), *self.conditions_unseen)


def unfit(lines: Sequence[Line], controller: str) -> str:
    """Why this job cannot be sent to a real controller; "" if it can."""
    language = needed(create_language(controller), controller)
    if offers(language, RunsPrograms) or any(line.program for line in lines):
        return f"{controller} acknowledges nothing on its line: the end of a command cannot be heard; use the twin"
    return ""


def check_real(
    job: str,
    lines: Sequence[Line],
    controller: str,
    real: RealController,
    bounds: Bounds,
    stop: Stop,
    cautions: Sequence[Finding] = (),
) -> RealReport:
    """Send a job line by line and judge the replies. bounds: cycle_s and timeout_s count, in real seconds, and strict.
    stop: true ends the job. cautions: what its file may mean otherwise. Raises SilentError if the controller has never
    said anything, or its port has gone."""
    results: list[Result] = []
    unseen: list[str] = []
    counts: Mapping[int, int] = {}
    last: Result | None = None
    halted = ""
    left = len(lines)
    try:
        for line in lines:
            if stop():
                break
            left -= 1
            if line.condition is not None:
                result = _look(line, real, counts, last)
                if result is None:
                    unseen.append(f"line {line.number} ({line.command})")
                    continue
            else:
                result = last = _sent(line, real, bounds.timeout_s, stop)
                counts = _told(real, line)
            results.append(result)
            if not result.ok:
                break
    finally:
        whole = bool(results) and results[-1].ok and not left
        if not whole:
            halted = real.break_off()
    if real.silent and any(not result.complete for result in results) and not stop():
        raise SilentError(
            f"{real.address}: no reply to {results[0].command} within {bounds.timeout_s:g} s; "
            f"is {controller} switched on, and its cable in?"
        )
    sent = [result for result in results if not result.condition]
    begin_ns, end_ns = (sent[0].time_ns, sent[-1].end_ns) if sent else (0, 0)
    cycle_s = (end_ns - begin_ns) / SECOND_NS
    number, over_ns = (results[-1].number, results[-1].end_ns) if results else (None, 0)
    found = [finding for result in results for finding in of_answer(result, bounds)]
    found += [*of_cycle(cycle_s, bounds, number, end_ns), *of_unsent(left, number, over_ns), *cautions]
    if bounds.strict:
        found = [replace(finding, strict=True) for finding in found]
    verdict = RealVerdict(len(sent), cycle_s, real.address, controller, left, stop() and not whole)
    return RealReport(job, few(found), verdict, tuple(unseen), tuple(results), halted)


def _sent(line: Line, real: RealController, timeout_s: float, stop: Stop) -> Result:
    real.begin()
    begin_ns = real.time_ns
    complete = converse(real, line, timeout_s, stop)
    silence = line.expected is not None and line.expected.wait_ns is not None
    end_ns = real.time_ns if silence or not complete else max(begin_ns, real.ended_ns)
    reply, text = real.reply, real.language.text(real.reply)
    if line.expected is not None:
        why = line.expected.why_not(reply, complete, end_ns - begin_ns, text)
        ok = complete and not why
    else:
        ok = complete and real.language.accepted(line.sent, reply)
        why = "" if ok else "interrupted" if stop() else real.why
    expected = None if line.expected is None else line.expected.text
    return Result(
        line.number, line.command, text, ok, begin_ns, end_ns, (), (), complete=complete, expected=expected, why=why
    )


def _told(real: RealController, line: Line) -> Mapping[int, int]:
    """The counters in the reply to this line, by axis."""
    language = real.language
    found = language.counters(line.sent, real.reply) if offers(language, TellsCounters) else None
    return {} if found is None else found[0]


def _look(line: Line, real: RealController, counts: Mapping[int, int], last: Result | None) -> Result | None:
    """The condition, if it is on the last command's duration, or on counters that its reply told; else None."""
    condition = line.condition
    assert condition is not None
    name, _, axis = condition.name.partition(".")
    told = name == "count" and axis in [AXIS_NAMES[known] for known in counts]
    if not told and name != "time":
        return None
    found = condition.look(
        cast("Twin", _Counters(np.array([counts.get(known, 0) for known in range(len(AXIS_NAMES))]))), last
    )
    why = "" if found.met else f"is {found.value}"
    now = real.time_ns
    return Result(
        line.number, line.command, found.value, found.met, now, now, (), (), expected=condition.text, why=why,
        condition=True,
    )  # fmt: skip


@dataclass(frozen=True)
class _Counters:
    """As much of a twin as a condition on a counter reads."""

    counts: np.ndarray
