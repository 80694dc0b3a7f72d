"""Sessions that stand in the documents, the demonstration and the tests, as scripts; played on both plants.

    > @07                  the host sends the line with CR and waits for the whole answer, at most 120 s
    >> @0S                 the host sends the line with CR and does not wait
    bytes fd               the host sends these bytes, in hexadecimal
    run 0.5                time passes
    set hood open          something is operated
    sample 0.001           from now on samples are taken every 1 ms

The first word of a session's name says which controller it is for. "\\x01" at the end of a line is the byte 01h; no CR
follows it then, nor "\\n", the end of a line of `external`.
"""

from __future__ import annotations

from typing import Any

from golden import machine_sessions
from golden.session import Action, Session

LIMIT_S = 120.0

HOMED = "> @07\n> @0R7\n"
ISMIF_HOMED = "> $HZXY\\x01\n"

DEMO = """
> @07
> @0M16000,10000,8000,10000,0,10000,0,30
> @0d5000,5000,5000
> @0R7
> @0P
> @0M16000,10000,8000,10000,0,10000,0,30
> @0P
> @0z1
> @0M48000,10000,24000,10000,9600,10000,0,30
> @0M0,10000,0,10000,0,10000,0,30
"""
OVERLOAD = """
> @0J4000
> @0M48000,20000,24000,20000,9600,20000,0,30
> @0P
run 1.0
"""
LONG_MOVE = HOMED + ">> @0A32000,10000,0,30,0,30,0,30\nrun 1.0\n"
JOB = """
> @07
> @0R7
>> @0A 16000,5000,0,30,0,30,0,30
run 0.5
bytes fd
run 0.5
> @0S
"""
PROGRAM = """
> @07
> @0R7
> @0k
> @0i
> N7
> J50
> 03200,5000,1600,5000,0,900,0,900
> 3 2,-1
> f-1
> y400,1500,119,-141,141,-1,-1
> 133
> 5 3
> p0,0,1
> m0,9000,0,9000,0,900,0,900
> 9
> @0S
> @0P
"""
LOOPS = "".join(
    f"> {line}\n"
    for line in (
        "@07",
        "@0N7",
        "@0k",
        "@0i",
        "02,900,1,900,0,900,0,900",
        *(f"3 2,-{n}" for n in range(1, 8)),
        "9",
        "@0S",
    )
)
CHATTER = HOMED + "".join(
    f"""
> @0A6400,9000,0,30,0,30,0,30
set limit_x1 broken
run 0.1
set limit_x1 ok
> @07
> @0N7
>> @0A640,900,0,30,0,30,0,30
run {wait_s}
set limit_x1 broken
run 0.0001
set limit_x1 ok
run 2.0
"""
    for wait_s in (0.001, 0.0049, 0.005, 0.005000001, 0.0051, 0.0061)
)
WATCHED = """
> @07
> @0N7
> @0IA0,1,0
> @0IH0,2,0
> @0IN0,4,0
> @0k
> @0i
> 016000,4000,0,900,0,900,0,900
> 0-16000,4000,0,900,0,900,0,900
> 3 0,-2
> 9
>> @0S
run 1.2345678
set user_0 high
run 1.0
set user_0 low
>> @0S
run 3.0004
set user_1 high
run 1.0
set user_1 low
>> @0S
run 2.0
set start down
run 0.1
set start up
run 0.7
set user_2 high
run 1.0
set user_2 low
> @07
> @0N7
>> @0S
run 1.0
"""
ARCS = """
> @07
> @0R7
> @0A12000,10000,12000,10000,6000,5000,0,30
> @0f-1
> @0y400,1500,119,-141,141,-1,-1
> @0y 2400,400,-200,0,-400,-1,1
> @0f0
> @0w32000,600,-1000,-2000,0,1,-1,6000
> @0e1
> @0w400,1500,119,-141,141,-1,-1,77
> @0e2
> @0y200,1500,-50,100,0,-1,1
> @0P
"""
TUNING = """
> @07
> @0R7
> @0z1
> @0j300
> @0J100
> @0M19200,10000,0,10000,0,10000,0,30
run 0.2
> @0J1600
> @0M20800,25000,12800,25000,0,25000,0,30
run 0.2
> @0j1500
> @0J3000
> @0M0,32000,0,32000,1600,32000,0,30
run 0.2
> @0J400
> @0M0,20000,0,20000,0,20000,0,30
"""
SQUARE = HOMED + "".join(
    f"> @0M{320 * x},4000,{320 * y},4000,0,30,0,30\nrun 0.5\n"
    for x, y in ((10, 10), (40, 10), (40, 40), (10, 40), (10, 10))
)
ISMIF_SQUARE = (
    ISMIF_HOMED
    + "> #E5,1000\\x01\n"
    + "".join(
        f"> L5,X{80 * x},Y{80 * y},Z0\\x01\nrun 0.5\n" for x, y in ((10, 10), (40, 10), (40, 40), (10, 40), (10, 10))
    )
)


def _ismif_stop(*masters: str) -> str:
    stops = "".join(f">> {master}\nrun 1.0\n" for master in masters)
    return f"{ISMIF_HOMED}> #E1,3000\\x01\n>> L1,X8000\\x01\nrun 1.2\n{stops}> @X\n> @LX\n"


SCRIPTS: dict[str, tuple[Any, ...]] = {
    **machine_sessions.SCRIPTS,
    "imc-s8 readme": ({}, HOMED + "> @0M16000,10000,8000,10000,0,10000,0,30\n"),
    "imc-s8 hosts pipelined": ({}, "bytes 4030370d403052370d4030500d\nrun 30.0\n"),
    "imc-s8 hosts job": ({}, JOB),
    "imc-m hosts job": ({}, JOB),
    "imc-mp hosts job": ({}, JOB),
    "c142 hosts job": ({}, JOB),
    "imc-s8 demo": ({"line_speed": True}, DEMO + OVERLOAD),
    "imc-s8 demo 4030-portal": ({"machine": "4030-portal"}, DEMO + OVERLOAD),
    "imc-s8 demo traverse": ({"machine": "traverse"}, DEMO + OVERLOAD),
    "c142 demo": ({}, DEMO + OVERLOAD),
    "imc-s8 tuning": ({}, TUNING),
    "imc-s8 tuning heavy": ({"overrides": {"payload.mass": 8.0}}, TUNING),
    "imc-s8 tuning ideal": ({"overrides": {"imperfections": "ideal"}}, TUNING),
    "imc-s8 arcs": ({}, ARCS),
    "imc-s8 program": ({}, PROGRAM),
    "c142 program": ({}, PROGRAM),
    "imc-s8 loops": ({}, LOOPS),
    "imc-s8 chatter": ({}, CHATTER),
    "imc-s8 watched program": ({}, WATCHED),
    "imc-s8 square": ({}, SQUARE),
    "imc-s8 square seed 7": ({"seed": 7}, SQUARE),
    "imc-s8 zero repeats": ({}, HOMED + 3 * "> @0A3200,5000,3200,5000,3200,5000,0,30\n> @0R7\nrun 0.5\n"),
    "imc-s8 stop and start": ({}, LONG_MOVE + "bytes fd\nrun 1.0\n> @0P\n> @0S\n"),
    "imc-s8 break": ({}, LONG_MOVE + "bytes ff\nrun 1.0\n> @0S\n"),
    "imc-s8 reset": (
        {},
        LONG_MOVE + "bytes fe\nrun 1.0\n> @0A100,1000,0,30,0,30,0,30\n> @07\n> @0A100,1000,0,30,0,30,0,30\n> @0R7\n",
    ),
    "imc-s8 past the far switch": (
        {},
        HOMED + "> @0A129600,10000,0,30,0,30,0,30\n> @0A-100,1000,0,30,0,30,0,30\n> @07\n> @0R7\n",
    ),
    "imc-s8 overload": ({}, HOMED + "> @0A64000,40000,0,30,0,30,0,30\nrun 1.0\n> @0R7\nrun 1.0\n"),
    "imc-s8 emergency stop": (
        {},
        LONG_MOVE
        + "set estop pressed\nrun 1.0\n> @0A100,1000,0,30,0,30,0,30\nset estop released\n> @07\n> @0R7\n"
        + "> @0A100,1000,0,30,0,30,0,30\n",
    ),
    "imc-s8 hood": (
        {},
        HOMED
        + "set hood open\n> @0A100,1000,0,30,0,30,0,30\nset hood closed\n>> @0A9000,3000,0,30,0,30,0,30\n"
        + "run 0.3\nset hood forced\nrun 1.0\nset hood closed\n> @07\n> @0R7\n",
    ),
    "imc-s8 broken wire": ({}, LONG_MOVE + "set limit_x2 broken\nrun 0.1\nset limit_x2 ok\n> @07\n> @0R7\n"),
    "imc-s8 endless move": ({}, HOMED + ">> @0A8000000,30,0,30,0,30,0,30\nrun 2.0\n>> @0P\nrun 1.0\n"),
    "ismif square": ({}, ISMIF_SQUARE),
    "ismif square seed 7": ({"seed": 7}, ISMIF_SQUARE),
    "ismif square slow line": ({"line_speed": True}, ISMIF_SQUARE),
    "ismif documented job": ({}, ISMIF_HOMED + "> #E1,1200\n> L1,X4000,Y4000\n> W250\n> L1,X0,Y0\\x01\n> @X\n"),
    **{f"ismif stop {stop}": ({"seed": 3}, _ismif_stop(stop)) for stop in ("@S", "@R", "@B", "@A")},
    "ismif pause": ({"seed": 3}, _ismif_stop("@A", "@C", "@A", "@B", "@C")),
    "ismif without a ramp": ({"seed": 3}, ISMIF_HOMED + "> #S5000\n> #E1,5000\n> L1,X4000\\x01\nrun 0.5\n> @LX\n"),
    "ismif far end": (
        {"seed": 2, "start_mm": (50.0, 290.0, 30.0)},
        "> #DY,1,1,2,3\n> $HY\\x01\nrun 0.5\n> @X\n",
    ),
    "ismif full steps": (
        {"seed": 1},
        ISMIF_HOMED + "> F1\n> #E1,300\n> L1,X800,Y-0\\x01\nrun 0.5\n> @LX\n> F0\n> L1,X100,Y55\\x01\n",
    ),
    "ismif emergency stop": (
        {"seed": 3},
        ISMIF_HOMED + "> #E1,600\\x01\n>> L1,X4000\\x01\nrun 1.2\nset estop pressed\nrun 3.0\n",
    ),
    "ismif hood": (
        {"start_mm": (30.0, 30.0, 30.0)},
        "run 0.6\n>> L1,X2000\\x01\nrun 0.1\nset hood open\nrun 2.0\n",
    ),
}
"""Name -> keyword arguments of the twin beside controller and plant, script, and a scenario if there is one."""


def script(text: str) -> tuple[Action, ...]:
    """Actions of a script."""
    return tuple(_action(line) for line in text.splitlines() if line)


def _action(line: str) -> Action:
    match line.split(" ", 1):
        case [">", rest]:
            return ("ask", _with_end(rest), LIMIT_S)
        case [">>", rest]:
            return ("write", _with_end(rest))
        case ["bytes", rest]:
            return ("write", bytes.fromhex(rest))
        case ["run", rest]:
            return ("run", float(rest), 1)
        case ["set", rest]:
            return ("set", *rest.split(" "))
        case ["sample", rest]:
            return ("sample", float(rest))
    raise ValueError(f"no action of a script: {line!r}")


def _with_end(text: str) -> bytes:
    data = text.replace("\\x01", "\x01").replace("\\n", "\n").encode("latin-1")
    return data if data.endswith((b"\x01", b"\n")) else data + b"\r"


def fixed_session(name: str, plant: str) -> Session:
    """The session of that name on a plant."""
    options, text, *scenario = SCRIPTS[name]
    return Session({"controller": name.split(" ")[0], "plant": plant, **options}, script(text), *scenario)
