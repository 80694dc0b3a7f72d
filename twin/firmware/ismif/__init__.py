"""The iSMIF stepper interface (20 commands, a job memory of 64 KB, three axes), after its manual.

    interface.py       the border to host, input and clock: implements isel_twin.controller.Controller
    commands.py        what a line says
    jobs.py            lines to stored commands, one carried out after the other; pause, halt, failures
    memory.py          the job memory
    actions.py         what stored commands do: vector, waiting time, reference run
    configuration.py   what can be set
    moves.py           ramp law, full steps

docs/ismif.md has what the manual leaves open and the ramp law in closed form. Sections in the docstrings are the
manual's; decisions are in docs/decisions/ismif.md.
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
    """Entry point of `isel_twin.controllers`. The interface keeps nothing without power, so there is no flash image.

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
