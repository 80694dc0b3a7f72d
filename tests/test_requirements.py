"""What the package imports is declared, in the base or in the extra that the code belongs to, and with an upper bound
where it leans on more than a library promises."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: Mapping[str, list[str]] = PROJECT["optional-dependencies"]
OF_FOLDERS = {  # extras of the code in them
    "bridge/editor": ["lsp"],
    "bridge/fmu": ["fmu"],
    "bridge/opcua": ["opcua"],
    "bridge/operate/panel": ["panel"],
    "bridge/robot": ["robot"],
    "twin/base/cluster.py": ["cluster"],
    "twin/base/crew.py": ["cluster"],
    "twin/base/pictures.py": ["report"],
    "twin/many/identification": ["tune"],
    "twin/many/studies": ["tune"],
    "twin/many/tuning": ["tune"],
    "twin/recordings/parquet.py": ["trace"],
    "twin/recordings/protobuf.py": ["trace"],
    "twin/report": ["report"],
}
GIVEN = {  # by whatever runs that code
    "bridge/linuxcnc/retrofit": {"hal", "linuxcnc"},
    "bridge/pytest": {"pytest"},
    "twin/cli/starter": {"pytest"},
}
OF_EXAMPLES = {"learn"}  # docs/examples
LEANED_ON = {
    "mujoco": "addresses of its structures, and where the time step stands in one (twin/plant/native.py)",
    "ziglang": "how its compiler names processors, and that it fuses nothing (twin/native/compiling.py)",
    "pyserial": "the clock of its timeouts is replaced (bridge/virtual/stand_ins.py)",
    "viser": "the server that it starts is replaced (bridge/operate/panel/guarded.py)",
    "websockets": "the same: this is the server",
    "asyncua": "the bounds of its sessions are set, and its events sent, inside its server (bridge/opcua)",
    "pythonfmu3": "what its wrapper lets go of too often is held (decision bridge/34)",
}


def name_of(requirement: str) -> str:
    """As indexes compare names."""
    found = re.match(r"[\w.-]+", requirement)
    assert found
    return re.sub(r"[-_.]+", "-", found[0]).lower()


def imports(folders: Iterator[Path]) -> Iterator[tuple[Path, str]]:
    """File and first name of each import of a package that Python does not bring."""
    for path in folders:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                names = [node.module]
            else:
                continue
            for top in {name.partition(".")[0] for name in names} - sys.stdlib_module_names - {"isel_twin"}:
                yield path.relative_to(ROOT), top


def sources() -> Iterator[Path]:
    for folder in ("twin", "bridge", "envs", "models"):
        yield from sorted((ROOT / folder).rglob("*.py"))


def under(path: Path, folder: str) -> bool:
    return path.is_relative_to(folder)


def allowed(path: Path) -> set[str]:
    """Distributions that code may import there."""
    extras = [extra for folder, extras in OF_FOLDERS.items() if under(path, folder) for extra in extras]
    lists = [PROJECT["dependencies"], *(EXTRAS[extra] for extra in extras)]
    return {name_of(requirement) for requirements in lists for requirement in requirements}


def test_each_import_is_declared_where_its_code_belongs() -> None:
    distributions = packages_distributions()
    undeclared = []
    for path, top in imports(sources()):
        given = any(under(path, folder) and top in names for folder, names in GIVEN.items())
        if not given and allowed(path).isdisjoint(map(name_of, distributions.get(top, [top]))):
            undeclared.append(f"{path}: {top}")
    assert undeclared == []


def test_each_requirement_is_imported() -> None:
    distributions = packages_distributions()
    imported = {name_of(each) for _, top in imports(sources()) for each in distributions.get(top, [top])}
    lists = [PROJECT["dependencies"], *(EXTRAS[extra] for extra in EXTRAS.keys() - OF_EXAMPLES - {"dev"})]
    assert {name_of(requirement) for requirements in lists for requirement in requirements} <= imported


@pytest.mark.parametrize("name", LEANED_ON)
def test_what_is_leaned_on_has_an_upper_bound(name: str) -> None:
    lists = [PROJECT["dependencies"], *EXTRAS.values()]
    found = [each for requirements in lists for each in requirements if name_of(each) == name]
    assert found
    assert all(re.search(r"<|==", each) for each in found), found


def test_tests_have_every_extra_but_the_examples() -> None:
    named = re.fullmatch(r"isel-twin\[(.*)\]", EXTRAS["dev"][0])
    assert named
    assert set(named[1].split(",")) == EXTRAS.keys() - OF_EXAMPLES - {"dev"}
