"""A recording as a file of another kind: what `--record OUT.vcd` and `isel-twin export` write.

session.mcap  --- read ---> stream, samples, changes --- write.py ---> .npz  .vcd  .parquet  .csv
"""

from __future__ import annotations

import os
from pathlib import Path

from isel_twin.recordings.reading import Played, RecordingError, read
from isel_twin.recordings.write import trace_kind, write_steps_and_samples


def export(recording: str | os.PathLike[str], out: str | os.PathLike[str], kind: str | None = None) -> bool:
    """Write a recording as a file of a kind of `write.KINDS`; without `kind`, the one that its name ends in.

    Returns False if the recording was cut off. Raises RecordingError for one of a real controller, which has nothing
    but bytes, and as `read` does; ValueError for an unknown kind; OSError.
    """
    out = Path(out)
    kind = kind or trace_kind(out)
    recorded = read(recording)
    if not recorded.of_twin:
        raise RecordingError(f"{recording}: has bytes of a line and nothing else; `isel-twin decode` explains them")
    write_steps_and_samples(out, recorded.steps(), None if kind == ".npz" else Played(recorded), kind)
    return recorded.whole
