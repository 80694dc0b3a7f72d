"""Whatever arrives on the line: no exception, no broken promise of the border, and no step before a valid job."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.ismif_desk import fresh

from isel_twin.testing import Desk

STRINGS = 20_000  # `python -m tests.reliability.strings` sends a million, which may move it
PER_DEVICE = 200
TOKENS = [
    b"\r", b"\r", b"\r", b"\n", b"\x01", b" ", b",", b"@", b"#", b"$", b"-", b"0", b"99", b"100", b"5001", b"8388608",
    b"X", b"y", b"z5", b"L", b"L1,x9", b"L2,X3,Y4,Z5", b"L1,q1", b"L99,x-40,y7", b"W", b"W3", b"$HXYZ", b"$HX", b"A1",
    b"#E1,600", b"#E7,5000", b"#S65", b"#R0", b"#R60000", b"#DX,1,2,3,4", b"#OY,0", b"F1", b"F0", b"T1", b"Z2", b"Z1",
    b"\rL2,x30,y-7\x01", b"\r$HY\x01", b"\r@C\r",
    b"@A", b"@C", b"@B", b"@S", b"@R", b"@X", b"@LX", b"@V", b"\xff", b"\x02", b"\x03", b"\x00",
]  # fmt: skip
JOBS = [
    b"#S150\r#E1,1200\r#R100\rL1,X40,y-7\rW25\rL2,z3\x01",
    b"T0\rF1\r#DX,0,1,2,3\r#OX,30\r$HX\x01",
    b"Z2\rA1\rL99,X-3,Y5,Z1\rL1,Z0\rA0\rZ1\x01",
    b"@V\rL0,x8\r@X\rL0,x-8\r@LX\x01",
]


def test_random_bytes_make_no_step() -> None:
    """No string of this seed happens to hold a valid vector or reference run with 01h, so nothing may ever move."""
    random = np.random.default_rng(5)
    for _ in range(STRINGS // PER_DEVICE):
        desk = fresh()
        for length in random.integers(1, 60, PER_DEVICE):
            desk.send(random.bytes(int(length)))
        desk.run(1.0)
        assert desk.ticks == 0
        assert desk.controller.idle


@pytest.mark.parametrize("seed", range(5))
def test_pieces_of_commands_break_nothing(seed: int) -> None:
    """The desk checks counters against the stream and the protocol of time; every reply is one the manual knows."""
    random = np.random.default_rng(seed)
    ticks = 0
    for _ in range(20):
        desk = fresh()
        for length in random.integers(1, 12, PER_DEVICE):
            desk.send(b"".join(TOKENS[i] for i in random.integers(0, len(TOKENS), length)))
            desk.run(0.03)
        desk.send(b"\r@C\r")
        desk.finish(36_000.0)
        assert known_replies(desk)
        ticks += desk.ticks
    assert ticks > 10_000  # some of it did move


def test_pieces_of_commands_without_a_start_make_no_step() -> None:
    random = np.random.default_rng(9)
    quiet = [token for token in TOKENS if b"\x01" not in token]
    for _ in range(50):
        desk = fresh()
        for length in random.integers(1, 12, PER_DEVICE):
            desk.send(b"".join(quiet[i] for i in random.integers(0, len(quiet), length)))
            desk.run(0.01)
        assert desk.ticks == 0


def test_truncated_jobs_make_no_step() -> None:
    """Without its 01h nothing of a job is carried out; a reset makes room for the next one."""
    for job in JOBS:
        for length in range(len(job)):
            desk = fresh()
            desk.send(job[:length])
            desk.run(5.0)
            assert desk.ticks == 0
            assert desk.controller.idle
            desk.send(b"\r@R\rL1,x9\x01")
            desk.finish()
            assert desk.steps.total == (9, 0, 0, 0)
            assert not desk.controller.fault


@pytest.mark.parametrize("seed", range(3))
def test_jobs_with_flipped_bits_break_nothing(seed: int) -> None:
    """One to three bits of several jobs are wrong. The replies stay those of the manual, and a reset mends all."""
    random = np.random.default_rng(seed)
    faults = 0
    for _ in range(100):
        data = bytearray(b"".join(JOBS[i] for i in random.integers(0, len(JOBS), 3)))
        for bit in random.integers(0, 8 * len(data), random.integers(1, 4)):
            data[bit // 8] ^= 1 << bit % 8
        desk = fresh()
        desk.send(bytes(data))
        desk.send(b"\r@C\r")
        desk.finish(36_000.0)
        assert known_replies(desk)
        faults += desk.controller.fault
        mark = desk.ticks
        desk.send(b"@R\rT0\rF0\rZ1\rL1,x9\x01")
        desk.finish()
        assert desk.steps_since(mark).total == (9, 0, 0, 0)
        assert not desk.controller.fault
    assert 20 < faults < 100  # some were noticed, some turned into other commands


def known_replies(desk: Desk) -> bool:
    """Nothing but CR, 02h, 03h and the three answers, each with its CR."""
    for _, data in desk.replies:
        text = data.decode("ascii")
        body = text.removesuffix("\r")
        known = body in ("", "\x02", "\x03", "@V SMC-ISMIF 1.00") or (
            (body.startswith("@X") and len(body) == 8 and set(body[2:]) <= {"0", "1"})
            or (body[:3] in ("@LX", "@LY", "@LZ") and body[3:].removeprefix("-").isdigit())
        )
        if not (known and text.endswith("\r")):
            return False
    return bool(desk.replies)
