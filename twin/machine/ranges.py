"""The allowed range of a number of a machine file, by its key: what a search may try (many/28).

The range stands at the field that holds the number (schema.py); here it is only found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

from isel_twin.base.parameters import Limits, limits_of
from isel_twin.controller import controller_settings
from isel_twin.drives.motor import Motor, Specimen
from isel_twin.drives.screw import Rod, Screw
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.spindle import Spindle
from isel_twin.drives.stage import Stage
from isel_twin.drives.supply import Supply
from isel_twin.machine.build import MASS_KG, PAYLOAD_KG, STEPS_PER_REV, STRIBECK_MM_S
from isel_twin.machine.schema import Axis, Contact, Feeler, Guides, Holder, Mode, Probe, Squareness, Timing

ANY = Limits("", -math.inf, math.inf)
# classes whose fields are the keys of a section, of its tables by name, and of the tables inside an axis
_FIELDS: Mapping[str, tuple[Any, ...]] = {
    "timing": (Timing,),
    "squareness": (Squareness,),
    "supply": (Supply,),
    "spindle": (Spindle,),
    "holder": (Holder,),
    "probe": (Probe,),
    "plate": (Feeler,),
    "guides": (Guides,),
    "switches": (Contact,),
}
_NAMED: Mapping[str, tuple[Any, ...]] = {
    "axes": (Axis, Screw, Rod),
    "structure": (Mode,),
    "contacts": (Contact,),
    "motors": (Motor,),
}
_INSIDE: Mapping[str, tuple[Any, ...]] = {
    "stage": (Stage,),
    "specimen": (Specimen,),
    "servo": (ServoMotor, ServoDrive),
}
_ALONE: Mapping[str, Limits] = {
    "masses": MASS_KG,
    "payload": PAYLOAD_KG,
    "steps_per_rev": STEPS_PER_REV,
    "stribeck_speed": STRIBECK_MM_S,
}


@cache
def limits(key: str) -> Limits:
    """The range of a number, in its unit of the file; everything of a key that is no number of a machine file. Key: as
    in `describe`."""
    section, *names = key.split(".")
    if section == "controller" and names:
        found = controller_settings(names).get(names[0])
        return found if isinstance(found, Limits) else ANY
    if section in _ALONE:
        return _ALONE[section]
    if names and names[-1] in _ALONE:
        return _ALONE[names[-1]]
    if section in _NAMED:
        own = _INSIDE.get(names[1], ()) if len(names) == 3 else _NAMED[section]
    else:
        own = _FIELDS.get(section, ())
    return next((found for cls in own if (found := limits_of(cls, names[-1])) is not None), ANY)


def held(key: str, value: float) -> float:
    """The value, or the end of the range of this number that is nearest to it."""
    allowed = limits(key)
    return min(max(value, allowed.low), allowed.high)
