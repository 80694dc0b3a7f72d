/* The ticks of an arc (circle.py). Coordinates are below 2^29, so that squares fit. */
#pragma once
#include "../native/core.h"

/* Go on from state x, y, c = x^2 + y^2 - R^2 by so many ticks, and by one for each row of delta, written there: a step
   in column `first` or `second`. A quadrant includes the half axis on which the counter-clockwise path enters it. */
API void walk(A1(int64_t, state, 3), int64_t unseen, A2(int8_t, delta), int64_t first, int64_t second) {
    int64_t x = state[0], y = state[1], c = state[2];
    for (int64_t i = -unseen; i < delta_rows; i++) {
        int64_t rx = y > 0 || (y == 0 && x > 0) ? -1 : 1;
        int64_t ry = x > 0 || (x == 0 && y < 0) ? 1 : -1;
        int inward = c + rx * x + ry * y + 1 > 0;
        int steps_x = inward == (rx * x < 0); /* X goes inwards in quadrants I and III, outwards in II and IV */
        if (steps_x) {
            c += 2 * rx * x + 1;
            x += rx;
        } else {
            c += 2 * ry * y + 1;
            y += ry;
        }
        if (i >= 0)
            delta[i * delta_columns + (steps_x ? first : second)] = (int8_t)(steps_x ? rx : ry);
    }
    state[0] = x, state[1] = y, state[2] = c;
}
