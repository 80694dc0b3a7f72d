"""The working spindle of a machine that has one: its contactor and command, the load of a cut, and what is shown.

    contactor (cabinet), outputs analog, spindle_speed ---> converter and rotor (drives/spindle.py) ---> speed
    feed of the carriages, cut (plant/cutting.py) --------> load                            speed ---> teeth of the cut

Load and shown speed are renewed every LOOK_NS while the speed changes or a cut is on; speed and angle themselves are
known at every nanosecond.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.drives.spindle import Spindle, Turning, turning
from isel_twin.plant import Cut, Plant, cutting_torque_nm

LOOK_NS: Final = 5 * MILLISECOND_NS
OUTPUTS: Final = ("spindle_rev_min",)  # shown beside the relays
SLOWEST_REV_MIN: Final = 60.0  # at which the teeth of a cut turn, as events may have them


class RunningSpindle:
    """The spindle, from power-on."""

    def __init__(self, spindle: Spindle) -> None:
        self.turning = Turning()
        self.cut: Cut | None = None
        self._spindle = spindle
        self._given: tuple[bool, float, float] = False, 0.0, 0.0  # contactor, command, load now in force
        self._looked_ns = 0
        self._shown = 0
        self._teeth = math.nan  # speed that the plant's cut has now

    @property
    def next_ns(self) -> int | None:
        """When `follow` is due by itself."""
        end_ns = self.turning.end_ns
        if end_ns <= self._looked_ns and self.cut is None:
            return None
        look_ns = (self._looked_ns // LOOK_NS + 1) * LOOK_NS
        return min(look_ns, end_ns) if end_ns > self._looked_ns else look_ns

    def follow(self, t_ns: int, outputs: Mapping[str, int], live: bool, plant: Plant) -> bool:
        """Take contactor, outputs and load of the present; return whether what is shown has changed."""
        wanted = self._spindle.wanted_rev_min(outputs.get("analog", 0), outputs.get("spindle_speed"))
        due = t_ns >= (self._looked_ns // LOOK_NS + 1) * LOOK_NS or t_ns >= self.turning.end_ns
        given = live, wanted, self._load_nm(t_ns, plant) if due else self._given[2]
        if given != self._given or t_ns >= self.turning.end_ns > self._looked_ns:
            self._given = given
            self.turning = turning(self._spindle, self.turning, t_ns, wanted, given[2], live=live)
        self._looked_ns = t_ns
        now = self.turning.speed_rev_min(t_ns)
        if self.cut is not None and now != self._teeth:
            self._teeth = now
            plant.turn_cut(max(abs(now), SLOWEST_REV_MIN))
        before = self._shown
        if due:
            self._shown = round(now)
        return self._shown != before

    def begin_cut(self, cut: Cut | None) -> None:
        """A cut begins, or ends (None)."""
        self.cut, self._teeth = cut, math.nan

    @property
    def outputs(self) -> Mapping[str, int]:
        return {"spindle_rev_min": self._shown}

    def _load_nm(self, t_ns: int, plant: Plant) -> float:
        if self.cut is None:
            return 0.0
        x, y, _ = plant.velocity_mm_s.tolist()
        turns = max(abs(self.turning.speed_rev_min(t_ns)), SLOWEST_REV_MIN)
        return cutting_torque_nm(self.cut, math.hypot(x, y), turns)
