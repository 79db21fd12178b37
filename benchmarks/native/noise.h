/* Standard normal noise as jaxsat draws it: Threefry-2x32-20 of a key and counters, 52 bits to
 * [-1, 1), the inverse error function. Also log and atan2 for it and for the law.
 */
#include "tableau.h"
#include "work.h"

INLINE uint32_t turned(uint32_t x, int by) { return (x << by) | (x >> (32 - by)); }

/* Both words in place (Salmon, Moraes, Dror, Shaw, SC11, 2011). */
INLINE void threefry(uint32_t k0, uint32_t k1, uint32_t *first, uint32_t *second) {
    uint32_t k2 = k0 ^ k1 ^ 0x1BD11BDAu, x = *first + k0, y = *second + k1;
#define ROUND(by) x += y; y = turned(y, by); y ^= x;
#define EVEN ROUND(13) ROUND(15) ROUND(26) ROUND(6)
#define ODD ROUND(17) ROUND(29) ROUND(16) ROUND(24)
    EVEN x += k1; y += k2 + 1;
    ODD x += k2; y += k0 + 2;
    EVEN x += k0; y += k1 + 3;
    ODD x += k1; y += k2 + 4;
    EVEN x += k2; y += k0 + 5;
    *first = x;
    *second = y;
}

INLINE double of_bits(int64_t bits) {
    union { int64_t i; double d; } both = {.i = bits};
    return both.d;
}
INLINE int64_t bits_of(double x) {
    union { int64_t i; double d; } both = {.d = x};
    return both.i;
}

/* The natural logarithm of a positive normal number. */
INLINE double log_of(double x) {
    int64_t bits = bits_of(x), k = (bits - 0x3fe6a09e667f3bcdLL) >> 52;
    double f = of_bits(bits - (k << 52)) - 1, s = f / (2 + f), z = s * s, half = 0.5 * f * f;
    double p = 0.14617807153417325;
    p = fma(p, z, 0.15331611722055008);
    p = fma(p, z, 0.1818289243253687);
    p = fma(p, z, 0.22222211089379496);
    p = fma(p, z, 0.28571428626253836);
    p = fma(p, z, 0.3999999999989889);
    p = fma(p, z, 0.666666666666667);
    double tail = s * (half + z * p) + k * 5.497923018708371e-14;
    return k * 0.6931471805598903 - ((half - tail) - f);
}

/* atan2 of x >= 0 */
INLINE double half_atan2(double y, double x) {
    double a = fabs(y), least = a < x ? a : x, most = a < x ? x : a;
    int middle = least > 0.41421356237309503 * most;
    double t = (middle ? least - most : least) / (middle ? least + most : most), z = t * t;
    double p = -0.019162068915902573;
    p = fma(p, z, 0.03921955253255129);
    p = fma(p, z, -0.05085030492810941);
    p = fma(p, z, 0.058580687568615106);
    p = fma(p, z, -0.06664502215671447);
    p = fma(p, z, 0.07692182535116648);
    p = fma(p, z, -0.09090904549884611);
    p = fma(p, z, 0.11111111014561013);
    p = fma(p, z, -0.14285714284657894);
    p = fma(p, z, 0.1999999999999548);
    p = fma(p, z, -0.3333333333333333);
    double angle = (middle ? 0.7853981633974483 : 0) + fma(t * z, p, t);
    return copysign(a > x ? 1.5707963267948966 - angle : angle, y);
}

/* erf_inv(x)/x by w = -log(1 - x^2) (Giles, GPU Computing Gems Jade, 2011), CENTRAL and TAIL from
 * the header that the driver writes. */
INLINE double inverse_central(double w) {
    double t = w - 3.125, p = CENTRAL[CENTRALS - 1];
#pragma GCC unroll 32
    for (int i = CENTRALS - 2; i >= 0; i--) p = fma(p, t, CENTRAL[i]);
    return p;
}
static double inverse_tail(double w) {
    double t = sqrt(w) - 4.25, p = TAIL[TAILS - 1];
    for (int i = TAILS - 2; i >= 0; i--) p = fma(p, t, TAIL[i]);
    return p;
}

#define DRAWS 6
/* Six draws for every lane at sample `number`. */
static void draw(const uint32_t (*key)[LANES], uint32_t number, double (*noise)[LANES]) {
    uint32_t folded[2][LANES], word[2][DRAWS][LANES];
    double w[DRAWS][LANES];
#pragma omp simd simdlen(16)
    for (int l = 0; l < LANES; l++) {
        uint32_t a = 0, b = number;
        threefry(key[0][l], key[1][l], &a, &b);
        folded[0][l] = a;
        folded[1][l] = b;
    }
    for (int d = 0; d < DRAWS; d++) {
#pragma omp simd simdlen(16)
        for (int l = 0; l < LANES; l++) {
            uint32_t a = 0, b = d;
            threefry(folded[0][l], folded[1][l], &a, &b);
            word[0][d][l] = a;
            word[1][d][l] = b;
        }
    }
    int far = 0;
    for (int d = 0; d < DRAWS; d++) {
#pragma omp simd simdlen(8) reduction(| : far)
        for (int l = 0; l < LANES; l++) {
            int64_t bits = ((int64_t)word[0][d][l] << 32) | word[1][d][l];
            double u = of_bits((int64_t)((uint64_t)bits >> 12) | 0x3ff0000000000000LL) - 1;
            double x = 2 * u - 0.9999999999999999;
            x = x < -0.9999999999999999 ? -0.9999999999999999 : x;
            w[d][l] = -log_of((1 - x) * (1 + x));
            far |= w[d][l] > 6.25;
            noise[d][l] = x;
        }
    }
    for (int d = 0; d < DRAWS; d++) {
#pragma omp simd simdlen(8)
        for (int l = 0; l < LANES; l++) {
            double plain = inverse_central(w[d][l]);
            w[d][l] = w[d][l] > 6.25 ? w[d][l] : -plain;
        }
    }
    for (int d = 0; far && d < DRAWS; d++)
        for (int l = 0; l < LANES; l++)
            if (w[d][l] > 6.25) w[d][l] = -inverse_tail(w[d][l]);
    for (int d = 0; d < DRAWS; d++)
#pragma omp simd simdlen(8)
        for (int l = 0; l < LANES; l++) noise[d][l] *= -w[d][l] * 1.4142135623730951;
}
