/* A sample of everything that is recorded (samples.py). */
#pragma once
#include "../drives/servo.h"
#include "../native/core.h"
#include "../native/records.h"
#include "lead.h"

/* What axis i has in a sample: commanded and rotor [m], current fraction, margin, force on the nut. at: the
   sub-step. */
INLINE void sample_axis(const MEMORY *memory, int i, int64_t at, double *rotor, double *values) {
    const PLANT *plant = memory->plant;
    const AXIS *axis = &memory->axes[i];
    const AXIS_STATE *state = &memory->states[i];
    int off = (axis->phases & memory->supply->gate) == OPEN;
    *rotor = state->theta_rad * axis->steps_per_rad;
    if (memory->drives[i].kind == SERVO) {
        int64_t since = plant->frozen ? at - plant->frozen_at : 0;
        values[0] = off || state->fault != 0 ? 0.0 : sqrt(cool(&memory->drives[i], state, since));
    } else {
        values[0] = off ? 0.0 : axis->fraction;
    }
    values[AXES] = axis->margin;
    values[2 * AXES] = axis->mean_nut_n;
}

/* Take a sample: the sub-step `at` (now or, if nothing moves, later), places and speeds of the joints [nv], commanded
   and rotors [m], current fractions, margins and forces on the nuts [3], supply voltage, bending of the tool [2].
   Places are those `sample_ahead_ns` after it. */
static void take_sample(MEMORY *memory, int64_t at) {
    PLANT *plant = memory->plant;
    int64_t n = memory->joints, m = memory->commands, ahead_ns = plant->sample_ahead_ns;
    if (plant->sampled == SAMPLES)
        return;
    double *row = memory->samples + plant->sampled * memory->fields;
    double *places = row + 1, *rates = places + n, *commanded = rates + n, *rotors = commanded + m;
    double *values = rotors + m, *last = values + 3 * AXES;
    plant->sampled += 1;
    double share = (double)(plant->now % plant->window) + (double)ahead_ns / (double)plant->substep_ns;
    share /= (double)plant->window;
    row[0] = (double)at;
    for (int64_t j = 0; j < n; j++) {
        places[j] = memory->before[j] + share * (memory->qpos[j] - memory->before[j]);
        rates[j] = memory->qvel[j];
    }
    int64_t at_ns = at * plant->substep_ns + ahead_ns;
    for (int64_t i = 0; i < m; i++) {
        commanded[i] = (double)memory->commanded[i];
        rotors[i] = (double)memory->commanded[i] - behind(&memory->leads[i], at_ns);
    }
    for (int i = 0; i < AXES; i++) {
        const AXIS *axis = &memory->axes[i];
        places[axis->dof] = axis->x_m + 1e-9 * (double)ahead_ns * axis->v_m_s;
        rates[axis->dof] = axis->v_m_s;
        sample_axis(memory, i, at, rotors + i, values + i);
    }
    last[0] = memory->supply->on ? memory->supply->voltage_v : NAN;
    last[1] = memory->cut->bend_m[0];
    last[2] = memory->cut->bend_m[1];
}
