/* The reference's right-hand side and its Runge-Kutta solver (bridge.py). Nothing here comes from the twin. */
#include "../../twin/native/core.h"
#include "exports.h"

enum { SLOW, MIXED, AUTO }; /* decay */

typedef struct { /* `Rig.array` */
    double r, inductance, km, j, detent, iron, knee, supply, current, microsteps, teeth, brake, decay, fast_share, tick,
        gain, corner;
} RIG;

INLINE void right_hand_side(const double *y, const RIG *rig, double v_a, double v_b, double load, double *out) {
    double angle = rig->teeth * y[2];
    double s = sin(angle), c = cos(angle), w = y[3], ratio = w / rig->knee;
    out[0] = (v_a - rig->r * y[0] + rig->km * w * s) / rig->inductance;
    out[1] = (v_b - rig->r * y[1] - rig->km * w * c) / rig->inductance;
    out[2] = w;
    double torque = rig->km * (y[1] * c - y[0] * s) - rig->detent * sin(4.0 * angle);
    out[3] = (torque - rig->iron * w / (1.0 + ratio * ratio) - rig->brake * w - load) / rig->j;
}

/* y [4] = i_A, i_B, th, w; out [4] its slope. */
API void slope(A1(const double, y), A1(const double, rig), double v_a, double v_b, double load, A1(double, out)) {
    right_hand_side(y, (const RIG *)rig, v_a, v_b, load, out);
}

/* One step of the classical Runge-Kutta rule. */
INLINE void advance(double *y, const RIG *rig, const double *v, double load, double dt) {
    double k1[4], k2[4], k3[4], k4[4], at[4];
    right_hand_side(y, rig, v[0], v[1], load, k1);
    for (int i = 0; i < 4; i++)
        at[i] = y[i] + 0.5 * dt * k1[i];
    right_hand_side(at, rig, v[0], v[1], load, k2);
    for (int i = 0; i < 4; i++)
        at[i] = y[i] + 0.5 * dt * k2[i];
    right_hand_side(at, rig, v[0], v[1], load, k3);
    for (int i = 0; i < 4; i++)
        at[i] = y[i] + dt * k3[i];
    right_hand_side(at, rig, v[0], v[1], load, k4);
    for (int i = 0; i < 4; i++)
        y[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
}

/* Steps at t: the rate rises from start_rate to rate within `ramp`, as 3 q^2 - 2 q^3. */
INLINE double counter(double t, double start_rate, double rate, double ramp) {
    double q = least(t / ramp, 1.0);
    return start_rate * t + (rate - start_rate) * (ramp * q * q * q * (1.0 - 0.5 * q) + most(t - ramp, 0.0));
}

typedef struct {
    int on; /* 1 on, 2 against the supply, 0 short-circuited */
    int falls;
    double sign, last, fast_until;
} PHASE;

/* Voltage of a bridge: ref, i: reference and current of its phase. */
INLINE double switched(PHASE *phase, const RIG *rig, double t, int tick, double ref, double i) {
    if (tick) {
        phase->falls = fabs(ref) < fabs(phase->last);
        phase->last = ref;
        phase->sign = ref >= 0.0 ? 1.0 : -1.0;
        phase->on = 1;
    }
    if (phase->on == 1 && i * phase->sign >= fabs(ref)) {
        phase->on = rig->decay == MIXED || (rig->decay == AUTO && phase->falls) ? 2 : 0;
        phase->fast_until = t + rig->fast_share * rig->tick;
    }
    if (phase->on == 2 && (t >= phase->fast_until || fabs(i) < 1e-3))
        phase->on = 0;
    if (phase->on == 1)
        return rig->supply * phase->sign;
    return phase->on == 0 ? 0.0 : i > 0.0 ? -rig->supply : rig->supply;
}

/* `run` of bridge.py; into found [3] what it returns. */
API void run(A1(const double, values), double start_rate, double rate, double ramp, double hold, double load,
             double rise, int64_t steps_per_tick, A1(double, found)) {
    const RIG *rig = (const RIG *)values;
    double dt = rig->tick / steps_per_tick, per_step = 0.5 * PI / rig->microsteps;
    double y[4] = {0.0, 0.0, 0.0, start_rate / rig->microsteps / (4.0 * rig->teeth) * 2.0 * PI};
    PHASE phases[2] = {{.sign = 1.0}, {.sign = 1.0}};
    double mean_lag = 0.0, share = 1.0 - exp(-rig->corner * dt), torque = 0.0;
    int64_t count = 0, periods = (int64_t)((ramp + hold) / rig->tick + 0.5);
    for (int64_t period = 0; period < periods; period++)
        for (int64_t sub = 0; sub < steps_per_tick; sub++) {
            double t = period * rig->tick + sub * dt;
            double phase = counter(t, start_rate, rate, ramp);
            double phi = floor(phase + 1e-9) * per_step;
            if (fabs(phi - rig->teeth * y[2]) > 2.0 * PI) {
                found[0] = t, found[1] = y[2], found[2] = 0.0;
                return;
            }
            if (rig->gain > 0.0) {
                double lag = phase * per_step - rig->teeth * y[2]; /* the drive smooths its pulses */
                if (period == 0 && sub == 0)
                    mean_lag = lag;
                mean_lag += (lag - mean_lag) * share;
                phi += rig->gain * (lag - mean_lag);
            }
            double v[2] = {switched(&phases[0], rig, t, sub == 0, rig->current * cos(phi), y[0]),
                           switched(&phases[1], rig, t, sub == 0, rig->current * sin(phi), y[1])};
            double q = rise > 0.0 ? least(most((t - ramp) / rise, 0.0), 1.0) : 1.0;
            advance(y, rig, v, load * q * q * (3.0 - 2.0 * q), dt);
            if (t > ramp + 0.5 * hold) {
                torque += rig->km * (y[1] * cos(rig->teeth * y[2]) - y[0] * sin(rig->teeth * y[2]));
                count++;
            }
        }
    found[0] = ramp + hold, found[1] = y[2], found[2] = torque / most_of(count, 1);
}
