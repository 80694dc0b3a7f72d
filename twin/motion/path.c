/* Steps spread evenly over the ticks of a path (path.py). */
#pragma once
#include "../native/core.h"

/* Write the steps of each axis that has any into its column of zeros: delta[i] is tick first + 1 + i of `ticks`. No
   axis has more steps than there are ticks, and these are below 2^40. */
API void fill_even(A2(int8_t, delta, n, axes), A1(const int64_t, steps, axes), int64_t first, int64_t ticks) {
    for (int64_t axis = 0; axis < delta_columns; axis++) {
        int8_t step = steps[axis] < 0 ? -1 : 1;
        int64_t twice = 2 * steps[axis] * step;
        if (twice == 0)
            continue;
        /* Step j falls at the first tick k with 2 k |n| + ticks >= 2 ticks j: they lie whole + part / twice apart. */
        int64_t whole = 2 * ticks / twice, part = 2 * ticks % twice;
        int64_t done = (int64_t)(((__int128)first * twice + ticks) / (2 * ticks));
        __int128 next = (__int128)(2 * done + 1) * ticks + twice - 1;
        int64_t i = (int64_t)(next / twice) - first - 1, rest = (int64_t)(next % twice);
        while (i < delta_rows) {
            delta[i * delta_columns + axis] = step;
            i += whole;
            rest += part;
            if (rest >= twice) {
                rest -= twice;
                i++;
            }
        }
    }
}
