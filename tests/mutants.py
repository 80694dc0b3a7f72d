"""Mutations: change one thing of a module at a time, and see whether the tests notice.

    python tests/mutants.py twin/motion                          every module of a folder, against tests/motion
    python tests/mutants.py twin/wiring/line.py tests/wiring --sample 20
    python tests/mutants.py --sample 100 --seed 7                the whole package, each against the tests that import
                                                                 its module

    a < b -> a <= b    == -> !=    not a -> a    and -> or    3 -> 4    +  -> -    statement -> pass

Goal: to find what no test looks at. Each mutant is written into a copy of the package, so the working tree stays as it
is, and the tests run in a process of their own; a mutant whose tests need twice the processor time is stopped and
counts as noticed. What survives is printed as file:line and the change; some of that means the same as before.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLACES = {"twin": "", "bridge": "bridge", "envs": "envs", "models": "models"}  # folders, and where they are installed
COMPARED = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
COMPARED |= {ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}
CALCULATED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.FloorDiv, ast.FloorDiv: ast.Mult}


def changes(node: ast.AST) -> Iterator[ast.AST]:
    """What may stand in the place of this node."""
    match node:
        case ast.Compare(left, [op], right) if type(op) in COMPARED:
            yield ast.Compare(left, [COMPARED[type(op)]()], right)
        case ast.UnaryOp(ast.Not(), operand):
            yield operand
        case ast.BoolOp(op, values):
            yield ast.BoolOp(ast.Or() if isinstance(op, ast.And) else ast.And(), values)
        case ast.BinOp(left, op, right) if type(op) in CALCULATED:
            yield ast.BinOp(left, CALCULATED[type(op)](), right)
        case ast.Constant(bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(int(value)):
            yield from (ast.Constant(value + 1), ast.Constant(value - 1))
        case ast.Expr(ast.Call()) | ast.AugAssign() | ast.Raise():
            yield ast.Pass()


def mutants(source: str) -> Iterator[tuple[int, str, str]]:
    """Line, what was changed, and the whole changed text, for each mutation of a module."""
    tree = ast.parse(source)
    for parent in ast.walk(tree):
        for name, value in ast.iter_fields(parent):
            places = enumerate(value) if isinstance(value, list) else [(None, value)]
            for index, node in places:
                for new in changes(node) if isinstance(node, ast.AST) else ():
                    put(parent, name, index, new)
                    what = f"{ast.unparse(node)}  ->  {ast.unparse(ast.fix_missing_locations(copy.copy(new)))}"
                    yield node.lineno, what, ast.unparse(ast.fix_missing_locations(tree))  # type: ignore[attr-defined]
                    put(parent, name, index, node)


def put(parent: ast.AST, name: str, index: int | None, node: ast.AST) -> None:
    """Replace a child."""
    if index is None:
        setattr(parent, name, node)
    else:
        getattr(parent, name)[index] = node


def noticed(package: Path, tests: list[str], limit_s: int | None) -> bool:
    """Do the tests fail with this copy of the package, or need more than limit_s of processor time?"""

    def limit() -> None:
        if limit_s is not None:
            resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))

    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    environment = os.environ | {"PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, preexec_fn=limit, check=False)
    return done.returncode != 0


def within(file: Path) -> Path:
    """The place of a source file in the installed package."""
    name, *rest = file.relative_to(ROOT).parts
    return Path(PLACES[name], *rest)


def tests_of(file: Path) -> list[str]:
    """The tests that import a module of the package; without one, those of its folder."""
    parts = within(file).with_suffix("").parts
    dotted, parent = ".".join(("isel_twin", *parts)), ".".join(("isel_twin", *parts[:-1]))
    imported = re.compile(rf"{re.escape(dotted)}\b|from {re.escape(parent)} import [^\n]*\b{parts[-1]}\b")
    found = [test for test in sorted((ROOT / "tests").rglob("test_*.py")) if imported.search(test.read_text("utf-8"))]
    folders = [ROOT.joinpath("tests", *parts[:deep]) for deep in range(len(parts) - 1, -1, -1)]
    return [str(test) for test in found or [next(folder for folder in folders if folder.is_dir())]]


def spent_s() -> float:
    """Processor time of the tests so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> int:
    """Returns 1 if the tests fail without any mutation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="?", type=Path, help="a module or a folder of the package; default: all of it")
    parser.add_argument("tests", nargs="*", help="tests to run; by default those that import the module")
    parser.add_argument("--sample", type=int, default=0, help="so many mutants, drawn at random (0: all)")
    parser.add_argument("--seed", type=int, default=1)
    call = parser.parse_args()
    places = [call.modules.resolve()] if call.modules else [ROOT / name for name in PLACES]
    files = sorted(file for place in places for file in (place.rglob("*.py") if place.is_dir() else [place]))
    work = [(file, *mutant) for file in files for mutant in mutants(file.read_text("utf-8"))]
    if call.sample:
        work = sorted(random.Random(call.seed).sample(work, min(call.sample, len(work))), key=lambda m: (m[0], m[1]))
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "isel_twin"
        for name, inside in PLACES.items():
            shutil.copytree(
                ROOT / name, package / inside, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True
            )
        survivors, limits_s = 0, {}
        for file, line, what, text in work:
            tests = call.tests or tests_of(file)
            if (key := tuple(tests)) not in limits_s:
                before_s = spent_s()
                if noticed(package, tests, None):
                    print(f"the tests fail without a mutation: {' '.join(tests)}")
                    return 1
                limits_s[key] = round(2 * (spent_s() - before_s)) + 5
            limit_s = limits_s[key]
            copied = package / within(file)
            original = copied.read_text("utf-8")
            copied.write_text(text, "utf-8")
            if not noticed(package, tests, limit_s):
                survivors += 1
                print(f"{file.relative_to(ROOT)}:{line}: {what}", flush=True)
            copied.write_text(original, "utf-8")
    print(f"{len(work)} mutants, {survivors} survived")
    return 0


if __name__ == "__main__":
    sys.exit(main())
