"""The moves of a cycle, one after the other; at each place of a pattern those of the machining cycle."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice

from isel_twin.firmware.bwo900.analysis.cycles.call import Call, CycleMove


class Moves(Iterator[CycleMove]):
    """Moves of a cycle. Cycles are pure functions: a copy restarts the cycle and skips the moves made."""

    def __init__(self, cycles: Mapping[int, object], number: int, call: Call) -> None:
        """cycles: functions by G number, `Call -> Iterator[CycleMove]`; number: the one called."""
        self._cycles, self._number, self._call = cycles, number, call
        self.made = 0
        self._rest: Iterator[CycleMove] | None = None

    def __next__(self) -> CycleMove:
        if self._rest is None:
            self._rest = islice(self._all(), self.made, None)
        move = next(self._rest)
        self.made += 1
        return move

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_rest": None}

    def _all(self) -> Iterator[CycleMove]:
        call = self._call
        place = call.position
        for move in self._cycles[self._number](call):  # type: ignore[operator]
            yield move
            place = tuple(move.target.get(axis, value) for axis, value in enumerate(place))
            if move.cycle is not None:
                here = {axis: place[axis] for axis in (call.plane.first, call.plane.second)}
                within = replace(call, position=place, words=here, inner=None, polar=False)
                for step in self._cycles[move.cycle](within):  # type: ignore[operator]
                    yield step
                    place = tuple(step.target.get(axis, value) for axis, value in enumerate(place))
