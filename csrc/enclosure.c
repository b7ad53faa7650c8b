/* Bounds on contact forces that hold for every mode that a reduced model leaves out.
 *
 * A reference motion under forces that are parabolas in time is exact in the lower modes of the model.
 * The upper ones, which are modes of no structure, follow their force by a brake on the rest of their
 * motion. The relative energy E of the true motion to it, and of the laws' potentials G,
 *
 *     E = 1/2 e'Me' + 1/2 eKe + sum H,    H(D) = G(delta + D) - G(delta) - g(delta) D >= 0,
 *
 * of the error e and the difference D of the indentations, obeys
 *
 *     E' <= sum R delta'+ + sum d D' + sqrt(2 E) (|phi| + sum brake |q'|) + |psi|^2,
 *
 * with R(D) = g(delta + D) - g(delta) - g'(delta) D >= 0 for a convex g, the forces' defect
 * d = F - g(delta), and what the residual of the model drives: channels phi, and others psi, linear in
 * the motion of the modes and their forces, and brakes on the modes. The terms are integrated over a
 * piece of time as upper bounds: R at the ends of all D with D^2/y + 2 H(D) <= 2 E + x P^2, P the
 * integral of sqrt(2 E), y the compliance of all bodies at -x, d D' by parts, |phi| by its cubic
 * between the ends. A bound of E in a piece is assumed, and accepted where it implies a smaller one. */
#include "internal.h"

#define RESOLVED 4.0 /* largest phase of a mode in a piece that the cubic follows */
#define APART 1.25 /* damping ratio from which the two decays of a mode are bounded by themselves */
#define WAVY 0.8   /* below which it swings in an envelope */
#define TRIES 60
#define TOUCHING 8  /* pieces more where a contact opens, closes or turns */
#define ROUNDS 4    /* of the forces of a step */

/* A contact during a piece: force, rate and curvature of the reference, its indentations. */
typedef struct piece {
    double force[2], force_rate[2], delta[2], rate[2], pull[2], jerk;
    double low, high, fastest, slowest; /* indentation and rate within */
    double defect, drift;               /* |d| at its start, and the integral of |d'| */
} piece;

static void bound_piece(const shape *law, double h, piece *x) {
    double pull = 0.5 * h * x->jerk, eighth = h * h / 8.0;
    double up = larger(larger(-x->pull[0], -x->pull[1]) + pull, 0.0);
    double down = larger(larger(x->pull[0], x->pull[1]) + pull, 0.0);
    x->low = smaller(x->delta[0], x->delta[1]) - eighth * down;
    x->high = larger(x->delta[0], x->delta[1]) + eighth * up;
    x->fastest = larger(x->rate[0], x->rate[1]) + eighth * x->jerk;
    x->slowest = smaller(x->rate[0], x->rate[1]) - eighth * x->jerk;

    convex at[2] = {convex_at(law, x->delta[0]), convex_at(law, x->delta[1])};
    convex high = convex_at(law, x->high), low = convex_at(law, x->low);
    double speed = larger(fabs(x->fastest), fabs(x->slowest));
    x->defect = fabs(x->force[0] - at[0].g);
    x->drift = 0.5 * h * (fabs(x->force_rate[0]) + fabs(x->force_rate[1])) + high.slope * speed * h;
    if (!(x->low > law->low))
        return;

    /* d' is a straight line but for g'' delta'^2 + g' delta'', whose range is known */
    double most = larger(own_bend(low), own_bend(high)) / (high.give * high.give * high.give);
    double least = smaller(own_bend(low), own_bend(high)) / (low.give * low.give * low.give);
    double slow = x->slowest * x->fastest <= 0.0 ? 0.0 : smaller(fabs(x->fastest), fabs(x->slowest));
    double top = larger(x->pull[0], x->pull[1]) + pull, bottom = smaller(x->pull[0], x->pull[1]) - pull;
    double range = most * speed * speed - least * slow * slow;
    range += larger(low.slope * top, high.slope * top) - smaller(low.slope * bottom, high.slope * bottom);
    double sum = 0.0;
    for (int i = 0; i < 2; i++)
        sum += fabs(x->force_rate[i] - at[i].slope * x->rate[i]);
    x->drift = smaller(x->drift, h * (0.5 * sum + 0.25 * h * range));
}

/* The integral of R delta'+ over a piece; or, where R <= E g''/g', 0 and the factor on E. */
static double growth(const shape *law, double h, const piece *x, double far, double near,
                     double energy, double *factor) {
    if (x->fastest <= 0.0 || x->high + far <= law->low)
        return 0.0;
    double most = larger(far, near), d0 = x->delta[0], d1 = x->delta[1];
    bool rises = x->slowest >= 0.0;

    if (x->low - law->low > near) {
        bool falls = law->n <= 2.0;
        convex low = convex_at(law, x->low - near), high = convex_at(law, x->high + far);
        double half = 0.5 * most * most, ratio = falls ? low.give / high.give : 1.0;
        ratio *= ratio * ratio;
        if (!rises)
            return half * h * x->fastest * ratio * (falls ? low.bend : high.bend);
        double by = falls ? -near : far;
        double a = convex_at(law, d0 + by).slope, b = convex_at(law, d1 + by).slope;
        double grown = half * ratio * (b - a);
        if (!falls || energy * ratio * (b - a) >= grown * a)
            return grown;
        *factor *= pow(b / a, ratio);
        return 0.0;
    }
    if (rises) {
        double on = relative_energy(law, d1, far) - relative_energy(law, d0, far);
        double off = relative_energy(law, d1, -near) - relative_energy(law, d0, -near);
        return larger(on, 0.0) + larger(off, 0.0);
    }
    return h * x->fastest * convex_at(law, x->high + far).slope * (far + near);
}

/* A channel in a piece: value and rate at its start and at its end; bounds on the fourth derivative of
 * what is resolved, and on what is not. */
typedef struct channel {
    double value[2], rate[2], fourth, left_out;
} channel;

/* A free motion of a mode, and bounds: |q^(k)| <= size rate^k exp(-fade t). */
typedef struct part {
    double q, v, size, rate, fade;
} part;

typedef struct enclosing {
    const aom_enclosure *e;
    double *q, *v;             /* [J] of the reference motion */
    double *f0, *f1, *f2;      /* [J] modal forces with two rates */
    double *third;             /* [J] bound on q''' */
    double *seen[3];           /* [J] q, v, q'' without what a piece does not resolve */
    double *kink;              /* [k][m] of a channel, by a change of a force's rate */
    double *bend, *begin, *end; /* [m] second derivative of a force; its rate at both ends of a half */
    double *far, *near;        /* [m] largest differences of the indentation */
    channel *channels;         /* [k + l] */
    piece *pieces;             /* [m] */
    yielding *laws;            /* [m] */
    part *ringing;             /* [J][2] */
    double *response;          /* [6][J] after a piece */
    double *ahead;             /* [2][6][J] after half a step and after all of it */
    double *F, *depth;         /* [3][m] at the nodes of a step, [m] */
    double h, half;            /* length of a piece; of all those of half a step */
    int64_t count;
    double energy, bound;      /* relative energy without the defects' share; its largest bound */
    double kinetic;            /* largest kinetic energy of the reference motion */
    double integral, t;        /* of sqrt(2 E) */
} enclosing;

size_t aom_enclosure_size(const aom_enclosure *e) {
    size_t J = (size_t)e->n_modes, m = (size_t)e->n_contacts, k = (size_t)e->n_channels;
    size_t numbers = J * (18 + 9) + k * m + 9 * m;
    size_t bytes = sizeof(double) * numbers + sizeof(channel) * (k + (size_t)e->n_losses);
    return bytes + (sizeof(piece) + sizeof(yielding)) * m + sizeof(part) * 2 * J;
}

static double *taken(double **at, size_t count) {
    double *here = *at;
    memset(here, 0, sizeof(double) * count);
    *at += count;
    return here;
}

static enclosing laid_out(const aom_enclosure *e, void *memory) {
    size_t J = (size_t)e->n_modes, m = (size_t)e->n_contacts, k = (size_t)e->n_channels;
    double *at = memory;
    enclosing x = {.e = e, .t = e->time[0]};

    double **modal[] = {&x.q, &x.v, &x.f0, &x.f1, &x.f2, &x.third, x.seen, x.seen + 1, x.seen + 2};
    for (size_t i = 0; i < sizeof modal / sizeof *modal; i++)
        *modal[i] = taken(&at, J);
    x.response = taken(&at, 6 * J);
    x.ahead = taken(&at, 12 * J);
    x.F = taken(&at, 3 * m);
    x.depth = taken(&at, m);

    double **of_contacts[] = {&x.bend, &x.begin, &x.end, &x.far, &x.near};
    for (size_t i = 0; i < sizeof of_contacts / sizeof *of_contacts; i++)
        *of_contacts[i] = taken(&at, m);
    x.kink = taken(&at, k * m);

    x.channels = (channel *)at;
    x.pieces = (piece *)(x.channels + k + (size_t)e->n_losses);
    x.laws = (yielding *)(x.pieces + m);
    x.ringing = (part *)(x.laws + m);
    return x;
}

static double along(int n, const double *a, const double *b) {
    double sum = 0.0;
    for (int j = 0; j < n; j++)
        sum += a[j] * b[j];
    return sum;
}

static double acceleration(const enclosing *x, int j, double q, double v) {
    const aom_enclosure *e = x->e;
    return x->f0[j] - e->omega[j] * e->omega[j] * q - 2.0 * e->decay[j] * v;
}

/* Indentation, rate and second derivative of all contacts at an end of a piece. */
static void observe(enclosing *x, int end) {
    const aom_enclosure *e = x->e;

    for (int c = 0; c < e->n_contacts; c++) {
        const double *beta = e->beta + c * e->n_modes;
        piece *at = x->pieces + c;
        at->delta[end] = along(e->n_modes, beta, x->q) - e->gap[c];
        at->rate[end] = along(e->n_modes, beta, x->v);
        at->pull[end] = 0.0;
        for (int j = 0; j < e->n_modes; j++)
            at->pull[end] += beta[j] * acceleration(x, j, x->q[j], x->v[j]);
    }
}

static void start(enclosing *x) {
    const aom_enclosure *e = x->e;
    int J = e->n_modes, m = e->n_contacts;

    memcpy(x->v, e->v, sizeof(double) * (size_t)J);
    for (int c = 0; c < m; c++)
        x->laws[c] = first_loading(e->laws + c);
    for (int k = 0; k < e->n_channels; k++)
        for (int c = 0; c < m; c++)
            for (int j = 0; j < J; j++) {
                const double *by = e->rows + 5 * k * J + j;
                x->kink[k * m + c] += (by[4 * J] + e->lag[j] * by[3 * J]) * e->beta[c * J + j];
            }
    memset(e->upper, 0, sizeof(double) * (size_t)m);
}

/* Rate at the start and second derivative of the parabola of a force in a step h. */
static void parabola(const double *F, int m, double h, double out[2]) {
    out[0] = (4.0 * F[m] - 3.0 * F[0] - F[2 * m]) / h;
    out[1] = 4.0 * (F[0] - 2.0 * F[m] + F[2 * m]) / (h * h);
}

/* Indentations in the middle of a step h or at its end, by the responses of the modes. */
static void look_ahead(enclosing *x, double h, const double *response, double *depth) {
    const aom_enclosure *e = x->e;
    int J = e->n_modes, m = e->n_contacts;
    const double *P = response, *S = P + 2 * J, *J0 = S + J, *J1 = J0 + J, *J2 = J1 + J;

    for (int c = 0; c < m; c++)
        depth[c] = -e->gap[c];
    for (int j = 0; j < J; j++) {
        double f0 = e->load[j], f1 = 0.0, f2 = 0.0, rates[2];
        for (int c = 0; c < m; c++) {
            parabola(x->F + c, m, h, rates);
            f0 -= e->beta[c * J + j] * x->F[c];
            f1 -= e->beta[c * J + j] * rates[0];
            f2 -= e->beta[c * J + j] * rates[1];
        }
        double q = P[j] * x->q[j] + S[j] * x->v[j] + J0[j] * (f0 + e->lag[j] * f1);
        q += J1[j] * (f1 + e->lag[j] * f2) + J2[j] * f2;
        for (int c = 0; c < m; c++)
            depth[c] += e->beta[c * J + j] * q;
    }
}

/* The forces of a step by the laws, from those of the run. */
static void foresee(enclosing *x, int64_t node) {
    const aom_enclosure *e = x->e;
    int J = e->n_modes, m = e->n_contacts;
    double h = e->time[node + 2] - e->time[node];

    memcpy(x->F, x->F + 2 * m, sizeof(double) * (size_t)m);
    memcpy(x->F + m, e->force + (node + 1) * m, sizeof(double) * 2 * (size_t)m);
    for (int i = 0; i < 2; i++) {
        double t = 0.5 * h * (1 + i);
        aom_responses(J, e->omega, e->decay, &t, 0, x->ahead + 6 * J * i);
    }
    for (int k = 0; k < 2 * ROUNDS; k++) {
        const double *ahead = x->ahead + k % 2 * 6 * J;
        look_ahead(x, h, ahead, x->depth);
        for (int c = 0; c < m; c++) {
            double *F = x->F + (1 + k % 2) * m + c, give = 0.0;
            convex at = convex_at(&x->laws[c].now, x->depth[c]);
            for (int j = 0; j < J; j++)
                give += e->beta[c * J + j] * e->beta[c * J + j] * ahead[3 * J + j];
            if (may_have_yielded(x->laws + c, x->laws[c].reached) && x->F[2 * m + c] < x->F[c])
                continue; /* the run unloads */
            if (x->F[c] > 0.0 || *F > 0.0)
                *F = larger(*F + (at.g - *F) / (1.0 + at.slope * give), 0.0);
        }
    }
}

/* The pieces of half a step. */
static void divide(enclosing *x, int64_t node) {
    const aom_enclosure *e = x->e;
    int m = e->n_contacts;
    bool touching = false;

    x->half = e->time[node + 1] - e->time[node];
    for (int c = 0; c < m; c++) {
        double a = x->F[c], b = x->F[m + c], d = x->F[2 * m + c], rates[2];
        touching |= smaller(a, smaller(b, d)) <= 0.0 && larger(a, larger(b, d)) > 0.0;
        parabola(x->F + c, m, 2.0 * x->half, rates);
        x->bend[c] = rates[1];
        x->begin[c] = rates[0] + (node % 2 ? rates[1] * x->half : 0.0);
        double turn = x->bend[c] * x->half; /* in this half or beside it */
        touching |= (x->begin[c] - turn) * (x->begin[c] + 2.0 * turn) < 0.0;
    }
    int64_t count = (int64_t)ceil(x->half / e->longest);
    x->count = (count < 1 ? 1 : count) * (touching ? TOUCHING : 1);
    x->h = x->half / (double)x->count;
    aom_responses(e->n_modes, e->omega, e->decay, &x->h, 0, x->response);
}

/* Integral of the root of the channels' squares where the rates of the forces jump. */
static double jumped(const enclosing *x) {
    int m = x->e->n_contacts;
    double squares = 0.0;

    for (int k = 0; k < x->e->n_channels; k++) {
        double sum = 0.0;
        for (int c = 0; c < m; c++)
            sum += x->kink[k * m + c] * (x->begin[c] - x->end[c]);
        squares += sum * sum;
    }
    return sqrt(squares);
}

/* The forces in a piece that begins so long after the half of a step. */
static void begin_piece(enclosing *x, int64_t node, double from) {
    const aom_enclosure *e = x->e;
    int J = e->n_modes, m = e->n_contacts;

    memcpy(x->f0, e->load, sizeof(double) * (size_t)J);
    memset(x->f1, 0, sizeof(double) * (size_t)J);
    memset(x->f2, 0, sizeof(double) * (size_t)J);
    for (int c = 0; c < m; c++) {
        piece *at = x->pieces + c;
        const double *beta = e->beta + c * J;
        for (int i = 0; i < 2; i++) {
            double u = from + (i ? x->h : 0.0);
            at->force[i] = x->F[node % 2 * m + c] + (x->begin[c] + 0.5 * x->bend[c] * u) * u;
            at->force_rate[i] = x->begin[c] + x->bend[c] * u;
        }
        for (int j = 0; j < J; j++) {
            x->f0[j] -= beta[j] * at->force[0];
            x->f1[j] -= beta[j] * at->force_rate[0];
            x->f2[j] -= beta[j] * x->bend[c];
        }
    }
    for (int j = 0; j < J; j++) {
        x->f0[j] += e->lag[j] * x->f1[j];
        x->f1[j] += e->lag[j] * x->f2[j];
    }
    observe(x, 0);
}

/* q, v of the motion that a mode has of the parabola of the force alone. */
static void own_motion(const enclosing *x, int j, double own[2]) {
    double square = x->e->omega[j] * x->e->omega[j], d = x->e->decay[j];
    double bend = x->f2[j] / square;

    own[1] = (x->f1[j] - 2.0 * d * bend) / square;
    own[0] = (x->f0[j] - 2.0 * d * own[1] - bend) / square;
}

/* What rings in a mode beside that: all of it, or the two decays of a mode of much damping. */
static void split_ringing(enclosing *x, int j) {
    part *parts = x->ringing + 2 * j;
    double w = x->e->omega[j], d = x->e->decay[j], own[2];
    memset(parts, 0, 2 * sizeof *parts);
    if (w == 0.0)
        return;
    own_motion(x, j, own);
    double q = x->q[j] - own[0], v = x->v[j] - own[1];

    if (d < WAVY * w) {
        double turned = (v + d * q) / sqrt(w * w - d * d);
        parts[0] = (part){q, v, sqrt(q * q + turned * turned), w, d};
        return;
    }
    if (d < APART * w) { /* its energy does not grow */
        double size = sqrt(q * q + v * v / (w * w));
        parts[0] = (part){q, v, size, d + sqrt(d * d + w * w), 0.0};
        return;
    }
    double fast = d + sqrt(d * d - w * w), slow = w * w / fast;
    double rest = (v + fast * q) / (fast - slow), gone = -(v + slow * q) / (fast - slow);
    parts[0] = (part){rest, -slow * rest, fabs(rest), slow, slow};
    parts[1] = (part){gone, -fast * gone, fabs(gone), fast, fast};
}

static bool resolved(const enclosing *x, const part *ringing) {
    return ringing->rate * x->h < RESOLVED;
}

/* The third derivatives of the modes. */
static void bound_modes(enclosing *x) {
    const aom_enclosure *e = x->e;

    for (int j = 0; j < e->n_modes; j++) {
        const part *ringing = x->ringing + 2 * j;
        double w = e->omega[j], d = e->decay[j], third = 0.0;
        if (w == 0.0) {
            double change = larger(fabs(x->f1[j]), fabs(x->f1[j] + x->f2[j] * x->h));
            double pull = fabs(acceleration(x, j, x->q[j], x->v[j])) + x->h * change;
            third = change + 2.0 * d * pull;
        }
        for (int i = 0; i < 2; i++) {
            part at = ringing[i];
            double cube = at.size * at.rate * at.rate * at.rate;
            double now = fabs(w * w * at.v - 2.0 * d * (w * w * at.q + 2.0 * d * at.v));
            third += smaller(cube, now + x->h * cube * at.rate);
        }
        x->third[j] = third;
    }
}

/* A bound on the integral of the weighed rates of the modes over a piece. */
static double braked(const enclosing *x) {
    const aom_enclosure *e = x->e;
    double sum = 0.0, own[2];

    for (int j = 0; j < e->n_modes; j++) {
        double square = e->omega[j] * e->omega[j];
        if (e->brake[j] == 0.0 || square == 0.0)
            continue;
        own_motion(x, j, own);
        double way = x->h * larger(fabs(own[1]), fabs(own[1] + x->h * x->f2[j] / square));
        for (int i = 0; i < 2; i++) {
            part at = x->ringing[2 * j + i];
            way += at.size * at.rate * smaller(x->h, 1.0 / at.fade);
        }
        sum += e->brake[j] * way;
    }
    return sum;
}

/* Of the modes that follow their forces: the squares of their brakes, integrated from now on over what
 * rings in them, whose energy falls by 2 decay v^2; or those of the steady motion over a piece. */
static double braking(const enclosing *x, bool rings) {
    const aom_enclosure *e = x->e;
    double sum = 0.0, own[2];

    for (int j = 0; j < e->n_modes; j++) {
        double square = e->omega[j] * e->omega[j], lag = e->lag[j], d = e->decay[j];
        if (lag == 0.0)
            continue;
        own_motion(x, j, own);
        double q = x->q[j] - own[0], v = x->v[j] - own[1];
        double steady = lag * (2.0 * d / square - lag) * x->f2[j], brake = lag * square;
        sum += rings ? brake * brake * (v * v + square * q * q) / (4.0 * d) : x->h * steady * steady;
    }
    return sum;
}

/* Values and rates of the channels at one end of a piece, and what rings in the modes there. */
static void read_channels(enclosing *x, int end) {
    const aom_enclosure *e = x->e;
    int J = e->n_modes;

    for (int j = 0; j < J; j++) {
        const part *ringing = x->ringing + 2 * j;
        double q = x->q[j], v = x->v[j];
        split_ringing(x, j);
        for (int i = 0; i < 2; i++)
            if (!resolved(x, ringing + i)) {
                q -= ringing[i].q;
                v -= ringing[i].v;
            }
        x->seen[0][j] = q;
        x->seen[1][j] = v;
        x->seen[2][j] = acceleration(x, j, q, v);
    }
    for (int k = 0; k < e->n_channels + e->n_losses; k++) {
        const double *y = e->rows + 5 * k * J;
        const double *by_q = y, *by_v = y + J, *by_f = y + 2 * J;
        channel *at = x->channels + k;
        at->value[end] = at->rate[end] = 0.0;
        for (int j = 0; j < J; j++) {
            double force = by_f[j] * x->f0[j] + by_f[J + j] * x->f1[j] + by_f[2 * J + j] * x->f2[j];
            double rate = by_f[j] * x->f1[j] + by_f[J + j] * x->f2[j];
            at->value[end] += by_q[j] * x->seen[0][j] + by_v[j] * x->seen[1][j] + force;
            at->rate[end] += by_q[j] * x->seen[1][j] + by_v[j] * x->seen[2][j] + rate;
        }
    }
}

/* What the cubics between the ends of a piece leave of the channels. */
static void bound_channels(enclosing *x) {
    const aom_enclosure *e = x->e;
    int J = e->n_modes;

    for (int k = 0; k < e->n_channels + e->n_losses; k++) {
        const double *y = e->rows + 5 * k * J;
        channel *at = x->channels + k;
        at->fourth = at->left_out = 0.0;
        for (int j = 0; j < J; j++)
            for (int i = 0; i < 2; i++) {
                part each = x->ringing[2 * j + i];
                double square = each.rate * each.rate, swing = square - each.fade * each.fade;
                double fading = y[j] - y[J + j] * each.fade;
                double most = each.size * sqrt(fading * fading + y[J + j] * y[J + j] * swing);
                if (resolved(x, &each))
                    at->fourth += most * square * square;
                else /* the root of its mean square */
                    at->left_out += most * smaller(sqrt(0.5 / (each.fade * x->h)), 1.0);
            }
    }
}

static void advance(enclosing *x) {
    const aom_enclosure *e = x->e;
    int J = e->n_modes;
    const double *P = x->response, *W = P + J, *S = W + J, *J0 = S + J, *J1 = J0 + J, *J2 = J1 + J;
    double h = x->h;

    for (int j = 0; j < J; j++) {
        double q = x->q[j], v = x->v[j], f0 = x->f0[j], f1 = x->f1[j], f2 = x->f2[j];
        x->q[j] = P[j] * q + S[j] * v + J0[j] * f0 + J1[j] * f1 + J2[j] * f2;
        x->v[j] = W[j] * v - e->omega[j] * e->omega[j] * S[j] * q + S[j] * f0 + J0[j] * f1 + J1[j] * f2;
        x->f0[j] += (f1 + 0.5 * f2 * h) * h;
        x->f1[j] += f2 * h;
    }
}

/* Sums of squares of some channels: of the four coefficients of Bernstein's polynomials of their
 * cubics, whose integrals are h/4 each, and of what these leave. */
static void sum_squares(const enclosing *x, int first, int count, double squares[6]) {
    memset(squares, 0, sizeof(double) * 6);
    for (int k = first; k < first + count; k++) {
        const channel *at = x->channels + k;
        double third = x->h / 3.0;
        double terms[6] = {at->value[0], at->value[0] + third * at->rate[0],
                           at->value[1] - third * at->rate[1], at->value[1], at->fourth, at->left_out};
        for (int i = 0; i < 6; i++)
            squares[i] += terms[i] * terms[i];
    }
}

/* The integral of the channels that drive the error, over a piece. */
static double driven(const enclosing *x) {
    double h = x->h, squares[6];

    sum_squares(x, 0, x->e->n_channels, squares);
    double source = h * h * h * h * h / 720.0 * sqrt(squares[4]) + h * sqrt(squares[5]);
    for (int i = 0; i < 4; i++)
        source += 0.25 * h * sqrt(squares[i]);
    return source;
}

/* The energy that the other channels give it. */
static double fed(const enclosing *x) {
    double h = x->h, squares[6], sum = 0.0;

    sum_squares(x, x->e->n_channels, x->e->n_losses, squares);
    for (int i = 0; i < 4; i++)
        sum += 0.25 * h * squares[i];
    double rest = h * h * h * h / 384.0 * sqrt(squares[4]) + sqrt(squares[5]);
    double root = sqrt(sum) + sqrt(h) * rest;
    return root * root;
}

/* Whether a contact may have yielded, and its reference goes back. */
static bool turns(const yielding *law, const piece *at, double far) {
    double depth = larger(law->reached, whole_of(&law->loading, at->high + 2.0 * far));
    return at->slowest < 0.0 && may_have_yielded(law, depth);
}

/* Indentation at a force of an unloading curve. */
static double depth_at(release r, double force, double c) {
    return r.low + r.width * pow(force / r.force, 1.0 / r.n) - c * force;
}

/* Room for deeper contacts in the depths from which one unloads. */
static void make_room(yielding *law, double far) {
    const shape *first = &law->loading;
    double deepest = whole_of(first, law->deepest), least = law->least;
    double most = law->most = larger(law->reached, whole_of(first, law->deepest + far));

    double spread = compliance_spread(first, deepest, least, most);
    law->shift = most - release_at(first, most).width - release_at(first, least).low;
    law->shift += spread * (most - law->now.low);
    law->spread = spread / convex_at(&law->now, law->deepest + far).give;
}

/* The energy that is added where a contact begins to unload, from a depth that the bounds give. */
static double unload(yielding *law, piece *at, double h, double energy) {
    const shape *first = &law->loading;
    limits of_energy = {.energy = energy};
    double near = nearer(first, at->delta[0], &of_energy);

    law->deepest = at->high + h * larger(at->rate[1], 0.0);
    law->least = whole_of(first, larger(at->delta[0] - near, 0.0));
    release here = release_at(first, whole_of(first, law->deepest));
    law->now = unloads(first, here);
    make_room(law, 2.0 * farther(first, law->deepest, &of_energy));

    double force = convex_at(&law->now, at->delta[0]).g, top = here.force;
    return (top - force) * (law->deepest - depth_at(release_at(first, law->least), force, first->c));
}

/* The same where it may load again beyond that depth. */
static double reload(yielding *law, const piece *at) {
    double force = convex_at(&law->now, at->delta[0]).g, top = convex_at(&law->loading, law->deepest).g;
    double depth = depth_at(release_at(&law->loading, law->most), top, law->loading.c);
    law->now = law->loading;
    law->reached = law->most;
    law->deepest = INFINITY;
    law->spread = law->shift = 0.0;
    return (top - force) * (depth - at->delta[0]);
}

/* The laws in a piece, as their contacts load or unload; whether they are known. */
static bool bound_contacts(enclosing *x) {
    for (int c = 0; c < x->e->n_contacts; c++) {
        yielding *law = x->laws + c;
        piece *at = x->pieces + c;
        bound_piece(&law->now, x->h, at);
        if (at->high > law->deepest) {
            x->energy += reload(law, at);
            bound_piece(&law->now, x->h, at);
        }
        double energy = larger(x->bound, x->energy);
        if (turns(law, at, x->far[c])) {
            x->energy += unload(law, at, x->h, energy);
            bound_piece(&law->now, x->h, at);
        } else if (at->high + x->far[c] > law->deepest) {
            double far = farther(&law->loading, law->deepest, &(limits){.energy = energy});
            if (whole_of(&law->loading, law->deepest + 1.2 * far) > law->most)
                make_room(law, 2.0 * far);
        }
        if (!(law->spread < 0.5))
            return false;
    }
    return true;
}

/* What a contact that may have yielded adds to the energy; its share in it; whether it is known. */
static bool by_yielding(enclosing *x, int c, double assumed, double *grown, double *offset) {
    const yielding *law = x->laws + c;
    const piece *at = x->pieces + c;
    const shape *first = &law->loading;
    double far = x->far[c], near = x->near[c], forward = larger(at->fastest, 0.0);

    if (law->deepest == INFINITY) {
        double deep = larger(law->reached, whole_of(first, at->high + far)), room = 0.0;
        if (!may_have_yielded(law, deep))
            return true;
        double more = above(first, larger(at->low - near, 0.0), deep, &room);
        *grown += more * forward * x->h;
        *offset += more * room;
        return at->slowest >= 0.0;
    }
    double depth = law->deepest + farther(first, law->deepest, &(limits){.energy = assumed});
    if (at->high + far > law->deepest && whole_of(first, depth) > law->most)
        return false;
    double force = convex_at(&law->now, at->high).g;
    double more = convex_at(&law->now, at->high + far).g - force;
    double gap = larger(more, force - convex_at(&law->now, at->high - near).g);
    double speed = larger(forward, -at->slowest);
    *grown += law->spread * gap * x->h * (speed + 2.0 * forward);
    return true;
}

/* At least the force at an indentation, and the slope. */
static convex most_at(const yielding *law, double x, double energy) {
    convex at = convex_at(&law->now, x);
    if (x > law->deepest) {
        limits of_energy = {.energy = energy};
        double depth = law->deepest + farther(&law->loading, law->deepest, &of_energy);
        at.g = smaller(at.g, convex_at(&law->loading, depth).g);
    }
    return at;
}

/* What bounds the difference of a contact's indentations, by an energy and the integral P. */
static limits limits_of(const enclosing *x, int c, double energy, double integral) {
    const aom_enclosure *e = x->e;
    const yielding *law = x->laws + c;
    double tight = 1.0 - law->spread;
    return (limits){energy / tight, integral / sqrt(tight), law->shift,
                    e->n_rates, e->rates, e->compliances + c * e->n_rates};
}

/* The energy at the end of a piece, and the defects' share in it, if it is at most `assumed`. */
static double implied(enclosing *x, double assumed, double source, double given, double *offset) {
    const aom_enclosure *e = x->e;
    double root = sqrt(2.0 * assumed), grown = given, factor = 1.0;

    *offset = 0.0;
    for (int c = 0; c < e->n_contacts; c++) {
        const yielding *law = x->laws + c;
        const piece *at = x->pieces + c;
        double loose = (1.0 + law->spread) / (1.0 - law->spread);
        limits l = limits_of(x, c, assumed, x->integral + x->h * root);
        double far = x->far[c] = farther(&law->now, at->low, &l);
        double near = x->near[c] = nearer(&law->now, at->low, &l);
        double most = larger(far, near) + law->shift, own = 1.0;
        if (!by_yielding(x, c, assumed, &grown, offset))
            return INFINITY;
        if (most_at(law, at->high + far, assumed).g > law->limit)
            return INFINITY;
        grown += loose * growth(&law->now, x->h, at, far, near, l.energy, &own) + at->drift * most;
        factor *= pow(own, loose);
        *offset += (at->defect + at->drift) * most;
    }
    root = sqrt(factor) * (sqrt(2.0 * (x->energy + *offset + grown)) + source);
    return 0.5 * root * root;
}

/* Whether a bound of the energy in a piece was found: one that implies a smaller one. */
static bool bound_energy(enclosing *x, double source, double given) {
    double assumed = larger(x->bound, x->energy);

    for (int tries = 0; tries < TRIES; tries++) {
        double offset, after = implied(x, assumed, source, given, &offset);
        if (!isfinite(after))
            return false;
        if (tries > 0 && after <= assumed) {
            x->bound = larger(x->bound, after) * (1.0 + 1e-14);
            x->energy = after - offset;
            x->integral += x->h * sqrt(2.0 * x->bound);
            x->t += x->h;
            return true;
        }
        assumed = larger(x->bound, after) * (tries < 3 ? 1.02 : 1.5);
    }
    return false;
}

/* Whether the bounds continue over a piece. */
static bool over_piece(enclosing *x, double jump) {
    const aom_enclosure *e = x->e;

    read_channels(x, 0);
    bound_modes(x);
    bound_channels(x);
    double source = jump + braked(x), ringing = braking(x, true), steady = braking(x, false);
    advance(x);
    ringing = larger(ringing - braking(x, true), 0.0);
    source += sqrt(x->h) * (sqrt(ringing) + sqrt(steady)); /* by Cauchy and Schwarz */
    observe(x, 1);
    read_channels(x, 1);

    for (int c = 0; c < e->n_contacts; c++) {
        piece *at = x->pieces + c;
        at->jerk = 0.0;
        for (int j = 0; j < e->n_modes; j++)
            at->jerk += fabs(e->beta[c * e->n_modes + j]) * x->third[j];
    }
    return bound_contacts(x) && bound_energy(x, source + driven(x), fed(x));
}

/* The largest force and error of the impulse in a piece. */
static void record_piece(const enclosing *x) {
    const aom_enclosure *e = x->e;

    for (int c = 0; c < e->n_contacts; c++) {
        yielding *law = x->laws + c;
        const piece *at = x->pieces + c;
        double low = at->low - x->near[c], high = at->high + x->far[c];
        if (law->deepest == INFINITY)
            law->reached = larger(law->reached, whole_of(&law->loading, high));

        convex top = most_at(law, high, x->bound);
        double inside = larger(x->far[c], smaller(x->near[c], larger(at->high - law->now.low, 0.0)));
        double error = larger(smaller(top.g, top.slope * inside), below(law, low, x->bound));
        e->peak[2 * c + 1] = larger(e->peak[2 * c + 1], top.g);
        e->impulse[2 * c + 1] += x->h * (error + at->defect + at->drift);
    }
}

/* The bounds at a node, the end of half a step. */
static void record_node(enclosing *x, int64_t node) {
    const aom_enclosure *e = x->e;
    double half = x->half;

    for (int c = 0; c < e->n_contacts; c++) {
        const piece *at = x->pieces + c;
        const yielding *law = x->laws + c;
        limits l = limits_of(x, c, x->bound, x->integral);
        double delta = at->delta[1];
        double high = delta + farther(&law->now, delta, &l);
        double low = delta - nearer(&law->now, delta, &l);
        e->upper[node * e->n_contacts + c] = most_at(law, high, x->bound).g;
        double least = convex_at(&law->now, low).g, back = below(law, low, x->bound);
        e->lower[node * e->n_contacts + c] =
            back > 0.0 ? larger(convex_at(&law->now, delta).g - back, 0.0) : least;
        e->peak[2 * c] = larger(e->peak[2 * c], least);

        double mean = at->force[1] - 0.5 * at->force_rate[1] * half + x->bend[c] * half * half / 6.0;
        e->impulse[2 * c] += half * mean;
        x->end[c] = at->force_rate[1];
    }
    e->clock[node] = x->t;
    *e->reached = node;
}

/* A step without length. */
static void repeat_node(const enclosing *x, int64_t node) {
    const aom_enclosure *e = x->e;
    size_t m = (size_t)e->n_contacts, before = (size_t)(node - 1) * m;

    memcpy(e->upper + before + m, e->upper + before, sizeof(double) * m);
    memcpy(e->lower + before + m, e->lower + before, sizeof(double) * m);
    e->clock[node] = x->t;
    *e->reached = node;
}

int aom_enclose(const aom_enclosure *e, void *memory) {
    enclosing x = laid_out(e, memory);
    start(&x);
    *e->reached = 0;

    for (int64_t node = 0; node < e->n_nodes - 1; node++) {
        if (!(e->time[node + 1] > e->time[node])) {
            repeat_node(&x, node + 1);
            continue;
        }
        if (node % 2 == 0)
            foresee(&x, node);
        divide(&x, node);
        double jump = jumped(&x);
        for (int64_t i = 0; i < x.count; i++) {
            begin_piece(&x, node, x.h * (double)i);
            if (!over_piece(&x, i ? 0.0 : jump))
                return AOM_STUCK;
            record_piece(&x);
        }
        record_node(&x, node + 1);

        /* an error of the whole energy: nothing is known from here on */
        x.kinetic = larger(x.kinetic, 0.5 * along(e->n_modes, x.v, x.v));
        if (x.bound > x.kinetic)
            return AOM_STUCK;
    }
    return AOM_DONE;
}
