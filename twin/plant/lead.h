/* The command of an axis between two set points (lead.py). Times are 0 to 2^62 ns, so that no sum overflows. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

/* Microsteps still to come at t_ns, which is not before the last tick. Exact if it fits into 53 bits. */
INLINE double behind(const LEAD *lead, int64_t t_ns) {
    return lead->pending * (double)most_of(lead->end_ns - t_ns, 0) / (double)lead->lead_ns;
}

/* Integral of `behind` from start_ns to end_ns, over dt_ns. */
INLINE double mean_behind(const LEAD *lead, int64_t start_ns, int64_t end_ns, int64_t dt_ns) {
    int64_t last_ns = least_of(end_ns, lead->end_ns);
    if (start_ns >= last_ns)
        return 0.0;
    int64_t ends_ns = (lead->end_ns - start_ns) + (lead->end_ns - last_ns);
    return lead->pending * (double)(last_ns - start_ns) * (double)ends_ns /
           (2.0 * (double)lead->lead_ns * (double)dt_ns);
}

INLINE void begin(LEAD *lead, int64_t t_ns, int64_t change, int64_t lead_ns) {
    lead->pending = behind(lead, t_ns) + (double)change;
    lead->end_ns = t_ns + lead_ns;
    lead->lead_ns = lead_ns;
}
