/* The edges of a value change dump and its lines (vcd.py). */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

/* Lay the lines of a dump into out, and return what they fill: text which[i] of the pool, after a line with its time,
   which is not negative, if that is new. ends [texts + 1]: where each text of the pool begins, and the last one
   ends. */
API int64_t lay_lines(A1(const int64_t, times_ns, n), A1(const uint8_t, new, n), A1(const int64_t, which, n),
                      A1(const uint8_t, pool), A1(const int64_t, ends), A1(uint8_t, out)) {
    int64_t at = 0;
    for (int64_t i = 0; i < times_ns_n; i++) {
        if (new[i]) {
            int64_t digits = 1;
            uint64_t time_ns = (uint64_t)times_ns[i];
            for (uint64_t rest = time_ns / 10; rest; rest /= 10)
                digits++;
            CHECK(at + digits + 2 <= out_n);
            out[at] = '#';
            for (int64_t k = digits; k > 0; k--, time_ns /= 10)
                out[at + k] = (uint8_t)('0' + time_ns % 10);
            at += digits + 2;
            out[at - 1] = '\n';
        }
        CHECK(which[i] >= 0 && which[i] + 1 < ends_n && ends[which[i] + 1] <= pool_n);
        CHECK(at + ends[which[i] + 1] - ends[which[i]] <= out_n);
        for (int64_t k = ends[which[i]]; k < ends[which[i] + 1]; k++)
            out[at++] = pool[k];
    }
    return at;
}

typedef struct {
    int64_t *t_ns, *codes;
    int64_t room, count;
} EDGES;

/* Edge 2 k sets signal k to 0, edge 2 k + 1 sets it to 1. */
INLINE void add_edge(EDGES *made, int64_t t_ns, int64_t signal, int level) {
    CHECK(made->count < made->room);
    made->t_ns[made->count] = t_ns;
    made->codes[made->count++] = 2 * signal + level;
}

/* Lay the edges of ticks into edge_ns and codes [4 a tick and axis], and return their number. rose_ns, minus, full,
   high [axes]: time of the tick before, and what it left of each axis; the latter three are left as the last tick
   leaves them. Signals: pulses of all axes, directions, and if `doubled` full steps. */
API int64_t lay_edges(A1(const int64_t, t_ns, n), A2(const int32_t, delta, n, axes), int64_t rose_ns,
                      A1(uint8_t, minus, axes), A1(uint8_t, full, axes), A1(uint8_t, high, axes), int64_t doubled,
                      A1(int64_t, edge_ns, m), A1(int64_t, codes, m)) {
    EDGES made = {edge_ns, codes, edge_ns_n, 0};
    int64_t axes = delta_columns;
    for (int64_t k = 0; k < t_ns_n; k++) {
        const int32_t *change = delta + k * axes;
        int room = t_ns[k] - rose_ns >= 2;
        int64_t middle_ns = room ? (rose_ns + t_ns[k]) / 2 : t_ns[k], set_ns = most_of(t_ns[k] - SETUP_NS, middle_ns);
        for (int64_t i = 0; i < axes; i++) {
            if (high[i] && !room && (change[i] || t_ns[k] == rose_ns))
                continue;
            if (high[i])
                add_edge(&made, least_of(rose_ns + PULSE_NS, middle_ns), i, 0);
            high[i] = 0;
        }
        for (int64_t i = 0; i < axes; i++)
            if (change[i] && (change[i] < 0) != minus[i]) {
                minus[i] = change[i] < 0;
                add_edge(&made, set_ns, axes + i, minus[i]);
            }
        for (int64_t i = 0; doubled && i < axes; i++) {
            int wide = change[i] > 1 || change[i] < -1;
            if (change[i] && wide != full[i]) {
                full[i] = (uint8_t)wide;
                add_edge(&made, set_ns, 2 * axes + i, wide);
            }
        }
        for (int64_t i = 0; i < axes; i++)
            if (change[i] && !high[i]) {
                add_edge(&made, t_ns[k], i, 1);
                high[i] = 1;
            }
        rose_ns = t_ns[k];
    }
    return made.count;
}
