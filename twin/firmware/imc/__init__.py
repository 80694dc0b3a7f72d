"""The iMC-M, iMC-MP and iMC-S8 controllers, and their older relative C142, after the iMC programming manual (03/2012).

    grammar.py     bytes to lines, lines to codes and numbers
    commands.py    every command of the manual, as three tables
    controller.py  host, inputs and clock: implements isel_twin.controller.Controller
    waiting.py     waiting lines, and lines held by a stop
    supervisor.py  events during commands that take time, and their effects (executor.py of the folder above)
    purpose.py     purposes of requests of activities
    moves.py       straight moves, arcs, moves until an event
    reference.py   reference run, running free
    program.py     stored programs
    adjust.py      commands that set
    query.py       commands that ask
    device.py      the state behind all of them: counters, references, outputs
    safety.py      the safety chain's three states
    limits.py      limit switches
    ports.py       input and output ports
    settings.py    initialisation values and the flash image
    profile.py     members of the family, as data (profiles.toml)
    replies.py     the reply codes
    language.py    its language: reading.py (lines and answers), wording.py, retiming.py

docs/imc.md is the overview of commands, docs/safety.md the safety chain, docs/decisions/imc.md what is left open.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from isel_twin.controller import takes
from isel_twin.firmware.imc.controller import Imc
from isel_twin.firmware.imc.profile import load_profile, readings_in_force
from isel_twin.firmware.imc.profile import settings as settings_taken

__all__ = ["Imc", "create"]


@takes(settings_taken(), readings_in_force)
def create(name: str, *, flash: bytes | None, settings: Mapping[str, Any]) -> Imc:
    """Entry point of `isel_twin.controllers`; `name` is a profile of profiles.toml.

    Settings: any number of profiles.toml by its name, such as program_memory_bytes. Raises ValueError for a wrong one.
    """
    return Imc(load_profile(name, settings), flash)
