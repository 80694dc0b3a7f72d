/* Benches of one drive, sub-step by sub-step, and what is only seen inside one. */
#include "../../twin/native/core.h"
#include "exports.h"
#include "../../twin/native/records.h"

#include "../../twin/drives/drives.c"

INLINE double step(const AXIS_PARAMETERS *p, AXIS_STATE *s, double command, int64_t phases, double x_m, double v_m_s,
                   double load_nm) {
    if (p->kind == SERVO)
        return step_servo(p, s, command, phases, x_m, v_m_s, load_nm);
    return step_axis(p, s, command, phases, 1.0, x_m, v_m_s, load_nm);
}

/* Energy in the rotor, the detent and the nut spring, J (phase currents not counted). */
API double stored_energy_j(R(const AXIS_PARAMETERS, p), R(const AXIS_STATE, s), double nut_position_m) {
    double angle = p->pole_pairs * s->theta_rad + p->phase_offset_rad;
    double stretch = most(0.0, fabs(p->travel_m_per_rad * s->theta_rad - nut_position_m) - p->half_backlash_m);
    double detent_j = p->detent_torque_nm / (4.0 * p->pole_pairs) * (1.0 - cos(4.0 * angle));
    double turning_j = 0.5 * p->inertia_kgm2 * s->omega_rad_s * s->omega_rad_s;
    return turning_j + detent_j + 0.5 * p->stiffness_n_per_m * stretch * stretch;
}

/* A drive whose nut pushes a carriage that slides without friction; a force of push_n pulls at it. Into record [n, 7]:
   angle and speed of the rotor, place and speed of the carriage, force, energy, rest. */
API void couple(R(const AXIS_PARAMETERS, p), R(AXIS_STATE, s), A1(const double, command), int64_t phases,
                double mass_kg, double push_n, double x_m, double v_m_s, A2(double, record)) {
    for (int64_t k = 0; k < command_n; k++) {
        x_m += 0.5 * p->dt_s * v_m_s;
        double force_n = step(p, s, command[k], phases, x_m, v_m_s, 0.0);
        v_m_s += p->dt_s * (force_n + push_n) / mass_kg;
        x_m += 0.5 * p->dt_s * v_m_s;
        double energy_j = stored_energy_j(p, s, x_m) + 0.5 * mass_kg * v_m_s * v_m_s - push_n * x_m;
        double seen[] = {s->theta_rad, s->omega_rad_s, x_m, v_m_s, force_n, energy_j, s->at_rest};
        memcpy(&record[k * record_columns], seen, sizeof seen);
    }
}

/* A drive without a nut. Into record [n, 6]: angle, speed, current, voltage, error, heat. */
API void ride(R(const AXIS_PARAMETERS, p), R(AXIS_STATE, s), A1(const double, command), int64_t phases,
              A1(const double, load_nm), A2(double, record)) {
    for (int64_t k = 0; k < command_n; k++) {
        step(p, s, command[k], phases, 0.0, 0.0, load_nm[k]);
        double seen[] = {s->theta_rad, s->omega_rad_s, s->current_a_a, s->voltage_v, s->error, s->heat};
        memcpy(&record[k * record_columns], seen, sizeof seen);
    }
}

/* 1 if nothing in a servo drive has changed in this sub-step of its motor. */
API int64_t steady(R(const AXIS_PARAMETERS, p), R(AXIS_STATE, s), double command, int64_t phases) {
    return servo_torque(p, s, command, phases).steady;
}

/* `sine_and_cosine`, into found [2]. */
API void sines(double angle_rad, A1(double, found)) { sine_and_cosine(angle_rad, &found[0], &found[1]); }
