"""Expressions in place of numbers (manual 3.4, 3.6).

    P30:(P20+35)*3        P500:P500 or $100;        P1:sinP2        X:_wegx[1]

Precedence, lowest first: or | and | + - | * / % mod | not, sign, functions (bwo900/2). Angles are in degrees. Functions
need no brackets in the standard syntax. An expression is parsed once and evaluated whenever its block is executed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol, TypeAlias

from isel_twin.firmware.bwo900.messages import Code, ProgramError

DEEPEST: Final = 10  # nested brackets (M1209)
# bound once: looking up a member of an enumeration takes 0.2 us, for every parameter of a program
TOO_LARGE: Final = int(Code.TOO_LARGE)


@dataclass(frozen=True, slots=True)
class Number:
    value: float


@dataclass(frozen=True, slots=True)
class Parameter:
    """P500, q11, P(500+P1), P[K1,500]."""

    area: str
    number: Expression
    channel: int = 1


@dataclass(frozen=True, slots=True)
class Symbol:
    """`_name`, `_name[index]`."""

    name: str
    index: Expression | None = None


@dataclass(frozen=True, slots=True)
class Function:
    """A function, "not" or "-"."""

    name: str
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary:
    operator: str
    left: Expression
    right: Expression


Expression: TypeAlias = Number | Parameter | Symbol | Function | Binary


class Environment(Protocol):
    """Values of parameters and symbols. Both raise ProgramError: M1221 or M1300 for one without a value."""

    def parameter(self, area: str, number: int, channel: int) -> float: ...
    def symbol(self, name: str, index: int) -> float: ...


def evaluate(expression: Expression, environment: Environment) -> float:
    """Raises ProgramError: M1203 division by zero, M1212 root, M1213 no value; those of the environment."""
    match expression:
        case Number(value):
            return value
        case Parameter(area, number, channel):
            return environment.parameter(area, whole(evaluate(number, environment), TOO_LARGE), channel)
        case Symbol(name, index):
            return environment.symbol(name, 0 if index is None else whole(evaluate(index, environment), TOO_LARGE))
        case Function(name, operand):
            return _finite(_FUNCTIONS[name], name, evaluate(operand, environment))
        case Binary(operator, left, right):
            first, second = evaluate(left, environment), evaluate(right, environment)
            return _finite(_OPERATORS[operator], operator, first, second)


def whole(value: float, error: int = Code.SYNTAX) -> int:
    """A value as an integer. Raises ProgramError `error` if it is not whole, or too large."""
    nearest = round(value) if math.isfinite(value) else 0
    if abs(value - nearest) > 1e-6 or abs(nearest) > 9_999_999_999:
        raise ProgramError(error, f"{value:g} is no number of its kind")
    return nearest


def depends_on(expression: Expression) -> int:
    """Number of parameters and symbols in an expression."""
    match expression:
        case Number():
            return 0
        case Parameter(_, number, _):
            return 1 + depends_on(number)
        case Symbol(_, index):
            return 1 + (0 if index is None else depends_on(index))
        case Function(_, operand):
            return depends_on(operand)
        case Binary(_, left, right):
            return depends_on(left) + depends_on(right)


def _finite(function: Callable[..., float], name: str, *operands: float) -> float:
    try:
        value = function(*operands)
    except ProgramError:
        raise
    except (ValueError, OverflowError):
        value = math.nan
    if not math.isfinite(value):
        raise ProgramError(Code.NO_VALUE, f"{name} of {', '.join(f'{operand:g}' for operand in operands)}")
    return value


def _degrees(function: Callable[[float], float]) -> Callable[[float], float]:
    """A function of degrees, exact at multiples of 90, unlike radians."""

    def of(angle: float) -> float:
        quarter, rest = divmod(angle, 90.0)
        if rest == 0.0:
            sine, cosine = ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0))[int(quarter) % 4]
            if function is math.tan:
                return sine / cosine if cosine else math.nan
            return sine if function is math.sin else cosine
        return function(math.radians(angle))

    return of


def _divide(a: float, b: float) -> float:
    if b == 0.0:
        raise ProgramError(Code.DIVISION_BY_ZERO)
    return a / b


def _remainder(a: float, b: float) -> float:
    if b == 0.0:
        raise ProgramError(Code.DIVISION_BY_ZERO)
    return math.fmod(a, b)


def _root(a: float) -> float:
    if a < 0.0:
        raise ProgramError(Code.ROOT_OF_NEGATIVE, f"{a:g}")
    return math.sqrt(a)


def _nearest(a: float) -> float:
    """Round to the nearest, halves away from zero."""
    return math.copysign(math.floor(abs(a) + 0.5), a)


def _bits(function: Callable[[int, int], int]) -> Callable[[float, float], float]:
    return lambda a, b: float(function(whole(a, Code.NO_VALUE), whole(b, Code.NO_VALUE)))


_FUNCTIONS: Final[Mapping[str, Callable[[float], float]]] = {
    "sin": _degrees(math.sin),
    "cos": _degrees(math.cos),
    "tan": _degrees(math.tan),
    "asin": lambda a: math.degrees(math.asin(a)),
    "acos": lambda a: math.degrees(math.acos(a)),
    "atan": lambda a: math.degrees(math.atan(a)),
    "sqr": _root,
    "int": lambda a: float(math.trunc(a)),
    "intr": _nearest,
    "abs": abs,
    "ln": math.log,
    "log": math.log10,
    "exp": math.exp,
    "not": lambda a: float(~whole(a, Code.NO_VALUE)),
    "-": lambda a: -a,
}
_OPERATORS: Final[Mapping[str, Callable[[float, float], float]]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": _divide,
    "mod": _remainder,
    "and": _bits(lambda a, b: a & b),
    "or": _bits(lambda a, b: a | b),
}
