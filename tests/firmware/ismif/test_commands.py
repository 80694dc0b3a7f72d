"""The command language by itself: what is read, what is refused."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from isel_twin.firmware.ismif.commands import COMMANDS, CommandError, Instruction, Target, parse

PRINTED = [
    (b"@R", Instruction("@R")),
    (b"@V", Instruction("@V")),
    (b"@X", Instruction("@X")),
    (b"@LX", Instruction("@L", (0,))),
    (b"@LY", Instruction("@L", (1,))),
    (b"T1", Instruction("T", (1,))),
    (b"F1", Instruction("F", (1,))),
    (b"Z2", Instruction("Z", (2,))),
    (b"#S150", Instruction("#S", (150,))),
    (b"#E1,800", Instruction("#E", (1, 800))),
    (b"#E25,400", Instruction("#E", (25, 400))),
    (b"#R400", Instruction("#R", (400,))),
    (b"#DX,0,4,4,4", Instruction("#D", (0, 0, 4, 4, 4))),
    (b"#DY,1,1,2,3", Instruction("#D", (1, 1, 1, 2, 3))),
    (b"#OX,35", Instruction("#O", (0, 35))),
    (b"$HZXY", Instruction("$H", ((2, 0, 1),))),
    (b"$HY", Instruction("$H", ((1,),))),
    (b"L1,X200,Y500", Instruction("L", (1, Target(0, False, 200), Target(1, False, 500)))),
    (b"L15,x500,y1000", Instruction("L", (15, Target(0, True, 500), Target(1, True, 1000)))),
    (b"L3,X0,Y0,Z0", Instruction("L", (3, Target(0, False, 0), Target(1, False, 0), Target(2, False, 0)))),
    (b"L99,x15,y25,z35", Instruction("L", (99, Target(0, True, 15), Target(1, True, 25), Target(2, True, 35)))),
    (b"L1,x-50,y-100", Instruction("L", (1, Target(0, True, -50), Target(1, True, -100)))),
    (b"@B", Instruction("@B")),
    (b"@S", Instruction("@S")),
    (b"@A", Instruction("@A")),
    (b"@C", Instruction("@C")),
    (b"A1", Instruction("A", (1,))),
    (b"A0", Instruction("A", (0,))),
    (b"W250", Instruction("W", (250,))),
]
"""Every command printed as an example in the manual."""


@pytest.mark.parametrize(("line", "command"), PRINTED)
def test_printed_examples(line: bytes, command: Instruction) -> None:
    assert parse(line) == command


def test_all_twenty_commands_are_printed_and_known() -> None:
    assert {command.code for _, command in PRINTED} == set(COMMANDS)
    assert len(COMMANDS) == 20


def test_blanks_count_for_nothing() -> None:
    assert parse(b" L 1, x -50 ,y 7 ") == parse(b"L1,x-50,y7")


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"l1,x5",  # small letters are axes of a vector only
        b"@v",
        b"@Q",
        b"T2",
        b"T",
        b"F-1",
        b"Z0",
        b"Z3",
        b"A2",
        b"#S64",
        b"#S5001",
        b"#E100,600",
        b"#E1",
        b"#E1,600,1",
        b"#R65536",
        b"#R-1",
        b"#DA,0,1,1,1",
        b"#Dx,0,1,1,1",
        b"#OX,-1",
        b"#O35",
        b"$H",
        b"$HXX",
        b"$HA",
        b"$HXYZX",
        b"$Hx",
        b"L1",
        b"L1,",
        b"L1,x",
        b"L1,x1.5",
        b"L1,x5,x5",
        b"L1,X5,x5",
        b"L1,x1,y1,z1,x1",
        b"L1,x8388608",
        b"L1,x\xb2",  # a superscript two is no digit
        b"W",
        b"W1e3",
        b"W65536",
        b"@R1",
    ],
)
def test_refused(line: bytes) -> None:
    with pytest.raises(CommandError):
        parse(line)


@given(st.binary(max_size=40))
@example(b"\x00")
def test_any_line_is_read_or_refused(line: bytes) -> None:
    try:
        command = parse(line)
    except CommandError:
        return
    assert command.code in COMMANDS


axis_words = st.permutations("XYZ").flatmap(lambda axes: st.integers(1, 3).map(lambda n: axes[:n]))


@given(st.integers(0, 99), axis_words, st.data())
def test_every_vector_is_read_as_written(index: int, axes: str, data: st.DataObject) -> None:
    targets = [
        Target("XYZ".index(axis), data.draw(st.booleans()), data.draw(st.integers(-8_388_607, 8_388_607)))
        for axis in axes
    ]
    letters = ["xyz"[t.axis] if t.relative else "XYZ"[t.axis] for t in targets]
    line = f"L{index}," + ",".join(f"{letter}{t.steps}" for letter, t in zip(letters, targets, strict=True))
    assert parse(line.encode()) == Instruction("L", (index, *targets))
