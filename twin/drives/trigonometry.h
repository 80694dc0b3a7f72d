/* Sine and cosine of one angle at once, precise to the last digit, at a third of the cost of two calls.

   Half of the cost of a drive's sub-step is sines. After reduction to the nearest quarter turn two short polynomials do:

       n = round(x 2/pi),  r = x - n pi/2,  |r| <= pi/4      pi/2 in two parts, n times the first of them is exact

            n mod 4     0        1        2        3
            sin x     sin r    cos r   -sin r   -cos r
            cos x     cos r   -sin r   -cos r    sin r

   Coefficients: fdlibm (Sun Microsystems, 1993, freely granted), k_sin.c and k_cos.c, errors below 2^-58. The result is
   within 2^-52 of the truth, and below 10^6 rad does not depend on the machine's mathematical library: so every sine of
   a sub-step is this one (drives/18). */
#pragma once
#include "../native/core.h"

#define FAR_RAD 1e6 /* from here on the library is used: 3000 turns of a rotor with 50 pole pairs */
#define ROUND 6755399441055744.0 /* 1.5 2^52: added and taken away, it leaves the nearest whole number */
#define HALF_PI_HIGH 1.57079632673412561417 /* the first 33 bits of pi/2 */
#define HALF_PI_LOW 6.07710050650619224932e-11

INLINE void sine_and_cosine(double angle_rad, double *sine, double *cosine) {
    if (!(fabs(angle_rad) < FAR_RAD)) {
        *sine = sin(angle_rad);
        *cosine = cos(angle_rad);
        return;
    }
    double quarters = (angle_rad * (2.0 / PI) + ROUND) - ROUND;
    double r = (angle_rad - quarters * HALF_PI_HIGH) - quarters * HALF_PI_LOW;
    double z = r * r;
    double w = z * z;
    double odd = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06);
    odd += z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    double sine_r = r + z * r * (-1.66666666666666324348e-01 + z * odd);
    double even = -1.38888888888741095749e-03 + z * 2.48015872894767294178e-05;
    even = z * (4.16666666666666019037e-02 + z * even);
    even += w * w * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
    double cosine_r = 1.0 - (0.5 * z - z * even);
    int64_t quarter = (int64_t)quarters;
    double s = quarter & 1 ? cosine_r : sine_r;
    double c = quarter & 1 ? sine_r : cosine_r;
    *sine = quarter & 2 ? -s : s;
    *cosine = (quarter + 1) & 2 ? -c : c;
}
