"""The samples of a recorder as a table of text, one row a sample; the columns are those of parquet.py.

    time_ns,count_x,count_y,...,position_x_mm,...,lost_x_steps,...,level_p1.0,...,input_hood,...,output_stages,...

Numbers are written so that they read back to the bit; a cell without a value yet is empty. Lines end with a line feed.
"""

from __future__ import annotations

import csv
import os
from io import TextIOWrapper

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.files import replacing
from isel_twin.recordings.recorder import Samples


def write_csv(path: str | os.PathLike[str], recorder: Samples) -> None:
    """Write all samples so far. Raises OSError."""
    axes = AXIS_NAMES[: recorder.axes]
    names = recorder.names()
    held: dict[tuple[str, str], int | str] = {}
    changes = iter(recorder.changes)
    change = next(changes, None)
    with replacing(path) as raw, TextIOWrapper(raw, encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            ["time_ns"]
            + [f"count_{axis}" for axis in axes]
            + [f"position_{axis}_mm" for axis in CARRIAGES]
            + [f"lost_{axis}_steps" for axis in axes]
            + [f"{group}_{name}" for group, name in names]
        )
        for piece in recorder.samples():
            columns = (piece[name].tolist() for name in ("time_ns", "counts", "position_mm", "lost_steps"))
            for time_ns, counts, position_mm, lost_steps in zip(*columns, strict=True):
                while change is not None and change.time_ns <= time_ns:
                    held[change.group, change.name] = change.value
                    change = next(changes, None)
                states = [held.get(key, "") for key in names]
                table.writerow([time_ns, *counts, *position_mm, *lost_steps, *states])
