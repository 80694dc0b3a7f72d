"""Random drill files of every form of number, each with the holes and slots that it means, from the seed.

A mark is (x, y) of a hole or (x, y, x, y) of a slot, mm, and the diameter of its tool.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import NamedTuple

Mark = tuple[float, ...]


class Form(NamedTuple):
    """How numbers are written: header lines, unit in mm, digits before and behind the point, which zeros."""

    header: str
    unit_mm: float
    whole: int
    behind: int
    zeros: str  # LZ, TZ; both; point


INCH, MM = 25.4, 1.0
FORMS = (
    Form("INCH,TZ", INCH, 2, 4, "TZ"),
    Form("INCH,LZ", INCH, 2, 4, "LZ"),
    Form("INCH,TZ", INCH, 2, 4, "both"),
    Form("METRIC,TZ", MM, 3, 3, "TZ"),
    Form("METRIC,LZ", MM, 3, 3, "LZ"),
    Form("METRIC,LZ", MM, 3, 3, "both"),
    Form("METRIC,TZ,000.000", MM, 3, 3, "TZ"),
    Form("METRIC,LZ,000.000", MM, 3, 3, "LZ"),
    Form("METRIC,LZ,000.00", MM, 3, 2, "LZ"),
    Form(";FILE_FORMAT=4:4\nMETRIC,TZ", MM, 4, 4, "TZ"),
    Form(";FILE_FORMAT=2:5\nINCH,TZ", INCH, 2, 5, "TZ"),
    Form(";FORMAT={3:3/ absolute / metric / suppress leading zeros}\nFMAT,2\nMETRIC,TZ", MM, 3, 3, "TZ"),
    Form(";FORMAT={2:4/ absolute / inch / keep zeros}\nFMAT,2\nINCH,TZ", INCH, 2, 4, "both"),
    Form(";FORMAT={-:-/ absolute / metric / decimal}\nFMAT,2\nMETRIC", MM, 3, 3, "point"),
    Form("VER,1\nFMAT,2\nINCH", INCH, 2, 4, "point"),
    Form("METRIC,LZ", MM, 3, 3, "point"),
    Form("M72", INCH, 2, 4, "TZ"),
    Form("INCH", INCH, 2, 4, "TZ"),
    Form("INCH", INCH, 2, 4, "both"),
    Form("METRIC,000.00", MM, 3, 2, "TZ"),
    Form("METRIC,0000.00", MM, 4, 2, "TZ"),
)
OTHERWISE = (  # gerbv 2.9.6 leaves out a mask behind TZ or LZ, zeros behind FILE_FORMAT, and takes METRIC alone for 2:4
    Form("METRIC,TZ,000.00", MM, 3, 2, "TZ"),
    Form("METRIC,TZ,0000.00", MM, 4, 2, "TZ"),
    Form("METRIC,LZ,0000.00", MM, 4, 2, "LZ"),
    Form(";FILE_FORMAT=2:5\nINCH,LZ", INCH, 2, 5, "LZ"),
    Form("METRIC", MM, 3, 3, "TZ"),
    Form("M71", MM, 3, 3, "TZ"),
)


def written(count: int, form: Form) -> str:
    """A whole number of the smallest unit as the form has it."""
    sign, digits = "-" if count < 0 else "", f"{abs(count):0{form.whole + form.behind}d}"
    if form.zeros == "point":
        return f"{sign}{abs(count) / 10**form.behind:.{form.behind}f}".rstrip("0")
    if form.zeros == "LZ":
        digits = digits.rstrip("0")
    elif form.zeros == "TZ":
        digits = digits.lstrip("0")
    return f"{sign}{digits or '0'}"


def file(seed: int, forms: Sequence[Form] = FORMS) -> tuple[str, list[Mark]]:
    """A drill file in one of these forms, and its marks."""
    draw = random.Random(seed)
    form = forms[seed % len(forms)]
    end = draw.choice(("\n", "\r\n"))
    tools = {number: draw.randint(2, 30) / 10 for number in draw.sample(range(1, 40), draw.randint(1, 3))}
    head = ["M48", *form.header.split("\n")]
    lines = [
        f"T{number:02d}{draw.choice(('', 'F200S65'))}C{mm / form.unit_mm:.4f}" for number, mm in sorted(tools.items())
    ]
    relative = draw.random() < 0.2
    if relative:
        head.append("ICI,ON")
    body = [draw.choice(("G05", "G90", "")) if not relative else "G91"]
    made = _Body(form, draw, relative)
    for number, mm in tools.items():
        body += [f"T{number:02d}", *made.holes(mm)]
    return end.join([*head, *lines, "%", *filter(None, body), draw.choice(("T0", "")), "M30", ""]), made.marks


class _Body:
    def __init__(self, form: Form, draw: random.Random, relative: bool) -> None:
        self._form, self._draw, self._relative = form, draw, relative
        self._at = (0, 0)
        self._most = round(100.0 / form.unit_mm * 10**form.behind)
        self.marks: list[Mark] = []

    def holes(self, mm: float) -> list[str]:
        lines = []
        for _ in range(self._draw.randint(1, 6)):
            kind = self._draw.random()
            if kind < 0.15 and self.marks:
                lines.append(self._repeated(mm))
            elif kind < 0.3:
                lines.append(self._slot(mm))
            else:
                lines.append(self._words(self._next()))
                self.marks.append((*self._mm(), mm))
        return lines

    def _next(self) -> tuple[int, int]:
        """A round number shows its trailing zeros."""
        x, y = (
            value - value % self._draw.choice((1, 10, 100))
            for value in (self._draw.randint(-self._most, self._most) for _ in "XY")
        )
        return (self._at[0], y) if self._draw.random() < 0.2 else (x, y)

    def _words(self, to: tuple[int, int]) -> str:
        """Go there; a coordinate that stays may be left out."""
        base = self._at if self._relative else (0, 0)
        pairs = zip("XY", to, self._at, base, strict=True)
        told = [(name, a - b) for name, a, old, b in pairs if a != old or name == "Y"]
        self._at = to
        return "".join(f"{name}{written(value, self._form)}" for name, value in told)

    def _mm(self) -> tuple[float, float]:
        x, y = (value / 10**self._form.behind * self._form.unit_mm for value in self._at)
        return x, y

    def _slot(self, mm: float) -> str:
        text = self._words(self._next())
        start = self._mm()
        text += f"G85{self._words(self._next())}"
        self.marks.append((*start, *self._mm(), mm))
        return text

    def _repeated(self, mm: float) -> str:
        times, step = self._draw.randint(1, 4), (self._draw.randint(-99, 99), self._draw.randint(1, 99))
        for _ in range(times):
            self._at = (self._at[0] + step[0], self._at[1] + step[1])
            self.marks.append((*self._mm(), mm))
        return f"R{times:02d}X{written(step[0], self._form)}Y{written(step[1], self._form)}"
