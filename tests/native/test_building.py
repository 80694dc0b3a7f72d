"""A checkout builds its core anew when its C has changed; what stands against that is one line with a remedy."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest
from native.small import SUMS_C, small, sources

from isel_twin.cli import main
from isel_twin.native import Core, CoreError, compiling

__all__ = ["small", "sources"]


def library(sources: Path) -> Path:
    return compiling.library(sources / "core.c")


def wrong(sources: Path) -> str:
    with pytest.raises(CoreError) as caught:
        Core(sources / "core.c").load()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_it_is_built_once_and_again_when_any_source_has_changed(sources: Path) -> None:
    path = library(sources)
    built = path.stat().st_mtime_ns
    assert library(sources).stat().st_mtime_ns == built
    (sources / "sums.c").write_text(SUMS_C + "API double half(double x) { return 0.5 * x; }\n")
    assert Core(sources / "core.c").half(3.0) == 1.5
    assert path.stat().st_mtime_ns > built


def test_nothing_is_left_beside_it(sources: Path) -> None:
    library(sources)
    names = {"core.c", "core.h", "sums.c", f"core{compiling.suffix()}"}
    assert {path.name for path in sources.iterdir()} == names


def test_c_that_is_wrong_is_told_by_file_and_line(sources: Path) -> None:
    library(sources)
    (sources / "sums.c").write_text("API double half(double x) {\n    return x +;\n}\n")
    said = wrong(sources)
    assert "sums.c:2:" in said
    assert "`python -m isel_twin.native.compiling`" in said


def test_without_a_compiler_one_is_named(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(sources))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiling, "find_spec", lambda _: None)
    assert not compiling.usable()
    assert "`pip install ziglang`" in wrong(sources)


def test_a_compiler_that_is_not_there(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "nowhere-cc -O1")
    told = wrong(sources)
    assert told.startswith("nowhere-cc: No such file or directory;")
    assert told.endswith("; CC names this compiler: unset it")


def test_another_library_that_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "other.so").write_bytes(b"none")
    monkeypatch.setenv("ISEL_TWIN_CORE", str(tmp_path / "other.so"))
    with pytest.raises(CoreError, match=r"other\.so: cannot be loaded .*; ISEL_TWIN_CORE names it: unset that$"):
        Core().load()


def test_a_compiler_that_cannot_is_passed_over(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as one without the headers of the C library."""
    works, broken = compiling.compilers()[0], sources / "gcc"
    broken.write_text("#!/bin/sh\necho no headers >&2; exit 1\n")
    broken.chmod(0o755)
    monkeypatch.delenv("CC", raising=False)
    for found, usable in ([[str(broken)]], False), ([[str(broken)], works], True):
        monkeypatch.setattr(compiling, "compilers", lambda found=found: found)
        assert compiling.usable() is usable
    assert library(sources).exists()


def test_a_folder_that_cannot_be_written_to(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryDirectory", refuse)
    assert "cannot be written (Permission denied)" in wrong(sources)


def test_a_library_that_cannot_be_loaded(sources: Path) -> None:
    """Of another kind of machine, or damaged."""
    mark = f"core_source={compiling.digest(compiling.sources(sources / 'core.c'))}"
    (sources / f"core{compiling.suffix()}").write_text(mark)
    assert "cannot be loaded" in wrong(sources)
    assert "build it: `python -m isel_twin.native.compiling`" in wrong(sources)


def test_an_installed_package_compiles_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """There are no C sources: its library is what it came with."""
    monkeypatch.setattr(compiling, "build", None)
    assert wrong(tmp_path) == f"{tmp_path / f'core{compiling.suffix()}'}: is missing; install isel-twin anew"
    (tmp_path / f"core{compiling.suffix()}").touch()
    assert library(tmp_path).exists()


def test_a_command_says_what_is_wrong_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("isel_twin.native.core", Core(tmp_path / "core.c"))
    with pytest.raises(SystemExit) as caught:
        main(["serve", "--tcp", "127.0.0.1:0"])
    said = capsys.readouterr()
    assert caught.value.code == 2
    assert said.out == ""
    assert said.err == f"isel-twin: {tmp_path / f'core{compiling.suffix()}'}: is missing; install isel-twin anew\n"


def test_two_at_once_both_get_a_whole_one(sources: Path) -> None:
    shutil.copy(str(compiling.__file__), sources / "compiling.py")
    call = "import compiling, ctypes; print(ctypes.CDLL(str(compiling.library())).first)"
    both = [
        subprocess.Popen([sys.executable, "-c", call], cwd=sources, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(2)
    ]
    assert [(one.communicate()[1], one.returncode) for one in both] == [(b"", 0)] * 2


def test_every_c_file_of_the_twin_is_in_the_library() -> None:
    """What is found by the names that core.c includes is what there is; records.h is written, exports.h made."""
    tree = compiling.HERE.parents[1]
    there = {path for folder in ("twin", "envs") for path in (tree / folder).rglob("*.[ch]")}
    assert set(compiling.sources()) == there
    assert os.fspath(compiling.HERE / "core.c") in map(os.fspath, there)
