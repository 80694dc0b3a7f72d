"""The drilling cycle of NCP: DRILLDEF gives its numbers, DRILL makes a hole.

Z   P+S ---.   .----.   .---- P+S, or L if that is higher
           |   |    |R  |             C1  straight to P-D
P   -------|---|----|-. |-----        C2  pecks: F first, then O each, back to P+S and to R above the last depth
           | F |     O| |             C3  as C1; both dwell T
P-D        |___|      |_|
"""

from __future__ import annotations

from collections.abc import Iterator

from isel_twin.cam.drilling import MOST_PECKS, Step
from isel_twin.cam.ncp.statement import Statement

_LENGTHS = "PSDLFOR"
_START = {"C": 1.0, "P": 0.0, "S": 2000.0, "T": 0.0}
_MUST_NOT_BE_ZERO, _MUST_NOT_BE_NEGATIVE = "VFO", "STDR"


class Drill:
    """The numbers of the cycle, in the unit of the file; V in mm/s."""

    def __init__(self) -> None:
        self._values = dict(_START)

    def __getitem__(self, letter: str) -> float | None:
        return self._values.get(letter)

    def define(self, statement: Statement, per_mm_s: float) -> None:
        """per_mm_s: 1 mm/s as V."""
        words = statement.letters("CPSDTVLFOIR")
        if not words:
            raise statement.wrong("wants letters behind it, as D1800 V1000")
        for letter, value in words.items():
            if letter == "C" and value not in (1.0, 2.0, 3.0):
                raise statement.wrong(f"C{value:g} is no cycle; allowed: 1, 2, 3")
            if letter == "I" and value:
                raise statement.wrong("I, by which pecks shrink, is not made; write I0")
            if letter in _MUST_NOT_BE_ZERO and value <= 0.0:
                raise statement.wrong(f"{letter} must be more than 0")
            if letter in _MUST_NOT_BE_NEGATIVE and value < 0.0:
                raise statement.wrong(f"{letter} must not be negative")
        self._values |= words
        if "V" in words:
            self._values["V"] = words["V"] / per_mm_s

    def convert(self, factor: float) -> None:
        """The unit of the file has changed: so many new units in an old one."""
        for letter in _LENGTHS:
            if letter in self._values:
                self._values[letter] *= factor

    def safe(self, per_mm: float, up: int) -> float:
        """The height at which the tool comes to a hole, mm. up: -1 if numbers of the file grow downwards."""
        return (up * self._values["P"] + self._values["S"]) / per_mm

    def steps(self, statement: Statement, per_mm: float, up: int, clearance: float) -> Iterator[Step]:
        """Motions at the hole, from `safe` on. clearance: back-off of pecks, mm, if R is not given."""
        mm = {letter: value / per_mm for letter, value in self._values.items()}
        if "D" not in mm:
            raise statement.wrong("its depth is not known; write DRILLDEF D first")
        surface, safe, depth = up * mm["P"], self.safe(per_mm, up), mm["D"]
        if self._values["C"] == 2.0:
            if "F" not in mm and "O" not in mm:
                raise statement.wrong("C2 drills in pecks; write DRILLDEF F and O")
            done = mm.get("F", mm.get("O", 0.0))
            peck = mm.get("O", done)
            if (depth - done) / peck > MOST_PECKS:
                raise statement.wrong(f"more than {MOST_PECKS} pecks; write a larger O")
            while done < depth - 1e-9:
                yield "feed", surface - done
                yield "rapid", safe
                yield "rapid", min(safe, surface - done + mm.get("R", clearance))
                done += peck
        yield "feed", surface - depth
        if self._values["T"]:
            yield "dwell", self._values["T"] / 1000.0
        yield "rapid", max(safe, up * mm["L"]) if "L" in mm else safe
