"""Time of a job as a CAM program says it: ways at their feeds, without ramps, corners and clipped speeds."""

from __future__ import annotations

import math
from collections.abc import Iterator

from isel_twin.cam import arcs
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Dwell, Element, Line, Point, Rapid, Reference, Spindle, Toolpath


class Estimate:
    """Adds up what passes: give `watched(path)` to a writer, and read the sum when it is through."""

    def __init__(self, settings: CamSettings) -> None:
        self.seconds = 0.0
        self._rapid_mm_s = settings.rapid_mm_s
        self._point: Point = settings.machine_point(settings.start)

    def watched(self, path: Toolpath) -> Iterator[Element]:
        """The same elements."""
        for element in path:
            if isinstance(element, Line):
                length = math.dist(self._point, element.to)
                self._point = element.to
                self.seconds += length / element.feed_mm_s if length else 0.0
            elif isinstance(element, Rapid):
                length = math.dist(self._point, element.to)
                self._point = element.to
                self.seconds += length / (element.speed_mm_s or self._rapid_mm_s)
            elif isinstance(element, Arc):
                length = arcs.shape(element, self._point).length
                self._point = element.to
                self.seconds += length / element.feed_mm_s
            elif isinstance(element, Reference):
                self._point = element.ends(self._point)
            elif isinstance(element, Dwell):
                self.seconds += element.seconds
            elif isinstance(element, Spindle):
                self.seconds += element.wait_s
            yield element
