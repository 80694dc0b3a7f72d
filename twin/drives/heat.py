"""Heat of power stages: one thermal mass each (drives/8), warmed by its losses, cooled through its heat sink.

    tau dT/dt = T_ambient + R_th P - T          P = P_idle + R I^2 f^2,  f: phase current over nominal

Phase currents are sine and cosine, so their losses add up to R I^2 whatever the microstep. A stage that reaches its
limit opens the over-temperature contact, and closes it again when it has cooled by HYSTERESIS_K.

Currents are sampled once a second of virtual time from power-on: often enough for a time constant of minutes, and
independent of the calls of `advance`. Stages that cannot reach their limit at full current are left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from isel_twin.drives.stage import AnyStage

GRID_NS = 1_000_000_000
HYSTERESIS_K = 10.0


def steady_c(stage: AnyStage, current_fraction: float) -> float:
    """Final temperature of a stage at a fraction of its nominal current (0: off)."""
    if current_fraction == 0.0:
        return stage.ambient_c
    return stage.ambient_c + stage.thermal_resistance_k_per_w * stage.loss_w(current_fraction)


def later_c(stage: AnyStage, temperature_c: float, current_fraction: float, seconds: float) -> float:
    """Temperature after some time at a constant fraction of nominal current: the exact solution."""
    end_c = steady_c(stage, current_fraction)
    return end_c + (temperature_c - end_c) * math.exp(-seconds / stage.thermal_time_constant_s)


class StageHeat:
    """Temperatures of a machine's stages, and whether one of them is too hot; all start at ambient temperature."""

    def __init__(self, stages: Sequence[AnyStage]) -> None:
        self._stages = tuple(stages)
        self.temperature_c = [stage.ambient_c for stage in stages]  # without what `warm` adds
        self.extra_k = [0.0 for _ in stages]
        self.hot = False
        matters = any(steady_c(stage, 1.0) >= stage.thermal_limit_c for stage in stages)
        self.next_ns: int | None = GRID_NS if matters else None  # next `advance`; None: they cannot overheat

    def warm(self, number: int, extra_k: float, t_ns: int) -> None:
        """From t_ns on a stage is this much warmer than by its losses: a blocked fan, a loose heat sink."""
        if number >= len(self._stages):
            return
        self.extra_k[number] = extra_k
        if self.next_ns is None:
            self.next_ns = (t_ns // GRID_NS + 1) * GRID_NS
        self._judge()

    def advance(self, current_fractions: Sequence[float]) -> None:
        """Advance by one interval of the grid; currents as a fraction of nominal (0: off) for each stage."""
        if self.next_ns is None:
            return
        self.next_ns += GRID_NS
        for number, (stage, fraction) in enumerate(zip(self._stages, current_fractions, strict=True)):
            self.temperature_c[number] = later_c(stage, self.temperature_c[number], fraction, GRID_NS * 1e-9)
        self._judge()

    def _judge(self) -> None:
        below_c = HYSTERESIS_K if self.hot else 0.0
        self.hot = any(
            temperature + extra_k >= stage.thermal_limit_c - below_c
            for stage, temperature, extra_k in zip(self._stages, self.temperature_c, self.extra_k, strict=True)
        )
