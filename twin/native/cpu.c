/* What the processor can do, read from itself: compilers' own words for it differ. */
#pragma once
#include "core.h"
#if defined(__x86_64__)
#include <cpuid.h>
#endif

/* 1 if the processor has AVX2 and the system keeps its registers. */
API int64_t has_avx2(void) {
#if defined(__x86_64__)
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_AVX))
        return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_AVX2);
#else
    return 0;
#endif
}
