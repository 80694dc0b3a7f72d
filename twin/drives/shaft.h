/* Rotor, screw and nut of an axis in one sub-step, whatever motor turns them.

   Stepper and servo drives differ only in how a command becomes a torque (stepper.h, servo.h). The effect of the torque
   on rotor, friction, screw, backlash and nut is here:

       F = k dead_zone(r th - x, backlash) + c (r w - v_nut)          force on the nut
       J dw/dt = T - B w - F r - T_load - friction

   Time step: the angle drifts half a sub-step, the speed is kicked by the torque found there, the angle drifts the other
   half (Stoermer-Verlet: second order, no secular gain of energy). What is linear in w is taken as the mean of old and
   new speed. Dry friction is an impulse in the kick that can stop the shaft but not reverse it: below breakaway the
   speed is exactly 0 and the angle does not change by a bit.

       th --drift--> torque of the motor --turn: kick, drift--> th'

   The fields of AXIS_PARAMETERS and AXIS_STATE are explained in shaft.py. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

#define REST_RAD_S 1e-9 /* shaft speed below which a drive counts as at rest (friction brings it to exactly 0) */

/* The motor's part of a sub-step. */
typedef struct {
    double torque_nm; /* of motor and load without the nut */
    double drag; /* its part linear in the speed, N m s/rad */
    int steady; /* nothing else in the drive has changed in this sub-step */
} TORQUE;

/* Turn the shaft by a torque for one sub-step; return the mean force on the nut in N. Other arguments: `step_axis`. */
INLINE double turn(const AXIS_PARAMETERS *p, AXIS_STATE *s, double torque, double drag, double nut_position_m,
                   double nut_velocity_m_s, int steady) {
    double half_dt = 0.5 * p->dt_s;
    double omega = s->omega_rad_s;
    double theta = s->theta_rad + half_dt * omega;

    /* Nut: spring and damper outside the backlash; a nut with play can be pushed but not pulled back. */
    double damping = 0.0;
    double spring = 0.0;
    if (p->stiffness_n_per_m > 0.0) {
        double stretch = p->travel_m_per_rad * theta - nut_position_m;
        double rate = p->damping_n_s_per_m * (p->travel_m_per_rad * omega - nut_velocity_m_s);
        if (stretch > p->half_backlash_m)
            spring = p->stiffness_n_per_m * (stretch - p->half_backlash_m);
        else if (stretch < -p->half_backlash_m)
            spring = p->stiffness_n_per_m * (stretch + p->half_backlash_m);
        if (p->half_backlash_m == 0.0 || (spring + rate) * spring > 0.0)
            damping = p->damping_n_s_per_m;
        else
            spring = 0.0;
    }
    double push = spring - damping * nut_velocity_m_s;
    drag += damping * p->travel_m_per_rad * p->travel_m_per_rad;
    torque -= push * p->travel_m_per_rad;

    /* Kick: linear drag at the mean speed, then the friction impulse. */
    double half_drag = 0.5 * p->kick_rad_s_per_nm * drag;
    double share = 1.0 / (1.0 + half_drag);
    double free = (omega * (1.0 - half_drag) + p->kick_rad_s_per_nm * torque) * share;
    double force = push + damping * p->travel_m_per_rad * omega;
    double ratio = omega / p->stribeck_rad_s;
    double friction = p->coulomb_nm + p->stribeck_nm / (1.0 + ratio * ratio);
    double loss = free * force > 0.0 ? p->forward_loss : p->backward_loss;
    friction += loss * fabs(force) * p->travel_m_per_rad;
    double stop = p->kick_rad_s_per_nm * friction * share;
    double omega_new = 0.0;
    if (free > stop)
        omega_new = free - stop;
    else if (free < -stop)
        omega_new = free + stop;
    s->theta_rad = theta + half_dt * omega_new;
    s->omega_rad_s = omega_new;
    s->force_n = push + 0.5 * damping * p->travel_m_per_rad * (omega + omega_new);
    s->at_rest = steady && fabs(omega) <= REST_RAD_S && fabs(omega_new) <= REST_RAD_S;
    return s->force_n;
}

/* 1 if the last sub-step changed neither angle nor currents. With the same arguments further ones change nothing either
   (with friction, not a bit): time may be skipped until an argument changes. */
INLINE int at_rest(const AXIS_STATE *s) { return s->at_rest != 0; }
