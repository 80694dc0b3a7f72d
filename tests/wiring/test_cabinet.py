"""The cabinet loses power when it must and gives it back only when all conditions hold (docs/safety.md)."""

from __future__ import annotations

import pytest

from isel_twin.controller import UnknownNameError
from isel_twin.wiring import SafetyCabinet
from isel_twin.wiring.cabinet import USER_INPUTS

CIRCUITS = [("estop", "pressed", "released"), ("overtemperature", "hot", "normal"), ("power", "off", "on")]


def cabinet(**states: str) -> SafetyCabinet:
    new = SafetyCabinet()
    for name, state in states.items():
        new.operate(name, state)
    return new


def press_estop(box: SafetyCabinet, state: str) -> None:
    box.operate("estop", state)
    box.sense(box.contacts().__getitem__)


def request_power(box: SafetyCabinet) -> None:
    box.output("power_request", 1)
    box.output("power_request", 0)


def test_power_is_on_at_the_start() -> None:
    box = SafetyCabinet()
    assert box.relay
    assert box.contacts()["power_ok"]


def test_emergency_stop_opens_both_circuits_and_the_relay_and_releasing_it_does_not_close_it() -> None:
    box = SafetyCabinet()
    press_estop(box, "pressed")
    assert (box.contacts()["estop_1"], box.contacts()["estop_2"], box.relay) == (False, False, False)
    request_power(box)
    assert not box.relay
    press_estop(box, "released")
    assert not box.relay
    request_power(box)
    assert box.relay


@pytest.mark.parametrize(("name", "bad", "good"), CIRCUITS[1:])
def test_relay_opens_with_any_other_circuit(name: str, bad: str, good: str) -> None:
    box = cabinet(**{name: bad})
    assert not box.relay
    request_power(box)
    assert not box.relay
    box.operate(name, good)
    request_power(box)
    assert box.relay


def test_operator_closes_the_relay_with_the_power_key() -> None:
    box = SafetyCabinet()
    press_estop(box, "pressed")
    press_estop(box, "released")
    box.operate("power", "on")
    assert box.relay


@pytest.mark.parametrize(("key", "closes"), [("automatic", False), ("setup", True)])
def test_relay_closes_with_the_hood_open_only_on_setup(key: str, closes: bool) -> None:
    box = cabinet(key=key, power="off", hood="open")
    box.operate("power", "on")
    assert box.relay is closes


@pytest.mark.parametrize(
    ("key", "moving", "spindle", "relay"),
    [
        ("automatic", 0, 0, True),
        ("automatic", 1, 0, False),
        ("automatic", 0, 1, False),
        ("setup", 1, 0, True),
        ("setup", 0, 1, True),
    ],
)
def test_opening_the_hood(key: str, moving: int, spindle: int, relay: bool) -> None:
    box = cabinet(key=key)
    box.output("moving", moving)
    box.output("spindle", spindle)
    box.operate("hood", "open")
    assert box.relay is relay
    assert not box.spindle_runs


def test_turning_the_key_to_automatic_with_the_hood_open_in_a_motion_cuts_power() -> None:
    box = cabinet(key="setup", hood="open")
    box.output("moving", 1)
    assert box.relay
    box.operate("key", "automatic")
    assert not box.relay


def test_a_locked_hood_stays_closed_unless_forced() -> None:
    box = SafetyCabinet()
    box.output("hood_release", 0)
    assert box.operate("hood", "open") == "closed"
    assert box.contacts()["hood_automatic"]
    assert box.operate("hood", "forced") == "open"
    assert not box.contacts()["hood_automatic"]


def test_the_spindle_needs_relay_hood_and_the_controller() -> None:
    box = SafetyCabinet()
    assert not box.spindle_runs
    box.output("spindle", 1)
    assert box.spindle_runs
    assert box.contacts()["spindle"]
    press_estop(box, "pressed")
    assert not box.spindle_runs


def test_the_spindle_stops_when_the_controller_stops_asking() -> None:
    box = SafetyCabinet()
    box.output("spindle", 1)
    box.output("spindle", 0)
    assert (box.spindle_runs, box.relay) == (False, True)


def test_a_request_that_stands_is_no_new_request() -> None:
    """Power and spindle come with a rising output; one that is told to be 1 again has not risen."""
    box = SafetyCabinet()
    box.output("power_request", 1)
    box.output("spindle", 1)
    press_estop(box, "pressed")
    press_estop(box, "released")
    box.output("power_request", 1)
    assert not box.relay
    box.operate("power", "on")
    box.output("spindle", 1)
    assert (box.relay, box.spindle_runs) == (True, False)


def test_only_a_closed_hood_is_locked() -> None:
    box = cabinet(hood="open")
    box.output("hood_release", 0)
    assert not box.locked
    assert box.operate("hood", "closed") == "closed"
    assert box.locked


def test_asking_for_the_spindle_with_the_hood_open_starts_nothing_and_cuts_nothing() -> None:
    """The contactor does not close, so nothing runs that the open hood would endanger (wiring/3)."""
    box = cabinet(hood="open")
    box.output("spindle", 1)
    assert (box.spindle_runs, box.relay) == (False, True)


def test_opening_the_hood_while_steps_are_made_cuts_power_whatever_the_controller_says() -> None:
    box = SafetyCabinet()
    box.motion(True)
    box.operate("hood", "open")
    assert not box.relay


def test_a_motion_that_begins_under_an_open_hood_cuts_power() -> None:
    box = cabinet(hood="open")
    assert box.relay
    box.motion(True)
    assert not box.relay


def test_there_are_eight_user_inputs() -> None:
    """A byte (iMC manual 2.2.3)."""
    assert tuple(f"user_{bit}" for bit in (0, 1, 2, 3, 4, 5, 6, 7)) == USER_INPUTS


def test_the_spindle_does_not_start_by_itself_when_the_hood_is_closed() -> None:
    box = cabinet(key="setup", hood="open")
    box.output("spindle", 1)
    assert not box.spindle_runs
    box.operate("hood", "closed")
    assert not box.spindle_runs
    box.output("spindle", 0)
    box.output("spindle", 1)
    assert box.spindle_runs
    box.operate("hood", "open")
    box.operate("hood", "closed")
    assert not box.spindle_runs


@pytest.mark.parametrize(
    ("hood", "key", "automatic", "setup"),
    [
        ("closed", "automatic", True, True),
        ("open", "automatic", False, False),
        ("closed", "setup", False, True),
        ("open", "setup", False, True),
    ],
)
def test_hood_contacts_combine_hood_and_key(hood: str, key: str, automatic: bool, setup: bool) -> None:
    contacts = cabinet(hood=hood, key=key).contacts()
    assert (contacts["hood_automatic"], contacts["hood_setup"], contacts["key"]) == (automatic, setup, key == "setup")


@pytest.mark.parametrize(
    ("element", "state", "closed", "opened"),
    [
        ("start", "down", {"start"}, set()),
        ("stop", "down", set(), {"stop"}),
        ("probe", "touched", {"probe"}, set()),
        ("key", "setup", {"key"}, {"hood_automatic"}),
        ("estop", "pressed", set(), {"estop_1", "estop_2"}),
        ("overtemperature", "hot", set(), {"overtemperature", "power_ok"}),
        ("power", "off", set(), {"power_ok"}),
        ("hood", "open", set(), {"hood_automatic", "hood_setup"}),
        *((f"user_{bit}", "high", {f"user_{bit}"}, set()) for bit in range(8)),
    ],
)
def test_what_each_element_does_to_contacts(element: str, state: str, closed: set[str], opened: set[str]) -> None:
    """The button of the E-stop opens two circuits; the relay looks at these, so it follows with `sense`."""
    box = SafetyCabinet()
    resting = box.contacts()
    box.operate(element, state)
    changed = box.contacts()
    assert {name for name in changed if changed[name] and not resting[name]} == closed
    assert {name for name in changed if resting[name] and not changed[name]} == opened


def test_unknown_names_and_states_are_named() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown input 'door'; there are: hood, estop"):
        SafetyCabinet().operate("door", "open")
    with pytest.raises(UnknownNameError, match=r"'hood' cannot be 'ajar'; it can be: closed, open, forced"):
        SafetyCabinet().operate("hood", "ajar")
