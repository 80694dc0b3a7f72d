/* The teeth of a cutter in one sub-step; the equations are in cutting.py.

   A tooth that enters or leaves within the sub-step has its force for the part in which it cuts, at the middle of that
   part: so the mean over a turn is the integral, however coarsely sub-steps divide it. */
#pragma once
#include "../drives/law.h"
#include "../native/core.h"
#include "../native/records.h"

#define LEAST_FEED_M_S 1e-6 /* below it a tooth rubs and takes no chip */

/* Forces x_n, y_n of sub-step `now`, with the screws moving tool over table by x_m_s, y_m_s. */
INLINE void bite(CUT *cut, int64_t now, double x_m_s, double y_m_s) {
    cut->x_m_s += cut->gain * (x_m_s - cut->x_m_s);
    cut->y_m_s += cut->gain * (y_m_s - cut->y_m_s);
    double speed = hypot(cut->x_m_s, cut->y_m_s);
    cut->x_n = 0.0;
    cut->y_n = 0.0;
    if (speed < LEAST_FEED_M_S)
        return;
    double along = 0.0, leftwards = 0.0;
    double turns = cut->turns * ((double)(now - cut->start) + 0.5);
    double half_rad = PI * cut->turns;
    for (int64_t tooth = 0; tooth < cut->flutes; tooth++) {
        double place = turns + (double)tooth / (double)cut->flutes;
        double phi = 2.0 * PI * (place - (double)whole_of(floor(place)));
        if (phi + half_rad > 2.0 * PI + cut->enter_rad)
            phi -= 2.0 * PI;
        double low = most(phi - half_rad, cut->enter_rad), high = least(phi + half_rad, cut->leave_rad);
        if (!(low < high))
            continue;
        double share = 0.5 * (high - low) / half_rad, sine, cosine;
        sine_and_cosine(0.5 * (low + high), &sine, &cosine);
        double feed_m_s = least(speed, cut->most_m_s);
        double tangential_n = cut->n_per_m * feed_m_s * cut->tooth_s * sine;
        if (cut->m != 0.0 && tangential_n > 0.0)
            tangential_n *= pow(1e3 * feed_m_s * cut->tooth_s * sine, -cut->m);
        along -= share * tangential_n * (cosine + cut->radial * sine);
        leftwards += share * tangential_n * (sine - cut->radial * cosine);
        along -= share * (cut->edge_n * cosine + cut->edge_radial_n * sine);
        leftwards += share * (cut->edge_n * sine - cut->edge_radial_n * cosine);
    }
    along /= speed;
    leftwards *= cut->left / speed;
    cut->x_n = along * cut->x_m_s - leftwards * cut->y_m_s;
    cut->y_n = along * cut->y_m_s + leftwards * cut->x_m_s;
    cut->sum_x_n += cut->x_n;
    cut->sum_y_n += cut->y_n;
}

/* Where the tip of the tool is after a sub-step with the forces that `bite` found. */
INLINE void bend(CUT *cut) {
    cut->bend_m[0] += cut->gain * (cut->tool_m_per_n * cut->x_n - cut->bend_m[0]);
    cut->bend_m[1] += cut->gain * (cut->tool_m_per_n * cut->y_n - cut->bend_m[1]);
}
