"""The stream as numpy's npz: `t_ns` int64 [n], `delta` int8 [n, axes], or int32 if any of it are set points.

    with np.load("out.npz") as stream:
        assert stream["delta"].sum(axis=0) ...

The file is as from numpy.savez, but only a piece of the stream is in memory at a time.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.files import replacing

if TYPE_CHECKING:
    from isel_twin.motion import Steps

CHUNK = 1 << 18  # ticks expanded at a time


def write_npz(path: str | os.PathLike[str], steps: Steps) -> None:
    """Write a stream. Raises OSError."""
    with replacing(path) as file, zipfile.ZipFile(file, "w") as archive:
        _write_array(archive, "t_ns", "<i8", (len(steps),), (t_ns for t_ns, _ in steps.chunks(CHUNK)))
        shape = len(steps), steps.axes
        _write_array(archive, "delta", steps.dtype.str, shape, (delta for _, delta in steps.chunks(CHUNK)))


def _write_array(
    archive: zipfile.ZipFile, name: str, dtype: str, shape: tuple[int, ...], pieces: Iterator[NDArray[Any]]
) -> None:
    with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
        header = {"descr": dtype, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_2_0(file, header)
        for piece in pieces:
            file.write(np.ascontiguousarray(piece, dtype=np.dtype(dtype)).data)
