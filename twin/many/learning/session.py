"""A recorded session for replay on candidates, each a `TwinSpec`.

    recording --- placed ---> the place at power-on from which the first reference runs take as long as recorded
              --- judged ---> the recording compared with what the candidate does

The place is not unique where one command references several axes: any with the same duration gives the same bytes, so
the axes are placed at the same part of their travels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.errors import CallError
from isel_twin.base.quiet import quietly
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.core.spec import TwinSpec
from isel_twin.language import Act, Language, create_language, needed
from isel_twin.plant import PlantError
from isel_twin.recordings.compare import Exchange, matched, paired
from isel_twin.recordings.host import Piece, play_host
from isel_twin.recordings.judging import USUAL, Comparison, Limits, act_of, judge

NEAR, FAR = 0.002, 0.98  # parts of the travel between which a machine is thought to stand at power-on
CLOSE_NS = MILLISECOND_NS  # a first reference run that fits so well needs no better place
TRIES = 4


@dataclass(frozen=True)
class Session:
    """Bytes of both directions with their times, and whose they are."""

    pieces: tuple[Piece, ...]
    controller: str
    limits: Limits = USUAL

    @property
    def language(self) -> Language:
        return needed(create_language(self.controller), self.controller)

    @cached_property
    def exchanges(self) -> Sequence[Exchange]:
        return paired(self.pieces, self.language)

    @cached_property
    def acts(self) -> Sequence[Act]:
        language = self.language
        return [act_of(language, one.command) for one in self.exchanges]

    def played(self, spec: TwinSpec) -> list[Exchange]:
        """The session on another machine. Raises CallError."""
        with quietly():
            return play_host(self.pieces, spec.build(keep_motions=1))

    def judged(self, spec: TwinSpec) -> Comparison:
        """The recording (A) compared with this candidate (B)."""
        limits = replace(self.limits, exact_b=True)
        return judge(matched(self.exchanges, self.played(spec)), self.language, limits)

    def tried(self, spec: TwinSpec) -> Comparison | None:
        """As `judged`; None for a candidate that cannot be built, or that leaves what its plant can follow."""
        try:
            return self.judged(spec)
        except (CallError, PlantError):
            return None

    def first_references(self) -> list[tuple[int, int]]:
        """Index of each command that references axes for the first time, and a mask of these."""
        found, known = [], 0
        for index, (one, act) in enumerate(zip(self.exchanges, self.acts, strict=True)):
            if (new := act.references & ~known) and one.replied_ns is not None:
                known |= act.references
                found.append((index, new))
        return found

    def placed(self, spec: TwinSpec) -> TwinSpec:
        """The candidate, switched on where the first reference runs take as long as in the recording."""
        twin = spec.build(keep_motions=1)
        place_mm = [float(mm) for mm in twin.machine_position_mm]
        travel_mm = [axis.travel_mm for axis in twin.machine.axes]
        for index, axes in self.first_references():
            mine = [axis for axis in range(len(CARRIAGES)) if axes >> axis & 1]
            part = Session(self._until(index), self.controller, self.limits)

            def late_ns(share: float, plant: str, mine: list[int] = mine, part: Session = part) -> float:
                """How much longer this reference run takes than recorded."""
                for axis in mine:
                    place_mm[axis] = share * travel_mm[axis]
                there = part.played(spec.with_(start_mm=tuple(place_mm), plant=plant))
                here = part.exchanges
                number = len(here) - 1
                same = len(there) > number and there[number].meaning == here[number].meaning
                took = there[number].duration_ns if same else None
                return math.nan if took is None else float(took - (here[number].duration_ns or 0))

            before = list(place_mm)
            if not _solve_place(late_ns, spec.plant):
                place_mm[:] = before
        return spec.with_(start_mm=tuple(place_mm))

    def _until(self, index: int) -> tuple[Piece, ...]:
        end_ns = self.exchanges[index].replied_ns or 0
        return tuple(piece for piece in self.pieces if piece[0] <= end_ns)


def _solve_place(late_ns: Callable[[float, str], float], plant: str) -> bool:
    """Put the axes where the run is as long as recorded: durations are nearly linear in the place, whose slope the
    kinematic plant has, too. False if this candidate does not make the run at all."""
    low, high = 0.05, 0.25
    at_low, at_high = late_ns(low, "kinematic"), late_ns(high, "kinematic")
    slope = (at_high - at_low) / (high - low)
    if math.isnan(slope) or slope == 0.0:
        return False
    share, late = low, at_low
    for _ in range(TRIES):
        share = min(max(share - late / slope, NEAR), FAR)
        late = late_ns(share, plant)
        if math.isnan(late):
            return False
        if abs(late) < CLOSE_NS or share in (NEAR, FAR):
            break
    return True
