"""What STEP 5 says of timers, counters, conditions, brackets and images, worked out by hand, step by step."""

from __future__ import annotations

import itertools

import pytest

from isel_twin.firmware.plc import ImageError, Plc, PlcBlock, PlcMemory, PlcProgram, Rights
from isel_twin.firmware.plc.assembler import assemble
from isel_twin.firmware.plc.processor import Elements, Halt, Processor

MS = 1_000_000
SECOND = 1000 * MS


class Bench:
    """OB 1 of instructions parted by "; "; a pass on demand."""

    def __init__(self, lines: str) -> None:
        self.processor = Processor(assemble("OB 1\n" + lines.replace("; ", "\n") + "\nBE\n"), {})
        self.memory, self.elements = PlcMemory(), Elements()

    def run(self, now_ns: int = 0, inputs: int = 0) -> int:
        """A pass; output byte 0 afterwards."""
        self.memory.e[0] = inputs
        self.processor.run("OB", 1, self.memory, self.elements, now_ns)
        return self.memory.a[0]

    def word(self, flag: int) -> int:
        return self.memory.m[flag] + 256 * self.memory.m[flag + 1]


def history(lines: str, inputs: str, unit_ns: int = SECOND) -> str:
    """Output A0.0, pass by pass in the middle of each unit, while byte 0 of the inputs is what each digit says."""
    bench = Bench(lines)
    return "".join(str(bench.run(n * unit_ns + unit_ns // 2, int(digit)) & 1) for n, digit in enumerate(inputs))


# Input 1: the start, input 2: the reset. KT 4 s, or what is said.
TIMERS = [
    # started anew while it runs: four more from there
    ("SI", "0101111110", "0101111000"),
    ("SV", "0100101000000", "0111111111000"),
    ("SE", "0111011111100", "0000000001100"),
    ("SS", "0101000000000", "0000000111111"),
    ("SA", "0100100100000", "0111111111110"),
    # an edge after it has run out
    ("SI", "0111110100000", "0111100100000"),
    ("SV", "0111111011111", "0111100011110"),
    ("SS", "0100000100000", "0000011111111"),
    # reset while it runs, and after
    ("SI", "0113111100000", "0110000000000"),
    ("SV", "0102000100000", "0110000111100"),
    ("SE", "0111111131100", "0000011100000"),
    ("SS", "0100000200000", "0000011000000"),
    ("SS", "0102000000000", "0000000000000"),
    ("SA", "0110020000000", "0111100000000"),
    # the start stays on during a reset: no edge, no start
    ("SV", "0131111100000", "0100000000000"),
]


@pytest.mark.parametrize(("kind", "inputs", "bits"), TIMERS)
def test_timers_started_again_and_reset(kind: str, inputs: str, bits: str) -> None:
    assert history(f"U E 0.0; L KT 004.2; {kind} T 3; U E 0.1; R T 3; U T 3; = A 0.0", inputs) == bits


@pytest.mark.parametrize(
    ("kind", "inputs", "bits"),
    [
        ("SI", "0110", "0000"),
        ("SV", "0110", "0000"),
        ("SE", "0110", "0110"),
        ("SS", "0100", "0111"),
        ("SA", "0110", "0110"),
    ],
)
def test_a_timer_of_0_has_run_out_at_once(kind: str, inputs: str, bits: str) -> None:
    assert history(f"U E 0.0; L KT 000.0; {kind} T 0; U T 0; = A 0.0", inputs) == bits


def test_a_timer_is_asked_before_it_is_started() -> None:
    """The chain that starts it stands behind the one that asks: first seen a pass later."""
    assert history("U T 1; = A 0.0; U E 0.0; L KT 004.2; SV T 1", "0100000") == "0011100"


def test_what_is_left_of_a_timer_goes_down_unit_by_unit() -> None:
    bench = Bench("U E 0.0; L KT 003.1; SI T 2; L T 2; T MW 40")
    left = []
    for ms in (0, 99, 100, 101, 299, 300):
        bench.run(ms * MS, 1)
        left.append(bench.word(40))
    assert left == [3, 3, 2, 2, 1, 0]


def test_digits_that_are_none_start_no_timer() -> None:
    assert history("U E 0.0; L KH 200A; SV T 1; U T 1; = A 0.0", "0100") == "0000"


# ---- counters --------------------------------------------------------------------------------------------------------

COUNTER = "U E 0.0; ZV Z 3; U E 0.1; ZR Z 3; U E 0.2; L KH {constant}; S Z 3; U E 0.3; R Z 3; L Z 3; T MW 40"


def counted(constant: str, *inputs: int) -> list[int]:
    bench = Bench(COUNTER.format(constant=constant))
    counts = []
    for byte in inputs:
        bench.run(inputs=byte)
        counts.append(bench.word(40))
    return counts


@pytest.mark.parametrize(
    ("constant", "number"), [("0000", 0), ("0017", 17), ("0999", 999), ("1234", 234), ("F999", 999)]
)
def test_a_counter_is_set_by_three_decimal_digits(constant: str, number: int) -> None:
    """The upper four bits do not count."""
    assert counted(constant, 4) == [number]


@pytest.mark.parametrize("constant", ["000A", "00F0", "0A00"])
def test_digits_that_are_none_leave_a_counter_as_it_was(constant: str) -> None:
    assert counted(constant, 1, 0, 1, 4) == [1, 1, 2, 2]


def test_a_counter_is_set_by_an_edge() -> None:
    assert counted("0005", 4, 4 + 1, 4, 4 + 1, 0, 4) == [5, 6, 6, 7, 7, 5]


def test_both_ways_at_once_leave_a_counter_as_it_was() -> None:
    assert counted("0005", 4, 3, 0, 3) == [5, 5, 5, 5]


def test_a_reset_behind_wins_and_eats_the_edge() -> None:
    """Counted up and reset in one pass: 0; the next edge comes after the input has been off."""
    assert counted("0005", 9, 1, 0, 1) == [0, 0, 0, 1]


def test_a_counter_at_its_ends() -> None:
    assert counted("0999", 4, 1, 0, 1) == [999, 999, 999, 999]
    assert counted("0001", 4, 2, 0, 2) == [1, 0, 0, 0]


# ---- conditions ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lines", "condition"),
    [
        ("L KH FF00; L KH 00FF; UW", 0),
        ("L KH FF00; L KH F000; UW", 1),  # a pattern of bits has no sign
        ("L KH 8000; L KH 0000; OW", 1),
        ("L KH 5555; L KH 5555; XOW", 0),
        ("L KF 3; L KF 5; -F", -1),
        ("L KF 32767; L KF 1; +F", -1),  # overflow: the sign is that of the sixteen bits
        ("L KF -32768; L KF -1; +F", 1),
        ("L KF -32768; L KF -32768; +F", 0),
        ("L KF 3; L KF 5; <F", -1),
        ("L KF 5; L KF 5; !=F", 0),
        ("L KH 7FFF; L KH 8000; >F", 1),
        ("L KH 8001; SLW 1", 1),  # the bit that went out last
        ("L KH 4001; SLW 1", 0),
        ("L KH 0002; SRW 2", 1),
        ("L KH 0004; SRW 2", 0),
        ("L KF 1; KZW", -1),
        ("L KF 0; KZW", 0),
        ("L KF 0; L KF 7; +F; KEW", 1),  # one's complement leaves it
        ("L KF 3; L KF 5; -F; L KB 0; T MB 60; TAK; U E 0.0", -1),  # loads and logic leave it
    ],
)
def test_jumps_by_the_condition(lines: str, condition: int) -> None:
    jumps = {"SPZ": condition == 0, "SPN": condition != 0, "SPP": condition > 0, "SPM": condition < 0}
    for jump, taken in jumps.items():
        bench = Bench(f"{lines}; {jump} =ON; L KB 1; T MB 40; ON: NOP0")
        bench.run()
        assert (bench.memory.m[40] == 0) is taken, jump


def test_a_comparison_begins_a_chain_that_goes_on() -> None:
    bench = Bench("L MB 50; L KB 7; >F; U E 0.0; O E 0.1; = A 0.0")
    for value, e0, e1 in itertools.product((6, 8), (0, 1), (0, 1)):
        bench.memory.m[50] = value
        assert bench.run(inputs=e0 + 2 * e1) == int((value > 7 and e0) or e1)


def test_a_jump_backwards_makes_a_loop() -> None:
    """1 + 2 + .. + 10."""
    bench = Bench(
        "L KB 10; T MB 40; L KB 0; T MW 42; UP: L MW 42; L MB 40; +F; T MW 42; "
        "L MB 40; D 1; T MB 40; L KF 0; +F; SPN =UP"
    )
    bench.run()
    assert bench.word(42) == 55


def test_increments_stay_in_the_low_byte_and_leave_the_condition() -> None:
    bench = Bench("L KF 0; L KF 0; +F; L KH 12FF; I 1; T MW 40; SPZ =ON; L KB 1; T MB 44; ON: NOP0")
    bench.run()
    assert (bench.word(40), bench.memory.m[44]) == (0x1200, 0)


# ---- brackets and results --------------------------------------------------------------------------------------------


def test_eight_brackets() -> None:
    """and (or-not (and (...))) eight deep: worked out from the innermost."""
    opened = "U(; O E 0.0; O(; U E 0.1; " * 4
    bench = Bench(opened + "U E 0.2; " + "); " * 8 + "= A 0.0")
    for a, b, c in itertools.product((False, True), repeat=3):
        value = c
        value = a or (b and value)  # the innermost pair; those around it are the same again
        for _ in range(3):
            value = a or (b and value)
        assert bench.run(inputs=a + 2 * b + 4 * c) == int(value)


def test_an_assignment_in_a_bracket_is_of_the_bracket() -> None:
    bench = Bench("U E 0.0; U(; O E 0.1; O E 0.2; = A 0.1; ); = A 0.0")
    for e0, e1, e2 in itertools.product((0, 1), repeat=3):
        inner = e1 or e2
        assert bench.run(inputs=e0 + 2 * e1 + 4 * e2) >> 1 & 1 == inner


def test_set_and_reset_want_a_result_and_leave_it() -> None:
    bench = Bench("U E 0.0; S A 0.0; R A 0.1; = A 0.2; UN E 0.0; R A 0.0; S A 0.1")
    assert [bench.run(inputs=i) for i in (0, 1, 0)] == [0b010, 0b101, 0b010]


def test_a_conditional_end_leaves_the_result_on() -> None:
    """BEB that does not end: what is assigned behind it is 1."""
    bench = Bench("U E 0.0; BEB; = A 0.0; = A 0.1")
    assert bench.run(inputs=0) == 3
    bench.memory.a[0] = 0
    assert bench.run(inputs=1) == 0


def test_a_conditional_call_leaves_the_result_on() -> None:
    program = assemble("OB 1\nU E 0.0\nSPB PB 1\n= A 0.0\nBE\nPB 1\nU E 0.1\n= A 0.1\nBE\n")
    processor, elements = Processor(program, {}), Elements()
    for inputs, expected in ((0, 1), (1, 0), (3, 3)):  # called, the result is that of the block
        memory = PlcMemory()
        memory.e[0] = inputs
        processor.run("OB", 1, memory, elements, 0)
        assert memory.a[0] == expected


@pytest.mark.parametrize("lines", ["L EW 46; T AW 46", "L DW 127; T MW 254", "L DL 127; T AB 47"])
def test_the_last_of_each_area(lines: str) -> None:
    bench = Bench(lines)
    bench.memory.e[46:48] = bench.memory.d[254:256] = b"\x12\x34"
    bench.run()
    assert 0x34 in (bench.memory.a[47], bench.memory.m[255])


# ---- images ----------------------------------------------------------------------------------------------------------

GOOD = assemble("OB 1\nU E 0.0\n= A 0.0\nBE\nPB 2\nBE\n").image


def entry(kind: int = 1, number: int = 1, offset: int = 10, length: int = 2) -> bytes:
    return bytes([kind, number]) + offset.to_bytes(2, "little") + length.to_bytes(2, "little")


def test_the_image_is_as_said() -> None:
    """53 35 01, two blocks: kind, number, offset, length; then the code."""
    assert GOOD.hex(" ") == ("53 35 01 02 01 01 10 00 06 00 02 02 16 00 02 00 c0 00 d8 80 65 00 65 00")


@pytest.mark.parametrize(
    "image",
    [
        pytest.param(b"", id="nothing"),
        pytest.param(b"\x53\x35\x01", id="no number of blocks"),
        pytest.param(b"\x53\x35\x02" + GOOD[3:], id="another version"),
        pytest.param(b"\x54" + GOOD[1:], id="another beginning"),
        pytest.param(GOOD[:9], id="list cut off"),
        pytest.param(GOOD[:-1], id="code cut off"),
        pytest.param(GOOD[:-2], id="last block cut off"),
        pytest.param(GOOD[:-2] + b"\x00\x00", id="no BE at the end"),
        pytest.param(b"\x53\x35\x01\x01" + entry(kind=5) + b"\x65\x00", id="kind of block unknown"),
        pytest.param(b"\x53\x35\x01\x01" + entry(kind=0) + b"\x65\x00", id="kind 0"),
        pytest.param(b"\x53\x35\x01\x01" + entry(offset=8) + b"\x65\x00", id="code within the list"),
        pytest.param(b"\x53\x35\x01\x01" + entry(offset=11) + b"\x65\x00", id="code behind the end"),
        pytest.param(b"\x53\x35\x01\x01" + entry(length=0) + b"\x65\x00", id="no code"),
        pytest.param(b"\x53\x35\x01\x01" + entry(length=3) + b"\x00\x65\x00", id="odd length"),
        pytest.param(b"\x53\x35\x01\x01" + entry(kind=2) + b"\x65\x00", id="no OB 1"),
        pytest.param(b"\x53\x35\x01\x00", id="no block"),
        pytest.param(b"\x53\x35\x01\x02" + entry(offset=16) * 2 + b"\x65\x00", id="a block twice"),
    ],
)
def test_an_image_that_is_none_is_refused_and_the_program_stays(image: bytes) -> None:
    plc = Plc(Rights(), {}, 4 * MS)
    plc.load(GOOD)
    with pytest.raises(ImageError):
        plc.load(image)
    assert plc.image == GOOD


def test_an_image_holds_65535_bytes() -> None:
    code = b"\x00\x00" * 32_759 + b"\x65\x00"
    assert len(PlcProgram.of([PlcBlock("OB", 1, code)]).image) == 65_530
    with pytest.raises(ImageError, match="65536"):
        PlcProgram.of([PlcBlock("OB", 1, code), PlcBlock("PB", 1, b"")])
    assert len(PlcProgram.of([PlcBlock("OB", 1, b"\x00\x00" * 2 + code)]).image) == 65_534


@pytest.mark.parametrize("code", ["04 00", "80", "34 20", "C0 30", "6D 05"])
def test_a_code_that_is_none_stops_it_when_it_comes_there(code: str) -> None:
    """Unknown; half a word; timer 32; input byte 48; a block that is not there."""
    processor = Processor(
        PlcProgram.of([PlcBlock("OB", 1, bytes.fromhex(code) + b"\x65\x00"[: 2 - len(code) % 2])]), {}
    )
    with pytest.raises(Halt):
        processor.run("OB", 1, PlcMemory(), Elements(), 0)


CODES = """U M 6.0 : 80 06; O M 6.1 : 89 06; S M 6.2 : 92 06; = M 6.3 : 9b 06; UN M 6.4 : a4 06; ON M 6.5 : ad 06
R M 6.6 : b6 06; U E 5.1 : c1 05; O E 5.1 : c9 05; S E 5.1 : d1 05; = A 5.1 : d9 85; UN E 5.1 : e1 05
ON A 5.1 : e9 85; R A 5.1 : f1 85; U T 3 : f8 03; O T 3 : f9 03; UN T 3 : fc 03; ON T 3 : fd 03
U Z 3 : b8 03; O Z 3 : b9 03; UN Z 3 : bc 03; ON Z 3 : bd 03; U( : ba 00; O( : bb 00; ) : bf 00
O : fb 00; SI T 3 : 34 03; SV T 3 : 1c 03; SE T 3 : 24 03; SS T 3 : 2c 03; SA T 3 : 14 03; R T 3 : 3c 03
ZV Z 3 : 6c 03; ZR Z 3 : 54 03; S Z 3 : 5c 03; R Z 3 : 7c 03; L KB 9 : 28 09; L EB 2 : 4a 02
L AB 2 : 4a 82; L EW 2 : 52 02; L MB 2 : 0a 02; L MW 2 : 12 02; L DW 2 : 32 02; L DL 2 : 22 02
L DR 2 : 2a 02; L T 2 : 02 02; L Z 2 : 42 02; L KH 1234 : 30 40 12 34; L KF 1 : 30 04 00 01
L KM 11 : 30 80 00 03; L KY 1,255 : 30 20 01 ff; L KT 050.1 : 30 02 10 50; L KZ 123 : 30 01 01 23
T AB 2 : 4b 82; T AW 2 : 53 82; T MB 2 : 0b 02; T MW 2 : 13 02; T DW 2 : 33 02; T DL 2 : 23 02
T DR 2 : 2b 02; !=F : 21 80; ><F : 21 60; >F : 21 20; >=F : 21 a0; <F : 21 40; <=F : 21 c0; +F : 79 00
-F : 59 00; I 5 : 11 05; D 5 : 19 05; UW : 41 00; OW : 49 00; XOW : 51 00; KEW : 01 00; KZW : 09 00
SLW 4 : 61 04; SRW 4 : 69 04; TAK : 70 02; SPA OB 2 : 6d 02; SPB OB 2 : 4d 02; SPA PB 2 : 75 02
SPB PB 2 : 55 02; SPA FB 2 : 3d 02; SPB FB 2 : 1d 02; SPA SB 2 : 7d 02; SPB SB 2 : 5d 02; A DB 2 : 20 02
BEA : 65 01; BEB : 05 00; NOP0 : 00 00; NOP1 : ff ff; STP : 70 03"""
"""Machine code of each instruction: the table that the decisions stand on, written down once more."""


@pytest.mark.parametrize("line", [line.strip() for line in CODES.replace("\n", "; ").split("; ")])
def test_the_code_of_an_instruction(line: str) -> None:
    text, code = line.split(" : ")
    assert assemble(f"OB 1\n{text}\nBE\n").image[10:-2].hex(" ") == code


@pytest.mark.parametrize(
    ("jump", "code"), [("SPA", "2d"), ("SPB", "fa"), ("SPZ", "45"), ("SPN", "35"), ("SPP", "15"), ("SPM", "25")]
)
def test_a_distance_is_in_words_from_the_jump(jump: str, code: str) -> None:
    """Forward over a constant of two words, backward onto itself."""
    assert assemble(f"OB 1\n{jump} =ON\nL KF 1\nON: NOP0\nBE\n").image[10:12].hex(" ") == f"{code} 03"
    assert assemble(f"OB 1\nUP: NOP0\n{jump} =UP\nBE\n").image[12:14].hex(" ") == f"{code} ff"


@pytest.mark.parametrize(
    ("store", "area", "at", "value"),
    [
        ("T MB 50", "m", 50, 0x34),
        ("T AB 20", "a", 20, 0x34),
        ("T DL 20", "d", 41, 0x34),
        ("T DR 20", "d", 40, 0x34),
    ],
)
def test_a_byte_is_stored_beside_its_neighbours(store: str, area: str, at: int, value: int) -> None:
    bench = Bench(f"L KH 1234; {store}")
    image = getattr(bench.memory, area)
    image[:] = b"\xee" * len(image)
    bench.run()
    assert image[at - 2 : at + 3] == bytes((0xEE, 0xEE, value, 0xEE, 0xEE))


@pytest.mark.parametrize(
    "operand", ["KY 1,256", "KY 256,1", "KF 32768", "KT 1000.0", "KT 1.4", "KZ 1000", "KB 256", "KH 10000"]
)
def test_a_constant_that_is_none_is_not_assembled(operand: str) -> None:
    with pytest.raises(ValueError, match=operand.split(" ")[1]):
        assemble(f"OB 1\nL {operand}\nBE\n")
