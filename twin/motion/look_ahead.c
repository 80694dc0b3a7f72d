/* Look-ahead over a chain of pieces, its ramps, and places on them (look_ahead.py; formulas: joined.py). */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

#define NOISE 1e-11       /* relative rounding error of v^2: a joint speed missed by less counts as kept */
#define PLACE_NOISE 1e-12 /* relative rounding error of places on a piece */

/* Check pieces: the index in FAULTS of the first fault found, 0 for none. */
API int64_t faults(A2(const double, displacement, n, axes), A1(const double, length, n), A1(const double, speed, n),
                   A1(const double, limit, n), A1(const double, acceleration, n), A1(const double, entry, n)) {
    for (int64_t j = 0; j < displacement_rows; j++) {
        for (int64_t axis = 0; axis < displacement_columns; axis++) {
            double way = displacement[j * displacement_columns + axis], parts = way * FRACTIONS;
            if (!(fabs(way) < FARTHEST && parts == rint(parts)))
                return 1;
        }
        if (!(0.0 < length[j] && length[j] < INFINITY))
            return 2;
        if (!(speed[j] > 0.0 && limit[j] > 0.0 && entry[j] >= 0.0))
            return 3;
        if (!(least(speed[j], limit[j]) < INFINITY))
            return 4;
        if (!(0.0 < acceleration[j] && acceleration[j] < INFINITY))
            return 5;
    }
    return 0;
}

/* Rounding error of v^2 on a piece. */
INLINE double slack_of(double v, double mean, double length) {
    return NOISE * v * v + 2.0 * mean * PLACE_NOISE * length;
}

/* The highest speed at the beginning of a piece from which it can brake to v. */
INLINE double reach_of(const PLAN_PIECE *piece, double v, double factor) {
    return sqrt(v * v + 2.0 * factor * piece->acceleration * piece->length);
}

/* Fill in joint [n + 1], the speeds at the beginnings of pieces and the end; return whether all entry speeds are kept
   and the final speed is 0. */
INLINE int64_t join_pieces(double s, double v, const PLAN_PIECE *table, int64_t n, const double *wanted, double factor,
                    double *joint) {
    joint[n] = 0.0;
    for (int64_t j = n - 1; j > 0; j--)
        joint[j] = least(least(table[j].entry, least(wanted[j - 1], wanted[j])),
                         reach_of(&table[j], joint[j + 1], factor));
    joint[0] = v;
    int64_t kept = 1;
    for (int64_t j = 0; j < n; j++) {
        double mean = factor * table[j].acceleration, length = table[j].length;
        double change = 2.0 * mean * (length - (j == 0 ? s : 0.0));
        double square = joint[j] * joint[j], slack = slack_of(joint[j], mean, length);
        if (joint[j + 1] * joint[j + 1] > square + change) {
            joint[j + 1] = sqrt(square + change);
        } else if (square - change > joint[j + 1] * joint[j + 1] + slack) {
            joint[j + 1] = sqrt(square - change); /* the speed before allows no less (motion/11) */
            double entry = j + 1 < n ? table[j + 1].entry : 0.0;
            if (square - change > entry * entry + slack)
                kept = 0;
        }
    }
    return kept;
}

/* Lay phases over the pieces of `table`, from place s of the first one, speed v and time t to the end of the last.

   wanted: highest speeds, one a piece. factor: mean over peak acceleration of a ramp. joint: scratch [n + 1]. Writes to
   phases [3 n], piece [3 n] (row of the table), back [3 n] (phases since the beginning of the piece or, in the first
   one, of the plan). Returns the number of phases, and in `told` the last joint that does not depend on where the chain
   ends, and whether all entry speeds are kept and the final speed is 0. */
API int64_t lay(double t, double s, double v, A1(const PLAN_PIECE, table, n), A1(const double, wanted, n),
                double factor, A1(double, joint, n + 1), A1(PLAN_PHASE, phases, 3 * n), A1(int32_t, piece, 3 * n),
                A1(int8_t, back, 3 * n), A1(int64_t, told, 2)) {
    told[0] = 0;
    told[1] = join_pieces(s, v, table, table_n, wanted, factor, joint);
    for (int64_t j = table_n - 1; j > 0; j--)
        if (joint[j] < reach_of(&table[j], joint[j + 1], factor)) {
            told[0] = j;
            break;
        }
    int64_t count = 0;
    for (int64_t j = 0; j < table_n; j++) {
        double v0 = joint[j], v1 = joint[j + 1], peak = wanted[j];
        double mean = factor * table[j].acceleration;
        double begins = j == 0 ? s : 0.0, end = table[j].length;
        if (v0 > peak) {
            peak = most(peak, v1);
        } else {
            peak = least(peak, sqrt((2.0 * mean * (end - begins) + v0 * v0 + v1 * v1) / 2.0));
            peak = most(peak, most(v0, v1));
        }
        double up = fabs(peak * peak - v0 * v0) / (2.0 * mean);
        double down = (peak * peak - v1 * v1) / (2.0 * mean);
        double cruise = end - begins - up - down;
        int steady = peak > 0.0 && (cruise > PLACE_NOISE * end || (peak == v0 && peak == v1));
        int64_t first = count;
        if (peak != v0) {
            double to = steady || peak != v1 ? begins + up : end;
            phases[count++] = (PLAN_PHASE){t, fabs(peak - v0) / mean, begins, least(to, end), v0, peak};
            t += phases[count - 1].dt;
        }
        if (steady) {
            double from = count == first ? begins : phases[count - 1].s1;
            double to = peak != v1 ? most(end - down, from) : end;
            phases[count++] = (PLAN_PHASE){t, (to - from) / peak, from, to, peak, peak};
            t += phases[count - 1].dt;
        }
        if (peak != v1) {
            double from = count == first ? begins : phases[count - 1].s1;
            phases[count++] = (PLAN_PHASE){t, (peak - v1) / mean, from, end, peak, v1};
            t += phases[count - 1].dt;
        }
        for (int64_t row = first; row < count; row++) {
            piece[row] = (int32_t)j;
            back[row] = (int8_t)(row - first);
        }
    }
    return count;
}

/* Brake to standstill along the pieces of `table`; otherwise like `lay`. phases: [n].

   Returns the number of phases, and in `told` 0 and whether all entry speeds are kept and it comes to rest before the
   end. */
API int64_t brake(double t, double s, double v, A1(const PLAN_PIECE, table, n), double factor,
                  A1(PLAN_PHASE, phases, n), A1(int32_t, piece, n), A1(int8_t, back, n), A1(int64_t, told, 2)) {
    told[0] = 0;
    told[1] = 1;
    for (int64_t j = 0; j < table_n; j++) {
        double mean = factor * table[j].acceleration, end = table[j].length;
        double slack = slack_of(v, mean, end), square = v * v - 2.0 * mean * (end - s);
        piece[j] = (int32_t)j;
        back[j] = 0;
        if (square <= slack) {
            double place = least(s + v * v / (2.0 * mean), end);
            if (end - place <= PLACE_NOISE * end)
                place = end;
            phases[j] = (PLAN_PHASE){t, v / mean, s, place, v, 0.0};
            return j + 1;
        }
        double after = sqrt(square);
        phases[j] = (PLAN_PHASE){t, (v - after) / mean, s, end, v, after};
        t += phases[j].dt;
        if (j + 1 == table_n || square > table[j + 1].entry * table[j + 1].entry + slack)
            told[1] = 0;
        v = after, s = 0.0;
    }
    told[1] = 0;
    return table_n;
}

/* Place on the piece x seconds after the beginning of a phase, at most its end. */
INLINE double place_at(double x, const PLAN_PHASE *phase, int64_t sine) {
    if (x >= phase->dt)
        return phase->s1;
    double dt = phase->dt, v0 = phase->v0, dv = phase->v1 - phase->v0, moved;
    if (sine)
        moved = v0 * x + dv * (x / 2.0 - dt / (2.0 * PI) * sin(PI * x / dt));
    else
        moved = v0 * x + dv * x * x / (2.0 * dt);
    return least(phase->s0 + moved, phase->s1);
}

/* Speed x seconds after the beginning of a phase; 0 after its end if nothing follows. */
INLINE double speed_at(double x, const PLAN_PHASE *phase, int64_t sine) {
    if (x >= phase->dt)
        return phase->v1;
    double wave = sine ? sin(PI * x / (2.0 * phase->dt)) : 0.0;
    return phase->v0 + (phase->v1 - phase->v0) * (sine ? wave * wave : x / phase->dt);
}

/* The last phase that begins at or before t, at or after `row`; -1 before the first one. */
INLINE int64_t row_at(double t, const PLAN_PHASE *phases, int64_t n, int64_t row) {
    while (row < n - 1 && phases[row + 1].t <= t)
        row++;
    return row;
}

INLINE int64_t first_row(double t, const PLAN_PHASE *phases, int64_t n) {
    int64_t low = 0, high = n;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (phases[middle].t <= t)
            low = middle + 1;
        else
            high = middle;
    }
    return low - 1;
}

/* The phase at time t, -1 before the first; there place on the piece and speed. */
API int64_t plan_state(double t, A1(const PLAN_PHASE, phases), int64_t sine, A1(double, state, 2)) {
    int64_t row = first_row(t, phases, phases_n);
    state[0] = row < 0 ? 0.0 : place_at(t - phases[row].t, &phases[row], sine);
    state[1] = row < 0 ? 0.0 : speed_at(t - phases[row].t, &phases[row], sine);
    return row;
}

/* For ticks k, k + 1, ...: place[i] on the piece in row number[i] of the table; -1 before the first phase. */
API void places(int64_t k, double period_s, A1(const PLAN_PHASE, phases, n), A1(const int32_t, piece, n), int64_t sine,
                A1(double, place, m), A1(int64_t, number, m)) {
    int64_t row = first_row((double)k * period_s, phases, phases_n);
    for (int64_t i = 0; i < place_n; i++) {
        double t = (double)(k + i) * period_s;
        row = row_at(t, phases, phases_n, row);
        place[i] = row < 0 ? 0.0 : place_at(t - phases[row].t, &phases[row], sine);
        number[i] = row < 0 ? -1 : piece[row];
    }
}

/* out[i, axis]: position at tick k + i in whole increments, on straight pieces. corner: [pieces + 1, axes]. */
API void positions(int64_t k, double period_s, A1(const PLAN_PHASE, phases, n), A1(const int32_t, piece, n),
                   int64_t sine, A1(const PLAN_PIECE, table, pieces), A2(const double, corner, pieces + 1, axes),
                   A2(int64_t, out, m, axes)) {
    int64_t axes = out_columns, row = first_row((double)k * period_s, phases, phases_n);
    for (int64_t i = 0; i < out_rows; i++) {
        double t = (double)(k + i) * period_s;
        row = row_at(t, phases, phases_n, row);
        int64_t j = row < 0 ? 0 : piece[row];
        double place = row < 0 ? 0.0 : place_at(t - phases[row].t, &phases[row], sine);
        for (int64_t axis = 0; axis < axes; axis++) {
            double corner_at = corner[j * axes + axis], corner_whole = rint(corner_at), way = 0.0;
            if (row >= 0)
                way = (corner[(j + 1) * axes + axis] - corner_at) * place / table[j].length;
            int64_t whole = whole_of(corner_whole), rest = whole_of(rint(corner_at - corner_whole + way));
            out[i * axes + axis] = (int64_t)((uint64_t)whole + (uint64_t)rest);
        }
    }
}
