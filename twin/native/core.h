/* What all C of the core shares: how a function is marked for Python, and Python's meaning of a few operations. */
#pragma once
#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(_WIN32)
#define API __declspec(dllexport)
#elif defined(__ELF__)
#define API __attribute__((visibility("protected"))) /* another library's function of the same name changes nothing */
#else
#define API __attribute__((visibility("default")))
#endif
#define TEXT API const char *const
#define SPELLED(number) SPELLED_(number) /* as a text */
#define SPELLED_(number) #number

/* Arrays among the parameters of an API function (isel_twin.native): address and shape. Further words are the lengths
   that a call must have. */
#define A1(T, name, ...) T *name, int64_t name##_n
#define A2(T, name, ...) T *name, int64_t name##_rows, int64_t name##_columns
#define R(T, name) T *name

#define INLINE static inline __attribute__((always_inline))

/* What must hold of places in arrays; only a debug build looks (`make sanitize`), and ends with the line. */
#ifdef DEBUG
#include <stdio.h>
#include <stdlib.h>
#define CHECK(holds) ((holds) ? (void)0 : (fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #holds), abort()))
#else
#define CHECK(holds) ((void)0)
#endif

#define PI 3.141592653589793

/* Python's min and max: the first of two that are equal, and of a number and nan. */
INLINE double least(double a, double b) { return b < a ? b : a; }
INLINE double most(double a, double b) { return b > a ? b : a; }
INLINE int64_t least_of(int64_t a, int64_t b) { return b < a ? b : a; }
INLINE int64_t most_of(int64_t a, int64_t b) { return b > a ? b : a; }

/* A number as a whole one; where it is beyond 64 bits or nan, as of a plant that runs away, the least one. */
INLINE int64_t whole_of(double x) { return fabs(x) < 0x1p63 ? (int64_t)x : INT64_MIN; }

/* Python's //: the quotient is rounded down. */
INLINE int64_t floor_div(int64_t a, int64_t b) {
    int64_t quotient = a / b;
    return a % b != 0 && ((a % b < 0) != (b < 0)) ? quotient - 1 : quotient;
}
