"""The interpolator: from moves to set points every 4 ms; hold, resume, break off, and actions on the way.

    commands f, G, W ...  -->  rules, feed, coordinates  --+
    moves                 -->  pieces (planner, circle)  --+-->  plan (isel_twin.motion.joined)  -->  run

Every new move and every change of override, reduced speed or spindle speed replans from the next time of the grid,
which counts from power-on. A move begins at the next time of the grid.

A hold brakes along the path and ends the motion; the rest of the plan is the next motion after the hold. A break-off
brakes the same way and drops the rest. `cut` ends the motion at once.

N17 = 1: a motion takes its time and T0 counts, but no set points are sent: it is a ghost (gmi99/22).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from isel_twin.firmware.gmi99 import planner
from isel_twin.firmware.gmi99.board import Board
from isel_twin.firmware.gmi99.circle import circle
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError, require_place
from isel_twin.firmware.gmi99.settings import HIGHEST, LOWEST, SLOTS
from isel_twin.motion import SetPointRun
from isel_twin.motion.joined import Joined
from isel_twin.motion.path import added

Position = tuple[int, ...]


class OntoSwitchError(Exception):
    """An axis would move further onto its struck limit switch."""

    def __init__(self, slot: int) -> None:
        super().__init__(f"slot {slot} stands on the limit switch it would move onto")


@dataclass(frozen=True)
class _Mark:
    """An action after a number of pieces of the plan: the end of a move (no `act`), or an output."""

    pieces: int
    act: Callable[[], None] | None
    from_host: bool = False


@dataclass(frozen=True)
class _Circle:
    """A circle after G2 or G3: its centre relative to the start by slot, None if not yet known; {}: dropped."""

    clockwise: bool
    centre: dict[int, int] | None = None


class Interpolator:
    def __init__(self, board: Board) -> None:
        self._board = board
        self.feed_hz: int | None = None  # f; None: rapid (G0)
        self.absolute = True
        self.per_turn = False  # G95
        self.shortest_way = False  # G36 for the next move
        self.sources = [-1] * SLOTS  # the axis that each axis duplicates, -1: none
        self.spindle_rpm = 0
        self._plan: Joined | None = None
        self._end: Position = (0,) * SLOTS
        self._heading: planner.Heading | None = None
        self._marks: deque[_Mark] = deque()
        self._circle: _Circle | None = None
        self.breaking = False  # the motion is breaking off: no move can be planned
        self._serial = 0
        self._found: tuple[Joined | None, int, int | None] = None, 0, None

    # ---- state ------------------------------------------------------------------------------------------------------

    @property
    def run(self) -> SetPointRun | None:
        """The motion in execution, even a ghost."""
        return self._board.path_run

    @property
    def path_hz(self) -> float:
        """Present speed of the path, as f gives it."""
        if self.run is None:
            return 0.0
        assert self._plan is not None
        return self._plan.speed(self.run.count(self._board.now_ns))

    @property
    def at_rest(self) -> bool:
        return self._plan is None

    @property
    def host_moves(self) -> int:
        return sum(mark.from_host for mark in self._marks)

    @property
    def moves(self) -> int:
        return len(self._marks)

    @property
    def next_ns(self) -> int | None:
        if self.run is None:
            return None
        assert self._plan is not None
        tick = self._tick_after(self._plan, self._marks[0].pieces) if self._marks else None
        return self.run.end_ns if tick is None else min(self.run.end_ns, self.run.start_ns + tick * self.run.period_ns)

    def _tick_after(self, plan: Joined, pieces: int) -> int | None:
        """The tick at which so many pieces of a plan are complete; None if it is held before. It is asked for at every
        step of the clock, and searched for once."""
        if self._found[:2] != (plan, pieces):
            self._found = plan, pieces, plan.passed(pieces) if pieces <= plan.finished(plan.ticks) else None
        return self._found[2]

    def grid_ns(self, t_ns: int) -> int:
        """The first time of the grid that is not before t_ns."""
        origin = self._board.power_on_ns
        return origin - (origin - t_ns) // planner.PERIOD_NS * planner.PERIOD_NS

    # ---- commands ---------------------------------------------------------------------------------------------------

    def begin_circle(self, *, clockwise: bool) -> None:
        """G2, G3: the next move is the centre, the one after it the end."""
        self._circle = _Circle(clockwise)

    def move(self, instruction: Instruction, *, from_host: bool) -> None:
        """`V` or the general motion command, in its turn; from_host: not from a program. Raises OutOfRangeError for
        what cannot be moved, OntoSwitchError for a way that begins on a limit switch."""
        given = dict(zip(instruction.axes, instruction.values, strict=False))
        if self._circle is not None and self._circle.centre is None:
            sound = len(given) == 2 and any(given.values())
            self._circle = _Circle(self._circle.clockwise, given if sound else {})
            if not sound:
                raise OutOfRangeError("the centre of a circle wants two axes and a radius")
            return
        arc, self._circle = self._circle, None
        shortest, self.shortest_way = self.shortest_way, False
        for value in given.values():
            if not LOWEST <= value <= HIGHEST:
                raise OutOfRangeError(f"a coordinate is {value}; it must lie in {LOWEST} .. {HIGHEST}")
        if any(not self._board.settings.axis_mask >> axis & 1 for axis, value in given.items()):
            raise OutOfRangeError("an axis that N10 leaves out cannot be moved")
        if any(self._board.uncoupled >> axis & 1 for axis in given):
            raise OutOfRangeError("an axis that has left the interpolation (p4) cannot be moved by it")
        start = self._end if self._plan is not None else self._board.position
        way = self._way(start, given, shortest=shortest)
        rules = self.rules()
        feed = None if self.feed_hz is None else min(self.feed_hz, rules.speed_hz[0])
        try:
            if arc is None:
                made = planner.line(way, feed, rules, per_revolution=self.per_turn)
            else:
                if not arc.centre:
                    raise OutOfRangeError("a circle without a centre is dropped")
                made = circle(arc.centre, way, arc.clockwise, feed, rules, per_revolution=self.per_turn)
        except ValueError as error:
            raise OutOfRangeError(str(error)) from error
        if len(made.pieces):
            ways = np.vstack(([way], made.pieces.displacement.cumsum(axis=0)))
            for slot, position in enumerate(start):
                for extreme in (ways[:, slot].min(), ways[:, slot].max()):
                    require_place(slot, position + int(extreme))
            self._append(made, start, way, from_host=from_host)

    def _way(self, start: Position, given: dict[int, int], *, shortest: bool) -> Position:
        way = [0] * SLOTS
        for axis, value in given.items():
            if not self.absolute:
                way[axis] = value
                continue
            way[axis] = value + self._board.offsets.total(axis) - start[axis]
            turn = self._board.settings.per_turn[axis]
            if shortest and turn:
                way[axis] = (way[axis] + turn // 2) % turn - turn // 2
        for axis, source in enumerate(self.sources):
            if source >= 0:
                way[axis] = way[source]
        return tuple(way)

    def _append(self, made: planner.PreparedMove, start: Position, way: Position, *, from_host: bool) -> None:
        rules = self.rules()
        if self._plan is None:
            if (onto := self._board.struck_ahead(way)) is not None:
                raise OntoSwitchError(onto)
            self._serial += 1
            scale, ceiling_hz = self._scale(), self._ceiling_hz()
            self._plan = planner.start([made], rules, scale=scale, ceiling_hz=ceiling_hz, identity=self._serial)
            if self._holds():
                self._plan = self._plan.replanned(0, hold=True)
            else:
                self._begin()
        else:
            self._replace(planner.more(self._plan, self._tick(), [made], rules, self._heading))
        self._heading = made.last
        self._end = added(start, way)
        self._marks.append(_Mark(self._plan.pieces, None, from_host=from_host))

    def displaced(self, axis: int, way: int) -> None:
        """An axis is back in the interpolation, that far from where it left it."""
        self._end = (*self._end[:axis], self._end[axis] + way, *self._end[axis + 1 :])

    def on_the_way(self, act: Callable[[], None]) -> None:
        """Call `act` at the end of the present plan, at rest at once."""
        if self._plan is None:
            act()
        else:
            self._marks.append(_Mark(self._plan.pieces, act))

    def rules(self) -> planner.Rules:
        """The rules for planning moves."""
        board, settings = self._board, self._board.settings
        return planner.Rules(
            speed_hz=board.reduced_m_hz,
            acceleration_hz_per_ms=settings.b_hz_per_ms,
            ratio=settings.ratios,
            influence=tuple(not apart for apart in settings.no_influence),
            tool_speed=bool(settings.tool_speed),
            jump_hz=settings.fs0_hz,
            sharp_jump_hz=min(settings.fs90_hz, settings.fs0_hz),
            sine=bool(settings.sine_ramps),
            free_circles=bool(settings.fast_circles),
        )

    # ---- speeds and stops -------------------------------------------------------------------------------------------

    def _scale(self) -> float:
        percent = self._board.override_percent or None
        # 0 would not be a plan: a stop is a hold
        return planner.scale(percent, self.spindle_rpm if self.per_turn else None) or 1.0

    def _ceiling_hz(self) -> float:
        return float(self._board.settings.r_hz[0]) if self._board.reduced else math.inf

    def _holds(self) -> bool:
        board = self._board
        return board.stopped or board.override_percent == 0 or (self.per_turn and not self.spindle_rpm)

    def speeds_changed(self) -> None:
        """Take changes of override, reduced speed, spindle speed, stop flag or enable."""
        plan = self._plan
        if plan is None or self.breaking:
            return
        holds, scale, ceiling = self._holds(), self._scale(), self._ceiling_hz()
        if self.run is None:
            if not holds:
                self._go_on(scale, ceiling)
        elif (holds, scale, ceiling) != (plan.held, plan.scale, plan.ceiling):
            self._replace(plan.replanned(self._tick(), hold=holds, scale=scale, ceiling=ceiling))

    def break_off(self) -> None:
        self._circle = None
        self._marks.clear()
        if self.run is None:
            self._forget()
        elif not self.breaking:
            assert self._plan is not None
            self.breaking = True
            self._replace(self._plan.stopped(self._tick()))

    def cut(self) -> None:
        """End at once: no set point follows."""
        if self.run is not None:
            self._take_in()
        self._drop()

    def release(self) -> SetPointRun:
        """Give the motion in execution to the caller, who ends it, and drop the plan."""
        assert self.run is not None
        run, self._board.path_run = self.run, None
        self._drop()
        return run

    def _drop(self) -> None:
        self._circle = None
        self._marks.clear()
        self._forget()

    # ---- time -------------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Do what is due now: actions on the way, and the end."""
        if self.run is None:
            return
        assert self._plan is not None
        made = self._plan.finished(self.run.count(self._board.now_ns))
        while self._marks and self._marks[0].pieces <= made:
            mark = self._marks.popleft()
            if mark.act is not None:
                mark.act()
        if self.run is None or self._board.now_ns < self.run.end_ns:
            return
        self._take_in()
        if self.breaking or self._plan.finished(self._plan.ticks) >= self._plan.pieces:
            self._forget()

    def _begin(self) -> None:
        assert self._plan is not None
        self._board.ghost = bool(self._board.settings.motion_off)
        self._board.path_run = SetPointRun(self._plan, planner.PERIOD_NS, self.grid_ns(self._board.now_ns))

    def _go_on(self, scale: float, ceiling: float) -> None:
        """Continue a held plan as a new motion."""
        assert self._plan is not None
        self._serial += 1
        rest = self._plan.remainder(self._serial)
        done = self._plan.pieces - rest.pieces
        self._marks = deque(replace(mark, pieces=mark.pieces - done) for mark in self._marks)
        self._plan = rest.replanned(0, scale=scale, ceiling=ceiling, hold=False)
        self._begin()

    def _take_in(self) -> None:
        assert self.run is not None
        self._board.take_in(self.run.displacement(self._board.now_ns), ghost=self._board.ghost)
        self._board.path_run = None

    def _forget(self) -> None:
        self._plan = self._heading = None
        self.breaking = False
        while self._marks:  # actions after the last move
            mark = self._marks.popleft()
            if mark.act is not None:
                mark.act()

    def _replace(self, plan: Joined) -> None:
        self._plan = plan
        if self.run is not None:
            self._board.path_run = self.run.with_plan(plan)

    def _tick(self) -> int:
        """The first tick that can still change; the last one of a held plan."""
        assert self._plan is not None
        return self._plan.ticks if self.run is None else self.run.next_tick(self._board.now_ns)
