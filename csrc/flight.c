/* Free motion under the loads, and whether a touch can hide in it. */
#include "internal.h"

#define OVERDAMPED 1.25 /* of the frequency: a decay beyond it */
#define ROUNDING 1e-13 /* of the sum of the modes' parts: below it a speed of approach is rounding */

/* What the slopes with which the last step ended add to the rate of row i at h/2 (ready_local). */
static double slopes_before(const aom_stepper *st, int i) {
    double total = 0.0;
    for (int n = 0; n < st->n_closed; n++) {
        int r = st->work.closed[n];
        total += st->system.residual[(ptrdiff_t)i * st->system.n_rows + r] * st->rows[r].slope;
    }
    return 0.25 * total;
}

/* Indentations and rates at h/2 and h without contact forces; under contact of rows that touch. */
void free_step(aom_stepper *st, int index, double h, stages *to) {
    modes_ahead(st, index);
    for (int i = 0; i < st->system.n_rows; i++) {
        if (!st->now.flying && !is_closed(st, i))
            continue;
        seen_ahead(st, i, h, to + i);
        if (with_slope(st))
            to[i].rate[0] += slopes_before(st, i);
    }
}

/* Loads and gaps from the present time on, with their slopes; the time that they hold. The rows get
 * as `kink` by how much their rates change. */
double acting_now(aom_stepper *st) {
    const aom_system *system = &st->system;
    double t = st->now.time, end = st->options.duration;
    int k = st->now.segment, J = load_width(system), m = system->n_rows;
    while (k + 1 < system->n_breaks && system->breaks[k + 1] - t <= 1e-13 * end)
        k++;
    st->now.smooth = st->now.smooth && k == st->now.segment;
    st->now.segment = k;
    bool last = k + 1 == system->n_breaks;
    st->rising = !last;
    double since = t - system->breaks[k];
    double span = last ? INFINITY : system->breaks[k + 1] - system->breaks[k];
    if (st->shifted)
        for (int i = 0; i < m; i++) {
            const double *at = system->offsets + (ptrdiff_t)k * m + i;
            st->rows[i].kink = st->work.drift[i];
            st->work.drift[i] = last ? 0.0 : (at[m] - at[0]) / span;
            st->rows[i].kink -= st->work.drift[i];
            st->work.offset[i] = at[0] + st->work.drift[i] * since;
        }
    if (st->loaded)
        for (int j = 0; j < J; j++) {
            const double *at = system->loads + (ptrdiff_t)k * J + j;
            st->work.load_rate[j] = last ? 0.0 : (at[J] - at[0]) / span;
            st->work.load[j] = at[0] + st->work.load_rate[j] * since;
        }
    return last ? end - t : smaller(end, system->breaks[k + 1]) - t;
}

/* A part of the motion of a mode about what the loads give: the largest displacement and rate, and the
 * second derivative over the displacement; of a mode without frequency second derivatives. */
typedef struct mode_part {
    double way, rate, bend;
} mode_part;

/* The parts of the motion of mode j: of one that is damped beyond OVERDAMPED two exponentials, of
 * which the fast one has mostly died away. */
static void parts_of(const aom_stepper *st, int j, mode_part out[2]) {
    const double *loads = st->work.load + j, *slopes = st->work.load_rate + j;
    int J = st->system.n_modes, rates = st->system.gamma == NULL ? 0 : J;
    double w = st->system.omega[j], w2 = w * w, d = st->system.decay[j], twice = 2.0 * d;
    double load = loads[0], rise = slopes[0], q = st->x[j], v = st->x[J + j];
    double drive = rates ? loads[rates] : 0.0, climb = rates ? slopes[rates] : 0.0;
    out[1] = (mode_part){0.0, 0.0, 0.0};
    if (w == 0.0) {
        double left = st->now.left;
        double most = larger(fabs(load), fabs(load + rise * left)) +
                      twice * larger(fabs(drive), fabs(drive + climb * left)) + twice * fabs(v);
        double rate = twice * most + fabs(rise) + twice * fabs(climb);
        out[0] = (mode_part){most + fabs(climb), rate, 0.0};
        return;
    }
    double rest = q - (load - twice * rise / w2 + climb) / w2, moving = v - rise / w2 + drive;
    if (d > OVERDAMPED * w) {
        double root = sqrt((d - w) * (d + w)), fast = d + root, slow = w2 / fast;
        double one = fabs(moving + fast * rest) / (2.0 * root);
        double two = fabs(moving + slow * rest) / (2.0 * root);
        out[0] = (mode_part){one, slow * one, slow * slow};
        out[1] = (mode_part){two, fast * two, fast * fast};
        return;
    }
    moving /= w;
    double size = sqrt(rest * rest + moving * moving);
    out[0] = (mode_part){size, (w + twice) * size, w * (w + twice)};
}

/* How each contact sees the free motion about that which the loads give. */
void amplitudes(aom_stepper *st) {
    int J = st->system.n_modes, p = st->system.n_contacts;
    double *curved = st->missed + (ptrdiff_t)LEVELS * p;
    memset(st->known, 0, LEVELS * sizeof *st->known);
    for (int c = 0; c < p; c++)
        st->sag[c] = curved[c] = 0.0;
    for (int j = 0; j < J; j++) {
        mode_part parts[2];
        parts_of(st, j, parts);
        for (int k = 0; k < 2; k++) {
            st->bend[2 * j + k] = parts[k].bend;
            for (int c = 0; c < p; c++) {
                double seen = fabs(beta_row(st, c)[j]) * parts[k].way +
                              fabs(gamma_at(st, c, j)) * parts[k].rate;
                st->swing[((ptrdiff_t)c * J + j) * 2 + k] = seen;
                if (st->system.omega[j] > 0.0)
                    curved[c] += seen * parts[k].bend;
                else
                    st->sag[c] += seen;
            }
        }
    }
    for (int c = 0; c < p; c++)
        curved[c] += st->sag[c];
}

/* The most by which free motion rises above its chord over h at a contact. */
static double chord(aom_stepper *st, int c, int index, double h) {
    ptrdiff_t n = 2 * (ptrdiff_t)st->system.n_modes;
    double *kept = st->missed + (ptrdiff_t)index * st->system.n_contacts + c, part = h * h / 8.0;
    if (index < LEVELS && st->known[index])
        return *kept;
    const double *swing = st->swing + c * n;
    double total = st->sag[c] * part;
    for (ptrdiff_t k = 0; k < n; k++)
        total += swing[k] * smaller(2.0, st->bend[k] * part);
    if (index < LEVELS)
        *kept = total;
    return total;
}

double origin_of(const aom_stepper *st, int c) {
    return origin(&st->system.contacts[c].law, st->contacts[c].memory);
}

/* Whether the bodies approach each other at a contact, by more than the rounding of the modes: a
 * site that the motion has not reached yet moves to and fro by rounding alone. */
static bool approaches(const aom_stepper *st, int c) {
    int J = st->system.n_modes;
    const double *beta = beta_row(st, c), *v = st->x + J;
    double total = fabs(st->work.drift[c]);
    for (int j = 0; j < J; j++) {
        double w = st->system.omega[j], twice = 2.0 * st->system.decay[j];
        total += fabs(beta[j] * v[j]) +
                 fabs(gamma_at(st, c, j)) * (fabs(w * w * st->x[j]) + fabs(twice * v[j]));
    }
    return st->rows[c].rate > ROUNDING * total;
}

/* The contact that touches now, or -1. */
int touching_now(const aom_stepper *st) {
    for (int c = 0; c < st->system.n_contacts; c++) {
        double close = SHARP * st->contacts[c].depth_scale;
        if (st->rows[c].depth >= origin_of(st, c) - close && approaches(st, c))
            return c;
    }
    return -1;
}

/* Whether a step of free motion, whose end is known, holds no touch at a contact, or one at which its
 * end lies beyond.
 *
 * It holds none if the larger of its ends lies below 0 by more than a chord can miss, or while the
 * bodies recede fast enough. */
static bool certain(aom_stepper *st, int c, int index) {
    double origin = origin_of(st, c), rate = st->rows[c].rate, h = st->now.step;
    double before = smaller(st->rows[c].depth - origin, 0.0);
    double after = st->work.motion[c].depth[1] - origin;
    double most = chord(st, c, index, h), close = SHARP * st->contacts[c].depth_scale;
    double curved = st->missed[(ptrdiff_t)LEVELS * st->system.n_contacts + c];
    double fine = st->options.resolution;
    double room = h <= fine / 16.0 ? close : smaller(close - most, 0.0);
    bool keeps = fabs(rate) >= h * curved; /* the sign of its rate */
    if (larger(before, after) <= room || (keeps && rate < 0.0 && after <= 0.0))
        return true;
    return after > close && (keeps || h <= fine || most <= close);
}

/* The same of all contacts. */
bool clear_of_touches(aom_stepper *st, int index) {
    bool clear = true;
    for (int c = 0; c < st->system.n_contacts; c++)
        clear = certain(st, c, index) && clear;
    if (index < LEVELS)
        st->known[index] = true;
    return clear;
}
