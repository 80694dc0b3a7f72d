"""The records of path following: settings and state of an episode, of its axes, and where its arrays are. A step is
made in C (tracking.c), with drives and machine in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.native import address, record
from isel_twin.plant.memory import AXES, MEMORY

PREVIEW_MM = (0.5, 1.0, 2.0, 4.0, 8.0)  # distances of the observed points ahead on the path
SIZE = 6 * AXES + AXES * len(PREVIEW_MM) + 2  # numbers in an observation
DONE, OUTSIDE, STEPS_LOST = 1, 2, 4  # what a step returns: bits, 0 if the episode goes on
IDLE = -2  # instead of that: this environment makes no step
IN_C = ("DONE", "OUTSIDE", "STEPS_LOST", "IDLE", "PREVIEW_MM", "SIZE")  # records.h has them, too

REWARDS = ("reward_progress", "reward_time", "reward_deviation", "reward_abort")
TRACK = record(
    "TRACK",  # settings and state of an episode
    [
        ("step_ns", "i8"),
        ("tolerance_mm", "f8"),
        ("reach_mm", "f8"),  # reach of the tool in a step
        ("time_limit_s", "f8"),
        ("time_weight", "f8"),  # of the reward, a second
        ("deviation_weight", "f8"),  # a second
        ("abort_penalty", "f8"),
        ("until_ns", "i8"),  # time of the plant
        ("began_ns", "i8"),
        ("piece", "i8"),  # piece of the path nearest to the tool
        ("way_mm", "f8"),  # s
        ("tool_mm", "f8", (AXES,)),  # from the start of the path
        ("rest_ns", "i8"),  # time for which the machine has stood at the end
        ("led_mm", "f8"),  # of the point that `aim` leads along the path
        ("deviation_mm", "f8"),
        ("edge", "f8"),  # least factor on the speed of any motor in the last step until it swings; inf at rest
        *((name, "f8") for name in REWARDS),
    ],
)

LANE = record(
    "LANE",  # settings and state of an axis
    [
        ("highest_hz", "f8"),
        ("steps_per_mm", "f8"),
        ("half_slip", "f8"),  # steps between counter and rotor that mean lost steps (envs/3)
        ("limit_rad_s", "f8"),  # speed from which on the motor swings (drives/stability.py)
        ("origin_mm", "f8"),  # tool at the start of the path, in machine coordinates
        ("counter", "i8"),  # steps from there
        ("fraction", "f8"),  # u - counter
        ("rate_hz", "f8"),  # f
    ],
)

_ARRAYS = {
    "memory": ("MEMORY", MEMORY),
    "track": ("TRACK", TRACK),
    "lanes": ("LANE", LANE),
    "shape_mm": ("double", np.float64),  # [3, joints], motion of the tool by the joints
    "path": ("double", np.float64),  # [points, 4]: X, Y, Z and the way to there
    "t_ns": ("int64_t", np.int64),  # [pulses], and
    "delta": ("int32_t", np.int32),  # [pulses, 3]: for the pulses of a step
}
# addresses of an environment's arrays, and their lengths
PLACE = record(
    "PLACE",
    [(name, "i8") for name in (*_ARRAYS, "joints", "points", "pulses")],
    {name: kind for name, (kind, _) in _ARRAYS.items()},
)


def place_of(arrays: Sequence[NDArray[Any]]) -> NDArray[np.void]:
    """PLACE [1] of these arrays, in its order: keep them as long as it. Raises TypeError for one that C cannot take."""
    for (name, (_, dtype)), array in zip(_ARRAYS.items(), arrays, strict=True):
        if array.dtype != dtype or not array.flags.c_contiguous:
            raise TypeError(f"{name}: got {array.dtype}, {array.flags}")
    _, _, _, shape_mm, path, t_ns, _ = arrays
    return np.array([(*map(address, arrays), shape_mm.shape[1], len(path), len(t_ns))], PLACE)
