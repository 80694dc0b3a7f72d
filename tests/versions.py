"""Other interpreters, and the lowest versions of libraries that pyproject.toml allows.

python -m tests.versions others [--whole]    on every other interpreter of 3.11 to 3.14 that is found: the quick tests
                                             and every command once; --whole: all tests
python -m tests.versions lowest              with the lowest interpreter and the lowest versions: every command once, a
                                             job on every controller, the gate of the panel, the language server

Each has a virtual environment of its own in build/.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
NAMES = [f"python3.{minor}" for minor in range(11, 15)]
SMOKE = ("tests/smoke", "tests/panel/test_site.py", "tests/bridge/test_editor.py")
MORE = (
    *("tests/test_borders.py", "tests/test_save.py", "tests/test_roles.py", "tests/cli/test_broken_plugins.py"),
    "tests/bridge/test_virtual_host.py",  # private parts of CPython
)


def interpreters() -> Iterator[tuple[str, Path]]:
    """Name and path of the interpreters that are found on the path or in pyenv's folder, but for this one."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for name in NAMES:
        folders = [*map(Path, os.environ["PATH"].split(os.pathsep)), *sorted(pyenv.glob("*/bin"))]
        for path in (folder / name for folder in folders):
            if name != f"python3.{sys.version_info.minor}" and path.is_file() and _runs(path):
                yield name, path
                break


def tried(python: Path | str, name: str, options: tuple[str, ...], tests: list[str]) -> bool:
    """True if these tests pass in an environment of that name, made anew. options: of the installation."""
    folder = ROOT / "build" / name
    own = folder / "bin" / "python"
    install = (sys.executable, "-m", "uv", "pip", "install", "--quiet", "--python", own, *options)
    for command in (
        (python, "-m", "venv", "--clear", "--without-pip", folder),
        (*install, "--editable", ".[dev]"),
        (own, "-m", "pytest", "--numprocesses", "2", "--dist", "loadfile", *tests),
    ):
        print(name, *command, flush=True)
        if subprocess.run(command, cwd=ROOT, check=False).returncode:
            return False
    return True


def _runs(python: Path) -> bool:
    return subprocess.run([python, "-c", ""], capture_output=True, check=False).returncode == 0


def _quick() -> list[str]:
    """What `make quick` tests."""
    told = re.search(r"QUICK := (.*?)\nquick:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.DOTALL)
    assert told
    return ["-m", "not slow", *re.findall(r"tests/\S+", told[1])]


def main(words: list[str]) -> int:
    match words:
        case ["lowest"]:  # of libraries there are wheels for the lowest interpreter only
            python = dict(interpreters()).get(NAMES[0], sys.executable)
            return 0 if tried(python, "lowest", ("--resolution", "lowest-direct"), [*SMOKE]) else 1
        case ["others", *whole] if whole in ([], ["--whole"]):
            found = dict(interpreters())
            print("found:", *found, flush=True)
            tests = [] if whole else [*dict.fromkeys([*_quick(), *SMOKE, *MORE])]
            return 0 if all([tried(python, name, (), tests) for name, python in found.items()]) else 1
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
