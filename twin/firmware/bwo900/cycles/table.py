"""The cycles by their G numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from isel_twin.firmware.bwo900.cycles.call import Call, Move

__all__ = ["CYCLES"]

CYCLES: Final[Mapping[int, Callable[[Call], Iterator[Move]]]] = {}
