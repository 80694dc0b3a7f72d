"""What is wrong with a served machine, out of a state of the control port; for what stands beside a served twin."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from isel_twin.base.axes import CARRIAGES

State = Mapping[str, Any]
"""The answer to {"state": true}."""


def powered(state: State) -> bool:
    """Is the safety relay closed? True for machines without one."""
    return bool(state["outputs"].get("power", 1))


def emergency(state: State) -> bool:
    """Is the E-stop pressed, or the safety relay open?"""
    return state["inputs"].get("estop") == "pressed" or not powered(state)


def conditions(state: State) -> dict[str, str]:
    """What each condition says by its name, "" where nothing is wrong.

    `lost_x` and `drive_x` of each axis: more than half a slip of steps is lost; a servo drive has switched itself off.
    """
    told = {
        "power": "" if powered(state) else "the safety relay is open",
        "controller": "the controller has an error that no reply has told" if state["fault"] else "",
        "line": "the line to the host is cut" if "line_cut" in state["faults"] else "",
    }
    for at, axis in enumerate(CARRIAGES):
        lost, slip = state["lost_steps"][at], state["slip_steps"][at]
        number, cause = state["drive_faults"][at]
        told[f"lost_{axis}"] = f"{axis} has lost {lost:.0f} steps" if abs(lost) >= slip / 2.0 else ""
        told[f"drive_{axis}"] = f"drive of {axis}: {cause}" if number else ""
    return told
