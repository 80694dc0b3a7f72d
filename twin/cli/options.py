"""Parameters that several commands have, and checks of their values before anything is begun."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError

MachineName = Annotated[str, Parameter(help="Name of a machine (see `machines`) or path of a machine folder.")]
ControllerName = Annotated[str, Parameter(help="Name of a controller (see `controllers`).")]
PlantName = Annotated[str, Parameter(help="mujoco: physics. kinematic: the carriage follows the counter.")]
Seed = Annotated[int, Parameter(help="Seed of power-on positions, switch scatter and bounce.")]
ScenarioFile = Annotated[Path | None, Parameter(help="Timed events (TOML): hood, E-stop, faults, forces.")]
FlashPath = Annotated[Path | None, Parameter(help="The controller's flash memory; created if missing.")]
Interval = Annotated[float, Parameter(help="Time between two samples of a trace, in virtual seconds.")]

Ptys = Annotated[
    list[str] | None,
    Parameter(help="A pseudo terminal, and a link to it if a name is given. The default. May be repeated."),
]
Tcps = Annotated[list[str] | None, Parameter(help="HOST:PORT for raw TCP; port 0: a free one. May be repeated.")]
Rfc2217s = Annotated[
    list[str] | None, Parameter(help="HOST:PORT for RFC 2217 (Telnet with line settings). May be repeated.")
]

STANDARD_INPUT = "/dev/stdin"
"""What `-` stands for."""
STREAMS = {STANDARD_INPUT: "standard input", "/dev/stdout": "standard output"}
"""Files behind them may be in the way of what is written."""


def is_standard_input(path: Path) -> bool:
    """Whether a path is what `-` stands for, however this system writes it."""
    return path == Path(STANDARD_INPUT)


LONGEST_S = 1e9
"""Longest time a call may name, in virtual seconds, as for the times of a scenario."""


def check_seconds(option: str, value: float, low: float) -> None:
    """Raise CallError unless the value of an option is a time from `low` to LONGEST_S seconds."""
    if not low <= value <= LONGEST_S:  # false for nan, too
        raise CallError(f"{option} {value:g}: must be a time from {low:g} to {LONGEST_S:g} s", option=True)


def check_writable(*paths: Path | None, kept: Sequence[Path | None] = ()) -> None:
    """Find out before a long job that its results have nowhere to go, or would replace a file it needs (`kept`).

    Raises CallError.
    """
    import os

    taken = {path.resolve() for path in kept if path is not None}
    streams = {file: name for stream, name in STREAMS.items() if (file := Path(stream).resolve()).is_file()}
    for path in paths:
        if path is None:
            continue
        if is_standard_input(path):
            raise CallError("-: is standard input; name a file for what is written")
        if path.resolve() in streams:
            raise CallError(f"{path}: is {streams[path.resolve()]} of this call; name another file for what is written")
        if path.is_dir():
            raise CallError(f"{path}: is a folder, not a file")
        if (path.is_file() or not path.exists()) and not os.access(path.parent, os.W_OK):
            raise CallError(f"{path}: cannot write in folder {path.parent}; choose another place")
        if path.resolve() in taken and not path.is_char_device():
            raise CallError(f"{path}: is named twice in this call; choose another name for what is written")
        taken.add(path.resolve())


def parse_override(text: str) -> tuple[str, Any]:
    """A machine parameter as KEY=VALUE; the value a number, true, false or a word. Raises CallError."""
    key, equals, word = (part.strip() for part in text.partition("="))
    if not equals or not key or not word:
        raise CallError(f"set {text!r}: must be KEY=VALUE, for example axes.all.steps_per_rev=3200", option=True)
    if word in ("true", "false"):
        return key, word == "true"
    for number in (int, float):
        try:
            return key, number(word)
        except ValueError:
            continue
    return key, word
