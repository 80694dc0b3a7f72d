"""Reads the events of a twin, in the names of its machine and controller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from isel_twin.base.parameters import Place
from isel_twin.controller import Controller, HasKeys, NamesOutputs, offers
from isel_twin.machine import Machine
from isel_twin.wiring import ScenarioError, ScenarioEvent, load_scenario, outputs, read_events, settable


def events_of(
    source: Path | Sequence[dict[str, Any]], machine: Machine, controller: Controller
) -> tuple[ScenarioEvent, ...]:
    """The events of a scenario file, or of its tables. Raises ScenarioError, and OSError for the file."""
    own = controller.output_names if offers(controller, NamesOutputs) else ()
    words: Mapping[str, Any] = {
        "settable": settable(machine),
        "switches": [switch.name for switch in machine.switches],
        "outputs": (*outputs(machine), *own),
        "keys": controller.keys if offers(controller, HasKeys) else {},
    }
    if isinstance(source, Path):
        return load_scenario(source, **words)
    return read_events(source, Place("scenario", ScenarioError), **words)
