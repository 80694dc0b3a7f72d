/* Numbers side by side in a register: the law of a drive is one text for one axis and for four.

   `sel(mask, a, b)` stands where a scalar text has a branch. Each lane computes what the scalar text does, operation by
   operation, so that its bits are the same. Four lanes pay where a register holds them (AVX2): elsewhere one axis after
   the other is as fast (drives/19). */
#pragma once
#include "core.h"

INLINE double sel_1(int64_t mask, double a, double b) { return mask ? a : b; }
INLINE int any_1(int64_t mask) { return mask != 0; }
INLINE double magnitude_1(double a) { return fabs(a); }
INLINE int64_t bits_1(double a) {
    int64_t bits;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}

/* Functions between these are made for processors with AVX2, whatever the rest is made for. `abreast` asks for them. */
#if defined(__x86_64__)
#define WIDE 1
#if defined(__clang__)
#define WIDE_BEGIN _Pragma("clang attribute push(__attribute__((target(\"avx2\"))), apply_to = function)")
#define WIDE_END _Pragma("clang attribute pop")
#else
#define WIDE_BEGIN _Pragma("GCC push_options") _Pragma("GCC target(\"avx2\")")
#define WIDE_END _Pragma("GCC pop_options")
#endif
typedef double V4 __attribute__((vector_size(32)));
typedef int64_t M4 __attribute__((vector_size(32)));
WIDE_BEGIN
INLINE V4 sel_4(M4 mask, V4 a, V4 b) { return (V4)(((M4)a & mask) | ((M4)b & ~mask)); }
INLINE int any_4(M4 mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }
INLINE V4 magnitude_4(V4 a) { return (V4)((M4)a & INT64_MAX); }
INLINE M4 bits_4(V4 a) { return (M4)a; }
WIDE_END
#else
#define WIDE 0
#endif
