"""Looks at the drives in an exact stop are left out until they have arrived: to the bit as if each had been made."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.firmware.bwo900.realtime.channel import Channel, State

BLOCKS = ("G00 X12 Y11 Z12", "X14", "Y12 G04.0,05", "G01 F3000 X13 G09", "G00 X12", "M30")
BOTH = pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
Happens = Callable[[Twin], Twin]


@contextmanager
def each_look_made() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Twin, "_awaited", lambda *_: None)
        yield


@contextmanager
def counted() -> Iterator[list[int]]:
    """Times of the looks that are made."""
    looks: list[int] = []
    look = Channel._look_settled

    def counting(channel: Channel) -> None:
        looks.append(channel._axes.now_ns)
        look(channel)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Channel, "_look_settled", counting)
        yield looks


def ready(plant: str, blocks: Sequence[str]) -> Twin:
    """Referenced, and a program of these blocks begun."""
    program = "P1\n" + "".join(f"N{10 * n + 10} {block}\n" for n, block in enumerate(blocks)) + "#\n"
    twin = Twin(controller="bwo900", machine="4030-servo", plant=plant, start_mm=(2.0, 2.0, 2.0))
    *steps, last = [b"".join(data) for _, data in twin.language.job(program)]
    for data in steps:
        twin.write(data)
        twin.run_until_idle()
    twin.write(last)
    return twin


def settles(twin: Twin) -> bool:
    return twin._controller._channel.state is State.SETTLE


def told(twin: Twin, happens: Happens) -> dict[str, Any]:
    """What a run of the program comes to, to the bit. happens: in its first exact stop."""
    said: list[str] = []
    heard: list[tuple[int, bytes]] = []
    began_ns = twin.time_ns
    twin.listen(lambda time_ns, kind, what: said.append(f"{time_ns} {kind} {what!r}") if kind != "motion" else None)
    while not settles(twin):
        twin.run(0.001)
    twin.run(0.0031234)
    assert settles(twin)
    twin = happens(twin)
    twin.run(2.0)
    heard.append((twin.time_ns, twin.read()))
    ticks = twin.steps
    made = ticks.t_ns > began_ns
    return {
        "said": tuple(said),
        "heard": heard,
        "ticks": (ticks.t_ns[made].tobytes(), ticks.delta[made].tobytes()),
        "places": (twin.position_mm.tobytes(), twin.counts.tobytes()),
        "idle": (twin.idle, twin.fault, dict(twin.outputs)),
    }


def nothing(twin: Twin) -> Twin:
    return twin


def looked_at(twin: Twin) -> Twin:
    """In odd pieces, with questions that need the controller."""
    for ns in (1, 777_777, 2_000_000, 1_999_999, 3, 40_000_001, 123_456):
        twin.run_until(twin.time_ns + ns)
        due_ns = twin.next_event_ns
        assert due_ns is not None
        assert due_ns > twin.time_ns
        assert len(twin.counts) == 3
    return twin


def stopped(twin: Twin) -> Twin:
    twin.set_input("stop", "down")
    twin.run(0.3)
    return twin


def impatient(twin: Twin) -> Twin:
    """P12018: no axis may take longer than 7.5 ms; it has taken some already."""
    limits = "".join(f"K1:P{12018 + 200 * axis}: 7,5\r\n" for axis in range(3))
    twin.write(f"\r\nD\r\n{limits}#\r\n\x04\r\n".encode())
    return twin


def cut_off(twin: Twin) -> Twin:
    twin.set_input("estop", "pressed")
    twin.run(0.1)
    twin.set_input("estop", "released")
    return twin


def asked(twin: Twin) -> Twin:
    twin.write(b"\r\nD\r\nK1:P8684: 1\r\n#\r\n\x04\r\n")
    return twin


def saved(twin: Twin) -> Twin:
    """Saved within the wait, led astray, and restored."""
    state = twin.save()
    twin.run(0.02)
    twin.set_input("estop", "pressed")
    twin.run(0.02)
    twin.restore(state)
    return twin


@BOTH
@pytest.mark.parametrize("happens", [nothing, looked_at, impatient, stopped, cut_off, asked, saved])
def test_the_program_comes_to_the_same(plant: str, happens: Happens, started: dict[str, Any]) -> None:
    twin = started[plant]
    twin.restore(started[f"{plant} begun"])
    with counted() as few:
        left_out = told(twin, happens)
    twin.restore(started[f"{plant} begun"])
    with each_look_made(), counted() as all_looks:
        made = told(twin, happens)
    assert left_out == made
    assert 0 < len(few) <= len(all_looks)
    assert happens is not nothing or 4 * len(few) < len(all_looks)


@pytest.fixture(scope="module")
def started() -> dict[str, Any]:
    twins = {plant: ready(plant, BLOCKS) for plant in ("kinematic", "mujoco")}
    return {**twins, **{f"{plant} begun": twin.save() for plant, twin in twins.items()}}
