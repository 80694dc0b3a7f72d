"""One supply for all stages: its capacitor, what acceleration takes from it and braking returns (drives/12).

    mains --|>|--[R_s]--+----------+-------------+
       U0               |          |             |          C dU/dt = max(0, (U0 - U) / R_s) - P / U - chopper
                       === C    [R_c] chopper  stages
                        |          |             |          P = sum of T w + R i^2 + d(L i^2 / 2)/dt + what stages
    -------------------+----------+-------------+              use for themselves while on

T w is the work of the currents on the rotors, exactly the energy that the rotors gain in a sub-step; R i^2 the loss in
windings and stage. A braking motor makes P negative: the rectifier blocks, and what is not lost charges the capacitor.
The chopper switches so fast that it is a clamp: above its voltage it takes the excess, at most U^2 / R_c. Below
`undervoltage_v` the stages open their phases (the energy of their inductances flows back) until U is above `release_v`
again: meanwhile motors do not hold, and steps are lost.

P is summed over a window of MuJoCo and U follows once a window, with P / U constant in it:

    charging, U < U0     U' = U_e + (U - U_e) exp(-h / R_s C)      U_e = U0 - R_s P / U
    blocked              U'^2 = U^2 - 2 h P / C

so U is a window (0.5 ms) late. For this to be small, a capacitor is refused if the greatest power of the stages could
change its voltage by more than LARGEST_CHANGE in a window. The law runs in isel_twin.plant.feed.

The stages see drive_v = supply_factor U and return_v = U. The factor stands for the stage's own drops, though its
fitted value holds the sag of the makers' benches, too (decision drives/1); switching losses are in the quiescent loss.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from isel_twin.base.parameters import check, flag, number
from isel_twin.drives.stage import AnyStage

LARGEST_CHANGE = 0.05  # of the voltage in a window at the greatest power of all stages; real moves are far below it


@dataclass(frozen=True)
class Supply:
    """The common supply of the stages. Raises ValueError for impossible values."""

    enabled: bool = flag()  # off: every stage has a stiff supply of its own
    capacitance_f: float = number("uF", 100.0, 1e6, key="capacitance", scale=1e-6)
    source_ohm: float = number("ohm", 0.01, 100.0, key="source_resistance")  # transformer, rectifier and mains as one
    chopper_v: float = number("V", 5.0, 400.0, key="chopper_voltage")  # where the brake resistor begins to conduct
    chopper_ohm: float = number("ohm", 0.1, 1e6, key="chopper_resistance")
    undervoltage_v: float = number("V", 0.0, 200.0, key="undervoltage")  # below it the stages switch off
    release_v: float = number("V", 0.0, 200.0, key="release")  # above it they switch on again

    def __post_init__(self) -> None:
        check(self)
        if self.undervoltage_v > self.release_v:
            raise ValueError(f"supply: release must not lie below undervoltage, {self.undervoltage_v:g} V")


def check_fit(supply: Supply, stages: Sequence[AnyStage], window_s: float) -> None:
    """Raise ValueError, one line, for a supply that does not fit its stages, or is too small for the window."""
    volts = sorted({stage.supply_v for stage in stages})
    if len(volts) > 1:
        raise ValueError(f"stages of {' and '.join(f'{v:g}' for v in volts)} V; allowed: the same supply on all axes")
    if not supply.release_v < volts[0] < supply.chopper_v:
        raise ValueError(
            f"release {supply.release_v:g} V, chopper_voltage {supply.chopper_v:g} V; "
            f"allowed: release below the stages' {volts[0]:g} V, chopper_voltage above"
        )
    largest_w = sum(math.sqrt(2.0) * stage.supply_v * stage.current_a for stage in stages)
    least_f = largest_w * window_s / (LARGEST_CHANGE * volts[0] ** 2)
    if supply.capacitance_f < least_f:
        raise ValueError(
            f"capacitance {supply.capacitance_f * 1e6:g} uF; allowed: from {math.ceil(least_f * 1e6)} uF, or the "
            f"voltage could change by more than {LARGEST_CHANGE:.0%} in a step of {window_s * 1e3:g} ms"
        )
