"""BWO 900: a CNC that runs DIN 66025 programs on servo axes, after its manual.

    control.py      host, inputs and clock: implements isel_twin.controller.Controller; ports.py, outgoing.py, power.py
    operating.py    modes, Start, Stop, parameters that are keys
    axes.py         where the axes stand and may go; hand.py: moves without a program (jog.py, homing.py)
    transfer.py     programs and parameters over the line; programs.py, parameters.py, memory.py: what is kept
    syntax.py       blocks read; expressions.py
    interpreter.py  blocks to paths: stack.py (programs), values.py (expressions), reader.py (G, M: said.py),
                    targets.py (axes, circles), coordinates.py (frames), cycle.py (cycles/)
    blocks.py       what flows from there on; elements.py: lines and arcs
    ahead.py        analysis ahead of the real time: contour.py, offset.py; blocks that wait
    channel.py      real time, its phases; services.py: what it asks of the control
    stretch.py      the path under way: path.py makes pieces of blocks, isel_twin.motion.joined set points of pieces
    machine_plc.py  spindle, coolant, tool change
    keys.py         the operator's keys; status.py: what the control tells about itself in parameters
    messages.py     messages by number    language.py      what its bytes mean

docs/bwo900.md has what there is and what not, docs/decisions.md Z1... what the manual leaves open.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from isel_twin.controller import takes

if TYPE_CHECKING:
    from isel_twin.firmware.bwo900.control import Control

__all__ = ["create"]


@takes({"plc_program": ()})
def create(name: str, *, flash: bytes | None, settings: Mapping[str, Any]) -> Control:
    """Entry point of `isel_twin.controllers`. Settings: `plc_program`, STEP 5 text in place of the default program."""
    from isel_twin.firmware.bwo900.control import Control

    text = settings.get("plc_program")
    return Control(flash, plc=None if text is None else str(text))
