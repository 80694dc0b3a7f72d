"""Whose code a compiled function contains: numba asks only whether the function's own file has changed, so a module
names the others (`contains`), or machine code with an old number or an old record goes on being used."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest

from isel_twin.base import compiling

ROOT = Path(__file__).parents[1]


@cache
def source(module: str) -> ast.Module:
    return ast.parse(file(module).read_text(encoding="utf-8"))


@cache
def file(module: str) -> Path:
    spec = find_spec(module)
    return Path(str(spec and spec.origin)).resolve()


@cache
def bound(module: str) -> dict[str, tuple[str, str] | ast.stmt]:
    """What the names of a module are: (module, name) of ours that is imported, name "" for a module itself, or a
    statement."""
    names: dict[str, tuple[str, str] | ast.stmt] = {}
    for statement in source(module).body:
        if isinstance(statement, ast.ImportFrom) and (statement.module or "").startswith("isel_twin"):
            of = statement.module or ""
            for alias in statement.names:
                whole = isinstance(getattr(import_module(of), alias.name, None), ModuleType)
                names[alias.asname or alias.name] = (f"{of}.{alias.name}", "") if whole else (of, alias.name)
        elif isinstance(statement, ast.FunctionDef | ast.ClassDef):
            names[statement.name] = statement
        elif isinstance(statement, ast.Assign | ast.AnnAssign):
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            names |= {
                each.id: statement for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)
            }
    return names


def reached(module: str, name: str, seen: set[tuple[str, str]]) -> Iterator[str]:
    """The modules of all that a name of a module is made of."""
    if (module, name) in seen:
        return
    seen.add((module, name))
    meaning = bound(module).get(name)
    if isinstance(meaning, tuple):
        if meaning[1]:
            yield from reached(*meaning, seen)
    elif meaning is not None:
        yield module
        body = meaning.body if isinstance(meaning, ast.FunctionDef) else [meaning]
        parts = [each for statement in body for each in ast.walk(statement)]
        own = {each.id for each in parts if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)}
        own |= {each.arg for each in ast.walk(meaning) if isinstance(each, ast.arg)}
        for each in parts:
            if isinstance(each, ast.Name) and each.id not in own:
                yield from reached(module, each.id, seen)
            elif isinstance(each, ast.Attribute) and isinstance(each.value, ast.Name) and each.value.id not in own:
                of = bound(module).get(each.value.id)
                if isinstance(of, tuple) and not of[1]:
                    yield from reached(of[0], each.attr, seen)


def entries(path: Path) -> list[str]:
    """The functions of a file that are compiled for Python."""
    found: list[str] = []
    text = path.read_text(encoding="utf-8")
    for statement in ast.parse(text).body if "@njit(" in text else ():
        for decorator in statement.decorator_list if isinstance(statement, ast.FunctionDef) else ():
            words = ast.unparse(decorator)
            if words.startswith("njit(") and "inner=True" not in words:
                found.append(statement.name)  # type: ignore[attr-defined]
    return found


PLACES = {"twin": "isel_twin", "envs": "isel_twin.envs", "bridge": "isel_twin.bridge"}
COMPILED = [
    ".".join((package, *path.relative_to(ROOT / folder).with_suffix("").parts))
    for folder, package in PLACES.items()
    for path in sorted((ROOT / folder).rglob("*.py"))
    if entries(path)
]


@pytest.mark.parametrize("module", COMPILED)
def test_all_files_are_named_whose_code_and_numbers_are_compiled_in(module: str) -> None:
    import_module(module)
    named = {file(module), *(Path(each).resolve() for each in compiling._CONTAINED.get(module, ()))}
    seen: set[tuple[str, str]] = set()
    needed = {file(other) for name in entries(file(module)) for other in reached(module, name, seen)}
    assert sorted(str(each.relative_to(ROOT)) for each in needed - named) == []
