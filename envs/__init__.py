"""Environments: tuning of ramps, start-stop frequency and speed, by learning, by search or by hand.

    moves.py        one move on a twin, and its measurements; watching.py: position errors meanwhile
    tuning.py       `isel_twin/JobTuning-v0`: one step is one move
    vector.py       many environments side by side, in threads and processes
    track.py        `isel_twin/TrackPath-v0`: one step is some milliseconds of step frequencies (paths.py, tracking.c)
    track_vector.py many of them in one compiled call
    wrappers.py     bounds and scales, other machines (variations.py), feed along the path
    sweep.py        tables of whole jobs on any `concurrent.futures.Executor`; the fastest setting with a margin

    import gymnasium
    env = gymnasium.make("isel_twin.envs:isel_twin/JobTuning-v0")

See docs/tuning.md and docs/learning.md.
"""

from __future__ import annotations

if __name__ != "isel_twin.envs":
    raise ImportError(f"import isel_twin.envs, not {__name__}: the folder envs/ of the repository is that package")

import gymnasium

from isel_twin.envs.moves import JOB, Settings, Setup
from isel_twin.envs.sweep import Fastest, Row, fastest, grid, run_job, sweep

__all__ = ["JOB", "Fastest", "Row", "Settings", "Setup", "fastest", "grid", "run_job", "sweep"]

# Gymnasium finds them by the module in front of the id (envs/10).
gymnasium.register(
    id="isel_twin/JobTuning-v0",
    entry_point="isel_twin.envs.tuning:JobTuning",
    vector_entry_point="isel_twin.envs.vector:tuning_vector",
)
gymnasium.register(
    id="isel_twin/TrackPath-v0",
    entry_point="isel_twin.envs.track:TrackPath",
    vector_entry_point="isel_twin.envs.track_vector:TrackVector",
)
