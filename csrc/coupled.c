/* What forces do to the modes, and through them to rows, also where the rate of a mode counts (gamma):
 * complex pairs and real poles of damping that couples modes.
 *
 * With y = beta J + gamma J' a force f moves mode j by q = f y and v = -omega^2 gamma J + (beta -
 * 2 d gamma) J', J the displacement that a modal force of this history causes, J' its rate. */
#include "internal.h"

/* Add what the forces 1, t, t^2/2 on b do to a row, or a, after the time of the responses: the rate by
 * the first, then displacements. */
void couple(const aom_stepper *st, const double *response, const row_span *span, modal_vector a,
            modal_vector b, double total[4]) {
    ptrdiff_t J = st->system.n_modes;
    const double *omega = st->system.omega, *decay = st->system.decay, *W = response + J;
    const double *S = W + J;
    for (int part = 0; part < 2; part++) {
        for (int j = span->begin[part]; a.gamma == NULL && j < span->end[part]; j++) {
            double way = a.beta[j] * b.beta[j];
            for (int k = 0; k < 4; k++)
                total[k] += way * S[k * J + j];
        }
        for (int j = span->begin[part]; a.gamma != NULL && j < span->end[part]; j++) {
            double both = a.gamma[j] * b.gamma[j];
            double way = a.beta[j] * b.beta[j] - omega[j] * omega[j] * both;
            double pace = a.beta[j] * b.gamma[j] + a.gamma[j] * b.beta[j] - 2.0 * decay[j] * both;
            for (int k = 0; k < 4; k++)
                total[k] += way * S[k * J + j] + pace * W[k * J + j];
        }
    }
}

/* Take from (q, v) what a force f[0] + f[1] t + f[2] t^2/2 does in the time of the responses, to the
 * modes from `begin` to `end`; without rates. */
static void apply_to_modes(ptrdiff_t J, int begin, int end, const double *restrict beta,
                           const double *restrict S, const double f[3], double *restrict q,
                           double *restrict v) {
    const double *J0 = S + J, *J1 = J0 + J, *J2 = J1 + J;
    double f0 = f[0], f1 = f[1], f2 = f[2];
    for (int j = begin; j < end; j++) {
        q[j] -= beta[j] * (f0 * J0[j] + f1 * J1[j] + f2 * J2[j]);
        v[j] -= beta[j] * (f0 * S[j] + f1 * J0[j] + f2 * J1[j]);
    }
}

/* The same, with rates. */
static void apply_with_rates(const aom_stepper *st, const double *S, int begin, int end,
                             modal_vector a, const double f[3], double *q, double *v) {
    ptrdiff_t J = st->system.n_modes;
    const double *omega = st->system.omega, *decay = st->system.decay;
    for (int j = begin; j < end; j++) {
        double rate = 0.0, way = 0.0;
        for (int k = 0; k < 3; k++) {
            rate += f[k] * S[k * J + j];
            way += f[k] * S[(k + 1) * J + j];
        }
        q[j] -= a.beta[j] * way + a.gamma[j] * rate;
        v[j] -= (a.beta[j] - 2.0 * decay[j] * a.gamma[j]) * rate -
                omega[j] * omega[j] * a.gamma[j] * way;
    }
}

/* The same, of all modes. */
void apply_force(const aom_stepper *st, const double *response, const row_span *span,
                 modal_vector a, const double f[3], double *q, double *v) {
    ptrdiff_t J = st->system.n_modes;
    for (int part = 0; part < 2; part++) {
        int begin = span->begin[part], end = span->end[part];
        if (a.gamma == NULL)
            apply_to_modes(J, begin, end, a.beta, response + 2 * J, f, q, v);
        else
            apply_with_rates(st, response + 2 * J, begin, end, a, f, q, v);
    }
}

/* The state after a step without forces. */
static void turn(int J, const double *restrict omega, const double *restrict response,
                 double *restrict q, double *restrict v) {
    const double *P = response, *W = P + J, *S = W + J;
    for (int j = 0; j < J; j++) {
        double a = q[j], b = v[j];
        q[j] = P[j] * a + S[j] * b;
        v[j] = W[j] * b - omega[j] * omega[j] * S[j] * a;
    }
}

void parabolas(aom_stepper *st, double h) {
    for (int n = 0; n < st->n_closed; n++) {
        int i = st->work.closed[n];
        const double *f = st->work.force[i].f;
        double *to = st->work.parabola + 3 * (ptrdiff_t)i;
        to[0] = f[0];
        to[1] = (4.0 * f[1] - 3.0 * f[0] - f[2]) / h;
        to[2] = 4.0 * (f[0] - 2.0 * f[1] + f[2]) / (h * h);
    }
}

/* The modal state after the time of the responses under the loads alone. */
static void move_freely(const aom_stepper *st, const double *response, double *q, double *v) {
    int J = st->system.n_modes;
    turn(J, st->system.omega, response, q, v);
    if (!st->loaded)
        return;

    const row_span all = {{0, J}, {J, J}};
    modal_vector load = load_vector(st, st->work.load);
    apply_force(st, response, &all, load, (double[]){-1.0, 0.0, 0.0}, q, v);
    modal_vector load_rate = load_vector(st, st->work.load_rate);
    if (st->rising)
        apply_force(st, response, &all, load_rate, (double[]){0.0, -1.0, 0.0}, q, v);
}

void force_ahead(aom_stepper *st, int index, int stage) {
    double *q = st->work.ahead + stage * (ptrdiff_t)st->system.n_modes, *v = q + 2 * st->system.n_modes;
    if (st->work.forced[stage])
        return;

    st->work.forced[stage] = true;
    for (int n = 0; n < st->n_closed; n++) {
        int i = st->work.closed[n];
        apply_force(st, st->slots[index + 1 - stage].response, st->spans + i, row_vector(st, i),
                    st->work.parabola + 3 * (ptrdiff_t)i, q, v);
    }
}

void modes_ahead(aom_stepper *st, int index) {
    size_t J = (size_t)st->system.n_modes;
    for (int stage = 0; stage < 2; stage++) {
        double *q = st->work.ahead + (size_t)stage * J, *v = q + 2 * J;
        memcpy(q, st->x, J * sizeof *q);
        memcpy(v, st->x + J, J * sizeof *v);
        st->work.forced[stage] = false;
        if (index >= 0)
            move_freely(st, st->slots[index + 1 - stage].response, q, v);
    }
}

/* Add what the factors of the modes from `begin` to `end` make of four numbers of each, J apart. */
static void add_products(ptrdiff_t J, int begin, int end, const double *factor, const double *of,
                         double sum[4]) {
    lanes total[4][LANES];
    int j = begin;
    memset(total, 0, sizeof total);
    for (; j + 2 <= end; j += 2)
        for (int k = 0; k < 4; k++)
            for (int s = 0; s < LANES; s++)
                total[k][s] += ((const anywhere *)(factor + j))[s] *
                               ((const anywhere *)(of + k * J + j))[s];
    for (int k = 0; k < 4; k++) {
        double part[2];
        memcpy(part, total[k], sizeof part);
        sum[k] += part[0] + part[1];
        if (j < end)
            sum[k] += factor[j] * of[k * J + j];
    }
}

void seen_ahead(const aom_stepper *st, int i, double h, stages *out) {
    const row_span *span = st->spans + i;
    const double *ahead = st->work.ahead, *omega = st->system.omega, *decay = st->system.decay;
    ptrdiff_t J = st->system.n_modes;
    double offset = st->work.offset[i], drift = st->work.drift[i];
    double sum[4] = {-offset - 0.5 * h * drift, -offset - h * drift, -drift, -drift};
    for (int part = 0; part < 2; part++) {
        int begin = span->begin[part], end = span->end[part];
        add_products(J, begin, end, beta_row(st, i), ahead, sum);
        for (int j = begin; j < end && st->system.gamma != NULL; j++)
            for (int s = 0; s < 2; s++) {
                double gamma = gamma_row(st, i)[j], q = ahead[s * J + j], v = ahead[(2 + s) * J + j];
                sum[s] += gamma * v;
                sum[2 + s] -= gamma * (omega[j] * omega[j] * q + 2.0 * decay[j] * v);
            }
    }
    *out = (stages){{sum[0], sum[1]}, {sum[2], sum[3]}};
}

/* The energy that the contacts have given the bodies grows by that of a step: of modes whose rate
 * counts too, the squares of q and v are no energy. */
void add_contact_work(aom_stepper *st, double h) {
    run_state *now = &st->now;
    for (int i = 0; i < st->system.n_rows; i++) {
        const double *f = st->work.force[i].f, *rate = st->work.motion[i].rate;
        double power = f[0] * st->rows[i].rate + 4.0 * f[1] * rate[0] + f[2] * rate[1];
        now->contact_work -= h / 6.0 * power;
    }
    now->highest = larger(now->highest, -now->contact_work);
}
