"""iMC desks in the states the tests begin with."""

from __future__ import annotations

from typing import Any

from isel_twin.testing import Desk, Ticks

MIDDLE = (60_000, 48_000, 22_000, 50_000)
"""Carriages far from all switches, steps from the motor end."""

TRAVEL = (126_400, 96_000, 44_800, 100_000)
"""Trip points of the switches at the far end, where those of the motor end trip at 0."""

XYZA = 15
"""Not a number of the manual: the desk says `@07`, then `@08`."""


CONTROLLERS = ("imc-s8", "imc-m", "imc-mp")
"""The manual is for all three; the tests drive the first one where they do not say otherwise."""


def fresh(controller: str = CONTROLLERS[0], **options: Any) -> Desk:
    """Just switched on; carriages 2000 steps from the motor end."""
    return Desk.of(controller, **options)


def initialised(axes: int = 7, **options: Any) -> Desk:
    """Axes set, not referenced."""
    desk = fresh(**options)
    for number in (7, 8) if axes == XYZA else (axes,):
        assert desk.query(f"@0{number}") == "0"
    return desk


def ready(axes: int = 7, **options: Any) -> Desk:
    """Axes set and taken as referenced in the middle of their travel, where every counter is 0."""
    desk = initialised(axes, **{"carriage": MIDDLE, **options})
    for number in (7, 8) if axes == XYZA else (axes,):
        assert desk.query(f"@0N{number}") == "0"
    return desk


def made(desk: Desk, command: str, reply: str = "0") -> Ticks:
    """The ticks of one command, which must answer `reply`."""
    mark = desk.ticks
    assert desk.query(command) == reply, command
    return desk.steps_since(mark)


def program(desk: Desk, *lines: str) -> None:
    """Erase, store these lines, each acknowledged, and close the data field."""
    for text in ("@0k", "@0i", *lines, "9"):
        assert desk.query(text) == "0", text


def stored(*lines: str, axes: int = 7, **options: Any) -> Desk:
    """A ready desk with this program in its flash."""
    desk = ready(axes, **options)
    program(desk, *lines)
    return desk
