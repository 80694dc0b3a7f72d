"""The forms of the page: one for everything an event can do, and what comes out of each is what a scenario takes."""

from __future__ import annotations

from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.base.parameters import Place
from isel_twin.bridge.operate.control import ControlError
from isel_twin.bridge.operate.panel.menu import menu
from isel_twin.wiring import event_now
from isel_twin.wiring.acts import ACTS

ENTRIES = menu()


def filled(entry: dict[str, Any], contacts: list[str]) -> dict[str, Any]:
    """What the page makes of a form with something in every field."""
    form = entry["form"]
    if "number" in form:
        value: Any = form["number"]["high"] / 2
    elif "words" in form:
        value = form["words"][0]
    elif "table" in form:
        value = {}
        for field in form["table"]:
            made = field["first"]
            if field.get("sourced"):
                made = {"value": made, "unit": field["number"]["unit"], "grade": "estimate", "source": "panel"}
            value[field["key"]] = made
    else:
        value = contacts[1] if "name" in form else True
    members = contacts if entry["by"] == "contact" else entry["members"]
    return {entry["key"]: {members[0]: value} if entry["by"] else value}


def ended(entry: dict[str, Any], begun: dict[str, Any]) -> dict[str, Any]:
    off = entry["off"]
    return {key: dict.fromkeys(value, off) if entry["by"] else off for key, value in begun.items()}


def test_there_is_a_form_for_everything_but_what_has_buttons():
    assert [entry["key"] for entry in ENTRIES] == [key for key in ACTS if key not in ("set", "key")]
    assert all(len(entry["form"]) == 1 for entry in ENTRIES)


@pytest.mark.parametrize("entry", ENTRIES, ids=[entry["key"] for entry in ENTRIES])
def test_what_a_form_makes_is_taken_and_so_is_its_end(entry: dict[str, Any]):
    settable = Twin(plant="kinematic").settable
    contacts = [name for name, states in settable.items() if "broken" in states]
    place = Place("request", ControlError)
    begun = filled(entry, contacts)
    assert event_now(begun, place, settable)
    if entry["off"] is not None:
        assert event_now(ended(entry, begun), place, settable)
