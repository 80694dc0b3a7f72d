"""Where a block leads to: jumps, calls, loops, ends (manual 6).

M23, comparison    M28, G of a Z program, Z5    M24, M25        M02, M29, M30
go to a block      one level more               pass by pass    a level less; the main program ends, or begins again
"""

from __future__ import annotations

from isel_twin.firmware.bwo900.analysis.output import Output
from isel_twin.firmware.bwo900.analysis.said import Said
from isel_twin.firmware.bwo900.analysis.stack import Goal, Level, Stack
from isel_twin.firmware.bwo900.geometry.blocks import Stop


def lead_on(stack: Stack, output: Output, goal: Goal | None, said: Said, level: Level) -> None:
    """Carry out what comes last in a block. goal: of a jump that is made now; level: of the block. With an M function
    with a jump in it, jump and call wait for its acknowledgement. Raises ProgramError for an unknown goal."""
    if goal is not None:
        stack.go(goal)
    elif said.call is not None and said.jump is None:
        stack.call(*said.call, change=said.changes)
    if said.hidden:
        stack.call("Z5", None, None, change=False)
    if said.passes is not None:
        level.open_loop(said.passes)
    if said.loops_back:
        level.close_loop()
    if said.stop in (Stop.END, Stop.REPEAT) or said.returns:
        _leave(stack, output, said, level)


def _leave(stack: Stack, output: Output, said: Said, level: Level) -> None:
    """M02, M29, M30: a subprogram ends; the main program ends, or begins again."""
    if stack.is_subprogram(level):
        if output.ready and output.ready[-1].stop in (Stop.END, Stop.REPEAT):
            output.restop(Stop.NONE)
        level.leave()
    elif said.stop is Stop.REPEAT:
        level.repeat()
    else:
        if output.ready and output.ready[-1].stop is Stop.NONE:
            output.restop(Stop.END)
        stack.clear()
