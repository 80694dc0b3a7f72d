"""The teeth of a cutter in one sub-step, compiled; the equations are in cutting.py.

A tooth that enters or leaves within the sub-step has its force for the part in which it cuts, at the middle of that
part: so the mean over a turn is the integral, however coarsely sub-steps divide it.
"""

import math

from isel_twin.base.compiling import njit
from isel_twin.drives.trigonometry import sine_and_cosine

LEAST_M_S = 1e-6  # feed below which a tooth rubs and takes no chip


@njit(inner=True, nogil=True, error_model="numpy")
def bite(cut, now, x_m_s, y_m_s):
    """Forces x_n, y_n of sub-step `now`, with the screws moving tool over table by x_m_s, y_m_s."""
    cut.x_m_s += cut.gain * (x_m_s - cut.x_m_s)
    cut.y_m_s += cut.gain * (y_m_s - cut.y_m_s)
    speed = math.hypot(cut.x_m_s, cut.y_m_s)
    cut.x_n = 0.0
    cut.y_n = 0.0
    if speed < LEAST_M_S:
        return
    along = 0.0
    leftwards = 0.0
    turns = cut.turns * (now - cut.start + 0.5)
    half_rad = math.pi * cut.turns
    for tooth in range(cut.flutes):
        place = turns + tooth / cut.flutes
        phi = 2.0 * math.pi * (place - math.floor(place))
        if phi + half_rad > 2.0 * math.pi + cut.enter_rad:
            phi -= 2.0 * math.pi
        low, high = max(phi - half_rad, cut.enter_rad), min(phi + half_rad, cut.leave_rad)
        if low < high:
            share, middle = 0.5 * (high - low) / half_rad, 0.5 * (low + high)
            sine, cosine = sine_and_cosine(middle)
            tangential_n = cut.n_per_m * min(speed, cut.most_m_s) * cut.tooth_s * sine
            if cut.m != 0.0 and tangential_n > 0.0:
                tangential_n *= (1e3 * min(speed, cut.most_m_s) * cut.tooth_s * sine) ** -cut.m
            along -= share * tangential_n * (cosine + cut.radial * sine)
            leftwards += share * tangential_n * (sine - cut.radial * cosine)
            along -= share * (cut.edge_n * cosine + cut.edge_radial_n * sine)
            leftwards += share * (cut.edge_n * sine - cut.edge_radial_n * cosine)
    along /= speed
    leftwards *= cut.left / speed
    cut.x_n = along * cut.x_m_s - leftwards * cut.y_m_s
    cut.y_n = along * cut.y_m_s + leftwards * cut.x_m_s
    cut.sum_x_n += cut.x_n
    cut.sum_y_n += cut.y_n


@njit(inner=True, nogil=True, error_model="numpy")
def bend(cut):
    """Where the tip of the tool is after a sub-step with the forces that `bite` found."""
    cut.bend_m[0] += cut.gain * (cut.tool_m_per_n * cut.x_n - cut.bend_m[0])
    cut.bend_m[1] += cut.gain * (cut.tool_m_per_n * cut.y_n - cut.bend_m[1])
