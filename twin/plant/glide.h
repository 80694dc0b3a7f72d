/* MuJoCo's step written out for sliding joints between their stops, without contact (glide.py).

   If all joints slide, masses and directions do not depend on positions. So without a stop or a collision the equations
   that MuJoCo solves in each step (its chapter "Computation") are linear but for dry friction:

       a0  = M^-1 (F - g - k (q - q_s) - d v)           M: mass matrix, F: forces on the joints, g: weights
       f_i = clip(-(a0_i + b v_i) / (A_ii + R_i))       dry friction of a joint, at most its loss either way
       a   = a0 + M^-1 f                                A = M^-1, b and R: as MuJoCo softens the friction of that joint
       v'  = v + h a,   q' = q + h v'

   which is exact as long as no two joints with friction are coupled by their masses (A_ij = 0), and needs no solver. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

/* One step of h_s with the forces qfrc on the joints: joints [n], mobility [n, n], q... [n] as MuJoCo's. Returns 0 and
   changes nothing if a joint is out of its bounds. */
INLINE int glide(JOINT *joints, const double *mobility, int64_t n, double h_s, double *qpos, double *qvel, double *qacc,
                 double *qacc_smooth, const double *qfrc) {
    for (int64_t j = 0; j < n; j++)
        if (!(joints[j].low_m < qpos[j] && qpos[j] < joints[j].high_m))
            return 0;
    for (int64_t j = 0; j < n; j++) {
        double rest_n = qfrc[j] + joints[j].rest_n - joints[j].spring_n_per_m * qpos[j];
        joints[j].force_n = rest_n - joints[j].damper_n_s_per_m * qvel[j];
    }
    for (int64_t i = 0; i < n; i++) {
        double free_m_s2 = 0.0;
        for (int64_t j = 0; j < n; j++)
            free_m_s2 += mobility[i * n + j] * joints[j].force_n;
        qacc_smooth[i] = free_m_s2;
        qacc[i] = free_m_s2;
    }
    for (int64_t i = 0; i < n; i++) {
        double most_n = joints[i].friction_n;
        if (most_n > 0.0) {
            double friction_n = -joints[i].stuck_kg * (qacc_smooth[i] + joints[i].creep_per_s * qvel[i]);
            friction_n = least(most_n, most(-most_n, friction_n));
            for (int64_t j = 0; j < n; j++)
                qacc[j] += mobility[j * n + i] * friction_n;
        }
    }
    for (int64_t j = 0; j < n; j++) {
        qvel[j] += h_s * qacc[j];
        qpos[j] += h_s * qvel[j];
    }
    return 1;
}

/* A step of MuJoCo, by the addresses of `mj_step` and of its arguments. */
INLINE void step_mujoco(int64_t mj_step, int64_t model, int64_t data) {
    ((void (*)(void *, void *))(intptr_t)mj_step)((void *)(intptr_t)model, (void *)(intptr_t)data);
}
