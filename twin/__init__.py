"""isel-twin: a digital twin of an isel gantry, from serial byte to moving carriage.

The signal chain, in the order of the folders:

    firmware/   host bytes in, step stream out (one folder a controller)
    motion/     what a step stream is: time law, path, run, record
    drives/     steps to torque: power stage, motor, screw, nut
    plant/      torque to motion: MuJoCo, or a carriage that follows the counter
    wiring/     motion back to input levels: switches, hood, E-stop, faults, scenarios
    trace/      what happened, as VCD, npz or Parquet
    twin.py     the clock that ties them together

What tools share: call.py (from the words of a caller to a twin), snapshot.py (what there is to see), verdict.py (was
the job well done?). cli/ is the command `isel-twin`. The borders between all of these are in docs/architecture.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import serial

from isel_twin.version import VERSION

if TYPE_CHECKING:
    from isel_twin.twin import Twin

__all__ = ["Twin"]
__version__ = VERSION

# serial.serial_for_url("twin://...") finds our handler once this package is imported.
if "isel_twin.bridge" not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append("isel_twin.bridge")


def __getattr__(name: str) -> Any:
    """Import `Twin` (and with it MuJoCo and numba) only when somebody asks for it."""
    if name == "Twin":
        from isel_twin.twin import Twin

        return Twin
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
