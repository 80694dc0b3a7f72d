/* The second closed form of the pull-out torque (curves.py). */
#pragma once
#include "../native/core.h"

typedef struct {
    double real, imag;
} COMPLEX;

INLINE double magnitude(COMPLEX z) { return hypot(z.real, z.imag); }

INLINE COMPLEX product(COMPLEX a, COMPLEX b) {
    return (COMPLEX){a.real * b.real - a.imag * b.imag, a.real * b.imag + a.imag * b.real};
}

/* a / b, by Smith's method. */
INLINE COMPLEX quotient(COMPLEX a, COMPLEX b) {
    if (fabs(b.real) >= fabs(b.imag)) {
        double ratio = b.imag / b.real, whole = b.real + b.imag * ratio;
        return (COMPLEX){(a.real + a.imag * ratio) / whole, (a.imag - a.real * ratio) / whole};
    }
    double ratio = b.real / b.imag, whole = b.real * ratio + b.imag;
    return (COMPLEX){(a.real * ratio + a.imag) / whole, (a.imag * ratio - a.real) / whole};
}

/* Python's x ** 2: by the library's pow, which rounds one of a thousand otherwise than x * x. A compiler that saw the
   number would multiply. */
INLINE double square(double x) {
    volatile double two = 2.0;
    return pow(x, two);
}

/* The point of largest imaginary part in |i| <= current and |i - centre| <= radius; 0 if they do not meet. */
INLINE COMPLEX highest(double current, COMPLEX centre, double radius) {
    if (magnitude((COMPLEX){-centre.real, current - centre.imag}) <= radius)
        return (COMPLEX){0.0, current};
    COMPLEX top = {centre.real, centre.imag + radius};
    if (magnitude(top) <= current)
        return top;
    double distance = magnitude(centre);
    double along = (square(current) - square(radius) + square(distance)) / (2.0 * distance);
    if (along >= current)
        return (COMPLEX){0.0, 0.0};
    double across = sqrt(square(current) - square(along));
    COMPLEX way = {centre.real / distance, centre.imag / distance};
    COMPLEX left = product(way, (COMPLEX){along, across});
    COMPLEX right = product(way, (COMPLEX){along, -across});
    return right.imag > left.imag ? right : left;
}

/* Fill in torque_nm [n] at speeds [n] in rev/min. current: g I; half_v: V. */
API void predict_torques(A1(const double, rpm, n), double pole_pairs, double resistance, double inductance, double km,
                         double iron_drag, double iron_knee, double current, double half_v, A1(double, torque_nm, n)) {
    for (int64_t k = 0; k < rpm_n; k++) {
        double omega = rpm[k] * 2.0 * PI / 60.0;
        COMPLEX impedance = {resistance, pole_pairs * omega * inductance};
        COMPLEX centre = quotient((COMPLEX){0.0, -omega * km}, impedance);
        double radius = half_v / magnitude(impedance);
        COMPLEX best = highest(current, centre, radius);
        double flows = magnitude(best);
        if (0.0 < flows && flows < current * (1.0 - 1e-9)) {
            double excess = current / flows;
            double clipped = 2.0 / PI * (excess * asin(1.0 / excess) + sqrt(1.0 - 1.0 / square(excess)));
            best = highest(current, centre, radius * clipped);
        }
        double iron_nm = iron_drag * omega / (1.0 + square(omega / iron_knee));
        torque_nm[k] = most(0.0, km * best.imag - iron_nm);
    }
}
