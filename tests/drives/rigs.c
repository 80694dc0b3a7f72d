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

/* Four steppers, each with a sub-step's arguments in a row of its own, and its force on the nut into nut_n. */
#define ROWS command, phases, fraction, place_m, speed_m_s, load_nm, nut_n, n
#define ROWS_OF const double *command, const int64_t *phases, const double *fraction, const double *place_m, \
                const double *speed_m_s, const double *load_nm, double *nut_n, int64_t n

static void one_by_one(const AXIS_PARAMETERS *p, AXIS_STATE *s, ROWS_OF) {
    for (int64_t k = 0; k < 4 * n; k++)
        nut_n[k] = step_axis(&p[k % 4], &s[k % 4], command[k], phases[k], fraction[k], place_m[k], speed_m_s[k],
                             load_nm[k]);
}

#if WIDE
WIDE_BEGIN
INLINE V4 four(const double *row) { return (V4){row[0], row[1], row[2], row[3]}; }

static void side_by_side(const AXIS_PARAMETERS *p, AXIS_STATE *s, ROWS_OF) {
    AXIS_PARAMETERS_4 drive;
    AXIS_STATE_4 state;
#define FIELD_double(name) drive.name = (V4){p[0].name, p[1].name, p[2].name, p[3].name};
#define FIELD_int64_t(name) drive.name = (M4){p[0].name, p[1].name, p[2].name, p[3].name};
    AXIS_PARAMETERS_FIELDS
#undef FIELD_double
#undef FIELD_int64_t
#define FIELD_double(name) state.name = (V4){s[0].name, s[1].name, s[2].name, s[3].name};
#define FIELD_int64_t(name) state.name = (M4){s[0].name, s[1].name, s[2].name, s[3].name};
    AXIS_STATE_FIELDS
#undef FIELD_double
#undef FIELD_int64_t
    for (int64_t k = 0; k < 4 * n; k += 4) {
        M4 stages = {phases[k], phases[k + 1], phases[k + 2], phases[k + 3]};
        V4 load = four(&load_nm[k]);
        TORQUE_4 motor = stepper_torque_4(&drive, &state, four(&command[k]), stages, four(&fraction[k]), load);
        V4 force_n = turn_4(&drive, &state, motor, four(&place_m[k]), four(&speed_m_s[k]));
        memcpy(&nut_n[k], &force_n, sizeof force_n);
    }
    for (int i = 0; i < 4; i++) {
#define FIELD_double(name) s[i].name = state.name[i];
#define FIELD_int64_t(name) s[i].name = state.name[i];
        AXIS_STATE_FIELDS
    }
}
WIDE_END
#endif

/* Steps them one by one or, if `wide`, side by side; 0 where there are no such registers. */
API int64_t march(int64_t wide, A1(const AXIS_PARAMETERS, p, 4), A1(AXIS_STATE, s, 4), A2(const double, command, n, 4),
                  A2(const int64_t, phases, n, 4), A2(const double, fraction, n, 4), A2(const double, place_m, n, 4),
                  A2(const double, speed_m_s, n, 4), A2(const double, load_nm, n, 4), A2(double, nut_n, n, 4)) {
    int64_t n = command_rows;
#if WIDE
    if (wide)
        side_by_side(p, s, ROWS);
#endif
    if (!wide)
        one_by_one(p, s, ROWS);
    return !wide || WIDE;
}
