"""The flash image: old or new, never half; unreadable means defaults, and says so."""

from __future__ import annotations

import copy
import json
import zlib

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from isel_twin.firmware.imc import commands
from isel_twin.firmware.imc import settings as image_format
from isel_twin.firmware.imc.profile import load_profile
from isel_twin.firmware.imc.settings import (
    Flash,
    Modal,
    ProgramState,
    Settings,
    StoredProgram,
    decode,
    default_settings,
    encode,
)
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
        StoredProgram,
        st.sampled_from(ProgramState),
        st.lists(st.tuples(st.sampled_from("0567mz"), st.lists(numbers, max_size=8).map(tuple))).map(tuple),
        st.sampled_from([1, 3, 7, 8, 15]),
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


TREE = json.loads(encode(Flash(DEFAULTS, StoredProgram(ProgramState.VALID, (("5", (1,)),), 7))).partition(b"\n")[2])


def image_with(part: str, name: str, value: object) -> bytes:
    """An image with a right checksum in which one value is another one."""
    tree = copy.deepcopy(TREE)
    where = tree["program"]["modal"] if part == "modal" else tree[part]
    assert name in where
    where[name] = value
    body = json.dumps(tree, separators=(",", ":")).encode()
    return image_format.MAGIC + b"%08x\n" % zlib.crc32(body) + body


NO_NUMBERS = ("300", 300.5, True, None, [], {}, 1e300)

IMPOSSIBLE = (
    *[("settings", "start_stop_hz", value) for value in (19, 4001, -1, 0, 10**30, *NO_NUMBERS)],
    *[("settings", "acceleration_hz_per_ms", value) for value in (0, -5, 4001, *NO_NUMBERS)],
    *[("settings", "limit_switches", value) for value in (-1, 65_536, *NO_NUMBERS)],
    *[("settings", "reference_hz", [2000] * 3 + [value]) for value in (0, -1, 1 << 23, *NO_NUMBERS)],
    *[("settings", "run_free_steps", [20] * 3 + [value]) for value in (-1, 1 << 23, *NO_NUMBERS)],
    *[("settings", name, value) for name in ("reference_hz", "run_free_steps") for value in ([], [50] * 5, 50, "5050")],
    *[
        ("settings", name, value)
        for name in ("swapped", "inverted", "reference_inverted", "rotary")
        for value in (-1, 16, *NO_NUMBERS)
    ],
    *[("settings", name, value) for name in ("io_only", "baud_9600") for value in (-1, 2, *NO_NUMBERS)],
    *[
        ("settings", name, value)
        for name in ("abort", "hood", "emergency", "error_signal")
        for value in ([4, 0, 0], [-1, 0, 0], [0, 256, 0], [0, 0, -1], [0, 0], [0, 0, 0, 0], [0, 0, "0"], 0, None)
    ],
    ("settings", "error_signal", [1, 0, 0]),
    *[("settings", "user_info", value) for value in ("x" * 33, "\n", "ä", 5, None)],
    *[("program", "state", value) for value in ("other", 1, None)],
    *[("program", "axes", value) for value in (0, 2, 6, 10, 16, -1, *NO_NUMBERS)],
    *[
        ("program", "lines", value)
        for value in ("5", [["5"]], [[5, [1]]], [["5", [1.5]]], [["5", ["1"]]], [["5", [1e9]]])
    ],
    ("program", "lines", [["5", [1 << 23]]]),
    *[("modal", "start_stop_hz", value) for value in (19, 4001, 300.5, True, "300")],
    *[("modal", "acceleration_hz_per_ms", value) for value in (0, 4001, 100.5, True, "100")],
    *[("modal", "reference_hz", value) for value in ([2000] * 3, [0] * 4, 2000)],
    *[("modal", "plane", value) for value in (-1, 3, True, "0")],
    *[("modal", name, value) for name in ("three_d", "clockwise", "test_mode") for value in (0, 1, "true")],
)


@pytest.mark.parametrize(("part", "name", "value"), IMPOSSIBLE)
def test_impossible_values_with_a_right_checksum_are_a_flash_fault(part: str, name: str, value: object) -> None:
    desk = Desk.of("imc-s8", flash=image_with(part, name, value))
    assert desk.outputs["flash_fault"] == 1
    for command in ("@07", "@0N7", "@0A100,5000,0,30,0,30,0,30", "@0R7"):
        assert desk.query(command) == "0"


@pytest.mark.parametrize(
    "body", [b"[]", b"null", b"{}", b'{"settings": 5, "program": 6}', b'{"settings": []}', b"[" * 99_999]
)
def test_an_image_of_something_else_is_a_flash_fault(body: bytes) -> None:
    assert decode(image_format.MAGIC + b"%08x\n" % zlib.crc32(body) + body) is None


def test_what_an_image_may_hold_is_what_the_commands_take() -> None:
    for code, name in CODES.items():
        numbers = commands.INITIALISATION[code].parameters
        assert isinstance(numbers, tuple)
        assert image_format.RANGES[name] == tuple((number.low, number.high) for number in numbers), code


CODES = {
    "IF": "run_free_steps",
    "IJ": "acceleration_hz_per_ms",
    "Ij": "start_stop_hz",
    "IO": "io_only",
    "IE": "limit_switches",
    "Ie": "swapped",
    "ID": "inverted",
    "IR": "reference_inverted",
    "IT": "rotary",
    "IA": "abort",
    "Ia": "error_signal",
    "IH": "hood",
    "IN": "emergency",
    "IC": "baud_9600",
}
"""Initialisation commands and the values they set, but for the speeds, whose range is a matter of the profile."""


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
    desk = wake_up(encode(Flash(DEFAULTS, StoredProgram(ProgramState.VALID, lines, 7))))
    assert desk.query("@0S") == "G"
    assert desk.ticks == 0


def test_a_jump_out_of_the_program_ends_it() -> None:
    assert wake_up(encode(Flash(DEFAULTS, StoredProgram(ProgramState.VALID, (("3", (0, -5)),), 7)))).query("@0S") == "0"
