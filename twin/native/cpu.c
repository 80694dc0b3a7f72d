/* What the processor can do, read from itself: 3 if it has all of x86-64-v3 and the system keeps its wide registers, 2 if
   not, 0 on other processors. */
#pragma once
#include "core.h"
#if defined(__x86_64__)
#include <cpuid.h>
#endif

API int64_t cpu_level(void) {
#if defined(__x86_64__)
    const unsigned first = bit_FMA | bit_MOVBE | bit_OSXSAVE | bit_AVX | bit_F16C; /* of leaf 1, ecx */
    const unsigned seventh = bit_AVX2 | bit_BMI | bit_BMI2;                        /* of leaf 7, ebx */
    const unsigned extended = 1u << 5; /* lzcnt, of leaf 0x80000001, ecx */
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & first) != first)
        return 2;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & 6) != 6 || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || (b & seventh) != seventh)
        return 2;
    return __get_cpuid(0x80000001, &a, &b, &c, &d) && (c & extended) ? 3 : 2;
#else
    return 0;
#endif
}
