"""One step of path following in one compiled call: pulses for each axis, drives and machine, observation. So an
environment costs little more than its physics. A step of h:

    frequencies f_i  --- pulses at u_i = k + 1/2 --->  the kernel's advance  --->  tool p, rotors, margins
                         u_i' = u_i + f_i h                                          |
                                                                                     v
    path P(s)  . . . . . nearest point P(s) within a window about the last one,  deviation |p - P(s)|, progress

u_i is the phase of an axis in steps, its counter the nearest whole number: so pulses are evenly spaced within a step
and across steps at any change of frequency, and the counter is never off by more than half a step. The nearest point is
searched only near the last one, as a path may cross itself (envs/8). A point of the path that is passed over counts for
the deviation, and progress is never more than the tool's own way (envs/12).
"""

from __future__ import annotations

import math

import numpy as np

from isel_twin.base.compiling import contains, njit
from isel_twin.core import seen
from isel_twin.core.seen import SLOW_RAD_S
from isel_twin.native import record
from isel_twin.plant import kernel
from isel_twin.plant.kernel import advance
from isel_twin.plant.memory import AXES, parts_of

PREVIEW_MM = (0.5, 1.0, 2.0, 4.0, 8.0)  # distances of the observed points ahead on the path
SIZE = 6 * AXES + AXES * len(PREVIEW_MM) + 2  # numbers in an observation
DONE, OUTSIDE, LOST = 1, 2, 4  # what `take_step` returns: bits, 0 if the episode goes on
STOPS_HZ = 300.0  # step frequency from which every axis can stop at once: the limit at the end of the path
REST_NS = 20_000_000  # rest at the end: two swings of a rotor, one of a portal (envs/11)
LOOK_NS = 2_000_000  # the tool is compared with the path at least this often
BACK_MM = 1.0  # the search for the nearest point goes this far back, and this far beyond the reach of a step

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
        ("x_mm", "f8"),  # tool from the start of the path
        ("y_mm", "f8"),
        ("z_mm", "f8"),
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


@njit(nogil=True, error_model="numpy")
def _within(value):
    """The value, clipped to -1 .. 1; -1 if it is nan."""
    return 1.0 if value > 1.0 else value if value > -1.0 else -1.0


@njit(nogil=True, error_model="numpy")
def _next_s(lane, k):
    """Time of pulse k (0, 1, ...) of a step, from its start."""
    if lane.rate_hz == 0.0:
        return math.inf
    sign = math.copysign(1.0, lane.rate_hz)
    return (k + 0.5 - sign * lane.fraction) / abs(lane.rate_hz)


@njit(nogil=True, error_model="numpy")
def lay_pulses(lanes, start_ns, step_ns, t_ns, delta):
    """Write the pulses of a step, in time order, into t_ns [n] and delta int32 [n, 3]; return their number."""
    step_s = 1e-9 * step_ns
    made_0, made_1, made_2, n = 0, 0, 0, 0
    next_0, next_1, next_2 = _next_s(lanes[0], 0), _next_s(lanes[1], 0), _next_s(lanes[2], 0)
    while n < t_ns.shape[0]:
        first_s = min(next_0, next_1, next_2)
        if not first_s <= step_s:
            break
        t_ns[n] = start_ns + min(max(round(first_s * 1e9), 1), step_ns)
        delta[n, 0] = delta[n, 1] = delta[n, 2] = 0
        if next_0 == first_s:
            made_0 += 1
            delta[n, 0] = 1 if lanes[0].rate_hz > 0.0 else -1
            next_0 = _next_s(lanes[0], made_0)
        if next_1 == first_s:
            made_1 += 1
            delta[n, 1] = 1 if lanes[1].rate_hz > 0.0 else -1
            next_1 = _next_s(lanes[1], made_1)
        if next_2 == first_s:
            made_2 += 1
            delta[n, 2] = 1 if lanes[2].rate_hz > 0.0 else -1
            next_2 = _next_s(lanes[2], made_2)
        n += 1
    for i in range(AXES):
        lane = lanes[i]
        made = made_0 if i == 0 else made_1 if i == 1 else made_2
        change = made if lane.rate_hz > 0.0 else -made
        lane.counter += change
        lane.fraction += lane.rate_hz * step_s - change
    return n


@njit(nogil=True, error_model="numpy")
def _off_mm(path, j, track, x, y, z):
    """Distance of the path's point j from the straight way of the tool, from where `track` has it to a place."""
    way_x, way_y, way_z = x - track.x_mm, y - track.y_mm, z - track.z_mm
    d_x, d_y, d_z = path[j, 0] - track.x_mm, path[j, 1] - track.y_mm, path[j, 2] - track.z_mm
    square = way_x * way_x + way_y * way_y + way_z * way_z
    share = 0.0
    if square > 0.0:
        share = min(1.0, max(0.0, (d_x * way_x + d_y * way_y + d_z * way_z) / square))
    d_x, d_y, d_z = d_x - share * way_x, d_y - share * way_y, d_z - share * way_z
    return math.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)


@njit(nogil=True, error_model="numpy")
def place_on(path, j, way_mm):
    """X, Y, Z of the path's [m, 4] point at a distance along it, in its piece j."""
    share = (way_mm - path[j, 3]) / (path[j + 1, 3] - path[j, 3])
    return (
        path[j, 0] + share * (path[j + 1, 0] - path[j, 0]),
        path[j, 1] + share * (path[j + 1, 1] - path[j, 1]),
        path[j, 2] + share * (path[j + 1, 2] - path[j, 2]),
    )


@njit(nogil=True, error_model="numpy")
def follow(path, track, x, y, z):
    """Follow the tool to a place; return its progress in mm. Sets piece, way, deviation and place of the track.

    The nearest point of the path [m, 4] is looked for near the last one. The deviation is the tool's from there, or
    that of a point in between from the tool's way, if it is above the tolerance. Progress is how far the nearest point
    has gone on; forwards, no more than the tool has moved in that direction.
    """
    low_mm, high_mm = track.way_mm - BACK_MM, track.way_mm + BACK_MM + track.reach_mm
    j = track.piece
    while j > 0 and path[j, 3] > low_mm:
        j -= 1
    least, piece, way_mm = math.inf, track.piece, track.way_mm
    while j < path.shape[0] - 1 and path[j, 3] < high_mm:
        a_x, a_y, a_z = path[j, 0], path[j, 1], path[j, 2]
        d_x, d_y, d_z = path[j + 1, 0] - a_x, path[j + 1, 1] - a_y, path[j + 1, 2] - a_z
        share = ((x - a_x) * d_x + (y - a_y) * d_y + (z - a_z) * d_z) / (d_x * d_x + d_y * d_y + d_z * d_z)
        share = min(1.0, max(0.0, share))
        p_x, p_y, p_z = a_x + share * d_x, a_y + share * d_y, a_z + share * d_z
        square = (x - p_x) * (x - p_x) + (y - p_y) * (y - p_y) + (z - p_z) * (z - p_z)
        if square < least:
            least, piece = square, j
            way_mm = path[j, 3] + share * (path[j + 1, 3] - path[j, 3])
        j += 1
    deviation_mm, progress_mm = math.sqrt(least), way_mm - track.way_mm
    if progress_mm > 0.0:
        for passed in range(track.piece + 1, piece + 1):
            off_mm = _off_mm(path, passed, track, x, y, z)
            if off_mm > track.tolerance_mm:
                deviation_mm = max(deviation_mm, off_mm)
        from_x, from_y, from_z = place_on(path, track.piece, track.way_mm)
        to_x, to_y, to_z = place_on(path, piece, way_mm)
        d_x, d_y, d_z = to_x - from_x, to_y - from_y, to_z - from_z
        along_mm = (x - track.x_mm) * d_x + (y - track.y_mm) * d_y + (z - track.z_mm) * d_z
        along_mm /= max(math.sqrt(d_x * d_x + d_y * d_y + d_z * d_z), 1e-12)
        progress_mm = max(0.0, min(progress_mm, along_mm))
    track.piece, track.way_mm, track.deviation_mm = piece, way_mm, deviation_mm
    track.x_mm, track.y_mm, track.z_mm = x, y, z
    return progress_mm


@njit(nogil=True, error_model="numpy")
def tool_mm(parts, lanes, shape_mm):
    """X, Y, Z of the tool from the start of the path."""
    x = y = z = 0.0
    for j in range(shape_mm.shape[1]):
        x += shape_mm[0, j] * parts.place[j]
        y += shape_mm[1, j] * parts.place[j]
        z += shape_mm[2, j] * parts.place[j]
    return x - lanes[0].origin_mm, y - lanes[1].origin_mm, z - lanes[2].origin_mm


@njit(nogil=True, error_model="numpy")
def look(memory, track, lanes, shape_mm, path, observation):
    """Fill in `observation` [SIZE] of the environment, and reset margins and edge."""
    parts = parts_of(memory)
    track.edge = math.inf
    place_x, place_y, place_z = place_on(path, track.piece, track.way_mm)
    for i in range(AXES):
        lane, axis = lanes[i], parts.axes[i]
        tool = track.x_mm if i == 0 else track.y_mm if i == 1 else track.z_mm
        nearest = place_x if i == 0 else place_y if i == 1 else place_z
        speed = 0.0
        for j in range(shape_mm.shape[1]):
            speed += shape_mm[i, j] * parts.qvel[j]
        for k in range(AXES):  # carriages as the sub-steps see them
            dof = parts.axes[k].dof
            speed += shape_mm[i, dof] * (parts.axes[k].v_m_s - parts.qvel[dof])
        lag = parts.commanded[i] - parts.states[i].theta_rad * axis.steps_per_rad
        observation[i] = _within((tool - nearest) / track.tolerance_mm)
        observation[AXES + i] = _within(speed * lane.steps_per_mm / lane.highest_hz)
        observation[2 * AXES + i] = lane.rate_hz / lane.highest_hz
        observation[3 * AXES + i] = _within(lag / lane.half_slip)
        observation[4 * AXES + i] = _within((lane.counter / lane.steps_per_mm - nearest) / (2.0 * track.tolerance_mm))
        observation[5 * AXES + i] = max(0.0, _within(axis.margin))
        axis.margin = 1.0
        if axis.fastest_rad_s >= SLOW_RAD_S:
            track.edge = min(track.edge, lane.limit_rad_s / axis.fastest_rad_s)
        axis.fastest_rad_s = 0.0
    j = track.piece
    for k in range(len(PREVIEW_MM)):
        ahead_mm = PREVIEW_MM[k]
        while j < path.shape[0] - 2 and path[j + 1, 3] < track.way_mm + ahead_mm:
            j += 1
        share = min(1.0, (track.way_mm + ahead_mm - path[j, 3]) / (path[j + 1, 3] - path[j, 3]))
        for i in range(AXES):
            nearest = place_x if i == 0 else place_y if i == 1 else place_z
            point = path[j, i] + share * (path[j + 1, i] - path[j, i])
            observation[(6 + k) * AXES + i] = _within((point - nearest) / ahead_mm)
    observation[SIZE - 2] = 1.0 - track.way_mm / path[path.shape[0] - 1, 3]
    left_s = track.time_limit_s - 1e-9 * (track.until_ns - track.began_ns)
    observation[SIZE - 1] = _within(max(left_s / track.time_limit_s, 0.0))


@njit(nogil=True, error_model="numpy")
def aim(tracks, lanes, path, feed_mm_s, offset_mm, asked, action):
    """Fill in the action [3] that brings the counters, by the end of the step, to a point that moves along the path, or
    beside it. asked [4] in -1 .. 1: its feed from 0 to feed_mm_s, its offset over offset_mm. Others: `take_step`."""
    track, last = tracks[0], path.shape[0] - 1
    step_s = 1e-9 * track.step_ns
    ahead_mm = 0.5 * (1.0 + _within(asked[0])) * feed_mm_s * step_s
    track.led_mm = min(path[last, 3], track.led_mm + ahead_mm)
    j, beyond = 1, last  # the first point behind the led one
    while j < beyond:
        middle = (j + beyond) // 2
        if path[middle, 3] > track.led_mm:
            beyond = middle
        else:
            j = middle + 1
    share = (track.led_mm - path[j - 1, 3]) / (path[j, 3] - path[j - 1, 3])
    for i in range(AXES):
        lane = lanes[i]
        aim_mm = path[j - 1, i] + share * (path[j, i] - path[j - 1, i]) + offset_mm * _within(asked[1 + i])
        speed_mm_s = (aim_mm - lane.counter / lane.steps_per_mm) / step_s
        action[i] = np.float32(speed_mm_s / (lane.highest_hz / lane.steps_per_mm))  # as the action space has it


@njit(nogil=True, error_model="numpy")
def begin(memory, tracks, lanes, shape_mm, path, observation):
    """The first observation; arguments as for `take_step`."""
    track = tracks[0]
    track.x_mm, track.y_mm, track.z_mm = tool_mm(parts_of(memory), lanes, shape_mm)
    follow(path, track, track.x_mm, track.y_mm, track.z_mm)
    look(memory, track, lanes, shape_mm, path, observation)


@njit(nogil=True, error_model="numpy")
def take_step(memory, tracks, lanes, shape_mm, path, t_ns, delta, no_leads, action, observation):
    """Make a step of the environment; return 0 or bits of DONE, OUTSIDE and LOST, or -1 for an invalid action.

    memory [1] MEMORY of a plant without thresholds; tracks [1] TRACK; lanes [3] LANE; shape_mm [3, nv], motion of the
    tool by the joints; path [m, 4]; t_ns [n], delta int32 [n, 3] scratch for pulses; no_leads int64 [0]; action float64
    [3], frequencies over the highest; observation [SIZE], to be filled.
    """
    track, parts = tracks[0], parts_of(memory)
    for i in range(AXES):
        if not math.isfinite(action[i]):
            return -1
    for i in range(AXES):
        lanes[i].rate_hz = lanes[i].highest_hz * _within(action[i])
    n, first, end_ns = lay_pulses(lanes, track.until_ns, track.step_ns, t_ns, delta), 0, track.until_ns + track.step_ns
    progress_mm = deviation_mm = 0.0
    while track.until_ns < end_ns:
        track.until_ns = min(track.until_ns + LOOK_NS, end_ns)
        last = first
        while last < n and t_ns[last] <= track.until_ns:
            last += 1
        advance(memory, track.until_ns, t_ns[first:last], delta[first:last], no_leads, 0)
        first = last
        x, y, z = tool_mm(parts, lanes, shape_mm)
        progress_mm += follow(path, track, x, y, z)
        deviation_mm = max(deviation_mm, track.deviation_mm)
        if parts.plant[0].lost_dof >= 0:
            track.until_ns = end_ns
    track.deviation_mm = deviation_mm
    look(memory, track, lanes, shape_mm, path, observation)
    over, slow, stands = 0, True, path[path.shape[0] - 1, 3] - track.way_mm <= track.tolerance_mm
    if not deviation_mm <= track.tolerance_mm or parts.plant[0].lost_dof >= 0:
        over |= OUTSIDE
    for i in range(AXES):
        lag = parts.commanded[i] - parts.states[i].theta_rad * parts.axes[i].steps_per_rad
        if not abs(lag) < lanes[i].half_slip:
            over |= LOST
        slow = slow and abs(lanes[i].rate_hz) <= STOPS_HZ
        stands = stands and abs(lag) <= 0.5 * lanes[i].half_slip
    track.rest_ns = track.rest_ns + track.step_ns if stands else 0
    if over == 0 and slow and track.rest_ns >= REST_NS:
        over = DONE
    step_s, share = 1e-9 * track.step_ns, min(1.0, track.deviation_mm / track.tolerance_mm)
    track.reward_progress = progress_mm
    track.reward_time = -track.time_weight * step_s
    track.reward_deviation = -track.deviation_weight * step_s * share * share
    track.reward_abort = -track.abort_penalty if over & (OUTSIDE | LOST) else 0.0
    return over


CONTAINED = (seen.__file__, kernel.__file__, *kernel.CONTAINED)  # files whose code these functions contain
contains(__name__, *CONTAINED)
