"""One way to write a trace: the suffix says which."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.core.twin import Twin
from isel_twin.recordings.recorder import Recorder
from isel_twin.recordings.write import KINDS, trace_kind, write_trace

BEGINS = {".npz": b"PK", ".vcd": b"$comment isel-twin", ".parquet": b"PAR1", ".csv": b"time_ns,count_x"}


@pytest.fixture(scope="module")
def twin() -> Twin:
    return Twin(plant="kinematic")


@pytest.mark.parametrize("kind", BEGINS)
def test_the_suffix_or_the_kind_says_what_is_written(kind: str, tmp_path: Path, twin: Twin) -> None:
    named, told = tmp_path / f"out{kind}", tmp_path / "out"
    with Recorder(twin, 10_000_000) as recorder:
        write_trace(named, twin.steps, recorder)
        write_trace(told, twin.steps, recorder, kind)
    assert named.read_bytes().startswith(BEGINS[kind])
    assert told.read_bytes() == named.read_bytes()


def test_these_are_all_kinds() -> None:
    assert set(KINDS) == BEGINS.keys()


@pytest.mark.parametrize("name", ["out.txt", "out", "out.npz.gz", ".npz"])
def test_other_names_are_refused_in_one_line(name: str, tmp_path: Path, twin: Twin) -> None:
    path = tmp_path / name
    with pytest.raises(ValueError, match=r"the name must end in \.npz, \.vcd, \.parquet or \.csv") as caught:
        trace_kind(path)
    with pytest.raises(ValueError, match="must end in"):
        write_trace(path, twin.steps, None)
    assert str(caught.value).startswith(f"{path}: ")
    assert not path.exists()


def test_only_the_step_stream_needs_no_recorder(tmp_path: Path, twin: Twin) -> None:
    write_trace(tmp_path / "out.npz", twin.steps, None)
    for kind in (".vcd", ".parquet", ".csv"):
        with pytest.raises(ValueError, match="needs a recorder"):
            write_trace(tmp_path / f"out{kind}", twin.steps, None)
    assert [path.name for path in tmp_path.iterdir()] == ["out.npz"]
