/* Forces of sheets and walls that stretch: bilateral, quadratic and cubic in the coordinates of the
 * last rows, from a quartic energy. They are rows as those of contacts are: parabolas over the step,
 * which meet the polynomial at h/2 and h. */
#include "internal.h"

enum { STRETCH_TRIES = 40 };
#define ACCURATE 1e-7 /* of the forces: Newton's correction after which none is needed */
#define RESTING 1e-12 /* of the forces: friction that changes by less has settled */

/* One equation of Newton's method: the force of a row at a stage. */
typedef struct equation {
    int row, stage;
} equation;

int first_stretch(const aom_system *s) { return s->n_rows - s->n_stretch; }

/* Products of n numbers, in sums that do not wait for each other. */
static double sum_of_products(const double *x, const double *y, int n) {
    enum { SUMS = 8 };
    double part[SUMS] = {0.0}, total = 0.0;
    int k = 0;
    for (; k + SUMS <= n; k += SUMS)
        for (int i = 0; i < SUMS; i++)
            part[i] += x[k + i] * y[k + i];
    for (; k < n; k++)
        total += x[k] * y[k];
    for (int i = 0; i < SUMS; i++)
        total += part[i];
    return total;
}

double stretch_forces(aom_stepper *st) {
    const aom_system *s = &st->system;
    workspace *w = &st->work;
    const double *a = w->coordinates;
    int m = s->n_stretch;
    double energy = 0.0;
    for (int i = 0; i < m; i++) {
        w->polynomial[i] = 0.0;
        for (int j = 0; j < m; j++)
            w->squares[i * m + j] = a[i] * a[j];
    }
    for (int k = 0; k < m; k++)
        for (int i = 0; i <= k; i++) {
            ptrdiff_t pair = (ptrdiff_t)k * m + i;
            double two = sum_of_products(s->quadratic + pair * m, a, m);
            double three = sum_of_products(s->cubic + pair * m * m, w->squares, m * m);
            w->slopes[k * m + i] = w->slopes[i * m + k] = 2.0 * two + 3.0 * three;
            w->polynomial[k] += (two + three) * a[i];
            if (i < k)
                w->polynomial[i] += (two + three) * a[k];
            energy += (i < k ? 2.0 : 1.0) * (two / 3.0 + three / 4.0) * w->squares[pair];
        }
    return energy;
}

/* The coordinates of a state. */
static void coordinates(const aom_stepper *st, const double *q, double *a) {
    int first = first_stretch(&st->system);
    for (int k = 0; k < st->system.n_stretch; k++) {
        const double *beta = beta_row(st, first + k);
        a[k] = 0.0;
        for (int part = 0; part < 2; part++)
            for (int j = st->spans[first + k].begin[part]; j < st->spans[first + k].end[part]; j++)
                a[k] += beta[j] * q[j];
    }
}

double stretch_energy(aom_stepper *st) {
    if (st->system.n_stretch == 0)
        return 0.0;
    workspace *w = &st->work;
    coordinates(st, st->x, w->coordinates);
    return stretch_forces(st);
}

/* The force by which the modes of a row resist, at most, as the row sees it. */
static double resistance(const aom_stepper *st, int i) {
    int J = st->system.n_modes;
    double elastic = 0.0, moving = 0.0, size = 0.0;
    for (int part = 0; part < 2; part++)
        for (int j = st->spans[i].begin[part]; j < st->spans[i].end[part]; j++) {
            double w = st->system.omega[j], beta = beta_row(st, i)[j];
            elastic += beta * w * w * st->x[j];
            moving += beta * w * st->x[J + j];
            size += beta * beta;
        }
    return size > 0.0 ? sqrt(elastic * elastic + moving * moving) / size : 0.0;
}

void scale_stretch(aom_stepper *st) {
    for (int i = first_stretch(&st->system); i < st->system.n_rows; i++) {
        double most = larger(resistance(st, i), fabs(st->rows[i].force));
        st->now.stretch_scale = larger(st->now.stretch_scale, most);
    }
}

void start_stretch(aom_stepper *st) {
    int first = first_stretch(&st->system);
    stretch_energy(st);
    for (int k = 0; k < st->system.n_stretch; k++) {
        st->rows[first + k].force = st->work.polynomial[k];
        st->owner[first + k] = st->system.n_contacts;
    }
    scale_stretch(st);
}

/* What the forces of the attempt add to the curvature of the free motion. */
bool stretched_clear(aom_stepper *st, int index) {
    amplitudes(st);
    for (int i = first_stretch(&st->system); i < st->system.n_rows; i++) {
        const double *f = st->work.force[i].f, *beta = beta_row(st, i);
        double most = larger(fabs(f[0]), larger(fabs(f[1]), fabs(f[2])));
        for (int c = 0; c < st->system.n_contacts; c++) {
            double way = 0.0;
            for (int j = 0; j < st->system.n_modes; j++)
                way += beta_row(st, c)[j] * beta[j];
            st->sag[c] += 2.0 * most * fabs(way); /* q'' = -omega^2 q - f from rest: |q''| <= 2 |f| */
            st->missed[(ptrdiff_t)LEVELS * st->system.n_contacts + c] += 2.0 * most * fabs(way);
        }
    }
    return clear_of_touches(st, index);
}

/* ---- the forces of a step */

static const influence *between_rows(const aom_stepper *st, const influence *local, int i, int j) {
    return i == j ? own_influence(st, local, i) : local + pair_of(st, st->group[i], st->group[j]);
}

/* The rows whose forces are unknown: of contacts that press, and those of stretching; their number. */
static int unknown_rows(aom_stepper *st) {
    int n = 0;
    for (int k = 0; k < st->n_closed; k++) {
        int i = st->work.closed[k];
        if (presses(st, i) || i >= first_stretch(&st->system))
            st->work.unknown[n++] = i;
    }
    return n;
}

/* Equation e of contact c: its residual, and its row of the matrix. */
static double contact_equation(aom_stepper *st, const influence *local, int n, equation e,
                               double *row) {
    double delta, rate, f = st->work.force[e.row].f[e.stage + 1];
    row_motion(st, local, e.stage, e.row, &delta, &rate);
    const contact_state *contact = st->contacts + e.row;
    tangent law = law_tangent(st, &st->system.contacts[e.row].law, contact->branch, delta, rate,
                              contact->memory);
    for (int k = 0; k < 2 * n; k++) {
        const influence *by = between_rows(st, local, e.row, st->work.unknown[k / 2]);
        row[k] += law.by_delta * by->depth[e.stage][k % 2 + 1] +
                  law.by_rate * by->rate[e.stage][k % 2 + 1];
    }
    return f - law.force;
}

/* What forces of n unknown rows add to the coordinates of a step, for its equations. */
static void gather_depths(aom_stepper *st, const influence *local, int n) {
    int m = st->system.n_stretch, first = first_stretch(&st->system), size = 2 * n;
    for (int i = 0; i < m; i++)
        for (int j = 0; j < size; j++) {
            const influence *by = between_rows(st, local, first + i, st->work.unknown[j / 2]);
            for (int stage = 0; stage < 2; stage++)
                st->work.depths[(stage * m + i) * size + j] = by->depth[stage][j % 2 + 1];
        }
}

/* The equations of stretching at a stage, the last of n unknown rows: residuals and matrix. */
static void stretch_equations(aom_stepper *st, const influence *local, int n, int stage, double *A,
                              double *rest) {
    workspace *w = &st->work;
    int m = st->system.n_stretch, first = first_stretch(&st->system), size = 2 * n;
    for (int k = 0; k < m; k++) {
        double rate;
        row_motion(st, local, stage, first + k, w->coordinates + k, &rate);
    }
    stretch_forces(st);
    for (int k = 0; k < m; k++) {
        int at = 2 * (n - m + k) + stage;
        double *row = A + (ptrdiff_t)at * size;
        rest[at] = w->force[first + k].f[stage + 1] - w->polynomial[k];
        for (int i = 0; i < m; i++) {
            const double *depth = w->depths + (ptrdiff_t)(stage * m + i) * size;
            double slope = w->slopes[k * m + i];
            for (int j = 0; j < size; j++)
                row[j] += slope * depth[j];
        }
    }
}

/* Residuals and matrix of all equations, into the workspace; the largest residual. */
static double equations(aom_stepper *st, const influence *local, int n) {
    double *A = st->work.matrix, *rest = st->work.rest, most = 0.0;
    int size = 2 * n;
    memset(A, 0, (size_t)size * (size_t)size * sizeof *A);
    for (int k = 0; k < size; k++)
        A[k * (size + 1)] = 1.0;
    for (int stage = 0; stage < 2; stage++) {
        for (int k = 0; k < n - st->system.n_stretch; k++) {
            equation e = {st->work.unknown[k], stage};
            int at = 2 * k + stage;
            rest[at] = contact_equation(st, local, n, e, A + at * size);
        }
        stretch_equations(st, local, n, stage, A, rest);
    }
    for (int k = 0; k < size; k++)
        most = larger(most, fabs(rest[k]));
    return most;
}

/* Forces of n unknown rows from those before and a share of the correction. */
static void correct(aom_stepper *st, int n, double length) {
    for (int k = 0; k < 2 * n; k++) {
        int i = st->work.unknown[k / 2], node = k % 2 + 1;
        st->work.force[i].f[node] = st->work.before[i].f[node] - length * st->work.correction[k];
    }
    add_up(st);
}

/* One step of Newton's method, shortened if need be; its correction over the forces, else NaN. */
static double newton_step(aom_stepper *st, const influence *local, int n) {
    workspace *w = &st->work;
    double far = 0.0, size = 1e-3 * st->now.force_scale, worst = equations(st, local, n);
    if (!eliminate(w->matrix, w->rest, 2 * n))
        return NAN;
    memcpy(w->correction, w->rest, 2 * (size_t)n * sizeof *w->rest);
    memcpy(w->before, w->force, (size_t)st->system.n_rows * sizeof *w->force);
    for (int k = 0; k < 2 * n; k++) {
        far = larger(far, fabs(w->correction[k]));
        size = larger(size, fabs(w->force[w->unknown[k / 2]].f[k % 2 + 1]));
    }
    for (double length = 1.0; length > 1e-3; length *= 0.5) {
        correct(st, n, length);
        if (far <= ACCURATE * size || equations(st, local, n) < worst)
            break;
    }
    return size > 0.0 ? far / size : 0.0;
}

/* Friction of all contacts at both stages; by how much its forces changed, over the largest. */
static double all_friction(aom_stepper *st, const influence *local) {
    double change = 0.0, most = 1e-3 * st->now.force_scale;
    for (int c = 0; c < st->system.n_contacts; c++)
        for (int stage = 0; stage < 2 && st->system.contacts[c].n_tangential > 0; stage++)
            if (pressing(st->contacts[c].branch)) {
                change = larger(change, friction_force(st, local, stage, c));
                most = larger(most, fabs(st->work.force[c].f[stage + 1]));
            }
    return most > 0.0 ? change / most : 0.0;
}

bool stretched_forces(aom_stepper *st, int index) {
    const influence *local = st->slots[index].local;
    start_forces(st, local);
    int n = unknown_rows(st);
    gather_depths(st, local, n);
    for (int tries = 0; tries < STRETCH_TRIES; tries++) {
        double far = newton_step(st, local, n), rubbed = all_friction(st, local);
        if (!(far < 1e300) || st->law_failed)
            return false;
        if (far > ACCURATE || rubbed > RESTING)
            continue;
        move_rows(st, index);
        return true;
    }
    return false;
}
