/* Times of ticks (time_law.py). Both kinds of phases give a time to the nearest nanosecond, ties to even, or say that
   it is too near to a tie for the digits that they have:

   cruise   t + (rest + (k - first) step_rest) / den + (k - first) step, in whole numbers. They are exact, or all rests
            are rounded down to 1/den (`rounded`), so that those of tick k miss less than k - first + 1 of them.
   ramp     t + t_rest + sign x(sign (k - s)) in double precision. DOUBT bounds its error relative to x(d) + 1 ns. With
            u = 2^-53 the relative errors are at most: d 2 u, 2 a d 4 u, radicand 5 u, root 3.5 u, plus f0 4.5 u,
            numerator 4 u, quotient 9.5 u; adding the rounded rest of T costs 1 u of the sum and 1 u of the rest. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

#define DOUBT (12 * 0x1p-53)
#define UNDECIDED (-1)

INLINE int64_t cruise_time(const PHASE *phase, int64_t whole, int64_t rest, int64_t k) {
    int64_t twice = 2 * rest;
    if (phase->rounded && twice <= phase->den && twice + 2 * (k - phase->first + 1) > phase->den)
        return UNDECIDED;
    return whole + (twice > phase->den || (twice == phase->den && whole & 1));
}

INLINE int64_t ramp_time(const PHASE *phase, int64_t k) {
    double d = (double)(phase->sign * (k - phase->s)) + phase->s_rest;
    double x = phase->two_units * d / (sqrt(phase->f0 * phase->f0 + phase->two_a * d) + phase->f0);
    double y = phase->t_rest + (double)phase->sign * x;
    double n = rint(y);
    return 0.5 - fabs(y - n) > DOUBT * (x + 1.0) ? phase->t + (int64_t)n : UNDECIDED; /* nan, too, is undecided */
}

/* Write the times of ticks first + 1, first + 2, ... to out, from index `done` on, up to one that is undecided; return
   the index reached. phases: all of the law, one after the other, no tick beyond them. Sums of times and rests are
   below 2^63: a cruise ends before 2^62 ns, den is below 2^61. */
API int64_t tick_times(A1(int64_t, out), int64_t done, int64_t first, A1(const PHASE, phases)) {
    for (int64_t p = 0; p < phases_n && done < out_n; p++) {
        const PHASE *phase = &phases[p];
        int64_t end = least_of(out_n, phase->last - first), k = first + 1 + done;
        if (phase->den == 0) {
            for (; done < end; done++, k++)
                if ((out[done] = ramp_time(phase, k)) == UNDECIDED)
                    return done;
        } else if (done < end) {
            __int128 rests = (__int128)phase->step_rest * (k - phase->first) + phase->rest;
            int64_t whole = phase->t + phase->step * (k - phase->first) + (int64_t)(rests / phase->den);
            int64_t rest = (int64_t)(rests % phase->den);
            for (; done < end; done++, k++) {
                if ((out[done] = cruise_time(phase, whole, rest, k)) == UNDECIDED)
                    return done;
                whole += phase->step;
                rest += phase->step_rest;
                if (rest >= phase->den) {
                    rest -= phase->den;
                    whole++;
                }
            }
        }
    }
    return done;
}

/* Time of one tick, or UNDECIDED. */
API int64_t tick_time(int64_t k, A1(const PHASE, phases)) {
    int64_t time_ns;
    return tick_times(&time_ns, 1, 0, k - 1, phases, phases_n) ? time_ns : UNDECIDED;
}

/* Number of the first `ticks` ticks at or before t_ns; UNDECIDED if one on the way to it is. */
API int64_t ticks_by(int64_t t_ns, int64_t ticks, A1(const PHASE, phases)) {
    int64_t low = 0, high = ticks;
    while (low < high) {
        int64_t middle = low + (high - low + 1) / 2, time_ns = tick_time(middle, phases, phases_n);
        if (time_ns == UNDECIDED)
            return UNDECIDED;
        if (time_ns <= t_ns)
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}
