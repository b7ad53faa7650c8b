/* The free modes of an anti-oscillator model of one site, whose mass matrix is an arrow. */
#include "internal.h"

#define SWEEPS_AT_MOST 200
#define EQUAL 4e-16

/* A zero of Z(x) = k0 - x m0 - sum m_i x p_i/(p_i - x) as a shift from its nearest pole, -1: from 0. */
typedef struct zero {
    int origin;
    double base, shift;
} zero;

/* Z less the part of the nearest pole, and its slope. */
static void rest_of(const zero *z, double k0, double m0, int n, const double *m, const double *p,
                    double *rest, double *slope) {
    double sum = 0.0, rise = 0.0, x = z->base + z->shift;
    for (int i = 0; i < n; i++) {
        if (i == z->origin)
            continue;
        double ratio = p[i] / ((p[i] - z->base) - z->shift); /* the only division */
        sum += m[i] * ratio;
        rise += m[i] * ratio * ratio;
    }
    *rest = k0 - x * m0 - x * sum;
    *slope = -m0 - rise;
}

/* The zero between `lower` and `upper`, interval c; whether it was found. */
static bool find_zero(double k0, double m0, int n, const double *m, const double *p, int c,
                      double lower, double upper, zero *z) {
    double half = 0.5 * (upper - lower), hung = 0.0, low = 0.0, high = half;
    for (int i = 0; i < n; i++) /* lower + half itself may be rounded to a pole */
        hung += m[i] * p[i] / ((p[i] - lower) - half);
    bool right = c < n && k0 - (lower + half) * (m0 + hung) > 0.0;
    z->origin = right ? c : c - 1;
    z->base = z->origin >= 0 ? p[z->origin] : 0.0;
    if (right) {
        low = -half;
        high = 0.0;
    } else if (c >= n)
        high = upper - lower;
    double middle = 0.5 * (low + high), own = z->origin >= 0 ? m[z->origin] * z->base : 0.0;
    double trial = 0.0, new = middle;
    for (int sweep = 0; sweep < SWEEPS_AT_MOST; sweep++) {
        double g, slope;
        z->shift = trial;
        rest_of(z, k0, m0, n, m, p, &g, &slope);
        if (z->origin >= 0) { /* shift Z has no pole there */
            slope = g + trial * slope + own;
            g = trial * g + own * (z->base + trial);
        }
        if (sweep > 0) {
            bool above = z->origin >= 0 && trial < 0.0 ? g < 0.0 : g > 0.0;
            if (g == 0.0)
                return true;
            *(above ? &low : &high) = trial;
        }
        new = trial - g / slope;
        if (!(low < new && new < high))
            new = 0.5 * (low + high);
        z->shift = new;
        if (fabs(new - trial) <= EQUAL * fabs(new))
            return true;
        double step = fabs(new - trial);
        trial = new;
        if (sweep + 1 == SWEEPS_AT_MOST)
            return step <= 1e-12 * fabs(new);
    }
    return false;
}

/* Shape of unit modal mass, of a stride, at a zero. */
static void shape_of(const zero *z, double m0, int n, const double *m, const double *p,
                     ptrdiff_t stride, double *shape) {
    double rest = m0, root, at;
    for (int i = 0; i < n; i++) {
        double ratio = p[i] / ((p[i] - z->base) - z->shift);
        if (i != z->origin)
            rest += m[i] * (ratio * ratio);
    }
    /* b^2 = -1/Z'(x), written so that a vanishing shift divides nothing */
    root = sqrt(z->origin < 0 ? rest
                              : z->shift * z->shift * rest + m[z->origin] * (z->base * z->base));
    at = (z->origin < 0 ? 1.0 : fabs(z->shift)) / root;
    shape[0] = at;
    for (int i = 0; i < n; i++)
        if (i != z->origin)
            shape[(i + 1) * stride] = p[i] * at / ((p[i] - z->base) - z->shift);
        else
            shape[(i + 1) * stride] = (z->shift > 0.0 ? -z->base : z->shift < 0.0 ? z->base : 0.0) / root;
}

int aom_arrow_modes(double k0, double m0, int n, const double *m, const double *p, double *x,
                    double *shape) {
    int size = m0 > 0.0 ? n + 1 : n, lost = 0;
    double top = k0;
    for (int i = 0; i < n; i++)
        top += m[i] * p[i];
    top /= m0;
    for (int c = 0; c < size; c++) {
        zero z;
        double upper = c < n ? p[c] : 2.0 * (larger(top, p[n - 1]) + sqrt(p[n - 1] * top));
        if (c == 0 && k0 == 0.0)
            z = (zero){-1, 0.0, 0.0};
        else
            lost += !find_zero(k0, m0, n, m, p, c, c == 0 ? 0.0 : p[c - 1], upper, &z);
        x[c] = z.base + z.shift;
        shape_of(&z, m0, n, m, p, size, shape + c);
    }
    return lost;
}
