/* Modes whose rate counts too (gamma): complex pairs and real poles of damping that couples modes.
 *
 * With y = beta J + gamma J' a force f moves mode j by q = f y and v = -omega^2 gamma J + (beta -
 * 2 d gamma) J', J the displacement that a modal force of this course causes, J' its rate. */
#include "internal.h"

/* Add what the rates of the modes do to the rows of a slot. */
void add_rates(aom_stepper *st, slot *s) {
    int J = st->system.n_modes;
    const double *omega = st->system.omega, *decay = st->system.decay;
    const double *W = s->response + J, *S = W + J;
    for (int i = 0; i < st->system.n_rows; i++) {
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
}

/* What the forces 1, t, t^2/2 of row b do to row a: the rate of the first, then displacements. */
void add_coupling(const aom_stepper *st, const slot *s, int a, int b, double total[4]) {
    ptrdiff_t J = st->system.n_modes;
    const double *omega = st->system.omega, *decay = st->system.decay, *W = s->response + J;
    const double *left = beta_row(st, a), *right = beta_row(st, b);
    const double *left_rate = gamma_row(st, a), *right_rate = gamma_row(st, b);
    for (int part = 0; part < 2; part++)
        for (int j = st->spans[a].begin[part]; j < st->spans[a].end[part]; j++) {
            double both = left_rate[j] * right_rate[j];
            double way = left[j] * right[j] - omega[j] * omega[j] * both;
            double pace =
                left[j] * right_rate[j] + left_rate[j] * right[j] - 2.0 * decay[j] * both;
            for (int k = 0; k < 4; k++)
                total[k] += way * W[(k + 1) * J + j] + pace * W[k * J + j];
        }
}

/* Take from (q, v) what a force f[0] + f[1] t + f[2] t^2/2 of row i does in the time of the
 * responses. */
void push_coupled(const aom_stepper *st, const double *response, int i, const double f[3], double *q,
                  double *v) {
    ptrdiff_t J = st->system.n_modes;
    const double *omega = st->system.omega, *decay = st->system.decay, *S = response + 2 * J;
    const double *beta = beta_row(st, i), *gamma = gamma_row(st, i);
    for (int part = 0; part < 2; part++)
        for (int j = st->spans[i].begin[part]; j < st->spans[i].end[part]; j++) {
            double rate = 0.0, way = 0.0;
            for (int k = 0; k < 3; k++) {
                rate += f[k] * S[k * J + j];
                way += f[k] * S[(k + 1) * J + j];
            }
            q[j] -= beta[j] * way + gamma[j] * rate;
            v[j] -= (beta[j] - 2.0 * decay[j] * gamma[j]) * rate -
                    omega[j] * omega[j] * gamma[j] * way;
        }
}

/* What the loads have moved mode j by after the time of its responses: q, v and their rates. */
void loaded_by(const aom_stepper *st, const double *response, int j, double out[4]) {
    ptrdiff_t J = st->system.n_modes;
    double w2 = st->system.omega[j] * st->system.omega[j], twice = 2.0 * st->system.decay[j];
    const double *at = st->work.load, *rise = st->work.load_rate, *W = response + J;
    double load[2] = {at[j], rise[j]}, drive[2] = {at[J + j], rise[J + j]};
    out[0] = out[1] = out[2] = out[3] = 0.0;
    for (int k = 0; k < 2; k++) {
        double rates = W[k * J + j], rate = W[(k + 1) * J + j], way = W[(k + 2) * J + j];
        double rest = load[k] - twice * drive[k];
        out[0] += load[k] * way + drive[k] * rate;
        out[1] += rest * rate - w2 * drive[k] * way;
        out[2] += load[k] * rate + drive[k] * rates;
        out[3] += rest * rates - w2 * drive[k] * rate;
    }
}

/* The amplitude at which a contact sees mode j moving about what the loads give, and, of a mode
 * without frequency, the curvature that it sees. */
double seen_amplitude(const aom_stepper *st, int c, int j) {
    ptrdiff_t J = st->system.n_modes;
    double w = st->system.omega[j], w2 = w * w, twice = 2.0 * st->system.decay[j];
    double beta = fabs(beta_row(st, c)[j]), gamma = fabs(gamma_row(st, c)[j]);
    double load = st->work.load[j], rise = st->work.load_rate[j];
    double drive = st->work.load[J + j], climb = st->work.load_rate[J + j];
    double q = st->x[j], v = st->x[J + j];
    if (w > 0.0) {
        double rest = q - (load - twice * rise / w2 + climb) / w2;
        double moving = (v - rise / w2 + drive) / w;
        return (beta + gamma * (w + twice)) * sqrt(rest * rest + moving * moving);
    }
    double left = st->now.left;
    double most = larger(fabs(load), fabs(load + rise * left)) +
                  twice * larger(fabs(drive), fabs(drive + climb * left)) + twice * fabs(v);
    return beta * (most + fabs(climb)) + gamma * (twice * most + fabs(rise) + twice * fabs(climb));
}

/* The energy that the contacts have given the bodies grows by that of a step: of modes whose rate
 * counts too, the squares of q and v are no energy. */
void give(aom_stepper *st, double h) {
    course *now = &st->now;
    for (int i = 0; i < st->system.n_rows; i++) {
        const double *f = st->work.force[i].f, *rate = st->work.motion[i].rate;
        double power = f[0] * st->rows[i].rate + 4.0 * f[1] * rate[0] + f[2] * rate[1];
        now->pushed -= h / 6.0 * power;
    }
    now->highest = larger(now->highest, -now->pushed);
}
