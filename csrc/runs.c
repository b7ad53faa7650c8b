/* What is read from runs: states, energies, the pulse of a contact, the difference of two runs. */
#include "internal.h"

/* Kinetic and strain energy of x = (q, v). */
double mechanical_energy(int n, const double *x, const double *omega) {
    double total[2] = {0.0, 0.0};
    for (int j = 0; j < n; j++) {
        double strained = omega[j] * x[j], moving = x[n + j];
        total[0] += strained * strained;
        total[1] += moving * moving;
    }
    return 0.5 * (total[0] + total[1]);
}

void aom_energies(int64_t n, int n_modes, const double *states, const double *omega, double *out) {
    for (int64_t k = 0; k < n; k++)
        out[k] = mechanical_energy(n_modes, states + 2 * k * n_modes, omega);
}

/* Value at time t, and slope, of what is linear between breaks and constant afterwards. */
static void between(const aom_system *system, const double *values, int width, int i, double t,
                    double *value, double *slope) {
    int k = 0;
    while (k + 1 < system->n_breaks && system->breaks[k + 1] <= t)
        k++;
    const double *at = values + (ptrdiff_t)k * width + i;
    bool last = k + 1 == system->n_breaks;
    *slope = last ? 0.0 : (at[width] - at[0]) / (system->breaks[k + 1] - system->breaks[k]);
    *value = at[0] + *slope * (t - system->breaks[k]);
}

void aom_state_at(const aom_system *system, const aom_record *record, int64_t k, double t,
                  double *state, double *force, double *depth) {
    int J = system->n_modes, m = system->n_rows;
    const double *F = record->force + 2 * k * m, *x = record->states + 2 * k * J;
    double start = record->time[2 * k], h = record->time[2 * k + 2] - start;
    double over = h > 0.0 ? 1.0 / h : 0.0;
    for (int j = 0; j < J; j++) {
        double r[6], f = 0.0, g = 0.0, c = 0.0, load, rise, w = system->omega[j];
        aom_responses(1, &w, system->decay + j, &t, 0, r);
        between(system, system->loads, J, j, start, &load, &rise);
        for (int i = 0; i < m; i++) {
            double b = system->beta[(ptrdiff_t)i * J + j], f0 = F[i], f1 = F[m + i];
            double f2 = F[2 * m + i];
            f += b * f0;
            g += b * (4.0 * f1 - 3.0 * f0 - f2) * over;
            c += b * 4.0 * (f0 - 2.0 * f1 + f2) * over * over;
        }
        f -= load;
        g -= rise;
        state[j] = r[0] * x[j] + r[2] * x[J + j] - f * r[3] - g * r[4] - c * r[5];
        state[J + j] = r[1] * x[J + j] - w * w * r[2] * x[j] - f * r[2] - g * r[3] - c * r[4];
    }
    if (force == NULL || depth == NULL)
        return;
    double u = t * over;
    for (int i = 0; i < m; i++) {
        double f0 = F[i], f1 = F[m + i], f2 = F[2 * m + i];
        force[i] = f0 + u * (4.0 * f1 - 3.0 * f0 - f2 + 2.0 * u * (f0 - 2.0 * f1 + f2));
    }
    for (int i = 0; i < m; i++) {
        double gap, drift, way = 0.0;
        between(system, system->offsets, m, i, start, &gap, &drift);
        for (int j = 0; j < J; j++)
            way += system->beta[(ptrdiff_t)i * J + j] * state[j];
        for (int j = 0; j < m; j++)
            way -= system->residual[(ptrdiff_t)i * m + j] * force[j];
        depth[i] = way - gap - drift * t;
    }
}

/* A run as aom_compare walks through it. */
typedef struct walk {
    int64_t n, node, step; /* nodes, the next one, the start of the present step */
    const double *time, *force;
    double u; /* share of the step that has passed */
} walk;

static void walk_to(walk *w, double t) {
    while (w->step + 4 < w->n && w->time[w->step + 2] <= t)
        w->step += 2;
    double start = w->time[w->step], h = w->time[w->step + 2] - start;
    w->u = h > 0.0 ? within((t - start) / h, 0.0, 1.0) : 0.0;
}

static double walk_force(const walk *w, int m, int i) {
    const double *f = w->force + w->step * m + i;
    double f0 = f[0], f1 = f[m], f2 = f[2 * m], u = w->u;
    return f0 + u * ((4.0 * f1 - 3.0 * f0 - f2) + 2.0 * u * (f0 - 2.0 * f1 + f2));
}

/* Integrals of |F_a - F_b|^2 and |F_b|^2 over time into `total`, and the largest |F_a| and |F_b| of
 * every row, up to `end`; the time at which the first integral exceeds the limit, else the end. */
static double integrals(int m, walk a, walk b, double end, double limit, double total[2],
                        double *peaks) {
    double before = 0.0, last[2] = {0.0, 0.0}, until = end;
    total[0] = total[1] = 0.0;
    memset(peaks, 0, 2 * (size_t)m * sizeof *peaks);
    while (a.node < a.n || b.node < b.n) {
        bool from_a = b.node >= b.n || (a.node < a.n && a.time[a.node] <= b.time[b.node]);
        double t = from_a ? a.time[a.node++] : b.time[b.node++], now[2] = {0.0, 0.0};
        if (t > end)
            break;
        walk_to(&a, t);
        walk_to(&b, t);
        for (int i = 0; i < m; i++) {
            double fa = walk_force(&a, m, i), fb = walk_force(&b, m, i);
            now[0] += (fa - fb) * (fa - fb);
            now[1] += fb * fb;
            peaks[i] = larger(peaks[i], fabs(fa));
            peaks[m + i] = larger(peaks[m + i], fabs(fb));
        }
        for (int k = 0; k < 2; k++) {
            total[k] += 0.5 * (t - before) * (now[k] + last[k]);
            last[k] = now[k];
        }
        before = t;
        if (total[0] > limit && until == end)
            until = t;
    }
    return until;
}

aom_difference aom_compare(int m, int64_t n_a, const double *time_a, const double *force_a,
                           int64_t n_b, const double *time_b, const double *force_b, double tol,
                           double *peaks) {
    walk a = {n_a, 0, 0, time_a, force_a, 0.0}, b = {n_b, 0, 0, time_b, force_b, 0.0};
    aom_difference found = {0.0, 0.0, smaller(time_a[n_a - 1], time_b[n_b - 1])};
    double total[2], apart = 0.0, most = 0.0;
    if (n_a < 3 || n_b < 3) /* one stopped at once */
        return found;
    integrals(m, a, b, found.until, INFINITY, total, peaks);
    if (total[1] == 0.0)
        return total[0] == 0.0 ? found : (aom_difference){1.0, 1.0, 0.0};
    for (int i = 0; i < m; i++) {
        apart = larger(apart, fabs(peaks[i] - peaks[m + i]));
        most = larger(most, peaks[m + i]);
    }
    found.force = sqrt(total[0] / total[1]);
    found.peak = apart / most;
    if (found.force > tol)
        found.until = integrals(m, a, b, found.until, tol * tol * total[1], total, peaks);
    return found;
}
