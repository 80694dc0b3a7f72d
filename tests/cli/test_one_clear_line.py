"""Calls that cannot be carried out end with one line that names what is wrong, and exit code 2."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from isel_twin.base import crew
from isel_twin.base.errors import CallError
from tests.full_disk import full_disk
from tests.in_process import isel_twin

FULL = "File too large"


def process(*words: object) -> tuple[int, str]:
    """A call in a process of its own, whose standard input is closed."""
    line = 'exec "$@" <&-'
    told = subprocess.run(
        ["sh", "-c", line, "sh", sys.executable, "-m", "isel_twin", *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
    )
    return told.returncode, told.stderr


@pytest.mark.long(seconds=4)
@pytest.mark.parametrize("words", [("run", "-"), ("decode", "-"), ("plc", "explain", "-")], ids=lambda words: words[0])
def test_a_closed_standard_input_is_named(words: tuple[str, ...]) -> None:
    assert process(*words) == (2, "isel-twin: standard input: is closed; name a file, or give it a pipe\n")


@pytest.mark.long(seconds=4)
def test_serve_names_a_link_without_a_folder(tmp_path: Path) -> None:
    link = tmp_path / "nowhere" / "imc"
    told = isel_twin("serve", "--pty", link, "--plant", "kinematic")
    assert (told.returncode, told.stderr) == (2, f"isel-twin: {link}: there is no such folder; make it first\n")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    (folder / "job.txt").write_text("@07\n@0R7\n")
    made = folder / "session.mcap"
    assert isel_twin("run", folder / "job.txt", "--plant", "kinematic", "--record", made).returncode == 0
    return made


@pytest.mark.long(seconds=4)
@pytest.mark.parametrize("kind", ["npz", "vcd", "parquet", "csv", "mcap"])
def test_export_names_the_file_that_a_full_disk_did_not_take(recording: Path, tmp_path: Path, kind: str) -> None:
    out = tmp_path / f"out.{kind}"
    out.symlink_to("/dev/full")
    told = isel_twin("export", recording, out)
    assert (told.returncode, told.stderr) == (2, f"isel-twin: {out}: No space left on device\n")


def test_init_on_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    with full_disk(600):  # room for its first files
        told = isel_twin("init", tmp_path / "a" / "project")
    assert told.returncode == 2
    assert told.stderr.startswith(f"isel-twin: {tmp_path / 'a' / 'project'}/")
    assert told.stderr.endswith(f": {FULL}\n")
    assert list(tmp_path.iterdir()) == []


def test_processes_without_shared_memory_say_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(*_: object) -> None:
        raise FileNotFoundError(2, "No such file or directory")  # sem_open(3) without /dev/shm

    monkeypatch.setattr("multiprocessing.synchronize._multiprocessing.SemLock", absent)
    wanted = r"need shared memory, and /dev/shm cannot be used \(.*\); mount it, or take one: --workers 1"
    with pytest.raises(CallError, match=wanted):
        list(crew.in_order(abs, [1, 2], crew.local(2)))


@pytest.mark.parametrize("option", ["robust", "uncertain"])
def test_run_bounds_its_repetitions(tmp_path: Path, option: str) -> None:
    (tmp_path / "job.txt").write_text("@07\n")
    told = isel_twin("run", tmp_path / "job.txt", f"--{option}", "1000000000")
    expected = f"isel-twin: --{option} 1000000000: must be up to 10000 repetitions\n"
    assert (told.returncode, told.stderr) == (2, expected)
