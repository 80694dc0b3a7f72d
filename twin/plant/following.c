/* Carriages that follow their command exactly, up to the first tick or nanosecond at which a switch changes, and what
   is asked of the same way: its corners and samples (following.py, path_samples.py).

   commanded [axes] counts, below 2^61      leads [axes], what of them is still being led (lead.h)

   Ticks have as many times as rows of changes, and no more columns than there are axes; both are checked in Python. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"
#include "lead.h"

#define FAR (INT64_C(1) << 62) /* a count that no axis reaches */

/* A whole number as a count; what is too far for one is out of reach. */
INLINE int64_t count_of(double x) { return (int64_t)most(-0x1p61, least(0x1p61, x)); }

/* Fill in the open interval of counts, low and high [axes], in which no switch of an axis changes outside leads. */
API void switch_bounds(A1(int64_t, low, axes), A1(int64_t, high, axes), A1(const SWITCH, switches)) {
    for (int64_t a = 0; a < low_n; a++)
        low[a] = -FAR, high[a] = FAR;
    for (int64_t s = 0; s < switches_n; s++) {
        const SWITCH *of = &switches[s];
        int64_t a = of->axis;
        if (of->sense > 0 && of->struck)
            low[a] = most_of(low[a], count_of(floor(of->release)));
        else if (of->sense > 0)
            high[a] = least_of(high[a], count_of(floor(of->strike)) + 1);
        else if (of->struck)
            high[a] = least_of(high[a], count_of(ceil(-of->release)));
        else
            low[a] = most_of(low[a], count_of(ceil(-of->strike)) - 1);
    }
}

INLINE int switch_changes(const SWITCH *of, int64_t t_ns, const int64_t *commanded, const LEAD *leads) {
    double beyond = (double)of->sense * ((double)commanded[of->axis] - behind(&leads[of->axis], t_ns));
    return (beyond > (of->struck ? of->release : of->strike)) != of->struck;
}

/* Set the switches by the carriages; 1 if one has changed. */
INLINE int64_t set_switches(int64_t t_ns, const int64_t *commanded, const LEAD *leads, SWITCH *switches, int64_t n) {
    int64_t changed = 0;
    for (int64_t s = 0; s < n; s++)
        if (switch_changes(&switches[s], t_ns, commanded, leads)) {
            switches[s].struck = !switches[s].struck;
            changed = 1;
        }
    return changed;
}

/* Make steps, none of them led, until a switch changes, and tell whether one has; reached_ns [1]: when, or until_ns.
   scratch: [3, axes].

   Axis by axis, so that its count stays in a register; the first tick at which one leaves its bounds ends the
   search. */
API int64_t make_steps(int64_t until_ns, A1(const int64_t, t_ns, n), A2(const int8_t, delta, n, columns),
                       A1(int64_t, commanded, axes), A1(const LEAD, leads, axes), A1(SWITCH, switches),
                       A2(int64_t, scratch, 3, axes), A1(int64_t, reached_ns, 1)) {
    int64_t axes = delta_columns, ticks = delta_rows, made = 0;
    int64_t *low = scratch, *high = scratch + scratch_columns, *place = high + scratch_columns;
    switch_bounds(low, scratch_columns, high, scratch_columns, switches, switches_n);
    reached_ns[0] = until_ns;
    for (;;) {
        int64_t last = ticks;
        int outside = 0;
        for (int64_t i = 0; i < axes; i++) {
            int64_t now = commanded[i];
            for (int64_t k = made; k < last; k++) {
                now += delta[k * axes + i];
                if (now <= low[i] || now >= high[i]) {
                    last = k + 1;
                    outside = 1;
                    break;
                }
            }
            place[i] = now;
        }
        if (!outside) {
            for (int64_t i = 0; i < axes; i++)
                commanded[i] = place[i];
            return 0;
        }
        while (last < ticks && t_ns[last] == t_ns[last - 1])
            last++;
        for (; made < last; made++)
            for (int64_t i = 0; i < axes; i++)
                commanded[i] += delta[made * axes + i];
        if (set_switches(t_ns[made - 1], commanded, leads, switches, switches_n)) {
            reached_ns[0] = t_ns[made - 1];
            return 1;
        }
    }
}

/* First time after start_ns at which a switch changes, until_ns + 1 if none does by then; no tick in between.

   Each axis moves in one direction in that time, so bisection finds the nanosecond. */
INLINE int64_t first_change(int64_t start_ns, int64_t until_ns, const int64_t *commanded, const LEAD *leads,
                            int64_t axes, const SWITCH *switches, int64_t n) {
    int64_t led_ns = start_ns, first_ns = until_ns + 1;
    for (int64_t i = 0; i < axes; i++)
        led_ns = most_of(led_ns, leads[i].end_ns);
    led_ns = least_of(until_ns, led_ns);
    if (led_ns <= start_ns)
        return first_ns;
    for (int64_t s = 0; s < n; s++) {
        int64_t low_ns = start_ns + 1, high_ns = least_of(led_ns, first_ns);
        if (switch_changes(&switches[s], low_ns, commanded, leads))
            return low_ns;
        if (!switch_changes(&switches[s], high_ns, commanded, leads))
            continue;
        while (high_ns - low_ns > 1) {
            int64_t middle_ns = low_ns + (high_ns - low_ns) / 2;
            if (switch_changes(&switches[s], middle_ns, commanded, leads))
                high_ns = middle_ns;
            else
                low_ns = middle_ns;
        }
        first_ns = high_ns;
    }
    return first_ns;
}

/* Take the changes [axes] of a tick. */
INLINE void follow_tick(int64_t t_ns, const int32_t *delta, int64_t axes, int64_t lead_ns, int64_t *commanded,
                        LEAD *leads) {
    for (int64_t i = 0; i < axes; i++) {
        commanded[i] += delta[i];
        if (lead_ns > 0 && delta[i] != 0)
            begin(&leads[i], t_ns, delta[i], lead_ns);
    }
}

/* Make ticks and leads until a switch changes, and tell whether one has; reached_ns [1]: when, or until_ns. */
API int64_t lead_on(int64_t start_ns, int64_t until_ns, int64_t lead_ns, A1(const int64_t, t_ns, n),
                    A2(const int32_t, delta, n, columns), A1(int64_t, commanded, axes), A1(LEAD, leads, axes),
                    A1(SWITCH, switches), A1(int64_t, reached_ns, 1)) {
    int64_t made = 0, now_ns = start_ns;
    for (;;) {
        int64_t goal_ns = made == t_ns_n ? until_ns : t_ns[made] - 1;
        int64_t edge_ns = first_change(now_ns, goal_ns, commanded, leads, leads_n, switches, switches_n);
        if (edge_ns <= goal_ns || made == t_ns_n) {
            reached_ns[0] = least_of(edge_ns, goal_ns);
            return edge_ns <= goal_ns && set_switches(edge_ns, commanded, leads, switches, switches_n);
        }
        now_ns = t_ns[made];
        for (; made < t_ns_n && t_ns[made] == now_ns; made++)
            follow_tick(now_ns, &delta[made * delta_columns], delta_columns, lead_ns, commanded, leads);
        if (set_switches(now_ns, commanded, leads, switches, switches_n)) {
            reached_ns[0] = now_ns;
            return 1;
        }
    }
}

/* Where all axes are at t_ns, what is led included. */
INLINE void places_at(int64_t t_ns, const int64_t *commanded, const LEAD *leads, int64_t axes, double *counts) {
    for (int64_t i = 0; i < axes; i++)
        counts[i] = (double)commanded[i] - behind(&leads[i], t_ns);
}

/* Where the path has its corners up to until_ns, what is led included: times [n] and counts [n, axes], before and after
   each change; return their number, at most (ticks + 1) (axes + 3) + 1. commanded, leads: copies, which change. */
API int64_t path_corners(int64_t start_ns, int64_t until_ns, int64_t lead_ns, A1(const int64_t, t_ns, n),
                         A2(const int32_t, delta, n, columns), A1(int64_t, commanded, axes), A1(LEAD, leads, axes),
                         A1(int64_t, times_ns, m), A2(double, counts, m, axes)) {
    int64_t axes = leads_n, n = 0, now_ns = start_ns;
    for (int64_t made = 0;; made++) {
        int64_t goal_ns = made == t_ns_n ? until_ns : t_ns[made];
        do { /* the leads that end before */
            int64_t next_ns = goal_ns;
            for (int64_t i = 0; i < axes; i++)
                if (now_ns < leads[i].end_ns && leads[i].end_ns < next_ns)
                    next_ns = leads[i].end_ns;
            times_ns[n] = now_ns = next_ns;
            places_at(now_ns, commanded, leads, axes, &counts[n++ * axes]);
        } while (now_ns != goal_ns);
        if (made == t_ns_n)
            return n;
        follow_tick(now_ns, &delta[made * delta_columns], delta_columns, lead_ns, commanded, leads);
        times_ns[n] = now_ns;
        places_at(now_ns, commanded, leads, axes, &counts[n++ * axes]);
    }
}

/* Fill in counts [n, axes], what is behind them, speeds in microsteps/s; at rising times [n]. commanded, leads: copies
   of the state before the first tick, which change. */
API void commands_at(A1(const int64_t, times_ns, m), int64_t lead_ns, A1(const int64_t, t_ns, n),
                     A2(const int32_t, delta, n, columns), A1(int64_t, commanded, axes), A1(LEAD, leads, axes),
                     A2(int64_t, counts, m, axes), A2(double, left, m, axes), A2(double, speeds, m, axes)) {
    int64_t axes = leads_n, made = 0;
    for (int64_t n = 0; n < times_ns_n; n++) {
        int64_t now_ns = times_ns[n];
        for (; made < t_ns_n && t_ns[made] <= now_ns; made++)
            follow_tick(t_ns[made], &delta[made * delta_columns], delta_columns, lead_ns, commanded, leads);
        for (int64_t i = 0; i < axes; i++) {
            const LEAD *lead = &leads[i];
            counts[n * axes + i] = commanded[i];
            left[n * axes + i] = behind(lead, now_ns);
            speeds[n * axes + i] = lead->end_ns > now_ns ? lead->pending * SECOND_NS / (double)lead->lead_ns : 0.0;
        }
    }
}
