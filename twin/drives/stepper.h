/* One stepper drive, one sub-step: from the commanded electrical angle to the torque of the motor.

   Power stage, two phase currents and rotor advance by one sub-step dt, at 10^7 axis sub-steps a second, with true
   sticking friction and no numerical gain of energy.

       e_A = -Km w sin(Nr th)        e_B = Km w cos(Nr th)                              back-EMF
       v   = clip((i_ref - E i)/A + e, -V, V),   i' = E i + A (v - e)                   E = exp(-R dt/L), A = (1 - E)/R
       T   = -Km i_A sin(Nr th) + Km i_B cos(Nr th) - Td sin(4 Nr th) - T_fe(w)         i_A, i_B: mean of i and i'
       T_fe = (Km^2/Rm) w / (1 + (w/w_k)^2)                                             iron loss (motor.py)

   (MathWorks Simscape "Stepper Motor"; the stage is a current source that the supply limits, without chopper ripple.)
   The other half of the sub-step, rotor, screw and nut, is in shaft.h for every kind of motor.

   i_ref is the wave of the stage at the commanded angle, turned and shifted by its errors (stage.py). Electronic damping
   turns the current vector further by the swing of the load angle about its low pass, as a digital microstep drive with
   damping does (drives/9):

       lambda = phi_cmd - Nr th    d lambda_f/dt = 2 pi f_c (lambda - lambda_f)    phi = phi_cmd + g (lambda - lambda_f)

   For lambda the command is smoothed between its pulses.

             dt
       |-----------|          pulses within the sub-step act in it by the time mean of the command:
       __|``````````          a pulse after 0.2 dt moves the mean by 0.8 microsteps

   The constants come from `axis_parameters` (dynamics.py); `follow_command` in drives.c shows how the sub-step is used. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"
#include "shaft.h"
#include "trigonometry.h"

#define SETTLED_RAD 1e-12 /* electrical load-angle swing below which damping does nothing, so a drive comes to rest */

/* The switched counterpart of the cosine: 1 up to pi/4, 0 at pi/2, -1 from 3 pi/4; linear between.

   The counter stands on multiples of pi/4 (half step), or odd ones (full step, drives/6); between them is the time mean
   of the wanted current in a sub-step with a pulse in it. */
INLINE double switched_cosine(double angle_rad) {
    double wrapped = angle_rad - 2.0 * PI * floor(angle_rad / (2.0 * PI) + 0.5);
    return least(1.0, most(-1.0, 2.0 - fabs(wrapped) * (4.0 / PI)));
}

/* Wanted currents at an electrical angle, turned and shifted by the stage's errors. */
INLINE void shape_with_errors(const AXIS_PARAMETERS *p, AXIS_STATE *s, double phi) {
    double shape_a, shape_b, error, sine, cosine;
    if (p->stepped != 0.0) {
        shape_a = switched_cosine(phi);
        shape_b = switched_cosine(phi - 0.5 * PI);
        sine_and_cosine(phi - p->phase_offset_rad, &error, &cosine);
    } else {
        sine_and_cosine(phi, &shape_b, &shape_a);
        error = shape_b;
    }
    if (p->step_error_rad != 0.0) {
        sine_and_cosine(p->step_error_rad * error, &sine, &cosine);
        double straight_a = shape_a;
        shape_a = straight_a * cosine - shape_b * sine;
        shape_b = shape_b * cosine + straight_a * sine;
    }
    s->shape_a = shape_a;
    s->shape_b = shape_b + p->current_offset;
}

INLINE void shape_at(const AXIS_PARAMETERS *p, AXIS_STATE *s, double phi) {
    if (p->plain != 0.0)
        sine_and_cosine(phi, &s->shape_b, &s->shape_a);
    else
        shape_with_errors(p, s, phi);
}

/* Phase current after a sub-step: the wanted one, as far as the supply can drive it. Drops in the switches reduce the
   voltage that drives a current, not the one against which it flows back (drives/1), which is a part of the supply where
   the current is only too large, and not of the wrong sign (drives/14). */
INLINE double phase_current(const AXIS_PARAMETERS *p, double current_a, double wanted_a, double emf_v) {
    double voltage_v = (wanted_a - p->decay * current_a) * p->gain_v_per_a + emf_v;
    double return_v = current_a * wanted_a <= 0.0 ? p->return_v : p->fast_share * p->return_v;
    double highest_v = current_a >= 0.0 ? p->drive_v : return_v;
    if (voltage_v > highest_v)
        return p->decay * current_a + p->gain_a_per_v * (highest_v - emf_v);
    double lowest_v = current_a <= 0.0 ? -p->drive_v : -return_v;
    if (voltage_v < lowest_v)
        return p->decay * current_a + p->gain_a_per_v * (lowest_v - emf_v);
    return wanted_a;
}

/* The motor's part of a sub-step, as `turn` takes it.

   p, s              s is changed
   command           time mean over the sub-step of the microstep counter
   phases            BOTH with the stage on, OPEN with it off, PHASE_A or PHASE_B with a wire broken. An open phase
                     carries no current from this sub-step on (in truth it fades within 0.3 ms, decision drives/5)
   current_fraction  phase current over nominal, for the lowered current at rest
   load_torque_nm    torque from outside against positive rotation

   Finite arguments give finite results. With phases OPEN it never adds energy. */
INLINE TORQUE stepper_torque(const AXIS_PARAMETERS *p, AXIS_STATE *s, double command, int64_t phases,
                             double current_fraction, double load_torque_nm) {
    double omega = s->omega_rad_s;
    double theta = s->theta_rad + 0.5 * p->dt_s * omega;
    double angle = p->pole_pairs * theta + p->phase_offset_rad;
    double sine, cosine;
    sine_and_cosine(angle, &sine, &cosine);

    /* Stage and currents. */
    int settled = 1;
    if (p->damping_gain > 0.0) {
        double phi = command * p->microstep_rad + p->phase_offset_rad;
        if (phases != BOTH || s->command != s->command) { /* nothing to damp, or the first sub-step */
            s->smooth_rad = phi;
            s->lag_rad = phi - angle;
        }
        s->smooth_rad += p->smooth_share * (phi - s->smooth_rad);
        double lag = s->smooth_rad - angle;
        s->lag_rad += p->damping_share * (lag - s->lag_rad);
        double swing = lag - s->lag_rad;
        settled = fabs(swing) + fabs(phi - s->smooth_rad) < SETTLED_RAD;
        if (settled) {
            s->smooth_rad = phi;
            s->lag_rad = phi - angle;
            swing = 0.0;
        }
        s->command = command;
        shape_at(p, s, phi + p->damping_gain * swing);
    } else if (command != s->command) {
        s->command = command;
        shape_at(p, s, command * p->microstep_rad + p->phase_offset_rad);
    }
    double emf_v = p->torque_constant_nm_per_a * omega;
    double wanted_a = p->current_a * current_fraction;
    double current_a = 0.0, current_b = 0.0, mean_a = 0.0, mean_b = 0.0;
    if (phases & PHASE_A) {
        current_a = phase_current(p, s->current_a_a, wanted_a * s->shape_a, -emf_v * sine);
        mean_a = 0.5 * (s->current_a_a + current_a);
    }
    if (phases & PHASE_B) {
        current_b = phase_current(p, s->current_b_a, wanted_a * s->shape_b, emf_v * cosine);
        mean_b = 0.5 * (s->current_b_a + current_b);
    }
    int steady = settled && current_a == s->current_a_a && current_b == s->current_b_a;
    s->current_a_a = current_a;
    s->current_b_a = current_b;
    double torque = p->torque_constant_nm_per_a * (mean_b * cosine - mean_a * sine);
    s->torque_nm = torque;
    double sine_2 = 2.0 * sine * cosine;
    torque -= p->detent_torque_nm * 2.0 * sine_2 * (1.0 - 2.0 * sine * sine) + load_torque_nm;

    double knee = p->iron_knee_s_per_rad * omega;
    double drag = p->drag_nm_s_per_rad + p->iron_nm_s_per_rad / (1.0 + knee * knee);
    return (TORQUE){torque, drag, steady};
}
