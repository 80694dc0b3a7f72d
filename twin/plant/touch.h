/* The law of a feeler, a touch probe or a plate for tool lengths (touch.py).

       d        distance of the ball (of the cutter's end, over a plate) from the nearest target, < 0: deflected by -d
       n        where that distance grows fastest: the way in which the tool is pushed

       deflection u = -d        contact changes at u > pretravel + lobing cos 3 phi, back below that less the hysteresis
       force      F = f u / pretravel,  beyond it  f + rate (u - pretravel)      f = |(force nx, force ny, force_z nz)|
       u > overtravel           it breaks: a collision; the contact stays closed, and nothing pushes any more

   phi: of n, about the vertical. Distances are exact (closed forms): of a ball from boxes, cylinders, rings and the
   table's surface. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"

#define AWAY_M 1.0 /* further than anything is looked for */

/* How far a point is from something, < 0 inside, and the gradient of that. */
typedef struct {
    double m, x, y, z;
} AWAY;

/* A point from the nearest side of a box: the distance in m, x and y of the way. */
INLINE AWAY from_sides(const TARGET *target, double dx, double dy) {
    double u = target->cosine * dx + target->sine * dy;
    double v = target->cosine * dy - target->sine * dx;
    double au = fabs(u) - target->a_m, av = fabs(v) - target->b_m;
    double side = av, nu = 0.0, nv = 1.0;
    if (au > 0.0 && av > 0.0) {
        side = hypot(au, av);
        nu = au / side;
        nv = av / side;
    } else if (au > av) {
        side = au;
        nu = 1.0;
        nv = 0.0;
    }
    nu = copysign(nu, u);
    nv = copysign(nv, v);
    return (AWAY){side, target->cosine * nu - target->sine * nv, target->sine * nu + target->cosine * nv, 0.0};
}

/* The same of the wall of a cylinder, or the nearer one of a ring. */
INLINE AWAY from_walls(const TARGET *target, double dx, double dy) {
    double rho = hypot(dx, dy);
    double side = rho - target->a_m, outwards = 1.0;
    if (target->kind == RING && target->b_m - rho > side) {
        side = target->b_m - rho;
        outwards = -1.0;
    }
    if (rho > 0.0)
        return (AWAY){side, outwards * dx / rho, outwards * dy / rho, 0.0};
    return (AWAY){side, outwards, 0.0, 0.0};
}

INLINE AWAY distance(const TARGET *target, double x_m, double y_m, double z_m) {
    double dx = x_m - target->x_m, dy = y_m - target->y_m, dz = z_m - target->z_m;
    if (target->kind == PLANE)
        return (AWAY){-dz, 0.0, 0.0, -1.0};
    AWAY aside = target->kind == BOX ? from_sides(target, dx, dy) : from_walls(target, dx, dy);
    double side = aside.m, up = fabs(dz) - target->c_m, up_z = copysign(1.0, dz);
    if (side > 0.0 && up > 0.0) {
        double far = hypot(side, up);
        return (AWAY){far, aside.x * side / far, aside.y * side / far, up_z * up / far};
    }
    if (side > up)
        return aside;
    return (AWAY){up, 0.0, 0.0, up_z};
}

/* Set deflection and push of a feeler with the tool's point at this place. targets [n]. */
INLINE void feel(FEELER *feeler, const TARGET *targets, int64_t n, double x_m, double y_m, double z_m) {
    for (int i = 0; i < 3; i++)
        feeler->push_n[i] = 0.0;
    if (feeler->broken)
        return;
    AWAY nearest = {AWAY_M, 0.0, 0.0, 0.0};
    int64_t at = 0;
    for (int64_t k = 0; k < n; k++) {
        AWAY found = distance(&targets[k], x_m, y_m, z_m + feeler->below_m);
        if (found.m < nearest.m) {
            nearest = found;
            at = k;
        }
    }
    double deflection_m = feeler->radius_m - nearest.m;
    feeler->at = at;
    feeler->deflected_m = deflection_m;
    if (deflection_m <= 0.0)
        return;
    double across = hypot(nearest.x, nearest.y);
    if (across > 0.0) {
        double cosine = nearest.x / across;
        feeler->deflected_m -= feeler->lobing_m * across * cosine * (4.0 * cosine * cosine - 3.0);
    }
    if (deflection_m > feeler->over_m) {
        feeler->broken = NEWS;
        feeler->deflected_m = AWAY_M;
        return;
    }
    double force_n = hypot(feeler->force_n * across, feeler->force_z_n * nearest.z);
    if (deflection_m < feeler->pretravel_m)
        force_n *= deflection_m / feeler->pretravel_m;
    else
        force_n += feeler->rate_n_per_m * (deflection_m - feeler->pretravel_m);
    feeler->push_n[0] = force_n * nearest.x;
    feeler->push_n[1] = force_n * nearest.y;
    feeler->push_n[2] = force_n * nearest.z;
}
