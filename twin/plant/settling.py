"""When servo drives are in position behind a command that they follow, without physics: by the law of their loops.

    w_ref = Kv e + Kff u'      z' = (w_ref - w) / Ti      w' = w_v (w_ref - w + z)      p' = w      e = u - p

the linear cascade of drives/servo.h. Between set points the command u is a straight line, so the state after it is a
matrix times the state before. A drive is in position when the following error has been within its window for the
window's time. On MuJoCo the sampled loops, friction and backlash add some 10 ms to 105 (plant/22).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import SECOND_NS
from isel_twin.drives.servo_drive import ServoDrive

LOOK_NS = SECOND_NS // 1000  # grid on which the law is followed
MEMORY = 12.0  # what was before so many time constants of the loop has no effect: 6e-6


class Settling:
    """Servo axes by their number: their last set points, and since when they are in position."""

    def __init__(self, drives: Mapping[int, ServoDrive]) -> None:
        self._loops = {axis: _Loop(drive) for axis, drive in drives.items()}
        self._keep_ns = max((loop.looks * LOOK_NS + loop.stay_ns for loop in self._loops.values()), default=0)
        self.begin(0)

    def begin(self, now_ns: int) -> None:
        """The drives are switched on, and stay where they are."""
        self._leads: deque[tuple[NDArray[np.int64], NDArray[Any], int]] = deque()
        self._arrivals_ns = {axis: now_ns + loop.stay_ns for axis, loop in self._loops.items()}
        self._known = True

    def lead(self, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int) -> None:
        """Set points of all axes: changes [n, axes] that begin at t_ns [n] and are made evenly within lead_ns."""
        if self._loops and len(t_ns):
            self._leads.append((t_ns.copy(), delta.copy(), lead_ns))  # the caller's are parts of large buffers
            self._known = False
            while self._leads[0][0][-1] + self._leads[0][2] < t_ns[-1] - self._keep_ns:
                self._leads.popleft()

    def in_position(self, axis: int, now_ns: int) -> bool:
        if not self._known:
            self._find()
        return axis not in self._loops or now_ns >= self._arrivals_ns[axis]

    @property
    def arrival_ns(self) -> int:
        """Since when, or from when on, all axes are in position if no more set points come."""
        if not self._known:
            self._find()
        return max(self._arrivals_ns.values(), default=0)

    def _find(self) -> None:
        begins_ns = np.concatenate([t_ns for t_ns, _, _ in self._leads])
        ends_ns = np.concatenate([t_ns + lead_ns for t_ns, _, lead_ns in self._leads])
        changes = np.concatenate([delta for _, delta, _ in self._leads])
        for axis, loop in self._loops.items():
            made = np.flatnonzero(changes[:, axis])
            if len(made):
                end_ns = int(ends_ns[made[-1]])
                after = np.cumsum(changes[made, axis], dtype=np.float64)
                knots_ns = np.stack([begins_ns[made], ends_ns[made]], axis=1).ravel()
                at_knots = np.stack([after - changes[made, axis], after], axis=1).ravel()
                grid_ns = end_ns - LOOK_NS * np.arange(loop.looks, -1, -1)
                command = np.interp(grid_ns, np.maximum.accumulate(knots_ns), at_knots)
                self._arrivals_ns[axis] = end_ns + loop.settling_ns(np.diff(command))
        self._known = True

    def save(self) -> Any:
        return tuple(self._leads), dict(self._arrivals_ns), self._known

    def restore(self, state: Any) -> None:
        leads, arrivals_ns, self._known = state
        self._leads, self._arrivals_ns = deque(leads), dict(arrivals_ns)


class _Loop:
    """The law of one drive."""

    def __init__(self, drive: ServoDrive) -> None:
        kv, w_v, forward = drive.position_gain_per_s, drive.speed_bandwidth_rad_s, drive.feed_forward
        t_i = drive.integral_ratio / w_v
        law = np.array(  # of e, w, z and u', which is held from look to look
            [
                [0.0, -1.0, 0.0, 1.0],
                [w_v * kv, -w_v, w_v, w_v * forward],
                [kv / t_i, -1.0 / t_i, 0.0, forward / t_i],
                [0.0, 0.0, 0.0, 0.0],
            ]
        )
        step = _exp(law * (LOOK_NS / SECOND_NS))
        self.looks = math.ceil(MEMORY / kv * SECOND_NS / LOOK_NS)
        self.stay_ns = round(drive.window_time_s * SECOND_NS)
        self._window = drive.window
        powers = [np.eye(3)]
        for _ in range(self.looks):
            powers.append(step[:3, :3] @ powers[-1])
        free = np.array(powers)
        self._from = free[-2::-1] @ (step[:3, 3] * (SECOND_NS / LOOK_NS))  # state by a change of 1 so many looks ago
        self._error = free[:, 0]  # error so many looks after a state, while the command stands

    def settling_ns(self, changes: NDArray[np.float64]) -> int:
        """From the end of the command, made of these changes [looks] from look to look, to the end of the window's
        time."""
        outside = np.flatnonzero(np.abs(self._error @ (changes @ self._from)) > self._window)
        return (int(outside[-1]) + 1 if len(outside) else 0) * LOOK_NS + self.stay_ns


def _exp(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The exponential: the Taylor series of a small part of it, squared again and again."""
    squarings = max(0, math.ceil(math.log2(32.0 * float(np.abs(matrix).max()))))
    term = made = np.eye(len(matrix))
    for k in range(1, 12):
        term = term @ matrix / (2**squarings * k)
        made = made + term
    for _ in range(squarings):
        made = made @ made
    return made
