"""The cycles by their G numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from isel_twin.firmware.bwo900.analysis.cycles import drilling, milling, pattern
from isel_twin.firmware.bwo900.analysis.cycles.call import Call, Move

CYCLES: Final[Mapping[int, Callable[[Call], Iterator[Move]]]] = {
    71: milling.rectangle,
    72: milling.rectangle_zigzag,
    73: milling.rectangle_finished,
    74: milling.circle,
    75: milling.circle_finished,
    81: drilling.drilling,
    83: drilling.deep_hole,
    84: drilling.tapping,
    85: drilling.boring,
    86: pattern.ray,
    87: pattern.perimeter,
    88: pattern.grid,
    89: pattern.circle,
}
