/* The discrete adjoint of a run: from its end to its start, the derivatives of a goal by the state.
 *
 * A step takes (q, v) and the forces f0 at its start to the forces f1, f2 that meet the laws at h/2
 * and h, and to the state at its end. All that happens in between is linear but for the laws, so that
 * the multipliers of the laws (adjoints of f1, f2) solve one small system a step. A step that a
 * contact ends where it leaves its branch has a length that depends on all before it: the multiplier
 * of that condition makes the derivative by the length 0. Forces are continuous there.
 *
 * Modes whose rate counts too (gamma) are oscillators in q and w = q' = v + p, p = drive - gamma^T F,
 *
 *     w' = -omega^2 q - 2 d w + g + p',   g = load - beta^T F,
 *     delta = beta q + gamma v - offset - R F,
 *
 * so that all but the last lines holds for q and w under the modal forces g + p'; else p = 0, w = v. */
#include "internal.h"

#define LACKING 1e-7 /* of the forces: far more than Newton's method leaves */

typedef struct edge { /* derivatives by what is there at an edge between two steps */
    double *q, *v;        /* [J] the state */
    double *force;        /* [m] the forces with which the next step starts */
    double *depth, *rate; /* [m] indentation and rate where the step before ends */
    double *slope;        /* [m] slopes of the forces there */
    double time;
} edge;

/* Friction of a tangential row at a stage: f = stiffness (way - anchor), or, where it slips, f along
 * the way u = way + held f - anchor, with any `held`. */
typedef struct slide {
    bool slips;
    double along;   /* direction of the force */
    double turn[2]; /* how the force turns with u of the contact's rows */
    double held;    /* by the force */
} slide;

typedef struct adjoint {
    aom_stepper *st;
    const aom_record *run;
    const aom_goal *goal;
    aom_slopes *out;
    edge now;
    law_slopes *laws; /* [p] by what the contacts remember, and by parameters */
    int64_t exits, readings; /* those that are left */
    double *slopes, *span;   /* [SLOTS][8][J] of the slots' responses, after this time */
    double *work;            /* [16][J]: motion, responses and their slopes at a reading */
    double fastest;          /* speed at which a contact goes over to another branch */
    /* of the present step */
    int64_t step;
    int index;
    double h, start;
    bool lacks;      /* it, or one after it, is a long one: its force at h/2 is not the law's */
    bool stopped;    /* it ends at a given time */
    double earlier;  /* derivative by the time of its start, all else given */
    double *f, *c;   /* [3][m] forces at the nodes; value, slope, curvature of the parabolas */
    double *before, *by_slope; /* [m] slopes with which the last step ended, where the rates take them */
    double *load;    /* [3][J] modal forces, their slopes and curvatures */
    double *push;    /* [3][J] p, its slopes and curvatures; NULL without gamma, as by_push, by_w */
    double *w0;      /* [J] the rate of q at the start */
    double *q, *v;   /* [2][J] q and w at h/2 and h */
    double *q0, *v0; /* [J] derivatives by the state at the start */
    double *by_load, *by_push;   /* [3][J] by g and p */
    double *by_q, *by_v, *by_w;  /* [2][J], [2][J], [J] */
    double *by_depth, *by_rate, *rates;        /* [2][m] */
    double *explicit_force, *anchor;           /* [2][m], [m] by the anchors at the start */
    int *owner, *active;                       /* [m] the contact of a row; rows that press */
    slide *slides;                             /* [2][m] */
    double *by_force, *by_parabola, *direct;   /* [3][m], [3][m], [2][m] multipliers */
    double *no_q, *no_depth, *no_rate; /* [J], [m], [m] */
    tangent *tangents;           /* [2][p] */
    double *matrix, *rest;       /* [2p][2p], [2p] */
} adjoint;

static void lay_out_adjoint(adjoint *a, arena *m, size_t J, size_t rows, bool coupled) {
    const struct {
        double **array;
        size_t count;
    } each[] = {
        {&a->now.q, J}, {&a->now.v, J}, {&a->q0, J}, {&a->v0, J}, {&a->no_q, J},
        {&a->now.force, rows}, {&a->now.depth, rows}, {&a->now.rate, rows}, {&a->now.slope, rows},
        {&a->before, rows}, {&a->by_slope, rows}, {&a->no_depth, rows}, {&a->no_rate, rows}, {&a->anchor, rows}, {&a->explicit_force, 2 * rows},
        {&a->span, SLOTS}, {&a->f, 3 * rows}, {&a->c, 3 * rows}, {&a->by_force, 3 * rows},
        {&a->by_parabola, 3 * rows}, {&a->rates, 2 * rows}, {&a->direct, 2 * rows},
        {&a->by_depth, 2 * rows}, {&a->by_rate, 2 * rows}, {&a->load, 3 * J}, {&a->by_load, 3 * J},
        {&a->q, 2 * J}, {&a->v, 2 * J}, {&a->by_q, 2 * J}, {&a->by_v, 2 * J},
        {&a->matrix, 4 * rows * rows}, {&a->rest, 2 * rows},
        {&a->w0, J}, {&a->push, coupled ? 3 * J : 0}, {&a->by_push, coupled ? 3 * J : 0},
        {&a->by_w, coupled ? J : 0},
        {&a->work, 16 * J}, {&a->slopes, 8 * SLOTS * J}, /* found before they are read */
    };
    a->owner = take(m, rows, sizeof(int));
    a->active = take(m, rows, sizeof(int));
    a->slides = take(m, 2 * rows, sizeof(slide));
    a->laws = take(m, rows, sizeof(law_slopes));
    a->tangents = take(m, 2 * rows, sizeof(tangent));
    for (size_t k = 0; k < sizeof each / sizeof *each; k++)
        *each[k].array = take(m, each[k].count, sizeof(double));
}

size_t aom_gradient_size(const aom_stepper *st) {
    arena m = {NULL, 0};
    adjoint unused;
    lay_out_adjoint(&unused, &m, (size_t)st->system.n_modes, (size_t)st->system.n_rows,
                    st->system.gamma != NULL);
    return m.used;
}

static double dot(int n, const double *a, const double *b) {
    double total = 0.0;
    for (int j = 0; j < n; j++)
        total += a[j] * b[j];
    return total;
}

static void add(int n, double by, const double *a, double *to) {
    for (int j = 0; j < n; j++)
        to[j] += by * a[j];
}

static void clear(double *x, ptrdiff_t n) { memset(x, 0, (size_t)n * sizeof *x); }

/* How the force of row k holds back row i. */
static const influence *held_by(const adjoint *a, int i, int k) {
    const influence *local = a->st->slots[a->index].local;
    return i == k ? local + i : local + pair_of(a->st, a->st->group[i], a->st->group[k]);
}

/* The state after t of modes under forces load + t slope + t^2/2 curvature. */
static void moved(int J, const double *restrict R, const double *restrict omega,
                  const double *restrict q0, const double *restrict v0, const double *restrict g,
                  double *restrict q, double *restrict v) {
    for (int j = 0; j < J; j++) {
        double P = R[j], W = R[J + j], S = R[2 * J + j], J0 = R[3 * J + j], J1 = R[4 * J + j];
        double x = omega[j] * omega[j], g0 = g[j], g1 = g[J + j], g2 = g[2 * J + j];
        q[j] = P * q0[j] + S * v0[j] + J0 * g0 + J1 * g1 + R[5 * J + j] * g2;
        v[j] = W * v0[j] - x * S * q0[j] + S * g0 + J0 * g1 + J1 * g2;
    }
}

/* From derivatives by the state after t to those by the forces. */
static void to_load(int J, const double *restrict R, const double *restrict by_q,
                    const double *restrict by_v, double *restrict to) {
    const double *restrict S = R + 2 * J, *restrict J0 = S + J, *restrict J1 = J0 + J;
    const double *restrict J2 = J1 + J;
    for (int j = 0; j < J; j++) {
        to[j] += J0[j] * by_q[j] + S[j] * by_v[j];
        to[J + j] += J1[j] * by_q[j] + J0[j] * by_v[j];
        to[2 * J + j] += J2[j] * by_q[j] + J1[j] * by_v[j];
    }
}

/* From derivatives by q and w after the time of the responses to those by the forces of the modes. */
static void to_forces(adjoint *a, const double *R, const double *by_q, const double *by_w) {
    ptrdiff_t J = a->st->system.n_modes;
    to_load((int)J, R, by_q, by_w, a->by_load);
    if (a->st->system.gamma == NULL)
        return;
    for (int n = 0; n < 3; n++) /* p acts by its slope, and at the start */
        for (ptrdiff_t j = 0; j < J; j++)
            a->by_push[n * J + j] += R[(n + 2) * J + j] * by_q[j] + R[(n + 1) * J + j] * by_w[j];
}

static double parabola_at(const double *c, ptrdiff_t stride, double t) {
    return c[0] + t * (c[stride] + 0.5 * t * c[2 * stride]);
}

static double slope_at(const double *c, ptrdiff_t stride, double t) {
    return c[stride] + t * c[2 * stride];
}

/* From derivatives by v = w - p at t to those by p; the derivative by t that they have of p alone. */
static double to_push(adjoint *a, double t, const double *by_v) {
    int J = a->st->system.n_modes;
    double later = 0.0;
    if (a->st->system.gamma == NULL)
        return later;
    add(J, -1.0, by_v, a->by_push);
    add(J, -t, by_v, a->by_push + J);
    add(J, -0.5 * t * t, by_v, a->by_push + 2 * J);
    for (int j = 0; j < J; j++)
        later -= by_v[j] * slope_at(a->push + j, J, t);
    return later;
}

/* From derivatives by indentation and rate of row i to those by q, by v = w - p, and by w. */
static void to_motion(const adjoint *a, int i, double depth, double rate, double *by_q, double *by_v,
                      double *by_w) {
    const aom_system *system = &a->st->system;
    int J = system->n_modes;
    add(J, depth, beta_row(a->st, i), by_q);
    add(J, rate, beta_row(a->st, i), by_w);
    for (int j = 0; system->gamma != NULL && j < J; j++) {
        double gamma = gamma_row(a->st, i)[j];
        by_q[j] -= rate * gamma * system->omega[j] * system->omega[j];
        by_v[j] += depth * gamma;
        by_w[j] -= rate * gamma * 2.0 * system->decay[j];
    }
}

/* What indentation and rate of row i have of the system at q, v, w and forces g of the modes. */
static void to_system(adjoint *a, int i, double depth, double rate, const double *q, const double *v,
                      const double *w, const double *g) {
    const aom_system *system = &a->st->system;
    int J = system->n_modes;
    add(J, depth, q, a->out->beta + (ptrdiff_t)i * J);
    add(J, rate, w, a->out->beta + (ptrdiff_t)i * J);
    for (int j = 0; system->gamma != NULL && j < J; j++) {
        double x = system->omega[j] * system->omega[j], d = system->decay[j];
        double pull = rate * gamma_row(a->st, i)[j];
        a->out->gamma[(ptrdiff_t)i * J + j] +=
            depth * v[j] + rate * (g[j] - x * q[j] - 2.0 * d * w[j]);
        a->out->square[j] -= pull * q[j];
        a->out->decay[j] -= 2.0 * pull * w[j];
    }
}

/* Add the derivatives by the squares of the frequencies, or by the decays: D has the slopes [4][J] of
 * S, J0, J1, J2. */
static inline void by_modes(ptrdiff_t J, bool square, const aom_system *system,
                            const double *restrict R, const double *restrict D,
                            const double *restrict q0, const double *restrict v0,
                            const double *restrict g, const double *restrict by_q,
                            const double *restrict by_v, double *restrict to) {
    const double *restrict omega = system->omega, *restrict decay = system->decay;
    for (ptrdiff_t j = 0; j < J; j++) {
        double x = omega[j] * omega[j], S = R[2 * J + j], g0 = g[j], g1 = g[J + j], g2 = g[2 * J + j];
        double s = D[j], j0 = D[J + j], j1 = D[2 * J + j], j2 = D[3 * J + j];
        double P = -x * j0 - (square ? R[3 * J + j] : 0.0);
        double W = P - 2.0 * decay[j] * s - (square ? 0.0 : 2.0 * S);
        double back = x * s + (square ? S : 0.0);
        to[j] += by_q[j] * (P * q0[j] + s * v0[j] + j0 * g0 + j1 * g1 + j2 * g2) +
                 by_v[j] * (W * v0[j] - back * q0[j] + s * g0 + j0 * g1 + j1 * g2);
    }
}

/* From derivatives by the state after t to those by the state at the start and by the modes. */
static void to_start(const adjoint *a, const double *restrict R, const double *D, const double *q0,
                     const double *v0, const double *restrict by_q, const double *restrict by_v) {
    const aom_system *system = &a->st->system;
    ptrdiff_t J = system->n_modes;
    const double *restrict omega = system->omega;
    double *restrict to_q = a->q0, *restrict to_v = a->v0;
    for (ptrdiff_t j = 0; j < J; j++) {
        double S = R[2 * J + j];
        to_q[j] += R[j] * by_q[j] - omega[j] * omega[j] * S * by_v[j];
        to_v[j] += S * by_q[j] + R[J + j] * by_v[j];
    }
    by_modes(J, true, system, R, D, q0, v0, a->load, by_q, by_v, a->out->square);
    if (a->out->decay != NULL)
        by_modes(J, false, system, R, D + 4 * J, q0, v0, a->load, by_q, by_v, a->out->decay);
}

/* Derivative by the time t of the state. */
static double by_time(const adjoint *a, double t, const double *q, const double *v,
                      const double *by_q, const double *by_v) {
    int J = a->st->system.n_modes;
    const double *omega = a->st->system.omega, *decay = a->st->system.decay, *g = a->load;
    double total = 0.0;
    for (int j = 0; j < J; j++) {
        double force = g[j] + t * (g[J + j] + 0.5 * t * g[2 * J + j]);
        double rise = force - 2.0 * decay[j] * v[j] - omega[j] * omega[j] * q[j];
        total += by_q[j] * v[j] + by_v[j] * rise;
    }
    return total;
}

/* Derivatives of the responses of a slot, found once for all steps of one length. */
static const double *slopes_of(adjoint *a, int index) {
    ptrdiff_t J = a->st->system.n_modes;
    const slot *s = a->st->slots + index;
    double *out = a->slopes + 8 * J * index;
    if (a->span[index] != s->span)
        response_slopes((int)J, a->st->system.omega, a->st->system.decay, s->span, s->response,
                        a->out->decay != NULL, out);
    a->span[index] = s->span;
    return out;
}

/* ---- a step */

/* Loads and gaps at a time; the time that they hold. */
static double acting_at(aom_stepper *st, double t) {
    double end = st->options.duration;
    while (st->now.segment > 0 && st->system.breaks[st->now.segment] - t > 1e-13 * end)
        st->now.segment--;
    st->now.time = t;
    return acting_now(st);
}

/* The slope of the force of a row at h/2 and h, as the rate of what has no mass takes it
 * (ready_local), but for what it takes of the last step, a->before. */
static void force_rates(const adjoint *a, int i, double out[2]) {
    int m = a->st->system.n_rows;
    double f0 = a->f[i], f1 = a->f[m + i], f2 = a->f[2 * m + i];
    out[0] = (f2 - f0) / a->h;
    out[1] = (f0 - 4.0 * f1 + 3.0 * f2) / a->h;
    if (with_slope(a->st))
        out[0] += (f1 - 0.75 * f0 - 0.25 * f2) / a->h;
}

static double rate_at(const adjoint *a, int stage, int i) {
    const aom_stepper *st = a->st;
    int J = st->system.n_modes, m = st->system.n_rows;
    double rate = dot(J, beta_row(st, i), a->v + stage * J) - st->work.drift[i], slope[2];
    for (int j = 0; st->system.gamma != NULL && j < J; j++) {
        double w = st->system.omega[j], t = 0.5 * (1 + stage) * a->h;
        double own = parabola_at(a->load + j, J, t) - slope_at(a->push + j, J, t);
        rate += gamma_row(st, i)[j] * (own - w * w * a->q[stage * J + j] -
                                       2.0 * st->system.decay[j] * a->v[stage * J + j]);
    }
    for (int r = 0; r < m; r++) {
        force_rates(a, r, slope);
        slope[0] -= 0.25 * a->before[r];
        rate -= st->system.residual[(ptrdiff_t)i * m + r] * slope[stage];
    }
    return rate;
}

/* The friction of contact c at a stage. */
static void rubbed(adjoint *a, int stage, int c) {
    const aom_contact *contact = a->st->system.contacts + c;
    int m = a->st->system.n_rows;
    double stiffness = contact->tangential_stiffness, trial[2] = {0.0, 0.0}, soft[2], size;
    const double *way = a->run->depth + 2 * a->step * m, *f = a->f;
    for (int r = 0; r < contact->n_tangential; r++) {
        int i = contact->first_tangential + r, now = (1 + stage) * m + i, before = stage * m + i;
        double held = held_by(a, i - r, i - r)->depth[stage][1 + stage]; /* the same for both */
        double anchor = way[before] - f[before] / stiffness;
        soft[r] = stiffness / (1.0 + stiffness * held);
        trial[r] = soft[r] * (way[now] + held * f[now] - anchor);
        a->slides[stage * m + i].held = held;
    }
    double most = contact->friction * larger(f[(1 + stage) * m + c], 0.0);
    size = sqrt(trial[0] * trial[0] + trial[1] * trial[1]);
    for (int r = 0; r < contact->n_tangential; r++) {
        slide *own = a->slides + stage * m + contact->first_tangential + r;
        own->slips = size > most * (1.0 + 1e-12);
        own->along = own->slips ? trial[r] / size : 0.0;
        for (int q = 0; q < contact->n_tangential && own->slips; q++)
            own->turn[q] = most / size * soft[q] * ((r == q) - own->along * trial[q] / size);
    }
}

/* Whether step k takes the slopes with which the last one ended, and these. */
static void recall_slopes(adjoint *a, int64_t k) {
    aom_stepper *st = a->st;
    int m = st->system.n_rows;
    const double *f = a->run->force + (2 * k - 2) * m, *time = a->run->time + 2 * k;
    bool exits = a->exits > 0 && a->run->exits[a->exits - 1].step >= (double)k;
    st->now.smooth = k > 0 && !exits && time[0] > time[-2] &&
                     (st->now.segment == 0 || time[0] - st->system.breaks[st->now.segment] >
                                                  1e-13 * st->options.duration);
    clear(a->before, m);
    for (int i = 0; i < m && with_slope(st); i++)
        if (pressing(st->contacts[a->owner[i]].branch))
            a->before[i] = (f[i] - 4.0 * f[m + i] + 3.0 * f[2 * m + i]) / (time[0] - time[-2]);
}

/* Forces, motion and slopes of the laws in step k. */
static void recall(adjoint *a, int64_t k, bool ended) {
    aom_stepper *st = a->st;
    int J = st->system.n_modes, m = st->system.n_rows;
    const double *node = a->run->force + 2 * k * m, *state = a->run->states + 2 * k * J;
    const double *omega = st->system.omega;
    bool coupled = st->system.gamma != NULL;
    double h = a->run->time[2 * k + 2] - a->run->time[2 * k];
    a->step = k;
    a->start = a->run->time[2 * k];
    double left = acting_at(st, a->start);
    a->stopped = !ended && h >= left - 1e-13 * st->options.duration;
    int level = (int)lround(log2(st->now.longest / h));
    bool whole = level >= 0 && level < LEVELS && !ended && !a->stopped &&
                 fabs(h - level_step(st, level)) <= 1e-9 * h;
    a->index = whole ? level : SCRATCH;
    a->h = h = whole ? level_step(st, level) : h;
    recall_slopes(a, k);
    ready_step(st, a->index, h);
    ready_local(st, a->index, h);
    memcpy(a->load, st->work.load, (size_t)J * sizeof(double));
    memcpy(a->load + J, st->work.load_rate, (size_t)J * sizeof(double));
    clear(a->load + 2 * J, J);
    if (coupled) {
        memcpy(a->push, st->work.load + J, (size_t)J * sizeof(double));
        memcpy(a->push + J, st->work.load_rate + J, (size_t)J * sizeof(double));
        clear(a->push + 2 * J, J);
    }
    for (int i = 0; i < m; i++) {
        bool presses = pressing(st->contacts[a->owner[i]].branch);
        double f0 = presses ? node[i] : 0.0, f1 = node[m + i], f2 = presses ? node[2 * m + i] : 0.0;
        double c[3] = {f0, (4.0 * f1 - 3.0 * f0 - f2) / h, 4.0 * (f0 - 2.0 * f1 + f2) / (h * h)};
        a->f[i] = f0;
        a->f[m + i] = f1;
        a->f[2 * m + i] = f2;
        for (int n = 0; n < 3; n++) {
            a->c[n * m + i] = c[n];
            if (presses)
                add(J, -c[n], beta_row(st, i), a->load + n * J);
            if (presses && coupled)
                add(J, -c[n], gamma_row(st, i), a->push + n * J);
        }
    }
    memcpy(a->q + J, state + 2 * J, (size_t)J * sizeof(double));
    memcpy(a->v + J, state + 3 * J, (size_t)J * sizeof(double));
    memcpy(a->w0, state + J, (size_t)J * sizeof(double));
    for (int j = 0; coupled && j < J; j++) {
        a->w0[j] += a->push[j];
        a->v[J + j] += parabola_at(a->push + j, J, h);
        a->load[j] += a->push[J + j];
        a->load[J + j] += a->push[2 * J + j];
    }
    for (int s = 0; s < 2; s++) {
        if (s == 0)
            moved(J, st->slots[a->index + 1].response, omega, state, a->w0, a->load, a->q, a->v);
        for (int i = 0; i < m; i++)
            a->rates[s * m + i] = rate_at(a, s, i);
        for (int i = 0; i < st->system.n_contacts; i++) {
            const contact_state *contact = st->contacts + i;
            a->tangents[s * m + i] =
                law_tangent(st, &st->system.contacts[i].law, contact->branch,
                            a->run->depth[(2 * k + 1 + s) * m + i], a->rates[s * m + i],
                            contact->memory);
            rubbed(a, s, i);
        }
    }
    double size = fabs(a->f[0]) + fabs(a->f[m]) + fabs(a->f[2 * m]);
    a->lacks = a->lacks || (m == 1 && fabs(a->tangents[0].force - a->f[m]) > LACKING * size);
}

/* Derivatives of what follows a step, by what it ends with. */
typedef struct seeds {
    const double *q, *v, *depth, *rate; /* [J], [m] at its end */
    const double *force, *slope; /* [m] by its last forces and their slopes; NULL: none, and nothing
                                    it reads */
    bool keep;                          /* they are to be carried to the start of the step */
} seeds;

/* The readings in the present step: what they give to the forces of the modes (into by_load) and, as
 * [3][m], to the parabolas; the derivative by the length of the step. */
static double read_back(adjoint *a, const seeds *in, double *parabola) {
    aom_stepper *st = a->st;
    const aom_goal *goal = a->goal;
    int J = st->system.n_modes, m = st->system.n_rows;
    const double *state = a->run->states + 2 * a->step * J;
    double longer = 0.0;
    int64_t r = in->force == NULL ? 0 : a->readings;
    for (; r > 0 && goal->readings[r - 1].step == a->step; r--) {
        const aom_reading *reading = goal->readings + r - 1;
        const double *by_q = goal->weights + (r - 1) * (2 * J + m), *by_v = by_q + J;
        const double *by_force = by_v + J;
        double t = reading->at * a->h, *q = a->work, *v = q + J, *R = v + J, *D = R + 6 * J;
        aom_responses(J, st->system.omega, st->system.decay, &t, 0, R);
        to_forces(a, R, by_q, by_v);
        moved(J, R, st->system.omega, state, a->w0, a->load, q, v);
        double later = by_time(a, t, q, v, by_q, by_v) + to_push(a, t, by_v);
        for (int i = 0; i < m; i++) {
            parabola[i] += by_force[i];
            parabola[m + i] += t * by_force[i];
            parabola[2 * m + i] += 0.5 * t * t * by_force[i];
            later += by_force[i] * (a->c[m + i] + t * a->c[2 * m + i]);
        }
        if (reading->stays)
            longer += reading->at * later;
        if (!in->keep)
            continue;
        if (!reading->stays)
            a->earlier -= later;
        response_slopes(J, st->system.omega, st->system.decay, t, R, a->out->decay != NULL, D);
        to_start(a, R, D, state, a->w0, by_q, by_v);
    }
    return longer;
}

/* Derivatives [3][m] by value, slope and curvature of the parabolas, from those by modal forces and by
 * their slopes at the end of the step; the derivative by its length that the slopes have of it alone. */
static double to_parabolas(const adjoint *a, const seeds *in, double *parabola) {
    int J = a->st->system.n_modes, m = a->st->system.n_rows;
    double longer = 0.0;
    for (int i = 0; in->slope != NULL && i < m; i++) {
        parabola[m + i] += in->slope[i];
        parabola[2 * m + i] += a->h * in->slope[i];
        longer += in->slope[i] * a->c[2 * m + i];
    }
    for (int i = 0; i < m; i++)
        for (int n = 0; n < 3 && pressing(a->st->contacts[a->owner[i]].branch); n++) {
            parabola[n * m + i] -= dot(J, beta_row(a->st, i), a->by_load + n * J);
            if (a->st->system.gamma != NULL)
                parabola[n * m + i] -= dot(J, gamma_row(a->st, i), a->by_push + n * J);
        }
    return longer;
}

/* Derivatives [2][m] by the motion and the forces at h/2 and h that row k at a stage has of them, times
 * its multiplier; `anchor` [m] by where the tangential springs hang at the start. */
static void row_seeds(const adjoint *a, int k, int stage, double mu, double *depth, double *rate,
                      double *force, double *anchor) {
    const aom_stepper *st = a->st;
    int m = st->system.n_rows, c = a->owner[k];
    if (k == c) {
        depth[stage * m + k] += mu * a->tangents[stage * m + k].by_delta;
        rate[stage * m + k] += mu * a->tangents[stage * m + k].by_rate;
        return;
    }
    const aom_contact *contact = st->system.contacts + c;
    const slide *own = a->slides + stage * m + k;
    double stiffness = contact->tangential_stiffness;
    if (own->slips)
        force[stage * m + c] += mu * contact->friction * own->along;
    for (int r = 0; r < contact->n_tangential; r++) {
        int i = contact->first_tangential + r;
        double by = own->slips ? mu * own->turn[r] : i == k ? mu * stiffness : 0.0;
        depth[stage * m + i] += by;
        if (own->slips)
            force[stage * m + i] += by * a->slides[stage * m + i].held;
        if (stage == 0)
            anchor[i] -= by;
        else { /* it hangs where the force at h/2 left it */
            depth[i] -= by;
            force[i] += by / stiffness;
        }
    }
}

/* The multipliers of the laws at h/2 and h, [2][m], from the derivatives `by` [3][m] by the forces. */
static bool multipliers(adjoint *a, const double *by, double *out) {
    aom_stepper *st = a->st;
    int m = st->system.n_rows, n = 0;
    double *depth = a->by_depth, *rate = a->by_rate, *force = a->explicit_force;
    clear(out, 2 * m);
    for (int i = 0; i < m; i++)
        if (pressing(st->contacts[a->owner[i]].branch))
            a->active[n++] = i;
    clear(depth, 2 * m);
    clear(rate, 2 * m);
    clear(force, 2 * m);
    for (int y = 0; y < 2 * n; y++) { /* the law of row k at a stage, by all forces */
        int k = a->active[y / 2], c = a->owner[k], count = st->system.contacts[c].n_tangential;
        row_seeds(a, k, y % 2, 1.0, depth, rate, force, a->anchor);
        for (int x = 0; x < 2 * n; x++)
            a->matrix[x * 2 * n + y] = (x == y) - force[x % 2 * m + a->active[x / 2]];
        for (int r = 0; r < 1 + count; r++) {
            int i = r == 0 ? c : st->system.contacts[c].first_tangential + r - 1;
            for (int s = 0; s < 2; s++) {
                double d = depth[s * m + i], v = rate[s * m + i];
                depth[s * m + i] = rate[s * m + i] = force[s * m + i] = 0.0;
                for (int x = 0; x < 2 * n && (d != 0.0 || v != 0.0); x++) {
                    const influence *held = held_by(a, i, a->active[x / 2]);
                    a->matrix[x * 2 * n + y] +=
                        d * held->depth[s][1 + x % 2] + v * held->rate[s][1 + x % 2];
                }
            }
        }
        a->rest[y] = by[(1 + y % 2) * m + k];
    }
    if (!eliminate(a->matrix, a->rest, 2 * n))
        return false;
    for (int x = 0; x < 2 * n; x++)
        out[x % 2 * m + a->active[x / 2]] = a->rest[x];
    return true;
}

/* Take from the derivatives by [3][m] forces what they hold back at a stage. */
static void hold_back(const adjoint *a, int stage, int i, double depth, double rate, double *by) {
    int m = a->st->system.n_rows;
    if (depth == 0.0 && rate == 0.0)
        return;
    for (int k = 0; k < m; k++) {
        const influence *held = held_by(a, i, k);
        for (int n = 0; n < 3; n++)
            by[n * m + k] -= depth * held->depth[stage][n] + rate * held->rate[stage][n];
    }
}

/* Derivatives by friction and by the tangential stiffness, of a tangential row. */
static void keep_friction(adjoint *a, int i, const double *mu) {
    int m = a->st->system.n_rows, c = a->owner[i];
    if (i == c)
        return;
    double stiffness = a->st->system.contacts[c].tangential_stiffness;
    double *to = a->out->friction + 2 * (ptrdiff_t)c;
    for (int s = 0; s < 2; s++) {
        const slide *own = a->slides + s * m + i;
        double now = a->f[(1 + s) * m + i], before = a->f[s * m + i], by = mu[s * m + i];
        int first = a->st->system.contacts[c].first_tangential;
        for (int q = 0; q < a->st->system.contacts[c].n_tangential && own->slips; q++)
            to[1] -= by * own->turn[q] * a->f[s * m + first + q] / (stiffness * stiffness);
        if (own->slips)
            to[0] += by * larger(a->f[(1 + s) * m + c], 0.0) * own->along;
        else /* f = stiffness (way - anchor), anchor = way before - f before/stiffness */
            to[1] += by * (now - before) / stiffness;
    }
}

/* What indentation and rate of row i at a stage have of the system. */
static void row_system(adjoint *a, int i, int s, double depth, double rate) {
    int J = a->st->system.n_modes;
    double *v = a->work, *g = v + J, t = 0.5 * (1 + s) * a->h;
    for (int j = 0; a->st->system.gamma != NULL && j < J; j++) {
        v[j] = a->v[s * J + j] - parabola_at(a->push + j, J, t);
        g[j] = parabola_at(a->load + j, J, t) - slope_at(a->push + j, J, t);
    }
    to_system(a, i, depth, rate, a->q + s * J, v, a->v + s * J, g);
}

/* The share that the next break has in loads and gaps at t. */
static double share_of_next(const aom_stepper *st, double t) {
    const double *at = st->system.breaks + st->now.segment;
    return st->now.segment + 1 == st->system.n_breaks ? 0.0 : (t - at[0]) / (at[1] - at[0]);
}

/* What is kept of a step's derivatives: by the system, by the time, forces and memory at its start. */
static void keep(adjoint *a, const double *mu) {
    aom_stepper *st = a->st;
    const aom_system *system = &st->system;
    int J = system->n_modes, m = system->n_rows, K = st->now.segment;
    bool last = K + 1 == system->n_breaks;
    double span = last ? 1.0 : system->breaks[K + 1] - system->breaks[K];
    double u = share_of_next(st, a->start);
    for (int j = 0, width = load_width(system); j < width; j++) {
        const double *by = j < J ? a->by_load + j : a->by_push + j - J;
        double *to = a->out->loads + (ptrdiff_t)K * width + j, over = last ? 0.0 : by[J] / span;
        to[0] += (1.0 - u) * by[0] - over;
        if (!last)
            to[width] += u * by[0] + over;
        a->earlier += by[0] * st->work.load_rate[j];
    }
    for (int i = 0; i < m; i++) {
        double *beta = a->out->beta + (ptrdiff_t)i * J, at = 0.0, drift = 0.0;
        for (int n = 0; n < 3; n++) {
            if (a->c[n * m + i] != 0.0)
                add(J, -a->c[n * m + i], a->by_load + n * J, beta);
            if (a->c[n * m + i] != 0.0 && system->gamma != NULL)
                add(J, -a->c[n * m + i], a->by_push + n * J, a->out->gamma + (ptrdiff_t)i * J);
        }
        for (int s = 0; s < 2; s++) {
            double depth = a->by_depth[s * m + i], rate = a->by_rate[s * m + i], slope[2];
            if (depth == 0.0 && rate == 0.0)
                continue;
            row_system(a, i, s, depth, rate);
            at -= depth;
            drift -= 0.5 * (1 + s) * a->h * depth + rate;
            for (int r = 0; r < m; r++) {
                force_rates(a, r, slope);
                slope[0] -= 0.25 * a->before[r];
                a->out->residual[(ptrdiff_t)i * m + r] -=
                    depth * a->f[(1 + s) * m + r] + rate * slope[s];
            }
            if (i >= system->n_contacts)
                continue;
            law_slopes law = force_slopes(&system->contacts[i].law, st->contacts[i].branch,
                                          a->run->depth[(2 * a->step + 1 + s) * m + i],
                                          a->rates[s * m + i], st->contacts[i].memory);
            add(AOM_LAW_SLOPES, mu[s * m + i], law.params, a->laws[i].params);
            add(2, mu[s * m + i], law.memory, a->laws[i].memory);
        }
        keep_friction(a, i, mu);
        double *gap = a->out->offsets + (ptrdiff_t)K * m + i, over = last ? 0.0 : drift / span;
        gap[0] += (1.0 - u) * at - over;
        if (!last)
            gap[m] += u * at + over;
        a->earlier += at * st->work.drift[i];
    }
}

static void clear_forces(adjoint *a) {
    ptrdiff_t J = a->st->system.n_modes;
    clear(a->by_load, 3 * J);
    if (a->st->system.gamma != NULL)
        clear(a->by_push, 3 * J);
}

/* From the derivative by the rate of row i at t to those by the forces g at that time; the derivative
 * by t that it has of them alone. */
static double to_rate(adjoint *a, int i, double t, double rate) {
    int J = a->st->system.n_modes;
    const double *gamma = gamma_row(a->st, i);
    double later = 0.0;
    add(J, rate, gamma, a->by_load);
    add(J, rate * t, gamma, a->by_load + J);
    add(J, rate * 0.5 * t * t, gamma, a->by_load + 2 * J);
    for (int j = 0; j < J; j++) /* the slope of p has itself a slope */
        later += rate * gamma[j] * (slope_at(a->load + j, J, t) - a->push[2 * J + j]);
    return later;
}

/* Go back over the present step; the derivative by its length. */
static double go_back(adjoint *a, const seeds *in) {
    aom_stepper *st = a->st;
    int J = st->system.n_modes, m = st->system.n_rows;
    const double *state = a->run->states + 2 * a->step * J, h = a->h;
    double *by = a->by_force, *parabola = a->by_parabola, *mu = a->direct, slope[2];
    clear_forces(a);
    clear(parabola, 3 * m);
    clear(by, 3 * m);
    to_forces(a, st->slots[a->index].response, in->q, in->v);
    to_push(a, h, in->v);
    seeds once = *in;
    once.keep = false;
    read_back(a, &once, parabola);
    to_parabolas(a, in, parabola);
    for (int i = 0; i < m; i++) {
        double one = parabola[m + i] / h, two = 4.0 * parabola[2 * m + i] / (h * h);
        by[i] = parabola[i] - 3.0 * one + two;
        by[m + i] = 4.0 * one - 2.0 * two;
        by[2 * m + i] = two - one;
        if (in->force != NULL) {
            by[m + i] += a->goal->force[(2 * a->step + 1) * m + i];
            by[2 * m + i] += a->goal->force[(2 * a->step + 2) * m + i] + in->force[i];
        }
    }
    for (int i = 0; i < m; i++)
        hold_back(a, 1, i, in->depth[i], in->rate[i], by);
    if (!multipliers(a, by, mu))
        return NAN;
    memcpy(a->by_q + J, in->q, (size_t)J * sizeof(double));
    memcpy(a->by_v + J, in->v, (size_t)J * sizeof(double));
    clear(a->by_q, J);
    clear(a->by_v, J);
    double longer = 0.0;
    clear(a->by_depth, 2 * m);
    clear(a->by_rate, 2 * m);
    clear(a->by_slope, m);
    clear(a->anchor, m);
    for (int s = 0; s < 2; s++)
        for (int i = 0; i < m; i++)
            if (mu[s * m + i] != 0.0)
                row_seeds(a, i, s, mu[s * m + i], a->by_depth, a->by_rate, a->explicit_force,
                          a->anchor);
    clear_forces(a);
    for (int s = 0; s < 2; s++) {
        double *V = a->by_v + s * J, *W = st->system.gamma == NULL ? V : a->by_w;
        double t = 0.5 * (1 + s) * h;
        if (W != V)
            clear(W, J);
        for (int i = 0; i < m; i++) {
            double depth = a->by_depth[s * m + i], rate = a->by_rate[s * m + i];
            hold_back(a, s, i, depth, rate, by);
            depth += s == 1 ? in->depth[i] : 0.0;
            rate += s == 1 ? in->rate[i] : 0.0;
            a->by_depth[s * m + i] = depth;
            a->by_rate[s * m + i] = rate;
            to_motion(a, i, depth, rate, a->by_q + s * J, V, W);
            if (W != V)
                longer += 0.5 * (1 + s) * to_rate(a, i, t, rate);
            longer -= 0.5 * (1 + s) * depth * st->work.drift[i];
            for (int r = 0; r < m; r++) {
                force_rates(a, r, slope);
                double part = rate * st->system.residual[(ptrdiff_t)i * m + r];
                longer += part * slope[s] / h;
                if (s == 0 && with_slope(st))
                    a->by_slope[r] += 0.25 * part;
            }
        }
        if (W != V) {
            longer += 0.5 * (1 + s) * to_push(a, t, V);
            add(J, 1.0, W, V);
        }
    }
    clear(parabola, 3 * m);
    clear(a->q0, J);
    clear(a->v0, J);
    a->earlier = 0.0;
    longer += read_back(a, in, parabola);
    for (int s = 0; s < 2; s++) {
        const double *R = st->slots[a->index + 1 - s].response, *Q = a->by_q + s * J;
        const double *V = a->by_v + s * J;
        to_forces(a, R, Q, V);
        longer += 0.5 * (1 + s) *
                  by_time(a, 0.5 * (1 + s) * h, a->q + s * J, a->v + s * J, Q, V);
        if (in->keep)
            to_start(a, R, slopes_of(a, a->index + 1 - s), state, a->w0, Q, V);
    }
    longer += to_parabolas(a, in, parabola);
    for (int i = 0; i < m; i++)
        longer -= (parabola[m + i] * a->c[m + i] + 2.0 * parabola[2 * m + i] * a->c[2 * m + i]) / h;
    if (in->keep)
        keep(a, mu);
    return longer;
}

/* ---- the edges between steps */

/* A touch at once in flight: the flight before it has the length 0, which depends on all before. */
static void undo_touch(adjoint *a, const aom_exit *e, const double *state) {
    aom_stepper *st = a->st;
    const aom_system *system = &st->system;
    int J = system->n_modes, c = (int)e->contact, m = system->n_rows;
    bool coupled = system->gamma != NULL;
    edge *now = &a->now;
    const double *q = state, *v = state + J;
    acting_at(st, a->run->time[2 * (int64_t)e->step]);
    memcpy(a->load, st->work.load, (size_t)J * sizeof(double));
    clear(a->load + J, 2 * J);
    memcpy(a->w0, v, (size_t)J * sizeof(double));
    double rate = -st->work.drift[c], next = share_of_next(st, st->now.time);
    if (coupled)
        add(J, 1.0, st->work.load + J, a->w0);
    for (int j = 0; coupled && j < J; j++)
        rate += gamma_row(st, c)[j] * (a->load[j] - system->omega[j] * system->omega[j] * q[j] -
                                       2.0 * system->decay[j] * a->w0[j]);
    to_motion(a, c, 0.0, now->rate[c], now->q, now->v, now->v);
    to_system(a, c, 0.0, now->rate[c], q, v, a->w0, a->load);
    for (int j = 0; coupled && j < 2 * J; j++) { /* the loads turn the rate at once */
        double gamma = gamma_row(st, c)[j % J];
        double own = j < J ? gamma : beta_row(st, c)[j - J] - 2.0 * system->decay[j - J] * gamma;
        double *to = a->out->loads + (ptrdiff_t)st->now.segment * 2 * J + j;
        to[0] += (1.0 - next) * now->rate[c] * own;
        if (next > 0.0)
            to[2 * J] += next * now->rate[c] * own;
    }
    rate += dot(J, beta_row(st, c), a->w0);
    double nu = (by_time(a, 0.0, q, a->w0, now->q, now->v) + now->time) / rate;
    now->rate[c] = 0.0;
    now->depth[c] -= nu;
    law_slopes bound = bound_slopes(&system->contacts[c].law, AOM_APART, HIGH, e->before + 1);
    add(AOM_LAW_SLOPES, nu, bound.params, a->laws[c].params);
    add(2, nu, bound.memory, a->laws[c].memory);
    to_motion(a, c, now->depth[c], 0.0, now->q, now->v, now->v);
    to_system(a, c, now->depth[c], 0.0, q, v, a->w0, a->load);
    a->out->offsets[(ptrdiff_t)st->now.segment * m + c] -= now->depth[c];
    now->depth[c] = 0.0;
    a->out->grazing = smaller(a->out->grazing, fabs(rate) / a->fastest);
}

/* The branch and the memory of a contact before an exit. */
static void restore(aom_stepper *st, const aom_exit *e) {
    contact_state *contact = st->contacts + (int)e->contact;
    contact->branch = (int)e->before[0];
    memcpy(contact->memory, e->before + 1, 3 * sizeof(double));
}

/* The last step that a goal depends on, or -1. */
static int64_t last_step(const aom_record *run, const aom_goal *goal, int m) {
    int64_t k = run->n_nodes / 2 - 1, r = goal->n_readings;
    int64_t read = r > 0 ? goal->readings[r - 1].step : -1;
    for (; k > read && goal->time[k + 1] == 0.0; k--) {
        const double *f = goal->force + (2 * k + 1) * m;
        int i = 0;
        while (i < 2 * m && f[i] == 0.0)
            i++;
        if (i < 2 * m)
            break;
    }
    return k;
}

/* Undo the exits at the start of step k; the one that ended the step before, or NULL. */
static const aom_exit *undo_exits(adjoint *a, int64_t k) {
    aom_stepper *st = a->st;
    const aom_exit *ended = NULL;
    for (; a->exits > 0 && a->run->exits[a->exits - 1].step >= (double)k; a->exits--) {
        const aom_exit *e = a->run->exits + a->exits - 1;
        int c = (int)e->contact;
        if (!pressing((int)e->after[0]) || (int)e->before[0] == AOM_APART) {
            const aom_contact *given = st->system.contacts + c;
            a->now.force[c] = 0.0;
            for (int r = 0; r < given->n_tangential; r++)
                a->now.force[given->first_tangential + r] = 0.0;
        }
        undo_branch(&st->system.contacts[c].law, e, st->system.contacts[c].slowest, a->laws + c,
                    a->now.depth + c, a->now.rate + c);
        restore(st, e);
        if (e->kind == 2.0)
            undo_touch(a, e, a->run->states + 2 * k * st->system.n_modes);
        if (e->kind == 1.0)
            ended = e;
    }
    return ended;
}

/* The multiplier of the condition at which an exit ends the present step. */
static bool end_condition(adjoint *a, const seeds *in, const aom_exit *e) {
    int c = (int)e->contact, branch = (int)e->before[0];
    bound exit = (bound)e->bound;
    bool moves = exit == LOW || exit == HIGH;
    seeds unit = {a->no_q, a->no_q, a->no_depth, a->no_rate, NULL, NULL, false};
    double longer = go_back(a, in) + a->now.time, *one = moves ? a->no_depth : a->no_rate;
    one[c] = 1.0;
    double pace = go_back(a, &unit), nu = longer / pace;
    one[c] = 0.0;
    if (!isfinite(nu))
        return false;
    if (moves && (branch == AOM_APART || (int)e->after[0] == AOM_APART))
        a->out->grazing = smaller(a->out->grazing, fabs(pace) / a->fastest);
    *(moves ? a->now.depth + c : a->now.rate + c) -= nu;
    law_slopes at = bound_slopes(&a->st->system.contacts[c].law, branch, exit, e->before + 1);
    add(AOM_LAW_SLOPES, nu, at.params, a->laws[c].params);
    add(2, nu, at.memory, a->laws[c].memory);
    return true;
}

static bool undo_step(adjoint *a, int64_t k) {
    aom_stepper *st = a->st;
    int J = st->system.n_modes, m = st->system.n_rows;
    edge *now = &a->now;
    now->time += a->goal->time[k + 1];
    const aom_exit *ended = undo_exits(a, k + 1);
    if (a->run->time[2 * k + 2] <= a->run->time[2 * k])
        return true;
    recall(a, k, ended != NULL);
    seeds in = {now->q, now->v, now->depth, now->rate, now->force, now->slope, false};
    if (ended != NULL && !end_condition(a, &in, ended))
        return false;
    in.keep = true;
    double longer = go_back(a, &in);
    now->time = a->earlier + (a->stopped ? -longer : now->time);
    memcpy(now->q, a->q0, (size_t)J * sizeof(double));
    memcpy(now->v, a->v0, (size_t)J * sizeof(double));
    memcpy(now->force, a->by_force, (size_t)m * sizeof(double));
    memcpy(now->slope, a->by_slope, (size_t)m * sizeof(double));
    clear(now->depth, m);
    clear(now->rate, m);
    for (int i = st->system.n_contacts; i < m; i++) { /* the anchor is way - f/stiffness there */
        now->depth[i] = a->anchor[i];
        now->force[i] -= a->anchor[i] / st->system.contacts[a->owner[i]].tangential_stiffness;
    }
    while (a->readings > 0 && a->goal->readings[a->readings - 1].step == k)
        a->readings--;
    return isfinite(longer);
}

/* A contact that is closed at the start: what its law remembers, and what the force there did. */
static void undo_preload(adjoint *a, int c) {
    const aom_system *system = &a->st->system;
    const aom_contact *contact = system->contacts + c;
    aom_exit begun = {.before = {AOM_APART}, .after = {AOM_FORWARD}};
    edge *now = &a->now;
    undo_branch(&contact->law, &begun, 0.0, a->laws + c, now->depth + c, now->rate + c);
    a->out->preload[c] += now->force[c] + a->goal->force[c];
    for (int i = 0; i < system->n_rows; i++) {
        ptrdiff_t at = (ptrdiff_t)i * system->n_rows + c;
        a->out->preload[c] -= now->depth[i] * system->residual[at];
        a->out->residual[at] -= now->depth[i] * contact->preload;
    }
}

/* The derivatives by the state at the start. */
static void finish(adjoint *a) {
    const aom_system *system = &a->st->system;
    int J = system->n_modes, m = system->n_rows;
    edge *now = &a->now;
    undo_exits(a, 0);
    for (int c = 0; c < system->n_contacts; c++)
        if (system->contacts[c].preload > 0.0)
            undo_preload(a, c);
    for (int i = 0; i < m; i++) { /* what the laws took from the motion at the start */
        to_motion(a, i, now->depth[i], now->rate[i], now->q, now->v, now->v);
        to_system(a, i, now->depth[i], now->rate[i], system->q, system->v, system->v, a->no_q);
        a->out->offsets[i] -= now->depth[i];
        if (i < system->n_contacts)
            add(AOM_LAW_SLOPES, 1.0, a->laws[i].params, a->out->laws + AOM_LAW_SLOPES * i);
    }
    add(J, 1.0, now->q, a->out->q);
    add(J, 1.0, now->v, a->out->v);
}

int aom_gradient(aom_stepper *st, const aom_record *run, const aom_goal *goal, aom_slopes *out,
                 void *memory, size_t bytes) {
    const aom_system *system = &st->system;
    int m = system->n_rows;
    if (memory == NULL || bytes < aom_gradient_size(st))
        return AOM_SMALL_MEMORY;
    if (system->n_stretch > 0)
        return AOM_BAD_SIZE;
    if (system->gamma != NULL && (out->gamma == NULL || out->decay == NULL))
        return AOM_BAD_MODES;
    for (int c = 0; c < system->n_contacts; c++) {
        if (system->contacts[c].law.kind == AOM_USER)
            return AOM_BAD_LAW;
        if (system->contacts[c].state != NULL)
            return AOM_BAD_CONTACT;
    }
    arena taken = {memory, 0};
    adjoint a = {.st = st, .run = run, .goal = goal, .out = out, .exits = run->n_exits,
                 .readings = goal->n_readings};
    lay_out_adjoint(&a, &taken, (size_t)system->n_modes, (size_t)m, system->gamma != NULL);
    memset(memory, 0, (size_t)((char *)a.work - (char *)memory));
    for (int k = 0; k < SLOTS; k++)
        a.span[k] = NAN;
    for (int c = 0; c < system->n_contacts; c++) {
        a.owner[c] = c;
        for (int r = 0; r < system->contacts[c].n_tangential; r++)
            a.owner[system->contacts[c].first_tangential + r] = c;
    }
    out->grazing = INFINITY;
    for (int64_t n = 0; n < run->n_exits; n++) {
        const aom_exit *e = run->exits + n;
        contact_state *contact = st->contacts + (int)e->contact;
        contact->branch = (int)e->after[0];
        memcpy(contact->memory, e->after + 1, 3 * sizeof(double));
        a.fastest = larger(a.fastest, fabs(e->speed));
    }
    int64_t last = last_step(run, goal, m);
    for (; a.exits > 0 && run->exits[a.exits - 1].step > (double)(last + 1); a.exits--)
        restore(st, run->exits + a.exits - 1);
    for (int64_t k = last; k >= 0; k--)
        if (!undo_step(&a, k) || a.lacks)
            return a.lacks ? AOM_TOO_MANY_STEPS : AOM_STUCK;
    finish(&a);
    return AOM_DONE;
}
