"""Cycles of the PLC in virtual time."""

from __future__ import annotations

import random

from isel_twin.firmware.plc import Plc, PlcMemory, Rights
from isel_twin.firmware.plc.assembler import assemble

MS = 1_000_000
GRID = 4 * MS


def plc_of(text: str, rights: Rights | None = None) -> Plc:
    plc = Plc(rights or Rights(), {}, GRID)
    plc.load(assemble(text).image)
    return plc


def pass_by_pass(plc: Plc, memory: PlcMemory, until_ns: int) -> int:
    """Make passes up to a time; how many."""
    made = 0
    while (t := plc.next_ns) is not None and t <= until_ns:
        plc.end_pass(t, memory)
        plc.begin_pass(t, memory)
        made += 1
    return made


def test_a_thousand_instructions_take_45_ms() -> None:
    plc, memory = plc_of("OB 1\n" + "NOP0\n" * 999 + "BE\n"), PlcMemory()
    plc.start(0, memory)
    assert plc.next_ns is None  # nothing ever changes
    plc.touch(0)
    assert plc.next_ns == 48 * MS  # 45 ms on the grid of 4 ms
    plc.end_pass(48 * MS, memory)
    plc.begin_pass(48 * MS, memory)
    plc.touch(50 * MS)
    assert plc.next_ns == 96 * MS


def test_effects_come_at_the_end_of_a_pass() -> None:
    plc, memory = plc_of("OB 1\nU E 0.0\n= A 0.0\nBE\n"), PlcMemory()
    memory.e[0] = 1
    plc.start(0, memory)
    assert (plc.next_ns, memory.a[0]) == (4 * MS, 0)
    assert plc.end_pass(4 * MS, memory)
    assert memory.a[0] == 1


def test_a_flag_set_during_a_pass_is_not_undone_by_it() -> None:
    plc, memory = plc_of("OB 1\nU M 40.1\nR M 6.0\nL KB 1\nT MB 41\nBE\n"), PlcMemory()
    memory.m[40] = 2
    plc.start(0, memory)
    memory.m[6] = 1
    plc.touch(MS)
    plc.end_pass(4 * MS, memory)
    assert (memory.m[6], memory.m[41]) == (1, 1)
    plc.begin_pass(4 * MS, memory)
    plc.end_pass(8 * MS, memory)
    assert memory.m[6] == 0


def test_rights_of_flags() -> None:
    may_set, may_reset = bytearray(b"\xff" * 256), bytearray(b"\xff" * 256)
    may_set[0], may_reset[0] = 0b01, 0b10
    rights = Rights(bytes(may_set), bytes(may_reset))
    plc, memory = plc_of("OB 1\nL KH 0005\nT MB 0\nBE\n", rights), PlcMemory()
    memory.m[0] = 0b1010
    plc.start(0, memory)
    plc.end_pass(4 * MS, memory)
    assert memory.m[0] == 0b1001


def test_start_up_blocks_run_once_each_at_its_occasion() -> None:
    text = "OB 1\nL MB 50\nI 1\nT MB 50\nBE\nOB 21\nL KB 10\nT MB 50\nBE\nOB 22\nL KB 20\nT MB 50\nBE\n"
    for power_on, expected in ((False, 11), (True, 21)):
        plc, memory = plc_of(text), PlcMemory()
        plc.start(0, memory, power_on=power_on)
        pass_by_pass(plc, memory, 4 * MS)
        assert memory.m[50] == expected
        pass_by_pass(plc, memory, 8 * MS)
        assert memory.m[50] == expected + 1


def test_it_stops_at_the_end_of_a_pass_or_by_itself() -> None:
    plc, memory = plc_of("OB 1\nU E 0.0\n= A 0.0\nU E 0.1\nSPB PB 9\nBE\n"), PlcMemory()
    memory.e[0] = 1
    plc.start(0, memory)
    plc.stop_at_end(MS)
    plc.end_pass(4 * MS, memory)
    plc.begin_pass(4 * MS, memory)
    assert (memory.a[0], plc.running, plc.stopped_by) == (1, False, "")
    memory.e[0] = 2
    plc.start(8 * MS, memory)
    plc.end_pass(12 * MS, memory)
    assert not plc.running
    assert "PB 9" in plc.stopped_by
    assert memory.a[0] == 0


TEXT = """OB 1
U E 0.0
L KT 003.0
SE T 1
U T 1
= A 0.0
U E 0.1
ZV Z 1
L Z 1
T AB 1
U M 30.0
S M 30.1
U E 0.2
R M 30.1
U E 0.3
L KT 002.0
SA T 2
U T 2
= A 0.1
BE
"""


class Awake(Plc):
    """The same, but that it never sleeps."""

    @property
    def next_ns(self) -> int | None:
        return None if self._made is None else self._made.end_ns


def history(plc: Plc, seed: int) -> tuple[list[tuple[int, bytes]], int]:
    """What the outputs and flags become, and how many passes were made, while inputs and flags change at random."""
    plc.load(assemble(TEXT).image)
    rng, memory, seen, passes, t_ns = random.Random(seed), PlcMemory(), [], 0, 0
    plc.start(0, memory)
    for _ in range(60):
        t_ns += rng.choice((rng.randrange(3 * GRID), rng.randrange(60 * GRID), GRID, 2 * GRID))
        while (due := plc.next_ns) is not None and due <= t_ns:
            if plc.end_pass(due, memory):
                seen.append((due, bytes(memory.a) + bytes(memory.m)))
            plc.begin_pass(due, memory)
            passes += 1
        if rng.random() < 0.7:
            memory.e[0] ^= 1 << rng.randrange(4)
        else:
            memory.m[30] ^= 1
        plc.touch(t_ns)
    return seen, passes


def test_asleep_it_does_what_it_does_awake() -> None:
    for seed in range(20):
        asleep, awake = history(Plc(Rights(), {}, GRID), seed), history(Awake(Rights(), {}, GRID), seed)
        assert asleep[0] == awake[0], seed
        assert len(asleep[0]) > 10
        assert asleep[1] < awake[1]
