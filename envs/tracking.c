/* One step of path following in one call: pulses for each axis, drives and machine, observation. So an environment
   costs little more than its physics. A step of h:

       frequencies f_i  --- pulses at u_i = k + 1/2 --->  the loop's advance  --->  tool p, rotors, margins
                            u_i' = u_i + f_i h                                         |
                                                                                       v
       path P(s)  . . . . . nearest point P(s) within a window about the last one,  deviation |p - P(s)|, progress

   u_i is the phase of an axis in steps, its counter the nearest whole number: so pulses are evenly spaced within a step
   and across steps at any change of frequency, and the counter is never off by more than half a step. The nearest point
   is searched only near the last one, as a path may cross itself (envs/8). A point of the path that is passed over
   counts for the deviation, and progress is never more than the tool's own way (envs/12).

   A PLACE says where the arrays of an environment are (tracking.py). path [points, 4]: X, Y, Z and the way to there. */
#pragma once
#include "../twin/native/core.h"
#include "../twin/native/records.h"
#include "../twin/plant/kernel.c"

#define STOPS_HZ 300.0 /* step frequency from which every axis can stop at once: the limit at the end of the path */
#define REST_NS 20000000 /* rest at the end: two swings of a rotor, one of a portal (envs/11) */
#define LOOK_NS 2000000 /* the tool is compared with the path at least this often */
#define BACK_MM 1.0 /* the search for the nearest point goes this far back, and this far beyond the reach of a step */

/* The value, clipped to -1 .. 1; -1 if it is nan. */
INLINE double within_one(double value) { return value > 1.0 ? 1.0 : value > -1.0 ? value : -1.0; }

INLINE double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* X, Y, Z of point j of the path; the fourth is the way to there. */
INLINE const double *path_point(const PLACE *place, int64_t j) { return &place->path[4 * j]; }

/* Time of pulse k (0, 1, ...) of a step, from its start. */
INLINE double pulse_s(const LANE *lane, int64_t k) {
    if (lane->rate_hz == 0.0)
        return INFINITY;
    return (k + 0.5 - copysign(1.0, lane->rate_hz) * lane->fraction) / fabs(lane->rate_hz);
}

/* Write the pulses of a step, in time order, into t_ns [n] and delta [n, AXES]; return their number. */
INLINE int64_t pulses_of_step(LANE *lanes, int64_t start_ns, int64_t step_ns, int64_t *t_ns, int32_t *delta,
                              int64_t most_pulses) {
    double step_s = 1e-9 * step_ns, next_s[AXES];
    int64_t made[AXES] = {0}, n = 0;
    for (int i = 0; i < AXES; i++)
        next_s[i] = pulse_s(&lanes[i], 0);
    for (; n < most_pulses; n++) {
        double first_s = least(least(next_s[0], next_s[1]), next_s[2]);
        if (!(first_s <= step_s))
            break;
        t_ns[n] = start_ns + least_of(most_of(whole_of(rint(first_s * 1e9)), 1), step_ns);
        for (int i = 0; i < AXES; i++) {
            int due = next_s[i] == first_s;
            delta[AXES * n + i] = !due ? 0 : lanes[i].rate_hz > 0.0 ? 1 : -1;
            if (due)
                next_s[i] = pulse_s(&lanes[i], ++made[i]);
        }
    }
    for (int i = 0; i < AXES; i++) {
        int64_t change = lanes[i].rate_hz > 0.0 ? made[i] : -made[i];
        lanes[i].counter += change;
        lanes[i].fraction += lanes[i].rate_hz * step_s - change;
    }
    return n;
}

/* Distance of point j of the path from the straight way of the tool, from where `track` has it to a place. */
INLINE double off_mm(const PLACE *place, int64_t j, const double *tool_mm) {
    const double *point = path_point(place, j), *before_mm = place->track->tool_mm;
    double way[3], d[3], share = 0.0;
    for (int i = 0; i < 3; i++) {
        way[i] = tool_mm[i] - before_mm[i];
        d[i] = point[i] - before_mm[i];
    }
    double square = dot(way, way);
    if (square > 0.0)
        share = least(1.0, most(0.0, dot(d, way) / square));
    for (int i = 0; i < 3; i++)
        d[i] = d[i] - share * way[i];
    return sqrt(dot(d, d));
}

/* X, Y, Z of the path's point at a distance along it, in its piece j. */
INLINE void point_on(const PLACE *place, int64_t j, double way_mm, double *found) {
    const double *a = path_point(place, j), *b = path_point(place, j + 1);
    double share = (way_mm - a[3]) / (b[3] - a[3]);
    for (int i = 0; i < 3; i++)
        found[i] = a[i] + share * (b[i] - a[i]);
}

/* Follow the tool to a place [3]; return its progress in mm. Sets piece, way, deviation and place of the track.

   The nearest point of the path is looked for near the last one. The deviation is the tool's from there, or that of a
   point in between from the tool's way, if it is above the tolerance. Progress is how far the nearest point has gone
   on; forwards, no more than the tool has moved in that direction. */
INLINE double follow_to(const PLACE *place, const double *tool_mm) {
    TRACK *track = place->track;
    double low_mm = track->way_mm - BACK_MM, high_mm = track->way_mm + BACK_MM + track->reach_mm;
    int64_t j = track->piece, piece = track->piece;
    while (j > 0 && path_point(place, j)[3] > low_mm)
        j--;
    double nearest = INFINITY, way_mm = track->way_mm;
    for (; j < place->points - 1 && path_point(place, j)[3] < high_mm; j++) {
        const double *a = path_point(place, j), *b = path_point(place, j + 1);
        double d[3], from[3], off[3];
        for (int i = 0; i < 3; i++) {
            d[i] = b[i] - a[i];
            from[i] = tool_mm[i] - a[i];
        }
        double share = least(1.0, most(0.0, dot(from, d) / dot(d, d)));
        for (int i = 0; i < 3; i++)
            off[i] = tool_mm[i] - (a[i] + share * d[i]);
        double square = dot(off, off);
        if (square < nearest) {
            nearest = square;
            piece = j;
            way_mm = a[3] + share * (b[3] - a[3]);
        }
    }
    double deviation_mm = sqrt(nearest), progress_mm = way_mm - track->way_mm;
    if (progress_mm > 0.0) {
        for (int64_t passed = track->piece + 1; passed <= piece; passed++) {
            double there_mm = off_mm(place, passed, tool_mm);
            if (there_mm > track->tolerance_mm)
                deviation_mm = most(deviation_mm, there_mm);
        }
        double from[3], d[3], moved[3];
        point_on(place, track->piece, track->way_mm, from);
        point_on(place, piece, way_mm, d);
        for (int i = 0; i < 3; i++) {
            d[i] = d[i] - from[i];
            moved[i] = tool_mm[i] - track->tool_mm[i];
        }
        double along_mm = dot(moved, d) / most(sqrt(dot(d, d)), 1e-12);
        progress_mm = most(0.0, least(progress_mm, along_mm));
    }
    track->piece = piece;
    track->way_mm = way_mm;
    track->deviation_mm = deviation_mm;
    for (int i = 0; i < 3; i++)
        track->tool_mm[i] = tool_mm[i];
    return progress_mm;
}

/* X, Y, Z of the tool from the start of the path. */
INLINE void find_tool(const PLACE *place, double *tool_mm) {
    for (int i = 0; i < AXES; i++) {
        double at_mm = 0.0;
        for (int64_t j = 0; j < place->joints; j++)
            at_mm += place->shape_mm[i * place->joints + j] * place->memory->place[j];
        tool_mm[i] = at_mm - place->lanes[i].origin_mm;
    }
}

/* Steps between the command of an axis and its rotor. */
INLINE double lag_steps(const MEMORY *memory, int i) {
    return memory->commanded[i] - memory->states[i].theta_rad * memory->axes[i].steps_per_rad;
}

/* Fill in an observation [SIZE], and reset margins and edge. */
INLINE void observe(const PLACE *place, double *observation, int64_t size) {
    static const double previews_mm[] = PREVIEW_MM;
    TRACK *track = place->track;
    const MEMORY *memory = place->memory;
    double nearest[3];
    point_on(place, track->piece, track->way_mm, nearest);
    track->edge = INFINITY;
    for (int i = 0; i < AXES; i++) {
        const LANE *lane = &place->lanes[i];
        const double *shape_mm = &place->shape_mm[i * place->joints];
        AXIS *axis = &memory->axes[i];
        double speed = 0.0;
        for (int64_t j = 0; j < place->joints; j++)
            speed += shape_mm[j] * memory->qvel[j];
        for (int k = 0; k < AXES; k++) { /* carriages as the sub-steps see them */
            int64_t dof = memory->axes[k].dof;
            speed += shape_mm[dof] * (memory->axes[k].v_m_s - memory->qvel[dof]);
        }
        double counter_mm = lane->counter / lane->steps_per_mm;
        observation[i] = within_one((track->tool_mm[i] - nearest[i]) / track->tolerance_mm);
        observation[AXES + i] = within_one(speed * lane->steps_per_mm / lane->highest_hz);
        observation[2 * AXES + i] = lane->rate_hz / lane->highest_hz;
        observation[3 * AXES + i] = within_one(lag_steps(memory, i) / lane->half_slip);
        observation[4 * AXES + i] = within_one((counter_mm - nearest[i]) / (2.0 * track->tolerance_mm));
        observation[5 * AXES + i] = most(0.0, within_one(axis->margin));
        axis->margin = 1.0;
        if (axis->fastest_rad_s >= SLOW_RAD_S)
            track->edge = least(track->edge, lane->limit_rad_s / axis->fastest_rad_s);
        axis->fastest_rad_s = 0.0;
    }
    int64_t j = track->piece;
    double *ahead = &observation[6 * AXES];
    for (size_t k = 0; k < sizeof previews_mm / sizeof *previews_mm; k++) {
        double ahead_mm = previews_mm[k];
        while (j < place->points - 2 && path_point(place, j + 1)[3] < track->way_mm + ahead_mm)
            j++;
        const double *a = path_point(place, j), *b = path_point(place, j + 1);
        double share = least(1.0, (track->way_mm + ahead_mm - a[3]) / (b[3] - a[3]));
        for (int i = 0; i < AXES; i++)
            *ahead++ = within_one((a[i] + share * (b[i] - a[i]) - nearest[i]) / ahead_mm);
    }
    observation[size - 2] = 1.0 - track->way_mm / path_point(place, place->points - 1)[3];
    double left_s = track->time_limit_s - 1e-9 * (track->until_ns - track->began_ns);
    observation[size - 1] = within_one(most(left_s / track->time_limit_s, 0.0));
}

/* Make a step of an environment; return 0 or bits of DONE, OUTSIDE and STEPS_LOST, or -1 for an invalid action. */
INLINE int64_t step_of(const PLACE *place, const double *action, double *observation, int64_t size) {
    TRACK *track = place->track;
    LANE *lanes = place->lanes;
    MEMORY *memory = place->memory;
    for (int i = 0; i < AXES; i++)
        if (!isfinite(action[i]))
            return -1;
    for (int i = 0; i < AXES; i++)
        lanes[i].rate_hz = lanes[i].highest_hz * within_one(action[i]);
    int64_t n = pulses_of_step(lanes, track->until_ns, track->step_ns, place->t_ns, place->delta, place->pulses);
    int64_t first = 0, end_ns = track->until_ns + track->step_ns;
    double progress_mm = 0.0, deviation_mm = 0.0, tool_mm[3];
    while (track->until_ns < end_ns) {
        track->until_ns = least_of(track->until_ns + LOOK_NS, end_ns);
        int64_t last = first;
        while (last < n && place->t_ns[last] <= track->until_ns)
            last++;
        advance(memory, track->until_ns, &place->t_ns[first], last - first, &place->delta[AXES * first], AXES, NULL,
                0, 0);
        first = last;
        find_tool(place, tool_mm);
        progress_mm += follow_to(place, tool_mm);
        deviation_mm = most(deviation_mm, track->deviation_mm);
        if (memory->plant->lost_dof >= 0)
            track->until_ns = end_ns;
    }
    track->deviation_mm = deviation_mm;
    observe(place, observation, size);
    int64_t over = 0;
    int slow = 1, stands = path_point(place, place->points - 1)[3] - track->way_mm <= track->tolerance_mm;
    if (!(deviation_mm <= track->tolerance_mm) || memory->plant->lost_dof >= 0)
        over |= OUTSIDE;
    for (int i = 0; i < AXES; i++) {
        double lag = fabs(lag_steps(memory, i));
        if (!(lag < lanes[i].half_slip))
            over |= STEPS_LOST;
        slow = slow && fabs(lanes[i].rate_hz) <= STOPS_HZ;
        stands = stands && lag <= 0.5 * lanes[i].half_slip;
    }
    track->rest_ns = stands ? track->rest_ns + track->step_ns : 0;
    if (over == 0 && slow && track->rest_ns >= REST_NS)
        over = DONE;
    double step_s = 1e-9 * track->step_ns, share = least(1.0, track->deviation_mm / track->tolerance_mm);
    track->reward_progress = progress_mm;
    track->reward_time = -track->time_weight * step_s;
    track->reward_deviation = -track->deviation_weight * step_s * share * share;
    track->reward_abort = over & (OUTSIDE | STEPS_LOST) ? -track->abort_penalty : 0.0;
    return over;
}

/* Fill in the action [3] that brings the counters, by the end of the step, to a point that moves along the path, or
   beside it. asked [4] in -1 .. 1: its feed from 0 to feed_mm_s, its offset over offset_mm. */
INLINE void action_along(const PLACE *place, double feed_mm_s, double offset_mm, const double *asked, double *action) {
    TRACK *track = place->track;
    int64_t last = place->points - 1, j = 1, beyond = last; /* j: the first point behind the led one */
    double step_s = 1e-9 * track->step_ns;
    double ahead_mm = 0.5 * (1.0 + within_one(asked[0])) * feed_mm_s * step_s;
    track->led_mm = least(path_point(place, last)[3], track->led_mm + ahead_mm);
    while (j < beyond) {
        int64_t middle = (j + beyond) / 2;
        if (path_point(place, middle)[3] > track->led_mm)
            beyond = middle;
        else
            j = middle + 1;
    }
    const double *a = path_point(place, j - 1), *b = path_point(place, j);
    double share = (track->led_mm - a[3]) / (b[3] - a[3]);
    for (int i = 0; i < AXES; i++) {
        const LANE *lane = &place->lanes[i];
        double aim_mm = a[i] + share * (b[i] - a[i]) + offset_mm * within_one(asked[1 + i]);
        double speed_mm_s = (aim_mm - lane->counter / lane->steps_per_mm) / step_s;
        action[i] = (float)(speed_mm_s / (lane->highest_hz / lane->steps_per_mm)); /* as the action space has it */
    }
}

/* `pulses_of_step`. delta [n, AXES]. */
API int64_t lay_pulses(A1(LANE, lanes, AXES), int64_t start_ns, int64_t step_ns, A1(int64_t, t_ns, n),
                       A2(int32_t, delta, n, AXES)) {
    return pulses_of_step(lanes, start_ns, step_ns, t_ns, delta, t_ns_n);
}

/* `follow_to`. */
API double follow_tool(R(const PLACE, place), A1(const double, tool_mm, AXES)) { return follow_to(place, tool_mm); }

/* `action_along`. */
API void aim(R(const PLACE, place), double feed_mm_s, double offset_mm, A1(const double, asked, 4),
             A1(double, action, AXES)) {
    action_along(place, feed_mm_s, offset_mm, asked, action);
}

/* The first observation [SIZE]. */
API void begin_episode(R(const PLACE, place), A1(double, observation, SIZE)) {
    double tool_mm[3];
    find_tool(place, tool_mm);
    for (int i = 0; i < 3; i++)
        place->track->tool_mm[i] = tool_mm[i];
    follow_to(place, tool_mm);
    observe(place, observation, observation_n);
}

/* `step_of` with action [3], frequencies over the highest; observation [SIZE], to be filled. */
API int64_t take_step(R(const PLACE, place), A1(const double, action, AXES), A1(double, observation, SIZE)) {
    return step_of(place, action, observation, observation_n);
}

/* `step_of` for the environments first .. last - 1, except those whose `overs` is IDLE.

   places [n], actions [n, 3], observations [n, SIZE], overs [n]: what each returns. feed_mm_s, offset_mm: of
   `action_along`, which fills in the actions from asked [n, 4] unless the feed is 0. */
API void take_steps(A1(const PLACE, places, n), double feed_mm_s, double offset_mm, A2(const double, asked, n, columns),
                    A2(double, actions, n, AXES), A2(double, observations, n, SIZE), A1(int64_t, overs, n),
                    int64_t first, int64_t last) {
    for (int64_t k = most_of(first, 0); k < least_of(last, places_n); k++) {
        if (overs[k] == IDLE)
            continue;
        double *action = &actions[k * actions_columns];
        if (feed_mm_s > 0.0)
            action_along(&places[k], feed_mm_s, offset_mm, &asked[k * asked_columns], action);
        overs[k] = step_of(&places[k], action, &observations[k * observations_columns], observations_columns);
    }
}
