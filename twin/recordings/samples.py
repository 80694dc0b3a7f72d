"""Samples as small messages of plain numbers: CDR, the encoding of ROS 2.

A message is four bytes of header (little endian) and the fields one after the other:

    int64[axes]    counts               the controller's counters, in steps
    float64[3]     position_mm          true carriage positions, in the zero and direction of the counters
    float64[3]     position_error_mm    true position minus counter
    float64[axes]  lost_steps           counter minus rotor; fractions are load angle
    float32[3]     velocity_mm_s        true carriage velocities
    float32[axes]  margin               least pull-out margin since `watch_margin`; nan without physics
    float32[m]     current              phase current over nominal of each motor; none without physics
    float32[3]     force_n              of each nut upon its carriage; none without physics, or in old recordings
    float32        supply_v             nan if there is none

All lengths are fixed, so the message has no length fields; the 64-bit fields come first, so that no padding is needed.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from isel_twin.base.axes import CARRIAGES

HEADER: Final = b"\0\1\0\0"  # CDR, little endian
_ROS: Final = {"i8": "int64", "f8": "float64", "f4": "float32"}


def sample_dtype(axes: int, motors: int, forces: bool) -> np.dtype[np.void]:
    """The type of a sample of a twin with that many axes and motors. forces: with those of the nuts."""
    carriages = len(CARRIAGES)
    fields: list[Any] = [
        ("counts", "<i8", (axes,)),
        ("position_mm", "<f8", (carriages,)),
        ("position_error_mm", "<f8", (carriages,)),
        ("lost_steps", "<f8", (axes,)),
        ("velocity_mm_s", "<f4", (carriages,)),
        ("margin", "<f4", (axes,)),
        *([("current", "<f4", (motors,))] if motors else []),
        *([("force_n", "<f4", (carriages,))] if forces else []),
        ("supply_v", "<f4"),
    ]
    return np.dtype(fields)


def samples_schema(dtype: np.dtype[np.void]) -> str:
    """The fields as a ROS 2 message definition."""
    lines = []
    for name, (field, *_) in (dtype.fields or {}).items():
        length = f"[{field.shape[0]}]" if field.shape else ""
        lines.append(f"{_ROS[field.base.str[1:]]}{length} {name}")
    return "\n".join(lines)
