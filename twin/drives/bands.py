"""How far the torque of a motor may be from what is predicted for it.

    ln(torque / predicted) lies within -+ w(x), nine times of ten       w = WIDTH (1 + GROWTH x^2)
    x: speed over that at which the supply takes over (stability.rule_rpm)

WIDTH comes from motors on which the law of iron loss and supply was not fitted (tests/drives/test_left_out.py): the
root mean square of what it missed on them, times Student's t for as many motors as there are. A loss that the law does
not know grows with speed while the torque falls, so it takes a share of the torque that grows with the square of the
speed; beyond what was compared (LAST) the band opens downwards alone, as such a loss only takes. GROWTH lets it open as
far as curves of motors on high currents ask for, on which nothing was chosen (decision drives/17).

A motor much larger or smaller than those compared, by Km / sqrt(R), has the other reading of its sheet's current in
its band, 41 % (motor.py). In full step a maker's motors held no more from FULL_STEP_LIMIT on:
there the band begins at 0.
"""

from __future__ import annotations

import math

from isel_twin.drives import stability
from isel_twin.drives.motor import Motor
from isel_twin.drives.stage import Stage

WIDTH = 0.15
GROWTH = 0.8
LAST = 1.7  # largest x at which a maker's curve was compared (curve D)
SIZES = (0.084, 0.526)  # Km / sqrt(R) in N m / sqrt(W) of the smallest and the largest motor compared (curves C and A)
READING = math.log(math.sqrt(2.0))
FULL_STEP_LIMIT = 0.55  # full-step limits that a maker tells of two motors at 24 and 48 V, over stability.rule_rpm
STARTS = (0.8, 1.1)  # of the starting rate: a sheet says 0.8 of what the bench finds, which leaves out its margin


def torque_band(motor: Motor, stage: Stage, speed_rpm: float) -> tuple[float, float]:
    """The least and the most torque at a speed, over the predicted torque: (0.86, 1.16) for a slow motor."""
    share = speed_rpm / stability.rule_rpm(motor, stage)
    reading = READING * _other_size(motor)
    least = math.exp(-WIDTH * (1.0 + GROWTH * share**2) - reading)
    most = math.exp(WIDTH * (1.0 + GROWTH * min(share, LAST) ** 2) + reading)
    return (0.0 if stage.microsteps == 1 and share > FULL_STEP_LIMIT else least), most


def margin_band(margin: float, *torque: float) -> tuple[float, float]:
    """The least and the most of a pull-out margin, to 0.01 %. torque: that band of it."""
    least, most = (max(0.0, 1.0 - (1.0 - margin) / share) if share else float(margin == 1.0) for share in torque)
    return round(least, 4), round(most, 4)


def _other_size(motor: Motor) -> float:
    """0 for a size that was compared, 1 from half the smallest and twice the largest on."""
    size = motor.torque_constant_nm_per_a / math.sqrt(motor.resistance_ohm)
    beyond = max(SIZES[0] / size, size / SIZES[1], 1.0)
    return min(1.0, math.log2(beyond))
