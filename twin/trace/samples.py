"""Samples as messages of plain numbers, which cost little room and less time: CDR, the encoding of ROS 2.

A message is four bytes of header (little endian) and the fields one after the other, eight bytes each:

    int64[axes]    counts               the controller's counters, in steps
    float64[3]     position_mm          true carriage positions, in the zero and direction of the counters
    float64[3]     position_error_mm    true position minus counter
    float64[3]     velocity_mm_s        true carriage velocities
    float64[axes]  lost_steps           counter minus rotor; fractions are load angle
    float64[axes]  margin               least pull-out margin since `watch_margin`; nan without physics
    float64[m]     current              phase current over nominal of each motor; none without physics
    float64        supply_v             nan if there is none

All lengths are fixed, so no field has a length of its own in the message, and nothing needs to be aligned.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from isel_twin.axes import CARRIAGES

__all__ = ["HEADER", "as_message", "sample_dtype", "sample_from", "samples_schema"]

HEADER: Final = b"\0\1\0\0"
"""CDR, little endian."""

_ROS: Final = {"i": "int64", "f": "float64"}


def sample_dtype(axes: int, motors: int) -> np.dtype[np.void]:
    """The fields of a sample of a twin with that many axes and motors."""
    carriages = len(CARRIAGES)
    fields: list[Any] = [
        ("counts", "<i8", (axes,)),
        ("position_mm", "<f8", (carriages,)),
        ("position_error_mm", "<f8", (carriages,)),
        ("velocity_mm_s", "<f8", (carriages,)),
        ("lost_steps", "<f8", (axes,)),
        ("margin", "<f8", (axes,)),
        *([("current", "<f8", (motors,))] if motors else []),
        ("supply_v", "<f8"),
    ]
    return np.dtype(fields)


def samples_schema(dtype: np.dtype[np.void]) -> str:
    """The fields in ROS's words."""
    lines = []
    for name, (field, *_) in (dtype.fields or {}).items():
        length = f"[{field.shape[0]}]" if field.shape else ""
        lines.append(f"{_ROS[field.base.kind]}{length} {name}")
    return "\n".join(lines)


def as_message(row: NDArray[np.void]) -> bytes:
    """A sample, shape (), as a message."""
    return HEADER + row.tobytes()


def sample_from(data: bytes, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """The sample of a message, shape (). Raises ValueError for one that is none."""
    if data[:4] != HEADER or len(data) != 4 + dtype.itemsize:
        raise ValueError(f"a sample of {len(data)} bytes instead of {4 + dtype.itemsize}")
    return np.frombuffer(data, dtype=dtype, offset=4)[0]
