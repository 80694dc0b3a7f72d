"""isel-twin: a digital twin of an isel gantry, from serial byte to moving carriage.

The signal chain, in the order of the folders:

    firmware/   host bytes in, motion out (one folder a controller); controller.py and language.py are its borders
    motion/     what a motion is: time law, path, steps and set points, the record
    drives/     steps to torque: power stage, motor, screw, nut
    plant/      torque to motion of the machine: MuJoCo, or a carriage that follows its command
    wiring/     motion back to input levels: switches, hood, E-stop, faults, scenarios
    trace/      what happened, as VCD, npz or Parquet
    twin.py     the clock that ties them together; position.py: counters, rotors and carriages

Around it: machine.py (the numbers of a machine, read by parameters.py), call.py (a twin from a call), job.py and
verdict.py (a file of commands, and what became of it), testing.py (controllers on a desk), cli/ (the command).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import serial

from isel_twin.version import VERSION

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

__all__ = ["Twin"]
__version__ = VERSION

# serial.serial_for_url("twin://...") finds our handler once this package is imported.
if "isel_twin.bridge.virtual" not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append("isel_twin.bridge.virtual")


def __getattr__(name: str) -> Any:
    """Import `Twin` (and with it MuJoCo and numba) only when somebody asks for it."""
    if name == "Twin":
        from isel_twin.core.twin import Twin

        return Twin
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
