"""Analysis ahead of the real time: analysed blocks that wait for execution.

    interpreter --> contour (G12, G123) --> radius correction (G41, G42) --> splines (G50, G51) --> waiting blocks
                    each may hold blocks back until the next one comes, or until `flush`

Analysis goes on until `AHEAD` blocks wait, the program ends, an error comes, or the interpreter itself waits: for a
block to be executed, or for a parameter (polled every block cycle). While it waits for the next block of a fed program,
or for a condition, nothing is flushed: the next block belongs to the same contour. An error is held until the blocks
before it are executed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Protocol

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.geometry.contour import Contour
from isel_twin.firmware.bwo900.geometry.offset import Offset
from isel_twin.firmware.bwo900.geometry.spline import Spline
from isel_twin.firmware.bwo900.messages import Effect, Message, ProgramError, message
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.realtime.surroundings import Surroundings, unmoved

BLOCK_NS: Final = 1_500_000  # block cycle time (manual: below 1.5 to 6 ms), of blocks without a path
AHEAD: Final = 400  # blocks analysed ahead of the one in execution
FILTERED: Final = (P.CORNER_ARC, P.SPLINE_BULGE)
REFILL: Final = 200  # analysis goes on when at most this many wait


class Filter(Protocol):
    """A stage that blocks pass on their way to the path; raises ProgramError."""

    @property
    def idle(self) -> bool:
        """True if it holds nothing back and passes on blocks that do not ask for it (`PathBlock.asks_filters`)
        unchanged: then it need see only the last one of them."""

    def push(self, block: PathBlock) -> list[PathBlock]: ...
    def flush(self) -> list[PathBlock]: ...


def filters(parameters: Parameters) -> list[Filter]:
    """New filters, in their order: contour, radius correction (P8845), splines (P8847)."""
    arc, bulge = (parameters.get(number) if parameters.loaded(number) else None for number in FILTERED)
    in_place = parameters.readings.plane_change_in_place
    return [Contour(), Offset(arc, in_place=in_place), Spline(bulge or 0.0)]


def run(interpreter: Interpreter, stages: Sequence[Filter], most: int) -> list[PathBlock]:
    """Analyse at most so many plain blocks at once and pass them through idle filters; none: one after the other."""
    blocks = interpreter.run(most) if all(stage.idle for stage in stages) else []
    for stage in stages:
        for block in blocks[-1:]:
            stage.push(block)
    return blocks


class Ahead:
    def __init__(self, interpreter: Interpreter, around: Surroundings) -> None:
        self._interpreter, self._around = interpreter, around
        self._filters: Sequence[Filter] = ()
        self.blocks: deque[PathBlock] = deque()  # those that wait, the next one first
        self.ended = True  # the interpreter gives no more blocks
        self.poll_ns: int | None = None  # when waiting or supervising analysis goes on
        self.error: Message | None = None  # the error that ended analysis

    def start(self) -> None:
        self.renew_filters()
        self.blocks.clear()
        self.ended, self.poll_ns, self.error = False, None, None

    def end(self) -> None:
        self._interpreter.end()
        self.blocks.clear()
        self.ended, self.error = True, None

    def renew_filters(self) -> None:
        """Drop the blocks in filters: their path is not made."""
        self._filters = filters(self._around.parameters)

    def fill(self, under_way: int) -> bool:
        """Analyse while there is room, beside the blocks in execution; return True if a message asks to stop."""
        now_ns = self._around.axes.now_ns
        if self.poll_ns is not None and now_ns < self.poll_ns:
            return False
        self.poll_ns = None
        stops = False
        if self._interpreter.waiting is Waiting.BEGINNING and not self.blocks and under_way <= 1:
            self._interpreter.begun()
        while not self.ended and self.error is None and (room := AHEAD - len(self.blocks) - under_way) > 0:
            if not unmoved(self._around) and (blocks := run(self._interpreter, self._filters, room)):
                self.blocks.extend(blocks)
                continue
            try:
                block = self._interpreter.next()
            except ProgramError as error:
                self._fault(error, None)
                self._flush()
                break
            stops = self._pass_notes() or stops
            if block is None:
                self._last()
                break
            if block is Waiting.FEED:
                break
            if block is Waiting.CONDITION:
                self.poll_ns = now_ns + BLOCK_NS
                break
            if isinstance(block, Waiting):
                if block in (Waiting.PASS, Waiting.BEGINNING):
                    self.poll_ns = now_ns + BLOCK_NS
                self._flush()
                break
            if unmoved(self._around):
                block = replace(block, elements=())
            self._through([block], 0)
            if block.stop is Stop.END:
                self._last()
                break
            if block.stop is not Stop.NONE:
                self._flush()
                if self._interpreter.waiting is not None:
                    if self._interpreter.supervises_watched:
                        self.poll_ns = now_ns + BLOCK_NS
                    break
        return stops

    def _pass_notes(self) -> bool:
        """Report the interpreter's messages that do not break off; return True if one of them stops."""
        notes = self._interpreter.notes
        for note in notes:
            self._around.say(note)
        stops = any(note.effect is Effect.STOP for note in notes)
        notes.clear()
        return stops

    def _last(self) -> None:
        self.ended = True
        self._flush()

    def _flush(self) -> None:
        """Take the blocks that filters hold back."""
        try:
            for number, item in enumerate(self._filters):
                self._through(item.flush(), number + 1)
        except ProgramError as error:
            self._fault(error, None)

    def _through(self, blocks: list[PathBlock], first: int) -> None:
        """Pass blocks through the filters from this one on."""
        try:
            for item in self._filters[first:]:
                blocks = [out for block in blocks for out in item.push(block)]
        except ProgramError as error:
            self._fault(error, blocks[0] if blocks else None)
            return
        self.blocks.extend(blocks)

    def _fault(self, error: ProgramError, block: PathBlock | None) -> None:
        """Store an error about a block (None: the one in analysis); the first error counts."""
        if self.error is not None:
            return
        here = (block.program, block.number) if block else self._interpreter.stack.place
        program, number = error.place or here
        column = error.column or (block.column if block else 0)
        self.error = message(
            error.number, program=program, block=number, column=column, detail=error.detail, infos=error.infos
        )
