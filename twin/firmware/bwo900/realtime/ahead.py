"""Analysis ahead of the real time: blocks that have been analysed and wait to be carried out.

    interpreter --> contour (G12, G123) --> radius correction (G41, G42) --> waiting blocks
                    each may keep blocks back until the next one comes, or until there is none: `flush`

Analysis goes on until `AHEAD` blocks wait, the program ends, an error comes, or the interpreter waits itself: until a
block has been executed, or for a parameter (looked at again after a block cycle). Where it waits for the next block of
a program that is fed, or for a condition, nothing is flushed: the next block belongs to the same contour. An error is
kept until the blocks before it have been carried out.
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
from isel_twin.firmware.bwo900.messages import Effect, Message, ProgramError, message
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.realtime.surroundings import Surroundings

BLOCK_NS: Final = 1_500_000  # block cycle time (manual: below 1.5 to 6 ms), of blocks without a path
AHEAD: Final = 400  # blocks that are analysed ahead of the one that is made
REFILL: Final = 200  # analysis goes on when no more than these wait


class Filter(Protocol):
    """Blocks pass through it on their way to the path; raises ProgramError."""

    def push(self, block: PathBlock) -> list[PathBlock]: ...
    def flush(self) -> list[PathBlock]: ...


def filters(parameters: Parameters) -> list[Filter]:
    """New filters, in their order: contour, radius correction (P8845)."""
    return [Contour(), Offset(parameters.get(P.CORNER_ARC) if parameters.loaded(P.CORNER_ARC) else None)]


class Ahead:
    def __init__(self, interpreter: Interpreter, around: Surroundings) -> None:
        self._interpreter, self._around = interpreter, around
        self._filters: Sequence[Filter] = ()
        self.blocks: deque[PathBlock] = deque()  # those that wait, the next one first
        self.ended = True  # nothing more comes from the interpreter
        self.poll_ns: int | None = None  # when analysis goes on that waits for a condition, or supervises
        self.error: Message | None = None  # what has ended analysis

    def start(self) -> None:
        self.renew_filters()
        self.blocks.clear()
        self.ended, self.poll_ns, self.error = False, None, None

    def end(self) -> None:
        self._interpreter.end()
        self.blocks.clear()
        self.ended, self.error = True, None

    def renew_filters(self) -> None:
        """Forget the blocks that filters have kept back: their path is not made."""
        self._filters = filters(self._around.parameters)

    def fill(self, under_way: int) -> bool:
        """Analyse as far as there is room, beside the blocks under way; True: a message asks to stop."""
        now_ns = self._around.axes.now_ns
        if self.poll_ns is not None and now_ns < self.poll_ns:
            return False
        self.poll_ns = None
        stops = False
        if self._interpreter.waiting is Waiting.BEGINNING and not self.blocks and under_way <= 1:
            self._interpreter.begun()
        while not self.ended and self.error is None and len(self.blocks) + under_way < AHEAD:
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
            if int(self._around.parameters.get(P.WITHOUT_MOVING)):
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
        """Say the messages of the interpreter that do not break off; True if one of them stops."""
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
        """The filters hand out the blocks that they have kept back."""
        try:
            for number, item in enumerate(self._filters):
                self._through(item.flush(), number + 1)
        except ProgramError as error:
            self._fault(error, None)

    def _through(self, blocks: list[PathBlock], first: int) -> None:
        """Blocks through the filters from one on."""
        try:
            for item in self._filters[first:]:
                blocks = [out for block in blocks for out in item.push(block)]
        except ProgramError as error:
            self._fault(error, blocks[0] if blocks else None)
            return
        self.blocks.extend(blocks)

    def _fault(self, error: ProgramError, block: PathBlock | None) -> None:
        """Keep an error about a block, None: about the one that is analysed; the first error counts."""
        if self.error is not None:
            return
        here = (block.program, block.number) if block else self._interpreter.stack.place
        program, number = error.place or here
        column = error.column or (block.column if block else 0)
        self.error = message(
            error.number, program=program, block=number, column=column, detail=error.detail, infos=error.infos
        )
