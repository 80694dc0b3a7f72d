"""iMC, as a whole: whatever a host and an operator do, the firmware answers from the manual's set and steps add up.

The desk checks after every call that the counters are the sum of the stream and of the counter settings, and counts
steps made while the stages are off or the safety relay is open.
"""

from __future__ import annotations

import re
from typing import Any

import pytest
from conformance.imc_desk import MIDDLE, fresh
from conformance.rows import shows
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.testing import Desk
from tests.thorough import drawn

numbers = st.one_of(
    st.integers(-300, 300),
    st.sampled_from([0, 1, 7, 8, 29, 30, 900, 2000, 40_000, 40_001, 65_535, 8_388_607, 8_388_608, -8_388_609, 2**31]),
)
speeds = st.sampled_from([900, 2000, 8000, 40_000] * 5 + [10])
steps = st.integers(-400, 400)


@st.composite
def moves(draw: st.DrawFn) -> str:
    """A move with mostly the right number of values, short enough to be tried often."""
    pairs = draw(st.sampled_from([4] * 8 + [1, 2, 5]))
    values = ",".join(f"{draw(steps)},{draw(speeds)}" for _ in range(pairs))
    return draw(st.sampled_from(["@0A", "@0A", "@0M", "0", "m"])) + values


def any_numbers(prefix: str, *counts: int) -> st.SearchStrategy[str]:
    """A command with one of these numbers of values, in or out of range."""
    lists = st.sampled_from(counts).flatmap(lambda n: st.lists(numbers, min_size=n, max_size=n))
    return lists.map(lambda values: prefix + ",".join(map(str, values)))


SIMPLE = "@07 @07 @08 @01 @03 @0R7 @0N7 @0N8 @0S @0s @0i 9 9 @0k @0z1 @0z0 @0T1 @0T0 @0IX @0IW @0IL 77 T0 z1 f-1 @0f0"
FEW = "@0B @0n @0N @0R @0F @0j @0J @0e @0g @0T @0IE @0Ie @0ID @0IR @0IT @0IO 3 5 7 j n"
SEVERAL = "@0d @0IF @0Id @0IA @0IH @0IN @0Ia o p 6 d"
MANY = "@0y @0w y w @0Z"
PROGRAM = "@0k|@0i|N7|020,900,7,900,5,900,-5,900|3 3,-1|60,128,5|0300,900,0,900,0,900,0,900|5 1|9|@0S"


def any_of(prefixes: str, *counts: int) -> st.SearchStrategy[str]:
    """One of these commands with one of these numbers of values."""
    return st.sampled_from(prefixes.split(" ")).flatmap(lambda prefix: any_numbers(prefix, *counts))


KINDS = {
    "simple": st.sampled_from(SIMPLE.split(" ")),
    "ready": st.just("@07\r@0N7"),
    "move": moves(),
    "arc": st.sampled_from(["@0y400,9000,119,-141,141,-1,-1", "@0w400,9000,119,-141,141,-1,-1,77"]),
    "program": st.just(PROGRAM.replace("|", "\r")),
    "few": any_of(FEW, 1, 2),
    "several": any_of(SEVERAL, 3, 4),
    "many": any_of(MANY, 7, 8),
}
WEIGHTS = ["move"] * 6 + ["ready"] * 4 + ["simple"] * 3 + ["few"] * 3 + ["program", "program", "arc", "several", "many"]
commands = st.sampled_from(WEIGHTS).flatmap(KINDS.__getitem__)
elements = st.one_of(
    st.tuples(st.just("hood"), st.sampled_from(["open", "closed", "forced"])),
    st.tuples(st.just("estop"), st.sampled_from(["pressed", "released", "released"])),
    st.tuples(st.just("key"), st.sampled_from(["automatic", "setup"])),
    st.tuples(st.just("power"), st.sampled_from(["off", "on", "on"])),
    st.tuples(st.just("overtemperature"), st.sampled_from(["hot", "normal", "normal"])),
    st.tuples(st.sampled_from(["start", "stop", "probe", "user_0", "user_1", "user_2"]), st.booleans()),
    st.tuples(st.sampled_from(["limit_x1", "limit_y2", "limit_z1"]), st.sampled_from(["open", "free", "free"])),
)
ACTIONS = {
    "command": commands,
    "byte": st.sampled_from([b"\xfd", b"\xfd", b"\xff", b"\xfe", b"\r", b"\n"]),
    "operate": elements,
    "run": st.sampled_from([0.001, 0.02, 0.1, 0.3, 3.0]),
    "power_cycle": st.none(),
}
actions = st.sampled_from(["command"] * 10 + ["run"] * 4 + ["byte"] * 3 + ["operate"] * 3 + ["power_cycle"]).flatmap(
    lambda kind: st.tuples(st.just(kind), ACTIONS[kind])
)


def act(desk: Desk, action: str, value: Any) -> None:
    """Do one thing to the desk."""
    match action:
        case "command":
            desk.start(value)
        case "byte":
            desk.send(value)
        case "operate":
            desk.set(*value)
        case "run":
            desk.run(value)
        case "power_cycle":
            desk.power_cycle(0.5)


@shows("imc-5-1", "imc-5-22", "imc-5-23", "imc-5-24", "imc-5-26")
@settings(max_examples=drawn(100), deadline=None)
@given(script=st.lists(actions, min_size=5, max_size=40))
def test_replies_are_the_manuals_and_no_step_without_power(script: list[tuple[str, Any]]) -> None:
    desk = fresh(carriage=MIDDLE)
    for text in ("@07", "@0N7"):
        assert desk.query(text) == "0"
    for action, value in script:
        act(desk, action, value)
    desk.run(5.0)
    replies = b"".join(data for _, data in desk.replies).decode("latin-1")
    assert re.fullmatch("[0-9DFGHR]*", replies)
    assert desk.steps_without_stages == 0
    assert (desk.steps.t_ns[1:] > desk.steps.t_ns[:-1]).all()


letters = st.text("@0123456789,-+. \r\nAMRiNz", max_size=40).map(str.encode)


@settings(max_examples=drawn(120), deadline=None)
@given(
    chunks=st.lists(st.one_of(st.binary(max_size=30), st.text("@0123456789,-+. \r\nAMRiNz", max_size=40)), max_size=12)
)
def test_any_bytes_are_answered_in_text(chunks: list[bytes | str]) -> None:
    desk = fresh(carriage=MIDDLE)
    for chunk in chunks:
        desk.send(chunk.encode() if isinstance(chunk, str) else chunk)
        desk.run(0.01)
    desk.run(1.0)
    replies = b"".join(data for _, data in desk.replies)
    assert all(32 <= value < 127 or value in b"\r\n" for value in replies)
    assert desk.steps_without_stages == 0


@shows("imc-5-11")
@pytest.mark.parametrize("length", [5000, 100_000])
def test_an_endless_line_is_a_syntax_error_and_the_next_one_is_understood(length: int) -> None:
    desk = fresh(carriage=MIDDLE)
    assert desk.query("@07") == "0"
    assert desk.query("@0j" + "1" * length) == "5"
    assert desk.query("@0P") == "0" + "0" * 18


@shows("imc-2.1-3", "imc-5-11")
@pytest.mark.parametrize("count", [10, 100, 5000])
def test_every_line_of_a_flood_during_a_move_is_answered(count: int) -> None:
    """The input buffer is finite: what does not fit is answered with a syntax error, and nothing is lost silently."""
    desk = fresh(carriage=MIDDLE)
    for text in ("@07", "@0N7"):
        assert desk.query(text) == "0"
    desk.start("@0A900,900,0,900,0,900,0,900")
    desk.run(0.1)
    desk.send(b"@0g1\r" * count)
    reply = desk.finish()
    assert len(reply) == 1 + count
    assert set(reply) <= {"0", "5"}
    assert reply.startswith("0" * min(count, 10))
    assert desk.query("@0P") == "0" + "000384" + "0" * 12
