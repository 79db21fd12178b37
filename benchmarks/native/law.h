/* One sample of the oscillatory law with its estimators and its end game, part of sampled.c. */

/* The row-wise upper half of a symmetric 8x8 matrix. */
#define AT(i, j) ((i) <= (j) ? (i) * 8 - (i) * ((i) - 1) / 2 + (j) - (i) \
                             : (j) * 8 - (j) * ((j) - 1) / 2 + (i) - (j))

INLINE double within_limits(double x, double most) {
    return x > most ? most : x < -most ? -most : x;
}

/* Least squares with the errors of the interval that ends now. */
static void fit(const Numbers *c, Block *k, double (*seen)[LANES]) {
    double coupling = (c->j1 - c->j2) / c->j3, noise = c->fit_noise * c->fit_noise;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        double r[8], projected[8], change = seen[2][l] - k->first[2][l];
        r[0] = seen[0][l] - k->first[0][l];
        r[1] = seen[1][l] - k->first[1][l];
        for (int i = 0; i < 6; i++) r[2 + i] = k->products[i][l];
        double variance = noise, residual = change - coupling * r[2];
#pragma GCC unroll 8
        for (int i = 0; i < 8; i++) {
            projected[i] = 0;
#pragma GCC unroll 8
            for (int j = 0; j < 8; j++) projected[i] += k->covariance[AT(i, j)][l] * r[j];
            variance += r[i] * projected[i];
            residual -= r[i] * k->estimate[i][l];
        }
        double inverse = 1 / variance;
#pragma GCC unroll 8
        for (int i = 0; i < 8; i++) {
            double gain = projected[i] * inverse;
            k->estimate[i][l] += gain * residual;
#pragma GCC unroll 8
            for (int j = i; j < 8; j++) k->covariance[AT(i, j)][l] -= gain * projected[j];
        }
        for (int i = 0; i < 3; i++) k->first[i][l] = seen[i][l];
        for (int i = 0; i < 6; i++) k->products[i][l] = 0;
    }
}

/* The six products of the rates that ds/dt is linear in. */
#define PRODUCTS(x, y, z) \
    {(x) * (y), (x) * (x) - (y) * (y), (y) * (z), (x) * (z), (x) * (x) + (y) * (y), (z) * (z)}

/* What follows from the fit, until the next one: the coupling about the axes of the reduced inertia,
 * these axes, the turn (turn1, 0, turn3) to the nearest attitude that can be held, the drift of s
 * that is left there, and the slow turn in which the end game stops the slow rate, over the rate's
 * square. The model has no product of inertia and its orbit frame turns about -y, so the orbit rate
 * cancels in the turn. */
static void believe(const Numbers *c, Block *k) {
    double model = (c->j1 - c->j2) / c->j3, least = 0.2 * model < 0.2 ? 0.2 * model : 0.2;
    double able = c->late.largest * c->late.largest / 2;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        double a = k->estimate[2][l] + model, b = k->estimate[3][l], f = k->estimate[4][l];
        double g = k->estimate[5][l], h = k->estimate[6][l], m = k->estimate[7][l];
        double full = sqrt(a * a + 4 * b * b), coupling = full > least ? full : least;
        double large = sqrt((1 + fabs(a) / full) / 2), small = fabs(b) / (full * large);
        k->axis_cos[l] = a < 0 ? small : large;
        k->axis_sin[l] = copysign(a < 0 ? large : small, -b);
        double square = a * a + f * f;
        double scale = within_limits((h - b) / square, 0.02 / sqrt(square));
        double turn1 = scale * f, turn3 = -scale * a;
        double rest[6] = PRODUCTS(-turn3, -1, turn1);
        k->turn1[l] = turn1;
        k->turn3[l] = turn3;
        double drift = c->orbit * c->orbit * (a * rest[0] + b * rest[1] + f * rest[2] + g * rest[3]
                                              + h * rest[4] + m * rest[5]);
        double most = coupling * able, sure = 0.7 * most - fabs(drift);
        k->coupling[l] = coupling;
        k->drift[l] = drift;
        k->braking[l] = 0.5 / (sure > 0.2 * most ? sure : 0.2 * most);
    }
}

/* Of an oscillator what one sample needs. */
typedef struct { double by_turn, by_rate, rest, dead, least, most, share; } Demand;
INLINE Demand demand_of(const Oscillator *o) {
    double by_rate = 2 * o->damping * o->k3;
    Demand d = {o->k3 * o->k3, by_rate, o->rest, by_rate * o->dead,
                1e-8 * o->largest, o->ratio * o->largest * o->largest, 1 / o->ratio};
    return d;
}

static void control(const Numbers *numbers, Block *k, double (*noise)[LANES], double t, int64_t i) {
    const Numbers n = *numbers, *c = &n;
    double seen[3][LANES], q[4][LANES], sine, cosine;
    double turn_sine = sin(c->frequency * c->period), turn_cosine = cos(c->frequency * c->period);
    double span = i ? c->period : 0, coupling = (c->j1 - c->j2) / c->j3;
    if (!i) turn_sine = 0, turn_cosine = 1;
    sincos_of(c->nu * t, &sine, &cosine);
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        look(c, k, l, t);
        double q0 = k->q[0][l], q1 = k->q[1][l], q2 = k->q[2][l], q3 = k->q[3][l];
        double size = 1 / sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3), half = 0.5 * c->attitude_noise;
        q0 *= size, q1 *= size, q2 *= size, q3 *= size;
        double a = half * noise[3][l], b = half * noise[4][l], d = half * noise[5][l];
        double m0 = q0 - q1 * a - q2 * b - q3 * d, m1 = q1 + q0 * a + q2 * d - q3 * b;
        double m2 = q2 + q0 * b + q3 * a - q1 * d, m3 = q3 + q0 * d + q1 * b - q2 * a;
        size = 1 / sqrt(m0 * m0 + m1 * m1 + m2 * m2 + m3 * m3);
        q[0][l] = m0 * size, q[1][l] = m1 * size, q[2][l] = m2 * size, q[3][l] = m3 * size;
        double x = k->omega[0][l] + c->rate_noise * noise[0][l];
        double y = k->omega[1][l] + c->rate_noise * noise[1][l];
        double z = k->omega[2][l] + c->rate_noise * noise[2][l];
        seen[0][l] = x, seen[1][l] = y, seen[2][l] = z;
        if (!i) {
            double first = c->noise * c->noise, wide = c->amplitude * c->amplitude;
            k->last[0][l] = k->first[0][l] = x;
            k->last[1][l] = k->first[1][l] = y;
            k->last[2][l] = k->first[2][l] = k->mean[l] = z;
            k->p[0][l] = first + wide, k->p[1][l] = -wide, k->p[3][l] = k->p[5][l] = wide;
        }
        double before[6] = PRODUCTS(k->last[0][l], k->last[1][l], k->last[2][l]);
        double u = (k->last[0][l] + x) / 2, v = (k->last[1][l] + y) / 2, w = (k->last[2][l] + z) / 2;
        double middle[6] = PRODUCTS(u, v, w), after[6] = PRODUCTS(x, y, z);
        double change = (x - k->last[0][l]) * k->estimate[0][l] + (y - k->last[1][l]) * k->estimate[1][l];
        for (int j = 0; j < 6; j++) {
            double product = span * ((before[j] + 4 * middle[j] + after[j]) / 6);
            change += product * (k->estimate[2 + j][l] + (j ? 0 : coupling));
            k->products[j][l] += product;
        }
        k->last[0][l] = x, k->last[1][l] = y, k->last[2][l] = z;
        double square = x * x + y * y, error = c->product_error * square;
        double s = turn_sine, o = turn_cosine, drift = span * c->drift * c->drift;
        double p0 = k->p[0][l] + span * error * error;
        double p1 = o * k->p[1][l] - s * k->p[2][l], p2 = s * k->p[1][l] + o * k->p[2][l];
        double p3 = o * o * k->p[3][l] - 2 * o * s * k->p[4][l] + s * s * k->p[5][l] + drift;
        double p5 = s * s * k->p[3][l] + 2 * o * s * k->p[4][l] + o * o * k->p[5][l] + drift;
        double p4 = o * s * (k->p[3][l] - k->p[5][l]) + (o * o - s * s) * k->p[4][l];
        double mean = k->mean[l] + change, ripple = o * k->ripple[l] - s * k->quadrature[l];
        double quadrature = s * k->ripple[l] + o * k->quadrature[l];
        double s0 = p0 + p1, s1 = p1 + p3, s2 = p2 + p4;
        double variance = s0 + s1 + c->noise * c->noise + c->lean_error * c->lean_error * square;
        double g0 = s0 / variance, g1 = s1 / variance, g2 = s2 / variance, e = z - mean - ripple;
        k->mean[l] = mean + g0 * e, k->ripple[l] = ripple + g1 * e;
        k->quadrature[l] = quadrature + g2 * e;
        k->p[0][l] = p0 - g0 * s0, k->p[1][l] = p1 - g0 * s1, k->p[2][l] = p2 - g0 * s2;
        k->p[3][l] = p3 - g1 * s1, k->p[4][l] = p4 - g1 * s2, k->p[5][l] = p5 - g2 * s2;
    }
    if (i && i % 10 == 0) fit(c, k, seen);
    if (i % 10 == 0) believe(c, k);
    double cos2 = 1 - 2 * sine * sine, sin2 = 2 * sine * cosine, nu = c->nu;
    const Demand early = demand_of(&c->early), quiet = demand_of(&c->late);
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        double x = seen[0][l], y = seen[1][l], z = seen[2][l];
        double q0 = q[0][l], q1 = q[1][l], q2 = q[2][l], q3 = q[3][l];
        double f1 = -2 * c->orbit * (q1 * q2 + q0 * q3);
        double f2 = -c->orbit * (2 * (q0 * q0 + q2 * q2) - 1);
        /* The attitude from the one that is held. */
        double half1 = k->turn1[l] / 2, half3 = k->turn3[l] / 2;
        double scale = 1 / sqrt(1 + half1 * half1 + half3 * half3);
        double a0 = scale * (q0 + half1 * q1 + half3 * q3), a1 = scale * (q1 - half1 * q0 + half3 * q2);
        double a2 = scale * (q2 - half3 * q1 + half1 * q3), a3 = scale * (q3 - half3 * q0 - half1 * q2);
        double up2 = a0 * a0 + a3 * a3, up = sqrt(up2), safe = 1 / (up > 1e-12 ? up : 1e-12);
        double phi = 2 * (a0 * a1 + a2 * a3) * safe, theta = 2 * (a0 * a2 - a1 * a3) * safe;
        double w = sqrt(a1 * a1 + a2 * a2) * safe, side = a0 < 0 ? -1 : 1;
        double z_turn = 2 * half_atan2(side * a3, side * a0);
        double turn_cos = (a0 * a0 - a3 * a3) / up2, turn_sin = 2 * a0 * a3 / up2;
        /* Slow rate and turn: without the ripple of the oscillation asked for last, about its axes. */
        double cc = k->coupling[l], e1 = k->estimate[0][l], e2 = k->estimate[1][l];
        double o1 = -c->orbit * k->turn3[l], o2 = -c->orbit, ac = k->swing_cos[l], as = k->swing_sin[l];
        double b1 = o1 * turn_cos + o2 * turn_sin, b2 = o2 * turn_cos - o1 * turn_sin;
        double along1 = ac * b1 + as * b2, along2 = ac * b2 - as * b1;
        double swing1 = k->rho[l] * sine, swing2 = k->alpha[l] * sine / k->rho[l];
        double rate = k->mean[l] - c->orbit * k->turn1[l] - e1 * (x - o1) - e2 * (y - o2)
                      - cc * ((ac * phi + as * theta) * along2 + (ac * theta - as * phi) * along1)
                      + cc / (4 * nu) * (k->alpha[l] * sin2);
        double frame = (1 + cc) * along2 * swing1 - (1 - cc) * along1 * swing2;
        double turn = z_turn - e1 * phi - e2 * theta - k->quadrature[l] / c->frequency
                      + (frame - cc / 8 * (k->alpha[l] * cos2)) / (nu * nu);
        /* Which of the two oscillators works; nothing of the other is needed. */
        double stopping = rate * fabs(rate) * k->braking[l], wanted_turn = turn + k->turn3[l];
        double held = fabs(turn), held_after = fabs(turn + stopping);
        double wanted = fabs(wanted_turn), wanted_after = fabs(wanted_turn + stopping);
        held = held > held_after ? held : held_after;
        wanted = wanted > wanted_after ? wanted : wanted_after;
        int enter = (w < c->enter_angle) & (held < c->enter_angle) & (wanted < c->enter_turn)
                    & (fabs(x - o1) < c->enter_rate) & (fabs(y - o2) < c->enter_rate);
        int leave = (w > c->leave_tilt) | (wanted > c->leave_turn);
        /* Numbers, as gcc has no vectors of truth values to choose from. */
        double stays = leave ? 0.0 : 1.0, enters = enter ? 1.0 : 0.0;
        double late = k->late[l] > 0 ? stays : enters;
#define CHOSEN(part) (late > 0 ? quiet.part : early.part)
        double least = CHOSEN(least), bottom = least * least, inverse = 2 / cc;
        double excess = turn - within_limits(turn, CHOSEN(rest)), dead = inverse * CHOSEN(dead);
        double alpha = -inverse * (CHOSEN(by_turn) * excess + CHOSEN(by_rate) * rate + k->drift[l]);
        double size = sqrt(alpha * alpha + bottom * bottom);
        double granted = size - sqrt(dead * dead + bottom * bottom), most = CHOSEN(most);
        granted = granted < bottom ? bottom : granted > most ? most : granted;
        double rho = sqrt(granted * CHOSEN(share)) + least;
        alpha *= granted / size;
        double second = alpha / rho;
        ac = k->axis_cos[l], as = k->axis_sin[l];
        double p1 = ac * rho - as * second, p2 = ac * second + as * rho;
        double r1 = f1 - c->tilt_gain * (phi + p1 * cosine / nu) + p1 * sine;
        double r2 = f2 - c->tilt_gain * (theta + p2 * cosine / nu) + p2 * sine;
        double d1 = nu * p1 * cosine - c->tilt_gain * (x - f1 - p1 * sine);
        double d2 = nu * p2 * cosine - c->tilt_gain * (y - f2 - p2 * sine);
        double u1 = c->j1 * (d1 - c->rate_gain * (x - r1)) - (c->j2 - c->j3) * y * z;
        double u2 = c->j2 * (d2 - c->rate_gain * (y - r2)) - (c->j3 - c->j1) * x * z;
        k->late[l] = late;
        k->alpha[l] = alpha;
        k->rho[l] = rho;
        k->swing_cos[l] = ac;
        k->swing_sin[l] = as;
        u1 = within_limits(u1, c->limit);
        u2 = within_limits(u2, c->limit);
#ifdef PULSED
        k->command[0][l] = u1;
        k->command[1][l] = u2;
#else
        k->torque[0][l] = k->axes[0][l] * u1 + k->axes[1][l] * u2;
        k->torque[1][l] = k->axes[2][l] * u1 + k->axes[3][l] * u2;
        k->torque[2][l] = k->axes[4][l] * u1 + k->axes[5][l] * u2;
#endif
    }
}
