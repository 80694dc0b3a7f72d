"""The specification of the table: what must become of each fault, reasoned fault by fault; no tool has a say in it.

    fault x controller x plant  --- EXPECTED ---> not well, or well because nothing that was made or answered is changed

A verdict is wrong green if a fault has changed anything of what the job made or of what was answered and the verdict
does not say so. It makes no difference which tool judges, and whether the host takes notice of its replies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

IMC, ISMIF, GMI99, BWO900 = "imc-s8", "ismif", "gmi99", "bwo900"
CONTROLLERS = (IMC, ISMIF, GMI99, BWO900)


@dataclass(frozen=True)
class Fault:
    """One kind of fault: what happens, when, and to whom it must matter."""

    acts: str  # of a scenario; {wall}: a place that X has still to pass; "": the cutter meets a fixture there
    because: str  # why the job cannot be well
    spares: tuple[str, ...] = ()  # controllers for which it changes nothing
    spared: str = ""  # why not
    physical: bool = False  # without physics it has no effect, and the verdict says that
    at_start: bool = False  # not amid the last motion

    def bites(self, controller: str, plant: str) -> bool:
        return controller not in self.spares and (plant == "mujoco" or not self.physical)


NO_INPUT = "it has no such input, and the relay has not dropped"
AT_SWITCHES = "it looks at its switches in reference runs only"
ANSWERED = "it has answered before it moves"
EVERYBODY = CONTROLLERS

FAULTS: Mapping[str, Fault] = {
    # the cabinet
    "E-stop": Fault('set.estop = "pressed"', "the stages lose their power in motion"),
    "E-stop, released": Fault('set.estop = "pressed"\nfor = 0.5', "the relay stays open, and positions are lost"),
    "hood": Fault('set.hood = "forced"', "the relay drops when the hood opens in motion"),
    "hood open": Fault(
        'set.hood = "open"', "with the hood open in automatic nothing may move: refused, or cut", at_start=True
    ),
    "power key": Fault('set.power = "off"', "the stages lose their power in motion"),
    "stop key": Fault(
        'set.stop = "down"\nfor = 0.2', "the motion stands, and nobody lets it go on",
        (ISMIF,), NO_INPUT,
    ),
    "key to setup": Fault(
        'set.key = "setup"', "", EVERYBODY, "with the hood closed setup allows what automatic does"
    ),
    "hot": Fault('set.overtemperature = "hot"', "the relay drops, as at an emergency stop"),
    # contacts
    "limit ahead": Fault(
        'set.limit_x2 = "broken"', "a broken switch reads as struck: the motion ends", (ISMIF,), AT_SWITCHES
    ),
    "limit behind": Fault(
        'set.limit_x1 = "broken"', "a switch that reads as struck ends any motion",
        (ISMIF, GMI99), "the one looks at its switches in reference runs only, the other at that ahead",
    ),
    "limit aside": Fault(
        'set.limit_y1 = "broken"', "a switch that reads as struck ends any motion",
        (ISMIF, GMI99), "the one looks at its switches in reference runs only, the other at that ahead",
    ),
    "limit dead": Fault(
        'set.limit_x2 = "stuck_closed"', "", EVERYBODY, "nothing comes near that switch"
    ),
    "limit worn": Fault('set.limit_x2 = "bounce"', "", EVERYBODY, "nothing comes near that switch"),
    "reference": Fault(
        'set.limit_x1 = "broken"', "the switch is never left: the reference run fails", at_start=True
    ),
    "E-stop wire": Fault(
        'set.estop_1 = "broken"', "the relay's circuit runs through that contact: as an emergency stop"
    ),
    "heat wire": Fault(
        'set.overtemperature = "broken"', "to the controller the stages are too hot", (ISMIF,), NO_INPUT
    ),
    "relay wire": Fault(
        'set.power_ok = "broken"', "to the controller the stages have no power", (ISMIF,), NO_INPUT
    ),
    "hood wire": Fault(
        'set.hood_automatic = "broken"', "to the controller the hood is open in motion",
        (ISMIF, GMI99, BWO900), "it does not look at the hood in motion, and the relay has not dropped",
    ),
    "stop wire": Fault(
        'set.stop = "broken"', "a stop key that reads as pressed: the motion stands", (ISMIF,), NO_INPUT,
    ),
    "spindle wire": Fault('set.spindle = "broken"', "", EVERYBODY, "the job has no spindle"),
    # supply and controller
    "brown-out": Fault("brownout = true\nfor = 0.2", "the controller has started anew"),
    "power cut": Fault("brownout = true", "there is no controller any more"),
    "reset": Fault("reset = true", "the controller has started anew"),
    # the line
    "line cut": Fault(
        "line_cut = true", "the reply is lost", (GMI99, BWO900), ANSWERED
    ),
    "noise": Fault("noise = 0.2", "the controller hears what nobody has sent", at_start=True),
    "lost bytes": Fault("dropped = 0.2", "bytes are lost", at_start=True),
    "doubled bytes": Fault("doubled = 0.2", "the controller hears what nobody has sent", at_start=True),
    # the machine
    "obstacle": Fault("obstacle_mm.x = {wall}", "X does not come where it should", physical=True),
    "push": Fault("force_n.x = -5000.0", "no motor holds five kilonewtons", physical=True),
    "friction": Fault("friction_n.x = 5000.0", "no motor overcomes five kilonewtons", physical=True),
    "drive": Fault('phase_lost.x = "ab"', "a motor without current does not follow", physical=True),
    "supply": Fault("undervoltage = 0.95", "below its lockout the stages drop", physical=True),
    "hot stage": Fault("hot_stage_k.x = 200.0", "the stage's contact opens: the relay drops", physical=True),
    "collision": Fault("", "the cutter has met a vise"),
}  # fmt: skip

Cell = tuple[str, str, str, str]  # tool, controller, fault, plant
JUDGES = ("run", "check", "exec", "pytest", "sweep")  # tools that say whether a job is well
SAME = ("golden", "replay", "compare")  # they ask whether it is the same once more
FEW = ("E-stop", "hood", "brown-out", "limit ahead", "obstacle", "line cut", "drive", "collision")
"""Faults of the tools that rest on the verdict of the others, or give none."""


def allowed(cell: Cell) -> tuple[int, ...]:
    """Exit codes that a cell may have: 0 well, 1 not well, 2 refused in one line."""
    tool, controller, fault, plant = cell
    bites = FAULTS[fault].bites(controller, plant)
    if tool in JUDGES:
        return (1,) if bites else (0,)
    if tool == "tune":  # what is not over is refused, of the rest no settings are well
        return (1, 2) if bites else (0,)
    if tool == "identify":  # there is nothing measured
        return (2,)
    if tool == "experiment":  # it plans without a twin; a BWO 900 answers nothing to a move
        return (2,) if controller == BWO900 else (0,)
    return (0,)
