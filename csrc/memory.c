/* The stepper's memory, and the checks of what it is given. */
#include "internal.h"

#define MOST_MODES 10000000
#define MOST_ROWS 10000
#define MOST_STRETCH 64

int aom_version(void) { return AOM_VERSION; }

#ifndef AOM_SOURCE_HASH
#define AOM_SOURCE_HASH ""
#endif

const char *aom_source_hash(void) { return AOM_SOURCE_HASH; }

const char *aom_status_name(int status) {
    static const char *const names[] = {
        "AOM_DONE",      "AOM_FULL",        "AOM_TOO_MANY_CONTACTS", "AOM_TOO_MANY_STEPS",
        "AOM_GREW",      "AOM_STUCK",       "AOM_PAUSED",            "AOM_LAW_FAILED",
        "AOM_BAD_SIZE",  "AOM_BAD_MODES",   "AOM_BAD_LOADS",         "AOM_BAD_LAW",
        "AOM_BAD_CONTACT", "AOM_BAD_OPTIONS", "AOM_SMALL_MEMORY"};
    int count = (int)(sizeof names / sizeof *names);
    return status >= 0 && status < count ? names[status] : "unknown";
}

aom_options aom_default_options(double duration) {
    return (aom_options){duration, 1e-3, 0.0, 0.0, duration / 1e4, 10000, 1000000, 0};
}

/* ---- memory */

static void lay_out_slots(aom_stepper *st, arena *a, size_t J, size_t m, size_t G) {
    for (int k = 0; k < SLOTS; k++) {
        slot *s = st == NULL ? NULL : st->slots + k;
        double *response = take(a, 6 * J, sizeof(double));
        double *coupling = take(a, 4 * (m + G * G), sizeof(double));
        influence *local = take(a, m + G * G, sizeof(influence));
        int *place = take(a, G, sizeof(int));
        bool *held = take(a, m, sizeof(bool));
        if (s != NULL)
            *s = (slot){NAN, response, coupling, local, place, held, 0, NO_LOCAL};
    }
}

static void lay_out_work(workspace *w, arena *a, size_t J, size_t L, size_t m, size_t p, size_t G,
                         size_t s) {
    size_t n = s > 0 && p + s > G ? p + s : G; /* rows of Newton's method */
    w->force = take(a, m, sizeof(nodes));
    w->before = take(a, m, sizeof(nodes));
    w->base = take(a, m, sizeof(stages));
    w->motion = take(a, m, sizeof(stages));
    w->pairs = take(a, m, sizeof *w->pairs);
    w->highest = take(a, p, sizeof(double));
    w->parabola = take(a, 3 * m, sizeof(double));
    w->load = take(a, L, sizeof(double));
    w->load_rate = take(a, L, sizeof(double));
    w->offset = take(a, m, sizeof(double));
    w->drift = take(a, m, sizeof(double));
    w->matrix = take(a, 4 * n * n, sizeof(double));
    w->rest = take(a, 2 * n, sizeof(double));
    w->newton = take(a, p, sizeof(newton_row));
    w->place = take(a, G, sizeof(int));
    w->sum = take(a, G, sizeof *w->sum);
    w->ahead = take(a, 4 * J, sizeof(double));
    w->kicks = take(a, 4 * J, sizeof(double));
    w->touching = take(a, G, sizeof(int));
    w->closed = take(a, m, sizeof(int));
    w->kept = take(a, G, sizeof(int));
    w->coupling = take(a, 4 * (m + G * G), sizeof(double));
    w->active = take(a, p, sizeof(int));
    w->unknown = take(a, p + s, sizeof(int));
    w->correction = take(a, 2 * (p + s), sizeof(double));
    w->coordinates = take(a, s, sizeof(double));
    w->squares = take(a, s * s, sizeof(double));
    w->polynomial = take(a, s, sizeof(double));
    w->slopes = take(a, s * s, sizeof(double));
    w->depths = take(a, 4 * s * (p + s), sizeof(double));
}

/* The arrays of a stepper behind it in its memory, for so many groups; returns the bytes of all. */
static size_t lay_out(const aom_system *system, int groups, void *memory) {
    size_t J = (size_t)system->n_modes, m = (size_t)system->n_rows, p = (size_t)system->n_contacts;
    size_t G = (size_t)groups;
    arena a = {memory, 0};
    aom_stepper *st = take(&a, 1, sizeof *st), unused;
    aom_stepper *to = st == NULL ? &unused : st;
    lay_out_work(&to->work, &a, J, (size_t)load_width(system), m, p, G, (size_t)system->n_stretch);
    to->spans = take(&a, m, sizeof(row_span));
    to->softens = take(&a, m, sizeof(bool));
    to->group = take(&a, m, sizeof(int));
    to->owner = take(&a, m, sizeof(int));
    to->first = take(&a, G, sizeof(int));
    to->second = take(&a, G, sizeof(int));
    to->x = take(&a, 2 * J + 1, sizeof(double));
    to->rows = take(&a, m, sizeof(row_state));
    to->contacts = take(&a, p, sizeof(contact_state));
    to->swing = take(&a, 2 * p * J, sizeof(double));
    to->bend = take(&a, 2 * J, sizeof(double));
    to->sag = take(&a, p, sizeof(double));
    to->missed = take(&a, (LEVELS + 1) * p, sizeof(double));
    to->known = take(&a, LEVELS, sizeof(bool));
    lay_out_slots(st, &a, J, m, G);
    return a.used;
}

static bool good_sizes(const aom_system *s) {
    return s->n_modes >= 0 && s->n_modes <= MOST_MODES && s->n_contacts >= 1 &&
           s->n_rows >= s->n_contacts && s->n_rows <= MOST_ROWS && s->n_breaks >= 1 &&
           s->n_stretch >= 0 && s->n_stretch <= MOST_STRETCH &&
           s->n_stretch <= s->n_rows - s->n_contacts && (s->n_stretch == 0 || s->gamma == NULL) &&
           (double)s->n_modes * s->n_rows < 1e8;
}

size_t aom_memory_size(const aom_system *system) {
    return good_sizes(system) ? lay_out(system, count_groups(system), NULL) : 0;
}

/* ---- checks */

/* Whether all numbers are finite and at least `least`. */
static bool all_good(const double *x, ptrdiff_t n, double least) {
    for (ptrdiff_t k = 0; k < n; k++)
        if (!(x[k] >= least && x[k] < INFINITY))
            return false;
    return true;
}

#define ANY (-1.7976931348623157e308)

static bool good_stretch(const aom_system *s) {
    ptrdiff_t n = s->n_stretch, three = n * n * n;
    return n == 0 || (all_good(s->quadratic, three, ANY) && all_good(s->cubic, three * n, ANY));
}

static bool good_modes(const aom_system *s) {
    ptrdiff_t J = s->n_modes, m = s->n_rows;
    for (ptrdiff_t i = 0; i < m; i++)
        if (!(s->residual[i * (m + 1)] >= 0.0))
            return false;
    return all_good(s->omega, J, 0.0) && all_good(s->decay, J, 0.0) &&
           all_good(s->beta, m * J, ANY) &&
           (s->gamma == NULL || all_good(s->gamma, m * J, ANY)) && all_good(s->residual, m * m, ANY) &&
           all_good(s->q, J, ANY) && all_good(s->v, J, ANY) && good_stretch(s);
}

static bool good_loads(const aom_system *s) {
    for (int k = 0; k < s->n_breaks; k++)
        if (!isfinite(s->breaks[k]) || (k == 0 ? s->breaks[0] > 0.0
                                               : !(s->breaks[k] > s->breaks[k - 1])))
            return false;
    return all_good(s->loads, (ptrdiff_t)s->n_breaks * load_width(s), ANY) &&
           all_good(s->offsets, (ptrdiff_t)s->n_breaks * s->n_rows, ANY);
}

static bool good_contact(const aom_system *s, const aom_contact *c) {
    const double least[] = {c->friction, c->slowest, c->preload};
    double smallest = c->law.kind == AOM_USER ? ANY : 0.0;
    const double above[] = {c->expected_depth, c->expected_speed, c->mass};
    if (c->state != NULL && !all_good(c->state, law_state_size(&c->law), smallest))
        return false;
    if (!all_good(least, 3, 0.0) || !(c->n_tangential >= 0 && c->n_tangential <= 2))
        return false;
    for (int k = 0; k < 3; k++)
        if (!(above[k] > 0.0) || (k < 2 && above[k] == INFINITY))
            return false;
    if (c->n_tangential == 0)
        return true;
    return c->first_tangential >= s->n_contacts &&
           c->first_tangential <= s->n_rows - s->n_stretch - c->n_tangential && c->tangential_stiffness > 0.0 &&
           c->tangential_stiffness < INFINITY;
}

int check_input(const aom_system *s, const aom_options *o) {
    if (!good_modes(s))
        return AOM_BAD_MODES;
    if (!good_loads(s))
        return AOM_BAD_LOADS;
    for (int c = 0; c < s->n_contacts; c++) {
        if (aom_law_check(&s->contacts[c].law) != AOM_DONE)
            return AOM_BAD_LAW;
        if (!good_contact(s, s->contacts + c))
            return AOM_BAD_CONTACT;
    }
    bool good = o->duration > 0.0 && o->duration < INFINITY && o->rel_tol > 0.0 &&
                o->force_scale >= 0.0 && o->force_scale < INFINITY && o->step >= 0.0 &&
                o->step < INFINITY && o->resolution >= 0.0 && o->max_contacts >= 0 &&
                o->max_steps >= 0;
    return good ? AOM_DONE : AOM_BAD_OPTIONS;
}

int aom_create(const aom_system *system, void *memory, size_t bytes, aom_stepper **made) {
    if (!good_sizes(system))
        return AOM_BAD_SIZE;
    int groups = count_groups(system);
    if (memory == NULL || bytes < lay_out(system, groups, NULL))
        return AOM_SMALL_MEMORY;
    *made = memory;
    lay_out(system, groups, memory);
    (*made)->system = *system;
    (*made)->n_groups = groups;
    find_groups(*made);
    find_spans(*made);
    for (int level = 0; level <= LEVELS; level++)
        (*made)->halved[level] = ldexp(1.0, -level);
    return AOM_DONE;
}
