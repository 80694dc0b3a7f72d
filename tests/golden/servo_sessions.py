"""Random sessions of the controllers of servo axes: what a host and an operator might do, drawn from one seed.

Lines are those of job files, framed by the controller's language; one in twenty is spoilt. A session is kept alive by
reference runs and by putting right what was operated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from golden.session import Action

from isel_twin.language import create_language, needed

Draw = np.random.Generator

GMI99_LINES = (
    "T1;0",
    "T0;0",
    "T0;1",
    "T3;0",
    "T3;4",
    "T3;8",
    "T1;6;0",
    "T5;11",
    "#1",
    "#1",
    "#0",
    "#9 50",
    "#9 100",
    "o0",
    "o1",
    "B{b}",
    "M{m}",
    "f{f}",
    "G90",
    "G91",
    "G0",
    "N{s};11",
    "N1;24",
    "N0;24",
    "W1",
    "81h {w}",
    "82h {w}",
    "84h {w}",
    "83h {w};{w}",
    "87h {w};{w};{w}",
    "V{w};{w};{w}",
    "p10;16;3",
    "p10;17;3",
    "p10;14;{t}",
    "p11;30;8",
    "m50;7",
    "Q7;0",
    "G2",
    "83h {s};{s}",
    "p3;100;1",
    "p3;101",
    "p3;1;1",
    "s85;170",
)
BWO900_LINES = (
    "G0 X{x} Y{x}",
    "G1 F{f} X{x}",
    "G1 F{f} X{x} Y{x} Z{z}",
    "G91 G1 X{d} F{f}",
    "G90",
    "G2 X{x} Y{x} R80 F{f}",
    "G4.0.2",
    "G3 X{x} Y{x} R-90 F{f}",
    "M3 S1200",
    "M5",
    "M0",
    "G54",
    "G92 X{d}",
    "G53",
    "G45 P160:5 P163:30",
    "G46",
    "G61",
    "G60",
    "P500:P500+1",
    "G28",
    "G29",
    "!text {s}",
    "G41 tr:3 G1 F{f} X{x}",
    "G40 X{x}",
    "G66 X{x}",
    "G12 P71:2 X{x}",
    "G9 Y{x}",
)
OPERATED = (
    ("estop", "pressed"),
    ("estop", "released"),
    ("hood", "open"),
    ("hood", "closed"),
    ("start", "down"),
    ("start", "up"),
    ("stop", "down"),
    ("stop", "up"),
    ("limit_x2", "broken"),
    ("limit_x2", "ok"),
    ("power", "off"),
    ("power", "on"),
)
CALM = tuple(pair for pair in OPERATED if pair[1] in ("released", "closed", "up", "ok", "on"))


def _filled(draw: Draw, line: str) -> str:
    return line.format(
        b=int(draw.integers(20, 900)),
        m=int(draw.integers(2_000, 60_000)),
        f=int(draw.integers(500, 20_000)),
        w=int(draw.integers(-30_000, 60_000)),
        s=int(draw.integers(0, 400)),
        t=int(draw.integers(0, 9)),
        x=round(float(draw.uniform(1.0, 60.0)), 3),
        d=round(float(draw.uniform(-5.0, 5.0)), 3),
        z=round(float(draw.uniform(0.0, 30.0)), 3),
    )


def _pick(draw: Draw, lines: Sequence[str]) -> str:
    return _filled(draw, lines[int(draw.integers(len(lines)))])


def _spoilt(draw: Draw, data: bytes) -> bytes:
    """One in twenty is not what it should be."""
    if not data or draw.random() > 0.05:
        return data
    at = int(draw.integers(len(data)))
    return data[:at] + bytes([int(draw.integers(256))]) + data[at + 1 :]


def _operation(draw: Draw) -> Action:
    return ("set", *OPERATED[int(draw.integers(len(OPERATED)))])


def _pause(draw: Draw) -> Action:
    return ("run", round(float(draw.uniform(0.01, 1.5)), 6), int(draw.integers(1, 4)))


def gmi99_actions(draw: Draw, length: int) -> list[Action]:
    """A session of a GMI99."""
    language = needed(create_language("gmi99"), "gmi99")
    ready: list[Action] = [("write", language.frame("Q7;0")), ("run", 0.3, 2)]
    actions = list(ready)
    for _ in range(length):
        match int(draw.integers(10)):
            case 0:
                actions += [_operation(draw), _pause(draw)]
            case 1:
                actions += [*(("set", *pair) for pair in CALM), *ready]
            case 2:
                actions += [("write", language.frame("Q7;1")), ("run", 6.0, 2)]
            case _:
                count = int(draw.integers(1, 6))
                for _ in range(count):
                    actions.append(("write", _spoilt(draw, language.frame(_pick(draw, GMI99_LINES)))))
                actions.append(_pause(draw))
    return actions


def bwo900_actions(draw: Draw, length: int) -> list[Action]:
    """A session of a BWO 900: programs transferred, started, disturbed."""
    actions: list[Action] = [("write", _file("D", "K1:P8683: 1", *(f"K1:P{p}: 1" for p in (12_530, 12_330, 12_130))))]
    actions.append(("run", 12.0, 3))
    for _ in range(max(length // 4, 2)):
        blocks = [f"N{10 * n + 10} {_pick(draw, BWO900_LINES)}" for n in range(int(draw.integers(2, 12)))]
        program = _file(f"P{int(draw.integers(1, 4))}", "N5 F3000", *blocks, "N900 M30")
        actions.append(("write", _spoilt(draw, program)))
        start = _file(
            "D", f"K1:P8800: {int(draw.integers(1, 4))}", f"K1:P8683: {2 if draw.random() < 0.8 else 4}", "K1:P8684: 1"
        )
        actions += [("write", start), _pause(draw)]
        match int(draw.integers(6)):
            case 0:
                actions += [_operation(draw), _pause(draw), *(("set", *pair) for pair in CALM)]
            case 1:
                actions += [("write", _file("D", "K1:P8684: 0")), _pause(draw), ("write", _file("D", "K1:P8684: 1"))]
            case 2:
                actions += [("write", _file("D", f"K1:P11310: {int(draw.integers(0, 121))}")), _pause(draw)]
            case 3:
                actions += [("write", _file("D", "K1:P8705: 1"))]
        actions += [("run", 4.0, 2), ("write", _file("D", "K1:P8683: 1")), ("run", 0.5, 1)]
    return actions


def _file(*lines: str) -> bytes:
    return "".join(f"{line}\r\n" for line in ("", *lines, "#")).encode() + b"\x04\r\n"
