"""The variables of the machine, and their values from a state of the control port.

OPC 40501-1 has no axes, so these, and what only a twin can tell, are in a namespace of our own. Positions are in the
zero of the counters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.bridge.operate.conditions import State, conditions, emergency, powered, program

OWN = "urn:isel-twin"
NAMESPACES = {
    "DI": "http://opcfoundation.org/UA/DI/",
    "IA": "http://opcfoundation.org/UA/IA/",
    "Machinery": "http://opcfoundation.org/UA/Machinery/",
    "MT": "http://opcfoundation.org/UA/MachineTool/",
    "Twin": OWN,
}
"""By the prefixes used here; names without one are of OPC UA itself."""

MACHINE_TOOL = 13  # MachineToolType in the namespace MT; all ids are of the published node set
MESSAGES = "MT:Notification/MT:Messages"
OPTIONAL = (("MT:Monitoring/MT:Channel", 16), ("MT:Monitoring/MT:Spindle", 22), (MESSAGES, 38))
"""Optional objects and their types in MT: ChannelMonitoringType, SpindleMonitoringType, MessagesType."""

# states of the program: its number, and the id in MT of the state's object
PROGRAM = {"Running": (1, 5041), "Ended": (2, 5038), "Interrupted": (3, 5040), "Aborted": (4, 5037)}
CHANNEL = {"Running": 0, "Interrupted": 1, "Ended": 2, "Aborted": 1}  # ChannelState: Active, Interrupted, Reset
AUTOMATIC, SETUP = 1, 2  # OperationMode
MODES = {"hand": 2, "auto": 0, "single": 0, "positioning": 1}  # ChannelMode: JogManual, Automatic, MdaMdi
REMOTE = 5  # ChannelMode of a controller without keys: lines of a host
HUNDRED = 100.0  # FeedOverride of a controller without that key, %


@dataclass(frozen=True)
class Node:
    """A variable of the machine.

    path: browse names below it. kind: a built-in type of OPC UA. value: None if there is none. lasting: still true
    when the twin has gone. unit: of UNITS. range: of its values in operation, where the type wants one.
    """

    path: str
    kind: str
    value: Callable[[State], Any]
    lasting: bool = False
    unit: str = ""
    range: tuple[float, float] | None = None


UNITS = {"mm": (5066068, "mm", "millimetre"), "s": (5457219, "s", "second"), "%": (20529, "%", "percent")}
"""Of a unit: its code in UNECE recommendation 20, packed as OPC 10000-8 has it, symbol and name."""


def _program_name(state: State) -> str:
    """Number of the program in a control that keeps some; lines of a host have no name."""
    return str(state["keys"].get("program") or "")


def _told(state: State) -> list[str]:
    return [text for text in conditions(state).values() if text]


def _of_axis(at: int, axis: str) -> Iterator[Node]:
    place = f"Twin:Axes/Twin:{axis.upper()}/Twin"
    yield Node(f"{place}:ActualPosition", "Double", lambda s: s["position_mm"][at], unit="mm")
    yield Node(
        f"{place}:CommandedPosition",
        "Double",
        lambda s: s["position_mm"][at] - s["position_error_mm"][at],
        unit="mm",
    )
    yield Node(f"{place}:LostSteps", "Double", lambda s: s["lost_steps"][at])
    yield Node(f"{place}:DriveFault", "String", lambda s: s["drive_faults"][at][1] if s["drive_faults"][at][0] else "")


NODES: tuple[Node, ...] = (
    Node("DI:Identification/DI:Manufacturer", "LocalizedText", lambda s: "isel (simulated)", lasting=True),
    Node("DI:Identification/DI:SerialNumber", "String", lambda s: str(s["seed"]), lasting=True),
    Node(
        "DI:Identification/DI:ProductInstanceUri", "String", lambda s: f"{OWN}:{s['machine']}:{s['seed']}", lasting=True
    ),
    Node("DI:Identification/DI:Model", "LocalizedText", lambda s: s["machine"], lasting=True),
    Node(
        "MT:Monitoring/MT:MachineTool/MT:OperationMode",
        "Int32",
        lambda s: SETUP if s["inputs"].get("key") == "setup" else AUTOMATIC,
    ),
    Node("MT:Monitoring/MT:Channel/MT:Name", "String", lambda s: s["controller"], lasting=True),
    Node("MT:Monitoring/MT:Channel/MT:ChannelState", "Int32", lambda s: CHANNEL[program(s)]),
    Node("MT:Monitoring/MT:Channel/MT:ChannelMode", "Int32", lambda s: MODES.get(s["keys"].get("mode"), REMOTE)),
    Node(
        "MT:Monitoring/MT:Channel/MT:FeedOverride",
        "Double",
        lambda s: s["keys"].get("override", HUNDRED),
        unit="%",
        range=(0.0, 120.0),
    ),
    Node("MT:Monitoring/MT:Spindle/MT:Name", "String", lambda s: "spindle", lasting=True),
    Node("MT:Monitoring/MT:Spindle/MT:IsRotating", "Boolean", lambda s: bool(s["outputs"].get("spindle_runs", 0))),
    Node("MT:Production/MT:ActiveProgram/MT:Name", "String", _program_name),
    Node("MT:Production/MT:ActiveProgram/NumberInList", "UInt16", lambda s: 0),
    Node("MT:Production/MT:ActiveProgram/MT:State/CurrentState", "LocalizedText", program),
    Node("MT:Production/MT:ActiveProgram/MT:State/CurrentState/Id", "NodeId", lambda s: PROGRAM[program(s)][1]),
    Node("MT:Production/MT:ActiveProgram/MT:State/CurrentState/Number", "UInt32", lambda s: PROGRAM[program(s)][0]),
    *(node for at, axis in enumerate(CARRIAGES) for node in _of_axis(at, axis)),
    Node("Twin:Safety/Twin:EmergencyStop", "Boolean", emergency),
    Node("Twin:Safety/Twin:Power", "Boolean", powered),
    Node("Twin:Safety/Twin:HoodClosed", "Boolean", lambda s: s["inputs"].get("hood", "closed") == "closed"),
    Node("Twin:Conditions", "String", _told),
    Node("Twin:VirtualTime", "Double", lambda s: s["time_s"], unit="s"),
)
