"""The flash image: old or new, never half; unreadable means defaults, and says so."""

from __future__ import annotations

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from isel_twin.firmware.imc.profile import load_profile
from isel_twin.firmware.imc.settings import VALID, Flash, Modal, Program, Settings, decode, default_settings, encode
from isel_twin.testing import Desk

PROGRAM = ("@0i", "010,900,0,900,0,900,0,900", "5 1", "3 2,-2", "9")
DEFAULTS = default_settings(load_profile("imc-s8", {}))

numbers = st.integers(-(1 << 23), (1 << 23) - 1)
flashes = st.builds(
    Flash,
    st.builds(
        Settings,
        reference_hz=st.tuples(*[st.integers(30, 40_000)] * 4),
        run_free_steps=st.tuples(*[st.integers(0, 9999)] * 4),
        start_stop_hz=st.integers(20, 4000),
        acceleration_hz_per_ms=st.integers(1, 4000),
        limit_switches=st.integers(0, 65_535),
        abort=st.tuples(st.integers(0, 3), st.integers(0, 255), st.integers(0, 255)),
        user_info=st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=32),
    ),
    st.builds(
        Program,
        st.sampled_from(["empty", "incomplete", VALID]),
        st.lists(st.tuples(st.sampled_from("0567mz"), st.lists(numbers, max_size=8).map(tuple))).map(tuple),
        st.sampled_from([0, 7, 15]),
        st.builds(Modal, start_stop_hz=st.none() | st.integers(20, 4000), three_d=st.none() | st.booleans()),
    ),
)


@given(flashes)
def test_what_was_written_is_read(flash: Flash) -> None:
    assert decode(encode(flash)) == flash


@settings(deadline=None)
@given(flashes, st.data())
def test_a_damaged_image_is_not_read(flash: Flash, data: st.DataObject) -> None:
    image = encode(flash)
    cut = data.draw(st.integers(0, len(image) - 1), "cut")
    assert decode(image[:cut]) is None
    where, what = data.draw(st.integers(0, len(image) - 1), "where"), data.draw(st.integers(1, 255), "what")
    assert decode(image[:where] + bytes([image[where] ^ what]) + image[where + 1 :]) is None


@given(st.binary(max_size=200))
def test_anything_else_is_not_read(image: bytes) -> None:
    assert decode(image) is None


@pytest.mark.parametrize("image", [b"rubbish", encode(Flash(DEFAULTS))[:-3]])
def test_unreadable_flash_gives_defaults_and_says_so(image: bytes) -> None:
    desk = Desk.of("imc-s8", flash=image)
    assert desk.outputs["flash_fault"] == 1
    assert "unreadable" in desk.query("@0H")
    assert desk.query("@07") == "0"
    assert desk.query("@0IW") == "0"
    assert desk.outputs["flash_fault"] == 0
    desk.power_cycle()
    assert desk.outputs["flash_fault"] == 0


@pytest.mark.parametrize("image", [None, b""])
def test_a_new_device_has_nothing_to_complain_about(image: bytes | None) -> None:
    assert Desk.of("imc-s8", flash=image).outputs["flash_fault"] == 0


def interrupted(commands: tuple[str, ...]) -> list[bytes | None]:
    """The flash as a power failure would leave it before, between and after all writes of these commands."""
    desk = Desk.of("imc-s8")
    assert desk.query("@07") == "0"
    images = [desk.flash]
    for command in commands:
        assert desk.query(command) == "0", command
        images += [image for _, image in desk.flash_log if image not in images]
    return images


def wake_up(image: bytes | None) -> Desk:
    desk = Desk.of("imc-s8", flash=image, carriage=(60_000, 48_000, 22_000, 50_000))
    assert desk.outputs["flash_fault"] == 0
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    return desk


def test_power_lost_while_a_program_is_stored_or_erased() -> None:
    """Whatever is left: the program runs as a whole, or it cannot be started and must be erased."""
    images = interrupted((*PROGRAM, "@0k"))
    assert len(images) >= 4
    replies = []
    for image in images:
        desk = wake_up(image)
        replies.append(desk.query("@0S"))
        assert desk.counts[0] == (30 if replies[-1] == "0" else 0)
        desk.query("@0k")
        for command in PROGRAM:
            assert desk.query(command) == "0"
    assert replies == ["G", "G", "0", "G"]


def test_power_lost_while_erasing_leaves_the_program() -> None:
    desk = wake_up(None)
    for command in PROGRAM:
        assert desk.query(command) == "0"
    desk.start("@0k")
    desk.run(1.9)
    desk.power_cycle()
    assert desk.query("@07") == "0"
    assert desk.query("@0i") == "G"
    assert desk.query("@0N7") == "0"
    assert desk.query("@0S") == "0"


def test_reset_while_a_program_is_stored_leaves_it_invalid() -> None:
    desk = wake_up(None)
    assert desk.query("@0i") == "0"
    assert desk.query("010,900,0,900,0,900,0,900") == "0"
    desk.send(b"\xfe")
    assert desk.query("@07") == "0"
    assert desk.query("@0S") == "G"
    assert desk.query("@0i") == "G"
    assert desk.query("@0k") == "0"
    assert desk.query("@0i") == "0"


def test_settings_and_program_do_not_overwrite_each_other() -> None:
    desk = wake_up(None)
    for command in (*PROGRAM, "@0IUhello", "@0IW", "@0IUlost"):
        assert desk.query(command) == "0"
    desk.power_cycle()
    assert "hello" in desk.query("@0U")
    for command in ("@07", "@0N7", "@0S"):
        assert desk.query(command) == "0"
    assert desk.counts[0] == 30
    assert desk.query("@0k") == "0"
    desk.power_cycle()
    assert "hello" in desk.query("@0U")


@pytest.mark.parametrize(
    "lines",
    [
        (("q", ()),),
        (("0", (1, 2)),),
        (("0", (10, 900, 0, 900, 0, 900, 0)),),
        (("0", (10, 99_999, 0, 900, 0, 900, 0, 900)),),
        (("z", (7,)),),
    ],
)
def test_a_program_no_firmware_would_have_stored_does_not_run(lines: tuple[tuple[str, tuple[int, ...]], ...]) -> None:
    desk = wake_up(encode(Flash(DEFAULTS, Program(VALID, lines, 7))))
    assert desk.query("@0S") == "G"
    assert desk.ticks == 0


def test_a_jump_out_of_the_program_ends_it() -> None:
    assert wake_up(encode(Flash(DEFAULTS, Program(VALID, (("3", (0, -5)),), 7)))).query("@0S") == "0"
