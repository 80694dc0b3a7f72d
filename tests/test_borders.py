"""Who knows what: searches that keep each border where it is."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
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
    for file in ("twin.py", "connected.py", "seen.py", "state.py", "observers.py", "assembly.py"):
        assert words(ROOT / "twin" / "core" / file, rf"(?<![\w.])({names})(?!\w)") == []


def test_a_controllers_language_is_known_in_its_folder_only() -> None:
    """No command, no end of a line, no byte with a meaning outside the firmware folders."""
    firmware = ROOT / "twin" / "firmware"
    for path in sources("twin", "bridge", "envs"):
        if path != DEMONSTRATION and not (path.is_relative_to(firmware) and path.parent != firmware):
            assert (path.name, re.findall(r'b"[^"]*\\[rx]|@0|\bb"@', code(path))) == (path.name, [])


def test_ticks_are_not_packed() -> None:
    for path in sources("twin/motion", "twin/plant", "twin/recordings"):
        assert words(path, r"(?<!\.)\b(en|de)code\(|packed|PAIR|100 ps") == []


def test_machines_name_no_terminal() -> None:
    for path in sorted((ROOT / "models").rglob("*.toml")):
        assert words(path, "terminal|" + "|".join(re.escape(name) for name in TERMINALS)) == []


def test_only_the_pseudo_terminal_needs_posix() -> None:
    """What only POSIX has may be asked for where it is used, with an answer for where it is missing."""
    modules = r"^(import|from) (fcntl|grp|posix|pty|pwd|resource|syslog|termios|tty)\b"
    for path in sources("twin", "bridge", "envs", "models"):
        if path != ROOT / "bridge" / "serve" / "pty.py":
            ours = "" if path == DEMONSTRATION else r"|^(import|from) isel_twin\.bridge\.serve\.pty\b"
            assert words(path, modules + ours) == []


ROOMS = re.findall(
    r"[\w.]+",
    """
    version base native models drives motion cam controller language machine firmware plant wiring core testing jobs
    capture recordings report many envs bridge.serve bridge.operate bridge.tap bridge.virtual bridge.linuxcnc
    bridge.pytest bridge.editor bridge.fmu bridge.mtconnect bridge.opcua bridge.robot bridge.demo cli
    __main__
    """,
)
"""The house from its ground up: a room knows those before it."""


@cache
def imports() -> dict[str, set[str]]:
    """Which modules of the package each of its modules imports, where it needs them or for types only."""
    files = {path: path.relative_to(ROOT).with_suffix("").parts for path in sources("twin", "bridge", "envs", "models")}
    names = {path: ".".join(parts[parts[0] == "twin" :]).removesuffix(".__init__") for path, parts in files.items()}
    names = {path: "" if name == "__init__" else name for path, name in names.items()}
    modules, known = set(names.values()), dict[str, set[str]]()
    for path, name in names.items():
        found = set()
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "isel_twin":
                module = str(node.module).removeprefix("isel_twin").removeprefix(".")
                inner = {f"{module}.{alias.name}".removeprefix(".") for alias in node.names}
                found |= (inner & modules) or {module}
            elif isinstance(node, ast.Import):
                found |= {a.name.removeprefix("isel_twin.") for a in node.names if a.name.startswith("isel_twin.")}
        known[name] = found - {name, ""}
    return known


def room(module: str) -> str:
    """The room in which a module is; "" for the door of the package."""
    return next((name for name in ROOMS if f"{module}.".startswith(f"{name}.")), module.partition(".")[0])


def test_every_module_is_in_a_room() -> None:
    assert {room(module) for module in imports()} == {*ROOMS, "", "bridge"}
    assert sorted(path.name for path in (ROOT / "twin").glob("*.py")) == ["__init__.py", "__main__.py", "version.py"]


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_knows_those_below_it_only(name: str) -> None:
    below = {*ROOMS[: ROOMS.index(name) + 1], "bridge"}
    above = {f"{module} -> {other}" for module, others in imports().items() for other in others if room(module) == name}
    assert {arrow for arrow in above if room(arrow.split(" -> ")[1]) not in below} == set()


def test_there_is_no_circle_of_imports() -> None:
    """Those for type checking count as well: who names a type knows its module."""
    assert len(list(TopologicalSorter(imports()).static_order())) >= len(imports())
