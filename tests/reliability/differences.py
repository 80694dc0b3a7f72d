"""Sessions tapped from a second machine that is other in one thing: `compare` names it first and marks nothing else.

    host --pty--> isel-twin tap --pty--> Server at speed 1 with the other twin
                       |
                    real.mcap ---> isel-twin compare ---> causes, the weightiest first; what is left unexplained

Everything is in real time and shares the computer with whatever else runs, so delays are real ones. One round is all
kinds of difference and two equal machines; a session takes about 20 s.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from isel_twin.core.spec import TwinSpec
from isel_twin.core.twin import Twin
from tests.reliability.figures import REPLY_S, Figure, main
from tests.reliability.tap import tapped

NUMBER = 1
NEAR_MM = (6.5, 4.0, 5.5)  # where the other machine stands at power-on, unless that is the difference
SLOW = ("@0A300,1000,0,30,0,30,0,30", "@0A-300,1000,0,30,0,30,0,30") * 3
"""Whose ramps hang on the start-stop frequency, and hardly on the acceleration: (v - f0)^2 / (a v)."""
COMMANDS = (
    "@07", "@0d5000,5000,5000", "@0R7", "@0P", "@0A8000,5000,400,2000,0,30,0,30", "@0B1,0", "@0b1",
    "@0M0,9000,0,9000,0,900,0,30", "@0P", "@0B1,1", "@0b1", "@0A6000,8000,6000,8000,0,30,0,30", "@0b1", "@0P",
    "@0M3200,9000,3200,9000,0,900,0,30", "@0A300,9000,0,30,0,30,0,30", "@0A-300,9000,0,30,0,30,0,30", *SLOW, "@0R7",
    "@0V", "@0P", "@0b1", "@0b1", "@0Id1,2,3,4",
)  # fmt: skip
OF_X = ("@01", "@0d5000", "@0R1", "@0P", "@0A1600,5000", "@0R1", "@0P", "@0A1600,5000", "@0R1", "@0P", "@0b1", "@0b1")
"""For play: one axis at a time tells whose it is."""
PHYSICS = "mujoco"


@dataclass(frozen=True)
class Kind:
    """One thing that is other, and by what names of causes it is found."""

    what: str
    names: tuple[str, ...]
    flash: str = ""  # line that the other controller has in its flash
    changes: tuple[tuple[str, Any], ...] = ()  # of the other twin
    call: tuple[str, ...] = ()  # what else `compare` is told
    commands: tuple[str, ...] = COMMANDS
    plant: str = "kinematic"


KINDS = (
    Kind("equal machines", ()),
    Kind("ramp", ("acceleration",), flash="@0IJ50"),
    Kind("start-stop frequency", ("start-stop frequency",), flash="@0Ij900"),
    Kind(
        "backlash",
        ("backlash", "reference speed"),
        changes=(("overrides", {"axes.x.backlash": 0.5}),),
        commands=OF_X,
        plant=PHYSICS,
    ),
    Kind("stuck switch", ("switch",), changes=(("events", [{"at": 0.0, "set": {"limit_y2": "stuck_open"}}]),)),
    Kind("firmware profile", ("firmware",), changes=(("controller", "c142"),)),
    Kind(
        "power-on position",
        ("power-on position",),
        changes=(("start_mm", (20.0, 20.0, 20.0)),),
        call=("--start", ",".join(map(str, NEAR_MM))),
    ),
)


def other(kind: Kind) -> Twin:
    """The second machine."""
    spec = TwinSpec(plant=kind.plant, line_speed=True, start_mm=NEAR_MM)
    for key, value in kind.changes:
        spec = spec.with_events(value) if key == "events" else spec.with_(**{key: value})
    if kind.flash:
        first = Twin(plant="kinematic")
        assert [first.query(line) for line in (kind.flash, "@0IW")] == ["0", "0"]
        spec = spec.with_(flash=first.flash)
    return spec.build(keep_motions=1)


def recorded(kind: Kind, file: Path) -> None:
    """The host's session, recorded by `isel-twin tap`."""
    with tapped(other(kind), file) as port:
        for text in kind.commands:
            port.write(text.encode() + b"\r")
            answer = port.read(1)
            port.timeout = 0.05
            while more := port.read(64):  # the rest of an answer, and 50 ms of silence
                answer += more
            port.timeout = REPLY_S
            if not answer:
                raise RuntimeError(f"{kind.what}: no reply to {text}")


def told(kind: Kind, file: Path) -> dict[str, Any]:
    """The summary of `isel-twin compare`."""
    words = ["compare", str(file), "--machine", "4030", "--plant", kind.plant, "--json", *kind.call]
    command = [sys.executable, "-m", "isel_twin", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr)
    summary: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return summary


def in_words(summary: dict[str, Any]) -> str:
    """The verdict, and what nothing explains."""
    left = [f"{one['command']} (number {one['number']}): {one['text']}" for one in summary["unexplained"]]
    return "; ".join([summary["verdict"], *left])


def measure(number: int) -> list[Figure]:
    figures = []
    for kind in KINDS:
        wrong = left = 0
        for _ in range(number):
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "real.mcap"
                began_s = time.monotonic()
                recorded(kind, file)
                session_s = time.monotonic() - began_s
                summary = told(kind, file)
            causes = [cause["name"] for cause in summary["causes"]]
            wrong += not (causes[:1] and causes[0] in kind.names if kind.names else not causes)
            left += len(summary["unexplained"]) + max(0, len(causes) - bool(kind.names))
            print(f"{kind.what}: {session_s:.0f} s, {in_words(summary)}", file=sys.stderr, flush=True)
        figures += [
            Figure(f"{kind.what}, of {number} tapped sessions: named first otherwise", wrong, "", 0),
            Figure(f"{kind.what}: other things marked", left, "", 0),
        ]
    return figures


if __name__ == "__main__":
    main(measure, NUMBER)
