"""The overrides 1 to 8 (manual 8.6, P11310 on), factors of speeds by potentiometers.

    P11311   0 .. 255, from the panel; a write sets P11310
    P11314   q of a table, its count first, then its values in %: 0 .. 255 is divided evenly among them
             0 or deleted: P11311 acts continuously, 255 is 120 %
    P11310   % in force, held between P11312 and P11313

The same, 5 parameters further each, of overrides 2 to 8. P11370 is the table as delivered: 27 values from 0 to 120 %.
P12125 of an axis gives the override of its paths; of several the lowest counts, as a path has one speed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import Parameters

COUNT: Final = 8
SIZE: Final = 5  # parameters of an override: value, raw value, lowest, highest, table
VALUE, RAW, LOWEST_OFFSET, HIGHEST_OFFSET, TABLE = range(SIZE)
HIGHEST: Final = 120.0  # highest % of a potentiometer (3.7)
FULL: Final = 255  # its highest value

# parameters P of a new control: overrides 5 to 8, which are fixed, and the table
FACTORY_OVERRIDES: Final[Mapping[int, float]] = {
    **{P.OVERRIDE_5: 0.0, P.OVERRIDE_6: 10.0, P.OVERRIDE_7: 50.0, P.OVERRIDE_8: 100.0},
    P.OVERRIDE_TABLE: 27.0,
    **dict(enumerate((0.0, 1.0, 2.0, *(5.0 * n for n in range(1, 25))), start=P.OVERRIDE_TABLE + 1)),
}


def is_override(number: int) -> bool:
    return P.OVERRIDE <= number < P.OVERRIDE + COUNT * SIZE


def written(parameters: Parameters, number: int) -> None:
    """Take a written parameter of an override: update P11310 by P11311 and its limits."""
    if not is_override(number):
        return
    first = number - (number - P.OVERRIDE) % SIZE
    if number - first == RAW and parameters.loaded(number):
        parameters.write(first, _from_raw(parameters, first, parameters.get(number)))
    if parameters.loaded(first):
        parameters.write(first, _limited(parameters, first, parameters.get(first)))


def factor(parameters: Parameters, axes: int) -> float:
    """The present factor of all path speeds: 1 is 100 %, also the default of an unset override."""
    return min(percent(parameters, int(parameters.axis(axis, Axis.OVERRIDE, 1.0))) for axis in range(axes)) / 100.0


def percent(parameters: Parameters, override: int) -> float:
    """Of an override 1 to 8, others are 1; 100 unless set."""
    first = P.OVERRIDE + SIZE * (override - 1 if 1 <= override <= COUNT else 0)
    return _limited(parameters, first, parameters.get(first, 100.0))


def _limited(parameters: Parameters, first: int, percent: float) -> float:
    """Limited to the range of the override; the highest value wins if the limits cross."""
    lowest = max(parameters.get(first + LOWEST_OFFSET), 0.0)
    highest = min(max(parameters.get(first + HIGHEST_OFFSET, HIGHEST), 0.0), HIGHEST)
    return min(max(percent, lowest), highest)


def _from_raw(parameters: Parameters, first: int, raw: float) -> float:
    """% for a raw value: from the table of the override, or linear if there is none or an empty one."""
    share = min(max(raw, 0.0), float(FULL))
    table = int(min(max(parameters.get(first + TABLE), 0.0), 1e9))
    try:
        count = int(min(parameters.get(table, 0.0, "q"), 1e3)) if table else 0
        if count > 0:
            return parameters.get(table + 1 + int(share * count / (FULL + 1)), HIGHEST, "q")
    except ProgramError:
        pass
    return HIGHEST * share / FULL
