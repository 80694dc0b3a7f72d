"""Random jobs through the whole card: whatever a host sends, the set points that leave it keep the limits.

Taken from the stream of set points alone, T = 4 ms apart, rounding to whole increments on either side:

    speed           sqrt(sum of d_i^2)      <=  F T  + sqrt(n)             d: increments in a tick; W1, ratios 1
    acceleration    |d_i(k + 1) - d_i(k)|   <=  A T^2 + J T + 2            J: what a corner may jump by
    end             the counters are the sum of what was told, exactly

A piece takes 12 ms at least, so that no tick has two corners; so do the chords of a circle, whose corners are as those
of lines (N14 = 0). J is FS0 for moves in any direction. For moves along the axes every corner is of 90 degrees or more,
or of none: there it is FS90.
"""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from conformance.gmi99_desk import G91, OK, TICK_NS, CardDesk, Q, command, fresh, short
from from_start import from_start

TICK_S = TICK_NS / 1e9


def dense(desk: CardDesk) -> np.ndarray:
    """Increments of each slot in every tick from the first to the last set point, int64 [n, 6]."""
    steps = desk.steps
    assert not np.any(steps.t_ns % TICK_NS)
    ticks = steps.t_ns // TICK_NS
    made = np.zeros((int(ticks[-1] - ticks[0]) + 3, 6), np.int64)
    made[ticks - ticks[0] + 1] = steps.delta
    return made


def job(rng: random.Random, *, along_axes: bool) -> tuple[list[str], np.ndarray, dict[str, int]]:
    """Telegrams of a job of relative moves and half circles, their sum, and the limits they were made with."""
    limits = {"m": rng.randrange(2000, 50_001), "f": rng.randrange(500, 50_000), "b": rng.randrange(5, 400)}
    limits |= {"fs0": rng.randrange(3000), "fs90": rng.randrange(800)}
    limits["fs90"] = min(limits["fs90"], limits["fs0"])
    told = [command("M", limits["m"]), command("f", limits["f"]), command("B", limits["b"]), G91]
    told += [command("N", limits["fs0"], 11), command("N", limits["fs90"], 16), command("N", rng.randrange(2), 24)]
    total = np.zeros(6, np.int64)
    for _ in range(rng.randrange(1, 30)):
        way = [round(rng.choice((30, 300, 3000)) * rng.uniform(-1, 1)) for _ in range(3)]
        if along_axes:
            axis = rng.randrange(3)
            told.append(command(0x80 | 1 << axis, way[axis]))
            total[axis] += way[axis]
        elif rng.random() < 0.15:  # half a circle, its centre and its end
            told += [command("G", rng.choice((2, 3))), command(0x83, *way[:2]), command(0x83, 2 * way[0], 2 * way[1])]
            total[:2] += 2 * np.array(way[:2])
        else:
            told.append(command(0x87, *way))
            total[:3] += way
    return told, total, limits


@pytest.mark.parametrize("along_axes", [False, True], ids=["any direction", "along the axes"])
@pytest.mark.parametrize("seed", range(30))
def test_no_limit_is_exceeded_and_the_end_is_exact(seed: int, along_axes: bool) -> None:
    """Telegrams come at odd times; an override, a stop flag and a break between change the plan under way."""
    rng = random.Random(1000 * along_axes + seed)
    desk = fresh()
    desk.ask(Q)
    told, total, limits = job(rng, along_axes=along_axes)
    override = 100
    for frame in told:
        assert desk.ask(frame) == OK
        if rng.random() < 0.3:
            desk.run(rng.choice((0.0, 0.0013, 0.02, 0.1)))
        if rng.random() < 0.1:
            override = max(override, percent := rng.choice((40, 80, 125)))
            desk.ask(short(9, percent))
        if rng.random() < 0.05:
            desk.ask(command("p", 11, 0, 1))
            desk.run(0.05)
            desk.ask(command("p", 11, 0, 0))
    desk.finish()
    assert np.array_equal(desk.counts, total)
    if not len(desk.steps):
        assert not total.any()
        return
    made = dense(desk)
    fastest = min(limits["m"], limits["f"] * override / 100)
    assert np.sqrt((made**2).sum(axis=1)).max() <= fastest * TICK_S + math.sqrt(3)
    jump = limits["fs90"] if along_axes else limits["fs0"]
    most = limits["b"] * 1000 * TICK_S**2 + jump * TICK_S + 2
    assert np.abs(np.diff(made, axis=0)).max() <= most


@pytest.mark.parametrize("seed", range(10))
def test_a_job_in_a_program_makes_the_same_set_points(seed: int) -> None:
    """Sent ahead while the card waits, or recorded and run: one and the same stream."""
    streams = []
    for recorded in (False, True):
        told, total, _ = job(random.Random(seed), along_axes=False)
        settings, moves = told[:3] + told[4:7], [told[3], *told[7:]]
        desk = fresh()
        desk.tell(Q, *(frame for frame in settings))
        if recorded:
            desk.tell(command("p", 3, 100, 0), *moves, command("p", 3, 101), command("p", 3, 1, 0))
        else:
            desk.tell(command("p", 10, 14, 1), *moves)
        desk.finish()
        assert np.array_equal(desk.counts, total)
        streams.append(from_start(desk.steps))
    assert np.array_equal(streams[0].t_ns, streams[1].t_ns)
    assert np.array_equal(streams[0].delta, streams[1].delta)
