/* F, from the state at a quarter period's beginning to that at its end, and its slope (stability.py).

   x and out: [STATES]; s, rest: state of the drive on the way, and where it begins. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"
#include "drives.c"

/* Advance a drive by a quarter electrical period from state x; the state then to out. */
API void quarter(R(const AXIS_PARAMETERS, p), R(const AXIS_STATE, rest), R(AXIS_STATE, s), A1(const double, command),
                 double load_nm, A1(const double, x, STATES), A1(double, out, STATES)) {
    *s = *rest;
    s->current_a_a = x[0];
    s->current_b_a = x[1];
    s->omega_rad_s = x[2];
    s->theta_rad = -x[3] / p->pole_pairs;
    s->smooth_rad = p->phase_offset_rad + x[4];
    s->lag_rad = x[5];
    s->command = -1.0;
    for (int64_t k = 0; k < command_n; k++)
        step_axis(p, s, command[k], BOTH, 1.0, 0.0, 0.0, load_nm);
    out[0] = s->current_b_a;
    out[1] = -s->current_a_a;
    out[2] = s->omega_rad_s;
    out[3] = 0.5 * PI - p->pole_pairs * s->theta_rad;
    out[4] = s->smooth_rad - p->phase_offset_rad - 0.5 * PI;
    out[5] = s->lag_rad;
}

/* Advance x by quarter periods, whose load angles go to lags [n]. 0 once half a turn of it is passed, else 1. */
API int64_t quarters(R(const AXIS_PARAMETERS, p), R(const AXIS_STATE, rest), R(AXIS_STATE, s),
                     A1(const double, command), double load_nm, A1(double, x, STATES), A1(double, lags)) {
    double out[STATES];
    for (int64_t k = 0; k < lags_n; k++) {
        quarter(p, rest, s, command, command_n, load_nm, x, STATES, out, STATES);
        memcpy(x, out, sizeof out);
        lags[k] = x[3];
        if (!(fabs(x[3]) < PI))
            return 0;
    }
    return 1;
}

/* Slope of what `quarter` makes of x over each of its numbers, by the straight line through so many points on both
   sides, away [n] apart: added to columns [n, n], one for each number that is moved; n <= STATES. */
API void slopes(R(const AXIS_PARAMETERS, p), R(const AXIS_STATE, rest), R(AXIS_STATE, s), A1(const double, command),
                double load_nm, A1(const double, x, STATES), A1(const double, away, n), int64_t points,
                A2(double, columns, n, n)) {
    double tried[STATES], up[STATES], down[STATES];
    double squares = (double)(points * (points + 1) * (2 * points + 1)) / 3.0;
    memcpy(tried, x, sizeof tried);
    for (int64_t k = 0; k < columns_rows; k++) {
        for (int64_t far = 1; far <= points; far++) {
            tried[k] = x[k] + far * away[k];
            quarter(p, rest, s, command, command_n, load_nm, tried, STATES, up, STATES);
            tried[k] = x[k] - far * away[k];
            quarter(p, rest, s, command, command_n, load_nm, tried, STATES, down, STATES);
            for (int64_t i = 0; i < columns_columns; i++)
                columns[k * columns_columns + i] += far * (up[i] - down[i]) / (squares * away[k]);
        }
        tried[k] = x[k];
    }
}
