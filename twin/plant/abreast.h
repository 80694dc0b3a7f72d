/* All axes abreast in a register each number, for as long as nothing but drives and carriages moves: through a window,
   as a rule. Where the processor has no such registers, or a drive is no stepper motor's, or cut, feeler or common
   supply couple the axes, the loop makes one after the other (kernel.c): the same text, so the same bits. */
#pragma once
#include "../drives/law.h"

/* Set when the library is loaded (isel_twin.native): 1 if the processor has AVX2. */
API int64_t core_abreast = 0;

#if WIDE
/* 1 if the next sub-step can be made with all axes abreast. */
INLINE int can_go_abreast(const MEMORY *memory) {
    int steppers = core_abreast != 0;
    for (int i = 0; i < AXES; i++)
        steppers &= memory->drives[i].kind == STEPPER;
    return steppers && !memory->cut->on && !memory->feeler->on && !memory->supply->on;
}

WIDE_BEGIN
typedef struct {
    AXIS_PARAMETERS_4 drive;
    AXIS_STATE_4 state;
    AXIS_4 axis;
} ABREAST;

/* The record of a lane; the last one is there twice, and its twin is never looked at. */
#define LANE_OF(records, lane) records[(lane) < AXES ? (lane) : AXES - 1]
#define ROW(records, name) {LANE_OF(records, 0).name, LANE_OF(records, 1).name, LANE_OF(records, 2).name, \
                            LANE_OF(records, 3).name}

INLINE void take_drives(ABREAST *abreast, const MEMORY *memory) {
#define FIELD_double(name) abreast->drive.name = (V4)ROW(memory->drives, name);
#define FIELD_int64_t(name) abreast->drive.name = (M4)ROW(memory->drives, name);
    AXIS_PARAMETERS_FIELDS
#undef FIELD_double
#undef FIELD_int64_t
}

INLINE void take_axes(ABREAST *abreast, const MEMORY *memory) {
#define FIELD_double(name) abreast->state.name = (V4)ROW(memory->states, name);
#define FIELD_int64_t(name) abreast->state.name = (M4)ROW(memory->states, name);
    AXIS_STATE_FIELDS
#undef FIELD_double
#undef FIELD_int64_t
#define FIELD_double(name) abreast->axis.name = (V4)ROW(memory->axes, name);
#define FIELD_int64_t(name) abreast->axis.name = (M4)ROW(memory->axes, name);
    AXIS_FIELDS
#undef FIELD_double
#undef FIELD_int64_t
}

/* Give the records what a sub-step changes. */
INLINE void give_axes(const ABREAST *abreast, MEMORY *memory) {
    for (int i = 0; i < AXES; i++) {
        AXIS *axis = &memory->axes[i];
        AXIS_STATE *state = &memory->states[i];
        axis->x_m = abreast->axis.x_m[i];
        axis->v_m_s = abreast->axis.v_m_s[i];
        axis->sum_n = abreast->axis.sum_n[i];
        axis->sum_nut_n = abreast->axis.sum_nut_n[i];
        axis->sum_nm = abreast->axis.sum_nm[i];
        state->theta_rad = abreast->state.theta_rad[i];
        state->omega_rad_s = abreast->state.omega_rad_s[i];
        state->current_a_a = abreast->state.current_a_a[i];
        state->current_b_a = abreast->state.current_b_a[i];
        state->command = abreast->state.command[i];
        state->shape_a = abreast->state.shape_a[i];
        state->shape_b = abreast->state.shape_b[i];
        state->smooth_rad = abreast->state.smooth_rad[i];
        state->lag_rad = abreast->state.lag_rad[i];
        state->torque_nm = abreast->state.torque_nm[i];
        state->force_n = abreast->state.force_n[i];
        state->at_rest = abreast->state.at_rest[i];
    }
}

/* Advance drives and carriages by a sub-step, with the commands and currents of the records. */
INLINE void step_abreast(ABREAST *abreast, const MEMORY *memory, double dt_s) {
    V4 none = {0}, x_mid_m = halfway_m_4(&abreast->axis, dt_s);
    V4 command = ROW(memory->axes, command), fraction = ROW(memory->axes, fraction);
    M4 phases = abreast->axis.phases & memory->supply->gate;
    TORQUE_4 motor = stepper_torque_4(&abreast->drive, &abreast->state, command, phases, fraction, none);
    V4 nut_n = turn_4(&abreast->drive, &abreast->state, motor, x_mid_m - abreast->axis.zero_m, abreast->axis.v_m_s);
    move_4(&abreast->axis, x_mid_m, nut_n, abreast->axis.push_n + nut_n, abreast->state.torque_nm, dt_s);
}
WIDE_END
#endif
