"""Telegrams: accepted by an independent FT1.2 parser; damaged ones, and noise, do nothing; random commands end well."""

from __future__ import annotations

import random

import pytest
from conformance.gmi99_desk import Q, command, fresh, long, short, switches
from iec60870 import parser

from isel_twin.controller import Reply, create_controller
from isel_twin.language import create_language
from isel_twin.testing import Desk

STATUS = bytes.fromhex("10 E0 01 E1 16")
READY = bytes.fromhex("10 E0 00 E0 16")
# The parser knows extensions of one byte at most, so `#8` with its two is not among these.
LINES = (
    "#0",
    "#1",
    "#9 50",
    "T1;0",
    "T0;3",
    "T3;4",
    "Q7;0",
    "M50000",
    "B100",
    "f10000",
    "G91",
    "81h 238",
    "89h 30 500",
    "BFh 1 -1 8388607 -8388352 0 5",
    "V1;2;3",
    "p3;100;0",
    "W1;32768;2",
    "N-1;18;-1",
    "a 0 53 35 01 00",
)


def is_frame(data: bytes) -> bool:
    """Whether an independent parser takes it for one FT1.2 record."""
    sizes = (len(data) - 4,) if data[0] == 0x10 else (1,)
    results = [parser.parse_frame(data, protocol="t101", link_address_size=n, parse_asdu_data=False) for n in sizes]
    return any(result.status is parser.FrameStatus.VALID for result in results)


@pytest.mark.parametrize("line", LINES)
def test_what_the_language_sends_is_a_record(line: str) -> None:
    assert is_frame(create_language("gmi99").frame(line))


@pytest.mark.parametrize("switches_", ["11111111", "11111101"], ids=["E", "S"])
def test_what_the_card_answers_is_a_record(switches_: str) -> None:
    desk = Desk.of("gmi99", settings={"dil_switches": switches_})
    variant_s = switches_[6] == "0"
    for line in ("10 E0 01 E1 16", command("T", 1, 0), command("T", 0, 2), command("T", 3, 4), command("T", 5, 12)):
        data = bytes.fromhex(line)
        if variant_s:
            body = data[2:3] + data[1:2] if data[0] == 0x10 else b"\x43" + data[4:-2]
            head = b"\x10" if data[0] == 0x10 else bytes([0x68, len(body), len(body), 0x68])
            data = head + body + bytes([sum(body) % 256, 0x16])
        desk.send(data)
        answer = desk.replies[-1][1]
        assert is_frame(answer)
    assert len(desk.replies) == 5


def test_our_own_frames_agree_with_the_language() -> None:
    language = create_language("gmi99")
    assert language is not None
    pairs = {
        "p3;100;0": command("p", 3, 100, 0),
        "81h 238": command(0x81, 238),
        "#9 50": short(9, 50),
        "O-5;0": command("O", -5, 0),
        "a 4 01 FF": long(b"a\x04\0\0\x01\xff"),
        "3: #1": short(1, address=3),
    }
    for line, frame in pairs.items():
        assert language.frame(line) == bytes.fromhex(frame)


def damaged(random_: random.Random, frame: bytes) -> bytes:
    """The frame with one thing wrong with it; it is not contained in the result, as it is behind noise."""
    while frame in (data := _damaged(random_, frame)):
        pass
    return data


def _damaged(random_: random.Random, frame: bytes) -> bytes:
    """A byte changed, missing, doubled, put in, or the end missing."""
    at = random_.randrange(len(frame))
    match random_.randrange(5):
        case 0:
            return frame[:at] + bytes([frame[at] ^ random_.randrange(1, 256)]) + frame[at + 1 :]
        case 1:
            return frame[:at] + frame[at + 1 :]
        case 2:
            return frame[: at + 1] + frame[at:]
        case 3:
            return frame[:at] + random_.randbytes(1 + random_.randrange(3)) + frame[at:]
        case _:
            return frame[: max(1, at)]


def test_damaged_frames_and_noise_do_nothing() -> None:
    """40 000 of them at a card that is ready to move: no answer, no motion, no fault, and the frame after each is
    answered."""
    random_ = random.Random(14)
    card = create_controller("gmi99")
    card.power_on(0, {"slot0.estop": True, "slot0.power": True})
    card.receive(0, bytes.fromhex(Q))
    frames = [bytes.fromhex(command(0x81 + mask, *[12345] * (mask + 1).bit_count())) for mask in (0, 1, 2, 6)]
    frames += [bytes.fromhex(f) for f in (command("f", 100), command("r", 0, 0, 1), short(9, 50), short(0))]
    t_ns = 0
    for number in range(40_000):
        noise = number % 5 == 0
        data = random_.randbytes(random_.randrange(1, 30)) if noise else damaged(random_, random_.choice(frames))
        card.take()
        t_ns += 100_000_000
        card.receive(t_ns, data)
        assert card.take() == [], data.hex(" ")
        t_ns += 60_000_000
        card.receive(t_ns, STATUS)
        assert card.take() == [Reply(READY)], data.hex(" ")
    assert card.counts == (0,) * 6
    assert not card.fault


def test_a_whole_frame_right_behind_a_damaged_one_is_answered() -> None:
    """Unless the damage claims more bytes than came; then the pause has it dropped and the host sends it again."""
    random_ = random.Random(15)
    card = create_controller("gmi99")
    card.power_on(0, {"slot0.estop": True, "slot0.power": True})
    card.take()
    frame = bytes.fromhex(command("B", 77))
    for number in range(2000):
        data = damaged(random_, frame)
        card.receive(number * 10**9, data + STATUS)
        if card.take() == []:
            card.receive(number * 10**9 + 60_000_000, STATUS)
            assert [type(event) for event in card.take()] == [Reply]


@pytest.mark.parametrize("seed", range(4))
def test_random_commands_break_nothing(seed: int) -> None:
    """500 commands of any kind, with switches, E-stop and hood between them: the desk watches counters and times; in
    the end the card can be made ready again."""
    random_ = random.Random(seed)
    desk = Desk.of("gmi99", carriage=(100_000, 100_000, 50_000), position_switches=switches())
    letters = "BcdfGHMmNOopQqRrsTVWXa"
    for _ in range(500):
        kind = random_.random()
        if kind < 0.35:
            code = 0x80 | random_.randrange(64)
            values = [random_.choice((0, 5, -300, 4000, -20_000, 8_388_607)) for _ in range((code & 63).bit_count())]
            frame = command(code, *values)
        elif kind < 0.8:
            small = (0, 1, 2, 3, 7, 10, 11, 12, 14, 16, 24, 50, 54, 90, 91, 100, 101, 110, 1000, 20_000, -1)
            frame = command(random_.choice(letters), *[random_.choice(small) for _ in range(random_.randrange(1, 4))])
        elif kind < 0.9:
            frame = random_.choice((short(0), short(1), short(9, random_.randrange(130)), short(8, 88, 2)))
        else:
            frame = command("Q", 7)
        desk.send(bytes.fromhex(frame))
        if random_.random() < 0.1:
            element, states = random_.choice(list(desk.cabinet.elements.items()))
            desk.set(element, random_.choice(states))
        if random_.random() < 0.5:
            desk.run(random_.choice((0.0, 0.001, 0.004, 0.1, 1.0)))
    for element, states in desk.cabinet.elements.items():
        desk.set(element, states[0])
    for frame in (short(0), command("r", 0, 0, 1), command("o", 0), command("p", 11, 0, 0), command("p", 11, 1, 0)):
        desk.send(bytes.fromhex(frame))
    desk.finish()
    desk.power_cycle()
    desk.send(bytes.fromhex(Q))
    desk.finish()
    desk.send(STATUS)
    assert desk.replies[-1][1] == READY


def test_a_card_that_waits_for_nothing_has_nothing_due() -> None:
    assert fresh().controller.next_ns is None
