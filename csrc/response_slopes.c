/* How the responses change with the square x of a mode's frequency and with its decay d. */
#include "internal.h"

enum { SERIES = 11, POINTS = 8 };

/* S' and (J0, J1, J2)' by x and by d, without damping and for small phases: power series. */
static void by_series(double x, double t, double out[8]) {
    double X = x * t * t, term = t; /* (-1)^n x^n t^(2n + 1)/(2n + 1)! */
    for (int k = 0; k < 8; k++)
        out[k] = 0.0;
    double slope = 0.0; /* of the term by x */
    for (int n = 0; n < SERIES; n++) {
        double parts[2] = {slope, -term * t};
        for (int k = 0; k < 2; k++) { /* by x as t^(2n + 1), by d as t^(2n + 2) */
            double value = parts[k];
            out[4 * k] += value;
            for (int i = 1; i < 4; i++) {
                value *= t / (2 * n + 1 + k + i);
                out[4 * k + i] += value;
            }
        }
        double over = 1.0 / ((2.0 * n + 2.0) * (2.0 * n + 3.0));
        slope = -(slope * X + term * t * t) * over;
        term *= -X * over;
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

/* The same with damping, for small phases: S' integrated by Gauss's rule. */
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

/* Derivatives [8][n] of S, J0, J1, J2 of n modes after a time by omega^2, then by the decay. */
void response_slopes(int n, const double *omega, const double *decay, double t,
                     const double *response, double *out) {
    for (int j = 0; j < n; j++) {
        double x = omega[j] * omega[j], d = decay[j], each[8];
        const double *S = response + 2 * (ptrdiff_t)n + j, *J0 = S + n;
        if (x * t * t >= 1.0)
            by_division(x, d, t, response[j], *S, (double[]){J0[0], J0[n], J0[2 * (ptrdiff_t)n]}, each);
        else if (d > 0.0)
            by_quadrature(x, d, t, each);
        else
            by_series(x, t, each);
        for (int k = 0; k < 8; k++)
            out[(ptrdiff_t)k * n + j] = each[k];
    }
}
