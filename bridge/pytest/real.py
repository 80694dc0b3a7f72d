"""`pytest --isel-port`: the fixture `watched` at a real controller.

    watched.play(job) --- check_real (bridge/tap/real_job.py) ---> the controller moves the machine, replies are judged
    assertions        --- of replies and times: asked       --- that look inside: `unseen`, in the report (bridge/27)

One port, one machine: it is opened for a test, and keeps its state from test to test.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

from isel_twin.base.errors import CallError
from isel_twin.bridge.pytest.without import NoTwin, no_twin
from isel_twin.bridge.tap.real_job import TIMEOUT_S, RealController, RealReport, SilentError, check_real, unfit
from isel_twin.bridge.tap.real_port import refusal
from isel_twin.core.twin import Twin
from isel_twin.jobs.checks.rules import Bounds
from isel_twin.jobs.checks.watched import Command, lines_of_job
from isel_twin.jobs.result import Result


@dataclass
class Said(Command):
    """A command of a job, and what was answered."""

    answer: str = ""  # as text
    accepted: bool = False


class RealWatched:
    """Implements `isel_twin.jobs.checks.watched.Heard`. Times are real, from the opening of the port."""

    def __init__(self, port: str, names: Twin) -> None:
        """names: a twin of the same controller, which knows its language, line settings and inputs. Raises CallError
        if the port cannot be had."""
        self._names = names
        self.unseen: dict[str, None] = {}  # assertions and conditions that nobody could look at, in their order
        self.begin_ns = 0
        self.report: RealReport | None = None  # of the last job
        self._said: list[Said] = []
        try:
            self._real = RealController(port, names.controller_name, names.serial_format)
        except (OSError, ValueError) as error:
            raise CallError(refusal(port, error)) from None

    def close(self) -> None:
        self._real.close()

    def begin(self) -> None:
        """Ignore what was before now: commands, replies and times."""
        self.begin_ns, self.report = self._real.time_ns, None

    def play(self, job: str | os.PathLike[str], timeout_s: float = TIMEOUT_S) -> RealReport:
        """Call `begin` and send a job. The first line that is not as expected ends it, and breaks a motion off
        (bridge/26). timeout_s: real seconds that a line may take. Raises JobError as `Watched.play` does, OSError, and
        CallError if nobody answers or the controller cannot be judged by its line."""
        __tracebackhide__ = True
        lines = lines_of_job(job, self._names)
        controller = self._names.controller_name
        if why := unfit(lines, controller):
            raise CallError(f"{job}: {why}")
        self.begin()
        try:
            report = check_real(str(job), lines, controller, self._real, Bounds(timeout_s=timeout_s), lambda: False)
        except SilentError as error:
            raise CallError(str(error)) from None
        self.report = report
        self._said = [
            Said(one.time_ns, one.number, end_ns=one.end_ns, text=one.command, answer=one.reply, accepted=one.ok)
            for one in report.results
            if not one.condition
        ]
        for what in report.conditions_unseen:
            self.overlook(what)
        return report

    @property
    def commands(self) -> list[Command]:
        return [one for one in self._said if one.begin_ns >= self.begin_ns]

    def reply_text(self, command: Command) -> str:
        return command.answer if isinstance(command, Said) else ""

    def accepts(self, command: Command) -> bool:
        return isinstance(command, Said) and command.accepted

    @property
    def job(self) -> tuple[Sequence[Result], int] | None:
        if self.report is None or not self.report.results:
            return None
        return self.report.results, self.report.results[-1].end_ns

    fault_left = ""

    def rest(self) -> None:
        """Nothing: a line of a job is over when the controller has said so."""

    @property
    def now_ns(self) -> int:
        return self._real.time_ns

    @property
    def twin(self) -> NoTwin:
        return NoTwin()

    def __getattr__(self, name: str) -> NoReturn:
        """What `Watched` has beside this needs the twin."""
        if name.startswith("_"):
            raise AttributeError(name)
        no_twin(f"watched.{name}")

    def overlook(self, what: str) -> bool:
        self.unseen[what] = None
        return True
