"""Canned cycles G73 G81 G82 G83 G85 G89 in the plane XY, step by step as LinuxCNC makes them.

G81  feed to Z                          G73  pecks of Q, back by 0.254 mm each
G82  and dwell P                        G83  pecks of Q, back to R and to 0.254 mm above the last depth
G85  feed to Z and back to R            G89  feed to Z, dwell, feed all the way back
"""

from __future__ import annotations

from collections.abc import Iterator

from isel_twin.cam.drilling import MOST_PECKS, Step
from isel_twin.cam.gcode.codes import name
from isel_twin.cam.gcode.words import Block

BACK_MM = 0.254
MOST_REPEATS = 10_000


class Cycle:
    """What stays from one hole to the next: the words Z R P Q of the code (mm, s), the height at which the series
    began."""

    def __init__(self) -> None:
        self._code: int | None = None
        self._words: dict[str, float] = {}
        self._began: float | None = None

    def end(self) -> None:
        """Of a series of holes."""
        self._code = self._began = None

    def take(self, block: Block, code: int, unit: float, up: int, z: float) -> int:
        """Take the words of a block; returns how often it is repeated. z: where the tool is. Raises CamError."""
        cycle, words = name("G", code), block.words
        if code != self._code:
            for letter in "RZ":
                if letter not in words:
                    raise block.wrong(f"{cycle} wants {letter}; write it where {cycle} begins")
            self._code, self._words = code, {}
        if self._began is None:
            self._began = z
        scale = {"Z": up * unit, "R": up * unit, "Q": unit, "P": 1.0}
        self._words |= {letter: words[letter] * scale[letter] for letter in "ZRQP" if letter in words}
        if code in (730, 830) and self._words.get("Q", 0.0) <= 0.0:
            raise block.wrong(f"{cycle} wants Q of more than 0, the depth of a peck")
        if code in (820, 890) and self._words.get("P", -1.0) < 0.0:
            raise block.wrong(f"{cycle} wants P, its dwell in seconds")
        repeats = words.get("L", 1.0)
        if repeats != int(repeats) or not 1 <= repeats <= MOST_REPEATS:
            raise block.wrong(f"L must be a whole number 1 .. {MOST_REPEATS}", "L")
        return int(repeats)

    def heights(self, block: Block, absolute: bool) -> tuple[float, float]:
        """R and Z of the hole; in G91 from where the series began. Raises CamError."""
        clear = self._words["R"] + (0.0 if absolute else self._began or 0.0)
        bottom = self._words["Z"] + (0.0 if absolute else clear)
        if clear < bottom:
            raise block.wrong(f"R {clear:g} is below Z {bottom:g}; a hole goes down from R")
        peck = self._words.get("Q")
        if self._code in (730, 830) and peck and (clear - bottom) / peck > MOST_PECKS:
            raise block.wrong(f"more than {MOST_PECKS} pecks; write a larger Q")
        return clear, bottom

    def steps(self, clear: float, bottom: float, to_start: bool) -> Iterator[Step]:
        """What is done at the hole, from R on. to_start: back to the height of before (G98), if that is above R."""
        if self._code in (730, 830):
            peck = self._words["Q"]
            depth = clear - peck
            while depth > bottom + 1e-9:
                yield "feed", depth
                if self._code == 830:
                    yield "rapid", clear
                yield "rapid", depth + BACK_MM
                depth -= peck
        yield "feed", bottom
        if self._code in (820, 890):
            yield "dwell", self._words["P"]
        if self._code == 850:
            yield "feed", clear
        began = clear if self._began is None else self._began
        yield "feed" if self._code == 890 else "rapid", max(clear, began) if to_start else clear
