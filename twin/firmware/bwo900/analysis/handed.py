"""Arguments of a user cycle, passed in parameters (manual 8.5, P8640, P8642; P9700 to P9799).

    P8640 = 1    G1001 X10 F500 M7    -->  P9700: 10, P9739: 500, P9740: 1001, P9750: 7; the words have no other effect
    P8642: 100   with P100: 72 (H), P101: 75 (K), P102: 0       G1001 H3 K-1    -->  P9790: 3, P9791: -1

They are deleted at the start of a program, and when a cycle has returned.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

from isel_twin.firmware.bwo900.analysis.values import Values
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.words import ProgramBlock

OTHERS: Final[Mapping[str, int]] = {
    "I": P.HANDED_I, "J": P.HANDED_J, "K": P.HANDED_K, "R": P.HANDED_R, "T": P.HANDED_T, "f": P.HANDED_END_FEED,
    "F": P.HANDED_FEED,
}  # fmt: skip
MOST: Final = 8  # G and M functions, spindles


def clear(p: Parameters) -> None:
    """Delete the arguments: a program begins, or a cycle has returned."""
    for switch, numbers in (
        (P.HANDED_WHOLE, range(P.HANDED_AXES, P.HANDED_OWN)),
        (P.HANDED_LIST, range(P.HANDED_OWN, P.HANDED_LAST + 1)),
    ):
        if p.get(switch):
            for number in numbers:
                if p.loaded(number):
                    p.write(number, None)


def handed(block: ProgramBlock, p: Parameters, values: Values, names: Mapping[str, int]) -> ProgramBlock:
    """Write the arguments; returns the rest of the block. names: axes by their letters. Raises ProgramError."""
    own = {letter: P.HANDED_OWN + at for at, letter in enumerate(_letters(p))}
    for word in block.words:
        if word.name in own:
            p.write(own[word.name], values.of(word.value))
    words = tuple(word for word in block.words if word.name not in own)
    if p.get(P.HANDED_WHOLE) != 1.0:
        return replace(block, words=words)
    for word in words:
        if (number := _number(word.name, names)) is not None:
            p.write(number, values.of(word.value))
    for at, g in enumerate(block.g[:MOST]):
        p.write(P.HANDED_G + at, float(g.number))
        if g.extension is not None:
            p.write(P.HANDED_EXTENSION, values.of(g.extension))
    for at, m in enumerate(block.m[:MOST]):
        p.write(P.HANDED_M + 3 * at, float(m.number))
        for field, extension in enumerate(m.extensions[:2], 1):
            p.write(P.HANDED_M + 3 * at + field, None if extension is None else values.of(extension))
    return replace(block, words=(), m=(), g=())


def _letters(p: Parameters) -> Iterator[str]:
    """Words of the list that P8642 points to."""
    first = int(p.get(P.HANDED_LIST))
    for at in range(P.HANDED_LAST - P.HANDED_OWN + 1 if first > 0 else 0):
        code = int(p.get(first + at))
        if not 32 < code < 127:
            return
        yield chr(code)


def _number(name: str, names: Mapping[str, int]) -> int | None:
    if name in names:
        return P.HANDED_AXES + names[name]
    if name[0] == "S":
        spindle = int(name[1:] or "1")
        return P.HANDED_SPEEDS + spindle - 1 if 1 <= spindle <= MOST else None
    return OTHERS.get(name)
