/* Rotor, screw and nut of an axis in one sub-step, whatever motor turns them.

   Stepper and servo drives differ only in how a command becomes a torque (stepper.h, servo.h). The effect of the torque
   on rotor, friction, screw, backlash and nut is here:

       F = k dead_zone(r th - x, backlash) + c (r w - v_nut)          force on the nut
       J dw/dt = T - B w - F r - T_load - friction

   Time step: the angle drifts half a sub-step, the speed is kicked by the torque found there, the angle drifts the
   other half (Stoermer-Verlet: second order, no secular gain of energy). What is linear in w is taken as the mean of
   old and new speed. Dry friction is an impulse in the kick that can stop the shaft but not reverse it: below breakaway
   the speed is exactly 0 and the angle does not change by a bit.

       th --drift--> torque of the motor --turn: kick, drift--> th'

   The fields of AXIS_PARAMETERS and AXIS_STATE are explained in shaft.py. Text of law.h, for each width. */

#if LANES == 1
#define REST_RAD_S 1e-9 /* shaft speed below which a drive counts as at rest (friction brings it to exactly 0) */
#endif

/* What a motor does in a sub-step: torque of motor and load without the nut in N m, its part linear in the speed in
   N m s/rad, and 1 if nothing in the drive has changed. */
typedef struct {
    V torque_nm, drag;
    M steady;
} OF(TORQUE);

/* Turn the shaft by a torque for one sub-step; return the mean force on the nut in N. nut_position_m, nut_velocity_m_s:
   where the carriage stands in the middle of the sub-step, 0: middle of the backlash at theta 0; its velocity. */
INLINE V OF(turn)(
    const OF(AXIS_PARAMETERS) *p, OF(AXIS_STATE) *s, OF(TORQUE) motor, V nut_position_m, V nut_velocity_m_s) {
    V none = {0}, half_dt = 0.5 * p->dt_s, omega = s->omega_rad_s;
    V theta = s->theta_rad + half_dt * omega, travel = p->travel_m_per_rad, half_m = p->half_backlash_m;

    /* Nut: spring and damper outside the backlash; a nut with play can be pushed but not pulled back. */
    V stretch = travel * theta - nut_position_m;
    V rate = p->damping_n_s_per_m * (travel * omega - nut_velocity_m_s);
    V pulled = SEL(stretch < -half_m, p->stiffness_n_per_m * (stretch + half_m), none);
    V spring = SEL(stretch > half_m, p->stiffness_n_per_m * (stretch - half_m), pulled);
    M meets = (p->stiffness_n_per_m > 0.0) & ((half_m == 0.0) | ((spring + rate) * spring > 0.0));
    V damping = SEL(meets, p->damping_n_s_per_m, none);
    V push = SEL(meets, spring, none) - damping * nut_velocity_m_s;
    V drag = motor.drag + damping * travel * travel;
    V torque = motor.torque_nm - push * travel;

    /* Kick: linear drag at the mean speed, then the friction impulse. */
    V half_drag = 0.5 * p->kick_rad_s_per_nm * drag;
    V share = 1.0 / (1.0 + half_drag);
    V free = (omega * (1.0 - half_drag) + p->kick_rad_s_per_nm * torque) * share;
    V force = push + damping * travel * omega;
    V ratio = omega / p->stribeck_rad_s;
    V friction = p->coulomb_nm + p->stribeck_nm / (1.0 + ratio * ratio);
    V loss = SEL(free * force > 0.0, p->forward_loss, p->backward_loss);
    friction += loss * ABS(force) * travel;
    V stop = p->kick_rad_s_per_nm * friction * share;
    V omega_new = SEL(free > stop, free - stop, SEL(free < -stop, free + stop, none));
    s->theta_rad = theta + half_dt * omega_new;
    s->omega_rad_s = omega_new;
    s->force_n = push + 0.5 * damping * travel * (omega + omega_new);
    s->at_rest = motor.steady & (ABS(omega) <= REST_RAD_S) & (ABS(omega_new) <= REST_RAD_S) & 1;
    return s->force_n;
}

#if LANES == 1
/* 1 if the last sub-step changed neither angle nor currents. With the same arguments further ones change nothing either
   (with friction, not a bit): time may be skipped until an argument changes. */
INLINE int at_rest(const AXIS_STATE *s) { return s->at_rest != 0; }
#endif
