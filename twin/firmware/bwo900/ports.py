"""The terminals of the contacts of machine and cabinet, and the form of bytes on the line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from isel_twin.controller import SerialFormat
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters

TERMINALS: Final[Mapping[str, tuple[str, ...]]] = {
    "estop": ("estop_1", "estop_2", "overtemperature"),
    "power": ("power_ok",),
    "e0.1": ("start",),
    "e0.2": ("stop",),
    "e0.3": ("hood_automatic",),
    "e0.4": ("hood_setup",),
    "e0.5": ("key",),
    "e0.6": ("probe",),
    "e0.7": ("spindle",),
    **{f"limit_{axis}{end}": (f"limit_{axis}{end}",) for axis in "xyz" for end in (1, 2)},
}


def serial_format(p: Parameters) -> SerialFormat:
    """P11172 on: speed, data bits, parity (none, odd, even), stop bits."""
    return SerialFormat(
        int(p.given(P.BAUD, 9600.0)),
        int(p.given(P.DATA_BITS, 8.0)),
        ("N", "O", "E")[min(max(int(p.get(P.PARITY)), 0), 2)],
        int(p.given(P.STOP_BITS, 2.0)),
    )
