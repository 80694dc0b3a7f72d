"""Positions in a recording as data: readings in motion, as of a scale that is logged.

A recording with samples (`serve --record`, `run --record`; a tap has none) tells where the carriages were. Of each
command, TIMES moments evenly over its time, of the axes that then move by more than LEAST_MM:

    reading     position, `at_s` after the command was sent      sigma = hypot(SCALE_MM, v CLOCK_S)      v: speed there

so that a sample that is late by CLOCK_S counts for what it is. Each command has a zero of its own: the shape is the
datum, places at rest are those of gauges. What interferes (acts) and what comes before a reference are left out.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import SECOND_NS
from isel_twin.many.identification.measured import Reading
from isel_twin.many.identification.session import LEAST_S, Session, exchanges_of
from isel_twin.recordings.reading import Recorded

TIMES = 8
LEAST_MM = 0.5
SCALE_MM = 0.005
CLOCK_S = 0.0001
MOST_GAP_S = 0.02  # between two samples that may be joined by a line
GAUGE = "trajectory"  # how its mountings begin


def with_trajectories(session: Session, recorded: Recorded) -> Session:
    """The session with the readings that its samples give. Raises RecordingError for samples that do not fit."""
    if not len(recorded.sample_times_ns):
        return session
    last = np.append(np.diff(recorded.sample_times_ns) > 0, True)  # of several samples at one instant
    times_s, position_mm = recorded.sample_times_ns[last] / SECOND_NS, recorded.samples["position_mm"][last]
    found: list[Reading] = []
    for number, exchange in enumerate(exchanges_of(session), 1):
        able = session.timed(number) and number not in session.references and exchange.duration_ns is not None
        if not able or exchange.duration_ns < LEAST_S * SECOND_NS:
            continue
        sent_s, long_s = exchange.sent_ns / SECOND_NS, exchange.duration_ns / SECOND_NS
        inside = (times_s >= sent_s) & (times_s <= sent_s + long_s)
        if inside.sum() < TIMES or np.diff(times_s[inside]).max() > MOST_GAP_S:
            continue
        at_s = (np.arange(TIMES) + 0.5) / TIMES * long_s
        for axis, name in enumerate(CARRIAGES):
            own = position_mm[inside, axis]
            if np.ptp(own) < LEAST_MM:
                continue
            mm = np.interp(sent_s + at_s, times_s[inside], own)
            speed = np.interp(sent_s + at_s, times_s[inside], np.gradient(own, times_s[inside]))
            for when, where, fast in zip(at_s.tolist(), mm.tolist(), speed.tolist(), strict=True):
                sigma = math.hypot(SCALE_MM, fast * CLOCK_S)
                found.append(Reading(session.name, number, name, where, sigma, f"{GAUGE} {number} {name}", at_s=when))
    readings = (*session.measured.readings, *found)
    return replace(session, measured=replace(session.measured, readings=readings))
