"""Compiled functions without a folder to keep them in: everything works, and one line says what it costs."""

from __future__ import annotations

import logging
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from isel_twin.base import compiled_code, compiling, object_code
from tests.forked import PATIENCE_S
from tests.reliability.figures import code_mb

pytestmark = pytest.mark.long(seconds=14)

ROOT = Path(__file__).parents[1]

SESSION = """
import sys
sys.path.insert(0, sys.argv[1])
import isel_twin.cli
assert isel_twin.cli.__file__.startswith(sys.argv[1])
try:
    isel_twin.cli.main(["decode", "@07"])
except SystemExit as end:
    assert not end.code
from isel_twin.motion import line, StepRun, constant
run = StepRun(line((3, -2, 0, 0)), constant(3, 1000), 0)
print(run.window(0, 3)[1].tolist())
"""
"""Compiles what makes the steps of a path: a part of a second, where a whole twin takes many."""


def test_without_any_folder_to_write_in_all_is_compiled_anew(tmp_path: Path) -> None:
    """As root, too: where the folders should be, there are files."""
    package = tmp_path / "isel_twin"
    for source, name in (("twin", "."), ("models", "models"), ("bridge", "bridge")):
        shutil.copytree(ROOT / source, package / name, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
    for folder in [package, *package.rglob("*")]:
        if folder.is_dir():
            (folder / "__pycache__").write_text("no folder")
    (tmp_path / "home").write_text("no folder")
    nowhere = str(tmp_path / "home")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    done = subprocess.run(
        [sys.executable, "-c", SESSION, str(tmp_path)],
        env={**environment, "HOME": nowhere, "XDG_CACHE_HOME": nowhere, "NUMBA_OPT": "1"},
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "initialise: X Y Z\n" in done.stdout
    assert done.stdout.endswith("[[1, -1, 0, 0], [1, 0, 0, 0], [1, -1, 0, 0]]\n")
    assert done.stderr == (
        "isel-twin: no folder to keep compiled code in, so each start compiles it anew; name one by NUMBA_CACHE_DIR\n"
    )


@pytest.fixture
def silent(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if nothing had been said yet."""
    monkeypatch.setattr(compiled_code, "_said", False)


@pytest.mark.usefixtures("silent")
def test_code_that_cannot_be_kept_is_used_all_the_same(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A disk that is full is found out when the code is stored."""

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile._save_data", full)

    @compiling.njit()
    def twice(n):  # type: ignore[no-untyped-def]
        return 2 * n

    @compiling.njit()
    def thrice(n):  # type: ignore[no-untyped-def]
        return n + twice(n)

    with caplog.at_level(logging.WARNING):
        assert (thrice(7), twice(np.float64(0.5))) == (21, 1.0)
    assert [record.getMessage() for record in caplog.records] == [
        "compiled code cannot be kept (No space left on device), so each start compiles it anew; "
        "name a folder for it by NUMBA_CACHE_DIR"
    ]


def test_what_is_no_matter_of_folders_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("something else")

    monkeypatch.setattr("numba.core.caching.FunctionCache.__init__", fail)
    with pytest.raises(RuntimeError, match="something else"):
        compiling.njit()(lambda n: n)(1)


def test_codes_for_other_types_never_share_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two processes compile a function at the same time for other types, and neither sees the other's index. What one
    of them has stored may be compiled again, but is never taken for the other's."""
    first, second = (compiled_code._Files(str(tmp_path), "advance", "source") for _ in range(2))
    write = first._save_data

    def write_late(name: str, data: object) -> None:
        second.save("int32", "code for int32")
        write(name, data)

    with monkeypatch.context() as at_once:
        at_once.setattr(compiled_code._Files, "_load_index", lambda _: {})
        at_once.setattr(first, "_save_data", write_late)
        first.save("int8", "code for int8")
    assert (second.load("int8"), second.load("int32")) == ("code for int8", None)


def test_the_index_names_no_code_that_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While a new source is compiled, the code of the old one is not loaded for it."""
    old, new = (compiled_code._Files(str(tmp_path), "advance", source) for source in ("old source", "new source"))
    old.save("int8", "old code")
    seen: list[object] = []
    write = new._save_data
    monkeypatch.setattr(new, "_save_data", lambda name, data: (seen.append(new.load("int8")), write(name, data)))
    new.save("int8", "new code")
    assert [*seen, new.load("int8")] == [None, "new code"]


OUTER = """
import inner
from inner import more
from isel_twin.base.compiling import contains, njit

@njit()
def outer(n):
    return more(n)

contains(__name__, inner.__file__)
"""
INNER = """
from isel_twin.base.compiling import njit

@njit()
def more(n):
    return n + {by}
"""


KEPT = """
import ctypes
import numpy as np
import inner
from inner import more
from isel_twin.base.compiling import contains, njit

ROW = np.dtype([("count", "i8"), ("share", "f8")])

@njit(nogil=True)
def total(rows, table, factor, n):
    rows[0].count += n
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            rows[0].share += table[i, j] * factor // 1.0
    return more(rows[0].count) % n

@njit()
def takes_memory(n):
    return np.arange(n).sum()

hypot = ctypes.CDLL(None).hypot
hypot.argtypes, hypot.restype = [ctypes.c_double] * 2, ctypes.c_double

@njit()
def calls_an_address(x):
    return hypot(x, 4.0)

contains(__name__, inner.__file__)
"""
CALLS = """
import sys
import numpy as np
import kept

early = "numba" in sys.modules
rows, table = np.zeros(1, kept.ROW), np.arange(6.0).reshape(2, 3)
results = [kept.total(rows, table, 0.5, n) for n in (4, 7)]
print(results, rows.tolist(), early, "numba" in sys.modules)
"""
RARE = """
import llvmlite.binding
print(llvmlite.binding.address_of_symbol("numba_do_raise"))
print(kept.total(rows, table[:, :2], 0.5, 7), kept.takes_memory(4), kept.calls_an_address(3.0))
try:
    kept.total(rows, table, 0.5, 0)
except ZeroDivisionError as error:
    print(error)
"""
OFTEN = "from isel_twin.base import compiling; compiling.OFTEN = 1"


DICT = pickle.dumps({"of": "another program"})


def test_kept_object_code_is_called_without_numba(tmp_path: Path) -> None:
    """From the second process on, until it is called often, for the types it was compiled for, and as long as no file
    that it contains has changed (numba asks only for the function's own); what it cannot do is numba's, and so are
    errors, by functions that numba finds as if there were no object code. Damaged, it is made again. Nobody imports
    numba before the first call."""
    (tmp_path / "kept.py").write_text(KEPT)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"  # which is not made anew for a file of the same size and second

    def told(code: str, by: int = 1, **more: str) -> list[str]:
        (tmp_path / "inner.py").write_text(INNER.format(by=by))
        done = subprocess.run(
            [sys.executable, "-c", code], env={**environment, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), **more},
            cwd=tmp_path, capture_output=True, text=True, check=True, timeout=PATIENCE_S,
        )  # fmt: skip
        return done.stdout.splitlines()

    same, changed = "[1, 5] [(11, 12.0)] False", "[3, 0] [(11, 12.0)] False"
    assert told(CALLS) == [f"{same} True"]
    assert told(CALLS + RARE) == [f"{same} False", "None", "5 6 5.0", "integer modulo by zero"]
    assert not [*(tmp_path / "cache").glob("kept.calls_an_address-*.o")]  # which is of one process
    assert told(OFTEN + CALLS) == [f"{same} True"]
    assert told(CALLS, NUMBA_OPT="1") == [f"{same} True"]
    assert told(CALLS, by=3) == [f"{changed} True"]
    (code,) = (tmp_path / "cache").glob("kept.total-*.o")
    whole = code.read_bytes()
    machine_code = whole.index(b"\x7fELF") + 64
    for damaged in (whole[:100], whole[:machine_code] + bytes(400) + whole[machine_code + 400 :]):
        code.write_bytes(damaged)
        assert told(CALLS, by=3) == [f"{changed} True"]
    for damaged in (lambda found: found[:100], lambda _: b"", lambda _: b"\xff of another program", lambda _: DICT):
        for file in (tmp_path / "cache").rglob("kept.total-*"):
            file.write_bytes(damaged(file.read_bytes()))
        assert told(CALLS, by=3) == [f"{changed} True"]
        assert told(CALLS, by=3) == [f"{changed} False"], "made anew"
    for stamp in (tmp_path / "cache").rglob("*.drives"):
        stamp.write_bytes(b"\xff\xfe")
    assert told(OFTEN + CALLS, by=3) == [f"{changed} True"]


@pytest.mark.parametrize(
    "value",
    [True, 2**63, "text", np.zeros((4, 4))[:, 1], np.zeros((2, 3), order="F"), np.float32(1.0)],
    ids=["bool", "too large", "text", "stride", "Fortran", "float32"],
)
def test_what_numba_alone_takes(value: object) -> None:
    assert object_code.kinds_of((1, value)) is None
    assert object_code.kinds_of((1, np.float64(2.0), np.int64(3))) == (int, float, int)


LOWERED = """
import sys
from pathlib import Path
from isel_twin.base import lowered
from outer import outer
folder = Path("lowered")
if sys.argv[1:] == ["write"]:
    lowered.write_to(folder)
lowered.FOLDER = folder
value = outer(1)
print(value, sum(outer.stats.cache_hits.values()), sum(outer.stats.cache_misses.values()))
"""


def test_lowered_code_is_compiled_only_where_it_fits_the_sources(tmp_path: Path) -> None:
    """A package brings lowered code: another machine, whose cache is empty, makes machine code of it, and keeps that.
    Where a source that it contains is another one, numba compiles."""
    (tmp_path / "outer.py").write_text(OUTER)
    (tmp_path / "inner.py").write_text(INNER.format(by=1))

    def call(cache: str, *words: str) -> list[int]:
        """Value; how often code was found, and how often compiled by numba."""
        done = subprocess.run(
            [sys.executable, "-c", LOWERED, *words], env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / cache)},
            cwd=tmp_path, capture_output=True, text=True, check=True, timeout=PATIENCE_S,
        )  # fmt: skip
        return [int(word) for word in done.stdout.split()]

    assert call("first", "write") == [2, 0, 1]
    assert call("second") == [2, 1, 0]
    (file,) = (tmp_path / "lowered").glob("*/outer.outer")
    lowered = file.read_bytes()
    file.unlink()
    assert call("second") == [2, 1, 0]  # its machine code is kept
    file.write_bytes(lowered)
    (tmp_path / "inner.py").write_text(INNER.format(by=100))
    assert call("third") == [101, 0, 1]


WARM = """
from isel_twin.base import compiling
from outer import outer
print(outer(1), sum(outer.stats.cache_misses.values()))
"""


def test_code_is_found_where_it_can_only_be_read(tmp_path: Path) -> None:
    """The kernels of an image: compiled by root, used by somebody who can write nowhere, as object code or, where
    variables tell numba how to compile, by numba."""
    (tmp_path / "outer.py").write_text(OUTER)
    (tmp_path / "inner.py").write_text(INNER.format(by=1))
    no_writing = "import tempfile; tempfile.TemporaryFile = lambda dir: (_ for _ in ()).throw(PermissionError(dir))\n"
    home = str(tmp_path / "home")

    def call(prefix: str, **variables: str) -> tuple[list[int], str]:
        """Value; how often numba compiled; what was said."""
        done = subprocess.run(
            [sys.executable, "-c", prefix + WARM], env={**os.environ, "NUMBA_CACHE_DIR": "", "HOME": home, **variables},
            cwd=tmp_path, capture_output=True, text=True, check=True, timeout=PATIENCE_S,
        )  # fmt: skip
        return [int(word) for word in done.stdout.split()], done.stderr

    image = {"NUMBA_CACHE_DIR": str(tmp_path / "image")}
    assert call("", **image) == ([2, 1], "")
    for variables in ({}, {"NUMBA_OPT": "3"}):
        assert call(no_writing, **image, **variables) == ([2, 0], "")
    (tmp_path / "inner.py").write_text(INNER.format(by=100))
    values, said = call(no_writing, **image)
    assert (values[0], "no folder to keep compiled code in" in said) == (101, True)


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for its pages")
def test_llvms_code_is_given_back_and_read_again() -> None:
    stamp = object_code._stamp(object_code.give_back, ())
    before_mb = code_mb("self", "libllvmlite")
    object_code.give_back()
    assert before_mb > 10.0
    assert code_mb("self", "libllvmlite") < before_mb / 10.0
    object_code._computer.cache_clear()
    assert object_code._stamp(object_code.give_back, ()) == stamp
    assert 0.0 < code_mb("self", "libllvmlite") < before_mb
