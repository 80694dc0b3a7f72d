"""The models of the FMUs: a twin behind the variables of FMI 3.0.

    parameters    machine, controller, plant, scenario, seed, job       set before initialisation ends
    inputs        what somebody operates, forces, and either bytes for the line or set points
    outputs       positions, speeds, errors, counters, lost steps, margins, switches, power

Inputs act at the beginning of a step. Virtual time is the communication point less the start time, in whole ns and
never a sum of step sizes, so with bytes any division of the time gives the same bits. The start time is where the
first step begins: pythonfmu3 0.3.4 tells it nobody before. A state is the bytes of `Twin.save` and the inputs.
"""

from __future__ import annotations

import ctypes
import functools
import math
import pickle
import uuid
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pythonfmu3 import Boolean, Float64, Fmi3Slave, Int32, Int64, String
from pythonfmu3.default_experiment import DefaultExperiment
from pythonfmu3.enums import Fmi3Causality, Fmi3Initial, Fmi3Status, Fmi3Variability
from pythonfmu3.fmi3slave import Fmi3StepResult
from pythonfmu3.unit import Unit

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.files import sealed, unsealed
from isel_twin.base.units import SECOND_NS
from isel_twin.core.spec import TwinSpec
from isel_twin.core.state import StateError
from isel_twin.core.twin import Twin
from isel_twin.language import set_points_language
from isel_twin.motion.time_law import LONGEST_NS
from isel_twin.version import VERSION

# inputs for people's acts: element of the cabinet, its state when False and when True
ACTS: Mapping[str, tuple[str, str, str]] = {
    "hood_open": ("hood", "closed", "open"),
    "estop_pressed": ("estop", "released", "pressed"),
    "key_setup": ("key", "automatic", "setup"),
    "power_pressed": ("power", "off", "on"),
    "start_down": ("start", "up", "down"),
    "stop_down": ("stop", "up", "down"),
    "probe_touched": ("probe", "free", "touched"),
}
SWITCHES = tuple(f"limit_{axis}{side}" for axis in CARRIAGES for side in (1, 2))
_KINDS = {float: Float64, int: Int64, bool: Boolean, str: String}

# what the wrapper calls of an instance
_CALLED = (
    *("setup_experiment", "enter_initialization_mode", "exit_initialization_mode", "do_step", "set_time", "terminate"),
    *("get_boolean", "get_float64", "get_int32", "get_int64", "get_string", "get_uint64", "_get_fmu_state"),
    *("set_boolean", "set_float64", "set_int32", "set_int64", "set_string", "set_uint64", "_set_fmu_state"),
)


def _balanced(method: Callable[..., Any]) -> Callable[..., Any]:
    """The method, whose exceptions do not cost the objects that are in use (bridge/34).

    At each exception the wrapper of pythonfmu3 0.3.4 lets go of the instance, its class and its log, keeps using them,
    and lets go of them once more with the instance. So it gets here what it lets go of too often.
    """
    hold = ctypes.PYFUNCTYPE(None, ctypes.py_object)(("Py_IncRef", ctypes.pythonapi))

    @functools.wraps(method)
    def call(slave: Any, *arguments: Any) -> Any:
        try:
            return method(slave, *arguments)
        except BaseException:
            for owned in (slave, type(slave), slave.log_queue):
                hold(owned)
            raise

    return call


def _balance(slave: type[_TwinSlave]) -> type[_TwinSlave]:
    for name in _CALLED:
        setattr(slave, name, _balanced(getattr(slave, name)))
    return slave


@_balance
class _TwinSlave(Fmi3Slave):
    """What both interfaces have."""

    interface = ""
    fixed: Mapping[str, Any] = {}  # parameters beyond the common ones, with their starts
    free: Mapping[str, Any] = {}  # inputs beyond the common ones

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.author, self.version, self.license = "isel-twin", VERSION, "Apache-2.0"
        self.description = "A gantry of isel with its drives, mechanics, switches and control cabinet"
        self.guid = uuid.uuid5(uuid.NAMESPACE_URL, f"isel-twin {VERSION} {self.interface}")
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=10.0, step_size=0.005)
        self.register_units([Unit("mm", m=1, factor=1e-3), Unit("mm/s", m=1, s=-1, factor=1e-3)])
        self.register_units([Unit("N", kg=1, m=1, s=-2), Unit("V", kg=1, m=2, s=-3, A=-1), Unit("s", s=1)])
        self.time = 0.0
        self.start_s: float | None = None  # None until the first step, where time begins (bridge/36)
        self.twin: Twin | None = None
        self.values: dict[str, Any] = {}  # of parameters and inputs
        self._applied: dict[str, Any] = {}  # inputs, as the twin knows them
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous, unit="s")
        )
        for name, start in {"machine": "4030", "plant": "mujoco", "scenario": "", **self.fixed}.items():
            self._given(String(name, start=start, **_fixed()), start)
        self._given(Int32("seed", start=0, **_fixed()), 0)
        acts = {**dict.fromkeys(ACTS, False), "power_pressed": True}
        for name, start in {**acts, **self.free}.items():
            discrete = {"causality": Fmi3Causality.input, "variability": Fmi3Variability.discrete}
            self._given(_KINDS[type(start)](name, start=start, **discrete), start)
        for axis in CARRIAGES:
            held = {"causality": Fmi3Causality.input, "variability": Fmi3Variability.continuous}
            self._given(Float64(f"force_{axis}", start=0.0, unit="N", **held), 0.0)
        for name, unit, start, read in self._shown():
            self._shows(name, unit, start, read)

    # Of FMI

    def exit_initialization_mode(self) -> None:
        """Build the twin. Raises CallError with one line for wrong parameters."""
        self.twin = self._built()

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        start_s = current_time if self.start_s is None else self.start_s
        end_s = current_time + step_size
        twin, why = self.twin, self._impossible(start_s, step_size, end_s)
        if twin is None or why:
            self.log(why or "there is no twin: it is terminated", Fmi3Status.discard)
            return Fmi3StepResult(status=Fmi3Status.discard)
        self.start_s = start_s
        try:
            self._operate(twin)
            self._step(twin, round((end_s - start_s) * SECOND_NS))
        except ValueError as error:
            self.log(" ".join(str(error).split()), Fmi3Status.error)
            return Fmi3StepResult(status=Fmi3Status.error)
        self.time = end_s
        return Fmi3StepResult(status=Fmi3Status.ok)

    def terminate(self) -> None:
        self.twin = None

    def _get_fmu_state(self) -> bytes:
        return sealed(pickle.dumps(self._state()))

    def _set_fmu_state(self, state: bytes) -> None:
        """Raises StateError for a state of another machine or controller, and changes nothing. A pickle runs code:
        states of strangers are not to be loaded."""
        try:
            given = {**pickle.loads(unsealed(state))}
            if not {"values", "applied", "time", "start", "twin"} <= given.keys():
                raise ValueError
        except Exception:  # damaged bytes raise anything
            raise StateError("this is no state of an FMU of isel-twin, or a damaged one") from None
        self._take(given)

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        return state

    # Of the interfaces

    def _state(self) -> dict[str, Any]:
        state = None if self.twin is None else self.twin.save()
        inputs = {"values": dict(self.values), "applied": dict(self._applied)}
        return {**inputs, "time": self.time, "start": self.start_s, "twin": state}

    def _take(self, state: Mapping[str, Any]) -> None:
        before, self.values = (self.values, self._applied), dict(state["values"])
        try:
            twin = None if state["twin"] is None else self.twin or self._built()  # it may be of another instance
            if twin is not None:
                twin.restore(state["twin"])
        except ValueError:
            self.values, self._applied = before
            raise
        self.twin = twin
        self._applied, self.time, self.start_s = dict(state["applied"]), state["time"], state["start"]

    @property
    def _controller(self) -> str:
        raise NotImplementedError

    def _overrides(self) -> dict[str, Any]:
        return {}

    def _begin(self, twin: Twin) -> None:
        raise NotImplementedError

    def _step(self, twin: Twin, end_ns: int) -> None:
        raise NotImplementedError

    # Inside

    def _impossible(self, start_s: float, step_s: float, end_s: float) -> str:
        """Why a step cannot be made, "" if it can."""
        if not step_s > 0.0:
            return f"a step of {step_s} s; allowed: more than 0"
        if self.start_s is not None and end_s < self.time:
            return f"time runs backwards, from {self.time} s to {end_s} s; set an earlier state first"
        if not (end_s - start_s) * SECOND_NS < LONGEST_NS:
            return f"virtual time would be {end_s - start_s} s; allowed: up to {LONGEST_NS // SECOND_NS}"
        return ""

    def _built(self) -> Twin:
        given = self.values
        scenario = Path(given["scenario"]) if given["scenario"] else None
        spec = TwinSpec(given["machine"], self._controller, given["plant"], int(given["seed"]), scenario)
        twin = spec.with_(overrides=self._overrides()).build()
        self._applied = {**dict.fromkeys(ACTS, False), "power_pressed": True}
        self._begin(twin)
        return twin

    def _given(self, variable: Any, start: Any) -> None:
        name = variable.name
        self.values[name] = start
        variable.getter = lambda: self.values[name]
        variable.setter = lambda value: self.values.__setitem__(name, value)
        self.register_variable(variable)

    def _shows(self, name: str, unit: str | None, start: Any, read: Callable[[Twin], Any]) -> None:
        kind = _KINDS[type(start)]
        continuous = kind is Float64
        how: dict[str, Any] = {"unit": unit} if unit else {}
        variable = kind(
            name,
            causality=Fmi3Causality.output,
            variability=Fmi3Variability.continuous if continuous else Fmi3Variability.discrete,
            initial=Fmi3Initial.calculated,
            getter=lambda: start if self.twin is None else type(start)(read(self.twin)),
            **how,
        )
        self.register_variable(variable)

    def _shown(self) -> Iterator[tuple[str, str | None, Any, Callable[[Twin], Any]]]:
        for at, axis in enumerate(CARRIAGES):
            yield f"position_{axis}", "mm", 0.0, _entry("position_mm", at)
            yield f"velocity_{axis}", "mm/s", 0.0, _entry("velocity_mm_s", at)
            yield f"error_{axis}", "mm", 0.0, _entry("position_error_mm", at)
            yield f"counter_{axis}", None, 0, _entry("counts", at)
            yield f"lost_{axis}", None, 0.0, _entry("lost_steps", at)
            yield f"margin_{axis}", None, 0.0, _entry("margin", at)
        for name in SWITCHES:
            yield name, None, False, partial(_struck, name)
        yield "power", None, False, lambda twin: twin.outputs.get("power", 0)
        yield "spindle", None, False, lambda twin: twin.outputs.get("spindle_runs", 0)
        yield "idle", None, False, lambda twin: twin.idle
        yield "fault", None, False, lambda twin: twin.fault
        yield "supply_v", "V", 0.0, lambda twin: 0.0 if math.isnan(twin.supply_v) else twin.supply_v

    def _operate(self, twin: Twin) -> None:
        for name, (element, off, on) in ACTS.items():
            if bool(self.values[name]) != bool(self._applied[name]):
                self._applied[name] = bool(self.values[name])
                twin.set_input(element, on if self.values[name] else off)
        for at, axis in enumerate(CARRIAGES):
            name = f"force_{axis}"
            if self.values[name] != self._applied.get(name, 0.0):
                self._applied[name] = self.values[name]
                twin.apply_force(at, float(self.values[name]))


class SerialTwin(_TwinSlave):
    """Bytes for the controller's line, as Latin-1 text: `to_controller` is sent at the beginning of a step and cleared;
    `from_controller` are those that came in the last step. `job`: lines sent at the start, each with its end."""

    interface = "serial"
    fixed: Mapping[str, Any] = {"controller": TwinSpec.controller, "job": ""}
    free: Mapping[str, Any] = {"to_controller": ""}

    def __init__(self, **kwargs: Any) -> None:
        self._received = ""
        super().__init__(**kwargs)
        self._shows("from_controller", None, "", lambda _: self._received)

    @property
    def _controller(self) -> str:
        return str(self.values["controller"])

    def _begin(self, twin: Twin) -> None:
        for line in self.values["job"].splitlines():
            if twin.language is not None and line.strip():
                twin.write(twin.language.frame(line))

    def _step(self, twin: Twin, end_ns: int) -> None:
        data, self.values["to_controller"] = self.values["to_controller"].encode("latin-1"), ""
        if data:
            twin.write(data)
        twin.run_until(end_ns)
        self._received = twin.read().decode("latin-1")

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), "received": self._received}

    def _take(self, state: Mapping[str, Any]) -> None:
        super()._take(state)
        self._received = state["received"]


class StepsTwin(_TwinSlave):
    """Counters of another control, reached evenly at the end of each step; power and stages are on."""

    interface = "steps"
    free: Mapping[str, Any] = {f"command_{axis}": 0 for axis in CARRIAGES}

    def __init__(self, **kwargs: Any) -> None:
        self._name, self._language = set_points_language()
        super().__init__(**kwargs)

    @property
    def _controller(self) -> str:
        return self._name

    def _overrides(self) -> dict[str, Any]:
        return dict(self._language.unwatched)

    def _begin(self, twin: Twin) -> None:
        for data in self._language.begin_rows():
            twin.write(data)
        twin.run_until_idle()
        twin.read()

    def _step(self, twin: Twin, end_ns: int) -> None:
        """Longer steps are several rows; what is shorter than a row passes with the next step."""
        begin_ns, begin = twin.time_ns, [int(count) for count in twin.counts]
        target = [int(self.values[f"command_{axis}"]) for axis in CARRIAGES]
        took_ns = end_ns - begin_ns
        rows = 0 if took_ns < self._language.shortest_ns else -(-took_ns // self._language.longest_ns)
        for row in range(1, rows + 1):
            until_ns = begin_ns + took_ns * row // rows
            counters = [at + (to - at) * row // rows for at, to in zip(begin, target, strict=False)]
            sent = self._language.row(until_ns - twin.time_ns, counters)
            twin.write(sent)
            twin.run_until(until_ns)
            answer = twin.read()
            if not self._language.accepted(sent, answer):
                raise ValueError(f"step to {until_ns} ns: {answer.decode('latin-1').strip() or 'no answer'}")


def _entry(name: str, at: int) -> Callable[[Twin], Any]:
    """Reads one entry of an array of the twin."""
    return lambda twin: getattr(twin, name)[at]


def _struck(switch: str, twin: Twin) -> bool:
    return twin.inputs.get(switch) == "struck"


def _fixed() -> dict[str, Any]:
    return {"causality": Fmi3Causality.parameter, "variability": Fmi3Variability.fixed}
