/* A feeler along a path (touch.py). */
#pragma once
#include "touch.h"

/* The first place of a path [n, 3] at which the contact changes or the feeler breaks; n: none. The feeler is then as it
   is there. Places nearer to one that was looked at than the targets were are not looked at. */
API int64_t first_felt(R(FEELER, feeler), A1(const TARGET, targets), A2(const double, path_mm, n, 3),
                       double threshold_m, int64_t touched) {
    double x_mm = 0.0, y_mm = 0.0, z_mm = 0.0, free_mm = 0.0;
    for (int64_t k = 0; k < path_mm_rows; k++) {
        const double *place_mm = path_mm + 3 * k;
        double dx = place_mm[0] - x_mm, dy = place_mm[1] - y_mm, dz = place_mm[2] - z_mm;
        if (!touched && dx * dx + dy * dy + dz * dz < free_mm * free_mm)
            continue;
        x_mm = place_mm[0];
        y_mm = place_mm[1];
        z_mm = place_mm[2];
        feel(feeler, targets, targets_n, 1e-3 * x_mm, 1e-3 * y_mm, 1e-3 * z_mm);
        free_mm = most(0.0, -1e3 * feeler->deflected_m);
        if (feeler->broken == NEWS || (feeler->deflected_m > threshold_m) != (touched != 0))
            return k;
    }
    return path_mm_rows;
}
