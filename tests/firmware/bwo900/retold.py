"""The same program in other words, by chapters 3 and 6 of the manual: what it draws stays.

G1 X1.5             P401:-2.25 G1 X:P401+3.75          a number as a sum of a parameter and the rest   3.6
G1 X1.5             G1 X1.5 (X7)                       a comment                                       3.6
A B C               M28.301       P301: A B C M02      some blocks as a subprogram                     6.1
A B                 A  M23.n  decoy  Nn B              a jump over a block                             6.1
"""

from __future__ import annotations

import re
from dataclasses import replace

from firmware.bwo900.draughtsman import Draughtsman
from hypothesis import strategies as st

_WORD = re.compile(r"\b([XYZIJKR])(-?[0-9]+\.[0-9]+)\b")
_NUMBER = re.compile(r"N[0-9]+ ")
_DECOYS = ("G0 X99 Y99", "G28 G18 F1", "P401:99 M28.301", "G92 X5", "M30")
_PARAMETERS = (401, 402, 403)
_CALLED = 301


@st.composite
def retold(draw: st.DrawFn, drawn: Draughtsman) -> Draughtsman:
    """The program with some of its blocks in other words."""
    lines = [_line(draw, _NUMBER.sub("", line, count=1)) for line in drawn.lines]
    called: dict[str, list[str]] = {}
    first = draw(st.integers(1, len(lines) - 1))
    last = draw(st.integers(first, min(first + 5, len(lines) - 1)))
    inside = lines[first:last]
    if draw(st.booleans()) and not any(re.match("M2[45]", line) for line in inside):
        called[f"P{_CALLED}"] = _numbered([*inside, "M02"])
        lines[first:last] = [f"M28.{_CALLED}"]
    for at in sorted(draw(st.sets(st.integers(1, len(lines) - 1), max_size=2)), reverse=True):
        lines[at:at] = [f"M23.{_AHEAD}", draw(st.sampled_from(_DECOYS))]
    return replace(drawn, lines=_numbered(lines), called=called)


_AHEAD = "ahead"
"""Stands for the number of the block after the next."""


def _numbered(lines: list[str]) -> list[str]:
    return [f"N{10 * n} {line.replace(_AHEAD, str(10 * (n + 2)))}" for n, line in enumerate(lines, 1)]


def _line(draw: st.DrawFn, line: str) -> str:
    """The line with one of its numbers as a sum, or with a comment."""
    words = list(_WORD.finditer(line))
    match draw(st.sampled_from(["as it is", "as it is", "sum", "comment"])):
        case "sum" if words:
            word, number = draw(st.sampled_from(words)), draw(st.sampled_from(_PARAMETERS))
            part = draw(st.integers(-400, 400)) / 4.0
            rest = round(float(word[2]) - part, 6)
            told = f"{word[1]}:P{number}{'+' if rest >= 0.0 else '-'}{abs(rest):.6f}"
            return f"P{number}:{part} {line[: word.start()]}{told}{line[word.end() :]}"
        case "comment":
            return f"{line} {draw(st.sampled_from(['(X7)', '{N5 M30}', '(Y-3 G0)']))}"
    return line
