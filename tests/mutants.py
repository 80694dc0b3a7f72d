"""Mutations: change one thing of a module at a time, and see whether the tests notice.

    python tests/mutants.py twin/motion                          every module of a folder
    python tests/mutants.py twin/wiring/line.py tests/wiring --sample 20
    python tests/mutants.py --sample 100 --seed 7                the whole package

    a < b -> a <= b    == -> !=    not a -> a    and -> or    3 -> 4    +  -> -    statement -> pass

Goal: to find what no test looks at. Each mutant is written into a copy of the package, so the working tree stays as it
is; of C a library is built. The tests of its module (those named after it, those that import it, those of its folder
or controller, in this order) run in a process of their own to the first that fails; slow ones are left out. A mutant
is noticed if that test passes without the change. A line for each is printed: the place, the change and the test that
noticed.
"""

from __future__ import annotations

import argparse
import ast
import copy
import itertools
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from isel_twin.native import compiling

ROOT = Path(__file__).parents[1]
PLACES = {"twin": "", "bridge": "bridge", "envs": "envs", "models": "models"}  # folders, and where they are installed
ENDLESS_S = 100
"""A test that needs so long has failed, if it passes without the change."""
TIME = "the time"
COMPARED = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
COMPARED |= {ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}
CALCULATED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.FloorDiv, ast.FloorDiv: ast.Mult}

IN_C = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&"}
IN_C |= {"+": "-", "-": "+", "*": "/", "/": "*"}
_WORD_OF_C = re.compile(r"(?<= )(?:[<>=!]=|[<>]|&&|[|]{2}|[-+*/])(?= )|(?<![\w.])[0-9]+(?![\w.])")
_NOT_C = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\])*"|^#[^\n]*', re.DOTALL | re.MULTILINE)


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


def places(tree: ast.AST) -> Iterator[tuple[ast.AST, str, int | None, ast.AST, ast.AST]]:
    """Parent, field, place in it, node and what may stand there, for each mutation of a module."""
    for parent in ast.walk(tree):
        for name, value in ast.iter_fields(parent):
            for index, node in enumerate(value) if isinstance(value, list) else [(None, value)]:
                for new in changes(node) if isinstance(node, ast.AST) else ():
                    yield parent, name, index, node, new


def mutated(source: str, number: int) -> tuple[int, str, str]:
    """Line, what was changed, and the whole text of one mutation of a module."""
    tree = ast.parse(source)
    parent, name, index, node, new = next(itertools.islice(places(tree), number, None))
    what = f"{ast.unparse(node)}  ->  {ast.unparse(ast.fix_missing_locations(copy.copy(new)))}"
    put(parent, name, index, new)
    return getattr(node, "lineno", 0), what, ast.unparse(ast.fix_missing_locations(tree))


def places_in_c(source: str) -> Iterator[tuple[int, str, str]]:
    """Place, word and what may stand there, for each mutation of a C file: operators between blanks, whole numbers."""
    code = _NOT_C.sub(lambda text: " " * len(text[0]), source)
    for word in _WORD_OF_C.finditer(code):
        old = word[0]
        for new in (IN_C[old],) if old in IN_C else (str(int(old) + 1), str(int(old) - 1)):
            yield word.start(), old, new


def mutated_in_c(source: str, number: int) -> tuple[int, str, str]:
    """The same of a C file as `mutated`."""
    place, old, new = next(itertools.islice(places_in_c(source), number, None))
    line = source.count("\n", 0, place)
    what = f"{source.splitlines()[line].strip()}:  {old}  ->  {new}"
    return line + 1, what, source[:place] + new + source[place + len(old) :]


def core_of(folder: Path, file: Path, text: str) -> Path | None:
    """The library with this text in the place of a C file, built in a folder; None if it cannot be compiled."""
    tree = folder / "tree"
    for source in (ROOT / "pyproject.toml", ROOT / "twin/native/compiling.py", *compiling.sources()):
        target = tree / source.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, target)
    (tree / file.relative_to(ROOT)).write_text(text, "utf-8")
    build = [sys.executable, str(tree / "twin/native/compiling.py")]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    return None if done.returncode else Path(done.stdout.strip())


def number_of_places(file: Path) -> int:
    source = file.read_text("utf-8")
    return sum(1 for _ in (places(ast.parse(source)) if file.suffix == ".py" else places_in_c(source)))


def put(parent: ast.AST, name: str, index: int | None, node: ast.AST) -> None:
    """Replace a child."""
    if index is None:
        setattr(parent, name, node)
    else:
        getattr(parent, name)[index] = node


def within(file: Path) -> Path:
    """The place of a source file in the installed package."""
    name, *rest = file.relative_to(ROOT).parts
    return Path(PLACES[name], *rest)


def tests_of(file: Path) -> list[str]:
    """The tests of a module, nearest first: named after it, importing it, in its folder, of its controller."""
    parts = within(file).with_suffix("").parts
    dotted, parent = ".".join(("isel_twin", *parts)), ".".join(("isel_twin", *parts[:-1]))
    imported = re.compile(rf"{re.escape(dotted)}\b|from {re.escape(parent)} import [^\n]*\b{parts[-1]}\b")
    folders = [ROOT.joinpath("tests", *parts[:deep]) for deep in range(len(parts) - 1, 0, -1)]
    folder = next((folder for folder in folders if folder.is_dir()), None)
    ranked = []
    for test in (ROOT / "tests").rglob("test_*.py"):
        text = test.read_text("utf-8")
        near = parts[-1].strip("_") in test.stem and (folder is None or folder in test.parents)
        controller = parts[0] == "firmware" and f"test_{parts[1]}_" in test.name  # conformance to its manual
        if near or imported.search(text) or folder in test.parents or controller:
            long = re.search(r"mark\.long\(seconds=(\d+)", text)
            rank = 0 if near else 1 if imported.search(text) else 2 if folder in test.parents else 3
            said = sum(text.count(word) for word in parts[-2:])
            ranked.append((rank, int(long[1]) if long else 0, -said, str(test.relative_to(ROOT))))
    return [test for *_, test in sorted(ranked)] or ["tests/test_twin.py"]


def first_failure(package: Path, tests: list[str], limit_s: float, core: Path | None = None) -> str | None:
    """The first test that fails with this copy of the package and this core, by default its own; TIME if none has by
    then; None if all pass."""
    command = [sys.executable, "-m", "pytest", "-xqrfE", "-m", "not slow", "-p", "no:cacheprovider"]
    command += [f"--timeout={ENDLESS_S}", *tests]
    environment = os.environ | {"PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    if core is not None:
        environment["ISEL_TWIN_CORE"] = str(core)
        command.append("--timeout-method=thread")  # a signal does not end a loop in C
    with subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        start_new_session=True,
    ) as run:  # fmt: skip
        try:
            said, _ = run.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            return TIME
    if run.returncode in {0, 5}:  # 5: no test is left without the slow ones
        return None
    failed = re.search(r"^(?:FAILED|ERROR) ([^\[ ]+)", said, re.MULTILINE)
    return failed[1] if failed else "the interpreter"


def write(package: Path, file: Path, text: str | None) -> None:
    """Put a text in the place of a module of the copy, or the module itself, without what was compiled of the other."""
    copied = package / within(file)
    for compiled in (copied.parent / "__pycache__").glob(f"{copied.stem}.*"):
        compiled.unlink()
    if text is not None:
        copied.write_text(text, "utf-8")
        return
    shutil.copy2(file, copied)
    for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*"):
        shutil.copy2(compiled, copied.parent / "__pycache__")


def main() -> int:
    """Returns 1 if tests fail without any mutation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="?", type=Path, help="a module or a folder of the package; default: all of it")
    parser.add_argument("tests", nargs="*", help="tests to run; by default those of the module")
    parser.add_argument("--sample", type=int, default=0, help="so many mutants, drawn at random (0: all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=900.0, help="for the tests of one mutant; later: undecided")
    call = parser.parse_args()
    folders = [call.modules.resolve()] if call.modules else [ROOT / name for name in PLACES]
    generated = "records.h", "exports.h"
    inside = (place.rglob(kind) if place.is_dir() else [place] for place in folders for kind in ("*.py", "*.[ch]"))
    files = sorted(set(itertools.chain(*inside)))
    work = [(file, n) for file in files if file.name not in generated for n in range(number_of_places(file))]
    if call.sample:
        work = random.Random(call.seed).sample(work, min(call.sample, len(work)))
    tests = {file: call.tests or tests_of(file) for file, _ in work}
    work.sort(key=lambda mutant: (len(tests[mutant[0]]), mutant))  # short ones first
    compiling.library()  # the copy has that of the present C
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "isel_twin"
        for name, inside in PLACES.items():
            shutil.copytree(ROOT / name, package / inside, dirs_exist_ok=True)  # and what is compiled of it
        counted: Counter[str] = Counter()
        for file, number in work:
            source = file.read_text("utf-8")
            if file.suffix == ".py":
                line, what, text = mutated(source, number)
                write(package, file, text)
                failed = first_failure(package, tests[file], call.seconds)
                same = ast.unparse(ast.parse(source))
            else:
                line, what, text = mutated_in_c(source, number)
                core = core_of(Path(folder), file, text)
                failed = first_failure(package, tests[file], call.seconds, core) if core else "the compiler"
                same = source
            if failed == "the compiler":
                result = "noticed"
            elif failed is None or failed == TIME:
                result = "undecided" if failed else "survived"
            else:
                write(package, file, same)  # as the mutant is written, without the change
                again = first_failure(package, [failed] if "::" in failed else tests[file], call.seconds)
                result = "fails without a mutation" if again else "noticed"
            write(package, file, None)
            counted[result] += 1
            print(f"{result}: {file.relative_to(ROOT)}:{line}: {what}  [{failed or 'all pass'}]", flush=True)
    print(f"{len(work)} mutants: {', '.join(f'{many} {result}' for result, many in counted.items())}")
    return 1 if counted["fails without a mutation"] else 0


if __name__ == "__main__":
    sys.exit(main())
