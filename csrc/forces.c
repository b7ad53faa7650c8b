/* The contact forces of a step, at its middle and its end, that meet the laws and friction. */
#include "internal.h"

#ifndef SWEEPS /* tests try other numbers */
#define SWEEPS 12
#endif
enum { NEWTON = 100 }; /* friction along a soft sheet converges by 0.7 a step */

#define SQUARED 1e-7 /* of the forces: Newton's correction after which none is needed */
#define SETTLED 1e-12 /* of the forces: none that changes them by less follows, as changes go on */

/* Newton's method for the two forces of the only contact that touches, without friction. */
bool one_force(aom_stepper *st, double h, const influence *local, int c) {
    const contact_state *contact = st->contacts + c;
    const aom_law *law = &st->system.contacts[c].law;
    const row_state *row = st->rows + c;
    const stages *base = st->work.base + c;
    int branch = contact->branch;
    bool presses = pressing(branch), close = !presses;
    double f0 = row->force, f1 = 0.0, f2 = 0.0;
    const double *a1 = local->depth[0], *a2 = local->depth[1];
    const double *b1 = local->rate[0], *b2 = local->rate[1];
    double d1 = base->depth[0] - a1[0] * f0, v1 = base->rate[0] - b1[0] * f0;
    double d2 = base->depth[1] - a2[0] * f0, v2 = base->rate[1] - b2[0] * f0;
    if (presses) { /* a first guess on the last parabola */
        f1 = f0 + 0.5 * h * (row->slope + 0.25 * h * row->bend);
        f2 = f0 + h * (row->slope + 0.5 * h * row->bend);
    }
    for (int tries = 0; tries < SWEEPS; tries++) {
        double x1 = d1 - a1[1] * f1 - a1[2] * f2, y1 = v1 - b1[1] * f1 - b1[2] * f2;
        double x2 = d2 - a2[1] * f1 - a2[2] * f2, y2 = v2 - b2[1] * f1 - b2[2] * f2;
        if (close) {
            st->work.force[c] = *st->work.sum = (nodes){{f0, f1, f2}};
            st->work.motion[c] = (stages){{x1, x2}, {y1, y2}};
            return true;
        }
        tangent one = law_tangent(st, law, branch, x1, y1, contact->memory);
        tangent two = law_tangent(st, law, branch, x2, y2, contact->memory);
        double j11 = 1.0 + one.by_delta * a1[1] + one.by_rate * b1[1];
        double j12 = one.by_delta * a1[2] + one.by_rate * b1[2];
        double j21 = two.by_delta * a2[1] + two.by_rate * b2[1];
        double j22 = 1.0 + two.by_delta * a2[2] + two.by_rate * b2[2];
        double det = j11 * j22 - j12 * j21;
        st->now.stiffness = two.by_delta;
        if (!(fabs(det) > 1e-300))
            return false;
        double r1 = f1 - one.force, r2 = f2 - two.force;
        double e1 = (r1 * j22 - r2 * j12) / det, e2 = (r2 * j11 - r1 * j21) / det;
        double size = larger(1e-3 * st->now.force_scale, larger(fabs(f1), fabs(f2)));
        double far = larger(fabs(e1), fabs(e2));
        close = far <= SQUARED * size; /* what the correction leaves is its square */
        if (tries > 2 && !close)
            close = far <= 1e-15 * larger(one.by_delta * fabs(d1) / larger(j11, 1.0),
                                          two.by_delta * fabs(d2) / larger(j22, 1.0));
        f1 -= e1;
        f2 -= e2;
        if (!(fabs(f1) + fabs(f2) < 1e300))
            return false;
    }
    return false;
}

/* The two forces of a long step of one contact: at the end force and slope are those of the law, which
 * damps vibrations that the step does not resolve; what the law gives beyond the force at h/2 into
 * `lacking`. */
bool long_force(aom_stepper *st, double h, const influence *local) {
    const contact_state *contact = st->contacts;
    const aom_law *law = &st->system.contacts[0].law;
    const row_state *row = st->rows;
    const stages *base = st->work.base;
    const double *a1 = local->depth[0], *a2 = local->depth[1];
    const double *b1 = local->rate[0], *b2 = local->rate[1];
    double f0 = row->force, f1 = f0 + 0.5 * h * (row->slope + 0.25 * h * row->bend);
    double f2 = f0 + h * (row->slope + 0.5 * h * row->bend);
    for (int tries = 0; tries < 4 * SWEEPS; tries++) {
        double x = base->depth[1] - a2[0] * f0 - a2[1] * f1 - a2[2] * f2;
        double y = base->rate[1] - b2[0] * f0 - b2[1] * f1 - b2[2] * f2;
        tangent end = law_tangent(st, law, contact->branch, x, y, contact->memory);
        double k = st->now.stiffness = end.by_delta, r1 = f0 - 4.0 * f1 + 3.0 * f2 - h * k * y, r2 = f2 - end.force;
        double j11 = h * k * b2[1] - 4.0, j12 = 3.0 + h * k * b2[2];
        double j21 = k * a2[1], j22 = 1.0 + k * a2[2], det = j11 * j22 - j12 * j21;
        if (!(fabs(det) > 1e-300))
            return false;
        double e1 = (r1 * j22 - r2 * j12) / det, e2 = (r2 * j11 - r1 * j21) / det;
        f1 -= e1;
        f2 -= e2;
        if (!(fabs(f1) + fabs(f2) < 1e300))
            return false;
        if (larger(fabs(e1), fabs(e2)) > SQUARED * st->now.force_scale)
            continue;
        motion at[2] = {{base->depth[0] - a1[0] * f0 - a1[1] * f1 - a1[2] * f2,
                         base->rate[0] - b1[0] * f0 - b1[1] * f1 - b1[2] * f2},
                        {base->depth[1] - a2[0] * f0 - a2[1] * f1 - a2[2] * f2,
                         base->rate[1] - b2[0] * f0 - b2[1] * f1 - b2[2] * f2}};
        *st->work.force = (nodes){{f0, f1, f2}};
        *st->work.motion = (stages){{at[0].depth, at[1].depth}, {at[0].rate, at[1].rate}};
        st->now.lacking = fabs(f1 - law_tangent(st, law, contact->branch, at[0].depth, at[0].rate,
                                                contact->memory).force);
        return true;
    }
    return false;
}

/* What the forces at `count` nodes of all rows take from the indentation and rate of row i at a stage:
 * those of the groups, and what its own coupling is beyond its group's. */
static inline void subtract_coupled(const aom_stepper *st, const influence *local, int stage,
                                    int i, int first, int count, double *delta, double *rate) {
    int g = st->group[i], at = st->work.place[g];
    const influence *by = local + st->system.n_rows + (ptrdiff_t)at * st->n_touching;
    const nodes *sum = st->work.sum;
    double d[2] = {0.0, 0.0}, v[2] = {0.0, 0.0};
    for (int h = 0; h < st->n_touching; h++) {
        const double *depth = by[h].depth[stage] + first, *pace = by[h].rate[stage] + first;
        for (int k = 0; k < count; k++) {
            d[k] += depth[k] * sum[h].f[first + k];
            v[k] += pace[k] * sum[h].f[first + k];
        }
    }
    for (int node = first, k = 0; k < count; node++, k++) {
        double own = st->work.force[i].f[node];
        if (!alone(st, g)) {
            d[k] += (local[i].depth[stage][node] - by[at].depth[stage][node]) * own;
            v[k] += (local[i].rate[stage][node] - by[at].rate[stage][node]) * own;
        }
        *delta -= d[k];
        *rate -= v[k];
    }
}

/* The sum of the forces of the group of a row. */
static nodes *sum_of(const aom_stepper *st, int i) {
    return st->work.sum + st->work.place[st->group[i]];
}

/* Sums of the forces of each group that touches. */
static void add_up(aom_stepper *st) {
    memset(st->work.sum, 0, (size_t)st->n_touching * sizeof *st->work.sum);
    for (int n = 0; n < st->n_closed; n++)
        for (int i = st->work.closed[n], node = 0; node < 3; node++)
            sum_of(st, i)->f[node] += st->work.force[i].f[node];
}

/* Take from the free motion of the step what the forces at its start hold back, of closed rows. */
static void start_forces(aom_stepper *st, const influence *local) {
    add_up(st);
    for (int c = 0; c < st->system.n_contacts; c++)
        for (int node = 1; node < 3; node++)
            memcpy(st->contacts[c].anchor[node], st->contacts[c].anchor[0], sizeof(double[2]));
    for (int n = 0; n < st->n_closed; n++)
        for (int i = st->work.closed[n], stage = 0; stage < 2; stage++)
            subtract_coupled(st, local, stage, i, 0, 1, st->work.base[i].depth + stage,
                             st->work.base[i].rate + stage);
}

/* Change the force of a row at a stage. */
static void set_force(aom_stepper *st, int stage, int i, double value) {
    int g = st->group[i], node = stage + 1;
    double *f = st->work.force[i].f + node, *sum = sum_of(st, i)->f + node;
    *sum = alone(st, g) ? value : *sum + (value - *f);
    *f = value;
}

/* Indentation and rate of row i at a stage under the forces of the attempt. */
static void row_motion(const aom_stepper *st, const influence *local, int stage, int i, double *delta,
                 double *rate) {
    *delta = st->work.base[i].depth[stage];
    *rate = st->work.base[i].rate[stage];
    subtract_coupled(st, local, stage, i, 1, 2, delta, rate);
}

/* Take from the motion of an open row at a stage that of what has no mass, of groups that touch. */
static void subtract_massless(const aom_stepper *st, int i, int stage, double h, double *depth,
                              double *rate) {
    const double *compliance = st->system.residual + (ptrdiff_t)i * st->system.n_rows;
    for (int n = 0; n < st->n_touching; n++) {
        int g = st->work.touching[n], other = (st->first[g] == i ? st->second : st->first)[g];
        const double *f = st->work.sum[n].f, r = compliance[other];
        double change = stage == 0 ? f[2] - f[0] : f[0] - 4.0 * f[1] + 3.0 * f[2];
        *depth -= r * f[stage + 1];
        *rate -= r * change / h;
    }
}

/* Indentations and rates of the closed rows under the forces of the attempt, at h/2 and h. */
void move_rows(aom_stepper *st, int index) {
    for (int n = 0; n < st->n_closed; n++) {
        int i = st->work.closed[n];
        stages *to = st->work.motion + i;
        for (int stage = 0; stage < 2; stage++)
            row_motion(st, st->slots[index].local, stage, i, to->depth + stage, to->rate + stage);
    }
}

/* The same of the other rows, by the modes; of one row alone if it is given, else -1. */
void move_open(aom_stepper *st, int index, double h, int only) {
    if (only < 0 ? st->n_closed == st->system.n_rows : is_closed(st, only))
        return;

    parabolas(st, h);
    for (int stage = 0; stage < 2; stage++)
        force_ahead(st, index, stage);
    for (int i = 0; i < st->system.n_rows; i++) {
        stages *to = st->work.motion + i;
        if (is_closed(st, i) || (only >= 0 && i != only))
            continue;
        seen_ahead(st, i, h, to);
        for (int stage = 0; stage < 2 && st->softens[i]; stage++)
            subtract_massless(st, i, stage, h, to->depth + stage, to->rate + stage);
    }
}

/* T (2) of C T = b; C: compliance[3] = C11, C22, C12. */
static void stuck(const double compliance[3], const double b[2], double T[2]) {
    double all = compliance[0] * compliance[1];
    double det = larger(all - compliance[2] * compliance[2], 1e-12 * all);
    T[0] = (compliance[1] * b[0] - compliance[2] * b[1]) / det;
    T[1] = (compliance[0] * b[1] - compliance[2] * b[0]) / det;
}

/* T (2) of (C + x) T = b with that x for which |T| is `most`. */
static void sliding(const double compliance[3], const double b[2], double most, double T[2]) {
    double x = 0.0, least = -0.9 * smaller(compliance[0], compliance[1]), size = 0.0;
    for (int tries = 0; tries < 50 && most > 0.0; tries++) {
        const double with[3] = {compliance[0] + x, compliance[1] + x, compliance[2]};
        stuck(with, b, T);
        size = sqrt(T[0] * T[0] + T[1] * T[1]);
        if (!(fabs(size - most) > most * 1e-14))
            break;
        double by_x[2]; /* -T' */
        stuck(with, T, by_x);
        double steep = T[0] * by_x[0] + T[1] * by_x[1];
        x = larger(x + (size - most) / most * size * size / steep, least);
    }
    for (int r = 0; r < 2; r++)
        T[r] = size > 0.0 ? T[r] * most / size : 0.0;
}

/* Where the springs of a contact that slips in two directions would hang at a stage without sliding in
 * the last part of the step. Collocation at h/2 and h, as of ready_local: order 2, 0 at infinity. */
static double slider_base(const contact_state *contact, int stage, int r) {
    double a0 = contact->anchor[0][r], a1 = contact->anchor[1][r], a2 = contact->anchor[2][r];
    return stage == 0 ? a0 - 0.25 * (a0 - 4.0 * a1 + 3.0 * a2) : (4.0 * a1 - a0) / 3.0;
}

/* Friction of one contact by a spring that hangs at a slider; by how much its forces changed. */
static double friction_force(aom_stepper *st, const influence *local, int stage, int c) {
    const aom_contact *contact = st->system.contacts + c;
    contact_state *state = st->contacts + c;
    nodes *force = st->work.force;
    int first = contact->first_tangential, count = contact->n_tangential, node = stage + 1;
    double soft = 1.0 / contact->tangential_stiffness, change = 0.0, rate;
    double most = contact->friction * larger(force[c].f[node], 0.0);
    double way[2] = {0.0, 0.0}, old[2] = {0.0, 0.0}, new[2] = {0.0, 0.0};
    double coupling[3] = {0.0, 0.0, 0.0};
    for (int r = 0; r < count; r++) {
        row_motion(st, local, stage, first + r, way + r, &rate);
        old[r] = force[first + r].f[node];
        coupling[r] = own_influence(st, local, first + r)->depth[stage][node];
    }
    if (count == 2)
        coupling[2] = local[pair_of(st, st->group[first], st->group[first + 1])].depth[stage][node];
    for (int r = 0; r < count; r++) /* without these forces */
        way[r] += coupling[r] * old[r] + coupling[2] * old[1 - r];

    const double compliance[3] = {coupling[0] + soft, coupling[1] + soft, coupling[2]};
    double stretch[2] = {0.0, 0.0};
    for (int r = 0; r < count; r++)
        stretch[r] = way[r] - (state->slips ? slider_base(state, stage, r) : state->anchor[0][r]);
    if (!state->slips)
        stuck(compliance, stretch, new);
    else if (count == 2)
        sliding(compliance, stretch, most, new);
    else
        new[0] = state->direction[0] * most;

    for (int r = 0; r < count; r++) {
        set_force(st, stage, first + r, new[r]);
        state->anchor[node][r] = state->anchor[0][r];
        if (state->slips)
            state->anchor[node][r] = way[r] - compliance[r] * new[r] - coupling[2] * new[1 - r];
        change = larger(change, fabs(new[r] - old[r]));
    }
    return change;
}

static void swap(double *a, double *b) {
    double kept = *a;
    *a = *b;
    *b = kept;
}

/* Solve A x = b in place by elimination with pivots; x into b. */
bool eliminate(double *A, double *b, int n) {
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(A[i * n + k]) > fabs(A[best * n + k]))
                best = i;
        if (!(fabs(A[best * n + k]) > 1e-300))
            return false;
        if (best != k) {
            for (int j = 0; j < n; j++)
                swap(A + k * n + j, A + best * n + j);
            swap(b + k, b + best);
        }
        for (int i = k + 1; i < n; i++) {
            double f = A[i * n + k] / A[k * n + k];
            if (f == 0.0)
                continue;
            for (int j = k; j < n; j++)
                A[i * n + j] -= f * A[k * n + j];
            b[i] -= f * b[k];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++)
            b[i] -= A[i * n + j] * b[j];
        b[i] /= A[i * n + i];
    }
    return true;
}

/* Slopes and residuals of the laws of n pressing contacts; sums of the squares of the residuals and
 * of the normal forces. */
static void residuals(aom_stepper *st, const influence *local, int n, double *norm, double *size) {
    *norm = *size = 0.0;
    for (int i = 0; i < n; i++)
        for (int stage = 0; stage < 2; stage++) {
            int c = st->work.active[i];
            newton_row *row = st->work.newton + i;
            double delta, rate, f = st->work.force[c].f[stage + 1];
            row_motion(st, local, stage, c, &delta, &rate);
            tangent law = law_tangent(st, &st->system.contacts[c].law, st->contacts[c].branch,
                                      delta, rate, st->contacts[c].memory);
            row->rest[stage] = f - law.force;
            row->by_delta[stage] = law.by_delta;
            row->by_rate[stage] = law.by_rate;
            *norm += row->rest[stage] * row->rest[stage];
            *size += f * f;
        }
}

/* Slope of a law's force at a stage by the force at a node behind an influence. */
static double slope_by(const newton_row *row, const influence *by, int stage, int node) {
    return row->by_delta[stage] * by->depth[stage][node] +
           row->by_rate[stage] * by->rate[stage][node];
}

/* The inverse of what a contact's matrix is beyond its group's coupling. */
static bool invert_own(const aom_stepper *st, const influence *local, int c, newton_row *row) {
    int g = st->group[c];
    double B[2][2] = {{1.0, 0.0}, {0.0, 1.0}};
    for (int s = 0; s < 2 && !alone(st, g); s++)
        for (int t = 0; t < 2; t++)
            B[s][t] += slope_by(row, local + c, s, t + 1) -
                       slope_by(row, local + pair_of(st, g, g), s, t + 1);
    double det = B[0][0] * B[1][1] - B[0][1] * B[1][0];
    row->inverse[0][0] = B[1][1] / det;
    row->inverse[0][1] = -B[0][1] / det;
    row->inverse[1][0] = -B[1][0] / det;
    row->inverse[1][1] = B[0][0] / det;
    return fabs(det) > 1e-300;
}

/* Row k of a contact: its normal force, then those of its friction. */
static int row_of_contact(const aom_contact *contact, int c, int k) {
    return k == 0 ? c : contact->first_tangential + k - 1;
}

/* What the forces of a contact's rows are to its normal one while this changes: of friction that
 * sticks nothing. */
static void find_shares(const aom_stepper *st, int c, newton_row *row) {
    const aom_contact *contact = st->system.contacts + c;
    for (int s = 0; s < 2; s++)
        for (int k = 0; k <= contact->n_tangential; k++) {
            double normal = st->work.force[c].f[s + 1];
            double f = st->work.force[row_of_contact(contact, c, k)].f[s + 1];
            bool follows = st->contacts[c].slips && normal > 0.0;
            row->share[k][s] = k == 0 ? 1.0 : follows ? f / normal : 0.0;
        }
}

/* The corrections of Newton's method for all normal forces of both stages. The matrix is that of
 * each contact by itself and one of the rank of the groups, so that the sums of the corrections over
 * the groups are found first (Woodbury). */
static bool corrections(aom_stepper *st, const influence *local, int n) {
    int size = 2 * st->n_touching;
    double *A = st->work.matrix, *E = st->work.rest;
    memset(A, 0, (size_t)size * (size_t)size * sizeof *A);
    memset(E, 0, (size_t)size * sizeof *E);
    for (int k = 0; k < size; k++)
        A[(ptrdiff_t)k * (size + 1)] = 1.0;
    for (int i = 0; i < n; i++) {
        newton_row *row = st->work.newton + i;
        int c = st->work.active[i];
        const aom_contact *contact = st->system.contacts + c;
        find_shares(st, c, row);
        if (!invert_own(st, local, c, row))
            return false;
        for (int k = 0; k <= contact->n_tangential; k++) {
            int at = 2 * st->work.place[st->group[row_of_contact(contact, c, k)]];
            for (int s = 0; s < 2; s++) {
                const double *inverse = row->inverse[s], share = row->share[k][s];
                E[at + s] += share * (inverse[0] * row->rest[0] + inverse[1] * row->rest[1]);
                for (int h = 0; h < st->n_touching && share != 0.0; h++) {
                    const influence *by = local + pair_of(st, st->group[c], st->work.touching[h]);
                    for (int t = 0; t < 2; t++)
                        A[(ptrdiff_t)(at + s) * size + 2 * h + t] +=
                            share * (inverse[0] * slope_by(row, by, 0, t + 1) +
                                     inverse[1] * slope_by(row, by, 1, t + 1));
                }
            }
        }
    }
    if (!eliminate(A, E, size))
        return false;
    for (int i = 0; i < n; i++) {
        newton_row *row = st->work.newton + i;
        double left[2] = {row->rest[0], row->rest[1]};
        int g = st->group[st->work.active[i]];
        for (int h = 0; h < st->n_touching; h++) {
            const influence *by = local + pair_of(st, g, st->work.touching[h]);
            for (int t = 0; t < 2; t++)
                for (int s = 0; s < 2; s++)
                    left[s] -= slope_by(row, by, s, t + 1) * E[2 * h + t];
        }
        for (int s = 0; s < 2; s++)
            row->step[s] = row->inverse[s][0] * left[0] + row->inverse[s][1] * left[1];
    }
    return true;
}

/* One step of Newton's method for all normal forces of both stages, shortened if need be; `far`: the
 * largest correction that it wants. */
static bool together(aom_stepper *st, const influence *local, double *far) {
    int m = st->system.n_rows, n = 0;
    nodes *force = st->work.force, *before = st->work.before;
    double best, size, norm, length = 1.0;
    *far = 0.0;
    for (int k = 0; k < st->n_closed; k++)
        if (presses(st, st->work.closed[k]))
            st->work.active[n++] = st->work.closed[k];
    memcpy(before, force, (size_t)m * sizeof *force);
    residuals(st, local, n, &best, &size);
    if (best <= 1e-28 * size)
        return true;
    if (!corrections(st, local, n))
        return false;
    for (int i = 0; i < n; i++)
        *far = larger(*far, larger(fabs(st->work.newton[i].step[0]), fabs(st->work.newton[i].step[1])));
    for (int tries = 0; tries < 11; tries++) {
        for (int i = 0; i < n; i++) {
            int c = st->work.active[i];
            const aom_contact *contact = st->system.contacts + c;
            const newton_row *own = st->work.newton + i;
            for (int k = 0; k <= contact->n_tangential; k++)
                for (int s = 0, r = row_of_contact(contact, c, k); s < 2; s++)
                    force[r].f[s + 1] =
                        before[r].f[s + 1] - length * own->share[k][s] * own->step[s];
        }
        add_up(st);
        residuals(st, local, n, &norm, &size);
        if (norm < best)
            return true;
        length *= 0.5;
    }
    memcpy(force, before, (size_t)m * sizeof *force);
    add_up(st);
    return *far * *far <= 1e-20 * size; /* what is left is rounding */
}

/* One sweep over the contacts: of each the friction, and before it (`take`) the force by a step of
 * Newton's method on its own law. The largest change, force and rounding into out. */
static void sweep(aom_stepper *st, const influence *local, bool take, double out[3]) {
    for (int stage = 0; stage < 2; stage++)
        for (int n = 0; n < st->n_closed; n++) {
            int c = st->work.closed[n];
            const aom_contact *contact = st->system.contacts + c;
            double delta, rate, new = st->work.force[c].f[stage + 1], old = new;
            if (!presses(st, c))
                continue;
            if (take) {
                row_motion(st, local, stage, c, &delta, &rate);
                tangent law = law_tangent(st, &contact->law, st->contacts[c].branch, delta, rate,
                                          st->contacts[c].memory);
                const influence *own = own_influence(st, local, c);
                double slope = own->depth[stage][stage + 1] * law.by_delta +
                               own->rate[stage][stage + 1] * law.by_rate;
                double divisor = 1.0 + larger(slope, 0.0);
                double rounding =
                    1e-15 * law.by_delta / divisor * fabs(st->work.base[c].depth[stage]);
                new = old - (old - law.force) / divisor;
                out[2] = larger(out[2], rounding);
                set_force(st, stage, c, new);
            }
            out[0] = larger(out[0], fabs(new - old));
            out[1] = larger(out[1], fabs(new));
            if (contact->n_tangential > 0)
                out[0] = larger(out[0], friction_force(st, local, stage, c));
        }
}

/* Forces of all rows at h/2 and h that meet laws and friction, into work.force, which holds those at 0
 * and first guesses, from the motion work.base without forces: Gauss and Seidel's sweeps; the whole
 * system by Newton's method where they do not converge, or where the rate of what has no mass couples
 * the stages. */
bool all_forces(aom_stepper *st, int index) {
    const influence *local = st->slots[index].local;
    nodes *force = st->work.force;
    double before = 0.0; /* change of the last sweep */
    start_forces(st, local);
    for (int tries = st->rated ? SWEEPS : 0; tries < SWEEPS + NEWTON; tries++) {
        double found[3] = {0.0, 1e-3 * st->now.force_scale, 0.0}, total = 0.0, far = 0.0;
        if (tries == SWEEPS && !st->rated) { /* the sweeps may have led away */
            for (int n = 0, i; n < st->n_closed; n++) {
                i = st->work.closed[n];
                force[i].f[1] = force[i].f[2] = force[i].f[0];
            }
            add_up(st);
            before = 0.0;
        }
        if (tries >= SWEEPS && !together(st, local, &far))
            return false;
        sweep(st, local, tries < SWEEPS, found);
        for (int n = 0; n < st->n_closed; n++) {
            const double *f = force[st->work.closed[n]].f;
            total += fabs(f[1]) + fabs(f[2]);
        }
        if (!(total + found[0] < 1e300) || st->law_failed)
            return false;
        double next = found[0] * smaller(found[0] / before, 1.0);
        before = found[0];
        if (next > SETTLED * found[1] + found[2] || far > SQUARED * found[1])
            continue;
        move_rows(st, index);
        return true;
    }
    return false;
}
