"""How the card plans moves: speeds and accelerations of the leading axis, corners, the 4 ms grid.

    increments n_i of a move  --ratios-->  e_i = n_i r_i  --+-> L, F, A of the piece        (GMI99 manual 1.1, 1.3, W)
    f, M, B, G0, G95, override -----------------------------+
    directions of two moves, N11, N16 ----------------------> speed at the corner           (3.1.2 N11, N16)

Tool speed control on (W1): L = sqrt(sum e_i^2) over the axes that have influence, so that the resulting speed is f; if
only others move, L = max |e_i|. Off (W0): L = max |n_i|, so that the axis with the longest way runs at f. Then

    F = min(f override, M_0, min_i M_i L / |e_i|, L / 12 ms)        A = min(B_0, min_i B_i L / |e_i|) 1000

and at a corner between the directions u, w (unit vectors of e), phi degrees apart, at which the velocity per path speed
changes by d = e/L - e'/L' (that is u - w under W1),

    v <= FS(phi) / max_i |d_i|,     FS(phi) = FS0 + (FS90 - FS0) min(phi, 90) / 90

Everything here is a function or a value; what happens when is the card's business:

    move = line((1000, 0, 0, 0, 0, 0), 10_000, rules)
    plan = start([move], rules, identity=serial)
    run = SetPointRun(plan, PERIOD_NS, start_ns=t)                  # t on the grid
    plan = more(plan, k, [another], rules, after=move.last)         # arrived while it moves, in force at tick k
    plan = plan.replanned(k, scale=scale(50))                       # override 50 %
    plan = plan.replanned(k, hold=True)                             # M0.0, and hold=False when it goes on
    plan = plan.stopped(k)                                          # #0, M0.1
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from isel_twin.motion.joined import Joined, Pieces

__all__ = [
    "AXES",
    "PERIOD_NS",
    "Heading",
    "Move",
    "Rules",
    "corner_hz",
    "factor",
    "line",
    "more",
    "scale",
    "start",
    "useful_hz",
]

AXES = 6
"""Slots 0 to 5; a displacement has one number for each."""

PERIOD_NS = 4_000_000
"""Set points leave every 4 ms (1.2)."""

SHORTEST_S = 0.012
"""Least time of a piece of line (1.2)."""

Six = tuple[int, int, int, int, int, int]


@dataclass(frozen=True)
class Rules:
    """What moves are planned by; the card keeps one and replaces it when a command changes something.

    speed_hz, acceleration_hz_per_ms: M and B, first the value of the leading axis, then those of slots 0 to 5.
    ratio: resolution ratios of slots 0 to 5 times 65535 (W). influence: whether a slot counts for the tool speed.
    tool_speed: W1. jump_hz, sharp_jump_hz: FS0 (N11), FS90 (N16; never above FS0). sine: N24. free_circles: N14.
    """

    speed_hz: tuple[int, ...] = (2000,) * 7
    acceleration_hz_per_ms: tuple[int, ...] = (50,) * 7
    ratio: Six = (65535,) * 6
    influence: tuple[bool, ...] = (True,) * 6
    tool_speed: bool = True
    jump_hz: int = 50
    sharp_jump_hz: int = 0
    sine: bool = False
    free_circles: bool = False

    def with_speed(self, hz: int, slot: int | None = None) -> Rules:
        """After M: of the leading axis and with it of all slots, or of one."""
        raise NotImplementedError

    def with_acceleration(self, hz_per_ms: int, slot: int | None = None) -> Rules:
        """After B; as `with_speed`."""
        raise NotImplementedError

    def with_ratio(self, p2: int, slot: int) -> Rules:
        """After W with P3 = slot + 1: p2 = 1..65535, or that + 65536 for an axis without influence."""
        raise NotImplementedError


@dataclass(frozen=True)
class Heading:
    """Direction of a move at one of its ends.

    per_path: effective increments e of each slot per unit of path length, float [6].
    """

    per_path: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Move:
    """A move ready to be joined: its pieces (none if it goes nowhere; one for a line; the chords of a circle) and its
    directions at the beginning and at the end (None if it goes nowhere)."""

    pieces: Pieces
    first: Heading | None
    last: Heading | None


def factor(speed_hz: int) -> int:
    """V factor k that follows from M of the leading axis (manual 5): 1, 2, 4, 8, 10 or 20."""
    raise NotImplementedError


def useful_hz(feed_hz: int, rules: Rules) -> int:
    """What the card makes of f: not above M, a multiple of the V factor k, not below 2 k."""
    raise NotImplementedError


def scale(override_percent: float | None = None, spindle_rpm: float | None = None) -> float:
    """Factor of programmed speeds: the override (None: 100 %, else 0..125; more is 125), and under G95 the revolutions
    of the spindle a second. 0 stands."""
    raise NotImplementedError


def line(displacement: Sequence[int], feed: int | None, rules: Rules, *, per_revolution: bool = False) -> Move:
    """A straight move by so many increments of each slot.

    feed: f in Hz; None: rapid, G0. per_revolution: feed is in increments per revolution (G95), the plan is scaled by
    `scale(override, rpm)`. Raises ValueError unless there are six numbers, or for a feed that is not positive.
    """
    raise NotImplementedError


def corner_hz(before: Heading, after: Heading, rules: Rules) -> float:
    """Greatest path speed at which a move of the one direction may pass into one of the other; inf if equal."""
    raise NotImplementedError


def start(
    moves: Sequence[Move], rules: Rules, *, scale: float = 1.0, ceiling_hz: float = math.inf, identity: object = 0
) -> Joined:
    """The plan that makes these moves from standstill, joined. ceiling_hz: R while the PLC asks for it."""
    raise NotImplementedError


def more(plan: Joined, k: int, moves: Sequence[Move], rules: Rules, after: Heading | None) -> Joined:
    """The plan with these moves behind it, known at tick k.

    after: direction at the end of the last move planned so far, None if there is none.
    """
    raise NotImplementedError
