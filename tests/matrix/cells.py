"""One cell of the table: a tool, a controller, a fault, a plant; and what becomes of it.

    job + fault in the midst of its last motion  --- tool --->  Outcome: exit code, what it says, in a few words

Every call is one of the command line, in this process; each cell has a folder of its own.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from isel_twin import Twin
from isel_twin.bridge.operate.conditions import conditions
from isel_twin.bridge.operate.control import Operator
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Server
from isel_twin.bridge.serve.tcp import TcpEndpoint, parse_address
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks.asserts import MotionError, assert_accepted, assert_no_collision, assert_no_step_lost
from isel_twin.jobs.checks.watched import Watched
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from isel_twin.language import create_language
from tests.forked import PATIENCE_S
from tests.in_process import isel_twin
from tests.matrix.expected import BWO900, CONTROLLERS, FAULTS, FEW, GMI99, IMC, ISMIF, JUDGES, SAME

PLANTS = ("kinematic", "mujoco")
JOBS: Mapping[str, tuple[str, str]] = {
    IMC: ("4030", "@07\n@0R7\n@0A1600,800,0,30,0,30,0,30\n"),
    ISMIF: ("4030", "$HZXY<1>\nL1,X3000<1>\n"),
    GMI99: ("4030-servo", "Q7;1\nf2000\nM5000\n81h 9000\n"),
    BWO900: ("4030-servo", "N10 G1 F300 G91 X10\nN20 M30\n"),
}
"""Machine and job of each: a reference run, and X moves for some seconds in the last line."""
MACHINE = """
based_on = "{machine}"

[supply]
enabled = true
chopper_voltage = {{ value = 75.0, unit = "V", grade = "setting", source = "above the supply of either machine" }}
"""
FOUND = """
[axes.{axis}]
power_on_low = {{ value = 1.0, unit = "mm", grade = "setting", source = "a short reference run" }}
power_on_high = {{ value = 1.5, unit = "mm", grade = "setting", source = "a short reference run" }}
"""
VISE = """
[[fixture]]
name = "vise"
shape = "box"
size_mm = [4, 40, {high}]
at_mm = [{x}, {y}, 0]
"""
CUTTER_MM, TABLE_MM = 3.0, 147.0  # radius of the cutter; height of its tip above the table where Z is 0
TOOLS = (*JUDGES, *SAME, "serve", "tune", "identify", "experiment")
BAUD: Mapping[str, str] = {IMC: "19200", ISMIF: "19200", GMI99: '38400, parity="E"', BWO900: "19200"}
SLACK_S = 5.0  # of virtual time, for a server whose thread is not asked at once
LINE_S = 1.0  # more than a line takes on the way, which takes no time in `run`
OFF = 50.0  # increments that no servo axis at rest is beside its command
PATIENCE = ("--timeout", "60")
HOST = """
import time, serial
port = serial.Serial("COM1", {baud}, timeout=0)
began = time.monotonic()
for at, frame in {frames!r}:
    time.sleep(max(at - (time.monotonic() - began), 0.0))
    port.reset_input_buffer()
    port.write(frame)
time.sleep(30)
"""


@dataclass(frozen=True)
class Outcome:
    """What became of a call."""

    code: int
    out: str
    err: str

    @property
    def words(self) -> str:
        """In a few words, as the table has it."""
        if self.code == 2:
            return "refused: " + self.err.strip().removeprefix("isel-twin: ")
        return "well" if self.code == 0 else "not well"

    @property
    def broken(self) -> str:
        """What no call may do, whatever is asked; "" if it did not."""
        if self.code not in (0, 1, 2):
            return f"exit code {self.code}"
        if "Traceback" in self.err:
            return "a traceback"
        if self.code == 2 and len([line for line in self.err.splitlines() if line.startswith("isel-twin: ")]) != 1:
            return f"not one line: {self.err}"
        return ""


@dataclass(frozen=True)
class Clean:
    """The job without a fault."""

    sent_s: tuple[float, ...]  # when each line is sent
    end_s: float
    end_mm: tuple[float, float, float]  # machine coordinates
    way_mm: float  # of X in the last line, upwards

    @property
    def amid_mm(self) -> float:
        """A place that X passes in its last motion only."""
        return self.end_mm[0] - 0.4 * self.way_mm

    @property
    def wall_mm(self) -> float:
        """A place that X passes after that one."""
        return self.end_mm[0] - 0.25 * self.way_mm

    def vise(self) -> str:
        """A fixture that the cutter touches when X is there."""
        x, high = round(self.wall_mm + CUTTER_MM + 2.0, 3), round(TABLE_MM - self.end_mm[2] + 2.0, 3)
        return VISE.format(x=x, y=round(self.end_mm[1], 3), high=high)


@cache
def clean(controller: str, plant: str) -> Clean:
    machine, job = JOBS[controller]
    near = {f"axes.{axis}.power_on_{end}": mm for axis in "xyz" for end, mm in (("low", 1.0), ("high", 1.5))}
    twin = Twin(machine, controller, plant, overrides={**near, "supply.enabled": True, "supply.chopper_voltage": 75.0})
    made = played(twin, parse_job(job, twin.language, controller))
    assert made.ok, made
    before, last = (result for result in made.results[-2:]) if len(made.results) > 1 else (None, made.results[-1])
    way_mm = last.position_mm[0] - (before.position_mm[0] if before else 0.0)
    x, y, z = twin.machine_position_mm[:3]
    sent_s = tuple(result.time_ns / 1e9 for result in made.results)
    return Clean(sent_s, last.end_ns / 1e9, (float(x), float(y), float(z)), way_mm)


def call(*words: object) -> Outcome:
    done = isel_twin(*words)
    return Outcome(done.returncode, done.stdout, done.stderr)


def _wait(twin: Twin, thread: threading.Thread, time_s: float) -> None:
    """Wait for a virtual time of a served twin."""
    deadline = time.monotonic() + PATIENCE_S
    while twin.time_ns < time_s * 1e9 and thread.is_alive() and time.monotonic() < deadline:
        time.sleep(0.001)


class Cell:
    """A folder with a job, a scenario and a host, and calls about them."""

    def __init__(self, folder: Path, controller: str, fault: str, plant: str) -> None:
        self.folder, self.controller, self.plant = folder, controller, plant
        machine, job = JOBS[controller]
        self.well, kind = clean(controller, plant), FAULTS[fault]
        well, self.bites = self.well, kind.bites(controller, plant)
        acts = kind.acts.format(wall=round(well.wall_mm, 3))
        at = "at = 0" if kind.at_start else f'when = "x > {well.amid_mm:.3f} mm"'
        self.job, self.scenario, self.machine = folder / "job.txt", folder / "events.toml", folder / "machine"
        self.job.write_text(job)
        self.scenario.write_text(f"[[event]]\n{at}\n{acts}\n" if acts else "")
        self.machine.mkdir()
        parts = [MACHINE.format(machine=machine), *(FOUND.format(axis=axis) for axis in "xyz")]
        parts += [] if acts else [well.vise()]
        (self.machine / "machine.toml").write_text("".join(parts))
        self.same = ("--machine", self.machine, "--controller", controller)
        self.called = (*self.same, "--plant", plant, "--scenario", self.scenario)

    def run(self) -> Outcome:
        return call("run", self.job, *self.called, *PATIENCE, "--record", self.folder / "run.mcap")

    def check(self) -> Outcome:
        return call("check", self.job, *self.called, *PATIENCE)

    def pytest(self) -> Outcome:
        """A test that plays the job and asserts all that can be asserted of any."""
        spec = TwinSpec(str(self.machine), controller=self.controller, plant=self.plant, scenario=self.scenario)
        watched = Watched(spec.build())
        try:
            watched.play(self.job, timeout_s=60.0)
            for holds in (assert_accepted, assert_no_step_lost, assert_no_collision):
                holds(watched)
        except MotionError as error:
            return Outcome(1, str(error), "")
        return Outcome(0, "", "")

    def golden(self) -> Outcome:
        """What a golden run compares is the same once more, well or not."""
        made = call("golden", "record", self.job, *self.called, *PATIENCE)
        return made if made.code == 2 else call("golden", "compare", self.job)

    def replay(self) -> Outcome:
        return call("replay", self._recording())

    def compare(self) -> Outcome:
        return call("compare", self._recording(), self._recording())

    def identify(self) -> Outcome:
        return call("identify", self._recording(), *self.same, "--fit", "friction.x")

    def exec(self) -> Outcome:
        host, language = self.folder / "host.py", create_language(self.controller)
        lines = parse_job(self.job.read_text(), language, self.controller)
        sent_s = clean(self.controller, self.plant).sent_s
        frames = [(at + n * LINE_S, line.sent) for n, (at, line) in enumerate(zip(sent_s, lines, strict=True))]
        host.write_text(HOST.format(baud=BAUD[self.controller], frames=frames))
        return call("exec", "--check", *self.called, "--timeout", "200", "--", "python", host)

    def sweep(self) -> Outcome:
        plan = self.folder / "plan.toml"
        plan.write_text(
            f'[sweep]\njob = "job.txt"\ncontroller = "{self.controller}"\nmachine = "machine"\n'
            f'plant = "{self.plant}"\nscenario = "events.toml"\ntimeout_s = 60\nseeds = 1\n'
        )
        done = call("sweep", plan, "--workers", "1")
        if done.code == 0:
            import pyarrow.parquet as pq

            well = pq.read_table(self.folder / "plan.parquet")["ok"].to_pylist()
            return Outcome(0 if all(well) else 1, done.out, done.err)
        return done

    def tune(self) -> Outcome:
        """On the plant with physics only."""
        few = ("--trials", "1", "--robust", "0", "--confirm", "1", "--margin", "0", "--timeout", "60")
        return call("tune", self.job, *self.same, "--scenario", self.scenario, *few)

    def serve(self) -> Outcome:
        """A server in this process: it lives on, whatever the fault, and its state says what bites."""
        spec = TwinSpec(str(self.machine), controller=self.controller, plant=self.plant, scenario=self.scenario)
        twin, language = spec.build(), create_language(self.controller)
        endpoint = TcpEndpoint("127.0.0.1:0")
        server = Server(twin, Pacer(20.0), (endpoint,))
        thread = threading.Thread(target=server.run, daemon=True)
        thread.start()
        host, port = parse_address(endpoint.address)
        lines = parse_job(self.job.read_text(), language, self.controller)
        with socket.create_connection((host, port), timeout=PATIENCE_S) as line:
            for n, (at_s, frame) in enumerate(zip(self.well.sent_s, lines, strict=True)):
                _wait(twin, thread, at_s + n * SLACK_S)
                line.sendall(frame.sent)
            _wait(twin, thread, self.well.end_s + (len(lines) + 1) * SLACK_S)
        alive = thread.is_alive()
        server.stop()
        thread.join(PATIENCE_S)
        state = Operator(server, twin).state()
        told = [*filter(None, conditions(state).values()), *state["collisions"]]
        told += ["it has started anew"] if twin.restarts else []
        told += [f"{error:.0f} increments off" for error in state["following_error"] if abs(error) > OFF]
        well = alive and not thread.is_alive() and not twin.events_left
        return Outcome(
            0 if well and bool(told) == (self.bites or twin.faults.get("line_cut", False)) else 1,
            "; ".join(map(str, told)),
            "",
        )

    def experiment(self) -> Outcome:
        """It plans without a twin, so without a fault."""
        return call("experiment", self.folder / "measure", *self.same, "--fit", "friction.x", "--blocks", "2")

    def _recording(self) -> Path:
        file = self.folder / "run.mcap"
        if not file.exists():
            self.run()
        return file


def cells() -> Iterator[tuple[str, str, str, str]]:
    """Tool, controller, fault and plant of every cell. `tune` knows the plant with physics only; `identify` and
    `experiment` take no faults, so one stands for all."""
    for tool in TOOLS:
        faults = tuple(FAULTS) if tool in JUDGES else FEW[:1] if tool in ("identify", "experiment") else FEW
        for controller in CONTROLLERS:
            for plant in PLANTS[1:] if tool in ("tune", "identify", "experiment") else PLANTS:
                for fault in faults:
                    yield tool, controller, fault, plant


def outcome(tool: str, controller: str, fault: str, plant: str, folder: Path) -> Outcome:
    """What becomes of one cell, in a folder of its own, which exists and is empty."""
    made = getattr(Cell(folder, controller, fault, plant), tool)()
    assert isinstance(made, Outcome)
    return replace(made, err=made.err.replace(f"{folder}/", ""))
