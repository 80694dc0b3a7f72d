"""Plain blocks on the short way, lines in columns: to the bit what the way of all blocks makes of them.

The general way is the same control with the short way taken out of it.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest
from firmware.bwo900.random_programs import WORDS
from firmware.bwo900.run import Analysed

from isel_twin.firmware.bwo900.analysis.functions import FACTORY_FUNCTIONS
from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.analysis.plain import Plain
from isel_twin.firmware.bwo900.analysis.stack import Level
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.feed import Feed
from isel_twin.firmware.bwo900.programs.stored import Store, StoredProgram
from isel_twin.firmware.bwo900.realtime import path
from isel_twin.firmware.bwo900.realtime.ahead import Filter, filters, run
from isel_twin.firmware.bwo900.realtime.path import MotionLimits, PieceMaker

PLAIN = ("X{0}", "Y{1}", "X{0} Y{1}", "X{0}Y{1}Z{2}", "Z{2}", "X{0} F{3}", "X{0} Y{1} Z{2} F{3}", "F{3}", "X-0 Y+0.")
OTHERS = """
    G0 G1 G1 G1 G2 G54 G53 G90 G91 G92 G61 G62 G60 G45 G46 G41 G42 G40 G18 G17 G63 G64 G28 G29 G9 G8 G10 G11 G44 G43
    G81 G80 G12 G66 T1 T2 M06 M3 M26 M01 M24.2 M25 M28.2 P1:5 P160:10 P163:30 P30:1 P1>2.40 X5 R20 sc:1 sc:100 P8830:54
    tr:3 tl:5 S500 !said G04.1
"""


MOST = 150  # blocks that are analysed


@contextmanager
def general_way() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Plain, "run", lambda *_: [])
        patch.setattr(path, "MANY", 1 << 60)
        yield


def program(chance: random.Random) -> dict[str, list[str]]:
    """Runs of plain blocks with others between them, which may jump into them, call, loop or fail."""

    others, share = OTHERS.split(), chance.choice((0.75, 0.96))

    def block(number: int) -> str:
        places = [f"{chance.uniform(-30, 30):.{chance.randint(0, 4)}f}" for _ in range(3)]
        feed = chance.choice((600, 1200, "800.5"))
        if chance.random() < share:
            return f"N{number} " + chance.choice(PLAIN).format(*places, feed)
        words = chance.choice((others, others, others, WORDS))
        return f"N{number} " + " ".join(chance.choice(words) for _ in range(chance.randint(0, 3)))

    first = ["N1 G1 F1000 X1 P1:0", *(block(10 * n) for n in range(1, chance.randint(10, 40))), "N900 M30"]
    return {"P1": first, "P2": [*(block(10 * n) for n in range(1, 8)), "N100 M02"]}


def through(stages: Sequence[Filter], block: PathBlock) -> list[PathBlock]:
    out = [block]
    for stage in stages:
        out = [made for one in out for made in stage.push(one)]
    return out


def operate(chance: random.Random, interpreter: Interpreter, parameters: Parameters) -> None:
    """The axes are moved, a zero point or another parameter is written."""
    match chance.randint(0, 2):
        case 0:
            interpreter.stand((chance.random(), 2.0, 3.0))
        case 1:
            parameters.write(20_000 + chance.randint(0, 11), chance.random(), "q")
        case _:
            number, value = chance.choice(((8_892, 1.0), (8_880, 0.0), (8_818, 50.0), (8_892, None)))
            parameters.write(number, value)
            interpreter.command(number, value, in_hand=False)


def told(programs: dict[str, list[str]], seed: int, fed: bool) -> list[str]:
    """All blocks, messages and pieces, as text in which -0.0 is not 0.0. Between blocks the axes may be moved, and
    parameters written, as by an operator."""
    chance, said, planned = random.Random(seed), [], []
    parameters, store = Parameters(), Store()
    for number, value in {**FACTORY_FUNCTIONS, 21_000: 1.0, 21_020: 2.0, 21_030: 3.0}.items():
        parameters.write(number, value)
    for number, value in enumerate((1.5, -0.25, 3.1, 0.0, 0.1, 0.3, 7.7, 1e-3, -4.0, -0.0, 0.0, 2.0)):
        parameters.write(20_000 + number, value, "q")
    for name, blocks in programs.items():
        store[name] = StoredProgram.of(name, blocks)
    if fed:
        store.feed = Feed("P1")
        for number, line in enumerate(programs["P1"]):
            store.feed.add(number, line)
        store.feed.end()
    interpreter = Interpreter(parameters, store)
    interpreter.begin("P1", (0.0, 0.0, 0.0))
    maker, stages, batch = (
        PieceMaker(MotionLimits.of(parameters, (1000.0,) * 3), (0.0, 0.0, 0.0)),
        filters(parameters),
        [],
    )
    sizes = random.Random(seed)
    operated = sorted(chance.sample(range(1, MOST), MOST // 16))
    done = 0
    while done < MOST:
        try:
            room = next((at for at in operated if at > done), MOST) - done
            plain = run(interpreter, stages, sizes.randint(1, room))
            batch += plain
            said += [f"{block!r} {block.target!r}" for block in plain]
            done += len(plain)
            if not plain:
                made, done = interpreter.next(), done + 1
                at = made.target if isinstance(made, PathBlock) and made.elements else interpreter.program_position
                said.append(f"{made!r} {at!r}")
                if made is Waiting.EXECUTION:
                    interpreter.executed()
                elif made is Waiting.ACKNOWLEDGEMENT:
                    interpreter.acknowledged(jumps=chance.random() < 0.5)
                elif made is Waiting.BEGINNING:
                    interpreter.begun()
                elif isinstance(made, PathBlock):
                    batch += through(stages, made)
                    if made.stop is Stop.END:
                        break
                else:
                    break
            if done in operated:
                said.append(f"{interpreter.program_position!r} {interpreter.stack.place}")
                operate(chance, interpreter, parameters)
            while len(batch) > 12:
                columns, counts = maker.pieces(batch[:13])
                planned.append(repr((counts, [column.tolist() for column in columns.columns], len(columns.curves))))
                batch = batch[13:]
        except ProgramError as error:
            said.append(f"{error.number} {error.column} {error.detail} {error.place} {interpreter.stack.place}")
            break
    said.append(f"{interpreter.program_position!r} {interpreter.stack.place} {fed and store.feed.level}")
    return [*said, *planned]


@pytest.mark.parametrize("fed", [False, True], ids=["stored", "fed"])
def test_random_programs_come_to_the_same_either_way(fed: bool) -> None:
    taken: list[int] = []
    short_way = Plain.run

    def counted(plain: Plain, level: Level, most: int) -> list[PathBlock]:
        made = short_way(plain, level, most)
        taken.append(len(made))
        return made

    for seed in range(40):
        programs = program(random.Random(seed))
        with general_way():
            expected = told(programs, seed, fed)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Plain, "run", counted)
            assert told(programs, seed, fed) == expected, programs
    assert sum(taken) > 300
    assert sum(size > 3 for size in taken) > 20


def test_a_jump_behind_a_plain_block_makes_no_pattern() -> None:
    """What was executed counts, not what stands before the place that follows."""
    text = "N1 G1 F600 X1 P1:0\nN10 X2 P1:P1+1 P1<2.30 G9\nN20 Y1\nN30 X3\nN40 X4\nN50 M30"
    with general_way():
        expected = Analysed(text).blocks
    assert Analysed(text).blocks == expected


@pytest.mark.parametrize(
    "text",
    [
        "N10 X10 Y10 F600",
        "N10X10Y10",
        "N10 X1.123456 Y-2.5",
        "N10 F900",
        "N10 X0 Y0",
        "N10 X10 ; Y5",
        "/N10 X10",
        "X10",
    ],
)
def test_each_form_of_a_plain_block_comes_to_the_same(text: str) -> None:
    programs = f"N1 G1 F600 X1\nN5 X2\n{text}\nN20 X7 Y7 Z7\nN30 M30"
    with general_way():
        expected = Analysed(programs).blocks
    assert repr(Analysed(programs).blocks) == repr(expected)
