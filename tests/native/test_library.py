"""The library of this checkout: the records and numbers of Python, and no fused instruction, which rounds once where
two operations round twice, so that not every processor would have the same bits."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from isel_twin.native import compiling, core, records

FUSED = re.compile(r"^\s*(?:vfn?m(?:add|sub)\w*|fn?m(?:add|sub|l[as]\w*))\s.*$", re.MULTILINE)  # x86-64, aarch64


def assembly(folder: Path, compiler: list[str], *flags: str) -> str:
    return compiling.build(folder / "core.s", compiler, ("-S", *flags)).read_text(encoding="utf-8")


@pytest.mark.parametrize("compiler", compiling.compilers(), ids=lambda words: Path(words[-1]).name)
def test_no_instruction_is_fused(compiler: list[str], tmp_path: Path) -> None:
    text = assembly(tmp_path, compiler)
    assert "balance" in text
    assert FUSED.findall(text) == []


def test_a_fused_instruction_would_be_found(tmp_path: Path) -> None:
    fused = ["-ffp-contract=fast", *(["-mfma"] if "-mno-fma" in compiling._flags([], "") else [])]
    assert FUSED.findall(assembly(tmp_path, compiling.compilers()[0], *fused)) != []


def test_records_h_is_what_python_says() -> None:
    """Else: python -m isel_twin.native.records."""
    write = "import sys; from isel_twin.native import records; sys.stdout.write(records.text())"
    done = subprocess.run([sys.executable, "-c", write], capture_output=True, text=True, check=True)
    assert records.HEADER.read_text(encoding="utf-8") == done.stdout


def test_each_function_marked_for_python_is_there_by_its_prototype() -> None:
    marked = {
        name
        for path in compiling.sources()
        for name in re.findall(r"^API (?:int64_t|double|void) (\w+)\(", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    records.text()  # all records are known
    assert marked
    assert set(core._prototypes) == marked
    for name in marked:
        assert callable(getattr(core, name))
