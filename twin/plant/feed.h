/* The law of a common supply (isel_twin.drives.supply), once a window. */
#pragma once
#include "../drives/servo.h"
#include "../native/core.h"
#include "../native/records.h"

#define STEADY_SHARE 1e-9 /* change of the voltage in a window, over U0, that counts as none */

/* U at the end of a window in which the stages took taken_j; dumped_j: what the chopper took is added to it. */
INLINE double fed_voltage(const SUPPLY *supply, double taken_j, double *dumped_j) {
    double h = supply->window_s, before = supply->voltage_v;
    double blocked_v = sqrt(most(0.0, before * before - 2.0 * taken_j / supply->capacitance_f));
    double voltage_v = blocked_v;
    if (before < supply->source_v || blocked_v < supply->source_v) {
        double end_v = supply->source_v - supply->source_ohm * taken_j / (h * most(before, 1.0));
        double charged_v = end_v + (before - end_v) * supply->charge_decay;
        voltage_v = most(blocked_v, least(charged_v, supply->source_v));
    }
    if (voltage_v > supply->chopper_v) {
        double least_v = voltage_v * exp(-h / (supply->chopper_ohm * supply->capacitance_f));
        double left_v = most(supply->chopper_v, least_v);
        *dumped_j += 0.5 * supply->capacitance_f * (voltage_v * voltage_v - left_v * left_v);
        voltage_v = left_v;
    }
    return voltage_v;
}

/* Advance the voltage to the end of a window in which the stages took `energy_j`, and pass it to the drives. A stage
   without enough voltage is off. */
INLINE void feed(MEMORY *memory) {
    SUPPLY *supply = memory->supply;
    double magnetic_j = 0.0, own_w = 0.0;
    for (int i = 0; i < AXES; i++) {
        double a_a = memory->states[i].current_a_a, b_a = memory->states[i].current_b_a;
        magnetic_j += 0.5 * memory->axes[i].inductance_h * (a_a * a_a + b_a * b_a);
        if ((memory->axes[i].phases & supply->gate) != OPEN)
            own_w += memory->axes[i].own_w;
    }
    double before = supply->voltage_v;
    double taken_j = supply->energy_j + magnetic_j - supply->magnetic_j + own_w * supply->window_s;
    supply->mean_j = supply->energy_j;
    supply->energy_j = 0.0;
    supply->magnetic_j = magnetic_j;
    supply->drawn_j += taken_j;
    double voltage_v = fed_voltage(supply, taken_j, &supply->dumped_j);
    supply->steady = fabs(voltage_v - before) <= STEADY_SHARE * supply->source_v;
    if (!supply->steady)
        supply->voltage_v = voltage_v;
    int64_t gate = supply->gate;
    if (voltage_v < supply->undervoltage_v)
        supply->gate = OPEN;
    else if (voltage_v > supply->release_v)
        supply->gate = BOTH;
    if (gate != supply->gate)
        supply->steady = 0;
    for (int i = 0; i < AXES; i++) {
        AXIS_PARAMETERS *drive = &memory->drives[i];
        AXIS_STATE *state = &memory->states[i];
        drive->drive_v = memory->axes[i].supply_factor * supply->voltage_v;
        drive->return_v = supply->voltage_v;
        memory->axes[i].fault = supply->gate == OPEN;
        if (supply->gate == OPEN && drive->kind == SERVO && state->on != 0 && state->fault == 0)
            fail(state, VOLTAGE_FAULT);
    }
}
