/* The course of events: flights and steps under contact, touches and releases. */
#include "internal.h"

#define GROWTH 1.2 /* of the bodies' energy, beyond what was given and the loads' work */
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
        double *rows = take(a, 8 * m * ((J + 1) / 2), sizeof(double));
        double *coupling = take(a, 4 * (m + G * G), sizeof(double));
        influence *local = take(a, m + G * G, sizeof(influence));
        if (s != NULL)
            *s = (slot){NAN, false, false, NO_LOCAL, response, rows, coupling, local};
    }
}

static void lay_out_work(workspace *w, arena *a, size_t L, size_t m, size_t p, size_t G,
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
    w->active = take(a, p, sizeof(int));
    w->unknown = take(a, p + s, sizeof(int));
    w->correction = take(a, 2 * (p + s), sizeof(double));
    w->coordinates = take(a, s, sizeof(double));
    w->polynomial = take(a, s, sizeof(double));
    w->slopes = take(a, s * s, sizeof(double));
}

/* The arrays of a stepper behind it in its memory, for so many groups; returns the bytes of all. */
static size_t lay_out(const aom_system *system, int groups, void *memory) {
    size_t J = (size_t)system->n_modes, m = (size_t)system->n_rows, p = (size_t)system->n_contacts;
    size_t G = (size_t)groups;
    arena a = {memory, 0};
    aom_stepper *st = take(&a, 1, sizeof *st), unused;
    aom_stepper *to = st == NULL ? &unused : st;
    lay_out_work(&to->work, &a, (size_t)load_width(system), m, p, G, (size_t)system->n_stretch);
    to->spans = take(&a, m, sizeof(row_span));
    to->group = take(&a, m, sizeof(int));
    to->owner = take(&a, m, sizeof(int));
    to->first = take(&a, G, sizeof(int));
    to->second = take(&a, G, sizeof(int));
    size_t changing = a.used;
    to->x = take(&a, 2 * J + 1, sizeof(double));
    to->rows = take(&a, m, sizeof(row_state));
    to->contacts = take(&a, p, sizeof(contact_state));
    to->swing = take(&a, 2 * p * J, sizeof(double));
    to->bend = take(&a, 2 * J, sizeof(double));
    to->sag = take(&a, p, sizeof(double));
    to->missed = take(&a, (LEVELS + 1) * p, sizeof(double));
    to->known = take(&a, LEVELS, sizeof(bool));
    to->changing_bytes = a.used - changing;
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

static int check(const aom_system *s, const aom_options *o) {
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

/* ---- the begin of a run */

/* Energy of the bodies. */
static double held_energy(aom_stepper *st) {
    const aom_system *s = &st->system;
    return mechanical_energy(s->n_modes, st->x, s->omega) + stretch_energy(st);
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

/* Mass that a contact seems to push if a constant force acts for a time t. */
static double mass_felt(const aom_stepper *st, int c, double t) {
    double give = st->system.residual[(ptrdiff_t)c * (st->system.n_rows + 1)];
    const double *beta = beta_row(st, c);
    for (int j = 0; j < st->system.n_modes; j++) {
        double z = 0.5 * st->system.omega[j] * t;
        double part = beta[j] * (z > 1e-4 ? t * sin(z) / z : t);
        give += 0.5 * part * part;
    }
    return give > 0.0 ? 0.5 * t * t / give : INFINITY;
}

/* A force of a contact that was met or is expected, unless its scale is known. */
static void set_scale(aom_stepper *st, int c, double force) {
    contact_state *state = st->contacts + c;
    state->force_scale = st->now.scaled ? state->force_scale : larger(state->force_scale, force);
    st->now.force_scale = larger(st->now.force_scale, state->force_scale);
}

/* The scales of a contact that begins or goes on at a speed, and how deep it goes, roughly. */
static double expect(aom_stepper *st, int c, double speed) {
    const aom_contact *contact = st->system.contacts + c;
    contact_state *state = st->contacts + c;
    double depth, force;
    law_expected(st, &contact->law, contact->mass, speed, state->memory, &depth, &force);
    state->depth_scale = larger(state->depth_scale, depth);
    if (st->now.scaled)
        return depth;
    double all = depth;
    for (int tries = 0; tries < 3; tries++) { /* with the mass that takes part while it lasts */
        double mass = smaller(mass_felt(st, c, 1.5 * depth / speed), contact->mass);
        law_expected(st, &contact->law, mass, speed, state->memory, &depth, &force);
    }
    set_scale(st, c, force);
    return all;
}

/* The contact is closed from the start, or goes on from touches before it; the rows know their
 * indentations. */
static void resume(aom_stepper *st, int c) {
    const aom_contact *contact = st->system.contacts + c;
    contact_state *state = st->contacts + c;
    const row_state *row = st->rows + c;
    if (contact->state != NULL)
        state->branch =
            resumed_branch(&contact->law, contact, row->depth, row->rate, state->memory);
    else if (contact->preload > 0.0)
        state->branch = next_branch(st, &contact->law, AOM_APART, HIGH, 0.0, 0.0, state->memory);
    if (state->branch == AOM_APART)
        return;
    st->now.level = 10;
    if (contact->state != NULL)
        expect(st, c, larger(fabs(row->rate), 1e-2 * state->speed_scale));
}

static void start_rows(aom_stepper *st) {
    const aom_system *s = &st->system;
    int J = s->n_modes, m = s->n_rows;
    memset(st->rows, 0, (size_t)m * sizeof *st->rows);
    for (int i = 0; i < m; i++) {
        row_state *row = st->rows + i;
        row->fresh = true;
        row->depth = -s->offsets[i];
        for (int j = 0; j < J; j++) {
            double beta = beta_row(st, i)[j], gamma = gamma_at(st, i, j);
            double slows = s->omega[j] * s->omega[j] * s->q[j] + 2.0 * s->decay[j] * s->v[j];
            row->depth += beta * s->q[j] + gamma * s->v[j];
            row->rate += beta * s->v[j] - gamma * slows;
        }
    }
}

static void start_contacts(aom_stepper *st, const double *highest) {
    const aom_system *s = &st->system;
    int m = s->n_rows;
    memset(st->contacts, 0, (size_t)s->n_contacts * sizeof *st->contacts);
    memset(st->owner, 0, (size_t)m * sizeof *st->owner);
    for (int c = 0; c < s->n_contacts; c++) {
        st->contacts[c].depth_scale = s->contacts[c].expected_depth;
        st->contacts[c].speed_scale = s->contacts[c].expected_speed;
        st->rows[c].force = s->contacts[c].preload;
        st->contacts[c].force_scale = highest != NULL ? highest[c] : st->options.force_scale;
        set_scale(st, c, s->contacts[c].preload);
        st->owner[c] = c;
        for (int r = 0; r < s->contacts[c].n_tangential; r++)
            st->owner[s->contacts[c].first_tangential + r] = c;
    }
    for (int i = 0; i < m; i++)
        for (int c = 0; c < s->n_contacts; c++)
            st->rows[i].depth -= s->residual[(ptrdiff_t)i * m + c] * st->rows[c].force;
    for (int c = 0; c < s->n_contacts; c++) {
        resume(st, c);
        for (int r = 0; r < s->contacts[c].n_tangential; r++)
            st->contacts[c].anchor[0][r] = st->rows[s->contacts[c].first_tangential + r].depth;
    }
}

/* Whether any number is not 0. */
static bool any(const double *x, ptrdiff_t n) {
    for (ptrdiff_t k = 0; k < n; k++)
        if (x[k] != 0.0)
            return true;
    return false;
}

/* Whether a law depends on the rate of what has no mass. */
static bool rate_of_massless(const aom_system *system) {
    for (int c = 0; c < system->n_contacts; c++) {
        const aom_law *law = &system->contacts[c].law;
        bool rated = law->kind == AOM_DAMPED || (law->kind == AOM_USER && law->user->rated);
        if (rated && system->residual[(ptrdiff_t)c * (system->n_rows + 1)] > 0.0)
            return true;
    }
    return false;
}

int start_run(aom_stepper *st, const aom_system *system, const aom_options *options,
              const double *highest) {
    if (system->n_modes != st->system.n_modes || system->n_rows != st->system.n_rows ||
        system->n_contacts != st->system.n_contacts || system->n_breaks < 1 ||
        (system->gamma == NULL) != (st->system.gamma == NULL) ||
        system->n_stretch != st->system.n_stretch)
        return AOM_BAD_SIZE;
    int status = check(system, options);
    if (status != AOM_DONE)
        return status;
    int J = system->n_modes, m = system->n_rows, L = load_width(system);
    st->system = *system;
    st->options = *options;
    st->loaded = any(system->loads, (ptrdiff_t)system->n_breaks * L);
    st->shifted = any(system->offsets, (ptrdiff_t)system->n_breaks * m);
    st->law_failed = false;
    workspace *w = &st->work;
    memset(w->load, 0, (size_t)L * sizeof *w->load);
    memset(w->load_rate, 0, (size_t)L * sizeof *w->load_rate);
    memset(w->offset, 0, (size_t)m * sizeof *w->offset);
    memset(w->drift, 0, (size_t)m * sizeof *w->drift);
    course now = {.level = 4};
    double unit = options->step > 0.0 ? options->step : 1.0;
    now.longest = unit * exp2(ceil(log2(options->duration / unit)));
    now.cap = options->duration / 16.0;
    if (options->step > 0.0)
        now.cap = smaller(now.cap, options->step);
    now.scaled = highest != NULL || options->force_scale > 0.0;
    st->now = now;
    st->rated = rate_of_massless(system);
    st->slots[SCRATCH].span = st->slots[SCRATCH + 1].span = NAN;
    memcpy(st->x, system->q, (size_t)J * sizeof *st->x);
    memcpy(st->x + J, system->v, (size_t)J * sizeof *st->x);
    st->x[2 * J] = 0.0;
    start_rows(st);
    start_contacts(st, highest);
    start_stretch(st);
    st->now.given = st->now.highest = system->stored + held_energy(st);
    return st->law_failed ? AOM_LAW_FAILED : AOM_DONE;
}

int aom_start(aom_stepper *st, const aom_system *system, const aom_options *options) {
    return start_run(st, system, options, NULL);
}

/* ---- a step is taken */

bool nothing_touches(const aom_stepper *st) {
    for (int c = 0; c < st->system.n_contacts; c++)
        if (st->contacts[c].branch != AOM_APART)
            return false;
    return true;
}

/* The mean loads over a step times the displacements: its change is their work, nearly. */
static double loads_on(const aom_stepper *st, double h) {
    double total = 0.0;
    for (int j = 0; j < st->system.n_modes; j++)
        total += (st->work.load[j] + 0.5 * h * st->work.load_rate[j]) * st->x[j];
    return total;
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

/* The modal state at the end of the step. */
static void move(aom_stepper *st, int index, double h) {
    int J = st->system.n_modes, m = st->system.n_rows;
    double *q = st->x, *v = st->x + J;
    const double *response = st->slots[index].response;
    if (st->loaded)
        st->now.worked -= loads_on(st, h);
    turn(J, st->system.omega, response, q, v);
    for (int i = 0; i < m; i++) {
        const double *f = st->work.parabola + 3 * (ptrdiff_t)i;
        if (f[0] != 0.0 || f[1] != 0.0 || f[2] != 0.0)
            push(st, response, st->spans + i, row_arm(st, i), f, q, v);
    }
    if (st->loaded) {
        const row_span all = {{0, J}, {J, J}};
        push(st, response, &all, load_arm(st, st->work.load), (double[]){-1.0, 0.0, 0.0}, q, v);
        if (st->rising)
            push(st, response, &all, load_arm(st, st->work.load_rate), (double[]){0.0, -1.0, 0.0}, q,
                 v);
        st->now.worked += loads_on(st, h);
    }
    if (st->shifted) /* the moving gaps: loads on sites without mass */
        for (int i = 0; i < m; i++) {
            const double *f = st->work.force[i].f;
            st->now.worked -= st->work.drift[i] * h / 6.0 * (f[0] + 4.0 * f[1] + f[2]);
        }
}

static void parabolas(aom_stepper *st, double h) {
    for (int i = 0; i < st->system.n_rows; i++) {
        const double *f = st->work.force[i].f;
        double *to = st->work.parabola + 3 * (ptrdiff_t)i;
        to[0] = f[0];
        to[1] = (4.0 * f[1] - 3.0 * f[0] - f[2]) / h;
        to[2] = 4.0 * (f[0] - 2.0 * f[1] + f[2]) / (h * h);
    }
}

static void write_nodes(aom_stepper *st, aom_record *out, double h) {
    int m = st->system.n_rows;
    for (int stage = 0; stage < 2; stage++) {
        int64_t n = out->n_nodes++;
        out->time[n] = st->now.time + (stage == 0 ? 0.5 * h : h);
        for (int i = 0; i < m; i++) {
            out->force[n * m + i] = st->work.force[i].f[1 + stage];
            out->depth[n * m + i] = st->work.motion[i].depth[stage];
        }
    }
}

/* Write the present state, at the start of a step, if it is one of those that are kept. */
void write_state(const aom_stepper *st, aom_record *out) {
    size_t J = (size_t)st->system.n_modes;
    if (out->states != NULL && (out->every < 2 || out->n_nodes / 2 % out->every == 0))
        memcpy(out->states + 2 * (size_t)out->n_states++ * J, st->x, 2 * J * sizeof *st->x);
}

/* Go to the end of the step and write it down. */
static void accept_step(aom_stepper *st, int index, aom_record *out) {
    course *now = &st->now;
    int J = st->system.n_modes;
    double h = now->step;
    write_state(st, out);
    parabolas(st, h);
    move(st, index, h);
    write_nodes(st, out, h);
    if (st->system.gamma != NULL)
        give(st, h);
    else if (nothing_touches(st) && st->system.n_stretch == 0) /* flight is exact */
        now->worked = mechanical_energy(J, st->x, st->system.omega) - now->given;
    now->steps++;
    now->idle = 0;
    now->smooth = true;
    now->time += h;
    now->last_step = h;
    for (int i = 0; i < st->system.n_rows; i++) {
        const nodes *force = st->work.force + i;
        const stages *motion = st->work.motion + i;
        const double *parabola = st->work.parabola + 3 * (ptrdiff_t)i;
        st->rows[i] = (row_state){force->f[2],      force->f[1],    parabola[1] + h * parabola[2],
                                  parabola[2],      motion->depth[1], motion->rate[1],
                                  false, 0.0};
    }
    scale_stretch(st);
    for (int c = 0; c < st->system.n_contacts; c++) {
        contact_state *contact = st->contacts + c;
        const aom_contact *given = st->system.contacts + c;
        contact->speed_scale = larger(contact->speed_scale, fabs(st->rows[c].rate));
        if (contact->branch == AOM_APART)
            continue;
        memcpy(contact->anchor[0], contact->anchor[2], sizeof contact->anchor[0]);
        set_scale(st, c, st->rows[c].force);
        if (given->law.kind == AOM_USER)
            user_advance(st, given->law.user, st->rows[c].depth, st->rows[c].rate,
                         contact->memory);
    }
}

/* ---- a contact goes over to its next branch */

/* The scales of a contact that begins, and the level of its first step; `active`: others touch. */
static void begin_contact(aom_stepper *st, int c, double rate, bool active) {
    course *now = &st->now;
    double speed = larger(rate, 1e-2 * st->contacts[c].speed_scale);
    now->touches++;
    double lasts = 3.0 * expect(st, c, speed) / speed, cap = lasts / 4.0, first = lasts / 64.0;
    if (st->options.step > 0.0)
        first = cap = smaller(st->options.step, cap);
    now->cap = active ? smaller(now->cap, cap) : cap;
    int level = active ? now->level : 0;
    while (level_step(st, level) > first && level < LEVELS - 8)
        level++;
    now->level = level;
}

/* The contact of the exit goes over to its next branch; `active`: others touch. */
static void enter_branch(aom_stepper *st, aom_record *out, bool active, bool at_once) {
    int c = st->exit_contact;
    const aom_contact *contact = st->system.contacts + c;
    contact_state *state = st->contacts + c;
    int before = state->branch;
    st->now.smooth = false;
    aom_exit left = {(double)st->now.steps, c, st->exit_bound, at_once ? (active ? 0 : 2) : 1, 0.0,
                     {before}, {0.0}};
    memcpy(left.before + 1, state->memory, 3 * sizeof(double));
    double rate = larger(st->rows[c].rate, contact->slowest);
    state->branch = next_branch(st, &contact->law, before, st->exit_bound, st->rows[c].depth, rate,
                                state->memory);
    if (out->exits != NULL) {
        left.speed = st->rows[c].rate;
        left.after[0] = state->branch;
        memcpy(left.after + 1, state->memory, 3 * sizeof(double));
        out->exits[out->n_exits++] = left;
    }
    for (int k = 0; k < 1 + contact->n_tangential; k++) {
        row_state *row = st->rows + (k == 0 ? c : contact->first_tangential + k - 1);
        row->fresh = true;
        row->slope = row->bend = 0.0;
        if (!pressing(state->branch))
            row->force = 0.0;
        if (before == AOM_APART && k > 0)
            state->anchor[0][k - 1] = row->depth;
    }
    if (before == AOM_APART || state->branch == AOM_APART)
        out->events[out->n_events++] = (aom_event){st->now.time, c, state->branch, rate};
    if (before == AOM_APART)
        begin_contact(st, c, rate, active);
    else if (st->system.n_stretch > 0 && nothing_touches(st))
        st->now.cap = st->options.step > 0.0 ? st->options.step : st->options.duration / 16.0;
}

/* ---- the run */

/* Whether the bodies hold more energy than they were given. */
static bool grew(aom_stepper *st) {
    course *now = &st->now;
    if (st->system.gamma != NULL) {
        now->surplus = larger(now->surplus, now->pushed - st->system.stored);
        return !(now->surplus <= (GROWTH - 1.0) * now->highest);
    }
    double given = now->given + now->worked;
    now->highest = larger(now->highest, given);
    double surplus = held_energy(st) - given;
    now->surplus = larger(now->surplus, surplus);
    return !(surplus <= (GROWTH - 1.0) * now->highest);
}

static bool full(const aom_record *out) {
    return out->n_nodes + 2 > out->max_nodes || out->n_events + 1 > out->max_events ||
           (out->states != NULL && out->n_states + 1 > out->max_states) ||
           (out->exits != NULL && out->n_exits + 1 > out->max_exits);
}

/* Write the present time and motion as the next node. */
static void write_present(const aom_stepper *st, aom_record *out) {
    int64_t n = out->n_nodes++;
    int m = st->system.n_rows;
    out->time[n] = st->now.time;
    for (int i = 0; i < m; i++) {
        out->force[n * m + i] = st->rows[i].force;
        out->depth[n * m + i] = st->rows[i].depth;
    }
}

/* The force of a row and its slope change at once: what was before is as if it had come so. */
static void bend_row(const aom_stepper *st, row_state *row, double jump, double kink) {
    row->force += jump;
    row->middle += jump - 0.5 * st->now.last_step * kink;
    row->slope += kink;
}

/* The gap of a contact begins to move otherwise: the forces of its rows have a kink, and of a law that
 * damps a jump; whether they have one. */
static bool bend_forces(aom_stepper *st, int c) {
    const aom_system *system = &st->system;
    const aom_contact *contact = system->contacts + c;
    const contact_state *state = st->contacts + c;
    row_state *row = st->rows + c, *sides = st->rows + contact->first_tangential;
    double give = system->residual[(ptrdiff_t)c * (system->n_rows + 1)], total = 0.0, turn = row->kink;
    tangent law = law_tangent(st, &contact->law, state->branch, row->depth, row->rate, state->memory);
    double jump = give > 0.0 ? 0.0 : law.by_rate * turn, old = row->force;
    double kink = law.by_delta * turn / (1.0 + law.by_delta * give);
    for (int r = 0; r < contact->n_tangential; r++)
        total += sides[r].force * sides[r].force;
    bool slides = sqrt(total) >= (1.0 - 1e-9) * contact->friction * old;
    row->rate += turn;
    bend_row(st, row, jump, kink);
    for (int r = 0; r < contact->n_tangential; r++) {
        ptrdiff_t i = contact->first_tangential + r;
        double share = slides && old > 0.0 ? sides[r].force / old : 0.0;
        double soft = system->residual[i * (system->n_rows + 1)] + 1.0 / contact->tangential_stiffness;
        bend_row(st, sides + r, share * jump, slides ? share * kink : sides[r].kink / soft);
    }
    return jump != 0.0;
}

/* A step without length, in which forces jump. */
static void write_jump(aom_stepper *st, aom_record *out) {
    write_state(st, out);
    write_present(st, out);
    write_present(st, out);
    st->now.steps++;
}

/* The next step, or event; AOM_DONE: go on. */
static int one_step(aom_stepper *st, aom_record *out) {
    course *now = &st->now;
    int segment = now->segment;
    now->left = acting_now(st);
    bool jumps = false;
    for (int c = 0; c < st->system.n_contacts && st->shifted && now->segment != segment; c++)
        if (pressing(st->contacts[c].branch))
            jumps = bend_forces(st, c) || jumps;
    if (jumps) {
        write_jump(st, out);
        return st->law_failed ? AOM_LAW_FAILED : AOM_DONE;
    }
    bool touches = !nothing_touches(st), active = touches || st->system.n_stretch > 0;
    if (!active && (!now->flying || now->segment != now->flown_segment))
        amplitudes(st);
    now->flying = !active;
    now->flown_segment = now->segment;
    st->exit_contact = touches ? -1 : touching_now(st);
    st->exit_bound = touches ? NOTHING : HIGH;
    int index = st->exit_contact >= 0 ? AT_ONCE : try_step(st);
    if (st->law_failed)
        return AOM_LAW_FAILED;
    if (index == NO_STEP)
        return AOM_STUCK;
    if (index == AT_ONCE) {
        now->idle++;
        now->retries++;
    } else
        accept_step(st, index, out);
    if (st->exit_contact >= 0) {
        bool touch = st->contacts[st->exit_contact].branch == AOM_APART;
        if (touch && now->touches >= st->options.max_contacts)
            return AOM_TOO_MANY_CONTACTS;
        enter_branch(st, out, touches, index == AT_ONCE);
    }
    if (st->law_failed)
        return AOM_LAW_FAILED;
    if (active && (st->exit_contact >= 0 || now->steps % 32 == 0) && grew(st))
        return AOM_GREW;
    return AOM_DONE;
}

int aom_integrate(aom_stepper *st, aom_record *out, double until, int64_t max_attempts) {
    course *now = &st->now;
    double duration = st->options.duration;
    int64_t before = now->steps + now->retries;
    if (out->n_nodes == 0 && out->max_nodes > 0)
        write_present(st, out);
    for (;;) {
        if (duration - now->time <= 1e-13 * duration) {
            now->time = duration;
            return AOM_DONE;
        }
        int64_t attempts = now->steps + now->retries;
        if (attempts >= st->options.max_steps)
            return AOM_TOO_MANY_STEPS;
        if (now->time >= until || attempts - before >= max_attempts)
            return AOM_PAUSED;
        if (full(out))
            return AOM_FULL;
        int status = one_step(st, out);
        if (status != AOM_DONE)
            return status;
    }
}

void aom_clear(aom_record *record) {
    record->n_nodes = record->n_states = record->n_events = record->n_exits = 0;
    record->every = 1;
}

/* ---- what is told of a run */

aom_summary aom_summarize(const aom_stepper *st) {
    const course *now = &st->now;
    return (aom_summary){now->time,   now->force_scale, now->highest,
                         now->surplus, now->worked,     now->steps,
                         now->steps + now->retries, now->touches, now->refused};
}

void aom_modal_state(const aom_stepper *st, double *state) {
    memcpy(state, st->x, 2 * (size_t)st->system.n_modes * sizeof *state);
}

size_t aom_snapshot_size(const aom_stepper *st) { return sizeof st->now + st->changing_bytes; }

void aom_save(const aom_stepper *st, void *snapshot) {
    memcpy(snapshot, &st->now, sizeof st->now);
    memcpy((char *)snapshot + sizeof st->now, st->x, st->changing_bytes);
}

void aom_restore(aom_stepper *st, const void *snapshot) {
    memcpy(&st->now, snapshot, sizeof st->now);
    memcpy(st->x, (const char *)snapshot + sizeof st->now, st->changing_bytes);
    st->slots[SCRATCH].span = st->slots[SCRATCH + 1].span = NAN;
    st->law_failed = false;
}
