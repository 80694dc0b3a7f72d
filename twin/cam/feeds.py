"""Feeds of a file: their unit, and the caution that they are out of proportion in it (cam/39).

upper bound   500 mm/s                            no gantry of these cuts so fast; said if another unit fits
lower bound   3 um in a turn of the spindle       less than the edge of a cutter is round: it rubs
              0.5 um, if the file only goes down  a core drill in glass grinds so
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from isel_twin.cam.settings import FEED_UNITS, CamSettings
from isel_twin.cam.toolpath import Arc, Caution, Line, Place, Point, Spindle

FASTEST_MM_S = 500.0
ACROSS_MM, DOWN_MM = 0.003, 0.0005  # in a turn, at least
TURNS = (6_000.0, 24_000.0)  # a minute: of usual spindles; what a file says counts within these
UNKNOWN_TURNS = 15_000.0  # of a spindle that is switched by hand
USUAL_MM_S = 10.0  # of the units that a file may mean, the one is named that brings it next to this


class Feeds:
    """The fastest cut of a file, across if it has one. per_mm_s: 1 mm/s in the feeds of the line that is read; 0 if it
    has none (G93). units: of FEED_UNITS, that files of the format are written in."""

    def __init__(self, settings: CamSettings, per_mm_s: Callable[[], float], units: tuple[str, ...]) -> None:
        self.across_mm_s = 0.0  # a cut that is no faster need not be looked at
        self._down_mm_s = 0.0
        self._own_mm_s = settings.feed_mm_s
        self._per_mm_s, self._units = per_mm_s, units
        self._turns, self._rpm = 0, 0.0
        self._at: tuple[Place, float, float] | None = None  # the cut: its place, per_mm_s, least feed

    def spindle(self, element: Spindle) -> None:
        self._turns = element.turns
        if element.speed_rpm is not None:
            self._rpm = element.speed_rpm

    def cut(self, element: Line | Arc, start: Point) -> None:
        feed, per_mm_s = element.feed_mm_s, self._per_mm_s()
        if not per_mm_s or feed == self._own_mm_s:
            return
        if type(element) is Arc or element.to[:2] != start[:2]:
            self.across_mm_s, least_mm = feed, ACROSS_MM
        elif not self.across_mm_s and element.to[2] < start[2] and feed > self._down_mm_s:
            self._down_mm_s, least_mm = feed, DOWN_MM
        else:
            return
        turns = min(max(self._rpm, TURNS[0]), TURNS[1]) if self._turns and self._rpm else UNKNOWN_TURNS
        self._at = element.place, per_mm_s, least_mm * turns / 60.0

    def caution(self) -> Iterator[Caution]:
        """One if even the fastest cut is too slow, or it is too fast and another unit fits; else writers say so."""
        if self._at is None:
            return
        place, per_mm_s, least = self._at
        feed = self.across_mm_s or self._down_mm_s
        if least <= feed <= FASTEST_MM_S:
            return
        meant = {name: feed * per_mm_s / FEED_UNITS[name] for name in self._units}
        name = min(meant, key=lambda each: abs(math.log(meant[each] / USUAL_MM_S)))
        what = f"feeds out of proportion: the fastest cut of this file is at {feed:.3g} mm/s"
        if least <= meant[name] <= FASTEST_MM_S:
            yield Caution(place, f'{what}; if its feeds are in {name}, set feed_unit = "{name}"')
        elif feed < least:
            yield Caution(place, what)
