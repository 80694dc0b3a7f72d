"""A block of a program: words, G and M functions, assignments, jumps (manual 3.1 to 3.8)."""

from __future__ import annotations

from dataclasses import dataclass

from isel_twin.firmware.bwo900.programs.expressions import Expression, Parameter, Symbol


@dataclass(frozen=True, slots=True)
class Word:
    """An address with a value: an axis (X, X2, x), F, f, S, S2, I, J, K, R, T, t, tr, tl, tq. column: from 1."""

    name: str
    value: Expression
    column: int = 0
    terms: tuple[Expression, ...] = ()  # V3, V2, V1 of a polynomial, `X:[1,2,3]`; value is the first


@dataclass(frozen=True, slots=True)
class GWord:
    """A path condition or cycle; extension: seconds of G04."""

    number: int
    extension: Expression | None = None
    column: int = 0


@dataclass(frozen=True, slots=True)
class MWord:
    """An M function. extensions: after its points, None for nothing (`M28..20`); last: after `_`."""

    number: int
    extensions: tuple[Expression | None, ...] = ()
    last: Expression | None = None
    column: int = 0


@dataclass(frozen=True, slots=True)
class Assign:
    """`P500:value`, `_v:=value`; value None deletes (`--`). bind: `_v::=500`, the symbol stands for that parameter."""

    target: Parameter | Symbol
    value: Expression | None
    bind: bool = False
    column: int = 0


@dataclass(frozen=True, slots=True)
class Jump:
    """`P500<250.15.30`: if P500 < 250.15, go to N30."""

    left: Expression
    relation: str
    right: Expression
    target: Expression
    column: int = 0


@dataclass(frozen=True, slots=True)
class Wait:
    """`waituntil left relation right`."""

    left: Expression
    relation: str
    right: Expression


@dataclass(frozen=True, slots=True)
class Text:
    """`!text`: a message for the operator; text None clears. colour: 0 black on grey, 1 white on blue, from 80h the
    back and the fore."""

    text: str | None
    colour: int = 1


@dataclass(frozen=True, slots=True)
class ProgramBlock:
    """A block that has been read. number: None without N; skip: `/`; line: of the file, from 1."""

    number: int | None
    text: str
    line: int = 0
    skip: bool = False
    words: tuple[Word, ...] = ()
    g: tuple[GWord, ...] = ()
    m: tuple[MWord, ...] = ()
    assignments: tuple[Assign, ...] = ()
    jumps: tuple[Jump, ...] = ()
    wait: Wait | None = None
    calls: tuple[Expression, ...] = ()  # `sc:n`
    message: Text | None = None

    @property
    def column(self) -> int:
        """For errors of its path, from 1: the first word of a circle, else of an axis, else G or M word."""
        axis = None
        for word in self.words:  # from the left to the right
            letter = word.name[0]
            if letter in "IJKR":
                return word.column
            if axis is None and letter not in "FfSTt":
                axis = word.column
        if axis is not None:
            return axis
        return min([*(g.column for g in self.g), *(m.column for m in self.m)], default=1)

    @property
    def may_move(self) -> bool:
        """True if it has G functions, or words other than feed, speed and tool."""
        return bool(self.g) or any(word.name[0] not in "FSTft" for word in self.words)

    def word(self, name: str) -> Word | None:
        return next((word for word in self.words if word.name == name), None)
