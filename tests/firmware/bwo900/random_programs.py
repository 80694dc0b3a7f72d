"""Random programs, right and wrong: a message or a run, never anything else.

    python tests/firmware/bwo900/random_programs.py 100000      so many, analysed and planned

Blocks of words of the manual in any order, two programs that call each other, some with characters changed.
"""

from __future__ import annotations

import random
import sys
from collections import Counter

from isel_twin.firmware.bwo900.analysis.functions import FACTORY_FUNCTIONS
from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.stored import Store, StoredProgram
from isel_twin.firmware.bwo900.realtime.ahead import filters
from isel_twin.firmware.bwo900.realtime.path import MotionLimits, PieceMaker

TEXT = """
    G0 G1 G2 G3 G04.1 G8 G9 G10 G11 G12 G17 G18 G19 G28 G29 G40 G41 G42 G43 G44 G45 G46 G47 G48 G53 G54 G60 G61
    G62 G63 G64 G66 G71 G72 G73 G74 G75 G81 G83 G84 G85 G86 G87 G88 G89 G90 G91 G92 G94 G97 G117 G123 G147 G153
    G154 M00 M01 M02 M03 M06 M16 M23.10 M23.20 M24.2 M25 M28.2 M28..20 M28.2.10_20 M29 M30 T1 T2 t:1 tr:3 tl:5
    F1000 f100 F0 S1000 X10 X-20 Y5 Y:P1 Z1 Z-3 I5 J5 K1 R10 R-7 x:10 c:45 P1:5 P1:P1+1 P1: -- P70:3 P71:2
    P160:10 P163:30 P165:5 P168:30 P30:1 P32:500 P33:0 P34:5 P35:9 P36:2 P100:30 P101:20 P106:3 P110:10 P111:30
    P116:2 P120:5 P122:30 P123:10 P126:4 P11:60 P12:40 P13:5 P14:6 P16:4 P17:2 P19:1 P1>5.20 P1=1.10 _a:=3
    _a::=5 X:_a P(P1):3 P1:sin(P1) P1:1/0 P1:sqr(-1) q170:2 P8830:54 !hello waituntil(P1>0) sc:1 P8859:2
    P8845:90 / \\\\ ( ) $1F; -- . : , P99999 G1234 M999 A5 X1e9 X99999999999
"""
WORDS = TEXT.split()
MOST_BLOCKS = 300
"""Analysed of one program: an endless loop is left after these."""


def program(seed: int) -> dict[str, list[str]]:
    """Blocks of P1 and P2."""
    chance = random.Random(seed)

    def block(number: int) -> str:
        return f"N{number} " + " ".join(chance.choice(WORDS) for _ in range(chance.randint(0, 6)))

    head = ["N1 G1 F1000 S100 M3 P1:0"] if chance.random() < 0.7 else []
    first = [*head, *(block(10 * n) for n in range(1, chance.randint(2, 13))), "N900 M30"]
    second = [*(block(10 * n) for n in range(1, chance.randint(2, 5))), "N100 M02"]
    if chance.random() < 0.4:
        for _ in range(chance.randint(1, 4)):
            place = chance.randrange(len(first))
            text, at = first[place], chance.randrange(len(first[place]))
            other = text[at:] if chance.random() < 0.3 else chr(chance.randint(32, 126))
            first[place] = text[:at] + (other if chance.random() < 0.6 else "") + text[at + 1 :]
    return {"P1": first, "P2": second}


def outcome(programs: dict[str, list[str]]) -> str:
    """The number of the message that ends it, "end" or "more"."""
    parameters, store = Parameters(), Store()
    for number, value in {**FACTORY_FUNCTIONS, 21_000: 1.0, 21_020: 2.0, 21_030: 3.0}.items():
        parameters.write(number, value)
    interpreter, stages = Interpreter(parameters, store), filters(parameters)
    path = PieceMaker(MotionLimits.of(parameters, [1000.0] * 3), (0.0, 0.0, 0.0))

    def through(blocks: list[PathBlock], first: int) -> None:
        for stage in stages[first:]:
            blocks = [out for block in blocks for out in stage.push(block)]
        if blocks:
            path.pieces(blocks)

    def flush() -> None:
        for number, stage in enumerate(stages):
            through(stage.flush(), number + 1)

    try:
        for name, blocks in programs.items():
            store[name] = StoredProgram.of(name, blocks)
        interpreter.begin("P1", (0.0, 0.0, 0.0))
        for _ in range(MOST_BLOCKS):
            block = interpreter.next()
            interpreter.notes.clear()
            if isinstance(block, PathBlock):
                through([block], 0)
                for number, value in block.parameters:
                    parameters.write(number, value)
            if block is None or (isinstance(block, PathBlock) and block.stop is Stop.END):
                flush()
                return "end"
            if isinstance(block, Waiting):
                flush()
                interpreter.executed()
                interpreter.acknowledged(jumps=False)
                interpreter.begun()
    except ProgramError as error:
        return f"M{error.number}"
    return "more"


if __name__ == "__main__":
    print(Counter(outcome(program(seed)) for seed in range(int(sys.argv[1]))).most_common())
