"""`isel-twin fmu`: a twin as a file for simulation tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli.options import check_writable, written


def fmu(
    out: Annotated[Path, written("What to write: NAME.fmu.", ".fmu")],
    /,
    *,
    interface: Annotated[
        Literal["serial", "steps"], Parameter(help="serial: bytes of a host. steps: counters of another control.")
    ] = "serial",
) -> int:
    """Write a twin as an FMU for co-simulation (FMI 3.0).

    Machine, controller, plant, seed and scenario are its parameters. The importing process needs a Python with
    isel-twin.
    """
    from isel_twin.bridge.fmu.builder import build

    check_writable(out)
    try:
        with call_errors(out):
            build(out, interface)
    except ImportError:
        raise CallError("fmu needs pythonfmu3: pip install 'isel-twin[fmu]'") from None
    return 0
