/* fixed.c with the sensitivities of state and cost to the gains k3, mu, a, k4, derived by hand.
 *
 * results (cases, 17): state, peak rate and settling as in fixed.c, then the four derivatives of the
 * cost.
 */
#include "work.h"

/* Derivatives of a state or of its rate by one gain; the effort has none. */
typedef State Slopes;

typedef struct { double k3, mu, a, k4; } Unit;

typedef struct {
    State y, d;
    Seen seen;
    double f1, f2;
    int b1, b2;
} Point;

INLINE Slopes along(const Gains *g, const Point *at, const Slopes *x, Unit n) {
    const State *y = &at->y;
    double w1 = y->w1, w2 = y->w2, square = w1 * w1 + w2 * w2;
    double inverse = 1 / (1 + square), under = 1 / (square + TILT2);
    double q = y->z * under, pull = g->k3 * inverse, r1 = at->seen.r1, r2 = at->seen.r2;
    double dw1 = at->d.w1, dw2 = at->d.w2, dz = at->d.z, s1 = q * w2, s2 = -q * w1;
    double dsquare = 2 * (w1 * dw1 + w2 * dw2), dq = (dz - q * dsquare) * under;
    double shrink = dsquare * inverse, half = 0.5 * (1 - square), cross = w1 * w2;
    double sat1 = at->b1 ? copysign(g->a, s1) : s1, sat2 = at->b2 ? copysign(g->a, s2) : s2;
    double xs = 2 * (w1 * x->w1 + w2 * x->w2);
    double xq = (x->z - q * xs) * under;
    double xs1 = xq * w2 + q * x->w2, xs2 = -(xq * w1 + q * x->w1);
    double xsat1 = at->b1 ? copysign(n.a, s1) : xs1, xsat2 = at->b2 ? copysign(n.a, s2) : xs2;
    double xpull = (n.k3 - pull * xs) * inverse;
    double xr1 = g->mu * xsat1 + n.mu * sat1 + x->e1 - xpull * w1 - pull * x->w1;
    double xr2 = g->mu * xsat2 + n.mu * sat2 + x->e2 - xpull * w2 - pull * x->w2;
    double xhalf = -0.5 * xs, xcross = x->w1 * w2 + w1 * x->w2;
    double xdw1 = (xhalf + 2 * w1 * x->w1) * r1 + (half + w1 * w1) * xr1 + xcross * r2 + cross * xr2;
    double xdw2 = (xhalf + 2 * w2 * x->w2) * r2 + (half + w2 * w2) * xr2 + xcross * r1 + cross * xr1;
    double xdz = x->w1 * r2 + w1 * xr2 - x->w2 * r1 - w2 * xr1;
    double xds = 2 * (x->w1 * dw1 + w1 * xdw1 + x->w2 * dw2 + w2 * xdw2);
    double xdq = (xdz - xq * dsquare - q * xds - dq * xs) * under;
    double xshrink = (xds - shrink * xs) * inverse;
    double free1 = n.mu * (dq * w2 + q * dw2)
                   + g->mu * (xdq * w2 + dq * x->w2 + xq * dw2 + q * xdw2);
    double free2 = n.mu * (dq * w1 + q * dw1)
                   + g->mu * (xdq * w1 + dq * x->w1 + xq * dw1 + q * xdw1);
    double xslope1 = -xpull * (dw1 - w1 * shrink) - pull * (xdw1 - x->w1 * shrink - w1 * xshrink)
                     + (at->b1 ? 0 : free1);
    double xslope2 = -xpull * (dw2 - w2 * shrink) - pull * (xdw2 - x->w2 * shrink - w2 * xshrink)
                     - (at->b2 ? 0 : free2);
    double xt1 = -x->w1 * (1 + square) - w1 * xs + x->w2 * y->z + w2 * x->z
                 - n.k4 * (y->e1 + y->v1) - g->k4 * (x->e1 + x->v1);
    double xt2 = -x->w2 * (1 + square) - w2 * xs - x->w1 * y->z - w1 * x->z
                 - n.k4 * (y->e2 + y->v2) - g->k4 * (x->e2 + x->v2);
    double xu1 = xt1 + JX * xslope1, xu2 = xt2 + JY * xslope2;
    Slopes d;
    d.w1 = xdw1;
    d.w2 = xdw2;
    d.z = xdz;
    d.e1 = xt1 * (1 / JX);
    d.e2 = xt2 * (1 / JY);
    d.p1 = x->v1;
    d.p2 = x->v2;
    d.v1 = x->e1 - at->f1 * at->f1 * x->p1;
    d.v2 = x->e2 - at->f2 * at->f2 * x->p2;
    d.cost = xs + 2 * y->z * x->z + 200 * (r1 * xr1 + r2 * xr2)
             + 2e-3 * (at->seen.u1 * xu1 + at->seen.u2 * xu2);
    d.effort = 0;
    return d;
}

typedef struct {
    Rows y, by[4];
    double torque[TORQUES][LANES], peak[LANES], settled[LANES];
} Block;

INLINE State moved(const State *y, double h, const State *k) {
    State s;
#define MOVE(x) s.x = y->x + h * k->x;
    EACH(MOVE)
    return s;
}
INLINE Point point(const Gains *g, const Torque *d, double t, const State *y) {
    Point at;
    Steering s = steering(y);
    double d1 = d->amplitude1 * sin_of(d->frequency1 * t + d->phase1);
    double d2 = d->amplitude2 * sin_of(d->frequency2 * t + d->phase2);
    at.y = *y;
    at.f1 = d->frequency1;
    at.f2 = d->frequency2;
    at.b1 = fabs(s.s1) > g->a;
    at.b2 = fabs(s.s2) > g->a;
    at.d = rate(g, d1, d2, at.f1, at.f2, at.b1, at.b2, y, &at.seen);
    return at;
}
INLINE Torque torque_of(Block *b, int l) {
    Torque d = {b->torque[0][l], b->torque[1][l], b->torque[2][l],
                b->torque[3][l], b->torque[4][l], b->torque[5][l]};
    return d;
}
INLINE State sum(State a, double n, State k) {
#define ADD(x) a.x += n * k.x;
    EACH(ADD)
    return a;
}

/* One direction through the four stages that the state has been through. */
INLINE void along_step(Block *b, int l, int gain, Unit unit, const Gains *g, double h,
                       const Point *one, const Point *two, const Point *three, const Point *four) {
    Slopes x = loaded(b->by[gain], l), m, all, k;
    all = along(g, one, &x, unit);
    m = moved(&x, h / 2, &all);
    k = along(g, two, &m, unit);
    all = sum(all, 2, k);
    m = moved(&x, h / 2, &k);
    k = along(g, three, &m, unit);
    all = sum(all, 2, k);
    m = moved(&x, h, &k);
    k = along(g, four, &m, unit);
    all = sum(all, 1, k);
    stored(b->by[gain], l, moved(&x, h / 6, &all));
}

static void step(Block *b, const Gains *gains, double t, double h) {
    const Gains g = *gains;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        State y = loaded(b->y, l), m;
        Torque d = torque_of(b, l);
        Point one = point(&g, &d, t, &y);
        m = moved(&y, h / 2, &one.d);
        Point two = point(&g, &d, t + h / 2, &m);
        m = moved(&y, h / 2, &two.d);
        Point three = point(&g, &d, t + h / 2, &m);
        m = moved(&y, h, &three.d);
        Point four = point(&g, &d, t + h, &m);
        State all = sum(sum(sum(one.d, 2, two.d), 2, three.d), 1, four.d);
        stored(b->y, l, moved(&y, h / 6, &all));
        along_step(b, l, 0, (Unit){1, 0, 0, 0}, &g, h, &one, &two, &three, &four);
        along_step(b, l, 1, (Unit){0, 1, 0, 0}, &g, h, &one, &two, &three, &four);
        along_step(b, l, 2, (Unit){0, 0, 1, 0}, &g, h, &one, &two, &three, &four);
        along_step(b, l, 3, (Unit){0, 0, 0, 1}, &g, h, &one, &two, &three, &four);
    }
}

static void look(Block *b, const Gains *gains, const double *limits, double t) {
    const Gains g = *gains;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        State y = loaded(b->y, l);
        Torque d = torque_of(b, l);
        Point at = point(&g, &d, t, &y);
        Kept kept = {b->peak[l], b->settled[l]};
        kept = looked(kept, t, &y, &at.seen, limits);
        b->peak[l] = kept.peak;
        b->settled[l] = kept.settled;
    }
}

void gradient(const double *start, const double *torque, const double *gains, const double *limits,
              double length, int64_t intervals, int64_t substeps, int64_t begin, int64_t end,
              double *results) {
    Block b;
    Gains g = {gains[0], gains[1], gains[2], gains[3]};
    double h = length / substeps;
    for (int64_t first = begin; first < end; first += LANES) {
        memset(&b, 0, sizeof b);
        for (int l = 0; l < LANES; l++) {
            int64_t c = first + l < end ? first + l : end - 1;
            for (int i = 0; i < 9; i++) b.y[i][l] = start[9 * c + i];
            for (int i = 0; i < TORQUES; i++) b.torque[i][l] = torque[TORQUES * c + i];
            b.settled[l] = INFINITY;
        }
        for (int64_t i = 0; i < intervals; i++) {
            look(&b, &g, limits, i * length);
            for (int64_t s = 0; s < substeps; s++) step(&b, &g, i * length + s * h, h);
        }
        for (int l = 0; l < LANES && first + l < end; l++) {
            double *row = results + 17 * (first + l);
            for (int i = 0; i < STATES; i++) row[i] = b.y[i][l];
            row[11] = b.peak[l];
            row[12] = b.settled[l];
            for (int i = 0; i < 4; i++) row[13 + i] = b.by[i][9][l];
        }
    }
}
