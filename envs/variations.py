"""Changes of the machine by options of `TrackPath.reset`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.parameters import changed
from isel_twin.drives.stage import Stage
from isel_twin.machine import Axis, Machine

VARIATIONS: dict[str, tuple[float, float]] = {  # bounds of a mass, and of factors
    "payload_kg": (0.0, 20.0),
    "friction": (0.1, 10.0),
    "stiffness": (0.2, 1.2),
    "supply": (0.5, 1.5),
    "backlash": (0.0, 10.0),
}
_FACTORS = tuple(VARIATIONS)[1:]
_SPAN = 0.05  # of the supply, between factors at which limits are found


def checked(options: dict[str, Any]) -> dict[str, Any]:
    """The options, numbers as float. Raises ValueError for a name that does not exist and for a number out of range."""
    unknown = sorted(options.keys() - {*VARIATIONS, "path"})
    if unknown:
        raise ValueError(f"unknown options {unknown}; there are: {', '.join((*VARIATIONS, 'path'))}")
    found = dict(options)
    for name, (low, high) in VARIATIONS.items():
        if name in found:
            value = found[name]
            number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
            if not number or not low <= value <= high:
                raise ValueError(f"option {name} is {value!r}; allowed: {low:g} to {high:g}")
            found[name] = float(value)
    return found


def varied(machine: Machine, options: Mapping[str, Any]) -> Machine:
    """The machine with these options; its `tree` stays. Raises ValueError for a number out of range."""
    friction, stiffness, supply, backlash = (options.get(name, 1.0) for name in _FACTORS)
    payload_kg = options.get("payload_kg", machine.payload_kg)
    axes, modes = list(machine.axes), machine.structure
    try:
        for i, axis in enumerate(machine.axes):
            screw, stage = axis.screw, axis.stage
            if not friction == stiffness == backlash == 1.0:
                screw = changed(
                    screw,
                    coulomb_nm=screw.coulomb_nm * friction,
                    stiffness_n_per_m=screw.stiffness_n_per_m * stiffness,
                    backlash_mm=screw.backlash_mm * backlash,
                )
            if supply != 1.0:
                stage = changed(stage, supply_v=stage.supply_v * supply)
            if screw is not axis.screw or stage is not axis.stage:
                axes[i] = changed(axis, guide_friction_n=axis.guide_friction_n * friction, stage=stage, screw=screw)
        if stiffness != 1.0:
            modes = tuple(changed(mode, stiffness_n_per_m=mode.stiffness_n_per_m * stiffness) for mode in modes)
    except ValueError as error:
        raise ValueError(f"the machine does not take these options: {error}") from None
    return changed(machine, axes=tuple(axes), structure=modes, payload_kg=payload_kg)


def limits_rad_s(machine: Machine, supply: float) -> NDArray[np.float64]:
    """float64 [axes], speed from which on each stepper motor swings with this factor on the supply of its stage; linear
    between factors that are _SPAN apart, as that is nearly how it grows, and each takes 40 ms to be found."""
    below = math.floor(supply / _SPAN + 1e-9)
    share = max(0.0, supply / _SPAN - below)
    found = []
    for axis in machine.axes:
        low = _limit(axis, below)
        found.append(low if share < 1e-9 else (1.0 - share) * low + share * _limit(axis, below + 1))
    return np.array(found)


@lru_cache(256)
def _limit(axis: Axis, number: int) -> float:
    assert isinstance(axis.stage, Stage)
    stage = replace(axis.stage, supply_v=axis.stage.supply_v * round(number * _SPAN, 2))
    return replace(axis, stage=stage).swing_limit_rad_s
