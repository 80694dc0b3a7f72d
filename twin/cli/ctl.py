"""`isel-twin ctl`: operate a machine that `isel-twin serve --control` serves.

    isel-twin ctl 127.0.0.1:4002 set estop=pressed

Exit codes: 0 done; 1 a wait that ran out of time; 2 a call that cannot be carried out, with the reason in one line. The
server's answer is printed as a line of JSON.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from isel_twin.base.errors import CallError
from isel_twin.cli import options

if TYPE_CHECKING:
    from isel_twin.wiring.acts import Act

Command = Literal[
    "set", "fault", "force", "phase", "force_n", "phase_lost", "swapped", "friction_n", "obstacle_mm", "payload_kg",
    "undervoltage", "hot_stage_k", "noise", "dropped", "doubled", "line_cut", "reset", "brownout", "key", "pause",
    "resume", "step", "speed", "state", "settable", "keys", "wait", "stop",
]  # fmt: skip

_SHORT = {"fault": "set", "force": "force_n", "phase": "phase_lost"}  # short names for keys of an event
_ALONE = ("pause", "resume", "state", "settable", "keys", "stop")


def ctl(
    address: Annotated[str, Parameter(help="HOST:PORT, what serve prints as control.")],
    command: Annotated[Command, Parameter(help="What to do.")],
    *what: Annotated[str, Parameter(help="See above.", allow_leading_hyphen=True)],
    place: Annotated[
        Literal["tool", "table"] | None, Parameter(help="Of a force; without it, what the axis moves.")
    ] = None,
    token_file: Annotated[Path | None, Parameter(help="Holds what the server wants to be told.")] = None,
) -> int:
    """Operate a served machine: press, break, push, pause, look, wait.

    set estop=pressed hood=open; fault limit_x2=broken (ok: whole again); phase x=a (x= restores it); noise 0.01;
    force x=50 --place tool (newton; 0 lets go); and what else an event of a scenario can do, by its key: friction_n
    x=40, obstacle_mm y=120 (or off), payload_kg table=8, swapped limit_x1=limit_x2, undervoltage 0.4, hot_stage_k x=60,
    dropped 0.1, doubled 0.1, line_cut true, reset, brownout true; each of these with for=SECONDS; keys of the control's
    own panel, which `keys` lists: key mode=auto, key start; pause; resume; step
    0.001 (seconds, while paused); speed 2 or max; state; settable; wait output=spindle is=1, input=estop is=pressed,
    level=p1.0 is=0, position=x above=120, idle, time=12.5, each with timeout_s=, wall_s= and pause; stop.
    """
    if place is not None and command not in ("force", "force_n"):
        raise CallError("place: goes with force", option=True)
    from isel_twin.bridge.operate.client import Client, ClientError, WaitError
    from isel_twin.cli.outputs import say, say_json

    request, token = _request(command, what, place), options.token(token_file)
    try:
        with Client(address, token) as client:
            say_json(client.ask(request))
    except WaitError as error:
        say(str(error))
        return 1
    except ClientError as error:
        raise CallError(str(error)) from None
    return 0


def _request(command: Command, what: Sequence[str], place: str | None) -> dict[str, Any]:
    from isel_twin.wiring.acts import ACTS

    if command in _ALONE:
        if what:
            raise CallError(f"{command}: takes nothing, not {what[0]!r}")
        return {command: True}
    act = ACTS.get(_SHORT.get(command, command))
    if act is not None:
        return _act(command, act, what) | ({} if place is None else {"place": place})
    if command == "wait":
        if not what:
            raise CallError("wait: needs what to wait for, for example idle or output=spindle is=1")
        pairs = [_pair(command, item) if "=" in item else (item, "true") for item in what]
        return {"wait": {key: _value(text) for key, text in pairs}}
    if len(what) != 1:
        raise CallError(f"{command}: needs one value")
    return {command: _value(what[0])}


def _act(command: str, act: Act, what: Sequence[str]) -> dict[str, Any]:
    """The event of one act, for each NAME=VALUE or as a whole, with an optional for=SECONDS."""
    from isel_twin.base.parameters import Limits

    ends = [item.removeprefix("for=") for item in what if item.startswith("for=")]
    lasting: dict[str, Any] = {"for": _value(ends[-1])} if ends else {}
    values = [item for item in what if not item.startswith("for=")]
    if act.by:
        switches = act.by == "key"
        pairs = [(item, "true") if switches and "=" not in item else _pair(command, item) for item in values]
        if not pairs:
            raise CallError(f"{command}: needs NAME=VALUE, one or more")
        numbers = switches or isinstance(act.value, Limits)
        return {act.key: {name: _value(text) if numbers else text for name, text in pairs}} | lasting
    if not values and act.value is bool:
        return {act.key: True} | lasting
    if len(values) != 1:
        raise CallError(f"{command}: needs one value")
    return {act.key: _value(values[0])} | lasting


def _pair(command: str, item: str) -> tuple[str, str]:
    name, equals, value = item.partition("=")
    if not (name and equals):
        raise CallError(f"{command}: {item!r} is not NAME=VALUE, such as estop=pressed or x=40")
    return name, value


def _value(text: str) -> float | bool | str:
    """A number or a switch, else text; nan and inf are text and so are refused by name."""
    if text in ("true", "false"):
        return text == "true"
    try:
        number = float(text)
    except ValueError:
        return text
    if not math.isfinite(number):
        return text
    return int(number) if number.is_integer() else number
