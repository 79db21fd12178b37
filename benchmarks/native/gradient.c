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

/* What the sensitivities need of a stage that the state has been through. */
enum { POINT = 18, STAGES = 4 };
typedef struct {
    Rows y, by[4];
    double torque[TORQUES][LANES], peak[LANES], settled[LANES];
    double points[STAGES][POINT][LANES];
} Block;

INLINE State moved(const State *y, double h, const State *k) {
    State s;
#define MOVE(x) s.x = y->x + h * k->x;
    EACH(MOVE)
    return s;
}
INLINE State stage(const Gains *g, const Torque *d, double t, const State *y, Seen *seen, int *b1,
                   int *b2) {
    Steering s = steering(y);
    double d1 = d->amplitude1 * sin_of(d->frequency1 * t + d->phase1);
    double d2 = d->amplitude2 * sin_of(d->frequency2 * t + d->phase2);
    *b1 = fabs(s.s1) > g->a;
    *b2 = fabs(s.s2) > g->a;
    return rate(g, d1, d2, d->frequency1, d->frequency2, *b1, *b2, y, seen);
}
INLINE Torque torque_of(Block *b, int l) {
    Torque d = {b->torque[0][l], b->torque[1][l], b->torque[2][l],
                b->torque[3][l], b->torque[4][l], b->torque[5][l]};
    return d;
}
/* Field by field: the compiler does not take structures apart in such loops otherwise. */
INLINE void keep(double (*rows)[LANES], int l, const State *y, const State *d, const Seen *seen,
                 int b1, int b2) {
    rows[0][l] = y->w1; rows[1][l] = y->w2; rows[2][l] = y->z; rows[3][l] = y->e1;
    rows[4][l] = y->e2; rows[5][l] = y->p1; rows[6][l] = y->p2; rows[7][l] = y->v1;
    rows[8][l] = y->v2; rows[9][l] = d->w1; rows[10][l] = d->w2; rows[11][l] = d->z;
    rows[12][l] = seen->r1; rows[13][l] = seen->r2; rows[14][l] = seen->u1;
    rows[15][l] = seen->u2;
    rows[16][l] = b1 ? 1 : 0;
    rows[17][l] = b2 ? 1 : 0;
}
INLINE Slopes along_kept(double (*rows)[LANES], int l, double f1, double f2, const Gains *g,
                         const Slopes *x, Unit unit) {
    Point at;
    at.y.w1 = rows[0][l]; at.y.w2 = rows[1][l]; at.y.z = rows[2][l]; at.y.e1 = rows[3][l];
    at.y.e2 = rows[4][l]; at.y.p1 = rows[5][l]; at.y.p2 = rows[6][l]; at.y.v1 = rows[7][l];
    at.y.v2 = rows[8][l]; at.d.w1 = rows[9][l]; at.d.w2 = rows[10][l]; at.d.z = rows[11][l];
    at.seen.r1 = rows[12][l]; at.seen.r2 = rows[13][l]; at.seen.u1 = rows[14][l];
    at.seen.u2 = rows[15][l];
    at.b1 = rows[16][l] != 0;
    at.b2 = rows[17][l] != 0;
    at.f1 = f1;
    at.f2 = f2;
    return along(g, &at, x, unit);
}

/* One direction through the four stages. */
INLINE void along_step(Block *b, int gain, Unit unit, const Gains *gains, double h) {
    const Gains g = *gains;
    double (*p)[POINT][LANES] = b->points;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        double f1 = b->torque[2][l], f2 = b->torque[3][l];
        Slopes x = loaded(b->by[gain], l);
        Slopes one = along_kept(p[0], l, f1, f2, &g, &x, unit);
        Slopes m1 = moved(&x, h / 2, &one);
        Slopes two = along_kept(p[1], l, f1, f2, &g, &m1, unit);
        Slopes m2 = moved(&x, h / 2, &two);
        Slopes three = along_kept(p[2], l, f1, f2, &g, &m2, unit);
        Slopes m3 = moved(&x, h, &three);
        Slopes four = along_kept(p[3], l, f1, f2, &g, &m3, unit);
#define WHOLE(x) one.x += 2 * (two.x + three.x) + four.x;
        EACH(WHOLE)
        stored(b->by[gain], l, moved(&x, h / 6, &one));
    }
}

static void step(Block *b, const Gains *gains, double t, double h) {
    const Gains g = *gains;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        State y = loaded(b->y, l);
        Torque d = torque_of(b, l);
        Seen seen1, seen2, seen3, seen4;
        int b1, b2, c1, c2, d1, d2, e1, e2;
        State one = stage(&g, &d, t, &y, &seen1, &b1, &b2);
        keep(b->points[0], l, &y, &one, &seen1, b1, b2);
        State m1 = moved(&y, h / 2, &one);
        State two = stage(&g, &d, t + h / 2, &m1, &seen2, &c1, &c2);
        keep(b->points[1], l, &m1, &two, &seen2, c1, c2);
        State m2 = moved(&y, h / 2, &two);
        State three = stage(&g, &d, t + h / 2, &m2, &seen3, &d1, &d2);
        keep(b->points[2], l, &m2, &three, &seen3, d1, d2);
        State m3 = moved(&y, h, &three);
        State four = stage(&g, &d, t + h, &m3, &seen4, &e1, &e2);
        keep(b->points[3], l, &m3, &four, &seen4, e1, e2);
        EACH(WHOLE)
        stored(b->y, l, moved(&y, h / 6, &one));
    }
    along_step(b, 0, (Unit){1, 0, 0, 0}, gains, h);
    along_step(b, 1, (Unit){0, 1, 0, 0}, gains, h);
    along_step(b, 2, (Unit){0, 0, 1, 0}, gains, h);
    along_step(b, 3, (Unit){0, 0, 0, 1}, gains, h);
}

/* The rates at the start are given, so the rate errors there move as the reference does. */
static void begin_slopes(Block *b, const Gains *g) {
    for (int l = 0; l < LANES; l++) {
        State y = loaded(b->y, l);
        Steering s = steering(&y);
        int b1 = fabs(s.s1) > g->a, b2 = fabs(s.s2) > g->a;
        double inverse = 1 / (1 + y.w1 * y.w1 + y.w2 * y.w2);
        b->by[0][3][l] = y.w1 * inverse;
        b->by[0][4][l] = y.w2 * inverse;
        b->by[1][3][l] = -(b1 ? copysign(g->a, s.s1) : s.s1);
        b->by[1][4][l] = -(b2 ? copysign(g->a, s.s2) : s.s2);
        b->by[2][3][l] = b1 ? -g->mu * copysign(1, s.s1) : 0;
        b->by[2][4][l] = b2 ? -g->mu * copysign(1, s.s2) : 0;
    }
}

static void look(Block *b, const Gains *gains, const double *limits, double t) {
    const Gains g = *gains;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        State y = loaded(b->y, l);
        Torque d = torque_of(b, l);
        Seen seen;
        int b1, b2;
        stage(&g, &d, t, &y, &seen, &b1, &b2);
        Kept kept = {b->peak[l], b->settled[l]};
        kept = looked(kept, t, &y, &seen, limits);
        b->peak[l] = kept.peak;
        b->settled[l] = kept.settled;
    }
}

void gradient(const double *start, const double *torque, const double *gains, const double *limits,
              double length, int64_t intervals, int64_t substeps, int64_t begin, int64_t end,
              double *results) {
    Block b __attribute__((aligned(64)));
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
        begin_slopes(&b, &g);
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
