"""Length of paths, for the life of tools (manual 8.5: P8870, P8871)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.curves import Bent
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Straight
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.realtime.axes import AXES

CHORDS: Final = 1024  # of a curve; a full circle is too short by 2e-6 of its length


def add_length(parameters: Parameters, block: PathBlock) -> None:
    """Add a block whose path has been made to P8871, in mm: in the axes whose bits P8870 has."""
    mask = int(parameters.get(P.LENGTH_AXES))
    axes = [axis for axis in range(AXES) if mask >> axis & 1]
    if axes and block.elements:
        way = sum(_length_mm(element, axes) for element in block.elements)
        parameters.write(P.LENGTH, parameters.get(P.LENGTH) + way)


def _length_mm(element: Element | Bent, axes: list[int]) -> float:
    """Length of an element as its projection on some axes."""
    if isinstance(element, Straight):
        return math.hypot(*(element.end[axis] - element.start[axis] for axis in axes))
    shares = np.linspace(0.0, 1.0, CHORDS + 1)
    points = [element.point(share) for share in shares] if isinstance(element, Arc) else element.points(shares)
    return sum(math.hypot(*(there[axis] - here[axis] for axis in axes)) for here, there in pairwise(points))
