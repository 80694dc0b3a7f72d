"""The moves of a cycle, one after the other; at each place of a pattern those of the machining cycle."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import replace

from isel_twin.firmware.bwo900.analysis.cycles.call import Answer, Call, CycleMove
from isel_twin.firmware.bwo900.numbers import G


class Moves(Iterator[CycleMove]):
    """Moves of a cycle. Cycles depend on their call and on the answers alone: a copy restarts the cycle and skips the
    moves made."""

    def __init__(self, cycles: Mapping[int, object], number: int, call: Call) -> None:
        """cycles: functions by G number, `Call -> Iterator[CycleMove]`; number: the one called."""
        self._cycles, self._number, self._call = cycles, number, call
        self.made = 0
        self._over = False
        self._answers: dict[int, Answer] = {}  # by the number of the move, from 1
        self._rest: Generator[CycleMove, Answer, None] | None = None

    def answer(self, answer: Answer) -> None:
        """Answer to the last move, a watched one."""
        self._answers[self.made] = answer

    def pass_over(self) -> None:
        """Make no further move."""
        self._over = True

    def __next__(self) -> CycleMove:
        if self._over:
            raise StopIteration
        if self._rest is None:
            self._rest = self._all()
            for number in range(self.made):
                self._rest.send(self._answers.get(number))
        move = self._rest.send(self._answers.get(self.made))
        self.made += 1
        return move

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_rest": None}

    def _all(self) -> Generator[CycleMove, Answer, None]:
        call = self._call
        if self._number == G.MEASURING:
            yield from self._cycles[self._number](call)  # type: ignore[operator]
            return
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
