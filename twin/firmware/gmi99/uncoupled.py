"""Axes that leave the interpolation (3.1.1 p4; gmi99/32): each runs a program of the store by itself, or turns.

    p4;n;axis,1      program n, of which the moves of that axis, f, G0, G90, G91, p10 and p3;2 are for it
    p4;rpm;axis,2    it turns, N40 increments a revolution, in either sense; 0: it brakes, and is coupled again
                     After FB 254.30 with 1 it follows the speed of the path from its next p4 on, in the proportion of
                     its speed and f at that moment (6.1.4); FB 254.30 with 0 ends that
    p4;0;axis,0      a normal command that waits until the axis has done its program

An axis moves with its own M and B from place to place, beside the others and the path. The stop flag holds it
(one that follows the path stands with it), a break-off brakes it and forgets its program.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable
from dataclasses import replace

from isel_twin.firmware.gmi99 import planner
from isel_twin.firmware.gmi99.board import Board
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError, require_place
from isel_twin.firmware.gmi99.interpolator import Interpolator
from isel_twin.firmware.gmi99.settings import HIGHEST, LOWEST, SLOTS
from isel_twin.firmware.gmi99.waiting import Wait
from isel_twin.motion import SetPointRun
from isel_twin.motion.indexer import Indexer, at_rest

FAR = 1 << 40  # increments: an axis that turns does not come there

Program = Generator[Wait, None, None]
Direct = Callable[[Instruction], Program | None]


class Uncoupled:
    def __init__(self, board: Board, interpolator: Interpolator) -> None:
        self._board, self._interpolator = board, interpolator
        self._programs: dict[int, tuple[Program, Wait]] = {}
        self._turns_hz: dict[int, float] = {}  # of each axis that turns, now
        self._asked_hz: dict[int, float] = {}  # as p4 gave it
        self._gears: dict[int, float] = {}  # of those that follow the path: Hz for each Hz of the path
        self.follows_feed = False  # FB 254.30
        self._goals: dict[int, tuple[int, float]] = {}  # of each axis that moves: its place, Hz
        self._began: dict[int, int] = {}  # where each axis was when it left the interpolation
        self._ending: set[int] = set()  # axes that brake, and are coupled when they stand
        self._held = False
        self._serial = 0

    @property
    def mask(self) -> int:
        return sum(1 << axis for axis in self._began)

    @property
    def working(self) -> bool:
        """True while an axis has a program, or brakes."""
        return bool(self._programs or self._ending)

    @property
    def next_ns(self) -> int | None:
        board, run = self._board, self._board.uncoupled_run
        times = [wait.at_ns for _, wait in self._programs.values() if wait.at_ns is not None]
        if self._gears and board.path_run is not None:
            times.append(self._interpolator.grid_ns(board.now_ns + 1))
        if run is not None:
            plan = _indexer(run)
            times += [run.start_ns + plan.stands_at(axis) * run.period_ns for axis in self._began]
            times.append(run.end_ns)
        return min((t for t in times if t > board.now_ns), default=None)

    # ---- commands ---------------------------------------------------------------------------------------------------

    def start(self, axis: int, commands: Iterable[Instruction], direct: Direct) -> Program:
        """Run a program on an axis, once it is free. direct: carries out `p10`."""
        while axis in self._began:
            yield Wait(until=lambda: axis not in self._began)
        self._uncouple(axis)
        self._programs[axis] = self._commands(axis, tuple(commands), direct), Wait(until=lambda: True)
        self.advance()

    def turn(self, axis: int, rev_min: int) -> None:
        """Turn an axis at that speed. Raises OutOfRangeError without N40, and for an axis that runs a program."""
        per_turn = self._board.settings.per_turn[axis]
        if not per_turn:
            raise OutOfRangeError("an axis that turns wants the increments of a revolution (N40)")
        if axis in self._programs:
            raise OutOfRangeError("the axis runs a program")
        if not rev_min and axis not in self._began:
            return
        self._uncouple(axis)
        self._ending.discard(axis)
        asked_hz = self._asked_hz[axis] = rev_min * per_turn / 60.0
        self._gears.pop(axis, None)
        if self.follows_feed and rev_min:
            self._gears[axis] = asked_hz / (self._interpolator.feed_hz or self._board.settings.m_hz[0])
            asked_hz = self._gears[axis] * self._interpolator.path_hz
        self._set_speed(axis, asked_hz)

    def follow_feed(self, *, on: bool) -> None:
        """FB 254.30."""
        self.follows_feed = on
        for axis in [] if on else list(self._gears):
            del self._gears[axis]
            self._set_speed(axis, self._asked_hz[axis])

    def wait(self, axis: int) -> Program:
        """Until the axis has no program."""
        while axis in self._programs:
            yield Wait(until=lambda: axis not in self._programs)

    # ---- time -------------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Do what is due now."""
        if self._board.stopped is not self._held:
            self._held = self._board.stopped
            for axis in list(self._goals):
                self._go(axis)
            for axis in list(self._turns_hz):
                self._turn(axis)
        for axis in list(self._programs):
            self._go_on(axis)
        for axis, gear in self._gears.items():
            self._set_speed(axis, gear * self._interpolator.path_hz)
        for axis in [axis for axis in self._turns_hz if self._stands(axis) and not self._held]:
            self._turn(axis)
        for axis in [axis for axis in self._ending if self._stands(axis)]:
            self._couple(axis)
        run = self._board.uncoupled_run
        if run is not None and self._board.now_ns >= run.end_ns:
            self._take_in()

    def break_off(self, sharpness: float = 1.0) -> None:
        """Brake all axes, with so many times their ramp, and forget what they were to do."""
        for program, _ in self._programs.values():
            program.close()
        self._programs.clear()
        self._turns_hz.clear()
        self._gears.clear()
        self._goals.clear()
        for axis in self._began:
            self._ending.add(axis)
            self._brake(axis, sharpness)

    def cut(self) -> None:
        """No set point follows."""
        self.break_off()
        self._take_in()
        self.advance()

    def _uncouple(self, axis: int) -> None:
        self._began.setdefault(axis, self._board.counts[axis])
        self._board.uncoupled = self.mask

    def _couple(self, axis: int) -> None:
        began = self._began.pop(axis)
        self._ending.discard(axis)
        self._board.uncoupled = self.mask
        self._interpolator.displaced(axis, self._board.counts[axis] - began)

    def _go_on(self, axis: int) -> None:
        """Carry on with the program of an axis up to its next wait."""
        program, wait = self._programs[axis]
        while wait.until() or (wait.at_ns is not None and wait.at_ns <= self._board.now_ns):
            try:
                wait = next(program)
            except (StopIteration, OutOfRangeError) as end:
                if isinstance(end, OutOfRangeError):
                    self._board.refuse(f"the program of axis {axis}: {end}")
                del self._programs[axis]
                self._couple(axis)
                return
        self._programs[axis] = program, wait

    def _commands(self, axis: int, commands: tuple[Instruction, ...], direct: Direct) -> Program:
        board = self._board
        speed, absolute = float(board.settings.m_hz[axis + 1]), True
        for instruction in commands:
            letter = "" if instruction.is_move else chr(instruction.code)
            if instruction.is_move:
                value = self._value(axis, instruction)
                way = value + board.offsets.total(axis) - board.position[axis] if absolute else value
                require_place(axis, board.position[axis] + way)
                self._goals[axis] = board.counts[axis] + way, speed
                self._go(axis)
                yield Wait(until=lambda: self._stands(axis) and board.counts[axis] == self._goals[axis][0])
                del self._goals[axis]
            elif letter == "f" and instruction.p1:
                speed = float(min(instruction.p1, board.settings.m_hz[axis + 1]))
            elif letter == "G" and instruction.p1 in (0, 90, 91):
                absolute = absolute if instruction.p1 == 0 else instruction.p1 == 90
                speed = float(board.settings.m_hz[axis + 1]) if instruction.p1 == 0 else speed
            elif letter == "p" and instruction.p1 == 10:
                yield from direct(instruction) or ()
            elif letter == "p" and (instruction.p1, instruction.p2) == (3, 2):
                return
            else:
                raise OutOfRangeError(f"{letter}{instruction.p1} is nothing for a single axis")

    def _value(self, axis: int, instruction: Instruction) -> int:
        """The coordinate of a move of that axis alone."""
        given = dict(zip(instruction.axes, instruction.values, strict=False))
        if instruction.code == ord("V"):
            given = {other: value for other, value in given.items() if value or other == axis}
        if list(given) != [axis] or not LOWEST <= given[axis] <= HIGHEST:
            raise OutOfRangeError("a move of another axis, or beyond the coordinates")
        if (struck := self._board.struck_ahead([given[axis] * (slot == axis) for slot in range(SLOTS)])) is not None:
            raise OutOfRangeError(f"slot {struck} stands on the limit switch it would move onto")
        return given[axis]

    # ---- motion -----------------------------------------------------------------------------------------------------

    def _go(self, axis: int) -> None:
        goal, speed = self._goals[axis]
        if self._held:
            self._brake(axis)
        else:
            place, stands = self._made(axis) + goal - self._board.counts[axis], self._stands(axis)
            self._plan(axis, lambda plan, tick: (plan.to if stands else plan.towards)(axis, tick, place, speed))

    def _set_speed(self, axis: int, hz: float) -> None:
        most = self._board.settings.m_hz[axis + 1]
        limited = min(max(hz, -most), most)
        if self._turns_hz.get(axis) != limited:
            self._turns_hz[axis] = limited
            self._turn(axis)

    def _turn(self, axis: int) -> None:
        wanted = self._turns_hz[axis]
        if not wanted and axis not in self._gears:
            del self._turns_hz[axis]
            self._ending.add(axis)
        now_hz = self._speed(axis)
        held = self._held and axis not in self._gears
        if held or not wanted or wanted * now_hz < 0.0:
            self._brake(axis)
        else:
            place, stands = self._made(axis) + math.copysign(FAR, wanted), self._stands(axis)
            self._plan(axis, lambda plan, tick: (plan.to if stands else plan.towards)(axis, tick, place, abs(wanted)))

    def _brake(self, axis: int, sharpness: float = 1.0) -> None:
        self._plan(axis, lambda plan, tick: plan.braked(axis, tick, sharpness))

    def _plan(self, axis: int, change: Callable[[Indexer, int], Indexer]) -> None:
        board, run = self._board, self._board.uncoupled_run
        ramp = 1000.0 * board.settings.b_hz_per_ms[axis + 1]
        if run is None:
            self._serial += 1
            rest = at_rest(SLOTS, planner.PERIOD_NS, ramp, ("uncoupled", self._serial))
            run = SetPointRun(rest, planner.PERIOD_NS, self._interpolator.grid_ns(board.now_ns))
        plan, tick = replace(_indexer(run), acceleration=ramp), run.next_tick(board.now_ns)
        board.uncoupled_run = run.with_plan(change(plan, tick))
        if not board.uncoupled_run.last:
            board.uncoupled_run = None

    def _made(self, axis: int) -> float:
        run = self._board.uncoupled_run
        return 0.0 if run is None else float(run.displacement(self._board.now_ns)[axis])

    def _speed(self, axis: int) -> float:
        """Increments of the present or next tick."""
        run = self._board.uncoupled_run
        if run is None or self._stands(axis):
            return 0.0
        k = run.count(self._board.now_ns)
        return float(run.plan.deltas(max(k - 1, 0), min(k + 1, run.last))[:, axis].sum())

    def moves(self, axis: int, sense: int) -> bool:
        """True if an uncoupled axis moves that way."""
        return axis in self._began and self._speed(axis) * sense > 0.0

    def _stands(self, axis: int) -> bool:
        run = self._board.uncoupled_run
        return run is None or _indexer(run).stands(axis, run.count(self._board.now_ns))

    def _take_in(self) -> None:
        if (run := self._board.uncoupled_run) is not None:
            self._board.take_in(run.displacement(self._board.now_ns), ghost=False)
            self._board.uncoupled_run = None


def _indexer(run: SetPointRun) -> Indexer:
    assert isinstance(run.plan, Indexer)
    return run.plan
