"""The cycles by their G numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from isel_twin.firmware.bwo900.analysis.cycles import drilling, measuring, milling, pattern
from isel_twin.firmware.bwo900.analysis.cycles.call import Call, CycleMove
from isel_twin.firmware.bwo900.numbers import G

CYCLES: Final[Mapping[int, Callable[[Call], Iterator[CycleMove]]]] = {
    G.MEASURING: measuring.measuring,
    G.RECTANGLE: milling.rectangle,
    G.RECTANGLE_ZIGZAG: milling.rectangle_zigzag,
    G.RECTANGLE_FINISHED: milling.rectangle_finished,
    G.CIRCULAR_POCKET: milling.circle,
    G.CIRCULAR_POCKET_FINISHED: milling.circle_finished,
    G.DRILLING: drilling.drilling,
    G.DEEP_HOLE: drilling.deep_hole,
    G.TAPPING: drilling.tapping,
    G.BORING: drilling.boring,
    G.RAY: pattern.ray,
    G.PERIMETER: pattern.perimeter,
    G.GRID: pattern.grid,
    G.CIRCLE_OF_PLACES: pattern.circle,
}
