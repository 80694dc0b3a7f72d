"""What can be done to a served machine, without sockets: requests, the instants at which they act, refusals."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.bridge.operate.control import ControlError, Operator, Pending
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Server
from tests.bridge.test_network import Mouth
from tests.bridge.test_pacing import MS, Clock

SECOND = 1000 * MS


class Bench:
    """A server on a wall clock of its own, turned by hand."""

    def __init__(self, speed: float | None = 1.0, **twin: Any) -> None:
        self.clock = Clock()
        self.twin = Twin(**({"plant": "kinematic", "line_speed": speed is not None} | twin))
        self.mouth = Mouth(b"", self.clock)
        self.server = Server(self.twin, Pacer(speed, clock=self.clock), [])
        self.operator = Operator(self.server, self.twin)

    def ask(self, **request: Any) -> Any:
        return self.operator.ask(request)

    def turn(self, seconds: float) -> None:
        """Wall time passes; the loop is turned every 5 ms."""
        end = self.clock.now + round(seconds * SECOND)
        while self.clock.now < end:
            self.clock.now += 5 * MS
            self.server.pacer.advance(self.twin)
            self.operator.look()

    def home(self) -> None:
        self.twin.query("@07")
        self.twin.query("@0R7")
        self.server.go_on(self.server.pacer.speed, self.server.pacer.paused)


def test_an_input_is_set_at_the_present_and_the_answer_says_so():
    bench = Bench()
    bench.clock.now += 200 * MS
    answer = bench.ask(set={"estop": "pressed", "hood": "open"})
    assert answer == {"time_s": 0.2, "time_ns": 200 * MS, "inputs": {"estop": "pressed", "hood": "open"}}
    assert bench.twin.outputs["power"] == 0
    assert bench.ask(state=True)["inputs"]["estop"] == "pressed"


def test_faults_have_the_names_of_scenarios_and_are_cleared():
    bench = Bench(plant="mujoco")
    bench.ask(set={"limit_x2": "broken"}, noise=0.25, phase_lost={"x": "a"})
    assert bench.ask(state=True)["faults"] == {"limit_x2": "broken", "phase_lost.x": "a", "noise": 0.25}
    assert bench.ask(set={"limit_x2": "ok"}, noise=0, phase_lost={"x": ""})["inputs"] == {"limit_x2": "free"}
    assert bench.ask(state=True)["faults"] == {}


def test_a_push_moves_the_tool():
    """A motor at rest is a spring: the carriage gives way the way it is pushed."""
    bench = Bench(plant="mujoco")
    before = bench.twin.position_mm[0]
    bench.ask(force_n={"x": 30.0}, place="tool")
    bench.turn(0.3)
    assert bench.twin.position_mm[0] > before + 1e-4


def test_paused_time_stands_still_while_bytes_are_taken():
    bench = Bench()
    bench.turn(0.1)
    assert bench.ask(pause=True)["time_ns"] == 100 * MS
    bench.turn(10.0)
    assert bench.twin.time_ns == 100 * MS
    assert bench.server.pacer.wait_s(bench.twin) is None
    assert bench.ask(set={"estop": "pressed"})["time_ns"] == 100 * MS, "a press needs no time"
    bench.ask(resume=True)
    bench.turn(1.0)
    assert bench.twin.time_ns == 1100 * MS


@pytest.mark.parametrize("speed", [None, 1.0, 0.001])
def test_steps_are_exact(speed: float | None):
    bench = Bench(speed)
    bench.ask(pause=True)
    for number, seconds in enumerate((1e-9, 0.001, 1.5)):
        began = bench.twin.time_ns
        pending = bench.ask(step=seconds)
        assert isinstance(pending, Pending)
        bench.turn(1.0)
        assert bench.twin.time_ns - began == round(seconds * SECOND), number
        assert pending.answer == {"time_s": bench.twin.time_ns / 1e9, "time_ns": bench.twin.time_ns}


def test_a_step_needs_a_pause_and_resuming_breaks_it_off():
    bench = Bench()
    with pytest.raises(ControlError, match=r"^request: step: virtual time does not stand still; allowed: after pause$"):
        bench.ask(step=0.1)
    bench.ask(pause=True)
    pending = bench.ask(step=3600.0)
    bench.ask(resume=True)
    bench.turn(0.1)
    assert pending.error == "step: broken off by pause or resume"


def test_a_new_speed_holds_from_then_on_and_not_earlier():
    bench = Bench(1.0)
    bench.turn(1.0)
    assert bench.ask(speed=10)["time_ns"] == 1 * SECOND
    bench.turn(1.0)
    assert bench.twin.time_ns == 11 * SECOND
    bench.ask(speed=0.5)
    bench.turn(1.0)
    assert bench.twin.time_ns == pytest.approx(11.5 * SECOND, abs=3)
    bench.ask(speed="max")
    assert not bench.twin.line_speed
    bench.turn(1.0)
    assert bench.twin.time_ns == pytest.approx(11.5 * SECOND, abs=3), "nobody has anything to do"
    bench.ask(speed=1)
    assert bench.twin.line_speed
    bench.turn(1.0)
    assert bench.twin.time_ns == pytest.approx(12.5 * SECOND, abs=3)


def test_a_speed_set_while_paused_holds_when_time_goes_on():
    bench = Bench(1.0)
    bench.ask(pause=True)
    bench.ask(speed=4)
    bench.turn(1.0)
    assert bench.twin.time_ns == 0
    bench.ask(resume=True)
    bench.turn(1.0)
    assert bench.twin.time_ns == 4 * SECOND


@pytest.mark.parametrize("speed", [1.0, None])
def test_a_wait_ends_where_it_is_so(speed: float | None):
    """X goes 50 mm at 5000 steps/s; 320 steps are a millimetre."""
    bench = Bench(speed)
    bench.home()
    beyond = bench.ask(wait={"position": "x", "above": 20, "below": 1000, "pause": True})
    moving = bench.ask(wait={"output": "moving", "is": 1})
    bench.twin.write(b"@0A16000,5000,0,30,0,30,0,30\r")
    bench.turn(10.0)
    assert moving.answer is not None
    assert beyond.answer is not None
    assert bench.twin.time_ns == beyond.answer["time_ns"]
    assert 20.0 < bench.twin.position_mm[0] <= 20.0 + 5000 / 320 * 0.001 + 1 / 320
    idle = bench.ask(wait={"idle": True})
    bench.ask(resume=True)
    bench.turn(10.0)
    assert idle.answer is not None
    assert bench.twin.position_mm[0] == pytest.approx(50.0, abs=0.01)
    assert isinstance(bench.ask(wait={"count": "x", "above": 15_999, "below": 16_001}).answer, dict), "so already"


def test_a_wait_for_a_time_ends_to_the_nanosecond():
    bench = Bench(7.0)
    pending = bench.ask(wait={"time": 1.234567891, "pause": True})
    bench.turn(1.0)
    assert pending.answer == {"time_s": 1.234567891, "time_ns": 1_234_567_891}
    assert bench.twin.time_ns == 1_234_567_891


def test_waits_for_inputs_and_levels():
    bench = Bench()
    waits = [bench.ask(wait=wait) for wait in ({"input": "estop", "is": "pressed"}, {"level": "p1.0", "is": 0})]
    bench.turn(0.1)
    assert not any(wait.over for wait in waits)
    bench.ask(set={"estop": "pressed"})
    bench.turn(0.1)
    assert all(wait.answer for wait in waits)


def test_a_wait_is_given_up_in_virtual_and_in_wall_time():
    bench = Bench(10.0)
    virtual = bench.ask(wait={"output": "spindle", "is": 1, "timeout_s": 1.0})
    wall = bench.ask(wait={"output": "spindle", "is": 1, "wall_s": 0.5})
    bench.turn(0.09)
    assert not virtual.over
    bench.turn(0.02)
    assert "timeout_s" in virtual.error
    bench.turn(0.38)
    assert not wall.over
    bench.turn(0.02)
    assert "wall_s" in wall.error
    assert bench.operator.wait_s is None


def test_emergency_stop_while_paused_and_recovery():
    """The carriage stands where it was when time goes on, the reply says why, and a new reference run helps."""
    bench = Bench(None)
    bench.home()
    bench.twin.write(b"@0A16000,5000,0,30,0,30,0,30\r")
    bench.ask(wait={"position": "x", "above": 20, "pause": True})
    bench.turn(5.0)
    stopped = bench.twin.position_mm[0]
    bench.ask(set={"estop": "pressed"})
    assert bench.twin.outputs["power"] == 0
    bench.turn(1.0)
    bench.ask(resume=True)
    bench.turn(1.0)
    assert bench.twin.read() == b"9", "safety chain open (manual, table of errors)"
    assert bench.twin.position_mm[0] == pytest.approx(stopped, abs=0.5)
    bench.ask(set={"estop": "released"})
    bench.ask(set={"power": "off"})
    bench.ask(set={"power": "on"})
    assert [bench.twin.query(command) for command in ("@07", "@0R7")] == ["0", "0"]


def test_stop_ends_waiting_too():
    bench = Bench()
    pending = bench.ask(wait={"idle": True, "pause": False}) if not bench.twin.idle else None
    pending = pending or bench.ask(wait={"time": 1000})
    assert "time_ns" in bench.ask(stop=True)
    assert bench.server._stopped
    bench.operator.end()
    assert pending.error == "wait: the server stops"


def test_the_state_is_plain_json():
    for controller in ("imc-s8", "ismif"):
        state = Bench(None, controller=controller).ask(state=True)
        assert json.loads(json.dumps(state, allow_nan=False)) == state
        assert state["controller"] == controller
        wanted = {"inputs", "outputs", "levels", "counts", "lost_steps", "margin", "edge", "faults", "time_ns"}
        assert wanted <= state.keys()


BAD: list[tuple[Any, str]] = [
    ([], "request: []; allowed: a table"),
    ({}, "nothing happens; say what: set, force_n"),
    ({"sett": {}}, "request: sett: unknown key; did you mean 'set'?"),
    ({"set": {"estop": "half"}}, "request: set: input 'estop' cannot be 'half'; it can be: released, pressed"),
    ({"set": {"estop": ["pressed"]}}, "request: set: input 'estop' cannot be"),
    ({"set": {"estopp": "pressed"}}, "request: set: unknown input 'estopp'; did you mean 'estop"),
    ({"set": {"estop": "pressed", "hood": "ajar"}}, "request: set: input 'hood' cannot be 'ajar'"),
    ({"set": {"estop": "pressed"}, "noise": math.nan}, "request: noise: nan; allowed: 0 .. 1"),
    ({"set": {"estop": "pressed"}, "force_n": {"x": 5}}, "request: force_n: does nothing without physics"),
    ({"phase_lost": {"x": "c"}}, "request: phase_lost.x: 'c'; allowed: "),
    ({"set": {"estop": "pressed"}, "pause": True}, "request: set, pause: one of them at a time"),
    ({"pause": 1}, "request: pause: 1; allowed: true"),
    ({"stop": "yes"}, 'request: stop: "yes"; allowed: true'),
    ({"step": "1"}, "request: step: '1'; allowed: 1e-09 .. 3600 s"),
    ({"step": -1}, "request: step: -1; allowed"),
    ({"speed": 0}, "request: speed: 0; allowed: 1e-06 .. 1e+06 times real time, or 'max'"),
    ({"speed": True}, "request: speed: True; allowed"),
    ({"speed": "fast"}, 'request: speed: "fast"; allowed'),
    ({"speed": math.inf}, "request: speed: inf; allowed"),
    ({"wait": {}}, "request: wait: nothing to wait for; allowed: one of output, input"),
    ({"wait": {"idle": True, "time": 1}}, "request: wait: idle, time to wait for; allowed: one of"),
    ({"wait": {"output": "spindel", "is": 1}}, "request: wait.output: \"spindel\"; did you mean 'spindle'?"),
    ({"wait": {"output": "spindle"}}, "request: wait.is: missing"),
    ({"wait": {"output": "spindle", "is": "on"}}, 'request: wait.is: "on"; allowed: a whole number'),
    ({"wait": {"level": "p1.0", "is": 2}}, "request: wait.is: 2; allowed: 0, 1"),
    ({"wait": {"input": "estop", "is": "up"}}, 'request: wait.is: "up"; '),
    ({"wait": {"position": "q", "above": 1}}, 'request: wait.position: "q"; '),
    ({"wait": {"position": "x"}}, "request: wait: position of what? allowed: above, below or both"),
    ({"wait": {"position": "x", "above": math.nan}}, "request: wait.above: nan; allowed"),
    ({"wait": {"idle": True, "is": 1}}, "request: wait.is: says nothing of idle"),
    ({"wait": {"idle": True, "wall_s": -1}}, "request: wait.wall_s: -1; allowed"),
    ({"wait": {"idle": True, "pause": "no"}}, 'request: wait.pause: "no"; allowed'),
    ({"wait": {"time": True}}, "request: wait.time: True; allowed"),
]


@pytest.mark.parametrize(("request_", "said"), BAD, ids=[str(number) for number in range(len(BAD))])
def test_what_is_wrong_is_one_line_and_changes_nothing(request_: Any, said: str):
    bench = Bench()
    before = bench.ask(state=True)
    with pytest.raises(ControlError) as caught:
        bench.operator.ask(request_)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert bench.ask(state=True) == before
    assert not bench.server._stopped


def test_two_operators_wait_at_once_and_neither_is_forgotten():
    """A control port and a panel: the one's wait ends at its instant though the other's has begun after it."""
    bench = Bench(speed=None)
    bench.home()
    other = Operator(bench.server, bench.twin)
    first = bench.ask(wait={"position": "x", "above": 1.0, "pause": True})
    second = other.ask({"wait": {"position": "x", "above": 2.0, "pause": True}})
    assert isinstance(first, Pending)
    assert isinstance(second, Pending)
    bench.twin.write(b"@0A 8000,2000,0,800,0,800,0,800\r")
    bench.turn(0.1)
    assert first.over
    assert not second.over
    assert 1.0 < bench.twin.position_mm[0] < 1.1
    bench.ask(resume=True)
    bench.turn(0.1)
    other.look()
    assert second.over
    assert 2.0 < bench.twin.position_mm[0] < 2.1
    assert bench.server.pacer.onlookers == []
