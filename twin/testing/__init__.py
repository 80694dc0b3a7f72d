"""For tests of controllers: a desk with ideal carriages, position switches, an operator and an exact clock.

The desk drives a controller with the exact protocol of time and nothing else, so that a test sees the firmware alone.
The carriage follows the counter (no motor, no elasticity), in the sense of the motor: carriage += controller.direction
* step. A position switch changes, and the controller is told, at the very tick that moves the carriage onto it:

    ticks of run   |   |   |   |   |           |   |
    carriage     103 102 101 100 (trip)       100 101
    switch      ______________|~~~~~~~~~~~~~~~~~~~|____      set_input(t of that tick, terminal, level)

The operator's elements, safety relay and spindle contactor are those of `isel_twin.wiring.cabinet`.

    from isel_twin.testing import Desk
    desk = Desk.of("imc-s8")                     # or Desk(factory), factory(flash) -> Controller
    assert desk.query("@07") == "0"              # as its language frames it; time advances until all is answered
    desk.start("@0A 8000,2000,0,30,0,30,0,30")   # the same, no waiting
    desk.run(0.5)                                # seconds of virtual time
    desk.set("hood", "forced")                   # an element, a contact ("limit_x1": open, closed, free) or a
    desk.set("p0.2", True)                       # terminal (its level, True: high)
    assert desk.finish() == "9"                  # until idle; all reply text not yet read
    desk.steps.t_ns, desk.steps.delta            # every tick since the first power-on

A controller that reads its drives (`UsesDrives`) has ideal ones here: encoders at the counters, no lag, no fault; the
terminals they feed are low until `set` changes them. The desk raises ProtocolError for a `next_ns` in the past,
counters that are not the sum of the stream, or a terminal fed by a contact that no machine has.
"""

from __future__ import annotations

from isel_twin.testing.desk import Desk, ProtocolError, StillBusyError
from isel_twin.testing.drives import IdealDrives
from isel_twin.testing.switches import PositionSwitch, Ticks, switches

__all__ = ["Desk", "IdealDrives", "PositionSwitch", "ProtocolError", "StillBusyError", "Ticks", "switches"]
