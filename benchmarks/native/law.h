/* One sample of the oscillatory law with its estimators and its regulator, part of sampled.c. */

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

#define PRODUCTS(x, y, z) {x * y, x * x - y * y, y * z, x * z, x * x + y * y, z * z}

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
    double cos2 = 1 - 2 * sine * sine, sin2 = 2 * sine * cosine, nu = c->nu;
#pragma omp simd simdlen(8)
    for (int l = 0; l < LANES; l++) {
        double q0 = q[0][l], q1 = q[1][l], q2 = q[2][l], q3 = q[3][l];
        double x = seen[0][l], y = seen[1][l], z = seen[2][l];
        double e1 = k->estimate[0][l], e2 = k->estimate[1][l], sign = coupling < 0 ? -1 : 1;
        double believed = sign * (coupling + k->estimate[2][l]);
        double cc = sign * (believed > 0.2 ? believed : 0.2);
        double third = k->mean[l] - e1 * x - e2 * (y + c->orbit);
        double turn_ripple = k->quadrature[l] / c->frequency;
        double up2 = q0 * q0 + q3 * q3, up = sqrt(up2), safe = up > 1e-12 ? up : 1e-12;
        double phi = 2 * (q0 * q1 + q2 * q3) / safe, theta = 2 * (q0 * q2 - q1 * q3) / safe;
        double w = sqrt(q1 * q1 + q2 * q2) / safe, side = q0 < 0 ? -1 : 1;
        double z_turn = 2 * half_atan2(side * q3, side * q0);
        double turn_cos = (q0 * q0 - q3 * q3) / up2, turn_sin = 2 * q0 * q3 / up2;
        double swing1 = k->rho[l] * sine, swing2 = k->alpha[l] * sine / k->rho[l];
        double rate = third + cc * c->orbit * (phi * turn_cos + theta * turn_sin)
                      + cc / (4 * nu) * (k->alpha[l] * sin2);
        double bare = z_turn - e1 * phi - e2 * theta - turn_ripple;
        double frame = (1 + cc) * turn_cos * swing1 - (1 - cc) * turn_sin * swing2;
        double turn = bare - c->orbit / (nu * nu) * frame - cc / (8 * nu * nu) * (k->alpha[l] * cos2);
        double alpha = -2 / cc * (c->k3 * c->k3 * (turn - within_limits(turn, c->rest))
                                  + 2 * c->damping * c->k3 * rate);
        double dead = -2 / cc * (2 * c->damping * c->k3 * c->dead);
        double size = sqrt(alpha * alpha + 1e-36), left = sqrt(dead * dead + 1e-36);
        double granted = size - left, most = c->ratio * c->largest * c->largest;
        granted = granted < 1e-18 ? 1e-18 : granted > most ? most : granted;
        double wanted = granted / size * alpha, rho = sqrt(granted / c->ratio) + 1e-9;
        double f1 = -2 * c->orbit * (q1 * q2 + q0 * q3);
        double f2 = -c->orbit * (2 * (q0 * q0 + q2 * q2) - 1);
        double second = wanted / rho, s1 = rho * sine, s2 = second * sine;
        double r1 = f1 - c->tilt_gain * (phi + rho * cosine / nu) + s1;
        double r2 = f2 - c->tilt_gain * (theta + second * cosine / nu) + s2;
        double d1 = nu * rho * cosine - c->tilt_gain * (x - f1 - s1);
        double d2 = nu * second * cosine - c->tilt_gain * (y - f2 - s2);
        double u1 = c->j1 * (d1 - c->rate_gain * (x - r1)) - (c->j2 - c->j3) * y * z;
        double u2 = c->j2 * (d2 - c->rate_gain * (y - r2)) - (c->j3 - c->j1) * x * z;
        double by = y + c->orbit, v1 = 0, v2 = 0;
        double deviation[6] = {phi, theta, bare, x, by, third};
        for (int j = 0; j < 6; j++) {
            v1 -= c->gain[j] * deviation[j];
            v2 -= c->gain[6 + j] * deviation[j];
        }
        int enter = (w < c->enter_angle) & (fabs(turn) < c->enter_angle)
                    & (fabs(rate) < c->enter_slow) & (fabs(x) < c->enter_rate)
                    & (fabs(by) < c->enter_rate);
        int leave = (w > c->leave_tilt) | (fabs(z_turn) > c->leave_turn) | (fabs(z) > c->leave_rate);
        int regulating = k->regulating[l] != 0 ? !leave : enter;
        k->regulating[l] = regulating;
        k->alpha[l] = regulating ? 0 : wanted;
        k->rho[l] = regulating ? 1e-9 : rho;
        u1 = within_limits(regulating ? v1 : u1, c->limit);
        u2 = within_limits(regulating ? v2 : u2, c->limit);
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
