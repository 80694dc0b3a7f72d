/* Rows of changes as ticks (spreading.py). A row has at most 2^20 steps of an axis and 2^36 ns. */
#pragma once
#include "../native/core.h"

/* When an axis makes its next step, after the beginning of a row; -1 if it has made all of them. */
INLINE int64_t next_step_ns(int64_t change, int64_t made, int64_t duration_ns) {
    int64_t steps = most_of(change, -change);
    return made < steps ? (2 * made + 1) * duration_ns / (2 * steps) : -1;
}

/* Write the ticks of a row to t_ns and to rows of zeros of delta, as many as all axes have steps; return their number.
   made: zeros, one an axis. */
API int64_t spread(A1(const int64_t, changes, axes), int64_t start_ns, int64_t duration_ns, A1(int64_t, made, axes),
                   A1(int64_t, t_ns, n), A2(int8_t, delta, n, axes)) {
    int64_t ticks = 0;
    for (;; ticks++) {
        int64_t first_ns = -1;
        for (int64_t axis = 0; axis < changes_n; axis++) {
            int64_t at_ns = next_step_ns(changes[axis], made[axis], duration_ns);
            if (at_ns >= 0 && (first_ns < 0 || at_ns < first_ns))
                first_ns = at_ns;
        }
        if (first_ns < 0)
            return ticks;
        t_ns[ticks] = start_ns + first_ns;
        for (int64_t axis = 0; axis < changes_n; axis++)
            if (next_step_ns(changes[axis], made[axis], duration_ns) == first_ns) {
                delta[ticks * changes_n + axis] = changes[axis] > 0 ? 1 : -1;
                made[axis]++;
            }
    }
}
