/* What forces do to the modes, and through them to rows, also where the rate of a mode counts (gamma):
 * complex pairs and real poles of damping that couples modes.
 *
 * With y = beta J + gamma J' a force f moves mode j by q = f y and v = -omega^2 gamma J + (beta -
 * 2 d gamma) J', J the displacement that a modal force of this history causes, J' its rate. */
#include "internal.h"

/* Add what the rates of the modes do to a row of a slot. */
void add_rates(const aom_stepper *st, slot *s, int i) {
    int J = st->system.n_modes;
    const double *omega = st->system.omega, *decay = st->system.decay;
    const double *W = s->response + J, *S = W + J;
    const double *beta = beta_row(st, i), *gamma = gamma_row(st, i);
    for (int part = 0; part < 2; part++)
        for (int j = st->spans[i].begin[part]; j < st->spans[i].end[part]; j++) {
            double *at = row_of(st, s, i, j) + (j & 1);
            double pull = omega[j] * omega[j] * S[j];
            at[0] -= gamma[j] * pull;
            at[2] += gamma[j] * W[j];
            at[4] = -omega[j] * omega[j] * at[2];
            at[6] = beta[j] * W[j] - gamma[j] * (pull + 2.0 * decay[j] * W[j]);
        }
}

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
    for (int i = 0; i < st->system.n_rows; i++) {
        const double *f = st->work.force[i].f;
        double *to = st->work.parabola + 3 * (ptrdiff_t)i;
        to[0] = f[0];
        to[1] = (4.0 * f[1] - 3.0 * f[0] - f[2]) / h;
        to[2] = 4.0 * (f[0] - 2.0 * f[1] + f[2]) / (h * h);
    }
}

void move_modes(const aom_stepper *st, const double *response, double *x) {
    int J = st->system.n_modes;
    double *q = x, *v = x + J;
    turn(J, st->system.omega, response, q, v);
    for (int i = 0; i < st->system.n_rows; i++) {
        const double *f = st->work.parabola + 3 * (ptrdiff_t)i;
        if (f[0] != 0.0 || f[1] != 0.0 || f[2] != 0.0)
            apply_force(st, response, st->spans + i, row_vector(st, i), f, q, v);
    }
    if (!st->loaded)
        return;

    const row_span all = {{0, J}, {J, J}};
    modal_vector load = load_vector(st, st->work.load);
    apply_force(st, response, &all, load, (double[]){-1.0, 0.0, 0.0}, q, v);
    modal_vector load_rate = load_vector(st, st->work.load_rate);
    if (st->rising)
        apply_force(st, response, &all, load_rate, (double[]){0.0, -1.0, 0.0}, q, v);
}

/* What a row sees of displacements q of the modes, or of their rates. */
double seen_by_row(const aom_stepper *st, int i, const double *q) {
    const row_span *span = st->spans + i;
    double total = 0.0;
    for (int part = 0; part < 2; part++) {
        int begin = span->begin[part];
        total += sum_of_products(beta_row(st, i) + begin, q + begin, span->end[part] - begin);
    }
    return total;
}

motion row_of_modes(const aom_stepper *st, int i, const double *x) {
    const aom_system *s = &st->system;
    const double *q = x, *v = x + s->n_modes;
    motion out = {seen_by_row(st, i, q), seen_by_row(st, i, v)};
    for (int j = 0; j < s->n_modes && s->gamma != NULL; j++) {
        double gamma = gamma_at(st, i, j), w = s->omega[j];
        out.depth += gamma * v[j];
        out.rate -= gamma * (w * w * q[j] + 2.0 * s->decay[j] * v[j]);
    }
    return out;
}

/* The modes at a stage of the attempt, into work.ahead: q and v, q' = v and v' without forces. */
void modes_ahead(aom_stepper *st, const double *response, int stage) {
    const aom_system *s = &st->system;
    int J = s->n_modes;
    double *x = st->work.modal, *out = st->work.ahead;
    memcpy(x, st->x, 2 * (size_t)J * sizeof *x);
    move_modes(st, response, x);
    for (int j = 0; j < J; j++) {
        double w = s->omega[j], q = x[j], v = x[J + j];
        out[4 * j + stage] = q;
        out[4 * j + 2 + stage] = v;
        out[4 * (J + j) + stage] = v;
        out[4 * (J + j) + 2 + stage] = -(w * w * q + 2.0 * s->decay[j] * v);
    }
}

/* Add what a factor of each mode from `begin` to `end` makes of four numbers of each. */
static void add_products(int begin, int end, const double *factor, const double *of, double sum[4]) {
    for (int j = begin; j < end; j++)
        for (int k = 0; k < 4; k++)
            sum[k] += factor[j] * of[4 * j + k];
}

/* Indentations and rates of a row at both stages by the modes of modes_ahead. */
void seen_ahead(const aom_stepper *st, int i, stages *out) {
    const row_span *span = st->spans + i;
    const double *ahead = st->work.ahead;
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    for (int part = 0; part < 2; part++) {
        int begin = span->begin[part], end = span->end[part];
        add_products(begin, end, beta_row(st, i), ahead, sum);
        if (st->system.gamma != NULL)
            add_products(begin, end, gamma_row(st, i), ahead + 4 * st->system.n_modes, sum);
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
