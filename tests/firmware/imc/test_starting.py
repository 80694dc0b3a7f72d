"""What a start goes on with, and that a start refused changes nothing."""

from __future__ import annotations

import pytest

from isel_twin.testing import Desk

MIDDLE = (60_000, 48_000, 22_000, 50_000)
MOVE = "@0A900,900,0,900,0,900,0,900"
"""About a second."""


def desk_after(*commands: str, **options: object) -> Desk:
    desk = Desk.of("imc-s8", **{"carriage": MIDDLE, **options})  # type: ignore[arg-type]
    for command in commands:
        assert desk.query(command) == "0", command
    return desk


def stored_in_test_mode() -> Desk:
    """A program for three axes stored in test mode with values of its own, then mains off and on."""
    desk = desk_after("@07", "@0T1", "@0j1000", "@0z1", "@0k", "@0i", "0500,900,0,900,0,900,0,900", "9")
    desk.power_cycle()
    return desk


def start(desk: Desk, how: str) -> str:
    if how == "key":
        desk.press("start")
        return desk.finish()
    return desk.query(how)


# --- a start refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["@0S", "key"])
def test_refused_for_its_axes_a_start_changes_nothing(how: str) -> None:
    desk = stored_in_test_mode()
    assert desk.query("@03") == "0"
    before = desk.query("@0DS0")
    assert start(desk, how) == ("3" if how == "@0S" else "")
    assert desk.query("@0DS0") == before
    assert desk.query("@0N3") == "0"
    assert desk.query("@0A-100000,30000,0,900") == "2"
    assert desk.struck("limit_x1")
    assert desk.carriage[0] == 0


@pytest.mark.parametrize("how", ["@0S", "key"])
def test_refused_for_an_unsound_program_a_start_sets_no_axes(how: str) -> None:
    desk = stored_in_test_mode()
    settings = {"max_speed_hz": 800}  # the image comes from a faster controller
    slow = Desk.of("imc-s8", carriage=MIDDLE, flash=desk.flash, settings=settings)
    assert start(slow, how) == ("G" if how == "@0S" else "")
    assert slow.query("@0n1") == "4"


@pytest.mark.parametrize("how", ["@0S", "key"])
@pytest.mark.parametrize(("watch", "reply"), [("@0IA0,1,1", "F"), ("@0IH0,1,1", "H"), ("@0IN0,1,1", "9")])
def test_refused_for_a_watched_port_a_start_leaves_the_error_output(how: str, watch: str, reply: str) -> None:
    desk = desk_after("@07", "@0N7", "@0k", "@0i", "0500,900,0,900,0,900,0,900", "9", "@0Ia0,8,8", watch)
    assert start(desk, how) == (reply if how == "@0S" else "")
    assert desk.outputs["user"] == 0
    assert desk.ticks == 0


def test_a_program_does_not_bring_test_mode() -> None:
    """Everything else that was set when it was stored comes with it."""
    desk = stored_in_test_mode()
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    assert desk.query("@0S") == "0"
    assert int(desk.query("@0DS0"), 16) & 0b1100000 == 0b0100000  # 3D, no test mode
    gaps_ns = (desk.steps.t_ns[1:] - desk.steps.t_ns[:-1]).tolist()
    assert max(gaps_ns) < 1.2e6  # 1000 Hz to start with: no ramp
    assert desk.query("@0A-100000,30000,0,900,0,900,0,900") == "2"


# --- going on after a change -----------------------------------------------------------------------------------------


INVERSIONS = {
    "by-command": (("@0ID1",), ()),
    "from-flash": (("@0IL",), ("@0ID1", "@0IW", "@0ID0")),
    "by-default": (("@0IX",), ("@0ID1",)),
    "and-taken-as-referenced": (("@0ID1", "@0N1"), ()),
    "and-back": (("@0ID1", "@0ID0"), ()),
}


@pytest.mark.parametrize("how", ["@0S", "key"])
@pytest.mark.parametrize(("between", "before"), INVERSIONS.values(), ids=INVERSIONS.keys())
def test_the_rest_never_goes_the_other_way(between: tuple[str, ...], before: tuple[str, ...], how: str) -> None:
    desk = desk_after(*before, "@07", "@0N7")
    desk.start(MOVE)
    desk.run(0.3)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    mark = desk.ticks
    for command in between:
        assert desk.query(command) == "0"
    assert start(desk, how) == ("R" if how == "@0S" else "")
    assert desk.ticks == mark
    assert desk.query("@0R1") == "0"
    assert desk.query("@0S") == "G"


def test_another_axis_inverted_and_taken_back_goes_on_the_same_way() -> None:
    desk = desk_after("@07", "@0N7")
    desk.start(MOVE)
    desk.run(0.3)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    for command in ("@0ID1", "@0ID0", "@0N1", "@0S"):
        assert desk.query(command) == "0"
    assert desk.carriage[0] == MIDDLE[0] + 900


# --- references lost -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("x", [-5, 60_000], ids=["off-a-switch", "from-nowhere"])
def test_after_running_free_every_axis_wants_a_reference_run(x: int) -> None:
    desk = desk_after("@07", "@0N7", "@0F1", carriage=(x, *MIDDLE[1:]))
    for axis, mask in enumerate((1, 2, 4)):
        pairs = ["0,900"] * 4
        pairs[axis] = "1,900"
        move = f"@0A{','.join(pairs)}"
        assert desk.query(move) == "R"
        assert desk.query(f"@0R{mask}") == "0"
        assert desk.query(move) == "0"
