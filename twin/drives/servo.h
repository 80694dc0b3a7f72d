/* One servo drive, one sub-step: from the command in increments to the torque of the motor.

   The mechanics are the stepper's (shaft.h); the drive closes its own loops:

       e     = command - shift - floor(th increments_per_rev / 2 pi)            following error, in every sub-step
       w_ref = (Kv e + Kff d command/dt) 2 pi / increments_per_rev             every loop period, as e
       i_ref = clip(Kp (w_ref - w + z), -I, I)       z' = z + (T_s / Ti) (w_ref - w), held while clipped
       v     = clip((i_ref - E i) / A + K w, -U, U)   i' = E i + A (v - K w)   E = exp(-R dt/L), A = (1 - E)/R
       T     = K (i + i')/2
       q'    = q + (1 - exp(-dt/tau)) ((i'/I_rated)^2 - q)                      I2t; I: peak, rated while overloaded

           command --(-)--> e --Kv--> w_ref --(-)--> PI --i_ref--> [current in one sub-step, |v| <= U] --K--> shaft
                      '--------- encoder -----'----- w -----'

   The command is its time mean over the sub-step; the plant interpolates it between set points, as a drive does that
   gets one every few milliseconds. Kp = J w_v / K and Ti = ratio / w_v, J: all that turns. The speed is the shaft's, as
   from an observer: differences of encoder counts would be coarse at this rate.

   When switched on, a drive stays where it is and stores the difference to its command (`shift`, plant/15). |e| beyond
   the limit is a fault: no current from that sub-step on, until it is cleared (`forget`) and the drive is on again. A
   motor with a broken cable has no current, but the drive does not notice. At rest with e = 0 nothing changes and time
   may be skipped; `cool` then advances the I2t.

   The constants come from `servo_parameters` (servo.py). */
#pragma once
#include "../native/core.h"
#include "../native/records.h"
#include "law.h"

/* Open the loops; latched faults stay. */
INLINE void open_loops(AXIS_STATE *s) {
    s->on = 0;
    s->wanted_a = 0.0;
    s->integral_rad_s = 0.0;
    s->voltage_v = 0.0;
    s->arrived = 0;
}

INLINE void fail(AXIS_STATE *s, int64_t cause) {
    s->fault = cause;
    s->cause = cause;
    s->faults += 1;
    open_loops(s);
}

/* The loops at a sample; 1 if the wanted current has not changed. */
INLINE int sample_loops(const AXIS_PARAMETERS *p, AXIS_STATE *s, double command, double error) {
    double went = command - s->sampled;
    s->sampled = command;
    double wanted_rad_s = p->position_gain_rad_s * error + p->forward_rad_s * went;
    double slow = wanted_rad_s - s->omega_rad_s;
    double wanted_a = p->speed_gain_a_s * (slow + s->integral_rad_s);
    double most_a = s->overloaded != 0 ? p->rated_a : p->peak_a;
    if (wanted_a > most_a)
        wanted_a = most_a;
    else if (wanted_a < -most_a)
        wanted_a = -most_a;
    else
        s->integral_rad_s += p->integral_share * slow;
    int same = wanted_a == s->wanted_a;
    s->wanted_a = wanted_a;
    return same;
}

/* The motor's part of a sub-step, as `turn` takes it, without a load. command in increments; phases OPEN or not. Finite
   arguments give finite results. With phases OPEN, or a fault, it never adds energy. */
INLINE TORQUE servo_torque(const AXIS_PARAMETERS *p, AXIS_STATE *s, double command, int64_t phases) {
    double encoder = (double)whole_of(floor(s->theta_rad * p->increments_per_rad));
    int steady = 1;
    double before_a = s->current_a_a;
    double current_a = 0.0;
    s->due -= 1;
    int sample = s->due <= 0;
    if (sample)
        s->due = p->loop_substeps;
    if (phases == OPEN || s->fault != 0) {
        steady = before_a == 0.0;
        open_loops(s);
    } else {
        if (s->on == 0) {
            s->on = 1;
            s->shift = command - encoder;
            s->sampled = command;
        }
        double error = command - s->shift - encoder;
        s->error = error;
        if (fabs(error) > p->lag_limit) {
            fail(s, LAG_FAULT);
        } else {
            s->arrived = fabs(error) <= p->window ? least_of(s->arrived + 1, p->window_substeps) : 0;
            if (sample)
                steady = sample_loops(p, s, command, error);
            if (p->connected != 0) {
                double emf_v = p->torque_constant_nm_per_a * s->omega_rad_s;
                double kept_a = p->decay * before_a;
                double voltage_v = (s->wanted_a - kept_a) * p->gain_v_per_a + emf_v;
                current_a = s->wanted_a;
                if (fabs(voltage_v) > p->drive_v) {
                    voltage_v = copysign(p->drive_v, voltage_v);
                    current_a = kept_a + p->gain_a_per_v * (voltage_v - emf_v);
                }
                s->voltage_v = voltage_v;
            }
            int here = error == 0.0 && command == s->sampled && s->arrived == p->window_substeps;
            steady = steady && here && current_a == before_a && fabs(current_a) <= p->rated_a;
        }
    }
    double mean_a = s->on != 0 ? 0.5 * (before_a + current_a) : 0.0;
    s->current_a_a = current_a;
    double ratio = current_a / p->rated_a;
    s->heat += p->heat_share * (ratio * ratio - s->heat);
    if (s->heat > 1.0)
        s->overloaded = 1;
    else if (s->heat < I2T_BACK)
        s->overloaded = 0;
    s->torque_nm = p->torque_constant_nm_per_a * mean_a;
    return (TORQUE){s->torque_nm, p->drag_nm_s_per_rad, steady && s->overloaded == 0};
}

/* I2t after sub-steps in which nothing else has changed (exact solution); s is unchanged. */
INLINE double cool(const AXIS_PARAMETERS *p, const AXIS_STATE *s, int64_t substeps) {
    double ratio = s->current_a_a / p->rated_a;
    double left = exp((double)substeps * log1p(-p->heat_share));
    return ratio * ratio + left * (s->heat - ratio * ratio);
}
