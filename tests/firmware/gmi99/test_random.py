"""Random sessions: moves, circles, programs, holds, aborts, E-stops and a PLC that interferes.

The desk watches counters and times in every one of them; in the end the card can be made ready again.
"""

from __future__ import annotations

import random

import pytest
from conformance.gmi99_desk import PRE, READY, STATUS, CardDesk, Q, assembled, command, short, switches

MEDDLER = """OB 1
U E 1.0
= M 0.0       ; stop
U E 1.1
S M 0.1       ; break off
U E 1.2
= M 1.3       ; hold barriers
U M 6.0
R M 6.0       ; acknowledge M50
U E 1.3
S M 0.2       ; start program MB2
UN M 30.0
= M 30.0
= A 0.5
BE
"""


def programs(random_: random.Random) -> list[str]:
    """Telegrams that record two programs, the first of which may call the second."""
    telegrams = []
    for number in range(2):
        telegrams.append(command("p", 3, 100, number))
        for _ in range(random_.randrange(6)):
            x, y = (random_.randrange(-9000, 9000) for _ in range(2))
            call = command("p", 3, 1, 1) if number == 0 else command("p", 3, 2)
            others = (command("p", 10, 16, 3), command("p", 10, 14, 1), command("m", 50), call, command("H", 2))
            telegrams.append(random_.choice((command(0x83, x, y), command("f", random_.randrange(1, 60_000)), *others)))
        telegrams.append(command("p", 3, 101))
    return telegrams


def telegram(random_: random.Random) -> str:
    """Anything that moves, holds or ends."""
    mask = random_.choice((1, 2, 3, 7))
    ways = [random_.choice((0, 5, -9, random_.randrange(-30_000, 30_000))) for _ in range(mask.bit_count())]
    kinds = {
        command(0x80 | mask, *ways): 45,
        command("G", random_.choice((0, 2, 3, 36, 53, 54, 90, 91, 94))): 12,
        short(9, random_.randrange(126)): 8,
        command("p", 11, 0, random_.choice((0, 1, 2, 4))): 8,
        command("p", 3, 1, random_.randrange(2)): 5,
        command("N", random_.randrange(2000), random_.choice((11, 16))): 5,
        command("N", random_.randrange(2), random_.choice((14, 17, 24))): 4,
        short(0): 3,
        command("Q", 7, random_.randrange(2)): 4,
        command("f", random_.randrange(1, 100_000)): 4,
        command("M", random_.choice((5, 2000, 50_000, 1_000_000))): 2,
    }
    return random_.choices(list(kinds), list(kinds.values()))[0]


@pytest.mark.parametrize("seed", range(3))
def test_a_random_session_ends_well(seed: int) -> None:
    random_ = random.Random(seed)
    desk = CardDesk.of(
        "gmi99",
        settings={"safety_program": seed % 2 == 1},
        carriage=(100_000, 100_000, 50_000),
        position_switches=switches(),
    )
    assert isinstance(desk, CardDesk)
    meddling = (command("p", 1, 100), *assembled(MEDDLER), command("p", 1, 101), command("p", 1, 1))
    desk.tell(*PRE, *(meddling if seed % 4 == 0 else ()), *programs(random_))
    for _ in range(150):
        desk.tell(telegram(random_))
        if random_.random() < 0.15:
            desk.set(f"user_{random_.randrange(4)}", random_.choice(("low", "high")))
        if random_.random() < 0.05:
            desk.press("estop", 0.01)
        if random_.random() < 0.7:
            desk.run(random_.choice((0.0007, 0.004, 0.05, 0.3, 2.0)))
    for user in range(4):
        desk.set(f"user_{user}", "low")
    desk.tell(command("p", 1, 2), short(0), command("p", 11, 0, 0), command("p", 11, 1, 0), short(9, 100))
    desk.finish()
    desk.run(0.1)
    desk.tell(short(0), command("p", 11, 0, 0), Q)
    desk.finish()
    assert desk.ask(STATUS) == READY
