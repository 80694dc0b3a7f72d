/* Sub-steps of one drive for Python, one by one and along a command. */
#pragma once
#include "law.h"
#include "servo.h"

/* Advance a stepper drive by one sub-step; return the force on the nut in N (mean over the sub-step).

   nut_position_m    where the carriage stands in the middle of the sub-step; 0: middle of the backlash at theta 0
   nut_velocity_m_s  its velocity
   Others: `stepper_torque`. */
API double step_axis(R(const AXIS_PARAMETERS, p), R(AXIS_STATE, s), double command, int64_t phases,
                     double current_fraction, double nut_position_m, double nut_velocity_m_s, double load_torque_nm) {
    TORQUE motor = stepper_torque(p, s, command, phases, current_fraction, load_torque_nm);
    return turn(p, s, motor, nut_position_m, nut_velocity_m_s);
}

/* The same for a servo drive: `servo_torque`. */
API double step_servo(R(const AXIS_PARAMETERS, p), R(AXIS_STATE, s), double command, int64_t phases,
                      double nut_position_m, double nut_velocity_m_s, double load_torque_nm) {
    TORQUE motor = servo_torque(p, s, command, phases);
    motor.torque_nm -= load_torque_nm;
    return turn(p, s, motor, nut_position_m, nut_velocity_m_s);
}

/* `cool`. */
API double cooled(R(const AXIS_PARAMETERS, p), R(const AXIS_STATE, s), int64_t substeps) {
    return cool(p, s, substeps);
}

/* `follow` of curves.py. */
API int64_t follow_command(R(const AXIS_PARAMETERS, p), R(AXIS_STATE, s), A1(const double, command, n),
                           A1(const double, load_torque_nm, n), double limit) {
    for (int64_t k = 0; k < command_n; k++) {
        step_axis(p, s, command[k], BOTH, 1.0, 0.0, 0.0, load_torque_nm[k]);
        if (fabs(command[k] - s->theta_rad * p->pole_pairs / p->microstep_rad) > limit)
            return k;
    }
    return command_n;
}
