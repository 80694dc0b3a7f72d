"""Collisions: the first contact of two bodies that must not meet, and how far they stay from each other.

    Collision    the event: who, where, when, how fast, how hard
    Sensed       on the MuJoCo plant: MuJoCo's own contacts, at the step that finds them
    Geometry     distances of the pairs of a model (clamped.py), with the carriages anywhere
    Along        on the kinematic plant: the first contact along a path
    Least        the least distance along a path, on both

Nothing is computed where nothing is near. All shapes are convex and do not turn, so the distance of two of them is a
convex function d of the place p of the carriages, and one look at p0 bounds it everywhere, by the plane between them:

    d(p) >= d(p0) + g (p - p0)        g: how the distance changes along X, Y and Z

A path is searched for the first place where this bound is gone; a look there gives a better one, and so on. A path that
leads straight at a flat side needs two looks, one that goes along it needs one.

A pair that touches is told once, until its shapes have parted by PARTED_MM.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.plant.clamped import Pair, pairs
from isel_twin.plant.collision import Clearance, Collision
from isel_twin.plant.memory import FRESH, PARTED_MM, TOUCHING, Parts

_EXACT_M = 1e-12  # of a distance; MuJoCo's own setting leaves some nanometres
_FAR_M = 100.0  # more than any two shapes are apart
TOUCH_MM = 1e-6  # distance that counts as none: rounding is below
LEAST_MM = 1e-3  # by which a least distance may be too large
FINE_MM = (
    0.05  # between two places of a path that are looked at: what is passed in between is not deeper than half of it
)


class Sensed:
    """Collisions of a MuJoCo plant: of what its loop has found touching."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, parts: Parts, shape_mm: NDArray[np.float64]) -> None:
        """shape_mm [3, nv]: of the tool over the table by the joints."""
        self._model, self._data, self._parts, self._shape_mm = model, data, parts, shape_mm
        self._pairs = pairs(model)

    def news(self, now_ns: int) -> tuple[Collision, ...]:
        """What has begun to touch in MuJoCo's last step, the one that ends now. MuJoCo looks at its beginning; how deep
        the shapes were in each other then says how long before that they met."""
        touching, step_ns = self._parts.touching, round(self._model.opt.timestep * SECOND_NS)
        fresh = np.flatnonzero(touching == FRESH)
        touching[fresh] = TOUCHING
        known = {pair.names for k, pair in enumerate(self._pairs) if touching[k] and k not in fresh}
        found: dict[tuple[str, str], Collision] = {}
        for k in fresh:
            pair = self._pairs[k]
            if pair.names not in known and pair.names not in found:
                found[pair.names] = self._collision(pair, now_ns - step_ns, step_ns)
        return tuple(found.values())

    def _collision(self, pair: Pair, look_ns: int, step_ns: int) -> Collision:
        velocity_mm_s = self._shape_mm @ self._parts.rates
        force, force_n, ago_ns = np.zeros(6), 0.0, 0
        for number, contact in enumerate(self._data.contact):
            if {int(contact.geom[0]), int(contact.geom[1])} == {pair.moving, pair.standing}:
                mujoco.mj_contactForce(self._model, self._data, number, force)
                force_n += float(force[0])
                ago_ns = max(ago_ns, self._since_ns(contact, step_ns))
        position_mm = self._shape_mm @ self._parts.before - velocity_mm_s * (ago_ns / SECOND_NS)
        x, y, z = position_mm.tolist()
        speed_mm_s = float(np.linalg.norm(velocity_mm_s))
        return Collision(*pair.names, (x, y, z), look_ns - ago_ns, speed_mm_s, force_n)

    def _since_ns(self, contact: Any, step_ns: int) -> int:
        """Time since the shapes of a contact met, at most a step."""
        ends = []
        for geom in contact.geom:
            jacobian = np.zeros((3, self._model.nv))
            mujoco.mj_jac(self._model, self._data, jacobian, None, contact.pos, self._model.geom_bodyid[geom])
            ends.append(jacobian @ self._parts.rates)
        nearing_m_s = float(contact.frame[:3] @ (ends[0] - ends[1]))
        return min(step_ns, round(-contact.dist / nearing_m_s * SECOND_NS)) if nearing_m_s > 1e-9 else 0


class Geometry:
    """Distances of pairs by the places of the carriages; all other joints stay where the model has them."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """model: from now on its own."""
        model.opt.ccd_tolerance, model.opt.ccd_iterations = _EXACT_M, 200
        self.pairs = pairs(model)
        self._model, self._data = model, mujoco.MjData(model)
        joints = [model.joint(name) for name in CARRIAGES]
        self._at = np.array([joint.qposadr[0] for joint in joints])
        mujoco.mj_forward(model, self._data)
        self._ways = np.array([self._way(pair, [joint.dofadr[0] for joint in joints]) for pair in self.pairs])
        self._place = np.full(3, np.nan)
        self._ends = np.zeros(6)
        n = len(self.pairs)
        self._seen_mm, self._from_mm, self._rise = np.full(n, -np.inf), np.zeros((n, 3)), np.zeros((n, 3))

    def _way(self, pair: Pair, dofs: Sequence[int]) -> NDArray[np.float64]:
        """float64 [3, 3], how X, Y and Z move the first shape of a pair in the world, seen from the second."""
        jacobian, model = np.zeros((2, 3, self._model.nv)), self._model
        for side, geom in zip(jacobian, (pair.moving, pair.standing), strict=True):
            mujoco.mj_jacBody(model, self._data, side, None, int(model.geom_bodyid[geom]))
        between: NDArray[np.float64] = (jacobian[0] - jacobian[1])[:, dofs]
        return between.T

    def look(self, k: int, place_mm: NDArray[np.float64]) -> float:
        """Distance of pair k in mm, below 0 how deep they are in each other; what it bounds is remembered."""
        model, data = self._model, self._data
        if not np.array_equal(place_mm, self._place):
            self._place = place_mm.copy()
            data.qpos[self._at] = 1e-3 * place_mm
            mujoco.mj_kinematics(model, data)
        pair, ends = self.pairs[k], self._ends
        apart_mm = 1e3 * mujoco.mj_geomDistance(model, data, pair.moving, pair.standing, _FAR_M, ends)
        if apart_mm > TOUCH_MM:
            self._seen_mm[k], self._from_mm[k] = apart_mm, place_mm
            self._rise[k] = self._ways[k] @ (ends[:3] - ends[3:]) * (1e3 / apart_mm)
        return float(apart_mm)

    def bounds(self, low_mm: NDArray[np.float64], high_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [pairs], what the distance of each is at least with the carriages in this box of places, in mm, by
        the last look."""
        way = np.where(self._rise > 0.0, low_mm, high_mm) - self._from_mm
        least: NDArray[np.float64] = self._seen_mm + (self._rise * way).sum(axis=1)
        return least

    def bound(self, k: int, path_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [n], the same of pair k at each place of a path [n, 3]."""
        least: NDArray[np.float64] = self._seen_mm[k] + (path_mm - self._from_mm[k]) @ self._rise[k]
        return least

    def first_below(self, k: int, path_mm: NDArray[np.float64], limit_mm: float, start: int = 0) -> int:
        """First place of a path [n, 3] from `start` on at which pair k is not farther apart than this; n: none."""
        while start < len(path_mm):
            near = self.bound(k, path_mm[start:]) <= limit_mm + TOUCH_MM
            ahead = int(near.argmax())
            if not near[ahead]:
                break
            start += ahead
            if self.look(k, path_mm[start]) <= limit_mm + TOUCH_MM:
                return start
            start += 1
        return len(path_mm)

    def first_apart(self, k: int, path_mm: NDArray[np.float64]) -> int:
        """First place of a path [n, 3] at which pair k, which touches, has parted; n: none."""
        at = 0
        while at < len(path_mm):
            apart_mm = self.look(k, path_mm[at])
            if apart_mm > PARTED_MM:
                return at
            gone = np.linalg.norm(path_mm[at + 1 :] - path_mm[at], axis=1) >= PARTED_MM - apart_mm
            if not gone.any():
                break
            at += 1 + int(gone.argmax())
        return len(path_mm)


class Along:
    """The contacts of a machine whose carriages go where they are told."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.begun = False  # somebody has looked
        self.touching = np.zeros(len(geometry.pairs), dtype=np.bool_)

    def first(self, path_mm: NDArray[np.float64]) -> int:
        """The first place of a path [n, 3] at which two bodies begin to touch; n: none."""
        return self._search(path_mm)[0]

    def follow(self, path_mm: NDArray[np.float64]) -> tuple[tuple[str, str], ...]:
        """Go along a path, on which nothing is met before its end; who meets there, by name."""
        self.begun = True
        before = self._names(self.touching)
        self.touching = self._search(path_mm)[1]
        return tuple(dict.fromkeys(names for names in self._names(self.touching) if names not in before))

    def share(self, ends_mm: NDArray[np.float64]) -> float:
        """Which part of a straight way [2, 3] is over when two bodies begin to touch that do so at its end."""
        geometry, fresh = self.geometry, self._search(ends_mm[1:])[1] & ~self.touching
        apart, met = 0.0, 1.0
        while (met - apart) * np.linalg.norm(ends_mm[1] - ends_mm[0]) > TOUCH_MM:
            middle = 0.5 * (apart + met)
            place_mm = ends_mm[0] + middle * (ends_mm[1] - ends_mm[0])
            touches = any(geometry.look(int(k), place_mm) <= TOUCH_MM for k in np.flatnonzero(fresh))
            apart, met = (apart, middle) if touches else (middle, met)
        return met

    def _search(self, path_mm: NDArray[np.float64]) -> tuple[int, NDArray[np.bool_]]:
        """The first place at which two bodies begin to touch, n: none; and which pairs touch there, or at the end."""
        geometry, touching, end = self.geometry, self.touching.copy(), len(path_mm)
        if not end:
            return end, touching
        before = self._names(touching)
        bounds = geometry.bounds(path_mm.min(axis=0), path_mm.max(axis=0))
        found = end
        for k in np.flatnonzero(touching | (bounds <= 2.0 * TOUCH_MM)).tolist():
            apart = geometry.first_apart(k, path_mm) if touching[k] else 0
            if apart == end:
                continue
            meets = geometry.first_below(k, path_mm, 0.0, apart)
            touching[k] = meets < end
            if apart > 0 or geometry.pairs[k].names not in before:
                found = min(found, meets)
        if found < end - 1:  # who meets or parts later does not count
            return found, self._search(path_mm[: found + 1])[1]
        return found, touching

    def _names(self, which: NDArray[np.bool_]) -> list[tuple[str, str]]:
        return [self.geometry.pairs[k].names for k in np.flatnonzero(which)]


class Least:
    """Keeps the least distance along paths."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry
        self.found: Clearance | None = None  # None: nobody has looked, or there are no two that could meet
        self._last: tuple[NDArray[np.int64], NDArray[np.float64]] | None = None

    def begin_anew(self) -> None:
        """The carriages are somewhere else, without having gone there."""
        self._last = None

    def look(self, times_ns: NDArray[np.int64], path_mm: NDArray[np.float64]) -> None:
        """Look along a path [n, 3], straight from place to place, at these times [n], and from the place before it."""
        if not len(path_mm) or not self._geometry.pairs:
            return
        if self._last is not None:
            times_ns = np.concatenate((self._last[0], times_ns))
            path_mm = np.concatenate((self._last[1], path_mm))
        self._last = times_ns[-1:].copy(), path_mm[-1:].copy()
        least_mm = np.inf if self.found is None else self.found.apart_mm
        bounds = self._geometry.bounds(path_mm.min(axis=0), path_mm.max(axis=0))
        near = [k for k in np.argsort(bounds) if bounds[k] < least_mm - LEAST_MM]
        if not near:
            return
        times, path_mm = fine(times_ns, path_mm)
        for k in near:
            self._look(int(k), times, path_mm)

    def _look(self, k: int, times_ns: NDArray[np.float64], path_mm: NDArray[np.float64]) -> None:
        """Where the bound is least there is a look, and a better bound, until none is below what is known."""
        geometry, low_mm = self._geometry, np.full(len(path_mm), -np.inf)
        while True:
            low_mm = np.maximum(low_mm, geometry.bound(k, path_mm))
            at = int(low_mm.argmin())
            least_mm = np.inf if self.found is None else self.found.apart_mm
            if low_mm[at] >= least_mm - LEAST_MM:
                return
            apart_mm = max(0.0, geometry.look(k, path_mm[at]))
            low_mm[at] = apart_mm
            if apart_mm < least_mm:
                x, y, z = path_mm[at].tolist()
                self.found = Clearance(apart_mm, *geometry.pairs[k].names, (x, y, z), round(times_ns[at]))


def fine(times_ns: NDArray[np.int64], path_mm: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A path with places between its own, so that no two are farther apart than FINE_MM."""
    ways_mm = np.linalg.norm(np.diff(path_mm, axis=0), axis=1)
    pieces = np.maximum(1, np.ceil(ways_mm / FINE_MM)).astype(np.int64)
    if (pieces == 1).all():
        return times_ns.astype(np.float64), path_mm
    own = np.concatenate(([0], np.cumsum(pieces)))
    every = np.arange(own[-1] + 1)
    columns = [np.interp(every, own, column) for column in (*path_mm.T, times_ns.astype(np.float64))]
    return columns[3], np.column_stack(columns[:3])
