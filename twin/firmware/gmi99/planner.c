/* Speeds and accelerations of pieces and at corners of the GMI99 (planner.py, where the formulas are). */
#pragma once
#include "../../native/core.h"
#include "../../native/records.h"

/* Length of each piece, its highest speed and acceleration, its effective increments per path. */
API void gmi99_limits(A2(const double, way, n, 6), R(const GMI99_RULES, rules), A1(const double, shortest_s, n),
                      A1(double, length, n), A1(double, limit, n), A1(double, acceleration, n),
                      A2(double, per_path, n, 6)) {
    for (int64_t j = 0; j < way_rows; j++) {
        const double *along = &way[j * way_columns];
        double *share = &per_path[j * way_columns];
        double square = 0.0, longest = 0.0, plain = 0.0;
        for (int64_t slot = 0; slot < way_columns; slot++) {
            double effective = along[slot] * rules->ratio[slot];
            share[slot] = effective;
            square += rules->influence[slot] ? effective * effective : 0.0;
            longest = most(longest, fabs(effective));
            plain = most(plain, fabs(along[slot]));
        }
        if (rules->tool_speed)
            length[j] = square > 0.0 ? sqrt(square) : longest;
        else
            length[j] = plain;
        limit[j] = least(rules->speed_hz[0], length[j] / shortest_s[j]);
        acceleration[j] = rules->acceleration_hz_per_s[0];
        for (int64_t slot = 0; slot < way_columns; slot++) {
            share[slot] /= length[j];
            double part = fabs(share[slot]);
            if (part > 0.0) {
                limit[j] = least(limit[j], rules->speed_hz[slot + 1] / part);
                acceleration[j] = least(acceleration[j], rules->acceleration_hz_per_s[slot + 1] / part);
            }
        }
    }
}

/* entry[j]: highest speed from the direction in row j - 1 into that of row j; not of row 0. */
API void gmi99_corners(A2(const double, per_path, n, 6), R(const GMI99_RULES, rules), A1(double, entry, n)) {
    int64_t slots = per_path_columns;
    double jump_hz = rules->jump_hz, sharp_hz = rules->sharp_jump_hz;
    for (int64_t j = 1; j < per_path_rows; j++) {
        const double *before = &per_path[(j - 1) * slots], *after = &per_path[j * slots];
        double a = 0.0, b = 0.0, apart = 0.0, along = 0.0, change = 0.0;
        for (int64_t slot = 0; slot < slots; slot++) {
            a += before[slot] * before[slot];
            b += after[slot] * after[slot];
        }
        a = sqrt(a), b = sqrt(b);
        for (int64_t slot = 0; slot < slots; slot++) {
            double difference = before[slot] / a - after[slot] / b, sum = before[slot] / a + after[slot] / b;
            apart += difference * difference;
            along += sum * sum;
            change = most(change, fabs(before[slot] - after[slot]));
        }
        if (change > STRAIGHT) {
            double angle_deg = 2.0 * atan2(sqrt(apart), sqrt(along)) * (180.0 / PI);
            double part = least(angle_deg / RIGHT_ANGLE_DEG, 1.0);
            entry[j] = (jump_hz + (least(sharp_hz, jump_hz) - jump_hz) * part) / change;
        } else {
            entry[j] = INFINITY;
        }
    }
}
