"""Limit switches: which are struck, in which direction they are, and when one is newly struck.

Switch 1 is in the negative direction of the counter, switch 2 in the positive one; `@0Ie` exchanges them for an axis. A
switch struck by a motion is in the direction of that motion until the next `@0Ie`: so even an axis inverted by `@0ID`
without exchanged switches can leave them (imc/20).

    level   ______|~|_|~~~~~~~~~~~~~~~|_|~|_______      active high, for the picture
    struck        ^ newly struck: at once
    released                          ^   ^ ^ chatter shorter than debounce after a release strikes nothing (imc/19)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.firmware.imc.ports import LIMIT_PORT, Inputs
from isel_twin.firmware.imc.settings import Settings


class LimitSwitches:
    """The eight limit switches; bit 2 * axis is switch 1, bit 2 * axis + 1 switch 2, as on port 3."""

    def __init__(self, inputs: Inputs, settings: Callable[[], Settings], debounce_ns: int) -> None:
        self._inputs = inputs
        self._settings = settings
        self._debounce_ns = debounce_ns
        self._released_ns: dict[int, int] = {}
        self._found: dict[int, int] = {}

    def active(self, bit: int) -> bool:
        """True if it is enabled (`@0IE`) and at its active level."""
        return bool(self.all_active() >> bit & 1)

    def all_active(self) -> int:
        """The same of all switches, one bit a switch."""
        enabled, low_active = _wanted(self._settings().limit_switches)
        return enabled & (self._inputs.port(LIMIT_PORT) ^ low_active)

    def struck(self, axis: int) -> list[int]:
        """Switches of an axis that are active now."""
        return [bit for bit in switches_of(axis) if self.active(bit)]

    def edge(self, bit: int, now_ns: int) -> bool:
        """Take a change of a switch; return True if it is newly struck."""
        if not self.active(bit):
            self._released_ns[bit] = now_ns
            return False
        released_ns = self._released_ns.get(bit)
        return released_ns is None or now_ns - released_ns > self._debounce_ns

    def found(self, bit: int, motor_direction: int) -> None:
        """Note that a motor motion in this direction (+1, -1) has struck the switch."""
        if motor_direction:
            self._found[bit] = motor_direction

    def forget_found(self, axes: int) -> None:
        """Forget what motions have found on these axes (mask)."""
        self._found = {bit: direction for bit, direction in self._found.items() if not axes >> axis_of(bit) & 1}

    def lies(self, bit: int) -> int:
        """Counter direction (+1, -1) of a switch."""
        axis, switch = divmod(bit, 2)
        settings = self._settings()
        if bit in self._found:
            return -self._found[bit] if settings.inverted >> axis & 1 else self._found[bit]
        return 1 if switch ^ (settings.swapped >> axis & 1) else -1

    def blocks(self, axis: int, direction: int) -> bool:
        """True if the axis would move towards a struck switch."""
        return any(self.lies(bit) == direction for bit in self.struck(axis))


@cache
def _wanted(setting: int) -> tuple[int, int]:
    """Which switches `@0IE` enables, and which of all are low-active, one bit a switch: it has two of each an axis."""
    pairs = [setting >> 2 * n & 3 for n in range(8)]  # enabled, low-active of X; of Y; ...
    enabled, low_active = (sum(pair << 2 * axis for axis, pair in enumerate(pairs[n::2])) for n in (0, 1))
    return enabled, low_active


def switches_of(axis: int) -> tuple[int, int]:
    return 2 * axis, 2 * axis + 1


def name_of(bit: int) -> str:
    """Contact of the switch, as machine files call it."""
    return f"limit_{AXIS_NAMES[axis_of(bit)]}{1 + bit % 2}"


def axis_of(bit: int) -> int:
    return bit // 2
