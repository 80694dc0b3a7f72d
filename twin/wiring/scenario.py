"""Scenario files: what happens around the machine, and when, in virtual time.

    # scenario.toml
    [[event]]
    at = 2.5                                 # seconds of virtual time since power-on
    set = { hood = "open" }                  # as Twin.set_input: an element, or a contact with a fault

    [[event]]
    at = 3.0
    set = { limit_x2 = "broken" }            # a wire comes off

    [[event]]
    at = 4.0
    force_n = { x = 50.0 }                   # a hand pushes the carriage, in N along the axis; 0 lets go

    [[event]]
    at = 5.0
    phase_lost = { x = "a" }                 # a motor phase is interrupted: "a", "b", "ab"; "" restores it

    [[event]]
    at = 6.0
    noise = 0.01                             # chance of a flipped bit in each byte on the serial line

One file serves the command line, tests and environments. Everything is checked when the file is read.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_AXES = {"x": 0, "y": 1, "z": 2}
_KEYS = ("at", "set", "force_n", "phase_lost", "noise")
_PHASES = ("", "a", "b", "ab")


class ScenarioError(ValueError):
    """A scenario file is wrong; the message is one line that names file, event, key and remedy."""


@dataclass(frozen=True)
class ScenarioEvent:
    """What happens at one instant."""

    at_ns: int
    inputs: Mapping[str, str] = field(default_factory=dict)
    force_n: Mapping[int, float] = field(default_factory=dict)
    phase_lost: Mapping[int, str] = field(default_factory=dict)
    noise: float | None = None


def load_scenario(path: str | Path, settable: Mapping[str, tuple[str, ...]]) -> tuple[ScenarioEvent, ...]:
    """Read a scenario file; events sorted by time, in file order at equal times.

    settable: what can be set and the states of each, see `Wiring.settable`.

    Raises ScenarioError for anything wrong in it, OSError if it cannot be read.
    """
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: not a TOML file: {error}") from None
    unknown = set(document) - {"event"}
    if unknown:
        raise ScenarioError(f"{path}: unknown key {sorted(unknown)[0]!r}; a scenario is a list of [[event]] tables")
    tables = document.get("event", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise ScenarioError(f"{path}: `event` must be written as [[event]] tables")
    events = [_event(table, f"{path}: event {number}", settable) for number, table in enumerate(tables, 1)]
    return tuple(sorted(events, key=lambda event: event.at_ns))


def _event(table: dict[str, Any], where: str, settable: Mapping[str, tuple[str, ...]]) -> ScenarioEvent:
    for key in table:
        if key not in _KEYS:
            near = difflib.get_close_matches(key, _KEYS, 1)
            hint = f"did you mean {near[0]!r}?" if near else f"keys are {', '.join(_KEYS)}"
            raise ScenarioError(f"{where}: unknown key {key!r}; {hint}")
    at_s = _number(table.get("at"), f"{where}: `at`", 0.0, 1e9)
    if len(table) < 2:
        raise ScenarioError(f"{where}: nothing happens; say what: {', '.join(_KEYS[1:])}")
    inputs = _table(table, "set", where)
    for name, state in inputs.items():
        check_input(name, state, settable, where)
    forces = {
        _axis(axis, f"{where}: `force_n`"): _number(value, f"{where}: `force_n.{axis}`", -1e5, 1e5)
        for axis, value in _table(table, "force_n", where).items()
    }
    phases = {}
    for axis, phase in _table(table, "phase_lost", where).items():
        if phase not in _PHASES:
            raise ScenarioError(f'{where}: `phase_lost.{axis}` is {phase!r}; write "a", "b", "ab" or ""')
        phases[_axis(axis, f"{where}: `phase_lost`")] = phase
    noise = _number(table["noise"], f"{where}: `noise`", 0.0, 1.0) if "noise" in table else None
    return ScenarioEvent(round(at_s * 1e9), inputs, forces, phases, noise)


def check_input(name: str, state: Any, settable: Mapping[str, tuple[str, ...]], where: str) -> None:
    """Raise ScenarioError unless `name` is something that can be set to `state`."""
    states = settable.get(name, ())
    if not states:
        near = difflib.get_close_matches(name, settable, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"there are: {', '.join(settable)}"
        raise ScenarioError(f"{where}: unknown input {name!r}; {hint}")
    if state not in states:
        raise ScenarioError(f"{where}: input {name!r} cannot be {state!r}; it can be: {', '.join(states)}")


def _table(table: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise ScenarioError(f"{where}: `{key}` must be a table such as {{ name = value }}")
    return value


def _axis(name: str, where: str) -> int:
    if name not in _AXES:
        raise ScenarioError(f"{where}: unknown axis {name!r}; axes are {', '.join(_AXES)}")
    return _AXES[name]


def _number(value: Any, where: str, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ScenarioError(f"{where} is {value!r}; it must be a number from {low:g} to {high:g}")
    return float(value)
