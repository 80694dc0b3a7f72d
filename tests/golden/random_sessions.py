"""Random sessions: what a host and an operator might do to a controller, drawn from one seed.

A language is a set of templates, a word in braces being a field: "@0A{s},{v},{s},{v},{s},{v},{s},{v}". Most lines are
legal; some are spoilt afterwards. Lines go out one by one, many in one write, or in pieces with time in between; inputs
are operated, control bytes interrupt, and now and then everything is made ready again, so that a session stays alive.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from golden.servo_sessions import bwo900_actions, gmi99_actions
from golden.session import Action, Session

Draw = np.random.Generator

STATES = {
    "hood": ("open", "closed", "forced", "closed"),
    "estop": ("pressed", "released"),
    "key": ("setup", "automatic"),
    "power": ("off", "on"),
    "start": ("down", "up"),
    "stop": ("down", "up"),
    "overtemperature": ("hot", "normal"),
    "probe": ("touched", "free"),
    **{f"user_{bit}": ("high", "low") for bit in range(4)},
    "limit_x1": ("broken", "ok", "stuck_closed", "ok"),
    "limit_x2": ("broken", "ok"),
    "limit_y2": ("stuck_open", "ok"),
    "limit_z1": ("broken", "stuck_closed", "ok"),
    "estop_1": ("broken", "ok"),
}
CALM = (
    ("estop", "released"),
    ("overtemperature", "normal"),
    ("hood", "closed"),
    ("key", "automatic"),
    ("power", "on"),
    ("start", "up"),
    ("stop", "up"),
    *((name, "ok") for name in ("limit_x1", "limit_x2", "limit_y2", "limit_z1", "estop_1")),
)
"""What an operator puts right before work goes on."""

SCENARIOS = (
    '[[event]]\nat = 1.5\nset = { hood = "open" }\n\n[[event]]\nat = 2.25\nset = { hood = "closed" }\n',
    '[[event]]\nat = 0.75\nset = { limit_x2 = "broken" }\n\n[[event]]\nat = 2.5\nset = { limit_x2 = "ok" }\n',
    "[[event]]\nat = 1.0\nforce_n = { x = 40.0, y = -20.0 }\n\n[[event]]\nat = 3.0\nforce_n = { x = 0.0 }\n",
    '[[event]]\nat = 2.0\nphase_lost = { x = "a" }\n\n[[event]]\nat = 3.0\nphase_lost = { x = "" }\n',
)
NOISE = "[[event]]\nat = 0.5\nnoise = 0.02\n"

OVERRIDES: tuple[dict[str, Any], ...] = (
    {},
    {},
    {},
    {"imperfections": "ideal"},
    {"imperfections": "static"},
    {"payload.mass": 8.0},
    {"axes.all.lead": 4.0},
)

PAUSES_S = (0.0, 0.000001, 0.000137, 0.001, 0.02, 0.1, 0.3, 0.3, 1.0, 1.0, 3.0)


def words(text: str) -> list[str]:
    """The words of a text; here, templates."""
    return text.split()


def pick(draw: Draw, choices: Sequence[Any]) -> Any:
    """One of these."""
    return choices[int(draw.integers(len(choices)))]


def chance(draw: Draw, probability: float) -> bool:
    """True that often."""
    return bool(draw.random() < probability)


def fill(draw: Draw, template: str, fields: dict[str, Callable[[Draw], Any]]) -> str:
    """The template with a fresh value for every word in braces."""
    return re.sub(r"\{(\w+)\}", lambda match: str(fields[match[1]](draw)), template)


def spoil(draw: Draw, line: str) -> str:
    """The line with one thing wrong, or at least unusual."""
    at = int(draw.integers(len(line) + 1))
    match int(draw.integers(9)):
        case 0:
            return line[:at] + line[at + 1 :]
        case 1:
            return line[:at] + pick(draw, ",-+.@x 7\n\x00é") + line[at:]
        case 2:
            return line.rsplit(",", 1)[0]
        case 3:
            return line + ",1"
        case 4:
            return line.swapcase()
        case 5:
            return re.sub(r"\d+", str(pick(draw, (-1, 29, 40_001, 65_536, 8_388_608, 10**12))), line, count=2)
        case 6:
            return " ".join(line)
        case 7:
            return re.sub(r"(\d+)", r"\1.75", line)
        case _:
            return line + "1" * int(pick(draw, (3, 130, 300)))


def pieces(draw: Draw, data: bytes) -> list[Action]:
    """The bytes in one write, or in two with a little time in between."""
    if chance(draw, 0.85) or len(data) < 2:
        return [("write", data)]
    at = int(draw.integers(1, len(data)))
    return [("write", data[:at]), ("run", pick(draw, PAUSES_S[:5]), 1), ("write", data[at:])]


def pause(draw: Draw, jitter: bool) -> Action:
    """Time passes, in one piece or in several; with jitter, by an odd number of nanoseconds."""
    seconds = pick(draw, PAUSES_S) if chance(draw, 0.6) else round(float(draw.exponential(0.4)), 9)
    if jitter:
        seconds = round(seconds + int(draw.integers(1000, 99_999)) * 1e-9, 9)
    return ("run", seconds, int(pick(draw, (1, 1, 7, 30))))


def operation(draw: Draw, allowed: Sequence[str]) -> Action:
    """Somebody touches something."""
    name = pick(draw, allowed)
    return ("set", name, pick(draw, STATES[name]))


def calm(wanted: Sequence[str]) -> list[Action]:
    """Everything is put right."""
    return [("set", name, state) for name, state in CALM if name in wanted]


# ---- iMC -----------------------------------------------------------------------------------------------------------


def _arc(draw: Draw) -> str:
    """Parameters B, speed, D, Xs, Ys, Rx, Ry: mostly the printed examples and their likes, sometimes any numbers."""
    speed = _speed(draw)
    if chance(draw, 0.6):
        length, d, xs, ys, rx, ry = pick(
            draw,
            (
                (400, 119, -141, 141, -1, -1),
                (200, -50, 100, 0, -1, 1),
                (200, 50, 100, 0, -1, -1),
                (2400, -200, 0, -400, -1, 1),
                (800, 0, 100, 0, -1, -1),
                (3200, -1000, -2000, 0, 1, -1),
            ),
        )
        return f"{length},{speed},{d},{xs},{ys},{rx},{ry}"
    d, xs, ys = draw.integers(-1500, 1500, 3).tolist()
    return f"{draw.integers(0, 3000)},{speed},{d},{xs},{ys},{pick(draw, (1, -1, 0))},1"


def _steps(draw: Draw) -> int:
    size = pick(draw, (0, 40, 400, 400, 3000, 3000, 12_000))
    return int(draw.integers(-size // 4, size + 1))


def _speed(draw: Draw) -> int:
    return int(pick(draw, (30, 299, 300, 301, 900, 2000, 3333, 5000, 8000, 9999, 10_000, 20_000, 40_000)))


def _wild(draw: Draw) -> int:
    return int(pick(draw, (-1, 0, 1, 2, 3, 7, 8, 16, 127, 128, 255, 256, 4000, 4001, 32_768, 65_535)))


IMC_FIELDS: dict[str, Callable[[Draw], Any]] = {
    "s": _steps,
    "v": _speed,
    "arc": _arc,
    "wild": _wild,
    "bit": lambda draw: int(draw.integers(2)),
    "few": lambda draw: pick(draw, (0, 1, 2, 2, 3, 5)),
    "watch": lambda draw: pick(draw, (0, 1, 1, 1, 2)),
    "mask": lambda draw: int(draw.integers(16)),
    "axes": lambda draw: pick(draw, (7, 7, 7, 1, 2, 4, 3, 5, 6, 8, 15)),
    "port": lambda draw: int(draw.integers(4)),
    "output": lambda draw: pick(draw, (0, 1, 2, 3, 4, 5, 6, 100, 101, 65_529)),
    "byte": lambda draw: pick(draw, (0, 1, 2, 4, 128, 255)),
    "startstop": lambda draw: pick(draw, (20, 100, 300, 301, 999, 2000, 4000)),
    "ramp": lambda draw: pick(draw, (1, 7, 50, 100, 400, 1600, 4000)),
    "back": lambda draw: int(draw.integers(-3, 4)),
}

IMC_MOVES = words("""
@0A{s},{v},{s},{v},{s},{v},0,30
@0A{s},{v},{s},{v},{s},{v},{s},{v}
@0a{s},{v},0,900,0,900,0,900
@0M{s},{v},{s},{v},{s},{v},0,30
@0m{s},{v},{s},{v},0,900,0,30
@0A{s},{v},{s},{v}
@0y{arc}
@0w{arc},{s}
@0Z{port},{byte},{bit},{v},{s},{s},{s}
@0F7
@0R{axes}
@0r4
@0S
""")

IMC_SETTINGS = words("""
@0z{bit} @0j{startstop} @0J{ramp} @0e{bit} @0e2 @0f{bit} @0f-1 @0f0 @0n{axes} @0N{axes} @0N7 @0T{bit} @0g{bit}
@0d{v},{v},{v} @0d{v},{v},{v},{v} @0B{output},{byte} @0B{output},{wild} @0b{port} @0P @0p @0V @0? @0U @0h @0H
@0DRp @0DRn @0DS0 @0Id{v},{v},{v},{v} @0IF{mask},{mask},20,9 @0IJ{ramp} @0Ij{startstop} @0IE57343 @0IE{wild}
@0Ie{mask} @0ID{mask} @0IR{mask} @0IT{mask} @0IA{port},{byte},{byte} @0Ia0,{byte},{byte} @0IH{port},{byte},{byte}
@0IN{port},{byte},{byte} @0IUgolden @0IL @0IW @0IX @0IC{bit} @07 @07 @0{axes} @0IX
""")

IMC_STORABLE = words("""
0{s},{v},{s},{v},{s},{v},0,900
0{s},{v},{s},{v},{s},{v},{s},{v}
m{s},{v},{s},{v},{s},{v},0,900
y{arc}
w{arc},{s}
133 233,{back} 3{mask},{back} 30,{back} 52 51 60,1,{bit} 60,128,5 7{axes} d{v},{v},{v},{v} e{bit} f-1 g{bit}
j{startstop} J{ramp} n{axes} N7 o{port},{mask},{bit},{back} o0,128,{byte},{back} p0,{bit},{bit} T{bit} z{bit}
""")

IMC_PROGRAMS = (
    "N7|0{s},{v},0,900,0,900,0,900|3 {few},-1|0{s},{v},{s},{v},0,900,0,900|3 {few},-2|3 2,-4|5 1",
    "N7|020,900,0,900,0,900,0,900|" + "|".join(f"3 1,-{depth}" for depth in range(1, 8)),
    "N7|z1|0{s},{v},{s},{v},{s},{v},0,900|o0,{bit},1,2|0{s},{v},0,900,0,900,0,900|3 0,-2|5 2|m0,{v},0,{v},0,{v},0,900",
    "N7|233,2|0{s},{v},0,900,0,900,0,900|165|266,-1|3 {few},-3",
    "N7|60,{bit},1|08000,{v},{s},{v},0,900,0,900|60,128,{byte}|0-4000,{v},0,{v},0,900,0,900|5 3|3 {few},-4",
    "N7|p0,{mask},1|J{ramp}|03000,{v},-300,{v},0,900,0,900|j{startstop}|p0,128,0|0-3000,{v},300,{v},0,900,0,900|3 0,-3",
    "N7|f-1|y{arc}|f0|w{arc},{s}|e1|y{arc}|3 {few},-1",
    "71|0{s},{v},0,900,0,900,0,900|5 5|3 {few},-2|72|n7|m{s},{v},{s},{v},0,900,0,900",
)
"""Programs that do something, with a bar between lines: loops, branches on ports, conditions, arcs, reference runs."""
IMC_WATCHES = ("@0IA0,{watch},0", "@0IH0,{watch},0", "@0IN0,{watch},0", "@0IA0,1,1", "@0Ia0,{byte},{byte}")
"""Ports that end or stop programs (4.2.11 to 4.2.14)."""
DURING_PROGRAMS = ("user_0", "user_0", "user_1", "user_2", "start", "stop", "hood")

IMC_RARE = ("@0k", "@0i", "9", "@0IO1", "@0IO0", "@1P", "@0G1", "@0G0", "@0x", "hello", "", "@", "0", "\xe9")


def imc_line(draw: Draw) -> str:
    """A command of the iMC's language, legal in form nine times out of ten."""
    lines = pick(draw, (IMC_MOVES,) * 10 + (IMC_SETTINGS,) * 6 + (IMC_STORABLE, IMC_RARE))
    line = fill(draw, pick(draw, lines), IMC_FIELDS)
    return spoil(draw, line) if chance(draw, 0.08) else line


def imc_program(draw: Draw) -> list[str]:
    """Lines that erase, store and start a small program."""
    if chance(draw, 0.6):
        lines = fill(draw, pick(draw, IMC_PROGRAMS), IMC_FIELDS).split("|")
    else:
        lines = ["N7", *(fill(draw, pick(draw, IMC_STORABLE), IMC_FIELDS) for _ in range(int(draw.integers(1, 7))))]
    if chance(draw, 0.1):
        lines.append(spoil(draw, lines[-1]))
    watches = [fill(draw, pick(draw, IMC_WATCHES), IMC_FIELDS)] if chance(draw, 0.4) else []
    return [*watches, "@0k", "@0i", *lines, "9", "@0S"]


def imc_program_runs(draw: Draw) -> list[Action]:
    """What an operator and a host do while a program runs."""
    actions: list[Action] = []
    for _ in range(int(draw.integers(1, 6))):
        doing = operation(draw, DURING_PROGRAMS)
        actions.append(("write", pick(draw, (b"!", b"A", b"B", b"\xfd"))) if chance(draw, 0.4) else doing)
        actions.append(("run", round(float(draw.uniform(0.001, 0.6)), 7), 3))
    return actions


def imc_actions(draw: Draw, length: int, physics: bool) -> list[Action]:
    """A session of an iMC; with physics it always begins with a reference run, so that there is motion to follow."""
    ready = b"@07\r@0N7\r"
    actions: list[Action] = []
    match 1 if physics else int(draw.integers(16)):
        case 0:
            pass
        case 1 | 2 | 3:
            actions += [("write", b"@07\r@0d%d,4000,3000\r@0R7\r" % pick(draw, (900, 2000, 5000))), ("run", 9.0, 9)]
        case 4:
            actions += [("write", b"@08\r@07\r@0N8\r@0N7\r"), ("run", 0.01, 1)]
        case 5:
            actions += [("write", b"@03\r@0R3\r"), ("run", 5.0, 3)]
        case _:
            actions += [("write", ready), ("run", 0.01, 1)]
    for _ in range(length):
        match int(draw.integers(24)):
            case 0 | 1:
                data = "".join(f"{line}\r" for line in imc_program(draw)).encode("latin-1")
                actions += [*pieces(draw, data), ("run", 2.2, 1), pause(draw, False), *imc_program_runs(draw)]
            case 2 | 3:
                actions += [("write", bytes([pick(draw, (253, 253, 253, 255, 254))])), pause(draw, False)]
            case 4 | 5 | 6:
                actions += [operation(draw, list(STATES)), pause(draw, False)]
            case 7 | 8 | 9 | 10 | 11:
                actions += [*calm(list(STATES)), ("run", 0.01, 1), ("write", b"\xff\r" + ready), ("run", 0.02, 1)]
            case 12 | 13 | 14:
                lines = [imc_line(draw) for _ in range(int(draw.integers(2, 7)))]
                actions += pieces(draw, "".join(f"{line}\r" for line in lines).encode("latin-1"))
                actions.append(pause(draw, False))
            case 15:
                actions.append(pause(draw, False))
            case 16:
                actions += [("write", pick(draw, (b"A", b"!", b"\n", b"\r")))]
            case _:
                actions += pieces(draw, imc_line(draw).encode("latin-1") + b"\r")
                actions.append(pause(draw, False))
    return actions


# ---- iSMIF ---------------------------------------------------------------------------------------------------------

ISMIF_FIELDS: dict[str, Callable[[Draw], Any]] = {
    "i": lambda draw: pick(draw, (0, 1, 2, 5, 50, 99)),
    "v": lambda draw: pick(draw, (65, 199, 200, 201, 400, 600, 901, 1500, 3000, 5000)),
    "s": lambda draw: int(draw.integers(-40, pick(draw, (1, 50, 400, 1500)))),
    "axis": lambda draw: pick(draw, "XYZ"),
    "bit": lambda draw: int(draw.integers(2)),
    "ms": lambda draw: pick(draw, (0, 1, 17, 250, 500, 1200)),
}

ISMIF_STORED = words("""
L{i},X{s} L{i},x{s} L{i},X{s},Y{s} L{i},x{s},y{s},z{s} L{i},X{s},Y{s},Z{s} L{i},z{s},X{s} L1,x{s},y{s} L1,y{s},X{s}
#E{i},{v} #E1,{v} #S{v} #R{ms} #O{axis},{ms} #D{axis},{bit},{i},{i},{i} A{bit} W{ms} W{ms} T{bit} Z2 Z1 F0
""")
ISMIF_REFERENCE = ("$HX", "$HY", "$HZXY", "$HZ")
ISMIF_MASTER = ("@V", "@X", "@LX", "@LY", "@LZ", "@B", "@S", "@A", "@C", "@C", "@R", "@A", "@B")


def ismif_line(draw: Draw, stored: Sequence[str]) -> str:
    """A command that is stored, legal in form nine times out of ten."""
    line = fill(draw, pick(draw, stored), ISMIF_FIELDS)
    return spoil(draw, line) if chance(draw, 0.06) else line


def ismif_actions(draw: Draw, length: int, full_steps: bool) -> list[Action]:
    """A session of an iSMIF.

    With full steps there is no reference run after the first F1, and time is cut at odd nanoseconds: where a switch or
    a stop falls between the two halves of a full step is not what such a session is to keep.
    """
    stored = ISMIF_STORED + ([] if full_steps else list(ISMIF_REFERENCE))
    things = [name for name in STATES if not (full_steps and name.startswith("limit"))]
    actions: list[Action] = []
    if full_steps or chance(draw, 0.8):
        actions += [("write", b"#E50,1500\r#DX,0,50,1,2\r$HZXY\x01"), ("run", 12.0, 12)]
    if full_steps:
        actions += [("write", b"F1\r#E1,700\rL1,x300,y-7\x01"), ("run", 0.7654321, 3)]
    for _ in range(length):
        match int(draw.integers(12)):
            case 0 | 1 | 2:
                actions += [("write", pick(draw, ISMIF_MASTER).encode() + b"\r"), pause(draw, full_steps)]
            case 3:
                actions += [operation(draw, things), pause(draw, full_steps)]
            case 4:
                again = [b"@R\r", b"@C\r"] if full_steps else [b"@R\r", b"@C\r", b"$HZXY\x01"]
                actions += [*calm(things), ("write", b"".join(again)), ("run", pick(draw, (0.5, 6.0)), 4)]
            case 5 if full_steps:
                actions += [("write", pick(draw, (b"F0\x01", b"F1\r", b"F1\x01"))), pause(draw, True)]
            case 5:
                actions.append(pause(draw, False))
            case _:
                lines = [ismif_line(draw, stored) for _ in range(int(draw.integers(1, 6)))]
                end = pick(draw, ("\x01", "\x01", "\x01", "\r"))
                actions += pieces(draw, ("\r".join(lines) + end).encode("latin-1"))
                actions.append(pause(draw, full_steps))
    return actions


# ---- external ------------------------------------------------------------------------------------------------------

EXTERNAL_FIELDS: dict[str, Callable[[Draw], Any]] = {
    "ns": lambda draw: int(pick(draw, (1000, 125_000, 1_000_000, 1_000_000, 4_000_000, 250_000_000))),
    "s": lambda draw: int(draw.integers(-20, pick(draw, (1, 20, 60, 400)))),
    "hz": lambda draw: pick(draw, (1, 200, 900, 3000, 9000)),
    "bit": lambda draw: int(draw.integers(2)),
}
EXTERNAL_ROWS = ("row {ns} {s} {s} {s}",) * 3 + ("row {ns} {s} 0 0 stages={bit} moving=1", "go {hz} {s} {s} {s}")
EXTERNAL_REST = (
    *("out stages={bit} brake=1", "out spindle={bit} hood_release={bit}", "out power_request=0", "out power_request=1"),
    *("set {s} {s} {s}", "form led", "form steps", "tell encoder index", "tell", "state", "names", "row 1 2", "hello"),
)


def external_actions(draw: Draw, length: int) -> list[Action]:
    """A session of another control: rows one by one and ahead, and everything else."""
    ready = b"out power_request=1 stages=1 brake=1\n"
    actions: list[Action] = [("write", ready), ("run", 0.01, 1)]
    for _ in range(length):
        match int(draw.integers(8)):
            case 0:
                actions += [operation(draw, list(STATES)), pause(draw, False)]
            case 1:
                actions += [*calm(list(STATES)), ("write", b"out power_request=0\n\n" + ready), ("run", 0.01, 1)]
            case 2 | 3:
                line = fill(draw, pick(draw, EXTERNAL_REST), EXTERNAL_FIELDS)
                line = spoil(draw, line) if chance(draw, 0.1) else line
                actions += [*pieces(draw, line.encode("latin-1") + b"\n"), pause(draw, False)]
            case _:
                rows = [
                    fill(draw, pick(draw, EXTERNAL_ROWS), EXTERNAL_FIELDS) for _ in range(int(draw.integers(1, 90)))
                ]
                actions += [*pieces(draw, "".join(f"{row}\n" for row in rows).encode()), pause(draw, False)]
    return actions


# ---- sessions ------------------------------------------------------------------------------------------------------


def random_session(controller: str, plant: str, number: int) -> Session:
    """Session `number` of a controller; the number is the seed."""
    if controller in SERVO:
        return _servo_session(controller, plant, number)
    ismif = controller == "ismif"
    physics = plant == "mujoco"
    draw = np.random.default_rng([number, sum(controller.encode()), physics])
    full_steps = ismif and number % 8 == 5
    options: dict[str, Any] = {"controller": controller, "plant": plant, "seed": number}
    if chance(draw, 0.3):
        options["line_speed"] = True
    if physics or chance(draw, 0.7):
        options["start_mm"] = tuple(round(float(x), 3) for x in draw.uniform(1.0, 12.0, 3))
    if chance(draw, 0.15):
        options["machine"] = pick(draw, ("4030-portal", "traverse"))
    overrides = pick(draw, OVERRIDES)
    if overrides:
        options["overrides"] = overrides
    scenario = None
    if chance(draw, 0.15) and not full_steps:
        scenario = NOISE if chance(draw, 0.3) and not ismif else pick(draw, SCENARIOS)
    length = int(draw.integers(8, 16) if physics else draw.integers(12, 36))
    actions = ismif_actions(draw, length, full_steps) if ismif else imc_actions(draw, length, physics)
    if ismif and not full_steps:
        actions = [_without_full_steps(action) for action in actions]
    return Session(options, tuple(actions), scenario)


SERVO = {"gmi99": gmi99_actions, "bwo900": bwo900_actions, "external": external_actions}
"""Controllers of servo axes, or of any."""


def _servo_session(controller: str, plant: str, number: int) -> Session:
    draw = np.random.default_rng([number, sum(controller.encode()), plant == "mujoco"])
    machine = pick(draw, ("4030", "4030-servo")) if controller == "external" else "4030-servo"
    options: dict[str, Any] = {"controller": controller, "machine": machine, "plant": plant, "seed": number}
    if chance(draw, 0.3):
        options["line_speed"] = True
    options["start_mm"] = tuple(round(float(x), 3) for x in draw.uniform(1.0, 12.0, 3))
    scenario = pick(draw, SCENARIOS[:3]) if chance(draw, 0.15) else None
    length = int(draw.integers(6, 10) if plant == "mujoco" else draw.integers(8, 20))
    return Session(options, tuple(SERVO[controller](draw, length)), scenario)


def _without_full_steps(action: Action) -> Action:
    """The same action, saying F0 where chance has put an F1 together."""
    return ("write", action[1].replace(b"F1", b"F0")) if action[0] == "write" else action
