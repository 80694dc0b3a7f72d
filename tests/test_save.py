"""A twin that has been saved and restored is the same twin, to the bit: here, in another twin, in another process."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden.digest import load
from golden.session import build, digest_of
from golden.sessions import FILE, session
from plugin.card6 import Card6, Card6Language, create

from isel_twin import Twin
from isel_twin.base.parameters import Place
from isel_twin.core import told
from isel_twin.core.sampling import TwinSamples
from isel_twin.core.state import StateError, pack
from isel_twin.core.told import OFTEN, Told
from isel_twin.language import MoveSettings
from isel_twin.recordings.recorder import Recorder
from isel_twin.wiring import event_now
from tests.forked import PATIENCE_S

pytestmark = pytest.mark.long(seconds=10)

READY = ("@07", "@0R7")
"""Axes and a reference run of an imc-s8."""
PLACE = Place(Path("test"), ValueError)
SAGGING = {"supply.enabled": True, "axes.all.stage.ambient": 60.0}
KEPT = load(FILE)


def astray(twin: Twin, draw: np.random.Generator) -> None:
    """Do something that leaves traces everywhere."""
    for _ in range(int(draw.integers(1, 4))):
        match int(draw.integers(6)):
            case 0:
                twin.write(bytes([253, 255, 13, 254][int(draw.integers(4))] for _ in range(2)))
            case 1:
                name = str(draw.choice(sorted(twin.settable)))
                twin.set_input(name, str(draw.choice(twin.settable[name])))
            case 2:
                twin.write(b"@07\r@0A500,2000,300,3000,0,100,0,100\r")
            case 3:
                twin.apply_force(int(draw.integers(3)), float(draw.uniform(-50.0, 50.0)))
            case 4:
                twin.line_speed = not twin.line_speed
            case _:
                twin.write(b"#E1,900\r#DX,0,1,1,1\rL1,X30,Y-9\x01")
        twin.run(float(draw.uniform(0.0, 0.3)))
        twin.read()


def detours(number: int, another: Callable[[], Twin]) -> Callable[[Twin], Twin]:
    """Every now and then the twin is saved, goes astray and is restored; or another goes on, which was elsewhere."""
    draw = np.random.default_rng(number)

    def detour(twin: Twin) -> Twin:
        choice = draw.random()
        if choice < 0.04:
            other = another()
            astray(other, draw)
            other.restore(pickle.loads(pickle.dumps(twin.save())))
            return other
        if choice < 0.2:
            state = twin.save()
            astray(twin, draw)
            twin.restore(state)
        return twin

    return detour


@pytest.mark.parametrize("controller", ["bwo900", "c142", "imc-m", "imc-mp", "imc-s8", "ismif"])
def test_sessions_with_detours_are_those_on_file(controller: str) -> None:
    """Faults, scenarios, noise, bounces, stored programs, reference runs, other machines: golden sessions."""
    for number in range(3, 30, 9):
        name = f"{controller}/kinematic/{number:03}"
        played = session(name)
        assert digest_of(played, detours(number, lambda played=played: build(played, seed=99))) == KEPT[name], name


@pytest.mark.parametrize("name", ["imc-s8/mujoco/003", "imc-mp/mujoco/007", "ismif/mujoco/002"])
def test_sessions_with_physics_and_detours(name: str) -> None:
    played = session(name)
    assert digest_of(played, detours(1, lambda: build(played, seed=99))) == digest_of(played)


def referenced(plant: str = "kinematic", seed: int = 1, **options: Any) -> Twin:
    """An imc-s8 after its reference run."""
    twin = Twin("4030", "imc-s8", plant, seed, start_mm=(3.0, 2.0, 1.0), **options)
    for text in READY:
        assert twin.query(text) == "0"
    return twin


def went(twin: Twin, seconds: float = 2.0) -> list[Any]:
    """Everything there is to see while time passes."""
    seen: list[Any] = []
    for _ in range(8):
        twin.run(seconds / 8)
        seen += [twin.time_ns, twin.read(), twin.counts.tolist(), twin.position_mm.tobytes(), dict(twin.inputs)]
        seen += [dict(twin.outputs), twin.velocity_mm_s.tobytes(), twin.lost_steps.tobytes(), dict(twin.faults)]
        seen += [
            twin.margin.tobytes(),
            twin.current_fraction.tobytes(),
            repr(twin.supply_v),
            twin.events_left,
            twin.flash,
        ]
    return [*seen, twin.steps.t_ns.tobytes(), twin.steps.delta.tobytes(), list(twin.remarks)]


SCENARIO = """
[[event]]
at = 0.1
payload_kg = { table = 8.0 }
friction_n = { x = 30.0 }
[[event]]
at = 0.15
obstacle_mm = { x = 12.0 }
[[event]]
at = 0.2
force_n = { y = -40.0 }
[[event]]
at = 0.3
[event.cut]
diameter = 6.0
flutes = 2
depth = 1.0
width = 6.0
spindle = 12000
stickout = 40
kc = { value = 700, unit = "N/mm2", grade = "estimate", source = "wax" }
[[event]]
at = 0.4
undervoltage = 0.3
noise = 0.02
"""


@pytest.mark.parametrize("instant_ns", [90_000_001, 160_012_345, 310_000_000, 3_234_567_891])
def test_what_acts_on_the_machine_is_in_the_state(instant_ns: int, tmp_path: Path) -> None:
    """Payload, friction, an obstacle it runs into, a push, a cut, low voltage: in another twin that knows of none
    of them, and in one that has had all of them and goes back to the time before."""
    file = tmp_path / "events.toml"
    file.write_text(SCENARIO)
    twin = Twin(seed=5, start_mm=(3.0, 2.0, 1.0), scenario=file, line_speed=True, overrides=SAGGING)
    twin.write(b"@07\r@0R7\r@0A6400,4000,900,3000,0,100,0,100\r")
    twin.run_until(instant_ns)
    state, seen = twin.save(), went(twin, 5.0)
    other = Twin(seed=6, scenario=file, start_mm=(50.0, 60.0, 20.0), overrides=SAGGING)
    other.restore(pickle.loads(pickle.dumps(state)))
    assert went(other, 5.0) == seen
    other.restore(state)
    assert went(other, 5.0) == seen


def test_another_process_goes_on_alike(tmp_path: Path) -> None:
    twin = referenced("mujoco")
    twin.write(b"@0A1500,4000,900,3000,0,100,0,100\r")
    twin.run(0.2)
    (tmp_path / "state").write_bytes(pickle.dumps(twin.save()))
    code = f"""
import pathlib, pickle, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_save import went
from plugin.card6 import Card6, Card6Language, create

from isel_twin import Twin
twin = Twin(seed=44)
twin.restore(pickle.loads(pathlib.Path({str(tmp_path / "state")!r}).read_bytes()))
pathlib.Path({str(tmp_path / "seen")!r}).write_bytes(pickle.dumps(went(twin)))
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=PATIENCE_S)
    assert pickle.loads((tmp_path / "seen").read_bytes()) == went(twin)


class Closed:
    """A controller like Card6 that keeps its state where no pickle finds it: in a generator."""

    def __init__(self) -> None:
        self._card = Card6()
        self._beat = (n for n in range(1 << 40))
        next(self._beat)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._card, name)


def closed(name: str, *, flash: bytes | None, settings: Any) -> Closed:
    return Closed()


@pytest.mark.parametrize("factory", [create, closed])
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_a_controller_from_outside(factory: Any, plant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Six axes, set points, drives that are asked; one can be pickled in mid-motion, one never."""
    build = partial(factory, "card6")
    monkeypatch.setattr(
        "isel_twin.core.assembly.controller_factory",
        lambda name: lambda flash, settings: build(flash=flash, settings=settings),
    )
    monkeypatch.setattr("isel_twin.core.assembly.language_factory", lambda name: Card6Language)
    twin, other = (Twin("4030", "card6", plant, seed, start_mm=(100.0, 50.0, 30.0)) for seed in (1, 2))
    twin.query("zero")
    twin.query("move 800 -1600 320 7 0 -9 16000")
    twin.write(twin.language.frame("move 3200 0 0 0 0 0 16000"))
    twin.run(0.05)
    twin.write(twin.language.frame("encoders"))
    twin.run(0.01)
    state = pickle.loads(pickle.dumps(twin.save()))
    assert bool(state.life.calls) == (factory is closed)

    def goes_on(twin: Twin) -> list[Any]:
        twin.run(0.05)
        twin.write(twin.language.frame("encoders"))
        twin.run(0.02)
        twin.write(twin.language.frame("stop"))
        return went(twin)

    seen = goes_on(twin)
    twin.restore(state)
    assert goes_on(twin) == seen
    other.restore(state)
    assert goes_on(other) == seen


def test_a_controller_that_was_handed_in_and_cannot_be_pickled_cannot_be_saved() -> None:
    twin = Twin(controller=Closed(), plant="kinematic")
    with pytest.raises(StateError, match=r"^the controller Closed cannot be saved now: .* cannot pickle 'generator'"):
        twin.save()
    twin = Twin(controller=Card6(), plant="kinematic")
    twin.restore(twin.save())


class Diary:
    """A controller with keys that writes down what it is told, and that no pickle can take."""

    idle = False

    def __init__(self) -> None:
        self.keys: dict[str, Any] = {}
        self.key_values: dict[str, Any] = {}
        self.told: list[tuple[Any, ...]] = []
        self._closed = lambda: None

    def __getattr__(self, name: str) -> Any:
        if name not in ("power_on", "receive", "set_input", "press", "advance"):
            raise AttributeError(name)
        return lambda *values: self.told.append((name, *values))

    def take(self) -> list[Any]:
        return []


def test_a_controller_that_cannot_be_pickled_is_told_its_life_again() -> None:
    """Every call, and those after a restored state too."""
    lives: list[Any] = [Told(Diary(), None, rebuilt=True) for _ in range(3)]
    lives[0].power_on(0, {"estop": True})
    lives[0].receive(1, b"@07")
    lives[0].set_input(2, "hood", False)
    assert lives[0].press(3, "mode", "auto")
    lives[0].advance(4)
    lives[1].restore(lives[0].save(), lambda flash: Diary(), None)
    lives[1].receive(5, b"\r")
    lives[2].restore(lives[1].save(), lambda flash: Diary(), None)
    assert lives[2].controller.told == [
        ("power_on", 0, {"estop": True}),
        ("receive", 1, b"@07"),
        ("set_input", 2, "hood", False),
        ("press", 3, "mode", "auto"),
        ("advance", 4),
        ("receive", 5, b"\r"),
    ]


def test_a_controller_without_keys_is_not_pressed() -> None:
    assert not Told(Card6(), None, rebuilt=True).press(0, "mode", "auto")


def test_calls_with_more_bytes_than_are_kept_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(told, "MOST_BYTES", 20)
    life: Any = Told(Diary(), None, rebuilt=True)
    life.receive(0, bytes(21))
    life.advance(1)
    assert life._calls == [("advance", 1, None)]


def test_a_pickle_is_tried_once_in_so_many_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each takes time, and here it is in vain."""
    tried = [0]

    def in_vain(life: Told) -> str:
        tried.append(len(life._calls))
        return "in vain"

    monkeypatch.setattr(Told, "_shorten", in_vain)
    twin = referenced()
    while len(tried) < 4:
        twin.query("@0P")
    assert min(np.diff(tried)) >= OFTEN


def test_of_more_bytes_than_are_kept_there_is_no_state_until_the_machine_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    """In motion the controller cannot be pickled, and what it has received is not kept."""
    monkeypatch.setattr(told, "MOST_BYTES", 20)
    twin = referenced()
    twin.write(b"@0A8000,2000,0,30,0,30,0,30\r")
    twin.run(1.0)
    with pytest.raises(StateError, match=r"^the controller Imc\w* cannot be saved now: "):
        twin.save()
    twin.run_until_idle()
    twin.restore(twin.save())


def test_a_state_of_another_kind_is_one_line() -> None:
    state = referenced().save()
    for twin, line in (
        (Twin(), "a state of imc-s8 on 4030, plant kinematic cannot be restored into imc-s8 on 4030, plant mujoco$"),
        (Twin(controller="ismif", plant="kinematic"), "into ismif on 4030, plant kinematic"),
        (Twin("traverse", plant="kinematic"), "into imc-s8 on traverse, plant kinematic"),
        (Twin(plant="kinematic", overrides={"payload.mass": 3.0}), "differ in overrides, machine file, scenario"),
    ):
        before = twin.time_ns, twin.counts.tolist(), twin.position_mm.tolist()
        with pytest.raises(StateError, match=line) as error:
            twin.restore(state)
        assert "\n" not in str(error.value)
        assert (twin.time_ns, twin.counts.tolist(), twin.position_mm.tolist()) == before


@pytest.mark.parametrize("what", [None, b"state", 5], ids=repr)
def test_what_is_no_state_is_one_line(what: Any) -> None:
    with pytest.raises(StateError, match=rf"^restore takes a state that save has returned, not {type(what).__name__}$"):
        Twin(plant="kinematic").restore(what)


def test_a_state_never_changes() -> None:
    state: Any = Twin(plant="kinematic").save()
    for part, name in ((state, "time_ns"), (state.kind, "digest")):
        with pytest.raises(FrozenInstanceError):
            setattr(part, name, getattr(part, name))


def test_what_of_a_twin_cannot_be_pickled_is_one_line() -> None:
    with pytest.raises(StateError, match=r"^the twin cannot be saved: .*pickle.*; see docs/controllers\.md$"):
        pack({"when": lambda: 0}, {}, {})


def test_observers_stay_and_look_on_their_grid() -> None:
    twin, looks = referenced(), list[int]()
    twin.run_until(10_000_000_000)
    state = twin.save()
    twin.observe(lambda twin: looks.append(twin.time_ns), 300_000_000)
    twin.run(1.0)
    twin.restore(state)
    looks.clear()
    twin.run(0.7)
    assert looks == [10_300_000_000, 10_600_000_000]


def test_samples_go_on_from_the_time_it_is() -> None:
    """And are those of a twin that has never been elsewhere."""
    taken: dict[str, list[TwinSamples]] = {"back": [], "straight": []}
    for name, samples in taken.items():
        twin = referenced("mujoco")
        sampler = twin.sample(samples.append, 1_000_000)
        assert sampler is not None
        twin.write(b"@0A1500,4000,900,3000,0,100,0,100\r")
        twin.run(0.1)
        if name == "back":
            state = twin.save()
            twin.run(0.2)
            twin.restore(state)
            cut = len(samples)
            begin_ns = twin.time_ns
        twin.run(1.5)
        sampler.hand_on()
    columns = ("time_ns", "counts", "position_mm", "velocity_mm_s", "lost_steps", "margin", "current_fraction")
    for column in columns:
        back = np.concatenate([getattr(part, column) for part in taken["back"][cut:]])
        times = np.concatenate([part.time_ns for part in taken["straight"]])
        straight = np.concatenate([getattr(part, column) for part in taken["straight"]])[times > begin_ns]
        assert back.tobytes() == straight.tobytes(), column


def test_nobody_saves_in_the_middle_of_it() -> None:
    twin, lines = referenced(), list[str]()

    def look(twin: Twin) -> None:
        for act in (twin.save, partial(twin.restore, state)):
            try:
                act()
            except StateError as error:
                lines.append(str(error))

    state = twin.save()
    twin.observe(look, None)
    lines.clear()
    twin.set_input("estop", "pressed")
    assert set(lines) == {"a twin is saved and restored between two calls, not by an observer or listener of one"}
    assert twin.save().time_ns == twin.time_ns


def test_a_twin_tells_what_it_is_after_that() -> None:
    """A recording says what a twin was built from; begun at power-on it must be possible to play it again."""
    twin, other = Twin(plant="kinematic", seed=1), Twin(plant="kinematic", seed=2, start_mm=(4.0, 5.0, 6.0))
    twin.restore(other.save())
    assert (twin.origin.seed, twin.origin.start_mm) == (2, (4.0, 5.0, 6.0))


def test_a_twin_that_is_recorded_does_not_go_back() -> None:
    twin = referenced()
    state = twin.save()
    twin.run(0.1)
    with Recorder(twin, 1_000_000), pytest.raises(StateError, match="being recorded cannot go to another time"):
        twin.restore(state)
    twin.restore(state)
    assert twin.time_ns == state.time_ns


def test_whoever_keeps_the_flash_gets_that_of_the_state() -> None:
    twin, kept = referenced(), list[bytes]()
    twin.on_flash = kept.append
    assert twin.query("@0IW") == "0"
    state = twin.save()
    assert (twin.query("@0IJ120"), twin.query("@0IW")) == ("0", "0")
    twin.restore(state)
    assert kept == [kept[0], kept[1], kept[0]]


def test_the_life_of_a_controller_stays_short() -> None:
    """However long it lives: what it was told is dropped when it can be pickled, at rest."""
    twin = referenced()
    for _ in range(1000):
        twin.query("@0A10,1000,0,1000,0,100,0,100")
    assert len(twin._told._calls) < 2 * OFTEN
    state, seen = twin.save(), went(twin)
    twin.restore(state)
    assert went(twin) == seen


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_another_twin_is_as_if_it_had_been_built(plant: str) -> None:
    """Whatever the one it comes from has been through, its model included."""
    one = referenced(plant)
    one.carry_out(event_now({"payload_kg": {"table": 9.0}, "friction_n": {"x": 200.0}}, PLACE, one.settable))
    other, built = one.another(8, (4.0, 5.0, 1.0)), Twin("4030", "imc-s8", plant, 8, start_mm=(4.0, 5.0, 1.0))
    for twin in (other, built):
        twin.write(b"@07\r@0R7\r@0A1500,4000,900,3000,0,100,0,100\r")
    assert went(other) == went(built)
    assert other.origin.seed == 8
    assert one.another(1).machine_position_mm.tolist() == Twin("4030", plant=plant, seed=1).machine_position_mm.tolist()


def test_servo_drives_and_a_controller_that_only_tells_its_life() -> None:
    """The GMI99 on three servo axes, one of which hits something: its loops, heat and following errors."""
    twin, other = (Twin("4030-servo", "gmi99", seed=seed, start_mm=(3.0, 2.0, 1.0)) for seed in (1, 2))
    for data in twin.language.reference():
        twin.write(data)
        assert twin.run_until_idle(60.0)
    twin.carry_out(event_now({"obstacle_mm": {"x": 12.0}}, PLACE, twin.settable))
    twin.write(twin.language.move([6400, 2000, 100], MoveSettings(4000, 100, 300))[-1])
    twin.run(0.7)
    assert twin.velocity_mm_s[0] > 1.0
    state, seen = pickle.loads(pickle.dumps(twin.save())), went(twin, 4.0)
    other.restore(state)
    assert went(other, 4.0) == seen
    twin.restore(state)
    assert went(twin, 4.0) == seen
