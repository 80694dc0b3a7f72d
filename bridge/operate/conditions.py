"""What is wrong with a served machine, out of a state of the control port; for what stands beside a served twin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from isel_twin.base.axes import CARRIAGES

State = Mapping[str, Any]
"""The answer to {"state": true}."""

NEEDED = frozenset({
    "machine", "controller", "idle", "fault", "unfinished", "inputs", "outputs", "faults", "lost_steps", "slip_steps",
    "drive_faults", "position_mm", "position_error_mm",
})  # fmt: skip
"""What those who stand beside a served machine look at in it."""

# how grave an alert is, of 1000
WRONG = 800  # one of `conditions`
STOPPED = 700  # E-stop
OPEN = 500  # hood
STRUCK = 300  # end switch: every reference run does that


@dataclass(frozen=True)
class Alert:
    """Something that an operator is told. severity: 1 to 1000."""

    text: str
    severity: int


def powered(state: State) -> bool:
    """Is the safety relay closed? True for machines without one."""
    return bool(state["outputs"].get("power", 1))


def emergency(state: State) -> bool:
    """Is the E-stop pressed, or the safety relay open?"""
    return state["inputs"].get("estop") == "pressed" or not powered(state)


def program(state: State) -> str:
    """State of the program, or of a host's lines: Running, Ended, Interrupted, Aborted."""
    if state["fault"]:
        return "Aborted"
    if state["idle"]:
        return "Interrupted" if state["unfinished"] else "Ended"
    return "Running" if powered(state) else "Interrupted"


def conditions(state: State) -> dict[str, str]:
    """What each condition says by its name, "" where nothing is wrong.

    `lost_x` and `drive_x` of each axis: more than half a slip of steps is lost; a servo drive has switched itself off.
    """
    told = {
        "power": "" if powered(state) else "the safety relay is open",
        "controller": (state.get("fault_cause") or "the controller shows an error") if state["fault"] else "",
        "line": "the line to the host is cut" if "line_cut" in state["faults"] else "",
    }
    for at, axis in enumerate(CARRIAGES):
        lost, slip = state["lost_steps"][at], state["slip_steps"][at]
        number, cause = state["drive_faults"][at]
        told[f"lost_{axis}"] = f"{axis} has lost {lost:.0f} steps" if abs(lost) >= slip / 2.0 else ""
        told[f"drive_{axis}"] = f"drive of {axis}: {cause}" if number else ""
    return told


def alerts(state: State) -> dict[str, Alert]:
    """What is wrong, and what stops a machine, by its name: those of `conditions`, `estop`, `hood`, `limit_x1` ..."""
    told = {name: Alert(text, WRONG) for name, text in conditions(state).items() if text}
    inputs = state["inputs"]
    if inputs.get("estop") == "pressed":
        told["estop"] = Alert("the E-stop is pressed", STOPPED)
    if inputs.get("hood", "closed") != "closed":
        told["hood"] = Alert("the hood is open", OPEN)
    struck = [name for name, contact in inputs.items() if name.startswith("limit_") and contact == "struck"]
    return told | {name: Alert(f"end switch {name.removeprefix('limit_')} is struck", STRUCK) for name in struck}
