"""One cell of the table: a tool, a controller, a fault, a plant; and what becomes of it.

    job + fault in the midst of its last motion  --- tool --->  Outcome: exit code, what it says, in a few words

Every call is one of the command line, in this process; each cell has a folder of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from isel_twin import Twin
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played

PLANTS = ("kinematic", "mujoco")
CONTROLLERS: Mapping[str, tuple[str, str]] = {
    "imc-s8": ("4030", "@07\n@0N7\n@0A1600,800,0,30,0,30,0,30\n"),
    "ismif": ("4030", "L1,X3000<1>\n"),
    "gmi99": ("4030-servo", "Q7;1\nf2000\nM5000\n81h 9000\n"),
    "bwo900": ("4030-servo", "N10 G1 F300 G91 X10\nN20 M30\n"),
}
"""Machine and job of each; the last line moves X for some seconds."""
FAULTS: Mapping[str, str] = {
    "E-stop": 'set.estop = "pressed"',
    "hood": 'set.hood = "forced"',
    "brown-out": "brownout = true\nfor = 0.2",
    "limit": 'set.limit_x2 = "broken"',
    "obstacle": "obstacle_mm.x = {wall}",
    "line cut": "line_cut = true",
    "drive": 'phase_lost.x = "ab"',
}
"""Acts of a scenario. `wall`: 1 mm before the carriage in machine coordinates."""
TOOLS = ("run", "check", "golden", "replay", "compare", "exec", "sweep", "tune", "identify", "experiment")
HOST = """
import sys, serial
port = serial.Serial("COM1", timeout=float(sys.argv[1]))
for frame in {frames!r}:
    port.write(frame)
    reply = port.read(1)
    while port.in_waiting:
        reply += port.read(port.in_waiting)
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


@cache
def clean(controller: str, plant: str) -> tuple[float, float]:
    """Time in s amid the last line of the job without a fault, and where X stands then in machine coordinates, mm."""
    machine, job = CONTROLLERS[controller]
    twin = Twin(machine, controller, plant, start_mm=(50.0, 50.0, 50.0))
    made = played(twin, parse_job(job, twin.language, controller))
    assert made.ok, made
    again = Twin(machine, controller, plant, start_mm=(50.0, 50.0, 50.0))
    middle_ns = (made.results[-1].time_ns + made.results[-1].end_ns) // 2
    list_of = played(again, parse_job(job, again.language, controller), stop=lambda: again.time_ns >= middle_ns)
    del list_of
    return middle_ns / 1e9, float(again.machine_position_mm[0])
