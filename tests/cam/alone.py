"""Toolpaths played to a controller alone, whose carriages are where its counters are: a third of what a twin costs."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from cam.played import FAST, MACHINES, STEPS_MM, Made, counts_of, homes, lines_of, texts
from numpy.typing import NDArray

from isel_twin import Twin
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Element, Point
from isel_twin.cam.written import MachineAxes
from isel_twin.controller import Output, Reply, Step, UsesDrives, create_controller, offers
from isel_twin.jobs.job import Line, parse_job
from isel_twin.jobs.sending import converse, play
from isel_twin.language import create_language
from isel_twin.motion import Motion
from isel_twin.testing import IdealDrives


class Alone:
    """Plays toolpaths one after the other, as `Player` does. Once a twin has made the reference run, the controller is
    driven by its own protocol of time: from one `next_ns` to the next, with drives that follow at once. What a job is
    sent to (`isel_twin.jobs.sending.Partner`)."""

    events_left = 0
    commands_due = 0

    def __init__(self, controller: str, axes: MachineAxes) -> None:
        self.controller, self._axes = create_controller(controller), axes
        self._name, self.steps_mm = controller, STEPS_MM.get(controller, 320.0)
        machine = MACHINES.get(controller, "4030-servo")
        twin = Twin(machine=machine, controller=self.controller, plant="kinematic", seed=1)
        twin.language = self.language = create_language(controller)
        self.steps_made: list[Step] = []
        self._replies = bytearray()
        self._run: Motion | None = None  # in execution, looked at
        self._since_ns = 0
        self._changes: list[NDArray[np.int64]] = []  # of the counters
        lines = self._job([], FAST)
        last = max(number for number, line in enumerate(lines) if homes(line))
        results = list(play(twin, lines[: last + 1], timeout_s=3000.0))
        assert [(result.command, result.reply) for result in results if not result.ok] == []
        self.time_ns, self.outputs = twin.time_ns, dict(twin.outputs)
        if offers(self.controller, UsesDrives):
            self.controller.use_drives(IdealDrives(self))

    @property
    def start(self) -> Point:
        """Where it stands, as the counters show it."""
        x, y, z = (count / self.steps_mm for count in self.counts[:3])
        return x, y, z

    @property
    def counts(self) -> tuple[int, ...]:
        return self.controller.counts

    @property
    def idle(self) -> bool:
        return self.controller.idle

    @property
    def fault(self) -> bool:
        return self.controller.fault

    unfinished = ""

    def play(self, path: Iterable[Element], settings: CamSettings = FAST) -> Made:
        self._changes.clear()
        for line in self._job(path, settings):
            if not homes(line):
                assert converse(self, line, 3000.0, None), line.command
                assert line.program or self.language.accepted(line.sent, bytes(self._replies)), line.command
                self._replies.clear()
        assert not self.fault
        delta = np.concatenate([np.empty((0, 3), np.int64), *self._changes])
        return Made(counts_of(delta, self.counts), self.steps_mm)

    def write(self, data: bytes) -> None:
        self.controller.receive(self.time_ns, data)
        self._take()
        if self.controller.run is not self._run:
            self._made()

    def run_until(self, time_ns: int, stop: Callable[[], bool] | None = None) -> None:
        while self.time_ns < time_ns and not (stop is not None and stop()):
            due_ns = self.controller.next_ns
            self._advance(time_ns if due_ns is None else min(due_ns, time_ns))

    def _advance(self, time_ns: int) -> None:
        self.time_ns = time_ns
        self.controller.advance(time_ns)
        self._take()
        if self.controller.run is not self._run:
            self._made()

    def _made(self) -> None:
        """Keep what has been made of a motion, up to now, and look at the next one."""
        if self._run is not None:
            first, last = self._run.count(self._since_ns), self._run.count(self.time_ns)
            self._changes.append(self._run.window(first, last)[1][:, :3].astype(np.int64))
        self._run, self._since_ns = self.controller.run, self.time_ns

    def _take(self) -> None:
        for event in self.controller.take():
            if isinstance(event, Reply):
                self._replies += event.data
            elif isinstance(event, Output):
                self.outputs[event.name] = event.value
            elif isinstance(event, Step):
                self.steps_made.append(event)

    def _job(self, path: Iterable[Element], settings: CamSettings) -> list[Line]:
        lines = lines_of(self._name, path, settings, self._axes)
        return parse_job("\n".join(texts(lines)), self.language, self._name)
