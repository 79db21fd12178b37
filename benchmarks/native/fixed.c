/* RK4 with equal steps: `substeps` in each of `intervals` seconds, lanes side by side.
 *
 * start (cases, 9), torque (cases, 6), results (cases, 13): the state and what was looked at.
 */
#include "work.h"

typedef struct {
    Rows y;
    double torque[TORQUES][LANES], peak[LANES], settled[LANES];
} Block;

INLINE Torque torque_of(Block *b, int l) {
    Torque d = {b->torque[0][l], b->torque[1][l], b->torque[2][l],
                b->torque[3][l], b->torque[4][l], b->torque[5][l]};
    return d;
}
INLINE State stage(const Gains *g, const Torque *d, double t, const State *y, Seen *seen) {
    Steering s = steering(y);
    double d1 = d->amplitude1 * sin_of(d->frequency1 * t + d->phase1);
    double d2 = d->amplitude2 * sin_of(d->frequency2 * t + d->phase2);
    return rate(g, d1, d2, d->frequency1, d->frequency2, fabs(s.s1) > g->a, fabs(s.s2) > g->a, y,
                seen);
}
INLINE State moved(const State *y, double h, const State *k) {
    State s;
#define MOVE(x) s.x = y->x + h * k->x;
    EACH(MOVE)
    return s;
}

static void interval(Block *b, const Gains *gains, const double *limits, double t, double length,
                     int substeps) {
    const Gains g = *gains;
    double h = length / substeps;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        State y = loaded(b->y, l);
        Torque d = torque_of(b, l);
        Seen seen;
        Kept kept = {b->peak[l], b->settled[l]};
        stage(&g, &d, t, &y, &seen);
        kept = looked(kept, t, &y, &seen, limits);
        b->peak[l] = kept.peak;
        b->settled[l] = kept.settled;
    }
    for (int s = 0; s < substeps; s++) {
        double now = t + s * h;
#pragma omp simd simdlen(8)
        for (int l = 0; l < LANES; l++) {
            State y = loaded(b->y, l), m, a, k;
            Torque d = torque_of(b, l);
            Seen seen;
            a = stage(&g, &d, now, &y, &seen);
            m = moved(&y, h / 2, &a);
            k = stage(&g, &d, now + h / 2, &m, &seen);
#define TWICE(x) a.x += 2 * k.x;
            EACH(TWICE)
            m = moved(&y, h / 2, &k);
            k = stage(&g, &d, now + h / 2, &m, &seen);
            EACH(TWICE)
            m = moved(&y, h, &k);
            k = stage(&g, &d, now + h, &m, &seen);
#define ONCE(x) a.x += k.x;
            EACH(ONCE)
            stored(b->y, l, moved(&y, h / 6, &a));
        }
    }
}

void fixed(const double *start, const double *torque, const double *gains, const double *limits,
           double length, int64_t intervals, int64_t substeps, int64_t begin, int64_t end,
           double *results) {
    Block b __attribute__((aligned(64)));
    Gains g = {gains[0], gains[1], gains[2], gains[3]};
    for (int64_t first = begin; first < end; first += LANES) {
        memset(&b, 0, sizeof b);
        for (int l = 0; l < LANES; l++) {
            int64_t c = first + l < end ? first + l : end - 1;
            for (int i = 0; i < 9; i++) b.y[i][l] = start[9 * c + i];
            for (int i = 0; i < TORQUES; i++) b.torque[i][l] = torque[TORQUES * c + i];
            b.settled[l] = INFINITY;
        }
        for (int64_t i = 0; i < intervals; i++)
            interval(&b, &g, limits, i * length, length, (int)substeps);
        for (int l = 0; l < LANES && first + l < end; l++) {
            double *row = results + 13 * (first + l);
            for (int i = 0; i < STATES; i++) row[i] = b.y[i][l];
            row[11] = b.peak[l];
            row[12] = b.settled[l];
        }
    }
}
