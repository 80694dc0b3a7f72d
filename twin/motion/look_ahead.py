"""Look-ahead over a chain of pieces and its ramps, compiled; used by `joined`, where the formulas are.

A chain is a table, one row a piece; a law is a list of phases, one to three a piece, each a ramp or a constant speed:

    table   LENGTH  LIMIT  ...                     phases   t      dt     s0     s1     v0     v1
            units of path, seconds                          begin, duration, from and to (on the piece), speeds

    piece j     v_j ___/~~~\\___ v_j+1              phases of it: rise to the peak, cruise, fall

Times are double precision: after a day the resolution is still 10 ps (motion/14).
"""

import math

import numpy as np

from isel_twin.base.compiling import njit

LENGTH, SPEED, LIMIT, ACCELERATION, ENTRY = range(5)  # columns of a table of pieces
T, DT, S0, S1, V0, V1 = range(6)  # columns of phases
FRACTIONS = 65536.0  # displacements are multiples of 1/FRACTIONS increment, so that sums are exact (motion/13)
LARGEST = 2.0**31

# messages by the number that `faults` returns
FAULTS = (
    "",
    "displacements must be whole multiples of 2^-16 increments below 2^31",
    "lengths of pieces must be positive",
    "speeds and limits of pieces must be positive, entry speeds at least 0",
    "a piece needs a speed or a limit",
    "accelerations of pieces must be positive",
)

NOISE = 1e-11  # relative rounding error of v^2: a joint speed missed by less counts as kept
PLACE_NOISE = 1e-12  # relative rounding error of places on a piece


@njit(nogil=True, error_model="numpy")
def faults(displacement, length, speed, limit, acceleration, entry):
    """Check pieces: the index in FAULTS of the first fault found, 0 for none."""
    for j in range(length.size):
        for axis in range(displacement.shape[1]):
            parts = displacement[j, axis] * FRACTIONS
            if not (abs(displacement[j, axis]) < LARGEST and parts == np.rint(parts)):
                return 1
        if not 0.0 < length[j] < np.inf:
            return 2
        if not (speed[j] > 0.0 and limit[j] > 0.0 and entry[j] >= 0.0):
            return 3
        if not min(speed[j], limit[j]) < np.inf:
            return 4
        if not 0.0 < acceleration[j] < np.inf:
            return 5
    return 0


@njit(inner=True, nogil=True, error_model="numpy")
def _slack(v, mean, length):
    """Rounding error of v^2 on a piece."""
    return NOISE * v * v + 2.0 * mean * PLACE_NOISE * length


@njit(nogil=True, error_model="numpy")
def lay(t, s, v, table, wanted, factor, phases, piece, back):
    """Lay phases over the pieces of `table`, from place s of the first one, speed v and time t to the end of the last.

    wanted: highest speeds, one a piece. factor: mean over peak acceleration of a ramp. Writes to phases
    [3 n, 6], piece [3 n] (row of the table), back [3 n] (phases since the beginning of the piece or, in the first one,
    of the plan). Returns the number of phases, the last joint that does not depend on where the chain ends, and whether
    all entry speeds are kept and the final speed is 0.
    """
    n = table.shape[0]
    joint = np.empty(n + 1)
    joint[n] = 0.0
    for j in range(n - 1, 0, -1):
        joint[j] = min(
            min(table[j, ENTRY], min(wanted[j - 1], wanted[j])),
            math.sqrt(joint[j + 1] ** 2 + 2.0 * factor * table[j, ACCELERATION] * table[j, LENGTH]),
        )
    joint[0] = v
    kept = True
    for j in range(n):
        mean = factor * table[j, ACCELERATION]
        length = table[j, LENGTH]
        change = 2.0 * mean * (length - (s if j == 0 else 0.0))
        square = joint[j] ** 2
        slack = _slack(joint[j], mean, length)
        if joint[j + 1] ** 2 > square + change:
            joint[j + 1] = math.sqrt(square + change)
        elif square - change > joint[j + 1] ** 2 + slack:
            joint[j + 1] = math.sqrt(square - change)  # the speed before allows no less (motion/11)
            entry = table[j + 1, ENTRY] if j + 1 < n else 0.0
            if square - change > entry**2 + slack:
                kept = False
    settled = 0
    for j in range(n - 1, 0, -1):
        reach = math.sqrt(joint[j + 1] ** 2 + 2.0 * factor * table[j, ACCELERATION] * table[j, LENGTH])
        if joint[j] < reach:
            settled = j
            break
    count = 0
    for j in range(n):
        v0, v1, peak = joint[j], joint[j + 1], wanted[j]
        mean = factor * table[j, ACCELERATION]
        begin, end = (s if j == 0 else 0.0), table[j, LENGTH]
        if v0 > peak:
            peak = max(peak, v1)
        else:
            peak = min(peak, math.sqrt((2.0 * mean * (end - begin) + v0 * v0 + v1 * v1) / 2.0))
            peak = max(peak, max(v0, v1))
        up = abs(peak * peak - v0 * v0) / (2.0 * mean)
        down = (peak * peak - v1 * v1) / (2.0 * mean)
        cruise = end - begin - up - down
        steady = peak > 0.0 and (cruise > PLACE_NOISE * end or (peak == v0 and peak == v1))
        first = count
        if peak != v0:
            to = begin + up if steady or peak != v1 else end
            _phase(phases, count, t, abs(peak - v0) / mean, begin, min(to, end), v0, peak)
            t = phases[count, T] + phases[count, DT]
            count += 1
        if steady:
            frm = begin if count == first else phases[count - 1, S1]
            to = max(end - down, frm) if peak != v1 else end
            _phase(phases, count, t, (to - frm) / peak, frm, to, peak, peak)
            t = phases[count, T] + phases[count, DT]
            count += 1
        if peak != v1:
            frm = begin if count == first else phases[count - 1, S1]
            _phase(phases, count, t, (peak - v1) / mean, frm, end, peak, v1)
            t = phases[count, T] + phases[count, DT]
            count += 1
        for row in range(first, count):
            piece[row] = j
            back[row] = row - first
    return count, settled, kept


@njit(inner=True, nogil=True, error_model="numpy")
def _phase(phases, row, t, dt, s0, s1, v0, v1):
    phases[row, T] = t
    phases[row, DT] = dt
    phases[row, S0] = s0
    phases[row, S1] = s1
    phases[row, V0] = v0
    phases[row, V1] = v1


@njit(nogil=True, error_model="numpy")
def brake(t, s, v, table, factor, phases, piece, back):
    """Brake to standstill along the pieces of `table`; otherwise like `lay`. phases: [n, 6].

    Returns the number of phases and whether all entry speeds are kept and it comes to rest before the end.
    """
    count, kept = 0, True
    for j in range(table.shape[0]):
        mean = factor * table[j, ACCELERATION]
        end = table[j, LENGTH]
        slack = _slack(v, mean, end)
        square = v * v - 2.0 * mean * (end - s)
        piece[count] = j
        back[count] = 0
        if square <= slack:
            place = min(s + v * v / (2.0 * mean), end)
            if end - place <= PLACE_NOISE * end:
                place = end
            _phase(phases, count, t, v / mean, s, place, v, 0.0)
            return count + 1, kept
        after = math.sqrt(square)
        _phase(phases, count, t, (v - after) / mean, s, end, v, after)
        t = phases[count, T] + phases[count, DT]
        count += 1
        if j + 1 == table.shape[0] or square > table[j + 1, ENTRY] ** 2 + slack:
            kept = False
        v, s = after, 0.0
    return count, False


@njit(inner=True, nogil=True, error_model="numpy")
def _place(x, phases, row, sine):
    """Place on the piece x seconds after the beginning of a phase, at most its end."""
    dt, s1 = phases[row, DT], phases[row, S1]
    if x >= dt:
        return s1
    v0, dv = phases[row, V0], phases[row, V1] - phases[row, V0]
    if sine:
        moved = v0 * x + dv * (x / 2.0 - dt / (2.0 * math.pi) * math.sin(math.pi * x / dt))
    else:
        moved = v0 * x + dv * x * x / (2.0 * dt)
    return min(phases[row, S0] + moved, s1)


@njit(nogil=True, error_model="numpy")
def speed_at(x, phases, row, sine):
    """Speed x seconds after the beginning of a phase; 0 after its end if nothing follows."""
    dt, v0, v1 = phases[row, DT], phases[row, V0], phases[row, V1]
    if x >= dt:
        return v1
    return v0 + (v1 - v0) * (math.sin(math.pi * x / (2.0 * dt)) ** 2 if sine else x / dt)


@njit(nogil=True, error_model="numpy")
def places(k, period_s, phases, piece, sine, place, number):
    """For ticks k, k + 1, ...: place[i] on the piece in row number[i] of the table; -1 before the first phase."""
    row, last = np.searchsorted(phases[:, T], k * period_s, side="right") - 1, phases.shape[0] - 1
    for i in range(place.size):
        t = (k + i) * period_s
        while row < last and phases[row + 1, T] <= t:
            row += 1
        if row < 0:
            place[i], number[i] = 0.0, -1
        else:
            place[i], number[i] = _place(t - phases[row, T], phases, row, sine), piece[row]


@njit(nogil=True, error_model="numpy")
def positions(k, period_s, phases, piece, sine, table, corner, out):
    """out[i, axis]: position at tick k + i in whole increments, on straight pieces. corner: [pieces + 1, axes]."""
    row, last = np.searchsorted(phases[:, T], k * period_s, side="right") - 1, phases.shape[0] - 1
    for i in range(out.shape[0]):
        t = (k + i) * period_s
        while row < last and phases[row + 1, T] <= t:
            row += 1
        if row < 0:
            j, place = 0, 0.0
        else:
            j = piece[row]
            place = _place(t - phases[row, T], phases, row, sine)
        for axis in range(out.shape[1]):
            begin = corner[j, axis]
            whole = np.rint(begin)
            way = corner[j + 1, axis] - begin if row >= 0 else 0.0
            out[i, axis] = np.int64(whole) + np.int64(
                np.rint(begin - whole + (way * place / table[j, LENGTH] if row >= 0 else 0.0))
            )
