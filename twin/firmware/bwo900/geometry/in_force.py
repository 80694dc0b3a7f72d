"""Modal state of a block, for status parameters (manual 8.5, P8900 to P9131).

    analysis ---- PathBlock with InForce ----> real time ---> status.py: P8912, P8934, P8945 ...
    is some 400 blocks ahead                   is here

Successive blocks share one while nothing changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from isel_twin.firmware.bwo900.geometry.elements import XY
from isel_twin.firmware.bwo900.geometry.frames import Frame
from isel_twin.firmware.bwo900.geometry.groups import START, Modal

NO_FRAME: Final = Frame(3, XY, (0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0), zero=(0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True)
class InForce:
    """Modal state of a block. Places are program and number of a block."""

    modal: Modal = START  # G functions
    frame: Frame = NO_FRAME  # zero point, G92, tool length, plane
    feed_mm_min: float = 0.0  # F; 0: there has been none yet
    depth: int = 0  # subprograms that are open
    caller: tuple[str, int] = ("", 0)  # where the last one was called
    cycle: int | None = None  # number of the cycle that the block belongs to
    called_by: tuple[str, int] | None = None  # where a cycle of the user was called by a program
    loop: tuple[int, int] = (0, 0)  # of the innermost one: passes, and the present one


AT_REST = InForce()  # without a program
