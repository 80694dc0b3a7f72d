"""Motion and people back to input levels: contacts, cabinet, serial line and what a scenario does to them.

wiring.py     all of it as one thing that settles itself
contacts.py   contacts, series circuits, bounce, broken wires -> terminal levels
cabinet.py    operator elements, hood, safety relay, spindle contactor
line.py       the serial line: byte times and noise
acts.py       everything an event can do: names, meanings, values
scenario.py   scenario files: events in virtual time
"""

from __future__ import annotations

from isel_twin.wiring.acts import ACTS, Act, check_input
from isel_twin.wiring.cabinet import CABINETS, Cabinet, SafetyCabinet
from isel_twin.wiring.contacts import FAULTS, Contacts
from isel_twin.wiring.line import SerialLine
from isel_twin.wiring.scenario import EVENT_KEYS, ScenarioError, ScenarioEvent, event_now, load_scenario
from isel_twin.wiring.wiring import Wiring, thresholds

__all__ = [
    "ACTS",
    "CABINETS",
    "EVENT_KEYS",
    "FAULTS",
    "Act",
    "Cabinet",
    "Contacts",
    "SafetyCabinet",
    "ScenarioError",
    "ScenarioEvent",
    "SerialLine",
    "Wiring",
    "check_input",
    "event_now",
    "load_scenario",
    "thresholds",
]
