"""Canned cycles G73 G81 G82 G83 G85 G89, step by step as LinuxCNC makes them: along Z in G17, Y in G18, X in G19.

G81  feed to Z (Y, X)                   G73  pecks of Q, back by 0.254 mm each
G82  and dwell P                        G83  pecks of Q, back to R and to 0.254 mm above the last depth
G85  feed to Z and back to R            G89  feed to Z, dwell, feed all the way back
"""

from __future__ import annotations

from collections.abc import Iterator

from isel_twin.cam.drilling import MOST_PECKS, Step
from isel_twin.cam.gcode.codes import name
from isel_twin.cam.gcode.words import Block
from isel_twin.cam.reader import Once
from isel_twin.cam.toolpath import Caution

BACK_MM = 0.254
PECKING, DWELLING = (730, 830), (820, 890)  # cycles that take Q, and P
MOST_REPEATS = 10_000


class Cycle:
    """State from one hole to the next: words R P Q of the code and the depth (mm, s), the axis they are along, the
    height at which the series began."""

    def __init__(self) -> None:
        self._code: int | None = None
        self._axis, self._unit = 2, 1.0
        self._words: dict[str, float] = {}
        self._began: float | None = None

    @property
    def series(self) -> tuple[int, float] | None:
        """Axis and unit of the series that is going on; None for none."""
        return None if self._began is None else (self._axis, self._unit)

    def end(self) -> None:
        """End the series of holes."""
        self._code = self._began = None

    def take(self, block: Block, code: int, axis: int, scale: float, unit: float, height: float) -> int:
        """Take the words of a block; returns how often it is repeated. scale: mm in a number along the axis, signed;
        unit: in any other; height: where the tool is along the axis. Raises CamError."""
        cycle, words, depth = name("G", code), block.words, "XYZ"[axis]
        if code != self._code or axis != self._axis:
            for letter in ("R", depth):
                if letter not in words:
                    raise block.wrong(f"{cycle} wants {letter}; write it where {cycle} begins")
            if axis != self._axis:
                self._began = height
            self._code, self._axis, self._words = code, axis, {}
        self._unit = unit
        if self._began is None:
            self._began = height
        scales = {depth: scale, "R": scale, "Q": unit, "P": 1.0}
        self._words |= {letter: words[letter] * mm for letter, mm in scales.items() if letter in words}
        if code in PECKING and self._words.get("Q", 0.0) <= 0.0:
            raise block.wrong(f"{cycle} wants Q of more than 0, the depth of a peck")
        if code in DWELLING and self._words.get("P", -1.0) < 0.0:
            raise block.wrong(f"{cycle} wants P, its dwell in seconds")
        repeats = words.get("L", 1.0)
        if repeats != int(repeats) or not 1 <= repeats <= MOST_REPEATS:
            raise block.wrong(f"L must be a whole number 1 .. {MOST_REPEATS}", "L")
        return int(repeats)

    def unused(self, block: Block, strict: bool, once: Once) -> Iterator[Caution]:
        """P and Q that are of another cycle (cam/48). Raises CamError if strict."""
        for letter, codes in (("P", DWELLING), ("Q", PECKING)):
            if letter in block.words and self._code not in codes:
                text = f"{letter} is not of {name('G', self._code or 0)}: it is not used"
                if strict:
                    raise block.wrong(text, letter)
                if block.words[letter]:
                    yield from once(f"{letter} of {self._code}", block.places[letter], text)

    def heights(self, block: Block, absolute: bool) -> tuple[float, float]:
        """R and depth of the hole; in G91 from where the series began. Raises CamError."""
        depth = "XYZ"[self._axis]
        clear = self._words["R"] + (0.0 if absolute else self._began or 0.0)
        bottom = self._words[depth] + (0.0 if absolute else clear)
        if clear < bottom:
            raise block.wrong(f"R {clear:g} is below {depth} {bottom:g}; a hole goes down from R")
        peck = self._words.get("Q")
        if self._code in PECKING and peck and (clear - bottom) / peck > MOST_PECKS:
            raise block.wrong(f"more than {MOST_PECKS} pecks; write a larger Q")
        return clear, bottom

    def unlike(self, before: tuple[int, float], height: float, clear: float, to_start: bool) -> str:
        """Say what LinuxCNC makes otherwise of the hole that has been taken (cam/19); "" for nothing. before: `series`
        of before it; height: where the tool is."""
        began = self._began or 0.0
        if before[0] != self._axis:
            what = "the plane changes: a new series begins where the tool is", "keeps heights of the old plane"
        elif before[1] != self._unit:
            what = "the unit changes: R, depth and Q stay as long as they were", "keeps their numbers"
        elif height < clear <= began:
            what = "R rises: the tool is lifted before it goes across", "lifts it on the way"
        elif began < clear < height:
            what = "R falls: the tool goes across before it goes down", "lowers it before"
        elif to_start and clear <= height < began:
            what = "G98 follows G99: the tool goes across at the R at which it stands", "lifts it on the way"
        else:
            return ""
        return f"within a series of holes {what[0]}; LinuxCNC {what[1]}"

    def steps(self, clear: float, bottom: float, to_start: bool) -> Iterator[Step]:
        """Motions at the hole, from R on. to_start: back to the height of before (G98), if that is above R."""
        if self._code in PECKING:
            peck = self._words["Q"]
            depth = clear - peck
            while depth > bottom + 1e-9:
                yield "feed", depth
                if self._code == 830:
                    yield "rapid", clear
                yield "rapid", depth + BACK_MM
                depth -= peck
        yield "feed", bottom
        if self._code in DWELLING:
            yield "dwell", self._words["P"]
        if self._code == 850:
            yield "feed", clear
        began = clear if self._began is None else self._began
        yield "feed" if self._code == 890 else "rapid", max(clear, began) if to_start else clear
