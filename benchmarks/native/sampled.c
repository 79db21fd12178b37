/* The scenario acceptance-hard with the law "oscillatory", by hand, lanes side by side: sensor
 * noise, a Kalman filter for the ripple of the third rate, recursive least squares for the errors
 * of axes and inertia, the oscillatory law, its end game and the hand-over between them, once a
 * period; then one step of Bogacki and Shampine's third order with the torque held.
 *
 * What a hand can do that a compiler must not: alpha alone (the law's beta is zero), symmetric
 * covariances, one of the two oscillators for each lane, sines and cosines of the turn and of the
 * axes without the angles, no check of the memories for numbers that are too large.
 *
 * With PULSED the torque is not held: four of six thrusters that push make it by pulses, and the
 * first makes less from a failure on.
 *
 * rows (cases, ROW): inertia xx xy xz yy yz zz, thruster axes (3, 2), with PULSED the torques of the
 * thrusters (3, 6), the disturbance's amplitude, frequency and phase, quaternion, omega. keys
 * (cases, 2). results (cases, 11): cost, effort, peak rate, settling time, quaternion, omega, with
 * PULSED propellant and openings.
 */
#include "noise.h"

#ifdef PULSED
enum { AXES = 18, RESULT = 13 };
#else
enum { AXES = 6, RESULT = 11 };
#endif
enum { ROW = 22 + AXES };
typedef struct { double k3, damping, rest, largest, ratio, dead; } Oscillator;
typedef struct {
    double orbit, j1, j2, j3, nu, tilt_gain, rate_gain;
    Oscillator early, late;
    double enter_rate, enter_angle, enter_turn, leave_tilt, leave_turn;
    double frequency, noise, amplitude, drift, product_error, lean_error, prior[8], fit_noise;
    double limit, period, rate_noise, attitude_noise, w_limit, z_limit, rate_limit;
    double cost_w, cost_z, cost_rate, cost_torque;
#ifdef PULSED
    double full[4], min_on, flow[6], failure, share;
#endif
} Numbers;

typedef struct {
    double inertia[6][LANES], inverse[6][LANES], axes[AXES][LANES], wave[9][LANES];
    double q[4][LANES], omega[3][LANES], cost[LANES], effort[LANES], peak[LANES], settled[LANES];
    double mean[LANES], ripple[LANES], quadrature[LANES], p[6][LANES];
    double estimate[8][LANES], covariance[36][LANES], first[3][LANES], last[3][LANES];
    double coupling[LANES], axis_cos[LANES], axis_sin[LANES], turn1[LANES], turn3[LANES];
    double drift[LANES], braking[LANES], swing_cos[LANES], swing_sin[LANES];
    double products[6][LANES], alpha[LANES], rho[LANES], late[LANES], torque[3][LANES];
#ifdef PULSED
    double command[2][LANES], open[4][LANES], propellant[LANES], openings[LANES];
#endif
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
INLINE void judge(const Numbers *c, Block *k, int l, double t) {
    Body b = body_at(k, l);
    Sight s = sight_of(c->orbit, &b);
    int good = (s.w1 * s.w1 + s.w2 * s.w2 < c->w_limit * c->w_limit) & (fabs(s.z) < c->z_limit)
               & (s.r1 * s.r1 + s.r2 * s.r2 + s.r3 * s.r3 < c->rate_limit * c->rate_limit);
    double since = k->settled[l] == INFINITY ? t : k->settled[l];
    k->settled[l] = good ? since : INFINITY;
}
INLINE void look(const Numbers *c, Block *k, int l, double t) {
    double x = k->omega[0][l], y = k->omega[1][l], z = k->omega[2][l];
    double size = sqrt(x * x + y * y + z * z);
    judge(c, k, l, t);
    k->peak[l] = size > k->peak[l] ? size : k->peak[l];
}

/* One step of length h with the torque held. */
INLINE void step(const Numbers *c, Block *k, int l, double t, double h) {
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
    k->q[0][l] = m.q0, k->q[1][l] = m.q1, k->q[2][l] = m.q2, k->q[3][l] = m.q3;
    k->omega[0][l] = m.x, k->omega[1][l] = m.y, k->omega[2][l] = m.z;
    k->cost[l] = m.cost;
    k->effort[l] += h * (fabs(k->torque[0][l]) + fabs(k->torque[1][l]) + fabs(k->torque[2][l]));
}
INLINE void normalise(Block *k, int l) {
    double q0 = k->q[0][l], q1 = k->q[1][l], q2 = k->q[2][l], q3 = k->q[3][l];
    double size = 1 / sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3);
    k->q[0][l] = q0 * size, k->q[1][l] = q1 * size, k->q[2][l] = q2 * size, k->q[3][l] = q3 * size;
}

#ifdef PULSED
/* Pulse widths of the command, then one step to each end of a pulse and one to that of the period.
 * Of the pairs about x and about y one thruster each fires, from the sample on. */
static void fly(const Numbers *numbers, Block *k, double t) {
    const Numbers n = *numbers, *c = &n;
    double width[2][LANES], one[6][LANES], now[LANES], period = c->period;
    double weak = t >= c->failure ? c->share : 1;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        double u = k->command[0][l], v = k->command[1][l];
        double x = fabs(u) / (u > 0 ? c->full[0] : c->full[1]);
        double y = fabs(v) / (v > 0 ? c->full[2] : c->full[3]);
        double most = x > y ? x : y;
        double scale = period / (most > 1 ? most : 1);
        width[0][l] = x * scale >= c->min_on ? x * scale : 0;
        width[1][l] = y * scale >= c->min_on ? y * scale : 0;
        double share = u > 0 ? weak : 1;
        one[0][l] = share * (u > 0 ? k->axes[0][l] : k->axes[1][l]);
        one[1][l] = share * (u > 0 ? k->axes[6][l] : k->axes[7][l]);
        one[2][l] = share * (u > 0 ? k->axes[12][l] : k->axes[13][l]);
        one[3][l] = v > 0 ? k->axes[2][l] : k->axes[3][l];
        one[4][l] = v > 0 ? k->axes[8][l] : k->axes[9][l];
        one[5][l] = v > 0 ? k->axes[14][l] : k->axes[15][l];
        k->propellant[l] += share * (u > 0 ? c->flow[0] : c->flow[1]) * width[0][l]
                            + (v > 0 ? c->flow[2] : c->flow[3]) * width[1][l];
        now[l] = 0;
    }
#define OPENED(i, chosen, sign) \
    _Pragma("omp simd simdlen(8)") for (int l = 0; l < LANES; l++) { \
        double on = k->command[chosen][l] * sign > 0 ? width[chosen][l] : 0; \
        double new = k->open[i][l] > 0 ? 0.0 : 1.0; \
        k->openings[l] += on > 0 ? new : 0.0; \
        k->open[i][l] = on >= period ? 1.0 : 0.0; \
    }
    OPENED(0, 0, 1)
    OPENED(1, 0, -1)
    OPENED(2, 1, 1)
    OPENED(3, 1, -1)
    for (int hold = 0; hold < 3; hold++) {
        int left = 0;
        for (int l = 0; l < LANES; l++) left |= now[l] < period;
        if (!left) break;
        if (hold) {
#pragma omp simd simdlen(8)
            for (int l = 0; l < LANES; l++) judge(c, k, l, t + now[l]);
        }
#pragma omp simd simdlen(8)
        for (int l = 0; l < LANES; l++) {
            double begin = now[l], p = width[0][l], q = width[1][l];
            double a = p > begin ? 1.0 : 0.0, b = q > begin ? 1.0 : 0.0;
            double first = p > begin ? p : period, second = q > begin ? q : period;
            double end = first < second ? first : second;
            k->torque[0][l] = a * one[0][l] + b * one[3][l];
            k->torque[1][l] = a * one[1][l] + b * one[4][l];
            k->torque[2][l] = a * one[2][l] + b * one[5][l];
            step(c, k, l, t + begin, end - begin);
            now[l] = end;
        }
    }
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) normalise(k, l);
}
#else
static void fly(const Numbers *numbers, Block *k, double t) {
    const Numbers n = *numbers, *c = &n;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        step(c, k, l, t, c->period);
        normalise(k, l);
    }
}
#endif

#include "law.h"

static void begin_block(const Numbers *c, Block *k, const double *rows, const uint32_t *keys,
                        int64_t first, int64_t end) {
    memset(k, 0, sizeof *k);
    for (int l = 0; l < LANES; l++) {
        int64_t number = first + l < end ? first + l : end - 1;
        const double *row = rows + ROW * number;
        for (int i = 0; i < 6; i++) k->inertia[i][l] = row[i];
        for (int i = 0; i < AXES; i++) k->axes[i][l] = row[6 + i];
        for (int i = 0; i < 9; i++) k->wave[i][l] = row[6 + AXES + i];
        for (int i = 0; i < 4; i++) k->q[i][l] = row[15 + AXES + i];
        for (int i = 0; i < 3; i++) k->omega[i][l] = row[19 + AXES + i];
        double xx = row[0], xy = row[1], xz = row[2], yy = row[3], yz = row[4], zz = row[5];
        double a = yy * zz - yz * yz, b = yz * xz - xy * zz, e = xy * yz - yy * xz;
        double all = xx * a + xy * b + xz * e;
        double inverse[6] = {a, b, e, xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy};
        for (int i = 0; i < 6; i++) k->inverse[i][l] = inverse[i] / all;
        k->key[0][l] = keys[2 * number];
        k->key[1][l] = keys[2 * number + 1];
        k->settled[l] = INFINITY;
        k->rho[l] = 1e-8 * c->early.largest;
        k->swing_cos[l] = 1;
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
#ifdef PULSED
            row[11] = k.propellant[l];
            row[12] = k.openings[l];
#endif
        }
    }
}
