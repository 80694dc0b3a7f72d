/* The constants of a step written out, and its comparison with MuJoCo's (glide.py). All arrays have as many rows as
   there are joints, where not said; Python takes them from one model. */
#pragma once
#include "glide.h"

#define LEAST_SOFT 1e-15 /* of R, MuJoCo's mjMINVAL */
#define AGREE_M_S 1e-9 /* largest difference to MuJoCo's speed after a step; its solver stops at a tenth of that */

/* Fill in joints [n]. bounds [2, n], mobility [n, n], others [n]; place: where the spring is without force. */
API void write_out(A1(JOINT, joints, n), A2(const double, bounds, 2, n), A2(const double, mobility, n, n),
                   A1(const double, weight_n, n), A1(const double, stiffness, n), A1(const double, place, n),
                   A1(const double, damping, n), A1(const double, loss, n), A1(const double, inverse_kg, n),
                   A1(const double, creep, n), A1(const double, impedance, n)) {
    int64_t n = joints_n;
    for (int64_t j = 0; j < n; j++) {
        JOINT *joint = &joints[j];
        joint->low_m = bounds[j];
        joint->high_m = bounds[n + j];
        joint->rest_n = stiffness[j] * place[j] - weight_n[j];
        joint->spring_n_per_m = stiffness[j];
        joint->damper_n_s_per_m = damping[j];
        joint->friction_n = loss[j];
        joint->creep_per_s = creep[j];
        double soft_per_kg = most(LEAST_SOFT, (1.0 - impedance[j]) * inverse_kg[j] / impedance[j]); /* R */
        joint->stuck_kg = 1.0 / (mobility[j * n + j] + soft_per_kg);
    }
}

/* 1 if steps equal MuJoCo's: at rest, creeping, moving, each unpushed and pushed, at one end of the bounds, the other
   or between. qpos, qvel, qfrc are those of `data`; scratch [4, n]. */
API int64_t agrees(A1(JOINT, joints, n), A2(const double, mobility, n, n), double h_s, int64_t mj_step, int64_t model,
                   int64_t data, A2(const double, bounds, 2, n), A1(double, qpos, n), A1(double, qvel, n),
                   A1(double, qfrc, n), A2(double, scratch, 4, n)) {
    int64_t n = joints_n;
    double *q = scratch, *v = scratch + n, *a = scratch + 2 * n, *a_smooth = scratch + 3 * n;
    for (int i = 0; i < 12; i++) {
        double share = i % 3 == 0 ? 0.01 : i % 3 == 1 ? 0.5 : 0.99;
        double speed_m_s = i < 3 ? 0.0 : i < 6 ? 1e-6 : i < 9 ? -0.1 : 0.3;
        int turned = (i + i / 3) % 3; /* each push at each place, and with each speed */
        double push_n = turned == 0 ? 0.0 : turned == 1 ? 10.0 : -200.0;
        for (int64_t j = 0; j < n; j++) {
            q[j] = qpos[j] = (1.0 - share) * bounds[j] + share * bounds[n + j];
            v[j] = qvel[j] = j % 2 ? speed_m_s : -speed_m_s;
            qfrc[j] = push_n;
        }
        glide(joints, mobility, n, h_s, q, v, a, a_smooth, qfrc);
        step_mujoco(mj_step, model, data);
        for (int64_t j = 0; j < n; j++)
            if (!(fabs(v[j] - qvel[j]) < AGREE_M_S))
                return 0;
    }
    return 1;
}
