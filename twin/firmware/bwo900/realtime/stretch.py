"""A stretch: joined blocks as one motion, which grows while it runs.

    waiting blocks --> begin, append --> entries:  | block 1 | block 2 | ... | block n |      pieces of `Joined`
                                         made -----------^                                    so far

A stretch ends where the axes stop: at an exact stop, a dwell, an M00, functions that must be acknowledged. The
override, a stop and late blocks change the rest from the next tick on (`replan`). A held stretch goes on in a new run
with the rest of the motion (`resume`). A very long stretch continues in new runs without the finished pieces
(`MOST_PIECES`): the same set points in bounded memory.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.elements import Point
from isel_twin.firmware.bwo900.realtime.path import MotionLimits, PieceMaker
from isel_twin.motion import SetPointRun
from isel_twin.motion.joined import Joined, joined
from isel_twin.motion.pieces import Pieces

PERIOD_NS: Final = 2 * MILLISECOND_NS  # period of set points; the manual's position control takes 0.25 to 3 ms
MOST_PIECES: Final = 8192  # most pieces of a motion before finished ones are dropped: some 150 bytes each


@dataclass
class _Entry:
    """A block of the stretch, and the numbers of pieces of the stretch up to its beginning and its end."""

    block: PathBlock
    begins: int
    until: int
    speaks: bool  # `PathBlock.speaks`


class Stretch:
    """The present stretch, if any: its blocks, its motion, its run of set points."""

    def __init__(self) -> None:
        self.run: SetPointRun | None = None
        self._plan: Joined | None = None
        self._pieces: PieceMaker | None = None
        self._entries: deque[_Entry] = deque()
        self._acting: deque[_Entry] = deque()  # those of them that have an effect when they begin or end
        self._made = 0  # pieces of the stretch that were made in earlier runs of it
        self._serial = 0

    def __len__(self) -> int:
        """Blocks that are not over."""
        return len(self._entries)

    @property
    def first(self) -> PathBlock | None:
        return self._entries[0].block if self._entries else None

    @property
    def last(self) -> PathBlock | None:
        return self._entries[-1].block if self._entries else None

    @property
    def blocks(self) -> Iterator[PathBlock]:
        """The blocks that are not over."""
        return (entry.block for entry in self._entries)

    @property
    def runs(self) -> bool:
        return self.run is not None and self._plan is not None

    @property
    def brakes(self) -> bool:
        return self._plan is not None and self._plan.hold

    @property
    def held(self) -> bool:
        """True if its set points end before its pieces do."""
        return self._plan is not None and self._plan.held

    def over(self, now_ns: int) -> bool:
        return self.run is not None and now_ns >= self.run.end_ns

    def speed_mm_s(self, now_ns: int) -> float:
        run, plan = self.run, self._plan
        if run is None or plan is None or now_ns >= run.end_ns:
            return 0.0
        return plan.speed(run.count(now_ns))

    def next_ns(self, now_ns: int, refill: int | None) -> int:
        """When the set points end, the next block has an effect, or there is room for more blocks: at most `refill` are
        left; None: no more will come."""
        run, plan = self.run, self._plan
        if run is None or plan is None:
            return now_ns
        marks = [run.end_ns]
        if not plan.held:
            for entry in self._acting:
                if entry.speaks and entry is not self._entries[0]:
                    marks.append(self._time_of(entry.begins))
                    break
                if entry.block.post and entry is not self._entries[-1]:
                    marks.append(self._time_of(entry.until))
                    break
            if refill is not None and len(self._entries) > refill:
                marks.append(self._time_of(self._entries[-refill].until))
        return min(marks)

    def _time_of(self, pieces: int) -> int:
        """Time at which this number of pieces of the stretch is made."""
        assert self.run is not None
        assert self._plan is not None
        try:
            tick = self._plan.passed(pieces - self._made)
        except IndexError:
            return self.run.end_ns
        return self.run.start_ns + (tick - self.run.first) * PERIOD_NS

    def stand(self, limits: MotionLimits, position: Point) -> None:
        """Set the beginning of the next path, mm."""
        self._pieces = PieceMaker(limits, position)

    def clear(self) -> None:
        self._forget()
        self._plan, self.run = None, None

    def begin(self, blocks: Sequence[PathBlock], limits: MotionLimits, scale: float, now_ns: int) -> None:
        """Begin a stretch with these blocks. scale: the override. Raises ProgramError as `PieceMaker.pieces`."""
        assert self._pieces is not None
        self._pieces.limits = limits
        self._forget()
        self._made = 0
        self._pieces.stop()
        pieces = self._enter(blocks)
        self._serial += 1
        self._plan = joined(pieces, PERIOD_NS, sine=limits.sine, scale=scale, identity=self._serial)
        self.run = SetPointRun(self._plan, PERIOD_NS, now_ns)

    def append(self, blocks: Sequence[PathBlock], now_ns: int) -> None:
        """Append these blocks. Raises ProgramError as `PieceMaker.pieces`."""
        pieces = self._enter(blocks)
        if len(pieces):
            self.replan(now_ns, append=pieces)
            self._hand_over(now_ns)

    def _enter(self, blocks: Sequence[PathBlock]) -> Pieces:
        assert self._pieces is not None
        pieces, counts = self._pieces.pieces(blocks)
        done = self._entries[-1].until if self._entries else 0
        for block, count in zip(blocks, counts, strict=True):
            entry = _Entry(block, done, done + count, block.speaks)
            done = entry.until
            self._entries.append(entry)
            if entry.speaks or block.post:
                self._acting.append(entry)
        return pieces

    def _forget(self) -> None:
        self._entries.clear()
        self._acting.clear()

    def passed(self, now_ns: int) -> Iterator[tuple[PathBlock, PathBlock, int]]:
        """Remove finished blocks except the last one; yields each, the next one, and when that began."""
        run, plan = self.run, self._plan
        if run is None or plan is None:
            return
        made = self._made + plan.finished(run.count(now_ns))
        while len(self._entries) > 1 and self._entries[0].until <= made:
            began_ns = min(self._time_of(self._entries[0].until), now_ns)
            over = self._entries.popleft()
            if self._acting and self._acting[0] is over:
                self._acting.popleft()
            yield over.block, self._entries[0].block, began_ns

    def finish(self, *, gives_up: bool) -> PathBlock | None:
        """At the end of the set points: return the last block, or None if the path was held and is not given up."""
        assert self._plan is not None
        plan, self.run = self._plan, None
        made = self._made + plan.finished(plan.ticks)
        if plan.held and made < self._entries[-1].until and not gives_up:
            self._made = made
            return None
        last = self._entries[-1].block
        self.clear()
        return last

    def resume(self, scale: float, now_ns: int) -> None:
        assert self._plan is not None
        self._serial += 1
        self._plan = self._plan.remainder(self._serial, scale=scale)
        self.run = SetPointRun(self._plan, PERIOD_NS, now_ns)

    def hasten(self, speed_mm_s: float, now_ns: int) -> None:
        """Change the feed for the rest of the first block."""
        if self._plan is None:
            return
        wanted = (self._entries[0].until - self._made, speed_mm_s)
        if self.run is None:
            self._plan = self._plan.replanned(self._plan.ticks, wanted=wanted)
        else:
            self.replan(now_ns, wanted=wanted)

    def replan(self, now_ns: int, **changes: object) -> None:
        """Replan from the next tick on; changes as for `Joined.replanned`."""
        run, plan = self.run, self._plan
        if run is None or plan is None:
            return
        self._plan = plan.replanned(run.next_tick(now_ns), **changes)  # type: ignore[arg-type]
        self.run = run.with_plan(self._plan)

    def _hand_over(self, now_ns: int) -> None:
        """Drop finished pieces if there are many; the last tick stays, for the present speed."""
        run, plan = self.run, self._plan
        if run is None or plan is None or plan.known_pieces <= MOST_PIECES or now_ns < run.start_ns:
            return
        tick = run.count(now_ns)
        self._plan = plan.forgetting(max(tick - 1, run.first))
        start_ns = run.start_ns + (tick - run.first) * PERIOD_NS
        self.run = SetPointRun(self._plan, PERIOD_NS, start_ns, first=tick)
