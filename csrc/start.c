/* The begin of a run: its scales, rows and contacts. */
#include "internal.h"

/* Energy of the bodies. */
double body_energy(aom_stepper *st) {
    const aom_system *s = &st->system;
    return mechanical_energy(s->n_modes, st->x, s->omega) + stretch_energy(st);
}

/* Mass that a contact seems to push if a constant force acts for a time t. */
static double effective_mass(const aom_stepper *st, int c, double t) {
    double compliance = st->system.residual[(ptrdiff_t)c * (st->system.n_rows + 1)];
    const double *beta = beta_row(st, c);
    for (int j = 0; j < st->system.n_modes; j++) {
        double z = 0.5 * st->system.omega[j] * t;
        double part = beta[j] * (z > 1e-4 ? t * sin(z) / z : t);
        compliance += 0.5 * part * part;
    }
    return compliance > 0.0 ? 0.5 * t * t / compliance : INFINITY;
}

/* A force of a contact that was met or is expected, unless its scale is known. */
void set_scale(aom_stepper *st, int c, double force) {
    contact_state *state = st->contacts + c;
    state->force_scale = st->now.scaled ? state->force_scale : larger(state->force_scale, force);
    st->now.force_scale = larger(st->now.force_scale, state->force_scale);
}

/* The scales of a contact that begins or goes on at a speed, and how deep it goes, roughly. */
double expect_contact(aom_stepper *st, int c, double speed) {
    const aom_contact *contact = st->system.contacts + c;
    contact_state *state = st->contacts + c;
    double depth, force;
    law_expected(st, &contact->law, contact->mass, speed, state->memory, &depth, &force);
    state->depth_scale = larger(state->depth_scale, depth);
    if (st->now.scaled)
        return depth;
    double all = depth;
    for (int tries = 0; tries < 3; tries++) { /* with the mass that takes part while it lasts */
        double mass = smaller(effective_mass(st, c, 1.5 * depth / speed), contact->mass);
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
        expect_contact(st, c, larger(fabs(row->rate), 1e-2 * state->speed_scale));
}

static void start_rows(aom_stepper *st) {
    const aom_system *s = &st->system;
    int m = s->n_rows;
    memset(st->rows, 0, (size_t)m * sizeof *st->rows);
    modes_ahead(st, -1);
    for (int i = 0; i < m; i++) {
        row_state *row = st->rows + i;
        stages start;
        seen_ahead(st, i, 0.0, &start);
        row->fresh = true;
        row->depth = start.depth[0] - s->offsets[i];
        row->rate = start.rate[0];
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
    int status = check_input(system, options);
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
    run_state now = {.level = 4};
    double unit = options->step > 0.0 ? options->step : 1.0;
    now.longest = unit * exp2(ceil(log2(options->duration / unit)));
    now.cap = now.first_cap = options->duration / 16.0;
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
    st->now.initial_energy = st->now.highest = system->stored + body_energy(st);
    return st->law_failed ? AOM_LAW_FAILED : AOM_DONE;
}

int aom_start(aom_stepper *st, const aom_system *system, const aom_options *options) {
    return start_run(st, system, options, NULL);
}
