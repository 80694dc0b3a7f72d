"""Digests of behaviour: everything a session said and did in sixteen characters, and the files that keep them.

    sha256( replies: time, bytes | t_ns of each tick | delta of each tick | counters | positions )[:16]

Arrays go in as little-endian int64, int32 and float64, so that a digest does not depend on the widths the code happens
to use.

A *coarse* digest leaves out how a full step of the iSMIF is split (ismif/4): ticks at most 1 ns apart are
one tick with the sum of their deltas, and all times are left out.

A file has one line a session, the digest in front, sorted by name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FOLDER = Path(__file__).parent
LENGTH = 16
REMEDY = "if the change is meant, run: make golden"


def digest(
    replies: Iterable[tuple[int, bytes]],
    steps: Any,
    counts: ArrayLike,
    positions: ArrayLike | None,
    coarse: bool = False,
) -> str:
    """Digest of one session.

    replies: (time in ns, bytes) in their order; steps: a stream with `t_ns` [n] and `delta` [n, 4]; counts [4];
    positions: float64 of any length, None if they are not to count.
    """
    sha = hashlib.sha256()
    t_ns = np.asarray(steps.t_ns).astype("<i8")
    delta = np.asarray(steps.delta).astype("<i4")
    if coarse:
        _put(sha, "replies", b"".join(data for _, data in replies))
        _put(sha, "delta", merged(t_ns, delta).astype("<i4").tobytes())
    else:
        _put(sha, "replies", "".join(f"{time} {data.hex()}\n" for time, data in replies).encode())
        _put(sha, "t_ns", t_ns.tobytes())
        _put(sha, "delta", delta.tobytes())
    _put(sha, "counts", np.asarray(counts).astype("<i8").tobytes())
    if positions is not None:
        exact = np.asarray(positions).astype("<f8")
        _put(sha, "positions", ((np.round(exact, 6) + 0.0) if coarse else exact).tobytes())
    return sha.hexdigest()[:LENGTH]


def _put(sha: Any, name: str, data: bytes) -> None:
    sha.update(f"{name} {len(data)}\n".encode() + data)


def merged(t_ns: NDArray[np.int64], delta: NDArray[np.int32]) -> NDArray[np.int32]:
    """int32 [m, 4]: deltas with those of ticks at most 1 ns after the one before added to it."""
    if not len(t_ns):
        return delta
    first = np.flatnonzero(np.diff(t_ns, prepend=t_ns[0] - 2) > 1)
    return np.add.reduceat(delta, first, axis=0, dtype=np.int32)


def switches_full_steps(data: bytes) -> bool:
    """Is there an `F1` in these bytes, sent to an iSMIF? Such a session gets a coarse digest."""
    return b"F1" in bytes(value for value in data if value > 32)


def load(path: Path) -> dict[str, str]:
    """Digest of each session of a file; none if there is no such file."""
    if not path.exists():
        return {}
    lines = (line.split(maxsplit=1) for line in path.read_text(encoding="utf-8").splitlines())
    return {name: value for value, name in lines}


def save(path: Path, digests: Mapping[str, str]) -> None:
    """Write a file anew."""
    path.write_text("".join(f"{digests[name]} {name}\n" for name in sorted(digests)), encoding="utf-8")
