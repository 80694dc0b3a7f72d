"""The place of another control: its set points, row by row, move the drives, and each row is answered.

    controller.py   queue, rows, outputs and answers: implements isel_twin.controller.Controller
    protocol.py     lines and answers
    language.py     the lines in words, for logs and job files

docs/connections.md has the protocol for people, docs/decisions/external.md what was decided.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.parameters import Limits
from isel_twin.controller import takes
from isel_twin.firmware.external.controller import WATCHDOG_MS, External
from isel_twin.firmware.external.protocol import FORMS

__all__ = ["External", "create"]

AXES = 1, len(AXIS_NAMES)
LONGEST_MS = 3_600_000


@takes(
    {
        "axes": Limits("", *AXES, whole=True),
        "set_points": FORMS,
        "watchdog_ms": Limits("ms", 0, LONGEST_MS, whole=True),
    }
)
def create(name: str, *, flash: bytes | None, settings: Mapping[str, Any]) -> External:
    """Entry point of `isel_twin.controllers`. There is no flash image. Raises ValueError for a wrong setting.

    axes          numbers in a row, 1 .. 8 (3)
    set_points    steps (default): spread evenly over the row; led: the command moves evenly, as for servo drives
    watchdog_ms   silence after which outputs go off, 0: never (1000)
    """
    axes = _whole(name, settings, "axes", 3, AXES)
    watchdog_ms = _whole(name, settings, "watchdog_ms", WATCHDOG_MS, (0, LONGEST_MS))
    form = settings.get("set_points", FORMS[0])
    if form not in FORMS:
        raise ValueError(f"{name}: set_points is {form!r}; allowed: {', '.join(FORMS)}")
    return External(axes, form, watchdog_ms)


def _whole(name: str, settings: Mapping[str, Any], key: str, default: int, limits: tuple[int, int]) -> int:
    value = settings.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not limits[0] <= value <= limits[1]:
        raise ValueError(f"{name}: {key} is {value!r}; allowed: a whole number from {limits[0]} to {limits[1]}")
    return value
