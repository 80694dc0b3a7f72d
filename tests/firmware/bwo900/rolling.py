"""Contours for radius correction, and what a disc that rolls along them may do: an oracle of its own.

contour    lines and arcs, each by its turn against the one before it, as numbers, not as elements of the firmware
distance   of points to an element, by the closed forms of segment and arc
rolling    whether a disc of the tool's size touches every element somewhere without cutting into its neighbours
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

Points: TypeAlias = NDArray[np.float64]
"""[n, 2], mm"""

AXES = {"G17": ("X", "Y", "Z"), "G18": ("Z", "X", "Y"), "G19": ("Y", "Z", "X")}
CENTRES = {"X": "I", "Y": "J", "Z": "K"}
SAMPLES = 401
STRAIGHT = 1e-6
"""rad: no corner at all, or the way back."""


@dataclass(frozen=True)
class Piece:
    """A line (sweep 0), or an arc of radius about centre; angles in rad, counter-clockwise."""

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0
    begin: float = 0.0
    """Angle of the start, seen from the centre; of a line its direction."""
    sweep: float = 0.0

    @property
    def length(self) -> float:
        return abs(self.sweep) * self.radius if self.sweep else math.dist(self.start, self.end)

    def heading(self, share: float) -> float:
        """Direction at a share of the length."""
        if not self.sweep:
            return self.begin
        return self.begin + share * self.sweep + math.copysign(math.pi / 2, self.sweep)

    def points(self, shares: NDArray[np.float64]) -> Points:
        """Points at shares of the length."""
        if not self.sweep:
            a, b = np.array(self.start), np.array(self.end)
            return a + shares[:, None] * (b - a)
        angles = self.begin + shares * self.sweep
        return np.array(self.centre) + self.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def beside(self, shares: NDArray[np.float64], aside: float) -> Points:
        """The same, moved to the left."""
        headings = np.array([self.heading(share) for share in shares])
        return self.points(shares) + aside * np.stack([-np.sin(headings), np.cos(headings)], axis=1)

    def distance(self, places: Points) -> NDArray[np.float64]:
        """Of places to it."""
        ends = np.minimum(np.hypot(*(places - self.start).T), np.hypot(*(places - self.end).T))
        if not self.sweep:
            way = np.array(self.end) - self.start
            share = (places - self.start) @ way / (way @ way)
            foot = np.array(self.start) + np.clip(share, 0.0, 1.0)[:, None] * way
            return np.hypot(*(places - foot).T)
        away = places - self.centre
        angle = np.mod(math.copysign(1.0, self.sweep) * (np.arctan2(away[:, 1], away[:, 0]) - self.begin), 2 * math.pi)
        on = angle <= abs(self.sweep) + 1e-9
        return np.where(on, np.minimum(np.abs(np.hypot(*away.T) - self.radius), ends), ends)


def contour(steps: Sequence[tuple[float, float, float]], heading: float = 0.0) -> list[Piece]:
    """Steps of (turn in degrees, length or radius, sweep in degrees; 0 for a line) from (0, 0); a radius below 0.1 is
    that."""
    here, made = (0.0, 0.0), list[Piece]()
    for turn, size, sweep_deg in steps:
        heading += math.radians(turn)
        if not sweep_deg:
            there = (here[0] + size * math.cos(heading), here[1] + size * math.sin(heading))
            made.append(Piece(here, there, begin=heading))
        else:
            sweep = math.radians(sweep_deg)
            side = math.copysign(1.0, sweep)
            centre = (here[0] - side * size * math.sin(heading), here[1] + side * size * math.cos(heading))
            begin = heading - side * math.pi / 2
            end = begin + sweep
            there = (centre[0] + size * math.cos(end), centre[1] + size * math.sin(end))
            if abs(sweep_deg) == 360:
                there = here
            made.append(Piece(here, there, centre, size, begin, sweep))
            heading += sweep
        here = there
    return made


def words(pieces: Sequence[Piece], plane: str = "G17") -> list[str]:
    """The words of each piece, G01 to G03, absolute."""
    u, v, _ = AXES[plane]
    made = []
    for piece in pieces:
        end = f"{u}{piece.end[0]:.7f} {v}{piece.end[1]:.7f}"
        if not piece.sweep:
            made.append(f"G1 {end}")
        else:
            i, j = CENTRES[u], CENTRES[v]
            made.append(f"{'G3' if piece.sweep > 0 else 'G2'} {end} {i}{piece.centre[0]:.7f} {j}{piece.centre[1]:.7f}")
    return made


def rolls(pieces: Sequence[Piece], aside: float) -> float | None:
    """How far a disc can roll along all of them: the least share of a piece at which it touches it and neither of its
    neighbours; below 0 where it cannot. None: a piece comes near its neighbour elsewhere than at their corner, and what
    a tool should do there is nobody's rule; or that cannot be told from samples. aside: the radius, left > 0."""
    shares = np.linspace(0.0, 1.0, SAMPLES)
    begins, ends = [0.0] * len(pieces), [1.0] * len(pieces)
    for number, piece in enumerate(pieces):
        if piece.sweep * aside > 0.0 and piece.radius <= abs(aside):
            return 0.0 if piece.radius == abs(aside) else -1.0
        if number + 1 < len(pieces):
            following = pieces[number + 1]
            turn = math.remainder(following.heading(0.0) - piece.heading(1.0), 2 * math.pi)
            inner = turn * aside > 0.0 and STRAIGHT < abs(turn) < math.pi - STRAIGHT
            before = following.distance(piece.beside(shares, aside)) > abs(aside) - 1e-5
            after = piece.distance(following.beside(shares, aside)) > abs(aside) - 1e-5
            if inner:
                before[-1] = after[0] = False
            if np.count_nonzero(before[1:] & ~before[:-1]) or np.count_nonzero(after[:-1] & ~after[1:]):
                return None
            if not inner and not (before.all() and after.all() and clear_around(piece, following, turn, aside)):
                return None
            if inner and before.any() and after.any():
                apart = math.dist(
                    piece.beside(shares[[np.flatnonzero(before)[-1]]], aside)[0],
                    following.beside(shares[[np.flatnonzero(after)[0]]], aside)[0],
                )
                lengths = [p.length * (1.0 + abs(aside) / (p.radius or math.inf)) for p in (piece, following)]
                resolved = 4.0 * max(lengths) / SAMPLES
                if apart > resolved:  # it would have to jump
                    return -1.0
                if resolved > abs(aside):
                    return None
            ends[number] = float(before.mean())
            begins[number + 1] = 1.0 - float(after.mean())
    return min(end - begin for begin, end in zip(begins, ends, strict=True))


def clear_around(piece: Piece, following: Piece, turn: float, aside: float) -> bool:
    """Whether a disc that turns about an outer corner keeps off the rest of both."""
    sweep = -math.copysign(abs(turn), aside)
    first = piece.heading(1.0) + math.copysign(math.pi / 2, aside)
    angles = first + sweep * np.linspace(0.0, 1.0, 51)
    centres = np.array(piece.end) + abs(aside) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return all(bool((p.distance(centres) > abs(aside) - 1e-5).all()) for p in (piece, following))


turns = st.sampled_from([0.0, 0.0, 0.0, 15.0, -15.0, 60.0, -60.0, 90.0, -90.0, 125.0, -125.0, 165.0, -165.0, 180.0])
sizes = st.integers(5, 300).map(lambda n: n / 10.0)
sweeps = st.sampled_from([30.0, -30.0, 90.0, -90.0, 180.0, -180.0, 270.0, -270.0, 360.0, -360.0])
lines = st.tuples(turns, sizes, st.just(0.0))
arcs = st.tuples(turns, sizes, sweeps)


@st.composite
def steps(draw: st.DrawFn, most: int = 7) -> list[tuple[float, float, float]]:
    """Steps of a contour; it may cross itself."""
    return draw(st.lists(st.one_of(lines, arcs), min_size=1, max_size=most))
