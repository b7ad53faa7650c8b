/* The course of events: flights and steps under contact, touches and releases. */
#include "internal.h"

#define GROWTH 1.2 /* of the bodies' energy, beyond what was given and the loads' work */

/* The mean loads over a step times the displacements: its change is their work, nearly. */
static double loads_on(const aom_stepper *st, double h) {
    double total = 0.0;
    for (int j = 0; j < st->system.n_modes; j++)
        total += (st->work.load[j] + 0.5 * h * st->work.load_rate[j]) * st->x[j];
    return total;
}

/* The modal state at the end of the step, and what the loads did. */
static void move(aom_stepper *st, int index, double h) {
    size_t J = (size_t)st->system.n_modes;
    if (st->loaded)
        st->now.load_work -= loads_on(st, h);
    force_ahead(st, index, 1);
    memcpy(st->x, st->work.ahead + J, J * sizeof *st->x);
    memcpy(st->x + J, st->work.ahead + 3 * J, J * sizeof *st->x);
    if (st->loaded)
        st->now.load_work += loads_on(st, h);
    for (int i = 0; i < st->system.n_rows && st->shifted; i++) {
        const double *f = st->work.force[i].f; /* the moving gaps: loads on sites without mass */
        st->now.load_work -= st->work.drift[i] * h / 6.0 * (f[0] + 4.0 * f[1] + f[2]);
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

/* Friction of a contact acts along its force at a node of the attempt, if it has one. */
static void aim_friction(aom_stepper *st, int c, int node) {
    const aom_contact *contact = st->system.contacts + c;
    const nodes *T = st->work.force + contact->first_tangential;
    double size = 0.0;
    for (int r = 0; r < contact->n_tangential; r++)
        size += T[r].f[node] * T[r].f[node];
    for (int r = 0; r < contact->n_tangential && size > 0.0; r++)
        st->contacts[c].direction[r] = T[r].f[node] / sqrt(size);
}

/* Go to the end of the step and write it down. */
static void accept_step(aom_stepper *st, int index, aom_record *out) {
    run_state *now = &st->now;
    int J = st->system.n_modes;
    double h = now->step;
    write_state(st, out);
    parabolas(st, h);
    move(st, index, h);
    write_nodes(st, out, h);
    if (st->system.gamma != NULL)
        add_contact_work(st, h);
    else if (nothing_touches(st) && st->system.n_stretch == 0) /* flight is exact */
        now->load_work = mechanical_energy(J, st->x, st->system.omega) - now->initial_energy;
    now->steps++;
    now->lasting++;
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
        const aom_contact *contact_data = st->system.contacts + c;
        contact->speed_scale = larger(contact->speed_scale, fabs(st->rows[c].rate));
        if (contact->branch == AOM_APART)
            continue;
        memcpy(contact->anchor[0], contact->anchor[2], sizeof contact->anchor[0]);
        aim_friction(st, c, 2);
        set_scale(st, c, st->rows[c].force);
        if (contact_data->law.kind == AOM_USER)
            user_advance(st, contact_data->law.user, st->rows[c].depth, st->rows[c].rate,
                         contact->memory);
    }
}

/* ---- a contact goes over to its next branch */

/* The scales of a contact that begins, and the level of its first step; `active`: others touch. */
static void begin_contact(aom_stepper *st, int c, double rate, bool active) {
    run_state *now = &st->now;
    double speed = larger(rate, 1e-2 * st->contacts[c].speed_scale);
    now->touches++;
    double lasts = 3.0 * expect_contact(st, c, speed) / speed, cap = lasts / 4.0, first = lasts / 64.0;
    if (st->options.step > 0.0)
        first = cap = smaller(st->options.step, cap);
    now->cap = now->first_cap = active ? smaller(now->cap, cap) : cap;
    int level = active ? now->level : 0;
    while (level_step(st, level) > first && level < LEVELS - 8)
        level++;
    now->level = level;
}

/* The force of a row and its slope change at once: what was before is as if it had come so. */
static void bend_row(const aom_stepper *st, row_state *row, double jump, double kink) {
    row->force += jump;
    row->middle += jump - 0.5 * st->now.last_step * kink;
    row->slope += kink;
}

/* Friction of the contact of the exit begins or ceases to slip; `at_once`: as the attempt began. */
static void switch_friction(aom_stepper *st, bool at_once) {
    int c = st->exit_contact;
    const aom_contact *contact = st->system.contacts + c;
    contact_state *state = st->contacts + c;
    row_state *rows = st->rows + contact->first_tangential;
    state->slips = st->exit_bound == SLIP;
    if (!state->slips)
        return; /* its slider stands still already: no kink */

    double kink = contact->friction * st->rows[c].slope;
    aim_friction(st, c, at_once ? 1 : 2);
    for (int r = 0; r < contact->n_tangential; r++)
        kink -= state->direction[r] * rows[r].slope;
    for (int r = 0; r < contact->n_tangential; r++)
        if (!rows[r].fresh)
            bend_row(st, rows + r, 0.0, state->direction[r] * kink);
    st->now.smooth = false;
}

/* What has no mass moves as if the force of row i, and its slope, had ceased. */
static void free_rows(aom_stepper *st, int i) {
    int m = st->system.n_rows;
    for (int k = 0; k < m; k++) {
        double compliance = st->system.residual[(ptrdiff_t)k * m + i];
        st->rows[k].depth += compliance * st->rows[i].force;
        st->rows[k].rate += compliance * st->rows[i].slope;
    }
}

/* The contact of the exit goes over to its next branch; `active`: others touch. */
static void enter_branch(aom_stepper *st, aom_record *out, bool active) {
    int c = st->exit_contact;
    const aom_contact *contact = st->system.contacts + c;
    contact_state *state = st->contacts + c;
    int before = state->branch;
    st->now.smooth = false;
    st->now.lasting = 0;
    double rate = larger(st->rows[c].rate, contact->slowest);
    state->branch = next_branch(st, &contact->law, before, st->exit_bound, st->rows[c].depth, rate,
                                state->memory);
    for (int k = 0; k < 1 + contact->n_tangential; k++) {
        int i = row_of_contact(contact, c, k);
        row_state *row = st->rows + i;
        if (!pressing(state->branch))
            free_rows(st, i);
        row->fresh = true;
        row->slope = row->bend = 0.0;
        if (!pressing(state->branch))
            row->force = 0.0;
        if (!pressing(before) && k > 0)
            state->anchor[0][k - 1] = row->depth;
    }
    state->slips = state->slips && pressing(before);
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
    run_state *now = &st->now;
    if (st->system.gamma != NULL) {
        now->surplus = larger(now->surplus, now->contact_work - st->system.stored);
        return !(now->surplus <= (GROWTH - 1.0) * now->highest);
    }
    double expected = now->initial_energy + now->load_work;
    now->highest = larger(now->highest, expected);
    double surplus = body_energy(st) - expected;
    now->surplus = larger(now->surplus, surplus);
    return !(surplus <= (GROWTH - 1.0) * now->highest);
}

static bool full(const aom_record *out) {
    return out->n_nodes + 2 > out->max_nodes || out->n_events + 1 > out->max_events ||
           (out->states != NULL && out->n_states + 1 > out->max_states);
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

/* The gap of a contact begins to move otherwise: the forces of its rows have a kink, and of a law that
 * damps a jump; whether they have one. */
static bool bend_forces(aom_stepper *st, int c) {
    const aom_system *system = &st->system;
    const aom_contact *contact = system->contacts + c;
    contact_state *state = st->contacts + c;
    row_state *row = st->rows + c, *sides = st->rows + contact->first_tangential;
    double compliance = system->residual[(ptrdiff_t)c * (system->n_rows + 1)], turn = row->kink;
    tangent law = law_tangent(st, &contact->law, state->branch, row->depth, row->rate, state->memory);
    double jump = compliance > 0.0 ? 0.0 : law.by_rate * turn;
    double kink = law.by_delta * turn / (1.0 + law.by_delta * compliance);
    row->rate += turn;
    bend_row(st, row, jump, kink);

    double size = 0.0, normal = larger(row->force, 0.0);
    for (int r = 0; r < contact->n_tangential; r++)
        size += sides[r].force * sides[r].force;
    size = sqrt(size);
    bool drops = jump < 0.0 && size > contact->friction * normal;
    for (int r = 0; r < contact->n_tangential && drops; r++)
        state->direction[r] = sides[r].force / size;
    state->slips = state->slips || drops; /* what stuck is beyond the cone now */

    for (int r = 0; r < contact->n_tangential; r++) {
        ptrdiff_t i = contact->first_tangential + r;
        double soft = 1.0 / contact->tangential_stiffness;
        double share = state->slips && size > 0.0 ? contact->friction * sides[r].force / size : 0.0;
        double lost = state->slips && jump != 0.0 ? sides[r].force - share * normal : 0.0;
        state->anchor[0][r] += soft * lost;
        soft += system->residual[i * (system->n_rows + 1)];
        bend_row(st, sides + r, -lost, state->slips ? share * kink : sides[r].kink / soft);
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
    run_state *now = &st->now;
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
    find_touching(st);
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
        if (st->exit_bound >= SLIP)
            switch_friction(st, index == AT_ONCE);
        else if (touch && now->touches >= st->options.max_contacts)
            return AOM_TOO_MANY_CONTACTS;
        else
            enter_branch(st, out, touches);
    }
    if (st->law_failed)
        return AOM_LAW_FAILED;
    if (active && (st->exit_contact >= 0 || now->steps % 32 == 0) && grew(st))
        return AOM_GREW;
    return AOM_DONE;
}

int aom_integrate(aom_stepper *st, aom_record *out, double until, int64_t max_attempts) {
    run_state *now = &st->now;
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
    record->n_nodes = record->n_states = record->n_events = 0;
    record->every = 1;
}

/* ---- what is told of a run */

aom_summary aom_summarize(const aom_stepper *st) {
    const run_state *now = &st->now;
    return (aom_summary){now->time,   now->force_scale, now->highest,
                         now->surplus, now->load_work,   now->steps,
                         now->steps + now->retries, now->touches, now->refused};
}
