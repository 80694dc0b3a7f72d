/* Sine and cosine of one angle at once, precise to the last digit, at a third of the cost of two calls.

   Half of the cost of a drive's sub-step is sines. After reduction to the nearest quarter turn two short polynomials
   do:

       n = round(x 2/pi),  r = x - n pi/2,  |r| <= pi/4       pi/2 in two parts, n times the first of them is exact

            n mod 4     0        1        2        3
            sin x     sin r    cos r   -sin r   -cos r
            cos x     cos r   -sin r   -cos r    sin r

   Coefficients: fdlibm (Sun Microsystems, 1993, freely granted), k_sin.c and k_cos.c, errors below 2^-58. The result is
   within 2^-52 of the truth, and below FAR_RAD does not depend on the machine's mathematical library: so every sine of
   a sub-step is this one (drives/18).

   Text of law.h, for each width. */

#if LANES == 1
#define FAR_RAD 1e6 /* from here on the library is used: 3000 turns of a rotor with 50 pole pairs */
#define ROUND 6755399441055744.0 /* 1.5 2^52: added, it makes the nearest whole number the lowest bits */
#define HALF_PI_HIGH 1.57079632673412561417 /* the first 33 bits of pi/2 */
#define HALF_PI_LOW 6.07710050650619224932e-11
#endif

INLINE void OF(sine_and_cosine)(V angle_rad, V *sine, V *cosine) {
    V shifted = angle_rad * (2.0 / PI) + ROUND;
    V quarters = shifted - ROUND;
    M quarter = BITS(shifted);
    V r = (angle_rad - quarters * HALF_PI_HIGH) - quarters * HALF_PI_LOW;
    V z = r * r, w = z * z;
    V odd = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06);
    odd += z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    V s = r + z * r * (-1.66666666666666324348e-01 + z * odd);
    V even = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05));
    even += w * w * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
    V c = 1.0 - (0.5 * z - z * even);
    M odd_quarter = (quarter & 1) != 0;
    *sine = SEL(odd_quarter, c, s);
    *cosine = SEL(odd_quarter, s, c);
    *sine = SEL((quarter & 2) != 0, -*sine, *sine);
    *cosine = SEL(((quarter + 1) & 2) != 0, -*cosine, *cosine);
    if (ANY(NOT(ABS(angle_rad) < FAR_RAD))) {
        double far_rad[LANES], sines[LANES], cosines[LANES];
        memcpy(far_rad, &angle_rad, sizeof far_rad);
        memcpy(sines, sine, sizeof sines);
        memcpy(cosines, cosine, sizeof cosines);
        for (int k = 0; k < LANES; k++)
            if (!(fabs(far_rad[k]) < FAR_RAD))
                sines[k] = sin(far_rad[k]), cosines[k] = cos(far_rad[k]);
        memcpy(sine, sines, sizeof sines);
        memcpy(cosine, cosines, sizeof cosines);
    }
}
