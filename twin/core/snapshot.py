"""A twin at one instant, for recordings, tables and panels; positions in the zero and direction of the counters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A twin at one instant; arrays and mappings are copies."""

    time_ns: int
    counts: NDArray[np.int64]  # int64 [axes], the controller's step counters
    position_mm: NDArray[np.float64]  # float64 [3], true carriage positions X, Y, Z
    position_error_mm: NDArray[np.float64]  # float64 [3], true carriage positions minus those by the counters
    # float64 [axes], counter minus rotor position in steps; meaningful at rest, where fractions are load angle
    lost_steps: NDArray[np.float64]
    inputs: Mapping[str, str]
    outputs: Mapping[str, int]  # controller outputs and the relays they act on, as `Twin.outputs`
    levels: Mapping[str, bool]  # electrical level (True: high) of every wired input terminal of the controller


class Visible(Protocol):
    """The properties of a `Twin` that a snapshot needs."""

    @property
    def time_ns(self) -> int: ...
    @property
    def counts(self) -> NDArray[np.int64]: ...
    @property
    def position_mm(self) -> NDArray[np.float64]: ...
    @property
    def position_error_mm(self) -> NDArray[np.float64]: ...
    @property
    def lost_steps(self) -> NDArray[np.float64]: ...
    @property
    def inputs(self) -> Mapping[str, str]: ...
    @property
    def outputs(self) -> Mapping[str, int]: ...
    @property
    def levels(self) -> Mapping[str, bool]: ...


def snapshot(twin: Visible) -> Snapshot:
    """The twin as it is now."""
    return Snapshot(*(getattr(twin, field.name) for field in fields(Snapshot)))
