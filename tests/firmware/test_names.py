"""Nothing outside a controller's own folder knows it: elsewhere its name stands in defaults and documentation only."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONTROLLERS = PROJECT["entry-points"]["isel_twin.controllers"]
FOLDERS = {target.split(":")[0].split(".")[2] for target in CONTROLLERS.values()}
NAME = re.compile(rf"(?<![a-z0-9])({'|'.join(sorted({*CONTROLLERS, *FOLDERS}))})(?![a-z0-9])", re.IGNORECASE)
DEFAULT = "imc-s8"
DEMONSTRATION = ROOT / "bridge" / "demo.py"
"""Prints what it shows to a person, controller included: documentation that runs."""

SOURCES = [
    path
    for folder in ("twin", "bridge", "envs", "models")
    for path in sorted((ROOT / folder).rglob("*.py"))
    if path != DEMONSTRATION and not any(path.is_relative_to(ROOT / "twin" / "firmware" / name) for name in FOLDERS)
]


def named_in_code(path: Path) -> Iterator[str]:
    """Every use of a controller's name that is no comment, no docstring and no default of a parameter or field."""
    text = path.read_text(encoding="utf-8")
    if not NAME.search(text):
        return
    tree = ast.parse(text)
    allowed = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            allowed.add(node.value)
        if isinstance(node, ast.FunctionDef):
            defaults = [*node.args.defaults, *(default for default in node.args.kw_defaults if default)]
            allowed |= {d for d in defaults if isinstance(d, ast.Constant) and d.value == DEFAULT}
        if isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Constant) and node.value.value == DEFAULT:
            allowed.add(node.value)  # a field of a dataclass
    for node in ast.walk(tree):
        if node in allowed:
            continue
        for field in ("value", "id", "attr", "name", "module", "arg"):
            word = getattr(node, field, None)
            if isinstance(word, str) and NAME.search(word):
                yield f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', '?')}: {word!r}"


def test_the_search_covers_the_package() -> None:
    assert {"imc", "ismif"} <= FOLDERS
    assert len(SOURCES) > 20
    assert ROOT / "twin" / "core" / "twin.py" in SOURCES


def test_no_controller_is_known_outside_its_folder() -> None:
    assert [found for path in SOURCES for found in named_in_code(path)] == []


def test_machines_name_controllers_only_as_sources() -> None:
    for path in sorted((ROOT / "models").rglob("*.toml")):
        for line in path.read_text(encoding="utf-8").splitlines():
            without_source = re.sub(r'source = "[^"]*"', "", line.split("#")[0])
            assert not NAME.search(without_source), f"{path.relative_to(ROOT)}: {line}"


@pytest.mark.parametrize(
    "code",
    ["from isel_twin.firmware import imc", "if name == 'ismif': pass", "def f(c='c142'): pass", "IMC_PORTS = 3"],
)
def test_the_search_finds(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    (tmp_path / "module.py").write_text(f'"""The iMC-S8 in a docstring."""\n{code}\n', encoding="utf-8")
    assert len(list(named_in_code(tmp_path / "module.py"))) == 1
