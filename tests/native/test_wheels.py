"""What the build backend makes: a source archive with C and without a library, a wheel with the library of its platform
and without C; and the core for every machine that there is a wheel for."""

from __future__ import annotations

import base64
import csv
import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from native.test_library import FUSED

from isel_twin.native import compiling
from tests.release import look

pytestmark = [pytest.mark.slow, pytest.mark.long(seconds=60)]

ROOT = Path(__file__).parents[2]
FILES = ("pyproject.toml", "README.md", "LICENSE", "MANIFEST.in", "twin", "bridge", "envs", "models", "wheels")
HOOKS = (  # of a backend that sees no ziglang, if the last word is "bare"
    "import sys; sys.path[:0] = ['wheels', 'twin/native']; import backend\n"
    "if sys.argv[-1] == 'bare': sys.modules['ziglang'] = None; sys.argv.pop()\n"
    "print(getattr(backend, sys.argv[1])(*map(eval, sys.argv[2:])))"
)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A copy of the checkout, with a stale library in it."""
    tree = tmp_path / "tree"
    tree.mkdir()
    for name in FILES:
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, tree / name)
    (tree / "twin" / "native" / f"core{compiling.suffix()}").write_text("of another day")
    return tree


def hook(tree: Path, *words: str, **variables: str) -> str:
    command = [sys.executable, "-c", HOOKS, *words]
    environment = {**os.environ, **variables}
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


def test_from_a_checkout_by_a_source_archive_to_a_wheel(tree: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    archive = out / hook(tree, "build_sdist", repr(str(out)))
    look(archive)
    with tarfile.open(archive) as file:
        file.extractall(tmp_path / "unpacked", filter="data")
    (source,) = (tmp_path / "unpacked").iterdir()
    mine = {path.relative_to(ROOT) for path in compiling.sources()}
    assert {path.relative_to(source) for path in source.rglob("*.[ch]") if "bridge" not in path.parts} == mine
    wheel = out / hook(source, "build_wheel", repr(str(out)))
    assert wheel.name.split("-")[2:4] == ["py3", "none"]
    assert wheel.stem.split("-")[-1] != "any"
    look(wheel)
    with zipfile.ZipFile(wheel) as file:
        names = file.namelist()
        (about,) = (name for name in names if name.endswith(".dist-info/WHEEL"))
        (record,) = (name for name in names if name.endswith(".dist-info/RECORD"))
        assert f"Root-Is-Purelib: false\nTag: py3-none-{wheel.stem.split('-')[-1]}\n" in file.read(about).decode()
        rows = list(csv.reader(file.read(record).decode().splitlines()))
        assert [row[0] for row in rows] == names
        for name, digest, size in rows[:-1]:
            data = file.read(name)
            sha256 = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
            assert (digest, size) == (f"sha256={sha256}", str(len(data)))
        assert [name for name in names if name.endswith((".c", ".h")) and "linuxcnc" not in name] == []
        made = file.extract(f"isel_twin/native/core{compiling.suffix()}", tmp_path)
    assert ctypes.CDLL(made).balance


def test_ziglang_is_asked_for_only_where_it_is_needed(tree: Path) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bound = [each for each in project["optional-dependencies"]["dev"] if each.startswith("ziglang")]
    ask = "get_requires_for_build_wheel"
    assert hook(tree, ask, CC="somewhere/cc") == "[]"
    assert hook(tree, ask, "{'target': 'aarch64-macos.11.0'}", CC="somewhere/cc") == str(bound)
    assert hook(tree, ask, "bare", CC="", PATH="/nowhere") == str(bound)


@pytest.mark.parametrize("target", compiling.TARGETS)
def test_the_core_of_every_machine_compiles_and_nothing_in_it_is_fused(target: str, tmp_path: Path) -> None:
    text = compiling.build(tmp_path / "core.s", target=target, extra=("-S",)).read_text(encoding="utf-8")
    assert "balance" in text
    assert FUSED.findall(text) == []
    if "windows" in target:  # `make wheels` links it: ziglang takes a minute and a half to build its C library first
        return
    library = compiling.build(tmp_path / f"core{compiling.suffix(target)}", target=target)
    wheel = tmp_path / f"isel_twin-1-py3-none-{compiling.TARGETS[target]}.whl"
    with zipfile.ZipFile(wheel, "w") as file:
        file.write(library)
    look(wheel)  # by its first bytes
    if target.startswith(f"{platform.machine().lower()}-{platform.system().lower()}"):
        assert ctypes.CDLL(str(library)).balance
