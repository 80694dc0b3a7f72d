"""BWO 900: a CNC that runs DIN 66025 programs on servo axes, after its manual.

    line, keys, inputs
        |
    control.py      host, inputs and clock: implements isel_twin.controller.Controller; ports.py
    commands.py     parameters that act as keys (keys.py); transfer.py: files on the line; feeder.py: fed programs
    operating.py    modes, Start, Stop, HAND, power; status.py: status in parameters
    execution.py    the program in execution: the channel's surroundings
    hardware.py     inputs, axes, power, machine_plc.py (spindle, coolant, tool change), outputs
    parameters.py, messages.py, memory.py (the flash), language.py
        |
    programs/       stored.py, feed.py: blocks as text        syntax.py, expressions.py: blocks read
        |
    analysis/       interpreter.py: blocks of a program to blocks of a path: stack.py, flow.py (calls), values.py,
        |           reader.py (G, M: said.py), targets.py (axes, circles), coordinates.py, tools.py, cycles/
        |
    geometry/       elements.py, blocks.py: elements of a path; frames.py; contour.py (G12, G123), offset.py (G41)
        |
    realtime/       surroundings.py: interfaces of the channel; ahead.py: waiting blocks; channel.py: states;
        |           path_run.py: the path under way: joining.py, stretch.py, path.py: its pieces;
        |           hand.py: moves without a program; axes.py, power.py, outgoing.py
        v
    set points (isel_twin.motion.joined), outputs, messages

docs/bwo900.md lists what is emulated, docs/decisions/bwo900.md what the manual leaves open.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from isel_twin.base.parameters import Limits
from isel_twin.controller import takes
from isel_twin.firmware.bwo900.readings import WORDS, readings_in_force, readings_of

if TYPE_CHECKING:
    from isel_twin.firmware.bwo900.control import Control

__all__ = ["create"]


@takes(
    {"plc_program": (), "nc_memory_bytes": Limits("byte", 1, 1e9, whole=True), **dict.fromkeys(WORDS, bool)},
    readings_in_force,
)
def create(name: str, *, flash: bytes | None, settings: Mapping[str, Any]) -> Control:
    """Entry point of `isel_twin.controllers`. Settings: `plc_program`, STEP 5 text in place of the default program;
    `nc_memory_bytes`, M1256 beyond it, unless set none; and the readings of readings.py."""
    from isel_twin.firmware.bwo900.control import Control

    text = settings.get("plc_program")
    memory_bytes = int(settings.get("nc_memory_bytes", 0))
    plc = None if text is None else str(text)
    return Control(flash, plc=plc, memory_bytes=memory_bytes, readings=readings_of(settings))
