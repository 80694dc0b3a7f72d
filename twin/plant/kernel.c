/* The loop: three drives and MuJoCo together, up to the first threshold passed.

   It advances the whole plant at little more than the cost of MuJoCo alone, and the result is the same to the bit
   however time is cut into calls. Time is counted in sub-steps of dt from power-on; every n sub-steps, a window, MuJoCo
   makes one step:

         window: one MuJoCo step                       sub-step: F_j = drive(command, x_j, v_j)
       |--+--+--+--+--+--+--+--|                       v_j+1 = v_j + dt (F_j / m + a), less the friction's dt F_f / m
          F_1 F_2 ...      F_n   -> mean F on the nut  x_j+1 = x_j + dt (v_j + v_j+1) / 2
                                 -> mj_step            window start: v from MuJoCo, a from its last step

   Inside the window the drives see a carriage that responds to nut force and guide friction (m: inertia at the nut).
   Other forces are those of the window before, except springs and dampers of the structure, which are those at the
   start of this one: a window late they would feed oscillations. At the end MuJoCo, with friction, stops, structure and
   contacts, gives the velocity, and the position is corrected by the difference:

       x = x_n + h (v_MuJoCo - v_n)                    h = n dt

   which is MuJoCo's own rule (x' = x + h v') for the forces that only MuJoCo has, and the sub-steps' for the nut force
   and the moment at which friction stops a carriage: both are resolved at dt, not at h (plant/3). MuJoCo's dry friction
   creeps (below 1 um/s); a carriage that sticks in the sub-steps does not. Thresholds are compared after every
   sub-step.

   A drive gets the exact time mean of its command over the sub-step: the sum of the ticks, each weighted by the part of
   the sub-step that follows it, less the mean of the rest of the leads (lead.py).

   Shaken: a motor that has lost its step throws its nut to and fro, at a stop above all. Where the structure moves
   faster than SHAKEN_M_S, as no motion in step does, windows are cut into `fine` ones until it has been calm
   (plant/25): the exchange could not follow else, and would feed what it should damp.

   Rest: after `rest_windows` windows of standstill without leads the plant is frozen: all sub-steps up to the next tick
   or change of current are skipped (plant/6). Of these windows themselves those are skipped that would change no bit.

   MuJoCo's step is called by its address (native.py). Between the stops, without contact, it is written out instead
   (glide.h). */
#pragma once
#include "../drives/servo.h"
#include "abreast.h"
#include "feed.h"
#include "lead.h"
#include "margin.h"
#include "samples.h"
#include "teeth.h"
#include "touch.h"
#include "window.h"

/* Ticks of a call, in time order. */
typedef struct {
    const int64_t *t_ns; /* [n] */
    const int32_t *delta; /* [n, axes], axes at most as many as there are commands */
    const int64_t *early_lead_ns; /* [early], early <= n: leads of the first ticks */
    int64_t n, axes, early;
    int64_t lead_ns; /* of the other ticks */
    int64_t made; /* so far */
} TICKS;

/* Sub-step in which the current of an axis is lowered (plant/7); NEVER if not asked for or done. */
INLINE int64_t lower_at(const AXIS *axis) {
    if (axis->lowering == 0 || axis->phases == OPEN || axis->fraction == axis->idle_fraction)
        return NEVER;
    return axis->still_since + axis->idle_delay;
}

/* The sub-step of the next tick or change of current, at most `until`. */
INLINE int64_t next_change(const MEMORY *memory, const TICKS *ticks, int64_t until) {
    if (ticks->made < ticks->n)
        until = least_of(until, floor_div(ticks->t_ns[ticks->made] - 1, memory->plant->substep_ns));
    for (int i = 0; i < AXES; i++)
        until = least_of(until, lower_at(&memory->axes[i]));
    return until;
}

/* 1 if all drives are, which are servo drives. */
INLINE int in_position(const MEMORY *memory) {
    int found = 1;
    for (int i = 0; i < AXES; i++)
        found = found && memory->states[i].on != 0 && memory->states[i].arrived == memory->drives[i].window_substeps;
    return found;
}

/* Lower the least pull-out margins to those of now, for motors whose stages are on. */
static void lower_margins(MEMORY *memory) {
    const PLANT *plant = memory->plant;
    const SUPPLY *supply = memory->supply;
    int64_t now_ns = plant->now * plant->substep_ns;
    double faster = supply->on ? supply->source_v / most(supply->voltage_v, 1.0) : 1.0;
    for (int i = 0; i < AXES; i++) {
        AXIS *axis = &memory->axes[i];
        const AXIS_STATE *state = &memory->states[i];
        double now = 0.0;
        if (memory->drives[i].kind == SERVO) {
            if (state->fault == 0 && state->on == 0)
                continue;
            if (state->fault == 0)
                now = 1.0 - fabs(state->error) / memory->drives[i].lag_limit;
        } else {
            if (axis->phases == OPEN)
                continue;
            double command = (double)memory->commanded[i] - behind(&memory->leads[i], now_ns);
            double lag = (command - state->theta_rad * axis->steps_per_rad) * axis->full_steps;
            double speed_rad_s = faster * state->omega_rad_s;
            double share = 0.1 * ((double)plant->window / (double)plant->usual);
            axis->turning_rad_s += share * (speed_rad_s - axis->turning_rad_s);
            axis->fastest_rad_s = most(axis->fastest_rad_s, fabs(axis->turning_rad_s));
            const double *available_nm = memory->available + i * memory->speeds;
            now = margin(axis->mean_nm, lag, speed_rad_s, available_nm, axis->fraction);
        }
        axis->margin = least(axis->margin, now);
        axis->untaken = least(axis->untaken, now);
    }
}

/* Set deflection and push of the feeler by where the tool is over the table. */
static void feel_tip(MEMORY *memory) {
    int64_t n = memory->joints;
    double x_m = 0.0, y_m = 0.0, z_m = 0.0;
    for (int64_t j = 0; j < n; j++) {
        double q = memory->qpos[j];
        for (int i = 0; i < AXES; i++)
            if (memory->axes[i].dof == j)
                q = memory->axes[i].x_m;
        x_m += memory->shape[j] * q;
        y_m += memory->shape[n + j] * q;
        z_m += memory->shape[2 * n + j] * q;
    }
    feel(memory->feeler, memory->targets, memory->number_of_targets, x_m, y_m, z_m);
}

/* Compare with all thresholds at the end of a sub-step; 1 if one was passed or left. */
static int pass_thresholds(MEMORY *memory) {
    int64_t now_ns = memory->plant->now * memory->plant->substep_ns;
    int changed = 0;
    for (int64_t k = 0; k < memory->number_of_thresholds; k++) {
        THRESHOLD *threshold = &memory->thresholds[k];
        int64_t i = threshold->axis;
        double beyond;
        if (threshold->quantity == POSITION) {
            beyond = threshold->sense * (memory->axes[i].x_m - threshold->limit);
        } else if (threshold->quantity == TOUCH) {
            beyond = memory->feeler->deflected_m - threshold->limit;
        } else if (i >= AXES) {
            continue; /* no mechanics: no lag, no fault */
        } else if (threshold->quantity == LAG) {
            const AXIS_STATE *state = &memory->states[i];
            double command = (double)memory->commanded[i] - behind(&memory->leads[i], now_ns);
            beyond = fabs(command - state->theta_rad * memory->axes[i].steps_per_rad - state->shift) - threshold->limit;
        } else {
            beyond = memory->axes[i].fault || memory->states[i].fault ? 1.0 : -1.0;
        }
        int passed = threshold->passed ? beyond > -threshold->hysteresis : beyond > 0.0;
        if (passed != (threshold->passed != 0)) {
            threshold->passed = passed;
            changed = 1;
        }
    }
    return changed;
}

/* Skip sub-steps of a frozen plant; 1 if it has to wake for the next one. */
static int skip_frozen(MEMORY *memory, const TICKS *ticks, int64_t until) {
    PLANT *plant = memory->plant;
    int64_t wakes = next_change(memory, ticks, until);
    if (plant->look_every && plant->look_at <= wakes) {
        if (in_position(memory))
            wakes = plant->look_at;
        else
            plant->look_at += ((wakes - plant->look_at) / plant->look_every + 1) * plant->look_every;
    }
    plant->now = most_of(plant->now, wakes);
    if (plant->sample_every && plant->sample_at <= plant->now) {
        if (plant->held == 0) {
            take_sample(memory, plant->sample_at);
            plant->held = 1;
        }
        plant->sample_at += ((plant->now - plant->sample_at) / plant->sample_every + 1) * plant->sample_every;
    }
    return plant->now != until && !(plant->look_every && plant->now == plant->look_at);
}

/* Windows that would change no bit: count them instead, up to the next change, sample or freezing. */
static void skip_settled(MEMORY *memory, const TICKS *ticks, int64_t until) {
    PLANT *plant = memory->plant;
    int64_t wakes = least_of(next_change(memory, ticks, until), plant->sample_at);
    int64_t alike = floor_div(wakes - plant->now, plant->window);
    alike = most_of(0, least_of(alike, plant->rest_windows - 1 - plant->quiet));
    plant->quiet += alike;
    plant->now += alike * plant->window;
}

/* Lay the next tick, which is in the sub-step that ends at end_ns, into commands and leads. */
INLINE void lay_tick(MEMORY *memory, TICKS *ticks, int64_t end_ns, int64_t dt_ns) {
    PLANT *plant = memory->plant;
    int64_t k = ticks->made++, t_ns = ticks->t_ns[k];
    double remaining = (double)(end_ns - t_ns) / (double)dt_ns;
    int64_t lead_ns = k < ticks->early ? ticks->early_lead_ns[k] : ticks->lead_ns;
    for (int64_t i = 0; i < ticks->axes; i++) {
        int64_t change = ticks->delta[k * ticks->axes + i];
        if (change == 0)
            continue;
        memory->commanded[i] += change;
        if (i < AXES) {
            AXIS *axis = &memory->axes[i];
            axis->command += (double)change * remaining;
            axis->fraction = 1.0;
            axis->still_since = plant->now + 1;
        }
        if (lead_ns > 0) {
            LEAD *lead = &memory->leads[i];
            double before_it = mean_behind(lead, t_ns, end_ns, dt_ns);
            begin(lead, t_ns, change, lead_ns);
            plant->led_until_ns = most_of(plant->led_until_ns, lead->end_ns);
            if (i < AXES)
                memory->axes[i].command -= mean_behind(lead, t_ns, end_ns, dt_ns) - before_it;
        }
    }
}

/* Find commands and currents of the next sub-step. A tick at t belongs to the sub-step in (start, end]. */
INLINE void lay_ticks(MEMORY *memory, TICKS *ticks, int64_t dt_ns) {
    const PLANT *plant = memory->plant;
    int64_t now = plant->now, start_ns = now * dt_ns, end_ns = start_ns + dt_ns;
    for (int i = 0; i < AXES; i++) {
        AXIS *axis = &memory->axes[i];
        if (now >= lower_at(axis))
            axis->fraction = axis->idle_fraction;
        axis->command = (double)memory->commanded[i];
    }
    for (int i = 0; plant->led_until_ns > start_ns && i < AXES; i++)
        if (memory->leads[i].end_ns > start_ns) {
            AXIS *axis = &memory->axes[i];
            axis->command -= mean_behind(&memory->leads[i], start_ns, end_ns, dt_ns);
            axis->fraction = 1.0;
            axis->still_since = now + 1;
        }
    while (ticks->made < ticks->n && ticks->t_ns[ticks->made] <= end_ns)
        lay_tick(memory, ticks, end_ns, dt_ns);
}

/* Advance drive and carriage of axis i by a sub-step. */
INLINE void step_carriage(MEMORY *memory, int i, double dt_s) {
    AXIS *axis = &memory->axes[i];
    const AXIS_PARAMETERS *drive = &memory->drives[i];
    AXIS_STATE *state = &memory->states[i];
    SUPPLY *supply = memory->supply;
    const CUT *cut = memory->cut;
    const FEELER *feeler = memory->feeler;
    const double *tip_nuts = memory->tip_nuts;
    double x_mid_m = halfway_m(axis, dt_s);
    double before_rad_s = state->omega_rad_s;
    int64_t phases = axis->phases & supply->gate;
    TORQUE by = drive->kind == SERVO ? servo_torque(drive, state, axis->command, phases)
                                     : stepper_torque(drive, state, axis->command, phases, axis->fraction, 0.0);
    double nut_n = turn(drive, state, by, x_mid_m - axis->zero_m, axis->v_m_s);
    double force_n = axis->push_n + nut_n;
    if (supply->on) {
        double work_w = 0.5 * (before_rad_s + state->omega_rad_s) * state->torque_nm;
        double a_a = state->current_a_a, b_a = state->current_b_a;
        supply->energy_j += dt_s * (work_w + axis->resistance_ohm * (a_a * a_a + b_a * b_a));
    }
    if (cut->on)
        force_n += tip_nuts[i] * cut->x_n + tip_nuts[AXES + i] * cut->y_n;
    for (int k = 0; feeler->on && k < AXES; k++)
        force_n += tip_nuts[k * AXES + i] * feeler->push_n[k];
    move(axis, x_mid_m, nut_n, force_n, state->torque_nm, dt_s);
}

/* One sub-step of all that moves inside a window. */
INLINE void make_substep(MEMORY *memory, double dt_s) {
    CUT *cut = memory->cut;
    FEELER *feeler = memory->feeler;
    if (cut->on) {
        double x_m_s = memory->drives[0].travel_m_per_rad * memory->states[0].omega_rad_s;
        bite(cut, memory->plant->now, x_m_s, memory->drives[1].travel_m_per_rad * memory->states[1].omega_rad_s);
        bend(cut);
    }
    for (int i = 0; i < AXES; i++)
        step_carriage(memory, i, dt_s);
    for (int i = 0; feeler->on && i < AXES; i++)
        feeler->sum_n[i] += feeler->push_n[i];
    memory->plant->now += 1;
}

#if WIDE
WIDE_BEGIN
/* Make sub-steps with all axes abreast up to the end of the window, `until`, or the first one after which something is
   to be looked at. */
static void make_substeps_abreast(MEMORY *memory, TICKS *ticks, int64_t until, double dt_s) {
    PLANT *plant = memory->plant;
    ABREAST abreast;
    take_drives(&abreast, memory);
    take_axes(&abreast, memory);
    int64_t last = least_of(until, plant->now - plant->now % plant->window + plant->window);
    if (plant->sample_at > plant->now)
        last = least_of(last, plant->sample_at);
    if (plant->look_every)
        last = least_of(last, plant->look_at);
    do {
        lay_ticks(memory, ticks, plant->substep_ns);
        step_abreast(&abreast, memory, dt_s);
        plant->now += 1;
    } while (plant->now < last && !plant->watched && !any_4(~is_free_4(&abreast.axis)));
    give_axes(&abreast, memory);
}
WIDE_END
#endif

/* The end of a window; 0 if a joint runs away. */
static int end_window(MEMORY *memory, const TICKS *ticks, int64_t until) {
    PLANT *plant = memory->plant;
    for (int i = 0; i < AXES; i++) {
        memory->axes[i].mean_nm = memory->axes[i].sum_nm / (double)plant->window;
        memory->axes[i].sum_nm = 0.0;
    }
    lower_margins(memory);
    if (memory->supply->on)
        feed(memory);
    leave_window(memory);
    if (plant->lost_dof >= 0)
        return 0;
    if (plant->settled == SAME && plant->look_every == 0)
        skip_settled(memory, ticks, until);
    return 1;
}

/* Take the sample that is due, and compare with thresholds and feeler, at the end of a sub-step; 1 if one of them ends
   the call. */
INLINE int find_edge(MEMORY *memory) {
    PLANT *plant = memory->plant;
    if (plant->now == plant->sample_at) {
        take_sample(memory, plant->now);
        plant->sample_at += plant->sample_every;
    }
    if (memory->feeler->on) {
        feel_tip(memory);
        if (memory->feeler->broken > 1)
            plant->struck = 1;
    }
    int near = plant->watched != 0;
    for (int i = 0; i < AXES; i++)
        near |= !is_free(&memory->axes[i]);
    return (near && pass_thresholds(memory)) || plant->struck;
}

/* Tell where the joints are at until_ns, within a sub-step along their velocities. What only MuJoCo knows, the
   structure, is known at the ends of windows: it comes one window late and smooth. */
static void tell_places(MEMORY *memory, int64_t until_ns) {
    const PLANT *plant = memory->plant;
    int64_t dt_ns = plant->substep_ns, ahead_ns = plant->edge ? 0 : until_ns - plant->now * dt_ns;
    double share = (double)(plant->now % plant->window) + (double)ahead_ns / (double)dt_ns;
    share /= (double)plant->window;
    for (int64_t j = 0; j < memory->joints; j++)
        memory->place[j] = memory->before[j] + share * (memory->qpos[j] - memory->before[j]);
    for (int i = 0; i < AXES; i++) {
        const AXIS *axis = &memory->axes[i];
        memory->place[axis->dof] = axis->x_m + 1e-9 * (double)ahead_ns * axis->v_m_s;
    }
}

/* Advance by whole sub-steps to until_ns, or to the end of the first one in which a threshold was passed or left, or
   two shapes that must not meet were found to touch, or to the first look at which all drives are in position; return
   the ticks made.

   t_ns [ticks], delta [ticks, axes], axes at most as many as there are commands: ticks in time order; early_lead_ns
   [early], early <= ticks: leads of the first ticks, lead_ns that of the others. mujoco.py checks what it passes. */
API int64_t advance(MEMORY *memory, int64_t until_ns, const int64_t *t_ns, int64_t ticks, const int32_t *delta,
                    int64_t axes, const int64_t *early_lead_ns, int64_t early, int64_t lead_ns) {
    PLANT *plant = memory->plant;
    TICKS given = {t_ns, delta, early_lead_ns, ticks, axes, early, lead_ns, 0};
    int64_t dt_ns = plant->substep_ns, until = floor_div(until_ns, dt_ns);
    double dt_s = 1e-9 * (double)dt_ns;
    plant->edge = plant->arrived = plant->struck = 0;
    for (;;) {
        if (plant->look_every && plant->now == plant->look_at) {
            int64_t look_ns = plant->now * dt_ns + plant->look_ahead_ns;
            if (look_ns <= until_ns && in_position(memory)) {
                until_ns = look_ns;
                plant->arrived = 1;
                break;
            }
            plant->look_at += plant->look_every;
        }
        if (plant->now >= until)
            break;
        if (plant->frozen) {
            if (!skip_frozen(memory, &given, until))
                continue;
            wake_up(memory);
        }
#if WIDE
        if (can_go_abreast(memory)) {
            make_substeps_abreast(memory, &given, until, dt_s);
        } else
#endif
        {
            lay_ticks(memory, &given, dt_ns);
            make_substep(memory, dt_s);
        }
        if (plant->now % plant->window == 0 && !end_window(memory, &given, until))
            break;
        if (find_edge(memory)) {
            plant->edge = 1;
            break;
        }
    }
    tell_places(memory, until_ns);
    return given.made;
}

/* `margin`, `bite` and `glide` for arrays in Python: closed forms are compared with them. available_nm [SPEEDS]. */
API double margin_at(A1(const double, available_nm, SPEEDS), double torque_nm, double lag_full_steps,
                     double speed_rad_s, double fraction) {
    return margin(torque_nm, lag_full_steps, speed_rad_s, available_nm, fraction);
}
API void bite_once(R(CUT, cut), int64_t now, double x_m_s, double y_m_s) { bite(cut, now, x_m_s, y_m_s); }
API int64_t glide_once(A1(JOINT, joints, n), A2(const double, mobility, n, n), double h_s, A1(double, qpos, n),
                       A1(double, qvel, n), A1(double, qacc, n), A1(double, qacc_smooth, n),
                       A1(const double, qfrc, n)) {
    return glide(joints, mobility, joints_n, h_s, qpos, qvel, qacc, qacc_smooth, qfrc);
}

/* Leave the frozen state, before a change from outside. */
API void wake(R(MEMORY, memory)) { wake_up(memory); }

/* Begin a window with what MuJoCo has. */
API void begin_window(R(MEMORY, memory)) { take_carriages(memory); }

/* Let the drives follow their screws at the present places of the nuts. */
API void feel_nuts(R(MEMORY, memory)) { feel_screws(memory); }

/* Reset the least pull-out margins and largest speeds to those of now. */
API void look(R(MEMORY, memory)) {
    for (int i = 0; i < AXES; i++) {
        memory->axes[i].margin = 1.0;
        memory->axes[i].fastest_rad_s = 0.0;
    }
    lower_margins(memory);
}

/* Let the feeler, and thresholds of it, be as the machine stands. */
API void feel_now(R(MEMORY, memory)) {
    if (memory->feeler->on) {
        feel_tip(memory);
        pass_thresholds(memory);
    }
}
