"""The samples of a recorder as a Parquet table, one row a sample, row groups of bounded size.

time_ns                                     int64, virtual time
count_x, count_y ..                         int64, the controller's counters, as many as it has axes
position_x_mm .. position_z_mm              float64, true carriage positions
lost_x_steps, lost_y_steps ..               float64
level_<terminal>, input_<name>, output_<name>    int64 or text, null before the first value

The metadata of each column have `unit` ("1": a count; none for text) and `description`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.files import replacing
from isel_twin.recordings.recorder import Change, Samples

# unit and description of columns, by the first word of their names
_COLUMNS = {
    "time": ("ns", "virtual time since power-on"),
    "count": ("steps", "counter of axis {} in the controller"),
    "position": ("mm", "true position of carriage {}, in zero and direction of the counter"),
    "lost": ("steps", "counter minus rotor of axis {}; fractions are load angle, meaningful at rest"),
    "level": ("1", "electrical level of terminal {}, 1: high"),
    "input": ("1", "state of the switch or element {}"),
    "output": ("1", "output or relay {}, 1: on"),
}
ROWS = 65_536  # rows of a row group


def write_parquet(path: str | os.PathLike[str], recorder: Samples) -> None:
    """Write all samples so far. Raises OSError."""
    history = {key: [c for c in recorder.changes if (c.group, c.name) == key] for key in recorder.names()}
    schema = _told(_table(np.empty(0, dtype=recorder.dtype), history).schema)
    with replacing(path) as temporary, pq.ParquetWriter(temporary, schema, compression="zstd") as writer:
        for piece in recorder.samples(ROWS):
            writer.write_table(_table(piece, history).cast(schema))


def _told(schema: pa.Schema) -> pa.Schema:
    """The schema with unit and description of each column."""
    fields = []
    for field in schema:
        kind, _, rest = field.name.partition("_")
        unit, text = _COLUMNS[kind]
        told = {"description": text.format(rest.replace("_mm", "").replace("_steps", ""))}
        if not pa.types.is_string(field.type):
            told["unit"] = unit
        fields.append(field.with_metadata(told))
    return pa.schema(fields, metadata={"creator": "isel-twin"})


def _table(piece: NDArray[np.void], history: dict[tuple[str, str], list[Change]]) -> pa.Table:
    columns: dict[str, pa.Array] = {"time_ns": pa.array(piece["time_ns"])}
    for pattern, field in (("count_{}", "counts"), ("position_{}_mm", "position_mm"), ("lost_{}_steps", "lost_steps")):
        for axis, column in zip(AXIS_NAMES, piece[field].T, strict=False):
            columns[pattern.format(axis)] = pa.array(np.ascontiguousarray(column))
    for (group, name), changes in history.items():
        columns[f"{group}_{name}"] = _held(piece["time_ns"], changes)
    return pa.table(columns)


def _held(time_ns: NDArray[np.int64], changes: Sequence[Change]) -> pa.Array:
    """The value at each time: that of the last change before or at it."""
    last = np.searchsorted(np.array([change.time_ns for change in changes]), time_ns, side="right") - 1
    text = any(isinstance(change.value, str) for change in changes)
    values: list[Any] = [str(change.value) if text else change.value for change in changes]
    known = pa.array(values, type=pa.string() if text else pa.int64())
    return known.take(pa.array(last, mask=last < 0))
