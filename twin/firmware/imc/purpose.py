"""Purposes of the iMC's requests, which determine the effect of a stop, a switch or an input.

Travel(path, law)                            an ordinary move: a stop parks it, a limit switch is an error
Travel(path, law, first, Until(condition))   ... and it ends with the stop ramp as soon as the condition holds
Travel(path, law, 0, Reference(seek=2))      towards the reference switch of Z, which ends it at once
Travel(path, law, 0, Reference(leave=2))     off the switches of Z, which end it at once when they have closed
Pause(ns, REFERENCE)                         a rest within a reference run
Pause(ns, WAITING)                           a program that waits for an input
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Until:
    """A motion that ends with the stop ramp when a condition on inputs comes true."""

    condition: Callable[[], bool]


@dataclass(frozen=True)
class Reference:
    """Part of a reference run, which a stop breaks off.

    seek: axis whose switches, or the stop key, end it at once; leave: axis whose last switch to close ends it at once.
    """

    seek: int | None = None
    leave: int | None = None


REFERENCE = Reference()


WAITING = "waiting"  # a pause in which a stop parks the program, as in moves
