"""Events during a command or program, and their effects, which the executor carries out.

One task at a time:

    its activity ends            `0`, or the code of its Refusal
    stop (253, stop key)         stop ramp, `F`, parked; a start resumes it. A reference run is broken off (imc/11)
    break (255, port abort)      stop ramp, its code, gone (imc/13)
    condition come true          stop ramp, goes on
    reference switch             struck ends the search at once, closed the way out of it; goes on
    limit switch                 ends at once, `2`
    power lost                   ends at once, `9`

An input for safety or motion acts when it changes; the hood, and the ports that a stored program watches, are polled
once a cycle (imc/30).
"""

from __future__ import annotations

from dataclasses import dataclass

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.firmware.activity import Activity, Listen, Unfinished
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.limits import axis_of
from isel_twin.firmware.imc.moves import sense
from isel_twin.firmware.imc.ports import LIMIT_PORT
from isel_twin.firmware.imc.purpose import WAITING, Reference, Until
from isel_twin.firmware.imc.replies import FAULT, HOOD_OPEN, LIMIT_SWITCH, NOT_REFERENCED, OK, STOPPED, Refusal
from isel_twin.firmware.imc.safety import State, hood_safe, powered
from isel_twin.motion import Displacement, StepRun


@dataclass
class Task:
    """A command in progress. line: as sent, empty for the start key; answers: the host gets a reply at its end (after a
    stop always); program: a stored one."""

    line: bytes
    answers: bool
    program: bool


class Supervisor:
    def __init__(self, device: Device) -> None:
        self._device = device
        self._executor = device.executor
        self.task: Task | None = None
        self.parked: Task | None = None
        """A stopped task that can be resumed."""
        self._stood: tuple[tuple[bool, ...], Displacement] = ((), ())
        """References and directions of the axes when it was stopped."""
        self._cycle_ns: int | None = None

    # ---- starting and ending ----------------------------------------------------------------------------------------

    def start(self, activity: Activity, line: bytes, *, answers: bool, program: bool = False) -> None:
        """Begin a task; none is in progress."""
        self.task = Task(line, answers, program)
        self._executor.start(activity, self._ended)

    def resume(self, *, answers: bool) -> None:
        """Resume the parked task. answers: the host has requested it and gets a reply at its end."""
        assert self.parked is not None
        self.task, self.parked = self.parked, None
        self.task.answers |= answers
        self._executor.resume()

    def require_unchanged(self) -> None:
        """Raise Refusal(R) if an axis has lost its reference or changed its direction since the stop (imc/27)."""
        referenced, direction = self._stood
        lost = any(was and not now for was, now in zip(referenced, self._device.referenced, strict=True))
        if lost or direction != self._device.direction:
            raise Refusal(NOT_REFERENCED)

    def forget_parked(self) -> None:
        self.parked = None
        self._executor.forget()

    def discard(self) -> None:
        """Reset: end and drop everything at once, without a reply."""
        self.task = self.parked = None
        self._executor.discard()

    def _ended(self, reason: Unfinished | None) -> None:
        assert self.task is not None
        assert reason is None or isinstance(reason, Refusal)
        task, self.task = self.task, None
        code = OK if reason is None else reason.code
        if code == OK:
            self._device.made(task.line)
        elif code != STOPPED:  # byte 255 is the host's own will
            self._device.hindered(task.line, code)
        if task.program:
            signal_error(self._device, code != OK)
        if task.answers or code == STOPPED:
            self._device.send(code)

    def _parked(self) -> None:
        self.parked, self.task = self.task, None
        self._stood = tuple(self._device.referenced), self._device.direction
        self._device.send(STOPPED)

    @property
    def next_ns(self) -> int | None:
        next_ns, cycle_ns = self._executor.end_ns, self._cycle_ns
        if cycle_ns is not None and (next_ns is None or cycle_ns < next_ns):
            next_ns = cycle_ns
        now_ns = self._executor.now_ns
        return now_ns if next_ns is not None and next_ns < now_ns else next_ns

    @property
    def moving(self) -> bool:
        """True while axes move, including short rests within a reference run."""
        return self._executor.motion is not None or isinstance(self._executor.purpose, Reference)

    def tick(self) -> bool:
        """Do what is due now; False if nothing is."""
        if self._cycle_ns is None or self._cycle_ns > self._executor.now_ns:
            return self._executor.tick()
        self._cycle_ns = None
        self._supervise()
        return True

    def _supervise(self) -> None:
        """Check once a cycle the hood during motion, and in a stored program the ports of 4.2.11 to 4.2.14."""
        if self.moving and not hood_safe(self._device.inputs):
            self._power_lost()
        elif self.task is not None and self.task.program:
            code = watched(self._device)
            if code == FAULT:
                self._power_lost()
            elif code is not None:
                self._device.hindered(self.task.line, code)
                self.break_off(code)

    # ---- the host's bytes, the keys ---------------------------------------------------------------------------------

    @property
    def listening(self) -> bool:
        """True if the stored program waits for a byte."""
        return isinstance(self._executor.request, Listen)

    def stop(self) -> bool:
        """Park the task, or break off a reference run; False if ignored, as in a delay of a program (3.2.6)."""
        executor = self._executor
        if isinstance(executor.purpose, Reference):
            self.break_off()
        elif executor.motion is not None or self.listening or executor.purpose == WAITING:
            executor.park(self._parked)
        else:
            return self.task is None or not self.task.program
        return True

    def stop_key(self) -> bool:
        """The stop key; on the way to a reference switch it acts as the switch (2.2.22). Returns as `stop`."""
        purpose = self._executor.purpose
        if isinstance(purpose, Reference) and purpose.seek is not None and not self._executor.stopping:
            self._executor.cut()
            return False
        task, stopped = self.task, self.stop()
        if stopped and task is not None:
            self._device.hindered(task.line, STOPPED)
        return stopped

    def break_off(self, code: str = STOPPED) -> None:
        """Byte 255, or a port that ends the program: stop ramp, answer `code`, drop the rest."""
        if self.task is None:
            self.forget_parked()
        elif self.moving or self.task.program:
            self._executor.break_off(Refusal(code))

    def input_changed(self, port: int, bit: int) -> None:
        device = self._device
        if port == LIMIT_PORT:
            self._limit_changed(bit)
        if device.safety is not State.FAULT and not powered(device.inputs):
            self._power_lost()
        purpose = self._executor.purpose
        if isinstance(purpose, Until) and not self._executor.stopping and purpose.condition():
            self._executor.event()
        if self.task is not None and self._cycle_ns is None:
            self._cycle_ns = device.now_ns + device.profile.cycle_ms * MILLISECOND_NS

    def _power_lost(self) -> None:
        """Fault: everything ends at once and answers 9."""
        concerned = self.task is not None and (self.moving or self.task.program)
        self.forget_parked()
        self._device.shut_down()
        if concerned:
            self._executor.abort(Refusal(FAULT))

    def _limit_changed(self, bit: int) -> None:
        device, run, axis = self._device, self._executor.motion, axis_of(bit)
        struck = device.limits.edge(bit, device.now_ns)
        if self._executor.purpose == Reference(leave=axis) and not device.limits.struck(axis):
            self._executor.cut()
        if not struck or run is None:
            return
        device.limits.found(bit, heading(run, device.now_ns, axis) * device.direction[axis])
        if self._executor.purpose == Reference(seek=axis):
            self._executor.cut()
        elif device.guards(axis):
            device.limit_struck(axis)
            self.forget_parked()
            self._executor.abort(Refusal(LIMIT_SWITCH))


def heading(run: StepRun, now_ns: int, axis: int) -> int:
    """Counter direction (+1, -1, 0) in which a motion moves an axis, over its last ticks."""
    made = run.count(now_ns)
    # a slow axis may not have stepped within the last 100 ticks
    return sense(run.path, axis, (max(made - 100, 0), made), (0, made))


def watched(device: Device) -> str | None:
    """The code by the ports watched in CNC mode: 9 (emergency), H (hood), F (abort) or None."""
    settings = device.settings
    watches = (settings.emergency, FAULT), (settings.hood, HOOD_OPEN), (settings.abort, STOPPED)
    for (port, mask, value), code in watches:
        if (device.inputs.port(port) ^ value) & mask:
            return code
    return None


def signal_error(device: Device, error: bool) -> None:
    """Write the error signal of 4.2.12: its value after an error, else the complement."""
    _, mask, value = device.settings.error_signal
    level = value if error else ~value
    if mask:
        device.outputs["user"] = device.outputs["user"] & ~mask | level & mask
