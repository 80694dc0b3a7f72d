"""Instructions of a PLC: expected values from truth tables, from the worked examples of STEP 5, and closed forms."""

from __future__ import annotations

import itertools

import pytest

from isel_twin.firmware.plc import PlcMemory
from isel_twin.firmware.plc.assembler import assemble
from isel_twin.firmware.plc.processor import Elements, Halt, Pass, Processor

SECOND = 1_000_000_000


class Bench:
    """A program and a memory; a pass on demand."""

    def __init__(self, text: str, functions: dict | None = None) -> None:
        self.processor = Processor(assemble(text), functions or {})
        self.memory, self.elements = PlcMemory(), Elements()

    def run(self, now_ns: int = 0, inputs: int = 0) -> Pass:
        self.memory.e[0] = inputs
        return self.processor.run("OB", 1, self.memory, self.elements, now_ns)

    def word(self, flag: int) -> int:
        return self.memory.m[flag] + 256 * self.memory.m[flag + 1]


def of(lines: str) -> Bench:
    """OB 1 of instructions parted by commas."""
    return Bench("OB 1\n" + lines.replace("; ", "\n") + "\nBE\n")


LOGIC = {
    "U E 0.0; U E 0.1; O; U E 0.2; U E 0.3; = A 0.0": lambda a, b, c, d: (a and b) or (c and d),
    "U(; O E 0.0; O E 0.1; ); UN E 0.2; = A 0.0": lambda a, b, c, d: (a or b) and not c,
    "U E 0.0; O E 0.1; U E 0.2; = A 0.0": lambda a, b, c, d: (a or b) and c,
    "ON E 0.0; ON E 0.1; = A 0.0": lambda a, b, c, d: not a or not b,
    "U E 0.0; O(; U E 0.1; UN E 0.2; ); = A 0.0": lambda a, b, c, d: a or (b and not c),
    "U E 0.0; O; U(; O E 0.1; O E 0.2; ); U E 0.3; = A 0.0": lambda a, b, c, d: a or ((b or c) and d),
    "U(; U(; O E 0.0; O E 0.1; ); U E 0.2; ); ON E 0.3; = A 0.0": lambda a, b, c, d: ((a or b) and c) or not d,
    "U E 0.0; = A 0.1; U E 0.1; = A 0.0": lambda a, b, c, d: b,
}


@pytest.mark.parametrize("text", LOGIC)
def test_logic_against_its_truth_table(text: str) -> None:
    bench = of(text)
    for bits in itertools.product((False, True), repeat=4):
        bench.run(inputs=sum(bit << i for i, bit in enumerate(bits)))
        assert bool(bench.memory.a[0] & 1) is bool(LOGIC[text](*bits)), bits


def test_a_chain_goes_on_with_several_assignments() -> None:
    bench = of("U E 0.0; = A 0.0; = A 0.1; S M 40.0; R M 40.1")
    bench.memory.m[40] = 2
    bench.run(inputs=1)
    assert bench.memory.a[0] == 3
    assert bench.memory.m[40] == 1


def test_a_latch_in_which_reset_wins() -> None:
    bench = of("U E 0.0; S M 30.0; U E 0.1; R M 30.0")
    states = []
    for inputs in (1, 0, 2, 0, 3, 0):
        bench.run(inputs=inputs)
        states.append(bench.memory.m[30])
    assert states == [1, 1, 0, 0, 0, 0]


def test_words_have_their_low_byte_first() -> None:
    bench = of("L KH 1234; T MW 40; L MB 40; T AB 1; L KY 1,2; T DW 5; L DL 5; T MB 50; L DR 5; T MB 51")
    bench.run()
    assert (bench.memory.m[40], bench.memory.m[41], bench.memory.a[1]) == (0x34, 0x12, 0x34)
    assert (bench.memory.m[50], bench.memory.m[51]) == (1, 2)
    assert bench.memory.d[10:12] == bytes((2, 1))


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("L KF 1000; L KF 234; -F", 766),
        ("L KF -1; L KF 2; +F", 1),
        ("L KF 32767; L KF 1; +F", 0x8000),
        ("L KH F0F0; L KH FF00; UW", 0xF000),
        ("L KH F0F0; L KH FF00; OW", 0xFFF0),
        ("L KH F0F0; L KH FF00; XOW", 0x0FF0),
        ("L KH 00F0; SLW 4", 0x0F00),
        ("L KH 8001; SRW 1", 0x4000),
        ("L KH 8001; SLW 1", 2),
        ("L KH 1234; KEW", 0xEDCB),
        ("L KF 5; KZW", 0xFFFB),
        ("L KH 12FF; I 2", 0x1201),
        ("L KH 1201; D 2", 0x12FF),
        ("L KF 1; L KF 2; TAK", 1),
        ("L KM 101", 5),
        ("L KZ 123", 0x123),
        ("L KT 050.1", 0x1050),
        ("L KB 200", 200),
    ],
)
def test_words(text: str, result: int) -> None:
    bench = of(f"{text}; T MW 40")
    bench.run()
    assert bench.word(40) == result


@pytest.mark.parametrize(("first", "second"), [(5, 7), (7, 5), (5, 5), (-1, 1), (-2, -1)])
def test_comparisons_are_of_accumulator_2_with_1(first: int, second: int) -> None:
    signs = {"!=F": first == second, "><F": first != second, ">F": first > second}
    signs |= {">=F": first >= second, "<F": first < second, "<=F": first <= second}
    for sign, expected in signs.items():
        bench = of(f"L KF {first}; L KF {second}; {sign}; = A 0.0; U E 0.0; = A 0.1")
        bench.run()
        assert bench.memory.a[0] == int(expected), sign


@pytest.mark.parametrize(
    ("jump", "taken"),
    [("SPZ", (0,)), ("SPN", (-3, 3)), ("SPP", (3,)), ("SPM", (-3,)), ("SPA", (-3, 0, 3))],
)
def test_jumps_by_a_result(jump: str, taken: tuple[int, ...]) -> None:
    for value in (-3, 0, 3):
        bench = of(f"L KF {value}; L KF 0; +F; {jump} =ON; L KB 1; T MB 40; ON: NOP0")
        bench.run()
        assert (bench.memory.m[40] == 0) is (value in taken), value


def test_a_conditional_jump_leaves_the_result_on() -> None:
    bench = of("U E 0.0; SPB =ON; = M 40.0; ON: = M 40.1")
    bench.run(inputs=0)
    assert bench.memory.m[40] == 3
    bench.memory.m[40] = 0
    bench.run(inputs=1)
    assert bench.memory.m[40] == 2


def test_blocks_are_called_and_left() -> None:
    bench = Bench(
        "OB 1\nU E 0.0\nSPB PB 3\nSPA FB 7\nBE\nPB 3\nL KB 1\nT MB 40\nBE\nFB 7\nU E 0.1\nBEB\nL KB 2\nT MB 41\nBEA\nBE"
    )
    assert bench.run(inputs=0).executed == 3 + 1 + 5
    assert (bench.memory.m[40], bench.memory.m[41]) == (0, 2)
    bench.memory.m[41] = 0
    bench.run(inputs=3)
    assert (bench.memory.m[40], bench.memory.m[41]) == (1, 0)


def test_sixteen_levels_and_no_more() -> None:
    def nested(levels: int) -> Bench:
        blocks = [f"PB {n}\nSPA PB {n + 1}\nBE" for n in range(1, levels - 1)]
        return Bench("\n".join(["OB 1\nSPA PB 1\nBE", *blocks, f"PB {levels - 1}\nL KB 1\nT MB 40\nBE"]))

    bench = nested(16)
    bench.run()
    assert bench.memory.m[40] == 1
    with pytest.raises(Halt, match="17th level"):
        nested(17).run()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("SPA PB 9", "PB 9"),
        ("STP", "STP"),
        ("LOOP: SPA =LOOP", "no end"),
        (")", "not opened"),
        ("; ".join(["U("] * 9), "8 brackets"),
    ],
)
def test_what_stops_the_plc(text: str, why: str) -> None:
    with pytest.raises(Halt, match=why):
        of(text).run()


def test_an_unknown_code_stops_it() -> None:
    from isel_twin.firmware.plc import PlcBlock, PlcProgram

    processor = Processor(PlcProgram.of([PlcBlock("OB", 1, bytes.fromhex("04 00 65 00"))]), {})
    with pytest.raises(Halt, match="word 0"):
        processor.run("OB", 1, PlcMemory(), Elements(), 0)


def test_a_built_in_function_changes_the_accumulators() -> None:
    bench = Bench("OB 1\nL KF 3\nL KF 6\nSPA FB 254\nT MW 40\nTAK\nT MW 42\nBE", {254: lambda a, b, m: (a * 10, b + 1)})
    assert bench.run().live
    assert (bench.word(40), bench.word(42)) == (60, 4)


DIAGRAM = {
    "SI": "0111100000 0110000000",
    "SV": "0111100000 0111100000",
    "SE": "0000011100 0000000000",
    "SS": "0000011111 0000011111",
    "SA": "0111111111 0111111000",
}
"""Bit of a timer of four units, unit by unit: the result on in units 1 to 7 and off, or on in 1 and 2 only."""


@pytest.mark.parametrize("kind", DIAGRAM)
@pytest.mark.parametrize("run", [0, 1])
def test_timers_as_in_the_diagram(kind: str, run: int) -> None:
    bench = of(f"U E 0.0; L KT 004.2; {kind} T 3; U T 3; = A 0.0")
    on = range(1, 8) if run == 0 else range(1, 3)
    bits = ""
    for unit in range(10):
        bench.run(unit * SECOND + SECOND // 2, inputs=int(unit in on))
        bits += str(bench.memory.a[0])
    assert bits == DIAGRAM[kind].split()[run]


@pytest.mark.parametrize(("base", "unit_ms"), [(0, 10), (1, 100), (2, 1000), (3, 10_000)])
def test_units_of_timers(base: int, unit_ms: int) -> None:
    bench = of(f"U E 0.0; L KT 123.{base}; SE T 0; U T 0; = A 0.0; L T 0; T MW 40")
    bench.run(0, inputs=1)
    assert bench.word(40) == 123
    end_ns = 123 * unit_ms * 1_000_000
    bench.run(end_ns - 1, inputs=1)
    assert (bench.memory.a[0], bench.word(40)) == (0, 1)
    bench.run(end_ns, inputs=1)
    assert (bench.memory.a[0], bench.word(40)) == (1, 0)


def test_a_stored_delay_ends_by_reset_only() -> None:
    bench = of("U E 0.0; L KT 001.0; SS T 5; U E 0.1; R T 5; U T 5; = A 0.0")
    bench.run(0, inputs=1)
    bench.run(SECOND, inputs=0)
    assert bench.memory.a[0] == 1
    bench.run(SECOND, inputs=2)
    assert bench.memory.a[0] == 0


def test_counters_count_edges_between_0_and_999() -> None:
    bench = of(
        "U E 0.2; L KZ 998; S Z 7; U E 0.0; ZV Z 7; U E 0.1; ZR Z 7; U E 0.3; R Z 7; L Z 7; T MW 40; U Z 7; = A 0.0"
    )
    counts = []
    for inputs in (2, 1, 1, 0, 1, 4, 1, 0, 1, 2, 0, 2, 8):
        bench.run(inputs=inputs)
        counts.append((bench.word(40), bench.memory.a[0]))
    values = [value for value, _ in counts]
    assert values == [0, 1, 1, 1, 2, 998, 999, 999, 999, 998, 998, 997, 0]
    assert [on for _, on in counts] == [int(value > 0) for value in values]
