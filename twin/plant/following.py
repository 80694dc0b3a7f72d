"""Compiled: carriages that follow their command exactly, up to the first tick or nanosecond at which a switch changes.

    commanded  int64 [axes], counts               leads   LEAD [axes], what of them is still being led (lead.py)
    axis, sense  int64 [s], of the switches       strike, release  float64 [s], in counts times sense
    struck     bool [s]

Arrays of state change in place.
"""

from __future__ import annotations

import math

import numpy as np

from isel_twin.base.compiling import contains, njit
from isel_twin.plant import lead
from isel_twin.plant.lead import begin, behind

_FAR = 1 << 62  # a count that no axis reaches


@njit(inner=True)
def bounds(low, high, axis, sense, strike, release, struck):
    """Fill in the open interval of counts, low and high int64 [axes], in which no switch of an axis changes outside
    leads."""
    for a in range(low.shape[0]):
        low[a], high[a] = -_FAR, _FAR
    for s in range(axis.shape[0]):
        a = axis[s]
        if sense[s] > 0 and struck[s]:
            low[a] = max(low[a], math.floor(release[s]))
        elif sense[s] > 0:
            high[a] = min(high[a], math.floor(strike[s]) + 1)
        elif struck[s]:
            high[a] = min(high[a], math.ceil(-release[s]))
        else:
            low[a] = max(low[a], math.ceil(-strike[s]) - 1)


@njit(inner=True)
def _changes(s, t_ns, commanded, leads, axis, sense, strike, release, struck):
    beyond = sense[s] * (commanded[axis[s]] - behind(leads[axis[s]], t_ns))
    return (beyond > (release[s] if struck[s] else strike[s])) != struck[s]


@njit(inner=True)
def _switch(t_ns, commanded, leads, axis, sense, strike, release, struck):
    """Set the switches by the carriages; True if one has changed."""
    changed = False
    for s in range(axis.shape[0]):
        if _changes(s, t_ns, commanded, leads, axis, sense, strike, release, struck):
            struck[s] = not struck[s]
            changed = True
    return changed


@njit()
def make_steps(t_ns, delta, commanded, leads, axis, sense, strike, release, struck, scratch):
    """Make steps until a switch changes; commanded and struck change in place. Return the number of ticks made, below
    zero if one changed with the last of them. scratch: int64 [3, axes].

    Axis by axis, so that its count stays in a register; the first tick at which one leaves its bounds ends the search.
    """
    low, high, reached = scratch[0], scratch[1], scratch[2]
    bounds(low, high, axis, sense, strike, release, struck)
    made = 0
    for i in range(commanded.shape[0]):
        reached[i] = commanded[i]
    while True:
        ahead = delta[made:]  # a view from 0 on: the compiler then knows that no index is negative
        ticks, axes = ahead.shape
        last, outside = ticks, False
        for i in range(axes):
            now, lowest, highest = commanded[i], low[i], high[i]
            for k in range(last):
                now += ahead[k, i]
                if now <= lowest or now >= highest:
                    last, outside = k + 1, True
                    break
            reached[i] = now
        if not outside:
            for i in range(axes):  # element by element: compiles in a fraction of the time of a slice
                commanded[i] = reached[i]
            return delta.shape[0]
        while last < ticks and t_ns[made + last] == t_ns[made + last - 1]:
            last += 1
        for k in range(last):
            for i in range(axes):
                commanded[i] += ahead[k, i]
        made += last
        if _switch(t_ns[made - 1], commanded, leads, axis, sense, strike, release, struck):
            return -made


@njit(inner=True)
def _first_change(start_ns, until_ns, commanded, leads, axis, sense, strike, release, struck):
    """First time after start_ns at which a switch changes, until_ns + 1 if none does by then; no tick in between.

    Each axis moves in one direction in that time, so bisection finds the nanosecond.
    """
    led_ns = start_ns
    for i in range(leads.shape[0]):  # one by one: compiles in a fraction of the time of a maximum
        led_ns = max(led_ns, leads[i].end_ns)
    led_ns = min(until_ns, led_ns)
    first_ns = until_ns + 1
    if led_ns <= start_ns:
        return first_ns
    for s in range(axis.shape[0]):
        low_ns, high_ns = start_ns + 1, min(led_ns, first_ns)
        if _changes(s, low_ns, commanded, leads, axis, sense, strike, release, struck):
            return low_ns
        if not _changes(s, high_ns, commanded, leads, axis, sense, strike, release, struck):
            continue
        while high_ns - low_ns > 1:
            middle_ns = (low_ns + high_ns) // 2
            if _changes(s, middle_ns, commanded, leads, axis, sense, strike, release, struck):
                high_ns = middle_ns
            else:
                low_ns = middle_ns
        first_ns = high_ns
    return first_ns


@njit()
def lead_on(start_ns, until_ns, lead_ns, t_ns, delta, commanded, leads, axis, sense, strike, release, struck):
    """Make ticks and leads until a switch changes. Return (ticks made, time reached)."""
    made = 0
    ticks = t_ns.shape[0]
    now_ns = start_ns
    while True:
        goal_ns = until_ns if made == ticks else t_ns[made] - 1
        edge_ns = _first_change(now_ns, goal_ns, commanded, leads, axis, sense, strike, release, struck)
        if edge_ns <= goal_ns:
            _switch(edge_ns, commanded, leads, axis, sense, strike, release, struck)
            return made, edge_ns
        if made == ticks:
            return made, until_ns
        now_ns = t_ns[made]
        while made < ticks and t_ns[made] == now_ns:
            for i in range(delta.shape[1]):
                change = delta[made, i]
                commanded[i] += change
                if lead_ns > 0 and change != 0:
                    begin(leads[i], now_ns, change, lead_ns)
            made += 1
        if _switch(now_ns, commanded, leads, axis, sense, strike, release, struck):
            return made, now_ns


@njit()
def places_on_the_way(start_ns, until_ns, lead_ns, t_ns, delta, commanded, leads):
    """Where the path has its corners up to until_ns, what is led included: times and counts, before and after each
    change. commanded, leads: copies, which change."""
    axes = leads.shape[0]
    most = (t_ns.shape[0] + 1) * (axes + 3) + 1
    times = np.empty(most, dtype=np.int64)
    counts = np.empty((most, axes))
    n, made, now_ns = 0, 0, start_ns
    while True:
        goal_ns = until_ns if made == t_ns.shape[0] else t_ns[made]
        while True:  # the leads that end before
            next_ns = goal_ns
            for i in range(axes):
                if now_ns < leads[i].end_ns < next_ns:
                    next_ns = leads[i].end_ns
            now_ns = next_ns
            times[n] = now_ns
            for i in range(axes):
                counts[n, i] = commanded[i] - behind(leads[i], now_ns)
            n += 1
            if now_ns == goal_ns:
                break
        if made == t_ns.shape[0]:
            return times[:n], counts[:n]
        for i in range(delta.shape[1]):
            change = delta[made, i]
            commanded[i] += change
            if lead_ns > 0 and change != 0:
                begin(leads[i], now_ns, change, lead_ns)
        made += 1
        times[n] = now_ns
        for i in range(axes):
            counts[n, i] = commanded[i] - behind(leads[i], now_ns)
        n += 1


contains(__name__, lead.__file__)
