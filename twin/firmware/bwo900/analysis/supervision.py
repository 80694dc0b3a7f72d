"""Supervision: analysed blocks that wait for `sc:100` (manual 3.6, `sc:n`).

sc:0      the kept blocks go on, then the following ones
sc:1      blocks are kept
sc:2      the same, once the path of the last block has begun
sc:100    the kept blocks go on; supervision stays as it is
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from enum import Enum

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import SC


class Keeping(Enum):
    """What to do with the block in analysis."""

    OFF = "it goes on"
    ON = "it is kept"
    LET_GO = "it goes on, for it has said sc:0 or sc:100; the next one is kept"


OFF, ON = Keeping.OFF, Keeping.ON  # bound once: looking up an enumeration's member takes 0.2 us, for every block


class Supervision:
    def __init__(self, ready: deque[PathBlock]) -> None:
        """ready: blocks for the path; kept ones go before them."""
        self._ready = ready
        self.clear()

    def clear(self) -> None:
        """A program begins."""
        self.keeping = OFF
        self._kept: list[PathBlock] = []

    @property
    def on(self) -> bool:
        """True if the blocks that follow are kept."""
        return self.keeping is not OFF

    def call(self, numbers: Iterable[int]) -> bool:
        """The `sc:n` of a block, in order; True if it waits for the path of the last block to begin."""
        on, lets_go, waits = self.on, False, False
        for number in numbers:
            if number not in SC.ALL:
                raise ProgramError(Code.SYNTAX, f"sc:{number}; there are 0, 1, 2 and 100")
            if number in (SC.GO_ON, SC.GO_NOW):
                self._ready.extendleft(reversed(self._kept))
                self._kept.clear()
                lets_go = True
            if number != SC.GO_NOW:
                on = number != SC.GO_ON
            waits = waits or number == SC.STAY_AND_WAIT
        self.keeping = OFF if not on else Keeping.LET_GO if lets_go else ON
        return waits

    def keep(self) -> bool:
        """Keep a block's output; return False and do nothing if it has functions, writes or a stop."""
        if any(b.pre or b.post or b.stop is not Stop.NONE or b.parameters for b in self._ready):
            return False
        self._kept += [made for made in self._ready if made.elements or made.dwell_s is not None or made.speeds]
        self._ready.clear()
        return True
