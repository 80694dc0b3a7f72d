"""Operating a served machine from outside, as at its cabinet, and with faults, time and state. Control port and panel
use the same functions. No sockets here.

    request, a table with one action  --- Operator.ask --->  answer at once, or a Pending that becomes one

    {"set": {"estop": "pressed"}}, {"force_n": {"x": 50}, "place": "tool"}, {"phase_lost": {"x": "a"}} ...
                                        as an event of a scenario (isel_twin.wiring.scenario), now
    {"pause": true}, {"resume": true}   virtual time stops, goes on; hosts stay connected
    {"step": 0.001}                     seconds of virtual time, while paused
    {"speed": 2}, {"speed": "max"}      times real time, from now on
    {"state": true}                     the machine as it is
    {"watch_margin": true}              least margins and edges of `state` begin anew
    {"settable": true}                  everything that can be set, with its states
    {"keys": true}                      the controller's own keys, {"key": {"mode": "auto"}}, and their values
    {"wait": {"output": "spindle", "is": 1}}      until it is true (`_condition`)
    {"wait": {"level": "p1.0", "is": 1, "edge": true}}         until it becomes true: it has to be otherwise before
    {"stop": true}                      the server ends, as by SIGTERM

Each acts in the loop of the server, at the present virtual time, which the answer contains. A wait ends when its
condition is met: levels, states, idleness, messages, collisions and times to the nanosecond, positions and counters at
multiples of LOOK_NS. With `"pause": true` virtual time stops at that instant, the same one however fast time runs. A
wrong request is a ControlError of one line, and changes nothing.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.parameters import FileError, Limits, Place, hint, known, plain, table
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.bridge.operate.client import PATIENCE_S
from isel_twin.bridge.operate.said import KINDS, Messages
from isel_twin.bridge.serve.pacing import HIGHEST_SPEED, LOWEST_SPEED
from isel_twin.bridge.serve.server import Server
from isel_twin.core.twin import Twin
from isel_twin.jobs.sending import MOST_EDGE, margins
from isel_twin.wiring import ACTS, EVENT_KEYS, event_now

Answer = dict[str, Any]

LOOK_NS = 1 * MILLISECOND_NS  # sampling interval of positions in waits, virtual time
REMARKS = 10  # last remarks of the controller, and last collisions, in a state

_STEP_S = Limits("s", 1e-9, 3600.0)
_SPEED = Limits("times real time, or 'max'", LOWEST_SPEED, HIGHEST_SPEED)
_TIME_S = Limits("s", 0.0, 1e9)
_WALL_S = Limits("s", 0.0, 86_400.0)
_MM = Limits("mm", -1e5, 1e5)
_COUNT = Limits("steps", -1e10, 1e10)

_ACTIONS = ("pause", "resume", "step", "speed", "state", "watch_margin", "settable", "keys", "wait", "stop")
_CONDITIONS = ("output", "input", "level", "position", "count", "idle", "time", "collision", "fault", *KINDS)
_CONDITION_KEYS = (*_CONDITIONS, "is", "above", "below", "edge")
_WAIT_KEYS = (*_CONDITION_KEYS, "timeout_s", "wall_s", "pause")
_SWITCH_STATES = ("free", "struck", "ok")


class ControlError(FileError):
    """A request cannot be carried out and has changed nothing; one line that names the key and what is allowed."""


@dataclass(frozen=True)
class _Condition:
    """A condition to wait for. `look_ns`: latest time of the next check; None: only when something has happened."""

    met: Callable[[], bool]
    look_ns: Callable[[], int] | None = None


@dataclass(eq=False)
class Pending:
    """A request without an answer yet; later `answer` or `error` is set."""

    condition: _Condition
    until_ns: int | None  # virtual time at which it is given up
    until_wall_s: float  # the same in wall time
    what: str
    pause: bool = False
    answer: Answer | None = None
    error: str = ""

    @property
    def over(self) -> bool:
        return self.answer is not None or bool(self.error)


class Operator:
    """Acts on the twin of a server; used in the thread of its loop only."""

    def __init__(self, server: Server, twin: Twin) -> None:
        self._server = server
        self._pacer = server.pacer
        self._twin = twin
        self._pending: list[Pending] = []
        self._messages: Messages | None = None  # from the first wait for one on

    def ask(self, request: Any) -> Answer | Pending:
        """Carry out one request. Raises ControlError."""
        place = Place("request", ControlError)
        content = table(request, place)
        actions = [key for key in content if key in _ACTIONS]
        known(content, (*_ACTIONS, *EVENT_KEYS), place)
        if len(actions) > 1 or (actions and len(content) > 1):
            raise place.wrong(f"{', '.join(content)}: one of them at a time")
        self._server.present()
        if not actions:
            return self._done(request, lambda: self.happen(content))
        (key,) = actions
        where, value = place.at(key), content[key]
        acts: dict[str, Callable[[Any, Place], Answer | Pending]]
        acts = {"step": self._step, "speed": self._speed, "wait": self._wait}
        if key in acts:
            return self._done(request, lambda: acts[key](value, where))
        if value is not True:
            raise where.wrong(f"{_shown(value)}; allowed: true")
        if key == "state":
            return self.state()
        if key == "settable":
            return {name: list(states) for name, states in self.settable.items()}
        if key == "keys":
            return {name: f"{one.meaning}: {one.allowed}" for name, one in self._twin.keys.items()}
        plain_acts = {"pause": self.pause, "resume": self.resume, "stop": self.stop, "watch_margin": self.watch_margin}
        return self._done(request, plain_acts[key])

    def _done(self, request: Any, act: Callable[[], Answer | Pending]) -> Answer | Pending:
        """The action's result; the action is logged."""
        result = act()
        self._server.act(json.dumps(request))
        return result

    # What can be done

    @property
    def settable(self) -> Mapping[str, tuple[str, ...]]:
        return self._twin.settable

    def happen(self, content: dict[str, Any]) -> Answer:
        """Let an event of a scenario (without `at`) happen now; the answer has the inputs or keys that it set."""
        place = Place("request", ControlError)
        event = event_now(content, place, self.settable, self._twin.keys)
        if event.physical and not self._twin.physics:
            key = next(key for key in content if key in ACTS and ACTS[key].physical)
            raise place.at(key).wrong("does nothing without physics; allowed: with the plant mujoco")
        self._twin.carry_out(event)
        inputs = self._twin.inputs
        keys = {"keys": dict(self._twin.key_values)} if "key" in event.acts else {}
        return self._now() | {"inputs": {name: inputs.get(name, "ok") for name in event.acts.get("set", {})}} | keys

    def pause(self) -> Answer:
        """Stop virtual time, even in the middle of a step."""
        self._pacer.pause(self._twin.time_ns)
        return self._now()

    def watch_margin(self) -> Answer:
        """Let the least margins and edges begin anew."""
        self._twin.watch_margin()
        return self._now()

    def resume(self) -> Answer:
        if self._pacer.paused:
            self._server.go_on(self._pacer.speed)
        return self._now()

    def speed(self, speed: float | None) -> Answer:
        """Set the speed of virtual time (None: `max`); while paused, the speed after the pause.

        At a finite speed bytes take their time on the line, as at the start of a server.
        """
        self._twin.line_speed = speed is not None
        self._server.go_on(speed, self._pacer.paused)
        return self._now()

    def step(self, step_ns: int) -> Pending:
        """Let step_ns of virtual time pass; raises ControlError unless paused."""
        if not self._pacer.paused:
            raise ControlError("request: step: virtual time does not stand still; allowed: after pause")
        end_ns = self._pacer.step(step_ns)
        made = _Condition(lambda: self._twin.time_ns >= end_ns, lambda: end_ns)
        return self._add(Pending(made, None, math.inf, "step"))

    def stop(self) -> Answer:
        self._server.stop()
        return self._now()

    def wait(
        self, condition: _Condition, timeout_ns: int | None, wall_s: float = PATIENCE_S, pause: bool = False
    ) -> Pending:
        """Wait for a condition, with limits in virtual and in wall time; `pause`: stop time when it is met."""
        until_ns = None if timeout_ns is None else self._twin.time_ns + timeout_ns
        return self._add(Pending(condition, until_ns, self._pacer.wall_s + wall_s, "wait", pause))

    def trigger(self, value: Any, place: Place) -> Pending:
        """Pause at the instant at which a condition of `wait` becomes true, however long that takes."""
        content = table(value, place)
        known(content, _CONDITION_KEYS, place)
        return self.wait(self._edge({**content, "edge": True}, place), None, math.inf, pause=True)

    def forget(self, pending: Pending) -> None:
        """Drop a request whose client has gone."""
        if pending in self._pending:
            self._pending.remove(pending)
        self._mind()

    def end(self) -> None:
        """End of the server: every wait fails."""
        for pending in self._pending:
            pending.error = f"{pending.what}: the server stops"
        self._pending.clear()
        self._mind()

    def state(self) -> Answer:
        twin, least = self._twin, margins(self._twin)
        return self._now() | {
            "machine": twin.machine.name,
            "seed": twin.origin.seed,
            "controller": twin.controller_name,
            "physics": twin.physics,
            "speed": "max" if self._pacer.speed is None else self._pacer.speed,
            "paused": self._pacer.paused,
            "idle": twin.idle,
            "fault": twin.fault,
            "fault_cause": twin.fault_cause,
            "counts": twin.counts.tolist(),
            "step_mm": twin.step_mm.tolist(),
            "position_mm": twin.position_mm.tolist(),
            "position_error_mm": twin.position_error_mm.tolist(),
            "machine_position_mm": twin.machine_position_mm.tolist(),
            "lost_steps": twin.lost_steps.tolist(),
            "slip_steps": twin.slip_steps.tolist(),
            "forgotten_steps": twin.forgotten_steps.tolist(),
            "following_error": twin.following_error.tolist(),
            "drive_faults": [list(fault) for fault in twin.drive_faults],
            "edge": [round(edge, 3) if edge < MOST_EDGE else None for edge in twin.speed_edge.tolist()],
            "margin_since_s": twin.margin_since_ns / SECOND_NS,
            "margin": list(least["margin"]),
            "margin_band": [ends and list(ends) for ends in least["margin_band"]],
            "inputs": dict(twin.inputs),
            "outputs": dict(twin.outputs),
            "keys": dict(twin.key_values),
            "unfinished": twin.unfinished,
            "levels": {terminal: int(level) for terminal, level in twin.levels.items()},
            "faults": dict(twin.faults),
            "events_left": twin.events_left,
            "serial_format": str(twin.serial_format),
            "ports": self._server.ports(),
            "collisions": [collision.content for collision in twin.collisions[-REMARKS:]],
            "remarks": [[time_ns / SECOND_NS, text] for time_ns, text in list(twin.remarks)[-REMARKS:]],
        }

    # The pacer's onlooker

    def look_ns(self) -> int | None:
        times = [pending.until_ns for pending in self._pending if pending.until_ns is not None]
        times += [pending.condition.look_ns() for pending in self._pending if pending.condition.look_ns is not None]
        return min((time_ns for time_ns in times if time_ns > self._twin.time_ns), default=None)

    def look(self) -> bool:
        """True if a wait is over: the pacer then stops computing, so that the answer leaves at once."""
        for pending in self._pending:
            self._judge(pending)
        over = any(pending.over for pending in self._pending)
        if over:
            self._pending = [pending for pending in self._pending if not pending.over]
            self._mind()
        return over

    @property
    def wait_s(self) -> float | None:
        """Wall seconds until the first wait times out."""
        if not self._pending:
            return None
        return max(0.0, min(pending.until_wall_s for pending in self._pending) - self._pacer.wall_s)

    # Inside

    def _now(self) -> Answer:
        return {"time_s": self._twin.time_ns / SECOND_NS, "time_ns": self._twin.time_ns}

    def _add(self, pending: Pending) -> Pending:
        self._judge(pending)
        if not pending.over:
            self._pending.append(pending)
            self._mind()
        return pending

    def _mind(self) -> None:
        """Be an onlooker of the pacer only during waits, as checks cost time."""
        if bool(self._pending) != (self in self._pacer.onlookers):
            (self._pacer.onlookers.append if self._pending else self._pacer.onlookers.remove)(self)

    def _judge(self, pending: Pending) -> None:
        if pending.condition.met():
            pending.answer = self._now()
            if pending.pause:
                self._pacer.pause(self._twin.time_ns)
        elif pending.until_ns is not None and self._twin.time_ns >= pending.until_ns:
            pending.error = "wait: not so in time: timeout_s of virtual time has passed"
        elif self._pacer.wall_s >= pending.until_wall_s:
            pending.error = "wait: not so in time: wall_s of wall time has passed"
        elif pending.what == "step" and (self._pacer.hold_ns is None or self._twin.time_ns >= self._pacer.hold_ns):
            pending.error = "step: broken off by pause or resume"

    def _step(self, value: Any, place: Place) -> Pending:
        return self.step(round(plain(value, _STEP_S, place) * SECOND_NS))

    def _speed(self, value: Any, place: Place) -> Answer:
        return self.speed(None if value == "max" else plain(_number(value, _SPEED, place), _SPEED, place))

    def _wait(self, value: Any, place: Place) -> Pending:
        content = table(value, place)
        known(content, _WAIT_KEYS, place)
        condition = self._edge(content, place)
        timeout_ns = None
        if "timeout_s" in content:
            where = place.at("timeout_s")
            timeout_ns = round(plain(_number(content["timeout_s"], _TIME_S, where), _TIME_S, where) * SECOND_NS)
        wall_s = plain(content.get("wall_s", PATIENCE_S), _WALL_S, place.at("wall_s"))
        pause = content.get("pause", False)
        if not isinstance(pause, bool):
            raise place.at("pause").wrong(f"{_shown(pause)}; allowed: true, false")
        return self.wait(condition, timeout_ns, wall_s, pause)

    def _edge(self, content: dict[str, Any], place: Place) -> _Condition:
        """The condition or, with `edge`, that it becomes so after it has not been."""
        edge = content.get("edge", False)
        if not isinstance(edge, bool):
            raise place.at("edge").wrong(f"{_shown(edge)}; allowed: true, false")
        condition = self._condition(content, place)
        if not edge:
            return condition
        armed = False

        def met() -> bool:
            nonlocal armed
            so = condition.met()
            begins, armed = so and armed, not so
            return begins

        return _Condition(met, condition.look_ns)

    def _condition(self, content: dict[str, Any], place: Place) -> _Condition:
        """Exactly one of these.

            {"output": NAME, "is": NUMBER}     {"input": NAME, "is": STATE}     {"level": TERMINAL, "is": 0 or 1}
            {"position": AXIS, "above": MM}    {"count": AXIS, "below": STEPS}  {"idle": true}    {"time": SECONDS}
            {"collision": true}                two bodies have met since        {"fault": true}   the controller's error
            {"replied": TEXT}, {"sent": TEXT}, {"remark": TEXT}      one that contains it is complete, from now on

        Positions are true ones in the zero and direction of the counters; `above` and `below` may be combined.
        """
        twin = self._twin
        keys = [key for key in _CONDITIONS if key in content]
        if len(keys) != 1:
            raise place.wrong(f"{', '.join(keys) or 'nothing'} to wait for; allowed: one of {', '.join(_CONDITIONS)}")
        (key,) = keys
        value, where = content[key], place.at(key)
        self._check_companions(content, key, place)
        if key in ("idle", "collision", "fault"):
            if value is not True:
                raise where.wrong(f"{_shown(value)}; allowed: true")
            before = len(twin.collisions)
            so = {
                "idle": lambda: twin.idle,
                "collision": lambda: len(twin.collisions) > before,
                "fault": lambda: bool(twin.fault),
            }
            return _Condition(so[key])
        if key == "time":
            time_ns = round(plain(value, _TIME_S, where) * SECOND_NS)
            return _Condition(lambda: twin.time_ns >= time_ns, lambda: time_ns)
        if key in ("position", "count"):
            return self._beyond(key, content, place)
        if key in KINDS:
            return self._said(key, value, where)
        wanted, allowed = content["is"], place.at("is")
        if key == "input":
            _one_of(value, tuple(dict.fromkeys((*twin.settable, *twin.inputs))), where)
            states = (*twin.settable.get(value, ()), *_SWITCH_STATES)
            _one_of(wanted, tuple(dict.fromkeys(states)), allowed)
            return _Condition(lambda: twin.inputs.get(value, "ok") == wanted)
        _one_of(value, tuple(twin.outputs if key == "output" else twin.levels), where)
        if isinstance(wanted, float) or not isinstance(wanted, int):
            raise allowed.wrong(f"{_shown(wanted)}; allowed: a whole number")
        if key == "output":
            return _Condition(lambda: twin.outputs.get(value) == wanted)
        if wanted not in (0, 1):
            raise allowed.wrong(f"{_shown(wanted)}; allowed: 0, 1")
        return _Condition(lambda: twin.levels.get(value) == bool(wanted))

    def _said(self, kind: str, text: Any, place: Place) -> _Condition:
        if not isinstance(text, str) or not text.strip():
            raise place.wrong(f"{_shown(text)}; allowed: text that the message or its explanation contains")
        if self._messages is None:
            self._messages = Messages(self._twin)
        watch = self._messages.watch(kind, text)
        return _Condition(watch.met, watch.look_ns)

    def _check_companions(self, content: Mapping[str, Any], key: str, place: Place) -> None:
        """`is` goes with states, `above` and `below` with numbers, neither with the rest."""
        of_states, of_numbers = key in ("output", "input", "level"), key in ("position", "count")
        for name, fits in (("is", of_states), ("above", of_numbers), ("below", of_numbers)):
            if name in content and not fits:
                raise place.at(name).wrong(f"says nothing of {key}; allowed: without it")
        if of_states and "is" not in content:
            raise place.at("is").wrong("missing; allowed: what it is waited for to be")
        if of_numbers and not {"above", "below"} & set(content):
            raise place.wrong(f"{key} of what? allowed: above, below or both")

    def _beyond(self, key: str, content: Mapping[str, Any], place: Place) -> _Condition:
        """A position in mm or a counter in steps within bounds."""
        twin = self._twin
        names = tuple(CARRIAGES if key == "position" else AXIS_NAMES[: len(twin.counts)])
        _one_of(content[key], names, place.at(key))
        axis = names.index(content[key])
        rule = _MM if key == "position" else _COUNT
        low, high = (
            plain(content[name], rule, place.at(name)) if name in content else otherwise
            for name, otherwise in (("above", -math.inf), ("below", math.inf))
        )

        def within() -> bool:
            return bool(low < (twin.position_mm if key == "position" else twin.counts)[axis] < high)

        so = within()

        def met() -> bool:
            nonlocal so  # in between it stays: how time is cut depends on the wall clock
            if twin.time_ns % LOOK_NS == 0 or twin.idle:
                so = within()
            return so

        return _Condition(met, lambda: (twin.time_ns // LOOK_NS + 1) * LOOK_NS)


def _number(value: Any, rule: Limits, place: Place) -> Any:
    """The value; refuses text and containers, so that the error stays one line."""
    if isinstance(value, str | list | dict):
        raise place.wrong(f"{_shown(value)}; allowed: {rule}")
    return value


def _one_of(value: Any, names: tuple[str, ...], place: Place) -> None:
    if not isinstance(value, str) or value not in names:
        raise place.wrong(f"{_shown(value)}; {hint(str(value)[:40], names)}")


def _shown(value: Any) -> str:
    return json.dumps(value)[:60]
