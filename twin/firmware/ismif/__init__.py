"""The iSMIF stepper interface (20 commands, a job memory of 64 KB, three axes), after its manual.

    interface.py       host, input and clock: implements isel_twin.controller.Controller
    commands.py        parses lines
    jobs.py            stores and carries out commands; pause, halt, failures
    memory.py          the job memory
    actions.py         stored commands: vector, waiting time, reference run
    configuration.py   settings
    moves.py           ramp law, full steps

docs/ismif.md has the ramp law in closed form, docs/decisions/ismif.md what the manual leaves open. Sections in the
docstrings are the manual's.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from isel_twin.base.parameters import Limits
from isel_twin.controller import takes
from isel_twin.firmware.ismif.interface import Ismif

__all__ = ["Ismif", "create"]

ERROR_LIMIT_PPM = 50_000


@takes({"frequency_error_ppm": Limits("", -ERROR_LIMIT_PPM, ERROR_LIMIT_PPM, whole=True)})
def create(name: str, *, flash: bytes | None, settings: Mapping[str, Any]) -> Ismif:
    """Entry point of `isel_twin.controllers`. The interface has no non-volatile memory, so there is no flash image.

    Settings: `frequency_error_ppm`, output frequency over nominal in millionths, -50000 .. 50000 (default 0); others
    are ignored. Raises ValueError for a wrong value.
    """
    error_ppm = settings.get("frequency_error_ppm", 0)
    if isinstance(error_ppm, bool) or not isinstance(error_ppm, int) or abs(error_ppm) > ERROR_LIMIT_PPM:
        raise ValueError(
            f"{name}: frequency_error_ppm is {error_ppm!r}; allowed: a whole number from "
            f"{-ERROR_LIMIT_PPM} to {ERROR_LIMIT_PPM}"
        )
    return Ismif(error_ppm=error_ppm)
