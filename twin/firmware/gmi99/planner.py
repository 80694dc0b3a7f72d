"""Planning of moves: speeds and accelerations of the leading axis, corners, the 4 ms grid.

    increments n_i of a move  --ratios-->  e_i = n_i r_i  --+-> L, F, A of the piece        (GMI99 manual 1.1, 1.3, W)
    f, M, B, G0, G95, override -----------------------------+
    directions of two moves, N11, N16 ----------------------> speed at the corner           (3.1.2 N11, N16)

Tool speed control on (W1): L = sqrt(sum e_i^2) over the axes that have influence, so that the resulting speed is f; if
only others move, L = max |e_i|. Off (W0): L = max |n_i|, so that the axis with the longest way runs at f. Then

    F = min(f override, M_0, min_i M_i L / |e_i|, L / 12 ms)        A = min(B_0, min_i B_i L / |e_i|) 1000

and at a corner between the directions u, w (unit vectors of e), phi degrees apart, at which the velocity per path speed
changes by d = e/L - e'/L' (that is u - w under W1),

    v <= FS(phi) / max_i |d_i|,     FS(phi) = FS0 + (FS90 - FS0) min(phi, 90) / 90
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.joined import Joined, joined
from isel_twin.motion.pieces import Pieces, chain
from isel_twin.native import core, record

AXES = 6  # slots 0 to 5; a displacement has one number for each
PERIOD_NS = 4_000_000  # set points leave every 4 ms (1.2)
SHORTEST_S = 0.012  # least duration of a line segment (1.2)
# greatest M of each V factor (5)
FACTORS = ((50_000, 1), (100_000, 2), (200_000, 4), (400_000, 8), (500_000, 10), (1_000_000, 20))
STRAIGHT = 1e-9  # change of direction that counts as none: rounding of two moves along one line
RIGHT_ANGLE_DEG = 90.0
IN_C = ("STRAIGHT", "RIGHT_ANGLE_DEG")  # records.h has them, too
FULL_RATIO = 65535.0
MOST_OVERRIDE = 125.0  # "Erhöht um 25 %" (3.1.1 f)
GMI99_RULES = record(
    "GMI99_RULES",
    [
        ("ratio", "f8", AXES),
        ("influence", "i8", AXES),
        ("speed_hz", "f8", AXES + 1),  # of the leading axis, then of slots
        ("acceleration_hz_per_s", "f8", AXES + 1),
        ("tool_speed", "i8"),
        ("jump_hz", "f8"),
        ("sharp_jump_hz", "f8"),
    ],
)


@dataclass(frozen=True)
class Rules:
    """Rules for planning moves; immutable, replaced when a command changes something.

    speed_hz, acceleration_hz_per_ms: M and B, first the value of the leading axis, then those of slots 0 to 5.
    ratio: resolution ratios of slots 0 to 5 times 65535 (W). influence: whether a slot counts for the tool speed.
    tool_speed: W1. jump_hz, sharp_jump_hz: FS0 (N11), FS90 (N16; never above FS0). sine: N24. free_circles: N14.
    """

    speed_hz: tuple[int, ...] = (2000,) * 7
    acceleration_hz_per_ms: tuple[int, ...] = (50,) * 7
    ratio: tuple[int, ...] = (65535,) * 6
    influence: tuple[bool, ...] = (True,) * 6
    tool_speed: bool = True
    jump_hz: int = 50
    sharp_jump_hz: int = 0
    sine: bool = False
    free_circles: bool = False

    @cached_property
    def in_c(self) -> NDArray[np.void]:
        """GMI99_RULES [1]."""
        found = np.zeros(1, GMI99_RULES)
        found["ratio"] = np.array(self.ratio) / FULL_RATIO
        found["acceleration_hz_per_s"] = np.array(self.acceleration_hz_per_ms) * 1000.0
        for name in ("influence", "speed_hz", "tool_speed", "jump_hz", "sharp_jump_hz"):
            found[name] = getattr(self, name)
        return found


@dataclass(frozen=True)
class Heading:
    """Direction of a move at one of its ends: effective increments e of each slot per unit of path length, [6]."""

    per_path: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class PreparedMove:
    """A move ready to be joined: its pieces (one for a line, the chords of a circle) and its directions at both ends;
    no pieces and None without a displacement."""

    pieces: Pieces
    first: Heading | None
    last: Heading | None


def factor(speed_hz: int) -> int:
    """V factor k that follows from M of the leading axis (manual 5): 1, 2, 4, 8, 10 or 20."""
    return next((k for most, k in FACTORS if speed_hz <= most), FACTORS[-1][1])


def useful_hz(feed_hz: int, rules: Rules) -> int:
    """The effective f: not above M, a multiple of the V factor k, not below 2 k."""
    k = factor(rules.speed_hz[0])
    return max(min(feed_hz, rules.speed_hz[0]) // k * k, 2 * k)


def scale(override_percent: float | None = None, spindle_rpm: float | None = None) -> float:
    """Factor of programmed speeds: override 0..125 % (None: 100), under G95 times the spindle's turns a second."""
    override = 1.0 if override_percent is None else min(max(override_percent, 0.0), MOST_OVERRIDE) / 100.0
    return override if spindle_rpm is None else override * spindle_rpm / 60.0


def line(displacement: Sequence[int], feed: int | None, rules: Rules, *, per_revolution: bool = False) -> PreparedMove:
    """A straight move; displacement: increments of each slot.

    feed: f in Hz; None: rapid, G0. per_revolution: feed is in increments per revolution (G95), the plan is scaled by
    `scale(override, rpm)`. Raises ValueError unless there are six numbers, or for a feed that is not positive.
    """
    way = np.array([displacement], dtype=np.float64)
    if way.shape != (1, AXES):
        raise ValueError(f"a move needs {AXES} numbers of increments, got {len(displacement)}")
    return straight(way[way.any(axis=1)], feed, rules, per_revolution=per_revolution)


def straight(
    way: NDArray[np.float64],
    feed: int | None,
    rules: Rules,
    *,
    per_revolution: bool = False,
    shortest_s: NDArray[np.float64] | None = None,
    corners: bool = True,
) -> PreparedMove:
    """A move of n straight pieces: `way` float64 [n, 6], increments, none of them all zeros. feed, per_revolution: as
    for `line`. shortest_s: float64 [n], least duration of each, by default 12 ms. corners: whether the corners between
    these pieces limit the speed.
    """
    if feed is not None and feed <= 0:
        raise ValueError(f"a feed must be positive, got {feed}")
    if feed is None:
        wanted = rules.speed_hz[0]
    else:
        wanted = max(feed, 2 * factor(rules.speed_hz[0])) if per_revolution else useful_hz(feed, rules)
    n = len(way)
    length, limit, acceleration, per_path = np.empty(n), np.empty(n), np.empty(n), np.empty((n, AXES))
    shortest = np.full(n, SHORTEST_S) if shortest_s is None else shortest_s
    core.gmi99_limits(way, rules.in_c, shortest, length, limit, acceleration, per_path)
    entry = np.full(n, math.inf)
    if corners and n > 1:
        core.gmi99_corners(per_path, rules.in_c, entry)
    pieces = Pieces(way, length, np.full(n, float(wanted)), limit, acceleration, entry)
    if not n:
        return PreparedMove(pieces, None, None)
    return PreparedMove(pieces, Heading(tuple(per_path[0].tolist())), Heading(tuple(per_path[-1].tolist())))


def corner_hz(before: Heading, after: Heading, rules: Rules) -> float:
    """Highest path speed at the corner from one direction to the other; inf if equal."""
    entry = np.full(2, math.inf)
    core.gmi99_corners(np.array([before.per_path, after.per_path]), rules.in_c, entry)
    return float(entry[1])


def start(
    moves: Sequence[PreparedMove],
    rules: Rules,
    *,
    scale: float = 1.0,
    ceiling_hz: float = math.inf,
    identity: object = 0,
) -> Joined:
    """The joined plan of these moves from standstill. ceiling_hz: R while the PLC requests it."""
    pieces = _together(moves, rules, None)
    return joined(pieces, PERIOD_NS, sine=rules.sine, scale=scale, ceiling=ceiling_hz, identity=identity)


def more(plan: Joined, k: int, moves: Sequence[PreparedMove], rules: Rules, after: Heading | None) -> Joined:
    """The plan with these moves appended at tick k; after: direction at its present end, or None."""
    return plan.replanned(k, append=_together(moves, rules, after))


def _together(moves: Sequence[PreparedMove], rules: Rules, heading: Heading | None) -> Pieces:
    """Their pieces, with the speeds at the corners between them."""
    parts: list[Pieces] = []
    for move in moves:
        if move.first is None:
            continue
        pieces = move.pieces
        if heading is not None:
            entry = pieces.entry.copy()
            entry[0] = corner_hz(heading, move.first, rules)
            pieces = replace(pieces, entry=entry)
        parts.append(pieces)
        heading = move.last
    return chain(parts) if parts else Pieces(np.empty((0, AXES)), *(np.empty(0),) * 5)
