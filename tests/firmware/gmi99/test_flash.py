"""The flash image: old or new, never half; unreadable means defaults, and says so."""

from __future__ import annotations

import itertools

import hypothesis.strategies as st
from conformance.gmi99_desk import OK, PLC_BEGIN, PLC_END, CardDesk, assembled, command, fresh, load, long
from hypothesis import given, settings

from isel_twin.firmware.gmi99.settings import Settings, Stored, decode, encode
from tests.thorough import drawn

numbers = st.integers(-(1 << 23), (1 << 23) - 1)
axes = st.tuples(*[numbers] * 6)
stored = st.builds(
    Stored,
    st.builds(
        Settings,
        m_hz=st.tuples(*[st.integers(5, 1_000_000)] * 7),
        b_hz_per_ms=st.tuples(*[st.integers(1, 30_000)] * 7),
        axis_mask=st.integers(0, 63),
        addresses=st.just(()) | st.tuples(*[st.integers(0, 255)] * 6),
        ratios=st.tuples(*[st.integers(1, 65_535)] * 6),
    ),
    zero_points=st.lists(axes, min_size=16, max_size=16).map(tuple),
    data=st.binary(max_size=160).map(bytes.hex),
    plc=st.binary(max_size=40).map(bytes.hex),
    programs=st.dictionaries(
        st.integers(0, 31).map(str), st.lists(st.binary(min_size=1, max_size=19).map(bytes.hex)).map(tuple), max_size=3
    ),
)


@settings(max_examples=drawn(60))
@given(stored)
def test_what_was_written_is_read(content: Stored) -> None:
    assert decode(encode(content)) == content


@settings(deadline=None, max_examples=drawn(60))
@given(stored, st.data())
def test_a_damaged_image_is_not_read(content: Stored, data: st.DataObject) -> None:
    image = encode(content)
    cut = data.draw(st.integers(0, len(image) - 1), "cut")
    assert decode(image[:cut]) is None
    where, what = data.draw(st.integers(0, len(image) - 1), "where"), data.draw(st.integers(1, 255), "what")
    assert decode(image[:where] + bytes([image[where] ^ what]) + image[where + 1 :]) is None


@given(st.binary(max_size=100))
def test_no_image_at_all_is_not_read(image: bytes) -> None:
    assert decode(image) is None


def test_an_unreadable_image_means_defaults_and_says_so() -> None:
    desk = fresh()
    desk.tell(command("N", 5, 10), command("s", 85, 170))
    assert desk.flash is not None
    desk.power_cycle(flash=desk.flash[:-1])
    assert desk.outputs["flash_fault"] == 1
    assert desk.tell(command("T", 5, 10), command("T", 3, 4)) == [long(b"N\x07\0\0"), long(b"\x33")]
    desk.tell(command("r", 0, 0, 1))
    desk.power_cycle()
    assert desk.outputs["flash_fault"] == 0
    assert desk.ask(command("T", 3, 4)) == long(b"\x02")


def content_of(desk: CardDesk) -> tuple[str, ...]:
    """What a host can ask of what is kept: settings, a zero point, a data word, what program 0 does."""
    answers = desk.tell(command("T", 5, 10), command("T", 8, 54, 0), command("T", 1, 6, 0), command("Q", 63))
    desk.ask(command("p", 3, 1, 0))
    desk.finish()
    return (*answers, str(desk.counts[0]))


def test_a_power_cut_at_any_write_leaves_the_old_image_or_the_new_one() -> None:
    desk = fresh()
    told = desk.tell(
        command("N", 3, 10),
        command("s", 85, 170),
        command("G", 54, 700, 1),
        command("d", 0x1234, 0),
        command("p", 3, 100, 0),
        command(0x81, 40),
        command("p", 3, 101),
        command("N", 5, 10),
        command("s", 85, 170),
        command("G", 54, 800, 1),
        command("d", 0x4321, 0),
        command("p", 3, 100, 0),
        command(0x81, 60),
        command("p", 3, 101),
    )
    assert told == [OK] * 14
    seen = []
    for _, image in desk.flash_log:
        again = fresh()
        again.power_cycle(flash=image)
        seen.append(content_of(again))
    mask, zero, word, program = zip(*[(s[0], s[1], s[2], s[4]) for s in seen], strict=True)
    assert mask == tuple(long(b"N" + bytes([3 if i < 5 else 5, 0, 0])) for i in range(len(seen)))
    assert set(zero) == {long(b"Z" + n.to_bytes(3, "little")) for n in (0, 700, 800)}
    assert set(word) == {long(b"I" + n.to_bytes(2, "little")) for n in (0, 0x1234, 0x4321)}
    assert list(program)[-1] == "60"
    assert set(program) == {"0", "40", "60"}, "a recording that was cut is an empty program"


def test_a_power_cut_during_a_download_for_the_plc_leaves_the_old_program_none_or_the_new_one() -> None:
    """None while it is being loaded, as for programs of the card, which the download makes invalid; and what a program
    has written into the static data words is there as a whole."""
    old, new = (f"OB 1\nL KF {n}\nT DW 3\nL KF {n}\nT DW 4\nBE\n" for n in (0x1111, 0x2222))
    desk = fresh()
    desk.tell(command("p", 3, 100, 0), command(0x81, 40), command("p", 3, 101))
    load(desk, *assembled(old))
    desk.run(0.1)
    desk.tell(PLC_BEGIN, *assembled(new))
    desk.run(0.1)
    desk.tell(PLC_END, command("p", 1, 1))
    desk.run(0.1)
    seen = []
    for _, image in desk.flash_log:
        again = fresh()
        again.power_cycle(flash=image)
        code = again.ask(command("T", 12, 10))
        loaded = code and int.from_bytes(bytes.fromhex(code)[8:10], "big")
        data = bytes.fromhex(again.ask(command("T", 1, 6, 6)))[6:8]
        data += bytes.fromhex(again.ask(command("T", 1, 6, 8)))[6:8]
        assert again.ask(command("T", 3, 4)) == long(b"\0" if loaded else b"\x02")
        again.tell(command("Q", 7), command("p", 3, 1, 0))
        again.finish()
        seen.append((loaded, data.hex(), again.counts[0]))
    assert [key for key, _ in itertools.groupby(seen)] == [
        ("", "00000000", 0),  # the recording has begun
        ("", "00000000", 40),
        ("", "00000000", 0),  # the first download
        (0x1111, "00000000", 0),
        (0x1111, "11111111", 0),
        ("", "11111111", 0),  # the second one
        (0x2222, "11111111", 0),
        (0x2222, "22222222", 0),
    ]
