"""Rules as the commands M, B and W change them one after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isel_twin.firmware.gmi99 import planner
from isel_twin.firmware.gmi99.planner import AXES

WITHOUT_INFLUENCE = 65536
"""Added to a resolution ratio by W: the axis does not count for the tool speed."""


@dataclass(frozen=True)
class Rules(planner.Rules):
    """slot None: of the leading axis and with it of all slots."""

    def with_speed(self, hz: int, slot: int | None = None) -> Rules:
        """After M."""
        return replace(self, speed_hz=_put(self.speed_hz, hz, slot))

    def with_acceleration(self, hz_per_ms: int, slot: int | None = None) -> Rules:
        """After B."""
        return replace(self, acceleration_hz_per_ms=_put(self.acceleration_hz_per_ms, hz_per_ms, slot))

    def with_ratio(self, p2: int, slot: int) -> Rules:
        """After W with P3 = slot + 1: p2 = 1..65535, or that + 65536 for an axis without influence."""
        without, ratio = divmod(p2, WITHOUT_INFLUENCE)
        ratios, influence = list(self.ratio), list(self.influence)
        ratios[slot], influence[slot] = ratio, not without
        return replace(self, ratio=tuple(ratios), influence=tuple(influence))


def _put(values: tuple[int, ...], value: int, slot: int | None) -> tuple[int, ...]:
    if slot is None:
        return (value,) * (AXES + 1)
    return (*values[: slot + 1], value, *values[slot + 2 :])
