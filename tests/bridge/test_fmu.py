"""FMUs by a client that is not ours: fmpy validates them, and steps them to the bits of the twin itself."""

from __future__ import annotations

import gc
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from isel_twin import Twin
from isel_twin.base.files import sealed
from isel_twin.bridge.fmu import slaves
from isel_twin.core.spec import TwinSpec
from isel_twin.core.state import StateError
from tests.in_process import isel_twin

START = {"plant": "mujoco", "seed": 3}
STEP_S = 0.02
MOVE = ("@07", "@0N7", "@0A1600,2000,800,2000,0,900,0,900")
SENT = "".join(f"{line}\r" for line in MOVE)


class Model:
    """An instance in a tool: set and get by name."""

    def __init__(self, path: Path, folder: Path, values: Mapping[str, Any], start_s: float = 0.0) -> None:
        self.description = read_model_description(str(path))
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        identifier = self.description.coSimulation.modelIdentifier
        self.fmu = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=str(extract(str(path), unzipdir=str(folder))),
            modelIdentifier=identifier,
            instanceName=identifier,
        )
        self.fmu.instantiate()
        for name, value in values.items():
            self.set(name, value)
        self.fmu.enterInitializationMode(startTime=start_s)
        self.fmu.exitInitializationMode()
        self.time_s = start_s

    def set(self, name: str, value: Any) -> None:
        variable = self.variables[name]
        getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [value])

    def get(self, name: str) -> Any:
        variable = self.variables[name]
        (value,) = getattr(self.fmu, f"get{variable.type}")([variable.valueReference])
        return value.decode("latin-1") if isinstance(value, bytes) else value

    def step(self, step_s: float = STEP_S) -> None:
        self.fmu.doStep(currentCommunicationPoint=self.time_s, communicationStepSize=step_s)
        self.time_s = round(self.time_s + step_s, 9)

    @property
    def place(self) -> list[float]:
        return [self.get(f"{what}_{axis}") for what in ("position", "velocity", "lost") for axis in "xyz"]


def place(twin: Twin) -> list[float]:
    return np.concatenate([twin.position_mm, twin.velocity_mm_s, twin.lost_steps[:3]]).tolist()


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fmu")
    for interface in ("serial", "steps"):
        done = isel_twin("fmu", folder / f"{interface}.fmu", "--interface", interface)
        assert (done.returncode, done.stderr) == (0, "")
    return folder


@pytest.fixture
def model(built: Path, tmp_path: Path) -> Iterator[Callable[..., Model]]:
    opened: list[Model] = []

    def open_one(interface: str, start_s: float = 0.0, **values: Any) -> Model:
        folder = tmp_path / str(len(opened))
        opened.append(Model(built / f"{interface}.fmu", folder, {**START, **values}, start_s))
        return opened[-1]

    yield open_one
    for one in opened:
        one.fmu.terminate()
        one.fmu.freeInstance()


@pytest.mark.parametrize("interface", ["serial", "steps"])
def test_it_is_valid(built: Path, interface: str) -> None:
    path = str(built / f"{interface}.fmu")
    assert validate_fmu(path) == []
    described = read_model_description(path)
    means = described.coSimulation
    assert means.canHandleVariableCommunicationStepSize
    assert (means.canGetAndSetFMUstate, means.canSerializeFMUstate) == (True, True)
    units = {unit.name: unit.baseUnit for unit in described.unitDefinitions}
    assert {name: (unit.factor, unit.kg, unit.m, unit.s, unit.A) for name, unit in units.items()} == {
        "mm": (1e-3, 0, 1, 0, 0),
        "mm/s": (1e-3, 0, 1, -1, 0),
        "N": (1.0, 1, 1, -2, 0),
        "V": (1.0, 1, 2, -3, -1),
        "s": (1.0, 0, 0, 1, 0),
    }
    starts = {variable.name: variable.start for variable in described.modelVariables}
    plain = TwinSpec()
    assert (starts["machine"], starts["plant"], starts["seed"]) == (plain.machine, plain.plant, str(plain.seed))


def test_bytes_of_a_host_to_the_bits_of_the_twin_and_back(model: Callable[..., Model]) -> None:
    """Steps of two sizes; then back to the middle, by a state and by its bytes: the same bits again."""
    one, twin = model("serial", controller="imc-s8"), Twin(**START)
    sent = {2: "@07\r@0N7\r", 5: "@0A1600,2000,800,2000,0,900,0,900\r"}
    replies: list[str] = []
    middle: Any = None
    seen: list[list[float]] = []
    for step in range(40):
        if step == 20:
            middle = one.fmu.getFMUState()
            kept = one.fmu.serializeFMUState(middle)
        one.set("to_controller", sent.get(step, ""))
        twin.write(sent.get(step, "").encode())
        one.step(STEP_S if step < 30 else STEP_S / 3)
        twin.run_until(round(one.time_s * 1e9))
        replies.append(one.get("from_controller"))
        assert replies[-1] == twin.read().decode("latin-1")
        assert one.place == place(twin)
        seen.append(one.place)
    assert replies[2] == "00"
    assert one.get("counter_x") == twin.counts[0]
    assert one.get("time") == pytest.approx(one.time_s, abs=1e-8)
    assert twin.counts[0] > 100
    for again in (middle, one.fmu.deserializeFMUState(kept)):
        one.fmu.setFMUState(again)
        one.time_s = round(20 * STEP_S, 9)
        for step in range(20, 40):
            one.step(STEP_S if step < 30 else STEP_S / 3)
            assert one.place == seen[step]


def test_a_state_goes_into_another_instance(model: Callable[..., Model]) -> None:
    """By its bytes, into one with other parameters that has not begun: the same twin then, with the same start."""
    one, other = model("serial", 100.0), model("serial", seed=8, plant="kinematic")
    one.set("to_controller", SENT)
    for _ in range(5):
        one.step()
    kept = one.fmu.serializeFMUState(one.fmu.getFMUState())
    other.fmu.reset()
    other.fmu.setFMUState(other.fmu.deserializeFMUState(kept))
    other.time_s = one.time_s
    for _ in range(5):
        one.step()
        other.step()
        assert other.place == one.place
        assert other.get("from_controller") == one.get("from_controller")


def test_a_state_of_another_machine_is_refused_and_changes_nothing(model: Callable[..., Model]) -> None:
    one, other, same = model("serial"), model("serial", machine="4030-hf"), model("serial", machine="4030-hf")
    kept = one.fmu.serializeFMUState(one.fmu.getFMUState())
    with pytest.raises(Exception, match=r"fmi3SetFMUState|failed"):
        other.fmu.setFMUState(other.fmu.deserializeFMUState(kept))
    assert other.get("machine") == "4030-hf"
    for each in (other, same):
        each.set("hood_open", True)
        each.step()
    assert (other.get("power"), other.place) == (same.get("power"), same.place)


def test_set_points_of_another_control_and_a_hood(model: Callable[..., Model]) -> None:
    one = model("steps")
    twin = Twin(controller="external", overrides={"controller.watchdog_ms": 0}, **START)
    for line in ("form led", "out power_request=1 stages=1 brake=1"):
        twin.query(line)
    for step in range(1, 30):
        if step == 20:
            one.set("hood_open", True)
            twin.set_input("hood", "open")
        one.set("command_x", 40 * step)
        one.step()
        twin.query(f"row {round(one.time_s * 1e9) - twin.time_ns} {40 * step} 0 0")
        assert one.place == place(twin)
        assert one.get("power") == (step < 20)
    assert one.get("lost_x") > 100


@pytest.mark.parametrize("start_s", [100.0, -7.25, 1e9])
def test_two_instances_by_random_steps_from_any_start(model: Callable[..., Model], start_s: float) -> None:
    """Steps from 1 ns to 0.3 s, in turns with another instance that starts elsewhere: each is the twin to the bit."""
    sizes_s = 10 ** np.random.default_rng(5).uniform(-9, -0.5, 25)
    sizes_s[0] = 1e-6
    pair = [
        (model("serial", start, plant="kinematic"), start, Twin("4030", "imc-s8", "kinematic"))
        for start in (start_s, 0.0)
    ]
    for one, _, twin in pair:
        one.set("to_controller", SENT)
        twin.write(SENT.encode())
    for size_s in sizes_s.tolist():
        for one, start, twin in pair:
            one.fmu.doStep(currentCommunicationPoint=one.time_s, communicationStepSize=size_s)
            one.time_s += size_s
            twin.run_until(round((one.time_s - start) * 1e9))
            assert one.get("time") == one.time_s
            assert one.place == place(twin)
            assert one.get("from_controller") == twin.read().decode()
    assert twin.counts[0] > 500


def test_a_simulation_that_ends_between_steps_with_an_input_that_changes_within_one(built: Path) -> None:
    """The tool divides the time at the input's change and ends where it was asked to: 100.0321 s, not 100.03 s."""
    opened = np.array([(0.0, False), (100.0137, True)], dtype=[("time", np.float64), ("hood_open", np.bool_)])
    result = simulate_fmu(
        str(built / "serial.fmu"),
        start_time=100.0,
        stop_time=100.0321,
        output_interval=0.01,
        start_values={"plant": "kinematic", "job": "\n".join(MOVE)},
        input=opened,
        output=["counter_x", "counter_y", "power"],
    )
    twin = Twin("4030", "imc-s8", "kinematic")
    twin.write(SENT.encode())
    twin.run_until(13_700_000)
    twin.set_input("hood", "open")
    twin.run_until(32_100_000)
    assert result["time"].tolist() == pytest.approx([100.0, 100.01, 100.0137, 100.02, 100.03, 100.0321], abs=1e-9)
    assert [result[f"counter_{axis}"][-1] for axis in "xy"] == list(twin.counts[:2])
    assert result["power"].tolist() == [1, 1, 1, 0, 0, 0]
    assert twin.outputs["power"] == 0


def test_set_points_in_steps_of_any_size(model: Callable[..., Model]) -> None:
    """150 s evenly, as three rows of 50 s; then steps of 0.3 us, in which set points wait for the microsecond."""
    one = model("steps", -100.0, plant="kinematic")
    twin = Twin(controller="external", plant="kinematic", overrides={"controller.watchdog_ms": 0})
    for line in ("form led", "out power_request=1 stages=1 brake=1"):
        twin.query(line)
    one.set("command_x", 12000)
    one.step(150.0)
    for row in (1, 2, 3):
        twin.query(f"row {50 * 10**9 * row - (twin.time_ns if row == 1 else 50 * 10**9 * (row - 1))} {4000 * row} 0 0")
    assert one.place == place(twin)
    assert one.get("counter_x") == 12000
    counters = []
    for step in range(8):
        one.set("command_x", 12001 + step // 4)
        one.fmu.doStep(currentCommunicationPoint=one.time_s, communicationStepSize=3e-7)
        one.time_s += 3e-7
        counters.append(one.get("counter_x"))
    assert counters == [*[12000] * 3, *[12001] * 3, 12001, 12002]


@pytest.mark.parametrize("step_s", [0.0, -0.01, float("nan"), float("inf"), 1e300])
def test_a_step_that_cannot_be_changes_nothing(model: Callable[..., Model], step_s: float) -> None:
    one = model("serial", 100.0, plant="kinematic")
    for begun_s in (100.0, 100.02):
        with pytest.raises(Exception, match=r"fmi3DoStep|failed"):
            one.fmu.doStep(currentCommunicationPoint=begun_s, communicationStepSize=step_s)
        one.step()
    with pytest.raises(Exception, match=r"fmi3DoStep|failed"):
        one.fmu.doStep(currentCommunicationPoint=100.0, communicationStepSize=0.01)
    assert one.get("time") == pytest.approx(100.04, abs=1e-9)


def test_wrong_parameters_and_impossible_steps_are_errors_of_fmi(model: Callable[..., Model]) -> None:
    with pytest.raises(Exception, match=r"fmi3Error|fmi3ExitInitializationMode|failed"):
        model("serial", machine="none")
    one = model("steps")
    one.set("command_x", 10**9)
    with pytest.raises(Exception, match=r"fmi3DoStep|failed"):
        one.step()


def end_initialization_wrongly(model: Model, _: bytes) -> None:
    model.set("machine", "none")
    model.fmu.exitInitializationMode()


def take_the_state_of_another_machine(model: Model, state: bytes) -> None:
    model.fmu.setFMUState(model.fmu.deserializeFMUState(state))


def take_no_state(model: Model, _: bytes) -> None:
    model.fmu.setFMUState(model.fmu.deserializeFMUState(b"no state"))


FLIPPED = bytearray(slaves.StepsTwin(instance_name="steps", resources=".")._get_fmu_state())
FLIPPED[-20] ^= 1


@pytest.mark.parametrize(
    "state",
    [
        b"",
        FLIPPED,
        pickle.dumps(7),
        sealed(pickle.dumps(7)),
        sealed(pickle.dumps({"values": {}})),
        pickle.dumps({"values": {}}),
        pickle.dumps("x" * 99)[:50],
    ],
    ids=["empty", "one bit", "a number", "a sealed number", "sealed parts", "parts", "truncated"],
)
def test_a_damaged_state_is_one_line(state: bytes) -> None:
    slave = slaves.StepsTwin(instance_name="steps", resources=".")
    before = dict(slave.values)
    with pytest.raises(StateError, match=r"^this is no state of an FMU of isel-twin, or a damaged one$"):
        slave._set_fmu_state(bytes(state))
    assert slave.values == before


def ask_for_another_kind(model: Model, _: bytes) -> None:
    model.fmu.getInt32([model.variables["machine"].valueReference])


def give_another_kind(model: Model, _: bytes) -> None:
    model.fmu.setBoolean([model.variables["machine"].valueReference], [True])


@pytest.fixture
def little_to_search() -> Iterator[None]:
    """Garbage collections look at what is made from now on, not at all that a worker has collected and imported."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("little_to_search")
@pytest.mark.parametrize(
    "fail",
    [
        end_initialization_wrongly,
        take_the_state_of_another_machine,
        take_no_state,
        ask_for_another_kind,
        give_another_kind,
    ],
)
def test_errors_free_nothing_that_is_in_use(
    built: Path, tmp_path: Path, model: Callable[..., Model], fail: Callable[[Model, bytes], None]
) -> None:
    """What is freed too early is there no more, or kills the process when garbage is collected: here it is told by the
    counts of references of class and log, after one error, and after two, and after the end of the instance."""
    state = (other := model("serial", plant="kinematic").fmu).serializeFMUState(other.getFMUState())
    wrong = Model(built / "serial.fmu", tmp_path / "wrong", {"plant": "kinematic", "machine": "4030-hf"})
    kind = sys.modules["isel_twin_serial"].IselTwinSerial
    gc.collect()
    (slave,) = (each for each in gc.get_objects() if type(each) is kind and each.values["machine"] == "4030-hf")
    counts = [sys.getrefcount(each) for each in (kind, slave, slave.log_queue)]
    for _ in range(2):
        with pytest.raises(Exception, match=r"failed|fmi3"):
            fail(wrong, state)
        gc.collect()
        assert [sys.getrefcount(each) for each in (kind, slave, slave.log_queue)] == counts
    wrong.fmu.terminate()
    wrong.fmu.freeInstance()
    gc.collect()
    assert [sys.getrefcount(each) for each in (slave, slave.log_queue)] == [counts[1] - 1, counts[2] - 1]


def test_without_the_extra_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pythonfmu3.builder", None)
    done = isel_twin("fmu", tmp_path / "a.fmu")
    assert (done.returncode, done.stderr) == (
        2,
        "isel-twin: fmu needs pythonfmu3: pip install 'isel-twin[fmu]'\n",
    )
    assert isel_twin("fmu", tmp_path / "a.zip").returncode == 2
