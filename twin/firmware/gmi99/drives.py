"""The drives at the card's slots: status, readiness, reference run, faults, limit switches, E-stop.

The drives' own manual is not available: their behaviour is decided in gmi99/16 to gmi99/20. A drive at slot i has
address i, sixteen inputs and outputs, an encoder, and an indexer of its own for the reference run:

    speed     -10000 Hz until the motor-end switch is struck, brake
              ______
                    \\      ___ +2000 Hz until it is free: the encoder is latched at that edge
                     \\____/   \\__ on to the next zero pulse of the encoder, where the counter becomes 0

The indexer of the card is ready (IDXOFF = 0) when every drive of the mask N10 has supply, no fault, and has been
referenced or zeroed since the last time it lost one of them.

    E-stop, supply lost   stages off, set points end, queue and program are dropped, not ready
    drive fault           the same but for the stages: that drive has switched itself off; the others brake
    limit switch struck   not in a reference run: all axes brake at 4 B; queue and program are dropped, not ready
"""

from __future__ import annotations

import re
from collections.abc import Generator, Mapping, Sequence

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.controller import DriveInput, Drives, ReferenceSearch
from isel_twin.firmware.gmi99 import planner
from isel_twin.firmware.gmi99.board import Board
from isel_twin.firmware.gmi99.interpolator import Interpolator
from isel_twin.firmware.gmi99.queue import Queue
from isel_twin.firmware.gmi99.settings import SLOTS
from isel_twin.firmware.gmi99.uncoupled import Uncoupled
from isel_twin.firmware.gmi99.waiting import Wait
from isel_twin.motion import SetPointRun
from isel_twin.motion.indexer import Indexer, at_rest, braked

MECHANICAL = 3  # slots with a motor of the gantry: X, Y, Z; further ones have only set points
POWER_WAIT_NS = 500 * MILLISECOND_NS  # how long Q waits for the supply after its request
FAULT_NS = 20 * MILLISECOND_NS  # how long it waits for drives to clear their faults
SEARCH_HZ, FREE_HZ = 10_000.0, 2000.0
# increments after which a search ends without a switch: 1.2 times the longest travel of the gantry at 1 um
SEARCH_LENGTH = 480_000
FREE_LENGTH = 20_000
TURN = 5000  # increments from zero pulse to zero pulse, by default
DRIVE_ACCELERATION = 100_000.0  # increments/s^2 of a drive's own indexer
LIMIT_SHARPNESS = 4

# terminals of the contacts of machine and cabinet: inputs of drives, E-stop and supply of all of them (gmi99/19)
TERMINALS: Mapping[str, tuple[str, ...]] = {
    "slot0.estop": ("estop_1", "estop_2", "overtemperature"),
    "slot0.power": ("power_ok",),
    "e0.0": ("power_ok",),
    "e0.1": ("start",),
    "e0.2": ("stop",),
    "e0.3": ("hood_automatic",),
    "e0.4": ("hood_setup",),
    "e0.5": ("key",),
    "e0.6": ("probe",),
    "e0.7": ("spindle",),
    **{f"e1.{bit}": (f"user_{bit}",) for bit in range(6)},
    **{f"e{2 * slot + 1}.{6 + end}": (f"limit_{'xyz'[slot]}{end + 1}",) for slot in range(3) for end in (0, 1)},
}
_INPUT = re.compile(r"e([0-9]+)\.([0-7])")
_FAULT = re.compile(r"slot([0-9])\.fault")


class DriveBank:
    def __init__(self, board: Board, interpolator: Interpolator, uncoupled: Uncoupled, queue: Queue, turn: int) -> None:
        self._board, self._interpolator, self._queue, self._turn = board, interpolator, queue, turn
        self._uncoupled = uncoupled
        self.asked: Drives | None = None
        self.ready = False
        self.lost_by = ""  # what has ended readiness, until it is there again
        self.enabled = False
        self.searching = 0  # mask of axes that search or leave their switch (FB 254.3)
        self._zeroed = [False] * SLOTS
        self._faulty = [False] * SLOTS
        self.estop = True
        self._power = False
        self._serial = 0
        self._referencing = False
        self._edge = False  # a switch has changed since the last step of the reference run

    # ---- state ------------------------------------------------------------------------------------------------------

    @property
    def run(self) -> SetPointRun | None:
        return self._board.drives_run

    @property
    def at_rest(self) -> bool:
        return self.run is None

    def status(self, slot: int) -> int:
        """Status register of the drive at a slot, bit by bit as in 6.1.3 (FB 254.10)."""
        return (
            (not self._zeroed[slot])  # reference missing
            | (self.searching >> slot & 1) << 1  # its own indexer runs
            | self.is_overloaded(slot) << 2
            | self.estop << 3
            | self._is_in_position(slot) << 4
            | self.blocked(slot) << 9
        )

    def blocked(self, slot: int) -> bool:
        """True if it has no current: the stages are off, or this drive has switched itself off."""
        return not self.enabled or self._faulty[slot]

    def drive_inputs(self) -> Sequence[DriveInput]:
        return [DriveInput(f"slot{slot}.fault", slot, "fault") for slot in range(MECHANICAL)]

    def is_overloaded(self, slot: int) -> bool:
        return self.asked is not None and bool(self.asked.overloaded[slot])

    def _is_in_position(self, slot: int) -> bool:
        return self.asked is None or self.asked.in_position[slot]

    def in_position(self, mask: int) -> Generator[Wait, None, None]:
        axes = [slot for slot in range(SLOTS) if mask >> slot & 1]
        yield Wait(at_ns=self._board.now_ns + planner.PERIOD_NS)  # the drives still move to the last set point
        while not all(map(self._is_in_position, axes)):
            yield Wait(at_ns=self._interpolator.grid_ns(self._board.now_ns + 1))

    # ---- inputs -----------------------------------------------------------------------------------------------------

    def set_input(self, terminal: str, level: bool) -> None:
        """Take a changed level; levels at power-on come the same way."""
        if terminal == "slot0.estop":
            self.estop = not level
            if self.estop:
                self.lose("E-stop", stages=True)
        elif terminal == "slot0.power":
            self._power = level
            if not level:
                self.lose("the drives have no supply", stages=True)
        elif (match := _FAULT.fullmatch(terminal)) is not None:
            slot = int(match[1])
            self._faulty[slot] = level
            if level:
                self._zeroed[slot] = False
                self.lose(f"the drive at slot {slot} has switched itself off", stages=False)
        elif (match := _INPUT.fullmatch(terminal)) is not None:
            byte, bit = int(match[1]), int(match[2])
            self._board.images.set_drive_input(byte, bit, level)
            if byte % 2 and bit >= 6 and byte // 2 < SLOTS:
                self._switch(byte // 2, bit - 6, struck=not level)

    def _switch(self, slot: int, end: int, *, struck: bool) -> None:
        known = (slot, end) in self._board.struck
        self._board.struck[slot, end] = struck
        self._edge = True
        if not struck or not known:
            return
        run = self._board.path_run
        sense = 1 if end else -1
        on_path = run is not None and not self._board.ghost and self._speed(run, slot) * sense > 0
        if on_path or self._uncoupled.moves(slot, sense):
            self.lose(f"limit switch of slot {slot}", stages=False)

    def _speed(self, run: SetPointRun, slot: int) -> int:
        """Increments of the present or next tick."""
        k = min(run.count(self._board.now_ns), run.last - 1)
        return int(run.plan.deltas(max(k - 1, run.first), k + 1)[:, slot].sum()) if k >= run.first else 0

    # ---- losing readiness -------------------------------------------------------------------------------------------

    def lose(self, why: str, *, stages: bool) -> None:
        """Lose readiness: motion ends, queue and program are dropped; `stages`: switch them off."""
        was_ready, self.ready = self.ready, False
        interpolator = self._interpolator
        if stages:
            self._zeroed = [False] * SLOTS
            interpolator.cut()
            self._uncoupled.cut()
            self._end_run()
            self._enable(on=False)
        elif self._board.path_run is not None and not self._board.ghost:
            run = interpolator.release()
            sharp = LIMIT_SHARPNESS * 1000.0 * self._board.settings.b_hz_per_ms[0]
            k = run.next_tick(self._board.now_ns)
            self._board.drives_run = run.with_plan(braked(run.plan, k, run.period_ns, sharp))
        else:
            interpolator.cut()
            self.brake()
        if not stages:
            self._uncoupled.break_off(LIMIT_SHARPNESS)
        if was_ready:
            self.lost_by = why
            self._board.refuse(why)
        self._queue.drop()

    def _enable(self, *, on: bool) -> None:
        self.enabled = on
        self._board.output("stages", int(on))
        self._board.output("brake", int(on))

    def brake(self) -> None:
        """End a reference run with its ramp."""
        if self.run is not None and isinstance(self.run.plan, Indexer):
            self._replan(self.run.plan.stopped(self.run.next_tick(self._board.now_ns)))

    def _end_run(self) -> None:
        if self.run is not None:
            self._board.take_in(self.run.displacement(self._board.now_ns), ghost=False)
            self._board.drives_run = None

    def advance(self) -> None:
        if self.run is not None and not self._referencing and self._board.now_ns >= self.run.end_ns:
            self._end_run()

    # ---- becoming ready ---------------------------------------------------------------------------------------------

    def make_ready(self, mask: int, *, run: bool, indexer: bool = True) -> Generator[Wait, None, None]:
        """Q: switch on, zero or reference axes; then the indexer is ready if all drives are."""
        board = self._board
        if self.estop or board.uncoupled:
            board.refuse("Q: E-stop" if self.estop else "Q: an axis has left the interpolation (p4)")
            return
        board.output("power_request", 1)
        board.output("power_request", 0)
        if not self._power:
            yield Wait(until=lambda: self._power, at_ns=board.now_ns + POWER_WAIT_NS)
        if not self._power:
            board.refuse("Q: the drives have no supply")
            return
        axes = [slot for slot in range(SLOTS) if mask >> slot & 1]
        if any(self._faulty):
            board.output("drive_reset", 1)
            board.output("drive_reset", 0)
            yield Wait(until=lambda: not any(self._faulty), at_ns=board.now_ns + FAULT_NS)
        if not self.enabled:
            self._enable(on=True)
        if run:
            found = yield from self._reference([slot for slot in axes if slot < MECHANICAL])
            axes = [slot for slot in axes if slot >= MECHANICAL or slot in found]
        for slot in axes:
            board.set_counter(slot, 0)
            self._zeroed[slot] = True
        if not indexer:
            return
        wanted = [slot for slot in range(SLOTS) if board.settings.axis_mask >> slot & 1]
        self.ready = all(self._zeroed[slot] and not self._faulty[slot] for slot in wanted)
        if self.ready:
            self.lost_by = ""

    def _reference(self, axes: list[int]) -> Generator[Wait, None, list[int]]:
        """The reference run of several axes at once; return those that succeeded."""
        board = self._board
        self._serial += 1
        self._referencing = True
        plan = at_rest(SLOTS, planner.PERIOD_NS, DRIVE_ACCELERATION, ("reference", self._serial))
        board.drives_run = SetPointRun(plan, planner.PERIOD_NS, self._interpolator.grid_ns(board.now_ns))
        runs = {slot: self._axis(slot, board.counts[slot]) for slot in axes}
        found: list[int] = []
        for slot in axes:
            self._zeroed[slot] = False
            self.searching |= 1 << slot
            board.events.append(ReferenceSearch(slot))
        try:
            while runs:
                self._edge = False
                for slot, steps in list(runs.items()):
                    try:
                        next(steps)
                    except StopIteration as end:
                        del runs[slot]
                        self.searching &= ~(1 << slot)
                        if end.value:
                            found.append(slot)
                            board.events.append(ReferenceSearch(slot, found=True))
                        else:
                            board.refuse(f"the reference run of slot {slot} has failed")
                if runs:
                    yield Wait(until=lambda: self._edge, at_ns=self._next_stand_ns())
            if board.now_ns < board.drives_run.end_ns:
                yield Wait(at_ns=board.drives_run.end_ns)
            self._end_run()
        finally:
            self.searching = 0
            self._referencing = False
        return found

    def _next_stand_ns(self) -> int:
        """When the next moving axis stops."""
        run, plan, _ = self._indexer()
        times = (run.start_ns + plan.stands_at(slot) * run.period_ns for slot in range(SLOTS))
        return min((t_ns for t_ns in times if t_ns > self._board.now_ns), default=self._board.now_ns + 1)

    def _axis(self, slot: int, base: int) -> Generator[None, None, bool]:
        """The reference run of one drive, continued after every event."""
        near, far, struck = (slot, 0), (slot, 1), self._board.struck
        if near not in struck:
            return False
        if not struck[near]:
            self._go(slot, -SEARCH_LENGTH, SEARCH_HZ)
            while not struck[near]:
                if self._stands(slot) or struck.get(far, False):
                    self._brake(slot)
                    return False
                yield
            self._brake(slot)
            while not self._stands(slot):
                yield
        self._go(slot, FREE_LENGTH, FREE_HZ)
        while struck[near]:
            if self._stands(slot):
                return False
            yield
        zero = self.encoder(slot) - base + self._turn - self._past_zero_pulse(slot)
        self._brake(slot)
        while not self._stands(slot):
            yield
        self._go(slot, zero, FREE_HZ, absolute=True)
        while not self._stands(slot):
            yield
        return True

    def encoder(self, slot: int) -> int:
        """Measured position of a drive; the set point without an encoder."""
        if self.asked is not None and slot < len(self.asked.encoder):
            return self.asked.encoder[slot]
        return self._board.counts[slot]

    def _past_zero_pulse(self, slot: int) -> int:
        pulses = () if self.asked is None else self.asked.past_zero_pulse
        return pulses[slot] % self._turn if slot < len(pulses) else 0

    def _stands(self, slot: int) -> bool:
        run = self.run
        if run is None:
            return True
        return isinstance(run.plan, Indexer) and run.plan.stands(slot, run.count(self._board.now_ns))

    def _go(self, slot: int, way: float, speed: float, *, absolute: bool = False) -> None:
        """Move by a distance from standstill; absolute: to a place, from the start of the run."""
        _, plan, k = self._indexer()
        self._replan(plan.to(slot, k, way if absolute else plan.displacement(k)[slot] + way, speed))

    def _brake(self, slot: int) -> None:
        if self.run is not None:
            _, plan, k = self._indexer()
            self._replan(plan.braked(slot, k))

    def _indexer(self) -> tuple[SetPointRun, Indexer, int]:
        """The reference run, its plan, and the first tick that can still change."""
        assert self.run is not None
        assert isinstance(self.run.plan, Indexer)
        return self.run, self.run.plan, self.run.next_tick(self._board.now_ns)

    def _replan(self, plan: Indexer) -> None:
        assert self.run is not None
        self._board.drives_run = self.run.with_plan(plan)

    # ---- the host, through the card -------------------------------------------------------------------------------

    def information(self, slot: int) -> int:
        """Information character of a drive's status, its bits as those of the card (gmi99/16)."""
        moves = bool(self.searching >> slot & 1)
        return self.estop << 3 | moves << 4 | (not self._zeroed[slot]) << 6
