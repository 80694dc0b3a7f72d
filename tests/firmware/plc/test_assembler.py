"""Text to image and back. The images are those of the worked example programs."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.firmware.plc import ImageError, PlcBlock, PlcProgram
from isel_twin.firmware.plc.assembler import AssemblyError, assemble, disassemble, explain
from isel_twin.firmware.plc.codes import FORMS, Instruction, decode, encode

EXAMPLES = {
    "U M 6.0/= A 0.0/U M 6.0/L KT 050.1/SE T 1/U T 1/R M 6.0/BE": (
        "53 35 01 01 01 01 0A 00 12 00 80 06 D8 80 80 06 30 02 10 50 24 01 F8 01 B0 06 65 00"
    ),
    "L KH 1234/T MW 40/L KF 1000/L KF 234/-F/T MW 42/L KF 5/L KF 7/<F/= M 44.0/L KH F0/SLW 4/T MW 46/BE": (
        "53 35 01 01 01 01 0A 00 28 00 30 40 12 34 13 28 30 04 03 E8 30 04 00 EA 59 00 13 2A 30 04 00 05 30 04 00 07 "
        "21 40 98 2C 30 40 00 F0 61 04 13 2E 65 00"
    ),
}


@pytest.mark.parametrize("text", EXAMPLES)
def test_worked_examples(text: str) -> None:
    program = assemble("OB 1\n" + text.replace("/", "\n"))
    assert program.image == bytes.fromhex(EXAMPLES[text])
    assert PlcProgram.read(program.image) == program


def test_several_blocks_and_their_entries() -> None:
    program = assemble("OB 1\nU M 6.1\nSPB PB 3\nBE\nOB 22\nL KB 7\nT MB 50\nBE\nPB 3\nU M 6.1\nS A 0.3\nR M 6.1\nBE\n")
    assert program.image.hex() == (
        "533501030101160006000116" + "1c0006000203220008008106550365002807" + "0b326500" + "8106d380b1066500"
    )
    assert program.entries == {("OB", 1): 0x16, ("OB", 22): 0x1C, ("PB", 3): 0x22}


def test_labels_count_words_from_the_jump() -> None:
    program = assemble("OB 1\nLOOP: L KF 1\nSPB =ON\nSPA =LOOP\nON:\nBE")
    assert program.blocks[0].code == bytes.fromhex("30 04 00 01 FA 02 2D FD 65 00")


def instructions() -> st.SearchStrategy[Instruction]:
    def of(form: object) -> st.SearchStrategy[Instruction]:
        numbers = st.integers(form.lowest, form.highest) if form.operand else st.just(0)  # type: ignore[attr-defined]
        bits = st.integers(0, 7) if form.operand == "bit" else st.just(0)  # type: ignore[attr-defined]
        return st.builds(Instruction, st.just(form), numbers, bits)

    known = [form for form in FORMS.values() if form.operand != "jump" and form.mnemonic != "BE"]
    return st.sampled_from(known).flatmap(of)


@given(st.lists(instructions(), max_size=30))
def test_what_is_disassembled_is_assembled_to_the_same_bytes(listed: list[Instruction]) -> None:
    code = b"".join(encode(instruction) for instruction in listed) + bytes.fromhex("65 00")
    program = PlcProgram.of([PlcBlock("PB", 200, code)])
    text = disassemble(program)
    assert assemble(text).image == program.image
    assert len(explain(program)) == len(listed) + 2


@given(st.binary(min_size=2, max_size=4))
def test_a_code_that_is_read_is_written_alike(code: bytes) -> None:
    instruction = decode(code)
    if instruction is not None:
        assert encode(instruction) == code[: 2 * instruction.words]


@given(st.binary(max_size=60))
def test_any_bytes_are_a_program_or_refused(data: bytes) -> None:
    for image in (data, b"\x53\x35\x01" + data):
        try:
            program = PlcProgram.read(image)
        except ImageError:
            continue
        assert PlcProgram.read(program.image) == program


@given(st.text("OB1PBUEAM 0.123=:\nLKFTSE;", max_size=80))
def test_any_text_is_a_program_or_refused_with_its_line(text: str) -> None:
    said = None
    try:
        program = assemble(text)
    except AssemblyError as error:
        said = error
    if said is None:
        assert PlcProgram.read(program.image) == program
    else:
        assert 1 <= said.line <= max(text.count("\n") + 1, 1)
        assert "\n" not in str(said)


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("U E 0.0", 1, "OB, PB, FB, SB"),
        ("OB 1\nU E 0.8\nBE", 2, "0 to 7"),
        ("OB 1\nU E 48.0\nBE", 2, "0 to 47"),
        ("OB 1\nX 3\nBE", 2, "'X 3'"),
        ("OB 1\nSPB =ON\nBE", 2, "no label ON"),
        ("OB 1\nA: NOP0\nA: NOP0\nBE", 3, "twice"),
        ("OB 1\nNOP0\n", 2, "BE"),
        ("OB 1\nBE\nOB 1\nBE", 3, "twice"),
        ("OB 1\nL KT 1000.0\nBE", 2, "0 to 999"),
        ("OB 1\nL KF 40000\nBE", 2, "-32768 to 32767"),
        ("OB 1\nSLW 16\nBE", 2, "0 to 15"),
        ("; nothing", 1, "OB 1"),
    ],
)
def test_a_wrong_line_is_named(text: str, line: int, said: str) -> None:
    with pytest.raises(AssemblyError, match=said) as error:
        assemble(text)
    assert error.value.line == line


@pytest.mark.parametrize(
    ("image", "said"),
    [
        ("00", "53 35 01"),
        ("53 35 01 02 01 01 0A 00 02 00", "cut off"),
        ("53 35 01 01 07 01 0A 00 02 00 65 00", "kind 7"),
        ("53 35 01 01 01 01 0A 00 04 00 65 00", "outside"),
        ("53 35 01 01 01 01 0A 00 02 00 00 00", "BE"),
    ],
)
def test_a_wrong_image_is_refused(image: str, said: str) -> None:
    with pytest.raises(ImageError, match=said):
        PlcProgram.read(bytes.fromhex(image))
