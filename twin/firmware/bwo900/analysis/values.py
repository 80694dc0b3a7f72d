"""Values of expressions (parameters, symbols, comparisons), and assignments (manual 3.6, 8.1).

_depth := P100 / 2     an internal variable, until the program ends
_depth ::= 100         bound: the name means that parameter, with an index one after it
P100 : 5               written at once in analysis; real-time parameters when the block is executed
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import eq, ge, gt, le, lt, ne
from typing import Final, TypeAlias

from isel_twin.firmware.bwo900.analysis.tools import told
from isel_twin.firmware.bwo900.messages import LOCKED, Code, ProgramError
from isel_twin.firmware.bwo900.parameters import REAL_TIME, SYNCHRONISING, Parameters
from isel_twin.firmware.bwo900.programs.expressions import (
    TOO_LARGE,
    Expression,
    Number,
    Parameter,
    Symbol,
    evaluate,
    whole,
)
from isel_twin.firmware.bwo900.programs.words import Assign, ProgramBlock

# parameters P that are written when a block is executed: number, value
Later: TypeAlias = list[tuple[int, float | None]]


class Values:
    """Implements `expressions.Environment`."""

    def __init__(self, parameters: Parameters, written: Callable[[int, float | None], None]) -> None:
        """written: called for each parameter P that a block writes."""
        self._parameters, self._written = parameters, written
        self._symbols: dict[str, float] = {}
        self._bound: dict[str, int] = {}

    def clear(self) -> None:
        """A program begins."""
        self._symbols, self._bound = {}, {}

    def parameter(self, area: str, number: int, channel: int) -> float:
        """Unset records of tools read 0, as T0."""
        if area == "P" and channel == 1 and told(number):
            return self._parameters.get(number)
        return self._parameters.read(area, number, channel)

    def symbol(self, name: str, index: int) -> float:
        """A bound symbol is its parameter, another one a variable, 0 before it is set."""
        if name in self._bound:
            return self._parameters.read("P", self._bound[name] + index)
        return self._symbols.get(_internal(name, index), 0.0)

    def of(self, expression: Expression) -> float:
        """Raises ProgramError as `evaluate` does."""
        return expression.value if isinstance(expression, Number) else evaluate(expression, self)

    def holds(self, block: ProgramBlock) -> bool:
        """True if the condition of waituntil is true."""
        wait = block.wait
        return wait is None or compare(self.of(wait.left), wait.relation, self.of(wait.right))

    def jump(self, block: ProgramBlock) -> int | None:
        """The block that the first true comparison leads to."""
        for jump in block.jumps:
            if compare(self.of(jump.left), jump.relation, self.of(jump.right)):
                return whole(self.of(jump.target), Code.NO_BLOCK)
        return None

    def assign(self, block: ProgramBlock) -> Later:
        """Carry out the assignments; returns those to be written in real time."""
        later: Later = []
        for assign in block.assignments:
            value = None if assign.value is None else self.of(assign.value)
            target = assign.target
            if isinstance(target, Symbol):
                index = 0 if target.index is None else whole(self.of(target.index), TOO_LARGE)
                if assign.bind:
                    self._bound[target.name] = whole(value or 0.0, TOO_LARGE)
                elif target.name in self._bound:
                    self._write("P", self._bound[target.name] + index, 1, value, later)
                else:
                    self._symbols[_internal(target.name, index)] = 0.0 if value is None else value
            else:
                number = whole(self.of(target.number), TOO_LARGE)
                self._write(target.area, number, target.channel, value, later)
        return later

    def _write(self, area: str, number: int, channel: int, value: float | None, later: Later) -> None:
        if self._parameters.locked(number, area, channel):
            raise ProgramError(LOCKED, f"{area}{number}")
        own = area == "P" and channel == 1
        if own and self._parameters.has(number, REAL_TIME):
            later.append((number, value))
            return
        self._parameters.write(number, value, area, channel)
        if own:
            self._written(number, value)

    def synchronises(self, block: ProgramBlock) -> bool:
        """True if analysis waits for one of the parameters that a block writes."""
        return any(self._synchronises(assign) for assign in block.assignments)

    def _synchronises(self, assign: Assign) -> bool:
        target = assign.target
        if not isinstance(target, Parameter) or not isinstance(target.number, Number):
            return False
        return self._parameters.has(int(target.number.value), SYNCHRONISING, target.area, target.channel)


def _internal(name: str, index: int) -> str:
    """Only symbols of parameters have an index (manual 3.6)."""
    if index:
        raise ProgramError(Code.NO_SYMBOL, f"{name}[{index}]: an index needs a symbol that is bound to a parameter")
    return name


_RELATIONS: Final[Mapping[str, Callable[[float, float], bool]]] = {
    "=": eq, "<>": ne, ">": gt, "<": lt, ">=": ge, "<=": le
}  # fmt: skip


def compare(left: float, relation: str, right: float) -> bool:
    return _RELATIONS[relation](left, right)
