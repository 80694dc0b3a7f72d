/* One stepper drive, one sub-step: from the commanded electrical angle to the torque on the shaft.

   This code advances power stage and two phase currents by one sub-step dt:

       e_A = -Km w sin(Nr th)        e_B = Km w cos(Nr th)                              back-EMF
       v   = clip((i_ref - E i)/A + e, -V, V),   i' = E i + A (v - e)                   E = exp(-R dt/L), A = (1 - E)/R
       T   = -Km i_A sin(Nr th) + Km i_B cos(Nr th) - Td sin(4 Nr th) - T_fe(w)         i_A, i_B: mean of i and i'
       T_fe = (Km^2/Rm) w / (1 + (w/w_k)^2)                                             iron loss (motor.py)

   (MathWorks Simscape "Stepper Motor"; the stage is a current source that the supply limits, without chopper ripple.)
   The other half of the sub-step, rotor, screw and nut, is in shaft.h for every kind of motor.

   i_ref is the wave of the stage at the commanded angle, turned and shifted by its errors (stage.py). Electronic
   damping turns the current vector further by the swing of the load angle about its low pass, as a digital microstep
   drive with damping does (drives/9):

       lambda = phi_cmd - Nr th    d lambda_f/dt = 2 pi f_c (lambda - lambda_f)    phi = phi_cmd + g (lambda - lambda_f)

   For lambda the command is smoothed between its pulses.

             dt
       |-----------|          pulses within the sub-step act in it by the time mean of the command:
       __|``````````          a pulse after 0.2 dt moves the mean by 0.8 microsteps

   The constants come from `axis_parameters` (dynamics.py); `follow_command` in drives.c shows how the sub-step is
   used. Text of law.h, for each width. */

#if LANES == 1
#define SETTLED_RAD 1e-12 /* electrical load-angle swing below which damping does nothing, so a drive comes to rest */

/* The switched counterpart of the cosine: 1 up to pi/4, 0 at pi/2, -1 from 3 pi/4; linear between. The counter stands
   on multiples of pi/4 (half step), or odd ones (full step, drives/6); between them is the time mean of the wanted
   current in a sub-step with a pulse in it. */
INLINE double corner(double angle_rad) {
    double wrapped = angle_rad - 2.0 * PI * floor(angle_rad / (2.0 * PI) + 0.5);
    return least(1.0, most(-1.0, 2.0 - fabs(wrapped) * (4.0 / PI)));
}

/* Wanted currents at an electrical angle, of a stage that is stepped or has errors: turned and shifted by these. */
INLINE void faulty_shape(const AXIS_PARAMETERS *p, double phi, double *shape_a, double *shape_b) {
    double a, b, error, sine, cosine;
    if (p->stepped != 0.0) {
        a = corner(phi), b = corner(phi - 0.5 * PI);
        sine_and_cosine(phi - p->phase_offset_rad, &error, &cosine);
    } else {
        sine_and_cosine(phi, &b, &a);
        error = b;
    }
    if (p->step_error_rad != 0.0) {
        double straight = a;
        sine_and_cosine(p->step_error_rad * error, &sine, &cosine);
        a = straight * cosine - b * sine, b = b * cosine + straight * sine;
    }
    *shape_a = a;
    *shape_b = b + p->current_offset;
}
#endif

/* Set the wanted currents at an electrical angle where `changed`. */
INLINE void OF(shape)(const OF(AXIS_PARAMETERS) *p, OF(AXIS_STATE) *s, V phi, M changed) {
    V sine, cosine;
    OF(sine_and_cosine)(phi, &sine, &cosine);
    s->shape_a = SEL(changed, cosine, s->shape_a);
    s->shape_b = SEL(changed, sine, s->shape_b);
    if (ANY(changed & (p->plain == 0.0))) {
#if LANES == 1
        faulty_shape(p, phi, &s->shape_a, &s->shape_b);
#else
        for (int k = 0; k < LANES; k++)
            if (changed[k] && p->plain[k] == 0.0) {
                AXIS_PARAMETERS one = {
                    .stepped = p->stepped[k],
                    .phase_offset_rad = p->phase_offset_rad[k],
                    .step_error_rad = p->step_error_rad[k],
                    .current_offset = p->current_offset[k],
                };
                double a, b;
                faulty_shape(&one, phi[k], &a, &b);
                s->shape_a[k] = a, s->shape_b[k] = b;
            }
#endif
    }
}

/* Phase current after a sub-step: the wanted one, as far as the supply can drive it. Drops in the switches reduce the
   voltage that drives a current, not the one against which it flows back (drives/1), which is a part of the supply
   where the current is only too large, and not of the wrong sign (drives/14). */
INLINE V OF(phase)(const OF(AXIS_PARAMETERS) *p, V current_a, V wanted_a, V emf_v) {
    V voltage_v = (wanted_a - p->decay * current_a) * p->gain_v_per_a + emf_v;
    V return_v = SEL(current_a * wanted_a <= 0.0, p->return_v, p->fast_share * p->return_v);
    V highest_v = SEL(current_a >= 0.0, p->drive_v, return_v);
    V lowest_v = SEL(current_a <= 0.0, -p->drive_v, -return_v);
    V limit_v = SEL(voltage_v > highest_v, highest_v, lowest_v);
    M limited = (voltage_v > highest_v) | (voltage_v < lowest_v);
    return SEL(limited, p->decay * current_a + p->gain_a_per_v * (limit_v - emf_v), wanted_a);
}

/* The motor's part of a sub-step, as `turn` takes it.

   command           time mean over the sub-step of the microstep counter
   phases            BOTH with the stage on, OPEN with it off, PHASE_A or PHASE_B with a wire broken. An open phase
                     carries no current from this sub-step on (in truth it fades within 0.3 ms, decision drives/5)
   current_fraction  phase current over nominal, for the lowered current at rest
   load_torque_nm    torque from outside against positive rotation */
INLINE OF(TORQUE) OF(stepper_torque)(
    const OF(AXIS_PARAMETERS) *p, OF(AXIS_STATE) *s, V command, M phases, V current_fraction, V load_torque_nm) {
    V none = {0}, omega = s->omega_rad_s, theta = s->theta_rad + 0.5 * p->dt_s * omega;
    V angle = p->pole_pairs * theta + p->phase_offset_rad, sine, cosine;
    OF(sine_and_cosine)(angle, &sine, &cosine);

    /* Stage and currents. */
    M damped = p->damping_gain > 0.0, settled = damped | NOT(damped), changed = damped | (command != s->command);
    if (ANY(changed)) {
        V phi = command * p->microstep_rad + p->phase_offset_rad;
        if (ANY(damped)) {
            M begins = (phases != BOTH) | (s->command != s->command); /* nothing to damp, or the first sub-step */
            V smooth_rad = SEL(begins, phi, s->smooth_rad), lag_rad = SEL(begins, phi - angle, s->lag_rad);
            smooth_rad += p->smooth_share * (phi - smooth_rad);
            V lag = smooth_rad - angle;
            lag_rad += p->damping_share * (lag - lag_rad);
            V swing = lag - lag_rad;
            settled = ABS(swing) + ABS(phi - smooth_rad) < SETTLED_RAD;
            smooth_rad = SEL(settled, phi, smooth_rad);
            s->smooth_rad = SEL(damped, smooth_rad, s->smooth_rad);
            s->lag_rad = SEL(damped, SEL(settled, phi - angle, lag_rad), s->lag_rad);
            phi = SEL(damped & NOT(settled), phi + p->damping_gain * swing, phi);
            settled = settled | NOT(damped);
        }
        s->command = command;
        OF(shape)(p, s, phi, changed);
    }
    V emf_v = p->torque_constant_nm_per_a * omega, wanted_a = p->current_a * current_fraction;
    M with_a = (phases & PHASE_A) != 0, with_b = (phases & PHASE_B) != 0;
    V current_a = SEL(with_a, OF(phase)(p, s->current_a_a, wanted_a * s->shape_a, -emf_v * sine), none);
    V current_b = SEL(with_b, OF(phase)(p, s->current_b_a, wanted_a * s->shape_b, emf_v * cosine), none);
    V mean_a = SEL(with_a, 0.5 * (s->current_a_a + current_a), none);
    V mean_b = SEL(with_b, 0.5 * (s->current_b_a + current_b), none);
    OF(TORQUE) motor;
    motor.steady = settled & (current_a == s->current_a_a) & (current_b == s->current_b_a);
    s->current_a_a = current_a;
    s->current_b_a = current_b;
    V torque = p->torque_constant_nm_per_a * (mean_b * cosine - mean_a * sine);
    s->torque_nm = torque;
    V sine_2 = 2.0 * sine * cosine;
    motor.torque_nm = torque - (p->detent_torque_nm * 2.0 * sine_2 * (1.0 - 2.0 * sine * sine) + load_torque_nm);

    V knee = p->iron_knee_s_per_rad * omega;
    motor.drag = p->drag_nm_s_per_rad + p->iron_nm_s_per_rad / (1.0 + knee * knee);
    return motor;
}
