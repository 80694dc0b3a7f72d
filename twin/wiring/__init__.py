"""From motion and operators back to input levels: contacts, cabinet, serial line and scenarios.

wiring.py     all of it as one object
trips.py      where switches and feeler act next
contacts.py   contacts, series circuits, bounce, broken wires -> terminal levels
cabinet.py    operator elements, hood, safety relay, spindle contactor; spindle.py: what it switches
line.py       the serial line: byte times and noise
acts.py       the table of all that an event can do
event.py      an event as a value, read from a table
scenario.py   scenario files: events in virtual time
when.py       the words of a condition
schedule.py   which event is next
"""

from __future__ import annotations

from isel_twin.wiring.acts import ACTS, Act, check_input, cut_table
from isel_twin.wiring.cabinet import SafetyCabinet
from isel_twin.wiring.contacts import FAULTS, Contacts
from isel_twin.wiring.event import EVENT_KEYS, ScenarioEvent, event_now
from isel_twin.wiring.line import LineFaults, SerialLine
from isel_twin.wiring.scenario import ScenarioError, load_scenario, read_events, scenario_text
from isel_twin.wiring.schedule import Schedule
from isel_twin.wiring.trips import TripPoints
from isel_twin.wiring.when import Trigger
from isel_twin.wiring.wiring import Wiring, outputs, settable, thresholds

__all__ = [
    "ACTS",
    "EVENT_KEYS",
    "FAULTS",
    "Act",
    "Contacts",
    "LineFaults",
    "SafetyCabinet",
    "ScenarioError",
    "ScenarioEvent",
    "Schedule",
    "SerialLine",
    "Trigger",
    "TripPoints",
    "Wiring",
    "check_input",
    "cut_table",
    "event_now",
    "load_scenario",
    "outputs",
    "read_events",
    "scenario_text",
    "settable",
    "thresholds",
]
