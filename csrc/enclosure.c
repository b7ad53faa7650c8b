/* Bounds on contact forces that hold for every mode that a reduced model leaves out.
 *
 * A reference motion under given forces, parabolas in time, is exact in the modes of the model. The
 * relative energy E of the true motion to it, and of the laws' potentials G,
 *
 *     E = 1/2 e'Me' + 1/2 eKe + sum H,    H(D) = G(delta + D) - G(delta) - g(delta) D >= 0,
 *
 * of the error e and the difference D of the indentations, obeys
 *
 *     E' <= sum R delta'+ + sum d D' + sqrt(2 E) |phi|,
 *
 * with R(D) = g(delta + D) - g(delta) - g'(delta) D >= 0 for a convex g, the forces' defect
 * d = F - g(delta), and the channels phi = sum y (d2/dt2 - s)^2 q of the residual. The terms are
 * integrated over a piece of time as upper bounds: R at the ends of all D with H <= E and
 * |D| <= kappa(P/sqrt(2 E)) sqrt(2 E), P the integral of sqrt(2 E), d D' by parts, |phi| by its cubic
 * between the ends. A bound of E in a piece is assumed, and accepted where it implies a smaller one. */
#include "internal.h"

#define RESOLVED 4.0 /* largest phase of a mode in a piece that the cubic follows */
#define TRIES 60
#define TOUCHING 16 /* pieces more where a contact opens or closes */
#define KINDS 8 /* lengths of pieces whose responses are kept */

/* A convex law: value, slope and curvature of the force, and the potential. */
typedef struct convex {
    double g, slope, bend, G;
} convex;

static double raised(double x, double n) {
    return n == 0.5 ? sqrt(x) : n == 1.0 ? x : n == 1.5 ? x * sqrt(x) : pow(x, n);
}

static convex convex_at(const aom_law *law, double x) {
    const double *p = law->params;
    if (!(x > 0.0))
        return (convex){0.0, 0.0, 0.0, 0.0};
    if (law->kind == AOM_LINEAR) {
        double k = linear_stiffness(law);
        return (convex){k * x, k, 0.0, 0.5 * k * x * x};
    }
    if (law->kind == AOM_HERTZ && p[1] > 0.0) {
        curve force = hertz(p, x);
        double s = cbrt(force.value), stretch = 2.0 / 3.0 * p[2] / s - p[1];
        double bend = 2.0 / 9.0 * p[2] / (s * s * s * s) / (stretch * stretch * stretch);
        return (convex){force.value, force.slope, bend, hertz_energy(p, x)};
    }
    double n = law->kind == AOM_HERTZ ? 1.5 : p[1], root = raised(x, n - 1.0);
    return (convex){p[0] * root * x, n * p[0] * root, n * (n - 1.0) * p[0] * root / x,
                    p[0] * root * x * x / (n + 1.0)};
}

/* Indentation beyond which the law is not convex; that at which its curvature is least. */
static double convex_end(const aom_law *law) {
    const double *p = law->params;
    return law->kind == AOM_HERTZ && p[1] > 0.0 ? (p[2] - p[1] * p[3]) * p[3] * p[3] : INFINITY;
}
static double flattest(const aom_law *law) {
    const double *p = law->params;
    if (law->kind != AOM_HERTZ || p[1] == 0.0)
        return 0.0;
    double s = p[2] / (6.0 * p[1]);
    return (p[2] - p[1] * s) * s * s;
}

/* At least the indentation of an energy: a patch makes Hertz's law stiffer. */
static double depth_of(const aom_law *law, double energy) {
    const double *p = law->params;
    if (law->kind == AOM_LINEAR)
        return sqrt(2.0 * energy / linear_stiffness(law));
    double n = law->kind == AOM_HERTZ ? 1.5 : p[1];
    return pow(energy * (n + 1.0) / p[0], 1.0 / (n + 1.0));
}

/* Largest D > 0 and D < 0 for indentations from `low` on, of H <= energy and |D| <= reach. */
static double farther(const aom_law *law, double low, double energy, double reach) {
    double most = smaller(reach, larger(-low, 0.0) + depth_of(law, energy));
    double slope = convex_at(law, low).slope;
    return slope > 0.0 ? smaller(most, sqrt(2.0 * energy / slope)) : most;
}
static double nearer(const aom_law *law, double low, double energy, double reach) {
    if (!(low > 0.0))
        return reach;
    double most = sqrt(2.0 * energy * low / convex_at(law, low).g);
    for (int i = 0; i < 3 && most < low; i++) /* g(x) - g(x - d) >= d g'(x - d) */
        most = smaller(most, sqrt(2.0 * energy / convex_at(law, low - most).slope));
    return most < low ? smaller(most, reach) : reach;
}

static double relative_energy(const aom_law *law, double delta, double change) {
    convex at = convex_at(law, delta);
    return larger(convex_at(law, delta + change).G - at.G - at.g * change, 0.0);
}

/* A contact during a piece: force, rate and curvature of the reference, its indentations. */
typedef struct piece {
    double force[2], force_rate[2], delta[2], rate[2], pull[2], jerk;
    double low, high, fastest, slowest; /* indentation and rate within */
    double defect, drift;               /* |d| at its start, and the integral of |d'| */
} piece;

static void bound_piece(const aom_law *law, double h, piece *x) {
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
    if (x->high <= 0.0)
        x->drift = 0.5 * h * (fabs(x->force_rate[0]) + fabs(x->force_rate[1]));
    if (!(x->low > 0.0))
        return;

    /* d' is a straight line but for g'' delta'^2 + g' delta'', whose range is known */
    double middle = flattest(law), most = larger(low.bend, high.bend);
    double least = smaller(low.bend, high.bend);
    if (middle > x->low && middle < x->high)
        least = convex_at(law, middle).bend;
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
static double growth(const aom_law *law, double h, const piece *x, double far, double near,
                     double energy, double *factor) {
    if (x->fastest <= 0.0 || x->high + far <= 0.0)
        return 0.0;
    double most = larger(far, near), d0 = x->delta[0], d1 = x->delta[1];
    bool rises = x->slowest >= 0.0;

    if (x->low > near) {
        convex a1 = convex_at(law, d1 - near), b0 = convex_at(law, d0 + far);
        convex a0 = convex_at(law, d0 - near), b1 = convex_at(law, d1 + far);
        double half = 0.5 * most * most, a = half * (a1.slope - a0.slope), b = half * (b1.slope - b0.slope);
        if (!rises)
            return half * h * x->fastest *
                   larger(convex_at(law, x->low - near).bend, convex_at(law, x->high + far).bend);
        if (a1.bend < b1.bend)
            return b0.bend >= a0.bend ? b : a + b;
        if (energy * (a1.slope - a0.slope) >= a * a0.slope)
            return a;
        *factor *= a1.slope / a0.slope;
        return 0.0;
    }
    if (rises) {
        double on = relative_energy(law, d1, far) - relative_energy(law, d0, far);
        double off = relative_energy(law, d1, -near) - relative_energy(law, d0, -near);
        return larger(on, 0.0) + larger(off, 0.0);
    }
    return h * x->fastest * convex_at(law, x->high + far).slope * (far + near);
}

/* kappa of a contact, for a motion that has lasted so long. */
static double reach_of(const aom_enclosure *e, int c, double lasted) {
    int i = 0;
    while (i < e->n_spans - 1 && e->spans[i] < lasted)
        i++;
    return e->spans[i] < lasted ? INFINITY : e->kappa[c * e->n_spans + i];
}

/* The motion of all modes at one time: displacements, velocities, modal forces with two rates. */
typedef struct modal_motion {
    const double *q, *v, *f0, *f1, *f2;
} modal_motion;

/* Value and rate of a channel, y (d2/dt2 - s)^2 q; of modes that a piece of length h does not
 * resolve, that of the parabola of the force alone. */
static void channel_at(const aom_enclosure *e, int k, double h, modal_motion at, double sums[2]) {
    const double *y = e->rows + k * e->n_modes, shift = e->shift[k];

    sums[0] = sums[1] = 0.0;
    for (int j = 0; j < e->n_modes; j++) {
        double x = e->omega[j] * e->omega[j], z = (x + shift) * (x + shift);
        if (y[j] == 0.0)
            continue;
        bool resolved = e->omega[j] * h < RESOLVED;
        double moved = resolved ? at.q[j] : (at.f0[j] - at.f2[j] / x) / x;
        double rate = resolved ? at.v[j] : at.f1[j] / x;
        sums[0] += y[j] * (z * moved - (x + 2.0 * shift) * at.f0[j] + at.f2[j]);
        sums[1] += y[j] * (z * rate - (x + 2.0 * shift) * at.f1[j]);
    }
}

/* Responses of all modes after one length of time. */
typedef struct responses_of {
    double length;
    const double *values; /* [6][n_modes] */
} responses_of;

size_t aom_enclosure_size(const aom_enclosure *e) {
    size_t J = (size_t)e->n_modes, m = (size_t)e->n_contacts, k = (size_t)e->n_channels;
    return sizeof(double) * (J * (6 * KINDS + 9) + k * m + 8 * k + 8 * m) + sizeof(piece) * m;
}

int aom_enclose(const aom_enclosure *e, void *memory) {
    const int J = e->n_modes, m = e->n_contacts, K = e->n_channels;
    double *q = memory, *v = q + J, *f0 = v + J, *f1 = f0 + J, *f2 = f1 + J, *amplitude = f2 + J;
    double *still = amplitude + J, *none = still + J, *spare = none + J, *store = spare + J;
    double *kink = store + 6 * KINDS * J, *channel = kink + K * m, *slope = channel + 8 * K;
    double *last_slope = slope, *bends = last_slope + m, *begin = bends + m, *reach = begin + m;
    double *far = reach + m, *near = far + m, *wide = near + m;
    piece *pieces = (piece *)(wide + 2 * m);
    responses_of kept[KINDS];
    int n_kept = 0, next = 0;
    const double *s = e->shift;
    const modal_motion now = {q, v, f0, f1, f2};

    memcpy(q, e->q, sizeof(double) * (size_t)J);
    memcpy(v, e->v, sizeof(double) * (size_t)J);
    memset(none, 0, sizeof(double) * (size_t)J);
    memset(last_slope, 0, sizeof(double) * (size_t)m);
    for (int k = 0; k < K; k++)
        for (int c = 0; c < m; c++) {
            kink[k * m + c] = 0.0;
            for (int j = 0; j < J; j++)
                kink[k * m + c] += e->rows[k * J + j] * e->beta[c * J + j];
        }

    double energy = 0.0, bound = 0.0, integral = 0.0, t = e->time[0];
    for (int c = 0; c < m; c++) {
        e->peak[2 * c] = e->peak[2 * c + 1] = e->impulse[2 * c] = e->impulse[2 * c + 1] = 0.0;
        e->lower[c] = e->upper[c] = 0.0;
        pieces[c].delta[1] = -e->gap[c];
        pieces[c].rate[1] = pieces[c].pull[1] = 0.0;
        for (int j = 0; j < J; j++) {
            pieces[c].delta[1] += e->beta[c * J + j] * q[j];
            pieces[c].rate[1] += e->beta[c * J + j] * v[j];
            pieces[c].pull[1] += e->beta[c * J + j] * (e->load[j] - e->omega[j] * e->omega[j] * q[j]);
        }
        for (int d = 0; d < m; d++)
            for (int j = 0; j < J; j++)
                pieces[c].pull[1] -= e->beta[c * J + j] * e->beta[d * J + j] * e->force[d];
    }
    e->clock[0] = t;

    for (int64_t node = 0; node + 2 < e->n_nodes + 1; node++) {
        /* the forces of this half of a step */
        const double *F = e->force + (node & ~(int64_t)1) * m;
        double half = e->time[node + 1] - e->time[node];
        int64_t count = (int64_t)ceil(half / e->longest);
        bool touching = false;
        for (int c = 0; c < m; c++) {
            double a = F[c], b = F[m + c], d = F[2 * m + c], least = smaller(a, smaller(b, d));
            touching |= least <= 0.0 && larger(a, larger(b, d)) > 0.0;
        }
        count = (count < 1 ? 1 : count) * (touching ? TOUCHING : 1);
        double h = half / (double)count;
        if (!(half > 0.0)) { /* a step without length */
            for (int c = 0; c < m; c++) {
                e->upper[(node + 1) * m + c] = e->upper[node * m + c];
                e->lower[(node + 1) * m + c] = e->lower[node * m + c];
            }
            e->clock[node + 1] = t;
            continue;
        }
        const double *response = NULL;
        for (int i = 0; i < n_kept && !response; i++)
            if (fabs(h - kept[i].length) <= 1e-9 * h) {
                h = kept[i].length;
                response = kept[i].values;
            }
        if (!response) {
            double *values = store + (size_t)(6 * J) * (size_t)next;
            aom_responses(J, e->omega, none, &h, 0, values);
            kept[next] = (responses_of){h, values};
            response = values;
            next = (next + 1) % KINDS;
            n_kept = n_kept < KINDS ? n_kept + 1 : KINDS;
        }
        const double *P = response, *S = P + 2 * J, *J0 = P + 3 * J, *J1 = P + 4 * J, *J2 = P + 5 * J;
        half = h * (double)count;

        for (int c = 0; c < m; c++) {
            double a = F[c], b = F[m + c], d = F[2 * m + c];
            bends[c] = (a - 2.0 * b + d) / (half * half);
            begin[c] = node % 2 ? (d - a) / (2.0 * half) : (4.0 * b - 3.0 * a - d) / (2.0 * half);
        }
        double jump = 0.0;
        for (int k = 0; k < K; k++) {
            double total = 0.0;
            for (int c = 0; c < m; c++)
                total += kink[k * m + c] * (begin[c] - last_slope[c]);
            jump += total * total;
        }

        for (int64_t part = 0; part < count; part++) {
            double from = h * (double)part;
            for (int c = 0; c < m; c++) {
                piece *x = pieces + c;
                double at = e->force[node * m + c];
                for (int i = 0; i < 2; i++) {
                    double u = from + (i ? h : 0.0);
                    x->force[i] = at + (begin[c] + 0.5 * bends[c] * u) * u;
                    x->force_rate[i] = begin[c] + bends[c] * u;
                }
                x->delta[0] = x->delta[1];
                x->rate[0] = x->rate[1];
                x->pull[0] = x->pull[1];
                x->jerk = x->delta[1] = x->rate[1] = x->pull[1] = 0.0;
                x->delta[1] = -e->gap[c];
            }

            /* the modes, and what rings in them beside the parabola's own motion */
            for (int j = 0; j < J; j++) {
                f0[j] = e->load[j];
                f1[j] = f2[j] = 0.0;
            }
            for (int c = 0; c < m; c++)
                for (int j = 0; j < J; j++) {
                    double b = e->beta[c * J + j];
                    f0[j] -= b * pieces[c].force[0];
                    f1[j] -= b * pieces[c].force_rate[0];
                    f2[j] -= b * bends[c];
                }
            memset(channel, 0, sizeof(double) * 6 * (size_t)K);
            for (int j = 0; j < J; j++) {
                double w = e->omega[j], x = w * w, a = 0.0, third;
                if (x > 0.0) {
                    double own = (f0[j] - f2[j] / x) / x, rate = (v[j] - f1[j] / x) / w;
                    a = sqrt((q[j] - own) * (q[j] - own) + rate * rate);
                    third = smaller(w * x * a, w * x * fabs(rate) + h * x * x * a);
                } else
                    third = larger(fabs(f1[j]), fabs(f1[j] + f2[j] * h));
                amplitude[j] = a;
                still[j] = third;
            }
            for (int k = 0; k < K; k++) {
                double *sum = channel + 6 * k;
                const double *y = e->rows + k * J;
                channel_at(e, k, h, now, sum);
                for (int j = 0; j < J; j++) {
                    double x = e->omega[j] * e->omega[j], z = (x + s[k]) * (x + s[k]);
                    double most = fabs(y[j]) * z * amplitude[j];
                    if (e->omega[j] * h < RESOLVED)
                        sum[4] += most * x * x;
                    else
                        sum[5] += most;
                }
            }
            for (int j = 0; j < J; j++) {
                double x = e->omega[j] * e->omega[j], a = q[j], b = v[j];
                q[j] = P[j] * a + S[j] * b + J0[j] * f0[j] + J1[j] * f1[j] + J2[j] * f2[j];
                v[j] = P[j] * b - x * S[j] * a + S[j] * f0[j] + J0[j] * f1[j] + J1[j] * f2[j];
                f0[j] += (f1[j] + 0.5 * f2[j] * h) * h;
                f1[j] += f2[j] * h;
            }
            for (int c = 0; c < m; c++) {
                piece *x = pieces + c;
                const double *beta = e->beta + c * J;
                for (int j = 0; j < J; j++) {
                    x->delta[1] += beta[j] * q[j];
                    x->rate[1] += beta[j] * v[j];
                    x->pull[1] += beta[j] * (f0[j] - e->omega[j] * e->omega[j] * q[j]);
                    x->jerk += fabs(beta[j]) * still[j];
                }
                bound_piece(e->laws + c, h, x);
            }
            double squares[6] = {0.0};
            for (int k = 0; k < K; k++) {
                double *sum = channel + 6 * k;
                channel_at(e, k, h, now, sum + 2);
                double cubic[6] = {sum[0], sum[0] + h / 3.0 * sum[1], sum[2] - h / 3.0 * sum[3],
                                   sum[2], sum[4], sum[5]};
                for (int i = 0; i < 6; i++)
                    squares[i] += cubic[i] * cubic[i];
            }
            double source = part ? 0.0 : sqrt(jump);
            source += h * h * h * h * h / 720.0 * sqrt(squares[4]) + h * sqrt(squares[5]);
            for (int i = 0; i < 4; i++)
                source += 0.25 * h * sqrt(squares[i]);

            /* an assumed bound of the energy that implies a smaller one */
            double assumed = larger(bound, energy), after = INFINITY, offset = 0.0;
            int tries = 0;
            for (; tries < TRIES; tries++) {
                double grown = 0.0, factor = 1.0;
                offset = 0.0;
                double root = sqrt(2.0 * assumed);
                for (int c = 0; c < m; c++) {
                    const aom_law *law = e->laws + c;
                    piece *x = pieces + c;
                    reach[c] = root > 0.0 ? root * reach_of(e, c, integral / root + h) : 0.0;
                    far[c] = farther(law, x->low, assumed, reach[c]);
                    near[c] = nearer(law, x->low, assumed, reach[c]);
                    if (x->high + far[c] > convex_end(law))
                        grown = INFINITY;
                    grown += growth(law, h, x, far[c], near[c], assumed, &factor) + x->drift * larger(far[c], near[c]);
                    offset += (x->defect + x->drift) * larger(far[c], near[c]);
                }
                root = sqrt(factor) * (sqrt(2.0 * (energy + offset + grown)) + source);
                after = 0.5 * root * root;
                if (!isfinite(after) || (tries > 0 && after <= assumed))
                    break;
                assumed = larger(bound, after) * (tries < 3 ? 1.02 : 1.5);
            }
            if (!isfinite(after) || tries == TRIES) {
                *e->reached = node;
                return AOM_STUCK;
            }
            bound = larger(bound, after) * (1.0 + 1e-14);
            energy = after - offset;
            integral += h * sqrt(2.0 * bound);
            t += h;
            for (int c = 0; c < m; c++) {
                piece *x = pieces + c;
                double top = convex_at(e->laws + c, x->high + far[c]).g;
                double inside = larger(far[c], smaller(near[c], larger(x->high, 0.0)));
                e->peak[2 * c + 1] = larger(e->peak[2 * c + 1], top);
                wide[c] = smaller(top, convex_at(e->laws + c, x->high + far[c]).slope * inside);
                e->impulse[2 * c + 1] += h * (wide[c] + x->defect + x->drift);
            }
        }
        double root = sqrt(2.0 * bound);
        e->clock[node + 1] = t;
        for (int c = 0; c < m; c++) {
            piece *x = pieces + c;
            const aom_law *law = e->laws + c;
            reach[c] = root > 0.0 ? root * reach_of(e, c, integral / root) : 0.0;
            double high = x->delta[1] + farther(law, x->delta[1], bound, reach[c]);
            double low = x->delta[1] - nearer(law, x->delta[1], bound, reach[c]);
            e->upper[(node + 1) * m + c] = convex_at(law, high).g;
            e->lower[(node + 1) * m + c] = convex_at(law, low).g;
            e->peak[2 * c] = larger(e->peak[2 * c], convex_at(law, low).g);
            e->impulse[2 * c] += half * (x->force[1] - 0.5 * x->force_rate[1] * half + bends[c] * half * half / 6.0);
            last_slope[c] = x->force_rate[1];
        }
        *e->energy = bound;
    }
    *e->reached = e->n_nodes - 1;
    return AOM_DONE;
}
