/* Masses at the nuts and springs of the structure (weighing.py). */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

#define LEAST_PULL_N 0.5e-6 /* at a carriage; less is rounding */

/* Fill in masses at the nuts and springs: mobility [nv, nv] of the joints; stiffness, damping [nv]: of each, which has
   one coordinate. */
API void spring(R(MEMORY, memory), A2(const double, mobility, n, n), A1(const double, stiffness, n),
                A1(const double, damping, n)) {
    int64_t n = mobility_rows;
    for (int i = 0; i < AXES; i++) {
        int64_t dof = memory->axes[i].dof;
        memory->axes[i].mobility_per_kg = mobility[dof * n + dof];
        for (int64_t j = 0; j < n; j++) {
            memory->springs[i * n + j] = -mobility[dof * n + j] * stiffness[j];
            memory->springs[(AXES + i) * n + j] = -mobility[dof * n + j] * damping[j];
        }
    }
}

/* Let nuts and carriages stand at rest at qpos [nv]: in the middle of the backlash or, pulled by weight [nv], on the
   flank (plant/8). */
API void balance(R(MEMORY, memory), A1(const double, qpos, n), A1(const double, weight, n)) {
    for (int64_t j = 0; j < qpos_n; j++)
        memory->before[j] = memory->place[j] = qpos[j];
    for (int i = 0; i < AXES; i++) {
        int64_t dof = memory->axes[i].dof;
        double zero_m = qpos[dof];
        if (fabs(weight[dof]) > LEAST_PULL_N)
            zero_m += copysign(memory->drives[i].half_backlash_m, weight[dof]);
        memory->axes[i].zero_m = memory->screws[i].start_m = zero_m;
    }
}

/* 1 if the squares of all frequencies of masses [n, n] on springs [n] are below the highest one: if highest * masses -
   springs is positive definite, by Cholesky's factors. scratch [n, n]. */
API int64_t holds(A2(const double, inertia, n, n), A1(const double, stiffness, n), double highest_per_s2,
                  A2(double, scratch, n, n)) {
    int64_t n = stiffness_n;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j <= i; j++) {
            double left = highest_per_s2 * inertia[i * n + j] - (i == j ? stiffness[i] : 0.0);
            for (int64_t k = 0; k < j; k++)
                left -= scratch[i * n + k] * scratch[j * n + k];
            if (i > j)
                scratch[i * n + j] = left / scratch[j * n + j];
            else if (left > 0.0)
                scratch[i * n + i] = sqrt(left);
            else
                return 0;
        }
    return 1;
}
