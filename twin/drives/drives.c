/* What Python asks of the drives: single sub-steps and runs of them. */
#pragma once
#include "servo.h"
#include "law.h"
#include "law.h"

/* Advance a stepper drive by one sub-step; return the force on the nut in N (mean over the sub-step).

   nut_position_m    where the carriage stands in the middle of the sub-step; 0: middle of the backlash at theta 0
   nut_velocity_m_s  its velocity
   Others: `stepper_torque`. */
API double step_axis(R(const AXIS_PARAMETERS, p), R(AXIS_STATE, s), double command, int64_t phases,
                     double current_fraction, double nut_position_m, double nut_velocity_m_s, double load_torque_nm) {
    TORQUE torque = stepper_torque(p, s, command, phases, current_fraction, load_torque_nm);
    return turn(p, s, torque.torque_nm, torque.drag, nut_position_m, nut_velocity_m_s, torque.steady);
}

/* The same for a servo drive: command in increments, phases OPEN or not. */
API double step_servo(R(const AXIS_PARAMETERS, p), R(AXIS_STATE, s), double command, int64_t phases,
                      double nut_position_m, double nut_velocity_m_s, double load_torque_nm) {
    TORQUE torque = servo_torque(p, s, command, phases);
    return turn(p, s, torque.torque_nm - load_torque_nm, torque.drag, nut_position_m, nut_velocity_m_s, torque.steady);
}

/* `cool`. */
API double cooled(R(const AXIS_PARAMETERS, p), R(const AXIS_STATE, s), int64_t substeps) {
    return cool(p, s, substeps);
}
