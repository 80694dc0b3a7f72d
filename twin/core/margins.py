"""Least pull-out margins for several independent readers.

The plant keeps the least margins since they were last taken, once. What one reader takes is handed to all of them:

    plant --- take ---> [least of reader 1]   [least of reader 2]   ...
"""

from __future__ import annotations

from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from isel_twin.plant import Plant


class MarginReaders:
    """All readers of one twin, by weak references."""

    def __init__(self) -> None:
        self._readers: WeakSet[MarginReader] = WeakSet()

    def reader(self, plant: Plant) -> MarginReader:
        """A new reader, which begins now."""
        self.collect(plant)
        new = MarginReader(self, plant)
        self._readers.add(new)
        return new

    def collect(self, plant: Plant) -> None:
        """Pass the plant's margins to every reader."""
        taken = plant.take_margin()
        for reader in self._readers:
            reader.least = np.minimum(reader.least, taken)


class MarginReader:
    """One reader, from `Twin.margin_reader`."""

    def __init__(self, readers: MarginReaders, plant: Plant) -> None:
        self._readers, self._plant = readers, plant
        self.least = np.ones(len(plant.margin))

    def take(self) -> NDArray[np.float64]:
        """float64 [axes], least margins since the last call, or since the beginning; as `Twin.margin`."""
        self._readers.collect(self._plant)
        taken, self.least = self.least, np.ones(len(self.least))
        return taken
