/* The scenario acceptance-hard with the law "oscillatory", by hand, lanes side by side: sensor
 * noise, a Kalman filter for the ripple of the third rate, recursive least squares for the errors
 * of axes and inertia, the oscillatory law, the regulator and the hand-over between them, once a
 * period; then one step of Bogacki and Shampine's third order with the torque held.
 *
 * What a hand can do that a compiler must not: alpha alone (the law's beta is zero), symmetric
 * covariances, least squares only at the samples that use them, the turn's sine and cosine
 * without its angle, no check of the memories for numbers that are too large.
 *
 * rows (cases, ROW): inertia xx xy xz yy yz zz, thruster axes (3, 2), the disturbance's amplitude,
 * frequency and phase, quaternion, omega. keys (cases, 2). results (cases, 11): cost, effort, peak
 * rate, settling time, quaternion, omega.
 */
#include "noise.h"

enum { ROW = 28, RESULT = 11 };
typedef struct {
    double orbit, j1, j2, j3, k3, damping, rest, nu, tilt_gain, rate_gain, largest, ratio, dead;
    double gain[12], enter_slow, enter_rate, enter_angle, leave_tilt, leave_turn, leave_rate;
    double frequency, noise, amplitude, drift, product_error, lean_error, prior[8], fit_noise;
    double limit, period, rate_noise, attitude_noise, w_limit, z_limit, rate_limit;
    double cost_w, cost_z, cost_rate, cost_torque;
} Numbers;

typedef struct {
    double inertia[6][LANES], inverse[6][LANES], axes[6][LANES], wave[9][LANES];
    double q[4][LANES], omega[3][LANES], cost[LANES], effort[LANES], peak[LANES], settled[LANES];
    double mean[LANES], ripple[LANES], quadrature[LANES], p[6][LANES];
    double estimate[8][LANES], covariance[36][LANES], first[3][LANES], last[3][LANES];
    double products[6][LANES], alpha[LANES], rho[LANES], regulating[LANES], torque[3][LANES];
    uint32_t key[2][LANES];
} Block;

typedef struct { double q0, q1, q2, q3, x, y, z, cost; } Body;
typedef struct { double w1, w2, z, r1, r2, r3; } Sight;

INLINE Sight sight_of(double orbit, const Body *b) {
    double n = b->q0 * b->q0 + b->q1 * b->q1 + b->q2 * b->q2 + b->q3 * b->q3, scale = orbit / n;
    double up = 1 / (b->q0 * b->q0 + b->q3 * b->q3), sign = b->q0 < 0 ? -1 : 1;
    Sight s;
    s.w1 = (b->q1 * b->q0 + b->q2 * b->q3) * up;
    s.w2 = (b->q2 * b->q0 - b->q1 * b->q3) * up;
    s.z = 2 * half_atan2(sign * b->q3, sign * b->q0);
    s.r1 = b->x + scale * 2 * (b->q1 * b->q2 + b->q0 * b->q3);
    s.r2 = b->y + scale * (2 * (b->q0 * b->q0 + b->q2 * b->q2) - n);
    s.r3 = b->z + scale * 2 * (b->q2 * b->q3 - b->q0 * b->q1);
    return s;
}

INLINE Body rate_of(const Numbers *c, const Block *k, int l, double t, const Body *b) {
    Sight s = sight_of(c->orbit, b);
    const double t1 = k->torque[0][l], t2 = k->torque[1][l], t3 = k->torque[2][l];
    double x = b->x, y = b->y, z = b->z;
    double h1 = k->inertia[0][l] * x + k->inertia[1][l] * y + k->inertia[2][l] * z;
    double h2 = k->inertia[1][l] * x + k->inertia[3][l] * y + k->inertia[4][l] * z;
    double h3 = k->inertia[2][l] * x + k->inertia[4][l] * y + k->inertia[5][l] * z;
#define WAVE(i) k->wave[i][l] * sin_of(k->wave[3 + i][l] * t + k->wave[6 + i][l])
    double m1 = t1 + WAVE(0) - (y * h3 - z * h2);
    double m2 = t2 + WAVE(1) - (z * h1 - x * h3);
    double m3 = t3 + WAVE(2) - (x * h2 - y * h1);
    Body d;
    d.q0 = 0.5 * (-b->q1 * s.r1 - b->q2 * s.r2 - b->q3 * s.r3);
    d.q1 = 0.5 * (b->q0 * s.r1 + b->q2 * s.r3 - b->q3 * s.r2);
    d.q2 = 0.5 * (b->q0 * s.r2 + b->q3 * s.r1 - b->q1 * s.r3);
    d.q3 = 0.5 * (b->q0 * s.r3 + b->q1 * s.r2 - b->q2 * s.r1);
    d.x = k->inverse[0][l] * m1 + k->inverse[1][l] * m2 + k->inverse[2][l] * m3;
    d.y = k->inverse[1][l] * m1 + k->inverse[3][l] * m2 + k->inverse[4][l] * m3;
    d.z = k->inverse[2][l] * m1 + k->inverse[4][l] * m2 + k->inverse[5][l] * m3;
    d.cost = c->cost_w * (s.w1 * s.w1 + s.w2 * s.w2) + c->cost_z * s.z * s.z
             + c->cost_rate * (s.r1 * s.r1 + s.r2 * s.r2 + s.r3 * s.r3)
             + c->cost_torque * (t1 * t1 + t2 * t2 + t3 * t3);
    return d;
}

#define PARTS(DO) DO(q0) DO(q1) DO(q2) DO(q3) DO(x) DO(y) DO(z) DO(cost)
INLINE Body body_at(const Block *k, int l) {
    Body b = {k->q[0][l], k->q[1][l], k->q[2][l], k->q[3][l],
              k->omega[0][l], k->omega[1][l], k->omega[2][l], k->cost[l]};
    return b;
}
INLINE Body further(const Body *b, double h, const Body *d) {
    Body s;
#define FURTHER(x) s.x = b->x + h * d->x;
    PARTS(FURTHER)
    return s;
}
INLINE void look(const Numbers *c, Block *k, int l, double t) {
    Body b = body_at(k, l);
    Sight s = sight_of(c->orbit, &b);
    int good = (s.w1 * s.w1 + s.w2 * s.w2 < c->w_limit * c->w_limit) & (fabs(s.z) < c->z_limit)
               & (s.r1 * s.r1 + s.r2 * s.r2 + s.r3 * s.r3 < c->rate_limit * c->rate_limit);
    double size = sqrt(b.x * b.x + b.y * b.y + b.z * b.z);
    double since = k->settled[l] == INFINITY ? t : k->settled[l];
    k->settled[l] = good ? since : INFINITY;
    k->peak[l] = size > k->peak[l] ? size : k->peak[l];
}

static void fly(const Numbers *numbers, Block *k, double t) {
    const Numbers n = *numbers, *c = &n;
    double h = c->period;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        Body b = body_at(k, l), a, m, d;
        d = rate_of(c, k, l, t, &b);
#define FIRST(x) a.x = 2.0 / 9 * d.x;
        PARTS(FIRST)
        m = further(&b, h / 2, &d);
        d = rate_of(c, k, l, t + h / 2, &m);
#define SECOND(x) a.x += 1.0 / 3 * d.x;
        PARTS(SECOND)
        m = further(&b, 0.75 * h, &d);
        d = rate_of(c, k, l, t + 0.75 * h, &m);
#define THIRD(x) a.x += 4.0 / 9 * d.x;
        PARTS(THIRD)
        m = further(&b, h, &a);
        double size = 1 / sqrt(m.q0 * m.q0 + m.q1 * m.q1 + m.q2 * m.q2 + m.q3 * m.q3);
        k->q[0][l] = m.q0 * size;
        k->q[1][l] = m.q1 * size;
        k->q[2][l] = m.q2 * size;
        k->q[3][l] = m.q3 * size;
        k->omega[0][l] = m.x;
        k->omega[1][l] = m.y;
        k->omega[2][l] = m.z;
        k->cost[l] = m.cost;
        k->effort[l] += h * (fabs(k->torque[0][l]) + fabs(k->torque[1][l]) + fabs(k->torque[2][l]));
    }
}

#include "law.h"

static void begin_block(const Numbers *c, Block *k, const double *rows, const uint32_t *keys,
                        int64_t first, int64_t end) {
    memset(k, 0, sizeof *k);
    for (int l = 0; l < LANES; l++) {
        int64_t number = first + l < end ? first + l : end - 1;
        const double *row = rows + ROW * number;
        for (int i = 0; i < 6; i++) k->inertia[i][l] = row[i];
        for (int i = 0; i < 6; i++) k->axes[i][l] = row[6 + i];
        for (int i = 0; i < 9; i++) k->wave[i][l] = row[12 + i];
        for (int i = 0; i < 4; i++) k->q[i][l] = row[21 + i];
        for (int i = 0; i < 3; i++) k->omega[i][l] = row[25 + i];
        double xx = row[0], xy = row[1], xz = row[2], yy = row[3], yz = row[4], zz = row[5];
        double a = yy * zz - yz * yz, b = yz * xz - xy * zz, e = xy * yz - yy * xz;
        double all = xx * a + xy * b + xz * e;
        double inverse[6] = {a, b, e, xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy};
        for (int i = 0; i < 6; i++) k->inverse[i][l] = inverse[i] / all;
        k->key[0][l] = keys[2 * number];
        k->key[1][l] = keys[2 * number + 1];
        k->settled[l] = INFINITY;
        k->rho[l] = 1e-9;
        for (int i = 0, at = 0; i < 8; at += 8 - i, i++) k->covariance[at][l] = c->prior[i] * c->prior[i];
    }
}

void sampled(const double *rows, const uint32_t *keys, const double *numbers, int64_t periods,
             int64_t begin, int64_t end, double *results) {
    Block k __attribute__((aligned(64)));
    double noise[DRAWS][LANES] __attribute__((aligned(64)));
    const Numbers *c = (const Numbers *)numbers;
    for (int64_t first = begin; first < end; first += LANES) {
        begin_block(c, &k, rows, keys, first, end);
        for (int64_t i = 0; i < periods; i++) {
            double t = i * c->period;
            draw(k.key, (uint32_t)i, noise);
            control(c, &k, noise, t, i);
            fly(c, &k, t);
        }
        double last = periods * c->period;
        for (int l = 0; l < LANES && first + l < end; l++) {
            double *row = results + RESULT * (first + l);
            look(c, &k, l, last);
            row[0] = k.cost[l];
            row[1] = k.effort[l];
            row[2] = k.peak[l];
            row[3] = k.settled[l] <= 0.9 * last ? k.settled[l] : INFINITY;
            for (int i = 0; i < 4; i++) row[4 + i] = k.q[i][l];
            for (int i = 0; i < 3; i++) row[8 + i] = k.omega[i][l];
        }
    }
}
