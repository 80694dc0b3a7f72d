/* The carriage of an axis within a window: nut force, push and guide friction move it (kernel.c). Text of law.h, for
   each width. */

/* Where it is in the middle of a sub-step. */
INLINE V OF(halfway_m)(const OF(AXIS) *axis, double dt_s) { return axis->x_m + 0.5 * dt_s * axis->v_m_s; }

/* Move it by a sub-step from x_mid_m, its middle, and add up force and torque of the window. nut_n: force on the nut;
   force_n: with all others. */
INLINE void OF(move)(OF(AXIS) *axis, V x_mid_m, V nut_n, V force_n, V torque_nm, double dt_s) {
    V none = {0};
    axis->sum_n += force_n;
    axis->sum_nut_n += nut_n;
    axis->sum_nm += torque_nm;
    V free_m_s = axis->v_m_s + dt_s * (axis->mobility_per_kg * force_n + axis->rest_m_s2);
    V stop_m_s = dt_s * axis->mobility_per_kg * axis->friction_n;
    V stopped_m_s = SEL(free_m_s > -stop_m_s, free_m_s, -stop_m_s);
    free_m_s -= SEL(stopped_m_s < stop_m_s, stopped_m_s, stop_m_s);
    axis->v_m_s = SEL(axis->held * free_m_s < 0.0, none, free_m_s);
    axis->x_m = x_mid_m + 0.5 * dt_s * axis->v_m_s;
}

/* True where no position switch of the axis changes. */
INLINE M OF(is_free)(const OF(AXIS) *axis) {
    return (axis->free_low_m < axis->x_m) & (axis->x_m < axis->free_high_m);
}
