/* Tsit5 with steps of each lane's own, sat held on one side of its corners within a step and the
 * switches located on the dense output; instants looked at lie on it, too. The internal model is
 * integrated in its own rotating frame. A lane that has finished takes the next case.
 *
 * The method is that of jaxsat's adaptive steps, but for the effort, whose integrand is integrated
 * as it is. results (cases, 14): state, peak rate, settling, steps tried. tableau.h holds A (7 x 7),
 * B, ERROR (7), NODES (7) and DENSE (4 x 7).
 */
#include "work.h"
#include "tableau.h"

enum { STAGES = 7, JUDGED = 11 };

typedef struct {
    Rows y, after, growth[4];
    double torque[TORQUES][LANES], peak[LANES], settled[LANES];
    double t[LANES], step[LANES], begin[LANES], length[LANES], size[LANES], middle[LANES];
    double end[LANES], number[LANES], steps[LANES];
    int64_t b1[LANES], b2[LANES], done[LANES];
} Block;

typedef struct { Gains gains; double tolerance[4], interval, intervals; const double *limits; } Job;

INLINE Torque torque_of(const Block *b, int l) {
    Torque d = {b->torque[0][l], b->torque[1][l], b->torque[2][l],
                b->torque[3][l], b->torque[4][l], b->torque[5][l]};
    return d;
}
/* The state with the oscillators turned to time t, and back the rate. */
INLINE void turned(const Torque *d, double s1, double c1, double s2, double c2, const State *back,
                   State *y) {
#define SAME(x) y->x = back->x;
    EACH(SAME)
    y->p1 = back->p1 * c1 + back->v1 * s1 / d->frequency1;
    y->p2 = back->p2 * c2 + back->v2 * s2 / d->frequency2;
    y->v1 = back->v1 * c1 - back->p1 * d->frequency1 * s1;
    y->v2 = back->v2 * c2 - back->p2 * d->frequency2 * s2;
}
INLINE State stage(const Gains *g, const Torque *d, double t, int b1, int b2, const State *back) {
    double s1, c1, s2, c2;
    sincos_of(d->frequency1 * t, &s1, &c1);
    sincos_of(d->frequency2 * t, &s2, &c2);
    State y;
    turned(d, s1, c1, s2, c2, back, &y);
    double d1 = d->amplitude1 * sin_of(d->frequency1 * t + d->phase1);
    double d2 = d->amplitude2 * sin_of(d->frequency2 * t + d->phase2);
    Seen seen;
    State k = rate(g, d1, d2, d->frequency1, d->frequency2, b1, b2, &y, &seen);
    k.p1 = -y.e1 * s1 / d->frequency1;
    k.p2 = -y.e2 * s2 / d->frequency2;
    k.v1 = y.e1 * c1;
    k.v2 = y.e2 * c2;
    return k;
}
INLINE double gap(const Gains *g, double w1, double w2, double z, int b1, int b2) {
    double q = z / (w1 * w1 + w2 * w2 + TILT2), s1 = q * w2, s2 = q * w1, a2 = g->a * g->a;
    double one = b1 ? a2 - s1 * s1 : s1 * s1 - a2, two = b2 ? a2 - s2 * s2 : s2 * s2 - a2;
    return one > two ? one : two;
}
INLINE double dense(const Block *b, int i, int l, double part) {
    double sum = b->growth[2][i][l] + part * b->growth[3][i][l];
    sum = b->growth[0][i][l] + part * (b->growth[1][i][l] + part * sum);
    return b->y[i][l] + part * sum;
}
INLINE double excess(const Block *b, const Gains *g, int l, double part) {
    return gap(g, dense(b, 0, l, part), dense(b, 1, l, part), dense(b, 2, l, part),
               b->b1[l] != 0, b->b2[l] != 0);
}

/* Rates of one stage for all lanes, kept in memory between the stages. */
INLINE void stage_rates(Block *b, const Gains *gains, Rows *k, int number) {
    const Gains g = *gains;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        double h = b->step[l];
        State y = loaded(b->y, l);
#define STAGE_ROW(x, i)                                                                            \
    {                                                                                              \
        double sum = 0;                                                                            \
        for (int j = 0; j < number; j++) sum += A[number][j] * k[j][i][l];                         \
        y.x += h * sum;                                                                            \
    }
        STAGE_ROW(w1, 0) STAGE_ROW(w2, 1) STAGE_ROW(z, 2) STAGE_ROW(e1, 3) STAGE_ROW(e2, 4)
        STAGE_ROW(p1, 5) STAGE_ROW(p2, 6) STAGE_ROW(v1, 7) STAGE_ROW(v2, 8)
        Torque d = torque_of(b, l);
        stored(k[number], l, stage(&g, &d, b->t[l] + NODES[number] * h, b->b1[l] != 0,
                                   b->b2[l] != 0, &y));
    }
}
INLINE double fifth_root_of_inverse(double x) {
    int64_t bits;
    memcpy(&bits, &x, 8);
    bits = (int64_t)(5.5276e18 - 0.2 * (double)bits);
    double y;
    memcpy(&y, &bits, 8);
    for (int i = 0; i < 4; i++) y = y * (1.2 - 0.2 * x * (y * y) * (y * y) * y);
    return y;
}
static void finished_step(Block *b, const Job *job, Rows *k) {
    const Gains g = job->gains;
    const double rtol = job->tolerance[0], atol = job->tolerance[1];
    double sum[LANES] = {0};
    for (int i = 0; i < STATES; i++) {
#pragma omp simd simdlen(8)
        for (int l = 0; l < LANES; l++) {
            double h = b->step[l], y = b->y[i][l], change = 0, error = 0;
            for (int j = 0; j < STAGES; j++) change += B[j] * k[j][i][l];
            for (int j = 0; j < STAGES; j++) error += ERROR[j] * k[j][i][l];
            double after = y + h * change;
            b->after[i][l] = after;
            for (int p = 0; p < 4; p++) {
                double grown = 0;
                for (int j = 0; j < STAGES; j++) grown += DENSE[p][j] * k[j][i][l];
                b->growth[p][i][l] = h * grown;
            }
            double large = fabs(y) > fabs(after) ? fabs(y) : fabs(after);
            double part = h * error / (atol + rtol * large);
            sum[l] += i == STATES - 1 ? 0 : part * part;
        }
    }
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        b->size[l] = sqrt(sum[l] * (1.0 / JUDGED));
        b->middle[l] = excess(b, &g, l, 0.5);
        b->end[l] = gap(&g, b->after[0][l], b->after[1][l], b->after[2][l], b->b1[l] != 0,
                        b->b2[l] != 0);
    }
}

/* The part of the step at which a switching function changes its sign: secants, Illinois rule. */
static double located(const Block *b, const Gains *g, int l) {
    double low = 0, high = 0.5, low_value = excess(b, g, l, 0), high_value = b->middle[l];
    if (!(high_value > 0)) low = 0.5, low_value = high_value, high = 1, high_value = b->end[l];
    double point = high;
    const double first = low;
    for (int n = 0, was = 0; n < 60 && high - low > 1e-14; n++) {
        int on_surface = low == first && low_value >= -1e-6 * high_value;
        int halve = on_surface || low_value >= 0 || n % 3 == 2;
        double last = point;
        point = halve ? (low + high) / 2 : low - low_value * (high - low) / (high_value - low_value);
        double value = excess(b, g, l, point);
        int is_low = value <= 0;
        if (is_low) {
            low = point, low_value = value;
            if (was == 1) high_value /= 2;
        } else {
            high = point, high_value = value;
            if (was == -1) low_value /= 2;
        }
        was = is_low ? 1 : -1;
        if (fabs(point - last) < 1e-13) break;
    }
    return point;
}
static void switched(Block *b, const Gains *g, int l) {
    double part = located(b, g, l), least = 1e-9 / b->step[l];
    part = part < least ? least : part > 1 ? 1 : part;
    for (int i = 0; i < STATES; i++) b->after[i][l] = dense(b, i, l, part);
    double w1 = b->after[0][l], w2 = b->after[1][l], z = b->after[2][l];
    double q = z / (w1 * w1 + w2 * w2 + TILT2), a2 = g->a * g->a;
    double one = (q * w2) * (q * w2) - a2, two = (q * w1) * (q * w1) - a2;
    if (b->b1[l]) one = -one;
    if (b->b2[l]) two = -two;
    int first = one >= two;
    b->b1[l] ^= first;
    b->b2[l] ^= !first;
    b->length[l] = part * b->step[l];
}

static void look(Block *b, const Job *job) {
    const Gains g = job->gains;
    const double *limits = job->limits;
    for (;;) {
        int64_t any = 0;
#pragma omp simd simdlen(8) reduction(| : any)
        for (int l = 0; l < LANES; l++) {
            double t = b->number[l] * job->interval, before = b->begin[l];
            int pending = (t <= b->t[l]) & (b->number[l] <= job->intervals) & !b->done[l];
            double part = (t - before) / b->step[l];
            State y = {dense(b, 0, l, part), dense(b, 1, l, part), dense(b, 2, l, part),
                       dense(b, 3, l, part), dense(b, 4, l, part)};
            Steering s = steering(&y);
            double sat1 = fabs(s.s1) > g.a ? copysign(g.a, s.s1) : s.s1;
            double sat2 = fabs(s.s2) > g.a ? copysign(g.a, s.s2) : s.s2;
            double pull = g.k3 / (1 + y.w1 * y.w1 + y.w2 * y.w2);
            Seen seen = {-pull * y.w1 + g.mu * sat1 + y.e1, -pull * y.w2 + g.mu * sat2 + y.e2, 0, 0};
            Kept kept = {b->peak[l], b->settled[l]};
            kept = looked(kept, t, &y, &seen, limits);
            b->peak[l] = pending ? kept.peak : b->peak[l];
            b->settled[l] = pending ? kept.settled : b->settled[l];
            double next = b->number[l] + (pending ? 1 : 0);
            b->number[l] = next;
            any |= (next * job->interval <= b->t[l]) & (next <= job->intervals) & !b->done[l];
        }
        if (!any) return;
    }
}

/* The part of the step after `after` was made: switches, acceptance, looks, the next length. */
static int moved_on(Block *b, const Job *job, Rows kept_y) {
    int64_t crossing = 0, ended = 0;
    for (int l = 0; l < LANES; l++) {
        b->length[l] = b->step[l];
        b->begin[l] = b->t[l];
        crossing |= (b->middle[l] > 0) | (b->end[l] > 0);
    }
    int64_t before1[LANES], before2[LANES];
    memcpy(before1, b->b1, sizeof before1);
    memcpy(before2, b->b2, sizeof before2);
    if (crossing)
        for (int l = 0; l < LANES; l++)
            if ((b->middle[l] > 0 || b->end[l] > 0) && b->size[l] <= 1 && !b->done[l])
                switched(b, &job->gains, l);
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        int accepted = (b->size[l] <= 1) | (b->step[l] <= job->tolerance[3]);
        b->t[l] = accepted ? b->t[l] + b->length[l] : b->t[l];
        b->b1[l] = accepted ? b->b1[l] : before1[l];
        b->b2[l] = accepted ? b->b2[l] : before2[l];
        b->length[l] = accepted ? 1 : 0;
        b->steps[l] += 1;
    }
    look(b, job);
    for (int l = 0; l < LANES; l++) {
        int fine = fabs(b->y[0][l]) + fabs(b->y[1][l]) + fabs(b->y[2][l]) < 1e6;
        b->end[l] = b->number[l] > job->intervals || (b->size[l] <= 1 && !fine);
        ended |= b->end[l] != 0;
    }
    if (ended)
        for (int l = 0; l < LANES; l++)
            if (b->end[l]) {
                double part = (job->interval * job->intervals - b->begin[l]) / b->step[l];
                for (int i = 0; i < STATES; i++) kept_y[i][l] = dense(b, i, l, part);
            }
    for (int i = 0; i < STATES; i++)
#pragma omp simd simdlen(8)
        for (int l = 0; l < LANES; l++) b->y[i][l] = b->length[l] > 0 ? b->after[i][l] : b->y[i][l];
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        double size = b->size[l] > 1e-12 ? b->size[l] : 1e-12;
        double factor = 0.9 * fifth_root_of_inverse(size);
        factor = b->size[l] < 1e300 ? factor : 0.2;
        factor = factor < 0.2 ? 0.2 : factor > 5 ? 5 : factor;
        double next = b->step[l] * factor;
        b->step[l] = next > job->tolerance[3] ? next : job->tolerance[3];
    }
    return ended != 0;
}

void adaptive(const double *start, const double *torque, const double *gains, const double *limits,
              const double *tolerance, double interval, int64_t intervals, int64_t begin,
              int64_t end, double *results) {
    Block block __attribute__((aligned(64)));
    Rows k[STAGES] __attribute__((aligned(64))), kept;
    Block *b = &block;
    Job job = {{gains[0], gains[1], gains[2], gains[3]},
               {tolerance[0], tolerance[1], tolerance[2], tolerance[3]},
               interval, (double)intervals, limits};
    int64_t of[LANES], next = begin, running = 0;
    memset(b, 0, sizeof *b);
    memset(k, 0, sizeof k);
    for (int l = 0; l < LANES; l++) of[l] = -1, b->end[l] = 1, b->step[l] = 1;
    for (int ended = 1;;) {
        for (int l = 0; ended && l < LANES; l++) {
            if (!b->end[l] || b->done[l]) continue;
            if (of[l] >= 0) {
                double *row = results + 14 * of[l];
                for (int i = 0; i < STATES; i++) row[i] = kept[i][l];
                row[11] = b->peak[l], row[12] = b->settled[l], row[13] = b->steps[l];
                running--;
            }
            b->done[l] = next >= end;
            of[l] = b->done[l] ? -1 : next++;
            int64_t c = b->done[l] ? end - 1 : of[l];
            running += !b->done[l];
            for (int i = 0; i < STATES; i++) b->y[i][l] = i < 9 ? start[9 * c + i] : 0;
            for (int i = 0; i < TORQUES; i++) b->torque[i][l] = torque[TORQUES * c + i];
            State y = loaded(b->y, l);
            Steering s = steering(&y);
            b->b1[l] = fabs(s.s1) > job.gains.a, b->b2[l] = fabs(s.s2) > job.gains.a;
            b->t[l] = b->number[l] = b->steps[l] = b->peak[l] = 0;
            b->settled[l] = INFINITY, b->step[l] = tolerance[2];
        }
        if (!running) return;
        stage_rates(b, &job.gains, k, 0);
        stage_rates(b, &job.gains, k, 1);
        stage_rates(b, &job.gains, k, 2);
        stage_rates(b, &job.gains, k, 3);
        stage_rates(b, &job.gains, k, 4);
        stage_rates(b, &job.gains, k, 5);
        stage_rates(b, &job.gains, k, 6);
        finished_step(b, &job, k);
        ended = moved_on(b, &job, kept);
    }
}
