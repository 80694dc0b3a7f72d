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
ROWS = 32_768  # rows of a row group


def write_parquet(path: str | os.PathLike[str], recorder: Samples) -> None:
    """Write all samples so far. Raises OSError."""
    history = {key: [c for c in recorder.changes if (c.group, c.name) == key] for key in recorder.names()}
    empty = _columns(np.empty(0, dtype=recorder.dtype), history)
    schema = _told(pa.schema([(name, column.type) for name, column in empty.items()]))
    with replacing(path) as file, pq.ParquetWriter(file, schema, compression="zstd") as writer:
        for piece in recorder.samples(ROWS):
            writer.write_table(pa.Table.from_arrays(list(_columns(piece, history).values()), schema=schema))


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


def _columns(piece: NDArray[np.void], history: dict[tuple[str, str], list[Change]]) -> dict[str, pa.Array]:
    columns = {"time_ns": _numbers(piece["time_ns"])}
    for pattern, field in (("count_{}", "counts"), ("position_{}_mm", "position_mm"), ("lost_{}_steps", "lost_steps")):
        for axis, column in zip(AXIS_NAMES, piece[field].T, strict=False):
            columns[pattern.format(axis)] = _numbers(column)
    for (group, name), changes in history.items():
        columns[f"{group}_{name}"] = _held(piece["time_ns"], changes)
    return columns


def _numbers(column: NDArray[Any], nulls: int = 0) -> pa.Array:
    """A column with so many nulls first. From its buffers: `pa.array` would import pandas where that is installed."""
    data = [_known(len(column), nulls), pa.py_buffer(np.ascontiguousarray(column))]
    return pa.Array.from_buffers(pa.from_numpy_dtype(column.dtype), len(column), data, nulls)


def _known(rows: int, nulls: int) -> pa.Buffer | None:
    """The bits that say which rows are not null."""
    return pa.py_buffer(np.packbits(np.arange(rows) >= nulls, bitorder="little")) if nulls else None


def _held(time_ns: NDArray[np.int64], changes: Sequence[Change]) -> pa.Array:
    """The value at each time: that of the last change before or at it."""
    begin = np.searchsorted(time_ns, [change.time_ns for change in changes], side="left")
    rows = np.diff(begin, append=len(time_ns))
    nulls = int(begin[0]) if len(begin) else len(time_ns)
    if not any(isinstance(change.value, str) for change in changes):
        values = np.array([0, *(change.value for change in changes)], dtype=np.int64)
        return _numbers(np.repeat(values, [nulls, *rows]), nulls)
    texts = [b"", *(str(change.value).encode() for change in changes)]
    lengths = np.repeat([len(text) for text in texts], [nulls, *rows])
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    data = b"".join([text * count for text, count in zip(texts, [nulls, *rows.tolist()], strict=True)])
    buffers = [_known(len(time_ns), nulls), pa.py_buffer(offsets), pa.py_buffer(data)]
    return pa.Array.from_buffers(pa.string(), len(time_ns), buffers, nulls)
