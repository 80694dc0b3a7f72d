"""Motion: the step and set-point streams that controllers make, described by formulas instead of stored.

A motion is a sequence of ticks; at each tick every axis changes its command by a whole number.

    motion.py       the protocol; what "continues" means
    time_law.py     when the ticks of steps fall: the trapezoidal law, exact to the nanosecond
    path.py         which axes step at a tick: line
    circle.py       the paths that are not straight: circle, helix
    step_run.py     a path, timed by a law, started at a time
    set_points.py   a plan with one tick a period, led evenly from tick to tick
    together.py     several such plans, added
    listed.py       ticks that are stored as they are
    spreading.py    changes of counters in a given time, as ticks
    joined.py       such plans for chains of pieces: look-ahead, ramps, override, hold
    pieces.py, blocks.py, look_ahead.py   what they are made of, how they are kept, the compiled part
    record.py       all motions since power-on, expanded where they are looked at
    stream.py       the same while time goes on: ticks made, and ticks still to be made

    motion = line((800, -2000, 0, 0))                                  # 2000 ticks, led by Y
    run = StepRun(motion, trapezoid(motion.ticks, 5000, 400, 100_000), start_ns=t)
    t_ns, delta = run.window(0, 1000)                                  # the first 1000 ticks

Definitions and closed forms are in docs/step_streams.md and docs/set_points.md.
"""

from __future__ import annotations

from isel_twin.motion.circle import circle
from isel_twin.motion.listed import Listed
from isel_twin.motion.motion import Motion
from isel_twin.motion.path import Displacement, StepPath, line
from isel_twin.motion.record import Steps
from isel_twin.motion.set_points import SetPointRun, SetPoints
from isel_twin.motion.step_run import StepRun
from isel_twin.motion.stream import Stream
from isel_twin.motion.time_law import Rational, TimeLaw, along_path, constant, trapezoid

__all__ = [
    "Displacement",
    "Listed",
    "Motion",
    "Rational",
    "SetPointRun",
    "SetPoints",
    "StepPath",
    "StepRun",
    "Steps",
    "Stream",
    "TimeLaw",
    "along_path",
    "circle",
    "constant",
    "line",
    "trapezoid",
]
