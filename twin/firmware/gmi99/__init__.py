"""The GMI99 interpolation card for servo drives: six axes, set points every 4 ms, DIN 19244, after its manual.

    controller.py   host, inputs and clock: implements isel_twin.controller.Controller
    link.py         frames both ways, DIL switches
    commands.py     every command, as one table; instruction.py: one with its parameters
    sequencer.py    order, barriers, buffer of 100 moves
    queue.py        waiting commands, programs and command in progress; waiting.py: what it waits for interpolator.py
    moves to set points: planner.py, circle.py; hold, go on, break off
    actions.py      commands that set, wait, reference     queries.py    T
    corrections.py  G; offsets.py: zero points             directly.py   p10: direct inputs and outputs
    programming.py  p: programs; store.py: the program store
    images.py       process images, flags, data words
    logic.py        the PLC of the folder beside this one on them, FB 254
    drives.py       the drives
    settings.py     settings of the host, and the flash image
    board.py        the card's state, shared by all these
    device.py       the card: the parts that work on it, for commands and controller

docs/gmi99.md lists the commands and what is not emulated, docs/decisions/gmi99.md what the manual leaves open.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from isel_twin.base.parameters import Limits
from isel_twin.controller import takes
from isel_twin.firmware.gmi99.controller import Gmi99
from isel_twin.firmware.gmi99.drives import TURN
from isel_twin.firmware.gmi99.link import Dil
from isel_twin.firmware.gmi99.logic import new_card
from isel_twin.firmware.gmi99.settings import Stored

__all__ = ["Gmi99", "create"]

POT_PERCENT = 0, 125
TURNS = 4, 10_000_000
REV_MIN = 0, 0xFFFF


@takes(
    {
        "dil_switches": (),
        "host_parity": ("even", "none"),
        "override_pot_percent": Limits("%", *POT_PERCENT, whole=True),
        "drive_increments_per_rev": Limits("", *TURNS, whole=True),
        "safety_program": bool,
        "spindle_rev_min": Limits("1/min", *REV_MIN, whole=True),
    }
)
def create(name: str, *, flash: bytes | None, settings: Mapping[str, Any]) -> Gmi99:
    """Entry point of `isel_twin.controllers`. Raises ValueError for a wrong setting.

    dil_switches               eight characters, switch 1 first, 1 on (11111111: address 224, variant E, 38400 Bd)
    host_parity                even (default) or none
    override_pot_percent       position of the potentiometer, 0 .. 125 (100)
    drive_increments_per_rev   from one zero pulse of the encoders to the next (5000)
    safety_program             whether a card without flash image has a program for its PLC (no)
    spindle_rev_min            for that program: speed of the spindle at 10 V of the analog output; 0 for none (0)
    """
    pot = settings.get("override_pot_percent", 100)
    if isinstance(pot, bool) or not isinstance(pot, int) or not POT_PERCENT[0] <= pot <= POT_PERCENT[1]:
        raise ValueError(f"{name}: override_pot_percent is {pot!r}; allowed: a whole number from 0 to 125")
    turn = settings.get("drive_increments_per_rev", TURN)
    if isinstance(turn, bool) or not isinstance(turn, int) or not TURNS[0] <= turn <= TURNS[1]:
        raise ValueError(f"{name}: drive_increments_per_rev is {turn!r}; allowed: a whole number from {TURNS[0]} on")
    parity = settings.get("host_parity", "even")
    if parity not in ("even", "none"):
        raise ValueError(f"{name}: host_parity is {parity!r}; allowed: even, none")
    try:
        dil = Dil(str(settings.get("dil_switches", "11111111")))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    safety = settings.get("safety_program", False)
    if not isinstance(safety, bool):
        raise ValueError(f"{name}: safety_program is {safety!r}; allowed: true, false")
    rev_min = settings.get("spindle_rev_min", 0)
    if isinstance(rev_min, bool) or not isinstance(rev_min, int) or not REV_MIN[0] <= rev_min <= REV_MIN[1]:
        raise ValueError(f"{name}: spindle_rev_min is {rev_min!r}; allowed: a whole number from 0 to {REV_MIN[1]}")
    new = new_card(rev_min) if safety else Stored()
    return Gmi99(flash, dil, parity="E" if parity == "even" else "N", override_pot_percent=pot, turn=turn, new=new)
