/* How the responses change with the square x of a mode's frequency and with its decay d. */
#include "internal.h"

enum { SERIES = 11, POINTS = 8, DAMPED_SERIES = 26 };

#define APART 20.0 /* decay times time above which an over-damped mode is two real poles far apart */

/* Of the series of S', J0', J1', J2' by x: the terms n + 1 over n of that of index i, without X. */
#define RATIO(n, i) ((n + 1.0) / (n * (2.0 * n + 2.0 + i) * (2.0 * n + 3.0 + i)))
#define RATIOS(i)                                                                             \
    {RATIO(1, i), RATIO(2, i), RATIO(3, i), RATIO(4, i),                                      \
     RATIO(5, i), RATIO(6, i), RATIO(7, i), RATIO(8, i)}

/* By x, without damping: rows [4][n] of S', J0', J1', J2', by power series where x t^2 < 1 and from
 * P = 1 - x J0, ... elsewhere; both are found and one is taken, so that the compiler finds several
 * modes at once. */
static void undamped_slopes(ptrdiff_t n, const double *restrict omega, double t,
                            const double *restrict response, double *restrict out) {
    static const double ratio[4][8] = {RATIOS(0), RATIOS(1), RATIOS(2), RATIOS(3)};
    static const double first[4] = {-1 / 6., -1 / 24., -1 / 120., -1 / 720.};
    const double *restrict P = response, *restrict S = P + 2 * n, *restrict J0 = S + n;
    const double *restrict J1 = J0 + n, *restrict J2 = J1 + n;
    double power = t * t * t;
    for (int i = 0; i < 4; i++, power *= t)
        for (ptrdiff_t j = 0; j < n; j++) {
            double x = omega[j] * omega[j] * t * t, X = x < 1.0 ? x : 1.0, sum = 1.0;
            for (int k = 7; k >= 0; k--)
                sum = 1.0 - X * ratio[i][k] * sum;
            out[i * n + j] = first[i] * power * sum;
        }
    for (ptrdiff_t j = 0; j < n; j++) {
        double x = omega[j] * omega[j];
        bool far = x * t * t >= 1.0;
        double over = far ? 1.0 / x : 0.0, s = 0.5 * (t * P[j] - S[j]) * over;
        double j0 = (0.5 * t * S[j] - J0[j]) * over, j1 = (-s - J1[j]) * over;
        double j2 = (-j0 - J2[j]) * over;
        out[j] = far ? s : out[j];
        out[n + j] = far ? j0 : out[n + j];
        out[2 * n + j] = far ? j1 : out[2 * n + j];
        out[3 * n + j] = far ? j2 : out[3 * n + j];
    }
}

/* S' and (J0, J1, J2)' by x and by d for small phases and decays: the power series of S/t in time
 * over t, from its differential equation, and its derivatives by X = x t^2 and by e = d t. */
static void by_series(double x, double d, double t, double out[8]) {
    double X = x * t * t, e = d * t, a[3] = {0.0, 0.0, 0.0}, b[3] = {1.0, 0.0, 0.0};
    for (int i = 0; i < 8; i++)
        out[i] = 0.0;
    for (int k = 0; k < DAMPED_SERIES; k++) { /* a, b: terms k and k + 1 */
        double over = 1.0 / ((k + 1.0) * (k + 2.0)), pull = 2.0 * (k + 1.0);
        double next[3] = {-(pull * e * b[0] + X * a[0]) * over,
                          -(pull * e * b[1] + X * a[1] + a[0]) * over,
                          -(pull * (e * b[2] + b[0]) + X * a[2]) * over};
        double share[4] = {1.0, 1.0 / (k + 3.0), 0.0, 0.0};
        share[2] = share[1] / (k + 4.0);
        share[3] = share[2] / (k + 5.0);
        for (int i = 0; i < 4; i++) {
            out[i] += share[i] * next[1];
            out[4 + i] += share[i] * next[2];
        }
        memcpy(a, b, sizeof a);
        memcpy(b, next, sizeof b);
    }
    double power = t * t;
    for (int i = 0; i < 4; i++, power *= t) {
        out[i] *= power * t;
        out[4 + i] *= power;
    }
}

/* S, C = S' + d S, and their derivatives by x: everything else follows. */
static void kernel(double x, double d, double t, double *S, double *C, double *by_x) {
    double y = x - d * d, g = sqrt(fabs(y)) * t, sine, cosine;
    if (y >= 0.0) {
        double fade = exp(-d * t);
        cosine = fade * cos(g);
        sine = g < 1e-4 ? fade * t * (1.0 - g * g / 6.0) : fade * sin(g) / g * t;
    } else {
        double slow = exp(g - d * t), fast = exp(-g - d * t);
        cosine = 0.5 * (slow + fast);
        sine = g < 1e-4 ? exp(-d * t) * t * (1.0 + g * g / 6.0) : 0.5 * (slow - fast) / g * t;
    }
    *S = sine;
    *C = cosine;
    if (g > 0.3) {
        *by_x = 0.5 * (t * cosine - sine) / y;
        return;
    }
    double Y = y * t * t, term = t * t * t * exp(-d * t), total = 0.0;
    for (int n = 1; n < SERIES; n++) {
        term *= -1.0 / ((2.0 * n) * (2.0 * n + 1.0));
        total += n * term;
        term *= Y;
    }
    *by_x = total;
}

/* The same for small phases of strong damping: S' integrated by Gauss's rule. */
static void by_quadrature(double x, double d, double t, double out[8]) {
    static const double place[POINTS / 2] = {0.1834346424956498, 0.5255324099163290,
                                             0.7966664774136267, 0.9602898564975363};
    static const double weight[POINTS / 2] = {0.3626837833783620, 0.3137066458778873,
                                              0.2223810344533745, 0.1012285362903763};
    int panels = 2 + (int)smaller(2.0 * d * t, 200.0);
    double half = 0.5 * t / panels;
    for (int k = 0; k < 8; k++)
        out[k] = 0.0;
    for (int n = 0; n < panels * POINTS; n++) {
        int k = n % POINTS / 2;
        double at = half * (2 * (n / POINTS) + 1 + (n % 2 ? place[k] : -place[k]));
        double S, C, slope, left = t - at, w = half * weight[k];
        kernel(x, d, at, &S, &C, &slope);
        double each[2] = {slope, -at * S - 2.0 * d * slope};
        for (int i = 0; i < 2; i++) {
            out[4 * i + 1] += w * each[i];
            out[4 * i + 2] += w * each[i] * left;
            out[4 * i + 3] += w * each[i] * left * left * 0.5;
        }
    }
    double S, C, slope;
    kernel(x, d, t, &S, &C, &slope);
    out[0] = slope;
    out[4] = -t * S - 2.0 * d * slope;
}

/* Of exp(p t) and its integrals with 1, t, t^2/2 that of index k, and its derivative by the pole p:
 * power series of a slow pole. */
static void slow_pole(double p, double t, double value[4], double slope[4]) {
    for (int k = 0; k < 4; k++) {
        double term = 1.0;
        for (int n = 1; n <= k; n++)
            term *= t / n;
        value[k] = slope[k] = 0.0;
        for (int n = 0; n < DAMPED_SERIES; n++) { /* term: p^n t^(n + k)/(n + k)! */
            value[k] += term;
            slope[k] += (n + 1.0) * term * t / (n + k + 1.0);
            term *= p * t / (n + k + 1.0);
        }
    }
}

static void fast_pole(double p, double t, double value[4], double slope[4]) {
    double power = 1.0;
    value[0] = exp(p * t);
    slope[0] = t * value[0];
    for (int k = 1; k < 4; k++) {
        value[k] = (value[k - 1] - power) / p;
        slope[k] = (slope[k - 1] - value[k]) / p;
        power *= t / k;
    }
}

/* The same for very strong damping: S, J0, ... = (those of the slow pole - those of the fast one)/(2 r),
 * r^2 = d^2 - x. */
static void by_poles(double x, double d, double t, double out[8]) {
    double r = sqrt(d * d - x), fast = -d - r, slow = x / fast;
    double one[4], two[4], one_slope[4], two_slope[4];
    if (slow * t < -1.0)
        fast_pole(slow, t, one, one_slope);
    else
        slow_pole(slow, t, one, one_slope);
    fast_pole(fast, t, two, two_slope);
    for (int k = 0; k < 4; k++) {
        double whole = (one[k] - two[k]) / (2.0 * r);
        out[k] = (whole - 0.5 * (one_slope[k] + two_slope[k])) / (2.0 * r * r);
        out[4 + k] = -(0.5 * (slow * one_slope[k] + fast * two_slope[k]) + d * whole) / (r * r);
    }
}

/* The same where x t^2 is not small, from P = 1 - x J0, J1 = (t - S - 2 d J0)/x, ... */
static void by_division(double x, double d, double t, double P, double S, const double J[3],
                        double out[8]) {
    double y = x - d * d, C = P - d * S;
    if (fabs(y) * t * t > 0.1)
        out[0] = 0.5 * (t * C - S) / y;
    else
        kernel(x, d, t, &S, &C, out);
    out[4] = -t * S - 2.0 * d * out[0];
    double P_x = -0.5 * t * S + d * out[0], P_d = d * t * S - t * C + S + d * out[4];
    out[1] = (-P_x - J[0]) / x;
    out[2] = (-out[0] - 2.0 * d * out[1] - J[1]) / x;
    out[3] = (-out[1] - 2.0 * d * out[2] - J[2]) / x;
    out[5] = -P_d / x;
    out[6] = (-out[4] - 2.0 * J[0] - 2.0 * d * out[5]) / x;
    out[7] = (-out[5] - 2.0 * J[1] - 2.0 * d * out[6]) / x;
}

/* Derivatives [8][n] of S, J0, J1, J2 of n modes after a time by omega^2, then, where they are asked
 * for, by the decay. */
void response_slopes(int n, const double *omega, const double *decay, double t,
                     const double *response, bool by_decay, double *out) {
    undamped_slopes(n, omega, t, response, out);
    for (int j = 0; j < n && by_decay; j++) {
        double x = omega[j] * omega[j], d = decay[j], each[8];
        const double *S = response + 2 * (ptrdiff_t)n + j, *J0 = S + n;
        if (d * t > APART && d * d > 2.0 * x) /* by_division would take the difference of large numbers */
            by_poles(x, d, t, each);
        else if (x * t * t >= 1.0)
            by_division(x, d, t, response[j], *S, (double[]){J0[0], J0[n], J0[2 * (ptrdiff_t)n]}, each);
        else if (d * t < 1.0)
            by_series(x, d, t, each);
        else
            by_quadrature(x, d, t, each);
        for (int k = 0; k < 8; k++)
            out[(ptrdiff_t)k * n + j] = each[k];
    }
}
