"""The lines of a job sent: to a twin in virtual time, to a real controller in real time.

A line is over when the controller has answered and is idle, or when the time without a reply (`=> none within 1 s`) has
passed; its reply is everything that came meanwhile. A line that is not over in time ends the job: later bytes would be
taken for replies to the next lines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Sized
from dataclasses import dataclass
from itertools import takewhile
from typing import TYPE_CHECKING, Any, Protocol, TypedDict

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.crew import Stop
from isel_twin.base.units import SECOND_NS
from isel_twin.controller import offers
from isel_twin.jobs import expect
from isel_twin.jobs.expect import Condition
from isel_twin.jobs.job import Line
from isel_twin.jobs.result import Ends, Part, Result
from isel_twin.jobs.why import RESTARTED, happened, meaning, referenced_astray, waits
from isel_twin.language import RunsPrograms, readable

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

MOST_EDGE = 100.0  # beyond, an axis is as good as at rest


def play(
    twin: Twin,
    lines: Sequence[Line],
    timeout_s: float,
    stop: Stop | None = None,
    last: Result | None = None,
    edges: bool = True,
) -> Iterator[Result]:
    """Send the lines, each when the one before is over.

    timeout_s: virtual seconds after which a line without complete reply counts as refused and ends the job. stop:
    called whenever something has happened; True ends the job in the same way. last: of the commands played before,
    for a condition that comes first. edges: whether results tell `Result.edge`, which takes 0.04 s of a processor for
    each motor that is met for the first time.
    """
    for line in lines:
        if stop is not None and stop():
            return
        if line.condition is not None:
            yield look(twin, line, line.condition, last)
            continue
        sent = Sent(twin, line, edges)
        complete = converse(twin, line, timeout_s, stop)
        last = sent.result(complete, twin.read(), timeout_s)
        yield last
        if ends_job(line, last):
            return


class Sent:
    """A line that is about to be sent, and what its result is compared with."""

    def __init__(self, twin: Twin, line: Line, edges: bool = True) -> None:
        self.twin, self.line, self._edges = twin, line, edges
        self.time_ns, self._faults, self._restarts = twin.time_ns, twin.line_faults, twin.restarts
        twin.watch_margin()
        twin.steps_made.clear()
        self._said = twin.remarks[-1] if twin.remarks else None
        self._astray = len(twin.astray)
        self._bytes_ns = twin.bytes_ns
        self._step, self._number = "", line.number  # the last one that was looked up

    @property
    def number(self) -> int:
        """The line of the file that is being made, in a program as far as it has told."""
        steps, language, line = self.twin.steps_made, self.twin.language, self.line
        if line.program and steps and steps[-1].name != self._step and offers(language, RunsPrograms):
            self._step = steps[-1].name
            own = language.lines(line.source, {self._step}).get(self._step)
            if own is not None:
                self._number = line.places[own - 1] if line.places else own
        return self._number

    def result(self, complete: bool, reply: bytes, timeout_s: float) -> Result:
        """The outcome. complete: the line is over, and did not take timeout_s."""
        twin, line, language = self.twin, self.line, self.twin.language
        new, disturbed = twin.restarts - self._restarts, twin.line_faults.since(self._faults).in_words()
        text = None if language is None else language.text(reply)
        took_ns = twin.time_ns - self.time_ns
        why = "" if line.expected is None else line.expected.why_not(reply, complete, took_ns, text)
        accepted = language is None or bool(line.program) or language.accepted(line.sent, reply)
        parts = _parts(twin, line, self._said) if line.program else ()
        if line.program and twin.fault:
            accepted = False
            why = next((part.text for part in reversed(parts) if not part.position_mm), twin.fault_cause)
        elif line.program and not complete and twin.steps_made:
            why = twin.unfinished
        elif line.expected is None and not complete:
            why = waits(twin, timeout_s)
        elif line.expected is None and not accepted:
            why = meaning(twin, line.sent, reply)
        if new and line.expected is None:
            accepted, why = False, RESTARTED
        elif line.expected is None and disturbed:
            accepted, why = False, disturbed
        astray = referenced_astray(twin.astray[self._astray :])
        if line.expected is None and accepted and astray:
            accepted, why = False, astray
        wrong = line.expected is None and not (accepted and complete)
        expected_refusal = line.expected is not None and bool(reply) and not accepted and not why
        return Result(
            number=line.number,
            command=line.command,
            reply=readable(reply) if text is None else text,
            ok=complete and (accepted if line.expected is None else not why),
            time_ns=self.time_ns,
            end_ns=twin.time_ns,
            counts=tuple(twin.counts.tolist()),
            position_mm=tuple(twin.position_mm.tolist()),
            **margins(twin),
            edge=_edges(twin) if self._edges else (),
            complete=complete,
            expected=None if line.expected is None else line.expected.text,
            why=why,
            event=happened(twin, self.time_ns) if wrong or new or disturbed or astray else "",
            disturbed=disturbed,
            astray=astray,
            bytes_ns=twin.bytes_ns - self._bytes_ns,
            restarts=new,
            fault_known=twin.fault_cause if expected_refusal or not twin.fault else None,
            parts=parts,
        )


class Margins(TypedDict):
    """Fields of `Result`."""

    margin: tuple[float | None, ...]
    margin_band: tuple[Ends | None, ...]


def margins(twin: Twin) -> Margins:
    """Those since `watch_margin`."""
    from isel_twin.drives.bands import margin_band

    least = tuple(None if math.isnan(margin) else round(margin, 4) for margin in twin.margin.tolist())
    bands = tuple(
        None if margin is None or math.isnan(torque[0]) else margin_band(margin, *torque)
        for margin, torque in zip(least, twin.torque_band.tolist(), strict=True)
    )
    return {"margin": least, "margin_band": bands}


def _edges(twin: Twin) -> tuple[float | None, ...]:
    return tuple(round(edge, 4) if edge < MOST_EDGE else None for edge in twin.speed_edge.tolist())


def ends_job(line: Line, result: Result) -> bool:
    """True if no later line is sent: this one is not over, or its program was not loaded and cannot be started."""
    return not result.complete or (bool(line.program) and not result.ok)


def _parts(twin: Twin, line: Line, before: tuple[int, str] | None) -> tuple[Part, ...]:
    """Steps of a program, each with the position at its end, and the remarks after the remark `before`."""
    steps = list(twin.steps_made)
    ends = [step.counts for step in steps[1:]] + [tuple(twin.counts.tolist())]
    scale = twin.step_mm.tolist()
    language = twin.language
    new = list(reversed(list(takewhile(lambda one: one is not before, reversed(twin.remarks)))))
    about = [language.place(text, line.command) if offers(language, RunsPrograms) else ("", 0) for _, text in new]
    names = {step.name for step in steps} | {name for name, _ in about if name}
    places: Mapping[str, int] = language.lines(line.source, names) if offers(language, RunsPrograms) and names else {}

    def at(name: str, column: int) -> tuple[int, int] | None:
        if name not in places:
            return None
        own = places[name]
        return (line.places[own - 1], 1) if line.places else (own, column)

    parts = [
        Part(
            step.t_ns,
            f"{step.name} {step.text}".strip(),
            tuple(count * mm for count, mm in zip(end, scale, strict=False)),
            step.plane,
            step.tool_mm,
            at(step.name, 1),
        )
        for step, end in zip(steps, ends, strict=False)
    ]
    said = []
    for (time_ns, text), (name, column) in zip(new, about, strict=True):
        place, (_, _, sent) = at(name, column), name.partition(" line ")
        if sent and place is not None:  # the controller counts the lines that it was sent
            text = text.replace(f"line {sent}", f"line {place[0]}", 1)
        said.append(Part(time_ns, text, at=place))
    return tuple(sorted(parts + said, key=lambda part: part.time_ns))


def look(twin: Twin, line: Line, condition: Condition, last: Result | None) -> Result:
    found = condition.look(twin, last)
    quantity, _, axis = condition.name.partition(".")
    values: Sequence[Any] = ()
    if found.met and quantity == "lost":
        values = expect.lost_steps(twin).tolist()
    elif found.met and quantity == "drive_faults":
        values = [number for number, _ in twin.drive_faults]
    known = tuple(value if axis in ("", name) else None for name, value in zip(AXIS_NAMES, values, strict=False))
    return Result(
        number=line.number,
        command=line.command,
        reply=found.value,
        ok=found.met,
        time_ns=twin.time_ns,
        end_ns=twin.time_ns,
        counts=tuple(twin.counts.tolist()),
        position_mm=tuple(twin.position_mm.tolist()),
        expected=condition.text,
        why="" if found.met else f"is {found.value}",
        condition=True,
        lost_known=known if quantity == "lost" else (),
        unpowered_known=_unpowered_known(twin, quantity) if found.met else None,
        line_known=_line_known(twin, axis) if found.met and quantity == "bytes" else (),
        restarts_known=twin.restarts if found.met and quantity == "restarts" else None,
        fault_known=twin.fault_cause if found.met and quantity == "fault" else None,
        drive_faults_known=known if quantity == "drive_faults" else (),
    )


def _line_known(twin: Twin, kind: str) -> tuple[int | None, ...]:
    """Bytes not as they were sent that a condition which is met answers for: of one kind, "": of each."""
    return tuple(number if kind in ("", name) else None for name, number in twin.line_faults._asdict().items())


def _unpowered_known(twin: Twin, quantity: str) -> int | None:
    """Steps without power that a condition which is met answers for: one on lost steps, too, if there are any."""
    told = quantity == "unpowered" or (quantity == "lost" and bool(expect.lost_steps(twin).any()))
    return int(twin.unpowered_steps.sum()) if told else None


@dataclass(frozen=True)
class Wait:
    """Something that has to become true before a line goes on. until: when there is no more to wait for, true or not;
    for_ns: how long it may take, in place of the time that any line may. last: nothing more is done for the line."""

    so: Callable[[], bool]
    until: Callable[[], bool]
    for_ns: int | None = None
    last: bool = False


class Partner(Protocol):
    """What lines are sent to: a twin, in virtual time, or a real controller, in real time."""

    @property
    def time_ns(self) -> int: ...

    @property
    def idle(self) -> bool:
        """True if everything sent is answered and nothing more is under way."""

    @property
    def commands_due(self) -> int: ...

    @property
    def fault(self) -> bool: ...

    @property
    def steps_made(self) -> Sized: ...

    @property
    def unfinished(self) -> str: ...

    @property
    def events_left(self) -> int: ...

    def write(self, data: bytes) -> None: ...

    def run_until(self, time_ns: int, stop: Stop | None = None) -> None: ...


def conversation(twin: Partner, line: Line) -> Iterator[bytes | int | Wait]:
    """What is to be done for a line, each when the one before is over: bytes to send, nanoseconds to let pass, waits.
    If one of these ends in vain, the line is not over, and no more is done for it."""
    end_ns = None
    if line.expected is not None and line.expected.wait_ns is not None:
        end_ns = twin.time_ns + line.expected.wait_ns
    yield from line.actions
    for piece in line.program:
        yield piece
        if twin.commands_due:
            yield Wait(lambda: not twin.commands_due, lambda: not twin.commands_due or _stands(twin))
    if end_ns is not None:
        yield Wait(lambda: twin.time_ns >= end_ns, lambda: False, end_ns - twin.time_ns, last=True)
    elif line.program:
        yield Wait(lambda: twin.idle and _over(twin), lambda: twin.idle and (_over(twin) or _stands(twin)), last=True)
    else:
        yield Wait(lambda: twin.idle, lambda: twin.idle, last=True)


def converse(twin: Partner, line: Line, timeout_s: float, stop: Stop | None) -> bool:
    """Send a line and wait until it is over; return whether it is."""

    def stopped() -> bool:
        return stop is not None and stop()

    for step in conversation(twin, line):
        if isinstance(step, bytes):
            twin.write(step)
        elif isinstance(step, int):
            twin.run_until(twin.time_ns + step, stop)
            if stopped():
                return False
        else:
            most_ns = round(timeout_s * SECOND_NS) if step.for_ns is None else step.for_ns
            twin.run_until(twin.time_ns + most_ns, lambda: step.until() or stopped())  # noqa: B023
            if not step.so():
                return False
    return True


def _over(twin: Partner) -> bool:
    """True if a program that this line has started must end now."""
    return twin.fault or not twin.steps_made or not twin.unfinished


def _stands(twin: Partner) -> bool:
    """True if it waits and nothing can continue it, such as a later scenario event that presses Start (bwo900/76)."""
    return not _over(twin) and not twin.events_left
