"""Step streams: what a controller makes and everything below it lives on, described instead of stored.

A stream is a sequence of ticks; at each tick every axis makes -1, 0 or +1 step.

    profile.py   when the ticks fall: the trapezoidal time law, exact to the nanosecond
    path.py      which axes step at a tick: line; the packing of a tick into a byte
    circle.py    the paths that are not straight: circle, helix
    run.py       a path, timed by a profile, started at a time
    record.py    all runs since power-on, expanded where they are looked at

    motion = line((800, -2000, 0, 0))                                  # 2000 ticks, led by Y
    run = Run(motion, trapezoid(motion.ticks, 5000, 400, 100_000), start_ns=t)
    t_ns, code = run.window(0, 1000)                                   # the first 1000 ticks

Definitions and closed forms are in docs/step_streams.md.
"""

from __future__ import annotations

from isel_twin.motion.circle import circle, helix
from isel_twin.motion.path import Path, decode, encode, line
from isel_twin.motion.profile import Profile, constant, trapezoid
from isel_twin.motion.record import Steps
from isel_twin.motion.run import Run

__all__ = ["Path", "Profile", "Run", "Steps", "circle", "constant", "decode", "encode", "helix", "line", "trapezoid"]
