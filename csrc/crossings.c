/* When a polynomial through values and slopes meets a bound. */
#include "internal.h"

/* When the cubic through values y and slopes d over h meets the edge, which y1 lies beyond. */
double crossing(double y0, double d0, double y1, double d1, double h, double edge) {
    double sign = y1 > edge ? 1.0 : -1.0;
    if (sign * (y0 - edge) >= 0.0) {
        if (sign * d0 >= 0.0)
            return 0.0;
        y0 = edge; /* it was on the bound, but for rounding, and goes inward first */
    }
    double a = h * d0, b = 3.0 * (y1 - y0) - h * (2.0 * d0 + d1);
    double c = 2.0 * (y0 - y1) + h * (d0 + d1);
    double low = 0.0, high = 1.0, u = within((edge - y0) / (y1 - y0), 0.1, 0.9);
    for (int tries = 0; tries < 60; tries++) {
        double y = y0 + u * (a + u * (b + u * c)) - edge;
        if (sign * y > 0.0)
            high = u;
        else
            low = u;
        double slope = a + u * (2.0 * b + 3.0 * c * u);
        double new = slope * sign > 0.0 ? u - y / slope : -1.0;
        if (!(low < new && new < high))
            new = 0.5 * (low + high);
        if (fabs(new - u) < 1e-12)
            break;
        u = new;
    }
    return u * h;
}

/* When the cubic through values y and slopes d over h rises over 0, INFINITY if it stays below `near`;
 * its highest point between counts too. */
double rises(double y0, double d0, double y1, double d1, double h, double near) {
    if (y1 <= near && d0 > 0.0 && d1 < 0.0) {
        double u = d0 / (d0 - d1), b = 3.0 * (y1 - y0) - h * (2.0 * d0 + d1);
        double c = 2.0 * (y0 - y1) + h * (d0 + d1);
        y1 = y0 + u * (h * d0 + u * (b + u * c));
        d1 = 0.0;
        h *= u;
    }
    return y1 > near ? crossing(y0, d0, y1, d1, h, 0.0) : INFINITY;
}

/* A crossing at about the time `at`, on the polynomial through values and slopes at 0, h/2, h, by
 * two steps of Newton's method; `at` itself where they lead away. */
double polished(double at, const double y[3], const double d[3], double h, double edge) {
    double a1 = h * d[0], first = 2.0 * (y[1] - y[0]), second = 2.0 * (y[2] - y[1]);
    double middle = h * d[1];
    double a2 = 2.0 * (first - a1), b2 = 2.0 * (middle - first);
    double c2 = 2.0 * (second - middle), e2 = 2.0 * (h * d[2] - second);
    double a3 = 2.0 * (b2 - a2), b3 = c2 - b2, c3 = 2.0 * (e2 - c2);
    double a4 = b3 - a3, a5 = c3 - b3 - a4;
    double u = at / h;
    for (int tries = 0; tries < 2; tries++) {
        double w = u - 0.5, z = u - 1.0, inner = a3 + w * (a4 + z * a5);
        double value = y[0] + u * (a1 + u * (a2 + w * inner)) - edge;
        double slope = a1 + u * (2.0 * a2 + 2.0 * w * inner +
                                 u * (inner + w * (a4 + (z + w) * a5)));
        if (slope == 0.0)
            return at;
        u -= value / slope;
    }
    return fabs(u * h - at) < 0.1 * h && 0.0 < u && u < 1.0 ? u * h : at;
}
