"""Carries out activities: makes their runs, keeps their times, ends them when something happens.

One task at a time. What can happen to it:

    its request is done          it goes on
    stop (253, stop key)         stop ramp, `F`, parked; a start resumes it
    break (255, port abort)      stop ramp, its code, gone
    limit switch                 ends at once, `2`
    power lost                   ends at once, `9`

"Done" is decided when the time of the last pulse has come. An input edge at that very time still meets a motion in
progress, because its pulse is what caused it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from isel_twin.firmware.imc.activity import Activity, Ended, Listen, Pause, Request, Travel
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.limits import axis_of
from isel_twin.firmware.imc.ports import LIMIT_PORT
from isel_twin.firmware.imc.replies import FAULT, HOOD_OPEN, LIMIT_SWITCH, OK, STOPPED, Refusal
from isel_twin.firmware.imc.safety import Event, State, hood_safe, powered
from isel_twin.firmware.imc.settings import Watch
from isel_twin.motion import Path, StepRun
from isel_twin.units import MILLISECOND_NS


@dataclass
class Task:
    """An activity in progress. `answers`: its end is reported to the host; `program`: it is the stored program."""

    activity: Activity
    answers: bool = True
    program: bool = False


@dataclass(frozen=True)
class Ending:
    """What a run in its stop ramp is to become: parked, gone with this code, or ended by its condition."""

    park: bool = False
    code: str | None = None


EVENT = Ending()
PARK = Ending(park=True)


class Executor:
    """Executes tasks on a device; `reply(text)` sends to the host."""

    def __init__(self, device: Device, reply: Callable[[str], None]) -> None:
        self._device = device
        self._reply = reply
        self.task: Task | None = None
        self.parked: tuple[Task, Ended | None] | None = None
        """A stopped task and the result with which it will go on."""
        self._request: Request | None = None
        self._ending: Ending | None = None
        self._pause_until: int | None = None
        self._cycle_ns: int | None = None

    # ---- starting and ending ----------------------------------------------------------------------------------------

    def start(self, task: Task) -> None:
        """Begin a task; there is none in progress."""
        self.task = task
        self._resume(None)

    def resume_parked(self, *, answers: bool) -> None:
        """Go on with the parked task. answers: the host has asked for it and wants to know the end."""
        assert self.parked is not None
        self.task, result = self.parked
        self.parked = None
        self.task.answers |= answers
        self._resume(result)

    def forget_parked(self) -> None:
        """The rest of a stopped motion or program is forgotten."""
        if self.parked is not None:
            self.parked[0].activity.close()
            self.parked = None

    def discard(self) -> None:
        """Reset: whatever there is ends at once and says nothing."""
        if self._device.run is not None:
            self._device.finish_run()
        if self.task is not None:
            self.task.activity.close()
        self.forget_parked()

    def _resume(self, result: Ended | int | None) -> None:
        """Let the activity go on with the result of its request, up to its next one that takes time."""
        while self.task is not None:
            self._request = self._ending = self._pause_until = None
            try:
                request = self.task.activity.send(result)
            except StopIteration:
                self._finish(OK)
                return
            except Refusal as refusal:
                self._finish(refusal.code)
                return
            result = self._begin(request)
            if result is None:
                return

    def _begin(self, request: Request) -> Ended | None:
        """Begin a request; return its result if it is done already."""
        device = self._device
        self._request = request
        match request:
            case Pause(ns):
                self._pause_until = device.now_ns + ns
            case Travel():
                run = StepRun(request.path, request.law, device.now_ns, request.first)
                if request.until is not None and request.until():
                    return Ended(request.first, by_event=True)
                if request.seek is None and self._blocked(run):
                    self._limit_error()
                else:
                    device.run = run
        return None

    def _finish(self, code: str) -> None:
        """The task has ended with this code."""
        assert self.task is not None
        task, self.task = self.task, None
        task.activity.close()
        self._request = self._ending = self._pause_until = None
        if task.program:
            signal_error(self._device, code != OK)
        if task.answers:
            self._reply(code)

    # ---- time -------------------------------------------------------------------------------------------------------

    @property
    def next_ns(self) -> int | None:
        """When something is due."""
        run = self._device.run
        times = [self._pause_until, self._cycle_ns, None if run is None else run.end_ns]
        return min((max(t, self._device.now_ns) for t in times if t is not None), default=None)

    @property
    def moving(self) -> bool:
        """Axes are in motion, or stand still for a moment within one."""
        return self._device.run is not None or (isinstance(self._request, Pause) and self._request.reference)

    def tick(self) -> None:
        """Do what is due at the device's time."""
        now_ns, run = self._device.now_ns, self._device.run
        if self._cycle_ns is not None and now_ns >= self._cycle_ns:
            self._cycle_ns = None
            self.supervise()
        elif run is not None and now_ns >= run.end_ns:
            self._run_ended()
        elif self._pause_until is not None and now_ns >= self._pause_until:
            self._resume(None)

    @property
    def due(self) -> bool:
        """Something is due now."""
        return self.next_ns is not None and self.next_ns <= self._device.now_ns

    def _run_ended(self) -> None:
        ending = self._ending
        ended = Ended(self._device.finish_run(), by_event=ending is EVENT)
        if ending is None or ending is EVENT:
            self._resume(ended)
        elif ending.park:
            self._park(ended)
        else:
            assert ending.code is not None
            self._finish(ending.code)

    def _park(self, result: Ended | None) -> None:
        assert self.task is not None
        self.parked, self.task = (self.task, result), None
        self._request = self._ending = self._pause_until = None
        self._reply(STOPPED)

    # ---- stop and break ---------------------------------------------------------------------------------------------

    def stop(self) -> None:
        """Byte 253 or the stop key: park the task where it can be resumed; a reference run is broken off."""
        if isinstance(self._request, Travel | Pause) and self._request.reference:
            self.break_off()
        elif self._device.run is not None:
            if self._ending is None:
                self._slow_down(PARK)
        elif isinstance(self._request, Listen) or (isinstance(self._request, Pause) and self._request.stoppable):
            self._park(None)

    def stop_key(self) -> None:
        """The stop key; on the way to a reference switch it stands for the switch (2.2.22)."""
        if self._searching and self._ending is None:
            self._end_at_once()
        else:
            self.stop()

    def break_off(self, code: str = STOPPED) -> None:
        """Byte 255, or a port that ends the program: stop ramp, answer `code`, forget the rest."""
        if self.task is None:
            self.forget_parked()
        elif self._device.run is not None:
            self._slow_down(Ending(code=code))
        elif self.task.program or self.moving:
            self._finish(code)

    def _slow_down(self, ending: Ending) -> None:
        assert self._device.run is not None
        if self._ending is None:
            self._device.run = self._device.run.stopped(self._device.now_ns)
        self._ending = ending

    def _end_at_once(self) -> None:
        """The switch has opened; a break begun before stays a break."""
        assert self._device.run is not None
        self._device.run = self._device.run.cut(self._device.now_ns)
        self._ending = self._ending or EVENT

    @property
    def _searching(self) -> bool:
        return isinstance(self._request, Travel) and self._request.seek is not None

    # ---- the host's bytes -------------------------------------------------------------------------------------------

    @property
    def listening(self) -> bool:
        """The stored program waits for a byte."""
        return isinstance(self._request, Listen)

    def hear(self, byte: int) -> None:
        """Give the waiting program its byte."""
        self._resume(byte)

    # ---- inputs -----------------------------------------------------------------------------------------------------

    def input_changed(self, port: int, bit: int) -> None:
        """React to an input that has just changed, as far as it concerns safety or the motion in progress."""
        device = self._device
        if port == LIMIT_PORT:
            self._limit_changed(bit)
        if device.safety is not State.FAULT and not powered(device.inputs):
            self.power_lost()
        self._check_condition()
        if self.task is not None and self._cycle_ns is None:
            self._cycle_ns = device.now_ns + device.profile.cycle_ms * MILLISECOND_NS

    def _check_condition(self) -> None:
        """End a move whose condition has come true, with the stop ramp."""
        request = self._request
        if self._device.run is None or self._ending is not None or not isinstance(request, Travel):
            return
        if request.until is not None and request.until():
            self._slow_down(EVENT)

    def power_lost(self) -> None:
        """Fault: everything ends at once and answers 9."""
        device = self._device
        concerned = self.task is not None and (self.moving or self.task.program)
        if device.run is not None:
            device.finish_run()
        self.forget_parked()
        device.shut_down()
        if concerned:
            self._finish(FAULT)

    def supervise(self) -> None:
        """Once a cycle: the hood while something moves; in a stored program the ports of 4.2.11 to 4.2.14."""
        if self.moving and not hood_safe(self._device.inputs):
            self.power_lost()
        elif self.task is not None and self.task.program:
            code = watched(self._device)
            if code == FAULT:
                self.power_lost()
            elif code is not None:
                self.break_off(code)

    def _limit_changed(self, bit: int) -> None:
        device, axis = self._device, axis_of(bit)
        if not device.limits.edge(bit, device.now_ns) or device.run is None:
            return
        device.limits.found(bit, device.heading(axis) * device.direction[axis])
        if isinstance(self._request, Travel) and self._request.seek == axis:
            self._end_at_once()
        elif device.guards(axis):
            self._limit_error()

    def _limit_error(self) -> None:
        device = self._device
        if device.run is not None:
            device.finish_run()
        device.note(Event.LIMIT_STRUCK)
        device.lose_references()
        self.forget_parked()
        self._finish(LIMIT_SWITCH)

    def _blocked(self, run: StepRun) -> bool:
        """Would this run drive an axis further onto a switch it stands on?"""
        device = self._device
        return any(
            device.guards(axis) and device.limits.blocks(axis, _sense(run.path, run.first, run.last, axis))
            for axis in device.axis_list
        )


def _sense(path: Path, first: int, last: int, axis: int) -> int:
    """Direction (+1, -1, 0) in which an axis sets off: over the first ticks, or over all if it rests in those."""
    begin = path.displacement(first)[axis]
    for k in (min(first + SETTING_OFF, last), last):
        steps = path.displacement(k)[axis] - begin
        if steps:
            return 1 if steps > 0 else -1
    return 0


SETTING_OFF = 100
"""Ticks that tell which way a curved path sets off."""


def watched(device: Device) -> str | None:
    """What the ports watched in CNC mode demand: 9 (emergency), H (hood), F (abort), None (nothing)."""
    settings = device.settings
    watches: tuple[tuple[Watch, str], ...] = (
        (settings.emergency, FAULT),
        (settings.hood, HOOD_OPEN),
        (settings.abort, STOPPED),
    )
    for (port, mask, value), code in watches:
        if (device.inputs.port(port) ^ value) & mask:
            return code
    return None


def signal_error(device: Device, error: bool) -> None:
    """Write the error signal of 4.2.12: the value after an error, its complement while all is well."""
    _, mask, value = device.settings.error_signal
    level = value if error else ~value
    if mask:
        device.outputs["user"] = device.outputs["user"] & ~mask | level & mask
