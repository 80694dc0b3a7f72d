"""The safety chain in the firmware: three states, and what each forbids. The hardware (safety relay, hood lock) works
without it; this state machine reads their contacts, drops the controller's own enable signals and refuses commands.

                  initialised (@0<axes>: circuits closed, power on)
          +------------------------------------------------------------+
          |          initialised, reference begun (imc/47)             |
          |          +-----------------------------------------+       |
          v          v                                         |       |
        [ OPERATING ] ------- limit switch struck ------> [ LIMIT ]    |
          |                                                    |       |
          +---- power, circuit or temperature lost, -----------+       |
          |     hood open in automatic while moving            |       |
          +---------------------> [ FAULT ] <------------------+       |
                                      |                                |
                                      +--------------------------------+

FAULT: stages, brake and spindle off, every reference lost; commands that move or start the spindle answer 9.
LIMIT: every reference lost; moves and reference runs answer 2. docs/safety.md has the table of events.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping

from isel_twin.firmware.imc.ports import Inputs


class State(enum.Enum):
    OPERATING = "operating"
    LIMIT = "limit"
    FAULT = "fault"


class Event(enum.Enum):
    INITIALISED = "initialised"
    REFERENCE_BEGUN = "reference begun"
    LIMIT_STRUCK = "limit struck"
    POWER_LOST = "power lost"


# other events do not change the state
TRANSITIONS: Mapping[tuple[State, Event], State] = {
    (State.OPERATING, Event.LIMIT_STRUCK): State.LIMIT,
    (State.OPERATING, Event.POWER_LOST): State.FAULT,
    (State.LIMIT, Event.POWER_LOST): State.FAULT,
    (State.LIMIT, Event.INITIALISED): State.OPERATING,
    (State.LIMIT, Event.REFERENCE_BEGUN): State.OPERATING,
    (State.FAULT, Event.INITIALISED): State.OPERATING,
}


def circuits_closed(inputs: Inputs) -> bool:
    """Both emergency stop circuits closed and the power stages cool."""
    signals = inputs.signals
    return signals["estop_1"] and signals["estop_2"] and signals["cool"]


def open_circuit(inputs: Inputs) -> str:
    """The emergency circuit that is open, in words; "" if none is."""
    signals = inputs.signals
    if not (signals["estop_1"] and signals["estop_2"]):
        return "emergency stop"
    return "" if signals["cool"] else "a power stage is too hot"


def power_loss(inputs: Inputs) -> str:
    """The cause of a loss of power, in words."""
    if circuit := open_circuit(inputs):
        return circuit
    if not inputs.signals["power_ok"]:
        return "the stages have lost their power"
    return "emergency input of the program" if hood_safe(inputs) else "hood open in automatic"


def powered(inputs: Inputs) -> bool:
    """True if the stages have power and may have it."""
    return inputs.signals["power_ok"] and circuits_closed(inputs)


def hood_safe(inputs: Inputs) -> bool:
    """The hood is closed, or the key is on setup. Both hood contacts must be closed: a broken wire counts as open."""
    signals = inputs.signals
    return signals["hood_setup"] and (signals["setup"] or signals["hood_automatic"])
