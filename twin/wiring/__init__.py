"""Motion and people back to input levels: contacts, cabinet, serial line and what a scenario does to them.

contacts.py   contacts, series circuits, bounce, broken wires -> terminal levels
cabinet.py    operator elements, hood, safety relay, spindle contactor
line.py       the serial line: byte times and noise
scenario.py   scenario files: events in virtual time
"""

from __future__ import annotations

from isel_twin.wiring.cabinet import ELEMENTS, Cabinet
from isel_twin.wiring.contacts import FAULTS, Contacts
from isel_twin.wiring.line import SerialLine
from isel_twin.wiring.scenario import ScenarioError, ScenarioEvent, check_input, load_scenario

__all__ = [
    "ELEMENTS",
    "FAULTS",
    "Cabinet",
    "Contacts",
    "ScenarioError",
    "ScenarioEvent",
    "SerialLine",
    "check_input",
    "load_scenario",
]
