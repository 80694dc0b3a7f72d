"""Timers and counters: started by edges of the result, read as bits and as numbers.

Five kinds of timers (STEP 5), `in` the result at the starting instruction, T the timer's own bit:

    in            ____/~~~~~~~~~~~~\\_______       KT = 4 units
    SI  pulse     ____/~~~~\\_______________      while in, at most 4
    SV  extended  ____/~~~~\\_______________      4, independent of in
    SE  on-delay  _________/~~~~~~~\\_______      4 later, while in
    SS  stored    _________/~~~~~~~~~~~~~~~      4 later, until reset
    SA  off-delay ____/~~~~~~~~~~~~~~~~~\\__      at once, 4 longer
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from isel_twin.base.units import MILLISECOND_NS

# units of a time constant: KT n.0 to n.3
BASES_NS: Final = tuple(MILLISECOND_NS * unit for unit in (10, 100, 1000, 10_000))
MOST: Final = 999  # largest number of a timer or counter


def bcd(number: int) -> int:
    """A number of 0 to 999 in three decimal digits of four bits."""
    return number // 100 << 8 | number // 10 % 10 << 4 | number % 10


def from_bcd(word: int) -> int | None:
    """The number of the low twelve bits, None if a digit is above 9."""
    digits = (word >> 8 & 15, word >> 4 & 15, word & 15)
    return None if max(digits) > 9 else digits[0] * 100 + digits[1] * 10 + digits[2]


@dataclass(slots=True)
class Timer:
    """One timer. Times are virtual, in ns."""

    kind: str = ""  # how it was started: SI, SV, SE, SS, SA; empty: not started
    was: bool = False  # the last result at its starting instruction
    end_ns: int | None = None  # when it runs out; None: it does not run
    unit_ns: int = 0
    ran_out: bool = False  # it has run out since its start; SS: since its reset

    def start(self, kind: str, result: bool, constant: int, now_ns: int) -> bool:
        """The starting instruction; True if anything has changed. A constant with digits above 9 starts nothing."""
        self.settle(now_ns)
        before = (self.kind, self.was, self.end_ns, self.ran_out)
        rising, falling = result and not self.was, self.was and not result
        self.was = result
        number = from_bcd(constant)
        if (falling if kind == "SA" else rising) and number is not None:
            self.kind, self.ran_out = kind, self.ran_out and kind == self.kind == "SS"  # which is on until its reset
            self.unit_ns = BASES_NS[constant >> 12 & 3]
            self.end_ns = now_ns + number * self.unit_ns
            self.settle(now_ns)
        elif kind == "SA" and rising:
            self.kind, self.end_ns, self.ran_out = kind, None, False
        elif kind in ("SI", "SE") and falling:
            self.end_ns, self.ran_out = None, False
        return before != (self.kind, self.was, self.end_ns, self.ran_out)

    def reset(self) -> bool:
        """True if anything has changed."""
        before = (self.kind, self.end_ns, self.ran_out)
        self.kind, self.end_ns, self.ran_out = "", None, False
        return before != ("", None, False)

    def settle(self, now_ns: int) -> None:
        if self.end_ns is not None and now_ns >= self.end_ns:
            self.end_ns, self.ran_out = None, True

    def on(self, now_ns: int) -> bool:
        self.settle(now_ns)
        match self.kind:
            case "SI" | "SV":
                return self.end_ns is not None
            case "SE":
                return self.ran_out and self.was
            case "SS":
                return self.ran_out
            case "SA":
                return self.was or self.end_ns is not None
        return False

    def left(self, now_ns: int) -> int:
        """Units left, rounded up."""
        self.settle(now_ns)
        return 0 if self.end_ns is None else -(-(self.end_ns - now_ns) // self.unit_ns)


@dataclass(slots=True)
class Counter:
    """One counter, 0 to 999; each of its instructions acts on an edge of its own."""

    value: int = 0
    up: bool = False
    down: bool = False
    set: bool = False

    def act(self, what: str, result: bool, constant: int) -> bool:
        """ZV, ZR or S with its result and accumulator 1; True if anything has changed."""
        edge = {"ZV": "up", "ZR": "down", "S": "set"}[what]
        if getattr(self, edge) == result:
            return False
        setattr(self, edge, result)
        if result and what == "ZV":
            self.value = min(self.value + 1, MOST)
        elif result and what == "ZR":
            self.value = max(self.value - 1, 0)
        elif result and (number := from_bcd(constant)) is not None:
            self.value = number
        return True

    def reset(self) -> bool:
        """True if anything has changed."""
        before, self.value = self.value, 0
        return before != 0
