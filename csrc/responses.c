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

/* See to it that a slot holds the responses after h, and the next one those after h/2.
 *
 * They are found together for a step that is used once; those of the levels each by itself, so that
 * a run does not depend on which of them earlier runs left. */
void ready_step(aom_stepper *st, int index, double h) {
    const aom_system *system = &st->system;
    slot *whole = st->slots + index;
    bool once = index >= LEVELS && whole[0].span != h && whole[1].span != 0.5 * h;
    if (once)
        responses_twice(system->n_modes, system->omega, system->decay, h, whole[0].response,
                        whole[1].response);
    for (int k = 0; k < 2; k++) {
        double t = k == 0 ? h : 0.5 * h;
        if (whole[k].span == t)
            continue;
        if (!once)
            aom_responses(system->n_modes, system->omega, system->decay, &t, 0, whole[k].response);
        whole[k].span = t;
        forget_rows(st, whole + k);
    }
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

/* Whether what has no mass couples a row with others. */
static bool softens(const aom_system *s, int i) {
    for (int k = 0; k < s->n_rows; k++)
        if (k != i && s->residual[(ptrdiff_t)i * s->n_rows + k] != 0.0)
            return true;
    return false;
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
        st->softens[i] = softens(&st->system, i);
        st->spans[i] = (row_span){{first < 0 ? 0 : first, resume}, {cut, end}};
    }
}

/* The rows of contacts that touch, and of stretching, and their groups; no other row has a force. */
void find_touching(aom_stepper *st) {
    const aom_system *system = &st->system;
    workspace *w = &st->work;
    size_t m = (size_t)system->n_rows;
    memset(w->force, 0, m * sizeof *w->force);
    memset(w->parabola, 0, 3 * m * sizeof *w->parabola);
    memset(w->place, -1, (size_t)st->n_groups * sizeof *w->place);
    st->n_touching = st->n_closed = 0;
    for (int i = 0; i < system->n_rows; i++) {
        int g = st->group[i];
        if (!is_closed(st, i))
            continue;
        w->closed[st->n_closed++] = i;
        if (w->place[g] >= 0)
            continue;
        w->place[g] = st->n_touching;
        w->touching[st->n_touching++] = g;
    }
}

/* Add what the forces 1, t, t^2/2 on a row do to another, by work.kicks; without rates. */
static void couple_modes(const aom_stepper *st, const row_span *span, const double *a,
                         const double *b, double *total) {
    lanes sum[2 * LANES];
    memset(sum, 0, sizeof sum);
    for (int part = 0; part < 2; part++)
        for (int j = span->begin[part]; j < span->end[part]; j++) {
            const anywhere *kick = (const anywhere *)(st->work.kicks + 4 * j);
            double way = a[j] * b[j];
            for (int k = 0; k < 2 * LANES; k++)
                sum[k] += way * kick[k];
        }
    memcpy(total, sum, sizeof sum);
}

/* beta S beta^T, beta J0 beta^T, beta J1 beta^T, beta J2 beta^T of two rows; those `before`, if any. */
static void couple_rows(const aom_stepper *st, const slot *s, int a, int b, const double *before,
                        double *to) {
    if (before != NULL)
        memcpy(to, before, 4 * sizeof *to);
    else if (st->system.gamma == NULL)
        couple_modes(st, st->spans + a, beta_row(st, a), beta_row(st, b), to);
    else {
        memset(to, 0, 4 * sizeof *to);
        couple(st, s->response, st->spans + a, row_vector(st, a), row_vector(st, b), to);
    }
}

/* A slot holds the coupling of no rows. */
void forget_rows(aom_stepper *st, slot *s) {
    s->n_held = 0;
    memset(s->place, -1, (size_t)st->n_groups * sizeof *s->place);
    memset(s->held, 0, (size_t)st->system.n_rows * sizeof *s->held);
}

/* See to it that a slot holds the coupling of the groups that touch, and of the rows of each that has
 * several. */
static void ready_coupling(aom_stepper *st, slot *s) {
    int n = st->n_touching, held = s->n_held, *kept = st->work.kept;
    const int *touching = st->work.touching;
    size_t m = (size_t)st->system.n_rows;
    double *from = s->coupling, *to = st->work.coupling, *pairs = to + 4 * m;
    bool same = n == held;
    for (int g = 0; g < n; g++) {
        kept[g] = s->place[touching[g]];
        same = same && kept[g] == g;
    }
    for (int k = 0; same && k < st->n_closed; k++)
        same = s->held[st->work.closed[k]];
    if (same)
        return;

    for (int j = 0, J = st->system.n_modes; j < J; j++)
        for (int k = 0; k < 4; k++)
            st->work.kicks[4 * j + k] = s->response[(2 + k) * (ptrdiff_t)J + j];
    for (int k = 0; k < st->n_closed; k++) {
        int i = st->work.closed[k];
        if (!alone(st, st->group[i]))
            couple_rows(st, s, i, i, s->held[i] ? from + 4 * i : NULL, to + 4 * i);
    }

    for (int g = 0; g < n; g++)
        for (int k = 0; k <= g; k++) {
            int a = st->first[touching[g]], b = (k == g ? st->second : st->first)[touching[k]];
            double *pair = pairs + 4 * (g * n + k);
            bool there = kept[g] >= 0 && kept[k] >= 0;
            const double *before = from + 4 * ((ptrdiff_t)m + kept[g] * held + kept[k]);
            couple_rows(st, s, a, b, there ? before : NULL, pair);
            memcpy(pairs + 4 * (k * n + g), pair, 4 * sizeof *pair);
        }
    st->work.coupling = from;
    s->coupling = to;
    forget_rows(st, s);
    s->n_held = n;
    for (int g = 0; g < n; g++)
        s->place[touching[g]] = g;
    for (int k = 0; k < st->n_closed; k++)
        s->held[st->work.closed[k]] = true;
    s->local_kind = NO_LOCAL;
    if (s > st->slots)
        s[-1].local_kind = NO_LOCAL; /* of the step whose half this is */
}

/* How the forces of row b at the nodes of a step h hold back row a, from the coupling of their pair. */
static void fill_local(aom_stepper *st, int index, double h, ptrdiff_t pair, int a, int b,
                       double quarter) {
    slot *whole = st->slots + index;
    influence *to = whole->local + pair;
    for (int stage = 0; stage < 2; stage++) {
        const double *K = (stage == 0 ? whole + 1 : whole)->coupling + 4 * pair;
        for (int k = 0; k < 2; k++) {
            double *out = k == 0 ? to->depth[stage] : to->rate[stage];
            double zero = K[1 - k], one = K[2 - k] / h, two = K[3 - k] / (h * h);
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
    ready_coupling(st, whole);
    ready_coupling(st, whole + 1);
    if (whole->local_kind == kind)
        return;

    whole->local_kind = kind;
    for (int k = 0; k < st->n_closed; k++) {
        int i = st->work.closed[k];
        if (!alone(st, st->group[i]))
            fill_local(st, index, h, i, i, i, quarter);
    }
    for (int a = 0; a < st->n_touching; a++)
        for (int b = 0; b <= a; b++) {
            int g = st->work.touching[a], k = st->work.touching[b];
            int row = (a == b ? st->second : st->first)[k];
            ptrdiff_t pair = pair_of(st, g, k);
            fill_local(st, index, h, pair, st->first[g], row, quarter);
            whole->local[pair_of(st, k, g)] = whole->local[pair];
        }
}
