"""Who knows what: searches that keep each border where it is."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from isel_twin.firmware.imc.ports import TERMINALS
from isel_twin.wiring.cabinet import ELEMENTS, SIGNALS

ROOT = Path(__file__).parents[1]
COMMON_WORDS = {"start", "stop", "power", "key"}
"""Words of the cabinet that are English first: `stop` of `run_until`, a key of a mapping."""
CABINET = {*ELEMENTS, *SIGNALS, "relay", "brake", "stages", "current_lowering", "spindle_runs"} - COMMON_WORDS
DEMONSTRATION = ROOT / "bridge" / "demo.py"
"""Shows a session to people: documentation that runs."""


def sources(*folders: str) -> Iterator[Path]:
    for folder in folders:
        yield from sorted((ROOT / folder).rglob("*.py"))


def words(path: Path, pattern: str) -> list[str]:
    """Lines of a file, docstrings and comments included, in which the pattern is found."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [f"{path.name}:{number}: {line.strip()}" for number, line in enumerate(lines, 1) if re.search(pattern, line)]


def code(path: Path) -> str:
    """A file without docstrings and comments."""
    text = re.sub(r'""".*?"""', "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"(^|\s)#.*", "", text)


def test_the_twin_knows_no_cabinet_and_no_terminal() -> None:
    names = "|".join(re.escape(name) for name in sorted({*CABINET, *TERMINALS}))
    for file in ("twin.py", "seen.py", "state.py", "observers.py", "assembly.py"):
        assert words(ROOT / "twin" / "core" / file, rf"(?<![\w.])({names})(?!\w)") == []


@pytest.mark.parametrize(
    "path",
    [p for p in sources("twin", "bridge", "envs") if p != DEMONSTRATION],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_a_controllers_language_is_known_in_its_folder_only(path: Path) -> None:
    """No command, no end of a line, no byte with a meaning outside the firmware folders."""
    if path.is_relative_to(ROOT / "twin" / "firmware") and path.parent.name != "firmware":
        return
    assert re.findall(r'b"[^"]*\\[rx]|@0|\bb"@', code(path)) == []


@pytest.mark.parametrize(
    "path", list(sources("twin/motion", "twin/plant", "twin/recordings")), ids=lambda path: str(path.relative_to(ROOT))
)
def test_ticks_are_not_packed(path: Path) -> None:
    assert words(path, r"(?<!\.)\b(en|de)code\(|packed|PAIR|100 ps") == []


def test_machines_name_no_terminal() -> None:
    for path in sorted((ROOT / "models").rglob("*.toml")):
        assert words(path, "terminal|" + "|".join(re.escape(name) for name in TERMINALS)) == []


@pytest.mark.parametrize(
    "path", list(sources("twin", "bridge", "envs", "models")), ids=lambda p: str(p.relative_to(ROOT))
)
def test_only_the_pseudo_terminal_needs_posix(path: Path) -> None:
    """What only POSIX has may be asked for where it is used, with an answer for where it is missing."""
    if path == ROOT / "bridge" / "serve" / "pty.py":
        return
    assert words(path, r"^(import|from) (fcntl|grp|posix|pty|pwd|resource|syslog|termios|tty)\b") == []
    if path != DEMONSTRATION:
        assert words(path, r"^(import|from) isel_twin\.bridge\.serve\.pty\b") == []


def test_firmware_has_no_circle_of_imports() -> None:
    """Those for type checking count as well: who names a type knows its module."""
    known: dict[str, set[str]] = {}
    for path in sources("twin/firmware"):
        name = ".".join(("isel_twin", *path.relative_to(ROOT / "twin").with_suffix("").parts))
        imports = [node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.ImportFrom)]
        known[name] = {f"{node.module}.{alias.name}" for node in imports for alias in node.names}
        known[name] |= {str(node.module) for node in imports}
    known = {name: {other for other in others if other in known} for name, others in known.items()}
    assert list(TopologicalSorter(known).static_order())
