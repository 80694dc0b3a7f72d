"""On a timed line a command is one event: bytes that the controller only keeps are handed over with what comes next.

To the bit as if each had been handed over when it arrived, which is what a twin does whose controller says nothing.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.base.parameters import Place
from isel_twin.firmware.imc.controller import Imc
from isel_twin.wiring import ScenarioError, event_now

PLACE = Place("test", ScenarioError)
BYTE_S = 10 / 19_200
MOVE = b"@0A300,900,-100,900,0,900,0,900\r"
LISTENS = b"@0k\r@0i\r5 1\r1 65\r2 66,1\r2 66,1\r9\r@0S\r"
"""A program that after a tenth of a second says A and waits for two bytes."""
PARTS = (
    MOVE,
    LISTENS,
    b"@0P\r",
    b"\xfd",
    b"\xff",
    b"@0S\r",
    b"\xfe@07\r",
    b"@07\r@0N7\r",
    b"B",
    b"x\nB",
    b"9" * 300 + b"\r",
)


@contextmanager
def each_byte_handed_over() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Imc, "acting_bytes", None)
        yield


@contextmanager
def calls() -> Iterator[list[bytes]]:
    """What the controller is handed, call by call."""
    made: list[bytes] = []
    receive = Imc.receive

    def noting(controller: Imc, t_ns: int, data: bytes) -> None:
        made.append(data)
        receive(controller, t_ns, data)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Imc, "receive", noting)
        yield made


def ready() -> Twin:
    twin = Twin(plant="kinematic", line_speed=True, start_mm=(10.0, 10.0, 10.0))
    assert twin.query("@07") == "0"
    assert twin.query("@0N7") == "0"
    return twin


def meddle(twin: Twin, chance: random.Random) -> Twin:
    """Something that comes between bytes."""
    match chance.randrange(8):
        case 0:
            twin.set_input("hood", chance.choice(("open", "closed")))
        case 1:
            twin.set_input("user_1", chance.choice(("high", "low")))
        case 2:
            twin.set_input("stop", chance.choice(("down", "up")))
        case 3:
            twin.carry_out(event_now({"line_cut": chance.random() < 0.4}, PLACE, twin.settable))
        case 4:
            state = twin.save()
            twin.run(0.004)
            twin.restore(state)
        case 5:
            assert len(twin.counts) == 4
    return twin


def told(seed: int) -> list[Any]:
    """A session of random bytes, in which something comes between them: all that is seen of it, piece by piece."""
    chance = random.Random(seed)
    twin, seen = ready(), []
    for _ in range(30):
        twin.write(b"".join(chance.choices(PARTS, k=chance.randint(1, 3))))
        for _ in range(chance.randint(1, 12)):
            twin.run(chance.choice((BYTE_S, 0.3 * BYTE_S, 0.01, 0.0333, 0.11)))
            seen.append((twin.time_ns, twin.read(), twin.commands_due, twin.replies_due, twin.idle))
            twin = meddle(twin, chance)
    steps = twin.steps
    return [*seen, steps.t_ns.tobytes(), steps.delta.tobytes(), twin.counts.tolist(), dict(twin.outputs)]


@pytest.mark.parametrize("seed", range(4))
def test_sessions_on_a_timed_line_come_to_the_same(seed: int) -> None:
    with calls() as few:
        runs = told(seed)
    with each_byte_handed_over(), calls() as many:
        bytewise = told(seed)
    assert runs == bytewise
    assert 2 * len(few) < len(many)


def test_a_command_is_handed_over_in_two_pieces_at_the_time_of_its_end() -> None:
    twin = ready()
    began_ns = twin.time_ns
    with calls() as made:
        twin.write(b"@0P\r@0b0\r")
        assert twin.run_until_idle()
    assert made == [b"@0P", b"\r", b"@0b0", b"\r"]
    answer_bytes = 19 + 3
    assert twin.time_ns - began_ns == pytest.approx(1e9 * BYTE_S * (4 + max(5 + 3, answer_bytes)), abs=10)


def test_a_program_that_begins_to_listen_hears_only_what_comes_later() -> None:
    """Of a row of B that is on its way then, the next two go to it, the rest is a line."""
    twin = ready()
    twin.write(LISTENS)
    state, began_ns = twin.save(), twin.time_ns
    said = b""
    while b"A" not in said:
        twin.run(BYTE_S)
        said += twin.read()
    listens_ns = twin.time_ns
    twin.restore(state)
    twin.run_until(listens_ns - 10_000_000)
    assert twin.time_ns > began_ns
    twin.read()
    with calls() as made:
        twin.write(b"B" * 60 + b"\r")
        twin.run(1.0)
    assert len(made[0]) == pytest.approx(0.01 / BYTE_S, abs=2.5)
    assert made[1:3] == [b"B", b"B"]
    assert len(made) <= 6
    assert b"".join(made) == b"B" * 60 + b"\r"
    assert twin.read()[-2:] == b"05"


def test_the_last_byte_of_an_unfinished_line_is_handed_over_when_it_arrives() -> None:
    twin = ready()
    with calls() as made:
        twin.write(b"@0P")
        assert not twin.idle
        assert twin.run_until_idle()
    assert b"".join(made) == b"@0P"
    assert twin.commands_due == 0


def test_long_rows_without_an_end_are_handed_over_in_pieces() -> None:
    twin = ready()
    with calls() as made:
        twin.write(b"x" * 1000)
        twin.run(1.0)
    assert [len(data) for data in made if len(data) > 1] == [127] * 7 + [103]
