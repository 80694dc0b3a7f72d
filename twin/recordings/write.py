"""One way to write a trace: the suffix of the file says which.

    .npz        the step stream, exactly                    npz.py
    .vcd        a value change dump for waveform viewers    vcd.py
    .parquet    the samples of a recorder as a table        parquet.py, with pyarrow (the extra `trace`)
    .csv        the same as text                            csv.py

Each kind is imported only when it is written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.motion import Steps
    from isel_twin.recordings.recorder import Samples


def trace_kind(path: Path) -> str:
    """The kind of trace that a file name ends in, one of KINDS. Raises ValueError, also if it needs an extra."""
    if path.suffix not in KINDS:
        *others, last = KINDS
        raise ValueError(f"{path}: the name must end in {', '.join(others)} or {last}")
    check_kind(path.suffix, f"{path}:")
    return path.suffix


def check_kind(kind: str, about: str) -> None:
    """Raise ValueError, of one line that begins with `about`, if traces of a kind need what is not installed."""
    if kind == ".parquet" and find_spec("pyarrow") is None:
        raise ValueError(f"{about} needs pyarrow: pip install 'isel-twin[trace]'")


def write_trace(path: Path, twin: Twin, recorder: Samples | None, kind: str | None = None) -> None:
    """Write what has happened to the twin so far. See `write_steps_and_samples`."""
    write_steps_and_samples(path, twin.steps, recorder, kind)


def write_steps_and_samples(path: Path, steps: Steps, recorder: Samples | None, kind: str | None = None) -> None:
    """Write a stream and samples, as they have been taken or read back from a recording.

    kind: one of KINDS; without it, the one that the file name ends in.
    recorder: has watched the twin; an .npz can do without. Raises ValueError for a name that says nothing and for a
    recorder that is missing, OSError about `path` if the file cannot be written.
    """
    kind = kind or trace_kind(path)
    check_kind(kind, f"{path}:")
    write = KINDS[kind]
    try:
        write(path, steps, recorder)
    except OSError as error:  # which may name a temporary file, or none
        raise OSError(error.errno, os.strerror(error.errno) if error.errno else str(error), str(path)) from error


def _write_npz(path: Path, steps: Steps, recorder: Samples | None) -> None:
    from isel_twin.recordings.npz import write_npz

    write_npz(path, steps)


def _write_vcd(path: Path, steps: Steps, recorder: Samples | None) -> None:
    from isel_twin.recordings.vcd import write_vcd

    write_vcd(path, steps, _needed(recorder, path))


def _write_parquet(path: Path, steps: Steps, recorder: Samples | None) -> None:
    from isel_twin.recordings.parquet import write_parquet

    write_parquet(path, _needed(recorder, path))


def _write_csv(path: Path, steps: Steps, recorder: Samples | None) -> None:
    from isel_twin.recordings.csv import write_csv

    write_csv(path, _needed(recorder, path))


def _needed(recorder: Samples | None, path: Path) -> Samples:
    if recorder is None:
        raise ValueError(f"{path}: this kind of trace needs a recorder that has watched the twin")
    return recorder


KINDS: Mapping[str, Callable[[Path, Steps, Samples | None], None]] = {
    ".npz": _write_npz,
    ".vcd": _write_vcd,
    ".parquet": _write_parquet,
    ".csv": _write_csv,
}
"""Kinds of traces by the suffix of their files, and who writes them."""
