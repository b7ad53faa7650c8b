/* The free and the forced motion of modes after a time, found once for all steps of one length. */
#include "internal.h"

/* (e^z - 1)/z, (e^z - 1 - z)/z^2 and (e^z - 1 - z - z^2/2)/z^3. */
static void phi(double z, double out[3]) {
    if (fabs(z) >= 0.7) {
        out[0] = expm1(z) / z;
        out[1] = (out[0] - 1.0) / z;
        out[2] = (out[1] - 0.5) / z;
        return;
    }
    double term[3] = {1.0, 0.5, 1.0 / 6.0};
    memcpy(out, term, sizeof term);
    for (int k = 1; k < 20; k++)
        for (int n = 0; n < 3; n++) {
            term[n] *= z / (k + n + 1);
            out[n] += term[n];
        }
}

/* The responses after t of `count` modes without damping, in rows that lie n apart, from the sines
 * of omega t/2 in the first row and the cosines in the second. All branches are computed and one is
 * taken, so that the compiler finds several modes at once. */
static void undamped(ptrdiff_t count, ptrdiff_t n, const double *restrict omega, double t,
                     double *restrict out) {
    double *restrict to_P = out, *restrict to_W = out + n, *restrict to_S = out + 2 * n;
    double *restrict to_J0 = out + 3 * n, *restrict to_J1 = out + 4 * n;
    double *restrict to_J2 = out + 5 * n, square = t * t;
    for (ptrdiff_t j = 0; j < count; j++) {
        double z = omega[j] * t, sine = to_P[j], cosine = to_W[j];
        double share = sine / (z > 0.0 ? z : 1.0), ratio = z > 0.0 ? share : 0.5;
        double large = z > 1.0 ? z : 1.0, over = 1.0 / (large * large), x = z < 1.0 ? z * z : 1.0;
        double S = 2.0 * ratio * cosine, J0 = 2.0 * ratio * ratio, P = 1.0 - 2.0 * sine * sine;
        double J1 = 1 - x * (1 / 110.) * (1 - x * (1 / 156.));
        double J2 = 1 - x * (1 / 132.) * (1 - x * (1 / 182.));
        J1 = (1 - x * (1 / 20.) * (1 - x * (1 / 42.) * (1 - x * (1 / 72.) * J1))) * (1 / 6.);
        J2 = (1 - x * (1 / 30.) * (1 - x * (1 / 56.) * (1 - x * (1 / 90.) * J2))) * (1 / 24.);
        double far1 = (1.0 - S) * over, far2 = (0.5 - J0) * over;
        to_P[j] = to_W[j] = P;
        to_S[j] = S * t;
        to_J0[j] = J0 * square;
        to_J1[j] = (z < 1.0 ? J1 : far1) * square * t;
        to_J2[j] = (z < 1.0 ? J2 : far2) * square * square;
    }
}

/* Partial fractions of an over-damped mode: J_k = (phi_k+1(slow) - phi_k+1(fast))/(2 g). */
static void split(double e, double g, double x, double J[3]) {
    double slow[3], fast[3];
    phi(-x / (e + g), slow);
    phi(-(e + g), fast);
    for (int k = 0; k < 3; k++)
        J[k] = (slow[k] - fast[k]) / (2.0 * g);
}

/* J0, J1, J2 over t^2, t^3, t^4 for small phases: power series of S, from the differential
 * equation. */
static void series(double e, double x, double J[3]) {
    double a = 0.0, b = 1.0;
    J[0] = 0.5;
    J[1] = 1.0 / 6.0;
    J[2] = 1.0 / 24.0;
    for (int k = 0; k < 20; k++) {
        double next = -(2.0 * e * (k + 1) * b + x * a) / ((k + 1) * (k + 2));
        a = b;
        b = next;
        J[0] += b / (k + 3);
        J[1] += b / ((k + 3) * (k + 4));
        J[2] += b / ((k + 3) * (k + 4) * (k + 5));
    }
}

static void damped(double z, double e, double t, double out[6]) {
    double x = z * z, gap = (e - z) * (e + z), g = sqrt(fabs(gap)), S, C, J[3];
    if (gap > 0.0) { /* over-damped: the slow root is -x/(e + g), no difference of large numbers */
        double slow = exp(-x / (e + g)), fast = expm1(-2.0 * g);
        S = g < 1e-6 ? exp(-e) : -slow * fast / (2.0 * g);
        C = slow * (1.0 + 0.5 * fast);
    } else {
        double fade = exp(-e);
        S = g < 1e-6 ? fade : fade * sin(g) / g;
        C = fade * cos(g);
    }
    double P = C + e * S, W = C - e * S;
    if (z < 1.0 && e < 0.5)
        series(e, x, J);
    else if (gap > 0.25 * e * e)
        split(e, g, x, J);
    else {
        J[0] = (1.0 - P) / x;
        J[1] = (1.0 - S - 2.0 * e * J[0]) / x;
        J[2] = (0.5 - J[0] - 2.0 * e * J[1]) / x;
    }
    double square = t * t;
    out[0] = P;
    out[1] = W;
    out[2] = S * t;
    out[3] = J[0] * square;
    out[4] = J[1] * square * t;
    out[5] = J[2] * square * square;
}

/* The responses of the damped modes among n. */
static void damped_ones(ptrdiff_t n, const double *omega, const double *decay, const double *t,
                        int t_stride, double *out) {
    for (ptrdiff_t j = 0; j < n; j++) {
        double each[6], after = t[j * t_stride];
        if (!(decay[j] > 0.0))
            continue;
        damped(omega[j] * after, decay[j] * after, after, each);
        for (int k = 0; k < 6; k++)
            out[k * n + j] = each[k];
    }
}

void aom_responses(int64_t modes, const double *omega, const double *decay, const double *t,
                   int t_stride, double *out) {
    ptrdiff_t n = (ptrdiff_t)modes;
    for (ptrdiff_t j = 0; j < n; j++) {
        double half = 0.5 * omega[j] * t[j * t_stride];
        out[j] = sin(half);
        out[n + j] = cos(half);
    }
    if (t_stride == 0)
        undamped(n, n, omega, *t, out);
    for (ptrdiff_t j = 0; j < n && t_stride != 0; j++)
        undamped(1, n, omega + j, t[j * t_stride], out + j);
    damped_ones(n, omega, decay, t, t_stride, out);
}

/* The responses after t and after t/2, which share their sines. */
static void responses_twice(int n, const double *omega, const double *decay, double t,
                            double *whole, double *half) {
    double before = 0.5 * t;
    for (int j = 0; j < n; j++) {
        double quarter = 0.25 * omega[j] * t, sine = sin(quarter), cosine = cos(quarter);
        half[j] = sine;
        half[n + j] = cosine;
        whole[j] = 2.0 * sine * cosine;
        whole[n + j] = 1.0 - 2.0 * sine * sine;
    }
    undamped(n, n, omega, before, half);
    undamped(n, n, omega, t, whole);
    damped_ones(n, omega, decay, &before, 0, half);
    damped_ones(n, omega, decay, &t, 0, whole);
}

/* ---- slots */

/* The rows of a slot that give indentation and rate from (q, v), from its responses. */
static void fill_rows(aom_stepper *st, slot *s, double t) {
    int J = st->system.n_modes;
    const double *omega = st->system.omega;
    const double *P = s->response, *W = P + J, *S = W + J;
    for (int i = 0; i < st->system.n_rows; i++) {
        const double *beta = beta_row(st, i);
        for (int part = 0; part < 2; part++)
            for (int j = st->spans[i].begin[part] & ~1; j < st->spans[i].end[part]; j += 2) {
                double *at = row_of(st, s, i, j);
                for (int k = 0; k < 2; k++) {
                    bool there = j + k < J; /* beyond the span beta is 0 */
                    double b = there ? beta[j + k] : 0.0, w = there ? omega[j + k] : 0.0;
                    double by_v = there ? b * S[j + k] : 0.0;
                    at[k] = there ? b * P[j + k] : 0.0;
                    at[2 + k] = by_v;
                    at[4 + k] = -w * w * by_v;
                    at[6 + k] = there ? b * W[j + k] : 0.0;
                }
            }
    }
    if (st->system.gamma != NULL)
        add_rates(st, s);
    s->span = t;
    s->has_rows = true;
    for (int g = 0; g < st->n_groups; g++) {
        s->has_coupling[g] = false;
        s->local_kind[g] = NO_LOCAL;
        if (s > st->slots)
            s[-1].local_kind[g] = NO_LOCAL; /* of the step whose half this is */
    }
}

/* See to it that a slot holds the responses after t. */
void ready_rows(aom_stepper *st, int index, double t) {
    slot *s = st->slots + index;
    if (s->span == t && s->has_rows)
        return;
    if (s->span != t)
        aom_responses(st->system.n_modes, st->system.omega, st->system.decay, &t, 0, s->response);
    fill_rows(st, s, t);
}

/* See to it that a slot holds the responses after h, and the next one those after h/2.
 *
 * They are found together for a step that is used once; those of the levels each by itself, so that
 * a run does not depend on which of them earlier runs left. */
void ready_step(aom_stepper *st, int index, double h) {
    slot *whole = st->slots + index, *half = whole + 1;
    if (index < LEVELS || whole->span == h || half->span == 0.5 * h) {
        ready_rows(st, index, h);
        ready_rows(st, index + 1, 0.5 * h);
        return;
    }
    responses_twice(st->system.n_modes, st->system.omega, st->system.decay, h, whole->response,
                    half->response);
    fill_rows(st, whole, h);
    fill_rows(st, half, 0.5 * h);
}

/* ---- groups of rows */

/* Whether rows i and k are of one group: where they differ, no other row is moved, nor both. */
static bool same_group(const aom_system *s, int i, int k) {
    int J = s->n_modes, m = s->n_rows;
    ptrdiff_t one = (ptrdiff_t)i * J, other = (ptrdiff_t)k * J;
    for (int j = 0; j < J; j++) {
        if (s->beta[one + j] == s->beta[other + j] &&
            (s->gamma == NULL || s->gamma[one + j] == s->gamma[other + j]))
            continue;
        if (moves_mode(s, i, j) && moves_mode(s, k, j))
            return false;
        for (int x = 0; x < m; x++)
            if (x != i && x != k && moves_mode(s, x, j))
                return false;
    }
    for (int x = 0; x < m; x++)
        if (x != i && x != k &&
            s->residual[(ptrdiff_t)i * m + x] != s->residual[(ptrdiff_t)k * m + x])
            return false;
    return true;
}

int count_groups(const aom_system *system) {
    int found = 0;
    for (int i = 0; i < system->n_rows; i++) {
        int k = 0;
        while (k < i && !same_group(system, i, k))
            k++;
        found += k == i;
    }
    return found;
}

/* The group of every row, and two rows of each. */
void find_groups(aom_stepper *st) {
    int found = 0;
    for (int i = 0; i < st->system.n_rows; i++) {
        int g = 0;
        while (g < found && !same_group(&st->system, i, st->first[g]))
            g++;
        st->group[i] = g;
        if (g == found)
            st->first[g] = st->second[found++] = i;
        else if (st->second[g] == st->first[g])
            st->second[g] = i;
    }
}

/* The modes that each row moves: from the first to the last that is not 0, less the longest gap. */
void find_spans(aom_stepper *st) {
    for (int i = 0; i < st->system.n_rows; i++) {
        int first = -1, end = 0, cut = 0, resume = 0;
        for (int j = 0; j < st->system.n_modes; j++) {
            if (!moves_mode(&st->system, i, j))
                continue;
            if (first < 0)
                first = j;
            else if (j - end > resume - cut) {
                cut = end;
                resume = j;
            }
            end = j + 1;
        }
        if (resume == cut) /* no gap */
            cut = resume = end;
        st->spans[i] = (row_span){{first < 0 ? 0 : first, resume}, {cut, end}};
    }
}

/* The groups of contacts that touch, and of stretching. */
void find_touching(aom_stepper *st) {
    const aom_system *system = &st->system;
    bool *touches = st->work.touches;
    int first = system->n_rows - system->n_stretch;
    memset(touches, 0, (size_t)st->n_groups * sizeof *touches);
    for (int i = 0; i < system->n_rows; i++)
        if (i >= first || st->contacts[st->owner[i]].branch != AOM_APART)
            touches[st->group[i]] = true;

    st->n_touching = 0;
    for (int g = 0; g < st->n_groups; g++)
        if (touches[g])
            st->work.touching[st->n_touching++] = g;
}

/* beta S beta^T, beta J0 beta^T, beta J1 beta^T, beta J2 beta^T of two rows into a pair. */
static void couple_rows(aom_stepper *st, slot *s, ptrdiff_t pair, int a, int b) {
    double total[4] = {0.0, 0.0, 0.0, 0.0};
    couple(st, s->response, st->spans + a, row_vector(st, a), row_vector(st, b), total);
    for (int k = 0; k < 4; k++)
        s->coupling[k * n_pairs(st) + pair] = total[k];
}

/* See to it that a slot holds the coupling of a group with itself, its rows, and all groups that it
 * holds already. */
static void ready_coupling(aom_stepper *st, slot *s, int h) {
    ptrdiff_t pairs = n_pairs(st), own = pair_of(st, h, h);
    if (s->has_coupling[h])
        return;
    s->has_coupling[h] = true;
    for (int i = 0; i < st->system.n_rows; i++)
        if (st->group[i] == h)
            couple_rows(st, s, i, i, i);
    couple_rows(st, s, own, st->first[h], st->second[h]);

    for (int g = 0; g < st->n_groups; g++) {
        ptrdiff_t pair = pair_of(st, g, h), mirrored = pair_of(st, h, g);
        if (g == h || !s->has_coupling[g])
            continue;
        couple_rows(st, s, pair, st->first[g], st->first[h]);
        for (int k = 0; k < 4; k++)
            s->coupling[k * pairs + mirrored] = s->coupling[k * pairs + pair];
    }
}

/* How the forces of row b at the nodes of a step h hold back row a, from the coupling of their pair. */
static void fill_local(aom_stepper *st, int index, double h, ptrdiff_t pair, int a, int b,
                       double quarter) {
    slot *whole = st->slots + index;
    influence *to = whole->local + pair;
    ptrdiff_t pairs = n_pairs(st);
    for (int stage = 0; stage < 2; stage++) {
        const double *K = (stage == 0 ? whole + 1 : whole)->coupling + pair;
        for (int k = 0; k < 2; k++) {
            double *out = k == 0 ? to->depth[stage] : to->rate[stage];
            double zero = K[(1 - k) * pairs], one = K[(2 - k) * pairs] / h;
            double two = K[(3 - k) * pairs] / (h * h);
            out[0] = zero - 3.0 * one + 4.0 * two;
            out[1] = 4.0 * one - 8.0 * two;
            out[2] = 4.0 * two - one;
        }
    }

    double r = st->system.residual[(ptrdiff_t)a * st->system.n_rows + b], rate = r / h;
    to->depth[0][1] += r;
    to->depth[1][2] += r;
    to->rate[0][0] -= (1.0 + 3.0 * quarter) * rate;
    to->rate[0][1] += 4.0 * quarter * rate;
    to->rate[0][2] += (1.0 - quarter) * rate;
    to->rate[1][0] += rate;
    to->rate[1][1] -= 4.0 * rate;
    to->rate[1][2] += 3.0 * rate;
}

/* See to it that the slot of a step holds how the forces at its nodes, of groups that touch, hold back
 * the motion of one another.
 *
 * The rate of what has no mass, -R F', is that of the parabola. Where a law depends on the rate, this
 * is a differential equation of F, stiff where the contact is hardly closed: at h it is met by the
 * slope of the parabola, at h/2 by this plus a quarter of what the parabola's slope at 0 is beyond the
 * slope F' with which the last step ended (`smooth`: which also holds at 0). The stages are those of an
 * implicit Runge-Kutta method of order 3, 2 without the quarter; its stability function is 0 at
 * infinity. free_step adds the part of F'. */
void ready_local(aom_stepper *st, int index, double h) {
    slot *whole = st->slots + index;
    int kind = with_slope(st) ? WITH_SLOPE : PLAIN;
    double quarter = kind == WITH_SLOPE ? 0.25 : 0.0;
    for (int n = 0; n < st->n_touching; n++) {
        int acting = st->work.touching[n];
        if (whole->local_kind[acting] == kind)
            continue;
        ready_coupling(st, whole, acting);
        ready_coupling(st, whole + 1, acting);

        for (int i = 0; i < st->system.n_rows; i++)
            if (st->group[i] == acting)
                fill_local(st, index, h, i, i, i, quarter);
        whole->local_kind[acting] = kind;
        for (int g = 0; g < st->n_groups; g++) {
            int row = g == acting ? st->second[acting] : st->first[acting];
            if (whole->local_kind[g] != kind)
                continue;
            fill_local(st, index, h, pair_of(st, g, acting), st->first[g], row, quarter);
            if (g != acting)
                fill_local(st, index, h, pair_of(st, acting, g), row, st->first[g], quarter);
        }
    }
}
