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
    int width;     /* forces of a node */
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

static double walk_force(const walk *w, int i) {
    int m = w->width;
    const double *f = w->force + w->step * m + i;
    double f0 = f[0], f1 = f[m], f2 = f[2 * m], u = w->u;
    return f0 + u * ((4.0 * f1 - 3.0 * f0 - f2) + 2.0 * u * (f0 - 2.0 * f1 + f2));
}

/* Whether a row has no force in the present step, nor had it at the last node. */
static bool rests(const walk *w, int i, double last) {
    int m = w->width;
    const double *f = w->force + w->step * m + i;
    return last == 0.0 && f[0] == 0.0 && f[m] == 0.0 && f[2 * m] == 0.0;
}

/* Add what two runs have between the last node and the next one, `h` later, to the sums of a row. */
static void add_node(row_pair *row, double h, double fa, double fb) {
    double a = row->last[0], b = row->last[1], before = a - b, now = fa - fb, half = 0.5 * h;
    row->apart += half * (before * before + now * now);
    row->size += half * (b * b + fb * fb);
    row->shift += half * (before + now);
    row->impulse += half * (fabs(b) + fabs(fb));
    row->peak[0] = larger(row->peak[0], fabs(fa));
    row->peak[1] = larger(row->peak[1], fabs(fb));
    row->last[0] = fa;
    row->last[1] = fb;
}

/* The sums of every row up to `end`; the time at which the runs are apart by the limit of a row, else
 * the end. */
static double integrals(int m, walk a, walk b, double end, row_pair *rows) {
    double before = 0.0, until = end;
    for (int i = 0; i < m; i++)
        rows[i] = (row_pair){.limit = rows[i].limit};
    while (a.node < a.n || b.node < b.n) {
        bool from_a = b.node >= b.n || (a.node < a.n && a.time[a.node] <= b.time[b.node]);
        double t = from_a ? a.time[a.node++] : b.time[b.node++];
        if (t > end)
            break;
        walk_to(&a, t);
        walk_to(&b, t);
        for (int i = 0; i < m; i++) {
            if (rests(&a, i, rows[i].last[0]) && rests(&b, i, rows[i].last[1]))
                continue;
            add_node(rows + i, t - before, walk_force(&a, i), walk_force(&b, i));
            if (rows[i].apart > rows[i].limit && until == end)
                until = t;
        }
        before = t;
    }
    return until;
}

/* The difference of a row, over the forces of its contact, or LIGHT of the heaviest: `most`, is added to
 * those that were found; its limit. */
static double add_difference(const row_pair *row, const row_pair *contact, const row_pair *most,
                             double tol, aom_difference *found) {
    double size = larger(contact->size, LIGHT * LIGHT * most->size);
    double impulse = larger(contact->impulse, LIGHT * most->impulse);
    double peak = larger(contact->peak[1], LIGHT * most->peak[1]);
    double force = larger(sqrt(row->apart / size), fabs(row->shift) / impulse);
    found->force = larger(found->force, force);
    found->peak = larger(found->peak, fabs(row->peak[0] - row->peak[1]) / peak);
    return tol * tol * size;
}

aom_difference compare_runs(int m, int width, const int *owner, const aom_record *a,
                            const aom_record *b, double tol, row_pair *rows) {
    walk one = {width, a->n_nodes, 0, 0, a->time, a->force, 0.0};
    walk two = {width, b->n_nodes, 0, 0, b->time, b->force, 0.0};
    double end = smaller(a->time[a->n_nodes - 1], b->time[b->n_nodes - 1]);
    aom_difference found = {0.0, 0.0, end};
    row_pair most = {0};
    if (one.n < 3 || two.n < 3) /* one stopped at once */
        return found;
    for (int i = 0; i < m; i++)
        rows[i].limit = INFINITY;
    integrals(m, one, two, end, rows);
    for (int i = 0; i < m; i++) {
        most.apart = larger(most.apart, rows[i].apart);
        most.size = larger(most.size, rows[i].size);
        most.impulse = larger(most.impulse, rows[i].impulse);
        most.peak[1] = larger(most.peak[1], rows[i].peak[1]);
    }
    if (most.size == 0.0)
        return most.apart == 0.0 ? found : (aom_difference){1.0, 1.0, 0.0};
    for (int i = 0; i < m; i++) {
        const row_pair *contact = rows + (owner == NULL ? i : owner[i]);
        rows[i].limit = add_difference(rows + i, contact, &most, tol, &found);
    }
    if (found.force > tol)
        found.until = integrals(m, one, two, end, rows);
    return found;
}

aom_difference aom_compare(int m, int64_t n_a, const double *time_a, const double *force_a,
                           int64_t n_b, const double *time_b, const double *force_b, double tol,
                           double *memory) {
    const aom_record a = {.n_nodes = n_a, .time = (double *)time_a, .force = (double *)force_a};
    const aom_record b = {.n_nodes = n_b, .time = (double *)time_b, .force = (double *)force_b};
    return compare_runs(m, m, NULL, &a, &b, tol, (row_pair *)memory);
}
