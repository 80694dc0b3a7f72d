/* Uneven screws: travel, zero and stiffness of their nuts at the present places (plant/14).

   The sub-steps use constant values of a screw, which are updated once a window. With the nut at x_0 for rotor angle 0,
   mean travel r and amplitude a of the error that repeats every turn, the nut is at

       n(th) = x_0 + r th + a (sin u - sin(x_0/r))          u = th + x_0/r: the same place has the same error

   and the sub-steps use its tangent at th_0, so that nut and shaft do the same work on one another:

       r_here = r + a cos u         x_0,here = n(th_0) - r_here th_0

   At the end of a window of h the tangent is off by a (w h)^2 / 2: 1 nm with 5 um at 6 turns a second and 0.5 ms. The
   stiffness is that of bearing and nut and of the free length of the screw (isel_twin.drives.screw). From one window to
   the next a nut keeps its stretch, not its force: at 60 mm/s that is 2e-5 of what is stored in it. */
#pragma once
#include "../drives/trigonometry.h"
#include "../native/core.h"
#include "../native/records.h"

INLINE void feel_screws(MEMORY *memory) {
    for (int i = 0; i < AXES; i++) {
        const SCREW *screw = &memory->screws[i];
        AXIS_PARAMETERS *drive = &memory->drives[i];
        double theta_rad = memory->states[i].theta_rad;
        double place_m = screw->start_m + screw->travel_m_per_rad * theta_rad;
        if (screw->cyclic_m != 0.0) {
            double turn_rad = screw->start_m / screw->travel_m_per_rad, sine, cosine, start_sine, start_cosine;
            sine_and_cosine(theta_rad + turn_rad, &sine, &cosine);
            sine_and_cosine(turn_rad, &start_sine, &start_cosine);
            double nut_m = place_m + screw->cyclic_m * (sine - start_sine);
            drive->travel_m_per_rad = screw->travel_m_per_rad + screw->cyclic_m * cosine;
            memory->axes[i].zero_m = nut_m - drive->travel_m_per_rad * theta_rad;
        }
        if (screw->rod_n < INFINITY) {
            double free_m = most(0.0, place_m + screw->free_m);
            drive->stiffness_n_per_m = 1.0 / (screw->soft_m_per_n + free_m / screw->rod_n);
        }
    }
}
