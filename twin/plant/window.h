/* From window to window of the loop: what MuJoCo gives and takes, how long the next one is, rest (kernel.c). */
#pragma once
#include "../drives/law.h"
#include "../native/core.h"
#include "../native/records.h"
#include "glide.h"
#include "thread.h"

#define REST_M_S 5e-6 /* speed below which a joint counts as at rest */
#define HELD_M_S2 1e-3 /* constraint acceleration beyond friction: a carriage is held; rounding is far below */
#define LEAST_BEND_M 1e-9 /* of a tool, below which the machine may rest */
#define SHAKEN_M_S 0.25 /* speed of a joint of the structure beyond which windows become fine */
#define CALM 40 /* fine windows without it, after which they are as usual again */

/* Take the carriages from MuJoCo at the start of a window.

   Constraint forces up to the guide friction are friction; more than that is a stop or a collision: the carriage cannot
   go on that way, however the nut pushes. */
INLINE void take_carriages(MEMORY *memory) {
    for (int i = 0; i < AXES; i++) {
        AXIS *axis = &memory->axes[i];
        int64_t dof = axis->dof;
        axis->x_m = memory->qpos[dof];
        axis->v_m_s = memory->qvel[dof];
        double push_m_s2 = memory->qacc[dof] - memory->qacc_smooth[dof];
        int free = fabs(push_m_s2) <= axis->mobility_per_kg * axis->friction_n + HELD_M_S2;
        axis->held = free ? 0.0 : copysign(1.0, push_m_s2);
        axis->rest_m_s2 = memory->qacc_smooth[dof] - axis->mobility_per_kg * axis->mean_n;
        axis->sum_n = 0.0;
        axis->sum_nut_n = 0.0;
    }
}

/* Leave the frozen state; the elapsed part of the window gets the force that held the carriage. */
static void wake_up(MEMORY *memory) {
    PLANT *plant = memory->plant;
    plant->settled = 0;
    if (!plant->frozen)
        return;
    plant->frozen = 0;
    plant->held = 0;
    plant->quiet = 0;
    double over = (double)(plant->now % plant->window);
    for (int i = 0; i < AXES; i++) {
        AXIS *axis = &memory->axes[i];
        AXIS_STATE *state = &memory->states[i];
        if (memory->drives[i].kind == SERVO) {
            int64_t loop = memory->drives[i].loop_substeps;
            state->heat = cool(&memory->drives[i], state, plant->now - plant->frozen_at);
            state->due = (loop - plant->now % loop) % loop + 1;
        }
        axis->sum_n = axis->mean_n * over;
        axis->sum_nut_n = axis->mean_nut_n * over;
        axis->sum_nm = axis->mean_nm * over;
        memory->feeler->sum_n[i] = memory->feeler->mean_n[i] * over;
    }
    memory->supply->energy_j = memory->supply->mean_j * over / (double)plant->window;
}

static void freeze(MEMORY *memory) {
    memory->plant->frozen = 1;
    memory->plant->frozen_at = memory->plant->now;
    for (int64_t j = 0; j < memory->joints; j++) {
        memory->qvel[j] = 0.0;
        memory->rates[j] = 0.0;
        memory->before[j] = memory->qpos[j];
    }
    CUT *cut = memory->cut;
    cut->x_m_s = cut->y_m_s = cut->bend_m[0] = cut->bend_m[1] = 0.0;
}

/* Set the forces on the joints to what the window had; 1 if they let the machine rest. */
INLINE int gather_forces(MEMORY *memory) {
    PLANT *plant = memory->plant;
    CUT *cut = memory->cut;
    FEELER *feeler = memory->feeler;
    double *qfrc = memory->qfrc, *push = memory->push, *tip = memory->tip_joints, window = (double)plant->window;
    int64_t n = memory->joints;
    int quiet = plant->led_until_ns <= plant->now * plant->substep_ns && memory->supply->steady != 0;
    for (int64_t j = 0; j < n; j++) {
        qfrc[j] = push[j] + push[n + j] / window;
        push[n + j] = 0.0;
    }
    if (cut->sum_x_n != 0.0 || cut->sum_y_n != 0.0) {
        quiet = 0;
        for (int64_t j = 0; j < n; j++)
            qfrc[j] += (tip[j] * cut->sum_x_n + tip[n + j] * cut->sum_y_n) / window;
        cut->sum_x_n = 0.0;
        cut->sum_y_n = 0.0;
    }
    if (cut->on && most(fabs(cut->bend_m[0]), fabs(cut->bend_m[1])) > LEAST_BEND_M)
        quiet = 0;
    for (int i = 0; feeler->on && i < AXES; i++) {
        feeler->mean_n[i] = feeler->sum_n[i] / window;
        feeler->sum_n[i] = 0.0;
        for (int64_t j = 0; j < n; j++)
            qfrc[j] += tip[i * n + j] * feeler->mean_n[i];
    }
    return quiet;
}

/* Which pairs touch, after a step of MuJoCo; one that begins to is news. */
static void notice_contacts(MEMORY *memory) {
    for (int64_t k = 0; k < memory->pairs; k++) {
        double *touched_m = memory->touched_m + AXES * k;
        if (memory->found[k] > 0.0) {
            if (memory->touching[k] == APART) {
                memory->touching[k] = FRESH;
                memory->plant->struck = 1;
            }
            for (int i = 0; i < AXES; i++)
                touched_m[i] = memory->axes[i].x_m;
        } else if (memory->touching[k] != APART) {
            for (int i = 0; i < AXES; i++)
                if (fabs(memory->axes[i].x_m - touched_m[i]) > 1e-3 * PARTED_MM)
                    memory->touching[k] = APART;
        }
    }
}

/* One step of the joints; 1 if MuJoCo made it. */
INLINE int step_joints(MEMORY *memory, double window_s) {
    const PLANT *plant = memory->plant;
    if (glide(memory->joints_law, memory->mobility, memory->joints, window_s, memory->qpos, memory->qvel, memory->qacc,
              memory->qacc_smooth, memory->qfrc))
        return 0;
    if (plant->window == plant->usual) {
        step_mujoco(plant->mj_step, plant->model, plant->data);
    } else {
        double *step_s = (double *)(intptr_t)plant->step_at;
        double usual_s = *step_s;
        *step_s = window_s;
        step_mujoco(plant->mj_step, plant->model, plant->data);
        *step_s = usual_s;
    }
    notice_contacts(memory);
    return 1;
}

/* Choose the next window: fine from when the structure is shaken until it has been calm. */
INLINE void pace(MEMORY *memory) {
    PLANT *plant = memory->plant;
    const AXIS *axes = memory->axes;
    int shaken = 0;
    for (int64_t j = 0; j < memory->joints; j++)
        if (fabs(memory->qvel[j]) > SHAKEN_M_S && axes[0].dof != j && axes[1].dof != j && axes[2].dof != j)
            shaken = 1;
    int64_t window = plant->window;
    if (shaken) {
        window = plant->fine;
        plant->calm = 0;
    } else if (window != plant->usual) {
        plant->calm += 1;
        if (plant->calm >= CALM && plant->now % plant->usual == 0)
            window = plant->usual;
    }
    if (window != plant->window) {
        SUPPLY *supply = memory->supply;
        plant->window = window;
        supply->window_s = 1e-9 * (double)plant->substep_ns * (double)window;
        supply->charge_decay = exp(-supply->window_s / (supply->source_ohm * supply->capacitance_f));
    }
}

/* Put bytes into `kept`, behind those before; 1 if they are there. */
INLINE int keep(const void *bytes, size_t size, char **kept) {
    int same = memcmp(*kept, bytes, size) == 0;
    memcpy(*kept, bytes, size);
    *kept += size;
    return same;
}

/* 1 if axes, drives and joints are what `kept` has, to the bit; keep them. */
INLINE int keep_all(MEMORY *memory) {
    char *kept = (char *)memory->kept;
    size_t joints = (size_t)memory->joints * sizeof(double);
    int same = keep(memory->axes, AXES * sizeof(AXIS), &kept);
    same &= keep(memory->states, AXES * sizeof(AXIS_STATE), &kept);
    same &= keep(memory->qpos, joints, &kept);
    same &= keep(memory->qvel, joints, &kept);
    return same & keep(memory->qacc, joints, &kept);
}

/* Give the window's mean forces to the joints; 0 if one of them is no number or a carriage is lost. *quiet: cleared if
   a drive does not rest. */
INLINE int hand_over(MEMORY *memory, int *quiet) {
    double window = (double)memory->plant->window;
    for (int i = 0; i < AXES; i++) {
        AXIS *axis = &memory->axes[i];
        axis->mean_n = axis->sum_n / window;
        axis->mean_nut_n = axis->sum_nut_n / window;
        memory->qfrc[axis->dof] += axis->mean_n;
        *quiet = *quiet && at_rest(&memory->states[i]);
        if (!(isfinite(axis->mean_n) && fabs(axis->x_m) < FAR_M)) {
            memory->plant->lost_dof = axis->dof;
            return 0;
        }
    }
    return 1;
}

/* One MuJoCo step with the mean forces of the window; freezes the plant after a long enough standstill. */
static void leave_window(MEMORY *memory) {
    PLANT *plant = memory->plant;
    int64_t n = memory->joints;
    double *qpos = memory->qpos, *qvel = memory->qvel, *before = memory->before, *rates = memory->rates;
    int quiet = gather_forces(memory);
    if (!hand_over(memory, &quiet))
        return;
    for (int64_t j = 0; j < n; j++) {
        before[j] = qpos[j];
        rates[j] = qvel[j];
    }
    double window_s = 1e-9 * (double)plant->substep_ns * (double)plant->window;
    int by_mujoco = step_joints(memory, window_s);
    for (int i = 0; i < AXES; i++) {
        const AXIS *axis = &memory->axes[i];
        if (axis->v_m_s == 0.0 && fabs(qvel[axis->dof]) < REST_M_S)
            qvel[axis->dof] = 0.0;
        qpos[axis->dof] = axis->x_m + window_s * (qvel[axis->dof] - axis->v_m_s);
    }
    for (int64_t j = 0; j < n; j++) {
        if (plant->lost_dof < 0 && !(fabs(qpos[j]) < FAR_M))
            plant->lost_dof = j;
        quiet = quiet && fabs(qvel[j]) < REST_M_S;
    }
    pace(memory);
    plant->quiet = quiet && plant->window == plant->usual ? plant->quiet + 1 : 0;
    if (plant->quiet >= plant->rest_windows)
        freeze(memory);
    if (plant->uneven)
        feel_screws(memory);
    take_carriages(memory);
    const double *by_place = memory->springs, *by_rate = memory->springs + AXES * n;
    for (int i = 0; i < AXES; i++)
        for (int64_t j = 0; j < n; j++)
            memory->axes[i].rest_m_s2 +=
                by_place[i * n + j] * (qpos[j] - before[j]) + by_rate[i * n + j] * (qvel[j] - rates[j]);
    if (plant->quiet == 0 || by_mujoco || memory->cut->on || memory->feeler->on || memory->supply->on)
        plant->settled = 0;
    else
        plant->settled = keep_all(memory) && plant->settled ? SAME : KEPT;
}
