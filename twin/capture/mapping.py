"""The roles of signals: step, direction and enable of the axes.

    x.step=D0,x.dir=!D1,enable=!D7          on the command line: ROLE=SIGNAL, "!" inverts

    role                  signal
    x.step, x.dir         a step at each rising edge, in positive direction while dir is high
    x.plus, x.minus       a step in one direction or the other at each rising edge (two-pulse drives)
    enable                power stages on while high; without it they are on all the time

An inverted step signal counts at its falling edges, an inverted dir is positive while low. Signals with usual names
(`step_x`, `X.DIR`, `Ystep`, `enable`) need no map, and neither do the dumps of this package, whose dir is high for
minus and which contain the outputs for the stages. No role is guessed otherwise (capture/3).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.capture.wave import CaptureError, WrongCallError

OUTPUTS = ("stages", "brake", "current_lowering")  # outputs of a controller with an effect on drives
_KINDS = ("step", "dir", "plus", "minus")
_ROLES = {*(f"{axis}.{kind}" for axis in AXIS_NAMES for kind in _KINDS), "enable"}
_WORDS = {
    "step": ("step", "stp", "pulse", "pul", "clk", "clock"),
    "dir": ("dir", "direction"),
    "plus": ("cw", "plus"),
    "minus": ("ccw", "minus"),
}
_USUAL: Mapping[str, str] = {
    **{
        name: f"{axis}.{kind}"
        for axis in AXIS_NAMES
        for kind, words in _WORDS.items()
        for word in words
        for name in (word + axis, axis + word)
    },
    **dict.fromkeys(("enable", "en", "enabled"), "enable"),
}
MOST_NAMES = 24  # names listed in a message


@dataclass(frozen=True)
class Signal:
    """A signal of a file by its name, and whether it is inverted."""

    name: str
    inverted: bool = False


def parse_map(texts: Iterable[str]) -> dict[str, Signal]:
    """Signals by role, from texts such as "x.step=D0,x.dir=!D1". Raises WrongCallError."""
    signals: dict[str, Signal] = {}
    for item in (item.strip() for text in texts for item in text.split(",")):
        role, equals, name = (part.strip() for part in item.partition("="))
        role = role.lower()
        if not equals or not name.lstrip("!").strip():
            raise WrongCallError(f"map {item!r}: must be ROLE=SIGNAL, for example x.step=D0 or x.dir=!D1")
        if role not in _ROLES:
            known = f"{', '.join(f'x.{kind}' for kind in _KINDS)}, the same of {', '.join(AXIS_NAMES[1:])}, and enable"
            raise WrongCallError(f"map {item!r}: unknown role {role!r}; there are {known}")
        if role in signals:
            raise WrongCallError(f"map {item!r}: {role} is mapped twice; leave one out")
        signals[role] = Signal(name.lstrip("!").strip(), (len(name) - len(name.lstrip("!"))) % 2 == 1)
    check_roles(signals)
    return signals


def check_roles(signals: Mapping[str, Signal]) -> None:
    """Raise WrongCallError for an axis with half a pair of signals."""
    for axis in AXIS_NAMES:
        kinds = {kind for kind in _KINDS if f"{axis}.{kind}" in signals}
        if kinds not in ({"step", "dir"}, {"plus", "minus"}, set()):
            if len(kinds) == 1:
                kind = kinds.pop()
                missing = {"step": "dir", "dir": "step", "plus": "minus", "minus": "plus"}[kind]
                raise WrongCallError(f"map: {axis}.{kind} needs {axis}.{missing} beside it; map that, too")
            has = ", ".join(sorted(kinds))
            raise WrongCallError(f"map: {axis} has {has}; it takes step and dir, or plus and minus")


def recognise(names: Sequence[str]) -> dict[str, Signal]:
    """Signals by role, guessed from the names of a file. Raises CaptureError if a role is ambiguous, or none is
    found."""
    own = dict(_own(names))
    if own:
        return own
    found: dict[str, Signal] = {}
    for name in names:
        role = _USUAL.get(re.sub(r"[^a-z0-9]", "", name.rpartition(".")[2].lower()))
        role = role or _USUAL.get(re.sub(r"[^a-z0-9]", "", name.lower()))
        if role in found:
            raise CaptureError(f"both {found[role].name} and {name} may be {role}; say which one, {_example(names)}")
        if role is not None:
            found[role] = Signal(name)
    if not found.keys() - {"enable"}:
        shown = ", ".join(names[:MOST_NAMES]) + (", ..." if len(names) > MOST_NAMES else "")
        raise CaptureError(f"no signal has a name that tells its role: {shown}; say which is which, {_example(names)}")
    check_roles(found)
    return found


def _own(names: Sequence[str]) -> Iterator[tuple[str, Signal]]:
    """Signals of a dump of this package."""
    present = set(names)
    if "step.step_x" not in present:
        return
    for axis in AXIS_NAMES:
        if {f"step.step_{axis}", f"step.dir_{axis}"} <= present:
            yield f"{axis}.step", Signal(f"step.step_{axis}")
            yield f"{axis}.dir", Signal(f"step.dir_{axis}", inverted=True)
            if f"step.full_{axis}" in present:
                yield f"{axis}.full", Signal(f"step.full_{axis}")
    for output in OUTPUTS:
        if f"output.{output}" in present:
            yield output, Signal(f"output.{output}")


def _example(names: Sequence[str]) -> str:
    first, second = [*names, "D0", "D1"][:2]
    return f'for example --map "x.step={first},x.dir={second}"'
