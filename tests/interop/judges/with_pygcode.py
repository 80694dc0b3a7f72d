"""Moves that pygcode's machine makes of the G-code of standard input, as JSON; run by a Python that has pygcode."""

import json
import sys

from pygcode import Line, Machine
from pygcode.gcodes import GCodeArcMove, GCodeLinearMove, GCodeRapidMove

machine, moves = Machine(), []
for text in sys.stdin:
    block = Line(text.strip()).block
    before = dict(machine.pos.values)
    machine.process_block(block)
    to, feed = machine.pos.values, machine.mode.feed_rate.word.value
    motions = [
        code for code in machine.mode.gcodes if isinstance(code, GCodeRapidMove | GCodeLinearMove | GCodeArcMove)
    ]
    if not any(word.letter in "XYZ" for word in block.words):
        continue
    end = [to["X"], to["Y"], to["Z"]]
    (code,) = motions
    if isinstance(code, GCodeArcMove):
        ways = {word.letter: word.value for word in block.words}
        centre = before["X"] + ways.get("I", 0.0), before["Y"] + ways.get("J", 0.0)
        moves.append(["arc", *end, *centre, 2, 1 if code.word_key.value == 3 else -1, feed])
    elif isinstance(code, GCodeRapidMove):
        moves.append(["rapid", *end])
    else:
        moves.append(["line", *end, feed])
print(json.dumps(moves))
