"""Where the carriages of a recorded machine are, in the coordinates of its model.

Samples are in zero and direction of the counters, so they jump when a counter is set. The machine does not: where it
stood at power-on is known, and from there on it moves as the samples do, without their jumps. Between the samples round
a jump it is taken to go on as fast as before and behind it, which is wrong by some hundredths of a millimetre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.core.twin import Twin
from isel_twin.plant.model import load_model
from isel_twin.recordings.reading import Recorded, RecordingError
from isel_twin.recordings.replay import captured_player, spec_of

if TYPE_CHECKING:
    import mujoco

    from isel_twin.machine import Machine


@dataclass(frozen=True, eq=False)
class Places:
    """A recorded machine, and where it is at each sample."""

    machine: Machine
    model: mujoco.MjModel
    position_mm: NDArray[np.float64]  # float64 [n, 3], as `Twin.machine_position_mm`


def places(recorded: Recorded) -> Places:
    """Raises RecordingError for a recording of a real controller, or of a twin that was switched on before it began;
    ValueError as `Twin` does."""
    with TemporaryDirectory(prefix="isel-twin-") as folder:
        spec = replace(spec_of(recorded, Path(folder)), plant="kinematic")
        twin = Twin.of(spec, 1, captured_player(recorded))
        model = load_model(twin.machine)
    sense = np.ones(len(CARRIAGES), dtype=np.int64)
    sense[: len(twin.direction)] = twin.direction[: len(CARRIAGES)]
    return Places(twin.machine, model, twin.machine_position_mm + sense * _moved_mm(recorded))


def _moved_mm(recorded: Recorded) -> NDArray[np.float64]:
    """float64 [n, 3], the way from the first sample on, in the directions of the counters."""
    times_ns, samples = recorded.sample_times_ns, recorded.samples
    position_mm = np.array(samples["position_mm"])
    if not len(position_mm):
        return position_mm
    velocity = samples["velocity_mm_s"].astype(np.float64)
    went_mm = np.diff(position_mm, axis=0, prepend=position_mm[:1])
    rolled_mm = (
        0.5 * (velocity + np.roll(velocity, 1, axis=0)) * (np.diff(times_ns, prepend=times_ns[0]) / SECOND_NS)[:, None]
    )
    beyond = np.abs(went_mm - rolled_mm)
    for entry in recorded.of("/counters"):
        axis = entry.content.get("axis")
        if not isinstance(axis, int) or not 0 <= axis < len(AXIS_NAMES):
            raise RecordingError(f"{recorded.path}: /counters at {entry.time_ns} ns says nothing")
        first, last = (int(np.searchsorted(times_ns, entry.time_ns, side=side)) for side in ("left", "right"))
        if axis < len(CARRIAGES) and first < len(times_ns):
            at = first + int(np.argmax(beyond[first : last + 1, axis]))  # the first sample in the new zero
            went_mm[at, axis] = rolled_mm[at, axis]
    return np.cumsum(went_mm, axis=0)
