"""The wiring as a whole: what the plant, people, outputs and a scenario do, and which levels and power come of it.

The plant is one that only does what a test says (tests/by_hand.py), so every time below is exact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil, log
from typing import Any

import numpy as np
import pytest
from by_hand import PlantByHand

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.controller import DriveInput
from isel_twin.drives.heat import HYSTERESIS_K, steady_c
from isel_twin.drives.stage import Stage
from isel_twin.machine import Contact, Machine, load_machine, with_overrides
from isel_twin.plant import Threshold
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.wiring import FAULTS, ScenarioEvent, SerialLine, TripPoints, Wiring, thresholds
from isel_twin.wiring.cabinet import ELEMENTS
from isel_twin.wiring.when import Trigger

SWITCHES = ("limit_x1", "limit_x2", "limit_y1", "limit_y2", "limit_z1", "limit_z2")
X1, X2 = 0, 1
SIGNALS = (
    *("estop_1", "estop_2", "overtemperature", "start", "stop", "probe", "spindle", "power_ok"),
    *("hood_automatic", "hood_setup", "key", "user_3"),
)
EACH = {name: (name,) for name in (*SWITCHES, "limit_a1", *SIGNALS)}
"""A controller with a terminal for every contact, of the same name."""
BOUNCE_NS = MILLISECOND_NS


class Bench:
    """A machine wired to a plant and a line that do nothing by themselves."""

    def __init__(
        self,
        *,
        terminals: Mapping[str, tuple[str, ...]] = EACH,
        drive_inputs: Sequence[DriveInput] = (),
        overrides: Mapping[str, Any] | None = None,
        contacts: Sequence[Contact] | None = None,
        stages: Sequence[Stage] = (),
        seed: int = 0,
        passed: Sequence[int] = (),
    ) -> None:
        machine = with_overrides(load_machine("4030"), {"imperfections": "ideal"} if overrides is None else overrides)
        self.machine: Machine = machine if contacts is None else replace(machine, contacts=tuple(contacts))
        random, bounces = np.random.default_rng(seed).spawn(2)
        trips = TripPoints(self.machine, random)
        self.plant = PlantByHand(thresholds(self.machine, drive_inputs, trips), stages=stages)
        self.plant.passed[list(passed)] = True
        self.line = SerialLine(timed=False, random=np.random.default_rng(7))
        self.wiring = Wiring(self.machine, self.plant, self.line, terminals, drive_inputs, trips, bounces)
        self.settle(0)

    def settle(self, t_ns: int) -> int:
        """Until nothing is due any more; how often there was something."""
        for n in range(100):
            if not self.wiring.settle(t_ns):
                return n
        raise AssertionError("it never settles")

    def outputs(self, **values: int) -> None:
        """The controller tells some outputs at one instant."""
        for name, value in values.items():
            self.wiring.output(name, value)
        self.wiring.follow_controller()
        self.settle(0)

    def motion(self, moving: bool, t_ns: int) -> None:
        self.wiring.motion(moving)
        self.wiring.follow_controller()
        self.settle(t_ns)

    def operate(self, *pairs: tuple[str, str]) -> None:
        for name, state in pairs:
            self.wiring.operate(name, state)
        self.settle(0)

    def pass_(self, number: int, passed: bool, t_ns: int) -> None:
        """The plant has passed or left a threshold."""
        self.plant.passed[number] = passed
        self.settle(t_ns)

    def levels(self, *names: str) -> tuple[bool, ...]:
        return tuple(self.wiring.levels[name] for name in names)

    def history(self, name: str, until_ns: int) -> list[tuple[int, bool]]:
        """Times and levels of all edges at a terminal on the way to until_ns, in which nothing happens from outside."""
        edges, level = [], self.wiring.levels[name]
        while (t := self.wiring.next_ns) is not None and t <= until_ns:
            assert self.settle(t) > 0, "it said it had something to do"
            assert self.wiring.next_ns is None or self.wiring.next_ns > t, "what was due is done"
            if self.wiring.levels[name] != level:
                level = not level
                edges.append((t, level))
        return edges


# ---- what the plant watches ----------------------------------------------------------------------------------------


def test_the_plant_watches_the_switches_and_then_what_drives_feed() -> None:
    machine = with_overrides(load_machine("4030"), {"imperfections": "ideal"})
    drives = [DriveInput("lag_y", 1, "lag", 40.0, 10.0), DriveInput("alarm", 5, "fault")]
    assert thresholds(machine, drives, TripPoints(machine, np.random.default_rng(0))) == [
        Threshold(axis=0, quantity="position", limit=0.0, sense=-1, hysteresis=0.2),
        Threshold(axis=0, quantity="position", limit=395.0, sense=1, hysteresis=0.2),
        Threshold(axis=1, quantity="position", limit=0.0, sense=-1, hysteresis=0.2),
        Threshold(axis=1, quantity="position", limit=300.0, sense=1, hysteresis=0.2),
        Threshold(axis=2, quantity="position", limit=0.0, sense=-1, hysteresis=0.2),
        Threshold(axis=2, quantity="position", limit=140.0, sense=1, hysteresis=0.2),
        Threshold(axis=1, quantity="lag", limit=40.0, hysteresis=10.0),
        Threshold(axis=5, quantity="fault"),
    ]


def test_a_machine_without_switches_has_none_to_watch() -> None:
    machine = replace(load_machine("4030"), contacts=())
    trips = TripPoints(machine, np.random.default_rng(0))
    assert thresholds(machine, [], trips) == []
    assert thresholds(machine, [DriveInput("alarm", 0, "fault")], trips) == [Threshold(0, "fault")]


# ---- levels --------------------------------------------------------------------------------------------------------


def test_levels_at_rest_are_those_of_the_table() -> None:
    """docs/architecture.md, "Resting levels"; without a controller nothing is on, but the relay is closed."""
    low = {"start", "probe", "spindle", "key", "user_3"}
    assert dict(Bench().wiring.levels) == {name: name not in low for name in EACH}


@pytest.mark.parametrize("number", range(6))
def test_each_switch_leads_to_its_terminal(number: int) -> None:
    bench = Bench()
    bench.pass_(number, True, 5)
    assert [name for name in SWITCHES if not bench.wiring.levels[name]] == [SWITCHES[number]]
    assert [name for name in SWITCHES if bench.wiring.inputs[name] == "struck"] == [SWITCHES[number]]
    bench.pass_(number, False, 6)
    assert all(bench.levels(*SWITCHES))
    assert {bench.wiring.inputs[name] for name in SWITCHES} == {"free"}


def test_a_switch_struck_at_power_on_shows_before_anything_is_settled() -> None:
    machine = load_machine("4030")
    random, bounces = np.random.default_rng(0).spawn(2)
    trips = TripPoints(machine, random)
    plant = PlantByHand(thresholds(machine, [], trips))
    plant.passed[X2] = True
    wiring = Wiring(machine, plant, SerialLine(timed=False, random=random), EACH, [], trips, bounces)
    assert (wiring.levels["limit_x1"], wiring.levels["limit_x2"]) == (True, False)


def test_contacts_in_series_are_high_only_while_all_are_closed() -> None:
    bench = Bench(terminals={"pin": SWITCHES, "mixed": ("limit_y1", "start")})
    assert dict(bench.wiring.levels) == {"pin": True, "mixed": False}
    bench.operate(("start", "down"))
    assert bench.wiring.levels["mixed"]
    bench.pass_(2, True, 1)
    bench.pass_(4, True, 2)
    assert dict(bench.wiring.levels) == {"pin": False, "mixed": False}
    bench.pass_(2, False, 3)
    assert dict(bench.wiring.levels) == {"pin": False, "mixed": True}
    bench.pass_(4, False, 4)
    assert dict(bench.wiring.levels) == {"pin": True, "mixed": True}


def test_a_terminal_without_any_contact_is_not_wired() -> None:
    bench = Bench(terminals={"limit_a": ("limit_a2",), "some": ("limit_a2", "limit_x1"), "open": ()})
    assert dict(bench.wiring.levels) == {"some": True}
    bench.pass_(X1, True, 1)
    assert dict(bench.wiring.levels) == {"some": False}


def test_levels_follow_the_kind_of_contact() -> None:
    contacts = [
        Contact(name="a", kind="switch", type="closer", axis="x", end="motor"),
        Contact(name="b", kind="switch", type="opener", inverted=True, axis="x", end="far", position_mm=395.0),
        Contact(name="c", kind="bridge"),
        Contact(name="d", kind="bridge", inverted=True),
        Contact(name="estop_1", kind="signal", inverted=True),
    ]
    bench = Bench(contacts=contacts, terminals={c.name: (c.name,) for c in contacts})
    assert bench.levels("a", "b", "c", "d", "estop_1") == (False, False, True, False, False)
    bench.pass_(0, True, 1)
    bench.pass_(1, True, 2)
    bench.operate(("estop", "pressed"))
    assert bench.levels("a", "b", "c", "d", "estop_1") == (True, True, True, False, True)


def test_levels_are_the_same_object_until_something_changes() -> None:
    bench = Bench()
    before = bench.wiring.levels
    bench.settle(10)
    bench.operate(("estop", "released"), ("limit_x1", "ok"), ("key", "automatic"))
    bench.outputs(stages=1, lamp_fault=1, analog=200)
    assert bench.wiring.levels is before
    bench.operate(("start", "down"))
    after = bench.wiring.levels
    assert after is not before
    assert after["start"]
    assert not before["start"], "what was handed out stays as it was"


# ---- bounce and repeatability --------------------------------------------------------------------------------------


def test_a_switch_changes_at_once_and_chatters_within_its_time() -> None:
    """Up to three bounces of two edges each (wiring/4); over 40 strikes some of them."""
    edges = []
    for seed in range(40):
        bench = Bench(overrides={"imperfections": "dynamic"}, seed=seed)
        t0 = 3 * SECOND_NS + seed
        bench.pass_(X1, True, t0)
        assert not bench.wiring.levels["limit_x1"], "at the instant it is struck"
        history = bench.history("limit_x1", 2 * t0)
        assert all(t0 < t <= t0 + BOUNCE_NS for t, _ in history)
        assert all(a < b for (a, _), (b, _) in pairwise(history))
        assert len(history) in (0, 2, 4, 6)
        assert not bench.wiring.levels["limit_x1"]
        assert bench.wiring.next_ns is None
        edges.append(len(history))
    assert max(edges) == 6
    assert len(set(edges)) > 1


@pytest.mark.parametrize("seed", range(20))
def test_a_release_while_a_strike_still_bounces_ends_its_bounces(seed: int) -> None:
    bench = Bench(overrides={"imperfections": "dynamic"}, seed=seed)
    bench.pass_(X1, True, 1000)
    bench.pass_(X1, False, 1001)
    assert bench.wiring.levels["limit_x1"]
    history = bench.history("limit_x1", SECOND_NS)
    assert len(history) in (0, 2, 4, 6)
    assert all(1001 < t <= 1001 + BOUNCE_NS for t, _ in history)
    assert bench.wiring.levels["limit_x1"]


def test_two_switches_bounce_each_by_itself() -> None:
    """A second strike right after the first leaves the bounces of the first as they are."""
    bounced = 0
    for seed in range(10):
        alone, both = (Bench(overrides={"imperfections": "dynamic"}, seed=seed) for _ in range(2))
        alone.pass_(X1, True, 1000)
        both.pass_(X1, True, 1000)
        both.pass_(2, True, 1001)
        assert both.levels("limit_x1", "limit_y1") == (False, False)
        history = alone.history("limit_x1", SECOND_NS)
        assert both.history("limit_x1", SECOND_NS) == history
        assert both.levels("limit_x1", "limit_y1") == (False, False)
        bounced += len(history) > 0
    assert bounced


def test_a_switch_that_hangs_with_others_bounces_only_while_they_are_closed() -> None:
    bench = Bench(overrides={"imperfections": "dynamic"}, terminals={"pin": SWITCHES})
    bench.operate(("limit_z2", "broken"))
    level = bench.wiring.levels
    bench.pass_(X1, True, 1000)
    assert bench.history("pin", SECOND_NS) == []
    assert bench.wiring.levels is level


def draws(bench: Bench, number: int, count: int) -> list[float]:
    """Trip points drawn for a switch that is struck and released again and again."""
    bench.plant.drawn.clear()
    t = SECOND_NS
    for n in range(count):
        bench.pass_(number, True, t)
        assert len(bench.plant.drawn) == n, "it is drawn when the switch is released"
        bench.pass_(number, False, t + SECOND_NS)
        assert len(bench.plant.drawn) == n + 1
        t += 2 * SECOND_NS
    assert {n for n, _ in bench.plant.drawn} <= {number}
    return [mm for _, mm in bench.plant.drawn]


def test_the_next_trip_point_is_drawn_at_each_release() -> None:
    """Normal around the nominal one with the standard deviation of the machine file, 0.01 mm (wiring/5)."""
    scattered = {"imperfections": "dynamic"}
    drawn = draws(Bench(overrides=scattered), X2, 400)
    assert np.mean(drawn) == pytest.approx(395.0, abs=4 * 0.01 / 20)
    assert np.std(drawn) == pytest.approx(0.01, rel=0.15)
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.2
    assert draws(Bench(overrides=scattered), X2, 5) == drawn[:5], "seeded"
    assert draws(Bench(overrides=scattered, seed=1), X2, 5) != drawn[:5]


def test_bounces_do_not_change_where_switches_trip() -> None:
    still = {"imperfections": "dynamic", "imperfections.bounce": False}
    assert draws(Bench(overrides=still), X1, 5) == draws(Bench(overrides={"imperfections": "dynamic"}), X1, 5)


def test_an_ideal_switch_trips_where_it_should() -> None:
    bench = Bench()
    bench.pass_(X2, True, 1)
    bench.pass_(X2, False, 2)
    assert {mm for number, mm in bench.plant.drawn if number == X2} <= {395.0}


def test_a_stuck_switch_has_its_trip_point_drawn_all_the_same() -> None:
    """The carriage strikes and leaves it, whatever the wire says."""
    bench = Bench(overrides={"imperfections": "dynamic"})
    bench.operate(("limit_x1", "broken"))
    assert len(draws(bench, X1, 3)) == 3


# ---- what drives feed ----------------------------------------------------------------------------------------------


DRIVES = (DriveInput("lag_x", 0, "lag", 40.0, 10.0), DriveInput("alarm_y", 1, "fault"))


def test_drive_inputs_are_levels() -> None:
    bench = Bench(drive_inputs=DRIVES, overrides={"imperfections": "dynamic"})
    assert bench.levels("lag_x", "alarm_y") == (False, False)
    bench.plant.drawn.clear()
    before = bench.wiring.levels
    bench.settle(10)
    assert bench.wiring.levels is before
    bench.pass_(6, True, 11)
    assert bench.levels("lag_x", "alarm_y") == (True, False)
    assert bench.wiring.next_ns is None, "nothing bounces"
    now = bench.wiring.levels
    bench.settle(12)
    assert bench.wiring.levels is now
    bench.pass_(7, True, 13)
    bench.pass_(6, False, 14)
    assert bench.levels("lag_x", "alarm_y") == (False, True)
    assert bench.plant.drawn == [], "a drive has no trip point"
    assert all(bench.levels(*SWITCHES))
    assert set(bench.wiring.levels) == {*EACH, "lag_x", "alarm_y"}


def test_a_drive_that_is_beyond_its_limit_at_power_on() -> None:
    assert Bench(drive_inputs=DRIVES, passed=[7]).levels("lag_x", "alarm_y") == (False, True)


# ---- cabinet and power ---------------------------------------------------------------------------------------------


def test_nothing_is_on_until_the_controller_says_so() -> None:
    bench = Bench()
    assert bench.plant.power == (False, False, False)
    assert dict(bench.wiring.outputs) == {"power": 1, "spindle_runs": 0}
    bench.operate(("power", "off"), ("power", "on"), ("key", "setup"))
    assert bench.plant.power == (False, False, False)


@pytest.mark.parametrize("outputs", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 1, 1)])
def test_outputs_reach_stages_brake_and_current(outputs: tuple[int, int, int]) -> None:
    bench = Bench()
    bench.outputs(**dict(zip(("stages", "brake", "current_lowering"), outputs, strict=True)))
    assert bench.plant.power == tuple(map(bool, outputs))
    bench.outputs(stages=0, brake=0, current_lowering=0)
    assert bench.plant.power == (False, False, False)


def test_outputs_of_an_instant_are_carried_over_together() -> None:
    """Stages and brake change in one step, so that the axis neither drops nor strains against its brake."""
    bench = Bench()
    told: list[tuple[bool, bool, bool]] = []
    bench.plant.set_power = lambda **power: told.append(tuple(power.values()))  # type: ignore[method-assign]
    bench.wiring.output("stages", 1)
    bench.wiring.output("brake", 1)
    bench.wiring.follow_controller()
    assert set(told) == {(True, True, False)}


CUTS = [
    [("estop", "pressed")],
    [("overtemperature", "hot")],
    [("power", "off")],
    [("estop_1", "broken")],
    [("estop_2", "stuck_open")],
]


@pytest.mark.parametrize("cut", CUTS)
def test_the_relay_takes_the_power_whatever_the_controller_says(cut: list[tuple[str, str]]) -> None:
    bench = Bench()
    bench.outputs(stages=1, brake=1, spindle=1)
    assert bench.wiring.outputs["spindle_runs"] == 1
    bench.operate(*cut)
    assert bench.plant.power[:2] == (False, False)
    assert (bench.wiring.outputs["power"], bench.wiring.outputs["spindle_runs"]) == (0, 0)
    assert (bench.wiring.outputs["stages"], bench.wiring.outputs["spindle"]) == (1, 1), (
        "the outputs are the controller's"
    )
    assert bench.levels("power_ok", "spindle") == (False, False)
    bench.outputs(power_request=1)
    assert bench.plant.power[:2] == (False, False), "the condition still holds"


@pytest.mark.parametrize(
    ("cut", "mend"),
    [
        ([("estop", "pressed")], [("estop", "released")]),
        ([("overtemperature", "hot")], [("overtemperature", "normal")]),
        ([("estop_2", "broken")], [("estop_2", "ok")]),
    ],
)
def test_power_comes_back_only_when_it_is_asked_for(cut: list[tuple[str, str]], mend: list[tuple[str, str]]) -> None:
    bench = Bench()
    bench.outputs(stages=1, brake=1, power_request=1)
    bench.operate(*cut)
    bench.operate(*mend)
    assert bench.plant.power[:2] == (False, False), "the request is a rising edge, and this one has been"
    bench.outputs(power_request=0)
    assert bench.plant.power[:2] == (False, False)
    bench.outputs(power_request=1)
    assert bench.plant.power[:2] == (True, True)
    assert bench.levels("power_ok") == (True,)


def test_a_wire_that_heals_is_seen_by_the_relay_only_after_a_reset() -> None:
    bench = Bench()
    bench.outputs(stages=1)
    bench.operate(("estop_1", "broken"))
    assert bench.levels("estop_1", "estop_2") == (False, True)
    bench.operate(("estop_1", "ok"))
    assert bench.levels("estop_1", "estop_2") == (True, True)
    assert not bench.plant.power[0]
    bench.operate(("power", "on"))
    assert bench.plant.power[0], "the operator's power key closes it as well"


@pytest.mark.parametrize("bridged", [["estop_1"], ["estop_1", "estop_2"]])
def test_a_circuit_stuck_closed_needs_the_other_one(bridged: list[str]) -> None:
    bench = Bench()
    bench.outputs(stages=1)
    bench.operate(*((name, "stuck_closed") for name in bridged))
    bench.operate(("estop", "pressed"))
    assert bench.plant.power[0] is (len(bridged) == 2), "both circuits as they are wired"


def test_a_hood_opened_in_a_motion_takes_the_power() -> None:
    bench = Bench()
    bench.outputs(stages=1, brake=1, hood_release=1)
    bench.operate(("hood", "open"))
    assert bench.plant.power[0], "at rest it does not"
    bench.operate(("hood", "closed"))
    bench.motion(True, 1)
    assert bench.plant.power[0]
    bench.operate(("hood", "open"))
    assert bench.plant.power[0] is False
    assert bench.levels("hood_automatic", "hood_setup", "power_ok") == (False, False, False)


def test_a_motion_that_begins_with_the_hood_open_takes_the_power() -> None:
    bench = Bench()
    bench.outputs(stages=1, hood_release=1)
    bench.operate(("hood", "open"))
    bench.motion(True, 1)
    assert bench.plant.power[0] is False
    assert bench.wiring.outputs["power"] == 0
    bench.motion(False, 2)
    assert bench.plant.power[0] is False


def test_a_motion_on_setup_may_have_the_hood_open() -> None:
    bench = Bench()
    bench.outputs(stages=1, hood_release=1)
    bench.operate(("key", "setup"), ("hood", "open"))
    bench.motion(True, 1)
    assert bench.plant.power[0]
    bench.operate(("key", "automatic"))
    assert bench.plant.power[0] is False


def test_outputs_are_those_of_the_controller_and_the_relays() -> None:
    bench = Bench()
    bench.outputs(stages=1, user=165, odd_name=7)
    assert dict(bench.wiring.outputs) == {"stages": 1, "user": 165, "odd_name": 7, "power": 1, "spindle_runs": 0}
    bench.outputs(user=0)
    assert bench.wiring.outputs["user"] == 0


# ---- what people do ------------------------------------------------------------------------------------------------


def test_everything_that_can_be_set_is_named_with_its_states() -> None:
    settable = Bench().wiring.settable
    for name, states in ELEMENTS.items():
        assert settable[name][: len(states)] == states
    for contact in load_machine("4030").contacts:
        assert settable[contact.name][-len(FAULTS) :] == tuple(FAULTS)
    assert settable["hood"] == ("closed", "open", "forced")
    assert settable["limit_x1"] == ("ok", "broken", "stuck_open", "stuck_closed", "bounce")
    assert settable["stop"] == ("up", "down", "ok", "broken", "stuck_open", "stuck_closed", "bounce")


@pytest.mark.parametrize(("name", "state"), [(n, s) for n, states in Bench().wiring.settable.items() for s in states])
def test_whatever_is_settable_can_be_set_and_shows(name: str, state: str) -> None:
    bench = Bench()
    bench.outputs(hood_release=1)
    bench.operate((name, state))
    shown = {"forced": "open", "ok": Bench().wiring.inputs.get(name)}.get(state, state)
    assert bench.wiring.inputs.get(name) == shown


def test_inputs_are_elements_switches_and_faults() -> None:
    bench = Bench()
    resting = {name: states[0] for name, states in ELEMENTS.items()} | dict.fromkeys(SWITCHES, "free")
    assert dict(bench.wiring.inputs) == resting
    bench.operate(("estop_1", "broken"), ("stop", "stuck_open"))
    assert dict(bench.wiring.inputs) == resting | {"estop_1": "broken", "stop": "stuck_open"}
    bench.operate(("estop_1", "ok"), ("stop", "ok"))
    assert dict(bench.wiring.inputs) == resting


@pytest.mark.parametrize(
    ("name", "state"), [("door", "open"), ("hood", "ajar"), ("limit_x1", "down"), ("hood", "broken"), ("", "")]
)
def test_what_cannot_be_set_is_refused_and_changes_nothing(name: str, state: str) -> None:
    bench = Bench()
    bench.outputs(stages=1)
    levels, inputs, power = bench.wiring.levels, dict(bench.wiring.inputs), bench.plant.power
    with pytest.raises(ValueError, match=f"unknown input {name!r}|{name!r} cannot be {state!r}"):
        bench.wiring.operate(name, state)
    bench.settle(0)
    assert bench.wiring.levels is levels
    assert dict(bench.wiring.inputs) == inputs
    assert bench.plant.power == power


def test_a_hood_that_nobody_locks_can_be_opened() -> None:
    bench = Bench()
    bench.operate(("hood", "open"))
    assert bench.wiring.inputs["hood"] == "open"


def test_a_locked_hood_stays_closed() -> None:
    bench = Bench()
    bench.outputs(stages=1, hood_release=0)
    levels, inputs = bench.wiring.levels, dict(bench.wiring.inputs)
    bench.operate(("hood", "open"))
    assert bench.wiring.levels is levels
    assert dict(bench.wiring.inputs) == inputs
    bench.outputs(hood_release=1)
    assert bench.wiring.inputs["hood"] == "closed", "the attempt is over"
    bench.operate(("hood", "open"))
    assert (bench.wiring.inputs["hood"], bench.levels("hood_automatic")) == ("open", (False,))


def test_a_fault_of_a_switch_holds_it_while_the_carriage_moves() -> None:
    bench = Bench()
    bench.operate(("limit_x2", "stuck_closed"))
    bench.pass_(X2, True, 5)
    assert bench.levels("limit_x2") == (True,)
    assert bench.wiring.inputs["limit_x2"] == "stuck_closed"
    bench.operate(("limit_x2", "ok"))
    assert bench.levels("limit_x2") == (False,)
    assert bench.wiring.inputs["limit_x2"] == "struck"


# ---- heat ----------------------------------------------------------------------------------------------------------


STAGE = Stage(
    supply_v=48.0,
    current_a=4.0,
    thermal_resistance_k_per_w=10.0,
    thermal_time_constant_s=20.0,
    ambient_c=30.0,
    thermal_limit_c=60.0,
)


def reaches(start_c: float, end_c: float, limit_c: float) -> int:
    """Whole seconds after which tau dT/dt = end - T has brought a stage from start beyond a limit."""
    return ceil(STAGE.thermal_time_constant_s * log((start_c - end_c) / (limit_c - end_c)))


def test_a_hot_stage_opens_the_over_temperature_contact() -> None:
    """Two stages, one of them at full current: its temperature rises from 30 towards 90 degrees with 20 s, so it is at
    60 after 20 ln 2 = 13.9 s, seen at 14 s; switched off then, it has cooled to 50 when it closes again."""
    full, off = steady_c(STAGE, 1.0), 30.0
    assert full > 70.0
    bench = Bench(stages=[STAGE, STAGE])
    bench.outputs(stages=1, brake=1)
    bench.plant.current_fraction[:] = (0.0, 1.0)
    opened = reaches(30.0, full, 60.0)
    edges = [(t, level) for t, level in bench.history("overtemperature", opened * SECOND_NS)]
    assert edges == [(opened * SECOND_NS, False)]
    assert bench.wiring.inputs["overtemperature"] == "hot"
    assert bench.plant.power[0] is False
    assert bench.levels("power_ok") == (False,)
    bench.plant.current_fraction[:] = 0.0
    at_opening = full + (30.0 - full) * np.exp(-opened / 20.0)
    cooled = opened + reaches(at_opening, off, 60.0 - HYSTERESIS_K)
    assert bench.history("overtemperature", (cooled + 20) * SECOND_NS) == [(cooled * SECOND_NS, True)]
    assert bench.wiring.inputs["overtemperature"] == "normal"
    assert bench.plant.power[0] is False, "the relay waits for a reset"


def test_temperatures_are_looked_at_once_a_second_and_are_no_event() -> None:
    bench = Bench(stages=[STAGE])
    assert bench.wiring.next_ns == SECOND_NS
    assert bench.wiring.next_event_ns is None
    bench.settle(SECOND_NS // 3)
    assert bench.wiring.next_ns == SECOND_NS
    bench.settle(SECOND_NS)
    assert bench.wiring.next_ns == 2 * SECOND_NS


def test_stages_that_cannot_become_too_hot_are_not_looked_at() -> None:
    assert Bench(stages=[replace(STAGE, thermal_limit_c=200.0)]).wiring.next_ns is None


def test_the_element_says_hot_by_itself() -> None:
    bench = Bench(stages=[STAGE])
    bench.operate(("overtemperature", "hot"))
    assert bench.levels("overtemperature") == (False,)
    bench.settle(SECOND_NS)
    assert bench.levels("overtemperature") == (False,), "a look at cool stages changes nothing"
    bench.operate(("overtemperature", "normal"))
    assert bench.levels("overtemperature") == (True,)


# ---- scenario and order --------------------------------------------------------------------------------------------


def test_the_next_time_is_the_least_of_all() -> None:
    bench = Bench(stages=[STAGE], overrides={"imperfections": "dynamic"})
    at = [SECOND_NS // 2, 5 * SECOND_NS // 2]
    bench.wiring.schedule([ScenarioEvent(t, {"set": {"user_3": "high"}}) for t in at])
    assert (bench.wiring.next_ns, bench.wiring.next_event_ns) == (at[0], at[0])
    bench.settle(at[0])
    assert (bench.wiring.next_ns, bench.wiring.next_event_ns) == (SECOND_NS, at[1])
    bench.pass_(X1, True, SECOND_NS - 1)
    bounce = bench.wiring.next_event_ns
    assert bounce is not None
    assert SECOND_NS - 1 < bounce < SECOND_NS + BOUNCE_NS
    assert bench.wiring.next_ns == min(bounce, SECOND_NS)


def test_without_anything_to_come_there_is_no_next_time() -> None:
    bench = Bench()
    assert (bench.wiring.next_ns, bench.wiring.next_event_ns) == (None, None)
    assert not bench.wiring.settle(10 * SECOND_NS)


def test_events_act_on_everything_at_their_times() -> None:
    bench = Bench()
    bench.outputs(stages=1)
    bench.wiring.schedule(
        [
            ScenarioEvent(10, {"set": {"start": "down", "limit_x2": "broken"}}),
            ScenarioEvent(20, {"set": {"start": "up"}, "force_n": {"x": 50.0, "z": -7.5}}, "table"),
            ScenarioEvent(30, {"force_n": {"x": 0.0}, "phase_lost": {"y": "ab", "x": "a"}}),
            ScenarioEvent(40, {"set": {"estop": "pressed"}, "noise": 1.0}),
            ScenarioEvent(50, {"phase_lost": {"y": ""}, "noise": 0.0}),
        ]
    )
    assert bench.levels("start", "limit_x2") == (False, True)
    assert bench.settle(9) == 0
    bench.settle(10)
    assert bench.levels("start", "limit_x2") == (True, False)
    assert bench.plant.pushed == []
    bench.settle(20)
    assert bench.levels("start", "limit_x2") == (False, False)
    assert bench.plant.pushed == [(0, 50.0, "table"), (2, -7.5, "table")]
    bench.settle(30)
    assert bench.plant.pushed[2:] == [(0, 0.0, "")]
    assert sorted(bench.plant.phases) == [(0, "a"), (1, "ab")]
    bench.line.from_host(30, b"before", 1)
    assert bench.line.at_controller(30) == b"before"
    assert bench.plant.power[0]
    bench.settle(40)
    assert bench.plant.power[0] is False
    bench.line.from_host(40, b"during", 1)
    assert [(a ^ b).bit_count() for a, b in zip(bench.line.at_controller(40), b"during", strict=True)] == [1] * 6
    bench.settle(50)
    assert bench.plant.phases[2:] == [(1, "")]
    bench.line.from_host(50, b"after", 1)
    assert bench.line.at_controller(50) == b"after"
    assert (bench.wiring.next_ns, bench.wiring.settle(60)) == (None, False)


def test_events_of_one_instant_come_one_after_another() -> None:
    """A button pressed and let go at once is two edges for a controller, who is shown the levels in between."""
    bench = Bench()
    bench.wiring.schedule([ScenarioEvent(10, {"set": {"start": s}}) for s in ("down", "up", "down")])
    seen = []
    while bench.wiring.settle(10):
        seen.append(bench.wiring.levels["start"])
    assert seen == [True, False, True]


def test_elements_of_one_event_change_together() -> None:
    """Key and hood are never seen half changed: only the hood_setup contact would open in between."""
    bench = Bench()
    bench.outputs(stages=1, hood_release=1)
    bench.motion(True, 1)
    bench.wiring.schedule([ScenarioEvent(10, {"set": {"key": "setup", "hood": "open"}})])
    seen = []
    while bench.wiring.settle(10):
        seen.append(bench.levels("hood_automatic", "hood_setup", "key"))
    assert seen == [(False, True, True)]
    assert bench.plant.power[0]


def test_the_plant_comes_before_the_scenario() -> None:
    """A switch struck at the instant its wire comes off has been struck: its trip point is drawn at its release."""
    bench = Bench()
    bench.wiring.schedule([ScenarioEvent(10, {"set": {"limit_x1": "stuck_closed"}})])
    bench.plant.passed[X1] = True
    assert bench.wiring.settle(10)
    bench.settle(10)
    assert bench.levels("limit_x1") == (True,)
    assert bench.wiring.inputs["limit_x1"] == "stuck_closed"
    bench.operate(("limit_x1", "ok"))
    assert bench.wiring.inputs["limit_x1"] == "struck"


def test_bounces_and_temperatures_come_before_the_scenario() -> None:
    """The contact opens by heat and is mended in the same instant: the event that comes last decides."""
    opened = reaches(30.0, steady_c(STAGE, 1.0), 60.0) * SECOND_NS
    bench = Bench(stages=[STAGE])
    bench.outputs(stages=1)
    bench.plant.current_fraction[:] = 1.0
    bench.wiring.schedule([ScenarioEvent(opened, {"set": {"power": "on"}})])
    bench.history("overtemperature", opened - 1)
    assert bench.plant.power[0]
    bench.settle(opened)
    assert bench.plant.power[0] is False, "a hot stage opens the relay, and the key of that instant cannot close it"


def test_settling_again_does_nothing() -> None:
    bench = Bench(overrides={"imperfections": "dynamic"}, stages=[STAGE])
    bench.wiring.schedule([ScenarioEvent(SECOND_NS, {"set": {"user_3": "high"}})])
    bench.pass_(X1, True, SECOND_NS)
    levels, drawn = bench.wiring.levels, list(bench.plant.drawn)
    for _ in range(3):
        assert not bench.wiring.settle(SECOND_NS)
    assert bench.wiring.levels is levels
    assert bench.plant.drawn == drawn


# ---- with a plant that moves ---------------------------------------------------------------------------------------


def test_edges_of_a_plant_that_follows_its_command() -> None:
    """0.1 mm from the motor-end switch at 320 steps/mm and 1000 steps/s: beyond it at step 33, at or beyond the
    hysteresis of 0.2 mm again 65 steps later."""
    machine = with_overrides(load_machine("4030"), {"imperfections": "ideal"})
    random = np.random.default_rng(0)
    trips = TripPoints(machine, random)
    plant = KinematicPlant(machine, thresholds(machine, DRIVES, trips), np.array([0.1, 50.0, 50.0]))
    wiring = Wiring(machine, plant, SerialLine(timed=False, random=random), EACH, DRIVES, trips, random)
    t_ns = np.arange(1, 300, dtype=np.int64) * MILLISECOND_NS
    delta = np.zeros((299, 4), dtype=np.int8)
    delta[:100, 0], delta[100:, 0] = -1, 1
    edges = []
    now, level = 0, wiring.levels["limit_x1"]
    while now < 299 * MILLISECOND_NS:
        rest = t_ns > now
        now = plant.advance(299 * MILLISECOND_NS, t_ns[rest], delta[rest])
        while wiring.settle(now):
            pass
        if wiring.levels["limit_x1"] != level:
            level = not level
            edges.append((now // MILLISECOND_NS, level))
    back = 100 + (100 - 32) + 64  # from 100 steps in, over the trip point 32 steps from the start, and the hysteresis
    assert edges == [(33, False), (back, True)]
    assert not wiring.levels["lag_x"]


def test_only_what_the_power_or_a_scenario_follows_stirs_the_wiring_again() -> None:
    bench = Bench()
    bench.outputs(stages=1, brake=1)
    assert not bench.wiring.stirred
    bench.wiring.output("lamp_start", 1)
    bench.wiring.motion(True)
    bench.wiring.follow_controller()
    assert not bench.wiring.stirred, "a lamp, and a motion with the hood closed"
    bench.wiring.output("stages", 0)
    bench.wiring.follow_controller()
    assert bench.wiring.stirred
    assert bench.settle(1) == 0
    assert not bench.wiring.stirred
    bench.wiring.output("drive_reset", 1)
    assert bench.wiring.stirred, "a fault may be gone"
    bench.settle(2)
    opens = ScenarioEvent(2, {"set": {"hood": "open"}}, when=Trigger("output", "lamp_start", 1))
    bench.wiring.schedule([opens])
    assert bench.wiring.stirred, "an event may wait for what the controller does"
