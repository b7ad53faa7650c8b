/* Forces of sheets and walls that stretch: bilateral, quadratic and cubic in the coordinates of the
 * last rows, from a quartic energy. They are rows as those of contacts are: parabolas over the step,
 * which meet the polynomial at h/2 and h. */
#include "internal.h"

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

/* What forces of n unknown rows add to the coordinates of a step, for its equations. */
static void gather_depths(aom_stepper *st, const influence *local, int n) {
    int m = st->system.n_stretch, first = first_stretch(&st->system), size = 2 * n;
    for (int stage = 0; stage < 2; stage++)
        for (int i = 0; i < m; i++)
            for (int j = 0; j < size; j++)
                st->work.depths[(stage * m + i) * size + j] =
                    held_by(st, local, stage, first + i, st->work.unknown[j / 2], j % 2).depth;
}

/* The equations of stretching at a stage, the last of n unknown rows: residuals and matrix. */
static void stretch_equations(aom_stepper *st, const influence *local, int n, int stage, double *A) {
    workspace *w = &st->work;
    int m = st->system.n_stretch, first = first_stretch(&st->system), size = 2 * n;
    for (int k = 0; k < m; k++) {
        double rate;
        row_motion(st, local, stage, first + k, w->coordinates + k, &rate);
    }
    stretch_forces(st);
    for (int k = 0; k < m; k++) {
        int at = 2 * (n - m + k) + stage;
        w->rest[at] = w->force[first + k].f[stage + 1] - w->polynomial[k];
        for (int i = 0; i < m && A != NULL; i++) {
            const double *depth = w->depths + (ptrdiff_t)(stage * m + i) * size;
            double slope = w->slopes[k * m + i], *row = A + (ptrdiff_t)at * size;
            for (int j = 0; j < size; j++)
                row[j] += slope * depth[j];
        }
    }
}
