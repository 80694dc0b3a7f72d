"""Writes a trace of a twin or of a recording; the suffix of the file gives the kind.

.npz        the step stream, exactly                    npz.py
.vcd        a value change dump for waveform viewers    vcd.py
.parquet    the samples of a recorder as a table        parquet.py, with pyarrow (the extra `trace`)
.csv        the same as text                            csv.py

A recording may be written as one for viewers, too:

.mcap       scene, frames, numbers by axis, log         viewer.py
"""

from __future__ import annotations

import os
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from isel_twin.base.files import kind_of

if TYPE_CHECKING:
    from isel_twin.motion import Steps
    from isel_twin.recordings.recorder import Samples

KINDS = (".npz", ".vcd", ".parquet", ".csv")
VIEWER = ".mcap"  # a recording for viewers


def trace_kind(path: Path) -> str:
    """The kind of trace by a file name, one of KINDS. Raises ValueError, also if an optional package is missing."""
    kind = kind_of(path, KINDS)
    _check_package(path, kind)
    return kind


def _check_package(path: Path, kind: str) -> None:
    """Raise ValueError if a kind of trace needs a missing package."""
    if kind == ".parquet" and find_spec("pyarrow") is None:
        raise ValueError(f"{path}: needs pyarrow: pip install 'isel-twin[trace]'")


def write_trace(path: Path, steps: Steps, recorder: Samples | None, kind: str | None = None) -> None:
    """Write a stream and samples. kind: one of KINDS, by default from the file name.

    Raises ValueError for an unknown ending or a missing recorder (only .npz needs none), OSError about `path` if the
    file cannot be written.
    """
    kind = kind or trace_kind(path)
    _check_package(path, kind)
    if recorder is None and kind != ".npz":
        raise ValueError(f"{path}: this kind of trace needs a recorder that has watched the twin")
    writers = import_module(f"isel_twin.recordings.{kind[1:]}")
    try:
        if kind == ".npz":
            writers.write_npz(path, steps)
        elif kind == ".vcd":
            writers.write_vcd(path, steps, recorder)
        elif kind == ".parquet":
            writers.write_parquet(path, recorder)
        else:
            writers.write_csv(path, recorder)
    except OSError as error:  # its file name may be a temporary one, or missing
        raise OSError(error.errno, os.strerror(error.errno) if error.errno else str(error), str(path)) from error


def export(recording: str | os.PathLike[str], out: str | os.PathLike[str], kind: str | None = None) -> bool:
    """Write a recording as `write_trace` does; return False if it is incomplete. Raises RecordingError for one of a
    real controller, which has only bytes, and as `read` does.
    """
    from isel_twin.recordings.reading import Played, RecordingError, read

    out = Path(out)
    kind = kind or kind_of(out, (VIEWER, *KINDS))
    recorded = read(recording)
    if not recorded.of_twin:
        raise RecordingError(f"{recording}: has bytes of a line and nothing else; `isel-twin decode` explains them")
    if kind == VIEWER:
        from isel_twin.recordings.viewer import write_viewer

        write_viewer(out, recorded)
        return recorded.whole
    write_trace(out, recorded.steps(), None if kind == ".npz" else Played(recorded), kind)
    return recorded.whole
