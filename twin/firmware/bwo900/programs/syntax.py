"""Parser of the standard syntax (manual 3.1 to 3.8).

    N10 G01 F100 T03 M100 P30:(P20+35)*3 X200.0000 X2:100 P500=110.50 {comment} !message

    line --- parse_block ---> Block: words, G and M functions, assignments, jumps, in the order programmed

The parser checks syntax; all that depends on the control (axes, groups, targets) is left to the interpreter. Errors
have their column.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final, NoReturn

from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import G
from isel_twin.firmware.bwo900.programs.expressions import (
    DEEPEST,
    Binary,
    Expression,
    Function,
    Number,
    Parameter,
    Symbol,
    depends_on,
)
from isel_twin.firmware.bwo900.programs.words import Assign, GWord, Jump, MWord, ProgramBlock, Text, Wait, Word

LONGEST: Final = 200  # characters of a block
MOST: Final[Mapping[str, int]] = {"G": 8, "M": 8, "S": 8, "P": 32}  # how often each word may be in a block; others once
MOST_WAITED: Final = 8  # parameters that `waituntil` may depend on (M1222)
LARGEST: Final = 9_999_999_999  # of a block, program, tool and G number: ten digits

_SPACE = re.compile(r"[\s;]*")
_HEAD = re.compile(r"\s*(/)?\s*(?:N\s*(\d+))?")
_PLAIN = re.compile(r"([A-FH-LOQ-Z])([-+]?\d+(?:\.\d*)?)(?=[\sA-Z;]|$)")  # most words: a letter and a number
_INDEXED = re.compile(r"([A-Z])([1-8])\s*:(?![:=])")
_G = re.compile(r"G\s*(\d+)")
_M = re.compile(r"M\s*(\d+)")
_TERMS = re.compile(r"\s*:?\s*\[([^\[\]]*)\]")
_NUMBER = re.compile(r"\d+(?:[.,]\d*)?|[.,]\d+")
_HEX = re.compile(r"\$([0-9A-Fa-f]+)\s*;")
_NAME = re.compile(r"_[A-Za-z0-9_]*")
_LOWER = re.compile(r"waituntil|sc|t[rlq]?|[a-z](?=\s*[:\d.,+-])")
_FUNCTION = re.compile(r"asin|acos|atan|sin|cos|tan|sqr|intr|int|abs|ln|log|exp|not")
_RELATION = re.compile(r"\s*(<>|>=|<=|=|>|<)\s*")
_COMPARED = re.compile(r"(?P<right>.+?)\s*\.\s*(?P<target>\d+|[Pq]\d+|_\w+|\([^()]*\))(?=\s|$|[A-Z{(!;_\\])")
# `--`, `- -` or a dash, unless it is the sign of a number or parameter that follows
_DELETED = re.compile(r"\s*(?:-\s?-(?=\s*(?:$|[^\s\d.,+-]))|[-–—\x96\x97](?=$|\s+(?:$|[^\s\d.,])|[;{!\\]|[A-OQ-Z]))")
_TEXT = re.compile(r"!\s*(?:(\$[0-9A-Fa-f]+|\d+)\s*,\s*)?(.*)", re.DOTALL)


def parse_block(text: str, line: int = 0) -> ProgramBlock:
    """The block of a line, chained lines joined. Raises ProgramError with the column."""
    return _Parser(text, line).block()


def parse_expression(text: str) -> Expression:
    """Raises ProgramError."""
    parser = _Parser(text, 0)
    expression = parser.expression()
    if parser.at_end():
        return expression
    parser.refuse(Code.SYNTAX, f"{parser.rest()!r}")


class _Parser:
    def __init__(self, text: str, line: int) -> None:
        self.text, self.line, self.at = text, line, 0
        self._depth = 0

    def refuse(self, number: int, detail: str = "") -> NoReturn:
        raise ProgramError(number, detail, self.at + 1)

    def rest(self) -> str:
        return self.text[self.at : self.at + 12].strip()

    def at_end(self) -> bool:
        blank = _SPACE.match(self.text, self.at)
        self.at = self.at if blank is None else blank.end()
        return self.at == len(self.text)

    # Blocks

    def block(self) -> ProgramBlock:
        if len(self.text) > LONGEST:
            raise ProgramError(Code.TOO_MANY, f"{len(self.text)} characters; allowed: {LONGEST}", LONGEST + 1)
        head = _HEAD.match(self.text)
        assert head is not None
        self.at = head.end()
        number = None if head[2] is None else self._limited(int(head[2]))
        words, g, m = list[Word](), list[GWord](), list[MWord]()
        assignments, jumps, calls = list[Assign](), list[Jump](), list[Expression]()
        wait, message = None, None
        while not self.at_end():
            column = self.at + 1
            if (plain := _PLAIN.match(self.text, self.at)) is not None:
                self.at = plain.end()
                words.append(Word(plain[1], Number(float(plain[2])), column))
                continue
            letter = self.text[self.at]
            match letter:
                case "G":
                    g.append(self._path_condition(column))
                case "M":
                    m.append(self._function(column))
                case "P" | "q" | "_":
                    self._parameter_word(column, assignments, jumps)
                case "{":
                    self._comment("}")
                case "(":
                    self._comment(")")
                case "!":
                    message = self._message()
                case "N":
                    self.refuse(Code.SYNTAX, "N stands at the beginning of a block")
                case _ if "A" <= letter <= "Z":
                    words.append(self._word(column))
                case _ if (lower := _LOWER.match(self.text, self.at)) is not None:
                    self.at = lower.end()
                    if lower[0] == "waituntil":
                        wait = self._wait()
                    elif lower[0] == "sc":
                        calls.append(self._value())
                    else:
                        words.append(Word(lower[0], self._value(), column))
                case _:
                    self.refuse(Code.UNKNOWN_AXIS if letter.isalpha() else Code.SYNTAX, f"{self.rest()!r}")
        self._count(words, g, m, len(assignments) + len(jumps))
        parts = tuple(words), tuple(g), tuple(m), tuple(assignments), tuple(jumps), wait, tuple(calls), message
        return ProgramBlock(number, self.text, self.line, head[1] is not None, *parts)

    def _count(self, words: list[Word], g: list[GWord], m: list[MWord], parameters: int) -> None:
        if len(g) > MOST["G"]:
            raise ProgramError(Code.TOO_MANY, f"more than {MOST['G']} G functions", g[MOST["G"]].column)
        if len(m) > MOST["M"]:
            raise ProgramError(Code.TOO_MANY, f"more than {MOST['M']} M functions", m[MOST["M"]].column)
        if parameters > MOST["P"]:
            raise ProgramError(Code.TOO_MANY_PARAMETERS, f"{parameters} of them", 1)
        seen: dict[str, int] = {}
        for word in words:
            name = word.name if word.name[0] != "S" else "S"
            seen[name] = seen.get(name, 0) + 1
            if seen[name] > MOST.get(name, 1):
                detail = f"{name} stands there more than {MOST.get(name, 1)} times"
                raise ProgramError(Code.TOO_MANY, detail, word.column)

    def _limited(self, number: int) -> int:
        return number if number <= LARGEST else self.refuse(Code.TOO_LARGE, f"{number}; allowed: ten digits")

    def _comment(self, end: str) -> None:
        close = self.text.find(end, self.at)
        if close < 0:
            self.refuse(Code.BRACKET_MISSING, f"no {end!r} to this comment")
        self.at = close + 1

    def _message(self) -> Text:
        match = _TEXT.match(self.text, self.at)
        assert match is not None
        self.at = len(self.text)
        if not match[2] and match[1] is None:
            return Text(None)
        colour = 1 if match[1] is None else int(match[1][1:], 16) if match[1][0] == "$" else int(match[1])
        return Text(match[2], colour)

    def _path_condition(self, column: int) -> GWord:
        match = _G.match(self.text, self.at)
        if match is None:
            self.refuse(Code.SYNTAX, "G without a number")
        self.at = match.end()
        extension: Expression | None = None
        if self.text.startswith(".", self.at):
            if int(match[1]) != G.DWELL:
                self.refuse(Code.SYNTAX, f"G{match[1]} has no point")
            self.at += 1
            extension = self._primary()
        return GWord(self._limited(int(match[1])), extension, column)

    def _function(self, column: int) -> MWord:
        match = _M.match(self.text, self.at)
        if match is None:
            self.refuse(Code.SYNTAX, "M without a number")
        if len(match[1].lstrip("0")) > 3:
            self.refuse(Code.M_TOO_LARGE, f"M{match[1]}; allowed: 0 to 999")
        self.at = match.end()
        extensions, last = list[Expression | None](), None
        while self.text.startswith(".", self.at):
            self.at += 1
            extensions.append(self._address())
            if self.text.startswith("_", self.at):
                self.at += 1
                last = self._address()
                break
        return MWord(int(match[1]), tuple(extensions), last, column)

    def _address(self) -> Expression | None:
        """After a point of an M function: digits, a parameter or a bracket; None for nothing."""
        if (digits := re.compile(r"\d+").match(self.text, self.at)) is not None:
            self.at = digits.end()
            return Number(float(digits[0]))
        return self._primary() if self.text[self.at : self.at + 1] in ("P", "q", "(") else None

    def _word(self, column: int) -> Word:
        if (indexed := _INDEXED.match(self.text, self.at)) is not None:
            self.at = indexed.end()
            return Word(indexed[1] + indexed[2], self.expression(), column)
        name = self.text[self.at]
        self.at += 1
        if (terms := _TERMS.match(self.text, self.at)) is not None:
            return self._polynomial(name, terms, column)
        return Word(name, self._value(), column)

    def _polynomial(self, name: str, terms: re.Match[str], column: int) -> Word:
        """`X:[V3,V2,V1]`: three values; commas part them, so that decimals have points."""
        parts = terms[1].split(",")
        if len(parts) != 3 or not all(part.strip() for part in parts):
            self.refuse(Code.SYNTAX, f"{name}:[...] has three values, V3, V2, V1")
        values = tuple(self._part(part) for part in parts)
        self.at = terms.end()
        return Word(name, values[0], column, values)

    def _value(self) -> Expression:
        """A number, a bracket, or `:` and an expression."""
        self._blank()
        if self.text.startswith(":", self.at):
            self.at += 1
            return self.expression()
        sign = self.text[self.at : self.at + 1]
        if sign in ("-", "+"):
            self.at += 1
        if self.text[self.at : self.at + 1] not in ("(", "$") and _NUMBER.match(self.text, self.at) is None:
            self.refuse(Code.SYNTAX, "a value is missing")
        value = self._primary()
        if sign != "-":
            return value
        return Number(-value.value) if isinstance(value, Number) else Function("-", value)

    # Parameters

    def _parameter_word(self, column: int, assignments: list[Assign], jumps: list[Jump]) -> None:
        target = self._primary()
        assert isinstance(target, Parameter | Symbol)
        self._blank()
        if self.text.startswith(("::=", ":=", ":"), self.at):
            bind = self.text.startswith("::=", self.at)
            if bind and (isinstance(target, Parameter) or target.index is not None):
                self.refuse(Code.NO_OPERATION, "only a symbol can be bound to a parameter")
            self.at += 3 if bind else 2 if self.text.startswith(":=", self.at) else 1
            if not bind and (deleted := _DELETED.match(self.text, self.at)) is not None:
                self.at = deleted.end()
                assignments.append(Assign(target, None, column=column))
            else:
                self._blank()
                if bind and self.text[self.at : self.at + 1] in ("P", "q"):
                    self.at += 1
                assignments.append(Assign(target, self.expression(), bind, column))
            return
        relation = _RELATION.match(self.text, self.at)
        if relation is None:
            said = f"{self.text[column - 1 : self.at].strip()} without ':' or a comparison"
            self.refuse(Code.NO_OPERATION, f"{said}: here P is a parameter; a time or a program only in other dialects")
        self.at = relation.end()
        compared = _COMPARED.match(self.text, self.at)
        if compared is None:
            self.refuse(Code.SYNTAX, "a comparison ends with a point and the block to go to")
        right = self._part(compared["right"])
        goal = compared["target"]
        to = Number(float(goal)) if goal.isdigit() else self._part(goal, compared.start("target") - self.at)
        self.at = compared.end()
        jumps.append(Jump(target, relation[1], right, to, column))

    def _part(self, text: str, offset: int = 0) -> Expression:
        try:
            return parse_expression(text)
        except ProgramError as error:
            raise ProgramError(error.number, error.detail, self.at + offset + max(error.column, 1)) from None

    def _wait(self) -> Wait:
        left = self.expression()
        relation = _RELATION.match(self.text, self.at)
        if relation is None:
            self.refuse(Code.SYNTAX, "waituntil needs a comparison")
        self.at = relation.end()
        right = self.expression()
        if (asked := depends_on(left) + depends_on(right)) > MOST_WAITED:
            self.refuse(Code.TOO_MANY, f"waituntil of {asked} parameters; allowed: {MOST_WAITED}")
        return Wait(left, relation[1], right)

    # Expressions

    def _blank(self) -> None:
        while self.text[self.at : self.at + 1].isspace():
            self.at += 1

    def _takes(self, *signs: str) -> str:
        """Consume the first of these signs that is here; empty for none."""
        self._blank()
        for sign in signs:
            if self.text.startswith(sign, self.at):
                self.at += len(sign)
                return sign
        return ""

    def expression(self) -> Expression:
        left = self._conjunction()
        while self._takes("or"):
            left = Binary("or", left, self._conjunction())
        return left

    def _conjunction(self) -> Expression:
        left = self._sum()
        while self._takes("and"):
            left = Binary("and", left, self._sum())
        return left

    def _sum(self) -> Expression:
        left = self._product()
        while sign := self._takes("+", "-"):
            left = Binary(sign, left, self._product())
        return left

    def _product(self) -> Expression:
        left = self._factor()
        while sign := self._takes("*", "/", "%", "mod", "|"):
            left = Binary({"%": "/", "|": "mod"}.get(sign, sign), left, self._factor())
        return left

    def _factor(self) -> Expression:
        self._blank()
        if sign := self._takes("-", "+"):
            operand = self._factor()
            if sign == "+":
                return operand
            return Number(-operand.value) if isinstance(operand, Number) else Function("-", operand)
        if (function := _FUNCTION.match(self.text, self.at)) is not None:
            self.at = function.end()
            return Function(function[0], self._factor())
        return self._primary()

    def _primary(self) -> Expression:
        self._blank()
        if (number := _NUMBER.match(self.text, self.at)) is not None:
            self.at = number.end()
            return Number(float(number[0].replace(",", ".")))
        letter = self.text[self.at : self.at + 1]
        match letter:
            case "(":
                return self._bracket("(", ")")
            case "$":
                if (hexadecimal := _HEX.match(self.text, self.at)) is None:
                    self.refuse(Code.SYNTAX, "a hexadecimal number is closed by ';'")
                self.at = hexadecimal.end()
                return Number(float(int(hexadecimal[1], 16)))
            case "P" | "q":
                self.at += 1
                return self._parameter(letter)
            case "_":
                name = _NAME.match(self.text, self.at)
                assert name is not None
                if len(name[0]) > 31:
                    self.refuse(Code.SYNTAX, f"{name[0]}: more than 30 characters")
                self.at = name.end()
                index = self._bracket("[", "]") if self.text.startswith("[", self.at) else None
                return Symbol(name[0], index)
        self.refuse(
            Code.BRACKET_MISSING if letter in (")", "]") else Code.SYNTAX,
            f"{self.rest()!r}" if letter else "a value is missing",
        )

    def _bracket(self, begin: str, end: str) -> Expression:
        self.at += len(begin)
        self._depth += 1
        if self._depth > DEEPEST:
            self.refuse(Code.TOO_DEEP)
        inner = self.expression()
        self._blank()
        if not self.text.startswith(end, self.at):
            self.refuse(Code.BRACKET_MISSING, f"{end!r} is missing")
        self.at += 1
        self._depth -= 1
        return inner

    def _parameter(self, area: str) -> Parameter:
        if self.text.startswith("(", self.at):
            return Parameter(area, self._bracket("(", ")"))
        if (both := re.compile(r"\[\s*K?(\d+)\s*,").match(self.text, self.at)) is not None:
            self.at = both.end()
            number = self.expression()
            self._blank()
            if not self.text.startswith("]", self.at):
                self.refuse(Code.BRACKET_MISSING, "']' is missing")
            self.at += 1
            return Parameter(area, number, int(both[1]))
        if (digits := re.compile(r"\s*(\d+)").match(self.text, self.at)) is None:
            self.refuse(Code.NO_OPERATION, f"{area} without a number")
        self.at = digits.end()
        return Parameter(area, Number(float(self._limited(int(digits[1])))))
