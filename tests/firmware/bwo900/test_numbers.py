"""Numbers of the manual stand in the sources by their names (numbers.py, messages.py), and nowhere else."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import isel_twin.firmware.bwo900 as room
from isel_twin.firmware.bwo900 import numbers
from isel_twin.firmware.bwo900.messages import Code

ROOM = Path(room.__file__).parent
SOURCES = sorted(path for path in ROOM.rglob("*.py") if path.name not in ("numbers.py", "messages.py"))
OF_PARAMETERS = {
    "get",
    "given",
    "needed",
    "read",
    "write",
    "loaded",
    "status",
    "set_status",
    "has",
    "locked",
    "address",
}
"""Methods whose first argument is the number of a parameter."""
OF_MESSAGES = {"ProgramError", "message", "refuse", "whole", "_skip", "_lose", "_note", "invalid"}
"""Functions that take the number of a message, first or second."""
FUNCTIONS = {"number", "motion", "polar", "plane", "exact", "radius", "correction", "rotation", "coordinates", "zero"}
"""Names of what is compared with the number of a G or M function."""
SETS = {"blockwise", "groups", "cycles", "numbers"}


def _named() -> set[int]:
    """All parameters and messages from 1000 on, but round numbers and 9999, which are sizes and programs as well."""
    spaces = (numbers.P, numbers.Q)
    values = {value for space in spaces for value in vars(space).values() if isinstance(value, int)} | {*Code}
    return {value for value in values if value >= 1000 and value % 1000} - {numbers.P.FIXED_LAST}


def _whole(node: ast.AST, least: int) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) is int and node.value >= least


def _name(node: ast.AST) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def bare(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every bare number in a source."""
    named = _named()
    for node in ast.walk(ast.parse(source)):
        found: list[ast.AST] = []
        match node:
            case ast.Constant() if _whole(node, 1000) and node.value in named:
                found = [node]
            case ast.Call(func=func, args=args) if _name(func) in OF_MESSAGES:
                found = [a for a in args[:2] if _whole(a, 1000)]
            case ast.Call(func=func, args=[first, *_]) if _name(func) in OF_PARAMETERS:
                found = [n for n in ast.walk(first) if _whole(n, 11)]
            case ast.Call(func=ast.Attribute(attr="axis"), args=[_, offset, *_]):
                found = [n for n in ast.walk(offset) if _whole(n, 0 if n is offset else 2)]
            case ast.Call(func=func, args=[_, offset]) if _name(func) == "of_axis":
                found = [n for n in ast.walk(offset) if _whole(n, 0 if n is offset else 2)]
            case ast.Compare(left=left, comparators=others):
                sides = [left, *others]
                if any(_name(side) in FUNCTIONS | SETS for side in sides):
                    found = [n for side in sides for n in ast.walk(side) if _whole(n, 2)]
            case ast.MatchValue(value=value) if _whole(value, 2):
                found = [value]
        yield from ((getattr(n, "lineno", 0), ast.unparse(n)) for n in found)


def test_no_bare_number_stands_in_the_sources() -> None:
    assert [(path.name, *found) for path in SOURCES for found in bare(path.read_text())] == []


@pytest.mark.parametrize(
    "line",
    [
        "p.get(8_804) and x",
        "p.write(12_130 + AXIS_SIZE * axis, 1.0)",
        "p.axis(axis, 16, 0.0)",
        "p.axis(axis, 4 + number, 0.0)",
        "of_axis(axis, 130)",
        "call.needed(33)",
        "raise ProgramError(1211)",
        "whole(value, 1202)",
        "self.refuse(1210 if letter else 1211)",
        "g.number == 4",
        "66 in said.blockwise",
        "modal.radius != 40",
        "match m.number:\n    case 30: pass",
        "match number:\n    case 8_683 | 8_703: pass",
        "TAKE = 8_045",
    ],
)
def test_a_bare_number_is_found(line: str) -> None:
    assert list(bare(line))


def test_each_message_has_one_name() -> None:
    assert len({*Code}) == len(Code.__members__)


def test_a_path_condition_and_an_m_function_have_one_name_each() -> None:
    for space in (numbers.G, numbers.M):
        values = [value for value in vars(space).values() if isinstance(value, int)]
        assert len(values) == len(set(values)), space
