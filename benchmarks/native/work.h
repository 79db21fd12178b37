/* The scenario benchmark-three-axis, written out by hand for one lane of a vector.
 *
 * Error coordinates: w1 w2 z, the rate errors e1 e2, the internal model's p1 p2 v1 v2, and the
 * integrals of cost and effort; the third rate is held at zero. Equations (11), (36), (40)-(43) of
 * Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53. Everything is inlined into loops over
 * lanes, which the compiler turns into vector code.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#define LANES 16
#define JX 449.5
#define JY 264.6
#define TILT2 1e-4
#define ORBIT_RATE 0.0011

typedef struct { double k3, mu, a, k4; } Gains;
typedef struct { double amplitude1, amplitude2, frequency1, frequency2, phase1, phase2; } Torque;
typedef struct { double w1, w2, z, e1, e2, p1, p2, v1, v2, cost, effort; } State;
enum { STATES = 11, TORQUES = 6 };

/* sin and cos to about one unit for |x| < 1e5 */
INLINE double reduced(double x, int64_t *quadrant) {
    double k = rint(x * 0.6366197723675814);
    *quadrant = (int64_t)k;
    double r = fma(-k, 1.5707963267341256, x);
    return fma(-k, 6.077100506506192e-11, r);
}
INLINE double sine_of(double r) {
    double z = r * r;
    double p = 1.591810123027412e-10;
    p = fma(p, z, -2.5051131455427946e-08);
    p = fma(p, z, 2.755731610068303e-06);
    p = fma(p, z, -0.0001984126983675497);
    p = fma(p, z, 0.008333333333330946);
    p = fma(p, z, -0.16666666666666666);
    return fma(r * z, p, r);
}
INLINE double cosine_of(double r) {
    double z = r * r;
    double p = -1.1382614868556325e-11;
    p = fma(p, z, 2.0876146024689747e-09);
    p = fma(p, z, -2.7557317270560326e-07);
    p = fma(p, z, 2.4801587298763433e-05);
    p = fma(p, z, -0.0013888888888887395);
    p = fma(p, z, 0.041666666666666664);
    return fma(z * z, p, fma(-0.5, z, 1.0));
}
INLINE void sincos_of(double x, double *s, double *c) {
    int64_t q;
    double r = reduced(x, &q), sine = sine_of(r), cosine = cosine_of(r);
    double first = (q & 1) ? cosine : sine, second = (q & 1) ? sine : cosine;
    *s = (q & 2) ? -first : first;
    *c = ((q + 1) & 2) ? -second : second;
}
INLINE double sin_of(double x) {
    double s, c;
    sincos_of(x, &s, &c);
    return s;
}

/* What switches: sat's arguments, steered by q (w2, -w1), and whether each saturates. */
typedef struct { double q, below, s1, s2; } Steering;
INLINE Steering steering(const State *y) {
    Steering s;
    s.below = y->w1 * y->w1 + y->w2 * y->w2 + TILT2;
    s.q = y->z / s.below;
    s.s1 = s.q * y->w2;
    s.s2 = -s.q * y->w1;
    return s;
}

typedef struct { double r1, r2, u1, u2; } Seen;

/* Rates of change with sat held beyond its corner as b1 and b2 tell. */
INLINE State rate(const Gains *g, double d1, double d2, double f1, double f2, int b1, int b2,
                  const State *y, Seen *seen) {
    double w1 = y->w1, w2 = y->w2, square = w1 * w1 + w2 * w2, whole = 1 + square;
    Steering s = steering(y);
    double sat1 = b1 ? copysign(g->a, s.s1) : s.s1, sat2 = b2 ? copysign(g->a, s.s2) : s.s2;
    double pull = g->k3 / whole;
    double r1 = -pull * w1 + g->mu * sat1 + y->e1, r2 = -pull * w2 + g->mu * sat2 + y->e2;
    double half = 0.5 * (1 - square), cross = w1 * w2;
    double dw1 = (half + w1 * w1) * r1 + cross * r2;
    double dw2 = (half + w2 * w2) * r2 + cross * r1;
    double dz = w1 * r2 - w2 * r1;
    double dsquare = 2 * (w1 * dw1 + w2 * dw2);
    double dq = (dz - s.q * dsquare) / s.below, shrink = dsquare / whole;
    double slope1 = -pull * (dw1 - w1 * shrink) + (b1 ? 0 : g->mu * (dq * w2 + s.q * dw2));
    double slope2 = -pull * (dw2 - w2 * shrink) - (b2 ? 0 : g->mu * (dq * w1 + s.q * dw1));
    double t1 = -w1 * whole + w2 * y->z - g->k4 * (y->e1 + y->v1);
    double t2 = -w2 * whole - w1 * y->z - g->k4 * (y->e2 + y->v2);
    double u1 = t1 + JX * slope1, u2 = t2 + JY * slope2;
    State d;
    d.w1 = dw1;
    d.w2 = dw2;
    d.z = dz;
    d.e1 = (t1 + d1) * (1 / JX);
    d.e2 = (t2 + d2) * (1 / JY);
    d.p1 = y->v1;
    d.p2 = y->v2;
    d.v1 = y->e1 - f1 * f1 * y->p1;
    d.v2 = y->e2 - f2 * f2 * y->p2;
    d.cost = square + y->z * y->z + 100 * (r1 * r1 + r2 * r2) + 1e-3 * (u1 * u1 + u2 * u2);
    d.effort = fabs(u1) + fabs(u2);
    seen->r1 = r1;
    seen->r2 = r2;
    seen->u1 = u1;
    seen->u2 = u2;
    return d;
}

#define EACH(DO) DO(w1) DO(w2) DO(z) DO(e1) DO(e2) DO(p1) DO(p2) DO(v1) DO(v2) DO(cost) DO(effort)

/* Lanes side by side in memory. */
typedef double Rows[STATES][LANES];
INLINE State loaded(double (*rows)[LANES], int lane) {
    State y;
    y.w1 = rows[0][lane]; y.w2 = rows[1][lane]; y.z = rows[2][lane];
    y.e1 = rows[3][lane]; y.e2 = rows[4][lane]; y.p1 = rows[5][lane]; y.p2 = rows[6][lane];
    y.v1 = rows[7][lane]; y.v2 = rows[8][lane]; y.cost = rows[9][lane]; y.effort = rows[10][lane];
    return y;
}
INLINE void stored(double (*rows)[LANES], int lane, State y) {
    rows[0][lane] = y.w1; rows[1][lane] = y.w2; rows[2][lane] = y.z;
    rows[3][lane] = y.e1; rows[4][lane] = y.e2; rows[5][lane] = y.p1; rows[6][lane] = y.p2;
    rows[7][lane] = y.v1; rows[8][lane] = y.v2; rows[9][lane] = y.cost; rows[10][lane] = y.effort;
}

/* What is kept of the instants looked at. */
typedef struct { double peak, settled; } Kept;
INLINE int within(const State *y, const Seen *seen, const double *limits) {
    double turns = y->z - 6.283185307179586 * rint(y->z * 0.15915494309189535);
    double w = y->w1 * y->w1 + y->w2 * y->w2, r = seen->r1 * seen->r1 + seen->r2 * seen->r2;
    return (w <= limits[0] * limits[0]) & (fabs(turns) <= limits[1]) & (r <= limits[2] * limits[2]);
}
INLINE Kept looked(Kept kept, double t, const State *y, const Seen *seen, const double *limits) {
    double omega2 = seen->r2 - ORBIT_RATE, size = sqrt(seen->r1 * seen->r1 + omega2 * omega2);
    int good = within(y, seen, limits);
    double since = isinf(kept.settled) ? t : kept.settled;
    kept.settled = good ? since : INFINITY;
    kept.peak = size > kept.peak ? size : kept.peak;
    return kept;
}
