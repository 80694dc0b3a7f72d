"""A fixed number of worlds in which nothing is wrong, and faults put into a twin on purpose, all of which are noticed.

`make hunt` plays more of the former. The latter show that an invariant of invariants.py says something: each world
here is one that passes as it is and fails when one line of the twin does not do what it should.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hunt.host import dialect_of
from hunt.invariants import Broken, Watch
from hunt.play import Stage, hunt, play
from hunt.world import CONTROLLERS, Event, World, draw_world
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.core.twin import Twin
from isel_twin.firmware.imc import commands as imc
from isel_twin.firmware.imc.grammar import AXES_CODE
from isel_twin.firmware.ismif.commands import COMMANDS, CommandError, parse
from isel_twin.machine import Contact
from isel_twin.motion.step_run import StepRun
from isel_twin.plant.built import find_free
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.wiring import FAULTS, SerialLine, TripPoints, Wiring
from isel_twin.wiring.cabinet import ELEMENTS, SafetyCabinet
from isel_twin.wiring.contacts import Contacts
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=4)

SEEDS = (*range(drawn(24)), 43, 46, 56)
"""About 0.4 s of computing each; the last three are with physics."""


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_is_found(seed: int) -> None:
    failure = hunt(seed)
    assert failure is None, f"\n{failure}"


# ---- faults put into a twin ------------------------------------------------------------------------------------------

CALM = World(
    seed=7,
    options={
        "machine": "4030",
        "controller": "imc-s8",
        "plant": "kinematic",
        "seed": 7,
        "start_mm": (4.0, 5.0, 6.0),
    },
    settings={},
    earlier=(),
    damage=None,
    scripted=(),
    by_hand=(),
    habits=("legal",),
    end_ns=8 * SECOND_NS,
    speed=None,
)
EMERGENCY = replace(
    CALM,
    scripted=(
        Event(5 * SECOND_NS // 10, ("set", "estop", "pressed")),
        Event(6 * SECOND_NS // 10, ("set", "limit_x1", "broken")),
    ),
)
"""The button is pressed, and a wire comes off."""
BROKEN_OFF = replace(CALM, habits=("impatient", "legal"))
SERVED = replace(CALM, speed=20.0)
TIMED = replace(CALM, options={**CALM.options, "line_speed": True})
WORLDS = {"calm": CALM, "emergency": EMERGENCY, "broken off": BROKEN_OFF, "served": SERVED, "timed": TIMED}

Patch = pytest.MonkeyPatch


def _draw_at_each_call(patch: Patch) -> None:
    """Each call of `run_until` uses up a random number: bits depend on how time is cut."""
    run_until = Twin.run_until

    def drawing(self: Twin, *args: Any) -> None:
        self._wiring._trips._random.random()
        run_until(self, *args)

    patch.setattr(Twin, "run_until", drawing)


def _uncut(patch: Patch) -> None:
    """The rest of a motion that is broken off stays in the record."""
    patch.setattr(StepRun, "cut", lambda self, t_ns: self)


def _far_trip_point(patch: Patch) -> None:
    """A switch that has been released trips 1.5 mm further on."""

    def far(_: TripPoints, __: int, switch: Contact) -> float:
        return switch.position_mm + 1.5 * (-1 if switch.end == "motor" else 1)

    patch.setattr(TripPoints, "next_of", far)


def _deaf_contact(patch: Patch) -> None:
    """A switch is struck, and its contact stays as it is."""
    patch.setattr(Contacts, "strike", lambda *_: None)


def _lost_tick(patch: Patch) -> None:
    """Once the plant does not get a tick that the record has, after the reference run."""
    ways = []
    go_straight = KinematicPlant.go_straight

    def losing(plant: Any, until_ns: int, way: Sequence[int], along: Any) -> None:
        ways.append(way)
        lost = np.sign(way) if len(ways) == 25 else np.zeros(len(way))
        go_straight(plant, until_ns, [int(steps - one) for steps, one in zip(way, lost, strict=True)], along)

    patch.setattr(KinematicPlant, "go_straight", losing)


def _no_way_back(patch: Patch) -> None:
    """The safety relay does not close again."""
    patch.setattr(SafetyCabinet, "_close_relay", lambda self: None)


def _relay_sticks(patch: Patch) -> None:
    """The safety relay never opens."""
    patch.setattr(SafetyCabinet, "_settle", lambda self: None)


def _no_time(patch: Patch) -> None:
    """Something is always due and never done."""
    patch.setattr(Wiring, "next_ns", property(lambda self: 0))


def _byte_by_byte(patch: Patch) -> None:
    """The host gets no more than one byte at once."""
    at_host = SerialLine.at_host
    kept: list[bytes] = []

    def one(self: SerialLine, t_ns: int) -> bytes:
        data = b"".join(kept) + at_host(self, t_ns)
        kept[:] = [data[1:]]
        return data[:1]

    patch.setattr(SerialLine, "at_host", one)


def _too_early(patch: Patch) -> None:
    """The host hears bytes that are still on the line."""
    at_host = SerialLine.at_host
    patch.setattr(SerialLine, "at_host", lambda self, t_ns: at_host(self, t_ns + MILLISECOND_NS))


def _no_bell(patch: Patch) -> None:
    """A twin does not say that there is something to read."""
    patch.setattr(Twin, "reply_waiting", property(lambda self: False))


def _no_promise(patch: Patch) -> None:
    """A twin does not say that there are events to come."""
    patch.setattr(Twin, "next_event_ns", property(lambda self: None))


def _raises(patch: Patch) -> None:
    """Something was not thought of."""

    def strike(*_: Any) -> None:
        raise ZeroDivisionError("nobody thought of this")

    patch.setattr(Contacts, "strike", strike)


FAULTY: Sequence[tuple[Callable[[Patch], None], str, str, str]] = (
    (_uncut, "broken off", "safety", "before the last one ends"),
    (_lost_tick, "calm", "safety", "carriages are .* mm away from their counters"),
    (_far_trip_point, "calm", "safety", "is free, with its carriage"),
    (_deaf_contact, "calm", "safety", "is high, with|is low, with"),
    (_draw_at_each_call, "calm", "safety", "not the same bits with time cut otherwise"),
    (_draw_at_each_call, "served", "safety", "with time passing otherwise"),
    (_no_way_back, "emergency", "liveness", "was refused"),
    (_relay_sticks, "emergency", "safety", "the stages have power with estop_1, estop_2 open"),
    (_no_time, "calm", "safety", "time stands still"),
    (_byte_by_byte, "broken off", "safety", "does not get the byte"),
    (_too_early, "timed", "safety", "has not arrived yet"),
    (_no_bell, "broken off", "safety", "and should have by"),
    (_no_promise, "emergency", "safety", "came before next_event_ns"),
    (_raises, "calm", "safety", "raised ZeroDivisionError"),
)


@pytest.mark.parametrize("name", WORLDS)
def test_these_worlds_are_right_as_they_are(name: str) -> None:
    assert play(WORLDS[name]) is None


@pytest.mark.parametrize(
    ("fault", "name", "kind", "what"), FAULTY, ids=[f"{row[0].__name__.strip('_')}-{row[1]}" for row in FAULTY]
)
def test_a_fault_put_into_a_twin_is_noticed(
    fault: Callable[[Patch], None], name: str, kind: str, what: str, monkeypatch: Patch
) -> None:
    fault(monkeypatch)
    failure = play(WORLDS[name])
    assert failure is not None
    assert failure.kind == kind
    assert re.search(what, failure.what)
    assert "python -m tests.hunt --seed 7" in str(failure)


def test_energy_from_nowhere_is_noticed(tmp_path: Path) -> None:
    """A hand that the hunt is not told of pushes the carriage of a machine without power."""
    physics = replace(CALM, options={**CALM.options, "plant": "mujoco", "overrides": {"imperfections": "ideal"}})
    stage = Stage(physics, tmp_path)
    watch = Watch(stage.twin, stage.border)

    def looks() -> None:
        for _ in range(20):
            stage.twin.run(0.005)
            watch.look(acted=True, pushed=False)

    stage.do(("set", "estop", "pressed"))
    looks()
    stage.twin.apply_force(0, 300.0)
    with pytest.raises(Broken, match="the limp machine has gained"):
        looks()


def test_a_switch_that_trips_late_by_a_tenth_of_a_millimetre_is_noticed(tmp_path: Path) -> None:
    """By hand to the motor end of X, on a machine whose frame gives: switches stand on the guides."""
    overrides = {"imperfections.repeatability": False, "imperfections.bounce": False}
    stage = Stage(replace(CALM, options={**CALM.options, "plant": "mujoco", "overrides": overrides}), tmp_path)
    watch = Watch(stage.twin, stage.border)
    plant = stage.twin._plant
    plant.parts.thresholds["limit"][plant.parts.thresholds["axis"] == 0] -= 1e-4
    find_free(plant.parts)
    stage.do(("set", "estop", "pressed"))
    stage.do(("force", 0, -400.0))

    def looks() -> None:
        for _ in range(1000):
            stage.twin.run(0.0005)
            watch.look(acted=True, pushed=True)

    with pytest.raises(Broken, match=r"limit_x1 is free, with its carriage \+0\.0"):
        looks()


def test_a_frame_that_bends_more_than_speed_and_force_explain_is_noticed(tmp_path: Path) -> None:
    """2 x 0.3 m/s sqrt(32 kg / 5 N/um) is 1.5 mm: nothing of the 4030 bends by 3 mm."""
    stage = Stage(replace(CALM, options={**CALM.options, "plant": "mujoco", "overrides": {}}), tmp_path)
    watch = Watch(stage.twin, stage.border)
    plant = stage.twin._plant
    watch.look(acted=True, pushed=False)
    plant.data.qpos[plant.model.joint("flex_x").dofadr[0]] = 3e-3
    with pytest.raises(Broken, match="the frame is bent"):
        watch.look(acted=True, pushed=False)


# ---- what is drawn ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def drawn() -> list[World]:
    """Worlds among which everything has to come up that there is."""
    return [draw_world(seed) for seed in range(600)]


def _imc_codes(lines: Sequence[str]) -> set[str]:
    """Commands of the tables in these lines, where the device number is 0."""
    codes = set()
    for line in lines:
        match re.match(r"@0(I.|.)|(.)", line):
            case re.Match() as found if found[1]:
                codes.add(f"@{AXES_CODE if found[1].isdigit() else found[1]}")
            case re.Match() as found:
                codes.add(found[2])
    return codes


def test_every_command_is_said() -> None:
    draw = np.random.default_rng(1)
    imc_dialect, ismif_dialect = dialect_of("imc-s8"), dialect_of("ismif")
    assert imc_dialect.program is not None
    lines = [imc_dialect.line(draw) for _ in range(6000)]
    stored = [line for _ in range(300) for line in imc_dialect.program(draw)]
    wanted = {f"@{code}" for code in (*imc.DNC, *imc.INITIALISATION)} | set(imc.CNC)
    assert wanted <= _imc_codes(lines) | _imc_codes(stored)
    said = set()
    for text in (ismif_dialect.line(draw) for _ in range(4000)):
        for line in re.split("[\r\x01]", text):
            try:
                said.add(parse(line.encode("latin-1")).code)
            except CommandError:
                continue
    assert said >= COMMANDS.keys() - {"@B", "@A", "@C", "@S"}
    interruptions = b"".join(ismif_dialect.interruptions)
    assert all(master in interruptions for master in (b"@B", b"@A", b"@C", b"@S"))
    assert {bytes([byte]) for byte in (253, 254, 255)} <= set(imc_dialect.interruptions)


def test_everything_that_can_happen_is_drawn(drawn: list[World]) -> None:
    events = [event for world in drawn for event in (*world.scripted, *world.by_hand)]
    assert {event.doing[0] for event in events} == {"set", "force", "phase", "noise", "fault"}
    done = {event.doing[1:] for event in events if event.doing[0] == "set"}
    assert {(name, state) for name, states in ELEMENTS.items() for state in states} <= done
    contacts = {contact.name for contact in Twin(plant="kinematic").machine.contacts}
    assert contacts <= {name for name, state in done if state in FAULTS}
    assert set(FAULTS) <= {state for _, state in done}
    assert {event.doing[2] for event in events if event.doing[0] == "phase"} == {"a", "b", "ab", ""}
    assert min(event.at_ns for event in events) == 0
    instants = Counter((id(world), event.at_ns) for world in drawn for event in world.scripted)
    assert max(instants.values()) > 1


def test_every_kind_of_world_is_drawn(drawn: list[World]) -> None:
    assert {world.controller for world in drawn} == set(CONTROLLERS)
    assert {world.physics for world in drawn} == {False, True}
    assert {bool(world.options.get("line_speed")) for world in drawn} == {False, True}
    assert {world.speed is None for world in drawn} == {False, True}
    assert {key for world in drawn for key in world.options.get("overrides", ())} >= {
        "payload.mass",
        "axes.all.motor",
        "axes.all.steps_per_rev",
        "imperfections",
    }
    assert any(world.settings for world in drawn)
    assert any(world.damage is not None for world in drawn)
    assert any(world.strict for world in drawn)
