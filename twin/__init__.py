"""isel-twin: a digital twin of an isel gantry, from serial byte to moving carriage.

The rooms, in the order of the data:

    base/        what every room uses: units, axes, errors, values read from files, files with one owner
    native/      the compiled core: a small C library; its C stands in the rooms, beside the Python that calls it
    controller/  the border between a firmware and everything around it: bytes, levels, time, motion
    cam/         job files of CAM programs: NCP, G-code and HPGL, read into toolpaths; what is common to writing them
    language/    the other border: what the bytes mean to people and tools

    firmware/    host bytes in, motion out: one folder a controller
    motion/      what a motion is: time law, path, steps and set points, the record
    drives/      steps to torque: power stage, motor, screw, nut; servo drives
    machine/     the numbers of a machine; the machines themselves are in models/
    plant/       torque to motion of the machine: MuJoCo, or a carriage that follows its command
    wiring/      motion back to input levels: switches, hood, E-stop, faults, scenarios

    core/        the twin: one virtual clock for all of these, what is seen of it, and how it is built and saved
    testing/     a desk with ideal carriages, for tests of a controller alone
    jobs/        job files: read, played, judged, checked
    capture/     step signals captured at a real controller, which drive the machine
    recordings/  what happened, in files: MCAP, VCD, npz, Parquet; read, replayed and compared
    report/      what people look at: pages, charts, pictures
    many/        many twins: sweeps, tuning, identification
    cli/         the command `isel-twin`

Beside this folder, in the same package: bridge/ (where hosts connect, in real and in virtual time), envs/ (environments
for learning), models/ (the machines).
"""

from __future__ import annotations

if __name__ != "isel_twin":
    raise ImportError(f"import isel_twin, not {__name__}: the folder twin/ of the repository is that package")

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
    """Import `Twin` (and with it MuJoCo) only when somebody asks for it."""
    if name == "Twin":
        from isel_twin.core.twin import Twin

        return Twin
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
