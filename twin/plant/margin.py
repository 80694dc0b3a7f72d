"""How far a motor was from losing step: its pull-out margin, computed after every window of the loop (margin.h).

One number for each axis, 1 without load and 0 where the motor loses step, that shows how reliably a job works. Two
limits can be reached; the margin is the smaller of what is left:

    torque       1 - |T| / T_max(w)   T: torque of the currents, mean over the window; T_max: the closed form of the
                                      pull-out torque at this speed by current and voltage, before iron loss
    load angle   1 - |lag| / 2        lag: command minus rotor in full steps, to the nearest place where the motor would
                                      hold as well (they are four full steps apart); at two the motor no longer holds

If a common supply has the voltage U in place of U0, T_max is taken at w U0 / U, as back-EMF and inductive voltage grow
with the speed. Neglecting the resistance costs 2 % at 0.8 U0.

A steady load reaches the torque limit first (at a lag of one full step); an overshoot may go beyond, with less torque,
as long as the angle stays below two. A motor that slips passes two: its margin is 0.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.curves import iron_torques, pull_out_predictions
from isel_twin.drives.motor import Motor
from isel_twin.drives.stage import Stage

SPEED_STEP_RAD_S = 2.0  # distance of the speeds in a table of available torque
SPEEDS = 256  # entries: up to 510 rad/s, where no motor here has torque; the last one holds for all beyond
IN_C = ("SPEED_STEP_RAD_S", "SPEEDS")  # records.h has them, too


@lru_cache(1024)  # three axes of some hundred machines, as searches have them
def available_torque(motor: Motor, stage: Stage) -> NDArray[np.float64]:
    """float64 [SPEEDS], largest mean torque of the currents in N m at 0, SPEED_STEP_RAD_S, ... of the shaft; read-only.
    The first is the torque of a current vector at rest, without losses of single steps."""
    omega: NDArray[np.float64] = SPEED_STEP_RAD_S * np.arange(SPEEDS, dtype=np.float64)
    net = pull_out_predictions(motor, stage, omega * 60.0 / (2.0 * math.pi))
    return np.where(net > 0.0, net + iron_torques(motor, omega), 0.0)
