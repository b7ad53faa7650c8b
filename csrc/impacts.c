/* What is read from the record of a contact: when it is closed, its impulses, its main impact. */
#include "internal.h"

#define ROUNDED 1e-6 /* change of a velocity, relative to it, below which it is rounding in part */

/* The first step that begins at t or later. */
static int64_t step_from(const aom_record *run, double t) {
    int64_t low = 0, high = run->n_nodes / 2 + 1;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (run->time[2 * middle] < t)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

int64_t aom_touches(const aom_record *run, int contact, int closed, aom_touch *out, int *open) {
    aom_touch now = {.start = 0.0};
    bool touches = closed;
    int64_t found = 0;
    for (int64_t k = 0; k < run->n_events; k++) {
        const aom_event *event = run->events + k;
        if ((int)event->contact != contact)
            continue;
        if ((int)event->branch != AOM_APART) {
            if (!touches)
                now = (aom_touch){.start = event->time, .speed = event->speed};
            touches = true;
            continue;
        }
        now.end = event->time;
        if (touches && now.end > now.start)
            out[found++] = now;
        touches = false;
    }
    now.end = run->time[run->n_nodes - 1];
    *open = touches && now.end > now.start;
    if (*open)
        out[found++] = now;
    for (int64_t k = 0; k < found; k++) {
        out[k].first = step_from(run, out[k].start);
        if (run->time[2 * out[k].first] > out[k].start) /* a method that knows no events */
            out[k].first--;
        out[k].last = step_from(run, out[k].end);
    }
    return found;
}

static void pulse(const double *time, const double *force, int m, int row, int64_t first,
                  int64_t last, double *area, double *peak) {
    *area = *peak = 0.0;
    for (int64_t n = 2 * first; n < 2 * last; n += 2) {
        const double *f = force + n * m + row;
        double f0 = f[0], f1 = f[m], f2 = f[2 * m], a = f1 - f0, b = f2 - f1;
        *area += (time[n + 2] - time[n]) * (f0 + 4.0 * f1 + f2) / 6.0;
        if (3.0 * a > b && 3.0 * b < a) /* it rises at first and falls at last */
            *peak = larger(*peak, f0 + (3.0 * a - b) * (3.0 * a - b) / (8.0 * (a - b)));
        else
            *peak = larger(*peak, larger(f0, f2));
    }
}

void aom_pulses(const double *time, const double *force, int m, int row, int64_t n,
                const int64_t *spans, double *out) {
    for (int64_t k = 0; k < n; k++)
        pulse(time, force, m, row, spans[2 * k], spans[2 * k + 1], out + 2 * k, out + 2 * k + 1);
}

/* The undamped rigid mode that only this contact moves, and it most; -1 without one. */
static int freest(const aom_system *s, int contact) {
    int J = s->n_modes, found = -1;
    double most = 0.0;
    for (int j = 0; j < J; j++) {
        double own = fabs(s->beta[(ptrdiff_t)contact * J + j]);
        if (s->omega[j] != 0.0 || s->decay[j] != 0.0 || !(own > most))
            continue;
        bool alone = true;
        for (int i = 0; i < s->n_rows; i++)
            alone = alone && (i == contact || s->beta[(ptrdiff_t)i * J + j] == 0.0);
        if (alone) {
            found = j;
            most = own;
        }
    }
    return found;
}

/* Speed of a contact by the rigid modes alone. */
static double rigid_speed(const aom_system *s, int contact, const double *v) {
    double total = 0.0;
    for (int j = 0; j < s->n_modes; j++)
        if (s->omega[j] == 0.0)
            total += s->beta[(ptrdiff_t)contact * s->n_modes + j] * v[j];
    return total;
}

double aom_main_impact(int64_t n, const aom_touch *touches) {
    double start = 0.0, end = 0.0, impulse = 0.0, longest = 0.0, most = -INFINITY;
    for (int64_t k = 0; k < n; k++) {
        const aom_touch *next = touches + k;
        if (k > 0 && next->start - end < end - start)
            impulse += next->impulse;
        else {
            start = next->start;
            impulse = next->impulse;
        }
        end = next->end;
        bool last = k + 1 == n || !(next[1].start - end < end - start);
        if (last && impulse > most) {
            most = impulse;
            longest = end - start;
        }
    }
    return longest;
}

aom_numbers aom_read_contact(const aom_system *s, const aom_record *run, int contact, int open,
                             int64_t n, aom_touch *touches, const double *v, ptrdiff_t stride) {
    aom_numbers found = {.restitution = NAN};
    int J = s->n_modes, rigid = s->n_breaks > 1 ? -1 : freest(s, contact);
    double closing = 0.0, parting = 0.0;
    for (int64_t k = 0; k < n; k++) {
        aom_touch *touch = touches + k;
        const double *before = v + 2 * k * J, *after = before + J;
        if (stride > 0) {
            before = v + touch->first * stride;
            after = v + touch->last * stride;
        }
        pulse(run->time, run->force, s->n_rows, contact, touch->first, touch->last, &touch->impulse,
              &touch->peak);
        found.peak = larger(found.peak, touch->peak);
        /* a force that jumps to 0 has two values at a node, of which the integral knows one */
        if (rigid >= 0) {
            double given = s->loads[rigid] * (run->time[2 * touch->last] - run->time[2 * touch->first]);
            double change = given - (after[rigid] - before[rigid]);
            double size = larger(larger(fabs(before[rigid]), fabs(after[rigid])), fabs(given));
            if (fabs(change) > ROUNDED * size)
                touch->impulse = change / s->beta[(ptrdiff_t)contact * J + rigid];
        }
        found.impulse += touch->impulse;
        found.closed += touch->end - touch->start;
        found.steps += touch->last - touch->first;
        if (k == 0)
            closing = rigid_speed(s, contact, before);
        parting = rigid_speed(s, contact, after);
    }
    if (n > 0 && !open && closing > 0.0)
        found.restitution = -parting / closing;
    found.contact_time = aom_main_impact(n, touches);
    return found;
}
