"""Numbers of a drill file, most of which have no point: 12500 is 12.5 mm, or 125, or 1.25 inch.

    whole   how many digits stand before the point      LZ: leading zeros are written, trailing ones may be missing:
    behind  how many behind it                              the point is behind the first `whole` digits
                                                        TZ: trailing zeros are written, leading ones may be missing:
                                                            the point is before the last `behind` digits

Both agree on a number of whole + behind digits. What a file does not say is concluded from its numbers, and said; where
nothing can be concluded the file is refused (cam/43).
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field

from isel_twin.cam.reader import MOST, Once
from isel_twin.cam.settings import DRILL_FORMAT
from isel_twin.cam.toolpath import CamError, Element, Place

INCH_MM = 25.4
COMMENT, COMMAND, SETTING = 1, 2, 3  # who says it; a higher one is not overruled by a lower one
_DIGITS = {"inch": (2, 4), "mm": (3, 3)}  # where nobody says it
_OTHER = {"LZ": "TZ", "TZ": "LZ"}
_COORDINATE = re.compile(r"[XY][-+]?([0-9]+)(?![0-9.])", re.I)
_MASK = re.compile(r"(0+)\.(0+)")
_COMMENTED = re.compile(r"FORMAT\s*[=:]\s*\{?\s*([1-9])\s*[:.]\s*([0-9])\b|FORMAT\s*[=:]\s*\{", re.I)
_IN_COMMENT = {
    r"/\s*metric\b": ("unit", "mm"),
    r"/\s*inch\b": ("unit", "inch"),
    r"/\s*suppress trailing zeros\b": ("zeros", "LZ"),
    r"/\s*suppress leading zeros\b": ("zeros", "TZ"),
}
_ZEROS = {"LZ": "leading zeros written", "TZ": "trailing zeros written"}


@dataclass
class NumberFormat:
    """Knowledge of the numbers so far."""

    once: Once
    setting: str  # drill_format, which wins over the file
    unit: str = field(default="", init=False)  # inch, mm
    digits: tuple[int, int] | None = field(default=None, init=False)  # before and behind the point
    zeros: str = field(default="", init=False)  # LZ, TZ
    concluded: str = field(default="", init=False)  # zeros, from the numbers themselves
    first: Place | None = field(default=None, init=False)  # number that needed what the file does not say
    _rank: dict[str, int] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        match = DRILL_FORMAT.fullmatch(self.setting)
        unit, whole, behind, zeros = match.groups("") if match is not None else ("",) * 4
        self.unit, self.zeros = unit.lower(), zeros.upper()
        self.digits = (int(whole), int(behind)) if whole else None
        self._rank = {what: SETTING for what in ("unit", "digits", "zeros") if getattr(self, what)}

    def say(self, what: str, value: object, rank: int, place: Place) -> Iterator[Element]:
        """The file says it; a remark if it has said something else."""
        before, ranked = getattr(self, what), self._rank.get(what, 0)
        if rank >= ranked:
            setattr(self, what, value)
            self._rank[what] = rank
        if before and before != value and ranked < SETTING:
            told = [":".join(map(str, each)) if isinstance(each, tuple) else each for each in (before, value)]
            taken = told[1] if rank >= ranked else told[0]
            yield from self.once(what, place, f"the file says {told[0]} and {told[1]}: {taken} is taken")

    def header(self, word: str, parts: Iterable[str], place: Place) -> Generator[Element, None, list[str]]:
        """INCH or METRIC, and what stands behind it; gives the parts that say nothing of numbers."""
        rest = []
        yield from self.say("unit", "inch" if word == "INCH" else "mm", COMMAND, place)
        for part in filter(None, parts):
            if mask := _MASK.fullmatch(part):
                yield from self.say("digits", (len(mask[1]), len(mask[2])), COMMAND, place)
            elif part in _ZEROS:
                yield from self.say("zeros", part, COMMAND, place)
            else:
                rest.append(part)
        return rest

    def commented(self, comment: str, place: Place) -> Iterator[Element]:
        """Remarks of board programs about their numbers."""
        match = _COMMENTED.search(comment)
        if match is None:
            return
        if match[1]:
            yield from self.say("digits", (int(match[1]), int(match[2])), COMMENT, place)
        for pattern, (what, value) in _IN_COMMENT.items():
            if re.search(pattern, comment, re.I):
                yield from self.say(what, value, COMMENT, place)

    def switch(self, unit: str) -> None:
        """M71 or M72 between holes: its own digits."""
        if self._rank.get("unit") != SETTING and unit != self.unit:
            self.unit = unit
            self._rank["unit"] = COMMAND
            if self._rank.get("digits", 0) == COMMAND:
                self.digits, self._rank["digits"] = None, 0

    @property
    def width(self) -> int:
        return sum(self.digits or _DIGITS[self.unit])

    def mm(self, text: str, place: Place, ahead: Iterable[str]) -> tuple[float, tuple[Element, ...]]:
        """A coordinate, and what is to be said of it. ahead: the lines from this one on, by which zeros are concluded.
        Raises CamError where several readings are as likely."""
        if not self.unit:
            raise CamError('the file says neither INCH nor METRIC; set drill_format = "inch", or "mm"', place)
        said: tuple[Element, ...] = ()
        if "." in text:
            value = float(text)
        else:
            digits = text.lstrip("+-")
            if int(digits) and len(digits) != self.width:
                said = self._check(digits, place, ahead)
            if self.digits is None and self.first is None and int(digits):
                self.first = place
            value = float(text[: len(text) - len(digits)] + self._pointed(digits, self.zeros or self.concluded))
        value *= INCH_MM if self.unit == "inch" else 1.0
        if not abs(value) <= MOST:
            raise CamError(f"{place.word[:20]} is out of range; allowed: up to {MOST:g} mm", place)
        return value, said

    def _check(self, digits: str, place: Place, ahead: Iterable[str]) -> tuple[Element, ...]:
        """A number on which LZ and TZ do not agree."""
        zeros, leans = self.zeros or self.concluded, self._leans(digits)
        if not zeros:
            zeros = self.concluded = self._conclude(place, ahead)
            self.first = self.first or place
        if leans != _OTHER[zeros]:
            return ()
        what = "begins" if leans == "LZ" else "ends"
        why = f"{place.word} {what} with a zero, which {zeros} leaves out"
        if self.concluded or (zeros == "TZ" and self.digits is None and len(digits) > self.width):
            raise CamError(f"{why}; {self._choice(digits)}", place)
        return self.once("zeros odd", place, f"{why}; is the file written otherwise? drill_format decides")

    def _conclude(self, place: Place, ahead: Iterable[str]) -> str:
        """The zeros of a file that does not name them, by the first number that leaves out zeros of one kind only."""
        digits = place.word.lstrip("XYxy+-")
        for line in ahead:
            for each in _COORDINATE.findall(line.partition(";")[0]):
                if int(each) and (found := self._leans(each)):
                    return found
        raise CamError(f"the file does not say which zeros of {place.word} are left out; {self._choice(digits)}", place)

    def _leans(self, digits: str) -> str:
        """The zeros that a number shows to be written; "" if it shows neither, or both."""
        leading, trailing = digits[0] == "0", digits[-1] == "0"
        return "" if leading == trailing else "LZ" if leading else "TZ"

    def _pointed(self, digits: str, zeros: str) -> str:
        whole, behind = self.digits or _DIGITS[self.unit]
        if zeros == "LZ":
            return f"{digits[:whole].ljust(whole, '0')}.{digits[whole:]}"
        digits = digits.rjust(behind + 1, "0")
        return f"{digits[: len(digits) - behind]}.{digits[len(digits) - behind :]}"

    def _choice(self, digits: str) -> str:
        """Both readings of a number, and what decides."""
        whole, behind = self.digits or _DIGITS[self.unit]
        lz, tz = (f"{float(self._pointed(digits, zeros)):g} {self.unit}" for zeros in _OTHER)
        return f'set drill_format = "{whole}:{behind} LZ" if it is {lz}, "{whole}:{behind} TZ" if it is {tz}'

    def assumed(self) -> str:
        """Reading of its numbers, if the file does not say all of it; "" if it does, or needs not."""
        if self.first is None:
            return ""
        whole, behind = self.digits or _DIGITS[self.unit]
        zeros = self.zeros or self.concluded
        return f"{self.unit} {whole}:{behind}{f', {_ZEROS[zeros]} ({zeros})' if zeros else ''}"
