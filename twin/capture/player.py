"""A controller that plays a captured stream: it ignores host and switches and makes each tick at its time (capture/1).

    ticks     ||||||||||        |||||||||||          |||
    motions   |---- 1 ---|      |---- 2 ----|        |-3-|        a pause of `gap_ns` or more ends a motion

The stream already contains the reactions of the real controller: where it stopped at a switch, the stream stops. The
counters begin at 0 at the position at the beginning of the capture; all is relative to that.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.capture.ticks import Ticks
from isel_twin.controller import Event, Output, SerialFormat
from isel_twin.motion import Displacement, StepRun

NAME = "player"  # its name in twins and recordings
GAP_NS = 100_000_000  # pause that ends a motion: no start-stop frequency is below 10 Hz
LEAD_NS = 1000  # a motion begins this long before its first tick, or at the end of the one before
_BLOCK = 1 << 12  # ticks between two stored sums


@dataclass(frozen=True, eq=False)
class CapturedPath:
    """The captured ticks of one motion. Implements isel_twin.motion.StepPath."""

    delta: NDArray[np.int8]

    @property
    def ticks(self) -> int:
        return len(self.delta)

    @property
    def axes(self) -> int:
        return int(self.delta.shape[1])

    @cached_property
    def _sums(self) -> NDArray[np.int64]:
        """int64 [blocks + 1, axes], sums of the ticks before each block."""
        starts = np.arange(0, max(len(self.delta), 1), _BLOCK)
        sums = np.zeros((len(starts) + 1, self.axes), dtype=np.int64)
        if len(self.delta):
            np.cumsum(np.add.reduceat(self.delta, starts, axis=0, dtype=np.int64), axis=0, out=sums[1:])
        return sums

    def deltas(self, first: int, last: int) -> NDArray[np.int8]:
        if not 0 <= first <= last <= self.ticks:
            raise IndexError(f"ticks {first}..{last} of a path of {self.ticks}")
        return self.delta[first:last]

    def displacement(self, k: int) -> Displacement:
        if not 0 <= k <= self.ticks:
            raise IndexError(f"tick {k} of a path of {self.ticks}")
        block = k // _BLOCK
        rest = self.delta[block * _BLOCK : k].sum(axis=0, dtype=np.int64)
        return tuple((self._sums[block] + rest).tolist())


@dataclass(frozen=True, eq=False)
class CapturedTimes:
    """Their times after the start of the motion. Implements isel_twin.motion.TimeLaw, without a stop ramp."""

    t_ns: NDArray[np.int64]
    start_ns: int

    @property
    def ticks(self) -> int:
        return len(self.t_ns)

    @property
    def duration_ns(self) -> int:
        return int(self.t_ns[-1]) - self.start_ns if len(self.t_ns) else 0

    def times(self, first: int, last: int) -> NDArray[np.int64]:
        if not 0 <= first <= last <= self.ticks:
            raise IndexError(f"ticks {first}..{last} of {self.ticks}")
        return self.t_ns[first:last] - self.start_ns

    def count(self, t_ns: int) -> int:
        return int(np.searchsorted(self.t_ns, t_ns + self.start_ns, side="right"))

    def cut(self, t_ns: int) -> CapturedTimes:
        made = self.count(t_ns)
        return self if made == self.ticks else CapturedTimes(self.t_ns[:made], self.start_ns)

    def stopped(self, t_ns: int) -> CapturedTimes:
        return self.cut(t_ns)


class Player:
    """Implements isel_twin.controller.Controller."""

    serial_format = SerialFormat(9600)
    fault = False

    def __init__(self, ticks: Ticks, contacts: tuple[str, ...] = (), gap_ns: int = GAP_NS) -> None:
        """contacts: of the machine; each gets a terminal of its own name."""
        axes = ticks.delta.shape[1]
        self.direction = (1,) * axes
        self.motions: tuple[StepRun, ...] = tuple(_motions(ticks, gap_ns))
        self.run: StepRun | None = None
        self._ticks, self._outputs = ticks, ticks.outputs
        self._contacts, self._gap_ns = contacts, gap_ns
        self._told = self._begun = 0
        self._made: Displacement = (0,) * axes
        self._t_ns = 0
        self._events: list[Event] = []

    def image(self) -> bytes:
        """The player as an image for `restored`: the flash memory in its recordings."""
        file = io.BytesIO()
        times, names, levels = zip(*self._outputs, strict=True) if self._outputs else ((), (), ())
        np.savez_compressed(
            file,
            after_ns=np.diff(self._ticks.t_ns, prepend=np.int64(0)),
            delta=self._ticks.delta,
            output_ns=np.array(times, dtype=np.int64),
            output=np.array(names, dtype=np.str_),
            level=np.array(levels, dtype=np.int64),
            contacts=np.array(self._contacts, dtype=np.str_),
            gap_ns=np.int64(self._gap_ns),
        )
        return file.getvalue()

    @staticmethod
    def restored(image: bytes) -> Player:
        """A new player from an image. Raises ValueError for a damaged one."""
        try:
            with np.load(io.BytesIO(image), allow_pickle=False) as file:
                t_ns = np.cumsum(file["after_ns"])
                columns = (file[name].tolist() for name in ("output_ns", "output", "level"))
                ticks = Ticks(t_ns, file["delta"], int(t_ns[-1]), tuple(zip(*columns, strict=True)))
                return Player(ticks, tuple(file["contacts"].tolist()), int(file["gap_ns"]))
        except Exception as error:  # numpy, zipfile and zlib have a dozen kinds for bytes that are none of theirs
            raise ValueError(f"is no image of a player: {' '.join(str(error).split())}") from None

    @property
    def counts(self) -> Displacement:
        if self.run is None:
            return self._made
        return tuple(m + n for m, n in zip(self._made, self.run.displacement(self._t_ns), strict=True))

    @property
    def next_ns(self) -> int | None:
        due = [self._outputs[self._told][0]] if self._told < len(self._outputs) else []
        if self.run is not None:
            due.append(self.run.end_ns)
        elif self._begun < len(self.motions):
            due.append(self.motions[self._begun].start_ns)
        return min(due, default=None)

    @property
    def idle(self) -> bool:
        """True once the whole capture has been played."""
        return self.next_ns is None

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._events.append(Output("current_lowering", 1))  # drives with step inputs do this by themselves
        self.advance(t_ns)

    def receive(self, t_ns: int, data: bytes) -> None:
        self.advance(t_ns)

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self.advance(t_ns)

    def advance(self, t_ns: int) -> None:
        self._t_ns = t_ns
        while self._told < len(self._outputs) and self._outputs[self._told][0] <= t_ns:
            _, name, level = self._outputs[self._told]
            self._events.append(Output(name, level))
            self._told += 1
        if self.run is not None and t_ns >= self.run.end_ns:
            self._made, self.run = self.counts, None
        elif self.run is None and self._begun < len(self.motions) and t_ns >= self.motions[self._begun].start_ns:
            self.run = self.motions[self._begun]
            self._begun += 1

    def take(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return {name: (name,) for name in self._contacts}

    def machine_overrides(self) -> Mapping[str, Any]:
        return {}


def _motions(ticks: Ticks, gap_ns: int) -> list[StepRun]:
    begins = [0, *(np.flatnonzero(np.diff(ticks.t_ns) >= gap_ns) + 1).tolist(), len(ticks.t_ns)]
    motions: list[StepRun] = []
    before = 0
    for begin, end in itertools.pairwise(begins):
        if begin < end:
            t_ns = ticks.t_ns[begin:end]
            start_ns = max(before, int(t_ns[0]) - LEAD_NS)
            motions.append(StepRun(CapturedPath(ticks.delta[begin:end]), CapturedTimes(t_ns, start_ns), start_ns))
            before = int(t_ns[-1])
    return motions
