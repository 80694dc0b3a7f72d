/* How far a motor is from losing step at one moment (margin.py). */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

#define LEAST_NM 1e-6 /* less counts as no torque */

/* Pull-out margin. torque_nm: mean over a window; speed_rad_s: as the voltage scales it; available_nm [SPEEDS]:
   `available_torque`; fraction: of the nominal current, which may be lowered at rest. */
INLINE double margin(double torque_nm, double lag_full_steps, double speed_rad_s, const double *available_nm,
                     double fraction) {
    double place = least(fabs(speed_rad_s) / SPEED_STEP_RAD_S, SPEEDS - 1.0);
    int64_t k = place < SPEEDS - 2 ? (int64_t)place : SPEEDS - 2; /* of nan, too, some entry */
    double largest_nm = available_nm[k] + (place - (double)k) * (available_nm[k + 1] - available_nm[k]);
    largest_nm = least(largest_nm, fraction * available_nm[0]);
    double by_torque = 1.0 - fabs(torque_nm) / most(largest_nm, LEAST_NM);
    double nearest = lag_full_steps - 4.0 * (double)whole_of(floor(0.25 * lag_full_steps + 0.5));
    double by_angle = 1.0 - 0.5 * fabs(nearest);
    return most(0.0, least(by_torque, by_angle));
}
